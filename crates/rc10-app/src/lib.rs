//! Control maths for robots: pure functions and small states, `no_std`, f32, no clock, no I/O.
//!
//! Every block is a **configuration** (a `Copy` struct you can write down, check and swap while
//! running) and a **state** that it works on. Time comes in as an argument.
//!
//! | module | contents |
//! |---|---|
//! | [`units`] | [`Rpm`], [`RotorRpm`], [`Degrees`], [`Amps`], [`Seconds`] …: units are types, and the two sides of a gearbox are two types |
//! | [`angle`] | [`TotalAngle`]: an exact angle of many turns; shortest way round a circle |
//! | [`pid`], [`schedule`] | positional PID; gains that depend on something |
//! | [`cascade`] | angle loop around speed loop, for any motor |
//! | [`feed_forward`] | the effort that a known motion takes |
//! | [`mechanism`] | homing, soft limits, jams, axes of several motors, feeders that count |
//! | [`swerve`] | bases on steered wheels |
//! | [`heading_hold`] | keeps the heading while the driver turns nothing |
//! | [`odometry`] | pose by wheels and gyro, with its covariance |
//! | [`path`] | paths by waypoints, timed within the wheels' limits, and a follower |
//! | [`transform`] | frames, points and poses in the plane, SE(2) |
//! | [`twist`] | motion in the plane, acceleration limit |
//! | [`base`] | bases on wheels: mecanum, omni, differential, any list; desaturation, residual |
//! | [`power`] | electrical power of a base: model, torques within a limit, a limiter that learns |
//! | [`profile`] | motion profiles within limits of velocity, acceleration and jerk |
#![no_std]
#![forbid(unsafe_code)]

pub mod angle;
pub mod base;
pub mod cascade;
pub mod feed_forward;
pub mod heading_hold;
pub mod maths;
pub mod mechanism;
pub mod odometry;
pub mod path;
pub mod pid;
pub mod power;
pub mod profile;
pub mod schedule;
mod states;
pub mod swerve;
mod text;
pub mod transform;
pub mod twist;
pub mod units;

mod config;

pub use angle::{CountsPerTurn, TotalAngle};
pub use base::{Base, BaseError, BaseMotion, Body, Tread, Wheel, WheelSpeeds};
pub use cascade::{Cascade, CascadeState};
pub use config::ConfigError;
pub use feed_forward::{FeedForward, Gravity, TwoJointArm};
pub use heading_hold::{HeadingHold, HeadingHoldConfig};
pub use odometry::{Covariance, Odometry, OdometryConfig, OdometryInput};
pub use pid::{PidConfig, PidInput, PidState};
pub use power::{Allocation, PowerConfig, PowerInput, PowerLimiter, PowerModel};
pub use profile::{AngleLimits, AngleProfile, AngleSetpoint, Profile, ProfileLimits, Setpoint};
pub use schedule::{GainSchedule, Gains};
pub use swerve::{Steering, Swerve, SwerveState};
pub use text::Text;
pub use transform::{FieldFrame, Frame, Point, Pose, RobotFrame};
pub use twist::{Twist, TwistLimiter, TwistLimits, TwistNotFinite};
pub use units::{
    Amps, Celsius, Degrees, Direction, ElectricalRpm, Gear, Joules, NewtonMetres, Radians,
    RotorRpm, Rpm, RpmPerSecond, RpmPerSecondSquared, Seconds, Volts, Watts,
};

/// The pages of `docs/control`: their examples are compiled and run.
#[cfg(doctest)]
mod pages {
    #[doc = include_str!("../../../docs/control/pid.md")]
    struct Pid;
    #[doc = include_str!("../../../docs/control/profiles.md")]
    struct Profiles;
    #[doc = include_str!("../../../docs/control/bases.md")]
    struct Bases;
    #[doc = include_str!("../../../docs/control/odometry.md")]
    struct Odometry;
    #[doc = include_str!("../../../docs/control/paths.md")]
    struct Paths;
    #[doc = include_str!("../../../docs/control/power.md")]
    struct Power;
    #[doc = include_str!("../../../docs/control/mechanisms.md")]
    struct Mechanisms;
}
