//! Layout of the frames to a GO-M8010-6 behind a module. Values are the output shaft's.

use heapless::Vec;
use rc10_can::IdPattern;

use super::config::ModuleConfig;
use super::wire::module::{FROM_MODULE, IMPEDANCE, NO_TEMPERATURE, Request, STATE};
use super::wire::{ERRORS, RawImpedance, RawMotion, Status};
use crate::signals::{Message, Signal};

/// Content of the frames that a DBC file cannot describe.
pub const NOT_IN_DBC: &[&str] = &[
    "UNITREE_GO_STATE: a module's reply has the motor's temperature, status and air pressure in \
     its identifier, so its identifier changes from frame to frame; its data are those of \
     UNITREE_GO_CONTROL.",
    "UNITREE_GO_FAULT: the error (1 over-temperature, 2 over-current, 3 over-voltage, 4 encoder) \
     stands in bits 23 to 16 of the identifier, and the lowest byte is 0x80.",
    "UNITREE_GO_GAINS: bits 23 to 16 of the identifier of a module's reply to \
     UNITREE_GO_READ_GAINS are not documented; its data are those of UNITREE_GO_SET_GAINS.",
];

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

/// Frames to a motor, then its replies ([not in a DBC file](NOT_IN_DBC)); empty if it is invalid.
pub fn messages(config: &ModuleConfig) -> Vec<Message, MOST> {
    let Ok((module, motor)) = config.devices() else { return Vec::new() };
    let request = |name, request: Request, signals| {
        Message::new(name, request.pack(module, motor).id(), 8, false, signals)
    };
    // The identifier of a reply: module, content, motor, and its lowest byte.
    let reply = |name, content: u8, low: u8, signals, varies| {
        let top = module.get() << 3 | FROM_MODULE_BYTE | content;
        let raw = u32::from_be_bytes([top, 0, motor.get(), low]);
        Message::new(name, IdPattern::extended(raw).id(), 8, true, signals).varying(varies)
    };
    let (motion, gains) = (RawMotion::default(), RawImpedance::default());
    let control = |status| Request::Control(status, motion);
    let unanswered = |status| Request::ControlUnanswered(status, motion);
    // Status in bits 14 to 12, what differs in bits 23 to 16.
    let fault = 0x00FF_7000;
    [
        // What its numbers say is not done.
        request("UNITREE_GO_LOCK", control(Status::LOCK), &[]),
        request("UNITREE_GO_CONTROL", control(Status::FOC), MOTION),
        request("UNITREE_GO_SET_GAINS", Request::SetImpedance(gains), GAINS),
        request("UNITREE_GO_READ_GAINS", Request::ReadImpedance, &[]),
        request("UNITREE_GO_CALIBRATE", control(Status::CALIBRATE), &[]),
        request("UNITREE_GO_LOCK_UNANSWERED", unanswered(Status::LOCK), &[]),
        request("UNITREE_GO_CONTROL_UNANSWERED", unanswered(Status::FOC), MOTION),
        reply("UNITREE_GO_STATE", STATE, 0, STATES, fault | 0xFF),
        reply("UNITREE_GO_FAULT", STATE, NO_TEMPERATURE.cast_unsigned(), FAULTS, fault),
        reply("UNITREE_GO_GAINS", IMPEDANCE, 0, GAINS, fault | 0xFF),
    ]
    .into_iter()
    .collect()
}

/// The most messages of a motor.
pub const MOST: usize = 10;

/// [`FROM_MODULE`] as a bit of the identifier's highest byte.
const FROM_MODULE_BYTE: u8 = (FROM_MODULE >> 24) as u8;

const STATUS: Signal =
    Signal::in_id("Status", 12, 3).named(&[(0, "locked"), (1, "controlled"), (2, "calibrates")]);

const STATES: &[Signal] = &[
    STATUS,
    MOTION[0],
    MOTION[1],
    MOTION[2],
    Signal::in_id("Temperature", 0, 8).signed().scaled(1.0, "degC"),
    Signal::in_id("AirPressure", 16, 8),
];

const FAULTS: &[Signal] = &[STATUS, Signal::in_id("Error", 16, 8).listed(0, &ERRORS)];
