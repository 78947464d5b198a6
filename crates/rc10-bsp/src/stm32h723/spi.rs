//! An SPI bus whose DMA reaches SRAM1 only.
//!
//! Drivers keep their bytes on the stack, in DTCM: embassy-stm32's SPI panics, [`DmaSpi`] copies.

use embedded_hal_async::spi::{ErrorType, SpiBus};

use crate::dma::DmaBuffer;

/// An [`SpiBus`] through SRAM1, in pieces of `N` bytes: make that the longest transfer.
///
/// ```ignore
/// let bus = Spi::new(p.SPI1, sck, mosi, miso, transmit, receive, Irqs, config);
/// let bus = DmaSpi::new(bus, dma_buffer!(u8; 64));
/// ```
///
/// embassy-stm32 leaves its DMA interrupts at the most urgent priority; set it before.
pub struct DmaSpi<B, const N: usize> {
    bus: B,
    memory: &'static mut [u8; N],
}

impl<B: SpiBus, const N: usize> DmaSpi<B, N> {
    /// A bus that sends from, and receives into, `buffer`.
    pub const fn new(bus: B, buffer: DmaBuffer<u8, N>) -> Self {
        Self { bus, memory: buffer.elements() }
    }
}

impl<B: ErrorType, const N: usize> ErrorType for DmaSpi<B, N> {
    type Error = B::Error;
}

impl<B: SpiBus, const N: usize> SpiBus for DmaSpi<B, N> {
    async fn read(&mut self, words: &mut [u8]) -> Result<(), B::Error> {
        for piece in words.chunks_mut(N) {
            let memory = &mut self.memory[..piece.len()];
            self.bus.read(memory).await?;
            piece.copy_from_slice(memory);
        }
        Ok(())
    }

    async fn write(&mut self, words: &[u8]) -> Result<(), B::Error> {
        for piece in words.chunks(N) {
            let memory = &mut self.memory[..piece.len()];
            memory.copy_from_slice(piece);
            self.bus.write(memory).await?;
        }
        Ok(())
    }

    /// Zeros follow where `write` is the shorter one: in the same transfer, as the chip may clock on behind one.
    async fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), B::Error> {
        let length = read.len().max(write.len());
        for start in (0..length).step_by(N) {
            let memory = &mut self.memory[..N.min(length - start)];
            memory.fill(0);
            for (own, sent) in memory.iter_mut().zip(write.iter().skip(start)) {
                *own = *sent;
            }
            self.bus.transfer_in_place(memory).await?;
            for (received, own) in read.iter_mut().skip(start).zip(&*memory) {
                *received = *own;
            }
        }
        Ok(())
    }

    async fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), B::Error> {
        for piece in words.chunks_mut(N) {
            let memory = &mut self.memory[..piece.len()];
            memory.copy_from_slice(piece);
            self.bus.transfer_in_place(memory).await?;
            piece.copy_from_slice(memory);
        }
        Ok(())
    }

    async fn flush(&mut self) -> Result<(), B::Error> {
        self.bus.flush().await
    }
}
