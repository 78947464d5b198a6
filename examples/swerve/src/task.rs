//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; else armed |
//! | left switch | down: emergency stop |
//! | left stick | moves the base |
//! | right stick | to the side: turns it |
//!
//! While the right stick is let go the robot keeps its heading. [`rc10_tasks::arming`] says how it is
//! armed, and what happens when the remote is lost.

use embassy_time::{Duration, Ticker};
use rc10_app::{BaseMotion, HeadingHold, Odometry, OdometryConfig, OdometryInput, Pose, Seconds};
use rc10_motor::Link;
use rc10_tasks::{Arming, BaseDriver, Drive as _};

use crate::Shared;
use crate::table::{ARMING, BASE, HEADING_HOLD};

/// Period of the task, ms.
pub const PERIOD: u64 = 5;
const DT: Seconds = Seconds::new(PERIOD as f32 * 1e-3);

/// Arms the robot, drives it, and counts where it is, every 5 ms.
pub async fn run(shared: &Shared<'_>) -> ! {
    let (mut arming, mut base) = (Arming::new(ARMING), BaseDriver::new(&BASE));
    let mut odometry = Odometry::new(Pose::IDENTITY);
    let mut hold = HeadingHold::new();
    let mut ticker = Ticker::every(Duration::from_millis(PERIOD));
    loop {
        ticker.next().await;
        let motion = BASE.measured(shared);
        if BASE.drives.into_iter().chain(BASE.steers).all(|name| is_heard(shared, name)) {
            count(&mut odometry, &motion, shared);
        }
        // Without a remote no motor is commanded: 50 ms later each is safe.
        let Some(remote) = shared.obey(&mut arming) else {
            base.rest();
            hold.release();
            continue;
        };
        let mut wish = BASE.sticks(&remote);
        let heading = odometry.pose().heading;
        wish.wz = hold.update(&HEADING_HOLD, wish.wz, heading, motion.twist.wz);
        base.drive(shared, wish, DT);
    }
}

fn is_heard(shared: &Shared<'_>, name: crate::Name) -> bool {
    shared.motor(name).status().link == Link::Online
}

/// Goes on with the pose, and shows it.
fn count(odometry: &mut Odometry, motion: &BaseMotion<4>, shared: &Shared<'_>) {
    let input = OdometryInput { twist: motion.twist, slip: motion.slip(), heading: None };
    odometry.update(&OdometryConfig::DEFAULT, input, DT);
    let (pose, own) = (odometry.pose(), &shared.own);
    own.x.set(pose.x);
    own.y.set(pose.y);
    own.heading.set(pose.heading.get());
    own.slip.set(motion.slip());
}
