//! TEMP.
use crate::robot::Io;
use embedded_io_async::Read;
use rc10_module::imu::{Wit, wit::Message};
/// TEMP.
pub async fn run(io: &Io<'_>, port: impl Read) -> ! {
    rc10_module::listen(port, Wit, &io.imu_reception, |frame, at| {
        if let Message::Angle { yaw, .. } = frame {
            io.heading.set(yaw, at)
        }
    })
    .await
}
