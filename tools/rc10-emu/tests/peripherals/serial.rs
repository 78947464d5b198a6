use rc10_emu::peripherals::AccessKind;
use rc10_sim::Nanos;

use crate::chip::{APB2ENR, Chip};

const USART1: u32 = 0x4001_1000;
const CR1: u32 = USART1;
const CR2: u32 = USART1 + 0x04;
const CR3: u32 = USART1 + 0x08;
const BRR: u32 = USART1 + 0x0C;
const ISR: u32 = USART1 + 0x1C;
const ICR: u32 = USART1 + 0x20;
const RDR: u32 = USART1 + 0x24;
const TDR: u32 = USART1 + 0x28;
const DMA1: u32 = 0x4002_0000;
/// AXI SRAM.
const BUFFER: u32 = 0x2400_0000;

const UE_RE_TE: u32 = 0b1101;
const FIFOEN: u32 = 1 << 29;

/// USART1 on PB6, PB7 at 115385 baud: 1040 clocks of 120 MHz, 8667 ns a bit.
fn usart(cr1: u32) -> Chip {
    let mut chip = Chip::running();
    chip.write(APB2ENR, 1 << 4);
    chip.alternate(1, 6, 7);
    chip.alternate(1, 7, 7);
    chip.write(BRR, 1040);
    chip.write(CR1, cr1 | UE_RE_TE);
    chip
}

const BYTE: u64 = 1040 * 10 * 25 / 3;

#[test]
fn a_byte_takes_ten_bits() {
    let mut chip = usart(0);
    let start = chip.now;
    assert_eq!(chip.read(ISR) & 0xC0, 0xC0);
    chip.write(TDR, 0x55);
    chip.write(TDR, 0xAA);
    assert_eq!(chip.read(ISR) & 0xC0, 0, "one is sent, one waits");
    chip.run_to(start + BYTE);
    assert!(chip.soc.take_sent().is_empty());
    chip.run_to(start + BYTE + 1);
    assert_eq!(chip.read(ISR) & 0xC0, 0x80);
    let sent = chip.soc.take_sent();
    assert_eq!((sent[0].uart, sent[0].value), (1, 0x55));
    assert_eq!(sent[0].end.get(), start + BYTE + 1, "86666 2/3 ns, rounded up");
    chip.run_to(start + 3 * BYTE);
    assert_eq!(chip.read(ISR) & 0xC0, 0xC0);
    assert_eq!(chip.soc.take_sent()[0].value, 0xAA);
}

#[test]
fn parity_stop_bits_and_oversampling_change_the_length() {
    // 8 data bits, even parity, two stop bits: 12 bits.
    let mut chip = usart(0);
    chip.write(CR1, 0);
    chip.write(CR2, 2 << 12);
    chip.write(CR1, 1 << 12 | 1 << 10 | UE_RE_TE);
    let start = chip.now;
    chip.write(TDR, 0x1FF);
    chip.run_to(start + 1_000_000);
    let sent = chip.soc.take_sent();
    assert_eq!((sent[0].end.get() - start, sent[0].value), (1040 * 12 * 25 / 3, 0xFF));

    // Oversampling by 8: BRR = 0x1040 holds 2 x 0x104 / 2... of twice the rate: 0x1040 / 2 clocks.
    let mut chip = usart(0);
    chip.write(CR1, 0);
    chip.write(BRR, 0x1040);
    chip.write(CR1, 1 << 15 | UE_RE_TE);
    let start = chip.now;
    chip.write(TDR, 1);
    chip.run_to(start + 1_000_000);
    let sent = chip.soc.take_sent();
    assert_eq!(sent[0].end.get() - start, (0x1040_u64 / 2 * 10 * 25).div_ceil(3));
}

#[test]
fn a_transmitter_without_its_pin_is_not_heard() {
    let mut chip = usart(0);
    chip.alternate(1, 6, 8);
    chip.write(TDR, 1);
    chip.run_to(chip.now + 1_000_000);
    assert!(chip.soc.take_sent().is_empty());
    assert_eq!(chip.read(ISR) >> 6 & 1, 1);
}

