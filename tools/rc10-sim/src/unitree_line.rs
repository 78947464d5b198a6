//! Unitree GO-M8010-6 on RS-485, from the motor's side.
//!
//! Sources: GO-M8010-6 user manual v1.2 and data manual. They leave open how long the motor thinks,
//! what it does when commands stop, what "lock" feels like, where its angle begins: estimates.

use std::f64::consts::TAU;

use rc10_time::Micros;

use crate::Nanos;
use crate::crc::crc16;
use crate::device::{Device, EscFault, Winding, set_if};
use crate::line::Heard;
use crate::motor::Shaft;
use crate::plant::Plant;

/// Bytes of a command and of an answer.
const COMMAND: usize = 17;
const ANSWER: usize = 16;

/// Rotor turns per turn of the output (user manual).
pub(crate) const GEAR: f64 = 6.33;
/// N·m at the output shaft per ampere (user manual).
pub(crate) const TORQUE_CONSTANT: f64 = 0.638_95;
/// Address of all motors; they do not answer to it.
const EVERYBODY: u8 = 15;
/// Its own protection (user manual): at this temperature, until power-off.
pub(crate) const TOO_HOT: f64 = 90.0;
/// Without a command for longer it stops obeying: an estimate.
const PATIENCE: Nanos = Nanos::new(50_000_000);
/// The time for which it turns by itself when told to calibrate (user manual), and hears nothing.
const CALIBRATION: Nanos = Nanos::new(5_000_000_000);

/// Content of a command, as the numbers of the table: at the rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Whom it is for, 0 ..= 15.
    pub id: u8,
    /// 0 lock, 1 field-oriented control, 2 calibrate.
    pub status: u8,
    /// N m.
    pub torque: f64,
    /// rad/s.
    pub speed: f64,
    /// rad.
    pub angle: f64,
    /// N m/rad.
    pub stiffness: f64,
    /// N m s/rad.
    pub damping: f64,
}

/// Content of an answer, as the numbers of the table: at the rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Answer {
    /// The motor that answers, 0 ..= 14.
    pub id: u8,
    /// The status, with the numbers of a [`Command`].
    pub status: u8,
    /// N m.
    pub torque: f64,
    /// rad/s.
    pub speed: f64,
    /// rad.
    pub angle: f64,
    /// °C.
    pub temperature: i8,
    /// 0 none, 1 over-temperature, 2 over-current, 3 over-voltage, 4 encoder.
    pub error: u8,
    /// 0 ..= 4095.
    pub foot_force: u16,
}

impl Command {
    /// Reads the 17 bytes of a command; `None` if head or check sum are wrong.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; COMMAND] = bytes.try_into().ok()?;
        let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        // The check sum is CRC-16/KERMIT.
        if bytes[..2] != [0xFE, 0xEE] || crc16(0, &bytes[..15]) != word(15) {
            return None;
        }
        let angle = i32::from_le_bytes([bytes[7], bytes[8], bytes[9], bytes[10]]);
        Some(Self {
            id: bytes[2] % 16,
            status: bytes[2] / 16 % 8,
            torque: f64::from(word(3).cast_signed()) / 256.0,
            speed: f64::from(word(5).cast_signed()) / 256.0 * TAU,
            angle: f64::from(angle) / 32_768.0 * TAU,
            stiffness: f64::from(word(11)) / 1280.0,
            damping: f64::from(word(13)) / 1280.0,
        })
    }
}

impl Answer {
    /// The 16 bytes of an answer; what a field cannot hold is held at its end.
    #[expect(clippy::cast_possible_truncation, reason = "saturates, as the motor's own numbers do")]
    pub fn write(&self) -> [u8; ANSWER] {
        let torque = (self.torque * 256.0).round() as i16;
        let speed = (self.speed / TAU * 256.0).round() as i16;
        let angle = (self.angle / TAU * 32_768.0).round() as i32;
        let mut bytes = [0; ANSWER];
        bytes[..3].copy_from_slice(&[0xFD, 0xEE, self.id % 16 + self.status % 8 * 16]);
        bytes[3..5].copy_from_slice(&torque.to_le_bytes());
        bytes[5..7].copy_from_slice(&speed.to_le_bytes());
        bytes[7..11].copy_from_slice(&angle.to_le_bytes());
        bytes[11] = self.temperature.cast_unsigned();
        let last = u16::from(self.error % 8) + self.foot_force % 4096 * 8;
        bytes[12..14].copy_from_slice(&last.to_le_bytes());
        let check = crc16(0, &bytes[..14]);
        bytes[14..].copy_from_slice(&check.to_le_bytes());
        bytes
    }
}

