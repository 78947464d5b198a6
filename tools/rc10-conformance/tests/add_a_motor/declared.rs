//! Abilities of the Finch F10.

use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Declaration, Trial};
use rc10_motor::Target;

/// Two of them with identifiers 1 and 2, 120 rpm to drive around with, 5 N m at full torque.
pub fn declared() -> Declaration {
    Declaration::new([1, 2], Rpm::new(120.0), NewtonMetres::new(5.0)).with_trials(&[
        Trial::new(Target::Torque(NewtonMetres::new(2.5)), 0.1, 100),
        Trial::new(Target::Speed(Rpm::new(200.0)), 2.0, 1000),
        Trial::new(Target::Speed(Rpm::new(-30.0)), 2.0, 1000),
        Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 2000),
        Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-720)), 1.0, 3000),
    ])
}