#[test]
fn bytes_come_in_and_an_unread_one_overruns() {
    let mut chip = usart(1 << 5 | 1 << 4);
    let start = chip.now;
    assert!(chip.soc.feed_serial(1, &[1, 2], 115_385, 10, Nanos::new(start)));
    let byte = 10 * 1_000_000_000 / 115_385;
    // The stop bit's tenth sample of sixteen: 9 bits and 10/16 of 8667 ns.
    assert_eq!(chip.until_interrupt(37, u64::MAX), Some(start + 83_417));
    assert_eq!(chip.read(ISR) & 0x3F, 0x20);
    assert_eq!((chip.read(RDR), chip.interrupt(37)), (1, false));
    assert!(chip.soc.feed_serial(1, &[3], 115_385, 10, Nanos::new(start + 2 * byte + 2)));
    chip.run_to(start + 4 * byte);
    assert_eq!(chip.read(ISR) & 0x28, 0x28);
    assert_eq!(chip.read(RDR), 2);
    chip.write(ICR, 1 << 3);
    assert!(!chip.interrupt(37));
    // A frame's time of silence.
    chip.run_to(start + 4 * byte + 1_000);
    assert_eq!(chip.read(ISR) & 0x10, 0x10);
    assert!(chip.interrupt(37));
    chip.write(ICR, 1 << 4);
    assert!(!chip.interrupt(37));
}

#[test]
fn a_fifo_holds_sixteen() {
    let mut chip = usart(FIFOEN);
    assert!(chip.soc.feed_serial(1, &[7; 17], 115_385, 10, Nanos::new(chip.now)));
    chip.run_to(chip.now + 16 * 86_700);
    assert_eq!(chip.read(ISR) & (1 << 3 | 1 << 24), 1 << 24);
    chip.run_to(chip.now + 86_700);
    assert_eq!(chip.read(ISR) >> 3 & 1, 1);
    for _ in 0..16 {
        assert_eq!(chip.read(RDR), 7);
    }
    assert_eq!(chip.read(ISR) >> 5 & 1, 0);
    for byte in 0..17 {
        chip.write(TDR, byte);
    }
    // One is being sent, sixteen wait.
    assert_eq!(chip.read(ISR) >> 7 & 1, 0);
    chip.run_to(chip.now + 18 * BYTE);
    assert_eq!(chip.soc.take_sent().len(), 17);
}

#[test]
fn another_baud_rate_is_a_framing_error() {
    let mut chip = usart(0);
    assert!(chip.soc.feed_serial(1, &[7], 112_000, 10, Nanos::new(chip.now)));
    chip.run_to(chip.now + 1_000_000);
    assert_eq!((chip.read(ISR) >> 1 & 1, chip.read(RDR)), (0, 7));
    assert!(chip.soc.feed_serial(1, &[7], 100_000, 10, Nanos::new(chip.now)));
    chip.run_to(chip.now + 1_000_000);
    assert_eq!(chip.read(ISR) >> 1 & 1, 1);
    assert!(!chip.soc.feed_serial(11, &[7], 100_000, 10, Nanos::new(chip.now)));
    assert!(!chip.soc.feed_serial(1, &[7], 0, 10, Nanos::new(chip.now)));
}

#[test]
fn the_baud_rate_is_locked_while_it_runs() {
    let mut chip = usart(0);
    chip.write(BRR, 16);
    assert_eq!((chip.read(BRR), chip.kinds()), (1040, vec![AccessKind::Protected]));
}

/// DMA1 stream `n`, byte to byte: EGE of its request; TCIE, HTIE, TEIE, EN.
fn stream(chip: &mut Chip, n: u32, request: u32, ends: [u32; 2], control: u32, count: u32) {
    chip.stream((1, n), request | 1 << 9, ends, count, 0b11101 | control);
}

#[test]
fn dma_sends() {
    let mut chip = usart(0);
    chip.memory.write(BUFFER, b"hello!").unwrap();
    chip.write(CR3, 1 << 7);
    let start = chip.now;
    stream(&mut chip, 0, 42, [TDR, BUFFER], 1 << 6, 6);
    // Two bytes at once: one is sent, one waits.
    assert_eq!(chip.read(DMA1 + 0x14), 4);
    assert_eq!(chip.until_interrupt(11, u64::MAX), Some(start + BYTE + 1), "half");
    chip.run_to(start + 7 * BYTE);
    let sent: Vec<_> = chip.soc.take_sent().iter().map(|byte| byte.value).collect();
    assert_eq!(sent, b"hello!".map(u16::from));
    assert_eq!(chip.read(DMA1) & 0x3D, 0x30);
    assert_eq!(chip.read(DMA1 + 0x10) & 1, 0);
    chip.write(DMA1 + 0x08, 0x3D);
    assert!(!chip.interrupt(11));
}

