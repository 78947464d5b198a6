//! The state of buses in a few numbers, and whether they tick.

use core::fmt;

use rc10_can::ErrorState;
use rc10_motor::embassy::{BusPort, BusStatus};

/// Status of a bus, for a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusSummary {
    /// Ticks so far.
    pub ticks: u32,
    /// Ticks that did not happen in time.
    pub overruns: u32,
    /// Longest time from tick to tick, in microseconds.
    pub longest_period: u32,
    /// Longest tick, in microseconds.
    pub longest_tick: u32,
    /// Frames that its motors understood.
    pub received: u32,
    /// Frames that had a motor's identifier and were no feedback.
    pub malformed: u32,
    /// Received frames that were lost.
    pub lost: u32,
    /// Error state of the controller.
    pub state: ErrorState,
    /// No other node acknowledges its frames: it seems to be alone on the bus.
    pub alone: bool,
    /// Number of times that the controller went bus-off.
    pub bus_offs: u32,
    /// Number of times that the controller was found unable to send (restricted operation).
    pub restrictions: u32,
    /// Number of times that the bus stood still and was made safe.
    pub stalls: u32,
}

impl From<BusStatus> for BusSummary {
    fn from(status: BusStatus) -> Self {
        let BusStatus { ticks, overruns, period, execution, received, health, .. } = status;
        Self {
            ticks,
            overruns,
            longest_period: period.max().unwrap_or(0),
            longest_tick: execution.max().unwrap_or(0),
            received: received.received,
            malformed: received.malformed,
            lost: health.receive_lost,
            state: health.state,
            alone: health.is_alone(),
            bus_offs: health.bus_offs,
            restrictions: health.restrictions,
            stalls: health.stalls,
        }
    }
}

impl fmt::Display for BusSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.state)?;
        if self.alone {
            write!(f, ", alone on the bus")?;
        }
        let Self { ticks, longest_tick, longest_period, received, .. } = self;
        write!(f, ": {ticks} ticks of {longest_tick} us, {longest_period} us apart")?;
        write!(f, ", {received} received")?;
        for (count, what) in [
            (self.overruns, "ticks missed"),
            (self.malformed, "malformed"),
            (self.lost, "lost"),
            (self.bus_offs, "times bus-off"),
            (self.restrictions, "times restricted"),
            (self.stalls, "times stalled"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        Ok(())
    }
}

/// Sees whether every bus ticks: a watchdog is fed only then.
#[derive(Clone, Copy, Debug)]
pub struct TickWatch<const BUSES: usize> {
    ticks: [u32; BUSES],
}

impl<const BUSES: usize> TickWatch<BUSES> {
    /// From now on.
    #[must_use]
    pub fn new(buses: &[BusPort; BUSES]) -> Self {
        Self { ticks: buses.each_ref().map(BusPort::ticks) }
    }

    /// Whether every bus has ticked since the last call. Ask less often than they tick.
    pub fn have_all_ticked(&mut self, buses: &[BusPort; BUSES]) -> bool {
        let before = core::mem::replace(&mut self.ticks, buses.each_ref().map(BusPort::ticks));
        self.ticks.iter().zip(before).all(|(now, before)| *now != before)
    }
}
