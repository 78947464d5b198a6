//! The chip's memories (RM0468, memory organisation).

use std::sync::Arc;

use anyhow::{Context, Result, anyhow};
use rsemu::core::space::RamStore;

use crate::image::Image;

/// Base and length of the peripherals' address range.
pub const PERIPHERALS: (u32, u32) = (0x4000_0000, 0x2000_0000);

/// One memory.
pub struct Bank {
    /// Name in the manual.
    pub name: &'static str,
    /// Its first address.
    pub base: u32,
    store: Arc<RamStore>,
}

impl Bank {
    pub(crate) fn store(&self) -> Arc<RamStore> {
        Arc::clone(&self.store)
    }
}

/// Name, first address and length of every memory.
const BANKS: [(&str, u32, u64); 8] = [
    ("ITCM", 0x0000_0000, 64 << 10),
    ("flash", 0x0800_0000, 1 << 20),
    ("DTCM", 0x2000_0000, 128 << 10),
    ("AXI SRAM", 0x2400_0000, 320 << 10),
    ("SRAM1", 0x3000_0000, 16 << 10),
    ("SRAM2", 0x3000_4000, 16 << 10),
    ("SRAM4", 0x3800_0000, 16 << 10),
    ("backup SRAM", 0x3880_0000, 4 << 10),
];

/// Address of the processor's first instruction.
pub const FLASH: u32 = BANKS[1].1;

/// Contents of a RAM at power-on: random, and the same for the same seed.
pub(crate) fn noise(seed: u64) -> impl Iterator<Item = u64> {
    // SplitMix64 (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators).
    (1_u64..).map(move |count| {
        let state = seed.wrapping_add(count.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let mixed = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    })
}

/// All memories. A reset leaves them as they are.
pub struct Memory {
    banks: Vec<Bank>,
}

impl Memory {
    /// As power-on leaves them: noise, other noise for another seed; erased flash is full of ones.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let banks = BANKS.map(|(name, base, length)| {
            let store = Arc::new(RamStore::new(length));
            // Neither can fail: it is the whole store.
            let _ = if base == FLASH {
                store.fill(0, length, 0xFF)
            } else {
                let words = usize::try_from(length / 8).unwrap_or(0);
                let words = noise(seed ^ u64::from(base)).take(words).flat_map(u64::to_le_bytes);
                store.write_at(0, &words.collect::<Vec<_>>())
            };
            Bank { name, base, store }
        });
        Self { banks: banks.into() }
    }

    /// Memories with a program in them.
    ///
    /// # Errors
    /// If it does not fit.
    pub fn with(image: &Image, seed: u64) -> Result<Self> {
        let memory = Self::new(seed);
        for (address, bytes) in &image.segments {
            memory.write(*address, bytes).context("the program does not fit")?;
        }
        Ok(memory)
    }

    /// The banks, in the order of their addresses.
    #[must_use]
    pub fn banks(&self) -> &[Bank] {
        &self.banks
    }

    fn bank(&self, address: u32, length: usize) -> Result<(&Bank, u64)> {
        let place = self.banks.iter().find_map(|bank| {
            let offset = u64::from(address.checked_sub(bank.base)?);
            let end = offset.checked_add(u64::try_from(length).ok()?)?;
            (end <= bank.store.len()).then_some((bank, offset))
        });
        place.ok_or_else(|| anyhow!("no memory holds {length} bytes at {address:#010x}"))
    }

    /// Copies bytes out.
    ///
    /// # Errors
    /// If no memory holds them all.
    pub fn read(&self, address: u32, to: &mut [u8]) -> Result<()> {
        let (bank, offset) = self.bank(address, to.len())?;
        bank.store.read_at(offset, to).map_err(|error| anyhow!("{}: {error:?}", bank.name))
    }

    /// Copies bytes in.
    ///
    /// # Errors
    /// If no memory holds them all.
    pub fn write(&self, address: u32, from: &[u8]) -> Result<()> {
        let (bank, offset) = self.bank(address, from.len())?;
        bank.store.write_at(offset, from).map_err(|error| anyhow!("{}: {error:?}", bank.name))
    }

    /// A word.
    ///
    /// # Errors
    /// If no memory holds it.
    pub fn word(&self, address: u32) -> Result<u32> {
        let mut bytes = [0; 4];
        self.read(address, &mut bytes)?;
        Ok(u32::from_le_bytes(bytes))
    }
}

impl Clone for Memory {
    /// The same memories, not a copy of them: what a DMA controller sees.
    fn clone(&self) -> Self {
        let banks = self.banks.iter();
        let banks =
            banks.map(|bank| Bank { name: bank.name, base: bank.base, store: bank.store() });
        Self { banks: banks.collect() }
    }
}
