//! AXI SRAM, which stays over a reset: for what happened before a crash.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

/// Its words: all of the 320 KiB but a rest.
pub const WORDS: usize = 81_864;

/// A place for the one black box of a program.
#[repr(align(8))]
pub struct BlackBox(UnsafeCell<MaybeUninit<[u32; WORDS]>>);

// SAFETY: what it refers to is touched in critical sections only, but for reads that may find it half written.
unsafe impl Sync for BlackBox {}

/// The black box of this program. Its name is for those who read it from outside.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".axi_sram.rc10_black_box")]
pub static RC10_BLACK_BOX: BlackBox = BlackBox(UnsafeCell::new(MaybeUninit::uninit()));

impl BlackBox {
    /// Does something with the memory; not within another such work.
    pub fn with<R>(&self, work: impl FnOnce(&mut [u32; WORDS]) -> R) -> R {
        critical_section::with(|_| {
            // SAFETY: any bits are words; a critical section is not entered twice, and none of ours calls this in another.
            work(unsafe { &mut *self.0.get().cast::<[u32; WORDS]>() })
        })
    }

    /// Copies words without holding anybody up: they may be written meanwhile, each at once. Fewer at the end.
    pub fn copy(&self, from: usize, to: &mut [u8]) -> usize {
        let words = self.0.get().cast::<u32>();
        let mut copied = 0;
        for (at, bytes) in (from..WORDS).zip(to.as_chunks_mut().0) {
            // SAFETY: within the memory; a word is read at once, whatever it is.
            *bytes = unsafe { words.add(at).read_volatile() }.to_le_bytes();
            copied += 4;
        }
        copied
    }
}
