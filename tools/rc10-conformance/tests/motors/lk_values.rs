//! What our codec says of an LK frame, by the names of its signals.

use rc10_can::CanFrame;
use rc10_motor::lk::{Commands, Config, DriveId, Health, Motion, Reply};

use super::joint;

/// The drive whose frames these are.
pub const ID: u8 = 3;

/// How it is set up.
pub fn config() -> Config {
    Config { id: ID, ..joint() }.with_commands(Commands::MultiMotor)
}

/// The signals that are there in a frame; empty if the codec refuses it.
pub fn values(message: &str, frame: &CanFrame) -> Vec<(&'static str, f64)> {
    match message {
        "LK_ANSWER" => answer(frame),
        "LK_MULTI_MOTOR" => lanes(frame),
        _ => Vec::new(),
    }
}

fn answer(frame: &CanFrame) -> Vec<(&'static str, f64)> {
    let command = f64::from(frame.bytes()[0]);
    let mut values = vec![("COMMAND", command)];
    match Reply::from_frame(frame, DriveId::new(ID).unwrap()) {
        Ok(Reply::Motion(motion)) => values.extend(measured(&motion)),
        Ok(Reply::Health(health)) => values.extend(reported(&health)),
        Ok(Reply::Off | Reply::Run) => (),
        // Kinds of answers that are never asked for, and no answers.
        _ => return Vec::new(),
    }
    values
}

fn measured(motion: &Motion) -> Vec<(&'static str, f64)> {
    let names = match motion.command {
        0xA1 => ["TEMPERATURE", "CURRENT", "ROTOR_SPEED", "ROTOR_ANGLE"],
        0x9C => {
            ["POLLED_TEMPERATURE", "POLLED_CURRENT", "POLLED_ROTOR_SPEED", "POLLED_ROTOR_ANGLE"]
        }
        _ => return Vec::new(),
    };
    let model = config().model;
    let values = [
        motion.temperature().get(),
        model.current(motion).unwrap().get(),
        motion.speed().get() * 6.0,
        model.angle(motion).unwrap().get(),
    ];
    names.into_iter().zip(values.map(f64::from)).collect()
}

fn reported(health: &Health) -> Vec<(&'static str, f64)> {
    const NAMES: [&str; 10] = [
        "REPORTED_TEMPERATURE",
        "SUPPLY",
        "SUPPLY_TOO_LOW",
        "SUPPLY_TOO_HIGH",
        "CONTROLLER_TOO_HOT",
        "MOTOR_TOO_HOT",
        "CURRENT_TOO_HIGH",
        "SHORT_CIRCUIT",
        "STALLED",
        "COMMANDS_STOPPED",
    ];
    const CLEARED: [&str; 10] = [
        "CLEARED_TEMPERATURE",
        "CLEARED_SUPPLY",
        "CLEARED_SUPPLY_TOO_LOW",
        "CLEARED_SUPPLY_TOO_HIGH",
        "CLEARED_CONTROLLER_TOO_HOT",
        "CLEARED_MOTOR_TOO_HOT",
        "CLEARED_CURRENT_TOO_HIGH",
        "CLEARED_SHORT_CIRCUIT",
        "CLEARED_STALLED",
        "CLEARED_COMMANDS_STOPPED",
    ];
    let names = if health.command == 0x9A { NAMES } else { CLEARED };
    let bits = (0..8).map(|bit| f64::from(health.errors.bits() >> bit & 1));
    let numbers = [health.temperature.get(), health.supply].map(f64::from);
    names.into_iter().zip(numbers.into_iter().chain(bits)).collect()
}

/// The frame is ours: what its bytes are to the drives.
fn lanes(frame: &CanFrame) -> Vec<(&'static str, f64)> {
    let lane = |index: usize| {
        let bytes = frame.bytes();
        f64::from(i16::from_le_bytes([bytes[2 * index], bytes[2 * index + 1]]))
    };
    ["CURRENT_1", "CURRENT_2", "CURRENT_3", "CURRENT_4"]
        .into_iter()
        .enumerate()
        .map(|(index, name)| (name, lane(index)))
        .collect()
}