#[test]
fn dma_receives_in_circles() {
    let mut chip = usart(0);
    chip.write(CR3, 1 << 6);
    stream(&mut chip, 5, 41, [RDR, BUFFER], 1 << 8, 4);
    assert!(chip.soc.feed_serial(1, &[1, 2, 3, 4, 5, 6], 115_385, 10, Nanos::new(chip.now)));
    chip.until_interrupt(16, u64::MAX).unwrap();
    assert_eq!(chip.read(DMA1 + 0x04) >> 6 & 0x3D, 0x10);
    chip.run_to(chip.now + 1_000_000);
    assert_eq!(chip.read(DMA1 + 0x04) >> 6 & 0x3D, 0x30);
    assert_eq!(chip.memory.word(BUFFER).unwrap(), 0x0403_0605);
    assert_eq!(chip.read(DMA1 + 0x10 + 0x18 * 5 + 4), 2);
    assert_eq!(chip.read(ISR) >> 3 & 1, 0);
}

#[test]
fn dma_refuses_the_cores_own_memories_and_the_flash() {
    for memory in [0x2000_0000, 0x2001_FFFF, 0x0000_0000, 0x0800_0000, 0x1000_0000] {
        let mut chip = usart(0);
        chip.write(CR3, 1 << 6);
        stream(&mut chip, 1, 41, [RDR, memory], 0, 4);
        assert!(chip.soc.feed_serial(1, &[1], 115_385, 10, Nanos::new(chip.now)));
        chip.until_interrupt(12, u64::MAX).unwrap();
        assert_eq!(chip.read(DMA1) >> 6 & 0x3D, 0x08, "transfer error at {memory:#x}");
        assert_eq!(chip.read(DMA1 + 0x28) & 1, 0, "disabled");
        assert_eq!(chip.kinds(), [AccessKind::OutOfReach], "{memory:#x}");
    }
    let mut chip = usart(0);
    chip.write(CR3, 1 << 7);
    stream(&mut chip, 1, 42, [TDR, 0x2000_0000], 1 << 6, 4);
    assert_eq!(chip.read(DMA1) >> 6 & 0x3D, 0x08);
    assert_eq!(
        (chip.kinds(), chip.soc.count(AccessKind::OutOfReach)),
        (vec![AccessKind::OutOfReach], 1)
    );
    // Constants lie in the flash.
    let mut chip = usart(0);
    chip.write(CR3, 1 << 7);
    stream(&mut chip, 1, 42, [TDR, 0x0800_0000], 1 << 6, 1);
    assert_eq!((chip.read(DMA1) >> 6 & 0x3D, chip.kinds()), (0x20, vec![]));
}

#[test]
fn dma_copies_memory() {
    let mut chip = usart(0);
    chip.memory.write(BUFFER, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
    // From the "peripheral" address, both count, words.
    stream(&mut chip, 0, 0, [BUFFER, BUFFER + 0x100], 2 << 6 | 1 << 9 | 2 << 11 | 2 << 13, 2);
    let mut copy = [0; 8];
    chip.memory.read(BUFFER + 0x100, &mut copy).unwrap();
    assert_eq!(copy, [1, 2, 3, 4, 5, 6, 7, 8]);
    assert!(chip.interrupt(11));
}

#[test]
fn a_stream_is_locked_while_enabled() {
    let mut chip = usart(0);
    chip.write(CR3, 1 << 6);
    stream(&mut chip, 0, 41, [RDR, BUFFER], 0, 4);
    chip.write(DMA1 + 0x14, 9);
    assert_eq!((chip.read(DMA1 + 0x14), chip.kinds()), (4, vec![AccessKind::Protected]));
    // Switched off, it tells that it has come to its end.
    chip.set(DMA1 + 0x10, 1, 0);
    assert_eq!(chip.read(DMA1) & 0x3D, 0x20);
}
