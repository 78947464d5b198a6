use core::cell::RefCell;
use core::fmt;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use rc10_can::{CanFrame, CanPort, Health, IdPattern, Submitted};
use rc10_time::Micros;

use crate::{Driver, Hardware};

/// A [`Driver`] of an interrupt and a task, in critical sections of a few microseconds.
pub struct SharedDriver<H>(Mutex<CriticalSectionRawMutex, RefCell<Option<Driver<H>>>>);

impl<H: Hardware> SharedDriver<H> {
    /// Without a controller yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(Mutex::new(RefCell::new(None)))
    }

    /// With a controller that was just started; its port.
    pub fn start(&'static self, hardware: H) -> Port<H> {
        self.0.lock(|driver| *driver.borrow_mut() = Some(Driver::new(hardware)));
        Port { shared: self }
    }

    /// For each interrupt of the controller.
    pub fn on_interrupt(&self) {
        self.with(Driver::serve);
    }

    /// `None` while there is no controller.
    fn with<T>(&self, work: impl FnOnce(&mut Driver<H>) -> T) -> Option<T> {
        self.0.lock(|driver| driver.borrow_mut().as_mut().map(work))
    }
}

impl<H: Hardware> Default for SharedDriver<H> {
    fn default() -> Self {
        Self::new()
    }
}

impl<H> fmt::Debug for SharedDriver<H> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SharedDriver").finish_non_exhaustive()
    }
}

/// A [`CanPort`] on one controller.
///
/// * **Received frames** wait in a queue of [`RECEIVE_QUEUE`](crate::RECEIVE_QUEUE). Their time is
///   the interrupt's, late by masked interrupts. [`Health::receive_lost`] counts frames without
///   room, and each overrun of the hardware as one.
/// * **Sent frames**: see [`Driver`]. [`Submitted::Replaced`]: the older frame will not leave. If
///   it was on the wire, or is aborted later, the answer is [`Submitted::Queued`], and
///   [`unreplaced`](Self::unreplaced) counts it.
/// * **After bus-off** what is unsent is taken back and counted ([`Health::transmit_lost`]), and new
///   frames are refused, until [`recover`](CanPort::recover).
pub struct Port<H: 'static> {
    shared: &'static SharedDriver<H>,
}

impl<H: Hardware> Port<H> {
    /// Frames that left although a newer one was there: [`Driver::unreplaced`].
    #[must_use]
    pub fn unreplaced(&self) -> u32 {
        self.shared.with(|driver| driver.unreplaced()).unwrap_or_default()
    }
}

impl<H: Hardware> CanPort for Port<H> {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        self.shared.with(Driver::receive).flatten()
    }

    fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted {
        let submitted = self.shared.with(|driver| driver.submit_as(frame, stream));
        submitted.unwrap_or(Submitted::Refused)
    }

    fn cancel_pending(&mut self) -> u8 {
        self.shared.with(Driver::cancel_pending).unwrap_or_default()
    }

    fn health(&self) -> Health {
        self.shared.with(Driver::health).unwrap_or_default()
    }

    fn accept(&mut self, patterns: &[IdPattern]) {
        self.shared.with(|driver| driver.accept(patterns));
    }

    fn recover(&mut self) {
        self.shared.with(Driver::recover);
    }
}

impl<H> fmt::Debug for Port<H> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Port").finish_non_exhaustive()
    }
}
