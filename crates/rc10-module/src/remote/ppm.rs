use rc10_time::Micros;

use super::channels::fitting;
use super::{ChannelMap, ChannelOrder, Travel};
use crate::Counters;

/// Eight channels as times between pulses.
///
/// 950 to 2050 µs between two rising edges is a channel, 2100 µs or more ends the frame, anything
/// else is no frame. A frame is delivered when it ends, if it had exactly eight channels: one edge too
/// many or too few would make a switch of a stick. [`silence`](Self::silence) delivers it some 8 ms before the edge
/// that follows. After 100 ms without an edge what was begun is over, and the next frame begins behind the next end
/// of one.
///
/// Made for pulses of either polarity: only the time from edge to edge counts.
#[derive(Clone, Debug, Default)]
pub struct Ppm {
    last: Option<Micros>,
    channels: [u16; 8],
    /// Number of channels received so far; `None` until a frame begins.
    count: Option<usize>,
    counters: Counters,
}

/// µs; `RC10_LIB`'s `AirJoy`.
const CHANNEL: core::ops::RangeInclusive<u64> = 950..=2050;
/// µs; the lower one `AirJoy`'s, which has no upper one.
const END: core::ops::RangeInclusive<u64> = 2100..=100_000;

/// The travel of channels, µs.
pub const PPM_TRAVEL: Travel = Travel { low: 1000, middle: 1500, high: 2000 };

impl ChannelMap<8> {
    /// [`ChannelOrder::AIR_JOY`] at [`PPM_TRAVEL`].
    pub const AIR_JOY: Self = fitting(ChannelOrder::AIR_JOY, PPM_TRAVEL);
}

impl Ppm {
    /// A rising edge at this time; the frame, 950 ..= 2050 µs a channel, if it ended one.
    pub fn edge(&mut self, at: Micros) -> Option<[u16; 8]> {
        let interval = at.since(self.last.replace(at)?).get();
        let begun = self.count.take();
        if CHANNEL.contains(&interval) {
            if let Some(begun) = begun {
                self.count = self.put(begun, interval);
            }
            return None;
        }
        if !END.contains(&interval) {
            self.drop_frame(begun);
            return None;
        }
        self.count = Some(0);
        if begun == Some(self.channels.len()) {
            return self.deliver();
        }
        self.drop_frame(begun);
        None
    }

    /// The time without an edge that ends a frame.
    pub const SILENCE: Micros = Micros::new(*END.start());

    /// No edge came for [`SILENCE`](Self::SILENCE) after the last: the frame, if that ended one.
    pub fn silence(&mut self) -> Option<[u16; 8]> {
        // The next begins behind the edge that follows, if that is not too early.
        let begun = self.count.take_if(|count| *count == self.channels.len());
        begun.and_then(|_| self.deliver())
    }

    fn deliver(&mut self) -> Option<[u16; 8]> {
        self.counters.frames = self.counters.frames.wrapping_add(1);
        Some(self.channels)
    }

