//! DJI's receivers: the DR16, from "RoboMaster Remote Control User Manual", Receiver, frame of DBUS;
//! and the video link VT03. No manual of that was found: the frame is as three teams' code reads it
//! (XDU librm `vt03.hpp`, RPL, UIC), its rate is that of a DR16.

use std::collections::VecDeque;

use super::{Controls, Remote, Switch, characters};
use crate::Nanos;
use crate::crc::crc16;
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
    fn with(
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
#[expect(clippy::cast_possible_truncation, reason = "364 ..= 1684")]
fn level(deflection: f64) -> u16 {
    (1024.0 + 660.0 * deflection.clamp(-1.0, 1.0)).round() as u16
}

/// A DR16: 18 bytes every 14 ms while it hears its remote, nothing otherwise.
pub type Dr16 = Dji<18>;

impl Dr16 {
    /// The UART: 100 kbaud, 8E1. Its output is inverted; the board's inverter is not simulated.
    pub const SERIAL: SerialConfig =
        SerialConfig { baud: 100_000, bits: 11, receive_capacity: 256 };

    /// A receiver that sends its first frame at `phase` after power-on.
    pub fn new(remote: &Remote, phase: Nanos) -> Self {
        Self::with(remote, phase, Self::SERIAL, dr16)
    }
}

fn dr16(controls: &Controls) -> [u8; 18] {
    let Controls { left, right, left_switch, right_switch, dial, keys, .. } = *controls;
    let mut bits = Bits::<18>::new();
    for deflection in [right.x, right.y, left.x, left.y] {
        bits.put(level(deflection), 11);
    }
    bits.put(position(right_switch), 2);
    bits.put(position(left_switch), 2);
    // The mouse: three motions of 16 bits, two buttons of a byte.
    for length in [16, 16, 16, 8, 8] {
        bits.put(0, length);
    }
    bits.put(keys, 16);
    bits.put(level(dial), 16);
    bits.bytes()
}

const fn position(switch: Switch) -> u16 {
    match switch {
        Switch::Up => 1,
        Switch::Down => 2,
        Switch::Middle => 3,
    }
}

/// A VT03: 21 bytes every 14 ms while it hears its remote, nothing otherwise.
///
/// Its remote has one switch: it takes the part of [`Controls::right_switch`]. Of the left one, down
/// is the pause button, and up the left button.
pub type Vt03 = Dji<21>;

impl Vt03 {
    /// The UART: 921,600 baud, 8N1.
    pub const SERIAL: SerialConfig =
        SerialConfig { baud: 921_600, bits: 10, receive_capacity: 256 };

    /// A receiver that sends its first frame at `phase` after power-on.
    pub fn new(remote: &Remote, phase: Nanos) -> Self {
        Self::with(remote, phase, Self::SERIAL, vt03)
    }
}

fn vt03(controls: &Controls) -> [u8; 21] {
    let Controls { left, right, left_switch, right_switch, dial, keys, .. } = *controls;
    let mut bits = Bits::<19>::new();
    bits.put(0x53A9, 16);
    for deflection in [right.x, right.y, left.y, left.x] {
        bits.put(level(deflection), 11);
    }
    let mode = match right_switch {
        Switch::Down => 0,
        Switch::Middle => 1,
        Switch::Up => 2,
    };
    bits.put(mode, 2);
    bits.put(u16::from(left_switch == Switch::Down), 1);
    bits.put(u16::from(left_switch == Switch::Up), 1);
    bits.put(0, 1);
    bits.put(level(dial), 11);
    // The trigger, and three bits of nothing.
    bits.put(0, 4);
    // The mouse: three motions of 16 bits, and its buttons.
    for length in [16, 16, 16, 8] {
        bits.put(0, length);
    }
    bits.put(keys, 16);
    let bytes = bits.bytes();
    let mut frame = [0; 21];
    frame[..19].copy_from_slice(&bytes);
    frame[19..].copy_from_slice(&crc16(0xFFFF, &bytes).to_le_bytes());
    frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remote::Stick;

    fn bytes(text: &str) -> Vec<u8> {
        let digits = |at| u8::from_str_radix(&text[at..at + 2], 16);
        (0..text.len()).step_by(2).filter_map(|at| digits(at).ok()).collect()
    }

    /// Frames that DJI's own receiver code understands so; the mouse's bytes are zero here.
    #[test]
    fn frames_of_a_dr16_are_what_the_vendor_s_code_reads() {
        let middle = bytes("0004200001f8000000000000000000000004");
        assert_eq!(dr16(&Controls::REST).to_vec(), middle);
        let moved = Controls {
            right: Stick { x: -1.0, y: 1.0 },
            left: Stick { x: -1.0, y: 1.0 },
            right_switch: Switch::Down,
            dial: 333.0 / 660.0,
            keys: 304,
            ..Controls::REST
        };
        assert_eq!(dr16(&moved).to_vec(), bytes("6ca1345b28ed000000000000000030014d05"));
    }

    /// Frames that XDU's code reads so; the mouse's bytes are zero here, so the second one's sum is
    /// not theirs.
    #[test]
    fn frames_of_a_vt03_are_what_a_team_s_code_reads() {
        let middle = bytes("a9530004200001180008000000000000000000528c");
        assert_eq!(vt03(&Controls::REST).to_vec(), middle);
        let share = |level: f64| (level - 1024.0) / 660.0;
        let moved = Controls {
            right: Stick { x: share(400.0), y: share(1600.0) },
            left: Stick { x: share(1100.0), y: share(1000.0) },
            left_switch: Switch::Up,
            right_switch: Switch::Down,
            dial: share(1300.0),
            keys: 529,
            ..Controls::REST
        };
        assert_eq!(vt03(&moved)[..10], bytes("a953900132fa9888280a")[..]);
        assert_eq!(vt03(&moved)[10..19], bytes("000000000000001102")[..]);
        // The check value of the catalogue of CRCs.
        assert_eq!(crc16(0xFFFF, b"123456789"), 0x6F91);
    }
}
