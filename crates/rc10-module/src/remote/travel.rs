use super::Switch;

/// The travel of a channel: its ends and its middle, in its protocol's counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Travel {
    /// At one end.
    pub low: u16,
    /// In the middle: between the two.
    pub middle: u16,
    /// At the other end.
    pub high: u16,
}

/// The share of the way around a stick's middle that counts as zero; from there it grows from 0.
pub const DEAD_BAND: f32 = 0.02;

impl Travel {
    pub(super) const fn is_possible(self) -> bool {
        self.low < self.middle && self.middle < self.high
    }

    /// -1 at the low end and below, 1 at the high end and above, 0 within [`DEAD_BAND`].
    #[must_use]
    pub fn share(self, raw: u16) -> f32 {
        let share = self.linear(raw);
        let beyond = (share.abs() - DEAD_BAND) / (1.0 - DEAD_BAND);
        // No minus before a zero.
        if beyond > 0.0 { beyond.min(1.0).copysign(share) } else { 0.0 }
    }

    /// A switch's position: `Up` below the low half's middle, `Down` above the high half's.
    #[must_use]
    pub fn switch(self, raw: u16) -> Switch {
        let share = self.linear(raw);
        if share < -0.5 {
            Switch::Up
        } else if share > 0.5 {
            Switch::Down
        } else {
            Switch::Middle
        }
    }

    /// Each half by its own length: the two are not always the same.
    fn linear(self, raw: u16) -> f32 {
        let end = if raw < self.middle { self.low } else { self.high };
        let length = f32::from(end.abs_diff(self.middle).max(1));
        (f32::from(raw) - f32::from(self.middle)) / length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SBUS: Travel = Travel { low: 172, middle: 992, high: 1811 };

    #[test]
    #[expect(clippy::float_cmp, reason = "they are exact")]
    fn the_ends_are_one_and_the_middle_is_nothing() {
        for (raw, share) in [(172, -1.0), (992, 0.0), (1811, 1.0), (0, -1.0), (u16::MAX, 1.0)] {
            assert_eq!(SBUS.share(raw), share, "{raw}");
        }
        // 2 % of 820 and of 819 are 16.4.
        assert_eq!((SBUS.share(976), SBUS.share(1008)), (0.0, 0.0));
        assert!((SBUS.share(1009) - 0.000_77).abs() < 1e-5, "{}", SBUS.share(1009));
        assert!((SBUS.share(975) + 0.000_75).abs() < 1e-5, "{}", SBUS.share(975));
        assert!(SBUS.share(1810) < 1.0 && SBUS.share(173) > -1.0);
    }

    #[test]
    fn a_switch_turns_half_way_to_its_ends() {
        let at = [172, 581, 582, 992, 1401, 1402, 1811].map(|raw| SBUS.switch(raw));
        use Switch::{Down, Middle, Up};
        assert_eq!(at, [Up, Up, Middle, Middle, Middle, Down, Down]);
    }

    #[test]
    fn nonsense_gives_numbers_all_the_same() {
        let nowhere = Travel { low: 5, middle: 5, high: 5 };
        assert!(!nowhere.is_possible() && SBUS.is_possible());
        for raw in [0, 5, u16::MAX] {
            assert!(nowhere.share(raw).abs() <= 1.0);
        }
    }
}
