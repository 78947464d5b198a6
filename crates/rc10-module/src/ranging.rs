//! Range finders: how far away the next thing is, or why that cannot be said.
//!
//! Every device makes a [`Range`] of its own measurement. **A `Range` is a state, with a distance
//! in one of its states only**: say what happens without one. It has no number for quality:
//! strength, signal quality (its sources contradict each other) and confidence (always 100 so far)
//! have no common scale. Each maker's own limit divides [`Distance`](Range::Distance) and
//! [`Unreliable`](Range::Unreliable); the measurement has the numbers.

use core::fmt;

pub mod jrt;
pub mod stp23l;
pub mod tfmini;

pub use jrt::Jrt;
pub use stp23l::Stp23l;
pub use tfmini::TfMini;

/// A measurement of a range finder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub enum Range {
    /// Distance in millimetres. All three devices count whole ones.
    Distance(u32),
    /// Nothing is where the device can measure: it is nearer, or further away.
    OutOfRange,
    /// The device measured, and says itself that this is not to be relied on.
    Unreliable(Doubt),
    /// The device cannot measure, and says why: a code of its own.
    Fault(u16),
}

/// Why a measurement is not to be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Doubt {
    /// Too little light comes back: a dark or slanting surface, a mirror, a dirty lens.
    #[error("too little light comes back")]
    TooWeak,
    /// Too much of its own light comes back: a reflector.
    #[error("too much light comes back")]
    TooStrong,
    /// Too much of other light: the sun, a spotlight.
    #[error("too much light from elsewhere")]
    AmbientLight,
    /// Measurements contradict each other: an edge, vibration, a bad supply.
    #[error("measurements contradict each other")]
    Unsteady,
    /// The device gives no reason.
    #[error("the device does not say why")]
    Unexplained,
}

impl Range {
    /// The distance in millimetres, if there is one.
    #[inline]
    #[must_use]
    pub const fn millimetres(self) -> Option<u32> {
        match self {
            Self::Distance(millimetres) => Some(millimetres),
            _ => None,
        }
    }

    /// The distance in metres, if there is one.
    #[inline]
    #[must_use]
    pub fn metres(self) -> Option<f32> {
        self.millimetres().map(|millimetres| millimetres as f32 / 1000.0)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Distance(millimetres) => {
                write!(f, "{}.{:03} m", millimetres / 1000, millimetres % 1000)
            }
            Self::OutOfRange => f.write_str("out of range"),
            Self::Unreliable(doubt) => write!(f, "unreliable: {doubt}"),
            Self::Fault(code) => write!(f, "fault {code}"),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn only_a_distance_has_a_number() {
        assert_eq!(Range::Distance(1234).metres(), Some(1.234));
        let others = [Range::OutOfRange, Range::Unreliable(Doubt::TooWeak), Range::Fault(10)];
        for other in others {
            assert_eq!((other.millimetres(), other.metres()), (None, None));
        }
    }

    #[test]
    fn a_range_reads_as_a_sentence() {
        assert_eq!(Range::Distance(12_304).to_string(), "12.304 m");
        assert_eq!(Range::OutOfRange.to_string(), "out of range");
        let weak = Range::Unreliable(Doubt::TooWeak).to_string();
        assert_eq!(weak, "unreliable: too little light comes back");
        assert_eq!(Range::Fault(10).to_string(), "fault 10");
    }
}
