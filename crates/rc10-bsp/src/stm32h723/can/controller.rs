//! One FDCAN controller by its registers (RM0468, FDCAN chapter) and its share of the message RAM.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::pac;
use embassy_stm32::pac::can::regs;
use rc10_can::{BusError, CanFrame, ErrorState};

use super::element::{ELEMENT, decode, encode};

/// Frames that a controller holds before the interrupt has to run: 3 ms of the shortest frames.
pub const HARDWARE_RECEIVE: usize = 64;
/// Transmit buffers, the most that the hardware has.
const TRANSMIT: usize = 32;
/// Transmit buffers kept for the coast image: the last ones.
pub const COAST_FRAMES: usize = 8;
/// Transmit buffers for [`submit`](rc10_can::CanPort::submit).
pub(super) const COMMANDS: usize = TRANSMIT - COAST_FRAMES;
/// The buffers of `submit` as a register mask.
pub(super) const COMMAND_MASK: u32 = (1 << COMMANDS) - 1;

// Message RAM, in words from the start of a controller's share.
const RECEIVE_AT: usize = 0;
const TRANSMIT_AT: usize = RECEIVE_AT + HARDWARE_RECEIVE * ELEMENT;
const SHARE: usize = TRANSMIT_AT + TRANSMIT * ELEMENT;
const _: () = assert!(3 * SHARE <= 2560, "the three FDCANs share 2560 words");

/// One of the three controllers.
#[derive(Clone, Copy)]
pub struct Controller {
    pub(super) registers: pac::can::Fdcan,
    share: usize,
    /// Which transmit buffers hold coast frames. Static, for the crash handler.
    coast: &'static AtomicU32,
}

static COAST: [AtomicU32; 3] = [const { AtomicU32::new(0) }; 3];

/// The controllers of FDCAN1, FDCAN2 and FDCAN3.
pub(crate) const ALL: [Controller; 3] = [
    Controller::new(pac::FDCAN1, 0),
    Controller::new(pac::FDCAN2, 1),
    Controller::new(pac::FDCAN3, 2),
];

impl Controller {
    const fn new(registers: pac::can::Fdcan, index: usize) -> Self {
        Self { registers, share: index * SHARE, coast: &COAST[index] }
    }

    /// Configures and starts a controller that was just reset (CCCR.INIT is set).
    pub(super) fn start(self) {
        let can = self.registers;
        can.cccr().modify(|w| w.set_cce(true));
        // 120 MHz / 3 = 40 time quanta a bit: 1 + 29 before the sample point (75 %), 10 after it.
        // The registers hold each value less one.
        can.nbtp().write(|w| {
            w.set_nbrp(3 - 1);
            w.set_ntseg1(29 - 1);
            w.set_ntseg2(10 - 1);
            w.set_nsjw(10 - 1);
        });
        // What the reset left, zero, is right for: classic frames, sent again until acknowledged; no
        // filters, everything accepted into FIFO 0; elements of eight data bytes; transmit buffers
        // that are all dedicated ones; no event FIFO; interrupt line 0.
        can.rxfc(0).write(|w| {
            w.set_fsa(word(self.share + RECEIVE_AT));
            w.set_fs(byte(HARDWARE_RECEIVE));
        });
        can.txbc().write(|w| {
            w.set_tbsa(word(self.share + TRANSMIT_AT));
            w.set_ndtb(byte(TRANSMIT));
        });
        can.ie().write(|w| {
            w.set_rfne(0, true);
            w.set_rfle(0, true);
            w.set_mrafe(true);
        });
        can.ile().write(|w| w.set_eint0(true));
        self.go_on_bus();
    }

    /// Takes part in the bus: after the configuration; after bus-off, when the hardware itself
    /// waits for the 129 x 11 recessive bits that ISO 11898-1 asks for; and after the message RAM
    /// was too slow for a frame, when the hardware stops sending (restricted operation, CCCR.ASM).
    pub(super) fn go_on_bus(self) {
        self.registers.cccr().modify(|w| {
            w.set_init(false);
            w.set_asm(false);
        });
    }

    /// The oldest received frame.
    pub(super) fn read(self) -> Option<CanFrame> {
        let status = self.registers.rxfs(0).read();
        if status.ffl() == 0 {
            return None;
        }
        let index = status.fgi();
        let at = self.share + RECEIVE_AT + usize::from(index) * ELEMENT;
        let element = core::array::from_fn(|word| pac::FDCANRAM.ram(at + word).read());
        self.registers.rxfa(0).write(|w| w.set_fai(index));
        Some(decode(element))
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

    /// Takes buffers back; one that is on the wire right now is not repeated if it fails. Says
    /// which were not being cancelled yet.
    pub(super) fn cancel(self, buffers: u32) -> u32 {
        let cancelled = buffers & !self.registers.txbcr().read().0;
        self.registers.txbcr().write_value(regs::Txbcr(buffers));
        cancelled
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
        for (buffer, frame) in (COMMANDS..TRANSMIT).zip(frames) {
            self.write(buffer, frame);
            mask |= 1 << buffer;
        }
        self.coast.store(mask, Ordering::Release);
    }

    /// For the crash handler: nothing but the coast image goes out from here on.
    pub(crate) fn send_coast_image(self) {
        let coast = self.coast.load(Ordering::Acquire);
        if coast == 0 {
            // Perhaps not even clocked: touching it could fault.
            return;
        }
        self.cancel(COMMAND_MASK);
        self.go_on_bus();
        self.request(coast);
    }

    /// For the crash handler: whether every coast frame was sent and acknowledged, or there are
    /// none.
    pub(crate) fn coast_image_sent(self) -> bool {
        let coast = self.coast.load(Ordering::Acquire);
        coast == 0 || self.registers.txbto().read().0 & coast == coast
    }
}

/// A message RAM word index as the address registers take it.
#[expect(clippy::cast_possible_truncation, reason = "below 2560, checked above")]
const fn word(index: usize) -> u16 {
    index as u16
}

/// A number of elements as a register field takes it.
#[expect(clippy::cast_possible_truncation, reason = "at most 64")]
const fn byte(count: usize) -> u8 {
    count as u8
}
