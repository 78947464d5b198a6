//! The robot for the tools on a PC: the loads of its motors.

use crate::table::{BASE, GIMBAL_AHEAD, LIFT, LIFT_TOP, Name};
use crate::{Robot, operator};
use rc10::sim::prelude::*;

impl Simulated for Robot {
    fn description() -> Description {
        let script = RemoteControl::of::<Self>(&operator::SCRIPT, Some(operator::SCRIPT_LENGTH));
        Description {
            base: Some(Base::of(BASE.wheels, &BASE.geometry)),
            remote: Some(script),
            yaw: Some("heading"),
            mechanisms: vec![
                Shape::lift("lift", LIFT[0], LIFT_TRAVEL),
                Shape::turret("gimbal", Name::GimbalYaw, AHEAD),
                Shape::arm("pitch", [(Name::GimbalPitch, AHEAD, 1.0)]),
            ],
            ..Description::of_program::<Self>(plant)
        }
    }
}

/// Degrees of the gimbal's motors where it looks ahead.
const AHEAD: f64 = GIMBAL_AHEAD.get() as f64;
/// Degrees of the lift's shafts.
const LIFT_TRAVEL: [f64; 2] = [-90.0, LIFT_TOP as f64 + 30.0];

/// Inertias (kg m²) and torques (N m) at the output shaft; our estimates. The wheels get theirs
/// from the base. The weight of the lift pulls each of its shafts down; it hangs a quarter of a
/// turn above its floor at power-on, so that one can see whether it is held or let go.
fn plant(name: Name) -> Plant {
    match name {
        Name::GimbalYaw => Plant::inertia(0.02),
        Name::GimbalPitch => Plant::inertia(0.01),
        Name::Feeder => Plant::inertia(0.002),
        lift if LIFT.contains(&lift) => {
            Plant { load: -1.0, travel: Some(LIFT_TRAVEL), ..Plant::inertia(0.01) }
        }
        _ => Plant::default(),
    }
}
