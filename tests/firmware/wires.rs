//! Devices at the other ends of the chip's wires.

use std::collections::VecDeque;

use rc10_emu::peripherals::I2cDevice;
use rc10_sim::{Nanos, SerialDevice};

/// Keeps what it hears.
#[derive(Default)]
pub struct Listener(pub Vec<u8>);

impl SerialDevice for Listener {
    fn power_on(&mut self, _now: Nanos) {}

    fn next_event(&self) -> Option<Nanos> {
        None
    }

    fn advance(&mut self, _now: Nanos, _send: &mut VecDeque<u8>) {}

    fn receive(&mut self, byte: u8, _now: Nanos) {
        self.0.push(byte);
    }
}

/// Sends back what it hears, at once.
#[derive(Default)]
pub struct Echo {
    waiting: VecDeque<u8>,
    /// Time at which its last byte began.
    pub spoke: Option<Nanos>,
}

impl SerialDevice for Echo {
    fn power_on(&mut self, _now: Nanos) {}

    fn next_event(&self) -> Option<Nanos> {
        // At once.
        (!self.waiting.is_empty()).then_some(Nanos::ZERO)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        send.append(&mut self.waiting);
        self.spoke = Some(now);
    }

    fn receive(&mut self, byte: u8, _now: Nanos) {
        self.waiting.push_back(byte);
    }
}

/// 256 registers behind a pointer that moves on by itself. What is written to the first is refused.
pub struct Registers {
    registers: [u8; 256],
    pointer: Option<u8>,
}

impl Registers {
    pub const fn new() -> Self {
        Self { registers: [0; 256], pointer: None }
    }
}

impl I2cDevice for Registers {
    fn address(&self) -> u8 {
        0x50
    }

    fn start(&mut self, reads: bool, _now: Nanos) -> bool {
        if !reads {
            self.pointer = None;
        }
        true
    }

    fn write(&mut self, byte: u8, _now: Nanos) -> bool {
        let Some(pointer) = self.pointer else {
            self.pointer = Some(byte);
            return true;
        };
        if pointer == 0 {
            return false;
        }
        self.registers[usize::from(pointer)] = byte;
        self.pointer = Some(pointer.wrapping_add(1));
        true
    }

    fn read(&mut self, _now: Nanos) -> u8 {
        let pointer = self.pointer.unwrap_or(0);
        self.pointer = Some(pointer.wrapping_add(1));
        self.registers[usize::from(pointer)]
    }
}

/// Holds the clock for ever once it is addressed.
pub struct Sleeper;

impl I2cDevice for Sleeper {
    fn address(&self) -> u8 {
        0x51
    }

    fn start(&mut self, _reads: bool, _now: Nanos) -> bool {
        true
    }

    fn write(&mut self, _byte: u8, _now: Nanos) -> bool {
        true
    }

    fn read(&mut self, _now: Nanos) -> u8 {
        0
    }

    fn stretch(&self) -> Nanos {
        Nanos::new(u64::MAX)
    }
}
