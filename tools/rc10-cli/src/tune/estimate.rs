//! Estimates what a motor moves, from samples of its effort and its angle: inertia, friction, weight, delay; each
//! with its 95 % interval.
//!
//! The equation of motion is weighted with a smooth bump of some tens of milliseconds, and integrated by parts: the
//! measured angle is never differentiated, so counts of an encoder and whole rpm do little harm. A window counts in which
//! the shaft turns one way throughout: what friction does about standstill is nobody's model. Least squares over the
//! windows; the delay by Gauss-Newton. The intervals are those of a jackknife over stretches of time, as what
//! is left (teeth, cogging, noise) is not independent from one window to the next.

use std::fmt;

/// One sample of a motor.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Time, s.
    pub at: f64,
    /// Effort of its loops, in their unit; NaN while they do not drive.
    pub effort: f64,
    /// Angle of the output shaft by its feedback, degrees.
    pub angle: f64,
    /// Speed of the output shaft as its loops measure it, rpm.
    pub speed: f64,
    /// Angle that its target asks for, or the integral of its target speed, degrees; NaN if that is not known.
    pub reference: f64,
}

impl Sample {
    /// The speed that was asked for since the sample before, rpm.
    pub fn asked_since(&self, before: &Self) -> f64 {
        (self.reference - before.reference) / (self.at - before.at) / 6.0
    }
}

/// A number with its 95 % interval: `value` ± `half`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// The estimate.
    pub value: f64,
    /// Half the width of its interval.
    pub half: f64,
}

/// Why something cannot be told from the samples, and what would tell it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// Too little of it turned one way for a while.
    TooShort,
    /// Its samples are too far apart.
    TooSeldom,
    /// It did not move though it was driven.
    Blocked,
    /// It moves against its effort.
    WrongWay,
    /// Its effort is too small to be told from what disturbs it.
    TooFree,
    /// It turned one way only: friction and weight are one number then.
    OneWay,
    /// Its speed was always the same.
    OneSpeed,
    /// It moves before its effort: what it turns is not one stiff body.
    NotOneBody,
    /// Its interval is wider than half of it.
    TooVague,
}

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooShort => {
                "cannot be told from this: it turned for too short a time. Let it turn for ten seconds, to and fro"
            }
            Self::TooSeldom => {
                "cannot be told from this: the samples are too far apart. Record one every millisecond or two: rc10 record --period 2"
            }
            Self::Blocked => {
                "cannot be told from this: it was driven and did not move. Free it, or allow more effort"
            }
            Self::WrongWay => {
                "cannot be told from this: it moves against its effort. Look at the direction of the motor, and at \
                 the sign of its effort"
            }
            Self::TooFree => {
                "cannot be told from this: its effort is too small beside what disturbs it. Accelerate it harder, \
                 or put its load on"
            }
            Self::OneWay => {
                "cannot be told from this: it turned one way only, so friction and weight are one number. Let it \
                 turn both ways"
            }
            Self::OneSpeed => {
                "cannot be told from this: its speed was always the same. Let it turn slowly and fast"
            }
            Self::NotOneBody => {
                "cannot be told from this: it seems to move before its effort, so what it turns is not one stiff body. \
                 Lift its wheel off the floor, and tighten what is loose"
            }
            Self::TooVague => {
                "cannot be told from this: the interval is wider than half of it. Let it turn longer, at several \
                 speeds, with hard starts"
            }
        })
    }
}

/// A number, or why it cannot be told.
pub type Told = Result<Figure, Unknown>;

/// What a motor moves, by the unit of its effort.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Effort per rpm/s.
    pub inertia: Told,
    /// Effort against dry friction.
    pub friction: Told,
    /// Effort per rpm.
    pub viscous: Told,
    /// Effort that holds the weight in the middle of the travel.
    pub weight: Told,
    /// Of an arm: effort where it is level, and the angle there, degrees. `None` where the travel does not tell.
    pub arm: Option<[Figure; 2]>,
    /// From an effort's tick to its motion in the samples, s.
    pub delay: Told,
    /// Play of the gear, degrees of the shaft, if all inertia is behind it, and more if not; `None` where there is no sign of it.
    pub play: Option<Figure>,
    /// Seconds of the samples that were of use.
    pub seconds: f64,
    /// What is left of the effort by this model, root mean square.
    pub left: f64,
    /// The lowest and the highest speed of use, rpm.
    pub speeds: [f64; 2],
}

