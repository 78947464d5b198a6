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
use rc10_app::{Rpm, Seconds, Twist, TwistLimiter};
use rc10_module::remote::{Remote, Switch};
use rc10_motor::{ArmState, Target};
use rc10_tasks::Arming;

use crate::Shared;
use crate::table::{ARMING, BASE, BASE_LIMITS, FEEDING, FULL_STICK, Name, WHEELS};

/// Period of the task, ms.
pub const PERIOD: u64 = 10;
const DT: Seconds = Seconds::new(PERIOD as f32 * 1e-3);

/// Arms the robot, and drives it, every 10 ms.
pub async fn run(shared: &Shared<'_>) -> ! {
    let mut arming = Arming::new(ARMING);
    let mut limiter = TwistLimiter::new();
    let mut ticker = Ticker::every(Duration::from_millis(PERIOD));
    loop {
        ticker.next().await;
        let before = shared.switch.state();
        // Without a remote no motor is commanded: 50 ms later each is safe.
        let Some(remote) = shared.obey(&mut arming) else { continue };
        if before != ArmState::Armed {
            // It may be rolling: the wheels begin with the speeds that they have.
            let speed = |name| shared.motor(name).status().feedback.speed;
            limiter.reset(BASE.forward(WHEELS.map(speed)).twist);
        }
        drive(&remote, &mut limiter, shared);
    }
}

fn drive(remote: &Remote, limiter: &mut TwistLimiter, shared: &Shared<'_>) {
    // Sticks count to the right, the robot to the left.
    let twist = Twist::new(
        remote.left.y * FULL_STICK.vx,
        -remote.left.x * FULL_STICK.vy,
        -remote.right.x * FULL_STICK.wz,
    );
    let wheels = limiter.update(&BASE_LIMITS, twist, DT).and_then(|twist| BASE.inverse(twist));
    // Without a result there is no speed either: the wheels refuse it, and that is counted.
    let speeds = wheels.map_or([Rpm::new(f32::NAN); WHEELS.len()], |wheels| wheels.speeds);
    for (name, speed) in WHEELS.into_iter().zip(speeds) {
        shared.command(name, Target::Speed(speed));
    }
    let feeder = match remote.left_switch {
        Switch::Up => Target::Speed(FEEDING),
        _ => Target::Coast,
    };
    shared.command(Name::Feeder, feeder);
}
