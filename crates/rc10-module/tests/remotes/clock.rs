//! A clock of each test's own, and a port whose bytes come in time.

use std::cell::Cell;
use std::collections::VecDeque;
use std::pin::pin;
use std::task::{Context, Waker};

use embassy_time::{Instant, Timer};
use embassy_time_driver::Driver;
use embedded_io_async::{ErrorKind, ErrorType, Read};

thread_local! {
    static NOW: Cell<u64> = const { Cell::new(0) };
}

struct Clock;

impl Driver for Clock {
    fn now(&self) -> u64 {
        NOW.get()
    }

    /// Everything is polled in each step anyway.
    fn schedule_wake(&self, _: u64, _: &Waker) {}
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock);

/// Ten microseconds: less than a character takes.
const STEP: u64 = 10;

/// Runs a task until a time, µs; what it gave, if it ended.
pub fn run_until<T>(end: u64, task: impl Future<Output = T>) -> Option<T> {
    let mut task = pin!(task);
    loop {
        if let std::task::Poll::Ready(output) =
            task.as_mut().poll(&mut Context::from_waker(Waker::noop()))
        {
            return Some(output);
        }
        if NOW.get() >= end {
            return None;
        }
        NOW.set(NOW.get() + STEP);
    }
}

/// An event on a line: a byte, or one that is lost; and when it is over, µs.
#[derive(Default)]
pub struct Line {
    pub events: VecDeque<(u64, Result<u8, ErrorKind>)>,
    /// The end of what was sent so far, µs.
    pub now: u64,
}

impl Line {
    /// Sends bytes one after the other.
    pub fn send(&mut self, bytes: &[u8], byte_ns: u64) {
        let start = self.now;
        for (number, &byte) in (1..).zip(bytes) {
            self.now = start + (number * byte_ns).div_ceil(1000);
            self.events.push_back((self.now, Ok(byte)));
        }
    }
}

impl ErrorType for Line {
    type Error = ErrorKind;
}

impl Read for Line {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        let Some(&(at, event)) = self.events.front() else { std::future::pending().await };
        Timer::at(Instant::from_micros(at)).await;
        self.events.pop_front();
        event.map(|byte| {
            buffer[0] = byte;
            1
        })
    }
}
