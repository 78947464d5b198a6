//! A robot in the simulator: its own tasks, against simulated motors on simulated wires.

use anyhow::{Result, bail, ensure};
use rc10_emu::fault::{ChipFault, Kind};
use rc10_module::Reception;
use rc10_motor::embassy::BusPort;
use rc10_motor::{ArmState, ArmSwitch, Loops, MotorStatus};
use rc10_sim::{Base, Bus, Esc, Faults, Tasks, TraceEntry};
use rc10_tasks::seen::Whole;
use rc10_time::Micros;

use crate::recording::look::{BusLook, Moment, RobotLook};
use crate::recording::sample::NOWHERE;
use crate::robot::description::Description;
use crate::robot::operator::Operator;
use crate::run::running::Running;
use crate::run::watch::Sight;
use crate::world::console::ConsoleLine;
use crate::world::environment::{Environment, Real, rounded_up};
use crate::world::inputs::Written;
use crate::world::ports::Ports;
use crate::world::robot::Robot;

/// A robot that runs in its environment.
pub struct Simulation<'r> {
    /// The environment.
    pub around: Environment,
    pub(crate) tasks: Tasks<'r>,
    pub(crate) ports: Ports<'r>,
    pub(crate) loops: Vec<Option<Loops>>,
    description: Description,
    faults: Faults<ChipFault>,
    /// Frames on the wires that were not taken yet.
    frames: Vec<Vec<TraceEntry>>,
    inputs: Option<&'static Written>,
}

impl<'r> Simulation<'r> {
    /// A robot before its start; with a PC at its console of so many bits a second, if there is to be one.
    /// Fails if the robot is not as described, has no console though there is to be one, or its
    /// environment cannot be built.
    pub fn new(robot: Robot<'r>, seed: u64, console: Option<u32>) -> Result<Self> {
        Self::with(robot, seed, console, &[])
    }

    /// The same, in which this is real.
    pub(crate) fn with(
        robot: Robot<'r>,
        seed: u64,
        console: Option<u32>,
        real: &[Real],
    ) -> Result<Self> {
        ensure!(
            console.is_none() || robot.has_console(),
            "this robot has no console in the simulator: see Robot::live"
        );
        let (description, ports, loops) =
            (robot.description().clone(), robot.ports(), robot.loops());
        let mut around = Environment::new(&description, seed)?;
        if let Some(baud) = console {
            around = around.with_console(baud);
        }
        if !real.is_empty() {
            around.leave_to(real.iter().copied());
        }
        let faults = around.faults(&description)?;
        let inputs = robot.inputs;
        let tasks = robot.tasks(&around)?;
        let frames = vec![Vec::new(); around.wires.len()];
        Ok(Self { around, tasks, ports, loops, description, faults, frames, inputs })
    }

    /// Whether it is armed. It need not say what arms it: its buses and lines know.
    fn arm(&self) -> Option<ArmState> {
        let Ports { switch, buses, lines, .. } = &self.ports;
        let bus = || buses.first().map(|port| port.status().arm);
        let line = || lines.first().map(|port| port.status().arm);
        switch.map(ArmSwitch::state).or_else(bus).or_else(line)
    }
}

impl Running for Simulation<'_> {
    fn description(&self) -> &Description {
        &self.description
    }

    fn is_real(&self) -> bool {
        !self.around.real.is_empty()
    }

    fn now(&self) -> Micros {
        self.around.world.now()
    }

    fn run_to(&mut self, until: Micros) -> Result<()> {
        while self.now() < until {
            let fault = self.faults.next(self.around.world.now_ns());
            let next = fault.map_or(until, rounded_up).min(until);
            self.around.run(&mut self.tasks, next);
            for (bus, wire) in self.around.wires.iter().enumerate() {
                let news = wire.take_trace();
                self.faults.heard(bus, &news);
                self.frames[bus].extend(news);
            }
            // The remote's are in its operator's hands, those of a chip are refused.
            let _ = self.faults.act(self.now().into());
        }
        Ok(())
    }

    fn console(&self) -> Option<&ConsoleLine> {
        self.around.console.as_ref()
    }

    fn operator(&mut self) -> Option<&mut Operator> {
        self.around.operator.as_mut()
    }

    fn inject(&mut self, begins: bool, kind: &Kind) -> Result<()> {
        ensure!(!self.is_real(), "a real robot is broken by hand, not from here");
        match (kind, &mut self.around.operator) {
            (Kind::Other(_), _) => {
                bail!("{kind}: the simulator has no chip to do that to; --emu does it")
            }
            (Kind::RemoteLost, Some(operator)) => operator.lose(begins),
            _ => self.faults.plan(self.around.world.now_ns(), begins, kind.clone()),
        }
        Ok(())
    }

    fn base(&self) -> Option<&Base> {
        self.around.base.as_ref()
    }

    fn twins(&self) -> &[Esc] {
        &self.around.motors
    }

    fn wires(&self) -> &[Bus] {
        &self.around.wires
    }

    fn sight(&self) -> Option<Sight<'_>> {
        let sent = self.around.remote.as_ref()?.remote.sent();
        let (motors, twins) = (&self.description.motors, &self.around.motors);
        Some(Sight { sent, motors, twins, arm: self.ports.switch.map(ArmSwitch::state) })
    }

    fn take_frames(&mut self) -> Vec<Vec<TraceEntry>> {
        self.frames.iter_mut().map(std::mem::take).collect()
    }

    fn take_inputs(&mut self) -> Vec<u32> {
        self.inputs.map(Written::take).unwrap_or_default()
    }

    fn signals(&self, now: Micros) -> Vec<Option<f64>> {
        self.ports.signals.iter().map(|signal| (signal.read)(now)).collect()
    }

    fn status(&self, entry: usize, _: Micros) -> MotorStatus {
        let port = self.ports.motor(&self.description, entry);
        port.map_or(MotorStatus::NEW, |port| port.status())
    }

    fn moment(&self, now: Micros) -> Moment {
        let Ports { buses, lines, parts, whole, yaw, reception, .. } = &self.ports;
        let bus = |port: &&BusPort| BusLook { status: port.status(), ..BusLook::default() };
        let unsaid = || Whole { arm: self.arm(), ..Whole::default() };
        Moment {
            robot: RobotLook {
                whole: whole.as_ref().map_or_else(unsaid, |whole| whole()),
                pose: self.around.base.as_ref().map_or(NOWHERE, Base::pose),
                yaw: yaw.as_ref().and_then(|(_, yaw)| yaw(now)),
            },
            buses: buses.iter().map(bus).collect(),
            lines: lines.iter().map(|port| port.status()).collect(),
            parts: parts.iter().map(|reception| reception.read()).collect(),
            remote: self.sight().map(|sight| sight.remote(reception.map(Reception::read))),
        }
    }
}
