//! Events of a run, and the script of a robot.

use rc10_time::Micros;

/// An event of a run, such as a step of a script.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// Time of the event.
    pub at: Micros,
    /// Name of the event, for reports.
    pub label: &'static str,
}

/// The script of a robot: its events at known times.
#[derive(Clone, Debug, Default)]
pub struct Script {
    /// Events, in order of time.
    pub events: Vec<Event>,
    /// Period after which the events repeat, if they do.
    pub repeats_after: Option<Micros>,
}

impl Script {
    /// All events before `end`.
    pub fn until(&self, end: Micros) -> Vec<Event> {
        let period = self.repeats_after.map_or(0, Micros::get);
        let repeats = end.get().checked_div(period).unwrap_or(0);
        let later = |round: u64| {
            let delay = Micros::new(round * period);
            self.events.iter().map(move |event| Event { at: event.at + delay, ..*event })
        };
        (0..=repeats).flat_map(later).filter(|event| event.at < end).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(millis: u64, label: &'static str) -> Event {
        Event { at: Micros::from_millis(millis), label }
    }

    fn times(script: &Script, end: u64) -> Vec<u64> {
        let events = script.until(Micros::from_millis(end));
        events.iter().map(|event| event.at.get() / 1000).collect()
    }

    #[test]
    fn a_script_may_repeat_and_ends_before_the_end() {
        let mut script =
            Script { events: vec![event(100, "a"), event(300, "b")], ..<_>::default() };
        assert_eq!(times(&script, 5000), [100, 300]);
        assert_eq!(times(&script, 300), [100]);
        script.repeats_after = Some(Micros::from_millis(1000));
        assert_eq!(times(&script, 2300), [100, 300, 1100, 1300, 2100]);
        script.repeats_after = Some(Micros::ZERO);
        assert_eq!(times(&script, 5000), [100, 300]);
        let nothing = Script { events: Vec::new(), ..script };
        assert!(nothing.until(Micros::from_millis(5000)).is_empty());
    }
}
