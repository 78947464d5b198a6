//! Inputs of a timer: filters, capture, and the encoder interface (RM0468, TIM2 to TIM5 chapter).

use rc10_sim::Nanos;

use super::{CHANNELS, ENCODER_MODES, Timer};
use crate::time::time_of;

/// Divider of the filter's clock (0: the timer's own, without CKD), and how many equal samples let
/// a level through, by `ICxF`. Source: RM0468, `TIMx_CCMR1`.
const DIVIDERS: [u64; 16] = [0, 0, 0, 0, 2, 2, 4, 4, 8, 8, 16, 16, 16, 32, 32, 32];
const SAMPLES: [u64; 16] = [0, 2, 4, 8, 6, 8, 6, 8, 6, 8, 5, 6, 8, 5, 6, 8];

/// A pin's level on its way through the filter.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Input {
    raw: bool,
    filtered: bool,
    /// Time at which the filter lets the raw level through.
    passes_at: Option<Nanos>,
    /// Edges that the prescaler has swallowed.
    swallowed: u32,
}

impl Timer {
    /// Whether it looks at any of its pins: a channel is set up as an input and is switched on.
    pub(in super::super) fn listens(&self) -> bool {
        self.is_encoder() || (0..self.facts().channels).any(|channel| self.captures(channel))
    }

    pub(super) const fn is_encoder(&self) -> bool {
        matches!(self.slave_mode & 7, 1..=ENCODER_MODES)
    }

    pub(super) fn captures(&self, channel: usize) -> bool {
        let selected = self.mode(channel) & 3;
        (selected == 1 || selected == 2) && self.outputs >> (4 * channel) & 1 != 0
    }

    /// Takes the levels of the pins now. `fresh`: they did not change, they begin to matter.
    pub(in super::super) fn look(&mut self, levels: u32, fresh: bool, now: Nanos) {
        self.advance(now);
        for input in 0..CHANNELS {
            // A clock of the chip has the pin's place.
            let level = levels >> input & 1 != 0 && !(input == 0 && self.input_select != 0);
            let delay = self.filter_delay(input);
            let state = &mut self.inputs[input];
            if fresh {
                *state = Input { raw: level, filtered: level, ..Input::default() };
                continue;
            }
            if std::mem::replace(&mut state.raw, level) == level {
                continue;
            }
            state.passes_at = (level != state.filtered).then(|| now + delay);
            if delay == Nanos::ZERO {
                self.pass(input);
            }
        }
    }

    fn filter_delay(&self, input: usize) -> Nanos {
        // Only an input channel has a filter there: an output's mode has those bits otherwise.
        if self.mode(input) & 3 == 0 || self.hz == 0 {
            return Nanos::ZERO;
        }
        let filter = (self.mode(input) >> 4 & 0xF) as usize;
        let (divider, samples) = (DIVIDERS[filter], SAMPLES[filter]);
        let divider = if divider == 0 { 1 } else { divider << (self.control >> 8 & 3) };
        time_of(divider * samples, self.hz)
    }

    pub(super) fn next_pass(&self) -> Option<Nanos> {
        self.inputs.iter().filter_map(|input| input.passes_at).min()
    }

    /// Filters let through the levels that are due at this time.
    pub(super) fn pass_due(&mut self, at: Nanos) {
        for input in 0..CHANNELS {
            if self.inputs[input].passes_at.is_some_and(|due| due <= at) {
                self.pass(input);
            }
        }
    }

    /// An input's filtered level changes, and the counter has arrived at this time.
    fn pass(&mut self, input: usize) {
        let state = &mut self.inputs[input];
        state.passes_at = None;
        state.filtered = state.raw;
        let rose = state.filtered;
        if self.is_encoder() && input < 2 {
            self.turn(input);
        }
        for channel in 0..self.facts().channels {
            // CCxS: its own pin, or that of its neighbour in the pair.
            let listens_to = match self.mode(channel) & 3 {
                1 => channel,
                2 => channel ^ 1,
                _ => continue,
            };
            // CCxNP, CCxP: rising, falling, (reserved), both.
            let wanted = match self.outputs >> (4 * channel) & 0b1010 {
                0b0000 => rose,
                0b0010 => !rose,
                0b1010 => true,
                _ => false,
            };
            if listens_to == input && wanted && self.captures(channel) {
                self.capture_prescaled(channel);
            }
        }
    }

    fn capture_prescaled(&mut self, channel: usize) {
        let every = 1 << (self.mode(channel) >> 2 & 3);
        let swallowed = &mut self.inputs[channel].swallowed;
        *swallowed += 1;
        if *swallowed >= every {
            *swallowed = 0;
            self.capture(channel);
        }
    }

    /// The counter goes into a channel's register.
    pub(super) fn capture(&mut self, channel: usize) {
        self.compare[channel].written = self.counter;
        self.compare[channel].in_force = self.counter;
        if self.flags & 2 << channel != 0 {
            // CCxOF: the capture before was not read.
            self.flags |= 0x200 << channel;
        }
        self.raise(2 << channel);
    }

    /// An edge of an encoder's signal (RM0468, table of counting directions).
    fn turn(&mut self, input: usize) {
        if self.control & super::ENABLE == 0 || self.hz == 0 {
            return;
        }
        // 1: edges of TI1 count, 2: of TI2, 3: of both.
        if self.slave_mode >> input & 1 == 0 {
            return;
        }
        // CCxP inverts.
        let level =
            |input: usize| self.inputs[input].filtered != (self.outputs >> (4 * input) & 2 != 0);
        let (rose, other) = (level(input), level(1 - input));
        // TI1 rises while TI2 is low, TI2 rises while TI1 is high: forwards.
        let up = if input == 0 { rose != other } else { rose == other };
        let last = self.reload.in_force;
        self.counts_down = !up;
        let (end, begin) = if up { (last, 0) } else { (0, last) };
        if self.counter == end {
            self.counter = begin;
            self.overflow(self.anchor);
        } else {
            self.counter = if up { self.counter + 1 } else { self.counter - 1 } & self.largest();
        }
        let counter = self.counter;
        self.arrive(|value| value == counter);
    }
}
