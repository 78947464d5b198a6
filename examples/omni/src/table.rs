//! The motor table: bus, id, gains and safe state of each motor; the robot's measures, and its path.

use core::f32::consts::{FRAC_PI_2, PI};
use core::num::NonZeroU8;
use rc10::prelude::*;

use rc10::app::mechanism::AbsoluteEncoder;
use rc10::app::path::{FollowerConfig, Path, PathLimits, Waypoint};
use rc10::app::{
    AngleLimits, GainSchedule, Gains, Gravity, HeadingHoldConfig, Radians, RpmPerSecondSquared,
};
use rc10::motor::damiao::{self, Damiao};
use rc10::motor::vesc::{self, Currents, ElectricalScale, Vesc};

rc10::robot! {
    own crate::Own;
    imu wit;
    motors {
        WheelFrontLeft: Dji = wheel(1),
        WheelRearLeft: Dji = wheel(2),
        WheelRearRight: Dji = wheel(3),
        WheelFrontRight: Dji = wheel(4),
        Arm: Damiao = Entry::new(Bus(2), ARM).with_safety(Safety::HOLD),
        Turret: Dji = Entry::new(Bus(2), Config::new(&GM6020_VOLTAGE, 1)),
        Flywheel: Vesc = Entry::new(Bus(3), FLYWHEEL),
    }
}

const fn wheel(id: u8) -> Entry<Config> {
    Entry::new(Bus(1), Config::new(&M3508, id).with_feed_forward(ROLLING))
}

/// What a wheel itself takes, in A: friction in its gearbox and on the floor; wheel and rotor are 0.0052
/// kg m², and an M3508 makes 0.3 N m/A. What the robot on it takes is in [`BASE`].
const ROLLING: FeedForward =
    FeedForward { friction: 0.4, per_rpm: 0.001, per_rpm_s: 0.0018, gravity: Gravity::None };

/// In MIT mode; efforts in N m. The low byte of its identifier is beyond those of DJI's feedback.
pub const ARM: damiao::Config = damiao::Config::new(
    damiao::models::J4310,
    0x11,
    0x31,
    damiao::Control::Mit(Cascade {
        speed: PidConfig::within(7.0).kp(0.063).ki(0.5),
        angle: PidConfig::within(150.0).kp(1.3),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(1000.0),
        // It weighs 0.5 N m where it is level, and has 0.02 kg m².
        feed_forward: FeedForward {
            per_rpm_s: 0.002,
            gravity: Gravity::Arm { effort: 0.5, level: Degrees::new(0.0) },
            ..FeedForward::NONE
        },
    }),
);

/// Seven pole pairs, no gear, currents below what VESC Tool allows it.
pub const FLYWHEEL: vesc::Config = vesc::Config::new(
    1,
    ElectricalScale::new(NonZeroU8::new(7).unwrap(), Gear::DIRECT),
    Currents { limit: Amps::new(40.0), brake: Amps::new(15.0), handbrake: Amps::new(10.0) },
);

/// The base: omni wheels of 76 mm radius, 250 mm from the middle, in the order of [`Base::omni_4`]. They stay
/// below the 480 rpm that an M3508 reaches unloaded.
pub const BASE: DrivenBase<Name, 4> = DrivenBase {
    wheels: [
        Name::WheelFrontLeft,
        Name::WheelRearLeft,
        Name::WheelRearRight,
        Name::WheelFrontRight,
    ],
    geometry: Base::omni_4(0.076, 0.25, Rpm::new(400.0)),
    // With everything on it.
    body: Body { mass_kg: 12.0, yaw_inertia_kg_m2: 0.7 },
    torque_constant: Config::new(&M3508, 1).torque_constant(),
    // At which its wheels do not slip.
    limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    full_stick: Twist::new(1.5, 1.5, 4.0),
};

/// How firmly it keeps its heading, by its speed in m/s: gently while it stands, so that it does not hunt
/// on its rollers.
pub const HOLD_GAINS: GainSchedule<2> = GainSchedule::checked([
    (0.0, Gains { kp: 2.5, ki: 0.0, kd: 0.0 }),
    (0.5, Gains { kp: 5.0, ki: 0.0, kd: 0.0 }),
]);

