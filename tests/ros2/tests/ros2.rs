//! `rc10 ros2` before ROS 2 nodes of two other makers, on the simulated and the emulated robot, and what is unplugged
//! and restarted meanwhile.
#![expect(clippy::unwrap_used, reason = "a test may panic")]
#![expect(
    clippy::float_cmp,
    clippy::cast_possible_truncation,
    reason = "it compares what was sent; small numbers"
)]

#[path = "ros2/joints.rs"]
mod joints;
#[cfg(unix)]
#[path = "ros2/late.rs"]
mod late;
#[path = "ros2/latency.rs"]
mod latency;
#[path = "ros2/orders.rs"]
mod orders;
#[path = "../../common/python.rs"]
mod python;
#[path = "ros2/scene.rs"]
mod scene;
#[path = "../../common/scratch.rs"]
mod scratch;
#[path = "ros2/witnesses.rs"]
mod witnesses;
