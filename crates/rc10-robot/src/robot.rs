use core::ops::Deref;

use rc10_app::{FieldFrame, Rpm, TotalAngle, Twist};
use rc10_message::{Latest, Statistics};
use rc10_tasks::Common;

use crate::table::{BUSES, FEEDER, Name};

/// The robot's buses as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, BUSES>;

/// Everything that the tasks share: what every robot has, and topics of this one.
pub struct Shared<'p> {
    /// The switch, the ports, the remote and the status.
    pub common: Common<'p, Name, BUSES>,
    /// Commanded motion of the base.
    pub motion: Latest<BaseCommand, 1>,
    /// Setpoints of the mechanisms: angles of the gimbal, speed of the feeder, height of the lift.
    pub mechanisms: Latest<MechanismCommand, 1>,
    /// Timing of the chassis task.
    pub chassis_timing: Statistics,
    /// Signals and parameters for a PC beside the motors' own.
    pub live: Live,
}

rc10_tasks::live! {
    /// Signals and parameters for a PC beside the motors' own.
    pub struct Live {
        signals {
            tilt: "lift tilt", "deg";
            heading: "heading", "deg";
        }
        parameters {
            feeder: "feeder speed", "rpm", FEEDER.get(), [0.0, 450.0];
        }
    }
}

impl<'p> Deref for Shared<'p> {
    type Target = Common<'p, Name, BUSES>;

    fn deref(&self) -> &Self::Target {
        &self.common
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

impl<'p> Shared<'p> {
    /// The shared state of a robot that has not begun, and its ports.
    // Always inlined, so that it is made where it stays and does not pass over the stack.
    #[inline(always)]
    #[must_use]
    pub const fn new(ports: &'p Ports) -> Self {
        Self {
            common: Common::new(ports),
            motion: Latest::new(),
            mechanisms: Latest::new(),
            chassis_timing: Statistics::new(),
            live: Live::new(),
        }
    }
}
