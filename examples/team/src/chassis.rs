//! The chassis task: from the motion of the base to the speeds of its wheels.

use crate::robot::BaseCommand;
use crate::table::{BASE, Shared};
use rc10::prelude::*;

/// Period of the chassis task.
pub const PERIOD: Micros = Micros::from_millis(5);
/// Age up to which a motion command is used.
const OLDEST_MOTION: Micros = Micros::from_millis(100);

/// The chassis task.
pub async fn run(shared: &Shared<'_>) -> ! {
    let mut base = BaseDriver::new(&BASE);
    let mut every = Every::new(PERIOD).with_statistics(&shared.own.chassis_timing);
    loop {
        let tick = every.next().await;
        let heard = shared.heading.read().map(|heard| heard.value);
        let yaw = heard.and_then(|heading| heading.total(tick.now));
        shared.own.heading.set(yaw.map_or(f32::NAN, |yaw| yaw.degrees().get()));
        let armed = shared.switch.state() == ArmState::Armed;
        let wish = shared.own.motion.newer_than(OLDEST_MOTION, tick.now).filter(|_| armed);
        match wish {
            // Without a fresh wish the wheels get no commands: their bus makes them safe.
            None => base.rest(),
            Some(BaseCommand::Robot(wish)) => base.drive(shared, wish, tick.dt),
            Some(BaseCommand::World(wish)) => {
                match heard.and_then(|heading| heading.direction(tick.now)) {
                    Some(heading) => base.drive_in_field(shared, wish, heading, tick.dt),
                    // Without a heading "forward" is not known: the base stops.
                    None => base.drive(shared, Twist::STOP, tick.dt),
                }
            }
        }
    }
}
