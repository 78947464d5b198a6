//! Two boards on a UART: values, a stop, a cut wire, noise.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![allow(clippy::float_cmp, reason = "counts, which are exact")]

use std::collections::VecDeque;
use std::sync::atomic::Ordering;

use rc10::motor::ArmState;
use rc10::sim::run::running::Running as _;
use rc10::sim::run::simulation::Simulation;
use rc10::sim::simulator::fault::Fault;
use rc10::sim::simulator::{Nanos, SerialConfig, SerialDevice};
use rc10::sim::{Robot, Simulated};
use rc10::tasks::boards::Link;
use rc10::time::Micros;
use two_boards_uart::{STATE, WISH, leader};

/// The leading board with the other one, under faults.
fn both(faults: &[&str], work: impl FnOnce(&leader::Shared<'_>, &mut Simulation<'_>)) {
    with(leader::Robot::description(), faults, work);
}

fn with(
    world: rc10::sim::Description,
    faults: &[&str],
    work: impl FnOnce(&leader::Shared<'_>, &mut Simulation<'_>),
) {
    let ports = leader::Ports::new();
    let (shared, mut motors) = (leader::Shared::new(&ports), leader::Motors::new());
    let mut robot = Robot::of::<leader::Robot>(world, &shared, &mut motors).unwrap();
    let faults: Vec<Fault<_>> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    robot.set_faults(&faults).unwrap();
    work(&shared, &mut Simulation::new(robot, 1, None).unwrap());
}

/// How long the wheel is commanded from now on, for at most 50 ms.
fn driven(simulation: &mut Simulation<'_>) -> Micros {
    let wheel = simulation.around.partner.as_ref().unwrap().wires[0].clone();
    let begin = simulation.now();
    let _ = wheel.take_trace();
    simulation.run_to(begin + Micros::from_millis(50)).unwrap();
    let frames = wheel.take_trace();
    let mut commands = frames.iter().rev().filter(|entry| entry.from_controller);
    let last = commands.find(|entry| entry.frame.bytes() != [0; 8]);
    last.map_or(Micros::ZERO, |entry| entry.at.since(begin))
}

fn millis(millis: u64) -> Micros {
    Micros::from_millis(millis)
}

#[test]
fn values_go_both_ways_and_none_is_lost() {
    both(&[], |shared, simulation| {
        simulation.run_to(millis(10_000)).unwrap();
        let peer = &shared.own.peer;
        assert_eq!((peer.link(), peer.lost(&STATE), peer.unsent()), (Link::Online, 0, 0));
        assert_eq!(peer.arm(), Some(ArmState::Armed));
        let [count, _, wrong, gaps, lost] =
            peer.newer_than(&STATE, millis(7), simulation.now()).unwrap();
        assert!(count > 1990.0, "{count}");
        assert_eq!([wrong, gaps, lost], [0.0; 3]);
        let counters = shared.receptions[0].read();
        assert_eq!((counters.damaged, counters.skipped, counters.port_errors), (0, 0, 0));
        assert!(driven(simulation) > millis(45));
    });
}

#[test]
fn a_stop_is_at_the_wheel_within_5_ms_in_50_phases() {
    let mut longest = Micros::ZERO;
    for phase in 0..50 {
        both(&[], |shared, simulation| {
            simulation.run_to(Micros::new(800_000 + 101 * phase)).unwrap();
            shared.switch.emergency_stop();
            longest = longest.max(driven(simulation));
            assert_eq!(shared.own.peer.arm(), Some(ArmState::EStopped));
        });
    }
    println!("the wheel is commanded for {longest} behind a stop");
    assert!(longest > Micros::ZERO && longest <= millis(5), "{longest}");
}

#[test]
fn behind_a_cut_wire_the_wheel_is_safe_within_20_ms_and_goes_on_when_it_is_whole() {
    let mut longest = Micros::ZERO;
    for phase in 0..50 {
        both(&[], |shared, simulation| {
            simulation.run_to(Micros::new(800_000 + 101 * phase)).unwrap();
            let wire = simulation.around.serials[0].clone();
            wire.set_cut(true);
            longest = longest.max(driven(simulation));
            assert_eq!(shared.own.peer.link(), Link::Interrupted);
            wire.set_cut(false);
            simulation.run_to(simulation.now() + millis(40)).unwrap();
            assert!(driven(simulation) > millis(45), "it drives again");
            // Some states did not come, each of them is counted.
            let lost = shared.own.peer.lost(&STATE);
            assert!(lost >= 9, "{lost}");
            assert_eq!(shared.own.gaps.get(), lost as f32);
        });
    }
    println!("the wheel is commanded for {longest} behind a cut wire");
    assert!(longest > millis(10) && longest <= millis(20), "{longest}");
}

#[test]
fn a_fault_of_the_line_is_one_of_the_part() {
    both(&["cut:follower@0.5s..0.6s", "noise:follower@0.7s"], |shared, simulation| {
        simulation.run_to(millis(550)).unwrap();
        assert_eq!(shared.own.peer.link(), Link::Interrupted);
        simulation.run_to(millis(650)).unwrap();
        assert_eq!(shared.own.peer.link(), Link::Online);
        simulation.run_to(millis(750)).unwrap();
        assert_eq!(shared.receptions[0].read().port_errors, 1);
        assert_eq!(shared.own.peer.link(), Link::Online);
    });
}