/// Half the length of a window, s.
const HALF: f64 = 0.035;
/// The longest time between samples, s.
const SELDOM: f64 = 0.006;
/// From one window to the next, s.
const STEP: f64 = 0.01;
/// Share of the fastest below which a speed is of no use: what friction does about standstill is in no model.
const SLOW: f64 = 0.2;
/// Stretches of time of the jackknife: at most, at least, and the shortest, s.
const STRETCHES: [usize; 2] = [30, 10];
const STRETCH: f64 = 0.2;
/// The longest delay that is looked for, s.
const LONGEST: f64 = 0.02;
/// Time constant of a current loop, s; what it is more or less is estimated.
const LAG_TIME: f64 = 1e-3;
/// Time about a sample in which its speed is measured, s.
const ABOUT: f64 = 0.01;
/// How far a motor may be behind what is asked for, s: at most, and from one try to the next.
const BEHIND: [f64; 2] = [0.04, 0.01];
/// Factor on intervals: neighbouring stretches are not quite independent. By the thousand plants of the tests.
const WIDER: f64 = 1.1;
/// Travel from which on an arm's weight is told from a constant one, degrees.
const ARM: f64 = 120.0;
/// Play that is tried, degrees.
const PLAYS: [f64; 5] = [0.03, 0.06, 0.12, 0.24, 0.5];
/// Share of what is left that play has to explain.
const EXPLAINS: f64 = 0.01;
/// Shares of the inertia and of the friction that may be behind the play, at least and at most.
const BEHIND_PLAY: [[f64; 2]; 2] = [[0.15, 0.7], [0.25, 0.75]];
/// Error of every delay, s: an elastic gear is in no model.
const ELASTIC: f64 = 25e-6;

/// Columns of the regression.
const INERTIA: usize = 0;
const FRICTION: usize = 1;
const VISCOUS: usize = 2;
const WEIGHT: usize = 3;
const SINE: usize = 4;
const COSINE: usize = 5;
const DELAY: usize = 6;
/// The spread of the delay, as a lag has it, in 1e-6 s²; play, and play that comes later.
const LAG: usize = 7;
const PLAY: usize = 8;
const LATE: usize = 9;
const COLUMNS: usize = 10;
/// Unit of the column of late play, s.
const LATER: f64 = 0.01;

/// A row of the regression, or its answer.
type Row = [f64; COLUMNS];

fn product(row: &Row, answer: &Row) -> f64 {
    row.iter().zip(answer).map(|(a, b)| a * b).sum()
}

/// The bump (1 - x²)⁴ and its first four derivatives by the time.
fn bump(x: f64) -> [f64; 5] {
    let rest = (1.0 - x * x).max(0.0);
    let (x2, second, third) = (x * x, rest * rest, rest * rest * rest);
    [
        second * second,
        -8.0 * x * third / HALF,
        (48.0 * x2 * second - 8.0 * third) / HALF.powi(2),
        (144.0 * second - 192.0 * x2 * rest) * x / HALF.powi(3),
        (144.0 * second - 1152.0 * x2 * rest + 384.0 * x2 * x2) / HALF.powi(4),
    ]
}

/// Sums of products of a regression: of the instruments with the columns, and with the effort.
#[derive(Clone, Copy)]
struct Sums {
    products: [Row; COLUMNS],
    efforts: Row,
}

impl Sums {
    const ZERO: Self = Self { products: [[0.0; COLUMNS]; COLUMNS], efforts: [0.0; COLUMNS] };

    fn plus(mut self, by: f64, other: &Self) -> Self {
        for at in 0..COLUMNS {
            self.efforts[at] += by * other.efforts[at];
            for with in 0..COLUMNS {
                self.products[at][with] += by * other.products[at][with];
            }
        }
        self
    }

