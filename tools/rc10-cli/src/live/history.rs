//! The values of signals as far as memory reaches, and their reduction to points for a plot.

use std::collections::{BTreeSet, VecDeque};

use rc10_time::Micros;

/// Limit of values of all signals, of 8 bytes each: 240 MB.
pub const KEPT_IN_ALL: usize = 30_000_000;
/// The part of it that all signals have that are not chosen, whatever is.
const REST: usize = 5;
/// Values that are kept, and thinned, together.
const CHUNK: usize = 256;
/// Values of which [`POINTS`] stay when they are thinned.
const THINNED: usize = 4 * POINTS;

/// Most points of one column of pixels: first, lowest, highest and last value.
pub const POINTS: usize = 4;

/// A value with its time.
type Point = (Micros, f32);

/// Some values of a signal, and those that stand for them.
struct Chunk {
    from: Micros,
    to: Micros,
    /// Each with its time since `from`.
    values: Box<[(u32, f32)]>,
    points: Vec<Point>,
    /// How often it was thinned.
    level: u8,
}

impl Chunk {
    /// Chunks of these values, in order.
    fn of(values: &[Point], level: u8) -> impl Iterator<Item = Self> {
        let near = |some: &[Point]| {
            let from = some.first().map_or(Micros::ZERO, |it| it.0);
            some.partition_point(|it| it.0.since(from).get() <= u32::MAX.into())
        };
        let mut rest = values;
        std::iter::from_fn(move || {
            let count = near(rest).min(CHUNK);
            let (some, others) = rest.split_at(count);
            rest = others;
            let (from, to) = (some.first()?.0, some.last()?.0);
            let mut points = Vec::with_capacity(POINTS);
            stand_for(some, &mut points);
            let short =
                |it: &Point| (u32::try_from(it.0.since(from).get()).unwrap_or(u32::MAX), it.1);
            Some(Self { from, to, values: some.iter().map(short).collect(), points, level })
        })
    }

    fn at(&self, (since, value): (u32, f32)) -> Point {
        (self.from + Micros::new(since.into()), value)
    }

    fn iter(&self) -> impl Iterator<Item = Point> {
        self.values.iter().map(|it| self.at(*it))
    }
}

/// The values of a signal, oldest first.
#[derive(Default)]
struct Series {
    chunks: VecDeque<Chunk>,
    /// The newest.
    open: Vec<Point>,
    count: usize,
    is_chosen: bool,
}

impl Series {
    fn newest(&self) -> Option<Point> {
        let of_chunk = || self.chunks.back().and_then(|it| Some(it.at(*it.values.last()?)));
        self.open.last().copied().or_else(of_chunk)
    }

    fn begin(&self) -> Option<Micros> {
        self.chunks.front().map(|it| it.from).or_else(|| self.open.first().map(|it| it.0))
    }

    /// Thins the older half of the values that were thinned as often as most are: so that the older a time is, the
    /// fewer points it has, and none has no point.
    fn thin(&mut self) {
        let mut counts = [0_usize; 16];
        self.chunks.iter().for_each(|it| counts[usize::from(it.level).min(15)] += 1);
        let most = counts.iter().copied().max().unwrap_or_default();
        let level = counts.iter().position(|it| *it == most).unwrap_or_default() as u8;
        let first = self.chunks.iter().position(|it| it.level == level).unwrap_or_default();
        if most < 2 || level == 15 {
            self.count -= self.chunks.pop_front().map_or(0, |it| it.values.len());
            return;
        }
        let tail = self.chunks.split_off(first + most.div_ceil(2).max(2));
        let some = self.chunks.split_off(first);
        let values: Vec<Point> = some.iter().flat_map(Chunk::iter).collect();
        let mut points = Vec::new();
        values.chunks(THINNED).for_each(|some| stand_for(some, &mut points));
        self.count -= values.len() - points.len();
        self.chunks.extend(Chunk::of(&points, level + 1));
        self.chunks.extend(tail);
    }
}

/// The values of signals.
pub struct History {
    /// By index of the signal.
    series: Vec<Series>,
    chosen: BTreeSet<u16>,
    /// Number of values, and of those of chosen signals.
    count: [usize; 2],
    most: usize,
}

impl Default for History {
    fn default() -> Self {
        Self::with_room(KEPT_IN_ALL)
    }
}

impl History {
    /// One that keeps about this number of values.
    pub const fn with_room(most: usize) -> Self {
        Self { series: Vec::new(), chosen: BTreeSet::new(), count: [0; 2], most }
    }

    /// Number of values.
    pub const fn count(&self) -> usize {
        self.count[0]
    }

    /// Number of values of a signal.
    pub fn count_of(&self, signal: u16) -> usize {
        self.of(signal).map_or(0, |it| it.count)
    }

