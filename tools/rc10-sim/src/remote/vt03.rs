//! DJI's video link with a remote. No manual of it was found: the frame is as three teams' code reads
//! it (XDU librm `vt03.hpp`, RPL, UIC), its rate is that of a DR16.

use super::dji::{Bits, Dji, level};
use super::{Controls, Remote, Switch};
use crate::Nanos;
use crate::serial::SerialConfig;

const LENGTH: usize = 21;

/// A VT03: 21 bytes every 14 ms while it hears its remote, nothing otherwise.
///
/// Its remote has one switch: it takes the part of [`Controls::right_switch`]. Of the left one, down
/// is the pause button, and up the left button.
pub type Vt03 = Dji<LENGTH>;

impl Vt03 {
    /// Its UART: 921,600 baud, 8N1.
    pub const SERIAL: SerialConfig =
        SerialConfig { baud: 921_600, bits: 10, receive_capacity: 256 };

    /// A receiver that sends its first frame at `phase` after power-on.
    #[must_use]
    pub fn new(remote: &Remote, phase: Nanos) -> Self {
        Self::with(remote, phase, Self::SERIAL, frame)
    }
}

fn frame(controls: &Controls) -> [u8; LENGTH] {
    let Controls { left, right, left_switch, right_switch, dial, keys, .. } = *controls;
    let mut bits = Bits::<{ LENGTH - 2 }>::new();
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
    let mut frame = [0; LENGTH];
    frame[..LENGTH - 2].copy_from_slice(&bytes);
    frame[LENGTH - 2..].copy_from_slice(&checksum(&bytes).to_le_bytes());
    frame
}

/// CRC-16/MCRF4XX, bit by bit.
fn checksum(bytes: &[u8]) -> u16 {
    let mut crc = 0xFFFF_u16;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            let carry = crc & 1;
            crc >>= 1;
            if carry == 1 {
                crc ^= 0x8408;
            }
        }
    }
    crc
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remote::Stick;

    /// Frames that XDU's code reads so; the mouse's bytes are zero here, so the second one's sum is
    /// not theirs.
    #[test]
    fn frames_are_what_a_team_s_code_reads() {
        let bytes = |text: &str| -> Vec<u8> {
            let digits = |at| u8::from_str_radix(&text[at..at + 2], 16);
            (0..text.len()).step_by(2).filter_map(|at| digits(at).ok()).collect()
        };
        let middle = bytes("a9530004200001180008000000000000000000528c");
        assert_eq!(frame(&Controls::REST).to_vec(), middle);
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
        assert_eq!(frame(&moved)[..10], bytes("a953900132fa9888280a")[..]);
        assert_eq!(frame(&moved)[10..19], bytes("000000000000001102")[..]);
        // The check value of the catalogue of CRCs.
        assert_eq!(checksum(b"123456789"), 0x6F91);
    }
}
