//! A ring of entries in AXI SRAM, which stays over a reset: what happened before a crash.
//!
//! An entry is words: the number of those behind the first stands in bits 16 to 23 of that. When the ring is full, the
//! oldest entries go, whole. A debugger, or a PC behind a probe, reads it as it lies there: [`Ring`].

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{Ordering, compiler_fence};

/// Words of entries in the ring: 256 KiB.
pub const WORDS: usize = 65_536;

/// The ring in memory, little endian. Its ends are one word of 64 bits: a reset loses one that was written by half.
#[repr(C, align(8))]
pub struct Ring {
    /// [`MAGIC`] and [`PROOF`] or anything.
    magic: [u32; 2],
    /// Words written so far, and those that have gone: both modulo 2^32.
    ends: [u32; 2],
    /// Number of times that the robot must be armed before what a crash has left goes; and nothing.
    held: [u32; 2],
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
        self.with(|ring| (ring.ends, ring.held, ring.magic[0]) = ([0; 2], [0; 2], MAGIC));
    }

    /// Keeps what is there until the robot has been armed so many times.
    pub fn hold(&self, armings: u32) {
        self.with(|ring| ring.held = [armings; 2]);
    }

    /// How many times it must still be armed, as of a run before.
    pub fn held(&self) -> u32 {
        // A reset may have lost one half.
        self.with(|ring| ring.held[0].max(ring.held[1]).min(2))
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
            // First: a reset in between must not find an end in the midst of what is written now.
            ring.ends[1] = tail;
            compiler_fence(Ordering::SeqCst);
            for word in entry {
                ring.words[(head & MASK) as usize] = *word;
                head = head.wrapping_add(1);
            }
            compiler_fence(Ordering::SeqCst);
            ring.ends = [head, tail];
        });
    }
}
