use core::cell::{Cell, RefCell};
use core::fmt;
use core::marker::PhantomData;

use embassy_stm32::can::Instance;
use embassy_stm32::interrupt::typelevel::Handler;
use embassy_stm32::peripherals::{FDCAN1, FDCAN2, FDCAN3};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Deque;
use rc10_can::{BusError, CanFrame, CanPort, Health, Micros, Submitted};

use super::controller::{ALL, COAST_FRAMES, COMMAND_MASK, COMMANDS, Controller};

/// Received frames that wait for their task, per bus.
pub const RECEIVE_QUEUE: usize = 32;

/// What the interrupt leaves for the port.
struct Received {
    frames: Deque<(CanFrame, Micros), RECEIVE_QUEUE>,
    lost: u32,
}

#[doc(hidden)]
pub struct Inbox(Mutex<CriticalSectionRawMutex, RefCell<Received>>);

impl Inbox {
    const fn new() -> Self {
        Self(Mutex::new(RefCell::new(Received { frames: Deque::new(), lost: 0 })))
    }

    fn with<R>(&self, f: impl FnOnce(&mut Received) -> R) -> R {
        self.0.lock(|received| f(&mut received.borrow_mut()))
    }

    fn on_interrupt(&self, controller: Controller) {
        let can = controller.registers;
        // Cleared before the FIFO is read: a frame that comes meanwhile raises it again.
        let raised = can.ir().read();
        can.ir().write_value(raised);
        let at = crate::now();
        self.with(|received| {
            while let Some(frame) = controller.read() {
                if received.frames.is_full() {
                    received.frames.pop_front();
                    received.lost = received.lost.saturating_add(1);
                }
                // There is room now.
                let _ = received.frames.push_back((frame, at));
            }
            // The FIFO was full, or the message RAM too slow: for one frame at least, the hardware
            // does not say for how many.
            if raised.rfl(0) || raised.mraf() {
                received.lost = received.lost.saturating_add(1);
            }
        });
    }
}

/// FDCAN1, FDCAN2 or FDCAN3.
pub trait BusPeripheral: Instance {
    #[doc(hidden)]
    const CONTROLLER: Controller;
    #[doc(hidden)]
    fn inbox() -> &'static Inbox;
}

macro_rules! bus_peripheral {
    ($peripheral:ty, $index:literal) => {
        impl BusPeripheral for $peripheral {
            const CONTROLLER: Controller = ALL[$index];
            fn inbox() -> &'static Inbox {
                static INBOX: Inbox = Inbox::new();
                &INBOX
            }
        }
    };
}
bus_peripheral!(FDCAN1, 0);
bus_peripheral!(FDCAN2, 1);
bus_peripheral!(FDCAN3, 2);

/// The interrupt handler of a bus, for `bind_interrupts!`:
/// `FDCAN1_IT0 => can::Interrupt<FDCAN1>;`
pub struct Interrupt<T>(PhantomData<T>);

impl<T: BusPeripheral> Handler<T::IT0Interrupt> for Interrupt<T> {
    unsafe fn on_interrupt() {
        T::inbox().on_interrupt(T::CONTROLLER);
    }
}

/// A [`CanPort`] on one FDCAN of the chip.
///
/// [`Health::receive_lost`] counts frames that the queue had no room for one by one, and overruns
/// of the hardware FIFO and of its access to the message RAM as one each, because the hardware does
/// not say how many frames they cost. After bus-off the port cancels what is unsent, counts, and
/// goes back on the bus, the next time that [`receive`](CanPort::receive) finds nothing.
pub struct FdcanPort {
    controller: Controller,
    inbox: &'static Inbox,
    /// The key of the frame last written to each transmit buffer.
    keys: [u32; COMMANDS],
    last_error: Cell<Option<BusError>>,
    bus_offs: u32,
}

impl FdcanPort {
    pub(super) const fn new(controller: Controller, inbox: &'static Inbox) -> Self {
        let last_error = Cell::new(None);
        Self { controller, inbox, keys: [0; COMMANDS], last_error, bus_offs: 0 }
    }

    /// Stores the frames that make every motor of this bus safe. They wait in the controller's own
    /// memory; a crash sends them by a few register writes ([`crash`](crate::crash)).
    ///
    /// # Errors
    /// [`CoastImageFull`] if there are more than [`COAST_FRAMES`]; then none is stored.
    pub fn keep_coast_image(&mut self, frames: &[CanFrame]) -> Result<(), CoastImageFull> {
        if frames.len() > COAST_FRAMES {
            return Err(CoastImageFull { frames: frames.len() });
        }
        self.controller.keep_coast_image(frames);
        Ok(())
    }

    /// Goes back on the bus if the controller has left it. Polled, because a state cannot be missed
    /// as the interrupt of a change can: and that would be for ever.
    fn return_to_bus(&mut self) {
        let control = self.controller.registers.cccr().read();
        if control.init() {
            // Since the start only the hardware sets it: bus-off.
            self.bus_offs = self.bus_offs.saturating_add(1);
            self.controller.cancel(COMMAND_MASK);
        }
        if control.init() || control.asm() {
            self.controller.go_on_bus();
        }
    }

    /// The pending buffers among `buffers` that hold a frame of this key.
    fn of_key(&self, key: u32, mut buffers: u32) -> u32 {
        let mut found = 0;
        while buffers != 0 {
            let lowest = buffers.trailing_zeros();
            buffers &= buffers - 1;
            if self.keys.get(lowest as usize) == Some(&key) {
                found |= 1 << lowest;
            }
        }
        found
    }
}

impl CanPort for FdcanPort {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        let oldest = self.inbox.with(|received| received.frames.pop_front());
        if oldest.is_none() {
            self.return_to_bus();
        }
        oldest
    }

    fn submit(&mut self, frame: &CanFrame) -> Submitted {
        let pending = self.controller.pending();
        let older = self.of_key(frame.key(), pending & COMMAND_MASK);
        let replaced = older != 0 && self.controller.cancel(older) != 0;
        // A cancelled buffer is free only once the controller has let go of it, which takes a
        // frame's time if it is on the wire: take another one.
        let buffer = (!pending & COMMAND_MASK).trailing_zeros() as usize;
        let Some(key) = self.keys.get_mut(buffer) else {
            return Submitted::Refused;
        };
        *key = frame.key();
        self.controller.write(buffer, frame);
        self.controller.request(1 << buffer);
        if replaced { Submitted::Replaced } else { Submitted::Queued }
    }

    fn cancel_pending(&mut self) -> u8 {
        let unsent = self.controller.pending() & COMMAND_MASK;
        u8::try_from(self.controller.cancel(unsent).count_ones()).unwrap_or(u8::MAX)
    }

    fn health(&self) -> Health {
        let (state, error) = self.controller.status();
        if error.is_some() {
            self.last_error.set(error);
        }
        let errors = self.controller.registers.ecr().read();
        Health {
            state,
            transmit_errors: errors.tec(),
            receive_errors: errors.rec(),
            last_error: self.last_error.get(),
            receive_lost: self.inbox.with(|received| received.lost),
            bus_offs: self.bus_offs,
        }
    }
}

impl fmt::Debug for FdcanPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FdcanPort").finish_non_exhaustive()
    }
}

/// A coast image of more frames than fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoastImageFull {
    /// How many there were.
    pub frames: usize,
}

impl fmt::Display for CoastImageFull {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a bus keeps at most {COAST_FRAMES} coast frames, not {}", self.frames)
    }
}

impl core::error::Error for CoastImageFull {}
