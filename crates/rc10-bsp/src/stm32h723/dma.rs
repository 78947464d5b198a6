//! DMA1 and DMA2 by their registers (RM0468, DMA and DMAMUX chapters), and the memory they reach.
//!
//! **They do not reach DTCM**, where stack and statics lie: a transfer from there ends in an error.
//! Memory that a DMA reads or writes lies in SRAM1, and [`dma_buffer!`](crate::dma_buffer) is the
//! only way to have a [`DmaBuffer`]. The data cache is off, so nothing has to be kept coherent.
//!
//! embassy-stm32's channels serve its own drivers: they panic on a transfer error, and their ring
//! stops at a line error. Its channel types and request numbers are used here.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering, fence};

use embassy_stm32::dma::ChannelInstance;
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::Interrupt;
use embassy_stm32::pac::dma::{regs, vals};
use embassy_stm32::{pac, peripherals};

/// A type that the elements of a [`DmaBuffer`] can have.
pub trait Element: Copy + 'static {
    #[doc(hidden)]
    const ZERO: Self;
    #[doc(hidden)]
    const SIZE: vals::Size;
}

impl Element for u8 {
    const ZERO: Self = 0;
    const SIZE: vals::Size = vals::Size::BITS8;
}
impl Element for u32 {
    const ZERO: Self = 0;
    const SIZE: vals::Size = vals::Size::BITS32;
}

/// Memory of DMA1 and DMA2, in SRAM1; [`dma_buffer!`](crate::dma_buffer) makes one of zeros.
pub struct DmaBuffer<T: Element, const N: usize>(&'static mut [T; N]);

impl<T: Element, const N: usize> DmaBuffer<T, N> {
    /// The elements, for drivers that give them to a DMA themselves, as embassy-stm32's do.
    #[must_use]
    pub const fn elements(self) -> &'static mut [T; N] {
        self.0
    }

    pub(super) const fn memory(self) -> DmaMemory<T> {
        DmaMemory { start: self.0.as_mut_ptr(), length: N }
    }
}

/// For [`dma_buffer!`](crate::dma_buffer), which puts it where it must be: what a buffer is made of.
#[doc(hidden)]
#[repr(C, align(4))]
pub struct Storage<T, const N: usize>(UnsafeCell<MaybeUninit<[T; N]>>);

// SAFETY: `take` hands it out once; nothing else looks inside.
unsafe impl<T: Element, const N: usize> Sync for Storage<T, N> {}

#[doc(hidden)]
impl<T: Element, const N: usize> Storage<T, N> {
    #[must_use]
    #[expect(clippy::new_without_default, reason = "there is no use for it outside of the macro")]
    pub const fn new() -> Self {
        const { assert!(N > 0 && N <= 0xFFFF, "a DMA stream counts 1 ..= 65535 elements") };
        Self(UnsafeCell::new(MaybeUninit::uninit()))
    }

    /// # Panics
    /// If it has been taken before.
    #[must_use]
    pub fn take(&'static self, taken: &AtomicBool) -> DmaBuffer<T, N> {
        assert!(!taken.swap(true, Ordering::AcqRel), "a DMA buffer is taken once");
        // SAFETY: the first time and the only one, as just checked. Aligned, and as long as a static.
        let memory = unsafe { &mut *self.0.get() };
        // No start-up code clears SRAM1: it has no clock then.
        DmaBuffer(memory.write([T::ZERO; N]))
    }
}

/// Makes a [`DmaBuffer`](crate::dma::DmaBuffer) in SRAM1, full of zeros.
///
/// ```ignore
/// let received = rc10_bsp::dma_buffer!(u8; 256);
/// ```
///
/// # Panics
/// If the same place in the code is passed twice.
#[macro_export]
macro_rules! dma_buffer {
    ($element:ty; $length:expr) => {{
        // SAFETY: the section is in memory.x; nothing else is in that memory.
        #[unsafe(link_section = ".sram1.dma")]
        static DMA_BUFFER: $crate::dma::Storage<$element, { $length }> =
            $crate::dma::Storage::new();
        static TAKEN: core::sync::atomic::AtomicBool = core::sync::atomic::AtomicBool::new(false);
        DMA_BUFFER.take(&TAKEN)
    }};
}

