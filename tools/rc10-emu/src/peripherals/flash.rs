//! The flash and its interface (RM0468, embedded flash memory): one bank of eight sectors of 128 KiB.
//!
//! The flash is programmed in words of 256 bits, each with a code that corrects one wrong bit and detects two. A word
//! that was programmed may not be programmed again before its sector was erased: its code would not fit. What is cut
//! short leaves words with any part of their bits done: such a word reads as erased, as whole, with one wrong bit, or as
//! what no code fits; and if it reads as erased it cannot be programmed all the same. Which, chance says.
//!
//! Times of programming and erasing are those of the data sheet, drawn between typical and longest. Not modelled: CRC,
//! option bytes but for `BOR_LEV`, read-out and write protection, more than one operation that waits (a third write
//! waits for the first on the bus, as here the second does).

use std::collections::BTreeMap;
use std::ops::Range;

use rc10_sim::{Nanos, Random};

use super::access::{AccessKind, Answer, BusFault, Write};
use crate::memory::{FLASH, Memory};

/// Bytes of a word, which has one code.
pub(crate) const WORD: u32 = 32;
/// Bytes of a sector, which is erased at once.
pub(crate) const SECTOR: u32 = 128 << 10;
const WORDS: u32 = 8 * SECTOR / WORD;

words! { ACR: 0x00, KEYR: 0x04, CR: 0x0C, SR: 0x10, CCR: 0x14 }
/// `OPTSR_CUR`; of it the level of read-out protection, which is off, and `BOR_LEV` are told.
pub(super) const OPTSR: u32 = 0x1C;
pub(super) const READABLE: u32 = 0xAA << 8;
const ECC_FAR: u32 = 0x60;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

// Bits of CR.
bits! { LOCK: 0, PG: 1, SER: 2, BER: 3, FW: 6, START: 7 }
/// PSIZE: 8, 16, 32 or 64 bits at once; and SNB, the sector.
const PSIZE: (u32, u32) = (4, 3);
const SNB: (u32, u32) = (8, 7);
/// A reset locks, and programs 64 bits at once.
const CR_RESET: u32 = 0x31;
/// Bits that keep a written value: all but those that the flash clears, and those that are reserved.
const CR_KEPT: u32 = 0x1FEF_873E;

// Bits of SR. The upper ones are cleared by the same bits of CCR, and interrupt if the same bits of CR are set.
bits! {
    BSY: 0, WBNE: 1, QW: 2, EOP: 16, PGSERR: 18, STRBERR: 19, INCERR: 21, OPERR: 22, RDPERR: 23,
    RDSERR: 24, SNECCERR: 25, DBECCERR: 26,
}
const STICKY: u32 = 0x1FEF_0000;

/// Typical times in ns to program a word and to erase a sector, by PSIZE; the longest are twice that. Source: data
/// sheet DS13313 of the STM32H723, flash memory programming.
const TIMES: [(u64, u64); 4] = [
    (290_000, 2_000_000_000),
    (180_000, 1_800_000_000),
    (130_000, 1_100_000_000),
    (100_000, 1_000_000_000),
];

/// What is wrong with a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sick {
    /// It reads as erased, and may not be programmed.
    Weak,
    /// One bit is wrong, and corrected.
    Single,
    /// More bits are wrong.
    Double,
}

#[derive(Debug)]
enum Task {
    /// Programs the word with this number.
    Program(u32, [u8; WORD as usize]),
    /// Erases the sectors of these numbers.
    Erase(Range<u32>),
}

#[derive(Debug)]
struct Operation {
    task: Task,
    begun: Nanos,
    ends: Nanos,
}

/// The buffer of the word that is written next: its number, its bytes, and which of them were written.
#[derive(Debug)]
struct Buffer {
    word: u32,
    bytes: [u8; WORD as usize],
    written: u32,
}

/// How reads of the flash go: by default as of plain memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct FlashState {
    /// The core waits for its answer.
    pub(crate) is_busy: bool,
    /// Sectors with words whose codes do not fit: a bit each.
    pub(crate) sick: u32,
}