/// How it keeps its heading while it is driven by hand; its `kp` is that of [`HOLD_GAINS`].
pub const HOLD: HeadingHoldConfig = HeadingHoldConfig {
    kp: HOLD_GAINS.at(0.0).kp,
    kd: 0.0,
    max_rate_rad_s: 2.0,
    deceleration_rad_s2: BASE.limits.angular_rad_s2,
    deadband_rad_s: 0.05,
};

/// The path: once around a rectangle of 1.8 m by 1.2 m with round corners. It begins and ends on a side,
/// and on the way the robot turns once to the left.
pub const PATH: Path<6> = Path::sound([
    Waypoint::new(0.0, 0.0, Radians::new(0.0)),
    Waypoint::new(1.2, 0.0, Radians::new(0.0)).rounded(0.4),
    Waypoint::new(1.2, 1.2, Radians::new(FRAC_PI_2)).rounded(0.4),
    Waypoint::new(-0.6, 1.2, Radians::new(PI)).rounded(0.4),
    Waypoint::new(-0.6, 0.0, Radians::new(-FRAC_PI_2)).rounded(0.4),
    Waypoint::new(0.0, 0.0, Radians::new(0.0)),
]);
/// Slower than by hand: the follower shall have something to correct with.
pub const PATH_LIMITS: PathLimits = PathLimits {
    twist: TwistLimits { linear_m_s2: 2.0, angular_rad_s2: 8.0 },
    max_speed_m_s: 1.5,
    wheel_share: 0.9,
};
/// How it follows.
pub const FOLLOWER: FollowerConfig = FollowerConfig::DEFAULT;
/// It gives its path up when it has waited for so long in all, or is not there so long after the path's
/// end.
pub const PATIENCE: Seconds = Seconds::new(1.5);
/// A stick that is moved farther than this share takes over.
pub const TAKES_OVER: f32 = 0.1;
/// One that is out by less is let go.
pub const REST: f32 = 0.02;

/// Speed of the arm with the stick at its end: 90 degrees per second.
pub const ARM_RATE: Rpm = Rpm::new(15.0);
/// Its encoder says 0 where it is level. It rests on a stop 5 degrees below, where that says 355.
pub const ARM_ENCODER: AbsoluteEncoder = AbsoluteEncoder {
    level: TotalAngle::ZERO,
    gear: Gear::DIRECT,
    lower: TotalAngle::from_degrees(-5),
    upper: TotalAngle::from_degrees(130),
    tolerance: Degrees::new(3.0),
};
/// The angles that it is driven to, from its level.
pub const ARM_RANGE: [TotalAngle; 2] = [TotalAngle::ZERO, TotalAngle::from_degrees(120)];
/// Limits of the arm's motion.
pub const ARM_LIMITS: AngleLimits = AngleLimits {
    velocity: ARM_RATE,
    acceleration: RpmPerSecond::new(200.0),
    jerk: RpmPerSecondSquared::new(4000.0),
};
/// Speed of the turret with the dial at its end: 180 degrees per second.
pub const TURRET_RATE: Rpm = Rpm::new(30.0);
/// Limits of the turret's motion.
pub const TURRET_LIMITS: AngleLimits = AngleLimits {
    velocity: TURRET_RATE,
    acceleration: RpmPerSecond::new(150.0),
    jerk: RpmPerSecondSquared::new(3000.0),
};
/// Speed of the flywheel while it is switched on.
pub const SHOOTING: Rpm = Rpm::new(1500.0);

const _: () = assert!(
    FOLLOWER.validate().is_ok()
        && PATH_LIMITS.validate().is_ok()
        && HOLD.validate().is_ok()
        && ARM_ENCODER.validate().is_ok()
        && ARM_LIMITS.validate().is_ok()
        && TURRET_LIMITS.validate().is_ok()
);
