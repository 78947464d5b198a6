/// A bit's parts: one quantum, `before` up to the sample point, `after` behind; of `prescaler`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Cycles of a quantum, 1 or more.
    pub prescaler: u16,
    /// Quanta between the first one and the sample point, 2 or more.
    pub before: u16,
    /// Quanta behind the sample point, 2 or more. Also the longest synchronisation jump.
    pub after: u16,
}

/// The largest numbers that a controller's bit timing register holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTimingLimits {
    /// The largest [`BitTiming::prescaler`].
    pub prescaler: u16,
    /// The largest [`BitTiming::before`].
    pub before: u16,
    /// The largest [`BitTiming::after`].
    pub after: u16,
}

impl BitTimingLimits {
    /// Bosch `M_CAN`, which ST calls FDCAN (RM0468 and RM0440, `FDCAN_NBTP`).
    pub const FDCAN: Self = Self { prescaler: 512, before: 256, after: 128 };
    /// ST's bxCAN (RM0090, `CAN_BTR`). Its longest jump is 4 quanta.
    pub const BXCAN: Self = Self { prescaler: 1024, before: 16, after: 8 };
}

/// With fewer quanta in a bit there is no room to resynchronise.
const FEWEST_QUANTA: u32 = 8;

/// Why a clock cannot make a bit rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.text())]
pub enum BitTimingError {
    /// A bit is not a whole number of cycles.
    NotWhole,
    /// A bit is less than eight quanta: the clock is too slow.
    TooFewQuanta,
    /// No prescaler divides a bit into as many quanta as the register holds.
    NoPrescaler,
}

impl BitTimingError {
    const fn text(self) -> &'static str {
        match self {
            Self::NotWhole => "a bit is not a whole number of clock cycles",
            Self::TooFewQuanta => "the clock is too slow: a bit has too few quanta",
            Self::NoPrescaler => "no prescaler divides a bit into quanta",
        }
    }
}

impl BitTiming {
    /// The timing of `bits_per_second` from a `clock`: exact, sampled at three quarters or, with
    /// few quanta, up to a tenth later, by the shortest quanta, for the finest resynchronisation.
    ///
    /// Three quarters is `CiA` 301's at 1 Mbit/s, and motors sample at 75 ..= 87.5 %.
    ///
    /// # Errors
    /// [`BitTimingError`] for a clock that cannot make it.
    pub const fn find(
        clock: u32,
        bits_per_second: u32,
        limits: BitTimingLimits,
    ) -> Result<Self, BitTimingError> {
        if bits_per_second == 0 || !clock.is_multiple_of(bits_per_second) {
            return Err(BitTimingError::NotWhole);
        }
        let cycles = clock / bits_per_second;
        if cycles < FEWEST_QUANTA {
            return Err(BitTimingError::TooFewQuanta);
        }
        let mut prescaler = 1;
        while prescaler <= limits.prescaler {
            let quanta = cycles / prescaler as u32;
            let after = quanta / 4;
            // The first quantum is the one of synchronisation.
            let before = (quanta - after).saturating_sub(1);
            let fits = before <= limits.before as u32 && after <= limits.after as u32;
            let is_enough = quanta >= FEWEST_QUANTA;
            if cycles.is_multiple_of(prescaler as u32) && fits && is_enough {
                #[expect(clippy::cast_possible_truncation, reason = "not above the limits")]
                return Ok(Self { prescaler, before: before as u16, after: after as u16 });
            }
            prescaler += 1;
        }
        Err(BitTimingError::NoPrescaler)
    }

    /// The same, for constants: panics if the clock cannot make it.
    #[must_use]
    pub const fn exact(clock: u32, bits_per_second: u32, limits: BitTimingLimits) -> Self {
        match Self::find(clock, bits_per_second, limits) {
            Ok(timing) => timing,
            Err(error) => panic!("{}", error.text()),
        }
    }
}
