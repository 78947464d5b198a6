//! An STM32F407 with a crystal of 8 MHz, and a transceiver at PD0 (RX) and PD1 (TX).

use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource,
    Sysclk,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, Peri, bind_interrupts, interrupt, pac};
use rc10_stm32_can::{InterruptHandler, bxcan, bxcan_bus};

use super::Port;

bxcan_bus!(Drive on CAN1);
bind_interrupts!(struct Interrupts {
    CAN1_TX => InterruptHandler<Drive>;
    CAN1_RX0 => InterruptHandler<Drive>;
});

/// Clocks and the bus at 1 Mbit/s; also the watchdog that is left.
pub fn start() -> (Port, Peri<'static, IWDG>) {
    let p = embassy_stm32::init(clocks());
    interrupt::CAN1_TX.set_priority(Priority::P1);
    interrupt::CAN1_RX0.set_priority(Priority::P1);
    let port = bxcan::start::<Drive>(p.CAN1, p.PD0, p.PD1, Interrupts, 1_000_000);
    (port.expect("42 MHz make 1 Mbit/s"), p.IWDG)
}

/// 168 MHz; 42 MHz for CAN. CAN needs a crystal: the internal oscillator is off by up to 1 %.
fn clocks() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(8_000_000), mode: HseMode::Oscillator });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

/// Whether one of the two watchdogs restarted the chip.
pub fn was_restarted_by_a_watchdog() -> bool {
    let reset = pac::RCC.csr().read();
    reset.wwdgrstf() || reset.wdgrstf()
}

/// Gives the window watchdog its clock.
pub fn clock_window_watchdog() {
    pac::RCC.apb1enr().modify(|w| w.set_wwdgen(true));
}
