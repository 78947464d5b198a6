//! Whether a robot's own sensors agree: its wheels with one another, with its IMU and with their
//! effort; its motors with their targets; its identifiers with the frames on the bus.
//!
//! A property that no sensor can know, such as a wheel's true radius, is given as information, with
//! what would show it. Thresholds, and the shipped robots' distance from them: `docs/verdict.md`.

use rc10_emu::fault::{Fault, Kind};
use rc10_motor::{DriveMode, Link, TargetKind};

use crate::recording::excuse::{is_excused, is_on};
use crate::recording::problem::{About, Problem};
use crate::recording::sample::{MotorSample, is_angle, seconds, time_of};
use crate::recording::{MotorTrack, Recording};
use crate::robot::motor::{Device, Place};

/// Multiple of a device's rate beyond which two devices answer.
pub const TWICE: f64 = 1.5;
/// Samples for which a runaway motor moves away from its target: 200 ms.
pub const AWAY: usize = 20;

// ---- identifiers -------------------------------------------------------------------------------

/// Finds a device with another motor's identifier: one is never heard, the other answers twice.
pub(super) fn identifiers(recording: &Recording, found: &mut Vec<Problem>) {
    let silent = |on: Place| {
        let is_silent = |track: &MotorTrack| track.last.link == Link::NeverSeen;
        recording.motors.iter().filter(move |track| track.motor.on == on && is_silent(track))
    };
    for track in &recording.motors {
        let (motor, on) = (&track.motor, track.motor.on);
        let Device::Dji(rc10_motor::dji::Config { rate, .. }) = motor.device else { continue };
        let is_filled = |fault: &Fault| matches!(fault.kind, Kind::Load(_)) && is_on(fault, on);
        let due = seconds(recording.length) * f64::from(rate.hz());
        let received = f64::from(track.last.counters.received);
        if received <= TWICE * due || recording.faults.iter().any(is_filled) {
            continue;
        }
        let silent: Vec<&str> = silent(on).map(|other| other.motor.label).collect();
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
        let stranger = bus.last.received.last_unclaimed;
        if let (Some(silent), Some(key)) = (silent(Place::Bus(bus.number)).next(), stranger) {
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
            let problem = Problem::new(About::Bus(bus.number), "other-identifier", text);
            let culprits = vec![silent.motor.label];
            found.push(Problem { culprits, ..problem }.because("set to another identifier"));
        }
    }
}

// ---- one motor and its target ------------------------------------------------------------------

/// Finds motors that drive away from their targets, ever faster or further.
pub(super) fn runaways(recording: &Recording, found: &mut Vec<Problem>) {
    found.extend(recording.motors.iter().filter_map(|track| runaway(recording, track)));
}

fn runaway(recording: &Recording, track: &MotorTrack) -> Option<Problem> {
    let at = track.samples.windows(AWAY).position(is_away)?;
    let last = track.samples[at + AWAY - 1];
    let end = time_of(at + AWAY - 1);
    if is_excused(&recording.faults, track.motor.on, end) {
        return None;
    }
    let unit = if is_angle(last.kind) { "degrees" } else { "rpm" };
    let text = format!(
        "runs away: at {:.2} s it is at {:.0} {unit}, its target is {:.0}, and it drives on: its \
         feedback counts against its commands",
        seconds(end),
        last.measured,
        last.target.unwrap_or_default(),
    );
    let problem = Problem::new(About::Motor(track.motor.label), "runaway", text);
    Some(problem.in_time(time_of(at), end.since(time_of(at))))
}

fn is_away(samples: &[MotorSample]) -> bool {
    let kind = samples[0].kind;
    let is_angle = is_angle(kind);
    if !is_angle && !matches!(kind, TargetKind::Speed | TargetKind::SpeedMotion) {
        return false;
    }
    let error = |sample: &MotorSample| {
        let error = sample.target? - sample.measured;
        let goes_away = error * if is_angle { sample.rpm } else { sample.measured } < 0.0;
        // A load or the floor that drags the motor takes power; a runaway motor gives it.
        let drives = sample.drive == DriveMode::Run && sample.current * sample.rpm > 0.0;
        (sample.kind == kind && goes_away && drives).then_some(error)
    };
    let errors = samples.iter().map(error).collect::<Option<Vec<f64>>>().unwrap_or_default();
    let ([first, .., last], [.., newest]) = (errors.as_slice(), samples) else { return false };
    let target = newest.target.unwrap_or_default().abs();
    let far = if is_angle { 90.0 } else { 50.0 + 0.5 * target };
    last.abs() > far && last * first > 0.0 && errors.is_sorted_by_key(|error| error.abs())
}

/// Adds what no sensor of the robot can know of its other motors.
pub(super) fn not_checked(recording: &Recording, found: &mut Vec<Problem>) {
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
    use super::*;
    use crate::judge::base::tests::run;
    use crate::recording::sample::Cell;

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
            temperature: f32::NAN,
            supply: f32::NAN,
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
