use embassy_stm32::can::{RxPin, TxPin};
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::{Peri, rcc};

use super::port::{BusPeripheral, FdcanPort};

/// What one bus is made of on the chip: a peripheral and its two pins.
pub struct BusParts<T: BusPeripheral> {
    /// Holding it is what makes this the only port on the controller.
    _peripheral: Peri<'static, T>,
    receive: (Flex<'static>, u8),
    transmit: (Flex<'static>, u8),
}

impl<T: BusPeripheral> BusParts<T> {
    /// `receive` and `transmit` are checked against the peripheral at compile time.
    pub fn new<R: RxPin<T>, X: TxPin<T>>(
        peripheral: Peri<'static, T>,
        receive: Peri<'static, R>,
        transmit: Peri<'static, X>,
    ) -> Self {
        let (receive_function, transmit_function) = (receive.af_num(), transmit.af_num());
        Self {
            _peripheral: peripheral,
            receive: (Flex::new(receive), receive_function),
            transmit: (Flex::new(transmit), transmit_function),
        }
    }
}

/// One CAN bus. Starting it starts everything that it needs.
#[derive(Debug)]
pub struct Bus;

impl Bus {
    /// Brings the controller up.
    #[must_use]
    pub fn start<T: BusPeripheral>(parts: BusParts<T>) -> FdcanPort {
        // The three controllers have one reset in common; embassy does it before the first only.
        rcc::enable_and_reset::<T>();
        // The pins only now: a transmit pin without a controller behind it could hold the bus low.
        let (mut receive, function) = parts.receive;
        receive.set_as_af_unchecked(function, AfType::input(Pull::None));
        let (mut transmit, function) = parts.transmit;
        let push_pull = AfType::output(OutputType::PushPull, Speed::VeryHigh);
        transmit.set_as_af_unchecked(function, push_pull);
        // Dropped, they would disconnect.
        core::mem::forget((receive, transmit));

        T::CONTROLLER.start();
        FdcanPort::new(T::CONTROLLER)
    }
}
