//! The gimbal, the feeder and the lift.

use embassy_time::{Duration, Ticker};
use rc10_can::Micros;
use rc10_motor::{Link, Request, Target};

use crate::robot::Io;
use crate::table::{LIFT, Name};

/// A posture older than this is nobody's wish any more.
const OLDEST_POSTURE: Micros = Micros::from_millis(100);

/// The mechanisms' task.
pub async fn run(io: &Io<'_>) -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(10));
    // The lift stands on its bottom at power-on. A motor that was not heard yet has no zero, and
    // does not move before it has one.
    let mut zeroed = [false; LIFT.len()];
    loop {
        ticker.next().await;
        for (motor, zeroed) in LIFT.into_iter().zip(&mut zeroed) {
            let port = io.motor(motor);
            if !*zeroed && port.status().link == Link::Online {
                *zeroed = port.request(Request::SetZero).await.is_ok();
            }
        }
        let Some(wish) = io.posture.newer_than(OLDEST_POSTURE, rc10_bsp::now()) else { continue };
        let command = |name, target| {
            // Refused only while the bus is not running yet, or if the wish is not finite: then
            // the command before expires.
            let _ = io.motor(name).command(target);
        };
        command(Name::Yaw, Target::Angle(wish.yaw));
        command(Name::Pitch, Target::Angle(wish.pitch));
        command(Name::Feeder, Target::Speed(wish.feeder));
        for (motor, _) in LIFT.into_iter().zip(zeroed).filter(|(_, zeroed)| *zeroed) {
            command(motor, Target::TotalAngle(wish.lift));
        }
    }
}
