//! A robot that leaves one joint to a PC, and no twist.

use std::time::Duration;

use hiroz::Builder as _;
use hiroz_msgs::sensor_msgs::JointState;
use rc10::prelude::*;
use rc10_cli::{Description, Plant, RemoteControl, Simulated};

use super::scene::{AUTO, BY_HAND, Router, World, simulated, until};

rc10::live! {
    /// What a PC may command.
    pub struct Own {
        auto {
            "turret", "rpm", 60.0;
        }
    }
}

rc10::robot! {
    own Own;
    motors {
        Turret: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
    }
}

impl Program for Robot {
    async fn run(shared: &Shared<'_>) -> ! {
        let (mut arming, mut every) = (Arming::of::<Self>(), Every::millis(10));
        loop {
            every.next().await;
            if let Some(remote) = shared.obey(&mut arming) {
                let values = shared.own.auto.values(remote.right_switch == Switch::Up);
                let [turret] = values.unwrap_or_default();
                shared.command(Name::Turret, Target::Speed(Rpm::new(turret)));
            }
        }
    }
}

impl Simulated for Robot {
    fn description() -> Description {
        Description {
            remote: Some(RemoteControl::of::<Self>(&[], None)),
            ..Description::of_program::<Self>(|_| Plant::inertia(0.005))
        }
    }
}

#[test]
fn a_joint_is_commanded_by_its_name_in_its_unit() {
    let (router, world) = (Router::new(), World::quiet(simulated::<Robot>));
    let bridge = world.bridge(&router.args(), &Robot::description());
    let (_context, node) = router.node("commander");
    let speed = std::sync::Arc::new(std::sync::Mutex::new(f64::NAN));
    let heard = std::sync::Arc::clone(&speed);
    let hear = move |it: JointState| *heard.lock().unwrap() = it.velocity[0];
    let _keep = node.create_sub::<JointState>("/joint_states").build_with_callback(hear).unwrap();
    let give = node.create_pub::<JointState>("/joint_commands").build().unwrap();
    let give = |name: &str, velocity: &[f64]| {
        let (name, velocity) = (vec![name.to_owned()], velocity.to_vec());
        give.publish(&JointState { name, velocity, ..JointState::default() }).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    };
    let limit = Duration::from_secs(20);
    until("the robot is heard", limit, || speed.lock().unwrap().is_finite());
    world.arm();
    world.hold(AUTO);
    for _ in 0..10 {
        give("turret", &[0.0]);
    }
    // 3 rad/s: 28.6 rpm.
    until("it turns", limit, || {
        give("turret", &[3.0]);
        (*speed.lock().unwrap() - 3.0).abs() < 0.2
    });
    // Beyond its 60 rpm.
    until("it is limited", limit, || {
        give("turret", &[30.0]);
        (*speed.lock().unwrap() - std::f64::consts::TAU).abs() < 0.2
    });
    // The switch takes back at once.
    world.hold(BY_HAND);
    until("it stands", Duration::from_secs(2), || {
        give("turret", &[3.0]);
        speed.lock().unwrap().abs() < 0.1
    });
    give("lift", &[0.0]);
    give("turret", &[]);
    give("turret", &[f64::NAN]);
    let reasons = [
        "no joint `lift` may be commanded",
        "joint `turret` is commanded by its velocity, which is not there",
        "a number that is not finite",
    ];
    until("each is told", limit, || {
        let told = bridge.commands.lock().unwrap().clone();
        reasons.iter().all(|why| told.contains(why))
    });
}
