//! What our decoder reads in a Damiao's frames, by the names of its signal table.

use rc10_can::CanFrame;
use rc10_motor::damiao::Limits;
use rc10_motor::damiao::registers::{Register, Reply, Value};
use rc10_motor::damiao::wire::Feedback;

/// The values of a frame of the message `name`; empty for a message that only we send.
pub fn values(name: &str, frame: &CanFrame, limits: &Limits) -> Vec<(&'static str, f64)> {
    if name == "DAMIAO_FEEDBACK" {
        let told = Feedback::unpack(frame, limits).expect("eight bytes");
        return vec![
            ("ID", told.id.into()),
            ("ERR", told.state.code().into()),
            ("POSITION", told.position.into()),
            ("VELOCITY", told.velocity.into()),
            ("TORQUE", told.torque.into()),
            ("T_MOS", told.driver_temperature.get().into()),
            ("T_ROTOR", told.motor_temperature.get().into()),
        ];
    }
    if name != "DAMIAO_REGISTER" {
        return Vec::new();
    }
    // A question with a value has the layout of an answer.
    let Ok(reply) = Reply::unpack(frame) else { return Vec::new() };
    let Some((Register(register), value)) = reply.held else {
        return vec![("CAN_ID", reply.id.into()), ("OPERATION", f64::from(0xAA))];
    };
    let operation = if reply.is_written { 0x55 } else { 0x33 };
    let mut values = vec![
        ("CAN_ID", reply.id.into()),
        ("OPERATION", f64::from(operation)),
        ("REGISTER", register.into()),
    ];
    let name = match register {
        7 => "MST_ID",
        8 => "ESC_ID",
        9 => "TIMEOUT",
        10 => "CTRL_MODE",
        21 => "PMAX",
        22 => "VMAX",
        23 => "TMAX",
        35 => "CAN_BR",
        _ => return values,
    };
    values.push((
        name,
        match value {
            Value::Real(real) => real.into(),
            // In steps of 50 µs.
            Value::Whole(steps) if register == 9 => f64::from(steps) * 0.05,
            Value::Whole(whole) => whole.into(),
        },
    ));
    values
}
