//! FDCAN1, configured, and its registers by name.

use std::sync::{Arc, Mutex, MutexGuard};

use rc10_can::CanFrame;
use rc10_can::embedded_can::{ExtendedId, StandardId};
use rc10_emu::fdcan::{Counters, Fdcans, Node};
use rc10_sim::{Activity, Controller, Nanos, Outcome};

pub const TEST: u32 = 0x10;
pub const CCCR: u32 = 0x18;
pub const NBTP: u32 = 0x1C;
pub const TSCC: u32 = 0x20;
pub const TSCV: u32 = 0x24;
pub const ECR: u32 = 0x40;
pub const PSR: u32 = 0x44;
pub const IR: u32 = 0x50;
pub const IE: u32 = 0x54;
pub const ILS: u32 = 0x58;
pub const ILE: u32 = 0x5C;
pub const GFC: u32 = 0x80;
pub const SIDFC: u32 = 0x84;
pub const XIDFC: u32 = 0x88;
pub const XIDAM: u32 = 0x90;
pub const HPMS: u32 = 0x94;
pub const NDAT1: u32 = 0x98;
pub const RXF0C: u32 = 0xA0;
pub const RXF0S: u32 = 0xA4;
pub const RXF0A: u32 = 0xA8;
pub const RXBC: u32 = 0xAC;
pub const RXF1C: u32 = 0xB0;
pub const RXF1S: u32 = 0xB4;
pub const RXESC: u32 = 0xBC;
pub const TXBC: u32 = 0xC0;
pub const TXFQS: u32 = 0xC4;
pub const TXBRP: u32 = 0xCC;
pub const TXBAR: u32 = 0xD0;
pub const TXBCR: u32 = 0xD4;
pub const TXBTO: u32 = 0xD8;
pub const TXBCF: u32 = 0xDC;
pub const TXBTIE: u32 = 0xE0;
pub const TXBCIE: u32 = 0xE4;
pub const TXEFC: u32 = 0xF0;
pub const TXEFS: u32 = 0xF4;
pub const TXEFA: u32 = 0xF8;

/// Of the clock calibration unit: its configuration, and the bit that bypasses it.
pub const CCFG: u32 = 0x04;
pub const BYPASS: u32 = 1 << 6;

pub const INIT: u32 = 1;
pub const CCE: u32 = 2;
pub const ASM: u32 = 1 << 2;
pub const CSA: u32 = 1 << 3;
pub const CSR: u32 = 1 << 4;
pub const MON: u32 = 1 << 5;
pub const DAR: u32 = 1 << 6;
pub const FDOE: u32 = 1 << 8;

/// 120 MHz / 3 / (1 + 29 + 10): 1 Mbit/s.
pub const ONE_MEGABIT: u32 = 9 << 25 | 2 << 16 | 28 << 8 | 9;

/// Places of the elements, in words.
pub const STANDARD_FILTERS: usize = 0;
pub const EXTENDED_FILTERS: usize = 128;
pub const FIFO_0: usize = 256;
pub const FIFO_1: usize = 512;
pub const RX_BUFFERS: usize = 768;
pub const EVENTS: usize = 1024;
pub const TRANSMIT: usize = 1280;
/// Words of a buffer with eight data bytes.
pub const ELEMENT: usize = 4;

pub const EVENT: u32 = 1 << 23;
pub const BIT: u64 = 1000;
/// 16 periods of 120 MHz, 133 1/3 ns: until INIT can be read back, and a cancellation is done.
pub const CROSSING: u64 = 134;

pub struct Bench {
    pub fdcans: Arc<Mutex<Fdcans>>,
    pub node: Node,
    pub now: Nanos,
}

pub fn start_address(word: usize) -> u32 {
    u32::try_from(word).unwrap() << 2
}

pub fn standard(id: u16, data: &[u8]) -> CanFrame {
    CanFrame::data_frame(StandardId::new(id).unwrap(), data).unwrap()
}

pub fn extended(id: u32, data: &[u8]) -> CanFrame {
    CanFrame::data_frame(ExtendedId::new(id).unwrap(), data).unwrap()
}

/// The frame's time on the wire, and the interframe space.
pub fn frame_ns(frame: &CanFrame) -> u64 {
    (u64::from(frame.wire_length().total()) - 3) * BIT
}
const INTERFRAME_NS: u64 = 3 * BIT;

impl Bench {
    /// In configuration mode: 1 Mbit/s, three elements in each FIFO, no filters, nothing to send.
    pub fn configuring() -> Self {
        let fdcans = Arc::new(Mutex::new(Fdcans::new(1)));
        let node = Node::new(Arc::clone(&fdcans), 0);
        let bench = Self { fdcans, node, now: Nanos::ZERO };
        bench.fdcans().set_kernel_clock(120_000_000);
        bench.fdcans().set_pins(0, true, true);
        bench.write(CCCR, INIT | CCE);
        assert_eq!(bench.fdcans().write_calibration(CCFG, BYPASS), Ok(()));
        bench.write(NBTP, ONE_MEGABIT);
        bench.write(RXF0C, 3 << 16 | start_address(FIFO_0));
        bench.write(RXF1C, 3 << 16 | start_address(FIFO_1));
        bench.write(RXBC, start_address(RX_BUFFERS));
        bench
    }

