//! The layout of an axis's frames.

use embedded_can::Id;
use heapless::Vec;
use rc10_app::ConfigError;

use super::config::{Config, Firmware};
use super::wire::{
    AXIS_STATES, CLEAR_ERRORS, CURRENTS, ESTIMATES, HEARTBEAT, LIMITS, MODES, POSITION, STATE,
    SUPPLY, TEMPERATURES, TORQUE, VELOCITY,
};
use crate::signals::{ByteOrder, Marks, Message, Signal};

/// Content of the frames that a DBC file cannot describe.
pub const NOT_IN_DBC: &[&str] = &[
    "ODrive: the heartbeat's error bits that the firmware does not document are not in the DBC, and \
     none of a firmware that is neither 0.5 nor 0.6.",
    "ODrive: questions are remote frames, which a DBC does not describe.",
];

/// Every frame from or to an axis, then remote requests; of one identifier the one in a DBC first.
/// Positions, speeds and torques are the encoder's.
///
/// # Errors
/// [`ConfigError`] as for [`ODrive::new`](super::ODrive::new).
pub fn messages(config: &Config) -> Result<Vec<Message, MOST>, ConfigError> {
    let node = config.checked_node()?;
    let firmware = &config.firmware;
    let (frames, asks) =
        if firmware.has_temperatures { (FRAMES_0_6, ASKS_0_6) } else { (FRAMES_0_5, ASKS_0_5) };
    let mut messages: Vec<_, MOST> = Vec::new();
    let heartbeat: [Row; 1] = [("ODRIVE_HEARTBEAT", HEARTBEAT, 8, true, heartbeat(firmware))];
    for &(name, number, len, from_device, signals) in heartbeat.iter().chain(FRAMES).chain(frames) {
        let id = Id::from(node.can_id(number));
        let message = Message::new(name, id, len, from_device, signals);
        // A DBC has one length for an identifier.
        let is_other = messages.iter().any(|known: &Message| known.id == id);
        let message = if is_other { message.marked(Marks::behind(len)) } else { message };
        // As many as MOST fit.
        let _ = messages.push(message);
    }
    for &(name, number) in ASKS.iter().chain(asks) {
        let id = Id::from(node.can_id(number));
        let _ = messages.push(Message::new(name, id, 8, false, &[]).requested());
    }
    Ok(messages)
}

/// Name, number, data bytes, whether the axis sends it, and what stands in it.
type Row = (&'static str, u8, u8, bool, &'static [Signal]);

