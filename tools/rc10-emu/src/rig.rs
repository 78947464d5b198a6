//! A chip on its wires, with motors, faults and everything that is measured: one scenario.

use anyhow::{Result, ensure};
use rc10_sim::{Bus, Esc, Faults, Line, LineEntry, Nanos, Parts, TraceEntry, World};

use crate::fault::{ChipFault, Fault, Kind};
use crate::machine::Machine;

/// The steps of a scenario; faults begin and end at their exact times between them.
const STEP: Nanos = Nanos::new(1_000_000);

/// One scenario: a machine in a world.
pub struct Rig {
    /// The chip.
    pub machine: Machine,
    /// The chip of the robot's other board.
    pub partner: Option<Machine>,
    /// The world around the chip.
    pub world: World,
    /// The buses.
    pub buses: Vec<Bus>,
    /// The RS-485 lines.
    pub lines: Vec<Line>,
    /// The motors, and the bus that each is on, 0 for the first.
    pub motors: Vec<(usize, Esc)>,
    /// The frames on each bus so far, in the order of the wire.
    pub logs: Vec<Vec<TraceEntry>>,
    line_bytes: Vec<Vec<LineEntry>>,
    faults: Faults<ChipFault>,
    next_step: Nanos,
}

impl Rig {
    /// Puts a chip on buses, FDCAN1 on the first, and on lines, each at a UART (1 for USART1).
    /// `motors` says on which bus each motor is. Fails if a fault is on a bus or line that is not
    /// there, or in a handler that the program does not have; if there is no such UART.
    pub fn new(
        mut machine: Machine,
        world: World,
        buses: Vec<Bus>,
        lines: Vec<(u8, Line)>,
        motors: Vec<(usize, Esc)>,
        faults: &[Fault],
    ) -> Result<Self> {
        for Fault { kind, .. } in faults {
            match kind {
                Kind::Other(ChipFault::Hang(handler)) => drop(machine.exception_of(handler)?),
                Kind::Other(ChipFault::CrystalDead) => machine.set_crystal(false),
                _ => ensure!(*kind != Kind::RemoteLost, "{kind}: the rig has no remote to lose"),
            }
        }
        for (index, bus) in buses.iter().enumerate() {
            machine.connect(index, bus);
        }
        for (uart, line) in &lines {
            machine.connect_line(*uart, line)?;
            line.keep_trace();
        }
        let lines: Vec<_> = lines.into_iter().map(|(_, line)| line).collect();
        Ok(Self {
            machine,
            partner: None,
            world,
            logs: vec![Vec::new(); buses.len()],
            line_bytes: vec![Vec::new(); lines.len()],
            faults: Faults::new(&buses, &lines, faults)?,
            buses,
            lines,
            motors,
            next_step: STEP,
        })
    }

    /// Adds the chip of the robot's other board, on its own ends of wires.
    ///
    /// # Errors
    /// If there is no such UART.
    pub fn set_partner(
        &mut self,
        mut machine: Machine,
        buses: &[Bus],
        lines: impl IntoIterator<Item = (u8, Line)>,
    ) -> Result<()> {
        for (index, bus) in buses.iter().enumerate() {
            machine.connect(index, bus);
        }
        for (uart, line) in lines {
            machine.connect_line(uart, &line)?;
        }
        self.partner = Some(machine);
        Ok(())
    }

    /// Adds the things with labels, for their faults.
    pub fn connect_parts(&mut self, parts: Parts) {
        self.faults.set_parts(parts);
    }

    /// Begins one more fault now, or ends one.
    pub fn plan(&mut self, begins: bool, kind: Kind) {
        self.faults.plan(self.machine.now(), begins, kind);
    }

    /// The bytes on each line since the last call, in the order of their ends.
    pub fn take_line_bytes(&mut self) -> Vec<Vec<LineEntry>> {
        self.line_bytes.iter_mut().map(std::mem::take).collect()
    }

    /// Lets chip and world go on up to a time. Fails if a fault cannot be put into the program.
    pub fn run(&mut self, until: Nanos) -> Result<()> {
        while self.machine.now() < until {
            let next_fault = self.faults.next(self.machine.now()).unwrap_or(until);
            let next = self.next_step.min(next_fault).min(until);
            match &mut self.partner {
                Some(other) => self.machine.run_with(other, &mut self.world, next)?,
                None => self.machine.run(&mut self.world, next)?,
            }
            self.collect();
            for (begins, kind) in self.faults.act(next) {
                if let Kind::Other(fault) = kind {
                    self.machine.inject(&fault, begins)?;
                }
            }
            if next >= self.next_step {
                self.next_step = self.next_step + STEP;
            }
        }
        Ok(())
    }

    fn collect(&mut self) {
        for (index, (bus, log)) in self.buses.iter().zip(&mut self.logs).enumerate() {
            let new = bus.take_trace();
            self.faults.heard(index, &new);
            log.extend(new);
        }
        for (line, bytes) in self.lines.iter().zip(&mut self.line_bytes) {
            bytes.extend(line.take_trace());
        }
    }
}
