//! TIM16 and TIM17: the chip's own clocks measured with one another.

use rc10_emu::Board;
use rc10_emu::peripherals::AccessKind;
use rc10_sim::Nanos;

use crate::chip::{APB2ENR, Chip, RCC};

const TIM16: u32 = 0x4001_4400;
const TIM17: u32 = 0x4001_4800;
const CR1: u32 = 0x00;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const RCR: u32 = 0x30;
const CCR1: u32 = 0x34;
const TISEL: u32 = 0x68;
const CC1IF: u32 = 2;
const CC1OF: u32 = 0x200;
const EIGHTH: u32 = 3 << 2;

/// After a reset on HSI, HSE on: a timer that captures channel 1 from a source of TISEL.
fn listening(
    board: Board,
    hsi_ppm: i32,
    timer: u32,
    source: u32,
    divider: u32,
    prescaler: u32,
) -> Chip {
    let mut chip = Chip::on(board, hsi_ppm);
    chip.set(RCC, 1 << 16, 1 << 16);
    chip.wait(RCC, 1 << 17);
    // RTCPRE.
    chip.set(RCC + 0x10, 0x3F << 8, divider << 8);
    chip.write(APB2ENR, 1 << 17 | 1 << 18);
    chip.write(timer + TISEL, source);
    chip.write(timer + CCMR1, prescaler | 1);
    chip.write(timer + CCER, 1);
    chip.set(timer + CR1, 1, 1);
    chip
}

/// Waits for `count` captures; the ticks from the first to the last.
fn ticks(chip: &mut Chip, timer: u32, count: u32) -> u32 {
    chip.read(timer + CCR1);
    chip.wait(timer + SR, CC1IF);
    let first = chip.read(timer + CCR1);
    let mut last = first;
    for _ in 0..count {
        chip.wait(timer + SR, CC1IF);
        last = chip.read(timer + CCR1);
    }
    assert_eq!(chip.read(timer + SR) & CC1OF, 0);
    last.wrapping_sub(first) & 0xFFFF
}

/// 64 MHz against eight periods of 1 MHz, 25 / 24 MHz, 1 MHz that HSI sees 1 % too slow.
#[test]
fn the_crystal_is_measured() {
    const WRONG: Board = Board { crystal_hz: 25_000_000, ..Board::DM_MC02 };
    for (board, ppm, expected) in [
        (Board::DM_MC02, 0, 100 * 512),
        (WRONG, 0, 49_152),
        (Board::DM_MC02, 10_000, 51_712),
        (WRONG, -10_000, 48_660),
    ] {
        let mut chip = listening(board, ppm, TIM17, 2, 24, EIGHTH);
        let measured = ticks(&mut chip, TIM17, 100);
        // A tick at each end.
        assert!(measured.abs_diff(expected) <= 1, "{measured} {expected}");
        assert_eq!(chip.kinds(), []);
    }
}

#[test]
fn no_divider_no_crystal_or_another_input_and_nothing_is_captured() {
    for (divider, source) in [(0, 2), (1, 2), (24, 0)] {
        let mut chip = listening(Board::DM_MC02, 0, TIM17, source, divider, 0);
        chip.run_to(chip.now + 1_000_000);
        assert_eq!(chip.read(TIM17 + SR) & CC1IF, 0, "{divider} {source}");
    }
    let mut chip = listening(Board::DM_MC02, 0, TIM17, 2, 24, 0);
    chip.wait(TIM17 + SR, CC1IF);
    chip.soc.set_crystal(false, Nanos::new(chip.now));
    chip.read(TIM17 + CCR1);
    chip.run_to(chip.now + 1_000_000);
    assert_eq!(chip.read(TIM17 + SR) & CC1IF, 0);
    assert_eq!(chip.kinds(), []);
    // SPDIF is not modelled, nor is what does not exist.
    chip.write(TIM17 + TISEL, 1);
    chip.write(TIM17 + TISEL, 7);
    assert_eq!(chip.kinds(), [AccessKind::Unmodelled; 2]);
}

