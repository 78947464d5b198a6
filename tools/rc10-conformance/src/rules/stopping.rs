use rc10_app::Seconds;
use rc10_motor::{ArmSwitch, DriveMode, Request, SafeState, TxBatch};
use rc10_sim::EscFault;

use crate::case::Case;
use crate::declaration::Claim;
use crate::outcome::{Findings, Halt, Outcome};
use crate::rig::Rig;

pub(super) fn silent_before_feedback(case: &Case<'_>, found: &mut Findings) {
    // The bus lets it only coast until it is heard: here nothing is between it and the wire.
    for drive in
        [DriveMode::Run, DriveMode::Hold, DriveMode::Brake, DriveMode::Coast, DriveMode::Off]
    {
        let switch = ArmSwitch::new();
        let mut bench = case.bench(&switch);
        let esc = bench.device(case.declared.ids[0]);
        esc.set_feedback(false);
        let mut motor = case.motor();
        for target in case.declared.trials.iter().map(|trial| trial.target) {
            let _ = motor.set_target(target);
            for _ in 0..200 {
                bench.tick_unwatched(&mut motor, Seconds::new(0.001), drive);
                let torque = esc.state().torque.abs();
                if torque > f64::from(case.declared.no_torque.get()) {
                    let what = format!("{torque:.3} N m in {drive:?}, told {target:?}");
                    return found.add(Some(bench.now()), what);
                }
            }
        }
    }
}

pub(super) fn off_until_armed(case: &Case<'_>, found: &mut Findings) {
    found.note(case.alone(SafeState::Hold, |rig| {
        rig.is_heard().map_err(|_| Halt::Stuck)?;
        let targets: Vec<_> = rig.declared.trials.iter().map(|trial| trial.target).collect();
        for target in targets.into_iter().chain([rig.cruise()]) {
            rig.rests(Some(target), (0, 100), "of being commanded while disarmed")?;
            rig.is_disabled("by a command while disarmed")?;
        }
        rig.rests(None, (0, 100), "after the last command while disarmed")
    }));
}

pub(super) fn disarm(case: &Case<'_>, found: &mut Findings) {
    for state in [SafeState::Coast, SafeState::Hold] {
        found.note(case.going(state, |rig| {
            rig.switch.disarm();
            rig.stops(Some(rig.cruise()), "after disarming")?;
            rig.is_disabled("after disarming")?;
            rig.watch();
            let _ = rig.switch.arm();
            rig.goes_again(rig.cruise(), "armed again")?;
            rig.was_soft("armed again")
        }));
    }
}

pub(super) fn emergency_stop(case: &Case<'_>, found: &mut Findings) {
    found.note(case.going(SafeState::Coast, |rig| {
        rig.switch.emergency_stop();
        rig.tick(Some(rig.cruise()));
        may(rig, DriveMode::Coast)?;
        rig.stops(Some(rig.cruise()), "after the emergency stop")
    }));
    // One that holds must be let go by disarming.
    found.note(case.going(SafeState::Hold, |rig| {
        rig.switch.emergency_stop();
        rig.wait(None, 300);
        may(rig, DriveMode::Hold)?;
        rig.switch.disarm();
        rig.stops(None, "after disarming during an emergency stop")
    }));
}

fn may(rig: &Rig<'_>, wanted: DriveMode) -> Outcome {
    let drive = rig.status().drive;
    rig.must(drive == wanted, || format!("it may {drive:?}, not {wanted:?}"))
}

pub(super) fn expiry(case: &Case<'_>, found: &mut Findings) {
    found.note(case.going(SafeState::Coast, |rig| {
        rig.wait(None, 51);
        may(rig, DriveMode::Coast)?;
        rig.stops(None, "after its command had expired")?;
        rig.watch();
        rig.goes_again(rig.cruise(), "commanded again")?;
        rig.was_soft("commanded again")
    }));
}

pub(super) fn lost(case: &Case<'_>, found: &mut Findings) {
    let timeout = case.motor().link_timeout();
    found.note(case.going(SafeState::Hold, |rig| {
        rig.esc.set_feedback(false);
        // A frame may have been on its way.
        rig.wait(Some(rig.cruise()), timeout + 3);
        may(rig, DriveMode::Coast)?;
        rig.stops(Some(rig.cruise()), "after its link was lost")
    }));
}

pub(super) fn coast_frames_are_fixed(case: &Case<'_>, found: &mut Findings) {
    let mut tx = TxBatch::new();
    let Some(motor) = case.can_motor() else { return };
    if motor.coast_frames(&mut tx).is_err() || tx.frames().is_empty() {
        return found.add(None, "a fresh motor has none".to_owned());
    }
    for moment in &case.life().log.moments {
        if moment.coast != tx.frames() {
            let (now, fresh) = (&moment.coast, tx.frames());
            let what = format!("in {:?} they are {now:?}, before {fresh:?}", moment.drive);
            return found.add(Some(moment.at), what);
        }
    }
}

