//! A robot of motors of many vendors, to show how they live together: two CAN buses with standard
//! and extended identifiers, and an RS-485 line. `rc10 run --robot mixed` drives it; `firmware/line` is it on
//! the chip.

use core::num::NonZeroU8;

use embassy_time::{Duration, Instant, Ticker, Timer};
use rc10_app::{
    Amps, ConfigError, Degrees, Gear, NewtonMetres, PidConfig, Rpm, RpmPerSecond, TotalAngle,
};
use rc10_can::Micros;
use rc10_motor::cybergear::{self, CyberGear};
use rc10_motor::damiao::{self, Control, Damiao};
use rc10_motor::embassy::{BusPort, MotorPort, Rs485Port};
use rc10_motor::lk::{self, Lk};
use rc10_motor::odrive::{self, ODrive};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::unitree::{self, GoM8010, GoModule, LineConfig, ModuleConfig, Rs485Bus};
use rc10_motor::vesc::{self, Currents, ElectricalScale, Vesc, VescId};
use rc10_motor::{ArmSwitch, AttachError, Impedance, MotorBus, MotorId, Safety, Target};

/// Number of CAN buses.
pub const BUSES: usize = 2;
/// Number of legs: GO-M8010-6 on the line, with ids 0 to 7.
pub const LEGS: usize = 8;

/// Names of the motors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Name {
    /// VESC 1, bus 1.
    Wheel,
    /// DM-J4310 in MIT mode, bus 1.
    Arm,
    /// GO-M8010-6 behind CAN module 3, bus 1.
    Hip,
    /// CyberGear, bus 2.
    Wrist,
    /// MG4010E-i10 of LK, bus 2.
    Turret,
    /// `ODrive` with 8 : 1, bus 2.
    Flywheel,
    /// One of the legs, 0 ..< [`LEGS`].
    Leg(u8),
}

/// The robot's motors: they stand here, and the buses and the line borrow them.
pub struct Motors {
    wheel: Vesc,
    arm: Damiao,
    hip: GoModule,
    wrist: CyberGear,
    turret: Lk,
    flywheel: ODrive,
    legs: [GoM8010; LEGS],
}

/// The state that the tasks share.
pub struct Shared {
    /// Arms and stops all motors.
    pub switch: ArmSwitch,
    /// One port per bus; bus 1 is the first.
    pub buses: [BusPort; BUSES],
    /// The port of the line.
    pub line: Rs485Port,
}

/// The wheel's VESC: seven pole pairs, no gear, currents below what VESC Tool allows it.
#[must_use]
pub const fn wheel() -> vesc::Config {
    const SEVEN: NonZeroU8 = NonZeroU8::new(7).unwrap();
    const ONE: VescId = VescId::new(1).unwrap();
    let scale = ElectricalScale::new(SEVEN, Gear::DIRECT);
    let currents =
        Currents { limit: Amps::new(40.0), brake: Amps::new(15.0), handbrake: Amps::new(10.0) };
    vesc::Config::new(ONE, scale, currents)
}

/// Identifiers of the arm's motor: of the frames that it takes, and of those that it sends. Its low
/// byte is beyond those of DJI's feedback.
pub const ARM_IDS: (u16, u16) = (0x11, 0x31);

/// The arm's motor.
///
/// # Errors
/// [`ConfigError`], naming what cannot be.
pub fn arm() -> Result<Damiao, ConfigError> {
    Damiao::new(damiao::Config::new(damiao::models::J4310, ARM_IDS.0, ARM_IDS.1, Control::Mit(ARM)))
}

/// The arm's loops. Efforts in N m; for a light arm on the shaft.
pub const ARM: Cascade = Cascade {
    speed: PidConfig::new(0.063, 0.5, 0.0, 7.0),
    angle: PidConfig::new(1.3, 0.0, 0.0, 150.0),
    outer_divider: 1,
    acceleration: RpmPerSecond::new(1000.0),
    feed_forward: 0.0,
};

/// The hip's module, as it is sold, and the motor behind it. Never module 0 beside a VESC: they
/// would take each other's frames.
pub const HIP: (u8, u8) = (3, 0);

/// The wrist's identifier, and ours.
pub const WRIST: cybergear::Address = cybergear::Address { motor: 0x7F, host: 0xFD };

