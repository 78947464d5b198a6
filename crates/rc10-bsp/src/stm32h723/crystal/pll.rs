//! A crystal's PLL1 settings, and whether another is measured. Without registers, for tests.

/// The core's clock, which PLL1 makes: hertz.
const CORE: u32 = 480_000_000;
/// The chip's own oscillator (HSI).
const HSI: u32 = 64_000_000;

/// A board's crystal, and the settings by which PLL1 makes 480 MHz of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crystal {
    hz: u32,
    divider: u8,
    multiplier: u16,
}

// STM32H723 data sheet, HSE oscillator characteristics.
const LOWEST: u32 = 4_000_000;
const HIGHEST: u32 = 50_000_000;
/// PLL1's input, hertz: also HSI / 10's range, to go on from that (RM0468, PLL1RGE).
const INPUT: core::ops::Range<u32> = 4_000_000..8_000_000;

/// Thousandths by which another crystal differs: HSI is within 15, 24 and 25 MHz are 40 apart.
const APART: u32 = 25;

impl Crystal {
    /// A crystal of `hz` hertz, 4 ..= 50 MHz. Meant for constants: 8, 12, 16, 20, 24, 25 MHz and many others.
    ///
    /// # Panics
    /// If the PLL cannot make exactly 480 MHz of it.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "at most 120")]
    pub const fn new(hz: u32) -> Self {
        assert!(hz >= LOWEST && hz <= HIGHEST, "a crystal has 4 to 50 MHz");
        let mut divider = 1;
        while divider < 64 {
            let input = hz / divider as u32;
            let is_whole = hz.is_multiple_of(divider as u32) && CORE.is_multiple_of(input);
            if is_whole && input >= INPUT.start && input < INPUT.end {
                return Self { hz, divider, multiplier: (CORE / input) as u16 };
            }
            divider += 1;
        }
        panic!("PLL1 cannot make 480 MHz of this crystal");
    }

    /// The frequency in hertz.
    #[must_use]
    pub const fn hz(self) -> u32 {
        self.hz
    }

    /// PLL1's settings: the divider before it, and its multiplier.
    #[must_use]
    pub const fn pll(self) -> (u8, u16) {
        (self.divider, self.multiplier)
    }

    /// Whether a crystal of this frequency, as HSI measures it, is another one than this.
    #[must_use]
    pub const fn is_other(self, measured: u32) -> bool {
        measured.abs_diff(self.hz) > self.hz / 1000 * APART
    }

    /// PLL1's multiplier of HSI / 10, in 8192ths, for 480 MHz, if HSI measures this of the crystal.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "within 2.5 % of the exact one")]
    pub const fn hsi_multiplier(self, measured: u32) -> u32 {
        (HSI_MULTIPLIER as u64 * measured as u64 / self.hz as u64) as u32
    }

    /// Bits a second of a bus of 1 Mbit/s with a crystal of this frequency in its place.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "at most 12.75 million")]
    pub const fn bit_rate_with(self, measured: u32) -> u32 {
        // Both are crystals: 4 to 50 MHz, one measured within 2 %.
        (measured as u64 * 1_000_000 / self.hz as u64) as u32
    }
}

/// PLL1's multiplier of an exact HSI / 10, in 8192ths, as `RCC_PLL1FRACR` counts.
pub(super) const HSI_MULTIPLIER: u32 = 75 * FRACTION;
const FRACTION: u32 = 8192;

/// How much too fast HSI is, for which this multiplier is right: hundredths of a per cent, to the nearest.
#[expect(clippy::cast_possible_wrap, reason = "within 3 % of 614,400")]
pub(super) const fn hsi_deviation(multiplier: u32) -> i32 {
    let of = multiplier as i32;
    let off = (HSI_MULTIPLIER as i32 - of) * 10_000;
    (off + if off < 0 { -of / 2 } else { of / 2 }) / of
}

/// A multiplier's whole part, and its fraction.
#[expect(clippy::cast_possible_truncation, reason = "77 and 8191 at most")]
pub(super) const fn parts(multiplier: u32) -> [u16; 2] {
    [(multiplier / FRACTION) as u16, (multiplier % FRACTION) as u16]
}

/// `RCC_CFGR.RTCPRE` for the measurement: the most, for less than 1 MHz of 50.
pub(super) const DIVIDER: u8 = 63;
/// The timer captures each eighth period of that.
const EIGHTH: u64 = 8;

/// The frequency by captures and ticks of HSI; `None` if impossible: a failed measurement.
#[expect(clippy::cast_possible_truncation, reason = "at most 51 MHz")]
pub(super) const fn frequency(captures: u32, ticks: u32) -> Option<u32> {
    if ticks == 0 {
        return None;
    }
    let hz = HSI as u64 * captures as u64 * EIGHTH * DIVIDER as u64 / ticks as u64;
    // HSI is within 1.5 %, so a real crystal of 50 MHz is seen at 50.8 at most.
    if hz < LOWEST as u64 * 98 / 100 || hz > HIGHEST as u64 * 102 / 100 {
        None
    } else {
        Some(hz as u32)
    }
}