    fn take(&mut self, row: &Row, instruments: &Row, effort: f64) {
        let sums = self.products.iter_mut().zip(&mut self.efforts);
        for (by, (products, sum)) in instruments.iter().zip(sums) {
            *sum += by * effort;
            products.iter_mut().zip(row).for_each(|(it, value)| *it += by * value);
        }
    }

    /// The answer, by elimination; columns that say nothing new are zero.
    fn solve(&self) -> Row {
        let scale: Row =
            std::array::from_fn(|at| self.products[at][at].abs().sqrt().max(f64::MIN_POSITIVE));
        let mut rows: [[f64; COLUMNS + 1]; COLUMNS] = std::array::from_fn(|at| {
            std::array::from_fn(|with| match with {
                COLUMNS => self.efforts[at] / scale[at],
                _ => self.products[at][with] / scale[at] / scale[with],
            })
        });
        for pivot in 0..COLUMNS {
            let own = rows[pivot];
            let by = if own[pivot].abs() > 1e-9 { 1.0 / own[pivot] } else { 0.0 };
            for (at, row) in rows.iter_mut().enumerate() {
                let share = row[pivot] * by;
                let pairs = row.iter_mut().zip(own);
                pairs.for_each(|(it, own)| {
                    *it = if at == pivot { own * by } else { *it - share * own }
                });
            }
        }
        std::array::from_fn(|at| rows[at][COLUMNS] / scale[at])
    }
}

/// A window: the place of its middle among the samples, its columns but for those of the delay, and the instruments.
struct Window {
    middle: usize,
    row: Row,
    instruments: Row,
}

/// The samples, and what is the same in all fits of them.
struct Samples<'s> {
    all: &'s [Sample],
    period: f64,
    /// Speed at each sample, rpm; NaN at the ends and at gaps.
    speeds: Vec<f64>,
    /// The mean effort in each tick, as it comes through a current loop.
    given: Vec<f64>,
    slowest: f64,
    /// The lowest and the highest angle, degrees.
    travel: [f64; 2],
}

fn speeds(samples: &[Sample], period: f64) -> Vec<f64> {
    let reach = ((ABOUT / period) as usize).max(1);
    let speed = |at: usize| {
        let (from, to) = (samples.get(at.checked_sub(reach)?)?, samples.get(at + reach)?);
        let time = to.at - from.at;
        let is_whole = time < 1.5 * period * (2 * reach) as f64;
        is_whole.then(|| (to.angle - from.angle) / time / 6.0)
    };
    (0..samples.len()).map(|at| speed(at).unwrap_or(f64::NAN)).collect()
}

fn given(samples: &[Sample]) -> Vec<f64> {
    let mut before = 0.0_f64;
    let mean = |pair: &[Sample]| {
        let length = (pair[1].at - pair[0].at) / LAG_TIME;
        let (effort, gap) = (pair[0].effort, before - pair[0].effort);
        let after = effort + gap * (-length).exp();
        before = if after.is_finite() { after } else { 0.0 };
        effort - gap * (-length).exp_m1() / length
    };
    samples.windows(2).map(mean).collect()
}

impl<'s> Samples<'s> {
    fn new(all: &'s [Sample]) -> Result<Self, Unknown> {
        let mut steps: Vec<f64> = all.windows(2).map(|pair| pair[1].at - pair[0].at).collect();
        steps.sort_by(f64::total_cmp);
        let period = steps.get(steps.len() / 2).copied();
        let period = period.filter(|it| *it > 0.0).ok_or(Unknown::TooShort)?;
        if period > SELDOM {
            return Err(Unknown::TooSeldom);
        }
        let speeds = speeds(all, period);
        let driven = || all.iter().zip(&speeds).filter(|(it, _)| it.effort.is_finite());
        let sizes = driven().map(|(_, speed)| speed.abs()).filter(|it| !it.is_nan());
        let mut sizes: Vec<f64> = sizes.collect();
        sizes.sort_by(f64::total_cmp);
        let fastest = sizes.get(sizes.len() * 19 / 20).copied().ok_or(Unknown::TooShort)?;
        let angles = || driven().map(|(it, _)| it.angle);
        let low = angles().fold(f64::INFINITY, f64::min);
        let high = angles().fold(f64::NEG_INFINITY, f64::max);
        // A count or two of an encoder without a gearbox are no motion.
        if fastest < 0.5 || high - low < 1.0 {
            let is_pushed = driven().any(|(it, _)| it.effort != 0.0);
            return Err(if is_pushed { Unknown::Blocked } else { Unknown::TooShort });
        }
        let slowest = SLOW * fastest;
        Ok(Self { all, period, speeds, given: given(all), slowest, travel: [low, high] })
    }

