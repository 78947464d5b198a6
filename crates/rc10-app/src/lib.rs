//! Control maths for robots: pure functions and small states, `no_std`, f32, no clock, no I/O.
//!
//! Every block is a **configuration** (a `Copy` struct you can write down, check and swap while
//! running) and a **state** that it works on. Time comes in as an argument.
//!
//! | module | contents |
//! |---|---|
//! | [`units`] | [`Rpm`], [`RotorRpm`], [`Degrees`], [`Amps`], [`Seconds`] …: units are types, and the two sides of a gearbox are two types |
//! | [`angle`] | [`TotalAngle`]: an exact angle of many turns; shortest way round a circle |
//! | [`pid`] | positional PID |
//! | [`profile`] | motion profiles within limits of velocity, acceleration and jerk |
//! | [`low_pass`] | first-order low-pass |
//! | [`transform`] | poses in the plane, SE(2) |
//! | [`chassis`] | twists, mecanum wheels, desaturation, acceleration limit |
#![no_std]
#![forbid(unsafe_code)]

pub mod angle;
pub mod cascade;
pub mod chassis;
pub mod low_pass;
pub mod maths;
pub mod pid;
pub mod profile;
mod text;
pub mod transform;
pub mod units;

mod config;

pub use angle::{CountsPerTurn, TotalAngle};
pub use cascade::{Cascade, CascadeState};
pub use chassis::{Mecanum, Twist, TwistLimiter, TwistLimits, TwistNotFinite, WheelSpeeds};
pub use config::ConfigError;
pub use low_pass::{LowPass, LowPassConfig};
pub use pid::{PidConfig, PidInput, PidState};
pub use profile::{AngleProfile, AngleSetpoint, Profile, ProfileLimits, Setpoint};
pub use text::Text;
pub use transform::Pose;
pub use units::{
    Amps, Celsius, Degrees, Direction, ElectricalRpm, Gear, NewtonMetres, Radians, RotorRpm, Rpm,
    RpmPerSecond, Seconds, Volts,
};
