//! An STM32G473 with a crystal of 24 MHz, and a transceiver at PA11 (RX) and PA12 (TX).

use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::rcc::{
    Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk, mux::Fdcansel,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, Peri, bind_interrupts, interrupt, pac};
use rc10_stm32_can::{InterruptHandler, fdcan, fdcan_bus};

use super::Port;

fdcan_bus!(Drive on FDCAN1);
bind_interrupts!(struct Interrupts {
    FDCAN1_IT0 => InterruptHandler<Drive>;
});

/// Clocks and the bus at 1 Mbit/s; also the watchdog that is left.
pub fn start() -> (Port, Peri<'static, IWDG>) {
    let p = embassy_stm32::init(clocks());
    interrupt::FDCAN1_IT0.set_priority(Priority::P1);
    let port = fdcan::start::<Drive>(p.FDCAN1, p.PA11, p.PA12, Interrupts, 1_000_000);
    (port.expect("170 MHz make 1 Mbit/s"), p.IWDG)
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

/// Whether one of the two watchdogs restarted the chip.
pub fn was_restarted_by_a_watchdog() -> bool {
    let reset = pac::RCC.csr().read();
    reset.wwdgrstf() || reset.iwdgrstf()
}

/// Gives the window watchdog its clock.
pub fn clock_window_watchdog() {
    pac::RCC.apb1enr1().modify(|w| w.set_wwdgen(true));
}
