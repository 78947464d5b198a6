//! Whether the effort of a motor's control loops oscillates or saturates.
//!
//! Only loops that run here are judged, not those in a device: every millisecond of a run, or as
//! often as a real robot tells it, in windows of [`WINDOW`] in which the motor is driven
//! throughout.

use crate::recording::load::WINDOW;
use rc10_motor::{Loops, TargetKind};
use rc10_time::Micros;

use crate::recording::load::{Carrying, LoadTrack, LoadWatch};
use crate::recording::margin::Margins;

/// Looks in a window that are needed to judge it.
pub const LEAST_LOOKS: usize = 10;
/// Share of its limit by which an effort must cross its mean both ways to change direction.
pub const SWING: f64 = 0.05;
/// Changes of direction in a window from which on an effort oscillates: 15 Hz.
pub const REVERSALS: u32 = 6;
/// The same where less than half of the milliseconds are looked at, so that fewer changes are seen.
pub const REVERSALS_SEEN: u32 = 4;
/// Share of its limit from which on an effort saturates.
pub const AT_LIMIT: f64 = 0.98;
/// Looks of a window at the limit, per thousand, from which on it saturates.
pub const SHARE_AT_LIMIT: u32 = 900;
/// Windows in a row that make a problem: fewer may be the answer to a step.
pub const IN_A_ROW: u32 = 3;

/// Summary of the effort of a motor's loops in a run.
#[derive(Clone, Debug, PartialEq)]
pub struct EffortTrack {
    /// The loops.
    pub loops: Loops,
    /// Gain margins of the loops; `None` if the load that they move is not described.
    pub margins: Option<Margins>,
    /// Windows that were judged.
    pub windows: u32,
    /// Changes of direction per window.
    pub reversals: Worst,
    /// Changes of direction of a window from which on it oscillates.
    pub least_reversals: u32,
    /// Looks at the limit per window, per thousand.
    pub at_limit: Worst,
    /// The load in excess of the feed-forward.
    pub load: LoadTrack,
}

/// The worst windows in a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Worst {
    /// The largest count that [`IN_A_ROW`] windows in a row have all reached.
    pub count: u32,
    /// Begin of the first of them.
    pub at: Micros,
    /// Windows that reached the threshold.
    pub windows: u32,
    /// The counts of the last windows, the newest last.
    last: [u32; IN_A_ROW as usize],
}

impl Worst {
    fn add(&mut self, count: u32, threshold: u32, end: Micros) {
        self.last.rotate_left(1);
        self.last[self.last.len() - 1] = count;
        self.windows += u32::from(count >= threshold);
        let all = self.last.iter().copied().min().unwrap_or(0);
        if all > self.count {
            let length = Micros::new(u64::from(IN_A_ROW) * WINDOW.get());
            (self.count, self.at) = (all, end.since(length));
        }
    }

    const fn interrupt(&mut self) {
        self.last = [0; IN_A_ROW as usize];
    }
}

impl EffortTrack {
    /// Whether the effort oscillated.
    pub const fn oscillates(&self) -> bool {
        self.reversals.count >= self.least_reversals
    }

    /// Whether the effort saturated.
    pub const fn saturates(&self) -> bool {
        self.at_limit.count >= SHARE_AT_LIMIT
    }

    /// Unit of the effort.
    pub const fn unit(&self) -> &'static str {
        match self.loops.effort {
            TargetKind::Current => "A",
            TargetKind::Torque => "N m",
            _ => "of the full voltage",
        }
    }
}

/// Watches the effort of one motor.
#[derive(Clone)]
pub struct EffortWatch {
    track: EffortTrack,
    load: LoadWatch,
    window: Vec<f64>,
    /// Begin of the window, and time of the newest look.
    begun: Micros,
    last: Option<Micros>,
}

impl EffortWatch {
    /// Creates a watch before the start.
    pub fn new(loops: Loops, margins: Option<Margins>) -> Self {
        let track = EffortTrack {
            loops,
            margins,
            windows: 0,
            reversals: Worst::default(),
            least_reversals: REVERSALS,
            at_limit: Worst::default(),
            load: LoadTrack::default(),
        };
        let load = LoadWatch::default();
        Self { track, load, window: Vec::new(), begun: Micros::ZERO, last: None }
    }

    /// Unit and limit of the effort.
    pub const fn loops(&self) -> Loops {
        self.track.loops
    }

    /// Gain margins of the loops.
    pub const fn margins(&self) -> Option<Margins> {
        self.track.margins
    }

    /// Takes the effort, if the time is new; `None` while the loops do not drive.
    pub fn look(&mut self, now: Micros, effort: Option<f64>) {
        if self.last.is_some_and(|last| now <= last) {
            return;
        }
        let apart = now.since(self.last.replace(now).unwrap_or(now));
        let is_gap = apart >= WINDOW;
        if is_gap || effort.is_none() {
            self.interrupt();
        }
        let Some(effort) = effort else { return };
        if self.window.is_empty() {
            self.begun = now;
        }
        self.window.push(effort);
        // A look stands for the time up to the next one.
        if !is_gap && now.since(self.begun) + apart >= WINDOW {
            self.judge(now);
        }
    }

