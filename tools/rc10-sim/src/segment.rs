//! A piece of wire and what is on it.

use rc10_can::{BusError, CanFrame};

use crate::Nanos;

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sender {
    /// The number of its place.
    Controller(usize),
    Node(usize),
    Foreign,
}

#[derive(Clone, Copy)]
pub(crate) struct Transmission {
    pub(crate) frame: CanFrame,
    pub(crate) sender: Sender,
    pub(crate) start: Nanos,
    /// Before the interframe space; of the error frame if it failed.
    pub(crate) end: Nanos,
    /// Why it is no frame, as its listeners see it.
    pub(crate) failed: Option<BusError>,
    /// A bit for each controller that has listened from its start on.
    pub(crate) heard_by: u32,
}

impl Transmission {
    /// Destroyed; the error frame ends at `end`.
    pub(crate) fn fail(&mut self, error: BusError, end: Nanos) {
        if self.failed.is_none() {
            self.failed = Some(error);
            self.end = end;
        }
    }
}

/// The content of a piece of wire.
#[derive(Clone, Copy)]
pub(crate) enum Segment {
    Idle,
    /// A frame, or the error frame that destroys it.
    Frame(Transmission),
    /// Recessive, but no node may start yet: after a frame that began at `since`.
    Gap {
        since: Nanos,
        until: Nanos,
    },
    /// Held dominant by a fault.
    Held {
        since: Nanos,
    },
}

impl Segment {
    pub(crate) const fn is_idle(&self) -> bool {
        matches!(self, Self::Idle)
    }

    /// The time at which this ends by itself.
    pub(crate) const fn next_event(&self) -> Option<Nanos> {
        match self {
            Self::Frame(air) => Some(air.end),
            Self::Gap { until, .. } => Some(*until),
            Self::Idle | Self::Held { .. } => None,
        }
    }

    /// The frame that has ended by now, if one has; `gap` of interframe space follows it.
    pub(crate) fn end_frame(&mut self, now: Nanos, gap: Nanos) -> Option<Transmission> {
        match *self {
            Self::Frame(air) if air.end <= now => {
                *self = Self::Gap { since: air.start, until: air.end + gap };
                Some(air)
            }
            _ => None,
        }
    }

    /// Idle from now on, if its time has come: from when to when it was busy.
    pub(crate) fn end_gap(&mut self, now: Nanos) -> Option<(Nanos, Nanos)> {
        match *self {
            Self::Gap { since, until } if until <= now => {
                *self = Self::Idle;
                Some((since, until))
            }
            _ => None,
        }
    }
}
