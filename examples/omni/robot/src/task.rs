//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; else armed |
//! | left switch | up: the flywheel turns; middle: it coasts; down: emergency stop |
//! | left stick | moves the base |
//! | right stick | to the side: turns the base; away: raises the arm |
//! | dial | turns the turret |
//!
//! [`rc10_tasks::arming`] says how it is armed, and what happens when the remote is lost.

use embassy_time::{Duration, Ticker};
use rc10_app::{Degrees, Rpm, Seconds, Twist, TwistLimiter};
use rc10_module::remote::{Remote, Switch};
use rc10_motor::{ArmState, Target};
use rc10_tasks::Arming;

use crate::Shared;
use crate::table::{
    ARM_RANGE, ARM_RATE, ARMING, BASE, BASE_LIMITS, FULL_STICK, Name, SHOOTING, TURRET_RATE, WHEELS,
};

/// Period of the task, ms.
pub const PERIOD: u64 = 10;
const DT: Seconds = Seconds::new(PERIOD as f32 * 1e-3);

/// What the sticks have made so far.
struct Wish {
    limiter: TwistLimiter,
    arm: f32,
    turret: f32,
}

/// Arms the robot, and drives it, every 10 ms.
pub async fn run(shared: &Shared<'_>) -> ! {
    let mut arming = Arming::new(ARMING);
    let mut wish = None;
    let mut ticker = Ticker::every(Duration::from_millis(PERIOD));
    loop {
        ticker.next().await;
        let now = rc10_message::now();
        let before = shared.switch.state();
        let obeyed = arming.step(shared.remote.read(), &shared.switch, now);
        shared.remote_link.set(arming.link(), now);
        // Without a remote no motor is commanded: 50 ms later each is safe.
        let Some(remote) = obeyed else { continue };
        if before != ArmState::Armed {
            wish = None;
        }
        wish.get_or_insert_with(|| begin(shared)).follow(&remote, shared);
    }
}

/// From where everything is.
fn begin(shared: &Shared<'_>) -> Wish {
    let angle = |name| shared.motor(name).status().feedback.angle.get();
    let mut limiter = TwistLimiter::new();
    let speeds = WHEELS.map(|name| shared.motor(name).status().feedback.speed);
    limiter.reset(BASE.forward(speeds).twist);
    let arm = angle(Name::Arm);
    let arm = if arm > 180.0 { arm - 360.0 } else { arm };
    Wish { limiter, arm: arm.clamp(ARM_RANGE[0], ARM_RANGE[1]), turret: angle(Name::Turret) }
}

impl Wish {
    fn follow(&mut self, remote: &Remote, shared: &Shared<'_>) {
        // Sticks count to the right, the robot to the left.
        let twist = Twist::new(
            remote.left.y * FULL_STICK.vx,
            -remote.left.x * FULL_STICK.vy,
            -remote.right.x * FULL_STICK.wz,
        );
        let limited = self.limiter.update(&BASE_LIMITS, twist, DT);
        let wheels = limited.and_then(|twist| BASE.inverse(twist));
        // Without a result there is no speed either: the wheels refuse it, and that is counted.
        let speeds = wheels.map_or([Rpm::new(f32::NAN); WHEELS.len()], |wheels| wheels.speeds);
        for (name, speed) in WHEELS.into_iter().zip(speeds) {
            shared.command(name, Target::Speed(speed));
        }
        self.arm += remote.right.y * ARM_RATE * DT.get();
        self.arm = self.arm.clamp(ARM_RANGE[0], ARM_RANGE[1]);
        shared.command(Name::Arm, Target::Angle(Degrees::new(self.arm)));
        self.turret -= remote.dial * TURRET_RATE * DT.get();
        self.turret = if self.turret < 0.0 { self.turret + 360.0 } else { self.turret };
        self.turret = if self.turret >= 360.0 { self.turret - 360.0 } else { self.turret };
        shared.command(Name::Turret, Target::Angle(Degrees::new(self.turret)));
        let flywheel = match remote.left_switch {
            Switch::Up => Target::Speed(SHOOTING),
            _ => Target::Coast,
        };
        shared.command(Name::Flywheel, flywheel);
    }
}
