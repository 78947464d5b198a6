use rc10_app::{Degrees, Rpm, TotalAngle};
use rc10_motor::{
    Impedance, Motion, Request, RequestError, Response, SafeState, Safety, Target, TargetKind,
};

use super::impedance::spring_of;
use crate::case::Case;
use crate::declaration::Claim;
use crate::outcome::{Findings, Halt, Outcome};
use crate::rig::Rig;

/// State of the motor when its zero is set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    Turning,
    Seeking,
    Springing,
    Moving,
    Holding,
    Braking,
}

/// How far the shaft may be from where it would be without the new zero, degrees: devices round.
const MOVES: f64 = 3.0;
/// How far from zero the shaft has to be for a new zero to be another one, degrees.
const FAR: f32 = 45.0;
/// How far the shaft is sent from where it is, degrees.
const AHEAD: i32 = 20;

fn doings(case: &Case<'_>) -> Vec<Doing> {
    let supports = case.motor().supports();
    let doings = [
        (true, Doing::Turning),
        (supports.contains(TargetKind::TotalAngle), Doing::Seeking),
        (supports.contains(TargetKind::Impedance), Doing::Springing),
        (supports.contains(TargetKind::Motion), Doing::Moving),
        (case.declared.holds == Claim::Does, Doing::Holding),
        (case.declared.brakes == Claim::Does, Doing::Braking),
    ];
    doings.into_iter().filter_map(|(can, doing)| can.then_some(doing)).collect()
}

fn scenario(case: &Case<'_>, doing: Doing, run: impl FnOnce(&mut Rig<'_>) -> Outcome) -> Outcome {
    let safety = match doing {
        Doing::Holding => Safety::HOLD,
        Doing::Braking => Safety::BRAKE,
        _ => Safety { command_expiry: Safety::LONGEST_EXPIRY, ..Safety::new(SafeState::Coast) },
    };
    case.with(&mut case.motor(), safety, run)
}

/// Brings the motor to do it, far from zero; what was commanded last.
fn start(rig: &mut Rig<'_>, doing: Doing) -> Result<Target, Halt> {
    rig.get_going()?;
    rig.esc.set_load(0.0);
    for _ in 0..2000 {
        if rig.status().feedback.total_angle.degrees().get() > FAR {
            break;
        }
        rig.tick(Some(rig.cruise()));
    }
    let target = ahead_of(rig.status().feedback.total_angle, rig, doing)?;
    match doing {
        Doing::Turning => rig.wait(Some(target), 50),
        Doing::Seeking | Doing::Springing | Doing::Moving => rig.wait(Some(target), 1500),
        // Until it has come to a stand.
        Doing::Holding => rig.wait(None, 1000),
        Doing::Braking => rig.wait(None, 150),
    }
    Ok(target)
}

/// The target of what it does, so far ahead of an angle if it has one.
fn ahead_of(angle: TotalAngle, rig: &Rig<'_>, doing: Doing) -> Result<Target, Halt> {
    let ahead = angle.plus(TotalAngle::from_degrees(AHEAD));
    Ok(match doing {
        Doing::Turning | Doing::Holding | Doing::Braking => rig.cruise(),
        Doing::Seeking => Target::TotalAngle(ahead),
        Doing::Moving => Target::Motion(Motion { angle: Some(ahead), ..Motion::default() }),
        Doing::Springing => {
            let spring = spring_of(rig.declared).ok_or(Halt::Stuck)?;
            Target::Impedance(Impedance { angle: ahead.degrees(), ..spring })
        }
    })
}

/// Sets the zero of a driven motor, on purpose.
pub(super) fn set_zero(rig: &mut Rig<'_>) -> Outcome {
    let answer = rig.bench.request(rig.motor, Request::SetZeroOfDriven);
    rig.must(answer == Ok(Response::Done), || format!("SetZeroOfDriven: {answer:?}"))
}