    fn middle(&self) -> f64 {
        f64::midpoint(self.travel[0], self.travel[1])
    }

    fn may_be_arm(&self) -> bool {
        self.travel[1] - self.travel[0] > ARM
    }

    /// The weight at an angle, by an answer.
    fn weight(&self, angle: f64, best: &Row) -> f64 {
        self.weights(angle).iter().zip(&best[WEIGHT..]).map(|(a, b)| a * b).sum()
    }

    /// What the weight is at an angle, for the columns of it.
    fn weights(&self, angle: f64) -> [f64; 3] {
        let (sin, cos) = (angle - self.middle()).to_radians().sin_cos();
        [1.0, sin, if self.may_be_arm() { cos - 1.0 } else { 0.0 }]
    }

    /// The windows of use, in order of time. The motor is `behind` so many samples, and its load at these `sides` of the play.
    fn windows(&self, behind: usize, sides: Option<&[f64]>) -> Vec<Window> {
        let Self { all, period, speeds, slowest, .. } = self;
        let reach = (HALF / period).ceil() as usize;
        let before = ((HALF + BEHIND[0]) / period).ceil() as usize + 1;
        let step = ((STEP / period).round() as usize).max(1);
        let mut found = Vec::new();
        for centre in (before..all.len().saturating_sub(reach + 1)).step_by(step) {
            let near = &all[centre - before..=centre + reach];
            let turning = &speeds[centre - reach..=centre + reach];
            let sign = speeds[centre].signum();
            let span = near[near.len() - 1].at - near[0].at;
            let is_whole = span < 1.2 * period * near.len() as f64;
            let is_driven = near.iter().all(|it| it.effort.is_finite());
            // NaN is no speed.
            if !is_whole || !is_driven || !turning.iter().all(|it| it * sign > *slowest) {
                continue;
            }
            let Sample { at, angle, .. } = all[centre];
            let slope = speeds[centre] * 6.0;
            let start = all[centre - behind].reference;
            let (mut row, mut asked) = ([0.0; COLUMNS], [0.0; 5]);
            for place in centre - reach..=centre + reach {
                let now = all[place];
                let x = (now.at - at) / HALF;
                if x.abs() >= 1.0 {
                    continue;
                }
                let length = 0.5 * (all[place + 1].at - all[place - 1].at);
                let bumps = bump(x).map(|it| it * length);
                let [bump, first, second, third, _] = bumps;
                // What turns evenly does not accelerate, at whichever times it is sampled.
                let (gone, evenly) = (now.angle - angle, slope * (now.at - at));
                let ask = all[place - behind].reference - start - evenly;
                asked.iter_mut().zip(bumps).for_each(|(sum, it)| *sum += it * ask / 6.0);
                row[INERTIA] += second * (gone - evenly) / 6.0;
                row[FRICTION] += bump * sign;
                row[VISCOUS] -= first * gone / 6.0;
                for (at, weight) in self.weights(now.angle).into_iter().enumerate() {
                    row[WEIGHT + at] += bump * weight;
                }
                let side = sides.map_or(0.0, |sides| sides[place]) / 6.0;
                row[PLAY] -= second * side;
                row[LATE] -= LATER * third * side;
            }
            let mut instruments = row;
            if asked[0].is_finite() {
                instruments[INERTIA] = asked[2];
                instruments[DELAY] = -asked[3];
                instruments[LAG] = -0.5e-6 * asked[4];
            }
            found.push(Window { middle: centre, row, instruments });
        }
        found
    }

