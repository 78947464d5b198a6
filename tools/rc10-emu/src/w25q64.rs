//! A W25Q64JV: a serial flash of 8 MiB. Source: data sheet W25Q64JV, revision I.
//!
//! Bits are programmed to zero, bytes of a page of 256 at once; sectors of 4 KiB and blocks of 32 and 64 KiB are erased
//! to ones. A cut of power leaves a page or a sector with any part of its bits done. Not modelled: protection, security
//! registers, suspending, power-down, QPI.

use std::sync::{Arc, Mutex};

use rc10_sim::{Nanos, Random};

use crate::peripherals::{Header, SerialMemory, lock};

const SIZE: u32 = 8 << 20;
const PAGE: u32 = 256;
/// Manufacturer, type, capacity.
const JEDEC: [u8; 3] = [0xEF, 0x40, 0x17];

/// Typical and longest times: of a page, and of 4, 32 and 64 KiB.
const PAGE_TIME: [u64; 2] = [400_000, 3_000_000];
const ERASE_TIMES: [(u8, u32, [u64; 2]); 3] = [
    (0x20, 4 << 10, [45_000_000, 400_000_000]),
    (0x52, 32 << 10, [120_000_000, 1_600_000_000]),
    (0xD8, 64 << 10, [150_000_000, 2_000_000_000]),
];

/// Fastest clocks: of a plain read, and of all else.
const CLOCKS: [u64; 2] = [50_000_000, 133_000_000];

#[derive(Clone, Debug)]
struct Operation {
    first: u32,
    /// Bits that are to be; those of an erased place are ones.
    wanted: Vec<u8>,
    begun: Nanos,
    ends: Nanos,
}

#[derive(Debug)]
struct Cells {
    bytes: Vec<u8>,
    random: Random,
    can_write: bool,
    running: Option<Operation>,
    /// The command that is on the wires; `None`: one that it does not understand.
    command: Option<Header>,
    sent: u32,
    taken: Vec<u8>,
}

/// A handle of a W25Q64JV.
#[derive(Clone, Debug)]
pub struct W25Q64(Arc<Mutex<Cells>>);

impl W25Q64 {
    /// An erased memory; the seed is of times and of what a cut leaves.
    pub fn new(seed: u64) -> Self {
        Self(Arc::new(Mutex::new(Cells {
            bytes: vec![0xFF; SIZE as usize],
            random: Random::new(seed ^ 0x2564),
            can_write: false,
            running: None,
            command: None,
            sent: 0,
            taken: Vec::new(),
        })))
    }

    /// Copies of its bytes.
    pub fn bytes(&self, first: u32, length: usize) -> Vec<u8> {
        let cells = lock(&self.0);
        let bytes = cells.bytes.iter().skip(first as usize).take(length);
        bytes.copied().collect()
    }

    /// The power goes: what runs stops where it is.
    pub(crate) fn cut(&self, now: Nanos) {
        let mut cells = lock(&self.0);
        cells.settle(now);
        (cells.can_write, cells.command) = (false, None);
        let Some(Operation { first, wanted, begun, ends }) = cells.running.take() else { return };
        let part = now.since(begun).get() as f64 / ends.since(begun).get().max(1) as f64;
        for (at, goal) in (first as usize..).zip(wanted) {
            let mut mask = 0;
            for bit in 0..8 {
                mask |= u8::from(cells.random.unit() < part) << bit;
            }
            cells.bytes[at] = cells.bytes[at] & !mask | goal & mask;
        }
    }
}

impl Cells {
    fn settle(&mut self, now: Nanos) {
        if let Some(done) = self.running.take_if(|running| running.ends <= now) {
            let first = done.first as usize;
            self.bytes[first..first + done.wanted.len()].copy_from_slice(&done.wanted);
            self.can_write = false;
        }
    }

    fn status(&self, register: u8) -> u8 {
        match register {
            0x05 => u8::from(self.running.is_some()) | u8::from(self.can_write) << 1,
            // QE: it has four lines by default (JV-IQ).
            0x35 => 0x02,
            _ => 0x60,
        }
    }

