//! The axis's side of `CANSimple`: commands in, messages out.

use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;

/// A command to an axis. Turns, turns/s, N·m, A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// `02`.
    EStop,
    /// `07`.
    State(u32),
    /// `0B`: control mode, input mode.
    Modes(u32, u32),
    /// `0C`: position, and feed-forwards in 0.001 turns/s and 0.001 N·m.
    Position(f32, i16, i16),
    /// `0D`: velocity, torque.
    Velocity(f32, f32),
    /// `0E`.
    Torque(f32),
    /// `0F`: velocity, current.
    Limits(f32, f32),
    /// `18`.
    ClearErrors,
}

fn word(bytes: &[u8], first: usize) -> Option<u32> {
    bytes.get(first..)?.first_chunk().map(|word| u32::from_le_bytes(*word))
}

fn float(bytes: &[u8], first: usize) -> Option<f32> {
    word(bytes, first).map(f32::from_bits)
}

fn short(bytes: &[u8], first: usize) -> Option<i16> {
    bytes.get(first..)?.first_chunk().map(|short| i16::from_le_bytes(*short))
}

/// The command in a message; `None` if there is no such, or it is too short.
pub fn decode(message: u8, bytes: &[u8]) -> Option<Order> {
    Some(match message {
        0x02 => Order::EStop,
        0x07 => Order::State(word(bytes, 0)?),
        0x0B => Order::Modes(word(bytes, 0)?, word(bytes, 4)?),
        0x0C => Order::Position(float(bytes, 0)?, short(bytes, 4)?, short(bytes, 6)?),
        0x0D => Order::Velocity(float(bytes, 0)?, float(bytes, 4)?),
        0x0E => Order::Torque(float(bytes, 0)?),
        0x0F => Order::Limits(float(bytes, 0)?, float(bytes, 4)?),
        0x18 => Order::ClearErrors,
        _ => return None,
    })
}

fn frame(node: u8, message: u8, low: u32, high: u32) -> CanFrame {
    let id = StandardId::new(u16::from(node & 63) * 32 + u16::from(message & 31));
    let mut bytes = [0; 8];
    bytes[..4].copy_from_slice(&low.to_le_bytes());
    bytes[4..].copy_from_slice(&high.to_le_bytes());
    CanFrame::eight_bytes(id.unwrap_or(StandardId::ZERO), bytes)
}

#[expect(clippy::cast_possible_truncation, reason = "what an f32 holds")]
fn floats(node: u8, message: u8, low: f64, high: f64) -> CanFrame {
    frame(node, message, (low as f32).to_bits(), (high as f32).to_bits())
}

/// `01`: error word, state, and three bytes that depend on the firmware.
pub fn encode_heartbeat(node: u8, errors: u32, state: u8, details: [u8; 3]) -> CanFrame {
    let [a, b, c] = details;
    frame(node, 0x01, errors, u32::from_le_bytes([state, a, b, c]))
}

/// `09`: turns, turns/s.
pub fn encode_estimates(node: u8, position: f64, velocity: f64) -> CanFrame {
    floats(node, 0x09, position, velocity)
}

/// `14`: what is asked for and what flows, A.
pub fn encode_currents(node: u8, setpoint: f64, measured: f64) -> CanFrame {
    floats(node, 0x14, setpoint, measured)
}

/// `15`, firmware 0.6: power stage and motor, °C.
pub fn encode_temperatures(node: u8, stage: f64, motor: f64) -> CanFrame {
    floats(node, 0x15, stage, motor)
}

/// `17`: V, A.
pub fn encode_supply(node: u8, volts: f64, amps: f64) -> CanFrame {
    floats(node, 0x17, volts, amps)
}
