//! DMA streams: errors, what they reach, and when they start.

use rc10_emu::peripherals::AccessKind;
use rc10_sim::Nanos;

use crate::chip::{APB2ENR, Chip, RCC};

const USART1: u32 = 0x4001_1000;
const RDR: u32 = USART1 + 0x24;
const AHB2ENR: u32 = RCC + 0xDC;
const DMA2: u32 = 0x4002_0400;
/// Stream 0.
const CR: u32 = DMA2 + 0x10;
const NDTR: u32 = DMA2 + 0x14;
const CIRCULAR: u32 = 1 << 8;
const SRAM1: u32 = 0x3000_0000;
/// TCIE, HTIE, TEIE.
const INTERRUPTS: u32 = 0b11100;

/// USART1's bytes go into eight bytes by DMA2's stream 0.
fn receiver(memory: u32, control: u32) -> Chip {
    let mut chip = Chip::running();
    chip.write(APB2ENR, 1 << 4);
    chip.alternate(1, 7, 7);
    chip.write(USART1 + 0x0C, 1200);
    chip.write(USART1 + 0x08, 1 << 6);
    chip.write(USART1, 0b101);
    chip.stream((2, 0), 41, [RDR, memory], 8, INTERRUPTS | control | 1);
    chip
}

fn feed(chip: &mut Chip, bytes: &[u8]) {
    assert!(chip.soc.feed_serial(1, bytes, 100_000, 10, Nanos::new(chip.now)));
    chip.run_to(chip.now + 100_000 * bytes.len() as u64);
}

#[test]
fn what_remains_can_be_read_while_it_runs() {
    let mut chip = receiver(0x2400_0000, CIRCULAR);
    for remaining in [7, 6, 5, 4, 3, 2, 1, 8, 7] {
        feed(&mut chip, &[1]);
        assert_eq!(chip.read(NDTR), remaining);
    }
}

#[test]
fn an_injected_error_switches_the_stream_off() {
    let mut chip = receiver(0x2400_0000, CIRCULAR);
    feed(&mut chip, &[1, 2]);
    assert!(chip.soc.inject_dma_error(2, 0));
    assert!(!chip.interrupt(56));
    feed(&mut chip, &[3]);
    assert!(chip.interrupt(56));
    assert_eq!((chip.read(DMA2) & 0x3D, chip.read(CR) & 1), (1 << 3, 0));
    assert_eq!(chip.read(NDTR), 6);
    // It is not switched on again while its flag stands.
    chip.set(CR, 1, 1);
    assert_eq!((chip.read(CR) & 1, chip.kinds()), (0, vec![AccessKind::Protected]));
    chip.write(DMA2 + 0x08, 0x3D);
    chip.write(NDTR, 8);
    chip.set(CR, 1, 1);
    feed(&mut chip, &[4]);
    assert_eq!(chip.read(CR) & 1, 1);
    for (dma, stream) in [(0, 0), (3, 0), (1, 8)] {
        assert!(!chip.soc.inject_dma_error(dma, stream));
    }
}

#[test]
fn enabled_again_it_starts_with_as_many() {
    let mut chip = receiver(0x2400_0000, 0);
    feed(&mut chip, &[1; 8]);
    assert_eq!((chip.read(NDTR), chip.read(CR) & 1), (0, 0));
    chip.write(DMA2 + 0x08, 0x3D);
    chip.set(CR, 1, 1);
    assert_eq!((chip.read(NDTR), chip.kinds()), (8, vec![]));
}

#[test]
fn a_memory_without_clock_does_not_answer() {
    let mut chip = receiver(SRAM1, 0);
    feed(&mut chip, &[1]);
    assert_eq!(chip.read(DMA2) & 0x3D, 1 << 3);
    assert_eq!(chip.kinds(), [AccessKind::Gated]);

    let mut chip = receiver(SRAM1, 0);
    chip.set(AHB2ENR, 1 << 29, 1 << 29);
    feed(&mut chip, &[0x5A]);
    assert_eq!(chip.memory.word(SRAM1).unwrap() & 0xFF, 0x5A);
    // SRAM2's clock is another one.
    let mut chip = receiver(SRAM1 + 0x4000, 0);
    chip.set(AHB2ENR, 1 << 29, 1 << 29);
    feed(&mut chip, &[1]);
    assert_eq!(chip.read(DMA2) & 0x3D, 1 << 3);
}

const TRBUFF: u32 = 1 << 20;
const USART2: u32 = 0x4000_4400;
/// Stream 1.
const OTHER_STREAM: u32 = 0x28;

/// As `receiver`, and USART2's bytes go by stream 1 of a DMA; both without TRBUFF unless told.
fn two_receivers(first: u32, second: u32, second_dma: u32) -> Chip {
    let mut chip = receiver(0x2400_0000, CIRCULAR | first);
    chip.write(crate::chip::APB1LENR, 1 << 17);
    chip.alternate(0, 3, 7);
    chip.write(USART2 + 0x0C, 1200);
    chip.write(USART2 + 0x08, 1 << 6);
    chip.write(USART2, 0b101);
    let ends = [USART2 + 0x24, 0x2400_0100];
    chip.stream((second_dma, 1), 43, ends, 8, CIRCULAR | second | 1);
    chip
}

/// One byte for both UARTs, at one time.
fn feed_both(chip: &mut Chip) {
    let now = Nanos::new(chip.now);
    for uart in [1, 2] {
        assert!(chip.soc.feed_serial(uart, &[7], 100_000, 10, now));
    }
    chip.run_to(chip.now + 100_000);
}

