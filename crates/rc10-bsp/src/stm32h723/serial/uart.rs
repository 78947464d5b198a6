//! One UART by its registers (RM0468, USART chapter), and its interrupt.

use core::cell::RefCell;
use core::marker::PhantomData;

use embassy_stm32::interrupt::typelevel::{self, Handler};
use embassy_stm32::pac::usart::{regs, vals};
use embassy_stm32::usart::Instance;
use embassy_stm32::{pac, peripherals, rcc};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::AtomicWaker;

use super::config::{BaudError, Parity, SerialConfig, StopBits};
use super::ring::{LineFlags, Ring};
use crate::dma::Stream;

/// USART1 ..= 3, UART4, UART5, USART6, UART7 ..= 9, USART10.
pub trait SerialPeripheral: Instance {
    #[doc(hidden)]
    const UART: Uart;
}

/// The registers of one UART, and what its interrupt shares with its owner.
#[derive(Clone, Copy)]
pub struct Uart {
    pub(super) registers: pac::usart::Usart,
    pub(super) shared: &'static Shared,
}

/// The state that interrupt and owner share.
pub(super) struct Shared {
    pub line: Mutex<CriticalSectionRawMutex, RefCell<Line>>,
    /// The task that waits for bytes.
    pub reader: AtomicWaker,
    /// The task that waits until bytes have left.
    pub writer: AtomicWaker,
}

impl Shared {
    const fn new() -> Self {
        Self {
            line: Mutex::new(RefCell::new(Line {
                ring: Ring::new(),
                receive: None,
                transmit: None,
                is_quiet: false,
                is_transmit_broken: false,
            })),
            reader: AtomicWaker::new(),
            writer: AtomicWaker::new(),
        }
    }
}

/// Both directions.
pub(super) struct Line {
    pub ring: Ring,
    /// The stream that fills the ring.
    pub receive: Option<Stream>,
    pub transmit: Option<Stream>,
    /// The UART is quiet until the reader comes: what a line full of errors costs is up to it.
    is_quiet: bool,
    /// A transfer out of memory has failed, and that was not reported yet.
    pub is_transmit_broken: bool,
}

/// The interrupt handler, for `bind_interrupts!`: of the UART and of its DMA streams.
///
/// ```ignore
/// bind_interrupts!(struct Irqs {
///     USART1 => serial::Interrupt<USART1>;
///     DMA1_STREAM0 => serial::Interrupt<USART1>; // receives
///     DMA1_STREAM1 => serial::Interrupt<USART1>; // sends
/// });
/// ```
pub struct Interrupt<T>(PhantomData<T>);

impl<T: SerialPeripheral, I: typelevel::Interrupt> Handler<I> for Interrupt<T> {
    unsafe fn on_interrupt() {
        T::UART.serve();
    }
}

impl Line {
    /// Brings the ring's accounts up to date.
    #[inline]
    pub fn look(&mut self) {
        if let Some(stream) = self.receive {
            let events = stream.take_events();
            if !events.error {
                self.ring.look(stream.remaining().into(), events.half, events.complete);
            }
        }
    }
}

impl Uart {
    /// Switches its clock on and sets it up. The streams are not started.
    pub(super) fn start<T: SerialPeripheral>(
        self,
        config: &SerialConfig,
        direction: Direction,
    ) -> Result<(), BaudError> {
        let divisor = config.divisor(rcc::frequency::<T>().0)?;
        rcc::enable_and_reset::<T>();
        let uart = self.registers;
        uart.brr().write(|w| w.set_brr(divisor));
        uart.cr2().write(|w| {
            w.set_stop(match config.stop_bits {
                StopBits::One => vals::Stop::STOP1,
                StopBits::Two => vals::Stop::STOP2,
            });
            w.set_rxinv(config.invert_receive);
            w.set_txinv(config.invert_transmit);
        });
        uart.cr3().write(|w| {
            // Framing, noise and overrun interrupt. They do not stop the DMA: DDRE stays 0.
            w.set_eie(true);
            w.set_dmar(true);
            w.set_dmat(direction.transmits);
            w.set_dem(direction.drives_enable);
        });
        uart.cr1().write(|w| {
            // The parity bit is one of the word's bits: nine of them.
            if config.parity != Parity::None {
                w.set_m0(vals::M0::BIT9);
                w.set_pce(true);
            }
            w.set_ps(match config.parity {
                Parity::None | Parity::Even => vals::Ps::EVEN,
                Parity::Odd => vals::Ps::ODD,
            });
            if direction.drives_enable {
                // In sixteenths of a bit: one bit to wake up before, and half of one behind.
                w.set_deat(16);
                w.set_dedt(8);
            }
        });
        // All of that is locked from here on.
        uart.cr1().modify(|w| {
            w.set_peie(config.parity != Parity::None);
            w.set_idleie(true);
            w.set_re(true);
            w.set_te(direction.transmits);
            w.set_ue(true);
        });
        Ok(())
    }

