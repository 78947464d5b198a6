use core::fmt;

use heapless::Vec;
use rc10_can::LengthBounds;

use crate::wiring::{CanIds, Ownership, is_extended};

/// How much of a bus the motors attached to it need, known before power-on: from their wirings
/// alone.
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
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.worst <= 100.0 {
            Verdict::Fits
        } else if self.typical <= 100.0 {
            Verdict::Tight
        } else {
            Verdict::DoesNotFit
        }
    }

    /// The load of motors with these wirings on a bus of `bits_per_second`.
    pub(crate) fn of(wirings: impl Iterator<Item = CanIds>, bits_per_second: u32) -> Self {
        let mut sum = Sum::default();
        // A frame that several motors share is sent once.
        let mut shared: Vec<_, 32> = Vec::new();
        for wiring in wirings {
            for (bounds, rate) in wiring.receive_bits() {
                sum.add(bounds, rate);
            }
            for transmit in wiring.transmitted() {
                let key = transmit.pattern.id();
                if matches!(transmit.share, Ownership::Lane(_)) && shared.contains(&key) {
                    continue;
                }
                // If the list is full, a shared frame counts twice: the load is never too low.
                let _ = shared.push(key);
                let extended = is_extended(&transmit.pattern);
                let bounds = LengthBounds::of(usize::from(transmit.len), extended);
                sum.add(bounds, transmit.rate.per_second());
            }
        }
        sum.share_of(bits_per_second)
    }
}

#[derive(Default)]
struct Sum {
    frames: u32,
    least: u32,
    typical: u32,
    worst: u32,
}

impl Sum {
    fn add(&mut self, bounds: LengthBounds, rate: u32) {
        let add = |sum: &mut u32, bits: u32| *sum = sum.saturating_add(bits.saturating_mul(rate));
        add(&mut self.frames, 1);
        add(&mut self.least, bounds.min);
        add(&mut self.typical, bounds.typical());
        add(&mut self.worst, bounds.max);
    }

    fn share_of(&self, bits_per_second: u32) -> BusLoad {
        #[expect(clippy::cast_precision_loss, reason = "a percentage for people")]
        let percent = |bits: u32| bits as f32 * 100.0 / bits_per_second.max(1) as f32;
        BusLoad {
            frames_per_second: self.frames,
            least: percent(self.least),
            typical: percent(self.typical),
            worst: percent(self.worst),
        }
    }
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