/// STM32H7 errata: "DMA stream locked when transferring data to/from USART/UART".
#[test]
fn a_uart_without_trbuff_locks_its_stream_when_another_one_moves() {
    // Set for both: no harm. On another DMA: no harm either.
    for mut chip in [two_receivers(TRBUFF, TRBUFF, 2), two_receivers(0, 0, 1)] {
        feed_both(&mut chip);
        feed_both(&mut chip);
        assert_eq!((chip.read(NDTR), chip.kinds()), (6, vec![]));
    }
    let mut chip = two_receivers(0, TRBUFF, 2);
    // Alone it works, so the mistake is not seen.
    feed(&mut chip, &[1]);
    assert_eq!((chip.read(NDTR), chip.kinds()), (7, vec![]));
    chip.now += 1000;
    feed_both(&mut chip);
    feed(&mut chip, &[2, 3]);
    // Enabled, without an error, and it moves nothing more. It is told once.
    assert_eq!((chip.read(NDTR), chip.read(CR) & 1, chip.read(DMA2) & 0x3D), (7, 1, 0));
    assert_eq!(chip.read(DMA2 + OTHER_STREAM + 0x04), 7, "the other one goes on");
    let reports = chip.soc.take_reports();
    assert_eq!(reports.len(), 1);
    assert!(reports[0].to_string().contains("without TRBUFF"), "{}", reports[0]);
    // Switched off and on again it works until the next time.
    chip.set(CR, 1, 0);
    chip.write(DMA2 + 0x08, 0x3D);
    chip.write(USART1 + 0x20, 0xF);
    chip.set(CR, 1, 1);
    let before = chip.read(NDTR);
    feed(&mut chip, &[4]);
    assert_eq!(chip.read(NDTR), before - 1);
}

/// FCR: DMDIS, and a threshold of a quarter, four bytes.
const FCR: u32 = CR + 0x14;
const FIFO_MODE: u32 = 1 << 2;

#[test]
fn with_its_fifo_ndtr_runs_ahead_of_memory() {
    let mut chip = receiver(0x2400_0000, CIRCULAR);
    assert_eq!(chip.read(FCR), 0x21);
    chip.set(CR, 1, 0);
    chip.write(DMA2 + 0x08, 0x3D);
    chip.write(NDTR, 8);
    chip.write(FCR, FIFO_MODE);
    chip.set(CR, 1, 1);
    let memory = |chip: &Chip| chip.memory.word(0x2400_0000).unwrap();
    let before = memory(&chip);
    feed(&mut chip, &[1, 2, 3]);
    assert_eq!((chip.read(NDTR), memory(&chip)), (5, before), "counted, and not there");
    assert_eq!(chip.read(FCR) >> 3 & 7, 0, "less than a quarter");
    feed(&mut chip, &[4]);
    assert_eq!((chip.read(NDTR), memory(&chip)), (4, 0x0403_0201));
    assert_eq!(chip.read(FCR) >> 3 & 7, 4, "empty");
    // The rest goes to memory when the stream is switched off.
    feed(&mut chip, &[5]);
    let second = |chip: &Chip| chip.memory.word(0x2400_0004).unwrap() & 0xFF;
    assert_ne!(second(&chip), 5);
    chip.set(CR, 1, 0);
    assert_eq!(second(&chip), 5);
    // FCR is locked while the stream runs.
    chip.write(DMA2 + 0x08, 0x3D);
    chip.set(CR, 1, 1);
    chip.write(FCR, 0);
    assert_eq!(chip.kinds(), [AccessKind::Protected]);
}

/// The end of the buffer is written even if the FIFO is not at its threshold.
#[test]
fn with_its_fifo_a_transfer_ends_in_memory() {
    let mut chip = receiver(0x2400_0000, 0);
    chip.set(CR, 1, 0);
    chip.write(DMA2 + 0x08, 0x3D);
    chip.write(NDTR, 3);
    chip.write(FCR, FIFO_MODE | 0b11);
    chip.set(CR, 1, 1);
    feed(&mut chip, &[1, 2, 3]);
    assert_eq!(chip.memory.word(0x2400_0000).unwrap() & 0xFF_FFFF, 0x03_0201);
    assert_eq!(chip.read(DMA2) & 0x20, 0x20, "complete");
}

#[test]
fn with_its_fifo_memory_is_read_ahead() {
    for (fifo, sent) in [(FIFO_MODE, [1, 2, 3]), (0, [1, 8, 9])] {
        let mut chip = receiver(0x2400_0000, CIRCULAR);
        chip.set(CR, 1, 0);
        chip.write(DMA2 + 0x08, 0x3D);
        // TE, and DMAT: USART1 sends.
        chip.alternate(1, 6, 7);
        chip.write(USART1, 0b1001);
        chip.write(USART1 + 0x08, 1 << 7);
        chip.write(0x4002_0820, 42);
        chip.memory.write(0x2400_0000, &[1, 2, 3]).unwrap();
        chip.write(NDTR, 3);
        chip.write(CR + 0x08, USART1 + 0x28);
        chip.write(FCR, fifo);
        // Before the UART asks for its third byte, the buffer is changed.
        chip.write(CR, 1 << 10 | 1 << 6 | TRBUFF);
        chip.write(USART1 + 0x08, 0);
        chip.set(CR, 1, 1);
        let old = chip.memory.word(0x2400_0000).unwrap() & 0xFF;
        assert_eq!(old, 1);
        chip.memory.write(0x2400_0001, &[8, 9]).unwrap();
        chip.write(USART1 + 0x08, 1 << 7);
        chip.run_to(chip.now + 400_000);
        let values: Vec<_> = chip.soc.take_sent().iter().map(|byte| byte.value).collect();
        assert_eq!(values, sent, "{fifo}");
    }
}