    /// Address of received bytes for a DMA: read as a byte, without the parity bit.
    pub(super) fn receive_register(self) -> u32 {
        self.registers.rdr().as_ptr() as u32
    }

    pub(super) fn transmit_register(self) -> u32 {
        self.registers.tdr().as_ptr() as u32
    }

    /// Whether the last bit of what was given to the UART has left.
    pub(super) fn has_sent(self) -> bool {
        self.registers.isr().read().tc()
    }

    /// Before bytes are given to it: from now on [`has_sent`](Self::has_sent) is about them.
    pub(super) fn forget_sent(self) {
        self.registers.icr().write(|w| w.set_tc(true));
    }

    /// Interrupts once the last bit has left; only with interrupts masked: a shared register.
    pub(super) fn tell_when_sent(self) {
        self.registers.cr1().modify(|w| w.set_tcie(true));
    }

    /// Takes the UART's flags until now, after a look of `line`; whether any was set.
    fn hear(self, line: &mut Line) -> bool {
        let flags = self.registers.isr().read();
        let mut clear = regs::Icr(0);
        clear.set_idle(flags.idle());
        clear.set_pe(flags.pe());
        clear.set_fe(flags.fe());
        clear.set_ne(flags.ne());
        clear.set_ore(flags.ore());
        if clear.0 == 0 {
            return false;
        }
        self.registers.icr().write_value(clear);
        if flags.ore() || flags.fe() || flags.pe() || flags.ne() {
            let errors = LineFlags {
                overrun: flags.ore(),
                framing: flags.fe(),
                parity: flags.pe(),
                noise: flags.ne(),
            };
            // With DDRE at 0 a byte with an error is not the DMA's, and lies here until the next
            // one (RM0468, USART_CR3); RXNE says that the next one is there: it is the DMA's.
            let is_there = flags.fe() && !flags.rxne();
            let wrong = is_there.then(|| self.registers.rdr().read().0.to_le_bytes()[0]);
            line.ring.fail(errors, wrong);
        }
        true
    }

    /// Whether pauses and errors interrupt.
    fn set_quiet(self, line: &mut Line, is_quiet: bool) {
        line.is_quiet = is_quiet;
        self.registers.cr1().modify(|w| {
            // No error without parity.
            w.set_peie(w.pce() && !is_quiet);
            w.set_idleie(!is_quiet);
        });
        self.registers.cr3().modify(|w| w.set_eie(!is_quiet));
    }

    /// What came since the check is checked, and interrupts go on. Whether there is more to read.
    pub(super) fn go_on(self, line: &mut Line) -> bool {
        if !line.is_quiet {
            return false;
        }
        // Before the flags: what they do not tell of has come whole.
        line.look();
        if !self.hear(line) || !line.ring.has_failed() {
            line.ring.check();
            self.set_quiet(line, false);
        }
        true
    }

    fn serve(self) {
        let (mut is_reader_due, mut is_writer_due) = (false, false);
        self.shared.line.lock(|line| {
            let line = &mut *line.borrow_mut();
            if let Some(stream) = line.receive {
                let events = stream.take_events();
                is_reader_due = events.half || events.complete || events.error;
                // A failed stream stops until the next read: it does not keep the processor busy.
                if !events.error {
                    line.ring.look(stream.remaining().into(), events.half, events.complete);
                }
                if !line.is_quiet {
                    line.ring.check();
                    is_reader_due |= self.hear(line);
                    if line.ring.has_failed() {
                        self.set_quiet(line, true);
                    }
                }
            }
            if let Some(stream) = line.transmit {
                let events = stream.take_events();
                line.is_transmit_broken |= events.error;
                is_writer_due = events.complete || events.error;
                if self.has_sent() && self.registers.cr1().read().tcie() {
                    self.registers.cr1().modify(|w| w.set_tcie(false));
                    is_writer_due = true;
                }
            }
        });
        if is_reader_due {
            self.shared.reader.wake();
        }
        if is_writer_due {
            self.shared.writer.wake();
        }
    }
}

/// The uses of a UART besides receiving.
#[derive(Clone, Copy, Default)]
pub(super) struct Direction {
    pub transmits: bool,
    /// Whether its driver-enable pin is high while it sends.
    pub drives_enable: bool,
}

macro_rules! uarts {
    ($($name:ident),* $(,)?) => {
        $(impl SerialPeripheral for peripherals::$name {
            const UART: Uart = {
                static SHARED: Shared = Shared::new();
                Uart { registers: pac::$name, shared: &SHARED }
            };
        })*
    };
}

uarts!(USART1, USART2, USART3, UART4, UART5, USART6, UART7, UART8, UART9, USART10);
