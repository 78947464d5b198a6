//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; else armed |
//! | left switch | up: the feeder turns; down: emergency stop |
//! | left stick | moves the base |
//! | right stick | to the side: turns it |
//!
//! [`rc10_tasks::arming`] says how it is armed, and what happens when the remote is lost.

use embassy_time::{Duration, Ticker};
use rc10_app::Seconds;
use rc10_module::remote::Switch;
use rc10_motor::Target;
use rc10_tasks::{Arming, BaseDriver, Drive as _};

use crate::Shared;
use crate::table::{ARMING, BASE, FEEDING, Name};

/// Period of the task, ms.
pub const PERIOD: u64 = 10;
const DT: Seconds = Seconds::new(PERIOD as f32 * 1e-3);

/// Arms the robot, and drives it, every 10 ms.
pub async fn run(shared: &Shared<'_>) -> ! {
    let (mut arming, mut base) = (Arming::new(ARMING), BaseDriver::new(&BASE));
    let mut ticker = Ticker::every(Duration::from_millis(PERIOD));
    loop {
        ticker.next().await;
        // Without a remote no motor is commanded: 50 ms later each is safe.
        let Some(remote) = shared.obey(&mut arming) else {
            base.rest();
            continue;
        };
        base.drive(shared, BASE.sticks(&remote), DT);
        let feeder = match remote.left_switch {
            Switch::Up => Target::Speed(FEEDING),
            _ => Target::Coast,
        };
        shared.command(Name::Feeder, feeder);
    }
}
