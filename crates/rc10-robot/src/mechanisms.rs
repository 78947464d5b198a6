//! The mechanisms task: gimbal, feeder and lift.

use embassy_time::{Duration, Ticker};
use rc10_app::Rpm;
use rc10_can::Micros;
use rc10_motor::{ArmState, Link, Request, Target};

use crate::robot::Shared;
use crate::table::{FEEDER, LIFT, Name};

/// Longest age of a command that is followed.
const OLDEST_COMMAND: Micros = Micros::from_millis(100);

/// The mechanisms' task.
pub async fn run(shared: &Shared<'_>) -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(10));
    // The lift stands on its bottom at power-on. A motor that was not heard yet has no zero, and
    // does not move before it has one.
    let mut zeroed = [false; LIFT.len()];
    loop {
        ticker.next().await;
        for (motor, zeroed) in LIFT.into_iter().zip(&mut zeroed) {
            if *zeroed {
                continue;
            }
            let port = shared.motor(motor);
            let is_online = port.status().link == Link::Online;
            *zeroed = is_online && port.request(Request::SetZero).await.is_ok();
        }
        shared.live.tilt.set(tilt(shared).unwrap_or(f32::NAN));
        let Some(wish) = shared.mechanisms.newer_than(OLDEST_COMMAND, rc10_message::now()) else {
            continue;
        };
        shared.command(Name::Yaw, Target::Angle(wish.yaw));
        shared.command(Name::Pitch, Target::Angle(wish.pitch));
        // At its fastest as a PC has set it.
        let feeder = wish.feeder.get() / FEEDER.get() * shared.live.feeder.get();
        shared.command(Name::Feeder, Target::Speed(Rpm::new(feeder)));
        for (motor, zeroed) in LIFT.into_iter().zip(zeroed) {
            if zeroed {
                shared.command(motor, Target::TotalAngle(wish.lift));
            }
        }
    }
}

/// How far the lift is from level, in degrees of its shafts: they stand anywhere until each has been set
/// to zero at the bottom.
fn tilt(shared: &Shared<'_>) -> Option<f32> {
    if shared.switch.state() == ArmState::Disarmed {
        return None;
    }
    let angles = LIFT.map(|name| shared.motor(name).look(|status| status.feedback.total_angle));
    let [lowest, highest] = [angles.iter().min()?, angles.iter().max()?];
    Some(highest.minus(*lowest).degrees().get())
}
