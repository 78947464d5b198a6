//! Characters in all formats, good ones and bad ones, and what the receiver makes of them.

use rc10_emu::peripherals::{AccessKind, Character, Format, Parity};
use rc10_sim::{Nanos, UartFault};

use crate::chip::{APB1LENR, Chip};

/// UART5, on PD2 for receiving and PC12 for sending.
const UART5: u32 = 0x4000_5000;
const CR1: u32 = UART5;
const CR2: u32 = UART5 + 0x04;
const CR3: u32 = UART5 + 0x08;
const BRR: u32 = UART5 + 0x0C;
const ISR: u32 = UART5 + 0x1C;
const ICR: u32 = UART5 + 0x20;
const RDR: u32 = UART5 + 0x24;
const TDR: u32 = UART5 + 0x28;

const UE_RE_TE: u32 = 0b1101;
const M0: u32 = 1 << 12;
const PCE: u32 = 1 << 10;
const PS: u32 = 1 << 9;
const TWO_STOPS: u32 = 2 << 12;
const RXINV: u32 = 1 << 16;
const TXINV: u32 = 1 << 17;
const SWAP: u32 = 1 << 15;

const PE: u32 = 1;
const FE: u32 = 1 << 1;
const NE: u32 = 1 << 2;
const ORE: u32 = 1 << 3;
const IDLE: u32 = 1 << 4;
const RXNE: u32 = 1 << 5;
const ERRORS: u32 = PE | FE | NE | ORE;

/// 10 us: 100 kbaud.
const BIT: u64 = 10_000;

fn uart(cr1: u32, cr2: u32, cr3: u32) -> Chip {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 << 20);
    chip.alternate(3, 2, 8);
    chip.alternate(2, 12, 8);
    chip.write(BRR, 1200);
    chip.write(CR2, cr2);
    chip.write(CR3, cr3);
    chip.write(CR1, cr1 | UE_RE_TE);
    chip
}

fn character(chip: &Chip, value: u16, format: Format) -> Character {
    Character::new(value, format, 100_000, Nanos::new(chip.now))
}

/// Hears one character and all the silence behind it.
fn hear_one(chip: &mut Chip, character: Character) {
    assert!(chip.soc.feed_character(5, character));
    chip.run_to(chip.now + 40 * BIT);
}

/// The same, perhaps with a fault.
fn hear(chip: &mut Chip, value: u16, format: Format, fault: impl Into<Option<UartFault>>) {
    let coming = Character { fault: fault.into(), ..character(chip, value, format) };
    hear_one(chip, coming);
}

fn errors(chip: &mut Chip) -> u32 {
    let found = chip.read(ISR) & ERRORS;
    chip.write(ICR, ERRORS);
    found
}

#[test]
fn formats_that_fit_give_the_byte() {
    for (cr1, cr2, format) in [
        (0, 0, Format::EIGHT_N_1),
        (M0 | PCE, 0, Format::EIGHT_E_1),
        (M0 | PCE, TWO_STOPS, Format::EIGHT_E_2),
        (M0 | PCE | PS, 0, Format { parity: Some(Parity::Odd), ..Format::EIGHT_E_1 }),
        (1 << 28, 0, Format { data_bits: 7, ..Format::EIGHT_N_1 }),
        (M0, TWO_STOPS, Format { data_bits: 9, half_stops: 4, ..Format::EIGHT_N_1 }),
        // Eight samples a bit.
        (M0 | PCE | 1 << 15, 0, Format::EIGHT_E_1),
    ] {
        let mut chip = uart(cr1, cr2, 0);
        if cr1 & 1 << 15 != 0 {
            chip.write(CR1, 0);
            chip.write(BRR, 0x960);
            chip.write(CR1, cr1 | UE_RE_TE);
        }
        for value in [0x00, 0x55, 0x2A, 0x7F, 0x01] {
            hear(&mut chip, value, format, None);
            assert_eq!(chip.read(ISR) & (ERRORS | RXNE), RXNE, "{format:?} {value:#x}");
            assert_eq!(chip.read(RDR) & 0x7F, u32::from(value), "{format:?}");
        }
        assert_eq!(chip.kinds(), []);
    }
}

