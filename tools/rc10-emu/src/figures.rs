//! Figures of a scenario.

use rc10_sim::{Nanos, TraceEntry};

use crate::fdcan::Spread;
use crate::peripherals::AccessKind;
use crate::rig::Rig;

/// The figures of a scenario so far.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// Duration of the run since power-on.
    pub length: Nanos,
    /// Time from the final clock to the chip's first frame on the last of its buses; `None` before.
    pub boot: Option<Nanos>,
    /// One per bus.
    pub buses: Vec<BusFigures>,
    /// Executed instructions.
    pub instructions: u64,
    /// The deepest that the stack ever was, in bytes.
    pub stack_bytes: u32,
    /// Accesses to addresses without a device.
    pub unowned_accesses: u64,
    /// Accesses to peripherals without a clock.
    pub gated_accesses: u64,
}

/// The figures of one bus.
#[derive(Clone, Debug, PartialEq)]
pub struct BusFigures {
    /// Frames on the wire.
    pub frames: u64,
    /// Frames that the chip sent.
    pub sent: u64,
    /// Frames of others that the chip's filters let into FIFO 0.
    pub received: u64,
    /// Frames that found FIFO 0 full.
    pub lost: u64,
    /// Frames let into FIFO 1 or nowhere: no motor's, no subscriber's.
    pub foreign: u64,
    /// Transmissions that were not acknowledged, or that were destroyed.
    pub failed: u64,
    /// Times the controller went bus-off.
    pub bus_offs: u64,
    /// Load of the wire, per cent.
    pub load: f64,
    /// Time from one tick to the next: from request to request for a first frame after a pause.
    pub tick_period: Option<Spread>,
}

impl Figures {
    /// Figures of a scenario so far.
    pub fn of(rig: &Rig) -> Self {
        let machine = &rig.machine;
        let soc = machine.soc();
        let ready = machine.ready;
        let first = |log: &Vec<TraceEntry>| {
            log.iter().find(|entry| entry.from_controller).map(|entry| entry.start)
        };
        let last_first = rig
            .logs
            .iter()
            .map(first)
            .try_fold(Nanos::ZERO, |latest, first| Some(latest.max(first?)));
        let stack_top = machine.image.stack().map_or(0, |stack| stack.end);
        let lowest = machine.profile.lowest_stack().unwrap_or(stack_top);
        Self {
            length: machine.now(),
            boot: ready.zip(last_first).map(|(ready, first)| first.since(ready)),
            buses: (0..rig.buses.len()).map(|index| BusFigures::of(rig, index)).collect(),
            instructions: machine.profile.total(),
            stack_bytes: stack_top.saturating_sub(lowest),
            unowned_accesses: soc.count(AccessKind::Unowned),
            gated_accesses: soc.count(AccessKind::Gated),
        }
    }

    /// Ticks of all buses.
    pub fn ticks(&self) -> u64 {
        let periods = self.buses.iter().filter_map(|bus| bus.tick_period);
        periods.map(|period| period.count + 1).sum()
    }

    /// Frames that the chip received.
    pub fn received(&self) -> u64 {
        self.buses.iter().map(|bus| bus.received).sum()
    }

    /// Frames that the chip lost.
    pub fn lost(&self) -> u64 {
        self.buses.iter().map(|bus| bus.lost).sum()
    }
}

impl BusFigures {
    fn of(rig: &Rig, index: usize) -> Self {
        let frames = &rig.logs[index];
        let sent = frames.iter().filter(|entry| entry.from_controller).count();
        let fdcan = rig.machine.fdcan();
        let counters = fdcan.counters(index);
        let [claimed, foreign] = counters.received;
        Self {
            frames: frames.len() as u64,
            sent: sent as u64,
            received: claimed,
            lost: counters.lost[0],
            foreign: foreign + counters.rejected,
            failed: counters.failed,
            bus_offs: counters.bus_offs,
            load: rig.buses[index].load(),
            tick_period: Some(counters.tick_period).filter(|period| period.count > 0),
        }
    }
}
