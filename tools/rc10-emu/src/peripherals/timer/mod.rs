//! Timers that count up: general-purpose and basic ones (RM0468, TIM chapters).
//!
//! Modelled: prescaler, reload and compare values with preload, update and compare flags, one-pulse
//! mode, software events, outputs in all plain modes, capture with filter and prescaler, encoders,
//! DMA requests; of TIM1, 8, 16 and 17 repetitions, main output enable and complementary outputs;
//! of TIM16 and 17 capture of the chip's own clocks (TISEL). Compare flags rise when the counter
//! arrives.
//! Not modelled, and reported when asked for: counting down by time, the other slave modes,
//! external triggers, combined output modes, DMA bursts, breaks, dead times, locks.
//!
//! `counter` counts and updates, `input` filters, captures and reads encoders, `tone` captures the
//! chip's own clocks, `output` drives the pins.

mod counter;
mod input;
mod output;
mod tone;

use rc10_sim::Nanos;

use super::access::{AccessKind, Answer, Write};
use super::clocks::{TONE_HSE, TONE_LSE, TONE_LSI, TONE_MCO1, Tones, UNMODELLED};
use input::Input;
use tone::Listener;

#[derive(Debug)]
pub(super) struct Facts {
    /// Bits of the counter.
    pub bits: u32,
    pub channels: usize,
    /// Numbers of its interrupts of an update and of the channels: often one.
    pub interrupts: [usize; 2],
    /// DMAMUX1's numbers of its requests: update, then channels 1 to 4; 0: it has none.
    pub requests: [u32; 1 + CHANNELS],
    /// 0: on APB1, 1: on APB2.
    pub bus: usize,
    /// Channels with a complementary output: then it has `BDTR` and `RCR`, too.
    pub complements: usize,
    /// The clocks that `TISEL.TI1SEL` = 1, 2, .. connects its first input to: places in [`Tones`].
    pub tones: &'static [usize],
}

/// Channels of a timer, at most.
pub(super) const CHANNELS: usize = 4;

const fn facts(bits: u32, channels: usize, interrupt: usize, requests: [u32; 5]) -> Facts {
    let interrupts = [interrupt; 2];
    Facts { bits, channels, interrupts, requests, bus: 0, complements: 0, tones: &[] }
}

/// One on APB2 with complementary outputs.
const fn advanced(
    channels: usize,
    interrupts: [usize; 2],
    requests: [u32; 5],
    complements: usize,
    tones: &'static [usize],
) -> Facts {
    Facts { bits: 16, channels, interrupts, requests, bus: 1, complements, tones }
}

/// TIM2, 3, 4, 5, 6, 7, 12, 13, 14, 23, 24 on APB1, TIM1, 8, 16, 17 on APB2. Source: RM0468
/// (`TIMx_TISEL`), ST's `stm32h7xx_hal_tim_ex.h`; interrupts and requests from stm32-metapac.
pub(super) const TIMERS: [Facts; 15] = [
    facts(32, 4, 28, [22, 18, 19, 20, 21]),
    facts(16, 4, 29, [27, 23, 24, 25, 26]),
    facts(16, 4, 30, [32, 29, 30, 31, 0]),
    facts(32, 4, 50, [59, 55, 56, 57, 58]),
    facts(16, 0, 54, [69, 0, 0, 0, 0]),
    facts(16, 0, 55, [70, 0, 0, 0, 0]),
    facts(16, 2, 43, [0; 5]),
    facts(16, 1, 44, [0; 5]),
    facts(16, 1, 45, [0; 5]),
    facts(32, 4, 161, [130, 126, 127, 128, 129]),
    facts(32, 4, 162, [136, 132, 133, 134, 135]),
    advanced(4, [25, 27], [15, 11, 12, 13, 14], 3, &[]),
    advanced(4, [44, 46], [51, 47, 48, 49, 50], 3, &[]),
    advanced(1, [117; 2], [110, 109, 0, 0, 0], 1, &[TONE_LSI, TONE_LSE, UNMODELLED]),
    advanced(1, [118; 2], [112, 111, 0, 0, 0], 1, &[UNMODELLED, TONE_HSE, TONE_MCO1]),
];

// CR1.
bits! { ENABLE: 0, UPDATE_DISABLE: 1, UPDATE_REQUEST_SOURCE: 2, ONE_PULSE: 3, DIRECTION: 4 }
/// DIR and CMS.
const OTHER_DIRECTIONS: u32 = 0b111 << 4;
const RELOAD_PRELOAD: u32 = 1 << 7;
const FLAG_IN_COUNTER: u32 = 1 << 11;

// BDTR.
bits! { MAIN_OUTPUT: 15, OFF_STATE_IDLE: 10, OFF_STATE_RUN: 11 }
const OFF_STATES: u32 = OFF_STATE_IDLE | OFF_STATE_RUN;
/// BKP, BK2P.
const BREAK_POLARITIES: u32 = 1 << 13 | 1 << 25;

/// The last of SMCR's encoder modes.
const ENCODER_MODES: u32 = 3;

/// Flag and interrupt enable of an update; channel n has bit 1 + n.
const UPDATE: u32 = 1;