#[test]
fn the_parity_bit_is_read_above_the_data() {
    let mut chip = uart(M0 | PCE, 0, 0);
    for (value, read) in [(0x07, 0x107), (0x03, 0x003)] {
        hear(&mut chip, value, Format::EIGHT_E_1, None);
        assert_eq!(chip.read(RDR), read);
    }
}

#[test]
fn formats_that_do_not_fit_are_errors() {
    // Even parity is expected and odd comes.
    let mut chip = uart(M0 | PCE, 0, 0);
    let odd = Format { parity: Some(Parity::Odd), ..Format::EIGHT_E_1 };
    hear(&mut chip, 0x42, odd, None);
    assert_eq!(errors(&mut chip), PE);

    // No parity is expected: the parity bit of 0x03, a zero, stands where the stop bit should.
    let mut chip = uart(0, 0, 0);
    hear(&mut chip, 0x03, Format::EIGHT_E_1, None);
    assert_eq!(errors(&mut chip), FE);

    // Parity is expected and none comes: the stop bit is taken for it, wrong for 0x03.
    let mut chip = uart(M0 | PCE, 0, 0);
    hear(&mut chip, 0x03, Format::EIGHT_N_1, None);
    assert_eq!(errors(&mut chip), PE);
}

#[test]
fn a_sender_may_be_some_per_cent_off() {
    for (baud, errors_expected) in
        [(96_500, false), (103_500, false), (94_000, true), (112_000, true), (50_000, true)]
    {
        let mut chip = uart(0, 0, 0);
        let coming = Character::new(0x55, Format::EIGHT_N_1, baud, Nanos::new(chip.now));
        hear_one(&mut chip, coming);
        let wrong = errors(&mut chip) != 0 || chip.read(RDR) != 0x55;
        assert_eq!(wrong, errors_expected, "{baud}");
    }
}

#[test]
fn an_inverted_line_needs_an_inverted_receiver() {
    let inverted =
        |chip: &Chip| Character { inverted: true, ..character(chip, 0x35, Format::EIGHT_E_2) };
    let mut chip = uart(M0 | PCE, TWO_STOPS | RXINV, 0);
    chip.soc.set_serial_idle(5, false);
    let coming = inverted(&chip);
    hear_one(&mut chip, coming);
    assert_eq!(chip.read(ISR) & (ERRORS | RXNE), RXNE);
    assert_eq!(chip.read(RDR) & 0xFF, 0x35);

    let mut chip = uart(M0 | PCE, TWO_STOPS, 0);
    chip.soc.set_serial_idle(5, false);
    let coming = inverted(&chip);
    hear_one(&mut chip, coming);
    assert_ne!(errors(&mut chip), 0);
    // The other way round, too.
    let mut chip = uart(M0 | PCE, TWO_STOPS | RXINV, 0);
    hear(&mut chip, 0x35, Format::EIGHT_E_2, None);
    assert_ne!(errors(&mut chip), 0);
}

#[test]
fn swapped_pins_are_the_other_pins() {
    let mut chip = uart(0, SWAP, 0);
    // PC12 and PD2 have changed their roles, and both lead outside.
    hear(&mut chip, 0x35, Format::EIGHT_N_1, None);
    assert_eq!(chip.read(RDR), 0x35);
    // Without the pin called TX nothing comes in.
    chip.alternate(2, 12, 0);
    hear(&mut chip, 0x36, Format::EIGHT_N_1, None);
    assert_eq!(chip.read(ISR) & RXNE, 0);
    chip.write(TDR, 0x5A);
    chip.run_to(chip.now + 20 * BIT);
    assert_eq!(chip.soc.take_sent()[0].value, 0x5A);
}

#[test]
fn faults_raise_their_flags() {
    for (fault, flag, value) in [
        (UartFault::Framing, FE, 0x42),
        (UartFault::Parity, PE, 0x142),
        (UartFault::Noise, NE, 0x042),
        (UartFault::Break, FE, 0x000),
    ] {
        let mut chip = uart(M0 | PCE, 0, 0);
        hear(&mut chip, 0x42, Format::EIGHT_E_1, fault);
        assert_eq!(errors(&mut chip) & !PE, flag & !PE, "{fault:?}");
        assert_eq!(chip.read(RDR) & 0xFF, value & 0xFF, "{fault:?}");
        // The next one is good.
        hear(&mut chip, 0x43, Format::EIGHT_E_1, None);
        assert_eq!((errors(&mut chip), chip.read(RDR) & 0xFF), (0, 0x43), "{fault:?}");
    }
}

