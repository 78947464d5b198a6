//! The layout of the frames of a VESC, as data.
//!
//! Values are the VESC's own: electrical rpm, and its own direction.

use heapless::Vec;

use super::config::Config;
use super::wire::{Address, Packet, STATUSES};
use crate::signals::{Marks, Message, Signal};

/// Properties of a VESC's frames that a DBC file cannot describe.
pub const NOT_IN_DBC: &[&str] = &[
    "VESC: all that is sent to id 255 is for every VESC; this software sends nothing to it",
    "VESC: PONG has the identifier of who asked; VESC_PONG_FROM tells who answered",
    "VESC: no frame tells a fault; VESC Tool, or the VESC's terminal, does",
    "VESC: the current in STATUS is negative when the motor generates, whichever way it turns",
];

/// Number of all messages of a VESC, and of all that can be sent to it.
pub const MOST: usize = 6 + 1 + 2 * ORDERS.len();

/// Expected status frames, the answer to a PING, all commands, other status frames, and to all.
pub fn messages(config: &Config) -> Vec<Message, MOST> {
    let Ok(own) = config.vesc_id() else { return Vec::new() };
    let message = |packet: Packet, id, name, len, from_device, signals| {
        Message::new(name, packet.id(id).into(), len, from_device, signals)
    };
    let reports = |wanted: bool| {
        let statuses = STATUSES.into_iter().zip(REPORTS).zip(config.status.all());
        let statuses = statuses.filter(move |(_, rate)| (*rate > 0) == wanted);
        statuses
            .map(move |((packet, (name, signals)), _)| message(packet, own, name, 8, true, signals))
    };
    let pong = message(Packet::Pong, config.asker, "VESC_PONG", 2, true, PONG);
    let orders = ORDERS
        .iter()
        .map(|&(packet, name, len, signals)| message(packet, own, name, len, false, signals));
    // Of eight bytes are only settings, which belong to one.
    let to_all = ORDERS.iter().filter(|(_, _, len, _)| *len < 8);
    let to_all = to_all.map(|&(packet, name, len, signals)| {
        let id = packet.id(Address::Every).into();
        Message::new(name, id, len, false, signals).marked(Marks::behind(len))
    });
    let own = reports(true).chain([pong]).chain(orders);
    own.chain(reports(false)).chain(to_all).take(MOST).collect()
}

/// In the order of their numbers (bldc `comm_can.c`, `comm_can_send_status1` to `status6`).
#[rustfmt::skip] // A table: name and signals.
const REPORTS: [(&str, &[Signal]); 6] = [
    ("VESC_STATUS_1", &[
        Signal::big("VESC_SPEED", 0, 4).signed().scaled(1.0, "erpm"),
        Signal::big("VESC_CURRENT", 4, 2).signed().scaled(0.1, "A"),
        Signal::big("VESC_DUTY", 6, 2).signed().scaled(0.001, ""),
    ]),
    ("VESC_STATUS_2", &[
        Signal::big("VESC_CHARGE_USED", 0, 4).signed().scaled(1e-4, "Ah"),
        Signal::big("VESC_CHARGE_FED_BACK", 4, 4).signed().scaled(1e-4, "Ah"),
    ]),
    ("VESC_STATUS_3", &[
        Signal::big("VESC_ENERGY_USED", 0, 4).signed().scaled(1e-4, "Wh"),
        Signal::big("VESC_ENERGY_FED_BACK", 4, 4).signed().scaled(1e-4, "Wh"),
    ]),
    ("VESC_STATUS_4", &[
        Signal::big("VESC_TRANSISTOR_TEMPERATURE", 0, 2).signed().scaled(0.1, "degC"),
        Signal::big("VESC_MOTOR_TEMPERATURE", 2, 2).signed().scaled(0.1, "degC"),
        Signal::big("VESC_INPUT_CURRENT", 4, 2).signed().scaled(0.1, "A"),
        Signal::big("VESC_POSITION", 6, 2).signed().scaled(0.02, "deg"),
    ]),
    ("VESC_STATUS_5", &[
        Signal::big("VESC_TACHOMETER", 0, 4).signed().scaled(1.0, "steps"),
        Signal::big("VESC_SUPPLY", 4, 2).signed().scaled(0.1, "V"),
    ]),
    ("VESC_STATUS_6", &[
        Signal::big("VESC_INPUT_1", 0, 2).signed().scaled(0.001, "V"),
        Signal::big("VESC_INPUT_2", 2, 2).signed().scaled(0.001, "V"),
        Signal::big("VESC_INPUT_3", 4, 2).signed().scaled(0.001, "V"),
        Signal::big("VESC_PPM", 6, 2).signed().scaled(0.001, ""),
    ]),
];

