//! The task: the remote control decides what the robot does.
//!
//! | control | the robot |
//! |---|---|
//! | right switch | down: disarmed; else armed: the lift homes, the arm stays where it is |
//! | left switch | up: the gripper closes, if there is air; down: emergency stop |
//! | right stick | drives, and brakes a metre from a wall; to the side: turns |
//! | throttle | how high the lift is; it stays where it is left |
//! | left stick to the side, dial | move shoulder and elbow |

use rc10::app::mechanism::Stage;
use rc10::module::remote::ChannelOrder;
use rc10::prelude::*;

use crate::arm::Arm;
use crate::lift::Lift;
use crate::{AIR, BASE, NEAREST, Name, Robot, Shared};

impl Program for Robot {
    const RECEIVER: Receiver = Receiver::Sbus;
    const CHANNELS: ChannelOrder = crate::CHANNELS;
    const ARMING: ArmingConfig = crate::ARMING;

    async fn run(shared: &Shared<'_>) -> ! {
        let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(10));
        let (mut base, mut lift, mut arm) = (BaseDriver::new(&BASE), Lift::new(), None);
        loop {
            let tick = every.next().await;
            let was_armed = shared.switch.state() == ArmState::Armed;
            // Without a remote no motor is commanded: 50 ms later each is safe.
            let Some(remote) = shared.obey(&mut arming) else {
                base.rest();
                continue;
            };
            if !was_armed {
                (lift, arm) = (Lift::new(), Arm::new(shared).ok());
                shared.own.arm.tell(if arm.is_some() { Stage::Ready } else { Stage::OutOfTravel });
            }
            let wall = shared.own.wall.get();
            let ahead = if wall < NEAREST { remote.right.y.min(0.0) } else { remote.right.y };
            let full = BASE.full_stick;
            let wish = Twist::new(ahead * full.vx, 0.0, -remote.right.x * full.wz);
            base.drive(shared, wish, tick.dt);

            let motor = shared.motor(Name::Lift).status().measured();
            let height = (remote.left.y + 1.0) / 2.0;
            let target = lift.step(height, &motor, shared.own.bottom.is_closed(), tick.dt);
            shared.command(Name::Lift, target);
            shared.own.lift.tell(lift.stage());
            shared.own.height.set(lift.height(&motor).map_or(f32::NAN, |it| it.degrees().get()));

            if let Some(arm) = &mut arm {
                arm.step(shared, [remote.left.x, remote.dial], tick.dt);
            }
            // It grips with air only.
            let grips = remote.left_switch == Switch::Up && shared.own.pressure.get() > AIR;
            shared.own.gripper.set(if grips { 90.0 } else { 0.0 });
        }
    }
}
