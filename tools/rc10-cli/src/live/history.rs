//! The values of signals over the last minutes, and their reduction to points for a plot.

use std::collections::{BTreeMap, VecDeque};

use rc10_time::Micros;

/// Limit of values of one signal.
const KEPT: usize = 200_000;
/// Limit of values of all signals: 320 MB, and up to twice that while buffers grow.
const KEPT_IN_ALL: usize = 20_000_000;

/// The values of signals, newest last.
#[derive(Default)]
pub struct History {
    series: BTreeMap<u16, VecDeque<(Micros, f32)>>,
    count: usize,
}

/// Most points of one column of pixels: first, lowest, highest and last value.
pub const POINTS: usize = 4;

impl History {
    /// Adds a value, unless it is not newer than the newest.
    pub fn push(&mut self, signal: u16, at: Micros, value: f32) {
        let series = self.series.entry(signal).or_default();
        if series.back().is_some_and(|(newest, _)| *newest >= at) {
            return;
        }
        series.push_back((at, value));
        self.count += 1;
        let limit = KEPT.min(KEPT_IN_ALL / self.series.len().max(1));
        let series = self.series.entry(signal).or_default();
        while series.len() > limit {
            series.pop_front();
            self.count -= 1;
        }
    }

    /// Removes all values: the robot was restarted, or is another one.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// The newest value.
    #[must_use]
    pub fn newest(&self, signal: u16) -> Option<(Micros, f32)> {
        self.series.get(&signal)?.back().copied()
    }

    /// Adds a signal's values in a span to `values`, and one on each side, so that lines reach the
    /// edges.
    pub fn copy(&self, signal: u16, [from, to]: [Micros; 2], values: &mut Vec<(Micros, f32)>) {
        let Some(series) = self.series.get(&signal) else { return };
        let first = series.partition_point(|(at, _)| *at < from).saturating_sub(1);
        let last = (series.partition_point(|(at, _)| *at <= to) + 1).min(series.len());
        values.extend(series.range(first.min(last)..last));
    }
}

/// Reduces values in a span to at most [`POINTS`] in each column that look the same, in order. NaN
/// stays as a gap.
#[must_use]
pub fn thin(values: &[(Micros, f32)], [from, to]: [Micros; 2], columns: u32) -> Vec<(Micros, f32)> {
    let width = to.since(from).get().div_ceil(columns.max(1).into()).max(1);
    let column = |at: Micros| at.get() / width;
    let mut points = Vec::new();
    for some in values.chunk_by(|a, b| column(a.0) == column(b.0)) {
        stand_for(some, &mut points);
    }
    points
}

/// Adds the points of one column.
fn stand_for(some: &[(Micros, f32)], points: &mut Vec<(Micros, f32)>) {
    if some.len() <= POINTS {
        points.extend(some);
        return;
    }
    let known = || some.iter().enumerate().filter(|(_, value)| !value.1.is_nan());
    let lowest = known().min_by(|a, b| a.1.1.total_cmp(&b.1.1)).map(|(at, _)| at);
    let highest = known().max_by(|a, b| a.1.1.total_cmp(&b.1.1)).map(|(at, _)| at);
    let mut kept: Vec<_> =
        [Some(0), lowest, highest, Some(some.len() - 1)].into_iter().flatten().collect();
    kept.sort_unstable();
    kept.dedup();
    points.extend(kept.into_iter().map(|at| some[at]));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_points_keep_every_peak() {
        let mut history = History::default();
        for at in 0..100_000 {
            let value = if at == 54_321 { 99.0 } else { (at % 7) as f32 };
            history.push(3, Micros::new(1000 * at), value);
        }
        let points = |signal, span| {
            let mut values = Vec::new();
            history.copy(signal, span, &mut values);
            thin(&values, span, 500)
        };
        let span = [Micros::ZERO, Micros::from_millis(100_000)];
        let all = points(3, span);
        assert!(all.len() <= POINTS * 501, "{}", all.len());
        let peak = all.iter().map(|point| point.1).fold(f32::MIN, f32::max);
        assert!((peak - 99.0).abs() < 1e-6, "{peak}");
        assert!(all.windows(2).all(|two| two[0].0 < two[1].0));
        // A column that is narrower than the values loses none.
        let span = [Micros::from_millis(10), Micros::from_millis(20)];
        assert_eq!(points(3, span).len(), 13);
        assert!(points(4, span).is_empty());
        assert!(points(3, [span[1], span[0]]).len() < 2, "backwards");
    }

    #[test]
    fn what_is_known_is_not_taken_twice_and_not_kept_for_ever() {
        let mut history = History::default();
        for at in 0..KEPT as u64 + 10 {
            history.push(1, Micros::new(at), 1.0);
            history.push(1, Micros::new(at), 2.0);
        }
        assert_eq!(history.newest(1), Some((Micros::new(KEPT as u64 + 9), 1.0)));
        assert_eq!(history.count, KEPT);
    }
}