/// A value that may wait for an update until it counts.
#[derive(Clone, Copy, Debug, Default)]
struct Preloaded {
    written: u32,
    in_force: u32,
}

impl Preloaded {
    const fn waits(self) -> bool {
        self.written != self.in_force
    }
}

#[derive(Debug, Default)]
pub(super) struct Timer {
    /// Index in [`TIMERS`].
    index: usize,
    control: u32,
    control_2: u32,
    slave_mode: u32,
    /// DIER.
    interrupts: u32,
    flags: u32,
    /// Transfers asked for and not made: update, then the channels.
    requests: u32,
    /// CCMR1, CCMR2, CCER.
    modes: [u32; 2],
    outputs: u32,
    prescaler: Preloaded,
    reload: Preloaded,
    compare: [Preloaded; CHANNELS],
    /// Levels of the outputs after their last match.
    references: [bool; CHANNELS],
    inputs: [Input; CHANNELS],
    /// The last edge of an encoder was backwards.
    counts_down: bool,
    /// Channels whose pins are observed, a bit each.
    pub(super) watched: u32,
    /// BDTR.
    breaks: u32,
    /// RCR: overflows to an update, less one; and those still to come.
    repetitions: Preloaded,
    repetitions_left: u32,
    /// TISEL.
    input_select: u32,
    tones: Tones,
    listener: Option<Listener>,
    counter: u32,
    hz: u64,
    /// Start of the count of ticks, where the prescaler had counted `phase` clocks; `ticks` of them
    /// are in `counter` already. So no rounding adds up.
    anchor: Nanos,
    phase: u64,
    ticks: u64,
}

impl Timer {
    pub(super) fn new(index: usize) -> Self {
        let largest = u32::MAX >> (32 - TIMERS[index].bits);
        let reload = Preloaded { written: largest, in_force: largest };
        Self { index, reload, ..Self::default() }
    }

