//! The gimbal's board: it has the remote, and tells the chassis where to drive.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; else armed |
//! | left switch | down: emergency stop |
//! | left stick | drives, seen from the gimbal |
//! | right stick | to the side: turns the gimbal; away: spins the chassis under it |

use rc10::app::{FieldFrame, Radians};
use rc10::join::join;
use rc10::prelude::*;
use rc10::tasks::boards::{Peer, Role};

use crate::boards::{BOARDS, DRIVE, TURNS};

rc10::robot! {
    board Gimbal;
    own Own;
    motors {
        buses: [100.0, 100.0];
        Yaw: Dji = Entry::new(Bus(1), YAW),
    }
}

rc10::live! {
    /// What the gimbal's tasks share.
    pub struct Own {
        signals {
            chassis: "chassis turns", "rad/s";
        }
        fields {
            /// The chassis' board.
            peer: Peer;
        }
    }
}

/// 0.02 kg m² on 0.741 N m/A.
const YAW: Config = Config::new(&GM6020_CURRENT, 1).with_cascade(Cascade {
    speed: PidConfig::within(3.0).kp(0.12).ki(0.6),
    ..GM6020_CURRENT.cascade
});

/// Speed of the base with the stick at its end, m/s.
pub const FULL_STICK: f32 = 1.5;
/// Speeds of the chassis under the gimbal and of the gimbal, with the stick at its end, rad/s.
pub const SPIN: f32 = 4.0;
const TURN: f32 = 3.0;
const RAD_S_PER_RPM: f32 = core::f32::consts::TAU / 60.0;
/// How old the turning of the chassis may be: without it the gimbal turns with the chassis.
const OLDEST: Micros = Micros::from_millis(50);

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        join(shared.own.peer.run(shared, &BOARDS, Role::Leads), drive(shared)).await.0
    }
}

async fn drive(shared: &Shared<'_>) -> ! {
    let (mut arming, mut every) = (Arming::of::<Robot>(), Every::millis(5));
    let peer = &shared.own.peer;
    loop {
        let now = every.next().await.now;
        let turns = peer.newer_than(&TURNS, OLDEST, now).filter(|turns| turns.is_finite());
        shared.own.chassis.set(turns.unwrap_or(f32::NAN));
        let Some(remote) = shared.obey(&mut arming) else { continue };
        // The gimbal's axes are the field of the chassis, which looks to the other side of them.
        let yaw = shared.motor(Name::Yaw).status().feedback.total_angle.degrees().get();
        let [ahead, left] = [remote.left.y, -remote.left.x].map(|stick| FULL_STICK * stick);
        let wish = Twist::<FieldFrame>::new(ahead, left, SPIN * remote.right.y);
        let Twist { vx, vy, wz, .. } = wish.into_frame(Radians::new(-yaw.to_radians()));
        // It fails for a topic of the other board, and for whole numbers that are longer than their type.
        let _ = peer.tell(&DRIVE, &[vx, vy, wz]);
        // Against the turning of the chassis it stays where it looks.
        let rate = TURN * -remote.right.x - turns.unwrap_or(0.0);
        shared.command(Name::Yaw, Target::Speed(Rpm::new(rate / RAD_S_PER_RPM)));
    }
}
