//! Whether what a robot's own sensors say fits together: its wheels with one another, with its IMU
//! and with what they push; its motors with their targets; its identifiers with the frames on the bus.
//!
//! A property that no sensor can know, a wheel's true radius for example, is said as information,
//! with what would show it. The thresholds, and how far the shipped robots are from them:
//! `docs/verdict.md`.

use rc10_can::Micros;
use rc10_motor::dji::Effort;
use rc10_motor::{DriveMode, Link, TargetKind};
use rc10_sim::fault::{Fault, Kind};

use crate::motor::{Device, Place};
use crate::problems::{About, Problem, is_excused, is_on, seconds, time_of};
use crate::recording::{BaseHeard, BaseTrack, MotorSample, MotorTrack, Recording, SAMPLE_PERIOD};

/// Samples of a window: 100 ms.
pub const WINDOW: usize = 10;
/// The base's yaw by its IMU and by its wheels differ if they do so by more than this in a window,
/// rad: 0.2 rad/s ..
pub const YAW: f64 = 0.02;
/// .. and by this share of the larger.
pub const YAW_SHARE: f64 = 0.1;
/// A wheel's rim goes at a steady speed if its way differs by less than this from the windows
/// before and after, m: 0.4 m/s².
pub const STEADY: f64 = 0.004;
/// Wheels roll if their rims go further than this in a window on average, m: 0.1 m/s.
pub const ROLLING: f64 = 0.01;
/// Wheels that roll at a steady speed and push with more than this share of their largest current
/// push against one another, or against something else.
pub const PUSH: f64 = 0.2;
/// Four wheels on a rigid base fit one another if none of them slips further than this in a window,
/// m: 0.1 m/s.
pub const SLIP: f64 = 0.01;
/// Windows that make a problem ..
pub const WINDOWS: usize = 3;
/// .. and those in which wheels push at a steady speed.
pub const PUSHING: usize = 2;
/// A base that turned by less than this, rad, tells nothing of its measures.
pub const TURNED: f64 = 1.0;
/// Over a whole run IMU and wheels may differ by this share of how far the base turned.
pub const TURNED_SHARE: f64 = 0.05;
/// A device that answers more often than this many times its rate is two.
pub const TWICE: f64 = 1.5;
/// Samples for which a motor that runs away goes away from its target: 200 ms.
pub const AWAY: usize = 20;

/// A measurement that shows what no sensor knows.
const MEASURE: &str =
    "drive 1 m forward, see which way it goes, and measure it on the floor (docs/bring-up.md)";

/// Looks for all of it.
pub fn consistency(recording: &Recording, found: &mut Vec<Problem>) {
    identifiers(recording, found);
    recording.motors.iter().for_each(|track| found.extend(runaway(recording, track)));
    if let Some(base) = &recording.base {
        base_and_wheels(recording, base, found);
    }
    not_checked(recording, found);
}

// ---- identifiers -------------------------------------------------------------------------------

/// A device that is set to another motor's identifier: one is never heard, the other answers twice.
fn identifiers(recording: &Recording, found: &mut Vec<Problem>) {
    for track in &recording.motors {
        let (motor, on) = (&track.motor, track.motor.on);
        let Device::Dji(rc10_motor::dji::Config { rate, .. }) = motor.device else { continue };
        // A bus is filled with repetitions of a motor's feedback.
        let is_filled = |fault: &Fault| matches!(fault.kind, Kind::Load(_)) && is_on(fault, on);
        let due = seconds(recording.length) * f64::from(rate.hz());
        let received = f64::from(track.last.counters.received);
        if received <= TWICE * due || recording.faults.iter().any(is_filled) {
            continue;
        }
        let silent = recording
            .motors
            .iter()
            .filter(|other| other.motor.on == on && other.last.link == Link::NeverSeen);
        let silent: Vec<&str> = silent.map(|other| other.motor.label).collect();
        let culprit = match silent.as_slice() {
            [] => String::new(),
            labels => format!(", and {} is never heard: is it set to this one?", labels.join(", ")),
        };
        let text = format!(
            "answers twice: {:.1} times as many frames as it sends, so two devices on {on} have \
             the identifier of {}{culprit}",
            received / due,
            motor.name(),
        );
        found.push(Problem::new(About::Motor(motor.label), "answers-twice", text));
    }
    for bus in &recording.buses {
        let silent = recording.motors.iter().find(|track| {
            track.motor.on == Place::Bus(bus.number) && track.last.link == Link::NeverSeen
        });
        let stranger = bus.last.received.last_unclaimed;
        if let (Some(silent), Some(key)) = (silent, stranger) {
            let base = silent.motor.dji().map(|(model, _)| u32::from(model.feedback_base));
            let id = base.and_then(|base| key.checked_sub(base)).filter(|id| (1..=8).contains(id));
            let other = match id {
                Some(id) => format!("{id}, not {}", silent.motor.name().id),
                None => "another identifier than the table's".into(),
            };
            let text = format!(
                "{} frames of {key:#x} belong to no motor of the table, and {} is never heard: is \
                 it set to {other}?",
                bus.last.received.unclaimed, silent.motor.label,
            );
            found.push(Problem::new(About::Bus(bus.number), "other-identifier", text));
        }
    }
}

