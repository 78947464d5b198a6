//! The layout of an LK drive's frames.

use embedded_can::Id;
use heapless::Vec;
use rc10_app::ConfigError;

use super::config::{Commands, Config, EncoderBits, Model};
use super::wire::{
    CLEAR_ERRORS, CURRENT, ERROR_TEXTS, HEALTH, MOTION, MULTI_MOTOR_ID, MULTI_TURN, OFF, OPEN_LOOP,
    PHASE_CURRENTS, RUN, SINGLE_TURN, SPEED, STOP, TURN_BY, TURN_BY_LIMITED, TURN_TO,
    TURN_TO_LIMITED, TURN_WITHIN, TURN_WITHIN_LIMITED,
};
use crate::signals::{ByteOrder, Marks, Message, Presence, Signal};

/// Content of the frames that a DBC file cannot describe.
pub const NOT_IN_DBC: &[&str] = &[
    "LK: commands to a drive have the identifier of its answers, and a DBC has room for one of \
     both: the answers are in it. Commands are byte 0 (80 off, 88 run, 9A, 9B, 9C questions, A1 \
     torque current) and, for A1, the current in bytes 4 and 5.",
    "LK: in the multi-motor frame the currents are steps, whose size depends on each drive's model: \
     33/2048 A for MG, 16.5/2048 A for MF.",
];

/// The answers of a drive, and in multi-motor mode the frame that commands it, which is the same
/// for all drives of a bus; then its single commands, which have the identifier of its answers, and
/// the answers to those that this crate never sends. Angles and speeds are the rotor's. A model
/// whose current step is neither that of MG nor that of MF has its current in steps.
///
/// # Errors
/// [`ConfigError`] as for [`Lk::new`](super::Lk::new).
pub fn messages(config: &Config) -> Result<Vec<Message, MOST>, ConfigError> {
    let (id, _) = config.lane()?;
    let id = Id::from(id.can_id());
    let Table { answers, motion, current } = table(&config.model);
    let mut messages = Vec::new();
    // Two, and as many as MOST has room for.
    let _ = messages.push(Message::new("LK_ANSWER", id, 8, true, answers));
    if config.commands == Commands::MultiMotor {
        let id = MULTI_MOTOR_ID.into();
        let _ = messages.push(Message::new("LK_MULTI_MOTOR", id, 8, false, &LANES));
    }
    let moved = [(OPEN_LOOP, 0xF8), (TURN_BY_LIMITED, 0xFF)].map(|(command, mask)| {
        let marks = Marks::masked([mask, 0, 0, 0, 0, 0, 0, 0], [command, 0, 0, 0, 0, 0, 0, 0]);
        Message::new("LK_MOTION", id, 8, true, motion).marked(marks)
    });
    let told = [
        ("LK_MULTI_TURN", MULTI_TURN, &MULTI_TURN_ANGLE[..]),
        ("LK_SINGLE_TURN", SINGLE_TURN, &SINGLE_TURN_ANGLE),
        ("LK_PHASE_CURRENTS", PHASE_CURRENTS, &PHASES),
    ]
    .map(|(name, command, signals)| {
        Message::new(name, id, 8, true, signals).marked(Marks::bytes([command]))
    });
    let asked = ASKED.map(|(name, command)| {
        let marks = Marks::bytes([command, 0, 0, 0, 0, 0, 0, 0]);
        Message::new(name, id, 8, false, &[]).marked(marks)
    });
    let moves = MOVES.map(|(name, command, zero, signals)| {
        let [a, b, c, d, e, f, g] = zero;
        let marks = Marks::masked([0xFF, a, b, c, d, e, f, g], [command, 0, 0, 0, 0, 0, 0, 0]);
        let signals = if command == CURRENT { current } else { signals };
        Message::new(name, id, 8, false, signals).marked(marks)
    });
    messages.extend(moved.into_iter().chain(told).chain(asked).chain(moves));
    Ok(messages)
}

/// The most messages of a drive.
pub const MOST: usize = 2 + 2 + 3 + ASKED.len() + MOVES.len();

/// Commands without a value: nothing but zeros follows. A drive echoes the first three.
const ASKED: [(&str, u8); 9] = [
    ("LK_OFF", OFF),
    ("LK_STOP", STOP),
    ("LK_RUN", RUN),
    ("LK_READ_ERRORS", HEALTH),
    ("LK_CLEAR_ERRORS", CLEAR_ERRORS),
    ("LK_READ_MEASUREMENT", MOTION),
    ("LK_READ_PHASE_CURRENTS", PHASE_CURRENTS),
    ("LK_READ_MULTI_TURN", MULTI_TURN),
    ("LK_READ_SINGLE_TURN", SINGLE_TURN),
];

