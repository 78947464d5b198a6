//! DJI's receiver, from "RoboMaster Remote Control User Manual", Receiver: frame of DBUS.

use super::dji::{Bits, Dji, level};
use super::{Controls, Remote, Switch};
use crate::Nanos;
use crate::serial::SerialConfig;

const LENGTH: usize = 18;

/// A DR16: 18 bytes every 14 ms while it hears its remote, nothing otherwise.
pub type Dr16 = Dji<LENGTH>;

impl Dr16 {
    /// Its UART: 100 kbaud, 8E1. Its output is inverted; the board's inverter is not simulated.
    pub const SERIAL: SerialConfig =
        SerialConfig { baud: 100_000, bits: 11, receive_capacity: 256 };

    /// A receiver that sends its first frame at `phase` after power-on.
    #[must_use]
    pub fn new(remote: &Remote, phase: Nanos) -> Self {
        Self::with(remote, phase, Self::SERIAL, frame)
    }
}

fn frame(controls: &Controls) -> [u8; LENGTH] {
    let Controls { left, right, left_switch, right_switch, dial, keys, .. } = *controls;
    let mut bits = Bits::<LENGTH>::new();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remote::Stick;

    /// Frames that DJI's own receiver code understands so; the mouse's bytes are zero here.
    #[test]
    fn frames_are_what_the_vendor_s_code_reads() {
        let bytes = |text: &str| -> Vec<u8> {
            let digits = |at| u8::from_str_radix(&text[at..at + 2], 16);
            (0..text.len()).step_by(2).filter_map(|at| digits(at).ok()).collect()
        };
        let middle = bytes("0004200001f8000000000000000000000004");
        assert_eq!(frame(&Controls::REST).to_vec(), middle);
        let moved = Controls {
            right: Stick { x: -1.0, y: 1.0 },
            left: Stick { x: -1.0, y: 1.0 },
            right_switch: Switch::Down,
            dial: 333.0 / 660.0,
            keys: 304,
            ..Controls::REST
        };
        assert_eq!(frame(&moved).to_vec(), bytes("6ca1345b28ed000000000000000030014d05"));
    }
}
