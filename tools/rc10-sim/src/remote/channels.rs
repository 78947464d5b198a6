//! Sixteen channels of 11 bits, as SBUS and CRSF pack them.

use super::dji::Bits;
use super::{Controls, Switch};

/// The middle of a channel, and how far it goes either way: 172 ..= 1811, 987.5 to 2012 us.
const MIDDLE: f64 = 992.0;
const REACH: f64 = 819.5;

/// The positions of the controls, as a transmitter that is set up for a robot sends them: the
/// sticks in the order "AETR" of mode 2, then right and left switch, two more, and the dial.
pub(super) fn channels(controls: &Controls) -> [u16; 16] {
    let Controls { left, right, left_switch, right_switch, more_switches, dial, .. } = controls;
    let [third, fourth] = *more_switches;
    let mut channels = [level(0.0); 16];
    let sticks = [right.x, right.y, left.y, left.x].map(level);
    channels[..4].copy_from_slice(&sticks);
    let switches = [*right_switch, *left_switch, third, fourth];
    channels[4..8].copy_from_slice(&switches.map(|switch| level(deflection(switch))));
    channels[8] = level(*dial);
    channels
}

/// A switch as a channel: away from the body is the least, as on transmitters of `EdgeTX`.
pub(super) const fn deflection(switch: Switch) -> f64 {
    match switch {
        Switch::Up => -1.0,
        Switch::Middle => 0.0,
        Switch::Down => 1.0,
    }
}

#[expect(clippy::cast_possible_truncation, reason = "172 ..= 1811")]
fn level(deflection: f64) -> u16 {
    (MIDDLE + REACH * deflection.clamp(-1.0, 1.0)).floor() as u16
}

/// The lowest bit of the first channel is the lowest bit of the first byte.
pub(super) fn pack(channels: &[u16; 16]) -> [u8; 22] {
    let mut bits = Bits::new();
    channels.iter().for_each(|channel| bits.put(*channel, 11));
    bits.bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_packed_as_betaflight_does() {
        let channels =
            [1024, 1, 2047, 0, 512, 777, 1333, 1666, 1999, 42, 84, 168, 336, 672, 1344, 640];
        let expected = [
            0x00, 0x0C, 0xC0, 0xFF, 0x01, 0x00, 0xA0, 0x84, 0xD5, 0x54, 0xD0, 0xCF, 0x57, 0x01,
            0x15, 0x50, 0x01, 0x15, 0x50, 0x01, 0x15, 0x50,
        ];
        assert_eq!(pack(&channels), expected);
    }

    #[test]
    fn levels_reach_from_172_to_1811() {
        let levels = [-2.0, -1.0, 0.0, 1.0, 2.0].map(level);
        assert_eq!(levels, [172, 172, 992, 1811, 1811]);
    }
}
