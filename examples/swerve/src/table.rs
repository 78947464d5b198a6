//! The motor table: bus, id, gains and safe state of each motor; and the robot's measures.

use rc10::app::{Gravity, HeadingHoldConfig, Point, RobotFrame, Steering, Swerve};
use rc10::prelude::*;

rc10::robot! {
    own crate::Own;
    motors {
        DriveFrontLeft: Dji = drive(1),
        DriveFrontRight: Dji = drive(2),
        DriveRearLeft: Dji = drive(3),
        DriveRearRight: Dji = drive(4),
        SteerFrontLeft: Dji = steer(1),
        SteerFrontRight: Dji = steer(2),
        SteerRearLeft: Dji = steer(3),
        SteerRearRight: Dji = steer(4),
    }
}

/// The motors that turn the wheels, in the order of [`BASE`].
pub const DRIVES: [Name; 4] =
    [Name::DriveFrontLeft, Name::DriveFrontRight, Name::DriveRearLeft, Name::DriveRearRight];

/// The motors that steer them, in the same order.
pub const STEERS: [Name; 4] =
    [Name::SteerFrontLeft, Name::SteerFrontRight, Name::SteerRearLeft, Name::SteerRearRight];

/// Total angles of the steering motors while their wheels look ahead, read once on the robot.
///
/// A GM6020 sits on the steering axis without a gear, and its encoder is absolute within the turn. So
/// these hold after every power-on, however the wheels then look. (With a gear, or an M2006, a module
/// needs a switch or a stop to find its zero.)
pub const AHEAD: [TotalAngle; 4] = [
    TotalAngle::from_degrees(35),
    TotalAngle::from_degrees(212),
    TotalAngle::from_degrees(301),
    TotalAngle::from_degrees(98),
];

const fn drive(id: u8) -> Entry<Config> {
    let config = Config::new(&M3508, id).with_feed_forward(ROLLING);
    Entry::new(Bus(1), config).with_jog(Rpm::new(20.0))
}

/// What a wheel itself takes, in A: friction in its gearbox and on the floor; wheel and rotor are 0.0052
/// kg m², and an M3508 makes 0.3 N m/A. What the robot on it takes is in [`BASE`].
const ROLLING: FeedForward =
    FeedForward { friction: 0.4, per_rpm: 0.001, per_rpm_s: 0.0018, gravity: Gravity::None };

const fn steer(id: u8) -> Entry<Config> {
    Entry::new(Bus(2), Config::new(&GM6020_CURRENT, id).with_cascade(STEERING))
}

/// A fork with its wheel and the rotor are 0.0024 kg m², and a GM6020 makes 0.741 N m/A: stiffer than
/// the gains that it comes with, which are for a turret.
const STEERING: Cascade = Cascade {
    speed: PidConfig::within(3.0).kp(0.035).ki(0.5),
    angle: PidConfig::within(250.0).kp(4.0),
    outer_divider: 1,
    acceleration: RpmPerSecond::new(3000.0),
    feed_forward: FeedForward { friction: 0.15, per_rpm_s: 0.00034, ..FeedForward::NONE },
};

/// The base: wheels of 60 mm radius in a square of 400 mm, that are steered through any number of
/// turns. The wheels stay below the 480 rpm that an M3508 reaches unloaded.
pub const BASE: DrivenSwerve<Name, 4> = DrivenSwerve {
    drives: DRIVES,
    steers: STEERS,
    ahead: AHEAD,
    geometry: Swerve::sound(PLACES, 0.06, Rpm::new(450.0), Steering::Endless),
    // With all that is on it, wheels included; our estimate.
    body: Body { mass_kg: 20.0, yaw_inertia_kg_m2: 1.2 },
    torque_constant: Config::new(&M3508, 1).torque_constant(),
    // 5 m/s² of a wheel with both, below what it slips at and below the 6.3 m/s² to which the loops of its
    // motor keep it.
    limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 7.0 },
    // 430 rpm of the fastest wheel with all of them.
    full_stick: Twist::new(1.3, 1.3, 3.0),
};

/// Front left, front right, rear left, rear right.
const PLACES: [Point<RobotFrame>; 4] =
    [Point::new(0.2, 0.2), Point::new(0.2, -0.2), Point::new(-0.2, 0.2), Point::new(-0.2, -0.2)];

/// It keeps looking where it looks by its wheels: the robot has no IMU.
pub const HEADING_HOLD: HeadingHoldConfig = HeadingHoldConfig {
    kp: 5.0,
    kd: 0.1,
    max_rate_rad_s: 2.0,
    deceleration_rad_s2: 6.0,
    deadband_rad_s: 0.05,
};

const _: () = assert!(BASE.limits.validate().is_ok() && HEADING_HOLD.validate().is_ok());
