//! The layout of the frames, as data; see [`crate::signals`].

use heapless::Vec;
use rc10_can::{CanFrame, IdPattern};

use super::config::{CYBERGEAR_DETAILS, Model, ROBSTRIDE_DETAILS};
use super::wire::{self, Address, Parameter, kind};
use crate::mit::spread;
use crate::pending::TIMEOUT_STEPS;
use crate::signals::{ByteOrder, Message, Presence, Signal};

/// Properties of these motors' frames that a DBC file cannot describe.
pub const NOT_IN_DBC: &[&str] = &[
    "CyberGear, RobStride: motion control (type 1) carries its torque in bits 23 to 8 of the \
     identifier, so there is no one identifier for it, and it is left out.",
    "CyberGear, RobStride: feedback carries mode (bits 23 and 22) and faults (bits 21 to 16) in the \
     identifier; only a motor without faults, stopped or running, has a message here.",
    "CyberGear, RobStride: feedback is scaled by the model's own range of position; a motor with \
     another one (12.5 rad or 4π) has another scale.",
    "RobStride: a parameter that does not exist is answered with 1 in bits 23 to 16 of the \
     identifier; that answer has no message here.",
    "CyberGear, RobStride: a change of the motor's identifier (type 7) carries the new one in bits 23 \
     to 16 of its own, and has no message here.",
];

/// Signals scaled by a model's limits. They outlive the messages: a `static`, or a leaked box.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaled {
    feedback: [Signal; 4],
    /// Mode and faults in the identifier, then the same.
    state: [Signal; 1 + 6 + 4],
    motion: [Signal; 5],
}

impl Scaled {
    /// For a model with these limits.
    pub const fn of(model: &Model) -> Self {
        const MODES: &[(u32, &str)] = &[(0, "stopped"), (1, "calibrates"), (2, "runs")];
        let Model { limits, faults, .. } = *model;
        let position = spread(Signal::big("POSITION", 0, 2), limits.position, "rad");
        let velocity = spread(Signal::big("VELOCITY", 2, 2), limits.velocity, "rad/s");
        let torque = spread(Signal::big("TORQUE", 4, 2), limits.torque, "N m");
        let temperature = Signal::big("TEMPERATURE", 6, 2).scaled(0.1, "degC");
        Self {
            feedback: [position, velocity, torque, temperature],
            state: [
                Signal::in_id("MODE", 22, 2).named(MODES),
                fault(faults, 0),
                fault(faults, 1),
                fault(faults, 2),
                fault(faults, 3),
                fault(faults, 4),
                fault(faults, 5),
                position,
                velocity,
                torque,
                temperature,
            ],
            motion: [
                position,
                velocity,
                Signal::big("KP", 4, 2).scaled(limits.kp as f64 / 65_535.0, "N m/rad"),
                Signal::big("KD", 6, 2).scaled(limits.kd as f64 / 65_535.0, "N m s/rad"),
                spread(Signal::in_id("TORQUE", 8, 16), limits.torque, "N m"),
            ],
        }
    }
}

/// A fault bit in the identifier of a feedback, with the text that the codec has for it.
const fn fault(faults: &'static [(u8, &'static str); 6], index: usize) -> Signal {
    const NAMES: [&str; 6] = ["FAULT_0", "FAULT_1", "FAULT_2", "FAULT_3", "FAULT_4", "FAULT_5"];
    let (bit, text) = &faults[index];
    Signal::in_id(NAMES[*bit as usize], 16 + *bit, 1).flag(text)
}

/// The most messages of a motor.
pub const MOST: usize = 18;

