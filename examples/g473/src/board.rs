//! The board: an STM32G473 with a crystal of 24 MHz, and a transceiver at PA11 (RX) and PA12 (TX).

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::rcc::{
    Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk, mux::Fdcansel,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, bind_interrupts, interrupt, pac, peripherals};
use embassy_time::Instant;
use rc10_motor::rc10_can::Micros;
use rc10_stm32_can::fdcan::{self, Fdcan, InterruptHandler};
use rc10_stm32_can::fdcan_bus;

fdcan_bus!(Drive on FDCAN1);
bind_interrupts!(struct Interrupts {
    FDCAN1_IT0 => InterruptHandler<Drive>;
});

/// The bus's port.
pub type Port = rc10_stm32_can::Port<Fdcan>;

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
        let reset = pac::RCC.csr().read();
        pac::RCC.csr().modify(|w| w.set_rmvf(true));
        // If it stayed set, it would hide the next cause.
        pac::RCC.csr().modify(|w| w.set_rmvf(false));
        let p = embassy_stm32::init(clocks());
        interrupt::FDCAN1_IT0.set_priority(Priority::P1);
        interrupt::UART5.set_priority(Priority::P6);
        let port = fdcan::start::<Drive>(p.FDCAN1, p.PA11, p.PA12, Interrupts, 1_000_000);
        Self {
            port: port.expect("170 MHz make 1 Mbit/s"),
            high: HIGH.start(interrupt::UART5),
            watchdog: IndependentWatchdog::new(p.IWDG, 100_000),
            was_switched_on: !reset.wwdgrstf() && !reset.iwdgrstf(),
        }
    }
}

/// 170 MHz, for FDCAN too. CAN needs a crystal: the internal oscillator is off by up to 1 %.
fn clocks() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(24_000_000), mode: HseMode::Oscillator });
    config.rcc.pll = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV6,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    config.rcc.sys = Sysclk::PLL1_R;
    config.rcc.boost = true;
    config.rcc.mux.fdcansel = Fdcansel::PCLK1;
    config
}

/// Restarts the chip at once. By the window watchdog, for its flag: a debugger's reset has the one of
/// the core's own reset.
pub fn restart() -> ! {
    pac::RCC.apb1enr1().modify(|w| w.set_wwdgen(true));
    loop {
        // A counter below 64 is one that has run out. The first write may come before the clock.
        pac::WWDG.cr().write(|w| w.set_wdga(true));
    }
}

/// The time since the start.
pub fn now() -> Micros {
    Micros::new(Instant::now().as_micros())
}
