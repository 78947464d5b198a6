//! The chassis task: from the motion of the base to the speeds of its wheels.

use rc10_app::{Seconds, Twist};
use rc10_message::{Overrun, periodic};
use rc10_motor::ArmState;
use rc10_tasks::BaseDriver;
use rc10_time::Micros;

use crate::robot::{BaseCommand, Shared};
use crate::table::BASE;

/// Period of the chassis task.
pub const PERIOD: Micros = Micros::from_millis(5);
/// Age up to which a motion command is used.
const OLDEST_MOTION: Micros = Micros::from_millis(100);

/// The chassis task.
pub async fn run(shared: &Shared<'_>) -> ! {
    let mut base = BaseDriver::new(&BASE);
    periodic(PERIOD, Overrun::Skip, &shared.own.chassis_timing, async |tick| {
        let heard = shared.heading.read().map(|heard| heard.value);
        let yaw = heard.and_then(|heading| heading.total(tick.now));
        shared.own.heading.set(yaw.map_or(f32::NAN, |yaw| yaw.degrees().get()));
        let armed = shared.switch.state() == ArmState::Armed;
        let wish = shared.own.motion.newer_than(OLDEST_MOTION, tick.now).filter(|_| armed);
        let dt = Seconds::from_micros(tick.since_last.get());
        match wish {
            // Without a fresh wish the wheels get no commands: their bus makes them safe.
            None => base.rest(),
            Some(BaseCommand::Robot(wish)) => base.drive(shared, wish, dt),
            Some(BaseCommand::World(wish)) => {
                match heard.and_then(|heading| heading.direction(tick.now)) {
                    Some(heading) => base.drive_in_field(shared, wish, heading, dt),
                    // Without a heading "forward" is not known: the base stops.
                    None => base.drive(shared, Twist::STOP, dt),
                }
            }
        }
    })
    .await
}
