use rc10_app::{Degrees, NewtonMetres, Rpm};
use rc10_motor::{Impedance, SafeState, Target, TargetKind};

use crate::case::Case;
use crate::declaration::Declaration;
use crate::outcome::{Findings, Halt, Outcome};
use crate::rig::Rig;

/// The spring of the declaration.
pub(super) fn spring_of(declared: &Declaration) -> Option<Impedance> {
    declared.trials.iter().find_map(|trial| match trial.target {
        Target::Impedance(impedance) => Some(impedance),
        _ => None,
    })
}

/// A law in which every term counts, and the zero of the motor's angle.
struct Law {
    asked: Impedance,
    /// The shaft's angle at the motor's zero, degrees.
    zero: f64,
}

impl Law {
    /// The torque that it gives for what the shaft does, N m.
    fn torque(&self, rig: &Rig<'_>) -> f64 {
        let Impedance { angle, speed, torque, kp, kd } = self.asked;
        let state = rig.esc.state();
        let way = f64::from(angle.get()) - (state.output_degrees - self.zero);
        let slip = f64::from(speed.get()) - state.output_rpm;
        let spring = f64::from(kp) * way.to_radians();
        // 1 rpm = 6 degrees a second.
        let damper = f64::from(kd) * (6.0 * slip).to_radians();
        spring + damper + f64::from(torque.get())
    }
}

/// Terms of a law, as shares of the largest torque: of the spring where the shaft is, of the damper
/// where it stands, and on top.
fn law(rig: &Rig<'_>, [spring, damper, torque]: [f32; 3]) -> Result<Law, Halt> {
    let base = spring_of(rig.declared).ok_or(Halt::Stuck)?;
    let full = rig.declared.full_torque.get();
    let (kp, kd) = (if spring == 0.0 { 0.0 } else { base.kp }, base.kd);
    let here = rig.status().feedback.total_angle.degrees().get();
    let way = if spring == 0.0 { 0.0 } else { (spring * full / base.kp).to_degrees() };
    let asked = Impedance {
        angle: Degrees::new(here + way),
        speed: Rpm::new((damper * full / base.kd).to_degrees() / 6.0),
        torque: NewtonMetres::new(torque * full),
        kp,
        kd,
    };
    Ok(Law { asked, zero: rig.esc.state().output_degrees - f64::from(here) })
}

/// Armed, coasting, and at rest.
fn rests(rig: &mut Rig<'_>) -> Outcome {
    rig.wake()?;
    rig.wait(Some(Target::Coast), rig.declared.enables_within + 100);
    Ok(())
}

/// So far from its law a torque may be, as a share of the largest: for delays and rounding.
const NEAR: f64 = 0.06;
/// Time from rest until a law is in force, ms: the soft start, and a command on its way.
const SOFT_TIME: u32 = 20;
const ON_ITS_WAY: u32 = 5;

pub(super) fn obeys_the_law(case: &Case<'_>, found: &mut Findings) {
    if !case.motor().supports().contains(TargetKind::Impedance) {
        return;
    }
    for terms in [[0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.2], [0.1, -0.1, 0.2]] {
        found.note(case.alone(SafeState::Coast, |rig| {
            rests(rig)?;
            let law = law(rig, terms)?;
            let target = Target::Impedance(law.asked);
            // The start has a rule of its own.
            rig.wait(Some(target), rig.declared.enables_within + 120);
            for _ in 0..300 {
                rig.tick(Some(target));
                let (is, should) = (rig.esc.state().torque, law.torque(rig));
                rig.must((is - should).abs() <= NEAR * rig.full_torque(), || {
                    format!("{is:.3} N m, not {should:.3}, with {:?}", law.asked)
                })?;
            }
            Ok(())
        }));
    }
}

/// State of the motor before.
#[derive(Clone, Copy, Debug)]
enum Before {
    Coasting,
    Disarmed,
    Following,
    Stopped,
}

pub(super) fn starts_softly(case: &Case<'_>, found: &mut Findings) {
    use Before::{Coasting, Disarmed, Following, Stopped};
    if !case.motor().supports().contains(TargetKind::Impedance) {
        return;
    }
    for before in [Coasting, Disarmed, Following, Stopped] {
        found.note(case.alone(SafeState::Hold, |rig| {
            comes_from(rig, before)?;
            grows(rig, before)
        }));
        found.note(case.alone(SafeState::Hold, |rig| {
            comes_from(rig, before)?;
            keeps_its_equilibrium(rig, before)
        }));
    }
}

fn comes_from(rig: &mut Rig<'_>, before: Before) -> Outcome {
    rests(rig)?;
    match before {
        Before::Coasting => (),
        Before::Disarmed => {
            rig.switch.disarm();
            rig.wait(None, 50);
            rig.switch.arm().map_err(|_| Halt::Stuck)?;
        }
        Before::Following => rig.wait(Some(Target::Speed(Rpm::ZERO)), 100),
        Before::Stopped => rig.wait(None, 200),
    }
    Ok(())
}

/// The torque grows to its law in the time of the soft start, neither faster nor slower.
fn grows(rig: &mut Rig<'_>, before: Before) -> Outcome {
    let mut law = law(rig, [0.0, 0.0, 0.8])?;
    // Without damping the law stays as large as it is.
    law.asked.kd = 0.0;
    let target = Target::Impedance(law.asked);
    let mut driven = 0;
    for _ in 0..rig.declared.enables_within + SOFT_TIME + 40 {
        rig.tick(Some(target));
        let (is, should) = (rig.esc.state().torque, law.torque(rig));
        driven += u32::from(driven > 0 || is.abs() > 2.0 * rig.no_torque());
        if driven == 1 {
            // A shaft that runs away would meet the limits of its voltage.
            rig.esc.set_load(-should);
        }
        // A millisecond for the first one, and one for the frame's delay.
        let most = f64::from(driven + 2) / f64::from(SOFT_TIME) * rig.full_torque();
        rig.must(is.abs() <= most, || format!("{before:?} before, {is:.3} N m after {driven} ms"))?;
        let is_late = driven > SOFT_TIME + ON_ITS_WAY;
        rig.must(!is_late || (is - should).abs() <= NEAR * rig.full_torque(), || {
            format!("{before:?} before, {is:.3} N m, not {should:.3}, {driven} ms on")
        })?;
    }
    if driven > SOFT_TIME + ON_ITS_WAY { Ok(()) } else { Err(Halt::Stuck) }
}

/// A spring and a torque that are in balance are so from the first tick.
fn keeps_its_equilibrium(rig: &mut Rig<'_>, before: Before) -> Outcome {
    let law = law(rig, [0.4, 0.0, -0.4])?;
    let target = Target::Impedance(law.asked);
    for past in 0..rig.declared.enables_within + 150 {
        rig.tick(Some(target));
        let torque = rig.esc.state().torque;
        rig.must(torque.abs() <= NEAR * rig.full_torque(), || {
            format!("{before:?} before, {torque:.3} N m where its law has none, {past} ms on")
        })?;
    }
    Ok(())
}