/// State of the device when the program panics.
#[derive(Clone, Copy, Debug)]
enum Doing {
    Waiting,
    Enabling,
    Running,
    Holding,
    Faulted,
}

pub(super) fn coast_frames_stop(case: &Case<'_>, found: &mut Findings) {
    use Doing::{Enabling, Faulted, Holding, Running, Waiting};
    for doing in [Waiting, Enabling, Running, Holding, Faulted] {
        found.note(case.alone(SafeState::Hold, |rig| {
            let cruise = rig.cruise();
            if matches!(doing, Running | Holding | Faulted) {
                rig.get_going()?;
            }
            match doing {
                Waiting => rig.wait(None, 50),
                Enabling => {
                    rig.wake()?;
                    rig.wait(Some(cruise), rig.declared.enables_within / 2 + 1);
                }
                Running => (),
                Holding => rig.wait(None, 500),
                Faulted => {
                    rig.esc.inject(EscFault::OverTemperature);
                    rig.wait(Some(cruise), 50);
                    let _ = rig.bench.request(rig.motor, Request::ClearFault);
                    rig.wait(Some(cruise), 5);
                }
            }
            panics(rig, doing)
        }));
    }
}

/// No tick comes any more: only these frames.
fn panics(rig: &mut Rig<'_>, doing: Doing) -> Outcome {
    rig.bench.panic();
    for past in 1..=200 {
        rig.bench.pass();
        rig.look();
        if past == rig.declared.stops_within + 20 {
            rig.esc.set_load(0.0);
        }
        if past > rig.declared.stops_within {
            rig.is_at_rest(&format!("{past} ms after them, sent when it was {doing:?}"))?;
        }
    }
    Ok(())
}

pub(super) fn brakes(case: &Case<'_>, found: &mut Findings) {
    if let Claim::Cannot(_) = case.declared.brakes {
        return;
    }
    found.note(case.going(SafeState::Brake, |rig| {
        let before = rig.esc.state().output_rpm;
        rig.esc.set_load(rig.load() * 0.5);
        rig.wait(None, 51);
        may(rig, DriveMode::Brake)?;
        rig.wait(None, 500);
        let rpm = rig.esc.state().output_rpm;
        rig.must(rpm.abs() <= 0.5 * before, || {
            format!("driven by a load it makes {rpm:.1} rpm, {before:.1} before")
        })?;
        rig.esc.set_load(0.0);
        rig.wait(None, 1500);
        let rpm = rig.esc.state().output_rpm;
        rig.must(rpm.abs() <= 0.05 * rig.cruise_rpm(), || {
            format!("after 2 s of braking it makes {rpm:.1} rpm")
        })
    }));
}

pub(super) fn holds(case: &Case<'_>, found: &mut Findings) {
    if let Claim::Cannot(_) = case.declared.holds {
        return;
    }
    for is_backward in [false, true] {
        found.note(case.alone(SafeState::Hold, |rig| stops_ahead(rig, is_backward)));
    }
    found.note(case.going(SafeState::Hold, |rig| {
        rig.wait(None, 51);
        may(rig, DriveMode::Hold)?;
        rig.esc.set_load(0.0);
        rig.wait(None, 2000);
        let start = rig.esc.state().output_degrees;
        for load in [rig.load(), -rig.load(), 0.0] {
            rig.esc.set_load(load);
            for _ in 0..700 {
                rig.tick(None);
                let gave = rig.esc.state().output_degrees - start;
                rig.must(gave.abs() <= rig.declared.hold_gives, || {
                    format!("against {load:.2} N m it gave {gave:.1} degrees")
                })?;
            }
        }
        Ok(())
    }));
}

/// From its speed it comes to a stand ahead of where it was, not behind.
fn stops_ahead(rig: &mut Rig<'_>, is_backward: bool) -> Outcome {
    rig.get_going()?;
    rig.esc.set_load(0.0);
    let target = if is_backward { rig.declared.backward() } else { rig.cruise() };
    rig.goes_again(target, "").map_err(|_| Halt::Stuck)?;
    rig.wait(Some(target), 300);
    rig.wait(None, 51);
    may(rig, DriveMode::Hold)?;
    let start = rig.esc.state();
    rig.wait(None, 2000);
    let moved = (rig.esc.state().output_degrees - start.output_degrees) * start.output_rpm.signum();
    let rpm = start.output_rpm;
    // A device that holds by itself gets an angle that is some milliseconds old.
    rig.must(moved >= -0.25 * rig.declared.hold_gives, || {
        format!("holding from {rpm:.1} rpm, it is thrown back {:.1} degrees", -moved)
    })
}
