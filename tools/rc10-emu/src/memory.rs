//! The chip's memories (RM0468, memory organisation).

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use anyhow::{Context, Result, anyhow};
use rc10_sim::Random;

use crate::image::Image;

/// The peripherals' address range.
pub const PERIPHERALS: Range<u32> = 0x4000_0000..0x6000_0000;

/// One memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bank {
    /// Name in the manual.
    pub name: &'static str,
    /// First address.
    pub base: u32,
    /// Length in bytes.
    pub length: u32,
    /// Place of its first byte among the bytes of all banks.
    pub(crate) start: u32,
}

const BANKS: [Bank; 8] = {
    const KIB: u32 = 1 << 10;
    let mut banks = [
        bank("ITCM", 0x0000_0000, 64 * KIB),
        bank("flash", 0x0800_0000, 1024 * KIB),
        bank("DTCM", 0x2000_0000, 128 * KIB),
        bank("AXI SRAM", 0x2400_0000, 320 * KIB),
        bank("SRAM1", 0x3000_0000, 16 * KIB),
        bank("SRAM2", 0x3000_4000, 16 * KIB),
        bank("SRAM4", 0x3800_0000, 16 * KIB),
        bank("backup SRAM", 0x3880_0000, 4 * KIB),
    ];
    let mut index = 1;
    while index < banks.len() {
        banks[index].start = banks[index - 1].start + banks[index - 1].length;
        index += 1;
    }
    banks
};

const fn bank(name: &'static str, base: u32, length: u32) -> Bank {
    Bank { name, base, length, start: 0 }
}

const BYTES: u32 = BANKS[7].start + BANKS[7].length;

/// The RAM whose code is of 64 bits; that of the others is of 32.
const AXI: Bank = BANKS[3];

/// The RAM that has this place.
fn ram_of(place: u32) -> Option<usize> {
    let holds = |bank: &Bank| place.wrapping_sub(bank.start) < bank.length && bank.base != FLASH;
    BANKS.iter().position(holds)
}

/// Address of the processor's first instruction.
pub const FLASH: u32 = BANKS[1].base;

/// Bytes in which writes are told as soon as an instruction has been decoded there.
const BLOCK: u32 = 256;

/// Contents of a RAM at power-on: random, and the same for the same seed.
pub(crate) fn noise(seed: u64) -> impl Iterator<Item = u64> {
    let mut random = Random::new(seed);
    std::iter::repeat_with(move || random.bits())
}

/// All memories; a reset leaves them as they are. A clone is the same memories: what a DMA sees.
#[derive(Clone)]
pub struct Memory(Arc<Words>);

/// Relaxed accesses of atomics are plain ones on every computer; only one thread makes them.
struct Words {
    words: Box<[AtomicU32]>,
    /// Blocks from which the core has decoded instructions.
    code: Box<[AtomicBool]>,
    /// The first place written there since, and the one behind the last; 0: nothing.
    stale: [AtomicU32; 2],
    /// Of each bank the last word of its code that was written in part, if nothing was written since.
    partial: [Partial; BANKS.len()],
    /// Banks that have one: a bit each.
    partials: AtomicU32,
}

/// A word of a RAM's code that was written in part: its place, which of its bytes, and what they were. A reset
/// discards what was written (RM0433 2.4; Zephyr 103501).
#[derive(Default)]
struct Partial {
    place: AtomicU32,
    written: AtomicU32,
    before: [AtomicU32; 2],
}

