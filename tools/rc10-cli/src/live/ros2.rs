//! `rc10 ros2`: the robot as a node of ROS 2 over zenoh, in the forms of `rmw_zenoh`.
//!
//! * `bridge`: between the link and the node, for ever. `told`: what the robot tells, as messages.
//! * `node`: the node's publishers. `given`: commands, services and parameters.

#[cfg(feature = "ros2")]
mod bridge;
#[cfg(feature = "ros2")]
mod given;
#[cfg(feature = "ros2")]
mod node;
#[cfg(feature = "ros2")]
mod told;

use anyhow::Result;
use clap::Args;

#[cfg(feature = "ros2")]
pub use self::bridge::Bridge;
use super::source::SourceArgs;
use crate::world::robot::Robot;

/// Arguments of `rc10 ros2`.
#[derive(Args, Clone, Debug, Default)]
pub struct Ros2Args {
    #[command(flatten)]
    pub(crate) at: SourceArgs,
    #[command(flatten)]
    pub(crate) node: NodeArgs,
}

/// The node of a robot.
#[derive(Args, Clone, Debug, Default)]
pub struct NodeArgs {
    /// Router of zenoh: zenohd or rmw_zenohd, which must run there
    #[arg(long, value_name = "LOCATOR", default_value = "tcp/localhost:7447")]
    pub router: String,
    /// Namespace of topics, services and frames: one for each of two robots in a room
    #[arg(long, value_name = "NAME", default_value = "")]
    pub namespace: String,
    /// Domain [default: ROS_DOMAIN_ID, or 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=232))]
    pub domain: Option<u32>,
    /// Messages a second of joints, odometry and IMU
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub rate: u32,
}

/// Makes the robot a node of ROS 2, until Ctrl-C.
#[cfg(feature = "ros2")]
pub fn ros2(args: &Ros2Args, robot: Robot<'_>) -> Result<()> {
    use std::sync::atomic::Ordering;

    use crate::live::session::stop;

    let ended = stop()?;
    let (estimate, yaw) = (robot.description().estimate, robot.description().yaw);
    let connection = args.at.open(robot, Some(1.0))?;
    let mut bridge = Bridge::new(connection, &args.node, estimate, yaw)?;
    while !ended.load(Ordering::Relaxed) {
        bridge.step()?;
    }
    Ok(())
}

/// Fails always: this build is without ROS 2.
#[cfg(not(feature = "ros2"))]
pub fn ros2(_: &Ros2Args, _: Robot<'_>) -> Result<()> {
    anyhow::bail!(
        "rc10 ros2: this program was built without it, for it takes 280 crates more: cargo run --features ros2 -- ros2"
    )
}
