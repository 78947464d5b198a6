//! Outputs as an oscilloscope shows them: PWM's share, longest pulse, levels.

use rc10_emu::Board;
use rc10_emu::peripherals::PinTime;
use rc10_sim::Nanos;

use crate::chip::{AHB4ENR, APB1LENR, Chip};

const TIM3: u32 = 0x4000_0400;
const TIM12: u32 = 0x4000_1800;
const GPIOC: u32 = 0x5802_0800;
const MILLISECOND: u64 = 1_000_000;

/// DM-MC02 with its heater on TIM3's channel 4 (PB1), 1 kHz, and its buzzer on TIM12's channel 2
/// (PB15), 4 kHz; both off.
fn board() -> Chip {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    chip.start_clocks_with(2, 40, 6);
    chip.write(APB1LENR, 1 << 1 | 1 << 6);
    for (timer, prescaler, reload) in [(TIM3, 239, 999), (TIM12, 239, 249)] {
        chip.write(timer + 0x28, prescaler);
        chip.write(timer + 0x2C, reload);
    }
    // OC4M and OC2M: PWM 1, with preload; CC4E, CC2E.
    chip.write(TIM3 + 0x1C, 0x6800);
    chip.write(TIM3 + 0x20, 1 << 12);
    chip.write(TIM12 + 0x18, 0x6800);
    chip.write(TIM12 + 0x20, 1 << 4);
    for timer in [TIM3, TIM12] {
        chip.write(timer + 0x14, 1);
        chip.set(timer, 1, 1);
    }
    chip.alternate(1, 1, 2);
    chip.alternate(1, 15, 2);
    assert!(chip.soc.watch_pin('B', 1, Nanos::new(chip.now)));
    assert!(chip.soc.watch_pin('B', 15, Nanos::new(chip.now)));
    chip
}

fn take(chip: &mut Chip, pin: usize) -> PinTime {
    chip.soc.take_pin_time('B', pin, Nanos::new(chip.now)).unwrap()
}

#[test]
fn the_share_of_a_heaters_duty() {
    let mut chip = board();
    let start = chip.now;
    chip.run_to(start + 10 * MILLISECOND);
    let off = take(&mut chip, 1);
    assert_eq!((off.high, off.rises), (Nanos::ZERO, 0));
    assert!(off.share().abs() < 1e-12);
    // From the next period on: 24.9 %.
    chip.write(TIM3 + 0x40, 249);
    chip.run_to(start + 11 * MILLISECOND);
    take(&mut chip, 1);
    chip.run_to(start + 5_011 * MILLISECOND);
    let time = take(&mut chip, 1);
    let since = Nanos::new(start + 11 * MILLISECOND);
    let until = Nanos::new(start + 5_011 * MILLISECOND);
    let (high, longest_high) = (Nanos::new(5_000 * 249_000), Nanos::new(249_000));
    assert_eq!((time.since, time.until, time.high), (since, until, high));
    assert_eq!((time.longest_high, time.rises), (longest_high, 5_000));
    assert!((time.share() - 0.249).abs() < 1e-12);
    // No edges are kept.
    assert_eq!(chip.soc.take_edges('B', 1), []);
    assert_eq!(chip.kinds(), []);
}

#[test]
fn a_window_may_end_in_the_middle_of_a_pulse() {
    let mut chip = board();
    chip.write(TIM3 + 0x40, 500);
    chip.run_to(chip.now + 2 * MILLISECOND);
    while chip.soc.pin_output('B', 1) != Some(true) {
        chip.run_to(chip.now + 10_000);
    }
    take(&mut chip, 1);
    let mut before = Nanos::ZERO;
    for _ in 0..3 {
        chip.run_to(chip.now + 100_000);
        let time = take(&mut chip, 1);
        assert_eq!((time.high, time.rises), (Nanos::new(100_000), 0));
        // The pulse began earlier, and goes on.
        assert!(time.longest_high.get() >= before.get() + 100_000, "{time:?} {before:?}");
        before = time.longest_high;
    }
}

#[test]
fn a_buzzer_that_is_held_high_shows() {
    let mut chip = board();
    chip.write(TIM12 + 0x38, 125);
    chip.run_to(chip.now + 100 * MILLISECOND);
    let time = take(&mut chip, 15);
    assert!(time.longest_high <= Nanos::new(125_000) && time.share() < 0.51, "{time:?}");
    // A timer that stops in the middle of a pulse holds it.
    while chip.soc.pin_output('B', 15) != Some(true) {
        chip.run_to(chip.now + 10_000);
    }
    chip.set(TIM12, 1, 0);
    chip.run_to(chip.now + 100 * MILLISECOND);
    assert!(take(&mut chip, 15).longest_high >= Nanos::new(100 * MILLISECOND));
}

#[test]
fn switches_are_on_or_off() {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    chip.write(AHB4ENR, 1 << 2);
    for pin in 13..16 {
        assert!(chip.soc.watch_pin('C', pin, Nanos::new(chip.now)));
        assert_eq!(chip.soc.pin_output('C', pin), None, "off: pulled down");
    }
    chip.write(GPIOC, 0x57FF_FFFF);
    chip.write(GPIOC + 0x18, 1 << 14);
    chip.run_to(chip.now + MILLISECOND);
    chip.write(GPIOC + 0x18, 1 << 30);
    chip.run_to(chip.now + MILLISECOND);
    let now = Nanos::new(chip.now);
    let highs = [13, 14, 15].map(|pin| chip.soc.take_pin_time('C', pin, now).unwrap().high.get());
    assert_eq!(highs, [0, MILLISECOND, 0]);
    assert_eq!(chip.soc.pin_output('C', 14), Some(false));
    assert!(chip.soc.take_pin_time('C', 12, now).is_none(), "not watched");
    assert!(!chip.soc.watch_pin('Z', 1, now));
}

#[test]
fn a_pin_that_is_high_already_counts_from_the_begin_of_watching() {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    chip.write(AHB4ENR, 1 << 2);
    chip.write(GPIOC + 0x18, 1 << 14 | 1 << 15);
    chip.write(GPIOC, 0x57FF_FFFF);
    chip.run_to(50 * MILLISECOND);
    // PC15 is recorded first, and watched later: its rise is not known either.
    assert!(chip.record('C', 15));
    assert!(chip.soc.watch_pin('C', 14, Nanos::new(chip.now)));
    chip.run_to(52 * MILLISECOND);
    assert!(chip.soc.watch_pin('C', 15, Nanos::new(chip.now)));
    chip.run_to(53 * MILLISECOND);
    let now = Nanos::new(chip.now);
    let times = [14, 15].map(|pin| chip.soc.take_pin_time('C', pin, now).unwrap());
    let figures = times.map(|time| (time.high.get(), time.longest_high.get(), time.rises));
    let both = [(3 * MILLISECOND, 3 * MILLISECOND, 0), (MILLISECOND, 3 * MILLISECOND, 0)];
    assert_eq!(figures, both);
}

#[test]
fn a_pin_that_is_only_recorded_has_no_time() {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    assert!(chip.record('C', 14));
    let now = Nanos::new(chip.now);
    assert!(chip.soc.take_pin_time('C', 14, now).is_none());
    assert!(chip.soc.watch_pin('C', 14, now));
    assert!(chip.soc.take_pin_time('C', 14, now).is_some());
}