/// The frames of both firmwares, but for the heartbeat.
#[rustfmt::skip] // A table: what stands in a frame has a line of its own where it needs one.
const FRAMES: &[Row] = &[
    ("ODRIVE_ESTIMATES", ESTIMATES, 8, true, &ESTIMATE_SIGNALS),
    ("ODRIVE_CURRENTS", CURRENTS, 8, true,
        &[float("CURRENT_SETPOINT", 0, "A"), float("CURRENT_MEASURED", 4, "A")]),
    ("ODRIVE_SUPPLY", SUPPLY, 8, true,
        &[float("SUPPLY_VOLTAGE", 0, "V"), float("SUPPLY_CURRENT", 4, "A")]),
    ("ODRIVE_EMERGENCY_STOP", 0x02, 0, false, &[]),
    ("ODRIVE_SET_STATE", STATE, 8, false, &STATE_SIGNALS),
    ("ODRIVE_SET_STATE", STATE, 4, false, &STATE_SIGNALS),
    ("ODRIVE_SET_MODES", MODES, 8, false,
        &[Signal::little("CONTROL_MODE", 0, 4).listed(0, CONTROL_MODES),
          Signal::little("INPUT_MODE", 4, 4).listed(0, INPUT_MODES)]),
    ("ODRIVE_SET_POSITION", POSITION, 8, false,
        &[float("INPUT_POSITION", 0, "rev"),
          Signal::little("INPUT_VELOCITY", 4, 2).signed().scaled(0.001, "rev/s"),
          Signal::little("INPUT_TORQUE", 6, 2).signed().scaled(0.001, "Nm")]),
    ("ODRIVE_SET_VELOCITY", VELOCITY, 8, false,
        &[float("INPUT_VELOCITY", 0, "rev/s"), float("INPUT_TORQUE", 4, "Nm")]),
    ("ODRIVE_SET_TORQUE", TORQUE, 8, false, &TORQUE_SIGNALS),
    ("ODRIVE_SET_TORQUE", TORQUE, 4, false, &TORQUE_SIGNALS),
    ("ODRIVE_SET_LIMITS", LIMITS, 8, false,
        &[float("VELOCITY_LIMIT", 0, "rev/s"), float("CURRENT_LIMIT", 4, "A")]),
    ("ODRIVE_SET_TRAJECTORY_VELOCITY", 0x11, 8, false, &[float("VELOCITY_LIMIT", 0, "rev/s")]),
    ("ODRIVE_SET_TRAJECTORY_VELOCITY", 0x11, 4, false, &[float("VELOCITY_LIMIT", 0, "rev/s")]),
    ("ODRIVE_SET_TRAJECTORY_ACCELERATION", 0x12, 8, false,
        &[float("ACCELERATION_LIMIT", 0, "rev/s2"), float("DECELERATION_LIMIT", 4, "rev/s2")]),
    ("ODRIVE_SET_INERTIA", 0x13, 8, false, &[float("INERTIA", 0, "")]),
    ("ODRIVE_SET_INERTIA", 0x13, 4, false, &[float("INERTIA", 0, "")]),
    ("ODRIVE_REBOOT", 0x16, 0, false, &[]),
    ("ODRIVE_CLEAR_ERRORS", CLEAR_ERRORS, 0, false, &[]),
    ("ODRIVE_SET_POSITION_GAIN", 0x1A, 8, false, &[float("POSITION_GAIN", 0, "")]),
    ("ODRIVE_SET_POSITION_GAIN", 0x1A, 4, false, &[float("POSITION_GAIN", 0, "")]),
    ("ODRIVE_SET_VELOCITY_GAINS", 0x1B, 8, false,
        &[float("VELOCITY_GAIN", 0, ""), float("VELOCITY_INTEGRATOR_GAIN", 4, "")]),
];
/// Firmware 0.5.6, `can_simple.hpp` and `can_simple.cpp`.
#[rustfmt::skip]
const FRAMES_0_5: &[Row] = &[
    ("ODRIVE_MOTOR_ERROR", 0x03, 8, true, &[Signal::little("MOTOR_ERROR_BITS", 0, 8)]),
    ("ODRIVE_ENCODER_ERROR", 0x04, 8, true, &[Signal::little("ENCODER_ERROR_BITS", 0, 4)]),
    ("ODRIVE_SENSORLESS_ERROR", 0x05, 8, true, &[Signal::little("SENSORLESS_ERROR_BITS", 0, 4)]),
    ("ODRIVE_SET_NODE", 0x06, 8, false, &[Signal::little("NODE", 0, 4)]),
    ("ODRIVE_ENCODER_COUNT", 0x0A, 8, true,
        &[Signal::little("SHADOW_COUNT", 0, 4).signed(),
          Signal::little("COUNT_IN_TURN", 4, 4).signed()]),
    ("ODRIVE_START_ANTICOGGING", 0x10, 0, false, &[]),
    ("ODRIVE_SENSORLESS_ESTIMATES", 0x15, 8, true, &ESTIMATE_SIGNALS),
    ("ODRIVE_SET_LINEAR_COUNT", 0x19, 8, false, &[Signal::little("COUNT", 0, 4).signed()]),
    ("ODRIVE_CONTROLLER_ERROR", 0x1D, 8, true, &[Signal::little("CONTROLLER_ERROR_BITS", 0, 4)]),
];
/// Firmware 0.6: the vendor's CAN page and DBC. An endpoint's value has the size of its type.
#[rustfmt::skip]
const FRAMES_0_6: &[Row] = &[
    ("ODRIVE_TEMPERATURES", TEMPERATURES, 8, true,
        &[float("CONTROLLER_TEMPERATURE", 0, "degC"), float("MOTOR_TEMPERATURE", 4, "degC")]),
    ("ODRIVE_VERSION", 0x00, 8, true,
        &[Signal::little("PROTOCOL", 0, 1), Signal::little("FIRMWARE_MAJOR", 4, 1),
          Signal::little("FIRMWARE_MINOR", 5, 1), Signal::little("FIRMWARE_REVISION", 6, 1)]),
    ("ODRIVE_ERRORS", 0x03, 8, true,
        &[Signal::little("ACTIVE_ERRORS", 0, 4), Signal::little("DISARM_REASON", 4, 4)]),
    ("ODRIVE_ENDPOINT_REQUEST", 0x04, 8, false, &[OPERATION, ENDPOINT, VALUE_4, REAL]),
    ("ODRIVE_READ_ENDPOINT", 0x04, 4, false, &[ENDPOINT]),
    ("ODRIVE_ENDPOINT_REQUEST", 0x04, 5, false, &[OPERATION, ENDPOINT, VALUE_1]),
    ("ODRIVE_ENDPOINT_REQUEST", 0x04, 6, false, &[OPERATION, ENDPOINT, VALUE_2]),
    ("ODRIVE_ENDPOINT_HOLDS", 0x05, 8, true, &[ENDPOINT, VALUE_4, REAL]),
    ("ODRIVE_ENDPOINT_HOLDS", 0x05, 5, true, &[ENDPOINT, VALUE_1]),
    ("ODRIVE_ENDPOINT_HOLDS", 0x05, 6, true, &[ENDPOINT, VALUE_2]),
    ("ODRIVE_ADDRESS", 0x06, 8, true,
        &[Signal::little("NODE", 0, 1), Signal::little("SERIAL_NUMBER", 1, 6)]),
    ("ODRIVE_REBOOT", 0x16, 1, false, &[Signal::little("ACTION", 0, 1)]),
    ("ODRIVE_CLEAR_ERRORS", CLEAR_ERRORS, 1, false, &[Signal::little("IDENTIFY", 0, 1)]),
    ("ODRIVE_SET_ABSOLUTE_POSITION", 0x19, 4, false, &[float("POSITION", 0, "rev")]),
    ("ODRIVE_TORQUES", 0x1C, 8, true,
        &[float("TORQUE_TARGET", 0, "Nm"), float("TORQUE_ESTIMATE", 4, "Nm")]),
    ("ODRIVE_POWERS", 0x1D, 8, true,
        &[float("ELECTRICAL_POWER", 0, "W"), float("MECHANICAL_POWER", 4, "W")]),
    ("ODRIVE_ENTER_DFU", 0x1F, 0, false, &[]),
];

