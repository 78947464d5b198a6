//! TIM1 and TIM8: main output enable, complementary outputs, repetitions, a strip's signal.

use rc10_emu::peripherals::AccessKind;

use crate::chip::{APB2ENR, Chip, RCC};
use crate::strip::{colours, widths};

const TIM1: u32 = 0x4001_0000;
const TIM8: u32 = 0x4001_0400;
const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const RCR: u32 = 0x30;
const CCR1: u32 = 0x34;
const CCR3: u32 = 0x3C;
const BDTR: u32 = 0x44;
const MOE: u32 = 1 << 15;
const OSSI: u32 = 1 << 10;
const OSSR: u32 = 1 << 11;

/// TIM8 at 240 MHz with PWM 1 of 72 in 300 clocks on channel 1; PA7 is CH1N, PC6 is CH1.
fn tim8(ccer: u32, bdtr: u32) -> Chip {
    let mut chip = Chip::running();
    chip.write(APB2ENR, 1 << 1);
    chip.alternate(0, 7, 3);
    chip.alternate(2, 6, 3);
    chip.write(TIM8 + CCR1, 72);
    chip.write(TIM8 + CCMR1, 0x68);
    chip.write(TIM8 + CCER, ccer);
    chip.write(TIM8 + BDTR, bdtr);
    chip.count(TIM8, 0, 299);
    assert!(chip.record('A', 7) && chip.record('C', 6));
    chip.write(TIM8 + CR1, 1);
    chip
}

/// Levels of CH1 and CH1N at a period's beginning and end, from now on counted.
fn levels(chip: &mut Chip) -> [(Option<bool>, Option<bool>); 2] {
    let start = chip.now + 12_500;
    [100, 1_000].map(|after| {
        chip.run_to(start + after);
        (chip.soc.pin_output('C', 6), chip.soc.pin_output('A', 7))
    })
}

/// RM0468, output control bits for complementary channels.
#[test]
fn enables_and_polarities_are_the_manuals() {
    const HIGH: Option<bool> = Some(true);
    const LOW: Option<bool> = Some(false);
    let table = [
        // CCER (CC1NP, CC1NE, CC1P, CC1E), BDTR, while the reference is active, while it is not.
        (0b0001, MOE, (HIGH, None), (LOW, None)),
        (0b0011, MOE, (LOW, None), (HIGH, None)),
        // Alone, the complementary output carries the reference itself.
        (0b0100, MOE, (None, HIGH), (None, LOW)),
        (0b1100, MOE, (None, LOW), (None, HIGH)),
        (0b0101, MOE, (HIGH, LOW), (LOW, HIGH)),
        (0b1101, MOE, (HIGH, HIGH), (LOW, LOW)),
        (0b0000, MOE, (None, None), (None, None)),
        (0b0110, MOE | OSSR, (HIGH, HIGH), (HIGH, LOW)),
        // Without MOE nothing is driven, or the idle state.
        (0b0101, 0, (None, None), (None, None)),
        (0b0101, OSSI, (LOW, LOW), (LOW, LOW)),
    ];
    for (ccer, bdtr, active, inactive) in table {
        let mut chip = tim8(ccer, bdtr);
        assert_eq!(levels(&mut chip), [active, inactive], "{ccer:#b} {bdtr:#x}");
        assert_eq!(chip.kinds(), []);
    }
    // OIS1N.
    let mut chip = tim8(0b0101, OSSI);
    chip.write(TIM8 + CR2, 1 << 9);
    assert_eq!(levels(&mut chip), [(LOW, HIGH); 2]);
}

#[test]
fn moe_lets_the_pulses_out() {
    let mut chip = tim8(0b0100, 0);
    chip.run_to(chip.now + 12_500);
    assert_eq!(chip.soc.take_edges('A', 7), []);
    chip.write(TIM8 + BDTR, MOE);
    chip.run_to(chip.now + 12_500);
    let edges = chip.soc.take_edges('A', 7);
    // One at either end.
    assert_eq!(edges.iter().filter(|edge| edge.high).count(), 11);
    for pair in edges.chunks_exact(2) {
        assert!(pair[0].high && !pair[1].high);
        assert_eq!(pair[1].at.since(pair[0].at).get(), 300);
    }
    assert_eq!(chip.soc.take_edges('C', 6), []);
}

