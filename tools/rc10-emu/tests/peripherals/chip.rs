//! A chip under test.

use std::sync::{Arc, Mutex};

use rc10_emu::fdcan::Fdcans;
use rc10_emu::peripherals::{AccessKind, Limit, Soc, TooFast, Width};
use rc10_emu::{Board, Memory, Options};
use rc10_sim::Nanos;

pub const RCC: u32 = 0x5802_4400;
pub const PWR: u32 = 0x5802_4800;
pub const FLASH: u32 = 0x5200_2000;

pub const AHB1ENR: u32 = RCC + 0xD8;
pub const AHB4ENR: u32 = RCC + 0xE0;
pub const APB1LENR: u32 = RCC + 0xE8;
pub const APB1HENR: u32 = RCC + 0xEC;
pub const APB2ENR: u32 = RCC + 0xF0;
pub const APB4ENR: u32 = RCC + 0xF4;

/// A clock that is too fast: any.
pub const TOO_FAST: AccessKind =
    AccessKind::TooFast(TooFast { clock: "", hz: 0, limit: Limit::AtMost(0) });

/// All peripherals, their memories, and the time in nanoseconds.
pub struct Chip {
    pub soc: Soc,
    pub memory: Memory,
    pub now: u64,
}

impl Chip {
    pub fn new() -> Self {
        Self::on(Board::H723ZG, 0)
    }

    pub fn on(board: Board, hsi_deviation_ppm: i32) -> Self {
        Self::with(Options { board, hsi_deviation_ppm, ..Options::default() })
    }

    pub fn with(options: Options) -> Self {
        let memory = Memory::new(1);
        let fdcans = Arc::new(Mutex::new(Fdcans::new(1)));
        let soc = Soc::new(options, fdcans, memory.clone());
        Self { soc, memory, now: 0 }
    }

    /// One that runs as our firmware sets it up: 480 MHz.
    pub fn running() -> Self {
        Self::with_pll1_q(6)
    }

    /// The same with another divider of PLL1's output Q: the FDCANs' and SPI1 to 3's clock.
    pub fn with_pll1_q(divider: u32) -> Self {
        let mut chip = Self::new();
        chip.start_clocks(divider);
        chip
    }

    /// The writes of embassy-stm32 0.6.0 for `rc10_bsp::clocks()`, with its waiting loops.
    pub fn start_clocks(&mut self, divider: u32) {
        self.start_clocks_with(5, 96, divider);
    }

    /// The same with another first divider and multiplier of PLL1.
    pub fn start_clocks_with(&mut self, first: u32, multiplier: u32, divider: u32) {
        self.set(PWR + 0x0C, 0b111, 0b010);
        self.wait(PWR + 0x04, 1 << 13);
        self.set(PWR + 0x18, 3 << 14, 0);
        self.wait(PWR + 0x18, 1 << 13);
        self.set(RCC, 1, 1);
        self.wait(RCC, 1 << 2);
        self.set(RCC, 1 << 16, 1 << 16);
        self.wait(RCC, 1 << 17);
        // P / 1; RGE: 4 to 8, 8 to 16 MHz.
        let range = if first < 4 { 3 } else { 2 };
        self.set(RCC + 0x28, 0x3F << 4 | 3, first << 4 | 2);
        self.set(RCC + 0x2C, 0b1111 | 7 << 16, range << 2 | 0b011 << 16);
        self.write(RCC + 0x30, (multiplier - 1) | (divider - 1) << 16 | 1 << 24);
        self.set(RCC, 1 << 24, 1 << 24);
        self.wait(RCC, 1 << 25);
        // It switches the other PLLs off like this.
        self.write(RCC + 0x28, 0);
        self.write(RCC + 0x28, 0);
        self.write(FLASH, 3 << 4 | 3);
        self.set(RCC + 0x18, 0xF7F, 4 << 4 | 8);
        self.set(RCC + 0x1C, 0x770, 4 << 8 | 4 << 4);
        self.set(RCC + 0x10, 7, 3);
        self.wait(RCC + 0x10, 3 << 3);
        self.set(RCC + 0x50, 3 << 28, 1 << 28);
    }

    pub fn read(&mut self, address: u32) -> u32 {
        self.soc.read(address, Width::Word, Nanos::new(self.now)).expect("a device is there")
    }

    pub fn write(&mut self, address: u32, value: u32) {
        self.soc
            .write(address, Width::Word, value, Nanos::new(self.now))
            .expect("a device is there");
    }

    pub fn record(&mut self, port: char, pin: usize) -> bool {
        self.soc.record_pin(port, pin, Nanos::new(self.now))
    }

    pub fn set(&mut self, address: u32, mask: u32, value: u32) {
        let old = self.read(address);
        self.write(address, old & !mask | value);
    }

    /// Reads every 100 ns until these bits are set.
    pub fn wait(&mut self, address: u32, bits: u32) {
        for _ in 0..1_000_000 {
            if self.read(address) & bits == bits {
                return;
            }
            self.now += 100;
        }
        panic!("{address:#x} never has {bits:#x}");
    }

    pub fn to(&mut self, now: u64) {
        self.now = now;
        self.soc.advance(Nanos::new(now));
    }

    /// Goes through all events up to a time.
    pub fn run_to(&mut self, until: u64) {
        while let Some(next) = self.soc.next_event().filter(|next| next.get() <= until) {
            self.to(next.get());
        }
        self.to(until);
    }

    /// Sets up stream `n` of a DMA: registers of a peripheral, memory, and how many; it counts
    /// through the memory, and runs if `control` has EN.
    pub fn stream(
        &mut self,
        (dma, n): (u32, u32),
        request: u32,
        [register, memory]: [u32; 2],
        count: u32,
        control: u32,
    ) {
        self.set(AHB1ENR, 1 << (dma - 1), 1 << (dma - 1));
        self.write(0x4002_0800 + 4 * (8 * (dma - 1) + n), request);
        let base = 0x4002_0010 + 0x400 * (dma - 1) + 0x18 * n;
        self.write(base + 0x04, count);
        self.write(base + 0x08, register);
        self.write(base + 0x0C, memory);
        self.write(base, 1 << 10 | control & !1);
        self.write(base, 1 << 10 | control);
    }

    /// A timer's prescaler and last count, in effect by an update whose flag is cleared.
    pub fn count(&mut self, timer: u32, prescaler: u32, last: u32) {
        for (register, value) in [(0x28, prescaler), (0x2C, last), (0x14, 1), (0x10, 0)] {
            self.write(timer + register, value);
        }
    }

    pub fn interrupt(&self, number: usize) -> bool {
        self.soc.interrupt_levels()[number / 32] >> (number % 32) & 1 != 0
    }

    /// Runs until an interrupt comes, or until a time.
    pub fn until_interrupt(&mut self, number: usize, limit: u64) -> Option<u64> {
        while !self.interrupt(number) {
            let next = self.soc.next_event().map(Nanos::get).filter(|&next| next <= limit)?;
            self.to(next);
        }
        Some(self.now)
    }

    pub fn kinds(&mut self) -> Vec<AccessKind> {
        self.soc.take_reports().iter().map(|access| access.kind).collect()
    }
}
