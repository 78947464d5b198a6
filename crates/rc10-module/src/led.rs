//! LED strips: how colours go down the wire, and what they say about the robot.

pub mod pattern;
pub mod ws2812;
