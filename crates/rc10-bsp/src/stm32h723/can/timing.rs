//! The bit rate, as the registers want it. Knows no register, so that it can be tested on a PC.

/// The parts of one bit: one quantum of synchronisation, `before` quanta up to the sample point,
/// and `after` quanta behind it. A quantum is `prescaler` cycles of the kernel clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// 1 ..= 512.
    pub prescaler: u16,
    /// 2 ..= 256.
    pub before: u16,
    /// 2 ..= 128. Also the synchronisation jump width.
    pub after: u16,
}

// Limits of the nominal bit timing register (RM0468, FDCAN_NBTP). It holds each value less one.
const PRESCALER: u32 = 512;
const BEFORE: u32 = 256;
const AFTER: u32 = 128;

impl BitTiming {
    /// The timing of `bits_per_second` from a kernel clock of `clock` hertz: exact, sampled at three
    /// quarters of the bit, with the shortest possible quanta, so that resynchronisation is as fine
    /// as it can be. Meant for constants.
    ///
    /// Three quarters is what `CiA` 301 recommends at 1 Mbit/s, and the early end of the range of
    /// 75 ..= 87.5 % in which motors sample.
    ///
    /// # Panics
    /// If there is none.
    #[must_use]
    pub const fn exact(clock: u32, bits_per_second: u32) -> Self {
        assert!(bits_per_second > 0 && clock.is_multiple_of(bits_per_second), "not a whole bit");
        let cycles = clock / bits_per_second;
        let mut prescaler = 1;
        while prescaler <= PRESCALER {
            let quanta = cycles / prescaler;
            let after = quanta / 4;
            let before = quanta - after;
            if cycles.is_multiple_of(prescaler) && before <= BEFORE + 1 && after <= AFTER {
                return Self::of(prescaler, before, after);
            }
            prescaler += 1;
        }
        panic!("no prescaler divides a bit into quanta");
    }

    #[expect(clippy::cast_possible_truncation, reason = "checked: at most 512")]
    const fn of(prescaler: u32, sampled_at: u32, after: u32) -> Self {
        let quanta = sampled_at + after;
        assert!(sampled_at >= 3 && after >= 2, "too few quanta");
        assert!(sampled_at * 1000 >= quanta * 750, "sampled before 75 %");
        assert!(sampled_at * 1000 <= quanta * 875, "sampled after 87.5 %");
        // The first quantum is the one of synchronisation.
        Self { prescaler: prescaler as u16, before: sampled_at as u16 - 1, after: after as u16 }
    }
}
