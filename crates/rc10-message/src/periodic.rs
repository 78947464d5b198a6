use core::cell::Cell;
use core::fmt;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Instant, Timer};
use rc10_time::{Micros, Schedule, Timing};

use crate::now;

/// The policy for starts whose time has gone by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overrun {
    /// Leave them out: for control, where only the newest matters.
    Skip,
    /// Make up for them as fast as possible: for counting and logging.
    CatchUp,
}

/// One start of periodic work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// The time at which it started.
    pub now: Micros,
    /// Time since the start before; the planned period at the first start.
    pub since_last: Micros,
}

/// Times of periodic work: period, execution, and overruns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    /// From each start to the next one. The first start is not in it.
    pub period: Timing,
    /// From each start to the end of the work, with everything that interrupted it.
    pub execution: Timing,
    /// Starts that came a whole period or more too late, or, under [`Overrun::Skip`], not at all.
    pub overruns: u32,
}

/// A place for the [`Load`] that [`periodic`] writes, for other tasks to read.
pub struct Statistics(Mutex<CriticalSectionRawMutex, Cell<Load>>);

impl Statistics {
    /// Nothing measured yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(Mutex::new(Cell::new(Load {
            period: Timing::new(),
            execution: Timing::new(),
            overruns: 0,
        })))
    }

    /// The measurements so far.
    #[must_use]
    pub fn read(&self) -> Load {
        self.0.lock(Cell::get)
    }

    fn write(&self, load: Load) {
        self.0.lock(|cell| cell.set(load));
    }
}

impl Default for Statistics {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Statistics").field(&self.read()).finish()
    }
}

/// Does `work` every `period` for ever, on a grid that a late start does not move.
///
/// ```
/// # mod clock { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clock/mod.rs")); }
/// use rc10_message::{Overrun, Statistics, periodic};
/// use rc10_time::Micros;
///
/// static BLINK: Statistics = Statistics::new();
///
/// let mut lit = false;
/// let blink = periodic(Micros::from_millis(500), Overrun::Skip, &BLINK, async |_| lit = !lit);
/// # clock::run_until(Micros::from_millis(1_700), blink);
/// // After 1.7 s: started at 0, 0.5, 1 and 1.5 s.
/// assert_eq!(BLINK.read().execution.count(), 4);
/// ```
pub async fn periodic(
    period: Micros,
    overrun: Overrun,
    statistics: &Statistics,
    mut work: impl AsyncFnMut(Tick),
) -> ! {
    let mut load = statistics.read();
    let mut plan = Schedule::new(now(), period);
    let mut last = None;
    loop {
        Timer::at(Instant::from_micros(plan.next().get())).await;
        let started = now();
        let start = match overrun {
            Overrun::Skip => plan.start(started),
            Overrun::CatchUp => plan.start_and_catch_up(started),
        };
        let overruns = start.missed + u32::from(start.missed == 0 && start.late >= plan.period());
        load.overruns = load.overruns.saturating_add(overruns);
        let since_last = last.map_or(plan.period(), |last| started.since(last));
        if last.is_some() {
            load.period.add(since_last);
        }
        last = Some(started);

        work(Tick { now: started, since_last }).await;
        load.execution.add(now().since(started));
        statistics.write(load);
    }
}
