//! Virtual time behind `embassy-time`: the clock stands still until a [`World`](crate::World)
//! moves it.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::task::Waker;

// Code under test locks with `CriticalSectionRawMutex`: this links the host's implementation.
use critical_section as _;
use embassy_time_driver::Driver;
use rc10_time::Micros;

use crate::Nanos;

/// One world's time and the wakers that wait for it.
#[derive(Default)]
pub(crate) struct Clock {
    now: Cell<Nanos>,
    timers: RefCell<Vec<(Micros, Waker)>>,
    /// The time at which the next of them is due.
    next: Cell<Option<Micros>>,
}

impl Clock {
    pub(crate) fn now(&self) -> Micros {
        self.now.get().micros()
    }

    pub(crate) fn now_ns(&self) -> Nanos {
        self.now.get()
    }

    pub(crate) fn set(&self, now: Nanos) {
        self.now.set(now);
    }

    /// One entry per waker is enough, the earliest: a woken task polls, and each of its timers
    /// that still waits then registers again (what `embassy-time`'s own queues rely on, too).
    fn schedule(&self, at: Micros, waker: &Waker) {
        let mut timers = self.timers.borrow_mut();
        match timers.iter_mut().find(|(_, other)| other.will_wake(waker)) {
            Some((earliest, _)) => *earliest = at.min(*earliest),
            None => timers.push((at, waker.clone())),
        }
        self.next.set(Some(self.next.get().map_or(at, |next| next.min(at))));
    }

    /// The time at which the next timer is due.
    pub(crate) fn next_timer(&self) -> Option<Micros> {
        self.next.get()
    }

    /// Wakes the tasks whose time has come; says whether there were any.
    pub(crate) fn wake_due(&self) -> bool {
        let now = self.now();
        if self.next.get().is_none_or(|next| next > now) {
            return false;
        }
        let due: Vec<_> =
            self.timers.borrow_mut().extract_if(.., |&mut (at, _)| at <= now).collect();
        self.next.set(self.timers.borrow().iter().map(|&(at, _)| at).min());
        // Woken after the queue is free again: a waker may run any code.
        let any = !due.is_empty();
        due.into_iter().for_each(|(_, waker)| waker.wake());
        any
    }
}

thread_local! {
    static CURRENT: RefCell<Rc<Clock>> = RefCell::default();
}

/// From now on `embassy-time` shows this clock on this thread.
pub(crate) fn make_current(clock: &Rc<Clock>) {
    // While the thread ends nothing reads the time any more.
    let _ = CURRENT.try_with(|current| current.replace(Rc::clone(clock)));
}

/// The time of the world that was made, run or advanced last on this thread, in whole
/// microseconds: the same clock that [`embassy_time_driver::now`] reads. Zero where there has been none.
pub fn now() -> Micros {
    CURRENT.try_with(|current| current.borrow().now()).unwrap_or(Micros::ZERO)
}

struct VirtualTime;

impl Driver for VirtualTime {
    fn now(&self) -> u64 {
        now().get()
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        // Fails only while the thread ends: then no world runs on it that could wake a task.
        let _ = CURRENT.try_with(|current| current.borrow().schedule(Micros::new(at), waker));
    }
}

embassy_time_driver::time_driver_impl!(static DRIVER: VirtualTime = VirtualTime);