#[test]
fn with_a_byte_of_a_hundred_damaged_for_minutes_no_value_is_wrong_and_each_loss_is_counted() {
    both(&[], |shared, simulation| {
        simulation.run_to(millis(1000)).unwrap();
        shared.own.noise.rate.store(1000, Ordering::Relaxed);
        simulation.run_to(millis(180_000)).unwrap();
        let damaged = shared.own.noise.damaged.load(Ordering::Relaxed);
        shared.own.noise.rate.store(0, Ordering::Relaxed);
        simulation.run_to(simulation.now() + millis(500)).unwrap();
        let [count, _, wrong, gaps, lost] = shared.own.peer.read(&STATE).unwrap().value;
        let there = [shared.own.wrong.get(), shared.own.gaps.get()];
        let here = shared.own.peer.lost(&STATE) as f32;
        let counters = shared.receptions[0].read();
        println!(
            "{damaged} bytes damaged; of {count} states {here} lost, of wishes {lost}; {counters:?}"
        );
        assert!(damaged > 20_000 && here > 1000.0 && lost > 1000.0);
        assert_eq!(there, [0.0, here]);
        assert_eq!([wrong, gaps], [0.0, lost]);
        assert!(driven(simulation) > millis(45), "it drives");
    });
}

#[test]
fn a_stop_gets_through_noise_and_nothing_else_does() {
    let mut longest = Micros::ZERO;
    for phase in 0..50 {
        both(&[], |shared, simulation| {
            simulation.run_to(Micros::new(600_000 + 101 * phase)).unwrap();
            // One byte of thirty: every second arm state.
            shared.own.noise.rate.store(3300, Ordering::Relaxed);
            simulation.run_to(simulation.now() + millis(200 + phase)).unwrap();
            shared.switch.emergency_stop();
            longest = longest.max(driven(simulation));
            shared.own.noise.rate.store(50_000, Ordering::Relaxed);
            assert_eq!(driven(simulation), Micros::ZERO);
        });
    }
    println!("in noise the wheel is commanded for {longest} behind a stop");
    assert!(longest > Micros::ZERO && longest <= millis(20), "{longest}");
}

/// What is there in place of the other board: it sends back what it hears, or else random bytes.
struct Other {
    echoes: bool,
    waiting: VecDeque<u8>,
    random: u64,
    next: Nanos,
}

impl SerialDevice for Other {
    fn power_on(&mut self, _: Nanos) {}

    fn next_event(&self) -> Option<Nanos> {
        if self.echoes {
            return (!self.waiting.is_empty()).then_some(Nanos::ZERO);
        }
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        send.append(&mut self.waiting);
        if !self.echoes {
            self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            // Every fourth begins a frame, or seems to.
            let byte = (self.random >> 33).to_le_bytes()[0];
            send.push_back(if byte.is_multiple_of(4) { 0xE7 } else { byte });
        }
        self.next = now + Nanos::new(11_000);
    }

    fn receive(&mut self, byte: u8, _: Nanos) {
        self.waiting.extend(Some(byte).filter(|_| self.echoes));
    }
}

#[test]
fn its_own_bytes_and_those_of_another_device_are_not_the_other_board() {
    fn port() -> SerialConfig {
        SerialConfig { baud: two_boards_uart::BAUD, ..<_>::default() }
    }
    fn other(echoes: bool) -> Other {
        Other { echoes, waiting: <_>::default(), random: 1, next: Nanos::ZERO }
    }
    let mut world = leader::Robot::description();
    world.partner = None;
    for echoes in [true, false] {
        world.serials[0].twin = Some(if echoes {
            |world, _| Ok(world.add_serial(port(), other(true)))
        } else {
            |world, _| Ok(world.add_serial(port(), other(false)))
        });
        with(world.clone(), &[], |shared, simulation| {
            simulation.run_to(millis(5000)).unwrap();
            assert_eq!(shared.own.peer.link(), Link::Lost);
            assert!(shared.own.peer.read(&STATE).is_none());
            assert!(shared.own.peer.read(&WISH).is_none());
            let counters = shared.receptions[0].read();
            println!("{counters:?}");
            assert_eq!((counters.frames > 1000, counters.skipped > 400_000), (echoes, !echoes));
        });
    }
}

#[test]
fn without_a_place_for_it_there_is_no_other_board() {
    let complaint = |world: rc10::sim::Description| {
        let made = rc10::sim::world::environment::Environment::new(&world, 1);
        made.err().map(|error| format!("{error:#}")).unwrap_or_default()
    };
    let mut world = leader::Robot::description();
    assert_eq!(complaint(world.clone()), "");
    world.serials.push(world.serials[0]);
    let words = "parts on UARTs, follower: there is no other board for it on a UART";
    assert_eq!(complaint(world.clone()), words);
    world.serials.clear();
    let words = "the other board: no `Twin::Board` says at which UART";
    assert_eq!(complaint(world.clone()), words);
    world = leader::Robot::description();
    world.partner = None;
    let words = "parts on UARTs, follower: there is no other board for it on a UART";
    assert_eq!(complaint(world), words);
}

#[test]
fn the_plan_of_a_bus_has_no_frames_between_boards() {
    let ports = leader::Ports::new();
    let (shared, mut motors) = (leader::Shared::new(&ports), leader::Motors::new());
    let world = leader::Robot::description();
    let robot = Robot::of::<leader::Robot>(world, &shared, &mut motors).unwrap();
    let mut text = Vec::new();
    let code = rc10::sim::CommandLine::parse(["rc10", "plan"]).unwrap().run_to(robot, &mut text);
    let text = String::from_utf8(text).unwrap();
    assert_eq!(code.unwrap(), 0, "{text}");
    assert!(text.contains("bus 1: 1 motors") && !text.contains("0x7C"), "{text}");
}
