//! One FDCAN controller by its registers (RM0468, FDCAN chapter) and its share of the message RAM.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use embassy_stm32::pac;
use embassy_stm32::pac::can::regs;
use rc10_can::m_can::{ELEMENT, encode};
use rc10_can::{BitTiming, BitTimingLimits, BusError, CanFrame, ErrorState, IdPattern};

use super::filter;
use crate::FDCAN_CLOCK;

/// Wanted frames in hardware, its most: 3 ms of shortest frames, 7 ms of eight bytes.
pub const HARDWARE_RECEIVE: usize = 64;
/// Unwanted frames that it holds, newest first to be looked at: a bus carries 21 in a millisecond.
const FOREIGN: usize = 32;
/// Transmit buffers, the most that the hardware has.
const TRANSMIT: usize = 32;
/// Transmit buffers kept for the coast image: the last ones.
pub const COAST_FRAMES: usize = 8;
/// Transmit buffers for [`submit`](rc10_can::CanPort::submit).
pub(super) const COMMANDS: usize = TRANSMIT - COAST_FRAMES;
pub(super) const COMMAND_MASK: u32 = (1 << COMMANDS) - 1;

// Message RAM, in words from the start of a controller's share.
const STANDARD_FILTERS_AT: usize = 0;
const EXTENDED_FILTERS_AT: usize = STANDARD_FILTERS_AT + filter::STANDARD;
const RECEIVE_AT: usize = STANDARD_FILTERS_AT + filter::WORDS;
const FOREIGN_AT: usize = RECEIVE_AT + HARDWARE_RECEIVE * ELEMENT;
const TRANSMIT_AT: usize = FOREIGN_AT + FOREIGN * ELEMENT;
const SHARE: usize = TRANSMIT_AT + TRANSMIT * ELEMENT;
const _: () = assert!(3 * SHARE <= 2560, "the three FDCANs share 2560 words");

/// Bits a second, of all buses.
const BIT_RATE: u32 = 1_000_000;
const BIT_TIMING: BitTiming = BitTiming::exact(FDCAN_CLOCK.0, BIT_RATE, BitTimingLimits::FDCAN);

/// CCFG of the clock calibration unit (RM0468, FDCAN; base `0x4000_A800` in ST's `stm32h723xx.h`).
const CALIBRATION: *mut u32 = 0x4000_A804 as *mut u32;
/// BCC: the unit is bypassed, and the kernel clock goes to the controllers undivided.
const BYPASS: u32 = 1 << 6;

/// One of the three controllers.
#[derive(Clone, Copy)]
pub struct Controller {
    pub(super) registers: pac::can::Fdcan,
    share: usize,
    pub(super) shared: &'static Shared,
}

/// The state that a bus's port, the supervisor and the crash handler share.
pub(super) struct Shared {
    /// Which transmit buffers hold coast frames.
    coast: AtomicU32,
    /// Whether the port is being asked for frames: [`POLLED`], [`SEEN`] or [`STALLED`].
    attendance: AtomicU8,
    stalls: AtomicU32,
}

/// The port has been asked since the supervisor looked last.
const POLLED: u8 = 0;
/// The controller has not been asked again since the supervisor saw that.
const SEEN: u8 = 1;
/// The controller had not been asked when the supervisor looked again.
const STALLED: u8 = 2;

static SHARED: [Shared; 3] = [const {
    Shared {
        coast: AtomicU32::new(0),
        attendance: AtomicU8::new(POLLED),
        stalls: AtomicU32::new(0),
    }
}; 3];

/// The controllers of FDCAN1, FDCAN2 and FDCAN3.
pub(crate) const ALL: [Controller; 3] = [
    Controller::new(pac::FDCAN1, 0),
    Controller::new(pac::FDCAN2, 1),
    Controller::new(pac::FDCAN3, 2),
];

/// One of a controller's two receive FIFOs.
#[derive(Clone, Copy)]
pub(super) enum Fifo {
    /// FIFO 0, for what the filters let in. When it is full, new frames are lost.
    Wanted = 0,
    /// FIFO 1, for all else. When it is full, new frames replace the oldest.
    Foreign = 1,
}

impl Controller {
    const fn new(registers: pac::can::Fdcan, index: usize) -> Self {
        Self { registers, share: index * SHARE, shared: &SHARED[index] }
    }

