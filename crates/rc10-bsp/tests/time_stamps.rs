//! From the time stamps of a 16-bit counter to time.
#![cfg(test)]

#[path = "../src/stm32h723/can/clock.rs"]
mod clock;

use clock::Clock;
use rc10_time::Micros;

#[test]
fn a_frame_is_as_old_as_the_counter_says_also_across_its_overflow() {
    let mut clock = Clock::new(Micros::new(100_000));
    clock.read(Micros::new(101_000), 50);
    assert_eq!(clock.time_of(50), Micros::new(101_000));
    assert_eq!(clock.time_of(20), Micros::new(100_970));
    assert_eq!(clock.time_of(u16::MAX), Micros::new(100_949));
    clock.read(Micros::new(102_000), 1050);
    assert_eq!(clock.time_of(20), Micros::new(100_970));
}

#[test]
fn after_a_pause_longer_than_the_counter_no_frame_looks_younger_than_it_may_be() {
    let mut clock = Clock::new(Micros::ZERO);
    clock.read(Micros::new(65_000), 0);
    assert_eq!(clock.time_of(u16::MAX - 9), Micros::new(64_990));
    // 70 ms later: it may have come at any time since, also 5 ms ago or 70.5.
    clock.read(Micros::new(135_000), 4_464);
    assert_eq!(clock.time_of(4_000), Micros::new(65_000));
    // What comes from now on is dated again.
    clock.read(Micros::new(136_000), 5_464);
    assert_eq!(clock.time_of(5_000), Micros::new(135_536));
}

#[test]
fn no_time_is_before_the_start() {
    let mut clock = Clock::new(Micros::ZERO);
    clock.read(Micros::new(10), 5);
    assert_eq!(clock.time_of(500), Micros::ZERO);
}