// ---- one motor and its target ------------------------------------------------------------------

/// A motor that drives itself away from its target, faster and faster or further and further.
fn runaway(recording: &Recording, track: &MotorTrack) -> Option<Problem> {
    let at = track.samples.windows(AWAY).position(is_away)?;
    let last = track.samples[at + AWAY - 1];
    let end = time_of(at + AWAY - 1);
    if is_excused(recording, track.motor.on, end) {
        return None;
    }
    let unit = match last.kind {
        TargetKind::Speed | TargetKind::SpeedMotion => "rpm",
        _ => "degrees",
    };
    let text = format!(
        "runs away: at {:.2} s it is at {:.0} {unit}, its target is {:.0}, and it drives on: its \
         feedback counts against its commands",
        seconds(end),
        last.measured,
        last.target.unwrap_or_default(),
    );
    Some(Problem::new(About::Motor(track.motor.label), "runaway", text))
}

fn is_away(samples: &[MotorSample]) -> bool {
    let kind = samples[0].kind;
    use TargetKind::{Angle, Impedance, Motion, Speed, SpeedMotion, TotalAngle};
    let is_angle = matches!(kind, Angle | TotalAngle | Impedance | Motion);
    if !is_angle && !matches!(kind, Speed | SpeedMotion) {
        return false;
    }
    let error = |sample: &MotorSample| {
        let error = sample.target? - sample.measured;
        let goes_away = error * if is_angle { sample.rpm } else { sample.measured } < 0.0;
        // What a load or the floor drags along takes power; what runs away gives it.
        let drives = sample.drive == DriveMode::Run && sample.current * sample.rpm > 0.0;
        (sample.kind == kind && goes_away && drives).then_some(error)
    };
    let Some(errors) = samples.iter().map(error).collect::<Option<Vec<f64>>>() else {
        return false;
    };
    let (first, last) = (errors[0], errors[errors.len() - 1]);
    let target = samples[samples.len() - 1].target.unwrap_or_default().abs();
    // More than an overshoot.
    let far = if is_angle { 90.0 } else { 50.0 + 0.5 * target };
    last.abs() > far
        && last * first > 0.0
        && errors.windows(2).all(|pair| pair[1].abs() >= pair[0].abs())
}

// ---- the base on its wheels --------------------------------------------------------------------

/// 100 ms in which all four wheels followed their targets.
struct Window {
    end: Micros,
    /// Distance of each rim by the robot's measures, m, forward positive.
    rims: [f64; 4],
    /// Turn of the base by its IMU, rad.
    imu: Option<f64>,
    /// Effort of the wheels on average, as a share of their largest current.
    push: Option<f64>,
    /// They rolled at a steady speed.
    is_steady: bool,
}

/// Which way a wheel turns the base.
const TURNS: [f64; 4] = [-1.0, 1.0, -1.0, 1.0];
/// Turns of four wheels that no motion of a rigid base makes.
const SLIPS: [f64; 4] = [1.0, 1.0, -1.0, -1.0];

fn dot(first: &[f64; 4], second: &[f64; 4]) -> f64 {
    first.iter().zip(second).map(|(a, b)| a * b).sum()
}

/// A cause of trouble with a base, of those that its sensors can tell apart.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cause {
    /// Nothing.
    None,
    /// A wheel goes the other way.
    Direction(usize),
    /// A wheel goes faster or slower by this factor.
    Scale(usize, f64),
    /// The base turns faster or slower than its wheels say, by this factor.
    Yaw(f64),
    /// Two wheels are exchanged.
    Swap(usize, usize),
}

/// A base, and what its sensors said.
struct Judged<'r> {
    base: &'r BaseTrack,
    wheels: [&'r MotorTrack; 4],
    windows: Vec<Window>,
}

