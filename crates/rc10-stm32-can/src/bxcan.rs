//! bxCAN (RM0090): F4, F7, F3, L4 and others with alternate functions; not F1, which remaps.

use embassy_stm32::Peri;
use embassy_stm32::can::{Instance, RxPin, TxPin};
use embassy_stm32::interrupt::typelevel::{Binding, Interrupt};
use embassy_stm32::pac::can::Can;
use embassy_stm32::pac::can::regs::{Fr1, Fr2, Tdhr, Tdlr, Tdtr, Tir};
use embassy_stm32::pac::can::vals::Lec;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::Instant;
use rc10_can::{BitTiming, BitTimingLimits, CanFrame, IdPattern};
use rc10_time::Micros;

use crate::layout::{REQUEST, decode, encode, filter};
use crate::start::{BRIEF, PATIENCE, byte, wait_for};
use crate::{Bus, BusOff, Ended, Errors, Hardware, InterruptHandler, Port, StartError};

/// Filter banks of a controller: half of the 28 that two share, or all that one has.
const BANKS: usize = 14;
/// Two controllers have their filters in the registers of one, and may be started by two tasks.
static FILTERS: Mutex<CriticalSectionRawMutex, ()> = Mutex::new(());
/// The longest synchronisation jump, quanta.
const LONGEST_JUMP: u16 = 4;

