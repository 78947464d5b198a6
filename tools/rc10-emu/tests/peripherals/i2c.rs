//! I2C as embassy-stm32 0.6 drives it, with devices.

use std::sync::{Arc, Mutex};

use rc10_emu::peripherals::{AccessKind, I2cDevice};
use rc10_sim::Nanos;

use crate::chip::{AHB4ENR, APB1LENR, Chip};

/// I2C2 on PF1 and PF0.
const I2C2: u32 = 0x4000_5800;
const CR1: u32 = I2C2;
const CR2: u32 = I2C2 + 0x04;
const TIMINGR: u32 = I2C2 + 0x10;
const ISR: u32 = I2C2 + 0x18;
const ICR: u32 = I2C2 + 0x1C;
const RXDR: u32 = I2C2 + 0x24;
const TXDR: u32 = I2C2 + 0x28;
const PORT_F: u32 = 0x5802_1400;

const START: u32 = 1 << 13;
const STOP: u32 = 1 << 14;
const RELOAD: u32 = 1 << 24;
const AUTOEND: u32 = 1 << 25;
const READ: u32 = 1 << 10;
const TXE: u32 = 1;
const TXIS: u32 = 1 << 1;
const RXNE: u32 = 1 << 2;
const NACKF: u32 = 1 << 4;
const STOPF: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TCR: u32 = 1 << 7;
const BERR: u32 = 1 << 8;
const ARLO: u32 = 1 << 9;
const BUSY: u32 = 1 << 15;

const ADDRESS: u32 = 0x1E << 1;
/// 120 MHz / 3 / (50 + 50): 400 kHz.
const TIMING: u32 = 2 << 28 | 49 << 8 | 49;
const BIT: u64 = 2_500;

#[derive(Default)]
struct State {
    log: Vec<String>,
    memory: Vec<u8>,
    refuses_byte: Option<u8>,
    stretch: u64,
}

#[derive(Clone, Default)]
struct Eeprom(Arc<Mutex<State>>);

impl I2cDevice for Eeprom {
    fn address(&self) -> u8 {
        0x1E
    }

    fn start(&mut self, reads: bool, _now: Nanos) -> bool {
        self.0.lock().unwrap().log.push(if reads { "R" } else { "W" }.into());
        true
    }

    fn write(&mut self, byte: u8, _now: Nanos) -> bool {
        let state = &mut *self.0.lock().unwrap();
        state.log.push(format!("{byte:02x}"));
        state.refuses_byte != Some(byte)
    }

    fn read(&mut self, _now: Nanos) -> u8 {
        let state = &mut *self.0.lock().unwrap();
        if state.memory.is_empty() { 0xFF } else { state.memory.remove(0) }
    }

    fn stop(&mut self, _now: Nanos) {
        self.0.lock().unwrap().log.push("P".into());
    }

    fn stretch(&self) -> Nanos {
        Nanos::new(self.0.lock().unwrap().stretch)
    }
}

fn i2c() -> (Chip, Eeprom) {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 << 22);
    [0, 1].iter().for_each(|&pin| chip.alternate(5, pin, 4));
    let device = Eeprom::default();
    assert!(chip.soc.attach_i2c(2, Box::new(device.clone())));
    chip.write(TIMINGR, TIMING);
    chip.write(CR1, 1);
    (chip, device)
}

fn log(device: &Eeprom) -> String {
    std::mem::take(&mut device.0.lock().unwrap().log).join(" ")
}

fn flags(chip: &mut Chip) -> u32 {
    chip.read(ISR) & (TXIS | RXNE | NACKF | STOPF | TC | TCR | ARLO | BUSY)
}

fn send(chip: &mut Chip, bytes: &[u8]) {
    for &byte in bytes {
        chip.wait(ISR, TXIS);
        chip.write(TXDR, byte.into());
    }
}

