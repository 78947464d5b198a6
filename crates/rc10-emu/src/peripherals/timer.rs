//! Timers that count up: general-purpose and basic ones (RM0468, TIM chapters).
//!
//! Modelled: prescaler, reload and compare values with their preload, update and compare flags,
//! one-pulse mode, software events. Compare flags rise when the counter arrives at the value.
//! Not modelled, and reported when asked for: counting down, slave modes, capture, DMA requests.
//! Outputs are not driven.

use rc10_sim::Nanos;

use super::access::{Refusal, Write};

/// What one timer has.
#[derive(Debug)]
pub(super) struct Facts {
    /// Bits of the counter.
    pub bits: u32,
    /// Compare channels.
    pub channels: usize,
    /// Number of its interrupt.
    pub interrupt: usize,
}

const fn facts(bits: u32, channels: usize, interrupt: usize) -> Facts {
    Facts { bits, channels, interrupt }
}

/// TIM2, 3, 4, 5, 6, 7, 12, 13, 14, 23, 24, all on APB1. Source: RM0468; interrupt numbers from
/// stm32-metapac.
pub(super) const TIMERS: [Facts; 11] = [
    facts(32, 4, 28),
    facts(16, 4, 29),
    facts(16, 4, 30),
    facts(32, 4, 50),
    facts(16, 0, 54),
    facts(16, 0, 55),
    facts(16, 2, 43),
    facts(16, 1, 44),
    facts(16, 1, 45),
    facts(32, 4, 161),
    facts(32, 4, 162),
];

const ENABLE: u32 = 1 << 0;
const UPDATE_DISABLE: u32 = 1 << 1;
const UPDATE_REQUEST_SOURCE: u32 = 1 << 2;
const ONE_PULSE: u32 = 1 << 3;
/// DIR and CMS.
const OTHER_DIRECTIONS: u32 = 0b111 << 4;
const RELOAD_PRELOAD: u32 = 1 << 7;
const FLAG_IN_COUNTER: u32 = 1 << 11;

/// Flag and interrupt enable of an update; channel n has bit 1 + n.
const UPDATE: u32 = 1;

/// A value that may wait for an update until it counts.
#[derive(Clone, Copy, Debug)]
struct Preloaded {
    written: u32,
    in_force: u32,
}

impl Preloaded {
    const fn new(value: u32) -> Self {
        Self { written: value, in_force: value }
    }

    const fn waits(self) -> bool {
        self.written != self.in_force
    }
}

#[derive(Debug)]
pub(super) struct Timer {
    facts: &'static Facts,
    control: u32,
    control_2: u32,
    interrupts: u32,
    flags: u32,
    /// CCMR1, CCMR2, CCER: only the preload and selection bits do something.
    modes: [u32; 2],
    outputs: u32,
    prescaler: Preloaded,
    reload: Preloaded,
    compare: [Preloaded; 4],
    counter: u32,
    hz: u64,
    /// The counter's ticks are counted from here, where the prescaler had counted `phase` clocks;
    /// `ticks` of them are in `counter` already. So no rounding adds up.
    anchor: Nanos,
    phase: u64,
    ticks: u64,
}

impl Timer {
    pub(super) const fn new(facts: &'static Facts) -> Self {
        Self {
            facts,
            control: 0,
            control_2: 0,
            interrupts: 0,
            flags: 0,
            modes: [0; 2],
            outputs: 0,
            prescaler: Preloaded::new(0),
            reload: Preloaded::new(u32::MAX >> (32 - facts.bits)),
            compare: [Preloaded::new(0); 4],
            counter: 0,
            hz: 0,
            anchor: Nanos::ZERO,
            phase: 0,
            ticks: 0,
        }
    }

    pub(super) fn reset(&mut self, now: Nanos) {
        *self = Self { hz: self.hz, anchor: now, ..Self::new(self.facts) };
    }

    /// Its clock from now on; 0 if gated.
    pub(super) fn set_clock(&mut self, hz: u64, now: Nanos) {
        if hz != self.hz {
            self.advance(now);
            self.rebase(now);
            self.hz = hz;
        }
    }

    const fn largest(&self) -> u32 {
        u32::MAX >> (32 - self.facts.bits)
    }

    const fn runs(&self) -> bool {
        // RM0468, TIMx_ARR: the counter is blocked while the auto-reload value is null.
        self.control & ENABLE != 0 && self.hz != 0 && self.reload.in_force != 0
    }

    const fn divider(&self) -> u64 {
        self.prescaler.in_force as u64 + 1
    }

