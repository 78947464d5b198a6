//! The small FDCAN (RM0440) of fixed layout: G4, H5, L5, U5 and others; H7: `rc10-bsp`.

use embassy_stm32::Peri;
use embassy_stm32::can::{Instance, RxPin, TxPin};
use embassy_stm32::interrupt::typelevel::{Binding, Interrupt};
use embassy_stm32::pac::can::Fdcan as Registers;
use embassy_stm32::pac::can::regs::{Txbar, Txbcie, Txbcr, Txbtie};
use embassy_stm32::pac::can::vals::{Anfe, Anfs, Tfqm};
use embassy_stm32::pac::fdcanram::Fdcanram;
use embassy_time::Instant;
use rc10_can::m_can::{EXTENDED_FILTER, decode, encode, filters};
use rc10_can::{BitTiming, BitTimingLimits, CanFrame, IdPattern};
use rc10_time::Micros;

use crate::start::{BRIEF, PATIENCE, byte, wait_for};
use crate::{Bus, Ended, Errors, Hardware, InterruptHandler, MAILBOXES, Port, StartError};

// Filters of a controller (RM0440, "Message RAM").
const STANDARD_FILTERS: usize = 28;
const EXTENDED_FILTERS: usize = 8;
/// Words of a frame's element, which has room for 64 bytes.
const ELEMENT: usize = 18;

/// The transmit buffers as a register mask.
const BUFFERS: u32 = (1 << MAILBOXES) - 1;

