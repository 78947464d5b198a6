//! What stands where in the frames, as data; see [`crate::signals`].

use embedded_can::ExtendedId;
use heapless::Vec;

use super::models::{self, CYBERGEAR_DETAILS, Model, ROBSTRIDE_DETAILS};
use super::wire::{self, Address, Parameter, kind};
use crate::damiao::mit::Limits;
use crate::signals::{ByteOrder, Message, Presence, Signal};

/// What a DBC file cannot say of these motors.
pub const NOT_IN_DBC: &[&str] = &[
    "CyberGear, RobStride: motion control (type 1) carries its torque in bits 23 to 8 of the \
     identifier, so there is no one identifier for it, and it is left out.",
    "CyberGear, RobStride: feedback carries mode (bits 23 and 22) and faults (bits 21 to 16) in the \
     identifier; only a motor without faults, stopped or running, has a message here.",
    "CyberGear, RobStride: feedback is scaled by the model's own range of position; a motor with \
     another one (12.5 rad or 4π) has another scale.",
    "RobStride: a parameter that does not exist is answered with 1 in bits 23 to 16 of the \
     identifier; that answer has no message here.",
    "CyberGear, RobStride: what has another identifier than 8 bits of motor and host (identity, \
     type 0; its change, type 7) has no message here: no motor of ours uses it.",
];

/// The frames that a motor of the model sends and takes, but for [`NOT_IN_DBC`].
#[must_use]
pub fn messages(model: &Model, address: Address) -> Vec<Message, 10> {
    let robstride = model.saves;
    // A prefix for each vendor.
    macro_rules! name {
        ($what:literal) => {
            if robstride { concat!("ROBSTRIDE_", $what) } else { concat!("CYBERGEAR_", $what) }
        };
    }
    let Address { motor, host } = address;
    let from = |kind: u8, mode: u32, name, signals| {
        let raw = u32::from(kind) << 24 | mode << 22 | u32::from(motor) << 8 | u32::from(host);
        let id = ExtendedId::new(raw).unwrap_or(ExtendedId::MAX).into();
        Message { name, id, len: 8, from_device: true, signals }
    };
    let to = |frame: rc10_can::CanFrame, name, signals| Message {
        name,
        id: frame.id(),
        len: 8,
        from_device: false,
        signals,
    };
    let feedback = feedback_of(model);
    let faults: &[_] = if robstride { &ROBSTRIDE_FAULTS } else { &CYBERGEAR_FAULTS };
    let parameter = Parameter::RUN_MODE;
    let mut all = Vec::new();
    let common = [
        from(kind::FEEDBACK, 0, name!("FEEDBACK_STOPPED"), feedback),
        from(kind::FEEDBACK, 2, name!("FEEDBACK_RUNNING"), feedback),
        from(kind::FAULTS, 0, name!("FAULTS"), faults),
        from(kind::READ, 0, name!("PARAMETER"), &PARAMETERS),
        to(wire::enable(address), name!("ENABLE"), &[]),
        to(wire::stop(address), name!("STOP"), &STOP),
        to(wire::set_zero(address), name!("SET_ZERO"), &[]),
        to(wire::read(address, parameter), name!("READ_PARAMETER"), &READ),
        to(wire::write(address, parameter, [0; 4]), name!("WRITE_PARAMETER"), &PARAMETERS),
    ];
    // Nine and one are ten.
    let _ = all.extend_from_slice(&common);
    if robstride {
        let _ = all.push(to(wire::save(address), "ROBSTRIDE_SAVE", &[]));
    }
    all
}

/// A field that is spread over ±`limit`.
const fn ranged(name: &'static str, first: u8, limit: f32, unit: &'static str) -> Signal {
    let limit = limit as f64;
    Signal::big(name, first, 2).scaled(2.0 * limit / 65_535.0, unit).offset(-limit)
}

const fn feedback(limits: &Limits) -> [Signal; 4] {
    [
        ranged("POSITION", 0, limits.position(), "rad"),
        ranged("VELOCITY", 2, limits.velocity(), "rad/s"),
        ranged("TORQUE", 4, limits.torque(), "N m"),
        Signal::big("TEMPERATURE", 6, 2).scaled(0.1, "degC"),
    ]
}

/// Of each model, and for those that are not ours: raw.
fn feedback_of(model: &Model) -> &'static [Signal] {
    FEEDBACK.iter().find(|(name, _)| *name == model.name).map_or(&RAW, |(_, signals)| signals)
}

static FEEDBACK: [(&str, [Signal; 4]); models::ALL.len()] = {
    let mut all = [("", RAW); models::ALL.len()];
    let mut index = 0;
    while index < all.len() {
        all[index] = (models::ALL[index].name, feedback(&models::ALL[index].limits));
        index += 1;
    }
    all
};

const RAW: [Signal; 4] = [
    Signal::big("POSITION", 0, 2),
    Signal::big("VELOCITY", 2, 2),
    Signal::big("TORQUE", 4, 2),
    Signal::big("TEMPERATURE", 6, 2).scaled(0.1, "degC"),
];

static STOP: [Signal; 1] =
    [Signal::little("CLEARS_FAULTS", 0, 1).named(&[(0, "stop"), (1, "stop and clear faults")])];

/// Where the bits of a mask lie.
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

const INDEX: Signal = Signal::little("INDEX", 0, 2);

static READ: [Signal; 1] = [INDEX];

/// A parameter that is an f32.
const fn real(name: &'static str, parameter: Parameter, unit: &'static str) -> Signal {
    Signal::little(name, 4, 4).float().scaled(1.0, unit).when(Presence::If(parameter.0 as u32))
}

static PARAMETERS: [Signal; 11] = [
    INDEX.when(Presence::Switch),
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
];
