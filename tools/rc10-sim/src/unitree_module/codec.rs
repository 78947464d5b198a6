use std::f64::consts::TAU;

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, Id};

// Scales of the rotor: module manual and data manual.
const TORQUE_STEPS: f64 = 256.0;
const SPEED_STEPS: f64 = 256.0 / TAU;
const ANGLE_STEPS: f64 = 32768.0 / TAU;
const GAIN_STEPS: f64 = 1280.0;

/// Torque, speed and angle of the rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// N·m.
    pub torque: f64,
    /// rad/s.
    pub speed: f64,
    /// rad, over many turns.
    pub angle: f64,
}

/// Stiffness and damping of the rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gains {
    /// `k_pos`, N·m/rad.
    pub stiffness: f64,
    /// `k_spd`, N·m·s/rad.
    pub damping: f64,
}

/// A frame to a module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Number of the module, 0 ..= 3.
    pub module: u8,
    /// Which of its motors, 0 ..= 15; 15 is all of them.
    pub motor: u8,
    /// The question or the command; `None` if the module takes no such length or operation.
    pub asked: Option<Asked>,
}

/// A question or command to a module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Asked {
    /// 10, or 13 if only a fault is answered.
    Control {
        /// 0 lock, 1 field-oriented control, 2 calibrate; three bits.
        status: u8,
        /// The motion.
        motion: Motion,
        /// Whether every frame is answered.
        answered: bool,
    },
    /// 11.
    SetGains(Gains),
    /// 12.
    ReadGains,
}

#[expect(clippy::cast_possible_truncation, reason = "a byte of an identifier")]
const fn byte(id: u32, from: u32) -> u8 {
    (id >> from) as u8
}

impl Command {
    /// Reads a frame; `None` if it is not for a module at all.
    pub fn unpack(frame: &CanFrame) -> Option<Self> {
        let id = frame.raw_id();
        // Bits 26 to 24: direction and content, zero in what goes to a module.
        if !frame.is_extended_id() || frame.is_remote() || byte(id, 24) & 7 != 0 {
            return None;
        }
        let (module, motor, status) = (byte(id, 27) & 3, byte(id, 8) & 15, byte(id, 12) & 7);
        let asked = frame.all_eight().and_then(|data| match byte(id, 16) {
            10 => Some(Asked::Control { status, motion: motion(*data), answered: true }),
            11 => Some(Asked::SetGains(gains(*data))),
            12 => Some(Asked::ReadGains),
            13 => Some(Asked::Control { status, motion: motion(*data), answered: false }),
            _ => None,
        });
        Some(Self { module, motor, asked })
    }
}

fn motion([a0, a1, a2, a3, w0, w1, t0, t1]: [u8; 8]) -> Motion {
    Motion {
        torque: f64::from(i16::from_le_bytes([t0, t1])) / TORQUE_STEPS,
        speed: f64::from(i16::from_le_bytes([w0, w1])) / SPEED_STEPS,
        angle: f64::from(i32::from_le_bytes([a0, a1, a2, a3])) / ANGLE_STEPS,
    }
}

fn gains([d0, d1, s0, s1, ..]: [u8; 8]) -> Gains {
    Gains {
        stiffness: f64::from(u16::from_le_bytes([s0, s1])) / GAIN_STEPS,
        damping: f64::from(u16::from_le_bytes([d0, d1])) / GAIN_STEPS,
    }
}

/// A frame from a module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Number of the module, 0 ..= 3.
    pub module: u8,
    /// About which of its motors, 0 ..= 14.
    pub motor: u8,
    /// The content of the report.
    pub told: Told,
}

/// The content of a report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Told {
    /// The state of the motor.
    State {
        /// 0 locked, 1 following, 2 calibrating.
        status: u8,
        /// The motion.
        motion: Motion,
        /// °C; −127 at least, as −128 stands for a fault.
        temperature: f64,
        /// Upper eight bits of its sensor.
        air_pressure: u8,
    },
    /// A fault of the motor.
    Fault {
        /// The status, with the numbers of a state.
        status: u8,
        /// 1 over-temperature, 2 over-current, 3 over-voltage, 4 encoder.
        error: u8,
    },
    /// The gains that the module has for the motor.
    Gains(Gains),
}

impl Report {
    /// The frame that says it.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "saturates, as the device's own numbers do"
    )]
    pub fn pack(&self) -> CanFrame {
        let mut data = [0; 8];
        let (content, low3, status, low1) = match self.told {
            Told::State { status, motion, temperature, air_pressure } => {
                let angle = (motion.angle * ANGLE_STEPS).round() as i32;
                let speed = (motion.speed * SPEED_STEPS).round() as i16;
                let torque = (motion.torque * TORQUE_STEPS).round() as i16;
                data[..4].copy_from_slice(&angle.to_le_bytes());
                data[4..6].copy_from_slice(&speed.to_le_bytes());
                data[6..].copy_from_slice(&torque.to_le_bytes());
                let degrees = (temperature.round() as i8).max(-127);
                (1, air_pressure, status, degrees.to_le_bytes()[0])
            }
            Told::Fault { status, error } => (1, error, status, 0x80),
            Told::Gains(gains) => {
                let damping = (gains.damping * GAIN_STEPS).round() as u16;
                let stiffness = (gains.stiffness * GAIN_STEPS).round() as u16;
                data[..2].copy_from_slice(&damping.to_le_bytes());
                data[2..4].copy_from_slice(&stiffness.to_le_bytes());
                // The manual calls it "read mode 2".
                (2, 2, 0, 0)
            }
        };
        let id = u32::from(self.module & 3) << 27
            | 1 << 26
            | content << 24
            | u32::from(low3) << 16
            | u32::from(status & 7) << 12
            | u32::from(self.motor & 15) << 8
            | u32::from(low1);
        CanFrame::eight_bytes(Id::Extended(ExtendedId::new(id).unwrap_or(ExtendedId::ZERO)), data)
    }
}