#[test]
fn breaks_and_dead_times_are_not_modelled() {
    // DTG, LOCK, BKE, AOE.
    for refused in [1, 1 << 8, 1 << 12, 1 << 14] {
        let mut chip = tim8(0b0001, MOE | refused);
        assert_eq!(chip.kinds(), [AccessKind::Unmodelled], "{refused:#x}");
        assert_eq!(chip.read(TIM8 + BDTR), MOE);
    }
}

#[test]
fn updates_and_channels_have_interrupts_of_their_own() {
    for (timer, gate, update, channels) in [(TIM1, 0, 25, 27), (TIM8, 1, 44, 46)] {
        let mut chip = Chip::running();
        chip.write(APB2ENR, 1 << gate);
        chip.write(timer + RCR, 1);
        chip.write(timer + CCR1, 50);
        chip.count(timer, 239, 99);
        chip.write(timer + DIER, 0b11);
        chip.write(timer + CR1, 1);
        let start = chip.now;
        assert_eq!(chip.until_interrupt(channels, u64::MAX), Some(start + 50_000));
        chip.write(timer + SR, 0);
        assert!(!chip.interrupt(update));
        assert_eq!(chip.until_interrupt(update, u64::MAX), Some(start + 200_000));
        assert_eq!(chip.kinds(), []);
    }
}

#[test]
fn servos_on_channels_1_and_3_of_tim1() {
    let mut chip = Chip::running();
    chip.write(APB2ENR, 1);
    chip.alternate(4, 9, 1);
    chip.alternate(4, 13, 1);
    chip.write(TIM1 + CCMR1, 0x68);
    chip.write(TIM1 + CCMR2, 0x68);
    chip.write(TIM1 + CCR1, 1_000);
    chip.write(TIM1 + CCR3, 2_000);
    chip.write(TIM1 + CCER, 0x0101);
    chip.count(TIM1, 239, 19_999);
    assert!(chip.record('E', 9) && chip.record('E', 13));
    chip.write(TIM1 + BDTR, MOE);
    chip.write(TIM1 + CR1, 1);
    let start = chip.now;
    chip.run_to(start + 35_000_000);
    for (pin, width) in [(9, 1_000_000), (13, 2_000_000)] {
        let edges = chip.soc.take_edges('E', pin);
        let edges: Vec<_> = edges.iter().map(|edge| (edge.at.get() - start, edge.high)).collect();
        let expected = [(0, true), (width, false), (20_000_000, true), (20_000_000 + width, false)];
        assert_eq!(edges, expected, "{pin}");
    }
}

/// A WS2812 on PA7: widths by DMA for every period of `TIM8_CH1N`, at the request of `TIM8_UP`.
#[test]
fn colours_come_out_of_the_complementary_output() {
    const WIDTHS: u32 = 0x3000_0000;
    let wanted = [0x00FF_8001, 0x0012_3456];
    let widths = widths(&wanted);

    let mut chip = Chip::running();
    chip.write(APB2ENR, 1 << 1);
    chip.write(RCC + 0xDC, 1 << 29);
    chip.alternate(0, 7, 3);
    chip.write(TIM8 + CCMR1, 0x68);
    chip.write(TIM8 + CCER, 0b0100);
    chip.count(TIM8, 0, 299);
    chip.write(TIM8 + BDTR, MOE);
    assert!(chip.record('A', 7));
    for (address, width) in (WIDTHS..).step_by(2).zip(&widths) {
        chip.memory.write(address, &width.to_le_bytes()[..2]).unwrap();
    }
    // TIM8_UP: half words to half words, to the peripheral, TCIE.
    let control = 1 << 13 | 1 << 11 | 1 << 6 | 1 << 4 | 1;
    let count = u32::try_from(widths.len()).unwrap();
    chip.stream((1, 7), 51, [TIM8 + CCR1, WIDTHS], count, control);
    chip.write(TIM8 + DIER, 1 << 8);
    chip.set(TIM8, 1, 1);
    let start = chip.now;
    assert!(chip.until_interrupt(47, start + 1_000_000).is_some());
    chip.run_to(start + 1_000_000);
    let pulses = crate::strip::pulses(&mut chip, ('A', 7));
    assert_eq!(colours(&pulses), wanted);
    assert_eq!(chip.kinds(), []);
}