    /// Counters of the frames so far: good ones, and those that were begun and dropped.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    fn put(&mut self, count: usize, interval: u64) -> Option<usize> {
        let Some(channel) = self.channels.get_mut(count) else {
            self.drop_frame(Some(count));
            return None;
        };
        *channel = u16::try_from(interval).ok()?;
        Some(count + 1)
    }

    fn drop_frame(&mut self, begun: Option<usize>) {
        // Where an end follows an end, there was no frame.
        if begun.is_some_and(|count| count > 0) {
            self.counters.damaged = self.counters.damaged.wrapping_add(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames after these times from edge to edge.
    fn frames(ppm: &mut Ppm, intervals: &[u64]) -> std::vec::Vec<[u16; 8]> {
        let mut at = ppm.last.unwrap_or(Micros::ZERO);
        let mut found = std::vec::Vec::new();
        let first = ppm.last.is_none().then_some(0);
        for interval in first.iter().chain(intervals) {
            at += Micros::new(*interval);
            found.extend(ppm.edge(at));
        }
        found
    }

    const FRAME: [u64; 9] = [1000, 2000, 1500, 1501, 950, 2050, 1499, 1750, 8000];
    const HEARD: [u16; 8] = [1000, 2000, 1500, 1501, 950, 2050, 1499, 1750];

    /// How many of these and one good frame come through, and how many are dropped.
    fn outcome(intervals: &[u64]) -> (usize, u32) {
        let mut ppm = Ppm::default();
        assert_eq!(frames(&mut ppm, &[5000]).len(), 0);
        let before = frames(&mut ppm, intervals).len();
        assert_eq!(frames(&mut ppm, &FRAME), [HEARD], "after {intervals:?}");
        (before, ppm.counters().damaged)
    }

    #[test]
    fn eight_channels_between_two_ends_are_a_frame() {
        let mut ppm = Ppm::default();
        // The first one is not known to be whole.
        assert_eq!(frames(&mut ppm, &FRAME).len(), 0);
        assert_eq!(frames(&mut ppm, &FRAME), [HEARD]);
        assert_eq!(frames(&mut ppm, &[2100]).len(), 0);
        assert_eq!(frames(&mut ppm, &FRAME), [HEARD]);
        assert_eq!((ppm.counters().frames, ppm.counters().damaged), (2, 0));
    }

    #[test]
    fn anything_else_is_dropped_as_a_whole() {
        let nine = [1500; 9];
        assert_eq!(outcome(&[&nine[..], &[5000]].concat()), (0, 1));
        assert_eq!(outcome(&[&nine[..7], &[5000]].concat()), (0, 1));
        for bad in [949, 2051, 2099, 1, 0, 100_001, 66_800, 10_000_000] {
            let mut intervals = FRAME;
            intervals[3] = bad;
            // A pause in the middle of a frame ends it, and what follows is a frame of five.
            let dropped = if bad == 66_800 { 2 } else { 1 };
            assert_eq!(outcome(&intervals), (0, dropped), "{bad}");
        }
    }

    #[test]
    fn a_whole_frame_that_ends_too_late_is_old() {
        assert_eq!(outcome(&[&FRAME[..8], &[100_000]].concat()), (1, 0));
        let mut ppm = Ppm::default();
        frames(&mut ppm, &[5000]);
        assert_eq!(frames(&mut ppm, &FRAME[..8]).len(), 0);
        assert_eq!(frames(&mut ppm, &[100_001]).len(), 0);
        // The line may have come back anywhere in a frame.
        assert_eq!(frames(&mut ppm, &FRAME).len(), 0);
        assert_eq!(frames(&mut ppm, &FRAME), [HEARD]);
        assert_eq!(ppm.counters().damaged, 1);
    }

    #[test]
    fn a_silence_ends_a_frame_before_its_edge_and_only_once() {
        let mut ppm = Ppm::default();
        frames(&mut ppm, &[5000]);
        for _ in 0..3 {
            assert_eq!(frames(&mut ppm, &FRAME[..7]).len(), 0);
            assert_eq!(ppm.silence(), None, "seven channels");
            assert_eq!(frames(&mut ppm, &FRAME[7..8]).len(), 0);
            assert_eq!((ppm.silence(), ppm.silence()), (Some(HEARD), None));
            assert_eq!(frames(&mut ppm, &FRAME[8..]).len(), 0, "the edge behind it");
        }
        assert_eq!((ppm.counters().frames, ppm.counters().damaged), (3, 0));
        // An edge that was on its way meanwhile begins no frame: all channels would be one further.
        frames(&mut ppm, &FRAME[..8]);
        assert!(ppm.silence().is_some());
        assert_eq!(frames(&mut ppm, &[[1500; 9].as_slice(), &[5000], &FRAME].concat()), [HEARD]);
        // As little does one behind a line that was cut.
        frames(&mut ppm, &FRAME[..8]);
        assert!(ppm.silence().is_some());
        assert_eq!(frames(&mut ppm, &[&[100_001], &FRAME[..], &FRAME].concat()), [HEARD]);
        assert_eq!((ppm.counters().frames, ppm.counters().damaged), (7, 0));
    }

    #[test]
    fn time_that_goes_backwards_is_no_channel() {
        let mut ppm = Ppm::default();
        frames(&mut ppm, &[5000, 1500]);
        assert_eq!(ppm.edge(Micros::ZERO), None);
        assert_eq!(frames(&mut ppm, &FRAME).len(), 0);
        assert_eq!(frames(&mut ppm, &FRAME), [HEARD]);
    }
}