    fn of(&self, signal: u16) -> Option<&Series> {
        self.series.get(usize::from(signal))
    }

    /// Keeps these signals longest: all others share what they leave, and their old values are thinned.
    pub fn choose(&mut self, chosen: BTreeSet<u16>) {
        self.count[1] = 0;
        for (signal, series) in (0..).zip(&mut self.series) {
            series.is_chosen = chosen.contains(&signal);
            self.count[1] += if series.is_chosen { series.count } else { 0 };
        }
        self.chosen = chosen;
    }

    /// Adds a value, unless it is not newer than the newest.
    pub fn push(&mut self, signal: u16, at: Micros, value: f32) {
        let Self { series, chosen, count: [count, of_chosen], most } = self;
        while series.len() <= usize::from(signal) {
            let is_chosen = chosen.contains(&(series.len() as u16));
            series.push(Series { is_chosen, ..Series::default() });
        }
        let signals = series.len();
        let Some(series) = series.get_mut(usize::from(signal)) else { return };
        if series.newest().is_some_and(|(newest, _)| newest >= at) {
            return;
        }
        series.open.push((at, value));
        series.count += 1;
        *count += 1;
        *of_chosen += usize::from(series.is_chosen);
        if series.open.len() < CHUNK {
            return;
        }
        series.chunks.extend(Chunk::of(&series.open, 0));
        series.open.clear();
        let chosen = chosen.len();
        let limit = match series.is_chosen {
            true => (*most - *most / REST) / chosen.max(1),
            false => most.saturating_sub(*of_chosen) / signals.saturating_sub(chosen).max(1),
        };
        while series.count > limit.max(2 * CHUNK) && !series.chunks.is_empty() {
            let before = series.count;
            series.thin();
            *count -= before - series.count;
            *of_chosen -= if series.is_chosen { before - series.count } else { 0 };
        }
    }

    /// Removes all values: the robot was restarted, or is another one.
    pub fn clear(&mut self) {
        (self.series, self.count) = (Vec::new(), [0; 2]);
    }

    /// The newest value.
    pub fn newest(&self, signal: u16) -> Option<(Micros, f32)> {
        self.of(signal)?.newest()
    }

    /// The time of the oldest value, of a signal or of all.
    pub fn begin(&self, signal: Option<u16>) -> Option<Micros> {
        match signal {
            Some(signal) => self.of(signal)?.begin(),
            None => self.series.iter().filter_map(Series::begin).min(),
        }
    }

    /// The value at a time: the newest that is not newer.
    pub fn at(&self, signal: u16, at: Micros) -> Option<f32> {
        let series = self.of(signal)?;
        let open = series.open.partition_point(|it| it.0 <= at);
        if let Some(place) = open.checked_sub(1) {
            return series.open.get(place).map(|it| it.1);
        }
        let chunk =
            series.chunks.get(series.chunks.partition_point(|it| it.from <= at).checked_sub(1)?)?;
        let place = chunk.values.partition_point(|it| chunk.at(*it).0 <= at);
        chunk.values.get(place.checked_sub(1)?).map(|it| it.1)
    }

    /// Adds a signal's values in a span to `values`, and one on each side, so that lines reach the
    /// edges. Where a column of pixels has many, they are those that stand for them.
    pub fn copy(
        &self,
        signal: u16,
        [from, to]: [Micros; 2],
        columns: u32,
        values: &mut Vec<(Micros, f32)>,
    ) {
        let Some(series) = self.of(signal) else { return };
        let width = to.since(from).get() / u64::from(columns.max(1));
        let first = series.chunks.partition_point(|it| it.to < from).saturating_sub(1);
        for chunk in series.chunks.range(first..) {
            if chunk.from > to {
                // The one behind the span.
                values.extend(chunk.values.first().map(|it| chunk.at(*it)));
                break;
            }
            if chunk.from >= from && chunk.to <= to && chunk.to.since(chunk.from).get() < width {
                values.extend(&chunk.points);
            } else {
                let within = |it: &(u32, f32)| chunk.at(*it).0;
                let begin = chunk.values.partition_point(|it| within(it) < from).saturating_sub(1);
                let end = (chunk.values.partition_point(|it| within(it) <= to) + 1)
                    .min(chunk.values.len());
                values.extend(
                    chunk
                        .values
                        .get(begin..end.max(begin))
                        .unwrap_or_default()
                        .iter()
                        .map(|it| chunk.at(*it)),
                );
            }
        }
        let begin = series.open.partition_point(|it| it.0 < from).saturating_sub(1);
        let end = (series.open.partition_point(|it| it.0 <= to) + 1).min(series.open.len());
        values.extend_from_slice(series.open.get(begin..end.max(begin)).unwrap_or_default());
        // Of two neighbours at each edge one is enough.
        let outside = values.partition_point(|it| it.0 < from).saturating_sub(1);
        values.drain(..outside);
        let behind = values.partition_point(|it| it.0 <= to) + 1;
        values.truncate(behind);
    }
}

