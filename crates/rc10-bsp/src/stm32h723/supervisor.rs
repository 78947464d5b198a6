//! Makes the motors safe by registers within 10 ms if the buses' executor hangs or starves.
//!
//! Every 4 ms a timer looks at buses with a coast image. One whose port was not asked for 4 to 8 ms
//! has its commands taken back and its image sent, at every look until it is asked again, counted
//! as [`Health::stalls`](rc10_can::Health::stalls).
//!
//! A bus that ticks again goes on by itself, and that is safe: what it sends was computed in a new
//! tick, because its port refuses the rest of a tick that was overtaken; its motors' feedback is
//! as old as its time stamps say, so that what was not heard for too long coasts; and its loops
//! never take a step of more than 10 ms. One that does not tick again is the watchdog's case.
//!
//! It also looks whether the watchdog is about to bite, and keeps what hangs ([`crash`]).
//!
//! ```ignore
//! bind_interrupts!(struct Irqs { TIM7 => supervisor::Interrupt; });
//!
//! supervisor::start(p.TIM7, Irqs, Priority::P3); // above the buses' executor
//! ```

use cortex_m::peripheral::scb::SystemHandler;
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{self, Binding, Handler, Interrupt as _};
use embassy_stm32::peripherals::TIM7;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{RoundTo, Timer};
use embassy_stm32::{Peri, pac};

use super::{can, crash};

/// Looks a second.
const RATE: Hertz = Hertz(250);
/// From one to the next, in microseconds.
pub(super) const PERIOD: u32 = 1_000_000 / RATE.0;

/// The interrupt handler, for `bind_interrupts!`.
pub struct Interrupt;

impl Handler<typelevel::TIM7> for Interrupt {
    unsafe fn on_interrupt() {
        pac::TIM7.sr().modify(|w| w.set_uif(false));
        for controller in can::ALL {
            controller.supervise();
        }
        if crash::supervised() {
            // Sooner than else: a period that the buses' is no part of, so that not each look interrupts their tick.
            pac::TIM7.cnt().write(|w| w.set_cnt(pac::TIM7.arr().read().arr() / 7));
        }
    }
}

/// Starts to look after the buses. `priority` must be above that of their executor.
pub fn start(
    timer: Peri<'static, TIM7>,
    _interrupt: impl Binding<typelevel::TIM7, Interrupt>,
    priority: Priority,
) {
    let timer = Timer::new(timer);
    timer.set_frequency(RATE, RoundTo::Slower);
    timer.clear_update_interrupt();
    timer.enable_update_interrupt(true);
    timer.start();
    // SAFETY: nothing else sets the priority of PendSV, which nothing else uses.
    unsafe {
        let mut core = cortex_m::Peripherals::steal();
        core.SCB.set_priority(SystemHandler::PendSV, priority.into());
    }
    // Dropped, it would stop.
    core::mem::forget(timer);
    typelevel::TIM7::set_priority(priority);
    typelevel::TIM7::unpend();
    // SAFETY: the handler is bound, as `_interrupt` proves, and needs nothing else.
    unsafe { typelevel::TIM7::enable() };
}
