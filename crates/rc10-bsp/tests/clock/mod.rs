// A clock for tests: stands still while code runs, and jumps to the next deadline when all of it
// waits. One per thread, so that tests do not disturb each other.
//
// Written as a driver of its own, not taken from embassy-time's `mock-driver` feature: features
// unify over a workspace, and a second driver elsewhere in it would no longer link.

struct Clock;

std::thread_local! {
    static NOW: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
    static NEXT: std::cell::Cell<u64> = const { std::cell::Cell::new(u64::MAX) };
}

impl embassy_time_driver::Driver for Clock {
    fn now(&self) -> u64 {
        NOW.get()
    }
    fn schedule_wake(&self, at: u64, _: &core::task::Waker) {
        // `run_until` polls at every deadline, so no task needs to be woken.
        NEXT.set(NEXT.get().min(at));
    }
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock);

/// Lets time pass while code runs.
pub fn spend(time: rc10_can::Micros) {
    NOW.set(NOW.get() + time.get());
}

/// Runs a task until the clock would pass `end`.
pub fn run_until<T>(end: rc10_can::Micros, task: impl Future<Output = T>) {
    let mut task = std::pin::pin!(task);
    let mut context = core::task::Context::from_waker(core::task::Waker::noop());
    loop {
        if task.as_mut().poll(&mut context).is_ready() {
            return;
        }
        let next = NEXT.replace(u64::MAX).max(NOW.get());
        if next > end.get() {
            NOW.set(NOW.get().max(end.get()));
            return;
        }
        NOW.set(next);
    }
}