/// Messages that can be asked for with a remote request.
const ASKS: &[(&str, u8)] = &[
    ("ODRIVE_ASK_HEARTBEAT", HEARTBEAT),
    ("ODRIVE_ASK_ESTIMATES", ESTIMATES),
    ("ODRIVE_ASK_CURRENTS", CURRENTS),
    ("ODRIVE_ASK_SUPPLY", SUPPLY),
];
const ASKS_0_5: &[(&str, u8)] = &[
    ("ODRIVE_ASK_MOTOR_ERROR", 0x03),
    ("ODRIVE_ASK_ENCODER_ERROR", 0x04),
    ("ODRIVE_ASK_SENSORLESS_ERROR", 0x05),
    ("ODRIVE_ASK_ENCODER_COUNT", 0x0A),
    ("ODRIVE_ASK_SENSORLESS_ESTIMATES", 0x15),
    ("ODRIVE_ASK_CONTROLLER_ERROR", 0x1D),
];
const ASKS_0_6: &[(&str, u8)] = &[
    ("ODRIVE_ASK_VERSION", 0x00),
    ("ODRIVE_ASK_ERRORS", 0x03),
    ("ODRIVE_ASK_ADDRESS", 0x06),
    ("ODRIVE_ASK_TEMPERATURES", TEMPERATURES),
    ("ODRIVE_ASK_TORQUES", 0x1C),
    ("ODRIVE_ASK_POWERS", 0x1D),
];

