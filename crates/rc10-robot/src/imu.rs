//! Which way the robot looks becomes a topic.

use embedded_io_async::Read;
use rc10_module::imu::{Heading, Wit, wit};
use rc10_module::listen;
use rc10_motor::ArmState;

use crate::robot::Io;

/// Listens to an HWT101 or WT901 on a serial port.
///
/// **The world's forward is where the robot looked when it was armed**: the heading is zero then. An
/// IMU that was silent may have lost power and begun at another zero, so from then on there is no
/// heading, until the robot is armed anew.
pub async fn run(io: &Io<'_>, port: impl Read) -> ! {
    let (mut heading, mut gaps, mut was_disarmed) = (Heading::default(), 0, true);
    listen(port, Wit, &io.imu_reception, |message, at| {
        let wit::Message::Angle { yaw, .. } = message else { return };
        heading.hear(yaw, at);
        let is_disarmed = io.switch.state() == ArmState::Disarmed;
        if was_disarmed && !is_disarmed {
            heading.zero();
            gaps = heading.gaps();
        }
        was_disarmed = is_disarmed;
        if heading.gaps() == gaps {
            io.heading.set(heading, at);
        }
    })
    .await
}
