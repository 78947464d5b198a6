//! How `Every` keeps time, on a clock that the test moves.
#![cfg(test)]
mod clock;

use std::cell::{Cell, RefCell};

use clock::{run_until, spend};
use rc10_message::{Every, Statistics, Tick};
use rc10_time::Micros;

const PERIOD: Micros = Micros::from_millis(1);

/// Does this at each start.
async fn every(statistics: &Statistics, mut work: impl FnMut(Tick)) {
    let mut every = Every::new(PERIOD).with_statistics(statistics);
    loop {
        work(every.next().await);
    }
}

#[test]
fn ten_thousand_periods_of_uneven_work_do_not_drift() {
    let statistics = Statistics::new();
    let starts = RefCell::new(Vec::new());
    let task = every(&statistics, |tick| {
        starts.borrow_mut().push(tick.now.get());
        spend(Micros::new(tick.now.get() * 7 % 997));
    });
    run_until(Micros::from_millis(10_000), task);
    let grid: Vec<u64> = (0..=10_000).map(|index| index * 1_000).collect();
    assert_eq!(*starts.borrow(), grid);
    let load = statistics.read();
    assert_eq!(load.overruns, 0);
    assert_eq!(load.period.count(), 10_000);
    assert_eq!((load.period.min(), load.period.max()), (Some(1000), Some(1000)));
    assert!(load.execution.max() <= Some(996));
}

/// The fifth start takes 3.5 ms; runs for 20 ms.
fn stumble() -> (Vec<u64>, Statistics) {
    let statistics = Statistics::new();
    let starts = RefCell::new(Vec::new());
    let task = every(&statistics, |tick| {
        starts.borrow_mut().push(tick.now.get());
        spend(Micros::new(if starts.borrow().len() == 5 { 3_500 } else { 10 }));
    });
    run_until(Micros::from_millis(20), task);
    (starts.into_inner(), statistics)
}

#[test]
fn skipping_counts_what_it_skips_and_stays_on_the_grid() {
    let (starts, statistics) = stumble();
    // The start of 5 ms happens at 7.5 ms; those of 6 and 7 ms do not happen.
    assert_eq!(starts[4..8], [4_000, 7_500, 8_000, 9_000]);
    assert_eq!(starts.len(), 21 - 2);
    let load = statistics.read();
    assert_eq!(load.overruns, 2);
    assert_eq!(load.execution.max(), Some(3_500));
    assert_eq!((load.period.min(), load.period.max()), (Some(500), Some(3_500)));
}

#[test]
fn work_learns_the_time_that_really_passed() {
    let statistics = Statistics::new();
    let longest = Cell::new(0.0);
    let task = every(&statistics, |tick| {
        longest.set(f32::max(longest.get(), tick.dt.get()));
        spend(Micros::new(if tick.now == PERIOD { 1_900 } else { 0 }));
    });
    run_until(Micros::from_millis(10), task);
    assert!((longest.get() - 1_900e-6).abs() < 1e-9, "{longest:?}");
}
