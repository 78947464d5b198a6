//! The motor table: bus, id, gains and safe state of each motor; and the robot's measures.

use core::num::NonZeroU8;

use rc10_app::{
    Amps, Base, Cascade, FeedForward, Gear, PidConfig, Rpm, RpmPerSecond, Twist, TwistLimits,
};
use rc10_module::remote::Receiver;
use rc10_motor::Place::Bus;
use rc10_motor::damiao::{self, Damiao};
use rc10_motor::dji::{self, Dji, GM6020_VOLTAGE, M3508};
use rc10_motor::vesc::{self, Currents, ElectricalScale, Vesc};
use rc10_motor::{Entry, Safety};
use rc10_tasks::ArmingConfig;

rc10_motor::motors! {
    /// Names of the motors.
    pub enum Name;
    /// The robot's motors: they stand here, and the buses borrow them.
    pub struct Motors;
    buses: [100.0; BUSES];
    lines: 0;
    FrontLeft: Dji = wheel("wheel front left", 1),
    RearLeft: Dji = wheel("wheel rear left", 2),
    RearRight: Dji = wheel("wheel rear right", 3),
    FrontRight: Dji = wheel("wheel front right", 4),
    Arm: Damiao = Entry::new("arm", Bus(2), ARM).with_safety(Safety::HOLD),
    Turret: Dji = Entry::new("turret", Bus(2), dji::Config::new(&GM6020_VOLTAGE, 1)),
    Flywheel: Vesc = Entry::new("flywheel", Bus(3), FLYWHEEL),
}

/// The buses of the board.
pub const BUSES: usize = 3;

/// The wheels, in the order of [`Base::omni_4`].
pub const WHEELS: [Name; 4] = [Name::FrontLeft, Name::RearLeft, Name::RearRight, Name::FrontRight];

const fn wheel(label: &'static str, id: u8) -> Entry<dji::Config> {
    Entry::new(label, Bus(1), dji::Config::new(&M3508, id))
}

/// In MIT mode; efforts in N m. The low byte of its identifier is beyond those of DJI's feedback.
pub const ARM: damiao::Config = damiao::Config::new(
    damiao::models::J4310,
    0x11,
    0x31,
    damiao::Control::Mit(Cascade {
        speed: PidConfig::new(0.063, 0.5, 0.0, 7.0),
        angle: PidConfig::new(1.3, 0.0, 0.0, 150.0),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    }),
);

/// Seven pole pairs, no gear, currents below what VESC Tool allows it.
pub const FLYWHEEL: vesc::Config = vesc::Config::new(
    1,
    ElectricalScale::new(NonZeroU8::new(7).unwrap(), Gear::DIRECT),
    Currents { limit: Amps::new(40.0), brake: Amps::new(15.0), handbrake: Amps::new(10.0) },
);

/// The receiver of the remote control.
pub const RECEIVER: Receiver = Receiver::Dr16;

/// Right switch down disarms, left switch down stops.
pub const ARMING: ArmingConfig = ArmingConfig::DEFAULT.checked(RECEIVER);

/// The base: omni wheels of 76 mm radius, 250 mm from the middle. The wheels stay below the 480 rpm
/// that an M3508 reaches unloaded.
pub const BASE: Base<4> = Base::omni_4(0.076, 0.25, Rpm::new(400.0));

/// Speed of the base with the sticks at their ends.
pub const FULL_STICK: Twist = Twist::new(1.5, 1.5, 4.0);
/// Largest accelerations of the base at which its wheels do not slip.
pub const BASE_LIMITS: TwistLimits =
    TwistLimits { linear_acceleration: 3.0, angular_acceleration: 12.0 };

/// Speed of the arm with the stick at its end, degrees per second, and the angles that it may take.
pub const ARM_RATE: f32 = 90.0;
/// See [`ARM_RATE`].
pub const ARM_RANGE: [f32; 2] = [0.0, 120.0];
/// Speed of the turret with the stick at its end, degrees per second.
pub const TURRET_RATE: f32 = 180.0;
/// Speed of the flywheel while it is switched on.
pub const SHOOTING: Rpm = Rpm::new(1500.0);
