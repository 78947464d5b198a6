use heapless::Vec;
use rc10_time::Micros;

use super::channels::{eleven_bits, fitting};
use super::{ChannelMap, ChannelOrder, Keys, Remote, Travel};
use crate::{Found, Pause, Protocol};

/// SBUS of Futaba, `FrSky` and others: 25 bytes every 4 to 14 ms, 100 kbaud 8E2, inverted.
///
/// A frame is taken when it begins with 0F, ends with 00 (SBUS2: 04, 14, 24 or 34) and the four
/// flags that do not exist are not set. It is found in a stream without a pause, too; where there
/// is one, what was begun before it is dropped, so that no frame is ever made of two halves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sbus;

/// One frame of SBUS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SbusFrame {
    /// 0 ..= 2047 each; see [`pulse_width`] and [`SBUS_TRAVEL`].
    pub channels: [u16; 16],
    /// Channels 17 and 18, which are on or off.
    pub digital: [bool; 2],
    /// The receiver has missed a radio frame: the channels are those of before.
    pub frame_lost: bool,
    /// The receiver has given the transmitter up: the channels are what it was told to send then.
    pub failsafe: bool,
}

const LENGTH: usize = 25;
const HEADER: u8 = 0x0F;
/// Longer than a frame (3 ms), for drivers that hand bytes over when the line is idle.
const PAUSE: Micros = Micros::new(3500);

/// The travel 987.5, 1500, 2011.9 µs of `FrSky` and others. (Futaba's middle is 1024.)
pub const SBUS_TRAVEL: Travel = Travel { low: 172, middle: 992, high: 1811 };

/// The pulse of an SBUS or CRSF channel, µs: 5/8 a count, 992 is 1500 (betaflight; TBS's CRSF).
#[must_use]
pub fn pulse_width(raw: u16) -> f32 {
    f32::from(raw) * 0.625 + 880.0
}

impl Protocol for Sbus {
    type Message = SbusFrame;
    type Buffer = Vec<u8, LENGTH>;

    const PAUSE: Option<Pause> = Some(Pause::Ends(PAUSE));

    fn examine(&self, bytes: &[u8]) -> Found<SbusFrame> {
        if bytes.first() != Some(&HEADER) {
            return Found::Nothing;
        }
        let Some([_, packed @ .., flags, end]) = bytes.first_chunk::<LENGTH>() else {
            return Found::More(LENGTH);
        };
        if !matches!(end, 0x00 | 0x04 | 0x14 | 0x24 | 0x34) {
            // A header of one byte: most likely it was another byte.
            return Found::Nothing;
        }
        if flags & 0xF0 != 0 {
            return Found::Damaged;
        }
        let frame = SbusFrame {
            channels: eleven_bits(packed),
            digital: [flags & 1 != 0, flags & 2 != 0],
            frame_lost: flags & 4 != 0,
            failsafe: flags & 8 != 0,
        };
        Found::Frame(LENGTH, frame)
    }
}

impl ChannelMap<16> {
    /// [`ChannelOrder::AETR`] at [`SBUS_TRAVEL`]: SBUS and CRSF as most transmitters send them.
    pub const AETR: Self = fitting(ChannelOrder::AETR, SBUS_TRAVEL);
}

