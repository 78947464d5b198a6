//! Inertial measurement units, and the heading that a robot drives by.

mod heading;
pub mod wit;

pub use heading::{FRESH_FOR, Heading};
pub use wit::Wit;
