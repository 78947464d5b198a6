//! The division of a bit into time quanta.
#![cfg(test)]

#[path = "../src/stm32h723/can/timing.rs"]
mod timing;

use timing::BitTiming;

const OURS: BitTiming = BitTiming::exact(80_000_000, 1_000_000);

#[test]
fn every_timing_is_exact_and_samples_where_the_motors_do() {
    assert_eq!(OURS, BitTiming { prescaler: 1, before: 59, after: 20 });
    for (clock, rate) in [
        (80_000_000, 1_000_000),
        (120_000_000, 1_000_000),
        (120_000_000, 500_000),
        (120_000_000, 125_000),
        (25_000_000, 1_000_000),
        (24_000_000, 1_000_000),
        (8_000_000, 1_000_000),
        (80_000_000, 10_000),
    ] {
        let BitTiming { prescaler, before, after } = BitTiming::exact(clock, rate);
        let [prescaler, before, after] = [prescaler, before, after].map(u32::from);
        let quanta = 1 + before + after;
        assert_eq!(prescaler * quanta * rate, clock, "{clock} / {rate}");
        let sampled_at = f64::from(1 + before) / f64::from(quanta);
        assert!((0.75..=0.875).contains(&sampled_at), "{clock} / {rate}: {sampled_at}");
        assert!(prescaler <= 512 && before <= 256 && after <= 128);
    }
}

#[test]
#[should_panic(expected = "not a whole bit")]
fn a_rate_that_does_not_divide_the_clock_is_refused() {
    let _ = BitTiming::exact(25_000_000, 800_000);
}

#[test]
#[should_panic(expected = "too few quanta")]
fn a_clock_that_is_too_slow_is_refused() {
    let _ = BitTiming::exact(4_000_000, 1_000_000);
}

#[test]
#[should_panic(expected = "no prescaler")]
fn a_bit_that_cannot_be_divided_is_refused() {
    // A prime number of cycles, more than a register holds.
    let _ = BitTiming::exact(3_571_000, 1_000);
}
