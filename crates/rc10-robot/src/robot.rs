use core::fmt;

use heapless::Vec;
use rc10_app::{ConfigError, Degrees, Rpm, Twist};
use rc10_bsp::{Latest, Statistics, Topic};
use rc10_motor::dji::{Dji, IdOutOfRange};
use rc10_motor::embassy::{BusPort, MotorPort};
use rc10_motor::{ArmSwitch, AttachError, MotorBus, MotorId};

use crate::status::RobotStatus;
use crate::table::{BUSES, Entry, MOTORS, Name};

/// A bus of this robot: up to eight motors.
pub type Bus<'r> = MotorBus<'r>;

/// The whole robot: its motors, and all that its tasks share.
pub struct Robot {
    io: Io,
    motors: Vec<Dji, { MOTORS.len() }>,
}

/// What the tasks share: every port, topic and switch of the robot.
pub struct Io {
    /// Arms and stops all motors.
    pub switch: ArmSwitch,
    /// One port per bus; bus 1 is the first.
    pub buses: [BusPort; BUSES],
    /// How the base shall move, in its own axes.
    pub twist: Latest<Twist, 1>,
    /// Where the gimbal shall point, how fast the feeder shall turn, how high the lift shall be.
    pub posture: Latest<Posture, 1>,
    /// How the robot is, ten times a second.
    pub status: Topic<RobotStatus, 4, 2>,
    /// How punctual the chassis task is.
    pub chassis_timing: Statistics,
}

/// What the mechanisms on the base shall do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Posture {
    /// Gimbal yaw, 0 ..< 360 degrees.
    pub yaw: Degrees,
    /// Gimbal pitch, 0 ..< 360 degrees.
    pub pitch: Degrees,
    /// Feeder speed.
    pub feeder: Rpm,
    /// Lift, in degrees of its shafts above the bottom.
    pub lift: i32,
}

/// Why a robot could not be set up: its table is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetupError {
    /// An identifier that the model does not have.
    Id(&'static str, IdOutOfRange),
    /// Gains that cannot be used.
    Gains(&'static str, ConfigError),
    /// A motor that cannot be on its bus.
    Attach(&'static str, AttachError),
}

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Id(motor, error) => write!(f, "motor table, {motor}: {error}"),
            Self::Gains(motor, error) => write!(f, "motor table, {motor}: gains: {error}"),
            Self::Attach(motor, error) => write!(f, "motor table, {motor}: {error}"),
        }
    }
}

impl core::error::Error for SetupError {}

impl Robot {
    /// The robot of [`table`](crate::table).
    ///
    /// # Errors
    /// [`SetupError`], naming the line of the table.
    pub fn new() -> Result<Self, SetupError> {
        let mut motors = Vec::new();
        for entry in &MOTORS {
            // It has room for exactly these.
            let _ = motors.push(motor(entry)?);
        }
        Ok(Self { io: Io::new(), motors })
    }

    /// What the tasks share, and the buses with their motors attached: each goes to a runner.
    ///
    /// # Errors
    /// [`SetupError::Attach`], naming both motors of a clash.
    pub fn start(&mut self) -> Result<(&Io, [Bus<'_>; BUSES]), SetupError> {
        let Self { io, motors } = self;
        let io: &Io = io;
        let mut buses = core::array::from_fn(|_| Bus::new(&io.switch));
        for (motor, entry) in motors.iter_mut().zip(&MOTORS) {
            let bus = &mut buses[usize::from(entry.bus - 1)];
            bus.attach(motor, entry.safety)
                .map_err(|error| SetupError::Attach(entry.label, error))?;
        }
        Ok((io, buses))
    }
}

fn motor(entry: &Entry) -> Result<Dji, SetupError> {
    let motor = Dji::new(entry.model, entry.id)
        .map_err(|error| SetupError::Id(entry.label, error))?
        .with_direction(entry.direction)
        .with_feedback_rate(entry.rate);
    match entry.gains {
        None => Ok(motor),
        Some(gains) => {
            motor.with_cascade(gains).map_err(|error| SetupError::Gains(entry.label, error))
        }
    }
}

impl Io {
    const fn new() -> Self {
        Self {
            switch: ArmSwitch::new(),
            buses: [const { BusPort::new() }; BUSES],
            twist: Latest::new(),
            posture: Latest::new(),
            status: Topic::new(),
            chassis_timing: Statistics::new(),
        }
    }

    /// The port of a motor.
    #[must_use]
    pub fn motor(&self, name: Name) -> MotorPort<'_> {
        let bus = usize::from(name.entry().bus - 1);
        self.buses[bus].motor(MotorId::new(name.index_on_bus()))
    }
}