/// The flash's cells and their interface.
pub(super) struct Flash {
    memory: Memory,
    random: Random,
    latency: u32,
    control: u32,
    flags: u32,
    /// Number of keys that were right; `None`: locked until the next reset.
    keys: Option<usize>,
    buffer: Option<Buffer>,
    running: Option<Operation>,
    /// The word of the last error of a code.
    failed: u32,
    /// Words that are programmed, as far as they can be read.
    programmed: Vec<bool>,
    sick: BTreeMap<u32, Sick>,
    /// Sectors that are worn out: a bit each.
    worn: u32,
}

impl Flash {
    /// A flash with the program that the memory has.
    pub(super) fn new(memory: Memory, seed: u64) -> Self {
        let mut flash = Self {
            memory,
            random: Random::new(seed ^ 0xF1A5_4000),
            latency: 0,
            control: 0,
            flags: 0,
            keys: Some(0),
            buffer: None,
            running: None,
            failed: 0,
            programmed: Vec::new(),
            sick: BTreeMap::new(),
            worn: 0,
        };
        flash.programmed =
            (0..WORDS).map(|word| flash.bytes(word) != [0xFF; WORD as usize]).collect();
        flash.reset();
        flash
    }

    /// A reset without loss of power lets what runs end.
    pub(super) fn reset(&mut self) {
        (self.latency, self.control, self.flags) = (0x37, CR_RESET, 0);
        (self.keys, self.buffer, self.failed) = (Some(0), None, 0);
    }

    fn bytes(&self, word: u32) -> [u8; WORD as usize] {
        let mut bytes = [0; WORD as usize];
        // Each word lies in the flash.
        let _ = self.memory.read(address_of(word), &mut bytes);
        bytes
    }

    fn put(&mut self, word: u32, bytes: [u8; WORD as usize], sick: Option<Sick>) {
        let _ = self.memory.write(address_of(word), &bytes);
        self.programmed[word as usize] = bytes != [0xFF; WORD as usize];
        match sick {
            Some(sick) => self.sick.insert(word, sick),
            None => self.sick.remove(&word),
        };
    }

    /// Wait states, of ACR.
    pub(super) const fn wait_states(&self) -> u32 {
        self.latency & 0xF
    }

    pub(super) fn read(&self, offset: u32) -> Answer<u32> {
        Ok(match offset {
            ACR => self.latency,
            KEYR => 0,
            CR => self.control,
            SR => {
                let busy = if self.running.is_some() { BSY | QW } else { 0 };
                busy | if self.buffer.is_some() { WBNE } else { 0 } | self.flags
            }
            CCR => 0,
            ECC_FAR => self.failed,
            _ => return Err(AccessKind::Unmodelled),
        })
    }

    /// A wrong key is refused by a fault of the bus, and shuts the interface until the next reset.
    pub(super) fn write(&mut self, write: Write, now: Nanos) -> Result<Answer, BusFault> {
        let value = write.ones();
        Ok(match write.offset {
            ACR => {
                self.latency = write.over(self.latency) & 0x3F;
                Ok(())
            }
            KEYR => {
                let right = self.keys.filter(|done| KEYS.get(*done) == Some(&value));
                self.keys = right.map(|done| done + 1);
                match self.keys {
                    None => return Err(BusFault),
                    Some(2) => self.control &= !LOCK,
                    Some(_) => {}
                }
                Ok(())
            }
            CR if self.control & LOCK != 0 => Err(AccessKind::Protected),
            CR => {
                self.control(write.over(self.control), now);
                Ok(())
            }
            SR => Err(AccessKind::Protected),
            CCR => {
                self.flags &= !(value & STICKY);
                Ok(())
            }
            _ => Err(AccessKind::Unmodelled),
        })
    }

