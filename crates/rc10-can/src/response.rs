//! Worst response times of frames on a bus, from their identifiers, lengths and periods alone.

use crate::{IdPattern, LengthBounds};

/// Frames of one sort, as their sender wants the bus. Times are in bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub struct Stream {
    /// Place in arbitration of the most urgent identifier and of the least urgent one: the smaller wins.
    pub urgency: [u32; 2],
    /// The longest frame, with all stuff bits and the interframe space.
    pub bits: u32,
    /// Least time from one frame to the next; [`RARE`](Self::RARE): there is one at most while others wait.
    pub period: u32,
    /// How late a frame may be ready, after its time.
    pub jitter: u32,
    /// The node that sends it, if that node's frames leave in the order in which they are ready. `None`: the most
    /// urgent of a node leaves first, as from an FDCAN's transmit buffers.
    pub fifo: Option<u8>,
}

/// Bits of the longest error frame and what follows: two flags of six each, delimiter 8, interframe space 3, and what the
/// flags overlap.
pub const ERROR_FRAME: u32 = 31;
/// Longer than this no bus is looked at, 100 ms: frames that wait so long have no bound worth the name.
const LONGEST: u32 = 100_000;
/// More error frames in a million bits are counted as these: none of them fits on a bus beside a frame.
const MOST_ERRORS: u32 = 20_000;

impl Stream {
    /// The period of what is set up now and then.
    pub const RARE: u32 = u32::MAX;

    /// Frames of such an identifier and so many data bytes, every `period` bits.
    pub const fn new(pattern: IdPattern, len: u8, period: u32) -> Self {
        let bits = LengthBounds::of(len as usize, pattern.is_extended()).max;
        let lowest = pattern.raw() & pattern.mask();
        let urgency = [lowest, lowest | !pattern.mask()];
        let urgency = [urgency_of(urgency[0], &pattern), urgency_of(urgency[1], &pattern)];
        Self { urgency, bits, period, jitter: 0, fifo: None }
    }

    /// Frames that are either these or those: as urgent, and as little, and as long as any of them.
    pub const fn or(mut self, other: Self) -> Self {
        let [[first, last], [other_first, other_last]] = [self.urgency, other.urgency];
        self.urgency =
            [if other_first < first { other_first } else { first }, most(last, other_last)];
        self.bits = most(self.bits, other.bits);
        self
    }

    /// Frames that are ready in such a time, at most.
    const fn ready_in(&self, time: u32) -> u32 {
        if self.period == Self::RARE { 1 } else { (time + self.jitter).div_ceil(self.period) }
    }

    const fn is_queued_with(&self, other: &Self) -> bool {
        matches!((self.fifo, other.fifo), (Some(own), Some(other)) if own == other)
    }
}

/// Place in arbitration: the bits as they come, and a standard frame before an extended one that begins like it.
const fn urgency_of(raw: u32, pattern: &IdPattern) -> u32 {
    if pattern.is_extended() {
        let raw = raw & 0x1FFF_FFFF;
        raw >> 18 << 19 | 1 << 18 | raw & 0x3_FFFF
    } else {
        (raw & 0x7FF) << 19
    }
}

/// The longest time from when a frame of a stream should be ready to its end on the wire, in bits; `None`: there is no
/// bound, because the bus may be full of frames that go before it.
///
/// `errors`: error frames in a million bits, evenly spread, each with the frame that it destroyed.
///
/// Source: Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted, revisited and
/// revised", 2007: all frames of a busy period count, not only the first. For nodes that send in order: Davis, Kollmann,
/// Pollex, Slomka, "Controller Area Network (CAN) schedulability analysis with FIFO queues", 2011: a frame waits for one of
/// each other stream of its node, all as urgent as the least urgent of them.
///
/// ```
/// use rc10_can::response::{Stream, response};
///
/// // The example of the paper, in microseconds. The analysis of 1994 says 3000 for the last.
/// let stream = |place, period| Stream { urgency: [place; 2], bits: 1000, period, jitter: 0, fifo: None };
/// let streams = [stream(1, 2500), stream(2, 3500), stream(3, 3500)];
/// assert_eq!(response(&streams, 2, 0), Some(3500));
/// ```
#[must_use]
pub const fn response(streams: &[Stream], of: usize, errors: u32) -> Option<u32> {
    let own = &streams[of];
    let (mut urgency, mut queued, mut at) = (own.urgency[1], 0, 0);
    while at < streams.len() {
        if at != of && own.is_queued_with(&streams[at]) {
            queued += streams[at].bits;
            urgency = most(urgency, streams[at].urgency[1]);
        }
        at += 1;
    }
    // One less urgent frame may have begun; in a queue also an older one of its own.
    let (mut blocking, mut longest) = (if queued > 0 { own.bits } else { 0 }, own.bits);
    at = 0;
    while at < streams.len() {
        let other = &streams[at];
        at += 1;
        if other.urgency[0] <= urgency {
            longest = most(longest, other.bits);
        }
        if other.urgency[0] > urgency || queued > 0 && own.is_queued_with(other) {
            blocking = most(blocking, other.bits);
        }
    }
    let errors = if errors < MOST_ERRORS { errors } else { MOST_ERRORS };
    let lost = (errors, ERROR_FRAME + longest);
    let others = Others { streams, of, urgency, lost };
    let mut busy = blocking + queued + own.bits;
    if queued == 0 {
        loop {
            let next = blocking + others.bits_in(busy) + own.ready_in(busy) * own.bits;
            if next > LONGEST {
                return None;
            }
            if next <= busy {
                break;
            }
            busy = next;
        }
    }
    let (mut worst, mut number, mut wait) = (0, 0, blocking + queued);
    loop {
        // When the frame of this number begins: behind those before it, and all that is more urgent.
        loop {
            let next = blocking + queued + number * own.bits + others.bits_in(wait + 1);
            if next > LONGEST {
                return None;
            }
            if next <= wait {
                break;
            }
            wait = next;
        }
        let ready = number.saturating_mul(own.period);
        worst = most(worst, (own.jitter + wait + own.bits).saturating_sub(ready));
        number += 1;
        if number >= own.ready_in(busy) || queued > 0 {
            break;
        }
        wait += own.bits;
    }
    // An older one of its own would be in the queue.
    if queued > 0 && worst > own.period { None } else { Some(worst) }
}

/// What goes before frames of one stream.
struct Others<'s> {
    streams: &'s [Stream],
    of: usize,
    urgency: u32,
    /// Error frames in a million bits, and what each costs.
    lost: (u32, u32),
}

impl Others<'_> {
    /// Bits that they want of the bus in such a time.
    const fn bits_in(&self, time: u32) -> u32 {
        let own = &self.streams[self.of];
        let (errors, cost) = self.lost;
        #[expect(clippy::cast_possible_truncation, reason = "at most as many as there are bits")]
        let mut bits = (time as u64 * errors as u64).div_ceil(1_000_000) as u32 * cost;
        let mut at = 0;
        while at < self.streams.len() {
            let other = &self.streams[at];
            if at != self.of && other.urgency[0] <= self.urgency && !own.is_queued_with(other) {
                bits += other.ready_in(time) * other.bits;
            }
            at += 1;
        }
        bits
    }
}

const fn most(one: u32, other: u32) -> u32 {
    if one > other { one } else { other }
}