#[test]
fn the_pins_show_what_holds_the_bus() {
    let (mut chip, _device) = i2c();
    // Pull-ups.
    [0, 1]
        .iter()
        .for_each(|&pin| assert!(chip.soc.drive_pin('F', pin, Some(true), Nanos::new(chip.now))));
    assert_eq!(chip.read(PORT_F + 0x10) & 0b11, 0b11, "at rest");
    chip.write(CR2, ADDRESS | 1 << 16 | START);
    chip.wait(ISR, TXIS);
    assert_eq!(chip.read(PORT_F + 0x10) & 0b11, 0b01, "the clock is held until there is a byte");
    chip.write(TXDR, 0x10);
    chip.wait(ISR, TC);
    chip.write(CR2, STOP);
    assert_eq!(chip.read(PORT_F + 0x10) & 0b11, 0, "the stop is on its way");
    chip.wait(ISR, STOPF);
    assert_eq!(chip.read(PORT_F + 0x10) & 0b11, 0b11, "over");
}

/// ST's errata sheets, "spurious bus error detection in master mode": a flag, and the transfer goes on.
#[test]
fn a_spurious_bus_error_is_a_flag_and_no_more() {
    let (mut chip, device) = i2c();
    assert!(chip.soc.disturb_i2c(2, 1) && !chip.soc.disturb_i2c(4, 1));
    chip.write(CR2, ADDRESS | 2 << 16 | START | AUTOEND);
    send(&mut chip, &[0x10]);
    assert_eq!(chip.read(ISR) & BERR, 0, "not before the byte has passed");
    send(&mut chip, &[0x20]);
    chip.wait(ISR, STOPF);
    assert_eq!((log(&device).as_str(), chip.read(ISR) & BERR), ("W 10 20 P", BERR));
    chip.write(ICR, BERR);
    assert_eq!(chip.read(ISR) & BERR, 0);
}

#[test]
fn a_write_a_repeated_start_and_a_read() {
    let (mut chip, device) = i2c();
    device.0.lock().unwrap().memory = vec![0xAA, 0xBB, 0xCC];
    let start = chip.now;
    chip.write(CR2, ADDRESS | 2 << 16 | START);
    assert_eq!(flags(&mut chip), BUSY);
    chip.run_to(start + 10 * BIT - 1);
    assert_eq!(flags(&mut chip), BUSY);
    chip.run_to(start + 10 * BIT);
    assert_eq!((flags(&mut chip), chip.read(CR2) & START), (BUSY | TXIS, 0));
    // The first byte goes on at once, the second waits in TXDR.
    chip.write(TXDR, 0x10);
    assert_eq!(flags(&mut chip), BUSY | TXIS);
    chip.write(TXDR, 0x11);
    assert_eq!((flags(&mut chip), chip.read(ISR) & TXE), (BUSY, 0));
    chip.run_to(start + 28 * BIT);
    assert_eq!(flags(&mut chip), BUSY | TC);
    chip.write(CR2, ADDRESS | READ | 3 << 16 | AUTOEND | START);
    let mut read = Vec::new();
    for _ in 0..3 {
        chip.wait(ISR, RXNE);
        read.push(chip.read(RXDR));
    }
    assert_eq!(read, [0xAA, 0xBB, 0xCC]);
    chip.wait(ISR, STOPF);
    assert_eq!(flags(&mut chip), STOPF);
    chip.write(ICR, STOPF);
    assert_eq!(log(&device), "W 10 11 R P");
    assert_eq!(chip.kinds(), []);
}

#[test]
fn an_address_without_a_device_is_a_nack_and_a_stop() {
    let (mut chip, device) = i2c();
    chip.write(CR2, 0x44 << 1 | 1 << 16 | START);
    chip.run_to(chip.now + 20 * BIT);
    assert_eq!(flags(&mut chip), NACKF | STOPF);
    chip.write(ICR, NACKF | STOPF);
    assert_eq!((flags(&mut chip), log(&device)), (0, String::new()));
    // A byte that is refused.
    device.0.lock().unwrap().refuses_byte = Some(0x22);
    chip.write(CR2, ADDRESS | 3 << 16 | START);
    send(&mut chip, &[0x21, 0x22, 0x23]);
    chip.run_to(chip.now + 40 * BIT);
    assert_eq!((flags(&mut chip), chip.read(ISR) & TXE), (NACKF | STOPF, 0), "one is left over");
    chip.write(ISR, TXE);
    assert_eq!(chip.read(ISR) & TXE, TXE);
    assert_eq!(log(&device), "W 21 22 P");
}