#[test]
fn an_overrun_deafens_until_it_is_cleared() {
    let mut chip = uart(0, 0, 0);
    for value in [1, 2] {
        hear(&mut chip, value, Format::EIGHT_N_1, None);
    }
    assert_eq!((chip.read(ISR) & ORE, chip.read(RDR)), (ORE, 1), "the first stays");
    // There is room again, and yet nothing comes, and no other flag rises.
    hear(&mut chip, 3, Format::EIGHT_N_1, UartFault::Framing);
    assert_eq!(chip.read(ISR) & (ERRORS | RXNE), ORE);
    chip.write(ICR, ORE);
    hear(&mut chip, 4, Format::EIGHT_N_1, None);
    assert_eq!((chip.read(ISR) & (ERRORS | RXNE), chip.read(RDR)), (RXNE, 4));

    // With OVRDIS the newest stays instead.
    let mut chip = uart(0, 0, 1 << 12);
    for value in [1, 2] {
        hear(&mut chip, value, Format::EIGHT_N_1, None);
    }
    assert_eq!((chip.read(ISR) & ORE, chip.read(RDR)), (0, 2));
    // An injected one comes as if the byte before had not been taken.
    let mut chip = uart(0, 0, 0);
    hear(&mut chip, 1, Format::EIGHT_N_1, UartFault::Overrun);
    assert_eq!(chip.read(ISR) & (ORE | RXNE), ORE);
}

#[test]
fn idle_is_told_once_after_a_whole_frame_of_silence() {
    let mut chip = uart(0, 0, 0);
    let start = chip.now;
    chip.run_to(start + 100 * BIT);
    assert_eq!(chip.read(ISR) & IDLE, 0, "nothing was received");
    let start = chip.now;
    assert!(chip.soc.feed_serial(5, &[1, 2], 100_000, 10, Nanos::new(start)));
    chip.run_to(start + 11 * BIT);
    chip.read(RDR);
    chip.run_to(start + 30 * BIT - 1);
    assert_eq!(chip.read(ISR) & IDLE, 0);
    chip.run_to(start + 30 * BIT);
    assert_eq!(chip.read(ISR) & IDLE, IDLE);
    chip.write(ICR, IDLE);
    chip.run_to(start + 100 * BIT);
    assert_eq!(chip.read(ISR) & IDLE, 0);
}

#[test]
fn a_held_line_is_not_idle() {
    let mut chip = uart(0, 0, 0);
    let start = chip.now;
    let good = character(&chip, 1, Format::EIGHT_N_1);
    assert!(chip.soc.feed_character(5, good));
    // Held low for four characters.
    let held = Character { start: Nanos::new(start + 10 * BIT), ..good };
    let held = Character { fault: Some(UartFault::Break), bit_fs: 4 * good.bit_fs, ..held };
    assert!(chip.soc.feed_character(5, held));
    chip.run_to(start + 11 * BIT);
    assert_eq!(chip.read(RDR), 1);
    chip.run_to(start + 60 * BIT - 1);
    assert_eq!(chip.read(ISR) & (IDLE | FE), FE);
    chip.run_to(start + 60 * BIT);
    assert_eq!(chip.read(ISR) & IDLE, IDLE, "a frame after the line was let go");
}

/// DMA1's stream 2 in circles of four.
fn circle(chip: &mut Chip) {
    chip.stream((1, 2), 65, [RDR, 0x2400_0000], 4, 1 << 8 | 1);
}

fn bytes_in_circle(chip: &mut Chip) -> u32 {
    4 - chip.read(0x4002_0044)
}

