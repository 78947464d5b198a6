//! Frames as the device sees them: numbers in f64, every field by its vendor's words.

use rc10_can::CanFrame;
use rc10_can::embedded_can::ExtendedId;

use super::Model;

/// A command of a host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Type 0: who are you.
    Identify,
    /// Type 1.
    Motion(Motion),
    /// Type 3.
    Enable,
    /// Type 4.
    Stop {
        /// And forget faults.
        clear: bool,
    },
    /// Type 6.
    SetZero,
    /// Type 7.
    SetId(u8),
    /// Type 17.
    Read(u16),
    /// Type 18.
    Write(u16, [u8; 4]),
    /// Type 22, whose meaning depends on the vendor.
    SaveOrBitRate([u8; 8]),
    /// Type 24 (RobStride): whether to report without being asked.
    Report(bool),
}

/// A setpoint of motion control.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// rad.
    pub position: f64,
    /// rad/s.
    pub velocity: f64,
    /// N m / rad.
    pub kp: f64,
    /// N m s / rad.
    pub kd: f64,
    /// N m.
    pub torque: f64,
}

/// From 0 ..= 65535 to `low` ..= `high`.
fn from_field(field: u16, low: f64, high: f64) -> f64 {
    f64::from(field) * (high - low) / 65_535.0 + low
}

/// From `low` ..= `high` to 0 ..= 65535, cut off at the ends and truncated as vendor code does.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn to_field(value: f64, low: f64, high: f64) -> u16 {
    ((value - low) * 65_535.0 / (high - low)) as u16
}

/// The addressee, the sender and the command of a frame; `None` for a foreign frame, and for the
/// command if the device does not take such a length or content.
pub fn read(frame: &CanFrame, model: &Model) -> Option<(u8, u8, Option<Command>)> {
    if !frame.is_extended_id() || frame.is_remote() {
        return None;
    }
    let id = frame.raw_id();
    let [kind, upper, host, target] = id.to_be_bytes();
    let command = match kind {
        // Drivers send it with one byte.
        0 => Some(Command::Identify),
        // Reverse-engineered by `python-cybergear` 0.1.2: no torque, at once.
        20 => Some(Command::Stop { clear: false }),
        1 | 3 | 4 | 6 | 7 | 17 | 18 | 22 | 24 => {
            frame.all_eight().and_then(|data| eight(kind, upper, id, *data, model))
        }
        _ => return None,
    };
    Some((target, host, command))
}

fn eight(kind: u8, upper: u8, id: u32, data: [u8; 8], model: &Model) -> Option<Command> {
    let big = |first: usize| u16::from_be_bytes([data[first], data[first + 1]]);
    let index = u16::from_le_bytes([data[0], data[1]]);
    let value = [data[4], data[5], data[6], data[7]];
    Some(match kind {
        1 => {
            let [_, high, low, _] = id.to_be_bytes();
            let torque = u16::from_be_bytes([high, low]);
            Command::Motion(Motion {
                position: from_field(big(0), -model.position, model.position),
                velocity: from_field(big(2), -model.velocity, model.velocity),
                kp: from_field(big(4), 0.0, model.kp),
                kd: from_field(big(6), 0.0, model.kd),
                torque: from_field(torque, -model.torque, model.torque),
            })
        }
        3 => Command::Enable,
        4 => Command::Stop { clear: data[0] == 1 },
        6 if data[0] == 1 => Command::SetZero,
        7 => Command::SetId(upper),
        17 => Command::Read(index),
        18 => Command::Write(index, value),
        22 => Command::SaveOrBitRate(data),
        24 if model.robstride && data[..6] == [1, 2, 3, 4, 5, 6] => Command::Report(data[6] == 1),
        _ => return None,
    })
}

/// Content of a feedback frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// 0 reset, 1 calibration, 2 run.
    pub mode: u8,
    /// Six bits: under-voltage, over-current, too hot, magnetic encoder, Hall encoder (RobStride:
    /// overload), not calibrated.
    pub faults: u8,
    /// rad.
    pub position: f64,
    /// rad/s.
    pub velocity: f64,
    /// N m.
    pub torque: f64,
    /// °C.
    pub temperature: f64,
}

fn frame(kind: u32, middle: u16, to: u8, data: [u8; 8]) -> CanFrame {
    let id = kind << 24 | u32::from(middle) << 8 | u32::from(to);
    CanFrame::eight_bytes(ExtendedId::new(id).unwrap_or(ExtendedId::MAX), data)
}

/// Type 2, or 24 when it was not asked for.
pub fn feedback(unasked: bool, motor: u8, host: u8, report: &Report, model: &Model) -> CanFrame {
    let state = report.mode << 6 | report.faults & 0x3F;
    let words = [
        to_field(report.position, -model.position, model.position),
        to_field(report.velocity, -model.velocity, model.velocity),
        to_field(report.torque, -model.torque, model.torque),
        tenths(report.temperature),
    ];
    let mut data = [0; 8];
    for (bytes, word) in data.chunks_exact_mut(2).zip(words) {
        bytes.copy_from_slice(&word.to_be_bytes());
    }
    let kind = if unasked { 24 } else { 2 };
    frame(kind, u16::from_be_bytes([state, motor]), host, data)
}

#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn tenths(celsius: f64) -> u16 {
    (celsius * 10.0).round() as u16
}

/// Type 0: the motor's identifier and the number of its chip, to all nodes.
pub fn identity(motor: u8, chip: [u8; 8]) -> CanFrame {
    frame(0, motor.into(), 0xFE, chip)
}

/// Type 17: what a parameter holds, or that it does not exist.
pub fn parameter(motor: u8, host: u8, index: u16, value: Option<[u8; 4]>) -> CanFrame {
    let [low, high] = index.to_le_bytes();
    let [a, b, c, d] = value.unwrap_or_default();
    let status = u8::from(value.is_none());
    let middle = u16::from_be_bytes([status, motor]);
    frame(17, middle, host, [low, high, 0, 0, a, b, c, d])
}

/// Type 21: what is wrong, and what will be.
pub fn faults(motor: u8, host: u8, faults: u32, warnings: u32) -> CanFrame {
    let [a, b, c, d] = faults.to_le_bytes();
    let [e, f, g, h] = warnings.to_le_bytes();
    frame(21, motor.into(), host, [a, b, c, d, e, f, g, h])
}
