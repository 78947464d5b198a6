//! The simulated world around a robot, and the robot set up in it.

pub(crate) mod black_box;
pub mod built;
pub mod console;
pub mod environment;
pub mod hang;
pub(crate) mod inputs;
pub mod kept;
pub mod ports;
pub mod robot;
