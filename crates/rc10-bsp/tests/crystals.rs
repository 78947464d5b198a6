//! PLL1's settings for a crystal, and when a measured one is another.
#![cfg(test)]

#[path = "../src/stm32h723/crystal/pll.rs"]
mod pll;

use pll::{Crystal, DIVIDER, HSI_MULTIPLIER, frequency, hsi_deviation, parts};

/// Captures of a measurement.
const CAPTURES: u32 = 32;
/// Ticks of HSI that they take with 25 MHz.
const TICKS: u32 = 41_288;

/// Computed when this is compiled, as a board's is.
const BOARDS: [Crystal; 4] = [
    Crystal::new(8_000_000),
    Crystal::new(16_000_000),
    Crystal::new(24_000_000),
    Crystal::new(25_000_000),
];

#[test]
fn every_crystal_makes_480_megahertz_within_the_plls_limits() {
    assert_eq!(BOARDS.map(Crystal::pll), [(2, 120), (4, 120), (4, 80), (5, 96)]);
    for hz in 4_000_000..=50_000_000_u32 {
        // Most have no such setting: those are refused.
        if !hz.is_multiple_of(100_000) || (1..64).all(|by| !480_000_000_u32.is_multiple_of(hz / by))
        {
            continue;
        }
        let Ok(crystal) = std::panic::catch_unwind(|| Crystal::new(hz)) else { continue };
        let (divider, multiplier) = crystal.pll();
        assert_eq!(u64::from(hz) * u64::from(multiplier), 480_000_000 * u64::from(divider), "{hz}");
        // RM0468: DIVM1 1 to 63, DIVN1 4 to 512, the input in the range that `PLL1RGE` = 2 is for, the VCO's
        // 480 MHz in 192 to 836.
        assert!((1..=63).contains(&divider) && (4..=512).contains(&multiplier), "{hz}");
        assert!((4_000_000..8_000_000).contains(&(hz / u32::from(divider))), "{hz}");
        // RTCPRE has six bits, and makes at most 1 MHz.
        assert!(hz / u32::from(DIVIDER) <= 1_000_000 && DIVIDER < 64, "{hz}");
    }
}

#[test]
fn a_crystal_that_cannot_be_is_refused() {
    for hz in [0, 3_999_999, 50_000_001, u32::MAX, 11_059_200, 25_000_001] {
        assert!(std::panic::catch_unwind(|| Crystal::new(hz)).is_err(), "{hz}");
    }
}

/// HSI is within 1 % (0 to 85 °C), and the count within one tick of it.
#[test]
fn another_crystal_is_told_from_a_chip_that_is_off() {
    let measured = |crystal: u32, hsi: f64| {
        let periods = f64::from(CAPTURES * 8 * u32::from(DIVIDER));
        let ticks = periods / f64::from(crystal) * 64e6 * hsi;
        // From one capture to the next the timer's 16 bits are enough.
        assert!(ticks / f64::from(CAPTURES) < 65_536.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some 10^5")]
        let ticks = ticks.round() as u32;
        frequency(CAPTURES, ticks).unwrap()
    };
    let known = [
        4_000_000, 8_000_000, 12_000_000, 16_000_000, 20_000_000, 24_000_000, 25_000_000,
        26_000_000, 50_000_000,
    ];
    for own in BOARDS {
        for other in known {
            for hsi in [0.99, 1.0, 1.01] {
                let seen = measured(other, hsi);
                let is_other = own.is_other(seen);
                assert_eq!(is_other, other != own.hz(), "{} for {other}, {hsi}: {seen}", own.hz());
            }
        }
    }
    // Of a hot chip, whose HSI is off by more, the right crystal is still right.
    for own in BOARDS {
        assert!(!own.is_other(measured(own.hz(), 0.98)) && !own.is_other(measured(own.hz(), 1.02)));
    }
    // The bound is 2.5 %, either way.
    let own = Crystal::new(24_000_000);
    for (off, is_other) in [(599_999, false), (600_001, true)] {
        assert_eq!(own.is_other(24_000_000 + off), is_other);
        assert_eq!(own.is_other(24_000_000 - off), is_other);
    }
}

/// A frequency that no crystal can have says that the measurement failed: a timer that captures
/// each period and not each eighth, or none.
#[test]
fn nonsense_is_no_crystal() {
    assert_eq!(frequency(CAPTURES, 0), None);
    assert_eq!(frequency(CAPTURES, 1), None);
    assert_eq!(frequency(CAPTURES, TICKS / 8), None);
    assert_eq!(frequency(CAPTURES, TICKS * 8), None);
    assert!(frequency(CAPTURES, TICKS).unwrap().abs_diff(25_000_000) < 1_000);
}

/// A HSI that is off makes 480 MHz by what was measured of it, within the tick of the count and a step of the fraction.
#[test]
fn an_oscillator_that_is_off_makes_the_same_clock() {
    assert_eq!((parts(HSI_MULTIPLIER), hsi_deviation(HSI_MULTIPLIER)), ([75, 0], 0));
    for own in BOARDS {
        for (ppm, hundredths) in
            [(-15_000, -150), (-3_100, -31), (0, 0), (3_100, 31), (15_000, 150)]
        {
            let hsi = 64e6 * (1.0 + f64::from(ppm) * 1e-6);
            let periods = f64::from(CAPTURES * 8 * u32::from(DIVIDER));
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "some 10^5"
            )]
            let ticks = (periods / f64::from(own.hz()) * hsi).round() as u32;
            let multiplier = own.hsi_multiplier(frequency(CAPTURES, ticks).unwrap());
            let [whole, fraction] = parts(multiplier);
            assert!(fraction < 8192);
            let core = hsi / 10.0 * (f64::from(whole) + f64::from(fraction) / 8192.0);
            let off = (core / 480e6 - 1.0) * 1e6;
            assert!(off.abs() < 30.0, "{}, {ppm} ppm: {off} ppm", own.hz());
            assert_eq!(hsi_deviation(multiplier), hundredths, "{}", own.hz());
        }
    }
}

/// Deviations of each multiplier that 2 % make.
#[test]
fn a_deviation_is_the_nearest_hundredth_of_a_per_cent() {
    for multiplier in HSI_MULTIPLIER * 98 / 100..HSI_MULTIPLIER * 102 / 100 {
        let exact = (f64::from(HSI_MULTIPLIER) / f64::from(multiplier) - 1.0) * 1e4;
        assert!((f64::from(hsi_deviation(multiplier)) - exact).abs() <= 0.5, "{multiplier}");
    }
}

#[test]
fn a_wrong_crystal_says_its_bit_rate() {
    assert_eq!(Crystal::new(25_000_000).bit_rate_with(24_000_000), 960_000);
    assert_eq!(Crystal::new(24_000_000).bit_rate_with(25_000_000), 1_041_666);
    assert_eq!(Crystal::new(8_000_000).bit_rate_with(50_000_000), 6_250_000);
}
