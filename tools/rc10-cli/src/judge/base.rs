//! Whether a base's wheels and its IMU agree.

use rc10_motor::TargetKind;
use rc10_motor::dji::Effort;
use rc10_sim::{Tread, Wheel};
use rc10_time::Micros;

use crate::recording::excuse::is_excused;
use crate::recording::problem::{About, Problem};
use crate::recording::sample::{BaseMeasurement, SAMPLE_PERIOD, seconds, time_of};
use crate::recording::wheels::Wheels;
use crate::recording::{BaseTrack, MotorTrack, Recording};

/// Samples of a window: 100 ms.
pub const WINDOW: usize = 10;
/// Smallest disagreement of the yaw by IMU and by wheels in a window, rad: 0.2 rad/s.
pub const YAW: f64 = 0.02;
/// Share of the larger yaw that a disagreement must exceed, too.
pub const YAW_SHARE: f64 = 0.1;
/// Largest difference of a rim's distance from the neighbouring windows at a steady speed, m: 0.4
/// m/s².
pub const STEADY: f64 = 0.004;
/// Wheels roll if their rims go further than this in a window on average, m: 0.1 m/s.
pub const ROLLING: f64 = 0.01;
/// Share of the largest current with which rolling wheels at a steady speed push against something.
pub const PUSH: f64 = 0.2;
/// Wheels on a rigid base agree if they slip less than this in a window, m: 0.1 m/s.
pub const SLIP: f64 = 0.01;
/// A window in which a wheel is steered by more than this, degrees, is not judged.
pub const STEERED: f64 = 5.0;
/// Number of windows that make a problem.
pub const WINDOWS: usize = 3;
/// Number of windows, with wheels that push at a steady speed, that make a problem.
pub const PUSHING: usize = 2;
/// A base that turned by less than this, rad, tells nothing of its measures.
pub const TURNED: f64 = 1.0;
/// Over a whole run IMU and wheels may differ by this share of how far the base turned.
pub const TURNED_SHARE: f64 = 0.05;
pub(super) const MEASURE: &str =
    "drive 1 m forward, see which way it goes, and measure it on the floor (docs/bring-up.md)";

/// 100 ms in which all wheels followed their targets.
struct Window {
    end: Micros,
    wheels: Wheels,
    /// Distance of each rim by the robot's measures, m, forward positive.
    rims: Vec<f64>,
    /// Turn of the base by its IMU, rad.
    imu: Option<f64>,
    /// Effort of the wheels on average, as a share of their largest current.
    push: Option<f64>,
    is_steady: bool,
}

impl Window {
    /// The turn of the base by these distances of the rims, rad.
    fn yaw(&self, rims: &[f64]) -> f64 {
        self.wheels.motion(rims)[2]
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Cause {
    None,
    /// A wheel turns the other way.
    Direction(usize),
    /// A wheel turns faster or slower by this factor.
    Scale(usize, f64),
    /// The base turns by this factor of what its wheels say.
    Yaw(f64),
    Swap(usize, usize),
    /// The IMU is mounted upside down.
    ImuOver,
}

struct Judged<'r> {
    base: &'r BaseTrack,
    wheels: Vec<&'r MotorTrack>,
    windows: Vec<Window>,
}

impl<'r> Judged<'r> {
    fn new(recording: &'r Recording, base: &'r BaseTrack) -> Option<Self> {
        let tracks = |lines: &[usize]| -> Option<Vec<&'r MotorTrack>> {
            lines.iter().map(|line| recording.motors.get(*line)).collect()
        };
        let wheels = tracks(&base.wheels)?;
        let all = [wheels.clone(), tracks(&base.steering)?].concat();
        let mut windows = Vec::new();
        let last = base.heard.len().saturating_sub(WINDOW + 1);
        for from in (0..=last).step_by(WINDOW) {
            // The wheels may have counted anew just before, and the IMU been set to zero.
            let before = from.saturating_sub(WINDOW / 2);
            let Some(heard) = base.heard.get(before..=from + WINDOW) else { break };
            let end = time_of(from + WINDOW);
            let followed = heard.iter().all(|one| one.wheels.iter().all(|wheel| wheel.follows));
            let is_disturbed =
                all.iter().any(|track| is_excused(&recording.faults, track.motor.on, end));
            if followed && before < from && !is_disturbed && !is_steered(&heard[from - before..]) {
                windows.push(window(&heard[from - before..], base, &wheels, end));
            }
        }
        for index in 0..windows.len() {
            let is_near = |other: Option<&Window>| {
                other.is_some_and(|other| {
                    let mut pairs = windows[index].rims.iter().zip(&other.rims);
                    let apart = windows[index].end.get().abs_diff(other.end.get());
                    apart == SAMPLE_PERIOD.get() * WINDOW as u64
                        && pairs.all(|(a, b)| (a - b).abs() < STEADY)
                })
            };
            let before = index.checked_sub(1).and_then(|before| windows.get(before));
            let rims = &windows[index].rims;
            let rolls = rims.iter().map(|rim| rim.abs()).sum::<f64>() / rims.len().max(1) as f64;
            let is_steady = rolls > ROLLING && is_near(before) && is_near(windows.get(index + 1));
            windows[index].is_steady = is_steady;
        }
        Some(Self { base, wheels, windows })
    }

