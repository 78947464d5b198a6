//! An arm of links that hang on each other, against its energy.

use rc10_sim::{ArmLink, BusConfig, Esc, EscConfig, Model, Mounting, Plant, WheelError, World};
use rc10_time::Micros;

const LINKS: [ArmLink; 3] = [
    ArmLink { mass: 1.0, centre: 0.15, length: 0.3, start: 20.0 },
    ArmLink { mass: 0.6, centre: 0.12, length: 0.25, start: -50.0 },
    ArmLink { mass: 0.3, centre: 0.1, length: 0.0, start: 100.0 },
];

fn motors(world: &mut World) -> [Esc; 3] {
    let bus = world.add_bus(BusConfig::default());
    [1, 2, 3].map(|id| {
        let esc = bus.add_esc(EscConfig::new(Model::C620, id)).unwrap();
        let smooth = Plant {
            viscous_friction: 0.0,
            coulomb_friction: 0.0,
            static_friction: 0.0,
            ..esc.plant()
        };
        esc.set_plant(smooth.with_load_inertia(0.05));
        esc
    })
}

/// Potential energy at these angles of the joints since power-on, J.
fn potential(angles: [f64; 3]) -> f64 {
    let (mut direction, mut height, mut energy) = (0.0, 0.0, 0.0);
    for (link, angle) in LINKS.iter().zip(angles) {
        direction += (link.start + angle).to_radians();
        energy += link.mass * 9.806_65 * (height + link.centre * direction.sin());
        height += link.length * direction.sin();
    }
    energy
}

/// What the joints gain in motion the weights lose in height: torques are the slope of one energy.
#[test]
fn it_falls_without_a_loss_or_a_gain() {
    for mounting in [Mounting::Normal, Mounting::Mirrored] {
        let mut world = World::new(1);
        let escs = motors(&mut world);
        let sign = if mounting == Mounting::Normal { 1.0 } else { -1.0 };
        let links = escs.iter().zip(LINKS).map(|(esc, link)| (esc, mounting, link));
        world.add_arm(links).unwrap();
        let begin = potential([0.0; 3]);
        let mut fastest = 0.0_f64;
        for tick in 1..=2000 {
            world.advance(Micros::new(tick * 500));
            let states = escs.each_ref().map(Esc::state);
            let moved: f64 = (states.iter().zip(&escs))
                .map(|(state, esc)| {
                    let speed = state.load_rpm * std::f64::consts::TAU / 60.0;
                    0.5 * esc.plant().inertia() * speed * speed
                })
                .sum();
            let fallen = begin - potential(states.map(|state| sign * state.load_degrees));
            assert!((moved - fallen).abs() < 0.01, "{tick}: {moved} J moved, {fallen} J fallen");
            fastest = fastest.max(moved);
        }
        assert!(fastest > 2.0, "{fastest}");
    }
}

#[test]
fn a_motor_carries_one_link_in_its_own_world() {
    let (mut world, mut other) = (World::new(1), World::new(1));
    let (escs, strangers) = (motors(&mut world), motors(&mut other));
    let mut add = |esc: &Esc, then: &Esc| {
        world.add_arm([esc, then].map(|esc| (esc, Mounting::Normal, LINKS[0]))).err()
    };
    assert_eq!(add(&escs[0], &strangers[1]), Some(WheelError::OtherWorld));
    assert_eq!(add(&escs[0], &escs[0]), Some(WheelError::Taken));
    assert_eq!(add(&escs[0], &escs[1]), None);
    assert_eq!(add(&escs[2], &escs[1]), Some(WheelError::Taken));
}
