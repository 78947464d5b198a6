//! What a test holds of a serial line.

use std::cell::RefCell;
use std::convert::Infallible;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

use embedded_io_async::{ErrorType, Read, Write};

use crate::Nanos;
use crate::device::{EscFault, EscState};
use crate::line::{self, LineCounters, LineDevice};
use crate::motor::Plant;
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
    pub fn add(&self, device: impl LineDevice, plant: Plant) -> LineMotor {
        let inner = &mut *self.inner.borrow_mut();
        let (phase, now) = (inner.random.unit(), inner.clock.now_ns());
        let motor = inner.lines[self.index].add(Box::new(device), plant, phase, now);
        LineMotor { line: self.clone(), motor }
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

    /// Unplugs the host, or plugs it in again: what it sends nobody hears, and it hears nothing.
    pub fn set_cut(&self, cut: bool) {
        self.with(|line, _| line.set_cut(cut));
    }

    /// Switches the power of all devices on the line: as [`LineMotor::set_power`] each.
    pub fn set_power(&self, powered: bool) {
        self.with(|line, now| line.set_power_of_all(powered, now));
    }

    /// Somebody who is no device sends bytes, from now on and after those he was given before.
    /// Whoever sends at the same time collides with him.
    pub fn inject(&self, bytes: &[u8]) {
        self.with(|line, now| line.inject(bytes, now));
    }

    /// In each of the host's next frames one bit is wrong. A frame is what somebody sends without a
    /// pause. Replaces the number given before.
    pub fn damage_commands(&self, frames: u32) {
        self.with(|line, _| line.damage_commands(frames));
    }

    /// The same with the devices' frames.
    pub fn damage_answers(&self, frames: u32) {
        self.with(|line, _| line.damage_answers(frames));
    }

    /// What happened so far.
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

/// A device on a [`Line`], with its motor: as [`Esc`](crate::Esc).
#[derive(Clone)]
pub struct LineMotor {
    line: Line,
    motor: usize,
}

impl LineMotor {
    /// What is true now (of the mechanics: at the last physics step).
    #[must_use]
    pub fn state(&self) -> EscState {
        self.line.with(|line, _| line.state(self.motor))
    }

    /// Its motor, gearbox and load.
    #[must_use]
    pub fn plant(&self) -> Plant {
        self.line.with(|line, _| line.plant(self.motor))
    }

    /// Switches its power. Without it there is no current and no answer; the rotor coasts.
    pub fn set_power(&self, powered: bool) {
        self.line.with(|line, now| line.set_power(self.motor, powered, now));
    }

    /// Silences its answers, or lets it speak again; it goes on obeying.
    pub fn set_feedback(&self, enabled: bool) {
        self.line.with(|line, _| line.set_muted(self.motor, !enabled));
    }

    /// Unplugs its data lines, or plugs them in again; it keeps its power.
    pub fn set_cut(&self, cut: bool) {
        self.line.with(|line, _| line.set_motor_cut(self.motor, cut));
    }

    /// Has it find something wrong with itself, until power-off. `false`: such a device knows no
    /// such fault, and nothing happened.
    pub fn inject(&self, fault: EscFault) -> bool {
        self.line.with(|line, _| line.inject_fault(self.motor, fault))
    }

    /// Sets another identifier on it, as before power-on. `false`: it can have no such one, and
    /// nothing happened.
    pub fn set_id(&self, id: u8) -> bool {
        self.line.with(|line, _| line.set_id(self.motor, id))
    }

    /// A look into its electronics, or a hand: `None` if it is not a `D`.
    pub fn with<D: LineDevice, T>(&self, look: impl FnOnce(&mut D) -> T) -> Option<T> {
        self.line.with(|line, _| line.device(self.motor).downcast_mut().map(look))
    }

    /// A constant torque on the output shaft from outside, N·m, positive in the motor's positive
    /// direction.
    pub fn set_load(&self, torque: f64) {
        self.line.with(|line, _| line.set_load(self.motor, torque));
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

    /// What has been received since the last time. Never waits.
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
