//! The chassis task: from the motion of the base to the speeds of its wheels.

use rc10_app::{FieldFrame, Frame, Seconds, Twist, TwistLimiter};
use rc10_can::Micros;
use rc10_message::{Overrun, periodic};
use rc10_motor::ArmState;

use crate::robot::{BaseCommand, Shared};
use crate::table::{BASE_LIMITS, DRIVEN};

/// Period of the chassis task.
pub const PERIOD: Micros = Micros::from_millis(5);
/// Age up to which a motion command is used.
const OLDEST_MOTION: Micros = Micros::from_millis(100);

/// The chassis task.
pub async fn run(shared: &Shared<'_>) -> ! {
    // While the base is driven in these axes.
    let mut robot_axes: Option<TwistLimiter> = None;
    let mut world_axes: Option<TwistLimiter<FieldFrame>> = None;
    let mut before: Option<Twist> = None;
    periodic(PERIOD, Overrun::Skip, &shared.chassis_timing, async |tick| {
        let heard = shared.heading.read().map(|heard| heard.value);
        let yaw = heard.and_then(|heading| heading.total(tick.now));
        shared.live.heading.set(yaw.map_or(f32::NAN, |yaw| yaw.degrees().get()));
        // Without a fresh wish the wheels get no commands: their bus makes them safe.
        let armed = shared.switch.state() == ArmState::Armed;
        let wish = shared.motion.newer_than(OLDEST_MOTION, tick.now).filter(|_| armed);
        let Some(wish) = wish else {
            (robot_axes, world_axes, before) = (None, None, None);
            return;
        };
        let dt = Seconds::from_micros(tick.since_last.get());
        // It may be rolling: the wheels begin with the speeds that they have. Other axes go on with those
        // that were commanded.
        let from = before.unwrap_or_else(|| DRIVEN.measured(shared).twist);
        let mut robot_twist = |wish| {
            world_axes = None;
            let limiter = robot_axes.get_or_insert_with(|| begun(from));
            limiter.update(&BASE_LIMITS, wish, dt)
        };
        let limited = match wish {
            BaseCommand::Robot(wish) => robot_twist(wish),
            BaseCommand::World(wish) => {
                match heard.and_then(|heading| heading.direction(tick.now)) {
                    Some(heading) => {
                        robot_axes = None;
                        let begin = || begun(from.out_of_frame(heading));
                        let limiter = world_axes.get_or_insert_with(begin);
                        let limited = limiter.update(&BASE_LIMITS, wish, dt);
                        limited.map(|twist| twist.into_frame(heading))
                    }
                    // Without a heading "forward" is not known: the base stops.
                    None => robot_twist(Twist::STOP),
                }
            }
        };
        // Without a twist there is no speed either: the wheels refuse it, and that is counted.
        let twist = limited.unwrap_or(Twist::new(f32::NAN, f32::NAN, f32::NAN));
        before = Some(if twist.is_finite() { twist } else { from });
        DRIVEN.drive(shared, from, (twist - from) * (1.0 / dt.get()));
    })
    .await
}

/// A limiter that goes on from this motion.
fn begun<F: Frame>(motion: Twist<F>) -> TwistLimiter<F> {
    let mut limiter = TwistLimiter::new();
    limiter.reset(motion);
    limiter
}
