//! Response times on a bus, known before power-on from what stands on it.

use rc10_can::LengthBounds;
use rc10_can::response::{Stream, response};

use crate::can_ids::{CanIds, Frames, Rate};
use crate::declaration::{Device, Entry, Place, Wiring};

/// The sorts of frames of a bus, and how late each can be. Times are in bits: microseconds at 1 Mbit/s.
#[derive(Clone, Copy, Debug)]
#[must_use]
pub struct Plan {
    streams: [Stream; Self::MOST],
    sorts: [Sort; Self::MOST],
    len: usize,
    extra: Extra,
}

/// What may come between beside the frames that are sent all the time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extra {
    /// Error frames in a second, evenly spread, each with the frame that it destroys.
    pub errors: u32,
    /// Whether motors are being set up: of each one frame and its reply at most while others wait.
    pub set_up: bool,
}

/// A sort of frames on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sort {
    /// Identifiers, length and rate.
    pub frames: Frames,
    /// The place in the plan of the motor whose they are; of a shared command, of the first of them.
    pub motor: usize,
    /// Whether they are sent to the motor, not by it.
    pub is_command: bool,
    /// The place among the sorts of the command of this motor's that is sent most often; `None` for a device that only tells.
    pub command: Option<usize>,
}

/// A tick of the bus.
const TICK: u32 = 1000;
/// The latest end of a command: one that began at the end of its tick.
const LATEST: u32 = TICK + 160;
/// Bits of the shortest command.
const SHORTEST: u32 = LengthBounds::of(0, false).min;
/// From when a tick reads feedback to when its commands may leave: `cargo xtask emulate feedback_waits` measures 56.
const WORK: u32 = 60;
/// How far a device's own period may be off. An assumption, as the next one: no maker tells it.
const JITTER: u32 = 50;
/// The longest time in which a device answers a command.
const REPLY: u32 = 250;

impl Plan {
    /// Sorts of frames that it holds: sixteen for each motor of a bus, as many as one may have.
    pub const MOST: usize = 128;

    /// A bus without motors.
    const fn new(extra: Extra) -> Self {
        let frames = Frames::new(rc10_can::IdPattern::any_standard(), 0, Rate::Rare);
        let sort = Sort { frames, motor: 0, is_command: false, command: None };
        let streams = [Stream::new(frames.pattern, 0, Stream::RARE); Self::MOST];
        Self { streams, sorts: [sort; Self::MOST], len: 0, extra }
    }

    /// A bus of a declaration. Motors count by their place in it.
    pub const fn of(entries: &[Entry<Device>], on: Place, extra: Extra) -> Self {
        Self::new(extra).with_all(entries, on, 0).settled()
    }

    /// A bus with motors of two boards, those of the second one counted behind the first's; `None` if two have the same
    /// identifier. [`settled`](Self::settled) comes last.
    #[must_use]
    pub const fn of_both(of: [(&[Entry<Device>], Place); 2], extra: Extra) -> Option<Self> {
        let [(ours, our_bus), (theirs, their_bus)] = of;
        let all = Self::new(extra).with_all(ours, our_bus, 0);
        let others = Self::new(extra).with_all(theirs, their_bus, ours.len());
        let mut at = 0;
        while at < all.len * others.len {
            let (one, other) = (&all.sorts[at / others.len], &others.sorts[at % others.len]);
            if one.frames.pattern.overlap(&other.frames.pattern).is_some() {
                return None;
            }
            at += 1;
        }
        // What a device obeys although it is never sent, too.
        at = 0;
        while at < ours.len() * theirs.len() {
            let (one, other) = (&ours[at / theirs.len()], &theirs[at % theirs.len()]);
            if one.on.is(our_bus)
                && other.on.is(their_bus)
                && let (Wiring::Can(one), Wiring::Can(other)) =
                    (one.config.wiring(), other.config.wiring())
                && one.clash(&other).is_some()
            {
                return None;
            }
            at += 1;
        }
        Some(all.with_all(theirs, their_bus, ours.len()))
    }

    const fn with_all(self, entries: &[Entry<Device>], on: Place, first: usize) -> Self {
        let (mut plan, mut at) = (self, 0);
        while at < entries.len() {
            if entries[at].on.is(on)
                && let Wiring::Can(ids) = entries[at].config.wiring()
            {
                plan = plan.with(first + at, &ids);
            }
            at += 1;
        }
        plan
    }

    /// With a sort of frames that no motor has: their period, and by how much one may be late. They come behind those of
    /// motors. [`settled`](Self::settled) comes last.
    pub const fn and(mut self, frames: Frames, period: u32, jitter: u32) -> Self {
        assert!(self.len < Self::MOST);
        let stream = Stream::new(frames.usual(), frames.len, period);
        self.streams[self.len] = Stream { jitter, ..stream };
        self.sorts[self.len] = Sort { frames, motor: usize::MAX, is_command: false, command: None };
        self.len += 1;
        self
    }