    /// Weighted effort of a window, of an effort that comes this much later; and how it changes with the delay.
    fn effort(&self, window: &Window, delay: f64) -> [f64; 3] {
        let centre = self.all[window.middle].at - delay + LAG_TIME;
        let mut sums = [0.0; 3];
        let first = self.all[..window.middle].partition_point(|it| it.at < centre - HALF);
        for place in first.saturating_sub(1)..self.given.len() {
            let (now, next) = (self.all[place].at, self.all[place + 1].at);
            let x = (f64::midpoint(now, next) - centre) / HALF;
            if x > 1.0 {
                break;
            }
            let given = self.given[place] * (next - now);
            sums.iter_mut().zip(bump(x.max(-1.0))).for_each(|(sum, bump)| *sum += bump * given);
        }
        sums
    }

    /// On which side of a play the motor is, -1 to 1: the load goes on by itself, until it is carried along.
    fn sides(&self, play: f64, best: &Row) -> Vec<f64> {
        let half = 0.5 * play;
        let (mut angle, mut speed, mut before) = (f64::NAN, f64::NAN, f64::NAN);
        let side = |(sample, own): (&Sample, &f64)| {
            let time = sample.at - std::mem::replace(&mut before, sample.at);
            let weight = self.weight(sample.angle, best);
            let drag = best[FRICTION] * speed.signum() + best[VISCOUS] * speed + weight;
            let change = -drag / best[INERTIA] * time;
            angle += 6.0 * (speed + 0.5 * change) * time;
            speed += change;
            let ahead = sample.angle - angle;
            // NaN at the begin and after a gap.
            if !(ahead.abs() < half && speed.is_finite()) {
                let side = if ahead < 0.0 { -half } else { half };
                (angle, speed) = (sample.angle - side, *own);
            }
            ((sample.angle - angle) / half).clamp(-1.0, 1.0)
        };
        self.all.iter().zip(&self.speeds).map(side).collect()
    }

    /// Whether the teeth press on one and the same side throughout a window and as long before it, whichever shares of
    /// inertia and friction are behind the play.
    fn is_pressed(&self, window: &Window, best: &Row) -> bool {
        let sign = window.row[FRICTION].signum();
        let [inertia, friction] = BEHIND_PLAY;
        let side = |at: usize| {
            let drag = best[FRICTION] + best[VISCOUS] * self.speeds[at].abs();
            let weight = self.weight(self.all[at].angle, best) * sign;
            let accelerates = self.given[at] * sign - drag - weight;
            let torques = inertia.map(|it| it * accelerates);
            let least = torques[0].min(torques[1]) + friction[0] * drag + weight;
            let most = torques[0].max(torques[1]) + friction[1] * drag + weight;
            i8::from(least > 0.0) - i8::from(most < 0.0)
        };
        let (reach, own) = ((HALF / self.period) as usize, side(window.middle));
        let all = window.middle.saturating_sub(2 * reach)..window.middle + reach;
        own != 0 && all.into_iter().all(|at| side(at) == own)
    }

    /// The fit of windows, at the delay that is the best.
    fn fit(&self, windows: &[Window], from: f64) -> Fit {
        let mut fit = self.fit_at(windows, from);
        for _ in 0..8 {
            let step = fit.whole.solve()[DELAY];
            fit = self.fit_at(windows, (fit.delay + step).clamp(-LONGEST, LONGEST));
            if step.abs() < 1e-6 {
                break;
            }
        }
        fit
    }

    fn fit_at(&self, windows: &[Window], delay: f64) -> Fit {
        let stretches = (windows.len() as f64 * STEP / STRETCH) as usize;
        let stretches = stretches.clamp(1, STRETCHES[0]);
        let (mut sums, mut rows) = (vec![Sums::ZERO; stretches], Vec::new());
        for (at, window) in windows.iter().enumerate() {
            let [effort, change, curve] = self.effort(window, delay);
            let Window { mut row, mut instruments, .. } = *window;
            (row[DELAY], row[LAG]) = (-change, -0.5e-6 * curve);
            if instruments[DELAY] == 0.0 {
                (instruments[DELAY], instruments[LAG]) = (row[DELAY], row[LAG]);
            }
            sums[at * stretches / windows.len()].take(&row, &instruments, effort);
            rows.push((row, effort));
        }
        let whole = sums.iter().fold(Sums::ZERO, |all, it| all.plus(1.0, it));
        Fit { delay, stretches: sums, whole, rows, plain: None }
    }
}

