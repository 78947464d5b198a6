//! The common parts of DJI's receivers.

use std::collections::VecDeque;

use super::{Controls, Remote, characters};
use crate::Nanos;
use crate::serial::{SerialConfig, SerialDevice};

const PERIOD: Nanos = Nanos::new(14_000_000);

/// A receiver that sends frames of `LENGTH` bytes, one every 14 ms while it hears its remote, and
/// nothing otherwise.
#[derive(Debug)]
pub struct Dji<const LENGTH: usize> {
    remote: Remote,
    phase: Nanos,
    next: Nanos,
    character: Nanos,
    frame: fn(&Controls) -> [u8; LENGTH],
}

impl<const LENGTH: usize> Dji<LENGTH> {
    pub(super) fn with(
        remote: &Remote,
        phase: Nanos,
        serial: SerialConfig,
        frame: fn(&Controls) -> [u8; LENGTH],
    ) -> Self {
        let character = serial.character();
        Self { remote: remote.clone(), phase, next: Nanos::ZERO, character, frame }
    }
}

impl<const LENGTH: usize> SerialDevice for Dji<LENGTH> {
    fn power_on(&mut self, now: Nanos) {
        self.next = now + self.phase;
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        self.next = now + PERIOD;
        match self.remote.heard() {
            Some(controls) => {
                send.extend((self.frame)(&controls));
                self.remote.sends(true, now + characters(LENGTH, self.character));
            }
            None => self.remote.pauses(),
        }
    }

    /// It has no receive line.
    fn receive(&mut self, _byte: u8, _now: Nanos) {}
}

/// Bit fields one after another, the lowest bit first.
pub(super) struct Bits<const LENGTH: usize> {
    bytes: [u8; LENGTH],
    at: usize,
}

impl<const LENGTH: usize> Bits<LENGTH> {
    pub(super) const fn new() -> Self {
        Self { bytes: [0; LENGTH], at: 0 }
    }

    pub(super) fn put(&mut self, value: u16, bits: usize) {
        for bit in 0..bits {
            self.bytes[self.at / 8] |= u8::from(value >> bit & 1 == 1) << (self.at % 8);
            self.at += 1;
        }
    }

    pub(super) const fn bytes(self) -> [u8; LENGTH] {
        self.bytes
    }
}

/// A stick's axis: 364 ..= 1684, 1024 in the middle.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "364 ..= 1684")]
pub(super) fn level(deflection: f64) -> u16 {
    (1024.0 + 660.0 * deflection.clamp(-1.0, 1.0)).round() as u16
}