pub(super) fn zero_moves_nothing(case: &Case<'_>, found: &mut Findings) {
    for doing in doings(case) {
        let mut undisturbed = Vec::new();
        let watched = scenario(case, doing, |rig| {
            start(rig, doing)?;
            for _ in 0..500 {
                rig.tick(None);
                undisturbed.push(rig.esc.state().output_degrees);
            }
            Ok(())
        });
        if watched.is_err() {
            found.note(watched);
            continue;
        }
        found.note(scenario(case, doing, |rig| {
            let target = start(rig, doing)?;
            let zero = rig.status().feedback.total_angle;
            set_zero(rig)?;
            for without in &undisturbed {
                rig.tick(None);
                let moved = rig.esc.state().output_degrees - without;
                rig.must(moved.abs() <= MOVES, || {
                    format!("{doing:?}, a new zero moves it {moved:.1} degrees")
                })?;
            }
            if !matches!(doing, Doing::Seeking | Doing::Springing | Doing::Moving) {
                return Ok(());
            }
            // On the new scale the same number is as far away as the zero was moved.
            let start = rig.esc.state().output_degrees;
            rig.wait(Some(target), 2000);
            let moved = rig.esc.state().output_degrees - start;
            let wanted = f64::from(zero.degrees().get());
            rig.must((moved - wanted).abs() <= 0.2 * wanted.abs(), || {
                format!("{doing:?}, the same number moves it {moved:.1}, not {wanted:.1}")
            })?;
            // Coasting is not taken for what it does already.
            set_zero(rig)?;
            rig.wait(Some(Target::Coast), rig.declared.stops_within);
            rig.is_at_rest("told to coast after a new zero")
        }));
    }
}

fn is_refused(rig: &mut Rig<'_>) -> Outcome {
    let before = rig.status().feedback.total_angle;
    let answer = rig.bench.request(rig.motor, Request::SetZero);
    rig.wait(None, 1);
    let moved = rig.status().feedback.total_angle.minus(before).degrees().get();
    rig.must(answer == Err(RequestError::WhileDriven) && moved.abs() < FAR / 2.0, || {
        format!("while it is driven: {answer:?}, and {moved:.1} degrees further")
    })
}

/// Driven, it has no new zero unless a task means it; and then no number given before is one of the new
/// scale.
pub(super) fn zero_while_driven(case: &Case<'_>, found: &mut Findings) {
    for doing in doings(case) {
        found.note(scenario(case, doing, |rig| {
            start(rig, doing)?;
            is_refused(rig)?;
            let stands = rig.esc.state().output_degrees;
            set_zero(rig)?;
            if !matches!(doing, Doing::Seeking | Doing::Springing | Doing::Moving) {
                return Ok(());
            }
            // As long as the last command holds, or nearly.
            rig.wait(None, 900);
            let moved = rig.esc.state().output_degrees - stands;
            rig.must(moved.abs() < f64::from(FAR) / 2.0, || {
                format!("{doing:?}, a number of before moves it {moved:.1} degrees")
            })
        }));
    }
    found.note(case.going(SafeState::Coast, |rig| {
        rig.switch.disarm();
        rig.esc.set_load(0.0);
        rig.wait(None, 2000);
        if rig.bench.request(rig.motor, Request::Jog(Rpm::new(5.0))) != Ok(Response::Done) {
            return Ok(());
        }
        rig.wait(None, 5);
        is_refused(rig)
    }));
}

/// The angle in a target, degrees.
fn angle_of(target: Target) -> Option<Degrees> {
    match target {
        Target::TotalAngle(angle) | Target::Motion(Motion { angle: Some(angle), .. }) => {
            Some(angle.degrees())
        }
        Target::Impedance(impedance) => Some(impedance.angle),
        _ => None,
    }
}

pub(super) fn target_is_on_the_new_scale(case: &Case<'_>, found: &mut Findings) {
    for doing in doings(case) {
        if !matches!(doing, Doing::Seeking | Doing::Springing | Doing::Moving) {
            continue;
        }
        found.note(scenario(case, doing, |rig| {
            let near = angle_of(start(rig, doing)?).and_then(TotalAngle::try_from_degrees);
            // The same, but on its way.
            let target = ahead_of(near.ok_or(Halt::Stuck)?, rig, doing)?;
            rig.wait(Some(target), 3);
            let zero = rig.status().feedback.total_angle.degrees();
            set_zero(rig)?;
            rig.wait(None, 3);
            let told = rig.status().target;
            let wanted = angle_of(target).map_or(0.0, |angle| angle.get() - zero.get());
            let is_right = told.kind() == target.kind()
                && angle_of(told).is_some_and(|angle| (angle.get() - wanted).abs() < 1.0);
            rig.must(is_right, || format!("it has {told:?}, and goes on to {wanted:.1} degrees"))
        }));
    }
}
