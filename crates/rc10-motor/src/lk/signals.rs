//! What stands in an LK drive's frames.

use embedded_can::Id;
use heapless::Vec;
use rc10_app::ConfigError;

use super::config::{Commands, Config};
use super::models::{EncoderBits, Model};
use super::wire::{CLEAR_ERRORS, CURRENT, ERROR_TEXTS, HEALTH, MOTION, MULTI_MOTOR_ID, OFF, RUN};
use crate::signals::{ByteOrder, Message, Presence, Signal};

/// What a DBC cannot say.
pub const NOT_IN_DBC: &[&str] = &[
    "LK: commands to a drive have the identifier of its answers, and a DBC has room for one of \
     both: the answers are in it. Commands are byte 0 (80 off, 88 run, 9A, 9B, 9C questions, A1 \
     torque current) and, for A1, the current in bytes 4 and 5.",
    "LK: in the multi-motor frame the currents are steps, whose size depends on each drive's model: \
     33/2048 A for MG, 16.5/2048 A for MF.",
];

/// The answers of a drive, and in multi-motor mode the frame that commands it, which is the same
/// for all drives of a bus. Angles and speeds are the rotor's. A model whose current step is neither
/// that of MG nor that of MF has its current in steps.
///
/// # Errors
/// [`ConfigError`] as for [`Lk::new`](super::Lk::new).
pub fn messages(id: u8, config: &Config) -> Result<Vec<Message, 2>, ConfigError> {
    let (id, _) = config.checked(id)?;
    let message =
        |name, id: Id, from_device, signals| Message { name, id, len: 8, from_device, signals };
    let mut messages = Vec::new();
    // Two fit.
    let _ = messages.push(message("LK_ANSWER", id.can_id().into(), true, answers(&config.model)));
    if config.commands == Commands::MultiMotor {
        let _ = messages.push(message("LK_MULTI_MOTOR", MULTI_MOTOR_ID.into(), false, &LANES));
    }
    Ok(messages)
}

static LANES: [Signal; 4] = [
    Signal::little("CURRENT_1", 0, 2).signed(),
    Signal::little("CURRENT_2", 2, 2).signed(),
    Signal::little("CURRENT_3", 4, 2).signed(),
    Signal::little("CURRENT_4", 6, 2).signed(),
];

/// What byte 0 of an answer means.
static COMMANDS: &[(u32, &str)] = &[
    (OFF as u32, "off"),
    (RUN as u32, "run"),
    (HEALTH as u32, "errors"),
    (CLEAR_ERRORS as u32, "errors cleared"),
    (MOTION as u32, "measurement"),
    (CURRENT as u32, "torque current"),
];

/// A bit that is set, in the words of the codec.
static TEXTS: [[(u32, &str); 1]; 8] = {
    let mut texts = [[(1, "")]; 8];
    let mut bit = 0;
    while bit < 8 {
        texts[bit][0].1 = ERROR_TEXTS[bit];
        bit += 1;
    }
    texts
};

/// Of the error bits, lowest first: in the answer to `9A`, and to `9B`.
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
            signals[next] = signal.named(&TEXTS[bit as usize]).when(when);
            next += 1;
            bit += 1;
        }
        kind += 1;
    }
    signals
}

const fn of_every_encoder(amps_per_count: f64) -> [[Signal; ANSWERS]; 3] {
    [
        answer_signals(amps_per_count, 14),
        answer_signals(amps_per_count, 15),
        answer_signals(amps_per_count, 16),
    ]
}

static MG: [[Signal; ANSWERS]; 3] = of_every_encoder(33.0 / 2048.0);
static MF: [[Signal; ANSWERS]; 3] = of_every_encoder(16.5 / 2048.0);
static STEPS: [[Signal; ANSWERS]; 3] = of_every_encoder(1.0);

fn answers(model: &Model) -> &'static [Signal] {
    let is_that_of =
        |other: Model| model.amps_per_count.to_bits() == other.amps_per_count.to_bits();
    let [fourteen, fifteen, sixteen] = if is_that_of(Model::mg(model.encoder)) {
        &MG
    } else if is_that_of(Model::mf(model.encoder)) {
        &MF
    } else {
        &STEPS
    };
    match model.encoder {
        EncoderBits::Fourteen => fourteen,
        EncoderBits::Fifteen => fifteen,
        EncoderBits::Sixteen => sixteen,
    }
}
