//! A test's handles of a serial link.

use std::cell::RefCell;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

use embedded_io_async::{ErrorType, Read, Write};

use crate::Nanos;
use crate::serial::{Link, SerialConfig, SerialCounters, SerialDevice, SerialEnd, UartFault};
use crate::world::Inner;

/// A serial link in full duplex of a [`World`](crate::World): a UART of the host's, and a device.
#[derive(Clone)]
pub struct Serial {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Serial {
    /// The host's port; all of them share one buffer.
    #[must_use]
    pub fn port(&self) -> UartPort {
        UartPort { link: self.clone() }
    }

    /// Its configuration.
    #[must_use]
    pub fn config(&self) -> SerialConfig {
        self.link(|link, _| link.config)
    }

    /// Puts the receiver of an emulated chip in the place of the host's port, whose buffer stays
    /// empty from then on. What the chip sends comes by [`deliver`](Self::deliver).
    ///
    /// The world borrows it while time passes; between its calls it is the caller's.
    pub fn attach(&self, chip: Rc<RefCell<dyn SerialEnd>>) {
        self.link(|link, _| link.attach(chip));
    }

    /// The attached chip sends a byte whose last stop bit ends at this time, now or later; those of
    /// several calls in the order of time.
    pub fn deliver(&self, byte: u8, at: Nanos) {
        self.link(|link, _| link.deliver(byte, at));
    }

    /// Damages the character that is on its way to the host: it is lost, and the port's next read
    /// that gets there fails so, once. If none is on its way, noise looks like one.
    pub fn inject(&self, fault: UartFault) {
        self.link(|link, now| link.inject(fault, now));
    }

    /// Cuts the link in both directions, or connects it again. Characters count as they begin.
    pub fn set_cut(&self, cut: bool) {
        self.link(|link, _| link.set_cut(cut));
    }

    /// Switches the device's power; it has it at first.
    pub fn set_power(&self, powered: bool) {
        self.link(|link, now| link.set_power(powered, now));
    }

    /// A look into the device, or a hand: `None` if it is not a `D`.
    pub fn with<D: SerialDevice, T>(&self, look: impl FnOnce(&mut D) -> T) -> Option<T> {
        self.link(|link, _| link.device().downcast_mut().map(look))
    }

    /// Counters since the world began.
    #[must_use]
    pub fn counters(&self) -> SerialCounters {
        self.link(|link, _| link.counters)
    }

    fn link<T>(&self, f: impl FnOnce(&mut Link, Nanos) -> T) -> T {
        let mut inner = self.inner.borrow_mut();
        let now = inner.clock.now_ns();
        f(&mut inner.serials[self.index], now)
    }
}

/// The host's UART at its end of a [`Serial`] link, with a receive buffer, in virtual time.
///
/// A read takes what is there, or waits for a byte; one that is dropped has taken nothing. Where
/// characters were lost it fails once, and the next goes on behind them. Writes never wait.
#[derive(Clone)]
pub struct UartPort {
    link: Serial,
}

impl ErrorType for UartPort {
    type Error = UartFault;
}

impl Read for UartPort {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, UartFault> {
        poll_fn(|context| {
            self.link.link(|link, _| match link.host.read(buffer) {
                Some(read) => Poll::Ready(read),
                None => {
                    link.host.reader = Some(context.waker().clone());
                    Poll::Pending
                }
            })
        })
        .await
    }
}

impl Write for UartPort {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, UartFault> {
        self.link.link(|link, _| link.host.waiting.extend(bytes));
        Ok(bytes.len())
    }

    /// Waits until the last stop bit has left.
    async fn flush(&mut self) -> Result<(), UartFault> {
        poll_fn(|context| {
            self.link.link(|link, _| {
                if link.has_sent_all() {
                    return Poll::Ready(Ok(()));
                }
                link.host.flusher = Some(context.waker().clone());
                Poll::Pending
            })
        })
        .await
    }
}