/// Whether at least a tenth turns each way.
fn turns_both_ways<'r>(rows: impl ExactSizeIterator<Item = &'r Row>) -> bool {
    let count = rows.len();
    let ways = rows.filter(|it| it[FRICTION] > 0.0).count();
    10 * ways.min(count - ways) > count
}

/// A fit about a delay.
struct Fit {
    delay: f64,
    /// The sums of each stretch of time, and of all.
    stretches: Vec<Sums>,
    whole: Sums,
    rows: Vec<(Row, f64)>,
    /// The answer without play, if this one has it.
    plain: Option<Row>,
}

impl Fit {
    /// Sum of the squares of what is left.
    fn left(&self) -> f64 {
        let best = self.whole.solve();
        self.rows.iter().map(|(row, effort)| (effort - product(row, &best)).powi(2)).sum()
    }

    /// The delay, s.
    fn delay(&self) -> Figure {
        let Figure { value, half } = self.figure(|it| self.delay + it[DELAY]);
        // With play a motor begins without its load.
        let half = half * if self.plain.is_some() { 1.5 } else { 1.0 };
        Figure { value, half: half.hypot(ELASTIC) }
    }

    /// A value of the answer with its interval, by leaving out each stretch once.
    fn figure(&self, of: impl Fn(&Row) -> f64) -> Figure {
        let value = of(&self.whole.solve());
        let count = self.stretches.len() as f64;
        let squares = self.stretches.iter().map(|stretch| {
            let rest = self.whole.plus(-1.0, stretch).solve();
            (of(&rest) - value).powi(2)
        });
        let variance = squares.sum::<f64>() * (count - 1.0) / count;
        let by_play = self.plain.as_ref().map_or(0.0, |plain| 2.0 * (of(plain) - value));
        Figure { value, half: WIDER * (student(count - 1.0) * variance.sqrt()).hypot(by_play) }
    }
}

/// Two-sided 95 % quantile of Student's distribution.
fn student(freedom: f64) -> f64 {
    1.959_964 + 2.372 / freedom + 2.82 / freedom / freedom
}

impl Estimate {
    /// Estimates from samples in order of time. Fails with why nothing at all can be told.
    pub fn of(samples: &[Sample]) -> Result<Self, Unknown> {
        let samples = Samples::new(samples)?;
        // How far the motor is behind what is asked.
        let along = |windows: &[Window]| {
            windows.iter().map(|it| it.row[INERTIA] * it.instruments[INERTIA]).sum::<f64>()
        };
        let tries = (0..=(BEHIND[0] / BEHIND[1]) as usize).map(|at| {
            let behind = (at as f64 * BEHIND[1] / samples.period) as usize;
            (behind, samples.windows(behind, None))
        });
        let found = tries.max_by(|a, b| along(&a.1).total_cmp(&along(&b.1)));
        let (behind, windows) = found.ok_or(Unknown::TooShort)?;
        if (windows.len() as f64) * STEP < STRETCH * STRETCHES[1] as f64 {
            return Err(Unknown::TooShort);
        }
        let plain = samples.fit(&windows, 0.002);
        let (best, least) = (plain.whole.solve(), (1.0 - EXPLAINS) * plain.left());
        let with_play = PLAYS.into_iter().map(|play| {
            let sides = samples.sides(play, &best);
            samples.fit(&samples.windows(behind, Some(&sides)), plain.delay)
        });
        let with_play = with_play.min_by(|a, b| a.left().total_cmp(&b.left()));
        let Some(mut fit) = with_play.filter(|it| it.left() < least) else {
            return Self::tell(&samples, &plain, None);
        };
        let play = fit.figure(|it| 2.0 * it[PLAY] / it[INERTIA]);
        let mut best = best;
        best[DELAY] += plain.delay - fit.delay;
        fit.plain = Some(best);
        // By what is left where no play opens, if that tells more.
        for _ in 0..2 {
            let best = fit.whole.solve();
            let mut pressed = samples.windows(behind, None);
            pressed.retain(|it| samples.is_pressed(it, &best));
            let is_long = pressed.len() as f64 * STEP >= STRETCH * STRETCHES[1] as f64;
            let is_both = turns_both_ways(pressed.iter().map(|it| &it.row));
            if is_long && is_both == turns_both_ways(windows.iter().map(|it| &it.row)) {
                let pressed = samples.fit(&pressed, fit.delay);
                fit = if pressed.delay().half < fit.delay().half { pressed } else { fit };
            }
        }
        Self::tell(&samples, &fit, Some(play))
    }

