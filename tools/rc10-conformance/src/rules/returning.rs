use rc10_app::TotalAngle;
use rc10_motor::{SafeState, Target, TargetKind};

use crate::case::Case;
use crate::outcome::{Findings, Halt, Outcome};
use crate::rig::Rig;

/// A speed is approached gently anyway; a torque is a step and shows whether the start is soft, and
/// so does a spring, whose angle means another place to a device that was restarted.
fn for_each_effort(
    case: &Case<'_>,
    found: &mut Findings,
    scenario: impl Fn(&mut Rig<'_>, Target) -> Outcome,
) {
    use TargetKind::{Current, Duty, Impedance, Torque};
    let efforts = [Torque, Current, Duty, Impedance];
    for trial in &case.declared.trials {
        if efforts.contains(&trial.target.kind()) {
            found.note(case.alone(SafeState::Coast, |rig| {
                rig.wake()?;
                rig.wait(Some(trial.target), rig.declared.enables_within + 50);
                scenario(rig, trial.target)
            }));
        }
    }
}

pub(super) fn back_on_the_wire(case: &Case<'_>, found: &mut Findings) {
    // Longer than its link lasts.
    let short = case.motor().link_timeout().saturating_add(3).max(60);
    for millis in [short, short + 340] {
        found.note(case.going(SafeState::Coast, |rig| {
            rig.esc.set_load(0.0);
            // What is wanted when it comes back is far from what it does.
            let back = rig.declared.backward();
            rig.bench.set_cut(true);
            rig.wait(Some(back), millis);
            rig.is_lost(&format!("in a cut of {millis} ms"))?;
            rig.bench.set_cut(false);
            rig.watch();
            let when = format!("after a cut of {millis} ms");
            rig.goes_again(back, &when)?;
            rig.was_soft(&when)
        }));
    }
    for_each_effort(case, found, |rig, effort| {
        rig.bench.set_cut(true);
        rig.wait(Some(effort), short);
        rig.is_lost(&format!("in a cut, with {effort:?},"))?;
        rig.bench.set_cut(false);
        rig.watch();
        rig.wait(Some(effort), rig.declared.enables_within + 100);
        rig.was_soft(&format!("after a cut, with {effort:?},"))
    });
}

pub(super) fn restart(case: &Case<'_>, found: &mut Findings) {
    for millis in [3, 300, 1500] {
        found.note(case.going(SafeState::Coast, |rig| {
            rig.esc.set_load(0.0);
            let cruise = rig.cruise();
            rig.restart(cruise, millis);
            rig.watch();
            let when = format!("restarted after {millis} ms");
            // It turns on for a while without torque.
            rig.wait(Some(cruise), rig.declared.enables_within + 500);
            rig.goes_again(cruise, &when)?;
            rig.esc.set_load(-rig.load());
            rig.wait(Some(cruise), 300);
            rig.goes_again(cruise, &format!("{when}, under load,"))?;
            rig.was_soft(&when)
        }));
    }
    for millis in [3, 300] {
        for is_backward in [false, true] {
            found.note(case.alone(SafeState::Coast, |rig| counts_on(rig, millis, is_backward)));
        }
    }
    for_each_effort(case, found, |rig, effort| {
        rig.restart(effort, 300);
        rig.watch();
        rig.wait(Some(effort), rig.declared.enables_within + 100);
        rig.was_soft(&format!("restarted, with {effort:?},"))
    });
}

/// Restarted while it turns, it counts on: exactly, if it was away for a moment; after longer at
/// least no turns that the shaft has not made. Then it seeks angles on that count.
fn counts_on(rig: &mut Rig<'_>, millis: u32, is_backward: bool) -> Outcome {
    let target = if is_backward { rig.declared.backward() } else { rig.cruise() };
    rig.get_going()?;
    rig.esc.set_load(0.0);
    rig.goes_again(target, "").map_err(|_| Halt::Stuck)?;
    rig.wait(Some(target), 100);
    let (start, told) = (rig.esc.state().output_degrees, rig.status().feedback.total_angle);
    rig.restart(target, millis);
    rig.wait(Some(target), rig.declared.enables_within + 500);
    rig.goes_again(target, &format!("restarted after {millis} ms while it turned,"))?;
    rig.wait(Some(target), 100);
    let moved = rig.esc.state().output_degrees - start;
    let counted = f64::from(rig.status().feedback.total_angle.minus(told).degrees().get());
    let is_right = if millis < SHORT {
        (moved - counted).abs() <= 0.02 * moved.abs() + 5.0
    } else {
        (0.2..1.2).contains(&(counted / moved))
    };
    rig.must(is_right, || {
        format!("restarted after {millis} ms, it went {moved:.1} degrees and says {counted:.1}")
    })?;
    rig.must(millis < SHORT || rig.status().feedback.turn_gaps != 0, || {
        format!("restarted after {millis} ms, it does not say that it missed turns")
    })?;
    if rig.bench.supports(rig.motor).contains(TargetKind::TotalAngle) {
        seeks(rig, millis)?;
    }
    Ok(())
}

/// A device that was without power for less long, ms, is expected to have lost no turn.
const SHORT: u32 = 10;

/// A quarter of a turn is one of the shaft, too.
fn seeks(rig: &mut Rig<'_>, millis: u32) -> Outcome {
    let (start, told) = (rig.esc.state().output_degrees, rig.status().feedback.total_angle);
    let there = Target::TotalAngle(told.plus(TotalAngle::from_degrees(90)));
    rig.wait(Some(there), 2000);
    let moved = rig.esc.state().output_degrees - start;
    rig.must((moved - 90.0).abs() <= 15.0, || {
        format!("restarted after {millis} ms, it goes {moved:.1} degrees, not 90")
    })
}
