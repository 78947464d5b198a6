use core::fmt;

use embedded_can::Id;
use heapless::Vec;
use rc10_can::{IdPattern, LengthBounds};

use crate::can_ids::{CanIds, Ownership};

/// The share of a bus that the motors attached to it need, known before power-on: from their
/// identifiers alone.
///
/// Percent of the bit rate. Every figure counts exact frame lengths with interframe space;
/// they differ in the stuff bits, which depend on the data.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusLoad {
    /// Frames a second, both ways.
    pub frames_per_second: u32,
    /// Percent without any stuff bit.
    pub least: f32,
    /// Percent as motors in motion show it (30 % of the possible stuff bits).
    pub typical: f32,
    /// Percent with the most stuff bits possible.
    pub worst: f32,
}

/// Whether a load fits on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Verdict {
    /// Even the worst case fits.
    Fits,
    /// Fits typically; in the worst case frames come late or are overwritten.
    Tight,
    /// Does not fit: frames will be lost.
    DoesNotFit,
}

impl BusLoad {
    /// A bus without motors.
    #[cfg(feature = "embassy")]
    pub(crate) const NONE: Self =
        Self { frames_per_second: 0, least: 0.0, typical: 0.0, worst: 0.0 };

    /// Whether it fits.
    pub fn verdict(&self) -> Verdict {
        if self.worst <= 100.0 {
            Verdict::Fits
        } else if self.typical <= 100.0 {
            Verdict::Tight
        } else {
            Verdict::DoesNotFit
        }
    }

    /// The load of motors with these identifiers on a bus of `bits_per_second`.
    pub(crate) fn of(motors: impl Iterator<Item = CanIds>, bits_per_second: u32) -> Self {
        let mut load = Self::default();
        #[expect(clippy::cast_precision_loss, reason = "a percentage for people")]
        let mut add = |bounds: LengthBounds, rate: u32| {
            let percent = rate as f32 * 100.0 / bits_per_second.max(1) as f32;
            load.frames_per_second = load.frames_per_second.saturating_add(rate);
            load.least += bounds.min as f32 * percent;
            load.typical += bounds.typical() as f32 * percent;
            load.worst += bounds.max as f32 * percent;
        };
        // A frame that several motors share is sent once.
        let mut shared: Vec<_, 32> = Vec::new();
        for ids in motors {
            for received in ids.received() {
                add(bounds(received.len, &received.pattern), received.rate.per_second());
            }
            for sent in ids.transmitted() {
                let key = sent.pattern.id();
                if matches!(sent.ownership, Ownership::Bytes(_)) && shared.contains(&key) {
                    continue;
                }
                // If the list is full, a shared frame counts twice: the load is never too low.
                let _ = shared.push(key);
                add(bounds(sent.len, &sent.pattern), sent.rate.per_second());
            }
        }
        load
    }
}

fn bounds(len: u8, pattern: &IdPattern) -> LengthBounds {
    LengthBounds::of(len.into(), matches!(pattern.id(), Id::Extended(_)))
}

impl fmt::Display for BusLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} frames/s: {:.0} % of the bus without stuff bits, {:.0} % typically, {:.0} % at worst",
            self.frames_per_second, self.least, self.typical, self.worst
        )?;
        f.write_str(match self.verdict() {
            Verdict::Fits => ": fits",
            Verdict::Tight => ": tight, fits typically but not in the worst case",
            Verdict::DoesNotFit => ": does NOT fit, frames will be lost",
        })
    }
}
