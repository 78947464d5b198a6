//! What stands in an axis's frames.

use heapless::Vec;
use rc10_app::ConfigError;

use super::config::{Config, Rates};
use super::firmware::Firmware;
use super::wire::{
    AXIS_STATES, CLEAR_ERRORS, CURRENTS, ControlMode, ESTIMATES, HEARTBEAT, LIMITS, MODES,
    POSITION, STATE, SUPPLY, TEMPERATURES, TORQUE, VELOCITY,
};
use crate::signals::{ByteOrder, Message, Signal};

/// What a DBC cannot say.
pub const NOT_IN_DBC: &[&str] = &[
    "ODrive: the heartbeat's error bits that the firmware does not document are not in the DBC, and \
     none of a firmware that is neither 0.5 nor 0.6.",
    "ODrive: questions are remote frames, which a DBC does not describe.",
];

/// Every frame of an axis's wiring, those it sends first. Positions, speeds and torques are those of
/// the encoder's shaft.
///
/// # Errors
/// [`ConfigError`] as for [`ODrive::new`](super::ODrive::new).
pub fn messages(node: u8, config: &Config) -> Result<Vec<Message, 10>, ConfigError> {
    let node = config.checked(node)?;
    let mut messages = Vec::new();
    let mut add = |name, number, len, from_device, signals| {
        let id = node.can_id(number).into();
        // Ten fit.
        let _ = messages.push(Message { name, id, len, from_device, signals });
    };
    let Rates { currents, temperatures, supply, .. } = config.rates;
    add("ODRIVE_HEARTBEAT", HEARTBEAT, 8, true, heartbeat(&config.firmware));
    add("ODRIVE_ESTIMATES", ESTIMATES, 8, true, &ESTIMATE_SIGNALS);
    for (rate, name, number, signals) in [
        (currents, "ODRIVE_CURRENTS", CURRENTS, &CURRENT_SIGNALS),
        (temperatures, "ODRIVE_TEMPERATURES", TEMPERATURES, &TEMPERATURE_SIGNALS),
        (supply, "ODRIVE_SUPPLY", SUPPLY, &SUPPLY_SIGNALS),
    ] {
        if rate > 0 {
            add(name, number, 8, true, signals.as_slice());
        }
    }
    add("ODRIVE_SET_STATE", STATE, 8, false, &STATE_SIGNALS);
    add("ODRIVE_SET_MODES", MODES, 8, false, &MODE_SIGNALS);
    match config.control.modes().0 {
        ControlMode::Velocity => {
            add("ODRIVE_SET_VELOCITY", VELOCITY, 8, false, &VELOCITY_SIGNALS);
        }
        ControlMode::Position => {
            add("ODRIVE_SET_POSITION", POSITION, 8, false, &POSITION_SIGNALS);
        }
        ControlMode::Torque | ControlMode::Voltage => {
            add("ODRIVE_SET_TORQUE", TORQUE, 8, false, &TORQUE_SIGNALS);
        }
    }
    if config.limits.is_some() {
        add("ODRIVE_SET_LIMITS", LIMITS, 8, false, &LIMIT_SIGNALS);
    }
    add("ODRIVE_CLEAR_ERRORS", CLEAR_ERRORS, 0, false, &[]);
    Ok(messages)
}

const fn float(name: &'static str, first: u8, unit: &'static str) -> Signal {
    Signal::little(name, first, 4).float().scaled(1.0, unit)
}

static ESTIMATE_SIGNALS: [Signal; 2] = [float("POSITION", 0, "rev"), float("VELOCITY", 4, "rev/s")];
static CURRENT_SIGNALS: [Signal; 2] =
    [float("CURRENT_SETPOINT", 0, "A"), float("CURRENT_MEASURED", 4, "A")];
static TEMPERATURE_SIGNALS: [Signal; 2] =
    [float("CONTROLLER_TEMPERATURE", 0, "degC"), float("MOTOR_TEMPERATURE", 4, "degC")];
static SUPPLY_SIGNALS: [Signal; 2] =
    [float("SUPPLY_VOLTAGE", 0, "V"), float("SUPPLY_CURRENT", 4, "A")];
static STATE_SIGNALS: [Signal; 1] = [Signal::little("REQUESTED_STATE", 0, 4).named(&STATES)];
static MODE_SIGNALS: [Signal; 2] = [
    Signal::little("CONTROL_MODE", 0, 4).named(CONTROL_MODES),
    Signal::little("INPUT_MODE", 4, 4).named(INPUT_MODES),
];
static VELOCITY_SIGNALS: [Signal; 2] =
    [float("INPUT_VELOCITY", 0, "rev/s"), float("INPUT_TORQUE", 4, "Nm")];
static POSITION_SIGNALS: [Signal; 3] = [
    float("INPUT_POSITION", 0, "rev"),
    Signal::little("INPUT_VELOCITY", 4, 2).signed().scaled(0.001, "rev/s"),
    Signal::little("INPUT_TORQUE", 6, 2).signed().scaled(0.001, "Nm"),
];
static TORQUE_SIGNALS: [Signal; 1] = [float("INPUT_TORQUE", 0, "Nm")];
static LIMIT_SIGNALS: [Signal; 2] =
    [float("VELOCITY_LIMIT", 0, "rev/s"), float("CURRENT_LIMIT", 4, "A")];