    fn tell(samples: &Samples<'_>, fit: &Fit, play: Option<Figure>) -> Result<Self, Unknown> {
        let (best, count) = (fit.whole.solve(), fit.rows.len() as f64);
        let root = |of: &dyn Fn(&(Row, f64)) -> f64| {
            let bumps: f64 = fit.rows.iter().map(|(row, _)| row[WEIGHT].powi(2)).sum();
            (fit.rows.iter().map(|it| of(it).powi(2)).sum::<f64>() / bumps).sqrt()
        };
        let effort = root(&|it| it.1);
        let is_both = turns_both_ways(fit.rows.iter().map(|it| &it.0));
        let speeds = || fit.rows.iter().map(|(row, _)| (row[VISCOUS] / row[WEIGHT]).abs());
        let (slowest, fastest) =
            (speeds().fold(f64::INFINITY, f64::min), speeds().fold(0.0, f64::max));
        let has_speeds = slowest < 0.8 * fastest;
        let inertia = fit.figure(|it| it[INERTIA]);
        let drag = fit.figure(|it| it[FRICTION] + it[VISCOUS] * fastest);
        if inertia.value + inertia.half < 0.0 || (is_both && drag.value + drag.half < 0.0) {
            return Err(Unknown::WrongWay);
        }
        // Good enough: to half of it, or to a twentieth of all effort.
        let told = |column: usize| {
            let figure = fit.figure(|it| it[column]);
            let is_small = figure.half * root(&|it| it.0[column]) < 0.05 * effort;
            let is_told = is_small || figure.half < 0.5 * figure.value.abs();
            if is_told { Ok(figure) } else { Err(Unknown::TooVague) }
        };
        let amplitude = fit.figure(|it| it[SINE].hypot(it[COSINE]));
        let level = fit.figure(|it| {
            // Near its own best value, whichever turn that is in.
            let best = best[SINE].atan2(best[COSINE]);
            let (sin, cos) = (it[SINE].atan2(it[COSINE]) - best).sin_cos();
            (best + sin.atan2(cos)).to_degrees() + samples.middle()
        });
        let is_arm = samples.may_be_arm()
            && amplitude.half < 0.3 * amplitude.value
            && amplitude.value > 0.03 * effort;
        let delay = fit.delay();
        let only = |is: bool, why: Unknown| if is { Ok(()) } else { Err(why) };
        Ok(Self {
            inertia: only(inertia.half < 0.3 * inertia.value, Unknown::TooFree).map(|()| inertia),
            friction: only(is_both, Unknown::OneWay)
                .and_then(|()| only(has_speeds, Unknown::OneSpeed))
                .and_then(|()| told(FRICTION)),
            viscous: only(has_speeds, Unknown::OneSpeed).and_then(|()| told(VISCOUS)),
            weight: only(is_both, Unknown::OneWay).and_then(|()| told(WEIGHT)),
            arm: is_arm.then_some([amplitude, level]),
            delay: only(delay.value + delay.half > 0.0, Unknown::NotOneBody)
                .and_then(|()| only(delay.half < 0.002, Unknown::TooVague))
                .map(|()| delay),
            play: play.filter(|it| it.value > it.half),
            seconds: count * STEP,
            left: root(&|(row, effort)| effort - product(row, &best)),
            speeds: [slowest, fastest],
        })
    }
}
