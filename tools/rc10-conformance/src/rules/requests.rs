use rc10_app::{Amps, NewtonMetres, TotalAngle};
use rc10_motor::{
    Feedback, Gains, Request, RequestError, Response, SafeState, Safety, Target, TargetKind,
};

use crate::case::Case;
use crate::outcome::{Findings, Halt, Outcome, broken};
use crate::rig::Rig;

/// How far from zero an angle just set to zero may be, degrees.
const NEARLY_ZERO: f32 = 2.0;

fn is_zero(feedback: &Feedback) -> bool {
    let angle = feedback.angle.get();
    angle.min(360.0 - angle) <= NEARLY_ZERO
        && feedback.total_angle.degrees().get().abs() <= NEARLY_ZERO
}

pub(super) fn set_zero(case: &Case<'_>, found: &mut Findings) {
    let early = case.motor().request(Request::SetZero);
    if early != Err(RequestError::NoFeedback) {
        found.add(None, format!("before any feedback: {early:?}, not NoFeedback"));
    }
    found.note(case.going(SafeState::Coast, |rig| {
        rig.esc.set_load(0.0);
        rig.wait(None, 50);
        // However long it turns on: it is stopped.
        rig.switch.disarm();
        let _ = rig.until(None, 20_000, |rig| rig.esc.state().output_rpm.abs() < 0.01);
        rig.wait(None, 50);
        let answer = rig.bench.request(rig.motor, Request::SetZero);
        rig.must(answer == Ok(Response::Done), || format!("SetZero: {answer:?}"))?;
        zero_moves_nothing(rig, 0.5)
    }));
    if case.motor().supports().contains(TargetKind::TotalAngle) {
        let patient = Safety { command_expiry: Safety::LONGEST_EXPIRY, ..Safety::COAST };
        found.note(case.with(&mut case.motor(), patient, seeking));
    }
}

/// An angle that is sought stays where it is.
fn seeking(rig: &mut Rig<'_>) -> Outcome {
    rig.get_going()?;
    rig.esc.set_load(0.0);
    let there = rig.status().feedback.total_angle.plus(TotalAngle::from_degrees(90));
    for _ in 0..4000 {
        rig.tick(Some(Target::TotalAngle(there)));
    }
    let off = rig.status().feedback.total_angle.minus(there).degrees().get();
    if off.abs() > 10.0 {
        return Err(Halt::Stuck);
    }
    super::zero::set_zero(rig)?;
    zero_moves_nothing(rig, 5.0)
}

/// After a new zero.
fn zero_moves_nothing(rig: &mut Rig<'_>, most: f64) -> Outcome {
    let start = rig.esc.state().output_degrees;
    for _ in 0..500 {
        rig.tick(None);
        let feedback = rig.status().feedback;
        let moved = rig.esc.state().output_degrees - start;
        rig.must(moved.abs() <= most, || format!("it moves {moved:.1} degrees"))?;
        let (angle, total) = (feedback.angle, feedback.total_angle.degrees());
        rig.must(is_zero(&feedback), || format!("angle {angle:?}, total angle {total:?}"))?;
    }
    Ok(())
}

pub(super) fn requests_are_checked(case: &Case<'_>, found: &mut Findings) {
    let gains = |kp| Gains { kp, ki: 0.0, kd: 0.0 };
    found.note(case.alone(SafeState::Coast, |rig| {
        rig.is_heard().map_err(|_| Halt::Stuck)?;
        for bad in [f32::NAN, -1.0] {
            for request in [
                Request::CurrentLimit(Amps::new(bad)),
                Request::TorqueLimit(NewtonMetres::new(bad)),
                Request::SpeedGains(gains(bad)),
                Request::AngleGains(gains(bad)),
            ] {
                let answer = rig.bench.request(rig.motor, request);
                let right =
                    matches!(answer, Err(RequestError::Config(_) | RequestError::Unsupported));
                rig.must(right, || format!("{request:?}: {answer:?}"))?;
            }
        }
        Ok(())
    }));
}

pub(super) fn set_up_while_disarmed(case: &Case<'_>, found: &mut Findings) {
    for request in [Request::StoreZero, Request::WriteRegister(u16::MAX, 0), Request::SaveRegisters]
    {
        found.note(case.going(SafeState::Coast, |rig| {
            let answer = rig.bench.request(rig.motor, request);
            match answer {
                Err(RequestError::NotWhileArmed | RequestError::Unsupported) => Ok(()),
                // That there is no such register is a reason as well.
                Err(RequestError::Config(_)) => Ok(()),
                _ => broken(rig.now(), format!("{request:?} while it runs: {answer:?}")),
            }
        }));
    }
}

pub(super) fn pending_is_answered(case: &Case<'_>, found: &mut Findings) {
    let requests =
        [Request::ClearFault, Request::StoreZero, Request::ReadRegister(0), Request::SaveRegisters];
    for request in requests {
        for is_silent in [false, true] {
            found.note(case.alone(SafeState::Coast, |rig| {
                rig.is_heard().map_err(|_| Halt::Stuck)?;
                // What cannot be cleared without a fault is asked with one.
                if request == Request::ClearFault {
                    rig.esc.inject(rc10_sim::EscFault::OverTemperature);
                    rig.wait(None, 100);
                }
                rig.bench.set_cut(is_silent);
                rig.wait(None, 1);
                is_answered(rig, request, is_silent)
            }));
        }
    }
}

fn is_answered(rig: &mut Rig<'_>, request: Request, is_silent: bool) -> Outcome {
    if rig.bench.request(rig.motor, request) != Ok(Response::Pending) {
        return Ok(());
    }
    let second = rig.bench.request(rig.motor, request);
    rig.must(second == Err(RequestError::Busy), || {
        format!("{request:?} is pending; the same again: {second:?}")
    })?;
    match rig.response() {
        None => return broken(rig.now(), format!("{request:?} is pending for ever")),
        Some(Err(RequestError::Timeout)) => (),
        Some(answer) if is_silent => {
            return broken(rig.now(), format!("{request:?}, with a cut wire: {answer:?}"));
        }
        Some(_) => (),
    }
    rig.tick(None);
    match rig.bench.response(rig.motor) {
        None => Ok(()),
        Some(answer) => broken(rig.now(), format!("{request:?} is answered again: {answer:?}")),
    }
}

pub(super) fn clear_fault_moves_nothing(case: &Case<'_>, found: &mut Findings) {
    let clear = |rig: &mut Rig<'_>| match rig.ask(Request::ClearFault) {
        Ok(_) | Err(RequestError::Unsupported) => Ok(()),
        Err(error) => broken(rig.now(), format!("ClearFault without a fault: {error}")),
    };
    found.note(case.alone(SafeState::Coast, |rig| {
        rig.is_heard().map_err(|_| Halt::Stuck)?;
        clear(rig)?;
        rig.rests(Some(rig.cruise()), (0, 200), "after ClearFault while disarmed")
    }));
    found.note(case.going(SafeState::Coast, |rig| {
        rig.watch();
        clear(rig)?;
        rig.goes_again(rig.cruise(), "after ClearFault")?;
        rig.was_soft("after ClearFault")
    }));
}