impl Memory {
    /// Memories at power-on: noise, other noise for another seed; erased flash is full of ones.
    pub fn new(seed: u64) -> Self {
        let mut words = Vec::with_capacity((BYTES / 4) as usize);
        for bank in BANKS {
            let length = (bank.length / 4) as usize;
            if bank.base == FLASH {
                words.extend((0..length).map(|_| AtomicU32::new(u32::MAX)));
            } else {
                let noise = noise(seed ^ u64::from(bank.base)).take(length / 2);
                #[expect(clippy::cast_possible_truncation, reason = "one half, then the other")]
                let halves = noise.flat_map(|noise| [noise as u32, (noise >> 32) as u32]);
                words.extend(halves.map(AtomicU32::new));
            }
        }
        let code = (0..BYTES / BLOCK).map(|_| AtomicBool::new(false)).collect();
        let (words, stale, partial) = (words.into(), Default::default(), Default::default());
        Self(Arc::new(Words { words, code, stale, partial, partials: AtomicU32::new(0) }))
    }

    /// Memories with a program in them. Fails if it does not fit.
    pub fn with(image: &Image, seed: u64) -> Result<Self> {
        let memory = Self::new(seed);
        for (address, bytes) in &image.segments {
            memory.write(*address, bytes).context("the program does not fit")?;
        }
        Ok(memory)
    }

    /// The banks, in the order of their addresses.
    pub const fn banks(&self) -> &[Bank] {
        &BANKS
    }

