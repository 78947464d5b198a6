//! A ring of entries in AXI SRAM, which stays over a reset: what happened before a crash.
//!
//! An entry is words: the number of those behind the first stands in bits 16 to 23 of that. When the ring is full, the
//! oldest entries go, whole. A debugger, or a PC behind a probe, reads it as it lies there: [`Ring`].

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

/// Words of entries in the ring: 256 KiB.
pub const WORDS: usize = 65_536;

/// The ring in memory, little endian. Its ends are one word of 64 bits: a reset loses one that was written by half.
#[repr(C, align(8))]
pub struct Ring {
    /// [`MAGIC`] and [`PROOF`] or anything.
    magic: [u32; 2],
    /// Words written so far, and those that have gone: both modulo 2^32.
    ends: [u32; 2],
    words: [u32; WORDS],
}

/// Tells a ring from memory that has no power since.
pub const MAGIC: u32 = 0x524E_4731;
/// The wish of a test bench, before the start: more detail.
pub const PROOF: u32 = 0x5052_4F46;

/// A place for the one ring of a program.
pub struct BlackBox(UnsafeCell<MaybeUninit<Ring>>);

// SAFETY: what it refers to is touched in critical sections only.
unsafe impl Sync for BlackBox {}

/// The ring of this program. Its name is for those who read it from outside.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".axi_sram.rc10_black_box")]
pub static RC10_BLACK_BOX: BlackBox = BlackBox(UnsafeCell::new(MaybeUninit::uninit()));

impl BlackBox {
    fn with<R>(&self, work: impl FnOnce(&mut Ring) -> R) -> R {
        critical_section::with(|_| {
            // SAFETY: any bits are a ring; a critical section is not entered twice, and none of ours calls this in another.
            work(unsafe { &mut *self.0.get().cast::<Ring>() })
        })
    }

    /// Whether a ring of an earlier run is there.
    pub fn is_kept(&self) -> bool {
        self.with(|ring| {
            let [head, tail] = ring.ends;
            ring.magic[0] == MAGIC && head != tail && head.wrapping_sub(tail) <= WORDS as u32
        })
    }

    /// Begins anew.
    pub fn clear(&self) {
        self.with(|ring| {
            ring.ends = [0; 2];
            ring.magic[0] = MAGIC;
        });
    }

    /// Whether a test bench wishes more detail.
    pub fn is_proof(&self) -> bool {
        self.with(|ring| ring.magic[1] == PROOF)
    }

    /// Adds an entry.
    pub fn put(&self, entry: &[u32]) {
        const MASK: u32 = WORDS as u32 - 1;
        self.with(|ring| {
            let [mut head, mut tail] = ring.ends;
            let after = head.wrapping_add(entry.len() as u32);
            while after.wrapping_sub(tail) > WORDS as u32 {
                tail = tail.wrapping_add(1 + (ring.words[(tail & MASK) as usize] >> 16 & 0xFF));
            }
            for word in entry {
                ring.words[(head & MASK) as usize] = *word;
                head = head.wrapping_add(1);
            }
            ring.ends = [head, tail];
        });
    }
}
