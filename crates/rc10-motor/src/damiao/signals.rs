//! What stands where in the frames of a motor.

use embedded_can::Id;
use heapless::Vec;

use super::mit::Limits;
use super::motor::Damiao;
use super::wire::{ERRORS, Mode, REGISTERS, standard};
use crate::signals::{ByteOrder, Message, Presence, Signal};

/// What a DBC file cannot say of these motors.
pub const NOT_IN_DBC: &[&str] = &[
    "Damiao: the answer to a register access has the identifier of feedback; only who has asked can tell.",
    "Damiao: seven bytes 0xFF and 0xFB to 0xFE, with a setpoint's identifier, are no setpoint but clear error, enable, disable and store zero.",
    "Damiao: several motors may answer with one MST_ID, told apart by the signal ID.",
    "Damiao: a question about a register has four bytes, a value being written four more.",
    "Damiao: a motor obeys every standard identifier with the low byte of its CAN_ID.",
];

/// Signals whose scales follow from a motor's limits. They have to outlive the messages: a
/// `static`, or a leaked box on a PC.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaled {
    feedback: [Signal; 7],
    setpoint: [Signal; 5],
}

impl Scaled {
    /// For these limits.
    #[must_use]
    pub const fn of(limits: &Limits) -> Self {
        let (position, velocity) = (limits.position() as f64, limits.velocity() as f64);
        let torque = limits.torque() as f64;
        Self {
            feedback: [
                Signal::new("ID", ByteOrder::Little, 0, 4),
                Signal::new("ERR", ByteOrder::Little, 4, 4).named(&ERRORS),
                within(Signal::big("POSITION", 1, 2), position, "rad"),
                within(twelve("VELOCITY", 31), velocity, "rad/s"),
                within(twelve("TORQUE", 35), torque, "N m"),
                Signal::big("T_MOS", 6, 1).scaled(1.0, "degC"),
                Signal::big("T_ROTOR", 7, 1).scaled(1.0, "degC"),
            ],
            setpoint: [
                within(Signal::big("POSITION", 0, 2), position, "rad"),
                within(twelve("VELOCITY", 23), velocity, "rad/s"),
                twelve("KP", 27).scaled(limits.kp() as f64 / 4095.0, "N m/rad"),
                twelve("KD", 47).scaled(limits.kd() as f64 / 4095.0, "N m s/rad"),
                within(twelve("TORQUE", 51), torque, "N m"),
            ],
        }
    }
}

/// Twelve bits, of which the highest is `start`.
const fn twelve(name: &'static str, start: u8) -> Signal {
    Signal::new(name, ByteOrder::Big, start, 12)
}

/// All values of its bits spread over ±`limit`.
const fn within(signal: Signal, limit: f64, unit: &'static str) -> Signal {
    let most = ((1_u32 << signal.bits) - 1) as f64;
    signal.scaled(2.0 * limit / most, unit).offset(-limit)
}

static POSITION_VELOCITY: [Signal; 2] = [
    Signal::little("POSITION", 0, 4).float().scaled(1.0, "rad"),
    Signal::little("VELOCITY", 4, 4).float().scaled(1.0, "rad/s"),
];

static VELOCITY: [Signal; 1] = [Signal::little("VELOCITY", 0, 4).float().scaled(1.0, "rad/s")];

static FORCE_POSITION: [Signal; 3] = [
    Signal::little("POSITION", 0, 4).float().scaled(1.0, "rad"),
    Signal::little("VELOCITY", 4, 2).scaled(0.01, "rad/s"),
    Signal::little("CURRENT", 6, 2).scaled(0.0001, ""),
];

static REGISTER: [Signal; 11] = [
    Signal::little("CAN_ID", 0, 2),
    Signal::little("OPERATION", 2, 1).named(&[
        (0x33, "read"),
        (0x55, "write"),
        (0xAA, "save"),
        (0xCC, "report"),
    ]),
    Signal::little("REGISTER", 3, 1).when(Presence::Switch),
    Signal::little("MST_ID", 4, 4).when(Presence::If(7)),
    Signal::little("ESC_ID", 4, 4).when(Presence::If(8)),
    Signal::little("TIMEOUT", 4, 4).scaled(0.05, "ms").when(Presence::If(9)),
    Signal::little("CTRL_MODE", 4, 4)
        .named(&[(1, "MIT"), (2, "position-velocity"), (3, "velocity"), (4, "force-position")])
        .when(Presence::If(10)),
    Signal::little("PMAX", 4, 4).float().scaled(1.0, "rad").when(Presence::If(21)),
    Signal::little("VMAX", 4, 4).float().scaled(1.0, "rad/s").when(Presence::If(22)),
    Signal::little("TMAX", 4, 4).float().scaled(1.0, "N m").when(Presence::If(23)),
    Signal::little("CAN_BR", 4, 4).when(Presence::If(35)),
];

/// The frames of a motor: its feedback, its commands, and the registers' frame, which all motors of
/// a bus share and which is the same for each.
#[must_use]
pub fn messages(motor: &Damiao, scaled: &'static Scaled) -> Vec<Message, 3> {
    let (name, len, signals): (_, _, &'static [Signal]) = match motor.mode() {
        Mode::Mit => ("DAMIAO_MIT", 8, &scaled.setpoint),
        Mode::PositionVelocity => ("DAMIAO_POSITION_VELOCITY", 8, &POSITION_VELOCITY),
        Mode::Velocity => ("DAMIAO_VELOCITY", 4, &VELOCITY),
        Mode::ForcePosition => ("DAMIAO_FORCE_POSITION", 8, &FORCE_POSITION),
    };
    let command = Id::Standard(motor.can_id().command_id(motor.mode()));
    let feedback = Id::Standard(motor.master_id());
    let register = Id::Standard(standard(REGISTERS));
    [
        Message {
            name: "DAMIAO_FEEDBACK",
            id: feedback,
            len: 8,
            from_device: true,
            signals: &scaled.feedback,
        },
        Message { name, id: command, len, from_device: false, signals },
        Message {
            name: "DAMIAO_REGISTER",
            id: register,
            len: 8,
            from_device: false,
            signals: &REGISTER,
        },
    ]
    .into_iter()
    .collect()
}
