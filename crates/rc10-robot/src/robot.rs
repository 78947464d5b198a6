use core::borrow::BorrowMut;
use core::fmt;

use heapless::Vec;
use rc10_app::{ConfigError, Degrees, Rpm, TotalAngle, Twist};
use rc10_message::{Cycles, Latest, Statistics, Topic};
use rc10_module::Reception;
use rc10_module::imu::Heading;
use rc10_module::remote::{Remote, RemoteLink};
use rc10_motor::dji::{self, Dji};
use rc10_motor::embassy::{BusPort, MotorPort};
use rc10_motor::{ArmSwitch, AttachError, MotorBus, MotorId, Target, TargetError};

use crate::status::RobotStatus;
use crate::table::{BUSES, Entry, MOTORS, Name};

/// A bus of this robot: up to eight motors.
pub type Bus<'r> = MotorBus<'r>;

/// The robot's motors: they stand here, and the buses borrow them.
#[derive(Default)]
pub struct Motors(Vec<Dji, { MOTORS.len() }>);

/// Everything that the tasks share: ports, topics and the switch of the robot.
pub struct Shared<'p> {
    /// Arms and stops all motors.
    pub switch: ArmSwitch,
    /// One port per bus; bus 1 is the first.
    pub buses: [&'p BusPort; BUSES],
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

/// Why a robot could not be set up: its table is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetupError {
    /// An identifier, gain or limit that cannot be used.
    Config(&'static str, ConfigError),
    /// A motor that cannot be on its bus.
    Attach(&'static str, AttachError),
}

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Config(motor, error) => write!(f, "motor table, {motor}: {error}"),
            Self::Attach(motor, error) => write!(f, "motor table, {motor}: {error}"),
        }
    }
}

impl core::error::Error for SetupError {}

impl Motors {
    /// Room for the motors of [`table`](crate::table).
    #[must_use]
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// The motors of the table on the buses of a robot: each goes to a runner.
    ///
    /// # Errors
    /// [`SetupError`], naming the line of the table, and both motors of a clash.
    pub fn start<'r>(&'r mut self, shared: &'r Shared<'_>) -> Result<[Bus<'r>; BUSES], SetupError> {
        self.attach(core::array::from_fn(|_| Bus::new(&shared.switch)))
    }

    /// The same on buses that stand elsewhere, as `&mut Bus`: a chip's stack is too small to make
    /// them there.
    ///
    /// # Errors
    /// As [`start`](Self::start).
    #[inline(never)]
    pub fn attach<'r, B: BorrowMut<Bus<'r>>>(
        &'r mut self,
        mut buses: [B; BUSES],
    ) -> Result<[B; BUSES], SetupError> {
        self.0.clear();
        for entry in &MOTORS {
            // It has room for exactly these.
            let _ = self.0.push(motor(entry)?);
        }
        for (motor, entry) in self.0.iter_mut().zip(&MOTORS) {
            let bus = buses[usize::from(entry.bus - 1)].borrow_mut();
            bus.attach(motor, entry.safety)
                .map_err(|error| SetupError::Attach(entry.label, error))?;
        }
        Ok(buses)
    }
}

/// A port for each bus.
#[must_use]
pub const fn ports() -> [BusPort; BUSES] {
    [const { BusPort::new() }; BUSES]
}

#[inline(never)]
fn motor(entry: &Entry) -> Result<Dji, SetupError> {
    let mut config = dji::Config::new(entry.model, entry.id)
        .with_direction(entry.direction)
        .with_feedback_rate(entry.rate);
    if let Some(gains) = entry.gains {
        config = config.with_cascade(gains);
    }
    Dji::new(config).map_err(|error| SetupError::Config(entry.label, error))
}

impl<'p> Shared<'p> {
    /// The shared state of a robot that has not begun, with a port per bus: [`ports`] makes some.
    // Always inlined, so that it is made where it stays and does not pass over the stack.
    #[inline(always)]
    #[must_use]
    pub const fn new(buses: [&'p BusPort; BUSES]) -> Self {
        Self {
            switch: ArmSwitch::new(),
            buses,
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
        let bus = usize::from(name.entry().bus - 1);
        self.buses[bus].motor(MotorId::new(name.index_on_bus()))
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
