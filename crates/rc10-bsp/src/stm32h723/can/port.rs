use core::cell::Cell;
use core::fmt;

use embassy_stm32::can::Instance;
use embassy_stm32::peripherals::{FDCAN1, FDCAN2, FDCAN3};
use rc10_can::m_can::{decode, time_stamp};
use rc10_can::{BusError, CanFrame, CanPort, Health, IdPattern, Submitted};
use rc10_time::Micros;

use super::clock::Clock;
use super::controller::{ALL, COAST_FRAMES, COMMAND_MASK, COMMANDS, Controller, Fifo};

/// FDCAN1, FDCAN2 or FDCAN3.
pub trait BusPeripheral: Instance {
    #[doc(hidden)]
    const CONTROLLER: Controller;
}

impl BusPeripheral for FDCAN1 {
    const CONTROLLER: Controller = ALL[0];
}
impl BusPeripheral for FDCAN2 {
    const CONTROLLER: Controller = ALL[1];
}
impl BusPeripheral for FDCAN3 {
    const CONTROLLER: Controller = ALL[2];
}

/// A [`CanPort`] on an FDCAN, without interrupt: take all frames by [`receive`](CanPort::receive).
///
/// Frames that the filters let in ([`accept`](CanPort::accept); all frames at first) come first,
/// oldest first. When there is no more of that, one frame that they did not let in follows, the
/// newest, and only then `None`: so strangers can be seen, and cost nothing. The others of them are
/// counted ([`Health::ignored`]); if more than 32 came since the last time, that count is too low.
///
/// [`Health::receive_lost`] counts an overrun of FIFO or message RAM as one: their size is unknown.
///
/// After bus-off unsent frames are taken back and new ones refused, until
/// [`recover`](CanPort::recover); so are those from before a [supervisor](crate::supervisor)'s act.
pub struct FdcanPort {
    controller: Controller,
    /// Frames of FIFO 0 that are known to be there, and where the oldest of them is.
    held: u8,
    oldest: u8,
    clock: Clock,
    /// The frame that the filters did not let in has been handed out.
    foreign_taken: bool,
    /// The stream of the frame last written to each transmit buffer.
    streams: [u32; COMMANDS],
    last_error: Cell<Option<BusError>>,
    receive_lost: u32,
    transmit_lost: u32,
    ignored: u32,
    bus_offs: u32,
    restrictions: u32,
    /// The controller has left the bus, and has not been told to go back.
    off: bool,
    /// Number of stalls of the bus when the port was asked for frames last.
    stalls: u32,
}

impl FdcanPort {
    pub(super) fn new(controller: Controller) -> Self {
        Self {
            controller,
            held: 0,
            oldest: 0,
            clock: Clock::new(rc10_message::now()),
            foreign_taken: false,
            streams: [0; COMMANDS],
            last_error: Cell::new(None),
            receive_lost: 0,
            transmit_lost: 0,
            ignored: 0,
            bus_offs: 0,
            restrictions: 0,
            off: false,
            stalls: controller.stalls(),
        }
    }

    /// Stores the frames that make this bus's motors safe, in the controller's memory, for
    /// [`crash`](crate::crash) and [`supervisor`](crate::supervisor).
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

    /// Looks what FIFO 0 holds; once for many frames.
    fn look(&mut self) {
        self.stalls = self.controller.attend();
        (self.held, self.oldest) = self.controller.held(Fifo::Wanted);
        // After the FIFO: no frame in it can be younger.
        self.clock.read(rc10_message::now(), self.controller.registers.tscv().read().tsc());
    }

