use rc10_emu::peripherals::Width;
use rc10_sim::Nanos;

use crate::chip::{APB1LENR, Chip, RCC};

const TIM2: u32 = 0x4000_0000;
const TIM6: u32 = 0x4000_1000;
const CR1: u32 = 0x00;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR2: u32 = 0x38;

/// TIM2 as embassy's time driver starts it: 1 MHz, 16 bits.
fn time_driver() -> (Chip, u64) {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 | 1 << 4);
    chip.write(TIM2 + CNT, 0);
    chip.write(TIM2 + PSC, 239);
    chip.write(TIM2 + ARR, 0xFFFF);
    chip.set(TIM2 + CR1, 1 << 2, 1 << 2);
    chip.write(TIM2 + EGR, 1);
    assert_eq!(chip.read(TIM2 + SR) & 1, 0, "URS");
    chip.set(TIM2 + CR1, 1 << 2, 0);
    chip.write(TIM2 + CCR1, 0x8000);
    chip.write(TIM2 + SR, 0);
    chip.write(TIM2 + DIER, 0b11);
    chip.set(TIM2 + CR1, 1, 1);
    let start = chip.now;
    (chip, start)
}

#[test]
fn it_counts_microseconds() {
    let (mut chip, start) = time_driver();
    for (nanos, count) in
        [(999, 0), (1_000, 1), (32_767_999, 32_767), (65_535_999, 65_535), (65_536_000, 0)]
    {
        chip.run_to(start + nanos);
        assert_eq!(chip.read(TIM2 + CNT), count, "{nanos}");
    }
}

#[test]
fn compare_and_overflow_interrupt_at_the_nanosecond() {
    let (mut chip, start) = time_driver();
    assert_eq!(chip.until_interrupt(28, u64::MAX), Some(start + 32_768_000));
    assert_eq!(chip.read(TIM2 + SR) & 0b11, 0b10);
    // Write zero to clear: the other flags stay.
    chip.write(TIM2 + SR, !0b10);
    assert!(!chip.interrupt(28));
    assert_eq!(chip.until_interrupt(28, u64::MAX), Some(start + 65_536_000));
    assert_eq!(chip.read(TIM2 + SR) & 0b11, 0b01);
    // An hour later it is still exact.
    let hour = 3_600_000_000_000 / 65_536_000;
    for _ in 0..hour {
        chip.write(TIM2 + SR, 0);
        chip.until_interrupt(28, u64::MAX);
        chip.write(TIM2 + SR, 0);
        chip.until_interrupt(28, u64::MAX);
    }
    assert_eq!(chip.now, start + 65_536_000 * (hour + 1));
}

#[test]
fn an_alarm_is_one_compare_channel() {
    let (mut chip, start) = time_driver();
    chip.to(start + 10_000);
    chip.write(TIM2 + CCR2, 1_010);
    chip.set(TIM2 + DIER, 1 << 2, 1 << 2);
    assert_eq!(chip.until_interrupt(28, u64::MAX), Some(start + 1_010_000));
    assert_eq!(chip.read(TIM2 + SR) & 0b111, 0b100);
}

#[test]
fn flags_rise_without_their_interrupts() {
    let (mut chip, start) = time_driver();
    chip.write(TIM2 + DIER, 0);
    chip.write(TIM2 + CCR2, 70);
    assert_eq!(chip.soc.next_event().filter(|at| at.get() < start + 1_000_000_000), None);
    chip.to(start + 69_999);
    assert_eq!(chip.read(TIM2 + SR) & 0b111, 0);
    chip.to(start + 70_000);
    assert_eq!(chip.read(TIM2 + SR) & 0b111, 0b100);
    chip.to(start + 1_000_000_000);
    assert_eq!(chip.read(TIM2 + SR) & 0b111, 0b111);
    assert_eq!(u64::from(chip.read(TIM2 + CNT)), 1_000_000 % 65_536);
}

