//! What stands where in the frames to a GO-M8010-6 behind a CAN-to-485 module. Values are those of
//! the output shaft.

use embedded_can::{ExtendedId, Id};
use heapless::Vec;

use super::wire::module::{Module, Request};
use super::wire::{Address, RawImpedance, RawMotion, Status};
use crate::signals::{Message, Signal};

/// What a DBC file cannot say.
pub const NOT_IN_DBC: &[&str] = &[
    "UNITREE_GO_STATE: a module's answer has the motor's temperature, status and air pressure in \
     its identifier, so its identifier changes from frame to frame; its data are those of \
     UNITREE_GO_CONTROL.",
    "UNITREE_GO_FAULT: the error (1 over-temperature, 2 over-current, 3 over-voltage, 4 encoder) \
     stands in bits 23 to 16 of the identifier, and the lowest byte is 0x80.",
    "UNITREE_GO_GAINS: bits 23 to 16 of the identifier of a module's answer to \
     UNITREE_GO_READ_GAINS are not documented; its data are those of UNITREE_GO_SET_GAINS.",
];

/// Turns of the rotor per turn of the output.
const GEAR: f64 = 6.33;

const MOTION: &[Signal] = &[
    Signal::little("Angle", 0, 4).signed().scaled(360.0 / (32768.0 * GEAR), "deg"),
    Signal::little("Speed", 4, 2).signed().scaled(60.0 / (256.0 * GEAR), "rpm"),
    Signal::little("Torque", 6, 2).signed().scaled(GEAR / 256.0, "Nm"),
];

const GAINS: &[Signal] = &[
    Signal::little("Damping", 0, 2).scaled(GEAR * GEAR / 1280.0, "Nms/rad"),
    Signal::little("Stiffness", 2, 2).scaled(GEAR * GEAR / 1280.0, "Nm/rad"),
];

/// Everything that is sent to a motor; what comes back is [not in a DBC file](NOT_IN_DBC).
#[must_use]
pub fn messages(module: Module, motor: Address) -> Vec<Message, 4> {
    let message = |name, request: Request, signals| {
        let id = ExtendedId::new(request.pack(module, motor).raw_id()).unwrap_or(ExtendedId::ZERO);
        Message { name, id: Id::Extended(id), len: 8, from_device: false, signals }
    };
    let (motion, gains) = (RawMotion::default(), RawImpedance::default());
    [
        message("UNITREE_GO_LOCK", Request::Control(Status::LOCK, motion), MOTION),
        message("UNITREE_GO_CONTROL", Request::Control(Status::FOC, motion), MOTION),
        message("UNITREE_GO_SET_GAINS", Request::SetImpedance(gains), GAINS),
        message("UNITREE_GO_READ_GAINS", Request::ReadImpedance, &[]),
    ]
    .into_iter()
    .collect()
}
