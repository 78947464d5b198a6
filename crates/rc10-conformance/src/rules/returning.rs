use rc10_motor::{SafeState, Target, TargetKind};

use crate::case::{Case, Findings, Halt, Outcome};
use crate::rig::Rig;

/// A speed is approached gently anyway; a torque is a step, and shows whether the start is soft.
fn for_each_effort(
    case: &Case<'_>,
    found: &mut Findings,
    scenario: impl Fn(&mut Rig<'_>, Target) -> Outcome,
) {
    let efforts =
        [TargetKind::Torque, TargetKind::Current, TargetKind::Duty, TargetKind::CurrentShare];
    for trial in &case.declared.trials {
        if efforts.contains(&trial.target.kind()) {
            found.note(case.alone(SafeState::Coast, |rig| {
                rig.is_heard().map_err(|_| Halt::Stuck)?;
                rig.switch.arm().map_err(|_| Halt::Stuck)?;
                rig.wait(Some(trial.target), rig.declared.enables_within + 50);
                scenario(rig, trial.target)
            }));
        }
    }
}

pub(super) fn back_on_the_wire(case: &Case<'_>, found: &mut Findings) {
    for millis in [60, 400] {
        found.note(case.alone(SafeState::Coast, |rig| {
            rig.get_going()?;
            rig.esc.set_load(0.0);
            // What is wanted when it comes back is far from what it does.
            let back = rig.declared.backward();
            rig.bench.set_cut(true);
            rig.wait(Some(back), millis);
            rig.bench.set_cut(false);
            rig.watch();
            let when = format!("after a cut of {millis} ms");
            rig.goes_again(back, &when)?;
            rig.was_soft(&when)
        }));
    }
    for_each_effort(case, found, |rig, effort| {
        rig.bench.set_cut(true);
        rig.wait(Some(effort), 60);
        rig.bench.set_cut(false);
        rig.watch();
        rig.wait(Some(effort), rig.declared.enables_within + 100);
        rig.was_soft(&format!("after a cut, with {effort:?},"))
    });
}

pub(super) fn restart(case: &Case<'_>, found: &mut Findings) {
    for millis in [3, 300, 1500] {
        found.note(case.alone(SafeState::Coast, |rig| {
            rig.get_going()?;
            rig.esc.set_load(0.0);
            let cruise = rig.cruise();
            rig.esc.set_power(false);
            rig.wait(Some(cruise), millis);
            rig.esc.set_power(true);
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
    for_each_effort(case, found, |rig, effort| {
        rig.esc.set_power(false);
        rig.wait(Some(effort), 300);
        rig.esc.set_power(true);
        rig.watch();
        rig.wait(Some(effort), rig.declared.enables_within + 100);
        rig.was_soft(&format!("restarted, with {effort:?},"))
    });
}