    /// Whether a command's form is the one that it has.
    fn understands(header: &Header) -> bool {
        let Header { instruction, address, wait, lines, clock_hz } = *header;
        let [of_instruction, of_address, of_data] = lines;
        let has_address = address.is_some_and(|(_, bits)| bits == 24);
        let form = (of_address, wait, of_data);
        let fits = match instruction {
            0x9F | 0x05 | 0x35 | 0x15 => form == (0, 0, 1),
            0x06 | 0x04 | 0x66 | 0x99 => form == (0, 0, 0),
            0x20 | 0x52 | 0xD8 => form == (1, 0, 0) && has_address,
            0x02 | 0x03 => form == (1, 0, 1) && has_address,
            0x32 => form == (1, 0, 4) && has_address,
            0x0B => form == (1, 8, 1) && has_address,
            0x6B => form == (1, 8, 4) && has_address,
            // Two clocks of a mode byte and four others.
            0xEB => form == (4, 6, 4) && has_address,
            _ => false,
        };
        fits && of_instruction == 1 && clock_hz <= CLOCKS[usize::from(instruction != 0x03)]
    }

    fn begin(&mut self, first: u32, wanted: Vec<u8>, [typical, longest]: [u64; 2], now: Nanos) {
        // Mostly near the typical time, now and then up to the longest.
        let spread = if self.random.below(16) == 0 { longest - typical } else { typical / 2 };
        let ends = now + Nanos::new(typical + self.random.below(spread));
        self.running = Some(Operation { first, wanted, begun: now, ends });
    }

    fn program(&mut self, address: u32, now: Nanos) {
        let page = address & !(PAGE - 1);
        let old = &self.bytes[page as usize..(page + PAGE) as usize];
        let mut wanted = old.to_vec();
        // Behind the page's end it goes on at its beginning; of more bytes than it has the last count.
        for (at, byte) in ((address % PAGE) as usize..).zip(&self.taken) {
            let at = at % PAGE as usize;
            wanted[at] = old[at] & byte;
        }
        self.begin(page, wanted, PAGE_TIME, now);
    }
}

impl SerialMemory for W25Q64 {
    fn begin(&mut self, header: Header, now: Nanos) {
        let mut cells = lock(&self.0);
        cells.settle(now);
        let is_status = matches!(header.instruction, 0x05 | 0x35 | 0x15);
        let hears = Cells::understands(&header) && (cells.running.is_none() || is_status);
        cells.command = hears.then_some(header);
        cells.sent = 0;
        cells.taken.clear();
    }

    fn read(&mut self, now: Nanos) -> u8 {
        let mut cells = lock(&self.0);
        cells.settle(now);
        let Some(header) = cells.command else { return 0xFF };
        let at = cells.sent;
        cells.sent += 1;
        match header.instruction {
            0x9F => JEDEC[at as usize % JEDEC.len()],
            0x05 | 0x35 | 0x15 => cells.status(header.instruction),
            _ => {
                let first = header.address.map_or(0, |(address, _)| address);
                cells.bytes[(first.wrapping_add(at) % SIZE) as usize]
            }
        }
    }

    fn write(&mut self, byte: u8) {
        lock(&self.0).taken.push(byte);
    }

    fn end(&mut self, now: Nanos) {
        let mut cells = lock(&self.0);
        let Some(header) = cells.command.take() else { return };
        let address = header.address.map_or(0, |(address, _)| address % SIZE);
        match header.instruction {
            0x06 => cells.can_write = true,
            0x04 => cells.can_write = false,
            0x02 | 0x32 if cells.can_write && !cells.taken.is_empty() => {
                cells.program(address, now);
            }
            erase if cells.can_write => {
                if let Some((_, size, times)) = ERASE_TIMES.iter().find(|(it, ..)| *it == erase) {
                    let wanted = vec![0xFF; *size as usize];
                    cells.begin(address & !(size - 1), wanted, *times, now);
                }
            }
            _ => {}
        }
    }
}
