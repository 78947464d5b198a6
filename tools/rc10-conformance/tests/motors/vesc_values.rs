//! Contents of the frames of a VESC, by name.

use rc10_can::CanFrame;
use rc10_motor::vesc::{Reply, Status};
use rc10_sim::vesc::Order;

/// The numbers in a frame of the message of this name, as the signals of the table are named: of
/// what a VESC sends by our decoder, of what it is sent by the simulated VESC's. Empty if the frame
/// is not such a message.
pub fn values(message: &str, frame: &CanFrame) -> Vec<(&'static str, f64)> {
    let told = match Reply::unpack(frame) {
        Ok(Reply::Pong { from, hardware, .. }) => vec![
            ("VESC_PONG_FROM", f64::from(from.get())),
            ("VESC_PONG_HARDWARE", f64::from(hardware)),
        ],
        Ok(Reply::Status { status, .. }) => reported(status),
        Err(_) => ordered(frame),
    };
    let own = match message {
        "VESC_STATUS_1" => "VESC_SPEED",
        "VESC_STATUS_2" => "VESC_CHARGE_USED",
        "VESC_STATUS_3" => "VESC_ENERGY_USED",
        "VESC_STATUS_4" => "VESC_TRANSISTOR_TEMPERATURE",
        "VESC_STATUS_5" => "VESC_TACHOMETER",
        "VESC_STATUS_6" => "VESC_INPUT_1",
        "VESC_PONG" => "VESC_PONG_FROM",
        "VESC_PING" => "VESC_PING_FROM",
        "VESC_CURRENT_LIMITS" | "VESC_STORE_CURRENT_LIMITS" => "VESC_LIMIT_MIN",
        setting if SETTINGS.iter().any(|(name, _)| *name == setting) => {
            return pair(setting, frame);
        }
        order => order,
    };
    if told.first().is_some_and(|(name, _)| *name == own) { told } else { Vec::new() }
}

/// Settings that the simulated VESC does not know: two numbers in thousandths.
const SETTINGS: [(&str, [&str; 2]); 6] = [
    ("VESC_INPUT_LIMITS", ["VESC_LIMIT_MIN", "VESC_LIMIT_MAX"]),
    ("VESC_STORE_INPUT_LIMITS", ["VESC_LIMIT_MIN", "VESC_LIMIT_MAX"]),
    ("VESC_FOC_SPEEDS", ["VESC_OPEN_LOOP_SPEED", "VESC_SENSORLESS_SPEED"]),
    ("VESC_STORE_FOC_SPEEDS", ["VESC_OPEN_LOOP_SPEED", "VESC_SENSORLESS_SPEED"]),
    ("VESC_BATTERY_CUT", ["VESC_CUT_BEGINS", "VESC_CUT_ENDS"]),
    ("VESC_STORE_BATTERY_CUT", ["VESC_CUT_BEGINS", "VESC_CUT_ENDS"]),
];

fn pair(setting: &str, frame: &CanFrame) -> Vec<(&'static str, f64)> {
    let (_, names) = SETTINGS.iter().find(|(name, _)| *name == setting).unwrap();
    let halves = frame.bytes().chunks_exact(4);
    let numbers =
        halves.map(|half| f64::from(i32::from_be_bytes(half.try_into().unwrap())) / 1000.0);
    names.iter().copied().zip(numbers).collect()
}

fn reported(status: Status) -> Vec<(&'static str, f64)> {
    let numbers = match status {
        Status::Motion { speed, current, duty } => {
            vec![("VESC_SPEED", speed.get()), ("VESC_CURRENT", current.get()), ("VESC_DUTY", duty)]
        }
        Status::AmpHours { used, charged } => {
            vec![("VESC_CHARGE_USED", used), ("VESC_CHARGE_FED_BACK", charged)]
        }
        Status::WattHours { used, charged } => {
            vec![("VESC_ENERGY_USED", used), ("VESC_ENERGY_FED_BACK", charged)]
        }
        Status::Temperatures { transistors, motor, input_current, position } => vec![
            ("VESC_TRANSISTOR_TEMPERATURE", transistors.get()),
            ("VESC_MOTOR_TEMPERATURE", motor.get()),
            ("VESC_INPUT_CURRENT", input_current.get()),
            ("VESC_POSITION", position.get()),
        ],
        Status::Tachometer { steps, volts } => {
            let steps = ("VESC_TACHOMETER", f64::from(steps));
            return vec![steps, ("VESC_SUPPLY", f64::from(volts))];
        }
        Status::Inputs { analogue: [first, second, third], ppm } => vec![
            ("VESC_INPUT_1", first),
            ("VESC_INPUT_2", second),
            ("VESC_INPUT_3", third),
            ("VESC_PPM", ppm),
        ],
    };
    numbers.into_iter().map(|(name, value)| (name, f64::from(value))).collect()
}

fn ordered(frame: &CanFrame) -> Vec<(&'static str, f64)> {
    let to = frame.raw_id().to_be_bytes()[3];
    let Ok(order) = Order::parse(frame, to) else { return Vec::new() };
    match order {
        Order::Duty(value) => vec![("VESC_SET_DUTY", value)],
        Order::Current(value) => vec![("VESC_SET_CURRENT", value)],
        Order::Brake(value) => vec![("VESC_SET_BRAKE", value)],
        Order::Speed(value) => vec![("VESC_SET_SPEED", value)],
        Order::Position(value) => vec![("VESC_SET_POSITION", value)],
        Order::CurrentShare(value) => vec![("VESC_SET_CURRENT_SHARE", value)],
        Order::BrakeShare(value) => vec![("VESC_SET_BRAKE_SHARE", value)],
        Order::Handbrake(value) => vec![("VESC_SET_HANDBRAKE", value)],
        Order::HandbrakeShare(value) => vec![("VESC_SET_HANDBRAKE_SHARE", value)],
        Order::Ping(from) => vec![("VESC_PING_FROM", from.into())],
        Order::CurrentLimits { min, max, .. } => {
            vec![("VESC_LIMIT_MIN", min), ("VESC_LIMIT_MAX", max)]
        }
        Order::Shutdown => Vec::new(),
    }
}