    pub(crate) fn bank(address: u32) -> Option<&'static Bank> {
        BANKS.iter().find(|bank| address.wrapping_sub(bank.base) < bank.length)
    }

    /// Place of the first of some bytes that lie in one bank.
    fn place(address: u32, length: usize) -> Result<u32> {
        let place = Self::bank(address).and_then(|bank| {
            let offset = address - bank.base;
            let rest = (bank.length - offset) as usize;
            (length <= rest).then_some(bank.start + offset)
        });
        place.ok_or_else(|| anyhow!("no memory holds {length} bytes at {address:#010x}"))
    }

    /// What an access of 1, 2 or 4 bytes reads at an aligned place.
    #[inline]
    pub(crate) fn get(&self, place: u32, bytes: u32) -> u32 {
        let word = self.0.words[(place / 4) as usize].load(Ordering::Relaxed);
        if bytes == 4 { word } else { word >> (8 * (place & 3)) & ((1 << (8 * bytes)) - 1) }
    }

    /// Writes 1, 2 or 4 bytes to an aligned place.
    #[inline]
    pub(crate) fn put(&self, place: u32, bytes: u32, value: u32) {
        if bytes < 4 || place.wrapping_sub(AXI.start) < AXI.length {
            self.note_partial(place, bytes);
        } else if self.0.partials.load(Ordering::Relaxed) != 0 {
            self.forget_partial(place);
        }
        let word = &self.0.words[(place / 4) as usize];
        if bytes == 4 {
            word.store(value, Ordering::Relaxed);
        } else {
            let (shift, mask) = (8 * (place & 3), (1 << (8 * bytes)) - 1);
            let kept = word.load(Ordering::Relaxed) & !(mask << shift);
            word.store(kept | (value & mask) << shift, Ordering::Relaxed);
        }
        if self.0.code[(place / BLOCK) as usize].load(Ordering::Relaxed) {
            let [first, end] = self.0.stale.each_ref().map(|bound| bound.load(Ordering::Relaxed));
            let first = if end == 0 { place } else { place.min(first) };
            self.0.stale[0].store(first, Ordering::Relaxed);
            self.0.stale[1].store(end.max(place + bytes), Ordering::Relaxed);
        }
    }

    /// Notes what the word of a RAM's code was before a part of it is written; forgets it when all of it was.
    fn note_partial(&self, place: u32, bytes: u32) {
        let Some(index) = ram_of(place) else { return };
        let size = if BANKS[index].base == AXI.base { 8 } else { 4 };
        let (partial, first) = (&self.0.partial[index], place & !(size - 1));
        let is_there = self.0.partials.load(Ordering::Relaxed) >> index & 1 != 0;
        let mut written = 0;
        if is_there && partial.place.load(Ordering::Relaxed) == first {
            written = partial.written.load(Ordering::Relaxed);
        } else {
            partial.place.store(first, Ordering::Relaxed);
            for (before, at) in partial.before.iter().zip([first, first + 4]) {
                before.store(self.get(at.min(BYTES - 4), 4), Ordering::Relaxed);
            }
        }
        written |= ((1 << bytes) - 1) << (place - first);
        partial.written.store(written, Ordering::Relaxed);
        let is_whole = written == (1 << size) - 1;
        let others = self.0.partials.load(Ordering::Relaxed) & !(1 << index);
        self.0.partials.store(others | u32::from(!is_whole) << index, Ordering::Relaxed);
    }

    /// Another word of the same RAM is written: the one before is in it.
    fn forget_partial(&self, place: u32) {
        if let Some(index) = ram_of(place) {
            self.0.partials.fetch_and(!(1 << index), Ordering::Relaxed);
        }
    }

    /// A reset: what was written last of a word in part is lost.
    pub(crate) fn drop_partial(&self) {
        let partials = self.0.partials.load(Ordering::Relaxed);
        for (index, partial) in self.0.partial.iter().enumerate() {
            let [first, written] =
                [&partial.place, &partial.written].map(|it| it.load(Ordering::Relaxed));
            let before = partial.before.each_ref().map(|word| word.load(Ordering::Relaxed));
            for at in (0..8).filter(|at| partials >> index & written >> at & 1 != 0) {
                self.put(first + at, 1, before[at as usize / 4] >> (8 * (at & 3)) & 0xFF);
            }
        }
        self.0.partials.store(0, Ordering::Relaxed);
    }

    /// The power goes: RAM is noise when it comes back, the flash stays.
    pub(crate) fn lose(&self, seed: u64) {
        for bank in BANKS.iter().filter(|bank| bank.base != FLASH) {
            let noise = noise(seed ^ u64::from(bank.base));
            for (place, noise) in (bank.start..bank.start + bank.length).step_by(8).zip(noise) {
                #[expect(clippy::cast_possible_truncation, reason = "one half, then the other")]
                let halves = [noise as u32, (noise >> 32) as u32];
                self.put(place, 4, halves[0]);
                self.put(place + 4, 4, halves[1]);
            }
        }
        self.0.partials.store(0, Ordering::Relaxed);
    }

    /// An instruction at this place is decoded: a write to it is to be told.
    pub(crate) fn mark_code(&self, place: u32) {
        self.0.code[(place / BLOCK) as usize].store(true, Ordering::Relaxed);
    }

    #[inline]
    pub(crate) fn is_stale(&self) -> bool {
        self.0.stale[1].load(Ordering::Relaxed) != 0
    }

    /// The addresses of instructions that were written since, perhaps; they are not asked for again.
    pub(crate) fn take_stale(&self) -> impl Iterator<Item = u32> {
        let [first, end] = self.0.stale.each_ref().map(|bound| bound.swap(0, Ordering::Relaxed));
        // One of four bytes may begin before.
        let places = (first & !1).saturating_sub(2)..end;
        places.step_by(2).filter_map(|place| {
            let bank = BANKS.iter().find(|bank| place.wrapping_sub(bank.start) < bank.length)?;
            Some(bank.base + (place - bank.start))
        })
    }

    /// Copies bytes out. Fails if no memory holds them all.
    pub fn read(&self, address: u32, to: &mut [u8]) -> Result<()> {
        let place = Self::place(address, to.len())?;
        for (place, byte) in (place..).zip(to) {
            [*byte, ..] = self.get(place, 1).to_le_bytes();
        }
        Ok(())
    }

    /// Copies bytes in. Fails if no memory holds them all.
    pub fn write(&self, address: u32, from: &[u8]) -> Result<()> {
        let place = Self::place(address, from.len())?;
        (place..).zip(from).for_each(|(place, &byte)| self.put(place, 1, byte.into()));
        Ok(())
    }

    /// A word. Fails if no memory holds it.
    pub fn word(&self, address: u32) -> Result<u32> {
        let mut bytes = [0; 4];
        self.read(address, &mut bytes)?;
        Ok(u32::from_le_bytes(bytes))
    }
}
