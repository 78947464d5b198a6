//! DMA streams: errors, what they reach, and when they start.

use rc10_emu::peripherals::AccessKind;
use rc10_sim::Nanos;

use crate::chip::{AHB1ENR, APB2ENR, Chip, RCC};

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
    chip.write(AHB1ENR, 2);
    chip.alternate(1, 7, 7);
    chip.write(USART1 + 0x0C, 1200);
    chip.write(USART1 + 0x08, 1 << 6);
    chip.write(USART1, 0b101);
    chip.write(0x4002_0820, 41);
    chip.write(NDTR, 8);
    chip.write(CR + 0x08, RDR);
    chip.write(CR + 0x0C, memory);
    chip.write(CR, 1 << 10 | INTERRUPTS | control);
    chip.set(CR, 1, 1);
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
