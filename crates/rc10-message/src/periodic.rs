use core::cell::Cell;
use core::fmt;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Instant, Timer};
use rc10_app::Seconds;
use rc10_time::{Micros, Schedule, Timing};

use crate::now;

/// One start of periodic work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// The time at which it started.
    pub now: Micros,
    /// Time since the start before, measured; the planned period at the first start.
    pub dt: Seconds,
}

/// Times of periodic work: period, execution, and overruns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Load {
    /// From each start to the next one. The first start is not in it.
    pub period: Timing,
    /// From each start to the end of the work, with everything that interrupted it.
    pub execution: Timing,
    /// Starts that came a whole period or more too late, or not at all.
    pub overruns: u32,
}

/// A place for the [`Load`] that [`Every`] writes, for other tasks to read.
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

/// The starts of periodic work, on a grid that a late one does not move: those whose time has gone by are left out.
///
/// ```
/// # mod clock { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clock/mod.rs")); }
/// use rc10_message::{Every, Statistics};
/// # use rc10_time::Micros;
///
/// static BLINK: Statistics = Statistics::new();
///
/// async fn blink() -> ! {
///     let (mut every, mut lit) = (Every::millis(500).with_statistics(&BLINK), false);
///     loop {
///         let tick = every.next().await; // tick.now, and tick.dt since the start before
///         lit = !lit;
///     }
/// }
/// # clock::run_until(Micros::from_millis(1_700), blink());
/// // After 1.7 s: started at 0, 0.5, 1 and 1.5 s; the work of the last one has not been measured.
/// assert_eq!(BLINK.read().execution.count(), 4);
/// ```
#[derive(Debug)]
#[must_use]
pub struct Every<'s> {
    plan: Schedule,
    last: Option<Micros>,
    statistics: Option<&'s Statistics>,
}

impl<'s> Every<'s> {
    /// Starts from now on, this many milliseconds apart.
    pub fn millis(period: u64) -> Self {
        Self::new(Micros::from_millis(period))
    }

    /// Starts from now on, with this period.
    pub fn new(period: Micros) -> Self {
        Self { plan: Schedule::new(now(), period), last: None, statistics: None }
    }

    /// Measured: `statistics` gets its periods, and how long the work takes from each start until it waits
    /// for the next.
    pub const fn with_statistics(mut self, statistics: &'s Statistics) -> Self {
        self.statistics = Some(statistics);
        self
    }

    /// Waits for the next start.
    ///
    /// # Cancel safety
    /// Cancelled, it loses no start.
    pub async fn next(&mut self) -> Tick {
        let mut load = self.statistics.map(Statistics::read);
        if let (Some(load), Some(last)) = (&mut load, self.last) {
            load.execution.add(now().since(last));
            self.write(*load);
        }
        Timer::at(Instant::from_micros(self.plan.next().get())).await;
        let now = now();
        let start = self.plan.start(now);
        let since_last = self.last.map_or(self.plan.period(), |last| now.since(last));
        if let Some(load) = &mut load {
            let overruns =
                start.missed + u32::from(start.missed == 0 && start.late >= self.plan.period());
            load.overruns = load.overruns.saturating_add(overruns);
            if self.last.is_some() {
                load.period.add(since_last);
            }
            self.write(*load);
        }
        self.last = Some(now);
        Tick { now, dt: Seconds::from_micros(since_last.get()) }
    }

    fn write(&self, load: Load) {
        if let Some(statistics) = self.statistics {
            statistics.write(load);
        }
    }
}
