//! A chip on its wires, with motors, faults and everything that is measured: one scenario.

use anyhow::{Context, Result, ensure};
use rc10_can::CanFrame;
use rc10_sim::{Bus, Esc, Nanos, TraceEntry, World};

use crate::fault::{Fault, Kind};
use crate::machine::{Injection, Machine};
use crate::memory::FLASH;

/// The steps in which a scenario goes on: faults begin and end at their exact times, between two
/// steps.
const STEP: Nanos = Nanos::new(1_000_000);
/// Frames that a filled bus has waiting: more than a step's worth.
const FILLER: usize = 12;
/// While a bus is filled, one step in this many is not: so that "99 %" is not "100 %".
const FILLER_PAUSE: u64 = 100;

/// What happened on one bus.
#[derive(Default)]
pub struct BusLog {
    /// Its frames, in the order of the wire.
    pub frames: Vec<TraceEntry>,
    /// The newest of its least urgent feedback, which fills it.
    filler: Option<CanFrame>,
}

/// One scenario: a machine in a world.
pub struct Rig {
    /// The chip.
    pub machine: Machine,
    /// What is around it.
    pub world: World,
    buses: Vec<Bus>,
    motors: Vec<(usize, Esc)>,
    logs: Vec<BusLog>,
    /// Beginnings (`true`) and ends of faults, in the order of time.
    timeline: Vec<(Nanos, bool, Kind)>,
    filled: Vec<bool>,
    next_step: Nanos,
}

impl Rig {
    /// Puts a chip on buses; FDCAN1 is on the first. `motors` says on which bus each motor is.
    ///
    /// # Errors
    /// If a fault is on a bus that is not there, or in a handler that the program does not have.
    pub fn new(
        mut machine: Machine,
        world: World,
        buses: Vec<Bus>,
        motors: Vec<(usize, Esc)>,
        faults: &[Fault],
    ) -> Result<Self> {
        let mut timeline = Vec::new();
        for Fault { kind, from, until } in faults {
            ensure!(
                kind.bus().is_none_or(|bus| bus < buses.len()),
                "{kind}: there is no such bus; the last is {}",
                buses.len()
            );
            if let Kind::Hang(handler) = kind {
                exception_of(&machine, handler)?;
            }
            if *kind == Kind::CrystalDead {
                machine.set_crystal(false);
                continue;
            }
            ensure!(*kind != Kind::RemoteLost, "{kind}: whoever holds the remote must do that");
            timeline.push((*from, true, kind.clone()));
            timeline.extend(until.map(|until| (until, false, kind.clone())));
        }
        // Stable: what begins and ends at one moment does so as it was written.
        timeline.sort_by_key(|entry| entry.0);
        for (index, bus) in buses.iter().enumerate() {
            machine.connect(index, bus);
        }
        Ok(Self {
            machine,
            world,
            logs: buses.iter().map(|_| BusLog::default()).collect(),
            filled: vec![false; buses.len()],
            buses,
            motors,
            timeline,
            next_step: STEP,
        })
    }

    /// The buses.
    #[must_use]
    pub fn buses(&self) -> &[Bus] {
        &self.buses
    }

    /// The motors, and the bus that each is on, 0 for the first.
    #[must_use]
    pub fn motors(&self) -> &[(usize, Esc)] {
        &self.motors
    }

    /// What happened on each bus so far.
    #[must_use]
    pub fn logs(&self) -> &[BusLog] {
        &self.logs
    }

    /// Lets chip and world go on up to a time.
    ///
    /// # Errors
    /// If a fault cannot be put into the program.
    pub fn run(&mut self, until: Nanos) -> Result<()> {
        while self.machine.now() < until {
            let next_fault = self.timeline.first().map_or(until, |entry| entry.0);
            let next = self.next_step.min(next_fault).min(until);
            self.machine.run(&mut self.world, next)?;
            while self.timeline.first().is_some_and(|entry| entry.0 <= next) {
                let (_, begins, kind) = self.timeline.remove(0);
                self.apply(begins, &kind)?;
            }
            self.collect();
            if next >= self.next_step {
                self.next_step = self.next_step + STEP;
                self.fill();
            }
        }
        Ok(())
    }

    fn apply(&mut self, begins: bool, kind: &Kind) -> Result<()> {
        match *kind {
            Kind::Cut(bus) => self.buses[bus].set_cut(begins),
            Kind::Short(bus) => self.buses[bus].set_shorted(begins),
            Kind::Dominant(bus) => self.buses[bus].set_held_dominant(begins),
            Kind::Noise(bus) => self.buses[bus].damage(1),
            Kind::Power(bus) => {
                let of_bus = self.motors.iter().filter(|(on, _)| *on == bus);
                of_bus.for_each(|(_, motor)| motor.set_power(!begins));
            }
            Kind::Load(bus) => self.filled[bus] = begins,
            Kind::Panic => self.machine.inject(Injection::Panic)?,
            Kind::HardFault => self.machine.inject(Injection::HardFault)?,
            Kind::Hang(ref handler) => {
                let exception = exception_of(&self.machine, handler)?;
                self.machine.inject(if begins {
                    Injection::Hang { exception }
                } else {
                    Injection::EndHang { exception }
                })?;
            }
            Kind::Mask => self.machine.inject(Injection::MaskInterrupts(begins))?,
            Kind::CrystalStops => self.machine.set_crystal(!begins),
            // Done and refused by `new`.
            Kind::CrystalDead | Kind::RemoteLost => (),
        }
        Ok(())
    }

    fn collect(&mut self) {
        for (bus, log) in self.buses.iter().zip(&mut self.logs) {
            for entry in bus.take_trace() {
                let least_urgent = log.filler.is_none_or(|filler| entry.frame.id() >= filler.id());
                if !entry.from_controller && least_urgent {
                    log.filler = Some(entry.frame);
                }
                log.frames.push(entry);
            }
        }
    }

    fn fill(&self) {
        if (self.next_step.get() / STEP.get()).is_multiple_of(FILLER_PAUSE) {
            return;
        }
        let filled = self.buses.iter().zip(&self.logs).zip(&self.filled);
        for ((bus, log), _) in filled.filter(|(_, filled)| **filled) {
            if let Some(frame) = &log.filler {
                for _ in bus.foreign_waiting()..FILLER {
                    bus.inject(frame);
                }
            }
        }
    }
}

/// The number of the exception that a function handles.
fn exception_of(machine: &Machine, handler: &str) -> Result<u16> {
    let address = machine.image().symbol(handler)?;
    // 16 exceptions of the core, then 163 interrupts (RM0468, NVIC chapter).
    for number in 1_u16..16 + 163 {
        if machine.memory().word(FLASH + 4 * u32::from(number))? == address {
            return Ok(number);
        }
    }
    None.with_context(|| format!("{handler} handles no exception"))
}