/// The names of the states, in the words of the codec.
static STATES: [(u32, &str); AXIS_STATES.len()] = {
    let mut states = [(0, ""); AXIS_STATES.len()];
    let mut state = 0;
    while state < states.len() {
        #[expect(clippy::cast_possible_truncation, reason = "fifteen")]
        let number = state as u32;
        states[state] = (number, AXIS_STATES[state]);
        state += 1;
    }
    states
};

static CONTROL_MODES: &[(u32, &str)] =
    &[(0, "voltage"), (1, "torque"), (2, "velocity"), (3, "position")];
static INPUT_MODES: &[(u32, &str)] = &[
    (0, "inactive"),
    (1, "passthrough"),
    (2, "velocity ramp"),
    (3, "position filter"),
    (4, "mix channels"),
    (5, "trapezoid"),
    (6, "torque ramp"),
    (7, "mirror"),
    (8, "tuning"),
];

/// A bit that is set, in the words of the codec.
const fn texts<const N: usize>(firmware: &Firmware) -> [[(u32, &'static str); 1]; N] {
    let mut texts = [[(1, "")]; N];
    let mut index = 0;
    while index < N {
        texts[index][0].1 = firmware.errors[index].1;
        index += 1;
    }
    texts
}

const ERRORS_0_5: usize = Firmware::V0_5.errors.len();
const ERRORS_0_6: usize = Firmware::V0_6.errors.len();
static TEXTS_0_5: [[(u32, &str); 1]; ERRORS_0_5] = texts(&Firmware::V0_5);
static TEXTS_0_6: [[(u32, &str); 1]; ERRORS_0_6] = texts(&Firmware::V0_6);

/// Of the error bits, by number.
const ERROR_NAMES: [&str; 32] = [
    "ERROR_0", "ERROR_1", "ERROR_2", "ERROR_3", "ERROR_4", "ERROR_5", "ERROR_6", "ERROR_7",
    "ERROR_8", "ERROR_9", "ERROR_10", "ERROR_11", "ERROR_12", "ERROR_13", "ERROR_14", "ERROR_15",
    "ERROR_16", "ERROR_17", "ERROR_18", "ERROR_19", "ERROR_20", "ERROR_21", "ERROR_22", "ERROR_23",
    "ERROR_24", "ERROR_25", "ERROR_26", "ERROR_27", "ERROR_28", "ERROR_29", "ERROR_30", "ERROR_31",
];

const fn bit(name: &'static str, number: u8) -> Signal {
    Signal::new(name, ByteOrder::Little, number, 1)
}

const AXIS_STATE: Signal = Signal::little("AXIS_STATE", 4, 1).named(&STATES);

/// Firmware 0.5: what has failed, and whether a trajectory is done.
const DETAILS_0_5: [Signal; 5] = [
    AXIS_STATE,
    bit("MOTOR_ERROR", 40),
    bit("ENCODER_ERROR", 48),
    bit("CONTROLLER_ERROR", 56),
    bit("TRAJECTORY_DONE", 63),
];
/// Firmware 0.6: the last procedure's result, and whether a trajectory is done.
const DETAILS_0_6: [Signal; 3] =
    [AXIS_STATE, Signal::little("PROCEDURE_RESULT", 5, 1), bit("TRAJECTORY_DONE", 48)];

const fn with_errors<const ALL: usize>(
    details: &[Signal],
    firmware: &Firmware,
    texts: &'static [[(u32, &'static str); 1]],
) -> [Signal; ALL] {
    let mut signals = [AXIS_STATE; ALL];
    let mut next = 0;
    while next < details.len() {
        signals[next] = details[next];
        next += 1;
    }
    let mut index = 0;
    while next < ALL {
        let number = firmware.errors[index].0;
        signals[next] = bit(ERROR_NAMES[number as usize], number).named(&texts[index]);
        next += 1;
        index += 1;
    }
    signals
}

static HEARTBEAT_0_5: [Signal; DETAILS_0_5.len() + ERRORS_0_5] =
    with_errors(&DETAILS_0_5, &Firmware::V0_5, &TEXTS_0_5);
static HEARTBEAT_0_6: [Signal; DETAILS_0_6.len() + ERRORS_0_6] =
    with_errors(&DETAILS_0_6, &Firmware::V0_6, &TEXTS_0_6);
static HEARTBEAT_OTHER: [Signal; 1] = [AXIS_STATE];

fn heartbeat(firmware: &Firmware) -> &'static [Signal] {
    if *firmware == Firmware::V0_5 {
        &HEARTBEAT_0_5
    } else if *firmware == Firmware::V0_6 {
        &HEARTBEAT_0_6
    } else {
        &HEARTBEAT_OTHER
    }
}
