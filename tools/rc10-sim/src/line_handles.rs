//! Handles of a serial line.

use std::cell::RefCell;
use std::convert::Infallible;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

use embedded_io_async::{ErrorType, Read, Write};

use crate::Nanos;
use crate::device::{Electronics, Place};
use crate::handles::Esc;
use crate::line::{self, LineCounters, LineDevice, LineEntry};
use crate::plant::Plant;
use crate::serial::SerialEnd;
use crate::world::Inner;

/// A serial line in half duplex (RS-485) of a [`World`](crate::World), with one host.
#[derive(Clone)]
pub struct Line {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Line {
    /// Puts a device with its motor on the line, powered, at rest.
    pub fn add(&self, device: impl LineDevice, plant: Plant) -> Esc {
        let line = self.index;
        Esc::plug_in(&self.inner, Electronics::Line(Box::new(device)), plant, |inner, _| {
            Place::Line { line, station: inner.lines[line].join(inner.units.len()) }
        })
    }

    /// The host's serial port; all of them share one buffer.
    #[must_use]
    pub fn port(&self) -> SerialPort {
        SerialPort { line: self.clone() }
    }

    /// Bits a second.
    #[must_use]
    pub fn baud(&self) -> u32 {
        self.with(|line, _| line.config.baud)
    }

    /// Puts the receiver of an emulated chip in the place of the host's port, whose buffer stays
    /// empty from then on. It is told of characters as they begin; one that collides is a framing
    /// error to it. What the chip sends comes by [`deliver`](Self::deliver).
    ///
    /// The world borrows it while time passes; between its calls it is the caller's.
    pub fn attach(&self, chip: Rc<RefCell<dyn SerialEnd>>) {
        self.with(|line, _| line.host.chip = Some(chip));
    }

    /// The attached chip begins to send a character: now, or as soon as its last one has ended.
    pub fn deliver(&self, byte: u8, start: Nanos) {
        self.with(|line, _| line.host.send(&[byte], start));
    }

    /// Unplugs the host, or plugs it in again. Unplugged it is not heard, and hears nothing.
    pub fn set_cut(&self, cut: bool) {
        self.with(|line, _| line.set_cut(cut));
    }

    /// Switches the power of all devices on the line: as [`Esc::set_power`] each.
    pub fn set_power(&self, powered: bool) {
        let is_here = |place| matches!(place, Place::Line { line, .. } if line == self.index);
        Esc::set_power_of(&self.inner, is_here, powered);
    }

    /// A foreign node sends bytes, from now on and after those it was given before. A device that
    /// sends at the same time collides with it.
    pub fn inject(&self, bytes: &[u8]) {
        self.with(|line, now| line.inject(bytes, now));
    }

    /// In each of the host's next frames one bit is wrong. A frame is what a node sends without a
    /// pause. Replaces the number given before.
    pub fn damage_commands(&self, frames: u32) {
        self.with(|line, _| line.damage_commands(frames));
    }

    /// The same with the devices' frames.
    pub fn damage_answers(&self, frames: u32) {
        self.with(|line, _| line.damage_answers(frames));
    }

    /// Keeps the bytes from now on for [`take_trace`](Self::take_trace).
    pub fn keep_trace(&self) {
        self.with(|line, _| line.keep_trace());
    }

    /// The bytes on the line since the last call, in the order of their ends: what a node in the
    /// middle would hear. Those of an end that is unplugged are not on it.
    #[must_use]
    pub fn take_trace(&self) -> Vec<LineEntry> {
        self.with(|line, _| line.take_trace())
    }

    /// Counters since the world began.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        self.with(|line, _| line.counters)
    }

    fn with<T>(&self, f: impl FnOnce(&mut line::Line, Nanos) -> T) -> T {
        let mut inner = self.inner.borrow_mut();
        let now = inner.clock.now_ns();
        f(&mut inner.lines[self.index], now)
    }
}

/// The host's serial port on a [`Line`]: as an asynchronous UART with a receive buffer, in virtual
/// time. A read that is dropped has taken nothing.
#[derive(Clone)]
pub struct SerialPort {
    line: Line,
}

impl SerialPort {
    /// Sends bytes, after those that wait already. Never waits.
    pub fn send(&mut self, bytes: &[u8]) {
        self.line.with(|line, now| line.host.send(bytes, now));
    }

    /// Takes the bytes received since the last time. Never waits.
    pub fn take_received(&mut self) -> Vec<u8> {
        self.line.with(|line, _| line.host.received.drain(..).collect())
    }
}

impl ErrorType for SerialPort {
    type Error = Infallible;
}

impl Read for SerialPort {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        poll_fn(|context| {
            self.line.with(|line, _| {
                let host = &mut line.host;
                if host.received.is_empty() && !buffer.is_empty() {
                    host.reader = Some(context.waker().clone());
                    return Poll::Pending;
                }
                let len = buffer.len().min(host.received.len());
                buffer.iter_mut().zip(host.received.drain(..len)).for_each(|(to, byte)| *to = byte);
                Poll::Ready(Ok(len))
            })
        })
        .await
    }
}

impl Write for SerialPort {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.send(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        poll_fn(|context| {
            self.line.with(|line, _| {
                if line.host.has_sent_all() {
                    return Poll::Ready(Ok(()));
                }
                line.host.flusher = Some(context.waker().clone());
                Poll::Pending
            })
        })
        .await
    }
}