    fn control(&mut self, value: u32, now: Nanos) {
        self.control = value & CR_KEPT;
        if value & LOCK != 0 {
            (self.control, self.keys) = (self.control | LOCK, Some(0));
        }
        if value & PG == 0 {
            self.buffer = None;
        }
        if value & FW != 0
            && let Some(buffer) = self.buffer.take()
        {
            self.program(buffer, now);
        }
        if value & START != 0 {
            let sector = value >> SNB.0 & SNB.1;
            match (value & BER != 0, value & SER != 0) {
                _ if self.running.is_some() => self.flags |= PGSERR,
                (true, _) => self.begin(Task::Erase(0..8), now),
                (_, true) => self.begin(Task::Erase(sector..sector + 1), now),
                _ => self.flags |= PGSERR,
            }
        }
    }

    /// A write of the core or a DMA to the flash, of one to four bytes.
    pub(super) fn store(&mut self, address: u32, bytes: &[u8], now: Nanos) -> Result<(), BusFault> {
        let offset = address - FLASH;
        let (word, first) = (offset / WORD, (offset % WORD) as usize);
        if self.control & (LOCK | PG) != PG {
            self.flags |= PGSERR;
            return Err(BusFault);
        }
        if self.buffer.as_ref().is_some_and(|buffer| buffer.word != word) {
            (self.buffer, self.flags) = (None, self.flags | INCERR);
            return Ok(());
        }
        let empty = Buffer { word, bytes: [0xFF; WORD as usize], written: 0 };
        let mut buffer = self.buffer.take().unwrap_or(empty);
        let lanes = ((1 << bytes.len()) - 1) << first;
        if buffer.written & lanes != 0 {
            self.flags |= STRBERR;
            return Ok(());
        }
        buffer.written |= lanes;
        buffer.bytes[first..first + bytes.len()].copy_from_slice(bytes);
        if buffer.written == u32::MAX {
            self.program(buffer, now);
        } else {
            self.buffer = Some(buffer);
        }
        Ok(())
    }

    fn program(&mut self, buffer: Buffer, now: Nanos) {
        self.begin(Task::Program(buffer.word, buffer.bytes), now);
    }

    fn begin(&mut self, task: Task, now: Nanos) {
        // What comes while another runs has waited on the bus until that has ended.
        if let Some(ends) = self.running.as_ref().map(|running| running.ends) {
            self.advance(ends);
        }
        let (word, sector) = TIMES[(self.control >> PSIZE.0 & PSIZE.1) as usize];
        let typical = match &task {
            Task::Program(..) => word,
            Task::Erase(sectors) => sector * sectors.len() as u64,
        };
        let ends = now + Nanos::new(typical + self.random.below(typical));
        self.running = Some(Operation { task, begun: now, ends });
    }

    /// The time at which what runs ends: until then no word can be read.
    pub(super) fn busy_until(&self) -> Option<Nanos> {
        self.running.as_ref().map(|running| running.ends)
    }

    /// A word of 32 bits as it is when what runs has ended.
    pub(super) fn word(&self, address: u32) -> u32 {
        let now = self.memory.word(address).unwrap_or(0);
        let (number, first) = ((address - FLASH) / WORD, (address - FLASH) % WORD);
        match self.running.as_ref().map(|running| &running.task) {
            Some(Task::Program(word, bytes)) if *word == number => {
                let bytes = bytes[first as usize..].first_chunk().copied().unwrap_or_default();
                now & u32::from_le_bytes(bytes)
            }
            Some(Task::Erase(sectors)) if sectors.contains(&sector_of(number)) => u32::MAX,
            _ => now,
        }
    }

    pub(super) fn advance(&mut self, now: Nanos) {
        let Some(operation) = self.running.take_if(|running| running.ends <= now) else { return };
        self.flags |= EOP;
        match operation.task {
            Task::Program(word, bytes) => {
                let old = self.bytes(word);
                let is_free = !self.programmed[word as usize] && !self.sick.contains_key(&word);
                let both = std::array::from_fn(|at| old[at] & bytes[at]);
                if is_free {
                    self.put(word, bytes, None);
                } else if old != bytes {
                    self.put(word, both, Some(Sick::Double));
                }
            }
            Task::Erase(sectors) => {
                for word in words(&sectors) {
                    if self.worn >> sector_of(word) & 1 == 0 {
                        self.put(word, [0xFF; WORD as usize], None);
                    } else {
                        self.flags |= OPERR;
                    }
                }
            }
        }
    }

