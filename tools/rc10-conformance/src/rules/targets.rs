use rc10_app::{Degrees, Rpm, Seconds, TotalAngle};
use rc10_motor::{Condition, DriveMode, Motion, SafeState, Target, TargetError, TargetKind, Tick};

use super::declared::every_kind;
use crate::case::Case;
use crate::declaration::Trial;
use crate::outcome::{Findings, Halt, Outcome, broken};
use crate::recorder::not_finite;
use crate::rig::Rig;

pub(super) fn supports_is_constant(case: &Case<'_>, found: &mut Findings) {
    let fresh = case.motor().supports();
    if !fresh.contains(TargetKind::Coast) {
        found.add(None, "it cannot be told to coast".to_owned());
    }
    if let Some((at, drive)) = case.life().other_targets {
        found.add(Some(at), format!("in {drive:?} it takes other targets than a fresh motor"));
    }
}

pub(super) fn refuses_targets(case: &Case<'_>, found: &mut Findings) {
    let supports = case.motor().supports();
    for mut motor in [case.motor(), case.used_motor()] {
        let mut old = Target::Coast;
        if motor.set_target(old).is_err() {
            found.add(None, "coasting is refused".to_owned());
        }
        for trial in &case.declared.trials {
            match motor.set_target(trial.target) {
                Ok(()) if motor.target() == trial.target => old = trial.target,
                answer => {
                    let now = motor.target();
                    found.add(None, format!("{:?}: {answer:?}, it has {now:?}", trial.target));
                    old = now;
                }
            }
        }
        let numbers = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        for target in [1.0].into_iter().chain(numbers).flat_map(every_kind) {
            let wanted = match supports.accepts(&target) {
                Ok(()) => continue,
                Err(error) => error,
            };
            let refused = motor.set_target(target);
            let right = match wanted {
                // What cannot be done need not be looked at closer.
                TargetError::Unsupported(_) => refused == Err(wanted),
                _ => matches!(refused, Err(TargetError::NotFinite(_) | TargetError::OutOfRange(_))),
            };
            if !right {
                found.add(None, format!("{target:?}: {refused:?}, not {wanted:?}"));
            }
            if motor.target() != old {
                found.add(None, format!("{target:?} was refused and took the place of {old:?}"));
                old = motor.target();
            }
        }
    }
}

pub(super) fn gets_going(case: &Case<'_>, found: &mut Findings) {
    found.note(case.alone(SafeState::Coast, |rig| {
        let cruise = rig.cruise();
        rig.is_heard()?;
        rig.switch.arm().map_err(|_| Halt::Stuck)?;
        rig.wait(Some(cruise), rig.declared.enables_within);
        let (condition, after) = (rig.status().condition, rig.declared.enables_within);
        rig.must(condition != Condition::Starting, || {
            format!("it is still starting after {after} ms")
        })?;
        rig.goes_again(cruise, "armed and commanded")?;
        rig.esc.set_load(-rig.load());
        rig.wait(Some(cruise), 100);
        let condition = rig.status().condition;
        rig.must(condition == Condition::Ready, || {
            format!("turning, it says that it is {condition:?}")
        })?;
        let torque = rig.esc.state().torque;
        rig.must(torque > 0.5 * rig.load(), || {
            format!("{torque:.3} N m do not carry the load of {}", rig.load())
        })
    }));
}

pub(super) fn follows(case: &Case<'_>, found: &mut Findings) {
    let supports = case.motor().supports();
    let trials = case.declared.trials.iter().copied();
    // The same as a motion, at rest or at a steady speed, where it takes one.
    let as_motions = trials.clone().filter_map(|trial| {
        let motion = match trial.target {
            Target::Speed(speed) => Motion { speed, ..Motion::default() },
            Target::TotalAngle(angle) => Motion { angle: Some(angle), ..Motion::default() },
            _ => return None,
        };
        let target = Target::Motion(motion);
        supports.contains(target.kind()).then_some(Trial { target, ..trial })
    });
    for trial in trials.chain(as_motions) {
        found.note(case.alone(SafeState::Coast, |rig| reaches(rig, &trial)));
    }
}

/// A motion that goes on between two commands, which come every 10 ms, is followed with no more of a
/// lag than its loops make of nothing: it is not a stair of angles that are sought.
pub(super) fn follows_motions(case: &Case<'_>, found: &mut Findings) {
    if !case.motor().supports().contains(TargetKind::Motion) {
        return;
    }
    found.note(case.alone(SafeState::Coast, |rig| {
        rig.wake()?;
        let speed = Rpm::new(0.5 * rig.declared.cruise.get());
        let here = rig.status().feedback.total_angle;
        let gone = |ticks: u32| {
            let degrees = speed.get() * 6.0e-3 * ticks as f32;
            here.plus(TotalAngle::try_from_degrees(Degrees::new(degrees)).unwrap_or_default())
        };
        let motion = |angle| Target::Motion(Motion { angle: Some(angle), speed, ..<_>::default() });
        let settle = rig.declared.enables_within + 2000;
        let mut fastest = 0.0_f64;
        let mut slowest = f64::INFINITY;
        for tick in 0..settle + 500 {
            let target = tick.is_multiple_of(10).then(|| motion(gone(tick)));
            rig.tick(target);
            if tick >= settle {
                let rpm = rig.esc.state().output_rpm;
                (fastest, slowest) = (fastest.max(rpm), slowest.min(rpm));
            }
        }
        let wanted = f64::from(speed.get());
        rig.must((slowest - wanted).abs().max((fastest - wanted).abs()) <= 0.1 * wanted, || {
            format!("a motion at {wanted:.1} rpm turns it at {slowest:.1} to {fastest:.1}")
        })?;
        let off = rig.status().feedback.total_angle.minus(gone(settle + 499)).degrees().get();
        // As far as it turns in 20 ms.
        rig.must(f64::from(off.abs()) <= wanted * 0.12 + 1.0, || {
            format!("it is {off:.1} degrees off a motion at {wanted:.1} rpm")
        })?;
        Ok(())
    }));
}

