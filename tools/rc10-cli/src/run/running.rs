//! A robot that runs in virtual time: in the simulator, or its program on the emulated chip.

use anyhow::Result;
use rc10_emu::LogLine;
use rc10_emu::fault::Kind;
use rc10_motor::MotorStatus;
use rc10_sim::{Base, Bus, Esc, TraceEntry};
use rc10_time::Micros;

use crate::recording::look::Moment;
use crate::robot::description::Description;
use crate::robot::operator::Operator;
use crate::run::watch::Sight;
use crate::world::console::ConsoleLine;

/// A robot that runs, and what can be seen of it.
pub trait Running {
    /// Its description, with the faults and mistakes of the run.
    fn description(&self) -> &Description;
    /// Whether its buses are real ones: then there is nothing to see but what it says.
    fn is_real(&self) -> bool {
        false
    }
    /// The time since power-on.
    fn now(&self) -> Micros;
    /// Lets everything go on up to a time. Fails if it cannot go on.
    fn run_to(&mut self, until: Micros) -> Result<()>;
    /// The line from its console to a PC, if there is one.
    fn console(&self) -> Option<&ConsoleLine>;
    /// The operator of its remote, if it has one.
    fn operator(&mut self) -> Option<&mut Operator>;
    /// Its base on the simulated floor, if it has one.
    fn base(&self) -> Option<&Base>;
    /// Begins a fault now, or ends it. Fails if there is no chip to do it to.
    fn inject(&mut self, begins: bool, kind: &Kind) -> Result<()>;
    /// The twins of its motors, in the order of the description.
    fn twins(&self) -> &[Esc];
    /// Takes the lines of the chip's log since the last call, if it has a chip.
    fn log(&mut self) -> Vec<LogLine> {
        Vec::new()
    }
    /// The wires of its buses.
    fn wires(&self) -> &[Bus];
    /// Looks at the remote and the motors from outside; `None` without a remote.
    fn sight(&self) -> Option<Sight<'_>>;
    /// Takes the frames that were on the wires since the last call, bus by bus.
    fn take_frames(&mut self) -> Vec<Vec<TraceEntry>>;
    /// Takes what reached its ticks since the last call, as [words](rc10_motor::record), if it is recorded.
    fn take_inputs(&mut self) -> Vec<u32> {
        Vec::new()
    }
    /// Values of its own signals, if they are known.
    fn signals(&self, now: Micros) -> Vec<Option<f64>>;
    /// The status of a motor.
    fn status(&self, entry: usize, now: Micros) -> MotorStatus;
    /// All else.
    fn moment(&self, now: Micros) -> Moment;
}