    /// The power goes: what runs stops where it is. What is in the buffer is lost.
    pub(super) fn cut(&mut self, now: Nanos) {
        self.advance(now);
        if let Some(Operation { task, begun, ends }) = self.running.take() {
            let part = now.since(begun).get() as f64 / ends.since(begun).get().max(1) as f64;
            match task {
                Task::Program(word, bytes) => self.tear(word, Some(bytes), part),
                Task::Erase(sectors) => {
                    words(&sectors).for_each(|word| self.tear(word, None, part));
                }
            }
        }
        self.reset();
    }

    /// Leaves a word that was programmed or erased for this part of the time. Cells need between 0.3 and 0.7 of it; now
    /// and then all but one are as quick.
    fn tear(&mut self, word: u32, wanted: Option<[u8; WORD as usize]>, part: f64) {
        const ERASED: [u8; WORD as usize] = [0xFF; WORD as usize];
        let (old, goal) = (self.bytes(word), wanted.unwrap_or(ERASED));
        let mut torn = old;
        for bit in 0..8 * WORD as usize {
            let (byte, mask) = (bit / 8, 1 << (bit % 8));
            if (old[byte] ^ goal[byte]) & mask != 0 && 0.3 + 0.4 * self.random.unit() < part {
                torn[byte] ^= mask;
            }
        }
        let is_single = torn != old && torn != goal && self.random.below(16) == 0;
        let (bytes, sick) = if is_single {
            (goal, Some(Sick::Single))
        } else if torn == ERASED && (wanted.is_some() || old != ERASED) {
            (torn, (self.random.below(2) == 0).then_some(Sick::Weak))
        } else if torn == goal {
            (torn, None)
        } else if torn == old {
            (torn, self.sick.get(&word).copied())
        } else {
            (torn, Some(Sick::Double))
        };
        self.put(word, bytes, sick);
    }

    /// Looks at the codes of the words that are read; a DMA only takes notice.
    pub(super) fn check(&mut self, address: u32, bytes: u32, by_dma: bool) -> Result<(), BusFault> {
        let first = (address - FLASH) / WORD;
        let last = (address - FLASH + bytes - 1) / WORD;
        for word in first..=last {
            let flag = match self.sick.get(&word) {
                Some(Sick::Single) => SNECCERR,
                Some(Sick::Double) => DBECCERR,
                Some(Sick::Weak) | None => continue,
            };
            if self.flags & (SNECCERR | DBECCERR) == 0 {
                self.failed = word;
            }
            self.flags |= flag;
            if flag == DBECCERR && !by_dma {
                return Err(BusFault);
            }
        }
        Ok(())
    }

    /// Sectors with words whose codes do not fit: a bit each.
    pub(super) fn sick_sectors(&self) -> u32 {
        let sectors = self.sick.iter().filter(|(_, sick)| **sick != Sick::Weak);
        sectors.fold(0, |bits, (word, _)| bits | 1 << sector_of(*word))
    }

    /// The core has looked ahead into protected memory, as it does where the MPU lets it.
    pub(super) fn speculate(&mut self) {
        self.flags |= RDPERR | RDSERR;
    }

    /// Wears a sector out: erasing it fails from now on.
    pub(super) fn wear(&mut self, sector: u32) {
        self.worn |= 1 << sector;
    }

    pub(super) fn interrupts(&self) -> bool {
        self.flags & self.control & STICKY != 0
    }
}

fn address_of(word: u32) -> u32 {
    FLASH + WORD * word
}

const fn sector_of(word: u32) -> u32 {
    word / (SECTOR / WORD)
}

const fn words(sectors: &Range<u32>) -> Range<u32> {
    sectors.start * (SECTOR / WORD)..sectors.end * (SECTOR / WORD)
}