#[test]
fn dma_takes_no_character_with_an_error() {
    for fault in [UartFault::Framing, UartFault::Parity, UartFault::Noise] {
        let mut chip = uart(M0 | PCE, 0, 1 << 6);
        circle(&mut chip);
        for (value, fault) in [(1, None), (2, Some(fault)), (3, None)] {
            hear(&mut chip, value, Format::EIGHT_E_1, fault);
            if fault.is_some() {
                assert_eq!(chip.read(RDR) & 0xFF, 2, "it can still be read");
            }
        }
        assert_eq!(bytes_in_circle(&mut chip), 2, "{fault:?}");
        assert_eq!(chip.memory.word(0x2400_0000).unwrap() & 0xFFFF, 0x0301);
        assert_ne!(errors(&mut chip), 0);
    }
}

#[test]
fn with_ddre_an_error_stops_the_transfers() {
    let mut chip = uart(M0 | PCE, 0, 1 << 6 | 1 << 13);
    circle(&mut chip);
    hear(&mut chip, 2, Format::EIGHT_E_1, UartFault::Noise);
    assert_eq!((chip.read(ISR) & (NE | RXNE), bytes_in_circle(&mut chip)), (NE | RXNE, 0));
    chip.write(ICR, NE);
    assert_eq!(bytes_in_circle(&mut chip), 1);
}

#[test]
fn an_overrun_stops_dma_until_it_is_cleared() {
    let mut chip = uart(0, 0, 1 << 6);
    circle(&mut chip);
    hear(&mut chip, 1, Format::EIGHT_N_1, UartFault::Overrun);
    hear(&mut chip, 2, Format::EIGHT_N_1, None);
    assert_eq!(bytes_in_circle(&mut chip), 0);
    chip.write(ICR, ORE);
    hear(&mut chip, 3, Format::EIGHT_N_1, None);
    assert_eq!(bytes_in_circle(&mut chip), 1);
    assert_eq!(chip.memory.word(0x2400_0000).unwrap() & 0xFF, 3);
}

#[test]
fn what_is_on_the_line_can_be_damaged_late() {
    let mut chip = uart(M0 | PCE, 0, 0);
    let start = chip.now;
    let coming = character(&chip, 0x42, Format::EIGHT_E_1);
    assert!(chip.soc.feed_character(5, coming));
    chip.run_to(start + 5 * BIT);
    assert!(chip.soc.disturb_serial(5, UartFault::Framing, Nanos::new(chip.now), coming));
    chip.run_to(start + 20 * BIT);
    assert_eq!((errors(&mut chip), chip.read(RDR) & 0xFF), (FE, 0x42));
    // Nothing is on the line: something comes that is damaged.
    assert!(chip.soc.disturb_serial(5, UartFault::Break, Nanos::new(chip.now), coming));
    chip.run_to(start + 40 * BIT);
    assert_ne!(errors(&mut chip) & FE, 0);
}

#[test]
fn who_is_switched_on_within_a_character_hears_something_else() {
    let mut chip = uart(0, 0, 0);
    chip.write(CR1, 0);
    let start = chip.now;
    let coming = character(&chip, 0x0F, Format::EIGHT_N_1);
    assert!(chip.soc.feed_character(5, coming));
    chip.run_to(start + 3 * BIT);
    chip.write(CR1, UE_RE_TE);
    chip.run_to(start + 40 * BIT);
    // The fall behind the fourth one looks like a start bit; zeros and the stop follow.
    assert_eq!(chip.read(ISR) & RXNE, RXNE);
    assert_ne!(chip.read(RDR), 0x0F);
}

#[test]
fn what_is_sent_is_inverted_and_locked_as_set_up() {
    let mut chip = uart(M0 | PCE, TWO_STOPS | TXINV, 0);
    for (register, value) in
        [(CR1, M0 | UE_RE_TE), (CR2, 0), (CR3, 1 << 14), (CR1, UE_RE_TE | 1 << 29)]
    {
        let before = chip.read(register);
        chip.write(register, value);
        assert_eq!(chip.read(register) & !0xF, before & !0xF, "{register:#x}");
    }
    assert_eq!(chip.kinds(), [AccessKind::Protected; 4]);
    // Bits that are not locked change.
    chip.set(CR1, 1 << 4, 1 << 4);
    chip.set(CR3, 1, 1);
    assert_eq!((chip.read(CR1) >> 4 & 1, chip.read(CR3) & 1, chip.kinds()), (1, 1, vec![]));
}