/// The frames that a motor sends and takes; first those that are not in [`NOT_IN_DBC`].
pub fn messages(model: &Model, address: Address, scaled: &'static Scaled) -> Vec<Message, MOST> {
    let robstride = model.saves;
    // A prefix for each vendor.
    macro_rules! name {
        ($what:literal) => {
            if robstride { concat!("ROBSTRIDE_", $what) } else { concat!("CYBERGEAR_", $what) }
        };
    }
    let Address { motor, host } = address;
    let with_id = |kind: u8, upper: u8, middle: u8, low: u8, name, from_device, signals| {
        let id = IdPattern::extended(u32::from_be_bytes([kind, upper, middle, low])).id();
        Message::new(name, id, 8, from_device, signals)
    };
    let from = |kind: u8, mode: u8, name, signals| {
        with_id(kind, mode << 6, motor, host, name, true, signals)
    };
    let to = |frame: CanFrame, name, signals| Message::new(name, frame.id(), 8, false, signals);
    let Scaled { feedback, state, motion } = scaled;
    let faults: &[_] = if robstride { &ROBSTRIDE_FAULTS } else { &CYBERGEAR_FAULTS };
    let parameter = Parameter::RUN_MODE;
    let parameters =
        if robstride { PARAMETERS.as_slice() } else { &PARAMETERS[..PARAMETERS.len() - 1] };
    let mut all = Vec::new();
    let plain = [
        from(kind::FEEDBACK, 0, name!("FEEDBACK_STOPPED"), feedback),
        from(kind::FEEDBACK, 2, name!("FEEDBACK_RUNNING"), feedback),
        from(kind::FAULTS, 0, name!("FAULTS"), faults),
        from(kind::READ, 0, name!("PARAMETER"), parameters),
        to(wire::enable(address), name!("ENABLE"), &[]),
        to(wire::stop(address), name!("STOP"), &STOP),
        to(wire::set_zero(address), name!("SET_ZERO"), &[]),
        to(wire::read(address, parameter), name!("READ_PARAMETER"), &READ),
        to(wire::write(address, parameter, [0; 4]), name!("WRITE_PARAMETER"), parameters),
        to(wire::identify(address), name!("IDENTIFY"), &[]),
        // 0xFE instead of a host: to everybody.
        with_id(kind::IDENTITY, 0, motor, 0xFE, name!("IDENTITY"), true, &IDENTITY),
    ];
    // Eleven, two, and five are eighteen.
    let _ = all.extend_from_slice(&plain);
    let save = wire::save(address);
    if robstride {
        let _ = all.push(to(save, "ROBSTRIDE_SAVE", &[]));
        let name = "ROBSTRIDE_SET_REPORT";
        let _ = all.push(with_id(kind::REPORT, 0, host, motor, name, false, &REPORT));
    } else {
        let _ = all.push(to(save, "CYBERGEAR_SET_BIT_RATE", &BIT_RATE));
    }
    const UPPER: u32 = 0x00FF_0000;
    let special = [
        with_id(kind::MOTION, 0, 0, motor, name!("MOTION"), false, motion).varying(0x00FF_FF00),
        from(kind::FEEDBACK, 0, name!("FEEDBACK"), state).varying(UPPER),
        with_id(kind::SET_ID, 0, host, motor, name!("SET_ID"), false, &NEW_ID).varying(UPPER),
        from(kind::READ, 0, name!("NO_SUCH_PARAMETER"), &READ).varying(UPPER),
        from(kind::REPORT, 0, name!("REPORT"), state).varying(UPPER),
    ];
    // The last two are a RobStride's.
    let _ = all.extend_from_slice(if robstride { &special } else { &special[..3] });
    all
}

/// Number of the chip, eight bytes as they came.
static IDENTITY: [Signal; 1] = [Signal::big("CHIP", 0, 8)];
/// Whether it reports of its own accord (RobStride manuals, type 24).
static REPORT: [Signal; 1] =
    [Signal::little("REPORTS", 6, 1).named(&[(0, "when asked"), (1, "of its own accord")])];
static NEW_ID: [Signal; 1] = [Signal::in_id("NEW_ID", 16, 8)];
static BIT_RATE: [Signal; 1] = [Signal::little("BIT_RATE", 0, 1).named(&[
    (1, "1 Mbit/s"),
    (2, "500 kbit/s"),
    (3, "250 kbit/s"),
    (4, "125 kbit/s"),
])];

static STOP: [Signal; 1] = [Signal::little("CLEARS_FAULTS", 0, 1).named(&[(0, "no"), (1, "yes")])];

/// A signal made of the bits of a mask.
const fn masked(name: &'static str, mask: u32) -> Signal {
    #[expect(clippy::cast_possible_truncation, reason = "at most 32")]
    let (start, bits) = (mask.trailing_zeros() as u8, mask.count_ones() as u8);
    Signal::new(name, ByteOrder::Little, start, bits)
}

/// A bit of a fault frame, with the text that the codec has for it.
macro_rules! fault {
    ($name:literal, $table:ident, $index:literal) => {
        masked($name, $table[$index].0).named(&[(0, "good"), (1, $table[$index].1)])
    };
}

const GETS_HOT: Signal =
    Signal::new("GETS_HOT", ByteOrder::Little, 32, 1).named(&[(0, "good"), (1, "motor gets hot")]);