    /// Clocks since the anchor, what the prescaler had already counted included.
    fn clocks(&self, now: Nanos) -> u64 {
        let clocks = u128::from(now.since(self.anchor).get()) * u128::from(self.hz) / 1_000_000_000;
        u64::try_from(clocks).unwrap_or(u64::MAX).saturating_add(self.phase)
    }

    /// When the counter makes a tick, counted from the anchor.
    fn time_of(&self, tick: u64) -> Nanos {
        let clocks = u128::from(tick) * u128::from(self.divider());
        let clocks = clocks.saturating_sub(u128::from(self.phase));
        let nanos = (clocks * 1_000_000_000).div_ceil(u128::from(self.hz.max(1)));
        self.anchor + Nanos::new(u64::try_from(nanos).unwrap_or(u64::MAX))
    }

    /// Counts from `now` on, with what the prescaler has counted so far.
    fn rebase(&mut self, now: Nanos) {
        if self.runs() {
            self.phase = self.clocks(now).saturating_sub(self.ticks * self.divider());
        }
        self.anchor = now;
        self.ticks = 0;
    }

    /// Ticks to the next overflow. A counter beyond its reload value runs through all its bits.
    fn to_overflow(&self) -> u64 {
        let last = if self.counter <= self.reload.in_force {
            self.reload.in_force
        } else {
            self.largest()
        };
        u64::from(last - self.counter) + 1
    }

