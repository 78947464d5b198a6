//! The layout of the frames of a motor, as data.

use embedded_can::Id;
use heapless::Vec;

use super::config::Config;
use super::registers::{NAMES, READ, REFRESH, Register, SAVE, WRITE};
use super::wire::{DeviceId, ERRORS, Mode, Operation, REGISTERS, operate};
use crate::can_ids::standard;
use crate::mit::{Limits, spread};
use crate::pending::TIMEOUT_STEPS;
use crate::signals::{ByteOrder, Marks, Message, Presence, Signal};

/// Properties of these motors' frames that a DBC file cannot describe.
pub const NOT_IN_DBC: &[&str] = &[
    "Damiao: the answer to a register access has the identifier of feedback; only who has asked can tell.",
    "Damiao: seven bytes 0xFF and 0xFB to 0xFE, with a setpoint's identifier, are no setpoint but clear error, enable, disable and store zero.",
    "Damiao: several motors may answer with one MST_ID, told apart by the signal ID.",
    "Damiao: a question about a register has four bytes, a value being written four more.",
    "Damiao: a motor obeys every standard identifier with the low byte of its CAN_ID.",
];

/// Signals scaled by a motor's limits. They outlive the messages: a `static`, or a leaked box.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaled {
    feedback: [Signal; 7],
    setpoint: [Signal; 5],
}

impl Scaled {
    /// For these limits.
    pub const fn of(limits: &Limits) -> Self {
        let Limits { position, velocity, torque, kp, kd } = *limits;
        Self {
            feedback: [
                Signal::new("ID", ByteOrder::Little, 0, 4),
                Signal::new("ERR", ByteOrder::Little, 4, 4).named(&ERRORS),
                spread(Signal::big("POSITION", 1, 2), position, "rad"),
                spread(twelve("VELOCITY", 31), velocity, "rad/s"),
                spread(twelve("TORQUE", 35), torque, "N m"),
                Signal::big("T_MOS", 6, 1).scaled(1.0, "degC"),
                Signal::big("T_ROTOR", 7, 1).scaled(1.0, "degC"),
            ],
            setpoint: [
                spread(Signal::big("POSITION", 0, 2), position, "rad"),
                spread(twelve("VELOCITY", 23), velocity, "rad/s"),
                twelve("KP", 27).scaled(kp as f64 / 4095.0, "N m/rad"),
                twelve("KD", 47).scaled(kd as f64 / 4095.0, "N m s/rad"),
                spread(twelve("TORQUE", 51), torque, "N m"),
            ],
        }
    }
}

