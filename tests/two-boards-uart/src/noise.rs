//! A port that damages bytes.

use core::sync::atomic::{AtomicU32, Ordering};

use rc10::io::{ErrorType, Read, Write};

/// How many bytes of 100,000 are damaged, in each direction, and how many were.
#[derive(Default)]
pub struct Noise {
    /// Of 100,000 bytes.
    pub rate: AtomicU32,
    /// So far.
    pub damaged: AtomicU32,
}

/// A port with noise.
pub struct Noisy<'n, P> {
    port: P,
    noise: &'n Noise,
    random: u64,
}

impl<'n, P> Noisy<'n, P> {
    /// A port, and what damages its bytes.
    pub const fn new(port: P, noise: &'n Noise) -> Self {
        Self { port, noise, random: 1 }
    }

    fn damage(&mut self, bytes: &mut [u8]) {
        let rate = u64::from(self.noise.rate.load(Ordering::Relaxed));
        for byte in bytes.iter_mut().filter(|_| rate > 0) {
            self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            if (self.random >> 33) % 100_000 < rate {
                *byte ^= ((self.random >> 55) % 255) as u8 + 1;
                self.noise.damaged.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

impl<P: ErrorType> ErrorType for Noisy<'_, P> {
    type Error = P::Error;
}

impl<P: Read> Read for Noisy<'_, P> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, P::Error> {
        let count = self.port.read(buffer).await?;
        self.damage(&mut buffer[..count]);
        Ok(count)
    }
}

impl<P: Write> Write for Noisy<'_, P> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, P::Error> {
        let (mut buffer, count) = ([0; 256], bytes.len().min(256));
        buffer[..count].copy_from_slice(&bytes[..count]);
        self.damage(&mut buffer[..count]);
        self.port.write_all(&buffer[..count]).await?;
        Ok(count)
    }

    async fn flush(&mut self) -> Result<(), P::Error> {
        self.port.flush().await
    }
}
