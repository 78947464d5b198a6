//! The independent watchdog IWDG1 (RM0468, IWDG chapter).
//!
//! New values of `PR`, `RLR` and `WINR` come into force after five periods of LSI: an estimate. The
//! counter starts at 0xFFF; the first feeding loads `RLR`.

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Write};
use super::clocks::LSI_HZ;
use crate::time::{Period, time_of};

words! { KEY_START: 0xCCCC, KEY_FEED: 0xAAAA, KEY_UNLOCK: 0x5555 }

const COUNTER_MASK: u32 = 0xFFF;
/// Periods of LSI that an update takes.
const UPDATE: u64 = 5;

#[derive(Clone, Copy, Debug, Default)]
struct Late {
    written: u32,
    in_force: u32,
    updated_at: Option<Nanos>,
}

impl Late {
    fn write(&mut self, value: u32, now: Nanos) {
        self.written = value;
        self.updated_at = Some(now + time_of(UPDATE, LSI_HZ));
    }

    fn advance(&mut self, now: Nanos) {
        if self.updated_at.is_some_and(|at| at <= now) {
            self.in_force = self.written;
            self.updated_at = None;
        }
    }
}

#[derive(Debug, Default)]
pub(super) struct Watchdog {
    unlocked: bool,
    /// PR: the counter's period is 4 << PR periods of LSI.
    prescaler: Late,
    reload: Late,
    window: Late,
    /// Time at which it was running last at `counter`; `None` if it was never started.
    counting_from: Option<Nanos>,
    counter: u32,
    pub(super) bites: bool,
}

impl Watchdog {
    pub(super) fn new() -> Self {
        let largest = Late { written: COUNTER_MASK, in_force: COUNTER_MASK, updated_at: None };
        Self { reload: largest, window: largest, counter: COUNTER_MASK, ..Self::default() }
    }

    fn period(&self) -> Period {
        Period { cycles: 4 << self.prescaler.in_force.min(6), hz: LSI_HZ }
    }

    fn bite_at(&self) -> Option<Nanos> {
        self.counting_from.map(|start| start + self.period().many(u64::from(self.counter) + 1))
    }

    fn count(&self, now: Nanos) -> u32 {
        let from = self.counting_from.unwrap_or(now);
        let ticks = self.period().count_in(now.since(from));
        self.counter.saturating_sub(u32::try_from(ticks).unwrap_or(u32::MAX))
    }

    fn restart(&mut self, counter: u32, now: Nanos) {
        self.counter = counter;
        self.counting_from = self.counting_from.map(|_| now);
    }

    pub(super) fn read(&self, offset: u32) -> Answer<u32> {
        let updating = |late: &Late, bit: u32| u32::from(late.updated_at.is_some()) << bit;
        Ok(match offset {
            0x00 => 0,
            0x04 => self.prescaler.written,
            0x08 => self.reload.written,
            0x0C => {
                updating(&self.prescaler, 0) | updating(&self.reload, 1) | updating(&self.window, 2)
            }
            0x10 => self.window.written,
            _ => return Err(AccessKind::Unmodelled),
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Answer {
        let value = write.ones();
        match write.offset {
            0x00 => {
                let key = value & 0xFFFF;
                self.unlocked = key == KEY_UNLOCK;
                if key == KEY_START {
                    self.counting_from.get_or_insert(now);
                }
                if key == KEY_FEED {
                    self.feed(now);
                }
            }
            0x0C => {}
            0x04 | 0x08 | 0x10 if !self.unlocked => return Err(AccessKind::Protected),
            0x04 => self.prescaler.write(value & 7, now),
            0x08 => self.reload.write(value & COUNTER_MASK, now),
            // Writing the window also feeds.
            0x10 => {
                self.window.write(value & COUNTER_MASK, now);
                self.restart(self.reload.in_force, now);
            }
            _ => return Err(AccessKind::Unmodelled),
        }
        Ok(())
    }

    fn feed(&mut self, now: Nanos) {
        // Too early is as bad as too late.
        if self.counting_from.is_some() && self.count(now) > self.window.in_force {
            self.bites = true;
        }
        self.restart(self.reload.in_force, now);
    }

    pub(super) fn next_event(&self) -> Option<Nanos> {
        let updates = [&self.prescaler, &self.reload, &self.window].map(|late| late.updated_at);
        updates.into_iter().chain([self.bite_at()]).flatten().min()
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        if let Some(at) = self.prescaler.updated_at
            && at <= now
        {
            let counter = self.count(at);
            let before = self.period();
            self.prescaler.advance(now);
            if self.period() != before {
                self.restart(counter, at);
            }
        }
        self.reload.advance(now);
        self.window.advance(now);
        if self.bite_at().is_some_and(|at| at <= now) {
            self.bites = true;
            self.counting_from = None;
        }
    }
}
