// A wire for the examples in the docs.
use embedded_io_async::Read;

/// A wire with bytes on it that then breaks.
pub struct Wire(pub &'static [u8]);

impl embedded_io_async::ErrorType for Wire {
    type Error = core::convert::Infallible;
}

impl Read for Wire {
    async fn read(&mut self, into: &mut [u8]) -> Result<usize, Self::Error> {
        if self.0.is_empty() {
            core::future::pending::<()>().await;
        }
        self.0.read(into).await
    }
}
