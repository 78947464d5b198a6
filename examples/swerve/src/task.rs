//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; middle: armed, by hand; up: armed, a PC moves the base ([auto](rc10::live::Auto)) |
//! | left switch | down: emergency stop |
//! | left stick | moves the base |
//! | right stick | to the side: turns it |
//!
//! While the right stick is let go the robot keeps its heading. [`rc10::tasks::arming`] says how it is
//! armed, and what happens when the remote is lost.

use rc10::app::{BaseMotion, HeadingHold, Odometry, OdometryConfig, OdometryInput, Pose};
use rc10::motor::Link;
use rc10::prelude::*;

use crate::table::{BASE, HEADING_HOLD};
use crate::{Robot, Shared};

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        let (mut arming, mut base) = (Arming::of::<Self>(), BaseDriver::new(&BASE));
        let mut odometry = Odometry::new(Pose::IDENTITY);
        let (mut hold, mut every) = (HeadingHold::new(), Every::millis(5));
        loop {
            let dt = every.next().await.dt;
            let motion = BASE.measured(shared);
            if BASE.drives.into_iter().chain(BASE.steers).all(|name| is_heard(shared, name)) {
                count(&mut odometry, &motion, shared, dt);
            }
            // Without a remote no motor is commanded: 50 ms later each is safe.
            let Some(remote) = shared.obey(&mut arming) else {
                base.rest();
                hold.release();
                continue;
            };
            let auto = shared.own.auto.twist(remote.right_switch == Switch::Up);
            let mut wish = auto.unwrap_or_else(|| BASE.sticks(&remote));
            let heading = odometry.pose().heading;
            wish.wz = hold.update(&HEADING_HOLD, wish.wz, heading, motion.twist.wz);
            base.drive(shared, wish, dt);
        }
    }
}

fn is_heard(shared: &Shared<'_>, name: crate::Name) -> bool {
    shared.motor(name).status().link == Link::Online
}

/// Goes on with the pose, and shows it.
fn count(odometry: &mut Odometry, motion: &BaseMotion<4>, shared: &Shared<'_>, dt: Seconds) {
    let input = OdometryInput { twist: motion.twist, slip: motion.slip(), heading: None };
    odometry.update(&OdometryConfig::DEFAULT, input, dt);
    let (pose, own) = (odometry.pose(), &shared.own);
    own.x.set(pose.x);
    own.y.set(pose.y);
    own.heading.set(pose.heading.get());
    own.slip.set(motion.slip());
}