/// Declares a bus: a type for [`start`](crate::fdcan::start) and
/// [`InterruptHandler`](crate::InterruptHandler), and the place where its driver stands.
/// `fdcan_bus!(Drive on FDCAN1);`
#[macro_export]
macro_rules! fdcan_bus {
    ($(#[$attribute:meta])* $visibility:vis $name:ident on FDCAN) => {
        $crate::fdcan_bus!(@ [$(#[$attribute])* $visibility] $name FDCAN FDCANRAM);
    };
    ($(#[$attribute:meta])* $visibility:vis $name:ident on FDCAN1) => {
        $crate::fdcan_bus!(@ [$(#[$attribute])* $visibility] $name FDCAN1 FDCANRAM1);
    };
    ($(#[$attribute:meta])* $visibility:vis $name:ident on FDCAN2) => {
        $crate::fdcan_bus!(@ [$(#[$attribute])* $visibility] $name FDCAN2 FDCANRAM2);
    };
    ($(#[$attribute:meta])* $visibility:vis $name:ident on FDCAN3) => {
        $crate::fdcan_bus!(@ [$(#[$attribute])* $visibility] $name FDCAN3 FDCANRAM3);
    };
    (@ [$($head:tt)*] $name:ident $peripheral:ident $memory:ident) => {
        $crate::bus!([$($head)*] $name $peripheral {
            use $crate::embassy_stm32::pac;
            $crate::fdcan::Fdcan::new(pac::$peripheral, pac::$memory)
        });
    };
}

/// Starts a bus at a bit rate, for all frames. Pins are checked when this is compiled. The kernel
/// clock is `rcc.mux.fdcansel`, by default the crystal.
///
/// Give its interrupt priority over all that takes longer than 140 µs, three frames.
pub fn start<B: Bus>(
    _peripheral: Peri<'static, B::Peripheral>,
    receive: Peri<'static, impl RxPin<B::Peripheral>>,
    transmit: Peri<'static, impl TxPin<B::Peripheral>>,
    _interrupts: impl Binding<<B::Peripheral as Instance>::IT0Interrupt, InterruptHandler<B>>,
    bits_per_second: u32,
) -> Result<Port<Fdcan>, StartError> {
    let port = crate::start::start::<B>(receive, transmit, bits_per_second)?;
    // SAFETY: its handler is bound, as the arguments prove, and what it looks at is there.
    #[expect(unsafe_code, reason = "the interrupt begins here")]
    unsafe {
        <B::Peripheral as Instance>::IT0Interrupt::enable();
    }
    Ok(port)
}

/// The registers of one FDCAN, and its message RAM.
pub struct Fdcan {
    registers: Registers,
    memory: Fdcanram,
}

impl Fdcan {
    pub(crate) const LIMITS: BitTimingLimits = BitTimingLimits::FDCAN;

    #[doc(hidden)]
    #[must_use]
    pub const fn new(registers: Registers, memory: Fdcanram) -> Self {
        Self { registers, memory }
    }

    /// Configures the controller, and goes on the bus.
    pub(crate) fn configure(&mut self, timing: BitTiming) -> Result<(), StartError> {
        let can = self.registers;
        can.cccr().modify(|w| w.set_init(true));
        if !wait_for(PATIENCE, || can.cccr().read().init()) {
            return Err(StartError::NoAnswer);
        }
        can.cccr().modify(|w| w.set_cce(true));
        // What it holds after power-on is anything.
        for word in 0..MAILBOXES * ELEMENT {
            self.memory.txbuf(word).write_value(0);
            self.memory.rxfifo0(word).write_value(0);
        }
        // The register holds each value less one.
        can.nbtp().write(|w| {
            w.set_nbrp(timing.prescaler - 1);
            w.set_ntseg1(byte(timing.before - 1));
            w.set_ntseg2(byte(timing.after - 1));
            w.set_nsjw(byte(timing.after - 1));
        });
        can.rxgfc().write(|w| {
            w.set_lss(byte(STANDARD_FILTERS));
            w.set_lse(byte(EXTENDED_FILTERS));
            w.set_anfs(Anfs::REJECT);
            w.set_anfe(Anfe::REJECT);
        });
        self.accept(&[IdPattern::any_standard(), IdPattern::any_extended()]);
        // The most urgent frame leaves first; TXBRP lets each buffer be chosen.
        can.txbc().write(|w| w.set_tfqm(Tfqm::QUEUE));
        can.txbtie().write_value(Txbtie(BUFFERS));
        can.txbcie().write_value(Txbcie(BUFFERS));
        can.ie().write(|w| {
            w.set_rfne(0, true);
            w.set_tce(true);
            w.set_tcfe(true);
            w.set_boe(true);
        });
        // All of them are line 0's.
        can.ile().write(|w| w.set_eint0(true));
        self.go_on_bus();
        Ok(())
    }

    /// Takes part: after configuration, and after bus-off, with ISO 11898-1's recessive bits.
    fn go_on_bus(&self) {
        let can = self.registers;
        can.cccr().modify(|w| {
            w.set_cce(false);
            w.set_init(false);
        });
        // Until the other clock has it: INIT would look like a bus-off.
        let _ = wait_for(PATIENCE, || !can.cccr().read().init());
    }

    fn is_pending(&self, mailbox: usize) -> bool {
        // A new request may stay in TXBAR while the controller looks for its most urgent frame.
        self.registers.txbar().read().ar(mailbox) || self.registers.txbrp().read().trp(mailbox)
    }
}

impl Hardware for Fdcan {
    fn now(&self) -> Micros {
        Micros::new(Instant::now().as_micros())
    }

    fn acknowledge(&mut self) {
        // Cleared by ones. What was lost, and the message RAM's failures, are looked at later.
        self.registers.ir().write(|w| {
            w.set_rfn(0, true);
            w.set_tc(true);
            w.set_tcf(true);
            w.set_bo(true);
        });
    }

    fn load(&mut self, mailbox: usize, frame: &CanFrame) {
        let at = mailbox * ELEMENT;
        for (word, value) in encode(frame).into_iter().enumerate() {
            self.memory.txbuf(at + word).write_value(value);
        }
        self.registers.txbar().write_value(Txbar(1 << mailbox));
    }

    fn abort(&mut self, mailbox: usize) {
        self.registers.txbcr().write_value(Txbcr(1 << mailbox));
        // At once, unless it is on the wire.
        let _ = wait_for(BRIEF, || !self.is_pending(mailbox));
    }

    fn ended(&mut self, mailbox: usize) -> Option<Ended> {
        if self.is_pending(mailbox) {
            return None;
        }
        let sent = self.registers.txbto().read().to(mailbox);
        Some(if sent { Ended::Sent } else { Ended::Aborted })
    }

    fn receive(&mut self) -> Option<CanFrame> {
        let status = self.registers.rxfs(0).read();
        if status.ffl() == 0 {
            return None;
        }
        let at = usize::from(status.fgi()) * ELEMENT;
        let read = |word| self.memory.rxfifo0(at + word).read();
        let frame = decode([read(0), read(1), read(2), read(3)]);
        self.registers.rxfa(0).write(|w| w.set_fai(status.fgi()));
        Some(frame)
    }

    fn overrun(&mut self) -> bool {
        let raised = self.registers.ir().read();
        // FIFO 0 was full, or the message RAM too slow.
        let overrun = raised.rfl(0) || raised.mraf();
        if overrun {
            self.registers.ir().write(|w| {
                w.set_rfl(0, true);
                w.set_mraf(true);
            });
        }
        overrun
    }

    fn is_off(&mut self) -> bool {
        // Since the start only the hardware sets it, as it goes bus-off.
        self.registers.cccr().read().init()
    }

    fn errors(&mut self) -> Errors {
        // Reading it clears the last error.
        let status = self.registers.psr().read();
        let counters = self.registers.ecr().read();
        // On its way back the hardware notes a bit error for every 11 recessive bits.
        let code = if status.bo() { 0 } else { status.lec().to_bits() };
        let flags = [status.bo(), status.ep(), status.ew()];
        Errors::new(flags, code, counters.tec(), counters.rec())
    }

    fn restart(&mut self) -> bool {
        // RM0440, CCE: it resets TXBRP, TXBTO and TXBCF, so that nothing cancelled leaves, and
        // RXF0S. INIT, needed before, is set since bus-off.
        self.registers.cccr().modify(|w| w.set_cce(true));
        self.go_on_bus();
        true
    }

    fn leave_restricted(&mut self) -> bool {
        // The message RAM was too slow for a frame, and that is over.
        let restricted = self.registers.cccr().read().asm();
        if restricted {
            self.registers.cccr().modify(|w| w.set_asm(false));
        }
        restricted
    }

    /// Rewrites the filters, also on the bus: the first of each size lets all in, and changes last.
    fn accept(&mut self, patterns: &[IdPattern]) {
        let mut standard = [0; STANDARD_FILTERS];
        let mut extended = [0; EXTENDED_FILTERS * EXTENDED_FILTER];
        filters(patterns, &mut standard, &mut extended);
        let (mut any_standard, mut any_extended) = ([0; 1], [0; EXTENDED_FILTER]);
        let any = [IdPattern::any_standard(), IdPattern::any_extended()];
        filters(&any, &mut any_standard, &mut any_extended);

        self.memory.flssa(0).write_value(any_standard[0]);
        for place in (0..STANDARD_FILTERS).rev() {
            self.memory.flssa(place).write_value(standard[place]);
        }
        // The mask is in the second word: first it grows, at last it shrinks.
        self.memory.flesa(1).write_value(any_extended[1]);
        self.memory.flesa(0).write_value(any_extended[0]);
        for place in (0..EXTENDED_FILTERS).rev() {
            let at = EXTENDED_FILTER * place;
            self.memory.flesa(at).write_value(extended[at]);
            self.memory.flesa(at + 1).write_value(extended[at + 1]);
        }
    }
}
