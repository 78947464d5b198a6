//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; middle: armed, by hand; up: along its path, once |
//! | left switch | up: the flywheel turns; back to the middle: it coasts, arm and turret go home together; down: emergency stop |
//! | left stick | moves the base, and takes over from the path |
//! | right stick | to the side: turns the base, and takes over; away: raises the arm |
//! | dial | turns the turret |
//!
//! [`rc10::tasks::arming`] says how it is armed, and what happens when the remote is lost.

use crate::base::{Driver, Navigation, tell};
use crate::mechanisms::Mechanisms;
use crate::{Robot, Shared};
use rc10::prelude::*;

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(10));
        let mut navigation = Navigation::default();
        let mut driven = None;
        loop {
            let dt = every.next().await.dt;
            let was_armed = shared.switch.state() == ArmState::Armed;
            let obeyed = shared.obey(&mut arming);
            let pose = navigation.step(shared, was_armed, dt);
            if !was_armed {
                driven = None;
            }
            // Without a remote no motor is commanded: 50 ms later each is safe.
            let Some(remote) = obeyed else {
                driven = None;
                tell(shared, None, None);
                continue;
            };
            let begin = || (Driver::default(), Mechanisms::new(shared));
            let (base, mechanisms) = driven.get_or_insert_with(begin);
            base.step(shared, &remote, pose, dt);
            mechanisms.step(shared, &remote, dt);
        }
    }
}