const PONG: &[Signal] = &[
    Signal::big("VESC_PONG_FROM", 0, 1),
    Signal::big("VESC_PONG_HARDWARE", 1, 1).named(&[(0, "VESC")]),
];

/// A command whose data is one number.
macro_rules! order {
    ($packet:ident, $name:literal, $factor:literal, $unit:literal) => {
        (Packet::$packet, $name, 4, &[Signal::big($name, 0, 4).signed().scaled($factor, $unit)])
    };
}

/// Commands (bldc `comm_can.c`, `comm_can_set_*`); [`Vesc`](super::Vesc) sends eleven.
const ORDERS: &[(Packet, &str, u8, &[Signal])] = &[
    order!(SetDuty, "VESC_SET_DUTY", 1e-5, ""),
    order!(SetCurrent, "VESC_SET_CURRENT", 1e-3, "A"),
    order!(SetCurrentBrake, "VESC_SET_BRAKE", 1e-3, "A"),
    order!(SetRpm, "VESC_SET_SPEED", 1.0, "erpm"),
    order!(SetPos, "VESC_SET_POSITION", 1e-6, "deg"),
    order!(SetCurrentRel, "VESC_SET_CURRENT_SHARE", 1e-5, ""),
    order!(SetCurrentBrakeRel, "VESC_SET_BRAKE_SHARE", 1e-5, ""),
    order!(SetCurrentHandbrake, "VESC_SET_HANDBRAKE", 1e-3, "A"),
    order!(SetCurrentHandbrakeRel, "VESC_SET_HANDBRAKE_SHARE", 1e-5, ""),
    (Packet::Ping, "VESC_PING", 1, &[Signal::big("VESC_PING_FROM", 0, 1)]),
    (Packet::ConfCurrentLimits, "VESC_CURRENT_LIMITS", 8, &CURRENT_LIMITS),
    (Packet::ConfStoreCurrentLimits, "VESC_STORE_CURRENT_LIMITS", 8, &CURRENT_LIMITS),
    (Packet::ConfCurrentLimitsIn, "VESC_INPUT_LIMITS", 8, &CURRENT_LIMITS),
    (Packet::ConfStoreCurrentLimitsIn, "VESC_STORE_INPUT_LIMITS", 8, &CURRENT_LIMITS),
    (Packet::ConfFocErpms, "VESC_FOC_SPEEDS", 8, &FOC_SPEEDS),
    (Packet::ConfStoreFocErpms, "VESC_STORE_FOC_SPEEDS", 8, &FOC_SPEEDS),
    (Packet::ConfBatteryCut, "VESC_BATTERY_CUT", 8, &BATTERY_CUT),
    (Packet::ConfStoreBatteryCut, "VESC_STORE_BATTERY_CUT", 8, &BATTERY_CUT),
    (Packet::Shutdown, "VESC_SHUTDOWN", 0, &[]),
];

/// Two numbers of a setting (bldc `comm_can.c`, `comm_can_conf_*`).
const fn pair(first: &'static str, second: &'static str, unit: &'static str) -> [Signal; 2] {
    [
        Signal::big(first, 0, 4).signed().scaled(1e-3, unit),
        Signal::big(second, 4, 4).signed().scaled(1e-3, unit),
    ]
}

const CURRENT_LIMITS: [Signal; 2] = pair("VESC_LIMIT_MIN", "VESC_LIMIT_MAX", "A");
const FOC_SPEEDS: [Signal; 2] = pair("VESC_OPEN_LOOP_SPEED", "VESC_SENSORLESS_SPEED", "erpm");
const BATTERY_CUT: [Signal; 2] = pair("VESC_CUT_BEGINS", "VESC_CUT_ENDS", "V");
