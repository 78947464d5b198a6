//! An arm of two joints is held by its feed-forward alone: by the library's formula, against the simulator's
//! weights.

use rc10_app::{Amps, Degrees, Direction, TwoJointArm};
use rc10_cli::world::environment::Environment;
use rc10_cli::{ArmPart, Description, Plant, Robot};
use rc10_motor::Place::Bus;
use rc10_motor::dji::{Config, Dji, M3508};
use rc10_motor::embassy::Ports;
use rc10_motor::{Entry, Link, Names, Target};
use rc10_sim::ArmLink;
use rc10_tasks::Common;
use rc10_time::Micros;

rc10_motor::motors! {
    enum Name;
    struct Motors;
    Shoulder: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
    // Its motor looks the other way.
    Elbow: Dji = Entry::new(Bus(1), Config::new(&M3508, 2).with_direction(Direction::Reversed)),
}

const ARM: TwoJointArm = TwoJointArm {
    upper_mass_kg: 1.2,
    upper_centre_m: 0.16,
    upper_length_m: 0.32,
    fore_mass_kg: 0.7,
    fore_centre_m: 0.13,
};

/// How far the joints have moved 1.5 s after they are let go, in degrees.
fn moves(pose: [f64; 2], believed: &TwoJointArm) -> [f64; 2] {
    let [shoulder, elbow] = pose;
    #[allow(clippy::cast_possible_truncation, reason = "an angle of a test")]
    let degrees = |at: usize| Degrees::new(pose[at] as f32);
    let upper = ArmLink { mass: 1.2, centre: 0.16, length: 0.32, start: shoulder };
    let fore = ArmLink { mass: 0.7, centre: 0.13, length: 0.0, start: elbow };
    let description = Description {
        arms: vec![ArmPart::new([(Name::Shoulder, upper), (Name::Elbow, fore)])],
        ..Description::of(|_: Name| Plant::inertia(0.05))
    };
    let ports = Ports::<Name, 1>::new();
    let shared = Common::<_>::new(&ports);
    let mut motors = Motors::new();
    let mut around = Environment::new(&description, 1).unwrap();
    let buses = motors.start(&shared.switch).unwrap().buses;
    let robot = Robot::on(description, buses, [], &shared);
    let amps = Config::new(&M3508, 1).torque_constant();
    let mut tasks = robot
        .task(async {
            let mut began = None;
            loop {
                embassy_time::Timer::after_millis(2).await;
                let status = Name::ALL.iter().map(|name| shared.motor(*name).status());
                let [shoulder, elbow] = status.collect::<Vec<_>>().try_into().unwrap();
                if [shoulder.link, elbow.link] != [Link::Online; 2] {
                    continue;
                }
                let counted = [shoulder, elbow].map(|motor| motor.feedback.total_angle);
                let zeros = *began.get_or_insert(counted);
                let _ = shared.switch.arm();
                let angle = |at: usize| counted[at].minus(zeros[at]).degrees() + degrees(at);
                for (name, torque) in Name::ALL.iter().zip(believed.torques([angle(0), angle(1)])) {
                    shared.command(*name, Target::Current(Amps::new(torque.get() / amps)));
                }
            }
        })
        .tasks(&around)
        .unwrap();
    let hold = |around: &Environment, travel| {
        around.motors.iter().for_each(|motor| motor.set_travel(travel));
    };
    hold(&around, Some([0.0, 0.0]));
    around.run(&mut tasks, Micros::from_millis(200));
    hold(&around, None);
    around.run(&mut tasks, Micros::from_millis(1700));
    [0, 1].map(|at| around.motors[at].state().load_degrees.abs())
}

#[test]
fn it_is_held_at_ten_poses_by_feed_forward_alone() {
    let poses = [
        [0.0, 0.0],
        [0.0, -90.0],
        [30.0, 45.0],
        [60.0, -120.0],
        [90.0, 90.0],
        [90.0, -90.0],
        [120.0, -30.0],
        [180.0, 10.0],
        [-45.0, 100.0],
        [-20.0, -40.0],
    ];
    for pose in poses {
        let moved = moves(pose, &ARM);
        println!("{pose:?}: {moved:.3?} degrees");
        assert!(moved.iter().all(|moved| *moved < 0.5), "{pose:?}: {moved:?}");
    }
}

/// The same test, of formulas that are wrong.
#[test]
fn without_the_coupling_or_with_another_weight_it_falls() {
    let fallen = |believed: &TwoJointArm| {
        moves([20.0, -30.0], believed).iter().fold(0.0_f64, |a, b| a.max(*b))
    };
    // The shoulder does not know of the forearm's place.
    let wrong = [
        TwoJointArm { upper_length_m: 0.0, ..ARM },
        TwoJointArm { fore_mass_kg: 1.0, ..ARM },
        TwoJointArm { fore_centre_m: 0.05, ..ARM },
    ]
    .map(|believed| fallen(&believed));
    assert!(wrong.iter().all(|fallen| *fallen > 10.0), "{wrong:?}");
}