    fn judge(&mut self, now: Micros) {
        let count = self.window.len();
        if count < LEAST_LOOKS {
            return self.interrupt();
        }
        let limit = f64::from(self.track.loops.cascade.speed.output_limit);
        let at_limit = self.window.iter().filter(|effort| effort.abs() >= AT_LIMIT * limit);
        let share = u32::try_from(1000 * at_limit.count() / count).unwrap_or(u32::MAX);
        let is_seldom = 2000 * count as u64 <= WINDOW.get();
        let least = if is_seldom { REVERSALS_SEEN } else { REVERSALS };
        self.track.windows += 1;
        self.track.least_reversals = least;
        self.track.reversals.add(reversals(&self.window, SWING * limit), least, now);
        self.track.at_limit.add(share, SHARE_AT_LIMIT, now);
        self.window.clear();
    }

    fn interrupt(&mut self) {
        self.window.clear();
        self.track.reversals.interrupt();
        self.track.at_limit.interrupt();
    }

    /// Takes a look at the load of the motor.
    pub fn look_at_load(&mut self, now: Micros, seen: &Carrying<'_>) {
        self.load.look(now, seen, &self.track.loops.cascade.feed_forward);
    }

    /// The summary of all windows.
    pub fn finish(self) -> EffortTrack {
        EffortTrack { load: self.load.track, ..self.track }
    }
}

/// Number of times that values go from `swing` above their mean to `swing` below it, or back.
fn reversals(values: &[f64], swing: f64) -> u32 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let (mut count, mut side) = (0, 0.0);
    for value in values.iter().map(|value| value - mean).filter(|value| value.abs() > swing) {
        count += u32::from(value * side < 0.0);
        side = value;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_motor::dji;

    fn track(effort: impl Fn(u32) -> Option<f64>) -> EffortTrack {
        let mut cascade = dji::M3508.cascade;
        cascade.speed.output_limit = 7.0;
        let loops = Loops { effort: TargetKind::Torque, cascade };
        let mut watch = EffortWatch::new(loops, None);
        for millis in 1..=2000 {
            watch.look(Micros::from_millis(millis.into()), effort(millis));
        }
        watch.finish()
    }

    #[test]
    fn an_effort_that_bangs_shakes_and_one_that_is_pushed_stands_at_its_limit() {
        let bang = |millis: u32| if (millis / 3).is_multiple_of(2) { 7.0 } else { -7.0 };
        let banging = track(|millis| Some(bang(millis)));
        assert!(banging.oscillates() && banging.saturates(), "{banging:?}");
        let pushing = track(|_| Some(6.9));
        assert!(!pushing.oscillates() && pushing.saturates(), "{pushing:?}");
        assert_eq!((pushing.windows, pushing.at_limit.windows), (10, 10));
        assert_eq!(pushing.at_limit.at, Micros::ZERO);
        let carrying = track(|_| Some(6.8));
        assert!(!carrying.saturates(), "{carrying:?}");
        // Around a load, from a second on.
        let late = track(|millis| Some(3.0 + if millis > 1000 { 0.2 * bang(millis) } else { 0.0 }));
        assert!(late.oscillates() && !late.saturates(), "{late:?}");
        assert_eq!(late.reversals.at, Micros::from_millis(1000));
    }

    #[test]
    fn an_answer_to_a_step_and_a_pause_are_no_shaking() {
        // Half a second of it.
        let step = track(|millis| {
            Some(if (700..900).contains(&millis) { f64::from(millis % 10) } else { 0.0 })
        });
        assert!(!step.oscillates(), "{step:?}");
        let paused =
            track(|millis| (millis % 390 > 10).then(|| 7.0 * f64::from(millis % 4) - 10.5));
        assert!(!paused.oscillates() && paused.windows > 0, "{paused:?}");
    }

    #[test]
    fn rare_samples_are_judged_by_time() {
        let told = |period: u64, effort: &dyn Fn(u64) -> f64| {
            let loops = Loops { effort: TargetKind::Current, cascade: dji::M3508.cascade };
            let limit = f64::from(loops.cascade.speed.output_limit);
            let mut watch = EffortWatch::new(loops, None);
            for at in (5..3000).step_by(usize::try_from(period).unwrap()) {
                watch.look(Micros::from_millis(at), Some(limit * effort(at)));
                // Told again with something else that is told: nothing new.
                watch.look(Micros::from_millis(at - 2), Some(0.0));
            }
            watch.finish()
        };
        // Each 27 ms up and down.
        let bang = |at: u64| if (at / 27).is_multiple_of(2) { 1.0 } else { -1.0 };
        for period in [1, 5, 10, 20] {
            let banging = told(period, &bang);
            assert!(banging.oscillates() && banging.saturates(), "{period} ms: {banging:?}");
            assert!((13..=15).contains(&banging.windows), "{period} ms: {banging:?}");
            let leaning = told(period, &|_| 0.99);
            assert!(!leaning.oscillates() && leaning.saturates(), "{period} ms: {leaning:?}");
        }
        for period in [25, 250] {
            assert_eq!(told(period, &bang).windows, 0, "{period} ms");
        }
    }

    #[test]
    fn small_noise_is_no_shaking() {
        let noise = track(|millis| Some(if millis.is_multiple_of(2) { 0.34 } else { -0.34 }));
        assert_eq!(noise.reversals.count, 0);
    }
}
