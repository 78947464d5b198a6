//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; else armed, if both sticks are in the middle |
//! | left switch | up: the feeder turns; down: emergency stop |
//! | left stick | moves the base |
//! | right stick | to the side: turns it |
//!
//! [`rc10::tasks::arming`] says how it is armed, and what happens when the remote is lost. Another receiver than a DR16,
//! and other switches, are constants of [`Program`].

use rc10::prelude::*;

use crate::{BASE, FEEDING, Name, Robot, Shared};

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        let (mut arming, mut base) = (Arming::of::<Self>(), BaseDriver::new(&BASE));
        let mut every = Every::millis(10);
        loop {
            let tick = every.next().await;
            // Without a remote no motor is commanded: 50 ms later each is safe.
            let Some(remote) = shared.obey(&mut arming) else {
                base.rest();
                continue;
            };
            base.drive(shared, BASE.sticks(&remote), tick.dt);
            let feeder = match remote.left_switch {
                Switch::Up => Target::Speed(FEEDING),
                _ => Target::Coast,
            };
            shared.command(Name::Feeder, feeder);
        }
    }
}
