//! Both boards in simulation: one drives the other, a stop of one stops both, and what a cut wire does.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use rc10::motor::ArmState;
use rc10::motor::rc10_can::CanFrame;
use rc10::motor::rc10_can::embedded_can::StandardId;
use rc10::sim::run::running::Running as _;
use rc10::sim::run::simulation::Simulation;
use rc10::sim::simulated;
use rc10::sim::simulator::fault::Fault;
use rc10::sim::{Robot, Simulated};
use rc10::tasks::boards::Link;
use rc10::time::Micros;
use two_boards::boards::{BOARDS, DRIVE, TURNS};
use two_boards::{chassis, gimbal};

/// The gimbal's board with the chassis, under faults.
fn both(faults: &[&str], work: impl FnOnce(&gimbal::Shared<'_>, &mut Simulation<'_>)) {
    let ports = gimbal::Ports::new();
    let (shared, mut motors) = (gimbal::Shared::new(&ports), gimbal::Motors::new());
    let world = gimbal::Robot::description();
    let mut robot = Robot::of::<gimbal::Robot>(world, &shared, &mut motors).unwrap();
    let faults: Vec<Fault<_>> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    robot.set_faults(&faults).unwrap();
    work(&shared, &mut Simulation::new(robot, 1, None).unwrap());
}

/// How long the wheels are commanded from now on, for at most 50 ms.
fn driven(simulation: &mut Simulation<'_>) -> Micros {
    let wheels = simulation.around.partner.as_ref().unwrap().wires[0].clone();
    let begin = simulation.now();
    let _ = wheels.take_trace();
    simulation.run_to(begin + Micros::from_millis(50)).unwrap();
    let frames = wheels.take_trace();
    let mut commands = frames.iter().rev().filter(|entry| entry.from_controller);
    let last = commands.find(|entry| entry.frame.bytes() != [0; 8]);
    last.map_or(Micros::ZERO, |entry| entry.at.since(begin))
}

fn millis(millis: u64) -> Micros {
    Micros::from_millis(millis)
}

#[test]
fn the_chassis_drives_ahead_of_the_gimbal() {
    let run = simulated::<chassis::Robot>(chassis::Robot::description(), 1, millis(5000)).unwrap();
    let path = &run.base.as_ref().unwrap().path;
    let way = |from: usize, to: usize| {
        let (from, to) = (path[from / 10 - 1], path[to / 10 - 1]);
        [to.x - from.x, to.y - from.y]
    };
    let [ahead, aside] = way(200, 2200);
    assert!((ahead - 0.9).abs() < 0.05 && aside.abs() < 0.05, "{ahead} {aside}");
    // The gimbal has looked by 86 degrees to the left since.
    let [ahead, aside] = way(2200, 3200);
    assert!(ahead.abs() < 0.15 && aside > 0.7, "{ahead} {aside}");
}

#[test]
fn the_gimbal_stays_where_it_looks_while_the_chassis_spins_under_it() {
    both(&[], |shared, simulation| {
        let looks = |simulation: &Simulation<'_>| {
            let base = simulation.around.partner.as_ref().unwrap().base.as_ref().unwrap().pose();
            let yaw = shared.motor(gimbal::Name::Yaw).status().feedback.total_angle.degrees();
            base.yaw.to_degrees() + f64::from(yaw.get())
        };
        simulation.run_to(millis(3200)).unwrap();
        let before = looks(simulation);
        simulation.run_to(millis(4600)).unwrap();
        let spun = simulation.around.partner.as_ref().unwrap().base.as_ref().unwrap().pose();
        assert!(spun.yaw.abs() > 2.0, "{spun:?}");
        let off = looks(simulation) - before;
        assert!(off.abs() < 10.0, "{off} degrees");
    });
}

#[test]
fn without_the_other_board_the_chassis_is_safe_within_20_ms_and_goes_on_when_it_is_back() {
    let mut longest = Micros::ZERO;
    for phase in 0..50 {
        both(&[], |_, simulation| {
            simulation.run_to(Micros::new(800_000 + 101 * phase)).unwrap();
            let chassis = simulation.around.partner.as_ref().unwrap().wires[1].clone();
            chassis.set_cut(true);
            longest = longest.max(driven(simulation));
            chassis.set_cut(false);
            simulation.run_to(simulation.now() + millis(40)).unwrap();
            assert!(driven(simulation) > millis(45), "it drives again");
        });
    }
    println!("the wheels are commanded for {longest} behind a cut wire");
    assert!(longest > millis(10) && longest <= millis(20), "{longest}");
}

#[test]
fn a_stop_is_at_the_wheels_within_5_ms() {
    let mut longest = Micros::ZERO;
    for phase in 0..50 {
        both(&[], |shared, simulation| {
            simulation.run_to(Micros::new(800_000 + 101 * phase)).unwrap();
            shared.switch.emergency_stop();
            longest = longest.max(driven(simulation));
            assert_eq!(shared.own.peer.arm(), Some(ArmState::EStopped));
        });
    }
    println!("the wheels are commanded for {longest} behind a stop");
    assert!(longest > Micros::ZERO && longest <= millis(5), "{longest}");
}

#[test]
fn on_a_full_bus_nothing_is_lost() {
    both(&[], |shared, simulation| {
        simulation.run_to(millis(400)).unwrap();
        // Another node, less urgent, always has something to send.
        let frame = CanFrame::exact(StandardId::new(0x7FF).unwrap(), [0x55; 8]);
        (0..35_000).for_each(|_| simulation.wires()[1].inject(&frame));
        let before = simulation.wires()[1].load();
        simulation.run_to(millis(3900)).unwrap();
        let load = (simulation.wires()[1].load() * 3.9 - before * 0.4) / 3.5;
        assert!(load > 99.0, "{load} %");
        let peer = &shared.own.peer;
        assert_eq!((peer.link(), peer.lost(&TURNS), peer.unsent()), (Link::Online, 0, 0));
        assert_eq!(shared.switch.state(), ArmState::Armed);
        assert!(peer.newer_than(&TURNS, millis(8), simulation.now()).is_some());
        assert!(driven(simulation) > millis(45));
    });
}

#[test]
fn only_the_board_of_a_topic_tells_it() {
    both(&[], |shared, simulation| {
        simulation.run_to(millis(10)).unwrap();
        assert!(shared.own.peer.tell(&TURNS, &1.0).is_err());
        assert!(shared.own.peer.tell(&DRIVE, &[0.0; 3]).is_ok());
    });
    // Nothing else is on their bus: behind all that may come there.
    assert_eq!(BOARDS.first(), 0x7C0);
}
