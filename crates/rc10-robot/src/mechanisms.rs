//! The mechanisms task: gimbal, feeder and lift.

use embassy_time::{Duration, Ticker};
use rc10_can::Micros;
use rc10_motor::{Link, MotorStatus, Request, Target};

use crate::robot::Io;
use crate::table::{LIFT, Name};

/// Age up to which a posture is used.
const OLDEST_POSTURE: Micros = Micros::from_millis(100);

/// The mechanisms' task.
pub async fn run(io: &Io<'_>) -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(10));
    // The lift stands on its bottom at power-on. A motor that was not heard yet has no zero, and
    // does not move before it has one; then this is the scale on which it counts.
    let mut zeroed = [None; LIFT.len()];
    loop {
        ticker.next().await;
        for (motor, zeroed) in LIFT.into_iter().zip(&mut zeroed) {
            if zeroed.is_some() {
                continue;
            }
            let port = io.motor(motor);
            let MotorStatus { link, feedback, .. } = port.status();
            if link == Link::Online && port.request(Request::SetZero).await.is_ok() {
                *zeroed = Some(feedback.total_angle.scale());
            }
        }
        let Some(wish) = io.posture.newer_than(OLDEST_POSTURE, rc10_bsp::now()) else { continue };
        io.command(Name::Yaw, Target::Angle(wish.yaw));
        io.command(Name::Pitch, Target::Angle(wish.pitch));
        io.command(Name::Feeder, Target::Speed(wish.feeder));
        let mut lift = wish.lift;
        for (motor, zeroed) in LIFT.into_iter().zip(zeroed) {
            if let Some(scale) = zeroed {
                // In the motor's own counts: divided here and once, not in the bus's tick.
                lift = lift.on(scale);
                io.command(motor, Target::TotalAngle(lift));
            }
        }
    }
}
