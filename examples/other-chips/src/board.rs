//! The board, with what is the same on both chips; the rest is in the chip's own file.

#[cfg_attr(feature = "f407", path = "board/f407.rs")]
#[cfg_attr(feature = "g473", path = "board/g473.rs")]
mod chip;

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{interrupt, pac, peripherals};
use embassy_time::Instant;
use rc10_motor::rc10_time::Micros;

/// The bus's port.
pub type Port = rc10_stm32_can::Port<rc10_stm32_can::Controller>;

/// Everything that the robot uses.
pub struct Board {
    /// The CAN bus.
    pub port: Port,
    /// For tasks that come before all others.
    pub high: SendSpawner,
    /// Restarts the chip 100 ms after it was petted last. Not unleashed yet.
    pub watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
    /// Restarted by neither a panic, nor a fault, nor the watchdog: after those a robot must not arm
    /// itself.
    pub was_switched_on: bool,
}

static HIGH: InterruptExecutor = InterruptExecutor::new();

/// UART5 is not used: its interrupt is the executor's.
#[interrupt]
fn UART5() {
    // SAFETY: called in the interrupt that the executor was started with.
    unsafe { HIGH.on_interrupt() }
}

impl Board {
    /// Clocks, the bus at 1 Mbit/s, and the executor of high priority.
    pub fn start() -> Self {
        let was_switched_on = !chip::was_restarted_by_a_watchdog();
        pac::RCC.csr().modify(|w| w.set_rmvf(true));
        // If it stayed set, it would hide the next cause.
        pac::RCC.csr().modify(|w| w.set_rmvf(false));
        let (port, watchdog) = chip::start();
        interrupt::UART5.set_priority(Priority::P6);
        Self {
            port,
            high: HIGH.start(interrupt::UART5),
            watchdog: IndependentWatchdog::new(watchdog, 100_000),
            was_switched_on,
        }
    }
}

/// Restarts the chip at once. By the window watchdog, for its flag: a debugger's reset has the one of
/// the core's own reset.
pub fn restart() -> ! {
    chip::clock_window_watchdog();
    loop {
        // A counter below 64 is one that has run out. The first write may come before the clock.
        pac::WWDG.cr().write(|w| w.set_wdga(true));
    }
}

/// The time since the start.
pub fn now() -> Micros {
    Micros::new(Instant::now().as_micros())
}
