use core::fmt;

use rc10_can::{IdPattern, LengthBounds};

use crate::can_ids::{CanIds, Frames};

/// The share of a bus that its motors need, known before power-on from their identifiers.
///
/// Percent of the bit rate: exact lengths with interframe space, and different stuff bits.
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
}

/// Adds up what motors need, in a constant too.
pub(crate) struct LoadSum {
    pub(crate) load: BusLoad,
    bits_per_second: u32,
    /// Shared frames, sent once. With a full list one counts twice: the load is never too low.
    shared: [IdPattern; 32],
    len: usize,
}

impl LoadSum {
    pub(crate) const fn new(bits_per_second: u32) -> Self {
        let shared = [IdPattern::any_standard(); 32];
        Self { load: BusLoad::NONE, bits_per_second, shared, len: 0 }
    }

    pub(crate) const fn add(&mut self, ids: &CanIds) {
        let (mut at, received) = (0, ids.received());
        while at < received.len() {
            self.add_frames(&received[at]);
            at += 1;
        }
        let (mut at, sent) = (0, ids.transmitted());
        while at < sent.len() {
            if !self.is_counted(&sent[at]) {
                self.add_frames(&sent[at]);
            }
            at += 1;
        }
    }

    /// Whether it is a frame that another motor shares, and counted with that. Else it is noted.
    const fn is_counted(&mut self, sent: &Frames) -> bool {
        let mut at = 0;
        while at < self.len {
            if sent.is_part_of(&self.shared[at]) {
                return true;
            }
            at += 1;
        }
        if self.len < self.shared.len() {
            self.shared[self.len] = sent.pattern;
            self.len += 1;
        }
        false
    }

    const fn add_frames(&mut self, frames: &Frames) {
        let bounds = LengthBounds::of(frames.len as usize, frames.pattern.is_extended());
        let rate = frames.rate.per_second();
        let bits = if self.bits_per_second == 0 { 1 } else { self.bits_per_second };
        let percent = rate as f32 * 100.0 / bits as f32;
        self.load.frames_per_second = self.load.frames_per_second.saturating_add(rate);
        self.load.least += bounds.min as f32 * percent;
        self.load.typical += bounds.typical() as f32 * percent;
        self.load.worst += bounds.max as f32 * percent;
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