    /// Channels that compare: those that exist and are not set up for capture.
    fn compares(&self) -> impl Iterator<Item = (u32, Preloaded)> + '_ {
        let channels = (0_u32..).zip(self.compare).take(self.facts.channels);
        channels.filter(|&(channel, _)| self.mode(channel) & 3 == 0)
    }

    /// The channel's byte in CCMR1 or CCMR2.
    const fn mode(&self, channel: u32) -> u32 {
        self.modes[(channel / 2) as usize] >> (8 * (channel % 2)) & 0xFF
    }

    /// The counter arrives at these values.
    fn arrive(&mut self, at: impl Fn(u32) -> bool) {
        let hits = self.compares().filter(|(_, compare)| at(compare.in_force));
        let flags: u32 = hits.map(|(channel, _)| 2 << channel).sum();
        self.flags |= flags;
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        while self.runs() {
            let total = self.clocks(now) / self.divider();
            let mut left = total - self.ticks.min(total);
            let anchor = self.anchor;
            while left > 0 && self.anchor == anchor && self.runs() {
                left -= self.count(left);
            }
            if left == 0 {
                return;
            }
        }
    }

    /// Counts up to `ticks` ticks, not beyond an overflow unless the next ones are all alike.
    fn count(&mut self, ticks: u64) -> u64 {
        let (before, to_overflow) = (self.counter, self.to_overflow());
        let steps = ticks.min(to_overflow - 1);
        // Fits: it does not reach the overflow.
        self.counter += u32::try_from(steps).unwrap_or(0);
        let after = self.counter;
        self.arrive(|value| value > before && value <= after);
        self.ticks += steps;
        if ticks == steps {
            return steps;
        }
        self.ticks += 1;
        self.counter = 0;
        self.update(true, self.time_of(self.ticks));
        self.arrive(|value| value == 0);
        let period = u64::from(self.reload.in_force) + 1;
        let whole = (ticks - to_overflow) / period * period;
        // As long as the anchor is the old one.
        let same = self.ticks != 0 && self.control & ONE_PULSE == 0 && !self.waits();
        if !same || whole == 0 {
            return to_overflow;
        }
        let last = self.reload.in_force;
        self.arrive(|value| value <= last);
        self.ticks += whole;
        to_overflow + whole
    }

    fn waits(&self) -> bool {
        self.control & UPDATE_DISABLE == 0
            && (self.prescaler.waits()
                || self.reload.waits()
                || self.compare.iter().any(|compare| compare.waits()))
    }

    /// An update event: preloaded values come into force.
    fn update(&mut self, overflow: bool, at: Nanos) {
        if self.control & UPDATE_DISABLE != 0 {
            return;
        }
        if overflow || self.control & UPDATE_REQUEST_SOURCE == 0 {
            self.flags |= UPDATE;
        }
        self.reload.in_force = self.reload.written;
        for compare in &mut self.compare {
            compare.in_force = compare.written;
        }
        let stops = overflow && self.control & ONE_PULSE != 0;
        if self.prescaler.waits() || stops {
            self.anchor = at;
            self.phase = 0;
            self.ticks = 0;
            self.prescaler.in_force = self.prescaler.written;
        }
        if stops {
            self.control &= !ENABLE;
        }
    }

    /// When a flag rises whose interrupt is enabled, or a waiting value comes into force.
    pub(super) fn next_event(&self) -> Option<Nanos> {
        if !self.runs() {
            return None;
        }
        let to_overflow = self.to_overflow();
        let wanted = self.interrupts & !self.flags;
        let updates = self.control & UPDATE_DISABLE == 0 && wanted & UPDATE != 0 || self.waits();
        let compares = self.compares().filter(|&(channel, compare)| {
            wanted & 2 << channel != 0 && compare.in_force <= self.reload.in_force
        });
        let ticks = compares.map(|(_, compare)| {
            if compare.in_force > self.counter {
                u64::from(compare.in_force - self.counter)
            } else {
                to_overflow + u64::from(compare.in_force)
            }
        });
        let ticks = ticks.chain(updates.then_some(to_overflow)).min()?;
        Some(self.time_of(self.ticks + ticks))
    }

    /// Number of its interrupt, if it is asked for.
    pub(super) fn interrupt(&self) -> Option<usize> {
        (self.flags & self.interrupts != 0).then_some(self.facts.interrupt)
    }

    /// Bits of DIER and SR that exist and are modelled: update and compare.
    const fn known_flags(&self) -> u32 {
        (2 << self.facts.channels) - 1
    }

    /// Compare channel of a register, if the timer has it.
    fn channel_of(&self, offset: u32) -> Option<usize> {
        let channel = offset.checked_sub(0x34)? as usize / 4;
        (channel < self.facts.channels).then_some(channel)
    }

    pub(super) fn read(&mut self, offset: u32, now: Nanos) -> Result<u32, Refusal> {
        self.advance(now);
        let has_channels = self.facts.channels > 0;
        Ok(match offset {
            0x00 => self.control,
            0x04 => self.control_2,
            0x08 if has_channels => 0,
            0x0C => self.interrupts,
            0x10 => self.flags,
            0x14 => 0,
            0x18 | 0x1C if has_channels => self.modes[(offset - 0x18) as usize / 4],
            0x20 if has_channels => self.outputs,
            0x24 if self.control & FLAG_IN_COUNTER != 0 => {
                self.counter & u32::MAX >> 1 | (self.flags & UPDATE) << 31
            }
            0x24 => self.counter,
            0x28 => self.prescaler.written,
            0x2C => self.reload.written,
            _ => match self.channel_of(offset) {
                Some(channel) => self.compare[channel].written,
                None => return Err(Refusal::Unmodelled),
            },
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Result<(), Refusal> {
        self.advance(now);
        let has_channels = self.facts.channels > 0;
        match write.offset {
            0x00 => {
                self.rebase(now);
                let wanted = write.over(self.control) & 0xFFF;
                self.control = wanted & !OTHER_DIRECTIONS;
                if wanted & OTHER_DIRECTIONS != 0 {
                    return Err(Refusal::Unmodelled);
                }
            }
            0x04 => self.control_2 = write.over(self.control_2),
            0x08 if has_channels && write.ones() == 0 => {}
            0x0C => {
                let wanted = write.over(self.interrupts);
                self.interrupts = wanted & self.known_flags();
                if wanted != self.interrupts {
                    return Err(Refusal::Unmodelled);
                }
            }
            0x10 => self.flags &= !write.zeros(),
            0x14 => {
                self.flags |= write.ones() & self.known_flags() & !UPDATE;
                if write.ones() & UPDATE != 0 {
                    self.rebase(now);
                    self.phase = 0;
                    self.counter = 0;
                    // No compare flag, also where zero is compared with: embassy's time would start
                    // at 65.5 ms, and on chips it starts at zero.
                    self.update(false, now);
                }
            }
            0x18 | 0x1C if has_channels => {
                let mode = &mut self.modes[(write.offset - 0x18) as usize / 4];
                *mode = write.over(*mode);
                if *mode & 0x0303 != 0 {
                    return Err(Refusal::Unmodelled);
                }
            }
            0x20 if has_channels => self.outputs = write.over(self.outputs),
            0x24 => self.counter = write.over(self.counter) & self.largest(),
            0x28 => self.prescaler.written = write.over(self.prescaler.written) & 0xFFFF,
            0x2C => {
                // It may be zero, which stops the counter.
                self.rebase(now);
                self.reload.written = write.over(self.reload.written) & self.largest();
                if self.control & RELOAD_PRELOAD == 0 {
                    self.reload.in_force = self.reload.written;
                }
            }
            _ => {
                let channel = self.channel_of(write.offset).ok_or(Refusal::Unmodelled)?;
                let mask = self.largest();
                // OCxPE.
                let preloads = self.mode(u32::try_from(channel).unwrap_or(0)) & 8 != 0;
                let compare = &mut self.compare[channel];
                compare.written = write.over(compare.written) & mask;
                if !preloads {
                    compare.in_force = compare.written;
                }
            }
        }
        Ok(())
    }
}