/// Elements of a [`DmaBuffer`] that a stream may work on: copies share it, accesses are volatile.
#[derive(Clone, Copy)]
pub(super) struct DmaMemory<T> {
    start: *mut T,
    length: usize,
}

// SAFETY: its memory is a static's; accesses are volatile and inside it.
unsafe impl<T: Element> Send for DmaMemory<T> {}
// SAFETY: who shares it reads only, and by volatile accesses.
unsafe impl<T: Element> Sync for DmaMemory<T> {}

impl<T: Element> DmaMemory<T> {
    pub const fn length(&self) -> usize {
        self.length
    }

    /// An element as it is now; zero beyond the last.
    #[inline]
    pub fn read(&self, index: usize) -> T {
        if index >= self.length {
            return T::ZERO;
        }
        // SAFETY: inside the buffer, which has been initialised; volatile, because a DMA may write.
        unsafe { self.start.add(index).read_volatile() }
    }

    /// Fills it from the front; returns how many fitted.
    #[inline]
    pub fn fill(&mut self, values: impl Iterator<Item = T>) -> usize {
        let mut count = 0;
        for value in values.take(self.length) {
            // SAFETY: inside the buffer.
            unsafe { self.start.add(count).write_volatile(value) };
            count += 1;
        }
        count
    }

    pub fn address(&self) -> u32 {
        self.start as u32
    }
}

impl DmaMemory<u8> {
    /// Fills it from the front; returns how many bytes fitted. No stream may be working on it.
    pub fn copy(&mut self, bytes: &[u8]) -> usize {
        let bytes = &bytes[..bytes.len().min(self.length)];
        let (chunks, rest) = bytes.as_chunks::<16>();
        for (at, chunk) in chunks.iter().enumerate() {
            // SAFETY: inside the buffer, which nothing else accesses.
            unsafe { self.start.add(16 * at).cast::<[u8; 16]>().write(*chunk) };
        }
        for (at, byte) in (16 * chunks.len()..).zip(rest) {
            // SAFETY: the same.
            unsafe { self.start.add(at).write(*byte) };
        }
        // They are there before a stream begins.
        fence(Ordering::SeqCst);
        bytes.len()
    }
}

/// One stream of DMA1 or DMA2, and its input of DMAMUX1.
#[derive(Clone, Copy)]
pub struct Stream {
    controller: pac::dma::Dma,
    index: usize,
    router: usize,
}

pub(super) struct Transfer {
    /// DMAMUX1's number of what asks for the elements.
    pub request: u8,
    /// Address of the peripheral's register.
    pub peripheral: u32,
    pub to_peripheral: bool,
    /// Starts over at its end, and tells of its half too.
    pub circular: bool,
    /// RM0468, `DMA_SxCR.TRBUFF`: to be set for UARTs.
    pub is_serial: bool,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Events {
    pub half: bool,
    pub complete: bool,
    /// Whether the stream has stopped.
    pub error: bool,
}

impl Stream {
    const fn new(controller: pac::dma::Dma, index: usize, router: usize) -> Self {
        Self { controller, index, router }
    }

    /// 0 ..= 15, over both controllers.
    pub(super) const fn number(self) -> usize {
        self.router
    }

