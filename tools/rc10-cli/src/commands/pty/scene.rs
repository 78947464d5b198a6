use anyhow::{Context, Result};
use rc10_can::Micros;
use rc10_sim::{Bus, Tasks};

use crate::commands::pty::PtyArgs;
use crate::world::environment::Environment;
use crate::world::robot::Robot;

pub(super) struct Scene<'r> {
    around: Environment,
    client: usize,
    tasks: Tasks<'r>,
}

impl<'r> Scene<'r> {
    pub(super) fn new(args: &PtyArgs, mut robot: Robot<'r>) -> Result<Self> {
        if !args.alone {
            robot.fit(args.force)?;
        }
        let around = Environment::new(robot.description(), args.seed)?;
        let buses = around.wires.len();
        let bus = args.bus.context("--bus says which")?;
        let client = usize::from(bus).checked_sub(1).filter(|&bus| bus < buses);
        let client =
            client.with_context(|| format!("--bus {bus}: the robot has buses 1 to {buses}"))?;
        let tasks = if args.alone { Tasks::new() } else { robot.tasks(&around)? };
        Ok(Self { around, client, tasks })
    }

    pub(super) fn now(&self) -> Micros {
        self.around.world.now()
    }

    pub(super) fn wire(&self) -> &Bus {
        &self.around.wires[self.client]
    }

    pub(super) fn run(&mut self, until: Micros) {
        self.around.run(&mut self.tasks, until);
        // The traces of the other buses are not read.
        let others = self.around.wires.iter().enumerate().filter(|(bus, _)| *bus != self.client);
        others.for_each(|(_, wire)| drop(wire.take_trace()));
    }
}
