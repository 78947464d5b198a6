//! The IMU's task: the heading of the robot becomes a topic.

use embedded_io_async::Read;
use rc10_tasks::heading;

use crate::robot::Shared;

/// Listens to an HWT101 or WT901 on a serial port.
pub async fn run(shared: &Shared<'_>, port: impl Read) -> ! {
    heading::listen_for(shared, port).await
}
