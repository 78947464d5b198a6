//! RoboMaster's referee system on its common link, as the header of V2.0.0 (June 2026) and the structures of V1.x
//! (taproot's) have its frames.

use std::collections::VecDeque;

use crate::Nanos;
use crate::crc::{crc8, crc16};
use crate::serial::{SerialConfig, SerialDevice};

const PERIOD: Nanos = Nanos::new(100_000_000);
/// Energy of a full buffer, J.
const FULL: f64 = 60.0;

/// The season's version of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Season {
    /// V1.x, spring 2026.
    Spring2026,
    /// V2.0.0, June 2026.
    June2026,
    /// A later one, which appends this number of bytes to each command.
    Later(usize),
}

/// A referee system: commands 0x0001, 0x0201, 0x0202 and 0x0208, ten times a second.
#[derive(Clone, Debug)]
pub struct Referee {
    /// The chassis' power limit, W.
    pub limit: u16,
    /// The mean power that the chassis takes, W.
    pub power: f64,
    /// It says nothing; its rules hold all the same.
    pub silent: bool,
    /// The buffer's energy, J.
    pub buffer: f64,
    /// Hit points that are left: an empty buffer costs a fifth of 200 each 100 ms.
    pub health: u16,
    season: Season,
    next: Nanos,
    sequence: u8,
}

impl Referee {
    /// The UART of the common link: 115,200 baud, 8N1.
    pub const SERIAL: SerialConfig =
        SerialConfig { baud: 115_200, bits: 10, receive_capacity: 256 };

    /// A referee with a power limit in W, and a full buffer.
    pub const fn new(limit: u16, season: Season) -> Self {
        let (power, silent, buffer, health) = (0.0, false, FULL, 200);
        Self { limit, power, silent, buffer, health, season, next: Nanos::ZERO, sequence: 0 }
    }

    /// Each 100 ms the buffer loses what was taken above the limit, or gains what was not.
    fn judge(&mut self) {
        let left = self.buffer - 0.1 * (self.power - f64::from(self.limit));
        if left < 0.0 {
            self.health = self.health.saturating_sub(40);
        }
        self.buffer = left.clamp(0.0, FULL);
    }

    fn say(&mut self, command: u16, data: &[u8], send: &mut VecDeque<u8>) {
        let more = if let Season::Later(more) = self.season { more } else { 0 };
        let mut frame = vec![0xA5];
        let length = u16::try_from(data.len() + more).unwrap_or(u16::MAX);
        frame.extend(length.to_le_bytes());
        frame.push(self.sequence);
        frame.push(crc8(0xFF, &frame));
        frame.extend(command.to_le_bytes());
        frame.extend(data);
        frame.resize(frame.len() + more, 0xEE);
        frame.extend(crc16(0xFFFF, &frame).to_le_bytes());
        self.sequence = self.sequence.wrapping_add(1);
        send.extend(frame);
    }
}

impl SerialDevice for Referee {
    fn power_on(&mut self, now: Nanos) {
        self.next = now + PERIOD;
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        self.next = now + PERIOD;
        self.judge();
        if self.silent {
            return;
        }
        let words = |words: &[u16]| words.iter().copied().flat_map(u16::to_le_bytes).collect();
        let left = 420_u64.saturating_sub(now.get() / 1_000_000_000);
        let mut game = vec![0x44];
        game.extend(left.to_le_bytes().into_iter().take(2));
        game.extend([0; 8]);
        self.say(0x0001, &game, send);
        let mut robot = vec![3, 1];
        let numbers: Vec<u8> = words(&[self.health, 200, 12, 100, self.limit]);
        robot.extend(numbers);
        if self.season != Season::Spring2026 {
            robot.extend(25.0_f32.to_le_bytes());
        }
        robot.push(0b111);
        self.say(0x0201, &robot, send);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ..= 60")]
        let buffer = self.buffer as u16;
        let power: Vec<u8> = words(&[0, 0, 0, 0, buffer, 0, 0]);
        self.say(0x0202, &power, send);
        let allowance: Vec<u8> = words(&[50, 0, 200, 0]);
        self.say(0x0208, &allowance, send);
    }
}
