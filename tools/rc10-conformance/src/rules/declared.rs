use rc10_app::{Amps, Degrees, NewtonMetres, Rpm, RpmPerSecond, TotalAngle};
use rc10_motor::{Impedance, Motion, Target, TargetKind};

use crate::case::Case;
use crate::declaration::Claim;
use crate::outcome::Findings;

/// A target of every kind, with `number` wherever one stands.
pub(super) fn every_kind(number: f32) -> [Target; 12] {
    let impedance = Impedance {
        angle: Degrees::new(number),
        speed: Rpm::new(number),
        torque: NewtonMetres::new(number),
        kp: number,
        kd: number,
    };
    let motion = Motion {
        angle: None,
        speed: Rpm::new(number),
        acceleration: RpmPerSecond::new(number),
        inertia: number,
        effort: number,
    };
    [
        Target::Coast,
        Target::Current(Amps::new(number)),
        Target::Duty(number),
        Target::Speed(Rpm::new(number)),
        Target::Angle(Degrees::new(number)),
        Target::TotalAngle(TotalAngle::ZERO),
        Target::Torque(NewtonMetres::new(number)),
        Target::Impedance(impedance),
        Target::Brake(Amps::new(number)),
        Target::Handbrake(Amps::new(number)),
        Target::Motion(motion),
        Target::Motion(Motion { angle: Some(TotalAngle::ZERO), ..motion }),
    ]
}

pub(super) fn every_target_is_tried(case: &Case<'_>, found: &mut Findings) {
    let declared = case.declared;
    let supports = case.motor().supports();
    for kind in every_kind(0.0).map(|target| target.kind()) {
        // A motion is tried with the speeds and angles of the others.
        let tried = match kind {
            TargetKind::SpeedMotion => TargetKind::Speed,
            TargetKind::Motion => TargetKind::TotalAngle,
            kind => kind,
        };
        let is_tried = declared.trials.iter().any(|trial| trial.target.kind() == tried);
        match (supports.contains(kind), is_tried) {
            (true, false) if kind != TargetKind::Coast => {
                found.add(None, format!("it takes a {kind:?} target, and no trial has one"));
            }
            (false, true) if kind == tried => {
                found.add(None, format!("it takes no {kind:?} target to be tried"));
            }
            _ => (),
        }
    }
    if declared.ids[0] == declared.ids[1] {
        found.add(None, format!("both identifiers are {}", declared.ids[0]));
    }
    if !(declared.cruise.get() > 0.0 && declared.load > declared.no_torque * 2.0) {
        found.add(None, "cruise must be above 0, and load far above no_torque".to_owned());
    }
    let claims = [declared.coasts_freely, declared.disables, declared.brakes, declared.holds];
    if claims.contains(&Claim::Cannot("")) {
        found.add(None, "what it cannot do needs a reason".to_owned());
    }
}