static CYBERGEAR_FAULTS: [Signal; 10] = [
    fault!("DRIVER_CHIP", CYBERGEAR_DETAILS, 0),
    fault!("OVER_CURRENT_A", CYBERGEAR_DETAILS, 1),
    fault!("OVER_CURRENT_B", CYBERGEAR_DETAILS, 2),
    fault!("OVER_CURRENT_C", CYBERGEAR_DETAILS, 3),
    fault!("TOO_HOT", CYBERGEAR_DETAILS, 4),
    // Eight bits: anything but zero is it.
    masked("OVERLOAD", CYBERGEAR_DETAILS[5].0).named(&[(0, "good")]),
    fault!("OVER_VOLTAGE", CYBERGEAR_DETAILS, 6),
    fault!("UNDER_VOLTAGE", CYBERGEAR_DETAILS, 7),
    fault!("NOT_CALIBRATED", CYBERGEAR_DETAILS, 8),
    GETS_HOT,
];

static ROBSTRIDE_FAULTS: [Signal; 12] = [
    fault!("DRIVER_CHIP", ROBSTRIDE_DETAILS, 0),
    fault!("OVER_CURRENT_A", ROBSTRIDE_DETAILS, 1),
    fault!("OVER_CURRENT_B", ROBSTRIDE_DETAILS, 2),
    fault!("OVER_CURRENT_C", ROBSTRIDE_DETAILS, 3),
    fault!("TOO_HOT", ROBSTRIDE_DETAILS, 4),
    fault!("OVERLOAD", ROBSTRIDE_DETAILS, 5),
    fault!("OVER_VOLTAGE", ROBSTRIDE_DETAILS, 6),
    fault!("UNDER_VOLTAGE", ROBSTRIDE_DETAILS, 7),
    fault!("NOT_INITIALISED", ROBSTRIDE_DETAILS, 8),
    fault!("NOT_RECOGNISED", ROBSTRIDE_DETAILS, 9),
    fault!("NOT_CALIBRATED", ROBSTRIDE_DETAILS, 10),
    GETS_HOT,
];

const INDEX: Signal = Signal::little("INDEX", 0, 2).named(&PARAMETER_NAMES);

/// Names of the parameters, for what tells which one is meant.
static PARAMETER_NAMES: [(u32, &str); PARAMETER_SIGNALS.len()] = {
    let mut names = [(0, ""); PARAMETER_SIGNALS.len()];
    let mut index = 0;
    while index < names.len() {
        let signal = &PARAMETER_SIGNALS[index];
        if let Presence::If(number) = signal.presence {
            names[index] = (number, signal.name);
        }
        index += 1;
    }
    names
};

static READ: [Signal; 1] = [INDEX];

const fn real(name: &'static str, parameter: Parameter, unit: &'static str) -> Signal {
    Signal::little(name, 4, 4).float().scaled(1.0, unit).when(Presence::If(parameter.0 as u32))
}

const PARAMETER_SIGNALS: [Signal; 11] = [
    Signal::little("RUN_MODE", 4, 1)
        .named(&[(0, "motion"), (1, "position"), (2, "velocity"), (3, "current")])
        .when(Presence::If(Parameter::RUN_MODE.0 as u32)),
    real("CURRENT", Parameter::CURRENT, "A"),
    real("VELOCITY", Parameter::VELOCITY, "rad/s"),
    real("TORQUE_LIMIT", Parameter::TORQUE_LIMIT, "N m"),
    real("POSITION", Parameter::POSITION, "rad"),
    real("VELOCITY_LIMIT", Parameter::VELOCITY_LIMIT, "rad/s"),
    real("CURRENT_LIMIT", Parameter::CURRENT_LIMIT, "A"),
    real("MEASURED_POSITION", Parameter::MEASURED_POSITION, "rad"),
    real("MEASURED_VELOCITY", Parameter::MEASURED_VELOCITY, "rad/s"),
    real("SUPPLY", Parameter::SUPPLY, "V"),
    // The last: a CyberGear has none.
    Signal::little("CAN_TIMEOUT", 4, 4)
        .scaled(1.0 / TIMEOUT_STEPS as f64, "ms")
        .when(Presence::If(Parameter::TIMEOUT.0 as u32)),
];

static PARAMETERS: [Signal; 12] = {
    let [a, b, c, d, e, f, g, h, i, j, k] = PARAMETER_SIGNALS;
    [INDEX.when(Presence::Switch), a, b, c, d, e, f, g, h, i, j, k]
};
