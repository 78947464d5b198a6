//! SPI as embassy-stm32 0.6 drives it, with devices.

use std::sync::{Arc, Mutex};

use rc10_emu::peripherals::{AccessKind, SpiDevice, Width};
use rc10_sim::Nanos;

use crate::chip::{APB2ENR, Chip};

/// SPI1 on PA5, PA6, PA7; a device selected by PC4, another by PC5.
const SPI1: u32 = 0x4001_3000;
const CR1: u32 = SPI1;
const CR2: u32 = SPI1 + 0x04;
const CFG1: u32 = SPI1 + 0x08;
const CFG2: u32 = SPI1 + 0x0C;
const SR: u32 = SPI1 + 0x14;
const IFCR: u32 = SPI1 + 0x18;
const TXDR: u32 = SPI1 + 0x20;
const RXDR: u32 = SPI1 + 0x30;
const PORT_C: u32 = 0x5802_0800;

const SPE: u32 = 1;
const CSTART: u32 = 1 << 9;
const RXP: u32 = 1;
const EOT: u32 = 1 << 3;
const OVR: u32 = 1 << 6;
const TXC: u32 = 1 << 12;
/// SSM, MASTER, SSOE.
const MASTER: u32 = 1 << 26 | 1 << 22 | 1 << 29;
/// 120 MHz / 16: 7.5 MHz; frames of eight bits, 1066 2/3 ns.
const EIGHT_BITS: u32 = 3 << 28 | 7;

/// Registers: an address with bit 7 to read, then bytes.
struct State {
    registers: [u8; 128],
    address: Option<u8>,
    transactions: u32,
    ended: u32,
}

#[derive(Clone)]
struct Registers(Arc<Mutex<State>>);

impl Default for Registers {
    fn default() -> Self {
        let state = State { registers: [0; 128], address: None, transactions: 0, ended: 0 };
        Self(Arc::new(Mutex::new(state)))
    }
}

impl SpiDevice for Registers {
    fn understands(&self, mode: u8, clock_hz: u64) -> bool {
        (mode == 0 || mode == 3) && clock_hz <= 10_000_000
    }

    fn select(&mut self, _now: Nanos) {
        let mut state = self.0.lock().unwrap();
        state.transactions += 1;
        state.address = None;
    }

    fn deselect(&mut self, _now: Nanos) {
        self.0.lock().unwrap().ended += 1;
    }

    fn exchange(&mut self, sent: u16, _now: Nanos) -> u16 {
        let state = &mut *self.0.lock().unwrap();
        let [sent, _] = sent.to_le_bytes();
        let Some(address) = state.address else {
            state.address = Some(sent);
            return 0xFF;
        };
        let register = &mut state.registers[usize::from(address & 0x7F)];
        let answer = *register;
        if address & 0x80 == 0 {
            *register = sent;
        }
        state.address = Some(address & 0x80 | address.wrapping_add(1) & 0x7F);
        answer.into()
    }
}

fn spi(cfg2: u32) -> (Chip, Registers) {
    let mut chip = Chip::with_pll1_q(4);
    chip.write(APB2ENR, 1 << 12);
    [5, 6, 7].iter().for_each(|&pin| chip.alternate(0, pin, 5));
    chip.set(crate::chip::AHB4ENR, 1 << 2, 1 << 2);
    chip.write(PORT_C + 0x18, 0b11 << 4);
    chip.set(PORT_C, 0xF << 8, 0b0101 << 8);
    let device = Registers::default();
    device.0.lock().unwrap().registers[0x10] = 0x1E;
    assert!(chip.soc.attach_spi(1, ('C', 4), Box::new(device.clone())));
    chip.write(CFG2, MASTER | cfg2);
    chip.write(CFG1, EIGHT_BITS);
    (chip, device)
}

fn select(chip: &mut Chip, low: bool) {
    chip.write(PORT_C + 0x18, if low { 1 << 20 } else { 1 << 4 });
}

fn send(chip: &mut Chip, byte: u8) {
    chip.soc.write(TXDR, Width::Byte, byte.into(), Nanos::new(chip.now)).unwrap();
}

fn take(chip: &mut Chip) -> u8 {
    chip.soc.read(RXDR, Width::Byte, Nanos::new(chip.now)).unwrap().try_into().unwrap()
}

/// As embassy's blocking transfer does it, byte by byte.
fn exchange(chip: &mut Chip, bytes: &[u8]) -> Vec<u8> {
    chip.write(CR1, SPE);
    select(chip, true);
    let answers = bytes.iter().map(|&byte| {
        chip.wait(SR, 1 << 1);
        send(chip, byte);
        chip.set(CR1, CSTART, CSTART);
        chip.wait(SR, RXP);
        take(chip)
    });
    let answers = answers.collect();
    select(chip, false);
    chip.write(CR1, 0);
    answers
}

