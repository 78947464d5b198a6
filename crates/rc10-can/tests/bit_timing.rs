//! The division of a bit into time quanta.
#![cfg(test)]

use rc10_can::BitTimingError::{NoPrescaler, NotWhole, TooFewQuanta};
use rc10_can::{BitTiming, BitTimingLimits};

const FDCAN: BitTimingLimits = BitTimingLimits::FDCAN;
const BXCAN: BitTimingLimits = BitTimingLimits::BXCAN;

const OURS: BitTiming = BitTiming::exact(80_000_000, 1_000_000, FDCAN);

#[test]
fn every_timing_is_exact_and_samples_where_the_motors_do() {
    assert_eq!(OURS, BitTiming { prescaler: 1, before: 59, after: 20 });
    for (clock, rate, limits) in [
        (80_000_000, 1_000_000, FDCAN),
        (120_000_000, 1_000_000, FDCAN),
        (120_000_000, 500_000, FDCAN),
        (120_000_000, 125_000, FDCAN),
        (160_000_000, 1_000_000, FDCAN),
        (170_000_000, 1_000_000, FDCAN),
        (25_000_000, 1_000_000, FDCAN),
        (24_000_000, 1_000_000, FDCAN),
        (8_000_000, 1_000_000, FDCAN),
        (80_000_000, 10_000, FDCAN),
        (8_000_000, 1_000_000, BXCAN),
        (36_000_000, 1_000_000, BXCAN),
        (42_000_000, 1_000_000, BXCAN),
        (42_000_000, 500_000, BXCAN),
        (42_000_000, 125_000, BXCAN),
        (45_000_000, 1_000_000, BXCAN),
        (48_000_000, 1_000_000, BXCAN),
        (54_000_000, 1_000_000, BXCAN),
        (80_000_000, 1_000_000, BXCAN),
    ] {
        let BitTiming { prescaler, before, after } = BitTiming::exact(clock, rate, limits);
        assert!(prescaler <= limits.prescaler, "{clock} / {rate}");
        assert!(before <= limits.before && after <= limits.after, "{clock} / {rate}");
        let [prescaler, before, after] = [prescaler, before, after].map(u32::from);
        let quanta = 1 + before + after;
        assert_eq!(prescaler * quanta * rate, clock, "{clock} / {rate}");
        let sampled_at = f64::from(1 + before) / f64::from(quanta);
        assert!((0.75..=0.875).contains(&sampled_at), "{clock} / {rate}: {sampled_at}");
    }
}

#[test]
fn an_f407_gets_21_quanta() {
    let timing = BitTiming::exact(42_000_000, 1_000_000, BXCAN);
    assert_eq!(timing, BitTiming { prescaler: 2, before: 15, after: 5 });
}

#[test]
fn what_cannot_be_made_says_why() {
    // Of the last two a bit is a prime number of cycles, more than a register holds.
    for (clock, rate, limits, error) in [
        (25_000_000, 800_000, FDCAN, NotWhole),
        (25_000_000, 0, FDCAN, NotWhole),
        (4_000_000, 1_000_000, FDCAN, TooFewQuanta),
        (4_000_000, 1_000_000, BXCAN, TooFewQuanta),
        (31_000_000, 1_000_000, BXCAN, NoPrescaler),
        (3_571_000, 1_000, FDCAN, NoPrescaler),
    ] {
        assert_eq!(BitTiming::find(clock, rate, limits), Err(error), "{clock} / {rate}");
    }
}

#[test]
#[should_panic(expected = "too few quanta")]
fn an_exact_timing_that_cannot_be_panics() {
    let _ = BitTiming::exact(4_000_000, 1_000_000, FDCAN);
}