    /// With one motor more, called by this number. [`settled`](Self::settled) comes last.
    const fn with(mut self, motor: usize, ids: &CanIds) -> Self {
        let (sent, received) = (ids.transmitted(), ids.received());
        let (mut at, mut command, mut most) = (0, None, 0);
        while at < sent.len() + received.len() {
            let is_command = at < sent.len();
            let frames = if is_command { sent[at] } else { received[at - sent.len()] };
            let rate = frames.rate.per_second();
            let place = self.place_of(motor, &frames, is_command);
            if is_command && rate > most {
                (command, most) = (Some(place), rate);
            }
            let period = match 1_000_000_u32.checked_div(rate) {
                Some(period) => period,
                None => Stream::RARE,
            };
            let mut stream = Stream::new(frames.usual(), frames.len, period);
            if place < self.len {
                self.streams[place] = self.streams[place].or(stream);
            } else if place < Self::MOST && (rate > 0 || self.extra.set_up) {
                stream.jitter = match (rate, is_command) {
                    (0, _) => 0,
                    (_, true) => WORK,
                    (_, false) => JITTER,
                };
                self.streams[place] = stream;
                self.sorts[place] = Sort { frames, motor, is_command, command };
                self.len += 1;
            }
            at += 1;
        }
        self
    }

    /// The place of these frames: that of a command that they are part of, or of what else sets the motor up, as that is done
    /// one by one.
    const fn place_of(&self, motor: usize, frames: &Frames, is_command: bool) -> usize {
        let mut at = 0;
        while at < self.len {
            let known = &self.sorts[at];
            let is_place = match (known.frames.rate, frames.rate) {
                (Rate::Rare, Rate::Rare) => known.motor == motor,
                _ => frames.is_part_of(&known.frames.pattern),
            };
            if is_place && known.is_command == is_command {
                return at;
            }
            at += 1;
        }
        self.len
    }

    /// With replies as late as the commands that they answer. They may delay commands themselves.
    pub const fn settled(mut self) -> Self {
        loop {
            let (mut at, mut is_settled) = (0, true);
            while at < self.len {
                let Sort { frames, is_command, command, .. } = self.sorts[at];
                if !is_command && matches!(frames.rate, Rate::EveryTick) {
                    // A command that is not sent within its tick is replaced by the next one.
                    let late = match self.arrives(command) {
                        Some(late) if late < LATEST => late,
                        _ => LATEST,
                    };
                    // Behind the earliest reply: to the shortest command, at once.
                    let late = (late + REPLY).saturating_sub(SHORTEST);
                    is_settled &= late <= self.streams[at].jitter;
                    self.streams[at].jitter = late;
                }
                at += 1;
            }
            if is_settled {
                return self;
            }
        }
    }

    /// The sorts of frames.
    pub const fn sorts(&self) -> &[Sort] {
        self.sorts.split_at(self.len).0
    }

    /// The longest time to the end of a frame of this sort, from when its sender should have it ready; `None`: it has no
    /// bound.
    #[must_use]
    pub const fn response(&self, sort: usize) -> Option<u32> {
        response(self.streams.split_at(self.len).0, sort, self.extra.errors)
    }

    /// The same of a motor's command; at once, if it has none.
    const fn arrives(&self, command: Option<usize>) -> Option<u32> {
        match command {
            Some(command) => self.response(command),
            None => Some(0),
        }
    }

    /// Whether these are the frames that their motor sends most often.
    #[must_use]
    pub const fn is_feedback(&self, sort: usize) -> bool {
        let own = &self.sorts[sort];
        let mut at = 0;
        while at < self.len {
            let (other, rate) = (&self.sorts[at], self.rate(at));
            let is_more = if at < sort { rate >= self.rate(sort) } else { rate > self.rate(sort) };
            if other.motor == own.motor && !other.is_command && is_more {
                return false;
            }
            at += 1;
        }
        !own.is_command
    }

    const fn rate(&self, sort: usize) -> u32 {
        self.sorts[sort].frames.rate.per_second()
    }

    /// The time from one frame of this sort to the next.
    #[must_use]
    pub const fn period(&self, sort: usize) -> u32 {
        self.streams[sort].period
    }

    /// Bits of the longest frame of this sort, with the interframe space.
    #[must_use]
    pub const fn bits(&self, sort: usize) -> u32 {
        self.streams[sort].bits
    }

    /// How old feedback of this sort is at most when a command that it decided has arrived: a period, to the bus and over it,
    /// to the next tick, and back.
    #[must_use]
    pub const fn age(&self, sort: usize) -> Option<u32> {
        match (self.response(sort), self.arrives(self.sorts[sort].command)) {
            (Some(there), Some(back)) => {
                Some(self.streams[sort].period.saturating_add(there + back))
            }
            _ => None,
        }
    }
}