/// The turret's identifier.
pub const TURRET_ID: u8 = 1;

/// The turret's drive. Efforts in A, 5 of its 33.
pub const TURRET: lk::Config = lk::Config::new(
    lk::models::MG4010E_I10,
    Cascade {
        speed: PidConfig::new(0.2, 2.0, 0.0, 5.0),
        angle: PidConfig::new(3.0, 0.0, 0.0, 200.0),
        outer_divider: 5,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: 0.0,
    },
);

/// The flywheel's node.
pub const FLYWHEEL_NODE: u8 = 3;

/// The flywheel's axis: efforts in N m behind its gearbox, estimates at 1 kHz, heartbeats at 100 Hz.
pub const FLYWHEEL: odrive::Config = odrive::Config::new(
    odrive::Firmware::V0_6,
    odrive::Control::Torque(Cascade {
        speed: PidConfig::new(0.1, 1.0, 0.0, 8.0),
        angle: PidConfig::new(3.0, 0.0, 0.0, 250.0),
        outer_divider: 5,
        acceleration: RpmPerSecond::new(1500.0),
        feed_forward: 0.0,
    }),
    odrive::Rates::new(1000, 100),
)
.with_gear(Gear::new(8, 1).unwrap())
.with_limits(odrive::Limits { speed: Rpm::new(400.0), current: Amps::new(18.0) });

/// The longest time from a command to a leg to the end of its reply: nearly twice what that takes if
/// the leg thinks for 20 µs, so that one that is silent costs the others little.
pub const REPLY: Micros = Micros::new(200);

/// The line, without its legs.
///
/// # Errors
/// [`ConfigError`], naming what cannot be.
pub fn line(switch: &ArmSwitch) -> Result<Rs485Bus<'_>, ConfigError> {
    Rs485Bus::new(switch).with_reply_timeout(REPLY)
}

impl Motors {
    /// As set up above.
    ///
    /// # Errors
    /// [`ConfigError`], naming what cannot be.
    pub fn new() -> Result<Self, SetupError> {
        let leg = |id| GoM8010::new(LineConfig::new(id)).map_err(SetupError::Leg);
        Ok(Self {
            wheel: Vesc::new(wheel())?,
            arm: arm()?,
            hip: GoModule::new(ModuleConfig::new(HIP.0, HIP.1))?,
            wrist: CyberGear::new(cybergear::Config::new(&cybergear::models::CYBERGEAR, WRIST))?,
            turret: Lk::new(lk::Config { id: TURRET_ID, ..TURRET })?,
            flywheel: ODrive::new(odrive::Config { node: FLYWHEEL_NODE, ..FLYWHEEL })?,
            legs: [leg(0)?, leg(1)?, leg(2)?, leg(3)?, leg(4)?, leg(5)?, leg(6)?, leg(7)?],
        })
    }

    /// The motors on the buses and the line of a robot: each goes to a runner.
    ///
    /// # Errors
    /// [`SetupError`], naming both motors of a clash.
    pub fn start<'r>(
        &'r mut self,
        shared: &'r Shared,
    ) -> Result<([MotorBus<'r>; BUSES], Rs485Bus<'r>), SetupError> {
        let mut buses = [(); BUSES].map(|()| MotorBus::new(&shared.switch));
        let mut line = line(&shared.switch)?;
        self.attach(buses.each_mut(), &mut line)?;
        Ok((buses, line))
    }

    /// The same, on buses and a line that stand where they stay: on a chip they are too large for the
    /// stack.
    ///
    /// # Errors
    /// [`SetupError`], naming both motors of a clash.
    pub fn attach<'r>(
        &'r mut self,
        [one, two]: [&mut MotorBus<'r>; BUSES],
        line: &mut Rs485Bus<'r>,
    ) -> Result<(), SetupError> {
        let Self { wheel, arm, hip, wrist, turret, flywheel, legs } = self;
        one.attach(wheel, Safety::BRAKE)?;
        one.attach(arm, Safety::HOLD)?;
        one.attach(hip, Safety::HOLD)?;
        two.attach(wrist, Safety::COAST)?;
        two.attach(turret, Safety::HOLD)?;
        two.attach(flywheel, Safety::COAST)?;
        for leg in legs {
            line.attach(leg, Safety::HOLD).map_err(SetupError::Attach)?;
        }
        Ok(())
    }
}