/// Twelve bits, of which the highest is `start`.
const fn twelve(name: &'static str, start: u8) -> Signal {
    Signal::new(name, ByteOrder::Big, start, 12)
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

/// Names of the registers, for what tells which one is meant.
static REGISTER_NAMES: [(u32, &str); NAMES.len()] = {
    let mut names = [(0, ""); NAMES.len()];
    let mut index = 0;
    while index < names.len() {
        names[index] = (NAMES[index].0 as u32, NAMES[index].1);
        index += 1;
    }
    names
};

const WHICH: Signal = Signal::little("REGISTER", 3, 1).named(&REGISTER_NAMES);

/// Signals of a register frame: `first`, the number of the register, and a value for each.
const fn with_registers<const FIRST: usize, const ALL: usize>(
    first: [Signal; FIRST],
) -> [Signal; ALL] {
    let mut signals = [WHICH.when(Presence::Switch); ALL];
    let mut next = 0;
    while next < FIRST {
        signals[next] = first[next];
        next += 1;
    }
    let mut index = 0;
    while index < NAMES.len() {
        let (number, name, unit) = NAMES[index];
        let value = Signal::little(name, 4, 4).when(Presence::If(number as u32));
        let register = Register(number);
        signals[FIRST + 1 + index] = match register {
            Register::TIMEOUT => value.scaled(1.0 / TIMEOUT_STEPS as f64, unit),
            Register::MODE => value.named(&MODES),
            Register::BIT_RATE => value.named(&BIT_RATES),
            _ if register.is_whole() => value,
            _ => value.float().scaled(1.0, unit),
        };
        index += 1;
    }
    signals
}

static MODES: [(u32, &str); 4] =
    [(1, "MIT"), (2, "position-velocity"), (3, "velocity"), (4, "force-position")];
static BIT_RATES: [(u32, &str); 5] =
    [(0, "125 kbit/s"), (1, "200 kbit/s"), (2, "250 kbit/s"), (3, "500 kbit/s"), (4, "1 Mbit/s")];

static REGISTER: [Signal; 3 + NAMES.len()] = with_registers([
    Signal::little("CAN_ID", 0, 2),
    Signal::little("OPERATION", 2, 1).named(&[
        (READ as u32, "read"),
        (WRITE as u32, "write"),
        (SAVE as u32, "save"),
        (REFRESH as u32, "report"),
    ]),
]);
static VALUE: [Signal; 1 + NAMES.len()] = with_registers([]);
static ASKED: [Signal; 1] = [WHICH];

/// The most messages of a motor.
pub const MOST: usize = 22;

/// A motor's feedback, commands, and the registers' frame, which all motors share. Then enable,
/// disable, clear error and store zero, and register questions and answers. Empty for a motor with
/// an invalid `CAN_ID`.
pub fn messages(motor: &Config, scaled: &'static Scaled) -> Vec<Message, MOST> {
    let (mode, id) = (motor.control.mode(), DeviceId::new(motor.can_id));
    let Some(id) = id else { return Vec::new() };
    let (name, len, signals): (_, _, &'static [Signal]) = match mode {
        Mode::Mit => ("DAMIAO_MIT", 8, &scaled.setpoint),
        Mode::PositionVelocity => ("DAMIAO_POSITION_VELOCITY", 8, &POSITION_VELOCITY),
        Mode::Velocity => ("DAMIAO_VELOCITY", 4, &VELOCITY),
        Mode::ForcePosition => ("DAMIAO_FORCE_POSITION", 8, &FORCE_POSITION),
    };
    let feedback = Id::Standard(standard(motor.master_id));
    let register = Id::Standard(standard(REGISTERS));
    let plain = [
        Message::new("DAMIAO_FEEDBACK", feedback, 8, true, &scaled.feedback),
        Message::new(name, id.command_id(mode).into(), len, false, signals),
        Message::new("DAMIAO_REGISTER", register, 8, false, &REGISTER),
    ];
    // The motor's own mode, and the bare identifier.
    let modes = [mode, Mode::Mit];
    let modes = if mode == Mode::Mit { &modes[1..] } else { &modes };
    let operations = modes.iter().flat_map(|&mode| {
        OPERATIONS.into_iter().map(move |(name, operation)| {
            let frame = operate(id, mode, operation);
            let marks = frame.all_eight().map_or(Marks::NONE, |bytes| Marks::bytes(*bytes));
            Message::new(name, frame.id(), 8, false, &[]).marked(marks)
        })
    });
    let [low, high] = id.raw().to_le_bytes();
    let about = move |name, operation, len, from_device, signals| {
        let id = if from_device { feedback } else { register };
        let marks = Marks::bytes([low, high, operation]);
        Message::new(name, id, len, from_device, signals).marked(marks)
    };
    // A question has four bytes; devices take eight, too.
    let questions = [4, 8].into_iter().flat_map(move |len| {
        [
            about("DAMIAO_READ_REGISTER", READ, len, false, &ASKED),
            about("DAMIAO_SAVE_REGISTERS", SAVE, len, false, &[]),
            about("DAMIAO_REFRESH", REFRESH, len, false, &[]),
        ]
    });
    let others = [
        about("DAMIAO_WRITE_REGISTER", WRITE, 8, false, &VALUE),
        about("DAMIAO_REGISTER_HOLDS", READ, 8, true, &VALUE),
        about("DAMIAO_REGISTER_WRITTEN", WRITE, 8, true, &VALUE),
        about("DAMIAO_REGISTERS_SAVED", SAVE, 4, true, &[]),
        about("DAMIAO_REGISTERS_SAVED", SAVE, 8, true, &[]),
    ];
    // Three, eight, six and five.
    plain.into_iter().chain(operations).chain(questions).chain(others).take(MOST).collect()
}

const OPERATIONS: [(&str, Operation); 4] = [
    ("DAMIAO_CLEAR_ERROR", Operation::ClearError),
    ("DAMIAO_ENABLE", Operation::Enable),
    ("DAMIAO_DISABLE", Operation::Disable),
    ("DAMIAO_STORE_ZERO", Operation::StoreZero),
];
