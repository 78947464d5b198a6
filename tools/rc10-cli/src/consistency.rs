//! Whether what a robot's own sensors say fits together: its wheels with one another, with its IMU
//! and with what they push; its motors with their targets; its identifiers with the frames on the bus.
//!
//! A property that no sensor can know, a wheel's true radius for example, is said as information,
//! with what would show it. The thresholds, and how far the shipped robots are from them:
//! `docs/verdict.md`.

mod base;

use rc10_emu::fault::{Fault, Kind};
use rc10_motor::{DriveMode, Link, TargetKind};

use crate::motor::{Device, Place};
use crate::problems::{About, Problem, is_excused, is_on, seconds, time_of};
use crate::recording::{MotorSample, MotorTrack, Recording};

/// Samples of a window: 100 ms.
pub const WINDOW: usize = 10;
/// The base's yaw by its IMU and by its wheels differ if they do so by more than this in a window,
/// rad: 0.2 rad/s ..
pub const YAW: f64 = 0.02;
/// .. and by this share of the larger.
pub const YAW_SHARE: f64 = 0.1;
/// A wheel's rim goes at a steady speed if its way differs by less than this from the windows
/// before and after, m: 0.4 m/s².
pub const STEADY: f64 = 0.004;
/// Wheels roll if their rims go further than this in a window on average, m: 0.1 m/s.
pub const ROLLING: f64 = 0.01;
/// Wheels that roll at a steady speed and push with more than this share of their largest current
/// push against one another, or against something else.
pub const PUSH: f64 = 0.2;
/// Wheels on a rigid base fit one another if they do not slip further than this in a window, m: 0.1 m/s.
pub const SLIP: f64 = 0.01;
/// A window in which a wheel is steered by more than this, degrees, is not judged.
pub const STEERED: f64 = 5.0;
/// Windows that make a problem ..
pub const WINDOWS: usize = 3;
/// .. and those in which wheels push at a steady speed.
pub const PUSHING: usize = 2;
/// A base that turned by less than this, rad, tells nothing of its measures.
pub const TURNED: f64 = 1.0;
/// Over a whole run IMU and wheels may differ by this share of how far the base turned.
pub const TURNED_SHARE: f64 = 0.05;
/// A device that answers more often than this many times its rate is two.
pub const TWICE: f64 = 1.5;
/// Samples for which a motor that runs away goes away from its target: 200 ms.
pub const AWAY: usize = 20;

/// A measurement that shows what no sensor knows.
const MEASURE: &str =
    "drive 1 m forward, see which way it goes, and measure it on the floor (docs/bring-up.md)";

/// Looks for all of it.
pub fn consistency(recording: &Recording, found: &mut Vec<Problem>) {
    identifiers(recording, found);
    recording.motors.iter().for_each(|track| found.extend(runaway(recording, track)));
    if let Some(base) = &recording.base {
        base::base_and_wheels(recording, base, found);
    }
    not_checked(recording, found);
}

// ---- identifiers -------------------------------------------------------------------------------

/// A device that is set to another motor's identifier: one is never heard, the other answers twice.
fn identifiers(recording: &Recording, found: &mut Vec<Problem>) {
    for track in &recording.motors {
        let (motor, on) = (&track.motor, track.motor.on);
        let Device::Dji(rc10_motor::dji::Config { rate, .. }) = motor.device else { continue };
        // A bus is filled with repetitions of a motor's feedback.
        let is_filled = |fault: &Fault| matches!(fault.kind, Kind::Load(_)) && is_on(fault, on);
        let due = seconds(recording.length) * f64::from(rate.hz());
        let received = f64::from(track.last.counters.received);
        if received <= TWICE * due || recording.faults.iter().any(is_filled) {
            continue;
        }
        let silent = recording
            .motors
            .iter()
            .filter(|other| other.motor.on == on && other.last.link == Link::NeverSeen);
        let silent: Vec<&str> = silent.map(|other| other.motor.label).collect();
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
        let silent = recording.motors.iter().find(|track| {
            track.motor.on == Place::Bus(bus.number) && track.last.link == Link::NeverSeen
        });
        let stranger = bus.last.received.last_unclaimed;
        if let (Some(silent), Some(key)) = (silent, stranger) {
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
            found.push(Problem::new(About::Bus(bus.number), "other-identifier", text));
        }
    }
}

// ---- one motor and its target ------------------------------------------------------------------

/// A motor that drives itself away from its target, faster and faster or further and further.
fn runaway(recording: &Recording, track: &MotorTrack) -> Option<Problem> {
    let at = track.samples.windows(AWAY).position(is_away)?;
    let last = track.samples[at + AWAY - 1];
    let end = time_of(at + AWAY - 1);
    if is_excused(recording, track.motor.on, end) {
        return None;
    }
    let unit = match last.kind {
        TargetKind::Speed | TargetKind::SpeedMotion => "rpm",
        _ => "degrees",
    };
    let text = format!(
        "runs away: at {:.2} s it is at {:.0} {unit}, its target is {:.0}, and it drives on: its \
         feedback counts against its commands",
        seconds(end),
        last.measured,
        last.target.unwrap_or_default(),
    );
    Some(Problem::new(About::Motor(track.motor.label), "runaway", text))
}

fn is_away(samples: &[MotorSample]) -> bool {
    let kind = samples[0].kind;
    use TargetKind::{Angle, Impedance, Motion, Speed, SpeedMotion, TotalAngle};
    let is_angle = matches!(kind, Angle | TotalAngle | Impedance | Motion);
    if !is_angle && !matches!(kind, Speed | SpeedMotion) {
        return false;
    }
    let error = |sample: &MotorSample| {
        let error = sample.target? - sample.measured;
        let goes_away = error * if is_angle { sample.rpm } else { sample.measured } < 0.0;
        // What a load or the floor drags along takes power; what runs away gives it.
        let drives = sample.drive == DriveMode::Run && sample.current * sample.rpm > 0.0;
        (sample.kind == kind && goes_away && drives).then_some(error)
    };
    let Some(errors) = samples.iter().map(error).collect::<Option<Vec<f64>>>() else {
        return false;
    };
    let (first, last) = (errors[0], errors[errors.len() - 1]);
    let target = samples[samples.len() - 1].target.unwrap_or_default().abs();
    // More than an overshoot.
    let far = if is_angle { 90.0 } else { 50.0 + 0.5 * target };
    last.abs() > far
        && last * first > 0.0
        && errors.windows(2).all(|pair| pair[1].abs() >= pair[0].abs())
}

/// Adds what no sensor of the robot can know of its other motors.
fn not_checked(recording: &Recording, found: &mut Vec<Problem>) {
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
    use super::base::tests::run;
    use super::*;
    use crate::recording::Cell;

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