#[test]
fn a_device_is_read_and_written() {
    let (mut chip, device) = spi(0);
    assert_eq!(exchange(&mut chip, &[0x90, 0, 0]), [0xFF, 0x1E, 0]);
    exchange(&mut chip, &[0x20, 0xAB, 0xCD]);
    assert_eq!(exchange(&mut chip, &[0xA0, 0, 0])[1..], [0xAB, 0xCD]);
    let state = device.0.lock().unwrap();
    assert_eq!((state.transactions, state.ended), (3, 3));
    assert_eq!(chip.kinds(), []);
}

#[test]
fn a_frame_takes_its_bits() {
    let (mut chip, _) = spi(0);
    chip.write(CR1, SPE);
    send(&mut chip, 1);
    let start = chip.now;
    assert_eq!(chip.read(SR) & TXC, 0);
    chip.run_to(start + 10_000);
    assert_eq!(chip.read(SR) & RXP, 0, "not started");
    chip.write(CR1, SPE | CSTART);
    let start = chip.now;
    chip.run_to(start + 1_066);
    assert_eq!(chip.read(SR) & (RXP | TXC), 0);
    chip.run_to(start + 1_067);
    assert_eq!(chip.read(SR) & (RXP | TXC), RXP | TXC);
}

#[test]
fn without_its_pins_its_select_its_mode_or_its_speed_a_device_is_silent() {
    let ask = |chip: &mut Chip| exchange(chip, &[0x90, 0])[1];
    // MISO, then SCK, without their alternate function.
    for pin in [6, 5] {
        let (mut chip, _) = spi(0);
        chip.alternate(0, pin, 0);
        assert_eq!(ask(&mut chip), 0);
    }
    let (mut chip, _) = spi(0);
    chip.write(PORT_C, 0xFFFF_FFFF);
    assert_eq!(ask(&mut chip), 0, "the select pin is no output");
    // CPHA alone is mode 1; both are mode 3.
    let (mut chip, device) = spi(1 << 24);
    assert_ne!(ask(&mut chip), 0x1E);
    assert_eq!(device.0.lock().unwrap().address, None);
    let (mut chip, _) = spi(3 << 24);
    assert_eq!(ask(&mut chip), 0x1E);
    // 15 MHz.
    let (mut chip, _) = spi(0);
    chip.write(CFG1, 2 << 28 | 7);
    assert_ne!(ask(&mut chip), 0x1E);
    // Least significant bit first: 0x09 is 0x90.
    let (mut chip, _) = spi(1 << 23);
    assert_eq!(exchange(&mut chip, &[0x09, 0])[1], 0x1E_u8.reverse_bits());
}

const SENT: u32 = 0x2400_0000;
const ANSWER: u32 = 0x2400_0100;

/// The order of embassy's transfer with DMA.
#[test]
fn dma_exchanges() {
    let (mut chip, _) = spi(0);
    let mut long = vec![0x90];
    long.resize(40, 0);
    chip.memory.write(SENT, &long).unwrap();
    select(&mut chip, true);
    chip.set(CFG1, 1 << 14, 1 << 14);
    chip.stream((2, 4), 37, [RXDR, ANSWER], 40, 1 << 4 | 1);
    chip.stream((2, 5), 38, [TXDR, SENT], 40, 1 << 6 | 1 << 4 | 1);
    chip.set(CFG1, 1 << 15, 1 << 15);
    chip.write(CR1, SPE);
    let start = chip.now;
    chip.set(CR1, CSTART, CSTART);
    assert!(chip.until_interrupt(60, u64::MAX).is_some());
    assert_eq!(chip.now, start + 40 * 1_067);
    let mut answer = [0; 3];
    chip.memory.read(ANSWER, &mut answer).unwrap();
    assert_eq!(answer, [0xFF, 0x1E, 0]);
    assert_eq!(chip.read(SR) & (TXC | OVR), TXC);
    chip.write(CR1, 0);
    assert_eq!(chip.kinds(), []);
}

/// As embassy's read with DMA does it: receiver mode, a size, the end of the transfer.
#[test]
fn dma_reads_a_size() {
    let (mut chip, device) = spi(0);
    device.0.lock().unwrap().address = Some(0x90);
    chip.write(CFG2, MASTER | 2 << 17);
    chip.set(CFG1, 1 << 14, 1 << 14);
    chip.stream((2, 4), 37, [RXDR, ANSWER], 3, 1 << 4 | 1);
    chip.write(CR2, 3);
    chip.write(CR1, SPE);
    select(&mut chip, true);
    device.0.lock().unwrap().address = Some(0x90);
    chip.set(CR1, CSTART, CSTART);
    assert!(chip.until_interrupt(60, u64::MAX).is_some());
    assert_eq!((chip.read(SR) & EOT, chip.read(CR1) & CSTART), (EOT, 0));
    chip.run_to(chip.now + 100_000);
    assert_eq!(chip.memory.word(ANSWER).unwrap() & 0xFF, 0x1E);
    chip.write(IFCR, EOT);
    assert_eq!(chip.read(SR) & EOT, 0);
}

