//! The heading of the robot in the world, by its IMU.

use embedded_io_async::Read;
use rc10_can::Micros;
use rc10_module::imu::{Heading, Wit, wit};
use rc10_module::{Reception, listen};
use rc10_motor::{ArmState, ArmSwitch};

/// Listens to an HWT101 or WT901 on a serial port, for ever; hands on each heading and its time.
///
/// **The world's forward is where the robot looked when it was armed**: the heading is zero then. An
/// IMU that was silent may have lost power and begun at another zero, and one that comes late knows
/// nothing of where the robot looked: until the robot is armed anew there is no heading then.
pub async fn listen_to_wit(
    port: impl Read,
    switch: &ArmSwitch,
    reception: &Reception,
    mut hear: impl FnMut(Heading, Micros),
) -> ! {
    let (mut heading, mut was_disarmed) = (Heading::default(), false);
    // How many gaps there were when it was heard last from a robot that was not armed.
    let mut gaps = None;
    listen(port, Wit, reception, |message, at| {
        let wit::Message::Angle { yaw, .. } = message else { return };
        heading.hear(yaw, at);
        let is_disarmed = switch.state() == ArmState::Disarmed;
        if is_disarmed {
            gaps = Some(heading.gaps());
        }
        if gaps == Some(heading.gaps()) {
            if was_disarmed && !is_disarmed {
                heading.zero();
            }
            hear(heading, at);
        }
        was_disarmed = is_disarmed;
    })
    .await
}