#[test]
fn the_programs_stop_and_reload() {
    let (mut chip, device) = i2c();
    chip.write(CR2, ADDRESS | 2 << 16 | RELOAD | START);
    send(&mut chip, &[1, 2]);
    chip.wait(ISR, TCR);
    chip.write(CR2, ADDRESS | 1 << 16);
    assert_eq!(flags(&mut chip), BUSY | TXIS);
    send(&mut chip, &[3]);
    chip.wait(ISR, TC);
    chip.write(CR2, STOP);
    chip.wait(ISR, STOPF);
    assert_eq!((flags(&mut chip), chip.read(CR2)), (STOPF, 0));
    assert_eq!(log(&device), "W 01 02 03 P");
    // With nothing to stop it does nothing.
    chip.write(CR2, STOP);
    chip.run_to(chip.now + 100 * BIT);
    assert_eq!((flags(&mut chip), chip.read(CR2)), (STOPF, 0));
    // No byte at all: does a device answer?
    chip.write(CR2, ADDRESS | AUTOEND | START);
    chip.run_to(chip.now + 20 * BIT);
    assert_eq!((flags(&mut chip), log(&device)), (STOPF, "W P".into()));
}

#[test]
fn unread_bytes_and_slow_devices_hold_the_clock() {
    let (mut chip, device) = i2c();
    device.0.lock().unwrap().memory = vec![1, 2, 3];
    chip.write(CR2, ADDRESS | READ | 3 << 16 | AUTOEND | START);
    chip.run_to(chip.now + 1_000 * BIT);
    assert_eq!(flags(&mut chip), BUSY | RXNE);
    for expected in 1..=3 {
        chip.wait(ISR, RXNE);
        assert_eq!(chip.read(RXDR), expected);
    }

    device.0.lock().unwrap().stretch = 1_000_000;
    let start = chip.now + 100 * BIT;
    chip.run_to(start);
    chip.write(CR2, ADDRESS | 1 << 16 | START);
    send(&mut chip, &[9]);
    chip.wait(ISR, TC);
    assert!(chip.now - start >= 1_000_000 + 19 * BIT, "{}", chip.now - start);
    // For ever.
    chip.write(CR2, STOP);
    chip.wait(ISR, STOPF);
    device.0.lock().unwrap().stretch = u64::MAX;
    chip.write(CR2, ADDRESS | 1 << 16 | START);
    send(&mut chip, &[9]);
    chip.run_to(chip.now + 10_000_000_000);
    assert_eq!(flags(&mut chip) & !STOPF, BUSY);
    // Switched off it lets go.
    chip.write(CR1, 0);
    assert_eq!((chip.read(ISR), log(&device).ends_with('P')), (TXE, true));
}

/// The way of embassy: interrupts and DMA.
#[test]
fn dma_and_interrupts() {
    let (mut chip, device) = i2c();
    device.0.lock().unwrap().memory = vec![7, 8];
    chip.memory.write(0x2400_0000, &[0x31, 0x32]).unwrap();
    // DMA2's stream 7 sends, stream 6 receives.
    chip.stream((2, 7), 36, [TXDR, 0x2400_0000], 2, 1 << 6 | 1 << 4 | 1);
    // TXDMAEN, TCIE, NACKIE, ERRIE.
    chip.write(CR1, 1 | 1 << 14 | 1 << 6 | 1 << 4 | 1 << 7);
    chip.write(CR2, ADDRESS | 2 << 16 | START);
    assert!(chip.until_interrupt(70, u64::MAX).is_some());
    assert!(chip.until_interrupt(33, u64::MAX).is_some());
    assert_eq!(flags(&mut chip), BUSY | TC);
    chip.stream((2, 6), 35, [RXDR, 0x2400_0010], 2, 1 << 4 | 1);
    chip.write(CR1, 1 | 1 << 15 | 1 << 5);
    assert!(!chip.interrupt(33));
    chip.write(CR2, ADDRESS | READ | 2 << 16 | AUTOEND | START);
    assert!(chip.until_interrupt(69, u64::MAX).is_some());
    assert_eq!(chip.memory.word(0x2400_0010).unwrap() & 0xFFFF, 0x0807);
    assert!(chip.until_interrupt(33, u64::MAX).is_some());
    assert_eq!((flags(&mut chip), log(&device)), (STOPF, "W 31 32 R P".into()));
    assert_eq!(chip.kinds(), []);
}

