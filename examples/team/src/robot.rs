use rc10_app::{FieldFrame, Rpm, TotalAngle, Twist};
use rc10_message::{Latest, Statistics};
use rc10_tasks::Common;

use crate::table::{BUSES, FEEDER, Name};

/// The robot's buses as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, BUSES>;

/// Everything that the tasks share.
pub type Shared<'p> = Common<'p, Name, BUSES, 0, Own>;

rc10_tasks::live! {
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
