//! `rc10 ros2`: the robot as a node of ROS 2 over zenoh, in the forms of `rmw_zenoh`.
//!
//! * `bridge`: between the link and the node, for ever. `told`: what the robot tells, as messages.
//! * `node`: the node's publishers. `given`: commands, services and parameters.

mod args;
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

pub use self::args::NodeArgs;
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

/// Makes the robot a node of ROS 2, until Ctrl-C.
#[cfg(feature = "ros2")]
pub fn ros2(args: &Ros2Args, robot: Robot<'_>) -> Result<()> {
    use std::sync::atomic::Ordering;

    use crate::live::session::stop;

    let ended = stop()?;
    let (estimate, yaw) = (robot.description().estimate, robot.description().yaw);
    let at = SourceArgs { waits: true, ..args.at.clone() };
    let connection = at.open(robot, Some(1.0))?;
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
