//! Inertial measurement: sensors, which way up the robot is, and the heading that it drives by.
//!
//! Axes: x forward, y left, z up, where rest is +9.81 m/s²; yaw counter-clockwise from above.

pub mod attitude;
pub mod bmi088;
mod heading;
pub mod heater;
pub mod wit;

pub use heading::{FRESH_FOR, Heading};
pub use wit::Wit;

/// One sample of an inertial sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sample {
    /// Acceleration less gravity's pull (+9.81 up at rest) along x, y, z, m/s².
    pub acceleration: [f32; 3],
    /// Rotation about x, y, z, rad/s.
    pub rotation: [f32; 3],
    /// The sensor's temperature, °C, if it knows.
    pub temperature: Option<f32>,
    /// An axis of `acceleration` is at the end of its range: it is more than that.
    pub acceleration_is_saturated: bool,
    /// An axis of `rotation` is.
    pub rotation_is_saturated: bool,
}

/// Standard gravity, m/s².
pub const GRAVITY: f32 = 9.806_65;