    /// Whether the wheels have rollers at an angle, which change the direction of motion.
    fn is_mecanum(&self) -> bool {
        let slants =
            |wheel: &Wheel| matches!(wheel.tread, Tread::Rollers { slant } if slant != 0.0);
        self.base.chassis.wheels.iter().any(slants)
    }

    /// The true motion of the rims if a cause is true.
    fn real(&self, cause: Cause, rims: &[f64]) -> Vec<f64> {
        let sign = |wheel: usize| self.wheels[wheel].motor.sign();
        let mut real = rims.to_vec();
        match cause {
            Cause::None | Cause::Yaw(_) | Cause::ImuOver => (),
            Cause::Direction(wheel) => real[wheel] = -rims[wheel],
            Cause::Scale(wheel, factor) => real[wheel] = factor * rims[wheel],
            // Each at the other's place, and seen from the other side if that is mirrored.
            Cause::Swap(a, b) => {
                let sides = sign(a) * sign(b);
                (real[a], real[b]) = (sides * rims[b], sides * rims[a]);
            }
        }
        real
    }

    fn expected(&self, cause: Cause, window: &Window) -> f64 {
        let factor = match cause {
            Cause::Yaw(factor) => factor,
            Cause::ImuOver => -1.0,
            _ => 1.0,
        };
        factor * window.yaw(&self.real(cause, &window.rims))
    }

    /// Windows with an IMU: its yaw, and the window.
    fn turned(&self) -> impl Iterator<Item = (f64, &Window)> {
        self.windows.iter().filter_map(|window| Some((window.imu?, window)))
    }

    /// Windows that can be judged by the effort of the wheels.
    fn pushing(&self) -> impl Iterator<Item = (f64, &Window)> {
        let steady = self.windows.iter().filter(|window| window.is_steady);
        steady.filter_map(|window| Some((window.push?, window)))
    }

    /// The cost of a cause: 0 if it explains the measurements, 2 if it does not at all.
    fn cost(&self, cause: Cause) -> f64 {
        let square = |cause: Cause| {
            let errors = self.turned().map(|(imu, it)| imu - self.expected(cause, it));
            errors.map(|error| error * error).sum::<f64>()
        };
        let noise = self.turned().count() as f64 * YAW * YAW;
        let yaw = match noise > 0.0 {
            true => (square(cause) / square(Cause::None).max(noise)).min(1.0),
            false => 0.0,
        };
        let fights = |window: &Window| window.wheels.slip(&self.real(cause, &window.rims));
        let wrong = self.pushing().filter(|(push, it)| (*push > PUSH) != (fights(it) > STEADY));
        let (wrong, all) = (wrong.count() as f64, self.pushing().count() as f64);
        yaw + wrong / all.max(ENOUGH)
    }

