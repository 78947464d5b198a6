use rc10_app::Seconds;
use rc10_motor::{ArmSwitch, Link, Safety, Target};

use crate::case::Case;
use crate::outcome::{Findings, Halt, Outcome, broken, must};

const MILLISECOND: Seconds = Seconds::new(0.001);

pub(super) fn same_id_is_refused(case: &Case<'_>, found: &mut Findings) {
    let (mut motor, mut twin) = (case.motor(), case.motor());
    let switch = ArmSwitch::new();
    let mut bench = case.bench(&switch);
    if bench.attach(&mut motor, Safety::COAST).is_err() {
        return found.note(Err(Halt::Stuck));
    }
    // Two of different identifiers fit: for its identifier, then.
    if bench.attach(&mut twin, Safety::COAST).is_ok() {
        found.add(None, "the second one is taken".to_owned());
    }
}

pub(super) fn two_share_a_bus(case: &Case<'_>, found: &mut Findings) {
    found.note(share(case));
}

fn share(case: &Case<'_>) -> Outcome {
    let (mut motor, mut other) = (case.motor(), case.other_motor());
    let switch = ArmSwitch::new();
    let mut bench = case.bench(&switch);
    let escs = case.declared.ids.map(|id| bench.device(id));
    let mut motors = [bench.attach(&mut motor, Safety::COAST).map_err(|_| Halt::Stuck)?; 2];
    match bench.attach(&mut other, Safety::COAST) {
        Ok(id) => motors[1] = id,
        Err(refusal) => return broken(None, refusal),
    }
    for _ in 0..500 {
        bench.tick(MILLISECOND);
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
            let _ = bench.command(motors[runs], case.declared.onward());
            let _ = bench.command(motors[rests], Target::Coast);
            bench.tick(MILLISECOND);
            rested += 1;
            let state = escs[rests].state();
            let torque = state.torque;
            let pushes = !case.declared.drags(&state) || torque * state.output_rpm > 0.0;
            let is_over = rested > case.declared.stops_within;
            must(
                bench.now(),
                !is_over || !pushes || torque.abs() <= f64::from(case.declared.no_torque.get()),
                || format!("one runs, and the other that coasts gets {torque:.3} N m"),
            )?;
        }
        for (motor, esc) in motors.iter().zip(&escs) {
            let (told, rpm) = (bench.status(*motor).feedback.speed, esc.state().output_rpm);
            must(bench.now(), (f64::from(told.get()) - rpm).abs() <= 0.1 * cruise, || {
                format!("one makes {rpm:.1} rpm, and its feedback says {told:?}")
            })?;
        }
        let rpm = escs[runs].state().output_rpm;
        must(bench.now(), rpm >= 0.5 * cruise, || {
            format!("motor {runs} makes {rpm:.1} rpm with another on the bus")
        })?;
    }
    Ok(())
}
