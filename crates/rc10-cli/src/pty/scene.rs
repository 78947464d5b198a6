use std::pin::Pin;

use anyhow::{Context, Result};
use rc10_can::Micros;
use rc10_sim::{Bus, Tasks, World};

use super::PtyArgs;
use crate::robot::Robot;
use crate::surroundings::Surroundings;

/// The world, with or without the robot.
pub(super) struct Scene<'r> {
    pub(super) world: World,
    wires: Vec<Bus>,
    /// The place of the client's bus among them.
    client: usize,
    tasks: Tasks<'r>,
}

impl<'r> Scene<'r> {
    pub(super) fn new(args: &PtyArgs, robot: Robot<'r>) -> Result<Self> {
        let description = robot.description();
        let Surroundings { world, wires, lines, .. } = Surroundings::new(description, args.seed)?;
        let client = usize::from(args.bus).checked_sub(1).filter(|&bus| bus < wires.len());
        let client = client.with_context(|| {
            format!("--bus {}: the robot has buses 1 to {}", args.bus, wires.len())
        })?;
        let tasks = if args.alone { Tasks::new() } else { robot.tasks(&wires, &lines)? };
        Ok(Self { world, wires, client, tasks })
    }

    /// The client's.
    pub(super) fn wire(&self) -> &Bus {
        &self.wires[self.client]
    }

    pub(super) fn run(&mut self, until: Micros) {
        if self.world.run(Pin::new(&mut self.tasks), until).is_ready() {
            self.world.advance(until);
        }
        // Nobody reads what is said on the others.
        let others = self.wires.iter().enumerate().filter(|(bus, _)| *bus != self.client);
        others.for_each(|(_, wire)| drop(wire.take_trace()));
    }
}
