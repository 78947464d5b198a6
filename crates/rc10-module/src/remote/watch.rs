use rc10_time::Micros;

use super::{INTERRUPTED_AFTER, LOST_AFTER, Remote, RemoteLink};

/// Tells the state of the link to a remote: the failsafe, in two steps.
///
/// ```
/// use rc10_time::Micros;
/// use rc10_module::remote::{RemoteLink, Remote, Watch};
///
/// let mut watch = Watch::new();
/// watch.heard(&Remote::default(), Micros::from_millis(10));
/// assert_eq!(watch.link(Micros::from_millis(109)), RemoteLink::Online);
/// assert_eq!(watch.link(Micros::from_millis(110)), RemoteLink::Interrupted);
/// assert_eq!(watch.link(Micros::from_millis(1010)), RemoteLink::Lost);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watch {
    good: Option<Micros>,
    /// The newest frame says that the receiver hears no transmitter.
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

    /// The state of the link. A frame that came after `now` counts as new.
    #[must_use]
    pub fn link(&self, now: Micros) -> RemoteLink {
        let Some(good) = self.good else { return RemoteLink::Lost };
        let age = now.since(good);
        if age >= LOST_AFTER {
            RemoteLink::Lost
        } else if age >= INTERRUPTED_AFTER || self.failsafe {
            RemoteLink::Interrupted
        } else {
            RemoteLink::Online
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use RemoteLink::{Interrupted, Lost, Online};

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
        assert_eq!(Watch::new().link(Micros::ZERO), Lost);
        let mut watch = Watch::new();
        watch.heard(&FAILSAFE, after(0));
        assert_eq!(watch.link(after(0)), Lost);
        watch.heard(&GOOD, after(1));
        assert_eq!(watch.link(after(1)), Online);
    }

    #[test]
    fn silence_is_missing_then_lost_to_the_microsecond() {
        let mut watch = Watch::new();
        watch.heard(&GOOD, after(0));
        for (age, freshness) in [
            (0, Online),
            (99_999, Online),
            (100_000, Interrupted),
            (999_999, Interrupted),
            (1_000_000, Lost),
            (3_600_000_000, Lost),
        ] {
            assert_eq!(watch.link(after(age)), freshness, "{age}");
        }
        watch.heard(&GOOD, after(5_000_000));
        assert_eq!(watch.link(after(5_099_999)), Online);
        assert_eq!(watch.link(after(5_100_000)), Interrupted);
    }

    #[test]
    fn a_failsafe_is_missing_at_once_and_lost_since_the_last_good_frame() {
        let mut watch = Watch::new();
        watch.heard(&GOOD, after(0));
        for time in (10_000..=990_000).step_by(10_000) {
            watch.heard(&FAILSAFE, after(time));
            assert_eq!(watch.link(after(time)), Interrupted, "{time}");
        }
        assert_eq!(watch.link(after(999_999)), Interrupted);
        assert_eq!(watch.link(after(1_000_000)), Lost);
        watch.heard(&GOOD, after(1_500_000));
        assert_eq!(watch.link(after(1_500_000)), Online);
        watch.heard(&FAILSAFE, after(1_500_001));
        assert_eq!(watch.link(after(1_500_001)), Interrupted);
        watch.heard(&GOOD, after(1_500_002));
        assert_eq!(watch.link(after(1_600_001)), Online);
    }

    #[test]
    fn times_out_of_order_do_not_matter() {
        let mut watch = Watch::new();
        watch.heard(&GOOD, after(50));
        assert_eq!(watch.link(after(0)), Online);
        // An older frame that is told of later makes nothing older.
        watch.heard(&GOOD, after(20));
        assert_eq!(watch.link(after(100_049)), Online);
        assert_eq!(watch.link(after(100_050)), Interrupted);
    }
}