    /// Configures and starts a controller after reset (CCCR.INIT). It accepts all frames.
    pub(super) fn start(self) {
        bypass_calibration();
        // What it holds after power-on is anything.
        for word in self.share..self.share + SHARE {
            pac::FDCANRAM.ram(word).write_value(0);
        }
        let can = self.registers;
        can.cccr().modify(|w| w.set_cce(true));
        // The register holds each value less one.
        can.nbtp().write(|w| {
            w.set_nbrp(BIT_TIMING.prescaler - 1);
            w.set_ntseg1(byte(BIT_TIMING.before as usize - 1));
            w.set_ntseg2(byte(BIT_TIMING.after as usize - 1));
            w.set_nsjw(byte(BIT_TIMING.after as usize - 1));
        });
        // The time stamp counter counts bit times.
        can.tscc().write(|w| w.set_tss(0b01));
        can.sidfc().write(|w| {
            w.set_flssa(word(self.share + STANDARD_FILTERS_AT));
            w.set_lss(byte(filter::STANDARD));
        });
        can.xidfc().write(|w| {
            w.set_flesa(word(self.share + EXTENDED_FILTERS_AT));
            w.set_lse(byte(filter::EXTENDED));
        });
        self.accept(&[IdPattern::any_standard(), IdPattern::any_extended()]);
        // What no filter lets in goes to FIFO 1. Remote frames are filtered as data frames are.
        can.gfc().write(|w| {
            w.set_anfs(0b01);
            w.set_anfe(0b01);
        });
        // Zero, after reset, is right for all else: classic frames, repeated until acknowledged;
        // eight data bytes; dedicated transmit buffers; no event FIFO; no interrupts.
        can.rxfc(Fifo::Wanted as usize).write(|w| {
            w.set_fsa(word(self.share + RECEIVE_AT));
            w.set_fs(byte(HARDWARE_RECEIVE));
        });
        can.rxfc(Fifo::Foreign as usize).write(|w| {
            w.set_fsa(word(self.share + FOREIGN_AT));
            w.set_fs(byte(FOREIGN));
            w.set_fom(true);
        });
        can.txbc().write(|w| {
            w.set_tbsa(word(self.share + TRANSMIT_AT));
            w.set_ndtb(byte(TRANSMIT));
        });
        self.go_on_bus();
    }

    /// Rewrites the filters, also on the bus: a filter that stays in its place never changes.
    pub(super) fn accept(self, patterns: &[IdPattern]) {
        for (offset, filter) in filter::words(patterns).into_iter().enumerate() {
            let at = self.share + STANDARD_FILTERS_AT + offset;
            pac::FDCANRAM.ram(at).write_value(filter);
        }
    }

    /// Takes part: after configuration; after bus-off, when the hardware waits for 129 x 11
    /// recessive bits; and from restricted operation (CCCR.ASM), which sends nothing.
    pub(super) fn go_on_bus(self) {
        self.registers.cccr().modify(|w| {
            w.set_init(false);
            w.set_asm(false);
        });
    }

    /// A frame's element. Its index must be below the FIFO's size; the hardware's are.
    #[inline]
    pub(super) fn element(self, fifo: Fifo, index: u8) -> [u32; ELEMENT] {
        let (first, size) = match fifo {
            Fifo::Wanted => (RECEIVE_AT, HARDWARE_RECEIVE),
            Fifo::Foreign => (FOREIGN_AT, FOREIGN),
        };
        let at = self.share + first + usize::from(index) % size * ELEMENT;
        // One check for all four words.
        let element = pac::FDCANRAM.ram(at).as_ptr();
        // SAFETY: whole elements behind `at`, in this controller's share of the message RAM.
        let read = |word| unsafe { element.add(word).read_volatile() };
        [read(0), read(1), read(2), read(3)]
    }

    #[inline]
    pub(super) fn held(self, fifo: Fifo) -> (u8, u8) {
        let status = self.registers.rxfs(fifo as usize).read();
        (status.ffl(), status.fgi())
    }

    /// The index a number of elements behind another.
    #[inline]
    pub(super) const fn after(fifo: Fifo, index: u8, elements: u8) -> u8 {
        let size = match fifo {
            Fifo::Wanted => HARDWARE_RECEIVE,
            Fifo::Foreign => FOREIGN,
        };
        (index + elements) % byte(size)
    }

    /// Gives a FIFO's elements back, up to and with this one.
    #[inline]
    pub(super) fn release(self, fifo: Fifo, index: u8) {
        self.registers.rxfa(fifo as usize).write(|w| w.set_fai(index));
    }

    /// Writes a frame into a transmit buffer that is not pending; does not send it.
    pub(super) fn write(self, buffer: usize, frame: &CanFrame) {
        let at = self.share + TRANSMIT_AT + buffer * ELEMENT;
        for (word, value) in encode(frame).into_iter().enumerate() {
            pac::FDCANRAM.ram(at + word).write_value(value);
        }
    }

    /// The transmit buffers that wait or are being sent.
    pub(super) fn pending(self) -> u32 {
        // A new request may stay in TXBAR while the controller looks for its most urgent frame.
        self.registers.txbar().read().0 | self.registers.txbrp().read().0
    }

    pub(super) fn request(self, buffers: u32) {
        self.registers.txbar().write_value(regs::Txbar(buffers));
    }

    /// Takes buffers back (one on the wire is not repeated); which were not being cancelled.
    pub(super) fn cancel(self, buffers: u32) -> u32 {
        let cancelled = buffers & !self.registers.txbcr().read().0;
        self.registers.txbcr().write_value(regs::Txbcr(buffers));
        cancelled
    }

    /// Frames lost on the way in since the last call: FIFO 0 full, or message RAM too slow.
    pub(super) fn losses(self) -> [bool; 2] {
        let raised = self.registers.ir().read();
        let losses = [raised.rfl(Fifo::Wanted as usize), raised.mraf()];
        if losses != [false; 2] {
            // Writing a one clears a flag.
            self.registers.ir().write(|w| {
                w.set_rfl(Fifo::Wanted as usize, losses[0]);
                w.set_mraf(losses[1]);
            });
        }
        losses
    }

