//! The host's end of a serial line or link.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::{Poll, Waker};

use embedded_io_async::{ErrorKind, ErrorType, Read, Write};

use crate::Nanos;
use crate::world::Inner;

/// The receiver of an emulated chip, in place of the host's port.
pub trait SerialEnd {
    /// A character begins on the wire: the first edge of its start bit, and the end of its last
    /// stop bit.
    fn hear(&mut self, byte: u8, start: Nanos, end: Nanos);

    /// Something damages the character that is on the wire, or looks like a damaged one.
    fn disturb(&mut self, _fault: UartFault, _at: Nanos) {}
}

/// Errors that a UART tells of a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
pub enum UartFault {
    /// The receive register was full.
    #[error("overrun: bytes were not taken in time")]
    Overrun,
    /// No stop bit.
    #[error("framing error: no stop bit")]
    Framing,
    /// The parity bit is wrong.
    #[error("parity error")]
    Parity,
    /// The samples of a bit differ.
    #[error("noise within a bit")]
    Noise,
    /// The line was low for longer than a character.
    #[error("break: the line was held low")]
    Break,
}

impl UartFault {
    /// Each of them.
    pub const ALL: [Self; 5] =
        [Self::Overrun, Self::Framing, Self::Parity, Self::Noise, Self::Break];
}

impl embedded_io_async::Error for UartFault {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Overrun => ErrorKind::Other,
            _ => ErrorKind::InvalidData,
        }
    }
}

/// The receive buffer of a host, and the tasks that wait at its port.
#[derive(Default)]
pub(crate) struct HostEnd {
    received: VecDeque<Result<u8, UartFault>>,
    reader: Option<Waker>,
    flusher: Option<Waker>,
    /// An emulated chip's receiver, in place of the port.
    pub(crate) chip: Option<Rc<RefCell<dyn SerialEnd>>>,
}

impl HostEnd {
    pub(crate) fn has_room(&self, capacity: usize) -> bool {
        self.received.iter().filter(|heard| heard.is_ok()).count() < capacity
    }

    /// Keeps a byte. A run of lost ones is one fault.
    pub(crate) fn hear(&mut self, heard: Result<u8, UartFault>) {
        if heard.is_ok() || self.received.back() != Some(&heard) {
            self.received.push_back(heard);
        }
    }

    /// Takes what there is up to the next fault, or that fault; `None` if there is nothing.
    fn read(&mut self, buffer: &mut [u8]) -> Option<Result<usize, UartFault>> {
        if buffer.is_empty() {
            return Some(Ok(0));
        }
        if let Err(fault) = *self.received.front()? {
            self.received.pop_front();
            return Some(Err(fault));
        }
        let mut count = 0;
        for (to, byte) in buffer.iter_mut().zip(self.received.iter().map_while(|heard| heard.ok()))
        {
            *to = byte;
            count += 1;
        }
        self.received.drain(..count);
        Some(Ok(count))
    }
}

/// A wire with a host at one end.
pub(crate) trait Hosted {
    fn host(&mut self) -> &mut HostEnd;

    /// The host sends bytes, after those that wait already.
    fn send(&mut self, bytes: &[u8], now: Nanos);

    /// Whether the last stop bit of the host has left.
    fn has_sent_all(&self) -> bool;

    /// Takes the tasks that wait for what is there now.
    fn take_wakers(&mut self, due: &mut Vec<Waker>) {
        let has_sent_all = self.has_sent_all();
        let host = self.host();
        due.extend(host.reader.take_if(|_| !host.received.is_empty()));
        due.extend(host.flusher.take_if(|_| has_sent_all));
    }
}

/// A wire of a world, by its number.
#[derive(Clone, Copy)]
pub(crate) enum Medium {
    Line(usize),
    Serial(usize),
}

/// The host's UART at its end of a [`Serial`](crate::Serial) link or a [`Line`](crate::Line), with a
/// receive buffer, in virtual time.
///
/// A read takes what is there, or waits for a byte; one that is dropped has taken nothing. Where
/// characters were lost it fails once, and the next goes on behind them. Writes never wait.
#[derive(Clone)]
#[must_use]
pub struct UartPort {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) medium: Medium,
}

impl UartPort {
    fn with<T>(&self, f: impl FnOnce(&mut dyn Hosted, Nanos) -> T) -> T {
        Inner::with(&self.inner, |inner, now| match self.medium {
            Medium::Line(index) => f(&mut inner.lines[index], now),
            Medium::Serial(index) => f(&mut inner.serials[index], now),
        })
    }

    /// Sends bytes, after those that wait already. Never waits.
    pub fn send(&mut self, bytes: &[u8]) {
        self.with(|wire, now| wire.send(bytes, now));
    }

    /// Takes the bytes received since the last time. Never waits.
    pub fn take_received(&mut self) -> Vec<u8> {
        self.with(|wire, _| wire.host().received.drain(..).flatten().collect())
    }
}

impl ErrorType for UartPort {
    type Error = UartFault;
}

impl Read for UartPort {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, UartFault> {
        poll_fn(|context| {
            self.with(|wire, _| match wire.host().read(buffer) {
                Some(read) => Poll::Ready(read),
                None => {
                    wire.host().reader = Some(context.waker().clone());
                    Poll::Pending
                }
            })
        })
        .await
    }
}

impl Write for UartPort {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, UartFault> {
        self.send(bytes);
        Ok(bytes.len())
    }

    /// Waits until the last stop bit has left.
    async fn flush(&mut self) -> Result<(), UartFault> {
        poll_fn(|context| {
            self.with(|wire, _| {
                if wire.has_sent_all() {
                    return Poll::Ready(Ok(()));
                }
                wire.host().flusher = Some(context.waker().clone());
                Poll::Pending
            })
        })
        .await
    }
}