    /// All causes that can be told apart, with their factors fitted to the IMU.
    fn causes(&self) -> Vec<Cause> {
        let mut causes = vec![Cause::None, Cause::ImuOver];
        let count = self.wheels.len();
        causes.extend((0..count).map(Cause::Direction));
        for a in 0..count {
            causes.extend((a + 1..count).map(|b| Cause::Swap(a, b)));
        }
        // The share of a motion that best explains the IMU's yaw beyond the wheels'.
        let fit = |of: &dyn Fn(&Window) -> f64| {
            let (mut product, mut square) = (0.0, 0.0);
            for (imu, window) in self.turned() {
                product += (imu - window.yaw(&window.rims)) * of(window);
                square += of(window) * of(window);
            }
            Some(1.0 + product / square).filter(|factor| square > 0.0 && *factor > 0.0)
        };
        for wheel in 0..count {
            let alone = |window: &Window| window.wheels.share(wheel)[2] * window.rims[wheel];
            causes.extend(fit(&alone).map(|factor| Cause::Scale(wheel, factor)));
        }
        causes.extend(fit(&|window| window.yaw(&window.rims)).map(Cause::Yaw));
        causes
    }
}

fn is_steered(heard: &[BaseMeasurement]) -> bool {
    let count = heard.first().map_or(0, |one| one.wheels.len());
    (0..count).any(|wheel| {
        let angles = || heard.iter().map(|one| one.wheels[wheel].steered);
        angles().fold(f64::MIN, f64::max) - angles().fold(f64::MAX, f64::min) > STEERED
    })
}

fn window(
    heard: &[BaseMeasurement],
    base: &BaseTrack,
    wheels: &[&MotorTrack],
    end: Micros,
) -> Window {
    let (first, last) = (&heard[0], &heard[heard.len() - 1]);
    let push = |(wheel, track): (usize, &&MotorTrack)| {
        let currents = heard.iter().map(|one| one.wheels[wheel].current);
        let sum = currents.sum::<Option<f64>>()?;
        Some(sum.abs() / heard.len() as f64 / largest_current(track)?)
    };
    let pushes = wheels.iter().enumerate().map(push).sum::<Option<f64>>();
    Window {
        end,
        wheels: Wheels::new(&base.chassis, &BaseMeasurement::steered(first, last)),
        rims: base.ways(first, last),
        imu: last.yaw.zip(first.yaw).map(|(last, first)| (last - first).to_radians()),
        push: pushes.map(|sum| sum / wheels.len().max(1) as f64),
        is_steady: false,
    }
}

/// The largest current in A, if the motor's loops or model have one.
fn largest_current(track: &MotorTrack) -> Option<f64> {
    let of_model = track.motor.dji().and_then(|(model, _)| match model.effort {
        Effort::Current(amps) => Some(amps),
        Effort::Voltage => None,
    });
    let loops = track.effort.as_ref().map(|effort| effort.loops);
    let of_loops = loops.filter(|loops| loops.effort == TargetKind::Current);
    of_model.or(of_loops.map(|loops| loops.cascade.speed.output_limit)).map(f64::from)
}

