use rc10_app::{Degrees, Rpm, TotalAngle, Twist};
use rc10_message::{Cycles, Latest, Statistics, Topic};
use rc10_module::Reception;
use rc10_module::imu::Heading;
use rc10_module::remote::{Remote, RemoteLink};
use rc10_motor::embassy::MotorPort;
use rc10_motor::{ArmSwitch, Target, TargetError};

use crate::status::RobotStatus;
use crate::table::{BUSES, Name};

/// The robot's buses as its tasks see them, and its motors by name.
pub type Ports = rc10_motor::embassy::Ports<Name, BUSES>;

/// Everything that the tasks share: ports, topics and the switch of the robot.
pub struct Shared<'p> {
    /// Arms and stops all motors.
    pub switch: ArmSwitch,
    /// The ports of its buses and motors.
    pub ports: &'p Ports,
    /// Newest frame of the remote control.
    pub remote: Latest<Remote, 1>,
    /// Counters of its receiver's bytes and frames.
    pub remote_reception: Reception,
    /// State of the link to the remote control.
    pub remote_link: Latest<RemoteLink, 1>,
    /// The heading of the robot in the world, by its IMU: [`imu::run`](crate::imu::run) says from
    /// where that counts.
    pub heading: Latest<Heading, 1>,
    /// Counters of the IMU's bytes and frames.
    pub imu_reception: Reception,
    /// Commanded motion of the base.
    pub motion: Latest<BaseCommand, 1>,
    /// Setpoints of the mechanisms: angles of the gimbal, speed of the feeder, height of the lift.
    pub mechanisms: Latest<MechanismCommand, 1>,
    /// The newest target that a motor refused: which motor, and why.
    pub refused: Latest<(Name, TargetError), 1>,
    /// Status of the robot, ten times a second.
    pub status: Topic<RobotStatus, 4, 2>,
    /// Timing of the chassis task.
    pub chassis_timing: Statistics,
    /// Cycles of the core that a tick of the buses takes, on a chip that counts its cycles: a run
    /// is a tick.
    pub bus_cycles: Option<&'p Cycles>,
}

/// A motion command for the base.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BaseCommand {
    /// Forward, to the left, and turning.
    pub twist: Twist,
    /// The axes of the twist: the robot's or the world's.
    pub axes: Axes,
}

/// Frame of reference of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axes {
    /// The robot's: forward is where it looks.
    #[default]
    Robot,
    /// The world's: forward is where the robot looked when it was armed.
    World,
}

/// Setpoints of the mechanisms on the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MechanismCommand {
    /// Gimbal yaw, 0 ..< 360 degrees.
    pub yaw: Degrees,
    /// Gimbal pitch, 0 ..< 360 degrees.
    pub pitch: Degrees,
    /// Feeder speed.
    pub feeder: Rpm,
    /// Lift: the angle of its shafts above the bottom.
    pub lift: TotalAngle,
}

impl<'p> Shared<'p> {
    /// The shared state of a robot that has not begun, and its ports.
    // Always inlined, so that it is made where it stays and does not pass over the stack.
    #[inline(always)]
    #[must_use]
    pub const fn new(ports: &'p Ports) -> Self {
        Self {
            switch: ArmSwitch::new(),
            ports,
            remote: Latest::new(),
            remote_reception: Reception::new(),
            remote_link: Latest::new(),
            heading: Latest::new(),
            imu_reception: Reception::new(),
            motion: Latest::new(),
            mechanisms: Latest::new(),
            refused: Latest::new(),
            status: Topic::new(),
            chassis_timing: Statistics::new(),
            bus_cycles: None,
        }
    }

    /// The port of a motor.
    #[must_use]
    pub fn motor(&self, name: Name) -> MotorPort<'_> {
        self.ports.motor(name)
    }

    /// Gives a motor a target; repeat it, for it expires in 50 ms.
    ///
    /// A motor that refuses it (a number that is not finite, a kind it does not take) keeps the old
    /// one until that expires, and then is safe. The status names the motor and the reason.
    pub fn command(&self, name: Name, target: Target) {
        if let Err(why) = self.motor(name).command(target) {
            self.refused.set((name, why), rc10_message::now());
        }
    }
}