impl<'r> Judged<'r> {
    fn new(recording: &'r Recording, base: &'r BaseTrack) -> Option<Self> {
        let [fl, fr, rl, rr] = base.wheels.map(|line| recording.motors.get(line));
        let wheels = [fl?, fr?, rl?, rr?];
        let mut windows = Vec::new();
        let last = base.heard.len().saturating_sub(WINDOW + 1);
        for from in (0..=last).step_by(WINDOW) {
            // The wheels may have counted anew just before, and the IMU been set to zero.
            let before = from.saturating_sub(WINDOW / 2);
            let Some(heard) = base.heard.get(before..=from + WINDOW) else { break };
            let end = time_of(from + WINDOW);
            let followed = heard.iter().all(|one| one.wheels.iter().all(|wheel| wheel.follows));
            let is_disturbed =
                wheels.iter().any(|track| is_excused(recording, track.motor.on, end));
            if followed && before < from && !is_disturbed {
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
            let rolls = windows[index].rims.iter().map(|rim| rim.abs()).sum::<f64>() / 4.0;
            let is_steady = rolls > ROLLING && is_near(before) && is_near(windows.get(index + 1));
            windows[index].is_steady = is_steady;
        }
        Some(Self { base, wheels, windows })
    }

    fn lever(&self) -> f64 {
        self.base.chassis.half_length + self.base.chassis.half_width
    }

    /// The turn of the base by its wheels, rad.
    fn yaw(&self, rims: &[f64; 4]) -> f64 {
        dot(rims, &TURNS) / (4.0 * self.lever())
    }

    fn labels<const N: usize>(&self, wheels: [usize; N]) -> [&'static str; N] {
        wheels.map(|wheel| self.wheels[wheel].motor.label)
    }

    /// The true motion of the wheels' rims if a cause is true.
    fn real(&self, cause: Cause, rims: &[f64; 4]) -> [f64; 4] {
        let sign = |wheel: usize| self.wheels[wheel].motor.sign();
        let mut real = *rims;
        match cause {
            Cause::None | Cause::Yaw(_) => (),
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

    /// The turn of the base by its IMU if a cause is true, rad.
    fn expected(&self, cause: Cause, rims: &[f64; 4]) -> f64 {
        let factor = if let Cause::Yaw(factor) = cause { factor } else { 1.0 };
        factor * self.yaw(&self.real(cause, rims))
    }

    /// Windows with an IMU: what it says, and what the rims do.
    fn turned(&self) -> impl Iterator<Item = (f64, &Window)> {
        self.windows.iter().filter_map(|window| Some((window.imu?, window)))
    }

    /// Windows that can be judged by what the wheels push with.
    fn pushing(&self) -> impl Iterator<Item = (f64, &Window)> {
        let steady = self.windows.iter().filter(|window| window.is_steady);
        steady.filter_map(|window| Some((window.push?, window)))
    }

    /// The cost of a cause: how badly it explains the measurements, 0 well, 2 not at all.
    fn cost(&self, cause: Cause) -> f64 {
        let square = |cause: Cause| {
            let errors = self.turned().map(|(imu, it)| imu - self.expected(cause, &it.rims));
            errors.map(|error| error * error).sum::<f64>()
        };
        let noise = self.turned().count() as f64 * YAW * YAW;
        let yaw = if noise > 0.0 {
            (square(cause) / square(Cause::None).max(noise)).min(1.0)
        } else {
            0.0
        };
        let fights = |window: &Window| dot(&self.real(cause, &window.rims), &SLIPS).abs() / 4.0;
        let wrong = self.pushing().filter(|(push, it)| (*push > PUSH) != (fights(it) > STEADY));
        let (wrong, all) = (wrong.count() as f64, self.pushing().count() as f64);
        yaw + wrong / all.max(ENOUGH)
    }

    /// All causes that can be told apart, with their factors fitted to the IMU.
    fn causes(&self) -> Vec<Cause> {
        let mut causes = vec![Cause::None];
        causes.extend((0..4).map(Cause::Direction));
        for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            causes.push(Cause::Swap(a, b));
        }
        // The share of a motion that explains best what the IMU saw beyond the wheels.
        let fit = |of: &dyn Fn(&[f64; 4]) -> f64| {
            let (mut product, mut square) = (0.0, 0.0);
            for (imu, Window { rims, .. }) in self.turned() {
                product += (imu - self.yaw(rims)) * of(rims);
                square += of(rims) * of(rims);
            }
            (square > 0.0).then(|| 1.0 + product / square)
        };
        for wheel in 0..4 {
            let alone = |rims: &[f64; 4]| TURNS[wheel] * rims[wheel] / (4.0 * self.lever());
            let factor = fit(&alone).filter(|factor| *factor > 0.0);
            causes.extend(factor.map(|factor| Cause::Scale(wheel, factor)));
        }
        let factor = fit(&|rims| self.yaw(rims)).filter(|factor| *factor > 0.0);
        causes.extend(factor.map(Cause::Yaw));
        causes
    }
}

fn window(heard: &[BaseHeard], base: &BaseTrack, wheels: &[&MotorTrack; 4], end: Micros) -> Window {
    let (first, last) = (heard[0], heard[heard.len() - 1]);
    let way = |wheel: usize| {
        let degrees = last.wheels[wheel].angle - first.wheels[wheel].angle;
        degrees.to_radians() * base.chassis.wheel_radius
    };
    let push = |wheel: usize| {
        let currents = heard.iter().map(|one| one.wheels[wheel].current);
        let sum = currents.sum::<Option<f64>>()?;
        Some(sum.abs() / heard.len() as f64 / largest_current(wheels[wheel])?)
    };
    let pushes = [push(0), push(1), push(2), push(3)].into_iter().sum::<Option<f64>>();
    Window {
        end,
        rims: [way(0), way(1), way(2), way(3)],
        imu: last.yaw.zip(first.yaw).map(|(last, first)| (last - first).to_radians()),
        push: pushes.map(|sum| sum / 4.0),
        is_steady: false,
    }
}

/// A, of a motor whose loops or model tell it.
fn largest_current(track: &MotorTrack) -> Option<f64> {
    let of_model = track.motor.dji().and_then(|(model, _)| match model.effort {
        Effort::Current(amps) => Some(amps),
        Effort::Voltage => None,
    });
    let loops = track.effort.as_ref().map(|effort| effort.loops);
    let of_loops = loops.filter(|loops| loops.effort == TargetKind::Current);
    of_model.or(of_loops.map(|loops| loops.cascade.speed.output_limit)).map(f64::from)
}

fn base_and_wheels(recording: &Recording, base: &BaseTrack, found: &mut Vec<Problem>) {
    let Some(judged) = Judged::new(recording, base) else { return };
    let differs = |imu: f64, wheels: f64| {
        (imu - wheels).abs() > YAW + YAW_SHARE * imu.abs().max(wheels.abs())
    };
    let yaws = || judged.turned().map(|(imu, it)| (imu, judged.yaw(&it.rims), it.end));
    let apart: Vec<_> = yaws().filter(|(imu, wheels, _)| differs(*imu, *wheels)).collect();
    let fights: Vec<_> = judged.pushing().filter(|(push, _)| *push > PUSH).collect();
    let slips = judged.windows.iter().filter(|it| dot(&it.rims, &SLIPS).abs() / 4.0 > SLIP);
    let slips = slips.count();
    let turned: f64 = judged.turned().map(|(imu, _)| imu.abs()).sum();
    let by_wheels: f64 = judged.turned().map(|(_, it)| judged.yaw(&it.rims).abs()).sum();
    let mut seen = Vec::new();
    let most = turned.max(by_wheels);
    if most > TURNED && (turned - by_wheels).abs() > TURNED_SHARE * most {
        seen.push(format!(
            "by its IMU it turned by {turned:.2} rad in all, by its wheels by {by_wheels:.2}"
        ));
    }
    if apart.len() >= WINDOWS {
        let worst = apart.iter().max_by(|a, b| (a.0 - a.1).abs().total_cmp(&(b.0 - b.1).abs()));
        let per_second = 1.0 / (WINDOW as f64 * seconds(SAMPLE_PERIOD));
        if let Some((imu, wheels, end)) = worst {
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
        seen.push(format!(
            "in {slips} of {} windows the four wheels turn as on no rigid base",
            judged.windows.len()
        ));
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
    let likely: Vec<String> = likely.into_iter().map(|cause| judged.sentence(cause)).collect();
    let likely = match likely.len() {
        0 => "why cannot be told from this run".to_owned(),
        // Without an IMU they all look alike.
        _ if directions > 2 => {
            "it looks as if the direction, or the gear, of one of its wheels were wrong in the table"
                .to_owned()
        }
        _ => format!("it looks as if {}", likely.join(", or ")),
    };
    let text = format!("the base does not do what its wheels say: {likely}; {}", seen.join("; "));
    found.push(Problem::new(About::Robot, "base", text));
}

/// From this cost on a cause explains nothing; and causes that differ by less are alike.
const EXPLAINED: f64 = 0.8;
const ALIKE: f64 = 0.03;
/// Fewer windows at a steady speed tell less.
const ENOUGH: f64 = 10.0;
/// The cost that is added to a cause with a fitted factor: it must explain more than one without.
const SIMPLER: f64 = 0.05;

impl Judged<'_> {
    fn sentence(&self, cause: Cause) -> String {
        match cause {
            Cause::None => "all were well".into(),
            Cause::Direction(wheel) => {
                format!("the direction of {} were wrong in the table", self.labels([wheel])[0])
            }
            Cause::Scale(wheel, factor) => format!(
                "{} turned about {factor:.1} times as fast as it says: another gear, or wheel, than \
                 in the table",
                self.labels([wheel])[0],
            ),
            Cause::Yaw(factor) => format!(
                "the wheels' radius were {factor:.2} times that of the table, or wheelbase and \
                 track together {:.2} times theirs",
                1.0 / factor,
            ),
            Cause::Swap(a, b) => {
                let [a, b] = self.labels([a, b]);
                format!("{a} and {b} were exchanged (plugs or identifiers)")
            }
        }
    }
}

/// The finding for a base with which nothing is wrong: what was checked, and what was not.
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

/// Adds what no sensor of the robot can know of its other motors.
fn not_checked(recording: &Recording, found: &mut Vec<Problem>) {
    let is_wheel =
        |index: usize| recording.base.as_ref().is_some_and(|base| base.wheels.contains(&index));
    let others = (0..).zip(&recording.motors).filter(|(index, _)| !is_wheel(*index));
    let others: Vec<&str> = others.map(|(_, track)| track.motor.label).collect();
    if !others.is_empty() {
        let text = format!(
            "direction and gear not checked, no sensor knows: of {}; turn each by hand and look \
             which way and how far it counts (docs/bring-up.md)",
            others.join(", ")
        );
        found.push(Problem::information(About::Robot, "not-checked", text));
    }
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji;

    use super::*;
    use crate::motor::Motor;
    use crate::recording::{Cell, PathPoint, WheelHeard};

    fn sample(target: f64, measured: f64, rpm: f64, current: f64, kind: TargetKind) -> MotorSample {
        MotorSample {
            target: Some(target),
            measured,
            measured_cell: Cell::default(),
            kind,
            current,
            current_cell: Cell::default(),
            rpm,
            rpm_cell: Cell::default(),
            link: Link::Online,
            drive: DriveMode::Run,
            counters: Default::default(),
            overwritten: 0,
        }
    }

    #[test]
    fn what_drives_itself_away_runs_away_and_what_is_dragged_or_overshoots_does_not() {
        let seen = |of: &dyn Fn(f64) -> MotorSample| {
            is_away(&(0..AWAY).map(|index| of(index as f64)).collect::<Vec<_>>())
        };
        let speed = TargetKind::Speed;
        let away = |n: f64| sample(100.0, -20.0 * n - 10.0, -20.0 * n - 10.0, -5.0, speed);
        assert!(seen(&away));
        assert!(
            !seen(&|n| MotorSample { current: 5.0, ..away(n) }),
            "dragged, against its current"
        );
        assert!(!seen(&|n| MotorSample { drive: DriveMode::Hold, ..away(n) }), "told nothing");
        assert!(!seen(&|n| MotorSample { target: None, ..away(n) }), "told nothing");
        assert!(!seen(&|n| sample(200.0, 210.0 + n, 210.0 + n, 5.0, speed)), "overshoots");
        assert!(!seen(&|n| sample(100.0, 200.0 - n, 200.0 - n, 5.0, speed)), "comes back");
        let angle = TargetKind::TotalAngle;
        assert!(seen(&|n| sample(0.0, 80.0 + n * n, 30.0, 5.0, angle)));
        assert!(!seen(&|n| sample(0.0, -80.0 - n, 30.0, 5.0, angle)), "on its way");
        assert!(!seen(&|n| sample(0.0, 10.0 + n, 30.0, 5.0, angle)), "a little");
    }

    /// A run in which four wheels did this in each window, and the IMU saw that.
    fn run(
        rims: impl Fn(usize) -> [f64; 4],
        imu: impl Fn(usize) -> Option<f64>,
        amps: f64,
    ) -> Recording {
        let wheel = |(label, id)| MotorTrack {
            motor: Motor::dji_on(label, 1, &dji::M3508, id),
            samples: Vec::new(),
            last: Default::default(),
            overwritten: 0,
            tracking: Vec::new(),
            peak_current: 0.0,
            effort: None,
        };
        let chassis = rc10_sim::Chassis::default();
        let (mut angles, mut yaw) = ([0.0; 4], 0.0);
        let heard = (0..=300).map(|index: usize| {
            let window = index.saturating_sub(1) / WINDOW;
            if index > 0 {
                for (angle, rim) in angles.iter_mut().zip(rims(window)) {
                    *angle += (rim / chassis.wheel_radius).to_degrees() / WINDOW as f64;
                }
                yaw += imu(window).unwrap_or(0.0).to_degrees() / WINDOW as f64;
            }
            let wheel = |angle| WheelHeard { angle, current: Some(amps), follows: true };
            BaseHeard { wheels: angles.map(wheel), yaw: imu(window).map(|_| yaw) }
        });
        let heard = heard.collect();
        let path = vec![PathPoint { x: 0.0, y: 0.0, yaw: 0.0 }];
        Recording {
            length: Micros::from_millis(3000),
            motors: [("a", 1), ("b", 2), ("c", 3), ("d", 4)].map(wheel).into(),
            base: Some(BaseTrack { wheels: [0, 1, 2, 3], path, chassis, heard }),
            ..Recording::default()
        }
    }

    fn said(recording: &Recording) -> (bool, String) {
        let mut found = Vec::new();
        base_and_wheels(recording, recording.base.as_ref().unwrap(), &mut found);
        let [problem] = found.as_slice() else { panic!("{found:?}") };
        (crate::problems::any(&found), problem.text.clone())
    }

    #[test]
    fn a_base_is_judged_by_what_its_robot_has() {
        let forward = |_| [0.1; 4];
        // Turns the base by 0.238 rad in each window.
        let turning = |_| [-0.1, 0.1, -0.1, 0.1];
        for (run, is_problem, words) in [
            (run(forward, |_| Some(0.0), 1.0), false, "it hardly turned"),
            (run(forward, |_| None, 1.0), false, "not checked, no sensor knows"),
            (run(turning, |_| Some(0.238), 1.0), false, "its IMU says 6."),
            (run(turning, |_| Some(0.119), 1.0), true, "the wheels' radius were 0.50 times"),
            (run(forward, |_| Some(0.119), 1.0), true, "differ on how fast it turns"),
            (run(forward, |_| None, 8.0), true, "push with 40 % of their largest current"),
            (run(forward, |_| None, 8.0), true, "the direction, or the gear, of one of its wheels"),
            (run(|_| [0.1, 0.1, 0.02, 0.1], |_| None, 1.0), true, "as on no rigid base"),
        ] {
            let (found, text) = said(&run);
            assert!(found == is_problem && text.contains(words), "{text}");
        }
    }

    #[test]
    fn what_a_fault_of_a_wire_does_is_none_of_the_base_s() {
        let bad = || run(|_| [0.1; 4], |_| Some(0.119), 8.0);
        let with = |fault: &str| Recording { faults: vec![fault.parse().unwrap()], ..bad() };
        assert!(said(&bad()).0 && said(&with("cut:1@2.5s")).0 && said(&with("noise:1@1ms")).0);
        assert!(!said(&with("cut:1@1ms")).0 && !said(&with("power:1@1ms..2.9s")).0);
        assert!(said(&with("cut:2@1ms")).0, "its wheels are on bus 1");
    }

    #[test]
    fn a_runaway_is_excused_by_a_fault_of_its_own_wire_alone() {
        let mut recording = run(|_| [0.0; 4], |_| None, 0.0);
        let away = |index: usize| {
            let rpm = -20.0 * index as f64 - 10.0;
            sample(100.0, rpm, rpm, -5.0, TargetKind::Speed)
        };
        recording.motors[0].samples = (0..AWAY).map(away).collect();
        for (fault, is_told) in [
            (None, true),
            (Some("cut:1@1ms"), false),
            (Some("cut:2@1ms"), true),
            (Some("cut:L1@1ms"), true),
        ] {
            recording.faults = fault.iter().map(|fault| fault.parse().unwrap()).collect();
            let found = runaway(&recording, &recording.motors[0]);
            assert_eq!(found.is_some(), is_told, "{fault:?}");
        }
    }
}