/// The most messages of an axis: the heartbeat, the other frames, and the requests.
pub const MOST: usize = 1 + FRAMES.len() + FRAMES_0_6.len() + ASKS.len() + ASKS_0_6.len();

const OPERATION: Signal = Signal::little("OPERATION", 0, 1).named(&[(0, "read"), (1, "write")]);
const ENDPOINT: Signal = Signal::little("ENDPOINT", 1, 2);
const VALUE_1: Signal = Signal::little("VALUE", 4, 1);
const VALUE_2: Signal = Signal::little("VALUE", 4, 2);
const VALUE_4: Signal = Signal::little("VALUE", 4, 4);
const REAL: Signal = float("VALUE_AS_FLOAT", 4, "");

const fn float(name: &'static str, first: u8, unit: &'static str) -> Signal {
    Signal::little(name, first, 4).float().scaled(1.0, unit)
}

static ESTIMATE_SIGNALS: [Signal; 2] = [float("POSITION", 0, "rev"), float("VELOCITY", 4, "rev/s")];
static STATE_SIGNALS: [Signal; 1] =
    [Signal::little("REQUESTED_STATE", 0, 4).listed(0, &AXIS_STATES)];
static TORQUE_SIGNALS: [Signal; 1] = [float("INPUT_TORQUE", 0, "Nm")];

const CONTROL_MODES: &[&str] = &["voltage", "torque", "velocity", "position"];
const INPUT_MODES: &[&str] = &[
    "inactive",
    "passthrough",
    "velocity ramp",
    "position filter",
    "mix channels",
    "trapezoid",
    "torque ramp",
    "mirror",
    "tuning",
];

/// Names of the error bits, by number.
const ERROR_NAMES: [&str; 32] = [
    "ERROR_0", "ERROR_1", "ERROR_2", "ERROR_3", "ERROR_4", "ERROR_5", "ERROR_6", "ERROR_7",
    "ERROR_8", "ERROR_9", "ERROR_10", "ERROR_11", "ERROR_12", "ERROR_13", "ERROR_14", "ERROR_15",
    "ERROR_16", "ERROR_17", "ERROR_18", "ERROR_19", "ERROR_20", "ERROR_21", "ERROR_22", "ERROR_23",
    "ERROR_24", "ERROR_25", "ERROR_26", "ERROR_27", "ERROR_28", "ERROR_29", "ERROR_30", "ERROR_31",
];

const fn bit(name: &'static str, number: u8) -> Signal {
    Signal::new(name, ByteOrder::Little, number, 1)
}

const AXIS_STATE: Signal = Signal::little("AXIS_STATE", 4, 1).listed(0, &AXIS_STATES);

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
    errors: &'static [(u8, &'static str)],
) -> [Signal; ALL] {
    let mut signals = [AXIS_STATE; ALL];
    let mut next = 0;
    while next < details.len() {
        signals[next] = details[next];
        next += 1;
    }
    let mut index = 0;
    while next < ALL {
        let (number, text) = &errors[index];
        signals[next] = bit(ERROR_NAMES[*number as usize], *number).flag(text);
        next += 1;
        index += 1;
    }
    signals
}

static HEARTBEAT_0_5: [Signal; DETAILS_0_5.len() + Firmware::V0_5.errors.len()] =
    with_errors(&DETAILS_0_5, Firmware::V0_5.errors);
static HEARTBEAT_0_6: [Signal; DETAILS_0_6.len() + Firmware::V0_6.errors.len()] =
    with_errors(&DETAILS_0_6, Firmware::V0_6.errors);
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
