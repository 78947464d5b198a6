//! What our codec says of an axis's frames, by the names of their signals.

use rc10_can::CanFrame;
use rc10_motor::odrive::{Config, Control, Firmware, Message, Node, Rates, Temperatures};

use super::{LIMITS, WHEEL};

/// The axis whose frames these are.
pub const NODE: u8 = 5;

/// How it is set up: firmware 0.6, and everything that it can send.
pub fn config() -> Config {
    let rates = Rates { currents: 100, temperatures: 10, supply: 10, ..Rates::new(500, 50) };
    Config::new(NODE, Firmware::V0_6, Control::Torque(WHEEL), rates).with_limits(LIMITS)
}

/// The signals of a frame that an axis of this firmware sends; empty if the codec refuses it, or if
/// we send it.
pub fn values(message: &str, frame: &CanFrame, firmware: &Firmware) -> Vec<(&'static str, f64)> {
    let node = Node::new(NODE).unwrap();
    if message == "ODRIVE_TEMPERATURES" {
        let Ok(told) = Temperatures::from_frame(frame, node) else { return Vec::new() };
        return vec![
            ("CONTROLLER_TEMPERATURE", told.controller.get().into()),
            ("MOTOR_TEMPERATURE", told.motor.get().into()),
        ];
    }
    match Message::from_frame(frame, node) {
        Ok(Message::Heartbeat(heartbeat)) => {
            let mut values = vec![("AXIS_STATE", f64::from(heartbeat.state.number()))];
            let [a, b, c] = heartbeat.details;
            if firmware.has_temperatures {
                values.push(("PROCEDURE_RESULT", a.into()));
                values.push(("TRAJECTORY_DONE", (b & 1).into()));
            } else {
                values.push(("MOTOR_ERROR", (a & 1).into()));
                values.push(("ENCODER_ERROR", (b & 1).into()));
                values.push(("CONTROLLER_ERROR", (c & 1).into()));
                values.push(("TRAJECTORY_DONE", (c >> 7).into()));
            }
            for (bit, _) in firmware.errors {
                let fault = firmware.fault(heartbeat.errors & 1 << bit);
                values.push((ERROR_NAMES[usize::from(*bit)], f64::from(u8::from(fault.is_some()))));
            }
            values
        }
        Ok(Message::Estimates(it)) => {
            vec![("POSITION", it.position.into()), ("VELOCITY", it.velocity.into())]
        }
        Ok(Message::Currents(it)) => vec![
            ("CURRENT_SETPOINT", it.setpoint.get().into()),
            ("CURRENT_MEASURED", it.measured.get().into()),
        ],
        Ok(Message::Supply(it)) => {
            vec![("SUPPLY_VOLTAGE", it.voltage.into()), ("SUPPLY_CURRENT", it.current.get().into())]
        }
        Err(_) => Vec::new(),
    }
}

const ERROR_NAMES: [&str; 32] = [
    "ERROR_0", "ERROR_1", "ERROR_2", "ERROR_3", "ERROR_4", "ERROR_5", "ERROR_6", "ERROR_7",
    "ERROR_8", "ERROR_9", "ERROR_10", "ERROR_11", "ERROR_12", "ERROR_13", "ERROR_14", "ERROR_15",
    "ERROR_16", "ERROR_17", "ERROR_18", "ERROR_19", "ERROR_20", "ERROR_21", "ERROR_22", "ERROR_23",
    "ERROR_24", "ERROR_25", "ERROR_26", "ERROR_27", "ERROR_28", "ERROR_29", "ERROR_30", "ERROR_31",
];