impl SbusFrame {
    /// The state of the remote. Channels 17 and 18 are keys 16 and 17.
    ///
    /// `None` if a radio frame was missed: counted as good it would keep an old stick alive.
    #[must_use]
    pub fn remote(&self, map: &ChannelMap<16>) -> Option<Remote> {
        if self.frame_lost && !self.failsafe {
            return None;
        }
        let [first, second] = self.digital.map(u32::from);
        Some(Remote {
            keys: Keys(first << 16 | second << 17),
            failsafe: self.failsafe,
            ..map.remote(&self.channels)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stream;
    use crate::remote::Switch;

    /// Channels 1024, 1, 2047, 0, 512, 777, 1333, 1666, 1999, 42, 84, 168, 336, 672, 1344, 640.
    const FRAME: [u8; LENGTH] = [
        0x0F, 0x00, 0x0C, 0xC0, 0xFF, 0x01, 0x00, 0xA0, 0x84, 0xD5, 0x54, 0xD0, 0xCF, 0x57, 0x01,
        0x15, 0x50, 0x01, 0x15, 0x50, 0x01, 0x15, 0x50, 0x00, 0x00,
    ];
    const CHANNELS: [u16; 16] =
        [1024, 1, 2047, 0, 512, 777, 1333, 1666, 1999, 42, 84, 168, 336, 672, 1344, 640];

    fn with(flags: u8, end: u8) -> [u8; LENGTH] {
        let mut frame = FRAME;
        [frame[23], frame[24]] = [flags, end];
        frame
    }

    fn found(bytes: &[u8]) -> Option<SbusFrame> {
        match Sbus.examine(bytes) {
            Found::Frame(LENGTH, frame) => Some(frame),
            _ => None,
        }
    }

    fn heard(stream: &mut Stream<Sbus>, bytes: &[u8], at: u64) -> usize {
        let mut heard = 0;
        stream.receive(bytes, Micros::new(at), |_| heard += 1);
        heard
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "they are exact")]
    fn counts_are_pulses() {
        assert_eq!([172, 992, 1811].map(pulse_width), [987.5, 1500.0, 2011.875]);
    }

    #[test]
    fn channels_flags_and_end() {
        let frame = found(&FRAME).unwrap();
        assert_eq!((frame.channels, frame.digital), (CHANNELS, [false; 2]));
        assert_eq!(found(&with(0x05, 0)).map(|frame| frame.digital), Some([true, false]));
        assert_eq!(found(&with(0x0A, 0)).map(|frame| frame.digital), Some([false, true]));
        for (flags, lost, failsafe) in [(0, false, false), (4, true, false), (8, false, true)] {
            let frame = found(&with(flags, 0)).unwrap();
            assert_eq!((frame.frame_lost, frame.failsafe), (lost, failsafe));
        }
        for end in 0..=255 {
            let is_taken = [0x00, 0x04, 0x14, 0x24, 0x34].contains(&end);
            assert_eq!(found(&with(0, end)).is_some(), is_taken, "{end:02X}");
        }
        assert_eq!(Sbus.examine(&with(0x10, 0)), Found::Damaged);
        assert_eq!(Sbus.examine(&FRAME[..24]), Found::More(LENGTH));
        assert_eq!(Sbus.examine(&FRAME[1..]), Found::Nothing);
    }

    #[test]
    fn a_frame_the_receiver_made_up_is_no_news() {
        let remote = |flags| found(&with(flags, 0)).unwrap().remote(&ChannelMap::AETR);
        let good = remote(3).unwrap();
        assert_eq!((good.left.y, good.keys, good.failsafe), (1.0, Keys(3 << 16), false));
        assert_eq!((good.right_switch, good.left_switch), (Switch::Up, Switch::Middle));
        assert_eq!(remote(4), None);
        assert!(remote(8).unwrap().failsafe && remote(12).unwrap().failsafe);
    }

    #[test]
    fn frames_are_found_without_pauses() {
        let mut stream = Stream::new(Sbus);
        let wire = [&[0x0F, 0x0F, 0x33][..], &FRAME, &FRAME, &[0x0F; 7], &FRAME].concat();
        assert_eq!(heard(&mut stream, &wire, 0), 3);
        assert_eq!(stream.counters().skipped, 10);
    }

    #[test]
    fn a_pause_ends_what_was_begun() {
        // The second half of a frame that begins with 0F, and the first half of the next.
        let mut halves = FRAME;
        halves[0] = 0x0F;
        let mut stream = Stream::new(Sbus);
        assert_eq!(heard(&mut stream, &halves[..12], 0), 0);
        assert_eq!(heard(&mut stream, &[], 3499), 0);
        assert_eq!(heard(&mut stream, &halves[12..], 3499), 1);
        assert_eq!(heard(&mut stream, &halves[..12], 10_000), 0);
        assert_eq!(heard(&mut stream, &[], 13_500), 0);
        assert_eq!(heard(&mut stream, &halves[12..], 13_500), 0);
        // A good frame behind a false header is found when the line is silent, not with the next.
        assert_eq!(heard(&mut stream, &[], 20_000), 0);
        let mut glued = [&[0x0F][..], &with(0x10, 0)].concat();
        glued.splice(1.., FRAME);
        assert_eq!(heard(&mut stream, &glued[..25], 30_000), 0);
        assert_eq!(heard(&mut stream, &glued[25..], 30_000), 1);
    }
}
