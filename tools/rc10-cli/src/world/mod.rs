//! The simulated world around a robot, and the robot set up in it.

pub mod built;
pub mod console;
pub mod environment;
pub mod hang;
pub mod kept;
pub mod ports;
pub mod robot;