    /// Error state and, if one came since the last call, the last bus error: reading it clears it.
    pub(super) fn status(self) -> (ErrorState, Option<BusError>) {
        let status = self.registers.psr().read();
        let state = match (status.bo(), status.ep(), status.ew()) {
            (true, _, _) => ErrorState::BusOff,
            (_, true, _) => ErrorState::Passive,
            (_, _, true) => ErrorState::Warning,
            _ => ErrorState::Active,
        };
        let error = match status.lec() {
            // On its way back the hardware notes a bit error for every 11 recessive bits.
            _ if status.bo() => None,
            1 => Some(BusError::Stuff),
            2 => Some(BusError::Form),
            3 => Some(BusError::Acknowledge),
            4 | 5 => Some(BusError::Bit),
            6 => Some(BusError::Crc),
            _ => None,
        };
        (state, error)
    }

    /// Writes the coast image into its buffers; at most [`COAST_FRAMES`] frames.
    pub(super) fn keep_coast_image(self, frames: &[CanFrame]) {
        let mut mask = 0;
        // Half of it is not sent.
        self.shared.coast.store(mask, Ordering::Release);
        for (buffer, frame) in (COMMANDS..TRANSMIT).zip(frames) {
            self.write(buffer, frame);
            mask |= 1 << buffer;
        }
        self.shared.coast.store(mask, Ordering::Release);
    }

    /// The port is being asked: the rest of a coast image is taken back. Says how often that was.
    #[inline]
    pub(super) fn attend(self) -> u32 {
        if self.shared.attendance.swap(POLLED, Ordering::AcqRel) == STALLED {
            self.cancel(!COMMAND_MASK);
        }
        self.stalls()
    }

    #[inline]
    pub(super) fn stalls(self) -> u32 {
        self.shared.stalls.load(Ordering::Acquire)
    }

    /// For the supervisor, above the port: if it was not asked, only the coast image goes out.
    pub(crate) fn supervise(self) {
        let Shared { attendance, stalls, .. } = self.shared;
        match attendance.load(Ordering::Acquire) {
            POLLED => attendance.store(SEEN, Ordering::Release),
            before => {
                if before == SEEN && self.coast() != 0 {
                    stalls.store(stalls.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
                    attendance.store(STALLED, Ordering::Release);
                }
                self.replace_by_coast_image();
            }
        }
    }

    fn coast(self) -> u32 {
        self.shared.coast.load(Ordering::Acquire)
    }

    /// Nothing but the coast image goes out from here on, if there is one.
    fn replace_by_coast_image(self) {
        let coast = self.coast();
        if coast == 0 {
            // Perhaps not even clocked: touching it could fault.
            return;
        }
        self.cancel(COMMAND_MASK);
        self.request(coast);
    }

    /// For the crash handler: the coast image, even if the bus is off.
    pub(crate) fn send_coast_image(self) {
        if self.coast() != 0 {
            self.cancel(COMMAND_MASK);
            self.go_on_bus();
        }
        self.replace_by_coast_image();
    }

    /// For the crash handler: whether every coast frame was sent and acknowledged. One that neither
    /// waits nor was sent is requested again: a request while cancelling is not taken.
    pub(crate) fn coast_image_sent(self) -> bool {
        let coast = self.coast();
        if coast == 0 {
            return true;
        }
        // Looked at first: what ends in between is sent.
        let waits = self.pending();
        let sent = self.registers.txbto().read().0;
        let lost = coast & !(waits | sent);
        if lost != 0 {
            self.request(lost);
        }
        sent & coast == coast
    }
}

/// Bypasses the clock calibration unit, FDCAN1's, before the first controller starts.
///
/// By the manual's text it gives no valid clock after a reset, and holds the controllers in
/// restricted operation until it is calibrated or bypassed. (Whether silicon does is doubtful: ST's
/// HAL never writes it.) It can be written only while FDCAN1 has INIT and CCE set.
fn bypass_calibration() {
    // SAFETY: a register of the FDCANs, whose common clock the caller has switched on.
    if unsafe { CALIBRATION.read_volatile() } & BYPASS != 0 {
        return;
    }
    // INIT is set since the common reset: no controller was started before this one.
    pac::FDCAN1.cccr().modify(|w| w.set_cce(true));
    // SAFETY: as above; without divider, and nothing else in it is used.
    unsafe { CALIBRATION.write_volatile(BYPASS) };
    pac::FDCAN1.cccr().modify(|w| w.set_cce(false));
}

/// A message RAM word index as the address registers take it.
#[expect(clippy::cast_possible_truncation, reason = "below 2560, checked above")]
const fn word(index: usize) -> u16 {
    index as u16
}

/// A number of elements or quanta as a register field takes it.
#[expect(clippy::cast_possible_truncation, reason = "at most 255")]
const fn byte(count: usize) -> u8 {
    count as u8
}