/// Commands with a value, and their zero bits, which tell them from answers but at 0 °C.
const MOVES: [(&str, u8, [u8; 7], &[Signal]); 9] = {
    const NO_LIMIT: [u8; 7] = [0xFF, 0xFF, 0xFF, 0, 0, 0, 0];
    const LIMIT: [u8; 7] = [0xFF, 0, 0, 0, 0, 0, 0];
    const EFFORT: [u8; 7] = [0xFF, 0xFF, 0xFF, 0, 0, 0xFF, 0xFF];
    const WAY_NO_LIMIT: [u8; 7] = [0xFE, 0xFF, 0xFF, 0, 0, 0xFF, 0xFF];
    const WAY_LIMIT: [u8; 7] = [0xFE, 0, 0, 0, 0, 0xFF, 0xFF];
    [
        ("LK_OPEN_LOOP", OPEN_LOOP, EFFORT, &[POWER]),
        // Its scale is the model's.
        ("LK_CURRENT", CURRENT, EFFORT, &[]),
        ("LK_SPEED", SPEED, NO_LIMIT, &[SPEED_WANTED]),
        ("LK_TURN_TO", TURN_TO, NO_LIMIT, &[ANGLE]),
        ("LK_TURN_TO", TURN_TO_LIMITED, LIMIT, &[ANGLE, SPEED_LIMIT]),
        ("LK_TURN_WITHIN", TURN_WITHIN, WAY_NO_LIMIT, &[ANGLE, WAY]),
        ("LK_TURN_WITHIN", TURN_WITHIN_LIMITED, WAY_LIMIT, &[ANGLE, WAY, SPEED_LIMIT]),
        ("LK_TURN_BY", TURN_BY, NO_LIMIT, &[ANGLE]),
        ("LK_TURN_BY", TURN_BY_LIMITED, LIMIT, &[ANGLE, SPEED_LIMIT]),
    ]
};
const POWER: Signal = Signal::little("POWER", 4, 2).signed();
const SPEED_WANTED: Signal = Signal::little("ROTOR_SPEED", 4, 4).signed().scaled(0.01, "deg/s");
const ANGLE: Signal = Signal::little("ROTOR_ANGLE", 4, 4).signed().scaled(0.01, "deg");
const SPEED_LIMIT: Signal = Signal::little("SPEED_LIMIT", 2, 2).scaled(1.0, "deg/s");
const WAY: Signal =
    Signal::little("DIRECTION", 1, 1).named(&[(0, "clockwise"), (1, "counter-clockwise")]);

static MULTI_TURN_ANGLE: [Signal; 1] =
    [Signal::little("ROTOR_ANGLE", 1, 7).signed().scaled(0.01, "deg")];
static SINGLE_TURN_ANGLE: [Signal; 1] = [Signal::little("ROTOR_ANGLE", 4, 4).scaled(0.01, "deg")];
static PHASES: [Signal; 4] = [
    Signal::little("TEMPERATURE", 1, 1).signed().scaled(1.0, "degC"),
    Signal::little("PHASE_A", 2, 2).signed().scaled(1.0 / 64.0, "A"),
    Signal::little("PHASE_B", 4, 2).signed().scaled(1.0 / 64.0, "A"),
    Signal::little("PHASE_C", 6, 2).signed().scaled(1.0 / 64.0, "A"),
];

static LANES: [Signal; 4] = [
    Signal::little("CURRENT_1", 0, 2).signed(),
    Signal::little("CURRENT_2", 2, 2).signed(),
    Signal::little("CURRENT_3", 4, 2).signed(),
    Signal::little("CURRENT_4", 6, 2).signed(),
];

/// Meanings of byte 0 of an answer: the command that it answers.
static COMMANDS: &[(u32, &str)] = &[
    (OFF as u32, "off"),
    (RUN as u32, "run"),
    (HEALTH as u32, "errors"),
    (CLEAR_ERRORS as u32, "errors cleared"),
    (MOTION as u32, "measurement"),
    (CURRENT as u32, "torque current"),
    (STOP as u32, "stop"),
    (OPEN_LOOP as u32, "open loop"),
    (SPEED as u32, "speed"),
    (TURN_TO as u32, "turn to"),
    (TURN_TO_LIMITED as u32, "turn to, limited"),
    (TURN_WITHIN as u32, "turn within"),
    (TURN_WITHIN_LIMITED as u32, "turn within, limited"),
    (TURN_BY as u32, "turn by"),
    (TURN_BY_LIMITED as u32, "turn by, limited"),
    (MULTI_TURN as u32, "multi-turn angle"),
    (SINGLE_TURN as u32, "single-turn angle"),
    (PHASE_CURRENTS as u32, "phase currents"),
];

