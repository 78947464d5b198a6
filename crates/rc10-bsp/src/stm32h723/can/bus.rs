use embassy_stm32::can::{RxPin, TxPin};
use embassy_stm32::gpio::{AfType, Flex, Level, OutputType, Pin, Pull, Speed};
use embassy_stm32::{Peri, rcc};
use embassy_time::{Duration, block_for};

use super::port::{BusPeripheral, FdcanPort};

/// The time that a transceiver gets from standby until it sends: data sheets say up to 50 µs.
const WAKE_UP: Duration = Duration::from_micros(100);

/// The parts of one bus on the chip: a peripheral, its two pins, and the transceiver's third.
pub struct BusParts<T: BusPeripheral> {
    /// Holding it is what makes this the only port on the controller.
    _peripheral: Peri<'static, T>,
    receive: (Flex<'static>, u8),
    transmit: (Flex<'static>, u8),
    standby: Option<(Flex<'static>, Level)>,
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
            standby: None,
        }
    }

    /// The transceiver's pin (STB, S, SILENT, EN) that decides whether it sends, at `level` if so.
    ///
    /// In standby the controller reads no own bits, and is bus-off at once.
    #[must_use]
    pub fn with_standby(mut self, pin: Peri<'static, impl Pin>, level: Level) -> Self {
        self.standby = Some((Flex::new(pin), level));
        self
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
        // Before the controller, whose bits the transceiver must send.
        if let Some((mut pin, level)) = parts.standby {
            pin.set_level(level);
            pin.set_as_output(Speed::Low);
            core::mem::forget(pin);
            block_for(WAKE_UP);
        }
        // The pins only now: a transmit pin without a controller behind it could hold the bus low.
        let (mut receive, function) = parts.receive;
        // Pulled to recessive: a transceiver without supply would leave it to the noise.
        receive.set_as_af_unchecked(function, AfType::input(Pull::Up));
        let (mut transmit, function) = parts.transmit;
        let push_pull = AfType::output(OutputType::PushPull, Speed::VeryHigh);
        transmit.set_as_af_unchecked(function, push_pull);
        // Dropped, they would disconnect.
        core::mem::forget((receive, transmit));

        T::CONTROLLER.start();
        FdcanPort::new(T::CONTROLLER)
    }
}
