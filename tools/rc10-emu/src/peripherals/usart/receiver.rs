//! The receiver's half: it looks for start bits and for silence.

use rc10_sim::{Nanos, UartFault};

use super::wire::{Character, Sampled, Sampling, Wire, after, stop_sixteenths};

/// Event at a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Heard {
    /// A character's stop bit has been sampled. `late`: the one before counts as not taken.
    Character { sampled: Sampled, late: bool },
    /// The line was idle for a whole frame.
    Idle,
}

#[derive(Debug, Default)]
pub(in super::super) struct Receiver {
    wire: Wire,
    /// Settings of sampling; `None`: it does not receive.
    sampling: Option<Sampling>,
    /// From here on it looks for a start bit.
    from: Nanos,
    /// Start of the next character, and when its stop bit will have been sampled.
    coming: Option<(Nanos, Nanos)>,
    late: bool,
    /// Something was received since the line was found idle the last time.
    armed: bool,
    /// Time at which the line will have been idle for a whole frame.
    idle_at: Option<Nanos>,
}

impl Receiver {
    /// A reset of the chip: the line stays.
    pub fn reset(&mut self, now: Nanos) {
        self.listen(None, now);
        (self.late, self.armed) = (false, false);
    }

    /// Listens in another way from now on, or no longer.
    pub fn listen(&mut self, sampling: Option<Sampling>, now: Nanos) {
        if self.sampling == sampling {
            return;
        }
        self.sampling = sampling;
        self.from = now;
        self.idle_at = None;
        self.wire.forget(now);
        self.look();
    }

    /// The level of the idle wire.
    pub fn set_idle(&mut self, high: bool) {
        self.wire.set_idle(high);
        self.look();
    }

    pub fn draw(&mut self, character: Character) {
        if self.sampling.is_none() {
            self.wire.forget(character.start);
        }
        self.late |= character.fault == Some(UartFault::Overrun);
        self.wire.draw(character);
        self.look();
    }

    /// A disturbance damages the character on the wire; without one, `otherwise` comes, damaged.
    pub fn disturb(&mut self, fault: UartFault, at: Nanos, otherwise: Character) {
        self.late |= fault == UartFault::Overrun;
        self.wire.disturb(fault, at, otherwise);
        self.look();
    }

    fn look(&mut self) {
        self.coming = self.sampling.and_then(|how| {
            let start = self.wire.edge_to(how.inverted, self.from)?;
            Some((start, after(start, how.bit_fs, stop_sixteenths(how.format, how.by_8))))
        });
    }

    pub fn is_busy(&self, now: Nanos) -> bool {
        self.coming.is_some_and(|(start, _)| start <= now)
    }

    pub fn next_event(&self) -> Option<Nanos> {
        let sampled = self.coming.map(|(_, sampled)| sampled);
        [sampled, self.idle_at].into_iter().flatten().min()
    }

    /// The event at this time, which is that of the next event.
    pub fn happens(&mut self, at: Nanos) -> Option<Heard> {
        let how = self.sampling?;
        if let Some((start, sampled_at)) = self.coming
            && sampled_at == at
        {
            let sampled = self.wire.sample(start, &how);
            // Too short for a start bit: the next may follow at once.
            self.from = if sampled.is_some() { at } else { after(start, how.bit_fs, 10) };
            self.wire.forget(self.from);
            self.look();
            let two_frames = 2 * how.format.sixteenths();
            self.idle_at = self.armed.then(|| after(start, how.bit_fs, two_frames));
            let late = sampled.is_some() && std::mem::take(&mut self.late);
            return sampled.map(|sampled| Heard::Character { sampled, late });
        }
        let idle = self.idle_at.take_if(|idle| *idle == at)?;
        if self.is_busy(idle) {
            return None;
        }
        if self.wire.level_at(idle) == how.inverted {
            // Held low: silence begins when it is let go.
            let free = self.wire.edge_to(!how.inverted, idle);
            self.idle_at = free.map(|free| after(free, how.bit_fs, how.format.sixteenths()));
            return None;
        }
        self.armed = false;
        Some(Heard::Idle)
    }

    /// The character just heard has been stored: silence is worth telling again.
    pub fn arm(&mut self, at: Nanos) {
        self.armed = true;
        if let Some(how) = self.sampling
            && self.idle_at.is_none()
        {
            let stop = stop_sixteenths(how.format, how.by_8);
            self.idle_at = Some(after(at, how.bit_fs, 2 * how.format.sixteenths() - stop));
        }
    }
}
