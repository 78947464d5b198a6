//! The IMU's task: the heading of the robot becomes a topic.

use embedded_io_async::Read;
use rc10_tasks::heading::listen_to_wit;

use crate::robot::Shared;

/// Listens to an HWT101 or WT901 on a serial port.
pub async fn run(shared: &Shared<'_>, port: impl Read) -> ! {
    listen_to_wit(port, &shared.switch, &shared.imu_reception, |heading, at| {
        shared.heading.set(heading, at);
    })
    .await
}