/// A device that lost a clock holds the data line; nine clocks by hand free it.
#[test]
fn a_held_bus_is_freed_by_hand() {
    let (mut chip, device) = i2c();
    let now = Nanos::new(chip.now);
    assert!(chip.soc.hold_data(2, ('F', 1), ('F', 0), 5, now));
    assert_eq!(flags(&mut chip), BUSY);
    chip.write(CR2, ADDRESS | 1 << 16 | START);
    chip.run_to(chip.now + 1_000_000);
    assert_eq!((flags(&mut chip), chip.read(CR2) & START), (BUSY, START));
    chip.write(CR1, 0);
    assert_eq!(flags(&mut chip), 0);
    // Both pins as open-drain outputs, high.
    chip.write(AHB4ENR, 1 << 5);
    chip.write(PORT_F + 0x04, 3);
    chip.write(PORT_F + 0x18, 3);
    chip.set(PORT_F, 0xF, 0b0101);
    let data = |chip: &mut Chip| chip.read(PORT_F + 0x10) & 1;
    assert_eq!(chip.read(PORT_F + 0x10) & 3, 2);
    for clock in 1..=5 {
        assert_eq!(data(&mut chip), 0, "{clock}");
        chip.write(PORT_F + 0x18, 2 << 16);
        chip.run_to(chip.now + 5_000);
        chip.write(PORT_F + 0x18, 2);
        chip.run_to(chip.now + 5_000);
    }
    assert_eq!(data(&mut chip), 1);
    [0, 1].iter().for_each(|&pin| chip.alternate(5, pin, 4));
    chip.write(CR1, 1);
    assert_eq!(flags(&mut chip), 0);
    chip.write(CR2, ADDRESS | AUTOEND | START);
    chip.wait(ISR, STOPF);
    assert_eq!((flags(&mut chip), log(&device)), (STOPF, "W P".into()));
    // In the middle of a transfer: arbitration is lost.
    chip.write(CR2, ADDRESS | 1 << 16 | START);
    chip.run_to(chip.now + 5 * BIT);
    assert!(chip.soc.hold_data(2, ('F', 1), ('F', 0), 1, Nanos::new(chip.now)));
    assert_eq!(flags(&mut chip) & ARLO, ARLO);
}

#[test]
fn without_its_pins_it_never_starts_and_locked_stays_locked() {
    let (mut chip, device) = i2c();
    chip.alternate(5, 0, 3);
    chip.write(CR2, ADDRESS | 1 << 16 | START);
    chip.run_to(chip.now + 1_000_000);
    assert_eq!((chip.read(CR2) & START, log(&device)), (START, String::new()));
    chip.write(TIMINGR, 0);
    assert_eq!((chip.read(TIMINGR), chip.kinds()), (TIMING, vec![AccessKind::Protected]));
    // Ten bits of address, an own address, a time-out in hardware.
    for (register, value) in
        [(CR2, 1 << 11), (I2C2 + 0x08, 1 << 15), (I2C2 + 0x14, 1 << 15), (CR1, 1 | 1 << 20)]
    {
        chip.write(register, value);
        assert_eq!(chip.kinds(), [AccessKind::Unmodelled], "{register:#x}");
    }
    assert!(!chip.soc.attach_i2c(4, Box::new(Eeprom::default())));
}
