//! Which pin is what. Source: the team's `CubeMX` project for the STM32H723ZGT6 board.

use embassy_stm32::peripherals::{FDCAN1, FDCAN2, FDCAN3, IWDG1, TIM7};
use embassy_stm32::{Peri, Peripherals};
use rc10_bsp::can::BusParts;

/// The board's parts, by what they are for.
pub struct Board {
    /// FDCAN1: receive PD0, transmit PD1.
    pub bus_1: BusParts<FDCAN1>,
    /// FDCAN2: receive PB12, transmit PB13.
    pub bus_2: BusParts<FDCAN2>,
    /// FDCAN3: receive PF6, transmit PF7.
    pub bus_3: BusParts<FDCAN3>,
    /// A timer that drives no pin.
    pub supervisor: Peri<'static, TIM7>,
    /// The independent watchdog.
    pub watchdog: Peri<'static, IWDG1>,
}

impl Board {
    /// Hands out the pins.
    pub fn new(p: Peripherals) -> Self {
        Self {
            bus_1: BusParts::new(p.FDCAN1, p.PD0, p.PD1),
            bus_2: BusParts::new(p.FDCAN2, p.PB12, p.PB13),
            bus_3: BusParts::new(p.FDCAN3, p.PF6, p.PF7),
            supervisor: p.TIM7,
            watchdog: p.IWDG1,
        }
    }
}