/// Ticks for which a target has to be kept.
const KEPT: u32 = 10;

fn reaches(rig: &mut Rig<'_>, trial: &Trial) -> Outcome {
    let slows = matches!(trial.target.kind(), TargetKind::Brake | TargetKind::Handbrake);
    if slows {
        rig.get_going()?;
        rig.esc.set_load(0.0);
    } else {
        rig.wake()?;
    }
    let (mut kept, mut nearest, mut effort) = (0, f64::INFINITY, None);
    for _ in 0..rig.declared.enables_within + trial.within {
        rig.tick(Some(trial.target));
        let off = off_by(rig, trial);
        let is_near = off <= trial.tolerance;
        kept = if is_near { kept + 1 } else { 0 };
        if off < nearest {
            (nearest, effort) = (off, effort_of(rig, trial.target));
        }
        if kept == KEPT {
            return Ok(());
        }
    }
    let Trial { target, tolerance, within } = trial;
    let target = words(*target);
    let what = format!("not within {tolerance} for {KEPT} ms on end, in {within} ms");
    match effort {
        // What the loops do with it does not come into it: the scale is wrong.
        Some((is, should, unit)) if is.abs() > 0.01 * should.abs() => {
            let times = times(is, should);
            Err(Halt::Wrong(rig.now(), format!("{target}: {is:.3} {unit} at best{times}; {what}")))
        }
        _ => broken(rig.now(), format!("{target}: {what}; {nearest:.3} off at best")),
    }
}

/// The effort that there is, the one that was asked for, and the unit of both.
fn effort_of(rig: &Rig<'_>, target: Target) -> Option<(f64, f64, &'static str)> {
    let state = rig.esc.state();
    match target {
        Target::Current(amps) => Some((state.current, amps.get().into(), "A")),
        Target::Torque(torque) => Some((state.torque, torque.get().into(), "N m")),
        _ => None,
    }
}

/// A target for people.
fn words(target: Target) -> String {
    match target {
        Target::Speed(rpm) => format!("speed {} rpm", rpm.get()),
        Target::Current(amps) => format!("current {} A", amps.get()),
        Target::Torque(torque) => format!("torque {} N m", torque.get()),
        Target::Angle(degrees) => format!("angle {} degrees", degrees.get()),
        Target::TotalAngle(angle) => format!("total angle {} degrees", angle.degrees().get()),
        other => format!("{other:?}"),
    }
}

/// How far the motor is from its target: at most the tolerance when it is reached.
fn off_by(rig: &Rig<'_>, trial: &Trial) -> f64 {
    let state = rig.esc.state();
    let feedback = rig.status().feedback;
    let way = |wanted: TotalAngle| {
        let way = feedback.total_angle.minus(wanted).microdegrees();
        f64::from(i32::try_from(way / 1000).unwrap_or(i32::MAX)).abs() * 1e-3
    };
    // Here the tolerance is what the speed must not be below.
    let turns = |number: f32| 2.0 * trial.tolerance - state.output_rpm * f64::from(number.signum());
    match trial.target {
        Target::Speed(rpm) | Target::Motion(Motion { angle: None, speed: rpm, .. }) => {
            (state.output_rpm - f64::from(rpm.get())).abs()
        }
        Target::Current(amps) => (state.current - f64::from(amps.get())).abs(),
        Target::Torque(torque) => (state.torque - f64::from(torque.get())).abs(),
        Target::Angle(degrees) => {
            let off = f64::from(feedback.angle.get() - degrees.get()).rem_euclid(360.0);
            off.min(360.0 - off)
        }
        Target::TotalAngle(angle) | Target::Motion(Motion { angle: Some(angle), .. }) => way(angle),
        Target::Impedance(impedance) => {
            TotalAngle::try_from_degrees(impedance.angle).map_or(f64::INFINITY, way)
        }
        Target::Duty(share) => turns(share),
        Target::Coast => state.torque.abs(),
        _ => state.output_rpm.abs(),
    }
}

