//! The IMU's task: the heading of the robot becomes a topic.

use embedded_io_async::Read;
use rc10_module::imu::{Heading, Wit, wit};
use rc10_module::listen;
use rc10_motor::ArmState;

use crate::robot::Shared;

/// Listens to an HWT101 or WT901 on a serial port.
///
/// **The world's forward is where the robot looked when it was armed**: the heading is zero then. An
/// IMU that was silent may have lost power and begun at another zero, and one that comes late knows
/// nothing of where the robot looked: until the robot is armed anew there is no heading then.
pub async fn run(shared: &Shared<'_>, port: impl Read) -> ! {
    let (mut heading, mut was_disarmed) = (Heading::default(), false);
    // How many gaps there were when it was heard last from a robot that was not armed.
    let mut gaps = None;
    listen(port, Wit, &shared.imu_reception, |message, at| {
        let wit::Message::Angle { yaw, .. } = message else { return };
        heading.hear(yaw, at);
        let is_disarmed = shared.switch.state() == ArmState::Disarmed;
        if is_disarmed {
            gaps = Some(heading.gaps());
        }
        if gaps == Some(heading.gaps()) {
            if was_disarmed && !is_disarmed {
                heading.zero();
            }
            shared.heading.set(heading, at);
        }
        was_disarmed = is_disarmed;
    })
    .await
}
