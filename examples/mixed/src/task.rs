//! The task: the robot follows a script.

use rc10::motor::Impedance;
use rc10::prelude::*;

use crate::table::{LEGS, Name};
use crate::{Robot, Shared};

/// Script of the robot: milliseconds, a label, and new targets.
pub type Step = (u32, &'static str, &'static [(Name, Target)]);

const fn legs(degrees: f32) -> [(Name, Target); LEGS.len()] {
    let spring = Impedance {
        angle: Degrees::new(degrees),
        speed: Rpm::ZERO,
        torque: NewtonMetres::ZERO,
        kp: 20.0,
        kd: 1.0,
    };
    let mut legs = [(LEGS[0], Target::Impedance(spring)); LEGS.len()];
    let mut leg = 1;
    while leg < LEGS.len() {
        legs[leg].0 = LEGS[leg];
        leg += 1;
    }
    legs
}

/// The script: speeds, angles, springs and torques, of every link.
pub const SCRIPT: &[Step] = &[
    (
        200,
        "wheel on, limbs out",
        &[
            (Name::Wheel, Target::Speed(Rpm::new(600.0))),
            (Name::Arm, Target::Angle(Degrees::new(60.0))),
            (Name::Hip, Target::TotalAngle(TotalAngle::from_degrees(45))),
            (Name::Wrist, Target::Angle(Degrees::new(90.0))),
            (Name::Turret, Target::TotalAngle(TotalAngle::from_degrees(180))),
        ],
    ),
    (400, "legs bend", &legs(20.0)),
    (1000, "flywheel on", &[(Name::Flywheel, Target::Speed(Rpm::new(250.0)))]),
    (2500, "wheel back", &[(Name::Wheel, Target::Speed(Rpm::new(-400.0)))]),
    (
        3000,
        "limbs home",
        &[
            (Name::Arm, Target::Angle(Degrees::ZERO)),
            (Name::Hip, Target::TotalAngle(TotalAngle::ZERO)),
            (Name::Wrist, Target::Angle(Degrees::ZERO)),
            (Name::Turret, Target::TotalAngle(TotalAngle::ZERO)),
        ],
    ),
    (5000, "legs stretch", &legs(0.0)),
    (6000, "wheel brakes", &[(Name::Wheel, Target::Brake(Amps::new(20.0)))]),
    (
        6500,
        "hip turns",
        &[(Name::Hip, Target::Speed(Rpm::new(60.0))), (Name::Wrist, Target::Speed(Rpm::new(30.0)))],
    ),
    (
        8500,
        "let go",
        &[
            (Name::Wheel, Target::Coast),
            (Name::Hip, Target::Coast),
            (Name::Wrist, Target::Coast),
            (Name::Turret, Target::Coast),
            (Name::Flywheel, Target::Coast),
        ],
    ),
];

/// Arms the robot by its remote, and repeats every 10 ms what the script said last to each motor. Without
/// the remote no motor is commanded: 50 ms later each is safe.
impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(10));
        loop {
            let now = every.next().await.now;
            if shared.obey(&mut arming).is_none() {
                continue;
            }
            let begun = SCRIPT.iter().filter(|(at, ..)| Micros::from_millis((*at).into()) <= now);
            for name in Name::ALL {
                let mut said = begun.clone().flat_map(|(_, _, targets)| targets.iter());
                let Some((_, target)) = said.rfind(|(whose, _)| whose == name) else { continue };
                shared.command(*name, *target);
            }
        }
    }
}