pub(super) fn feedback_is_true(case: &Case<'_>, found: &mut Findings) {
    let driven = case.going(SafeState::Coast, |rig| {
        rig.wait(Some(rig.cruise()), 300);
        tells_the_truth(case, rig, Some(rig.cruise()), "")
    });
    // Wrong feedback is a reason not to get going.
    found.note(match driven {
        Err(Halt::Stuck) => case.alone(SafeState::Coast, |rig| {
            rig.is_heard().map_err(|_| Halt::Stuck)?;
            rig.turn_by_hand()?;
            tells_the_truth(case, rig, None, "turned by hand ")
        }),
        driven => driven,
    });
}

/// For half a second it says what the shaft does.
fn tells_the_truth(
    case: &Case<'_>,
    rig: &mut Rig<'_>,
    target: Option<Target>,
    how: &str,
) -> Outcome {
    let wrong = |rig: &Rig<'_>, what| Err(Halt::Wrong(rig.now(), what));
    let (start, told_start) = (rig.esc.state(), rig.status().feedback);
    for _ in 0..500 {
        rig.tick(target);
        let angle = rig.status().feedback.angle.get();
        if !(0.0..360.0).contains(&angle) {
            return wrong(rig, format!("{how}its angle is {angle} degrees"));
        }
    }
    let (end, told) = (rig.esc.state(), rig.status().feedback);
    let (rpm, told_rpm) = (end.output_rpm, f64::from(told.speed.get()));
    if (rpm - told_rpm).abs() > 0.05 * rig.cruise_rpm() {
        let times = times(told_rpm, rpm);
        return wrong(rig, format!("{how}it says {told_rpm:.1} rpm, and makes {rpm:.1}{times}"));
    }
    let moved = end.output_degrees - start.output_degrees;
    let told_moved = told.total_angle.minus(told_start.total_angle).degrees();
    let told_moved = f64::from(told_moved.get());
    // At both ends the feedback is some milliseconds old: 6 degrees a second for each rpm.
    let period = Seconds::from_micros(case.motor().report_period().get());
    let period_ms = f64::from(period.get()) * 1000.0 + 2.0;
    let age = 2.0 * period_ms * 0.006 * rig.cruise_rpm();
    if (moved - told_moved).abs() <= 0.01 * moved.abs() + age {
        return Ok(());
    }
    let times = times(told_moved, moved);
    wrong(rig, format!("{how}it says {told_moved:.1} degrees, and went {moved:.1}{times}"))
}

/// What a wrong unit, byte, gear or sign makes of a number: one of these, its inverse, or negative.
const SLIPS: [f64; 10] = [1.0, 2.0, 6.0, 9.549, 10.0, 57.296, 60.0, 100.0, 256.0, 1000.0];

/// ": 0.100 times that", if it is so by a usual slip.
fn times(is: f64, should: f64) -> String {
    let times = is / should;
    let is_slip = |slip: &f64| {
        [times.abs() / slip, times.abs() * slip].iter().any(|rest| (rest - 1.0).abs() < 0.03)
    };
    if SLIPS.iter().any(is_slip) { format!(": {times:.3} times that") } else { String::new() }
}

/// Steps that no clock should take, s.
const STRANGE: [f32; 7] = [0.0, -0.0, -1.0, 3600.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

pub(super) fn strange_steps(case: &Case<'_>, found: &mut Findings) {
    for dt in STRANGE.map(Seconds::new) {
        let mut motor = case.used_motor();
        for drive in
            [DriveMode::Run, DriveMode::Hold, DriveMode::Brake, DriveMode::Coast, DriveMode::Off]
        {
            motor.update(&Tick { dt, ..Tick::new(drive) });
            motor.pack();
            if let Some(name) = not_finite(&motor.feedback()) {
                found.add(None, format!("after {dt:?} its {name} is not finite"));
            }
        }
    }
    found.note(case.going(SafeState::Coast, |rig| {
        let cruise = rig.cruise();
        rig.wait(Some(cruise), 300);
        rig.watch();
        for dt in STRANGE.map(Seconds::new) {
            for is_strange in [true, false, false, false, false].repeat(8) {
                let _ = rig.bench.command(rig.motor, cruise);
                rig.bench.tick(if is_strange { dt } else { Seconds::new(0.001) });
                rig.look();
            }
            let rpm = rig.esc.state().output_rpm;
            rig.must(rig.goes(cruise), || format!("{dt:?} takes it from its speed to {rpm:.1}"))?;
        }
        rig.was_soft("after strange steps")
    }));
}

pub(super) fn deterministic(case: &Case<'_>, found: &mut Findings) {
    let trace = || case.going(SafeState::Coast, |rig| Ok(rig.bench.take_traffic()));
    match (trace(), trace()) {
        (Ok(once), Ok(twice)) => {
            let mut both = once.iter().zip(&twice);
            if let Some((one, other)) = both.find(|(one, other)| one != other) {
                let (sent, other) = (&one.what, &other.what);
                let what =
                    format!("{sent:?} was on the wire, and {other:?} when the same happened again");
                found.add(Some(one.at), what);
            } else if once.len() != twice.len() {
                found.add(None, "the same run again has more or less traffic".to_owned());
            }
        }
        _ => found.note(Err(Halt::Stuck)),
    }
}