/// Under one chip select. A transfer without a size has clocked on before the next one begins.
#[test]
fn an_answer_is_shifted_in_a_second_transfer_and_right_in_one() {
    let (mut chip, _) = spi(0);
    select(&mut chip, true);
    chip.write(CR1, SPE);
    send(&mut chip, 0x90);
    chip.set(CR1, CSTART, CSTART);
    chip.wait(SR, RXP);
    chip.write(CR1, 0);
    // As embassy's read does it.
    chip.write(CFG2, MASTER | 2 << 17);
    chip.write(CR2, 2);
    chip.write(CR1, SPE);
    chip.set(CR1, CSTART, CSTART);
    chip.wait(SR, EOT);
    let answer = take(&mut chip);
    assert_eq!(answer, 0x1E << 3);
    chip.write(IFCR, EOT);
    chip.write(CR1, 0);
    chip.write(CR2, 0);
    chip.write(CFG2, MASTER);
    // Its select rises, and it counts anew.
    select(&mut chip, false);
    assert_eq!(exchange(&mut chip, &[0x90, 0]), [0xFF, 0x1E]);
    // With a size nothing comes behind the last frame.
    select(&mut chip, true);
    for byte in [0x90, 0] {
        chip.write(CR2, 1);
        chip.write(CR1, SPE);
        send(&mut chip, byte);
        chip.set(CR1, CSTART, CSTART);
        chip.wait(SR, EOT);
        let answer = take(&mut chip);
        assert_eq!(answer, if byte == 0 { 0x1E } else { 0xFF });
        chip.write(IFCR, EOT);
        chip.write(CR1, 0);
    }
    assert_eq!(chip.kinds(), []);
}

#[test]
fn an_answer_that_is_not_taken_overruns() {
    let (mut chip, _) = spi(0);
    chip.write(CR1, SPE);
    chip.set(CR1, CSTART, CSTART);
    for _ in 0..17 {
        send(&mut chip, 0);
        chip.run_to(chip.now + 1_067);
    }
    assert_eq!(chip.read(SR) & (OVR | RXP), OVR | RXP);
    chip.write(CR1, 0);
    chip.write(CR1, SPE);
    assert_eq!(chip.read(SR) & (OVR | RXP), 0);
}

#[test]
fn frames_are_packed_into_words() {
    let (mut chip, device) = spi(0);
    chip.write(CR1, SPE);
    select(&mut chip, true);
    chip.set(CR1, CSTART, CSTART);
    chip.write(TXDR, 0x0000_0090);
    chip.run_to(chip.now + 10_000);
    assert_eq!(chip.read(SR) >> 15 & 1, 1, "RXWNE");
    assert_eq!(chip.read(RXDR), 0x0000_1EFF);
    // Sixteen bits are one frame.
    chip.write(CR1, 0);
    select(&mut chip, false);
    select(&mut chip, true);
    chip.write(CFG1, 3 << 28 | 15);
    device.0.lock().unwrap().address = Some(0x90);
    chip.write(CR1, SPE);
    chip.soc.write(TXDR, Width::Half, 0xABCD, Nanos::new(chip.now)).unwrap();
    chip.set(CR1, CSTART, CSTART);
    chip.run_to(chip.now + 10_000);
    assert_eq!(chip.soc.read(RXDR, Width::Half, Nanos::new(chip.now)), Ok(0x1E));
}

#[test]
fn what_is_locked_or_not_modelled_says_so() {
    let (mut chip, _) = spi(0);
    chip.write(CR1, SPE);
    chip.write(CFG1, EIGHT_BITS | 1 << 28 << 2);
    chip.write(CFG2, MASTER | 1 << 24);
    assert_eq!((chip.read(CFG1), chip.read(CFG2)), (EIGHT_BITS, MASTER));
    assert_eq!(chip.kinds(), [AccessKind::Protected; 2]);
    chip.write(CR1, 0);
    send(&mut chip, 1);
    assert_eq!(chip.kinds(), [AccessKind::Protected]);
    chip.write(CFG2, 0);
    chip.write(CR1, SPE);
    assert_eq!(chip.kinds(), [AccessKind::Unmodelled], "a slave");
    assert!(!chip.soc.attach_spi(6, ('C', 4), Box::new(Registers::default())));
}
