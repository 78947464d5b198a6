//! Benewake `TFmini-Plus`: UART, 115200 baud 8N1, a frame every 10 ms by itself. Little endian.
//!
//! | byte | |
//! |---|---|
//! | 0, 1 | `59 59` |
//! | 2, 3 | distance, cm |
//! | 4, 5 | strength of what came back |
//! | 6, 7 | temperature, 1/8 °C above -256 °C |
//! | 8 | sum of bytes 0 to 7 |
//!
//! Source: manual A04, table 7 and section 5.4. Not for a `TFmini` without *Plus*: other fields.

use rc10_app::Celsius;

use super::{Doubt, Range};
use crate::sum::sum;
use crate::{Found, Protocol};

const LEN: usize = 9;
const HEAD: u8 = 0x59;
/// Below this strength the detection is unreliable (manual, 5.4).
const WEAKEST: u16 = 100;
/// With this strength, too: the receiver is saturated.
const SATURATED: u16 = u16::MAX;
/// The reach, in cm (manual, 5.4); 0 is what it gives when it has nothing.
const FURTHEST: u16 = 1200;

/// The protocol of a `TFmini-Plus`.
///
/// ```
/// use rc10_time::Micros;
/// use rc10_module::{Stream, ranging::{Range, TfMini}};
///
/// let mut stream = Stream::new(TfMini);
/// let mut range = None;
/// let frame = [0x59, 0x59, 0x7B, 0x00, 0xD7, 0x11, 0x90, 0x09, 0xAE];
/// stream.receive(&frame, Micros::ZERO, |measurement| range = Some(measurement.range()));
/// assert_eq!(range, Some(Range::Distance(1230)));
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct TfMini;

/// The content of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Measurement {
    /// In centimetres, 0 ..= 1200. 0 without an echo. See [`range`](Self::range).
    pub centimetres: u16,
    /// The amount of light that came back: 100 ..= 65534 is reliable.
    pub strength: u16,
    /// The chip's temperature.
    pub temperature: Celsius,
}

impl Measurement {
    /// Whether its strength is one with which the maker calls the distance reliable.
    #[must_use]
    pub const fn is_reliable(&self) -> bool {
        self.strength >= WEAKEST && self.strength != SATURATED
    }

    /// The distance of something, or why it is not known.
    pub fn range(&self) -> Range {
        match (self.strength, self.centimetres) {
            (SATURATED, _) => Range::Unreliable(Doubt::TooStrong),
            (..WEAKEST, _) => Range::Unreliable(Doubt::TooWeak),
            (_, 1..=FURTHEST) => Range::Distance(u32::from(self.centimetres) * 10),
            _ => Range::OutOfRange,
        }
    }
}

impl Protocol for TfMini {
    type Message = Measurement;
    type Buffer = heapless::Vec<u8, LEN>;

    fn examine(&self, bytes: &[u8]) -> Found<Measurement> {
        let &[HEAD, ..] = bytes else { return Found::Nothing };
        let Some(frame) = bytes.first_chunk::<LEN>() else { return Found::More(LEN) };
        let &[_, HEAD, d0, d1, s0, s1, t0, t1, check] = frame else { return Found::Nothing };
        if sum(&frame[..LEN - 1]) != check {
            return Found::Damaged;
        }
        let eighths = f32::from(u16::from_le_bytes([t0, t1]));
        let measurement = Measurement {
            centimetres: u16::from_le_bytes([d0, d1]),
            strength: u16::from_le_bytes([s0, s1]),
            temperature: Celsius::new(eighths / 8.0 - 256.0),
        };
        Found::Frame(LEN, measurement)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::{Counters, Stream};
    use rc10_time::Micros;
    use std::vec::Vec;

    fn frame(centimetres: u16, strength: u16) -> [u8; LEN] {
        let ([d0, d1], [s0, s1]) = (centimetres.to_le_bytes(), strength.to_le_bytes());
        let mut frame = [HEAD, HEAD, d0, d1, s0, s1, 0x60, 0x09, 0];
        frame[8] = sum(&frame[..8]);
        frame
    }

    fn heard(bytes: &[u8]) -> (Vec<Measurement>, Counters) {
        let (mut stream, mut heard) = (Stream::new(TfMini), Vec::new());
        stream.receive(bytes, Micros::ZERO, |measurement| heard.push(measurement));
        (heard, stream.counters())
    }

    #[test]
    fn a_frame_byte_for_byte() {
        let (heard, counters) = heard(b"\x59\x59\x7B\x00\xD7\x11\x90\x09\xAE");
        let temperature = Celsius::new(50.0);
        assert_eq!(heard, [Measurement { centimetres: 123, strength: 4567, temperature }]);
        assert_eq!((counters.frames, counters.skipped), (1, 0));
    }

    #[test]
    fn every_state_at_its_limits() {
        let range = |centimetres, strength| heard(&frame(centimetres, strength)).0[0].range();
        assert_eq!(range(1200, 100), Range::Distance(12_000));
        assert_eq!(range(1, 65_534), Range::Distance(10));
        assert_eq!(range(0, 5000), Range::OutOfRange);
        assert_eq!(range(1201, 5000), Range::OutOfRange);
        assert_eq!(range(300, 99), Range::Unreliable(Doubt::TooWeak));
        assert_eq!(range(0, 65_535), Range::Unreliable(Doubt::TooStrong));
    }

    #[test]
    fn a_frame_that_says_unreliable_is_not_reliable() {
        for strength in [0, 99, 100, 65_534, 65_535] {
            let measurement = heard(&frame(300, strength)).0[0];
            let doubted = matches!(measurement.range(), Range::Unreliable(_));
            assert_eq!(measurement.is_reliable(), !doubted, "{strength}");
        }
    }

    /// 59 59 59: the frame begins with the second of them.
    #[test]
    fn a_head_too_many_costs_no_frame() {
        let bytes = [&[HEAD][..], &frame(251, 900), &[HEAD, HEAD, HEAD], &frame(252, 900)].concat();
        let (heard, counters) = heard(&bytes);
        let distances: Vec<_> = heard.iter().map(|one| one.centimetres).collect();
        assert_eq!(distances, [251, 252]);
        assert_eq!(counters.skipped, 4);
    }

    #[test]
    fn any_wrong_byte_is_noticed() {
        for at in 0..LEN {
            let mut spoilt = frame(250, 900);
            spoilt[at] ^= 0x10;
            let (heard, counters) = heard(&[&spoilt[..], &frame(251, 900)].concat());
            assert_eq!(heard.iter().map(|one| one.centimetres).collect::<Vec<_>>(), [251], "{at}");
            assert!(at < 2 || counters.damaged > 0, "{at}");
        }
        // One head alone is no frame, though the sum is right.
        let mut lone = frame(250, 900);
        lone[1] = 0;
        lone[8] = sum(&lone[..8]);
        assert_eq!(heard(&lone).1.frames, 0);
    }
}
