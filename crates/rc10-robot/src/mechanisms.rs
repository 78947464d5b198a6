//! The gimbal, the feeder and the lift.

use embassy_time::{Duration, Ticker};
use rc10_app::TotalAngle;
use rc10_can::Micros;
use rc10_motor::Target;

use crate::robot::Io;
use crate::table::{LIFT, Name};

/// A posture older than this is nobody's wish any more.
const OLDEST_POSTURE: Micros = Micros::from_millis(100);

/// The mechanisms' task.
pub async fn run(io: &Io<'_>) -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(10));
    loop {
        ticker.next().await;
        let Some(wish) = io.posture.newer_than(OLDEST_POSTURE, rc10_bsp::now()) else { continue };
        let command = |name, target| {
            // Refused only while the bus is not running yet, or if the wish is not finite: then
            // the command before expires.
            let _ = io.motor(name).command(target);
        };
        command(Name::Yaw, Target::Angle(wish.yaw));
        command(Name::Pitch, Target::Angle(wish.pitch));
        command(Name::Feeder, Target::Speed(wish.feeder));
        for motor in LIFT {
            command(motor, Target::TotalAngle(TotalAngle::from_degrees(wish.lift)));
        }
    }
}
