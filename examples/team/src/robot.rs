use rc10::app::FieldFrame;
use rc10::join::join3;
use rc10::message::Statistics;
use rc10::prelude::*;

use crate::table::{FEEDER, Robot, Shared};
use crate::{chassis, driver, mechanisms};

rc10::live! {
    /// Signals and parameters for a PC beside the motors' own, and the commands of its tasks.
    pub struct Own {
        signals {
            tilt: "lift tilt", "deg";
            heading: "heading", "deg";
        }
        parameters {
            feeder: "feeder speed", "rpm", FEEDER.get(), [0.0, 450.0];
        }
        fields {
            /// Commanded motion of the base.
            motion: Latest<BaseCommand, 1>;
            /// Setpoints of the mechanisms: angles of the gimbal, speed of the feeder, height of the lift.
            mechanisms: Latest<MechanismCommand, 1>;
            /// Timing of the chassis task.
            chassis_timing: Statistics;
        }
    }
}

impl Program for Robot {
    // What a USB adapter for it must be able to.
    const CONSOLE: u32 = 2_000_000;

    /// The driver comes last: motors start a tick after arming.
    async fn run(shared: &Shared<'_>) -> ! {
        join3(chassis::run(shared), mechanisms::run(shared), driver::run(shared)).await.0
    }
}

/// A motion command for the base: forward, to the left, and turning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BaseCommand {
    /// In the robot's axes: forward is where it looks.
    Robot(Twist),
    /// In the world's: forward is where the robot looked when it was armed.
    World(Twist<FieldFrame>),
}

/// Setpoints of the mechanisms on the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MechanismCommand {
    /// Gimbal yaw, over many turns.
    pub yaw: Goal,
    /// Gimbal pitch, over many turns.
    pub pitch: Goal,
    /// Feeder speed.
    pub feeder: Rpm,
    /// Lift: the angle of its shafts above the bottom.
    pub lift: Goal,
}

/// Where a stick has brought a shaft, and how fast it still moves it there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Goal {
    /// The angle.
    pub angle: TotalAngle,
    /// Speed of the motor; zero as soon as the stick is let go.
    pub speed: Rpm,
}