    /// FIFO 0 is empty: how is the controller, and is there a frame that was not asked for?
    fn finish(&mut self) -> Option<(CanFrame, Micros)> {
        let [overrun, too_slow] = self.controller.losses();
        if overrun || too_slow {
            let lost = u32::from(overrun) + u32::from(too_slow);
            self.receive_lost = self.receive_lost.saturating_add(lost);
        }
        let control = self.controller.registers.cccr().read();
        if control.init() {
            // Since the start only the hardware sets it: bus-off.
            self.leave_bus();
        } else if control.asm() {
            // The message RAM was too slow once; or the calibration unit is at work, in every tick.
            self.restrictions = self.restrictions.saturating_add(1);
            self.controller.go_on_bus();
        }
        if core::mem::take(&mut self.foreign_taken) {
            return None;
        }
        let foreign = self.take_foreign();
        self.foreign_taken = foreign.is_some();
        foreign
    }

    /// The newest frame not let in: the hardware overwrites the oldest, perhaps right now.
    fn take_foreign(&mut self) -> Option<(CanFrame, Micros)> {
        let (held, oldest) = self.controller.held(Fifo::Foreign);
        let older = held.checked_sub(1)?;
        self.ignored = self.ignored.saturating_add(older.into());
        let newest = Controller::after(Fifo::Foreign, oldest, older);
        let element = self.controller.element(Fifo::Foreign, newest);
        self.controller.release(Fifo::Foreign, newest);
        Some((decode(element), self.clock.time_of(time_stamp(element))))
    }

    #[cold]
    fn leave_bus(&mut self) {
        if self.off {
            return;
        }
        self.off = true;
        self.bus_offs = self.bus_offs.saturating_add(1);
        let unsent = self.cancel_pending();
        self.transmit_lost = self.transmit_lost.saturating_add(unsent.into());
    }

    /// Those among `buffers` that were last written with a frame of this stream.
    fn of_stream(&self, stream: u32, mut buffers: u32) -> u32 {
        let mut found = 0;
        while buffers != 0 {
            let lowest = buffers.trailing_zeros();
            buffers &= buffers - 1;
            if self.streams.get(lowest as usize) == Some(&stream) {
                found |= 1 << lowest;
            }
        }
        found
    }
}

impl CanPort for FdcanPort {
    #[inline]
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        if self.held == 0 {
            self.look();
            if self.held == 0 {
                return self.finish();
            }
        }
        let index = self.oldest;
        let element = self.controller.element(Fifo::Wanted, index);
        self.held -= 1;
        if self.held == 0 {
            // All of them at once.
            self.controller.release(Fifo::Wanted, index);
        }
        self.oldest = Controller::after(Fifo::Wanted, index, 1);
        Some((decode(element), self.clock.time_of(time_stamp(element))))
    }

    fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted {
        if self.off {
            return Submitted::Refused;
        }
        let pending = self.controller.pending();
        let older = self.of_stream(stream, pending & COMMAND_MASK);
        let replaced = older != 0 && self.controller.cancel(older) != 0;
        // A cancelled buffer on the wire is busy for a frame's time: take another one.
        let buffer = (!pending & COMMAND_MASK).trailing_zeros() as usize;
        let Some(held) = self.streams.get_mut(buffer) else {
            return Submitted::Refused;
        };
        *held = stream;
        self.controller.write(buffer, frame);
        // Not earlier: the supervisor may come between any two instructions.
        if self.stalls != self.controller.stalls() {
            return Submitted::Refused;
        }
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
            receive_lost: self.receive_lost,
            transmit_lost: self.transmit_lost,
            ignored: self.ignored,
            bus_offs: self.bus_offs,
            restrictions: self.restrictions,
            stalls: self.controller.stalls(),
        }
    }

    fn accept(&mut self, patterns: &[IdPattern]) {
        self.controller.accept(patterns);
    }

    fn recover(&mut self) {
        if core::mem::take(&mut self.off) {
            // Also a coast image that could not leave.
            self.controller.cancel(!0);
            self.controller.go_on_bus();
        }
    }
}

impl fmt::Debug for FdcanPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FdcanPort").finish_non_exhaustive()
    }
}

/// A coast image of more frames than fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a bus keeps at most {COAST_FRAMES} coast frames, not {frames}")]
pub struct CoastImageFull {
    /// Number of frames in the image.
    pub frames: usize,
}
