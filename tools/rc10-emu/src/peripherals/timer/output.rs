//! Outputs of a timer: what its compare channels do to their pins.

use super::{CHANNELS, MAIN_OUTPUT, OFF_STATE_IDLE, OFF_STATE_RUN, Timer};

/// `OCxM`: 0 keeps what it was; 1 and 2 become active and inactive when the counter arrives, 3 turns
/// over; 4 and 5 are inactive and active; 6 and 7 are active below the compare value, and from it on.
const fn output_mode(bits: u32) -> u32 {
    bits >> 4 & 7
}

impl Timer {
    /// The level at a channel's pin, or at that of its complementary output; `None` if nothing drives
    /// it. RM0468, TIM1 and TIM8 chapter, output control bits for complementary channels, without
    /// dead time.
    pub(in super::super) fn level(&self, channel: usize, complement: bool) -> Option<bool> {
        let (bits, facts) = (self.mode(channel), self.facts());
        let channels = if complement { facts.complements } else { facts.channels };
        if channel >= channels || bits & 3 != 0 {
            return None;
        }
        // CCxE, CCxP; CCxNE, CCxNP.
        let enables = self.outputs >> (4 * channel);
        let (main, other) = (enables & 1 != 0, enables & 4 != 0 && channel < facts.complements);
        let (enabled, inverts) =
            if complement { (other, enables & 8 != 0) } else { (main, enables & 2 != 0) };
        if !main && !other {
            return None;
        }
        if self.is_advanced() && self.breaks & MAIN_OUTPUT == 0 {
            // OISx, OISxN.
            let idle = self.control_2 >> (8 + 2 * channel + usize::from(complement)) & 1 != 0;
            return (self.breaks & OFF_STATE_IDLE != 0).then_some(idle);
        }
        if !enabled {
            // Its inactive level, or not driven.
            return (self.is_advanced() && self.breaks & OFF_STATE_RUN != 0).then_some(inverts);
        }
        let is_below = self.counter < self.compare[channel].in_force;
        let active = match output_mode(bits) {
            4 => false,
            5 => true,
            6 => is_below,
            7 => !is_below,
            _ => self.references[channel],
        };
        // Alone, a complementary output carries the reference itself.
        let opposite = complement && main && other;
        Some(active != (inverts != opposite))
    }

    /// The counter has arrived at these channels' values, a bit each.
    pub(super) fn matched(&mut self, channels: u32) {
        for channel in (0..self.facts().channels).filter(|channel| channels >> channel & 1 != 0) {
            let mode = output_mode(self.mode(channel));
            let reference = &mut self.references[channel];
            *reference = match mode {
                1 => true,
                2 => false,
                3 => !*reference,
                _ => *reference,
            };
        }
    }

    /// Ticks until the output of an observed channel may change.
    pub(super) fn ticks_to_change(&self) -> Option<u64> {
        if self.watched == 0 {
            return None;
        }
        let channels = (0..CHANNELS.min(self.facts().channels)).filter(|channel| {
            self.watched >> channel & 1 != 0
                && self.level(*channel, false).or_else(|| self.level(*channel, true)).is_some()
        });
        let ticks = channels.filter_map(|channel| {
            let value = self.compare[channel].in_force;
            let modulates = output_mode(self.mode(channel)) >= 6;
            if value > self.reload.in_force || modulates && value == 0 {
                // The same level for all of the period.
                None
            } else if modulates && value <= self.counter {
                Some(self.to_overflow())
            } else {
                Some(self.ticks_to(value))
            }
        });
        ticks.min()
    }
}
