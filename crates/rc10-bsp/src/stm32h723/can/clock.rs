//! From a controller's time stamps to time. Knows no register, so that it can be tested on a PC.

use rc10_time::Micros;

/// The controller's time stamps (1 µs, 16 bits) beside the clock: of frames younger than 65.5 ms.
pub struct Clock {
    read_at: Micros,
    /// A frame's time is this, less the known bits of its age.
    base: Micros,
    known: u16,
    counter: u16,
}

/// After a longer pause an old frame could look like a new one.
const LONGEST_PAUSE: Micros = Micros::from_millis(65);

impl Clock {
    /// A clock whose frames all come after `now`.
    pub const fn new(now: Micros) -> Self {
        Self { read_at: now, base: now, known: u16::MAX, counter: 0 }
    }

    /// Reads both clocks for the frames since the last time; too long ago, they count as old.
    #[inline]
    pub fn read(&mut self, now: Micros, counter: u16) {
        let last = core::mem::replace(&mut self.read_at, now);
        self.counter = counter;
        (self.base, self.known) =
            if now.since(last) <= LONGEST_PAUSE { (now, u16::MAX) } else { (last, 0) };
    }

    /// The time at which the frame with this time stamp began.
    #[inline]
    pub fn time_of(&self, stamp: u16) -> Micros {
        let age = self.counter.wrapping_sub(stamp) & self.known;
        self.base.since(Micros::new(age.into()))
    }
}