    /// Joined, with that many dedicated buffers and that many in FIFO (or queue, with `queue`).
    pub fn sending(dedicated: u32, shared: u32, queue: bool) -> Self {
        let mut bench = Self::configuring();
        bench.lay_out_transmit(dedicated, shared, queue);
        bench.join();
        bench
    }

    pub fn lay_out_transmit(&self, dedicated: u32, shared: u32, queue: bool) {
        let layout = u32::from(queue) << 30 | shared << 24 | dedicated << 16;
        self.write(TXBC, layout | start_address(TRANSMIT));
        self.write(TXBTIE, u32::MAX);
        self.write(TXBCIE, u32::MAX);
    }

    pub fn join(&mut self) {
        let cccr = self.read(CCCR);
        self.write(CCCR, cccr & !(INIT | CCE));
        self.wait(11 * BIT);
        assert!(self.node.is_on_bus());
    }

    pub fn fdcans(&self) -> MutexGuard<'_, Fdcans> {
        self.fdcans.lock().unwrap()
    }

    pub fn counters(&self) -> Counters {
        self.fdcans().counters(0).clone()
    }

    pub fn read(&self, offset: u32) -> u32 {
        self.fdcans().read(0, offset, self.now).unwrap()
    }

    pub fn write(&self, offset: u32, value: u32) {
        assert_eq!(self.fdcans().write(0, offset, value, self.now), Ok(()));
    }

    /// Writes CCCR and waits until INIT can be read back.
    pub fn set_cccr(&mut self, value: u32) {
        self.write(CCCR, value);
        self.wait(CROSSING);
    }

    pub fn ram(&self, word: usize) -> u32 {
        self.fdcans().read_ram(word).unwrap()
    }

    pub fn write_ram(&self, word: usize, value: u32) {
        assert!(self.fdcans().write_ram(word, value));
    }

    pub fn wait(&mut self, nanos: u64) {
        self.now = self.now + Nanos::new(nanos);
        self.node.advance(self.now);
    }

    /// Puts a frame into a transmit buffer; `control` is or-ed to its second word.
    pub fn fill(&self, buffer: usize, frame: &CanFrame, control: u32) {
        let word = TRANSMIT + ELEMENT * buffer;
        let id =
            if frame.is_extended_id() { 1 << 30 | frame.raw_id() } else { frame.raw_id() << 18 };
        self.write_ram(word, id | u32::from(frame.is_remote()) << 29);
        self.write_ram(word + 1, control | u32::try_from(frame.len()).unwrap() << 16);
        let mut data = [0; 8];
        data[..frame.bytes().len()].copy_from_slice(frame.bytes());
        for half in 0..2 {
            let bytes = data[4 * half..4 * half + 4].try_into().unwrap();
            self.write_ram(word + 2 + half, u32::from_le_bytes(bytes));
        }
    }

    /// Fills a buffer and requests its transmission.
    pub fn request(&self, buffer: usize, frame: &CanFrame) {
        self.fill(buffer, frame, 0);
        self.write(TXBAR, 1 << buffer);
    }

    /// The node's next frame starts, if it has one.
    pub fn start(&mut self) -> Option<CanFrame> {
        let frame = self.node.offer(self.now)?;
        self.node.sending(self.now);
        self.node.wire_is(Activity::Busy, self.now);
        Some(frame)
    }

    /// The frame that it sends ends.
    pub fn end(&mut self, frame: &CanFrame, outcome: Outcome) {
        self.now = self.now + Nanos::new(frame_ns(frame));
        self.node.sent(outcome, self.now);
        self.idle();
    }

    fn idle(&mut self) {
        self.now = self.now + Nanos::new(INTERFRAME_NS);
        self.node.wire_is(Activity::Idle, self.now);
    }

    /// The node sends its next frame, if it has one.
    pub fn carry(&mut self, outcome: Outcome) -> Option<CanFrame> {
        let frame = self.start()?;
        self.end(&frame, outcome);
        Some(frame)
    }

    /// Everything it has to send, as candump writes it.
    pub fn carry_all(&mut self) -> Vec<String> {
        std::iter::from_fn(|| self.carry(Outcome::Acknowledged).map(|f| f.to_string())).collect()
    }

    /// Another node sends.
    pub fn hear(&mut self, frame: &CanFrame) {
        let start = self.now;
        self.node.wire_is(Activity::Busy, start);
        self.now = self.now + Nanos::new(frame_ns(frame));
        self.node.received(frame, start, self.now);
        self.idle();
    }

    /// Clears IR; what it was.
    pub fn take_flags(&self) -> u32 {
        let flags = self.read(IR);
        self.write(IR, flags);
        flags
    }
}