/// GO-M8010-6 at 24 V, nothing on the shaft.
///
/// Gear, torque constant, no-load speed and largest torque are the data manual's (6.33, 0.63895
/// N·m/A and 23.7 N·m at the output, 30 rad/s at 24 V). The rotor's inertia is the one that Unitree
/// publishes in its robot descriptions of the Go1; resistance, friction and thermal figures are our
/// estimates.
pub const fn plant() -> Plant {
    Plant {
        current_time_constant: 0.5e-3,
        ..Plant::motor(GEAR, TORQUE_CONSTANT, 0.2, 23.7 / TORQUE_CONSTANT, 1.12e-4)
            .with_friction(5e-3, 0.08, 0.10)
            .with_heating(1.0, 200.0)
    }
    .with_no_load_speed(30.0 * GEAR * 60.0 / TAU)
}

/// The number by which the motor tells a fault that it finds in itself.
pub(crate) const fn error_of(fault: EscFault) -> Option<u8> {
    match fault {
        EscFault::OverTemperature => Some(1),
        EscFault::OverCurrent => Some(2),
        EscFault::OverVoltage => Some(3),
        EscFault::Encoder => Some(4),
        EscFault::CommunicationLost | EscFault::UnderVoltage => None,
    }
}

/// The motor's electronics.
#[derive(Debug)]
#[must_use]
pub struct GoM8010 {
    id: u8,
    /// The time from a command to its answer.
    pub think: Nanos,
    /// The beginning of what may be a command.
    heard: Vec<u8>,
    /// The command it obeys: the newest, or lock with nothing else when it has waited too long.
    pub command: Command,
    commanded_at: Nanos,
    /// Rotor turns that it does not count.
    uncounted: f64,
    error: u8,
    calibrating_until: Option<Nanos>,
}

impl GoM8010 {
    /// A motor of this id, 0 ..= 14. It answers 20 µs after a command, and stops obeying 50 ms after
    /// the last one: both are estimates, nothing is documented.
    ///
    /// # Panics
    /// With another id.
    pub fn new(id: u8) -> Self {
        assert!(id < EVERYBODY, "a GO-M8010-6 takes ids 0 to 14, not {id}");
        Self {
            id,
            think: Nanos::new(20_000),
            heard: Vec::new(),
            command: Command::default(),
            commanded_at: Nanos::ZERO,
            uncounted: 0.0,
            error: 0,
            calibrating_until: None,
        }
    }

    /// Whether it turns by itself.
    pub const fn is_calibrating(&self) -> bool {
        self.calibrating_until.is_some()
    }

    /// Angle of the rotor as the motor counts it, rad: from power-on within the first turn.
    pub fn angle(&self, shaft: &Shaft) -> f64 {
        (shaft.rotor_turns() - self.uncounted) * TAU
    }

    fn answer(&self, shaft: &Shaft) -> Answer {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let temperature = shaft.temperature.round() as i8;
        Answer {
            id: self.id,
            status: self.command.status,
            torque: shaft.torque() / GEAR,
            speed: shaft.speed * GEAR,
            angle: self.angle(shaft),
            temperature,
            error: self.error,
            foot_force: 0,
        }
    }
}

impl Device for GoM8010 {
    fn set_id(&mut self, id: u8) -> bool {
        set_if(id < EVERYBODY, &mut self.id, id)
    }

    fn power_on(&mut self, shaft: &Shaft, now: Micros, _phase: Micros) {
        *self = Self { think: self.think, ..Self::new(self.id) };
        self.uncounted = shaft.rotor_turns().floor();
        self.commanded_at = now.into();
    }