/// Declares a bus for [`start`](crate::bxcan::start) and its handler, and its driver's place.
///
/// `bxcan_bus!(Drive on CAN1);` is one with filters of its own. CAN2 has its filters in CAN1, which
/// must be started first: `bxcan_bus!(Turret on CAN2, filters of CAN1);`. Start all buses before
/// the runners: while the filters of one are set up, the other receives nothing.
#[macro_export]
macro_rules! bxcan_bus {
    ($(#[$attribute:meta])* $visibility:vis $name:ident on $peripheral:ident) => {
        $crate::bxcan_bus!(@ [$(#[$attribute])* $visibility] $name $peripheral $peripheral 0);
    };
    ($(#[$attribute:meta])* $visibility:vis $name:ident on $peripheral:ident,
        filters of $owner:ident) => {
        $crate::bxcan_bus!(@ [$(#[$attribute])* $visibility] $name $peripheral $owner 14);
    };
    (@ [$($head:tt)*] $name:ident $peripheral:ident $owner:ident $first_bank:literal) => {
        $crate::bus!([$($head)*] $name $peripheral {
            use $crate::embassy_stm32::pac;
            $crate::bxcan::BxCan::new(pac::$peripheral, pac::$owner, $first_bank)
        });
    };
}

/// Starts a bus at a bit rate, for all frames. Pins are checked when this is compiled.
///
/// Give its interrupts priority over all that takes longer than 140 µs, three frames.
pub fn start<B: Bus>(
    _peripheral: Peri<'static, B::Peripheral>,
    receive: Peri<'static, impl RxPin<B::Peripheral>>,
    transmit: Peri<'static, impl TxPin<B::Peripheral>>,
    _interrupts: impl Binding<<B::Peripheral as Instance>::TXInterrupt, InterruptHandler<B>>
    + Binding<<B::Peripheral as Instance>::RX0Interrupt, InterruptHandler<B>>,
    bits_per_second: u32,
) -> Result<Port<BxCan>, StartError> {
    let port = crate::start::start::<B>(receive, transmit, bits_per_second)?;
    // SAFETY: their handler is bound, as the arguments prove, and what it looks at is there.
    #[expect(unsafe_code, reason = "the interrupts begin here")]
    unsafe {
        <B::Peripheral as Instance>::TXInterrupt::enable();
        <B::Peripheral as Instance>::RX0Interrupt::enable();
    }
    Ok(port)
}

/// The registers of one bxCAN.
pub struct BxCan {
    registers: Can,
    /// The registers that have the filters: its own, or those of CAN1.
    filters: Can,
    first_bank: usize,
    bus_off: BusOff,
}

impl BxCan {
    pub(crate) const LIMITS: BitTimingLimits = BitTimingLimits::BXCAN;

    #[doc(hidden)]
    #[must_use]
    pub const fn new(registers: Can, filters: Can, first_bank: usize) -> Self {
        Self { registers, filters, first_bank, bus_off: BusOff::new() }
    }

    /// Configures a controller that was just reset, and goes on the bus.
    pub(crate) fn configure(&mut self, timing: BitTiming) -> Result<(), StartError> {
        let can = self.registers;
        if self.filters.fmr().read().0 == 0 {
            // It is never zero: this controller has no clock.
            return Err(StartError::NoFilters);
        }
        can.mcr().modify(|w| {
            w.set_sleep(false);
            w.set_inrq(true);
            // Set by a reset: under a debugger the controller goes on.
            w.set_dbf(false);
        });
        let is_ready = || {
            let status = can.msr().read();
            status.inak() && !status.slak()
        };
        if !wait_for(PATIENCE, is_ready) {
            return Err(StartError::NoAnswer);
        }
        // The register holds each value less one.
        can.btr().write(|w| {
            w.set_brp(timing.prescaler - 1);
            w.set_ts(0, byte(timing.before - 1));
            w.set_ts(1, byte(timing.after - 1));
            w.set_sjw(byte(timing.after.min(LONGEST_JUMP) - 1));
        });
        // Zero is right for all else in MCR: mailboxes by identifier, repeated frames, bus-off.
        FILTERS.lock(|()| self.open_filters());
        can.ier().write(|w| {
            w.set_tmeie(true);
            w.set_fmpie(0, true);
            // Not to interrupt (there is no ERRIE), but for ERRI to keep that it was off.
            w.set_bofie(true);
        });
        can.mcr().modify(|w| w.set_inrq(false));
        Ok(())
    }

    /// All banks become pairs of identifier and mask for FIFO 0, and the first lets everything in.
    fn open_filters(&self) {
        let filters = self.filters;
        filters.fmr().modify(|w| w.set_finit(true));
        let banks = self.first_bank..self.first_bank + BANKS;
        filters.fm1r().modify(|w| banks.clone().for_each(|bank| w.set_fbm(bank, false)));
        filters.fs1r().modify(|w| banks.clone().for_each(|bank| w.set_fsc(bank, true)));
        filters.ffa1r().modify(|w| banks.clone().for_each(|bank| w.set_ffa(bank, false)));
        filters.fmr().modify(|w| w.set_finit(false));
        self.set_bank(0, Some([0; 2]));
    }

    /// A bank's values may be changed while it is off, and the others go on.
    fn set_bank(&self, bank: usize, filter: Option<[u32; 2]>) {
        let bank = self.first_bank + bank;
        self.filters.fa1r().modify(|w| w.set_fact(bank, false));
        if let Some([identifier, mask]) = filter {
            self.filters.fb(bank).fr1().write_value(Fr1(identifier));
            self.filters.fb(bank).fr2().write_value(Fr2(mask));
            self.filters.fa1r().modify(|w| w.set_fact(bank, true));
        }
    }
}

impl Hardware for BxCan {
    fn now(&self) -> Micros {
        Micros::new(Instant::now().as_micros())
    }

    fn load(&mut self, mailbox: usize, frame: &CanFrame) {
        let [identifier, length, low, high] = encode(frame);
        let mailbox = self.registers.tx(mailbox);
        mailbox.tdtr().write_value(Tdtr(length));
        mailbox.tdlr().write_value(Tdlr(low));
        mailbox.tdhr().write_value(Tdhr(high));
        mailbox.tir().write_value(Tir(identifier | REQUEST));
    }

    fn abort(&mut self, mailbox: usize) {
        let status = self.registers.tsr();
        // All other bits are cleared by ones.
        status.write(|w| w.set_abrq(mailbox, true));
        // At once, unless it is on the wire.
        let _ = wait_for(BRIEF, || status.read().rqcp(mailbox));
    }

    fn ended(&mut self, mailbox: usize) -> Option<Ended> {
        let status = self.registers.tsr();
        let now = status.read();
        if !now.rqcp(mailbox) {
            return None;
        }
        // Clears the outcome, too.
        status.write(|w| w.set_rqcp(mailbox, true));
        Some(if now.txok(mailbox) { Ended::Sent } else { Ended::Aborted })
    }

    fn receive(&mut self) -> Option<CanFrame> {
        let fifo = self.registers.rfr(0);
        // The one before is being released, which takes some cycles.
        let is_ready = wait_for(PATIENCE, || !fifo.read().rfom());
        if !is_ready || fifo.read().fmp() == 0 {
            return None;
        }
        let oldest = self.registers.rx(0);
        let identifier = oldest.rir().read().0;
        let length = oldest.rdtr().read().0;
        let data = (oldest.rdlr().read().0, oldest.rdhr().read().0);
        fifo.write(|w| w.set_rfom(true));
        Some(decode([identifier, length, data.0, data.1]))
    }

    fn overrun(&mut self) -> bool {
        let fifo = self.registers.rfr(0);
        let overrun = fifo.read().fovr();
        if overrun {
            // Cleared by a one; without RFOM nothing is released.
            fifo.write(|w| w.set_fovr(true));
        }
        overrun
    }

    fn is_off(&mut self) -> bool {
        let off = self.registers.esr().read().boff();
        let fell = self.registers.msr().read().erri();
        if fell {
            self.registers.msr().write(|w| w.set_erri(true));
        }
        self.bus_off.is_off(off, fell)
    }

    fn errors(&mut self) -> Errors {
        let status = self.registers.esr().read();
        let flags = [status.boff(), status.epvf(), status.ewgf()];
        let code = status.lec().to_bits();
        let errors = Errors::new(flags, code, status.tec(), status.rec().min(127));
        if errors.last.is_some() {
            // "Set by software": it has been told.
            self.registers.esr().write(|w| w.set_lec(Lec::CUSTOM));
        }
        errors
    }

    fn restart(&mut self) -> bool {
        let can = self.registers;
        // RM0090: software enters initialization mode, after the frame of others; then it counts.
        can.mcr().modify(|w| w.set_inrq(true));
        if !wait_for(BRIEF, || can.msr().read().inak()) {
            return false;
        }
        can.mcr().modify(|w| w.set_inrq(false));
        self.bus_off.restarted();
        true
    }

    fn accept(&mut self, patterns: &[IdPattern]) {
        // Everything comes in while they change.
        self.set_bank(0, Some([0; 2]));
        for bank in 1..BANKS {
            self.set_bank(bank, patterns.get(bank - 1).map(filter));
        }
        if patterns.len() < BANKS {
            self.set_bank(0, None);
        }
    }
}
