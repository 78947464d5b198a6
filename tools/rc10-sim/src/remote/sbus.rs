//! Futaba's serial bus, as receivers of Futaba and `FrSky` speak it.

use std::collections::VecDeque;

use super::channels::{AETR, Mixer, packed};
use super::{Controls, Remote, characters};
use crate::Nanos;
use crate::serial::{SerialConfig, SerialDevice};

const LENGTH: usize = 25;
const FRAME_LOST: u8 = 1 << 2;
const FAILSAFE: u8 = 1 << 3;

/// Reaction of a receiver to a long silence, as set when it was bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Failsafe {
    /// The channels stay as they were heard last: the sticks are stuck, but for the flags.
    #[default]
    Hold,
    /// Sticks and switches go to the middle.
    Centre,
}

/// An SBUS receiver: 25 bytes every 7 or 14 ms, whether it hears its remote or not.
///
/// A receiver that does not hear its remote repeats what it heard last, and sets the flag "frame
/// lost"; after a while it sets the flag "failsafe" too.
#[derive(Debug)]
#[must_use]
pub struct Sbus {
    remote: Remote,
    phase: Nanos,
    /// The time from one frame to the next, 7 or 14 ms.
    pub period: Nanos,
    /// The reaction to a long silence.
    pub failsafe: Failsafe,
    /// Lost frames after which it tells the failsafe: 0 tells it with the first.
    pub failsafe_after: u32,
    next: Nanos,
    /// The controls that it heard last; nothing since power-on is failsafe from the start.
    last: Option<Controls>,
    missed: u32,
}

impl Sbus {
    /// The UART: 100 kbaud, 8E2. Its output is inverted; the board's inverter is not simulated.
    pub const SERIAL: SerialConfig =
        SerialConfig { baud: 100_000, bits: 12, receive_capacity: 256 };

    /// A receiver that sends every 14 ms, its first frame at `phase` after power-on. It holds the
    /// sticks when it loses the remote, and says "failsafe" with the 15th frame in a row that is
    /// lost.
    pub fn new(remote: &Remote, phase: Nanos) -> Self {
        Self {
            remote: remote.clone(),
            phase,
            period: Nanos::new(14_000_000),
            failsafe: Failsafe::Hold,
            failsafe_after: 14,
            next: Nanos::ZERO,
            last: None,
            missed: 0,
        }
    }
}

impl SerialDevice for Sbus {
    fn power_on(&mut self, now: Nanos) {
        self.next = now + self.phase;
        (self.last, self.missed) = (None, 0);
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        self.next = now + self.period;
        let heard = self.remote.heard();
        let (controls, flags) = match (heard, self.last) {
            (Some(controls), _) => {
                (self.last, self.missed) = (heard, 0);
                (controls, 0)
            }
            (None, Some(last)) if self.missed < self.failsafe_after => {
                self.missed += 1;
                (last, FRAME_LOST)
            }
            (None, Some(last)) if self.failsafe == Failsafe::Hold => (last, FRAME_LOST | FAILSAFE),
            (None, _) => (Controls::REST, FRAME_LOST | FAILSAFE),
        };
        send.extend(frame(&self.remote.mixer(AETR), &controls, flags));
        let end = now + characters(LENGTH, Self::SERIAL.character());
        self.remote.sends(heard.is_some(), end);
    }
}

fn frame(mixer: &Mixer, controls: &Controls, flags: u8) -> [u8; LENGTH] {
    let mut frame = [0; LENGTH];
    frame[0] = 0x0F;
    frame[1..23].copy_from_slice(&packed(mixer, controls));
    frame[23] = flags;
    frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remote::Switch;

    #[test]
    fn a_frame_at_rest_is_betaflight_s() {
        let mut expected = *b"\x0F\xE0\x03\x1F\xF8\xC0\x07\x3E\xF0\x81\x0F\x7C\
            \xE0\x03\x1F\xF8\xC0\x07\x3E\xF0\x81\x0F\x7C\x00\x00";
        assert_eq!(frame(&AETR, &Controls::REST, 0), expected);
        expected[23] = 0x0C;
        assert_eq!(frame(&AETR, &Controls::REST, FRAME_LOST | FAILSAFE), expected);
    }

    #[test]
    fn a_lost_remote_is_told_by_flags() {
        let remote = Remote::new();
        let mut receiver = Sbus { failsafe_after: 2, ..Sbus::new(&remote, Nanos::ZERO) };
        let mut frame = || {
            let mut send = VecDeque::new();
            receiver.advance(Nanos::ZERO, &mut send);
            let frame: Vec<u8> = send.into();
            (frame[1..23] == packed(&AETR, &Controls::REST), frame[23])
        };
        // It never heard it.
        remote.set_transmitter(false);
        assert_eq!(frame(), (true, 0x0C));
        remote.set_transmitter(true);
        remote.set(Controls { right_switch: Switch::Up, ..Controls::REST });
        assert_eq!(frame(), (false, 0));
        remote.set_transmitter(false);
        assert_eq!([frame(), frame(), frame()], [(false, 4), (false, 4), (false, 0x0C)]);
        receiver.failsafe = Failsafe::Centre;
        let mut send = VecDeque::new();
        receiver.advance(Nanos::ZERO, &mut send);
        assert_eq!(send.make_contiguous(), self::frame(&AETR, &Controls::REST, 0x0C));
        assert_eq!((remote.sent().frames, remote.sent().live), (6, 1));
        assert_eq!(remote.sent().back_since, None);
    }
}