/// Names of the error bits, lowest first: in the answer to `9A`, and to `9B`.
const ERROR_NAMES: [[&str; 2]; 8] = [
    ["SUPPLY_TOO_LOW", "CLEARED_SUPPLY_TOO_LOW"],
    ["SUPPLY_TOO_HIGH", "CLEARED_SUPPLY_TOO_HIGH"],
    ["CONTROLLER_TOO_HOT", "CLEARED_CONTROLLER_TOO_HOT"],
    ["MOTOR_TOO_HOT", "CLEARED_MOTOR_TOO_HOT"],
    ["CURRENT_TOO_HIGH", "CLEARED_CURRENT_TOO_HIGH"],
    ["SHORT_CIRCUIT", "CLEARED_SHORT_CIRCUIT"],
    ["STALLED", "CLEARED_STALLED"],
    ["COMMANDS_STOPPED", "CLEARED_COMMANDS_STOPPED"],
];

/// One switch, two measurements of four, two reports of two and eight bits.
const ANSWERS: usize = 1 + 2 * 4 + 2 * (2 + 8);

const fn answer_signals(amps_per_count: f64, bits: u32) -> [Signal; ANSWERS] {
    const COMMAND: Signal = Signal::little("COMMAND", 0, 1).named(COMMANDS).when(Presence::Switch);
    const MEASURED: [[&str; 4]; 2] = [
        ["TEMPERATURE", "CURRENT", "ROTOR_SPEED", "ROTOR_ANGLE"],
        ["POLLED_TEMPERATURE", "POLLED_CURRENT", "POLLED_ROTOR_SPEED", "POLLED_ROTOR_ANGLE"],
    ];
    const REPORTED: [[&str; 2]; 2] =
        [["REPORTED_TEMPERATURE", "SUPPLY"], ["CLEARED_TEMPERATURE", "CLEARED_SUPPLY"]];
    let amps = if amps_per_count < 1.0 { "A" } else { "" };
    let degrees = 360.0 / (1_u32 << bits) as f64;
    let mut signals = [COMMAND; ANSWERS];
    let mut next = 1;
    let mut kind = 0;
    while kind < 2 {
        let when = Presence::If(if kind == 0 { CURRENT as u32 } else { MOTION as u32 });
        let [temperature, current, speed, angle] = MEASURED[kind];
        let little = Signal::little;
        signals[next] = little(temperature, 1, 1).signed().scaled(1.0, "degC").when(when);
        signals[next + 1] = little(current, 2, 2).signed().scaled(amps_per_count, amps).when(when);
        signals[next + 2] = little(speed, 4, 2).signed().scaled(1.0, "deg/s").when(when);
        signals[next + 3] = little(angle, 6, 2).scaled(degrees, "deg").when(when);
        let when = Presence::If(if kind == 0 { HEALTH as u32 } else { CLEAR_ERRORS as u32 });
        let [temperature, supply] = REPORTED[kind];
        signals[next + 4] = little(temperature, 1, 1).signed().scaled(1.0, "degC").when(when);
        signals[next + 5] = little(supply, 3, 2).scaled(0.1, "V").when(when);
        next += 6;
        let mut bit = 0;
        while bit < 8 {
            let name = ERROR_NAMES[bit as usize][kind];
            let signal = Signal::new(name, ByteOrder::Little, 56 + bit, 1);
            signals[next] = signal.flag(&ERROR_TEXTS[bit as usize]).when(when);
            next += 1;
            bit += 1;
        }
        kind += 1;
    }
    signals
}

struct Table {
    answers: [Signal; ANSWERS],
    /// In the answer to any command that moves.
    motion: [Signal; 5],
    current: [Signal; 1],
}

const fn of_encoder(amps_per_count: f64, bits: u32) -> Table {
    let answers = answer_signals(amps_per_count, bits);
    let [a, b, current, c, d, ..] = answers;
    let all = Presence::Always;
    let motion = [a.when(all), b.when(all), current.when(all), c.when(all), d.when(all)];
    let current = [Signal::little("CURRENT", 4, 2).signed().scaled(amps_per_count, current.unit)];
    Table { answers, motion, current }
}

const fn of_every_encoder(amps_per_count: f64) -> [Table; 3] {
    [of_encoder(amps_per_count, 14), of_encoder(amps_per_count, 15), of_encoder(amps_per_count, 16)]
}

static MG: [Table; 3] = of_every_encoder(33.0 / 2048.0);
static MF: [Table; 3] = of_every_encoder(16.5 / 2048.0);
static STEPS: [Table; 3] = of_every_encoder(1.0);

fn table(model: &Model) -> &'static Table {
    let is_that_of =
        |other: Model| model.amps_per_count.to_bits() == other.amps_per_count.to_bits();
    let tables = if is_that_of(Model::mg(model.encoder)) {
        &MG
    } else if is_that_of(Model::mf(model.encoder)) {
        &MF
    } else {
        &STEPS
    };
    &tables[model.encoder as usize - EncoderBits::Fourteen as usize]
}
