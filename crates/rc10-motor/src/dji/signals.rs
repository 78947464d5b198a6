//! The layout of the frames of DJI's motors, as data: see [`crate::signals`].
//!
//! Angle and speed are the rotor's, as they are on the wire.

use embedded_can::Id;
use heapless::Vec;
use rc10_can::IdPattern;

use super::{GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508, Model};
use crate::signals::{Message, Signal};

/// Properties of DJI's frames that a DBC file cannot describe.
pub const NOT_IN_DBC: &[&str] = &[
    "DJI: angle and speed are the rotor's; gearbox and direction of the output shaft are the robot's",
    "DJI: an angle above 359.96 deg is no angle, its frame is refused",
];

/// The feedback of device `id`, its lane of the shared command frame, and the frame that begins
/// setting of identifiers, which is never sent; `None` for an unknown model or identifier.
///
/// ```
/// use rc10_motor::dji::{M3508, signals::messages};
/// let [feedback, command, _] = messages(&M3508, 2).unwrap().into_array().unwrap();
/// assert_eq!((feedback.name, feedback.signals.len()), ("M3508_FEEDBACK", 4));
/// // Bytes 2 and 3 of 0x200.
/// assert_eq!((command.name, command.signals[0].start), ("DJI_COMMAND_200", 23));
/// ```
pub fn messages(model: &Model, id: u8) -> Option<Vec<Message, 3>> {
    let table = match model {
        model if *model == M3508 => &M3508_TABLE,
        model if *model == M2006 => &M2006_TABLE,
        model if *model == GM6020_CURRENT => &GM6020_CURRENT_TABLE,
        model if *model == GM6020_VOLTAGE => &GM6020_VOLTAGE_TABLE,
        _ => return None,
    };
    let feedback_id = model.feedback_id(id).ok()?;
    let (command_id, lane) = model.command_lane(id).ok()?;
    let command = match command_id.as_raw() {
        0x200 => "DJI_COMMAND_200",
        0x1FF => "DJI_COMMAND_1FF",
        0x2FF => "DJI_COMMAND_2FF",
        0x1FE => "DJI_COMMAND_1FE",
        _ => "DJI_COMMAND_2FE",
    };
    let lane = table.lanes.get(lane / 2)?;
    Vec::from_slice(&[
        Message::new(table.name, Id::Standard(feedback_id), 8, true, table.feedback),
        Message::new(command, Id::Standard(command_id), 8, false, lane),
        Message::new("DJI_QUICK_ID_SETTING", QUICK_ID_SETTING, 8, false, &[]),
    ])
    .ok()
}

/// Eight zeros begin quick setting of identifiers (board C sample, `CAN_cmd_chassis_reset_ID`).
const QUICK_ID_SETTING: Id = IdPattern::standard(0x700).id();

struct Table {
    name: &'static str,
    feedback: &'static [Signal],
    /// Lanes of the first to the fourth device of a command frame.
    lanes: [[Signal; 1]; 4],
}

static M3508_TABLE: Table = Table {
    name: "M3508_FEEDBACK",
    feedback: &with_temperature(motion(20.0 / 16384.0)),
    lanes: lanes("CURRENT", 20.0 / 16384.0, "A"),
};

/// No temperature.
static M2006_TABLE: Table = Table {
    name: "M2006_FEEDBACK",
    feedback: &motion(10.0 / 10000.0),
    lanes: lanes("CURRENT", 10.0 / 10000.0, "A"),
};

static GM6020_CURRENT_TABLE: Table = Table {
    name: "GM6020_FEEDBACK",
    feedback: &with_temperature(motion(3.0 / 16384.0)),
    lanes: lanes("CURRENT", 3.0 / 16384.0, "A"),
};

/// The command is a part of full scale: the vendor documents no volts per count.
static GM6020_VOLTAGE_TABLE: Table =
    Table { lanes: lanes("VOLTAGE", 100.0 / 25000.0, "%"), ..GM6020_CURRENT_TABLE };

const fn motion(amps_per_count: f64) -> [Signal; 3] {
    [
        Signal::big("ROTOR_ANGLE", 0, 2).scaled(360.0 / 8192.0, "deg"),
        Signal::big("ROTOR_SPEED", 2, 2).signed().scaled(1.0, "rpm"),
        Signal::big("CURRENT", 4, 2).signed().scaled(amps_per_count, "A"),
    ]
}

const fn with_temperature([angle, speed, current]: [Signal; 3]) -> [Signal; 4] {
    [angle, speed, current, Signal::big("TEMPERATURE", 6, 1).scaled(1.0, "degC")]
}

const fn lanes(name: &'static str, factor: f64, unit: &'static str) -> [[Signal; 1]; 4] {
    const fn lane(name: &'static str, first: u8) -> Signal {
        Signal::big(name, first, 2).signed()
    }
    [
        [lane(name, 0).scaled(factor, unit)],
        [lane(name, 2).scaled(factor, unit)],
        [lane(name, 4).scaled(factor, unit)],
        [lane(name, 6).scaled(factor, unit)],
    ]
}
