//! The transmitter's half: characters one after the other, and the driver of an RS-485 transceiver.

use std::collections::VecDeque;

use rc10_sim::Nanos;

use super::wire::{Character, Format, after};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) struct Sending {
    pub format: Format,
    pub bit_fs: u64,
    pub inverted: bool,
    /// Sixteenths of a bit from the driver's enable to the start bit, and from the last stop bit
    /// to its release.
    pub driver: Option<(u64, u64)>,
}

/// A character that begins or has ended at a transmit pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Outgoing {
    pub character: Character,
    /// The end of its last stop bit.
    pub end: Nanos,
    /// Whether it has ended, or begins.
    pub has_ended: bool,
}

#[derive(Debug, Default)]
pub(in super::super) struct Transmitter {
    pub(super) waiting: VecDeque<u16>,
    pub(super) sending: Option<(Character, Nanos)>,
    /// Whether the driver is asserted, and when it will be released.
    pub(super) driver: bool,
    released_at: Option<Nanos>,
    /// Beginning of the character in transmission, while it has not been reported.
    begins_at: Option<Nanos>,
    /// Whether beginnings of characters are reported.
    pub tells: bool,
}

impl Transmitter {
    /// Drops what it has to send.
    pub fn stop(&mut self) {
        *self = Self { tells: self.tells, ..Self::default() };
    }

    /// Starts the next character, if nothing is sent and the driver is not being released.
    pub fn start(&mut self, now: Nanos, how: &Sending) {
        if self.sending.is_some() || self.released_at.is_some_and(|at| at > now) {
            return;
        }
        let Some(value) = self.waiting.pop_front() else { return };
        let mut start = now;
        if let Some((before, _)) = how.driver
            && !std::mem::replace(&mut self.driver, true)
        {
            start = after(now, how.bit_fs, before);
        }
        let value = value & how.format.mask();
        let Sending { format, bit_fs, inverted, .. } = *how;
        let character = Character { value, format, start, bit_fs, inverted, fault: None };
        let end = after(start, bit_fs, format.sixteenths());
        self.sending = Some((character, end));
        self.begins_at = self.tells.then_some(start);
    }

    pub fn next_event(&self) -> Option<Nanos> {
        let end = self.sending.map(|(_, end)| end);
        [end, self.begins_at, self.released_at].into_iter().flatten().min()
    }

    /// The event at this time, if there is one.
    pub fn happens(&mut self, at: Nanos, how: Option<&Sending>) -> Option<Outgoing> {
        if self.released_at.take_if(|released| *released == at).is_some() {
            self.driver = false;
            if let Some(how) = how {
                self.start(at, how);
            }
        }
        if self.begins_at.take_if(|begins| *begins == at).is_some() {
            let (character, end) = self.sending?;
            return Some(Outgoing { character, end, has_ended: false });
        }
        let (character, end) = self.sending.take_if(|(_, end)| *end == at)?;
        if let Some(how) = how {
            self.start(at, how);
            if self.sending.is_none() && self.driver {
                let (_, behind) = how.driver.unwrap_or_default();
                let released = after(at, how.bit_fs, behind);
                self.driver = released > at;
                self.released_at = self.driver.then_some(released);
            }
        }
        Some(Outgoing { character, end, has_ended: true })
    }
}
