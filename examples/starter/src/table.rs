//! The motor table: bus, identifier, gains and safe state of each motor; and the robot's measures.

use rc10_app::{Base, Body, Rpm, Twist, TwistLimits};
use rc10_module::remote::Receiver;
use rc10_motor::Entry;
use rc10_motor::Place::Bus;
use rc10_motor::dji::{Config, Dji, M2006, M3508};
use rc10_motor::rc10_app::Direction;
use rc10_tasks::{ArmingConfig, DrivenBase};

rc10_motor::motors! {
    /// Names of the motors.
    pub enum Name;
    /// The robot's motors: they stand here, and the buses borrow them.
    pub struct Motors;
    buses: [100.0; BUSES];
    lines: 0;
    FrontLeft: Dji = wheel("wheel front left", Config::new(&M3508, 1)),
    FrontRight: Dji = wheel("wheel front right", mirrored(2)),
    RearLeft: Dji = wheel("wheel rear left", Config::new(&M3508, 3)),
    RearRight: Dji = wheel("wheel rear right", mirrored(4)),
    Feeder: Dji = Entry::new("feeder", Bus(2), Config::new(&M2006, 1)),
}

/// On blocks, `rc10 live` may turn it: to see which one it is, and which way it turns.
const fn wheel(label: &'static str, config: Config) -> Entry<Config> {
    Entry::new(label, Bus(1), config).with_jog(Rpm::new(20.0))
}

/// Mounted the other way round.
const fn mirrored(id: u8) -> Config {
    Config::new(&M3508, id).with_direction(Direction::Reversed)
}

/// The buses that are used, of the three that the board has.
pub const BUSES: usize = 2;

/// The base: wheels of 76 mm radius, 400 mm by 440 mm apart, in the order of [`Base::mecanum`]. They stay
/// below the 480 rpm that an M3508 reaches unloaded.
pub const BASE: DrivenBase<Name, 4> = DrivenBase {
    wheels: [Name::FrontLeft, Name::FrontRight, Name::RearLeft, Name::RearRight],
    geometry: Base::mecanum(0.076, 0.20, 0.22, Rpm::new(400.0)),
    // With everything on it: an estimate, in kg and kg m².
    body: Body { mass_kg: 20.0, yaw_inertia_kg_m2: 1.2 },
    torque_constant: mirrored(1).torque_constant(),
    // At which its wheels do not slip: m/s² and rad/s².
    limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    // m/s and rad/s.
    full_stick: Twist::new(1.5, 1.5, 4.0),
};

/// The receiver of the remote control.
pub const RECEIVER: Receiver = Receiver::Dr16;

/// Right switch down disarms, left switch down stops; it arms only while both sticks are in the middle.
/// One that moves nothing may be left out, such as a throttle that stays where it is left:
/// `ArmingConfig { at_rest: &[Axis::LeftX, Axis::RightX], ..ArmingConfig::DEFAULT }.checked(RECEIVER)`.
pub const ARMING: ArmingConfig = ArmingConfig::DEFAULT.checked(RECEIVER);

/// Speed of the feeder while it is switched on.
pub const FEEDING: Rpm = Rpm::new(200.0);