    const fn facts(&self) -> &'static Facts {
        &TIMERS[self.index]
    }

    pub(super) fn reset(&mut self, now: Nanos) {
        let Self { hz, watched, tones, .. } = *self;
        *self = Self { hz, watched, tones, anchor: now, ..Self::new(self.index) };
    }

    pub(super) fn set_clock(&mut self, hz: u64, now: Nanos) {
        if hz != self.hz {
            self.advance(now);
            self.rebase(now);
            self.hz = hz;
        }
    }

    /// Whether it has a main output enable.
    const fn is_advanced(&self) -> bool {
        self.facts().complements > 0
    }

    /// BDTR.
    fn write_breaks(&mut self, write: Write) -> Answer {
        let wanted = write.over(self.breaks);
        self.breaks = wanted & (MAIN_OUTPUT | OFF_STATES);
        // Dead time, locks, breaks and their filters; polarities of breaks that are off do nothing.
        let harmless = MAIN_OUTPUT | OFF_STATES | BREAK_POLARITIES;
        AccessKind::Unmodelled.when(wanted & !harmless != 0)
    }

    /// The channel's byte in CCMR1 or CCMR2.
    const fn mode(&self, channel: usize) -> u32 {
        self.modes[channel / 2] >> (8 * (channel % 2)) & 0xFF
    }

    pub(super) fn interrupts(&self) -> impl Iterator<Item = usize> + use<> {
        let asked = self.flags & self.interrupts & 0xFF;
        let asks = [asked & UPDATE != 0, asked & !UPDATE != 0];
        let numbers = self.facts().interrupts.into_iter().zip(asks);
        numbers.filter_map(|(number, asks)| asks.then_some(number))
    }

    /// Bit of the request with this number in DMAMUX1.
    fn request_bit(&self, request: u32) -> Option<u32> {
        let position = self.facts().requests.iter().position(|&own| own == request && own != 0)?;
        Some(1 << position)
    }

    pub(super) fn requests(&self, request: u32) -> bool {
        self.requests != 0 && self.request_bit(request).is_some_and(|bit| self.requests & bit != 0)
    }

    pub(super) fn acknowledge(&mut self, request: u32) {
        if let Some(bit) = self.request_bit(request) {
            self.requests &= !bit;
        }
    }

    /// Bits of SR and of DIER's lower half that exist and are modelled: update and compare.
    const fn known_flags(&self) -> u32 {
        (2 << self.facts().channels) - 1
    }

    /// DIER's bits that exist and are modelled.
    fn known_enables(&self) -> u32 {
        let requests = self.facts().requests.iter().zip(0_u32..);
        let transfers: u32 =
            requests.filter(|(number, _)| **number != 0).map(|(_, bit)| 0x100 << bit).sum();
        self.known_flags() | transfers
    }

    /// Compare channel of a register, if the timer has it.
    fn channel_of(&self, offset: u32) -> Option<usize> {
        let channel = offset.checked_sub(0x34)? as usize / 4;
        (channel < self.facts().channels).then_some(channel)
    }

    pub(super) fn read(&mut self, offset: u32, now: Nanos) -> Answer<u32> {
        self.advance(now);
        let has_channels = self.facts().channels > 0;
        Ok(match offset {
            0x00 => self.control | if self.counts_down { DIRECTION } else { 0 },
            0x04 => self.control_2,
            0x08 if has_channels => self.slave_mode,
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
            0x30 if self.is_advanced() => self.repetitions.written,
            0x44 if self.is_advanced() => self.breaks,
            0x68 if !self.facts().tones.is_empty() => self.input_select,
            _ => match self.channel_of(offset) {
                Some(channel) => {
                    if self.mode(channel) & 3 != 0 {
                        // A captured value is taken.
                        self.flags &= !(2 << channel);
                    }
                    self.compare[channel].written
                }
                None => return Err(AccessKind::Unmodelled),
            },
        })
    }

    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Answer {
        self.advance(now);
        let has_channels = self.facts().channels > 0;
        match write.offset {
            0x00 => {
                self.rebase(now);
                let wanted = write.over(self.control) & 0xFFF;
                self.control = wanted & !OTHER_DIRECTIONS;
                // An encoder's direction cannot be written, only written back.
                let directions = wanted & OTHER_DIRECTIONS;
                AccessKind::Unmodelled
                    .when(directions != 0 && !(self.is_encoder() && directions == DIRECTION))?;
            }
            0x04 => self.control_2 = write.over(self.control_2),
            0x08 if has_channels => {
                self.rebase(now);
                self.slave_mode = write.over(self.slave_mode);
                AccessKind::Unmodelled
                    .when(self.slave_mode & !7 != 0 || self.slave_mode > ENCODER_MODES)?;
                AccessKind::Unmodelled.when(self.is_encoder() && self.prescaler.in_force != 0)?;
            }
            0x0C => {
                let wanted = write.over(self.interrupts);
                self.interrupts = wanted & self.known_enables();
                self.requests &= self.interrupts >> 8;
                AccessKind::Unmodelled.when(wanted != self.interrupts)?;
            }
            0x10 => self.flags &= !write.zeros(),
            0x14 => self.event(write.ones(), now),
            0x18 | 0x1C if has_channels => {
                let written = self.write_mode(write);
                self.listen(now);
                return written;
            }
            0x20 if has_channels => {
                self.outputs = write.over(self.outputs);
                self.listen(now);
            }
            0x30 if self.is_advanced() => {
                // 16 bits in TIM1 and TIM8, 8 in the others.
                let mask = if self.facts().channels > 1 { 0xFFFF } else { 0xFF };
                self.repetitions.written = write.over(self.repetitions.written) & mask;
            }
            0x44 if self.is_advanced() => return self.write_breaks(write),
            0x68 if !self.facts().tones.is_empty() => {
                self.input_select = write.over(self.input_select) & 0xF;
                self.listen(now);
                let source = self.source();
                let is_unknown = source.is_none() && self.input_select != 0;
                AccessKind::Unmodelled.when(source == Some(UNMODELLED) || is_unknown)?;
            }
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
                let channel = self.channel_of(write.offset).ok_or(AccessKind::Unmodelled)?;
                if self.mode(channel) & 3 != 0 {
                    // RM0468, CCR1: of an input channel it cannot be written.
                    return Err(AccessKind::Protected);
                }
                let mask = self.largest();
                // OCxPE.
                let preloads = self.mode(channel) & 8 != 0;
                let compare = &mut self.compare[channel];
                compare.written = write.over(compare.written) & mask;
                if !preloads {
                    compare.in_force = compare.written;
                }
            }
        }
        Ok(())
    }

    /// EGR.
    fn event(&mut self, bits: u32, now: Nanos) {
        for channel in (0..self.facts().channels).filter(|channel| bits & 2 << channel != 0) {
            if self.mode(channel) & 3 == 0 {
                self.raise(2 << channel);
            } else {
                self.capture(channel);
            }
        }
        if bits & UPDATE != 0 {
            self.rebase(now);
            self.phase = 0;
            self.counter = 0;
            self.repetitions_left = self.repetitions.written;
            // No compare flag, also where zero is compared with: embassy's time would start at
            // 65.5 ms, and on chips it starts at zero.
            self.update(false, now);
        }
    }

    /// CCMR1, CCMR2.
    fn write_mode(&mut self, write: Write) -> Answer {
        let register = (write.offset - 0x18) as usize / 4;
        let old = self.modes[register];
        let mut wanted = write.over(old);
        let mut locked = false;
        for channel in [2 * register, 2 * register + 1] {
            let shift = 8 * (channel % 2);
            // RM0468, CCxS: can only be written while the channel is off.
            if (old ^ wanted) >> shift & 3 != 0 && self.outputs >> (4 * channel) & 1 != 0 {
                wanted = wanted & !(3 << shift) | old & 3 << shift;
                locked = true;
            }
        }
        self.modes[register] = wanted;
        // CCxS = 3: captures at a trigger. OCxM's fourth bit: combined modes.
        let triggered = [0, 8].iter().any(|shift| wanted >> shift & 3 == 3);
        AccessKind::Unmodelled.when(triggered || wanted & 0x0101_0000 != 0)?;
        AccessKind::Protected.when(locked)
    }
}