/// Why the robot could not be set up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetupError {
    /// A number that cannot be.
    Config(ConfigError),
    /// An id that no leg can have.
    Leg(unitree::IdOutOfRange),
    /// A motor that cannot be attached.
    Attach(AttachError),
}

impl core::fmt::Display for SetupError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Config(error) => error.fmt(f),
            Self::Leg(error) => error.fmt(f),
            Self::Attach(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for SetupError {}

impl From<ConfigError> for SetupError {
    fn from(error: ConfigError) -> Self {
        Self::Config(error)
    }
}

impl From<AttachError> for SetupError {
    fn from(error: AttachError) -> Self {
        Self::Attach(error)
    }
}

impl Shared {
    /// The shared state of a robot that has not begun.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            switch: ArmSwitch::new(),
            buses: [const { BusPort::new() }; BUSES],
            line: Rs485Port::new(),
        }
    }

    /// The port of a motor: as [`Motors::start`] attached them.
    #[must_use]
    pub fn motor(&self, name: Name) -> MotorPort<'_> {
        match name {
            Name::Wheel => self.buses[0].motor(MotorId::new(0)),
            Name::Arm => self.buses[0].motor(MotorId::new(1)),
            Name::Hip => self.buses[0].motor(MotorId::new(2)),
            Name::Wrist => self.buses[1].motor(MotorId::new(0)),
            Name::Turret => self.buses[1].motor(MotorId::new(1)),
            Name::Flywheel => self.buses[1].motor(MotorId::new(2)),
            Name::Leg(leg) => self.line.motor(MotorId::new(leg)),
        }
    }
}

impl Default for Shared {
    fn default() -> Self {
        Self::new()
    }
}

/// Script of the robot: milliseconds, a label, and new targets.
pub type Line = (u32, &'static str, &'static [(Name, Target)]);

const fn legs(degrees: f32) -> [(Name, Target); LEGS] {
    let spring = Impedance {
        angle: Degrees::new(degrees),
        speed: Rpm::ZERO,
        torque: NewtonMetres::ZERO,
        kp: 20.0,
        kd: 1.0,
    };
    let mut legs = [(Name::Leg(0), Target::Impedance(spring)); LEGS];
    let (mut index, mut leg) = (1, 1);
    while index < LEGS {
        legs[index].0 = Name::Leg(leg);
        (index, leg) = (index + 1, leg + 1);
    }
    legs
}

/// The script: speeds, angles, springs and torques, of every link.
pub const SCRIPT: &[Line] = &[
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

/// Time at which the robot is armed, in milliseconds: all motors have been heard by then.
pub const ARMED_AT: u64 = 100;

const MOTORS: [Name; 6 + LEGS] = [
    Name::Wheel,
    Name::Arm,
    Name::Hip,
    Name::Wrist,
    Name::Turret,
    Name::Flywheel,
    Name::Leg(0),
    Name::Leg(1),
    Name::Leg(2),
    Name::Leg(3),
    Name::Leg(4),
    Name::Leg(5),
    Name::Leg(6),
    Name::Leg(7),
];

/// The task: arms the robot, and repeats every 10 ms what the script said last to each motor.
pub async fn run(shared: &Shared) -> ! {
    Timer::at(Instant::from_millis(ARMED_AT)).await;
    // Refused after an emergency stop, and if its buses do not fit: it stays disarmed then.
    let _ = shared.switch.arm();
    let mut ticker = Ticker::every(Duration::from_millis(10));
    loop {
        let now = Instant::now().as_millis();
        let begun = SCRIPT.iter().filter(|(at, ..)| u64::from(*at) <= now);
        for name in MOTORS {
            let mut said = begun.clone().flat_map(|(_, _, targets)| targets.iter());
            let Some((_, target)) = said.rfind(|(whose, _)| *whose == name) else { continue };
            if shared.motor(name).command(*target).is_err() {
                // A mistake in this program: rather none drives than all others. The motor's status
                // counts it by reason.
                shared.switch.emergency_stop();
            }
        }
        ticker.next().await;
    }
}