/// Reduces values in a span to at most [`POINTS`] in each column that look the same, in order. NaN
/// stays as a gap.
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
            history.copy(signal, span, 500, &mut values);
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
    fn what_is_known_is_not_taken_twice() {
        let mut history = History::default();
        for at in 0..1000 {
            history.push(1, Micros::new(at), 1.0);
            history.push(1, Micros::new(at), 2.0);
        }
        assert_eq!((history.newest(1), history.count()), (Some((Micros::new(999), 1.0)), 1000));
        assert_eq!(history.at(1, Micros::new(500)), Some(1.0));
        history.push(1, Micros::new(2000), 3.0);
        let at = |micros| history.at(1, Micros::new(micros));
        assert_eq!([at(1999), at(2000), at(9999)], [Some(1.0), Some(3.0), Some(3.0)]);
        history.push(2, Micros::new(7), 4.0);
        assert_eq!(history.at(2, Micros::new(6)), None);
        assert_eq!(
            (history.begin(None), history.begin(Some(2))),
            (Some(Micros::ZERO), Some(Micros::new(7)))
        );
    }

    /// Thirteen signals at 1 kHz, as a line of 921,600 baud carries them, and all other 269 of a robot.
    #[test]
    fn half_an_hour_of_what_is_chosen_is_whole_and_memory_is_bounded() {
        let mut history = History::default();
        history.choose((0..13).collect());
        let minutes = Micros::from_millis(30 * 60 * 1000);
        for milli in 0..minutes.get() / 1000 {
            let at = Micros::new(milli * 1000);
            (0..13).for_each(|signal| history.push(signal, at, milli as f32));
            if milli % 10 == 0 {
                (13..123).for_each(|signal| history.push(signal, at, (milli % 1000) as f32));
            }
            if milli % 100 == 0 {
                (123..282).for_each(|signal| history.push(signal, at, 1.0));
            }
        }
        for signal in 0..13 {
            assert_eq!(history.count_of(signal), 1_800_000);
        }
        let megabytes = history.count() * 8 / 1_000_000;
        println!("30 minutes: {} values, {megabytes} MB", history.count());
        assert!(history.count() <= KEPT_IN_ALL + 282 * CHUNK && megabytes <= 241);
        // Not one of them is missing, and of the others no minute is.
        let points = |signal, span, columns| {
            let mut values = Vec::new();
            history.copy(signal, span, columns, &mut values);
            values
        };
        let second = points(5, [Micros::from_millis(1000), Micros::from_millis(2000)], 10_000);
        assert!(
            second.len() == 1003
                && second.windows(2).all(|two| two[1].0.since(two[0].0).get() == 1000)
        );
        for minute in 0..30 {
            let span =
                [Micros::from_millis(minute * 60_000), Micros::from_millis((minute + 1) * 60_000)];
            let some = points(50, span, 1000);
            let highest = some.iter().map(|it| it.1).fold(f32::MIN, f32::max);
            assert!(
                some.len() > 100 && highest >= 990.0,
                "minute {minute}: {} points, {highest}",
                some.len()
            );
        }
        // The whole of it is looked at by those that stand for many: no seek touches every value.
        let whole = points(5, [Micros::ZERO, minutes], 1000);
        assert!(whole.len() <= 1_800_000 / CHUNK * POINTS + 2 * CHUNK, "{}", whole.len());
        assert!(whole.iter().any(|it| (it.1 - 1_799_999.0).abs() < 1.0));
    }

    #[test]
    fn more_than_there_is_room_for_is_thinned_and_keeps_its_peaks() {
        let mut history = History::with_room(20_000);
        for at in 0..1_000_000_u64 {
            let value = if at == 77_777 { 99.0 } else { (at % 7) as f32 };
            history.push(1, Micros::new(1000 * at), value);
        }
        assert!(history.count() <= 20_000 + CHUNK, "{}", history.count());
        let mut values = Vec::new();
        history.copy(1, [Micros::ZERO, Micros::from_millis(1_000_000)], 1_000_000, &mut values);
        assert_eq!(values.len(), history.count_of(1));
        assert!(
            values.iter().any(|it| it.1 > 98.0) && values.windows(2).all(|two| two[0].0 < two[1].0)
        );
        assert_eq!(history.begin(Some(1)), Some(Micros::ZERO));
    }
}
