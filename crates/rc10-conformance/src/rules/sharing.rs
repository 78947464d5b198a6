use rc10_motor::{ArmSwitch, AttachError, Link, Safety, Target};

use crate::Bench;
use crate::case::{Case, Findings, Halt, Outcome, broken};
use crate::declaration::Claim;

pub(super) fn same_id_is_refused(case: &Case<'_>, found: &mut Findings) {
    let (mut motor, mut twin) = (case.motor(), case.motor());
    let switch = ArmSwitch::new();
    let mut bench = Bench::new(1, &switch);
    if bench.attach(&mut *motor, Safety::COAST).is_err() {
        return found.note(Err(Halt::Stuck));
    }
    let second = bench.attach(&mut *twin, Safety::COAST);
    if !matches!(second, Err(AttachError::Clash { .. })) {
        found.add(None, format!("the second one: {second:?}"));
    }
}

pub(super) fn two_share_a_bus(case: &Case<'_>, found: &mut Findings) {
    found.note(share(case));
}

fn share(case: &Case<'_>) -> Outcome {
    let (mut motor, mut other) = (case.motor(), case.other_motor());
    let switch = ArmSwitch::new();
    let mut bench = Bench::new(1, &switch);
    let escs = case.declared.ids.map(|id| case.device(&bench.wire, id));
    let mut motors = [bench.attach(&mut *motor, Safety::COAST).map_err(|_| Halt::Stuck)?; 2];
    match bench.attach(&mut *other, Safety::COAST) {
        Ok(id) => motors[1] = id,
        Err(error) => return broken(None, error.to_string()),
    }
    for _ in 0..500 {
        bench.wait(1);
        if motors.iter().all(|motor| bench.status(*motor).link == Link::Online) {
            break;
        }
    }
    switch.arm().map_err(|_| Halt::Stuck)?;
    let cruise = f64::from(case.declared.cruise.get());
    for (runs, rests) in [(0, 1), (1, 0)] {
        let mut rested = 0;
        // The one that ran before has to come to a stand first.
        for _ in 0..case.declared.enables_within + 3000 {
            let now = bench.world.now();
            let _ = bench.bus.command(motors[runs], case.declared.onward(), now);
            let _ = bench.bus.command(motors[rests], Target::Coast, now);
            bench.tick();
            rested += 1;
            let state = escs[rests].state();
            let torque = state.torque;
            let drags = case.declared.coasts_freely != Claim::Does && state.shorted;
            let pushes = !drags || torque * state.output_rpm > 0.0;
            let is_over = rested > case.declared.stops_within;
            if is_over && pushes && torque.abs() > f64::from(case.declared.no_torque.get()) {
                let what = format!("one runs, and the other that coasts gets {torque:.3} N m");
                return broken(bench.world.now(), what);
            }
        }
        for (motor, esc) in motors.iter().zip(&escs) {
            let (told, rpm) = (bench.status(*motor).feedback.speed, esc.state().output_rpm);
            if (f64::from(told.get()) - rpm).abs() > 0.1 * cruise {
                let what = format!("one makes {rpm:.1} rpm, and its feedback says {told:?}");
                return broken(bench.world.now(), what);
            }
        }
        let rpm = escs[runs].state().output_rpm;
        if rpm < 0.5 * cruise {
            let what = format!("motor {runs} makes {rpm:.1} rpm with another on the bus");
            return broken(bench.world.now(), what);
        }
    }
    Ok(())
}
