use core::cell::Cell;
use core::fmt;
use core::pin::pin;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embedded_io_async::Read;
use rc10_time::Micros;

use crate::{Counters, Protocol, Stream};

/// Counters of a loop ([`listen`], [`remote::listen_pulses`](crate::remote::listen_pulses)).
pub struct Reception(Mutex<CriticalSectionRawMutex, Cell<Counters>>);

impl Reception {
    /// Nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(Mutex::new(Cell::new(Counters { frames: 0, damaged: 0, skipped: 0, port_errors: 0 })))
    }

    /// The counters so far.
    pub fn read(&self) -> Counters {
        self.0.lock(Cell::get)
    }

    /// Says how it goes to a sensor that is read, not listened to: samples, samples that it spoilt, errors of the port.
    pub fn count(&self, frames: u32, damaged: u32, port_errors: u32) {
        self.write(Counters { frames, damaged, skipped: 0, port_errors });
    }

    /// Says how it goes to what is heard by a loop of its own.
    pub fn write(&self, counters: Counters) {
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

const RECEIVE: usize = 64;
/// A port that always fails must not keep the processor busy. What comes meanwhile waits in it.
const ERROR_PAUSE: Duration = Duration::from_millis(4);

/// Listens to a serial device for ever, and hands each message and its time to `hear`.
///
/// `port` must read as soon as there are bytes, and go on after an error, which
/// [`Counters::port_errors`] counts; 4 ms later it reads on. A [`Protocol::PAUSE`] is heard when
/// `port` had nothing to read that long; a late task hears none rather than a wrong one.
pub async fn listen<P: Protocol>(
    mut port: impl Read,
    protocol: P,
    reception: &Reception,
    mut hear: impl FnMut(P::Message, Micros),
) -> ! {
    let mut stream = Stream::new(protocol);
    let mut received = [0; RECEIVE];
    let mut at = now();
    loop {
        let result = {
            let mut read = pin!(port.read(&mut received));
            // The same read goes on after a pause: dropping one might lose bytes.
            match P::PAUSE.map(|pause| Duration::from_micros(pause.length().get())) {
                Some(pause) => match with_timeout(pause, read.as_mut()).await {
                    Ok(result) => result,
                    Err(_) => {
                        stream.receive(&[], now(), |message| hear(message, at));
                        reception.write(stream.counters());
                        read.await
                    }
                },
                None => read.await,
            }
        };
        at = now();
        match result {
            Ok(count) if count > 0 => {
                let bytes = received.get(..count).unwrap_or_default();
                stream.receive(bytes, at, |message| hear(message, at));
            }
            // The end of something that has none is an error, too.
            _ => {
                stream.interrupt();
                // Silence counts from here.
                stream.receive(&[], at, |message| hear(message, at));
                Timer::after(ERROR_PAUSE).await;
            }
        }
        reception.write(stream.counters());
    }
}

fn now() -> Micros {
    Micros::new(Instant::now().as_micros())
}
