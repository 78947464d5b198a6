//! The chassis' board: it drives where the gimbal's says, and tells it how fast it turns.

use rc10::join::join;
use rc10::prelude::*;
use rc10::tasks::boards::{Peer, Role};

use crate::boards::{BOARDS, DRIVE, TURNS};

rc10::robot! {
    board Chassis;
    own Own;
    motors {
        buses: [100.0, 100.0];
        WheelFrontLeft: Dji = wheel(Config::new(&M3508, 1)),
        WheelFrontRight: Dji = wheel(mirrored(2)),
        WheelRearLeft: Dji = wheel(Config::new(&M3508, 3)),
        WheelRearRight: Dji = wheel(mirrored(4)),
    }
}

rc10::live! {
    /// What the chassis' tasks share.
    pub struct Own {
        fields {
            /// The gimbal's board.
            peer: Peer;
        }
    }
}

const fn wheel(config: Config) -> Entry<Config> {
    Entry::new(Bus(1), config).with_jog(Rpm::new(20.0))
}

const fn mirrored(id: u8) -> Config {
    Config::new(&M3508, id).with_direction(Direction::Reversed)
}

/// Wheels of 76 mm radius, 400 mm by 440 mm apart.
pub const BASE: DrivenBase<Name, 4> = DrivenBase {
    wheels: [
        Name::WheelFrontLeft,
        Name::WheelFrontRight,
        Name::WheelRearLeft,
        Name::WheelRearRight,
    ],
    geometry: Base::mecanum(0.076, 0.20, 0.22, Rpm::new(400.0)),
    body: Body { mass_kg: 18.0, yaw_inertia_kg_m2: 1.0 },
    torque_constant: mirrored(1).torque_constant(),
    limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    full_stick: Twist::new(1.5, 1.5, 4.0),
};

/// How old a wish of the gimbal's board may be.
const OLDEST: Micros = Micros::from_millis(50);

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        join(shared.own.peer.run(shared, &BOARDS, Role::Follows), drive(shared)).await.0
    }
}

async fn drive(shared: &Shared<'_>) -> ! {
    let (mut base, mut every) = (BaseDriver::new(&BASE), Every::millis(5));
    loop {
        let tick = every.next().await;
        // It fails for a topic of the other board, and for whole numbers that are longer than their type.
        let _ = shared.own.peer.tell(&TURNS, &BASE.measured(shared).twist.wz);
        let wish = shared.own.peer.newer_than(&DRIVE, OLDEST, tick.now);
        match wish.filter(|_| shared.switch.state() == ArmState::Armed) {
            // Without a wish no wheel is commanded: 50 ms later each is safe.
            None => base.rest(),
            Some([vx, vy, wz]) => base.drive(shared, Twist::new(vx, vy, wz), tick.dt),
        }
    }
}