pub(super) fn base_and_wheels(recording: &Recording, found: &mut Vec<Problem>) {
    let Some(base) = &recording.base else { return };
    let Some(judged) = Judged::new(recording, base) else { return };
    let differs = |imu: f64, wheels: f64| {
        (imu - wheels).abs() > YAW + YAW_SHARE * imu.abs().max(wheels.abs())
    };
    let yaws = || judged.turned().map(|(imu, it)| (imu, it.yaw(&it.rims), it.end));
    let apart: Vec<_> = yaws().filter(|(imu, wheels, _)| differs(*imu, *wheels)).collect();
    let fights: Vec<_> = judged.pushing().filter(|(push, _)| *push > PUSH).collect();
    let slips = judged.windows.iter().filter(|it| it.wheels.slip(&it.rims) > SLIP).count();
    let turned: f64 = judged.turned().map(|(imu, _)| imu.abs()).sum();
    let by_wheels: f64 = judged.turned().map(|(_, it)| it.yaw(&it.rims).abs()).sum();
    let mut seen = Vec::new();
    let most = turned.max(by_wheels);
    if most > TURNED && (turned - by_wheels).abs() > TURNED_SHARE * most {
        seen.push(format!(
            "by its IMU it turned by {turned:.2} rad in all, by its wheels by {by_wheels:.2}"
        ));
    }
    let worst = apart.iter().max_by(|a, b| (a.0 - a.1).abs().total_cmp(&(b.0 - b.1).abs()));
    if let (WINDOWS.., Some((imu, wheels, end))) = (apart.len(), worst) {
        let per_second = 1.0 / (WINDOW as f64 * seconds(SAMPLE_PERIOD));
        seen.push(format!(
            "in {} of {} windows of 100 ms its IMU and its wheels differ on how fast it turns: \
             {:.2} rad/s, and {:.2} by the wheels, at {:.1} s",
            apart.len(),
            yaws().count(),
            imu * per_second,
            wheels * per_second,
            seconds(*end),
        ));
    }
    if fights.len() >= PUSHING {
        let mean = fights.iter().map(|(push, _)| push).sum::<f64>() / fights.len() as f64;
        seen.push(format!(
            "in {} of {} windows at a steady speed the wheels push with {:.0} % of their largest \
             current: against one another, against something, or with too little grip",
            fights.len(),
            judged.pushing().count(),
            mean * 100.0,
        ));
    }
    if slips >= WINDOWS {
        let all = judged.windows.len();
        seen.push(format!("in {slips} of {all} windows its wheels turn as on no rigid base"));
    }
    if judged.windows.first().is_some_and(|window| !window.wheels.is_overdetermined()) {
        let text = format!(
            "its {} wheels fit one another whatever they do, because a motion is no less than that: \
             one that slips or is wrong is seen by an IMU alone",
            judged.wheels.len()
        );
        found.push(Problem::information(About::Robot, "not-overdetermined", text));
    }
    if seen.is_empty() {
        found.push(agreement(&judged, turned, by_wheels, !recording.source.is_told()));
        return;
    }
    // Whatever is wrong, one wheel's own factor explains some of it.
    let handicap = |cause: &Cause| if matches!(cause, Cause::Scale(..)) { SIMPLER } else { 0.0 };
    let cost = |cause: Cause| (judged.cost(cause) + handicap(&cause), cause);
    let mut causes: Vec<_> = judged.causes().into_iter().map(cost).collect();
    causes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (least, best) = causes[0];
    let is_explained = best != Cause::None && least < EXPLAINED;
    let likely = causes.iter().filter(|(cost, _)| is_explained && *cost < least + ALIKE);
    let likely: Vec<Cause> = likely.map(|(_, cause)| *cause).collect();
    let directions = likely.iter().filter(|cause| matches!(cause, Cause::Direction(_))).count();
    let (cause, culprits) = judged.headline(&likely, directions > 2);
    let likely: Vec<String> = likely.into_iter().map(|cause| judged.sentence(cause)).collect();
    let mut likely = match likely.len() {
        0 => "why cannot be told from this run".to_owned(),
        // Without an IMU they all look alike.
        _ if directions > 2 => {
            "it looks as if the direction, or the gear, of one of its wheels were wrong in the table"
                .to_owned()
        }
        _ => format!("it looks as if {}", likely.join(", or ")),
    };
    // The wheels follow their commands though the floor drags them: only the IMU sees it.
    let is_either = matches!(best, Cause::Yaw(_)) && is_explained && least > SURE;
    let is_either = is_either && judged.is_mecanum();
    if is_either {
        likely += "; two wheels of one side that are exchanged look the same";
    }
    let cause = if is_either { "wheel radius wrong, or two wheels swapped" } else { cause };
    let text = format!("the base does not do what its wheels say: {likely}; {}", seen.join("; "));
    let shown = worst.map(|(.., end)| *end).or(fights.first().map(|(_, window)| window.end));
    let length = Micros::new(WINDOW as u64 * SAMPLE_PERIOD.get());
    let span = shown.map(|end| (end.since(length), end));
    let problem = Problem::new(About::Robot, "base", text).because(cause);
    found.push(Problem { culprits, span, ..problem });
}

