use core::cell::Cell;
use core::fmt;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::Read;
use rc10_can::Micros;

use crate::{Counters, Protocol, Stream};

/// What [`listen`] received so far, for other tasks to read.
pub struct Reception(Mutex<CriticalSectionRawMutex, Cell<Counters>>);

impl Reception {
    /// Nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(Mutex::new(Cell::new(Counters { frames: 0, damaged: 0, skipped: 0, port_errors: 0 })))
    }

    /// What was received so far.
    #[must_use]
    pub fn read(&self) -> Counters {
        self.0.lock(Cell::get)
    }

    fn write(&self, counters: Counters) {
        self.0.lock(|cell| cell.set(counters));
    }
}

impl Default for Reception {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for Reception {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Reception").field(&self.read()).finish()
    }
}

/// Bytes taken from the port at once.
const RECEIVE: usize = 64;
/// A port that always fails at once must not keep the processor busy.
const ERROR_PAUSE: Duration = Duration::from_micros(100);

/// Listens to a serial device for ever, and hands each message and its time to `hear`.
///
/// `port` must read as soon as there are bytes, not only when its buffer is full, and go on after
/// an error: [`Counters::port_errors`] counts those.
pub async fn listen<P: Protocol>(
    mut port: impl Read,
    protocol: P,
    reception: &Reception,
    mut hear: impl FnMut(P::Message, Micros),
) -> ! {
    let mut stream = Stream::new(protocol);
    let mut received = [0; RECEIVE];
    loop {
        match port.read(&mut received).await {
            Ok(count) if count > 0 => {
                let at = Micros::new(Instant::now().as_micros());
                let bytes = received.get(..count).unwrap_or_default();
                stream.receive(bytes, at, |message| hear(message, at));
            }
            // The end of something that has none is an error, too.
            _ => {
                stream.interrupt();
                Timer::after(ERROR_PAUSE).await;
            }
        }
        reception.write(stream.counters());
    }
}
