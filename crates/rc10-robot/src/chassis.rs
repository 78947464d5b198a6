//! From the twist the base shall have to the speeds of its wheels.

use rc10_app::{Seconds, TwistLimiter};
use rc10_bsp::{Overrun, periodic};
use rc10_can::Micros;
use rc10_motor::{ArmState, Target};

use crate::robot::Io;
use crate::table::{BASE, BASE_LIMITS, WHEELS};

/// How often.
pub const PERIOD: Micros = Micros::from_millis(5);
/// A twist older than this is nobody's wish any more.
const OLDEST_TWIST: Micros = Micros::from_millis(100);

/// The chassis task.
pub async fn run(io: &Io<'_>) -> ! {
    let mut limiter = TwistLimiter::new();
    periodic(PERIOD, Overrun::Skip, &io.chassis_timing, async |tick| {
        // Without a fresh wish the wheels get no commands: their bus makes them safe. Armed again,
        // the base starts from standstill.
        let armed = io.switch.state() == ArmState::Armed;
        let wish = io.twist.newer_than(OLDEST_TWIST, tick.now);
        let Some(wish) = wish.filter(|_| armed) else {
            limiter = TwistLimiter::new();
            return;
        };
        let dt = Seconds::from_micros(tick.since_last.get());
        let limited = limiter.update(&BASE_LIMITS, wish, dt);
        // A twist that is not finite is treated as none at all.
        let Ok(wheels) = limited.and_then(|twist| BASE.inverse(twist)) else { return };
        for (name, speed) in WHEELS.into_iter().zip(wheels.speeds) {
            // Refused only while the bus is not running yet.
            let _ = io.motor(name).command(Target::Speed(speed));
        }
    })
    .await
}