#[test]
fn captures_that_are_not_taken_are_told_and_cost_nothing() {
    let mut chip = listening(Board::DM_MC02, 0, TIM17, 2, 24, 0);
    let next = chip.soc.next_event().map(Nanos::get);
    assert!(next.is_none_or(|next| next > chip.now + 1_000_000_000), "{next:?}");
    chip.run_to(chip.now + 1_000_000_000);
    assert_eq!(chip.read(TIM17 + SR) & (CC1IF | CC1OF), CC1IF | CC1OF);
    // The last one: at most a microsecond ago.
    let ago = chip.read(TIM17 + CNT).wrapping_sub(chip.read(TIM17 + CCR1)) & 0xFFFF;
    assert!(ago <= 64, "{ago}");
    chip.write(TIM17 + SR, 0);
    chip.to(chip.now + 1_000);
    assert_eq!(chip.read(TIM17 + SR) & (CC1IF | CC1OF), CC1IF);
}

/// 25 MHz / 24, every edge: 960 ns; of eight edges 7.68 us; both edges 480 ns.
#[test]
fn an_interrupt_comes_at_the_nanosecond() {
    let board = Board { crystal_hz: 25_000_000, ..Board::DM_MC02 };
    for (prescaler, edges, period) in [(0, 0, 960), (EIGHTH, 0, 7_680), (0, 0b1010, 480)] {
        let mut chip = listening(board, 0, TIM17, 2, 24, prescaler);
        chip.write(TIM17 + CCER, 0);
        chip.read(TIM17 + CCR1);
        chip.write(TIM17 + SR, 0);
        chip.write(TIM17 + DIER, CC1IF);
        chip.write(TIM17 + CCER, 1 | edges);
        let start = chip.now;
        for capture in 1..=3 {
            let at = chip.until_interrupt(118, u64::MAX);
            assert_eq!(at, Some(start + capture * period), "{prescaler} {edges}");
            chip.read(TIM17 + CCR1);
        }
    }
}

#[test]
fn tim16_hears_lsi_and_tim17_mco1() {
    let mut chip = listening(Board::DM_MC02, 0, TIM16, 1, 0, 0);
    chip.set(RCC + 0x74, 1, 1);
    chip.wait(RCC + 0x74, 2);
    // 32 kHz.
    assert_eq!(ticks(&mut chip, TIM16, 10), 20_000);
    let mut chip = listening(Board::DM_MC02, 0, TIM17, 3, 0, EIGHTH);
    // HSE / 15.
    chip.set(RCC + 0x10, 0x7F << 18, 2 << 22 | 15 << 18);
    assert!(ticks(&mut chip, TIM17, 10).abs_diff(3_200) <= 1);
    assert_eq!(chip.kinds(), []);
}

#[test]
fn they_count_and_update_after_repetitions() {
    let mut chip = Chip::running();
    chip.write(APB2ENR, 1 << 17);
    chip.write(TIM16 + RCR, 3);
    chip.count(TIM16, 239, 99);
    chip.write(TIM16 + DIER, 1);
    chip.write(TIM16 + CR1, 1);
    let start = chip.now;
    for update in 1..=3 {
        assert_eq!(chip.until_interrupt(117, u64::MAX), Some(start + update * 400_000));
        chip.write(TIM16 + SR, 0);
    }
    // Many at once: 10 overflows further, the next update comes 2 later.
    chip.write(TIM16 + DIER, 0);
    chip.to(start + 1_200_000 + 1_050_000);
    assert_eq!(chip.read(TIM16 + SR) & 1, 1);
    chip.write(TIM16 + SR, 0);
    chip.write(TIM16 + DIER, 1);
    assert_eq!(chip.until_interrupt(117, u64::MAX), Some(start + 2_400_000));
}
