use rc10_can::Micros;

use super::{Freshness, LOST_AFTER, MISSING_AFTER, Remote};

/// Tells how fresh what a remote says is: the failsafe, in two steps.
///
/// ```
/// use rc10_can::Micros;
/// use rc10_module::remote::{Freshness, Remote, Watch};
///
/// let mut watch = Watch::new();
/// watch.heard(&Remote::default(), Micros::from_millis(10));
/// assert_eq!(watch.freshness(Micros::from_millis(109)), Freshness::Fresh);
/// assert_eq!(watch.freshness(Micros::from_millis(110)), Freshness::Missing);
/// assert_eq!(watch.freshness(Micros::from_millis(1010)), Freshness::Lost);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watch {
    /// When the newest good frame came.
    good: Option<Micros>,
    /// The newest frame was none.
    failsafe: bool,
}

impl Watch {
    /// Nothing was heard yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { good: None, failsafe: false }
    }

    /// A frame came. One that says [`Remote::failsafe`] is no good frame.
    pub fn heard(&mut self, remote: &Remote, at: Micros) {
        self.failsafe = remote.failsafe;
        if !remote.failsafe {
            self.good = self.good.max(Some(at));
        }
    }

    /// How fresh the newest frame is. A frame that came after `now`, by clocks that were not read
    /// in order, is as old as one that comes just now.
    #[must_use]
    pub fn freshness(&self, now: Micros) -> Freshness {
        let Some(good) = self.good else { return Freshness::Lost };
        let age = now.since(good);
        if age >= LOST_AFTER {
            Freshness::Lost
        } else if age >= MISSING_AFTER || self.failsafe {
            Freshness::Missing
        } else {
            Freshness::Fresh
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Freshness::{Fresh, Lost, Missing};

    const GOOD: Remote = Remote {
        failsafe: false,
        left: super::super::Stick { x: 0.0, y: 0.0 },
        right: super::super::Stick { x: 0.0, y: 0.0 },
        left_switch: super::super::Switch::Middle,
        right_switch: super::super::Switch::Middle,
        more_switches: [super::super::Switch::Middle; 2],
        dial: 0.0,
        mouse: super::super::Mouse { motion: [0; 3], left: false, right: false, middle: false },
        keys: super::super::Keys(0),
    };
    const FAILSAFE: Remote = Remote { failsafe: true, ..GOOD };
    /// Not zero, and not a whole millisecond.
    const START: u64 = 123_456_789;

    fn after(micros: u64) -> Micros {
        Micros::new(START + micros)
    }

    #[test]
    fn nothing_heard_is_lost() {
        assert_eq!(Watch::new().freshness(Micros::ZERO), Lost);
        let mut watch = Watch::new();
        watch.heard(&FAILSAFE, after(0));
        assert_eq!(watch.freshness(after(0)), Lost);
        watch.heard(&GOOD, after(1));
        assert_eq!(watch.freshness(after(1)), Fresh);
    }

    #[test]
    fn silence_is_missing_then_lost_to_the_microsecond() {
        let mut watch = Watch::new();
        watch.heard(&GOOD, after(0));
        for (age, freshness) in [
            (0, Fresh),
            (99_999, Fresh),
            (100_000, Missing),
            (999_999, Missing),
            (1_000_000, Lost),
            (3_600_000_000, Lost),
        ] {
            assert_eq!(watch.freshness(after(age)), freshness, "{age}");
        }
        watch.heard(&GOOD, after(5_000_000));
        assert_eq!(watch.freshness(after(5_099_999)), Fresh);
        assert_eq!(watch.freshness(after(5_100_000)), Missing);
    }

    #[test]
    fn a_failsafe_is_missing_at_once_and_lost_since_the_last_good_frame() {
        let mut watch = Watch::new();
        watch.heard(&GOOD, after(0));
        for time in (10_000..=990_000).step_by(10_000) {
            watch.heard(&FAILSAFE, after(time));
            assert_eq!(watch.freshness(after(time)), Missing, "{time}");
        }
        assert_eq!(watch.freshness(after(999_999)), Missing);
        assert_eq!(watch.freshness(after(1_000_000)), Lost);
        watch.heard(&GOOD, after(1_500_000));
        assert_eq!(watch.freshness(after(1_500_000)), Fresh);
        watch.heard(&FAILSAFE, after(1_500_001));
        assert_eq!(watch.freshness(after(1_500_001)), Missing);
        watch.heard(&GOOD, after(1_500_002));
        assert_eq!(watch.freshness(after(1_600_001)), Fresh);
    }

    #[test]
    fn times_out_of_order_do_not_matter() {
        let mut watch = Watch::new();
        watch.heard(&GOOD, after(50));
        assert_eq!(watch.freshness(after(0)), Fresh);
        // An older frame that is told of later makes nothing older.
        watch.heard(&GOOD, after(20));
        assert_eq!(watch.freshness(after(100_049)), Fresh);
        assert_eq!(watch.freshness(after(100_050)), Missing);
    }
}