    fn hear(&mut self, byte: u8, shaft: &Shaft, now: Nanos) -> Heard {
        if self.calibrating_until.is_some() {
            return Heard::Nothing;
        }
        self.heard.push(byte);
        // Drops what cannot be the beginning of a command.
        while !self.heard.is_empty() && !self.heard.iter().zip([0xFE, 0xEE]).all(|(a, b)| *a == b) {
            self.heard.remove(0);
        }
        if self.heard.len() < COMMAND {
            return Heard::Nothing;
        }
        let Some(command) = Command::read(&self.heard) else {
            let is_for_me = self.heard[2] % 16 == self.id;
            self.heard.remove(0);
            return if is_for_me { Heard::Malformed } else { Heard::Nothing };
        };
        self.heard.clear();
        if command.id != self.id && command.id != EVERYBODY {
            return Heard::Nothing;
        }
        (self.command, self.commanded_at) = (command, now);
        let calibrates = command.status == 2;
        self.calibrating_until = calibrates.then(|| now + CALIBRATION);
        if calibrates || command.id == EVERYBODY {
            return Heard::Command;
        }
        Heard::Question(self.answer(shaft).write().to_vec(), self.think)
    }

    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding {
        let now = Nanos::from(now);
        if self.calibrating_until.is_some_and(|until| now >= until) {
            (self.calibrating_until, self.command) = (None, Command::default());
        }
        if shaft.temperature >= TOO_HOT {
            self.error = 1;
        }
        if self.error != 0 {
            return Winding::Open;
        }
        if self.calibrating_until.is_some() {
            // Slowly, by itself.
            return Winding::Current(1.0);
        }
        if now.since(self.commanded_at) >= PATIENCE {
            self.command = Command::default();
        }
        let Command { status, torque, speed, angle, stiffness, damping, .. } = self.command;
        if status != 1 {
            // Locked: its winding is shorted.
            return Winding::Voltage(0.0);
        }
        let torque = torque
            + stiffness * (angle - self.angle(shaft))
            + damping * (speed - shaft.speed * GEAR);
        Winding::Current(torque * GEAR / shaft.plant.torque_constant)
    }

    fn inject(&mut self, fault: EscFault) -> bool {
        self.error = error_of(fault).unwrap_or(self.error);
        error_of(fault).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes of the vendor's SDK: id 11, field-oriented control, 85 °C, over-voltage.
    const ANSWER_BYTES: [u8; 16] = [
        0xFD, 0xEE, 0x1B, 0xC7, 0xCF, 0xA0, 0x5B, 0x4F, 0x97, 0x21, 0xC5, 0x55, 0x23, 0x03, 0xB0,
        0x5D,
    ];

    #[test]
    fn an_answer_is_the_vendor_s_bytes() {
        let answer = Answer {
            id: 11,
            status: 1,
            torque: -12345.0 / 256.0,
            speed: 23456.0 / 256.0 * TAU,
            angle: -987_654_321.0 / 32_768.0 * TAU,
            temperature: 85,
            error: 3,
            foot_force: 100,
        };
        assert_eq!(answer.write(), ANSWER_BYTES);
    }

    #[test]
    fn a_command_is_read_as_the_vendor_wrote_it() {
        let bytes = *b"\xFE\xEE\x10\xC0\x00\x7F\x00\xFF\x1F\x00\x00\x80\x00\x00\x01\xA6\x60";
        let command = Command::read(&bytes).expect("a command");
        assert_eq!((command.id, command.status), (0, 1));
        let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-9, "{value}");
        near(command.torque, 0.75);
        near(command.speed, 127.0 / 256.0 * TAU);
        near(command.angle, 8191.0 / 32_768.0 * TAU);
        near(command.stiffness, 0.1);
        near(command.damping, 0.2);
        for at in 0..bytes.len() {
            let mut broken = bytes;
            broken[at] ^= 4;
            assert_eq!(Command::read(&broken), None, "byte {at}");
        }
    }
}
