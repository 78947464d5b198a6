use rc10_app::{Amps, NewtonMetres};
use rc10_motor::{Request, RequestError, Response, SafeState, Target};

use crate::case::Case;
use crate::harness::Sent;
use crate::outcome::{Findings, Halt, Outcome, broken};
use crate::rig::Rig;

/// The limit's share of the effort that is asked for.
const SHARE: f32 = 0.4;

/// A limit that is lower than the effort, and the effort that is just as large.
fn lowered(target: Target) -> Option<(Request, Target)> {
    let limit = |amps: Amps| Request::CurrentLimit(Amps::new(amps.get().abs() * SHARE));
    Some(match target {
        Target::Current(amps) => (limit(amps), Target::Current(amps * SHARE)),
        Target::Brake(amps) => (limit(amps), Target::Brake(amps * SHARE)),
        Target::Handbrake(amps) => (limit(amps), Target::Handbrake(amps * SHARE)),
        Target::Torque(torque) => {
            let limit = NewtonMetres::new(torque.get().abs() * SHARE);
            (Request::TorqueLimit(limit), Target::Torque(torque * SHARE))
        }
        _ => return None,
    })
}

pub(super) fn limits_bound_efforts(case: &Case<'_>, found: &mut Findings) {
    for trial in &case.declared.trials {
        let Some((limit, least)) = lowered(trial.target) else {
            continue;
        };
        // The device may have limits of its own: what counts is what it is sent.
        let sent = |target| case.going(SafeState::Coast, |rig| sent(rig, limit, target));
        found.note(sent(trial.target).and_then(|beyond| {
            let within = sent(least)?;
            is_same(&beyond, &within, trial.target, limit)
        }));
        found.note(case.going(SafeState::Coast, |rig| gives_no_more_than_all(rig, trial.target)));
    }
}

/// Whatever it is asked for, its torque is not above the largest that it has.
fn gives_no_more_than_all(rig: &mut Rig<'_>, target: Target) -> Outcome {
    let most = match target {
        Target::Current(_) => Target::Current(Amps::new(f32::MAX)),
        Target::Torque(_) => Target::Torque(NewtonMetres::new(f32::MAX)),
        _ => return Ok(()),
    };
    let full = rig.full_torque();
    for _ in 0..100 {
        rig.tick(Some(most));
        let torque = rig.esc.state().torque;
        rig.must(torque.abs() <= 1.05 * full, || {
            format!("with {most:?}, {torque:.3} N m of {full:.3}")
        })?;
    }
    Ok(())
}

fn is_same(beyond: &[Sent], within: &[Sent], target: Target, limit: Request) -> Outcome {
    match beyond.iter().zip(within).find(|(one, other)| one != other) {
        Some((one, other)) => {
            broken(None, format!("with {limit:?}, {target:?} sends {one:?}, not {other:?}"))
        }
        None => Ok(()),
    }
}

/// What goes to a device that turns while its motor has a target beyond a limit; nothing of a motor
/// that has no such limit.
fn sent(rig: &mut Rig<'_>, limit: Request, target: Target) -> Result<Vec<Sent>, Halt> {
    match rig.bench.request(rig.motor, limit) {
        Ok(Response::Done) => (),
        Err(RequestError::Unsupported) => return Ok(Vec::new()),
        _ => return Err(Halt::Stuck),
    }
    let _ = rig.bench.take_traffic();
    rig.wait(Some(target), 100);
    let ours = rig.bench.take_traffic().into_iter().filter(|traffic| traffic.is_ours);
    Ok(ours.map(|traffic| traffic.what).collect())
}
