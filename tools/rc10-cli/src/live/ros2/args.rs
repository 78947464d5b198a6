//! Arguments of the node.

use clap::Args;

/// The node of a robot.
#[derive(Args, Clone, Debug, Default)]
pub struct NodeArgs {
    /// Router of zenoh.
    #[arg(
        long,
        value_name = "LOCATOR",
        default_value = "tcp/localhost:7447",
        help = "Router of zenoh: zenohd or rmw_zenohd, which must run there"
    )]
    pub router: String,
    /// Namespace of topics, services and frames: one for each of two robots in a room
    #[arg(long, value_name = "NAME", default_value = "")]
    pub namespace: String,
    /// Domain of ROS.
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u32).range(0..=232),
        help = "Domain [default: ROS_DOMAIN_ID, or 0]"
    )]
    pub domain: Option<u32>,
    /// Messages a second of joints, odometry and IMU
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub rate: u32,
}
