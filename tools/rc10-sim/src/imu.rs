//! IMUs on a base: [`Hwt101`] on a serial line, [`bmi088`] on an SPI.

pub mod bmi088;

use std::collections::VecDeque;
use std::f64::consts::PI;

use crate::serial::{SerialConfig, SerialDevice};
use crate::{Base, Nanos};

/// The bytes that unlock the registers, and the time for which they do: WIT's manual, "standard
/// communication protocol".
const UNLOCK: [u8; 5] = [0xFF, 0xAA, 0x69, 0x88, 0xB5];
const UNLOCKED_FOR: Nanos = Nanos::new(10_000_000_000);
const RATE: u8 = 0x03;
const ZERO_YAW: u8 = 0x76;

/// A WIT HWT101 on a base: which way it looks, and how fast it turns, about the vertical axis. Both
/// are exact but for their 16 bits; a real one drifts.
///
/// Counter-clockwise is positive, and where it looks at power-on is zero. Of its registers it knows
/// the output rate and the zero, both only when unlocked.
pub struct Hwt101 {
    base: Base,
    phase: Nanos,
    period: Nanos,
    next: Nanos,
    /// rad.
    zero: f64,
    heard: [u8; 5],
    unlocked_until: Option<Nanos>,
}

impl Hwt101 {
    /// The UART: 115200 baud, 8N1.
    pub const SERIAL: SerialConfig =
        SerialConfig { baud: 115_200, bits: 10, receive_capacity: 256 };

    /// An IMU that is set to 200 Hz and sends its first frames at `phase` after power-on.
    pub fn new(base: &Base, phase: Nanos) -> Self {
        Self {
            base: base.clone(),
            phase,
            period: Nanos::new(5_000_000),
            next: Nanos::ZERO,
            zero: 0.0,
            heard: [0; 5],
            unlocked_until: None,
        }
    }

    fn obey(&mut self, register: u8, value: u8) {
        match (register, value) {
            (ZERO_YAW, 0) => self.zero = self.base.pose().yaw,
            (RATE, 0x06) => self.period = Nanos::new(100_000_000),
            (RATE, 0x07) => self.period = Nanos::new(50_000_000),
            (RATE, 0x08) => self.period = Nanos::new(20_000_000),
            (RATE, 0x09) => self.period = Nanos::new(10_000_000),
            (RATE, 0x0B) => self.period = Nanos::new(5_000_000),
            _ => (),
        }
    }
}

impl SerialDevice for Hwt101 {
    fn power_on(&mut self, now: Nanos) {
        self.next = now + self.phase;
        self.zero = self.base.pose().yaw;
        (self.heard, self.unlocked_until) = ([0; 5], None);
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        self.next = now + self.period;
        let (pose, twist, sign) = (self.base.pose(), self.base.twist(), self.base.imu_sign());
        let turn_rate =
            (sign * twist.yaw.to_degrees() / 2000.0 * 32_768.0).clamp(-32_768.0, 32_767.0);
        // One turn is 65536, and the angle wraps at half of it.
        let turns = sign * (pose.yaw - self.zero) / (2.0 * PI);
        let yaw = (turns - turns.round()) * 65_536.0;
        #[expect(clippy::cast_possible_truncation, reason = "32768 is -32768")]
        let [turn_rate, yaw] = [turn_rate, yaw].map(|value| value.round() as i32 as i16);
        send.extend(frame(0x52, [0, 0, turn_rate, 0]));
        send.extend(frame(0x53, [0, 0, yaw, 0]));
    }

    fn receive(&mut self, byte: u8, now: Nanos) {
        self.heard.rotate_left(1);
        self.heard[4] = byte;
        let [0xFF, 0xAA, register, low, _] = self.heard else { return };
        let is_unlocked = self.unlocked_until.is_some_and(|until| now < until);
        if self.heard == UNLOCK {
            self.unlocked_until = Some(now + UNLOCKED_FOR);
        } else if is_unlocked {
            self.obey(register, low);
        }
        self.heard = [0; 5];
    }
}

/// Head, kind, four numbers, and the sum of it all.
fn frame(kind: u8, values: [i16; 4]) -> [u8; 11] {
    let mut frame = [0; 11];
    (frame[0], frame[1]) = (0x55, kind);
    for (bytes, value) in frame[2..10].chunks_exact_mut(2).zip(values) {
        bytes.copy_from_slice(&value.to_le_bytes());
    }
    frame[10] = frame[..10].iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_wit_s() {
        assert_eq!(
            frame(0x53, [0x2000, -0x4000, 0x7FFF, 0]),
            *b"\x55\x53\x00\x20\x00\xC0\xFF\x7F\x00\x00\x06"
        );
    }
}