    /// Transfers the first `items` of `memory`; the caller owns and keeps both until the end.
    pub(super) fn start<T: Element>(
        self,
        transfer: &Transfer,
        memory: &DmaMemory<T>,
        items: usize,
    ) {
        self.stop();
        self.take_events();
        let route = pac::DMAMUX1.ccr(self.router);
        route.write(|w| w.set_dmareq_id(transfer.request));
        let stream = self.controller.st(self.index);
        stream.par().write_value(transfer.peripheral);
        stream.m0ar().write_value(memory.address());
        let items = items.min(memory.length());
        stream.ndtr().write(|w| w.set_ndt(u16::try_from(items).unwrap_or(u16::MAX)));
        stream.fcr().modify(|w| w.set_dmdis(vals::Dmdis::ENABLED));
        // What the processor wrote to the memory is there before the stream reads it.
        fence(Ordering::SeqCst);
        cortex_m::asm::dsb();
        stream.cr().write(|w| {
            w.set_dir(if transfer.to_peripheral {
                vals::Dir::MEMORY_TO_PERIPHERAL
            } else {
                vals::Dir::PERIPHERAL_TO_MEMORY
            });
            w.set_minc(true);
            w.set_msize(T::SIZE);
            w.set_psize(T::SIZE);
            w.set_circ(transfer.circular);
            // Received bytes do not wait.
            w.set_pl(if transfer.to_peripheral { vals::Pl::MEDIUM } else { vals::Pl::HIGH });
            w.set_trbuff(transfer.is_serial);
            w.set_htie(transfer.circular);
            w.set_tcie(true);
            w.set_teie(true);
            w.set_en(true);
        });
    }

    /// Stops it, and waits until it has: an element on its way is moved first.
    pub(super) fn stop(self) {
        let control = self.controller.st(self.index).cr();
        if control.read().en() {
            control.modify(|w| w.set_en(false));
            while control.read().en() {}
        }
    }

    #[inline]
    pub(super) fn is_running(self) -> bool {
        self.controller.st(self.index).cr().read().en()
    }

    /// Elements until its end.
    #[inline]
    pub(super) fn remaining(self) -> u16 {
        self.controller.st(self.index).ndtr().read().ndt()
    }

    /// The events since the last call.
    #[inline]
    pub(super) fn take_events(self) -> Events {
        // Six bits a stream (RM0468, DMA_LISR): FIFO error, -, direct mode error, transfer error,
        // half, complete. By hand, because every interrupt of a serial port runs this.
        const ALL: u32 = 0b11_1101;
        let (half, shift) = (self.index / 4, [0, 6, 16, 22][self.index % 4]);
        let flags = self.controller.isr(half).read().0 >> shift & ALL;
        self.controller.ifcr(half).write_value(regs::Ixr(flags << shift));
        let is_set = |bit: u32| flags >> bit & 1 != 0;
        Events { half: is_set(4), complete: is_set(5), error: is_set(3) }
    }
}

/// A stream of DMA1 or DMA2, as embassy-stm32 names it: `DMA1_CH0` is stream 0 of DMA1.
pub trait DmaStream: ChannelInstance {
    #[doc(hidden)]
    const STREAM: Stream;
}

macro_rules! streams {
    ($($name:ident $controller:ident $index:literal $router:literal),* $(,)?) => {
        $(impl DmaStream for peripherals::$name {
            const STREAM: Stream = Stream::new(pac::$controller, $index, $router);
        })*
    };
}

streams!(
    DMA1_CH0 DMA1 0 0,
    DMA1_CH1 DMA1 1 1,
    DMA1_CH2 DMA1 2 2,
    DMA1_CH3 DMA1 3 3,
    DMA1_CH4 DMA1 4 4,
    DMA1_CH5 DMA1 5 5,
    DMA1_CH6 DMA1 6 6,
    DMA1_CH7 DMA1 7 7,
    DMA2_CH0 DMA2 0 8,
    DMA2_CH1 DMA2 1 9,
    DMA2_CH2 DMA2 2 10,
    DMA2_CH3 DMA2 3 11,
    DMA2_CH4 DMA2 4 12,
    DMA2_CH5 DMA2 5 13,
    DMA2_CH6 DMA2 6 14,
    DMA2_CH7 DMA2 7 15,
);

/// Switches an interrupt on whose handler is bound.
pub(super) fn enable<I: Interrupt>(priority: Priority) {
    I::set_priority(priority);
    I::unpend();
    // SAFETY: the callers ask for a `Binding` of the handler, which needs nothing else.
    unsafe { I::enable() };
}
