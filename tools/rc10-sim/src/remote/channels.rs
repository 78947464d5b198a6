//! Sixteen channels of 11 bits, as SBUS and CRSF pack them.

use super::dji::Bits;
use super::{Controls, Switch};

/// The middle of a channel, and how far it goes either way: 172 ..= 1811, 987.5 to 2012 us.
const MIDDLE: f64 = 992.0;
const REACH: f64 = 819.5;

/// The mixer of a transmitter: the channel of each control, counted from 1 (0: on none), and whether it is reversed.
/// The controls are the right stick across and away, the left stick across and away, right and left switch, two
/// more, and the dial.
pub type Mixer = [(u8, bool); 9];

/// "AETR" of mode 2, then the switches and the dial.
pub(super) const AETR: Mixer = plain([1, 2, 4, 3, 5, 6, 7, 8, 9]);
/// As `RC10_LIB`'s `AirJoy`: left stick across, away; right stick away, across; the switches.
pub(super) const AIR_JOY: Mixer = plain([4, 3, 1, 2, 5, 6, 7, 8, 0]);

const fn plain(numbers: [u8; 9]) -> Mixer {
    let (mut mixer, mut at) = ([(0, false); 9], 0);
    while at < numbers.len() {
        mixer[at].0 = numbers[at];
        at += 1;
    }
    mixer
}

/// How far each channel is from its middle, -1 to 1.
pub(super) fn channels<const N: usize>(mixer: &Mixer, controls: &Controls) -> [f64; N] {
    let Controls { left, right, left_switch, right_switch, more_switches, dial, .. } = controls;
    let [third, fourth] = more_switches.map(deflection);
    let [right_switch, left_switch] = [*right_switch, *left_switch].map(deflection);
    let sticks = [right.x, right.y, left.x, left.y];
    let rest = [right_switch, left_switch, third, fourth, *dial];
    let mut channels = [0.0; N];
    for ((number, is_reversed), value) in mixer.iter().zip(sticks.into_iter().chain(rest)) {
        let channel = usize::from(*number).checked_sub(1).and_then(|index| channels.get_mut(index));
        if let Some(channel) = channel {
            *channel = if *is_reversed { -value } else { value };
        }
    }
    channels
}

/// A switch as a channel: away from the body is the least, as on transmitters of `EdgeTX`.
const fn deflection(switch: Switch) -> f64 {
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

/// Sixteen channels as a frame has them.
pub(super) fn packed(mixer: &Mixer, controls: &Controls) -> [u8; 22] {
    pack(&channels(mixer, controls).map(level))
}

/// The lowest bit of the first channel is the lowest bit of the first byte.
fn pack(channels: &[u16; 16]) -> [u8; 22] {
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