#[test]
fn odd_rates_do_not_drift() {
    // 240 MHz / 7 / 1000: an update every 29166 2/3 ns.
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 << 4);
    chip.count(TIM6, 6, 999);
    chip.write(TIM6 + DIER, 1);
    chip.write(TIM6 + CR1, 1);
    let start = chip.now;
    for update in 1..=3_000_u64 {
        let at = chip.until_interrupt(54, u64::MAX).unwrap();
        assert_eq!(at, start + (update * 7_000_000_000_000).div_ceil(240_000_000));
        chip.write(TIM6 + SR, 0);
    }
}

#[test]
fn the_prescaler_waits_for_an_update() {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 << 4);
    chip.write(TIM6 + ARR, 239);
    chip.write(TIM6 + CR1, 1);
    let start = chip.now;
    chip.write(TIM6 + PSC, 239);
    chip.to(start + 500);
    assert_eq!(chip.read(TIM6 + CNT), 120);
    // After the overflow at 1 us it counts microseconds.
    chip.run_to(start + 1_000 + 7_999);
    assert_eq!(chip.read(TIM6 + CNT), 7);
}

#[test]
fn reload_and_compare_values_with_and_without_preload() {
    let (mut chip, start) = time_driver();
    chip.write(TIM2 + DIER, 1);
    chip.set(TIM2 + CR1, 1 << 7, 1 << 7);
    chip.write(TIM2 + ARR, 99);
    assert_eq!(chip.until_interrupt(28, u64::MAX), Some(start + 65_536_000));
    chip.write(TIM2 + SR, 0);
    assert_eq!(chip.until_interrupt(28, u64::MAX), Some(start + 65_636_000));
    // OC2PE: the new value counts from the next overflow on.
    chip.write(TIM2 + CCMR1, 1 << 11);
    chip.write(TIM2 + CCR2, 50);
    chip.write(TIM2 + SR, 0);
    chip.write(TIM2 + DIER, 1 << 2);
    assert_eq!(chip.until_interrupt(28, u64::MAX), Some(start + 65_736_000 + 50_000));
}

#[test]
fn one_pulse_stops_after_an_update() {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 << 4);
    chip.write(TIM6 + ARR, 239);
    chip.write(TIM6 + DIER, 1);
    chip.write(TIM6 + CR1, 1 | 1 << 3);
    let start = chip.now;
    assert_eq!(chip.until_interrupt(54, u64::MAX), Some(start + 1_000));
    assert_eq!((chip.read(TIM6 + CR1) & 1, chip.read(TIM6 + CNT)), (0, 0));
    chip.write(TIM6 + SR, 0);
    assert_eq!(chip.until_interrupt(54, start + 1_000_000_000), None);
}

#[test]
fn without_clock_it_stands() {
    let (mut chip, start) = time_driver();
    chip.to(start + 5_000);
    chip.write(APB1LENR, 0);
    chip.to(start + 50_000);
    chip.write(APB1LENR, 1);
    assert_eq!(chip.read(TIM2 + CNT), 5);
    chip.to(start + 52_000);
    assert_eq!(chip.read(TIM2 + CNT), 7);
}

#[test]
fn a_slower_bus_slows_it() {
    let (mut chip, start) = time_driver();
    chip.to(start + 5_000);
    // HPRE / 4.
    chip.set(RCC + 0x18, 0xF, 9);
    chip.to(start + 15_000);
    assert_eq!(chip.read(TIM2 + CNT), 10);
}

/// A value narrower than a register comes over the bridge repeated: in a counter of 32 bits that is
/// another value, in one of 16 the same.
#[test]
fn a_half_word_is_written_twice_over() {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 0b11);
    let now = Nanos::new(chip.now);
    const TIM3: u32 = TIM2 + 0x400;
    for timer in [TIM2, TIM3] {
        chip.soc.write(timer + CCR1, Width::Half, 72, now).unwrap();
    }
    assert_eq!((chip.read(TIM2 + CCR1), chip.read(TIM3 + CCR1)), (72 << 16 | 72, 72));
}
