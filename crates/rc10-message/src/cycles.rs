use core::sync::atomic::{AtomicU32, Ordering};

/// Number of runs in the mean. Of more than these, each counts for less, the older it is.
const NEWEST: u32 = 1024;

/// Clock cycles that work takes which is done again and again. One place measures, any may read.
///
/// ```
/// use rc10_message::Cycles;
///
/// // Of a clock of 480 MHz.
/// static WORK: Cycles = Cycles::new(480_000_000);
/// # let clock = core::cell::Cell::new(u32::MAX - 10);
/// # let counter = || clock.replace(clock.get().wrapping_add(6_200));
/// WORK.measure(counter, || { /* the work */ });
/// assert_eq!(WORK.read().map(|cycles| cycles.most), Some(6_200));
/// ```
#[derive(Debug)]
pub struct Cycles {
    a_second: u32,
    /// At most [`NEWEST`].
    runs: AtomicU32,
    /// Times [`NEWEST`].
    mean: AtomicU32,
    most: AtomicU32,
}

/// The measurement of [`Cycles`], with everything that interrupted the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CycleCount {
    /// Mean of a run, of about the newest 1024; one above 4 million cycles counts as that.
    pub mean: u32,
    /// The most that a run took so far.
    pub most: u32,
    /// Cycles of the clock in a second.
    pub a_second: u32,
}

impl Cycles {
    /// Nothing measured yet. The argument is the clock's cycles a second.
    #[must_use]
    pub const fn new(a_second: u32) -> Self {
        let [runs, mean, most] = [const { AtomicU32::new(0) }; 3];
        Self { a_second, runs, mean, most }
    }

    /// Does the work, and measures it by a counter of cycles that wraps at 2^32.
    #[inline]
    pub fn measure<R>(&self, counter: impl Fn() -> u32, work: impl FnOnce() -> R) -> R {
        let start = counter();
        let result = work();
        self.add(counter().wrapping_sub(start));
        result
    }

    #[inline]
    fn add(&self, cycles: u32) {
        let runs = (self.runs.load(Ordering::Relaxed) + 1).min(NEWEST);
        let mean = self.mean.load(Ordering::Relaxed);
        let counted = cycles.min(u32::MAX / NEWEST);
        self.mean.store(mean - mean / runs + counted * NEWEST / runs, Ordering::Relaxed);
        let most = self.most.load(Ordering::Relaxed);
        self.most.store(most.max(cycles), Ordering::Relaxed);
        self.runs.store(runs, Ordering::Relaxed);
    }

    /// The measurement so far; `None` before the first run.
    #[must_use]
    pub fn read(&self) -> Option<CycleCount> {
        let is_measured = self.runs.load(Ordering::Relaxed) > 0;
        let mean = self.mean.load(Ordering::Relaxed) / NEWEST;
        let most = self.most.load(Ordering::Relaxed);
        is_measured.then_some(CycleCount { mean, most, a_second: self.a_second })
    }
}
