//! The order of a declaration decides the order of tables, and nothing else: every pair of motors of a
//! robot is exchanged.
//!
//! What may differ by a hair is the tick in which an angle loop of a bus runs, by the motor's number
//! there, and when its feedback comes.

use crate::common::made::{Made, attach};
use rc10_cli::recording::Recording;
use rc10_cli::robot::motor::Motor;
use rc10_cli::run::simulate::simulate;
use rc10_cli::{Description, Plant, Robot};
use rc10_motor::declaration::{check, slots};
use rc10_motor::embassy::{BusPort, MotorPort};
use rc10_motor::rc10_app::Rpm;
use rc10_motor::unitree::Rs485Bus;
use rc10_motor::{ArmSwitch, Device, Entry, MotorBus, Names, Place, Slot, Target};
use rc10_time::Micros;

/// The lines of a robot's declaration, with two exchanged.
fn exchanged<N: Names, const MOTORS: usize>(one: usize, other: usize) -> [Entry<Device>; MOTORS] {
    let mut entries = N::ENTRIES.to_vec();
    entries.swap(one, other);
    entries.try_into().unwrap()
}

/// Each pair of motors, and no pair.
fn pairs(motors: usize) -> impl Iterator<Item = (usize, usize)> {
    let all = (0..motors).flat_map(move |one| (one + 1..motors).map(move |other| (one, other)));
    std::iter::once((0, 0)).chain(all)
}

/// Everything that is known of a robot before power-on, by label.
#[derive(Debug, PartialEq)]
struct Known {
    /// Label, model and identifier of the motor that is behind the name's place.
    motors: Vec<(&'static str, String, Place)>,
    /// Frames a second of each bus, and percent in tenths.
    loads: Vec<(u32, String)>,
    /// Identifiers that are received and sent on each bus.
    ids: Vec<Vec<String>>,
}

fn known<N: Names, const MOTORS: usize>(one: usize, other: usize) -> Known {
    let entries = exchanged::<N, MOTORS>(one, other);
    check(&entries, N::BUSES, N::LINES).unwrap();
    let slots: [Slot; MOTORS] = slots(&entries);
    let switch = ArmSwitch::new();
    let mut made: Vec<Made> = entries.iter().map(|entry| Made::new(entry, |_| ())).collect();
    let mut buses: Vec<_> = N::BUSES.iter().map(|_| MotorBus::new(&switch)).collect();
    let mut lines: Vec<_> = (0..N::LINES).map(|_| Rs485Bus::new(&switch)).collect();
    let (mut all_buses, mut all_lines): (Vec<_>, Vec<_>) =
        (buses.iter_mut().collect(), lines.iter_mut().collect());
    attach(&mut made, &mut all_buses, &mut all_lines);
    let mut motors: Vec<_> = slots
        .iter()
        .map(|slot| {
            let name = match slot.on {
                Place::Bus(bus) => {
                    buses[usize::from(bus) - 1].motors().find(|it| it.0 == slot.motor)
                }
                Place::Line(line) => {
                    lines[usize::from(line) - 1].motors().find(|it| it.0 == slot.motor)
                }
            };
            (slot.label, name.unwrap().1.to_string(), slot.on)
        })
        .collect();
    motors.sort_by_key(|motor| motor.0);
    let load = |bus: &MotorBus<'_>| {
        let load = bus.load(1_000_000);
        (load.frames_per_second, format!("{:.1}", load.typical))
    };
    let ids = |bus: &MotorBus<'_>| {
        let mut all = Vec::new();
        bus.for_each_can_ids(|ids| {
            all.extend(ids.received().iter().map(|frames| format!("from {}", frames.pattern)));
            all.extend(ids.transmitted().iter().map(|frames| format!("to {}", frames.pattern)));
        });
        all.sort();
        all
    };
    let loads = buses.iter().map(load).collect();
    Known { motors, loads, ids: buses.iter().map(ids).collect() }
}

fn nothing_else_changes<N: Names, const MOTORS: usize>() {
    let as_declared = known::<N, MOTORS>(0, 0);
    for (label, model, on) in &as_declared.motors {
        let entry = N::ENTRIES.iter().find(|entry| entry.label == *label).unwrap();
        assert_eq!((model, *on), (&entry.config.name().to_string(), entry.on));
    }
    for (one, other) in pairs(MOTORS) {
        assert_eq!(known::<N, MOTORS>(one, other), as_declared, "{one} and {other}");
    }
}

#[test]
fn places_models_and_loads_are_those_of_the_label() {
    nothing_else_changes::<team::Name, 11>();
    nothing_else_changes::<mixed::Name, 14>();
}

type Team = team::Name;
const MOTORS: usize = 11;

/// The team's motors, each told a speed of its own, by label.
fn drive(one: usize, other: usize) -> Recording {
    let entries = exchanged::<Team, MOTORS>(one, other);
    let slots: [Slot; MOTORS] = slots(&entries);
    let (switch, ports) = (ArmSwitch::new(), [(); 3].map(|()| BusPort::new()));
    let mut made: Vec<Made> = entries.iter().map(|entry| Made::new(entry, |_| ())).collect();
    let mut buses = [(); 3].map(|()| MotorBus::new(&switch));
    attach(&mut made, &mut buses.each_mut(), &mut []);
    let motors = entries.iter().map(|entry| Motor::of(entry, Plant::inertia(0.01)));
    let description = Description { motors: motors.collect(), buses: 3, ..<_>::default() };
    let robot = Robot::new(description).switch(&switch);
    let robot =
        std::iter::zip(buses, &ports).fold(robot, |robot, (bus, port)| robot.bus(bus, port));
    let robot = robot.task(async {
        embassy_time::Timer::after_millis(20).await;
        switch.arm().unwrap();
        loop {
            for slot in &slots {
                port(&ports, slot).command(Target::Speed(speed(slot.label))).unwrap();
            }
            embassy_time::Timer::after_millis(10).await;
        }
    });
    simulate(robot, 1, Micros::from_millis(500)).unwrap()
}

fn port<'p>(ports: &'p [BusPort; 3], slot: &Slot) -> MotorPort<'p> {
    ports[usize::from(slot.on.bus().unwrap()) - 1].motor(slot.motor)
}

/// By its place in the declaration: 20, 25, 30 rpm and so on.
fn speed(label: &str) -> Rpm {
    let name = Team::ALL.iter().find(|name| name.label() == label).unwrap();
    Rpm::new(20.0 + 5.0 * f32::from(u8::try_from(name.index()).unwrap()))
}

#[test]
fn each_shaft_turns_as_its_label_is_told() {
    for (one, other) in pairs(MOTORS) {
        let run = drive(one, other);
        for track in &run.motors {
            let label = track.motor.label;
            let real = track.samples.last().unwrap().rpm;
            let told = f64::from(speed(label).get());
            assert!((real - told).abs() < 1.5, "{label}, {one} and {other}: {real}, not {told}");
        }
        assert!(run.buses.iter().all(|bus| bus.last.refused + bus.last.replaced == 0));
    }
}
