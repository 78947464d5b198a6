//! The shipped robots, with other gains for one of their motors.

use rc10_cli::Simulated as _;
use rc10_cli::run::simulate::simulate;
use rc10_cli::world::robot::Robot;
use rc10_motor::rc10_app::Cascade;
use rc10_motor::{MotorBus, Names, Started};

use super::*;
use crate::common::made::{Made, attach};

/// A shipped robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    Team,
    Mixed,
}

pub const TEN_SECONDS: Micros = Micros::from_millis(10_000);

/// Other gains for the motor of a label.
pub type Change<'c> = (&'c str, &'c dyn Fn(&mut Cascade));

/// Runs it as it is shipped, but for a change.
pub fn run(which: Which, seed: u64, length: Micros, change: Option<Change<'_>>) -> Recording {
    let run = |robot: Robot<'_>| simulate(robot, seed, length).unwrap();
    match which {
        Which::Team => {
            let ports = team::Ports::new();
            let shared = &team::Shared::new(&ports);
            let mut all = motors::<team::Name>(change);
            let mut buses = [(); 3].map(|()| MotorBus::new(&shared.switch));
            attach(&mut all, &mut buses.each_mut(), &mut []);
            let robot = Robot::on(team::Robot::description(), buses, [], shared);
            run(robot.program::<team::Robot>(shared))
        }
        Which::Mixed => {
            let ports = mixed::Ports::new();
            let shared = &mixed::Shared::new(&ports);
            let mut all = motors::<mixed::Name>(change);
            let mut started = Started::<2, 1>::new(&shared.switch);
            let Started { buses, lines } = &mut started;
            attach(&mut all, &mut buses.each_mut(), &mut lines.each_mut());
            let Started { buses, lines } = started;
            let lines = lines.map(|line| line.with_reply_timeout(mixed::table::REPLY).unwrap());
            let world = mixed::Robot::description();
            run(Robot::on(world, buses, lines, shared).program::<mixed::Robot>(shared))
        }
    }
}

/// The motors of a declaration, with the change.
fn motors<N: Names>(change: Option<Change<'_>>) -> Vec<Made> {
    let made = |name: &N| {
        let entry = name.entry();
        Made::new(entry, |cascade| {
            let change = change.into_iter().filter(|(label, _)| *label == entry.label);
            change.for_each(|(_, f)| f(cascade));
        })
    };
    N::ALL.iter().map(made).collect()
}