/// Cost from which on a cause explains nothing; causes that differ by less are alike.
const EXPLAINED: f64 = 0.8;
const ALIKE: f64 = 0.03;
/// Largest cost at which it is the wheels' radius alone: a wrong radius has 0.03 at most.
const SURE: f64 = 0.2;
/// Number of windows at a steady speed that are needed.
const ENOUGH: f64 = 10.0;
/// Cost added to a cause with a fitted factor: it must explain more than one without.
const SIMPLER: f64 = 0.05;

impl Judged<'_> {
    /// The cause in a few words, and the wheels that it names. Of several causes none is named: it may be the wrong one.
    fn headline(&self, likely: &[Cause], is_any: bool) -> (&'static str, Vec<&'static str>) {
        let label = |wheel: usize| self.wheels[wheel].motor.label;
        match *likely {
            [] => ("its wheels and sensors disagree", vec![]),
            _ if is_any => ("one wheel's direction or gear is wrong", vec![]),
            [Cause::Direction(it)] => ("direction is reversed", vec![label(it)]),
            [Cause::Scale(it, _)] => ("another gear or wheel", vec![label(it)]),
            [Cause::Swap(a, b)] => ("swapped", vec![label(a), label(b)]),
            [Cause::ImuOver] => ("IMU is upside down", vec![]),
            [Cause::ImuOver, ..] => ("IMU is perhaps upside down", vec![]),
            [Cause::Yaw(_) | Cause::None] => ("wheel radius or track is wrong", vec![]),
            [Cause::Direction(_), ..] => ("one wheel's direction is perhaps reversed", vec![]),
            [Cause::Scale(..), ..] => ("one wheel's gear is perhaps wrong", vec![]),
            [Cause::Swap(..), ..] => ("two wheels are perhaps swapped", vec![]),
            [Cause::Yaw(_) | Cause::None, ..] => ("wheel radius is perhaps wrong", vec![]),
        }
    }

    fn sentence(&self, cause: Cause) -> String {
        let label = |wheel: usize| self.wheels[wheel].motor.label;
        match cause {
            Cause::None => "all were well".into(),
            Cause::ImuOver => {
                "the IMU were mounted upside down, or its yaw taken with the wrong sign".into()
            }
            Cause::Direction(it) => {
                format!("the direction of {} were wrong in the table", label(it))
            }
            Cause::Scale(wheel, factor) => format!(
                "{} turned about {factor:.1} times as fast as it says: another gear, or wheel, than \
                 in the table",
                label(wheel),
            ),
            Cause::Yaw(factor) => {
                let distances = if self.is_mecanum() {
                    "wheelbase and track together"
                } else {
                    "its wheels' distances from its middle"
                };
                format!(
                    "the wheels' radius were {factor:.2} times that of the table, or {distances} \
                     {:.2} times theirs",
                    1.0 / factor,
                )
            }
            Cause::Swap(a, b) => {
                format!("{} and {} were exchanged (plugs or identifiers)", label(a), label(b))
            }
        }
    }
}

/// The finding for a base without a problem: what was checked, and what was not.
fn agreement(judged: &Judged<'_>, turned: f64, by_wheels: f64, is_emulated: bool) -> Problem {
    let text = if judged.windows.is_empty() {
        format!("wheel radius: not checked, its wheels were never driven together: {MEASURE}")
    } else if turned > TURNED {
        format!(
            "its wheels turned it by {by_wheels:.2} rad, its IMU says {turned:.2}; which way and how \
             far it goes no sensor knows: {MEASURE}"
        )
    } else if judged.turned().next().is_some() {
        format!("wheel radius: not checked, it hardly turned: {MEASURE}")
    } else if is_emulated {
        format!("wheel radius: not checked, the chip's IMU is not seen from here: {MEASURE}")
    } else {
        format!("wheel radius: not checked, no sensor knows: {MEASURE}")
    };
    Problem::information(About::Robot, "wheel-radius", text)
}

#[cfg(test)]
pub(super) mod tests;
