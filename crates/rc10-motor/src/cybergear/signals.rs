//! What stands where in the frames, as data; see [`crate::signals`].

use embedded_can::ExtendedId;
use heapless::Vec;
use rc10_can::CanFrame;

use super::config::{self, CYBERGEAR_DETAILS, Model, ROBSTRIDE_DETAILS, models};
use super::wire::{self, Address, Parameter, kind};
use crate::mit::Limits;
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
    "CyberGear, RobStride: a change of the motor's identifier (type 7) carries the new one in bits 23 \
     to 16 of its own, and has no message here.",
];

/// The most messages of a motor.
pub const MOST: usize = 18;

/// The frames that a motor of the model sends and takes; first those that are not in
/// [`NOT_IN_DBC`].
#[must_use]
pub fn messages(model: &Model, address: Address) -> Vec<Message, MOST> {
    let robstride = model.saves;
    // A prefix for each vendor.
    macro_rules! name {
        ($what:literal) => {
            if robstride { concat!("ROBSTRIDE_", $what) } else { concat!("CYBERGEAR_", $what) }
        };
    }
    let Address { motor, host } = address;
    let with_id = |kind: u8, upper: u8, middle: u8, low: u8, name, from_device, signals| {
        let raw = u32::from_be_bytes([kind, upper, middle, low]);
        let id = ExtendedId::new(raw).unwrap_or(ExtendedId::MAX).into();
        Message::new(name, id, 8, from_device, signals)
    };
    let from = |kind: u8, mode: u8, name, signals| {
        with_id(kind, mode << 6, motor, host, name, true, signals)
    };
    let to = |frame: CanFrame, name, signals| Message::new(name, frame.id(), 8, false, signals);
    let Table { feedback, state, motion, .. } = table_of(model);
    let faults: &[_] = if robstride { &ROBSTRIDE_FAULTS } else { &CYBERGEAR_FAULTS };
    let parameter = Parameter::RUN_MODE;
    let mut all = Vec::new();
    let plain = [
        from(kind::FEEDBACK, 0, name!("FEEDBACK_STOPPED"), feedback),
        from(kind::FEEDBACK, 2, name!("FEEDBACK_RUNNING"), feedback),
        from(kind::FAULTS, 0, name!("FAULTS"), faults),
        from(kind::READ, 0, name!("PARAMETER"), &PARAMETERS),
        to(wire::enable(address), name!("ENABLE"), &[]),
        to(wire::stop(address), name!("STOP"), &STOP),
        to(wire::set_zero(address), name!("SET_ZERO"), &[]),
        to(wire::read(address, parameter), name!("READ_PARAMETER"), &READ),
        to(wire::write(address, parameter, [0; 4]), name!("WRITE_PARAMETER"), &PARAMETERS),
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

/// A field that is spread over ±`limit`.
const fn ranged(name: &'static str, first: u8, limit: f32, unit: &'static str) -> Signal {
    let limit = limit as f64;
    Signal::big(name, first, 2).scaled(2.0 * limit / 65_535.0, unit).offset(-limit)
}

const fn feedback(limits: &Limits) -> [Signal; 4] {
    [
        ranged("POSITION", 0, limits.position, "rad"),
        ranged("VELOCITY", 2, limits.velocity, "rad/s"),
        ranged("TORQUE", 4, limits.torque, "N m"),
        Signal::big("TEMPERATURE", 6, 2).scaled(0.1, "degC"),
    ]
}

/// Mode and faults in the identifier, then what stands in the data of a feedback.
const STATE_SIGNALS: usize = 1 + 6 + 4;

const fn state(data: [Signal; 4], robstride: bool) -> [Signal; STATE_SIGNALS] {
    const MODES: &[(u32, &str)] = &[(0, "stopped"), (1, "calibrates"), (2, "runs")];
    const NAMES: [&str; 6] = ["FAULT_0", "FAULT_1", "FAULT_2", "FAULT_3", "FAULT_4", "FAULT_5"];
    let (faults, texts) = if robstride {
        (&config::ROBSTRIDE_FAULTS, &ROBSTRIDE_TEXTS)
    } else {
        (&config::CYBERGEAR_FAULTS, &CYBERGEAR_TEXTS)
    };
    let mut signals = [Signal::in_id("MODE", 22, 2).named(MODES); STATE_SIGNALS];
    let mut index = 0;
    while index < 6 {
        let bit = faults[index].0;
        let signal = Signal::in_id(NAMES[bit as usize], 16 + bit, 1);
        signals[1 + index] = signal.named(&texts[index]);
        index += 1;
    }
    index = 0;
    while index < 4 {
        signals[7 + index] = data[index];
        index += 1;
    }
    signals
}

/// A fault bit that is set, in the words of the codec.
const fn texts(faults: &[(u8, &'static str); 6]) -> [[(u32, &'static str); 1]; 6] {
    let mut texts = [[(1, "")]; 6];
    let mut index = 0;
    while index < 6 {
        texts[index][0].1 = faults[index].1;
        index += 1;
    }
    texts
}

static CYBERGEAR_TEXTS: [[(u32, &str); 1]; 6] = texts(&config::CYBERGEAR_FAULTS);
static ROBSTRIDE_TEXTS: [[(u32, &str); 1]; 6] = texts(&config::ROBSTRIDE_FAULTS);

const fn motion(limits: &Limits) -> [Signal; 5] {
    let torque = limits.torque as f64;
    [
        ranged("POSITION", 0, limits.position, "rad"),
        ranged("VELOCITY", 2, limits.velocity, "rad/s"),
        Signal::big("KP", 4, 2).scaled(limits.kp as f64 / 65_535.0, "N m/rad"),
        Signal::big("KD", 6, 2).scaled(limits.kd as f64 / 65_535.0, "N m s/rad"),
        Signal::in_id("TORQUE", 8, 16).scaled(2.0 * torque / 65_535.0, "N m").offset(-torque),
    ]
}

/// What the frames of a model hold whose scales follow from its limits.
#[derive(Clone, Copy)]
struct Table {
    name: &'static str,
    feedback: [Signal; 4],
    /// The same with what stands in the identifier.
    state: [Signal; STATE_SIGNALS],
    motion: [Signal; 5],
}

/// Without scales.
const fn raw_table(robstride: bool) -> Table {
    const FEEDBACK: [Signal; 4] = [
        Signal::big("POSITION", 0, 2),
        Signal::big("VELOCITY", 2, 2),
        Signal::big("TORQUE", 4, 2),
        Signal::big("TEMPERATURE", 6, 2).scaled(0.1, "degC"),
    ];
    let motion = [
        Signal::big("POSITION", 0, 2),
        Signal::big("VELOCITY", 2, 2),
        Signal::big("KP", 4, 2),
        Signal::big("KD", 6, 2),
        Signal::in_id("TORQUE", 8, 16),
    ];
    Table { name: "", feedback: FEEDBACK, state: state(FEEDBACK, robstride), motion }
}

static RAW: [Table; 2] = [raw_table(false), raw_table(true)];
static TABLES: [Table; models::ALL.len()] = {
    let mut all = [raw_table(false); models::ALL.len()];
    let mut index = 0;
    while index < all.len() {
        let Model { name, limits, saves, .. } = models::ALL[index];
        let feedback = feedback(limits);
        let state = state(feedback, *saves);
        all[index] = Table { name, feedback, state, motion: motion(limits) };
        index += 1;
    }
    all
};

/// Of one of our models; of another, raw.
fn table_of(model: &Model) -> &'static Table {
    let known = TABLES.iter().find(|table| table.name == model.name);
    known.unwrap_or(&RAW[usize::from(model.saves)])
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

/// A parameter that is an f32.
const fn real(name: &'static str, parameter: Parameter, unit: &'static str) -> Signal {
    Signal::little(name, 4, 4).float().scaled(1.0, unit).when(Presence::If(parameter.0 as u32))
}

const PARAMETER_SIGNALS: [Signal; 10] = [
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

static PARAMETERS: [Signal; 1 + PARAMETER_SIGNALS.len()] = {
    let mut signals = [INDEX.when(Presence::Switch); 1 + PARAMETER_SIGNALS.len()];
    let mut index = 0;
    while index < PARAMETER_SIGNALS.len() {
        signals[1 + index] = PARAMETER_SIGNALS[index];
        index += 1;
    }
    signals
};
