//! I2C with timeouts and bus recovery, on embassy-stm32's driver.
//!
//! A device that lost a clock may hold the data line low for ever. Then the master clocks until it
//! lets go, nine times at most, and sends a STOP (UM10204, 3.1.16). [`I2cBus`] does that before a
//! transaction with a line low, after a failure without a NACK, and after a dropped future.
//!
//! An error of the bus (BERR) in a transaction may be false (ST's errata: STARTs and STOPs that
//! were not there). It is tried once more; a device may hear its first bytes twice.
//!
//! Bytes to send and received bytes go through SRAM1: the DMA reaches no stack.

use embassy_stm32::dma::InterruptHandler as DmaInterruptHandler;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Speed};
use embassy_stm32::i2c::mode::Master;
use embassy_stm32::i2c::{
    self, Config, ErrorInterruptHandler, EventInterruptHandler, I2c, Instance, RxDma, SclPin,
    SdaPin, TxDma,
};
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{Binding, Interrupt};
use embassy_stm32::mode::Async;
use embassy_stm32::peripherals::{I2C1, I2C2, I2C3, I2C5};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Peri, pac};
use embassy_time::{Duration, TimeoutError, Timer, with_timeout};
use embedded_hal_async::i2c::{ErrorKind, ErrorType, NoAcknowledgeSource, Operation};
use heapless::Vec;

use crate::dma::DmaBuffer;

/// Longest duration of a whole transaction: 255 bytes at 100 kHz take 23 ms.
const LIMIT: Duration = Duration::from_millis(30);
/// Half a clock at 100 kHz, which every device understands.
const HALF_CLOCK: Duration = Duration::from_micros(5);
/// A STOP takes two of them.
const STOP_HALF_CLOCKS: usize = 4;
const OPERATIONS: usize = 8;

/// I2C1, I2C2, I2C3, I2C5. (I2C4 is in reach of the BDMA only.)
pub trait I2cPeripheral: Instance {
    #[doc(hidden)]
    const REGISTERS: pac::i2c::I2c;
}

impl I2cPeripheral for I2C1 {
    const REGISTERS: pac::i2c::I2c = pac::I2C1;
}
impl I2cPeripheral for I2C2 {
    const REGISTERS: pac::i2c::I2c = pac::I2C2;
}
impl I2cPeripheral for I2C3 {
    const REGISTERS: pac::i2c::I2c = pac::I2C3;
}
impl I2cPeripheral for I2C5 {
    const REGISTERS: pac::i2c::I2c = pac::I2C5;
}

/// Why a transaction failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum I2cError {
    /// Not acknowledged: no such device, or it is busy. (Of a read that shows after 30 ms only.)
    #[error("no device acknowledged")]
    NoAcknowledge,
    /// The transaction took longer than 30 ms.
    #[error("the transaction took longer than 30 ms")]
    Timeout,
    /// A line is held low, and recovery did not help: a short circuit, or no pull-ups.
    #[error("a line is held low")]
    Held,
    /// More than eight operations, or more bytes than the buffer holds; nothing was sent.
    #[error("the transaction does not fit the buffer, or has too many operations")]
    TooLong,
    /// Another error of the bus: arbitration, a START or STOP at a wrong place.
    #[error("an error on the bus")]
    Bus,
}

impl embedded_hal_async::i2c::Error for I2cError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NoAcknowledge => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Unknown),
            Self::Held | Self::Bus => ErrorKind::Bus,
            Self::Timeout | Self::TooLong => ErrorKind::Other,
        }
    }
}

/// The result from the driver, if it came in time.
type Attempt = Result<Result<(), i2c::Error>, TimeoutError>;

/// A pin, and the alternate function that connects it to the peripheral.
struct Line {
    pin: Flex<'static>,
    function: u8,
}

impl Line {
    /// Takes it from the peripheral, and releases it.
    fn take(&mut self) {
        self.pin.set_high();
        self.pin.set_as_input_output(Speed::Medium);
    }

    fn give_back(&mut self) {
        let open_drain = AfType::output(OutputType::OpenDrain, Speed::Medium);
        self.pin.set_as_af_unchecked(self.function, open_drain);
    }
}

/// A master on an I2C bus with pull-ups: an [`embedded_hal_async::i2c::I2c`].
pub struct I2cBus {
    driver: I2c<'static, Async, Master>,
    registers: pac::i2c::I2c,
    clock: Line,
    data: Line,
    memory: &'static mut [u8],
    recoveries: u32,
    retries: u32,
    /// A transaction has begun and was not heard to end: it failed, or its future was dropped.
    is_open: bool,
}

impl I2cBus {
    /// Starts the master; `buffer` holds one transaction, `priority` is its interrupts'.
    #[expect(clippy::too_many_arguments, reason = "embassy's own, and two")]
    pub fn start<T, C, D, X, R, I, const N: usize>(
        peripheral: Peri<'static, T>,
        clock: Peri<'static, C>,
        data: Peri<'static, D>,
        transmit: Peri<'static, X>,
        receive: Peri<'static, R>,
        interrupts: I,
        frequency: Hertz,
        buffer: DmaBuffer<u8, N>,
        priority: Priority,
    ) -> Self
    where
        T: I2cPeripheral,
        C: SclPin<T>,
        D: SdaPin<T>,
        X: TxDma<T>,
        R: RxDma<T>,
        I: Binding<T::EventInterrupt, EventInterruptHandler<T>>
            + Binding<T::ErrorInterrupt, ErrorInterruptHandler<T>>
            + Binding<X::Interrupt, DmaInterruptHandler<X>>
            + Binding<R::Interrupt, DmaInterruptHandler<R>>
            + 'static,
    {
        T::EventInterrupt::set_priority(priority);
        T::ErrorInterrupt::set_priority(priority);
        X::Interrupt::set_priority(priority);
        R::Interrupt::set_priority(priority);
        let functions = [clock.af_num(), data.af_num()];
        // SAFETY: the driver below never drops its pins; they change hands only in `recover`.
        let lines =
            unsafe { [Flex::new(clock.clone_unchecked()), Flex::new(data.clone_unchecked())] };
        let mut config = Config::default();
        config.frequency = frequency;
        // Where the driver waits without letting others run; its own is a second.
        config.timeout = LIMIT;
        let driver = I2c::new(peripheral, clock, data, transmit, receive, interrupts, config);
        let [clock, data] = lines;
        Self {
            driver,
            registers: T::REGISTERS,
            clock: Line { pin: clock, function: functions[0] },
            data: Line { pin: data, function: functions[1] },
            memory: buffer.elements(),
            recoveries: 0,
            retries: 0,
            is_open: false,
        }
    }

    /// Number of times that the bus had to be recovered.
    #[must_use]
    pub const fn recoveries(&self) -> u32 {
        self.recoveries
    }

    /// Transactions tried a second time, after an error of the bus that was perhaps false.
    #[must_use]
    pub const fn retries(&self) -> u32 {
        self.retries
    }

    /// The transaction once, through SRAM1.
    async fn attempt(
        &mut self,
        address: u8,
        operations: &[Operation<'_>],
    ) -> Result<Attempt, I2cError> {
        let mut rest = &mut *self.memory;
        let mut pieces: Vec<Operation<'_>, OPERATIONS> = Vec::new();
        for operation in operations {
            let length = match operation {
                Operation::Read(bytes) => bytes.len(),
                Operation::Write(bytes) => bytes.len(),
            };
            let (piece, behind) = rest.split_at_mut_checked(length).ok_or(I2cError::TooLong)?;
            rest = behind;
            let piece = match operation {
                Operation::Read(_) => Operation::Read(piece),
                Operation::Write(bytes) => {
                    piece.copy_from_slice(bytes);
                    Operation::Write(piece)
                }
            };
            pieces.push(piece).map_err(|_| I2cError::TooLong)?;
        }
        self.is_open = true;
        self.registers.icr().write(|w| w.set_stopcf(true));
        Ok(with_timeout(LIMIT, self.driver.transaction(address, &mut pieces)).await)
    }

    fn is_at_rest(&self) -> bool {
        self.clock.pin.is_high() && self.data.pin.is_high()
    }

    /// Whether the bus is at rest, or comes to rest soon: the driver does not wait for its last STOP.
    async fn comes_to_rest(&self) -> bool {
        for _ in 0..STOP_HALF_CLOCKS {
            if self.is_at_rest() {
                return true;
            }
            Timer::after(HALF_CLOCK).await;
        }
        self.is_at_rest()
    }

    /// Clocks the data line free, sends a STOP, starts anew; whether the bus rests. Up to 0.2 ms.
    async fn recover(&mut self) -> bool {
        self.recoveries = self.recoveries.saturating_add(1);
        self.clock.take();
        self.data.take();
        for _ in 0..9 {
            if self.data.pin.is_high() {
                break;
            }
            self.clock.pin.set_low();
            Timer::after(HALF_CLOCK).await;
            self.clock.pin.set_high();
            Timer::after(HALF_CLOCK).await;
        }
        self.clock.pin.set_low();
        Timer::after(HALF_CLOCK).await;
        self.data.pin.set_low();
        Timer::after(HALF_CLOCK).await;
        self.clock.pin.set_high();
        Timer::after(HALF_CLOCK).await;
        self.data.pin.set_high();
        Timer::after(HALF_CLOCK).await;
        // Off for three clocks: the state machine forgets everything (RM0468, I2C, software reset).
        self.registers.cr1().modify(|w| w.set_pe(false));
        self.clock.give_back();
        self.data.give_back();
        self.registers.cr1().modify(|w| w.set_pe(true));
        self.is_open = false;
        self.is_at_rest()
    }
}

impl ErrorType for I2cBus {
    type Error = I2cError;
}

impl embedded_hal_async::i2c::I2c for I2cBus {
    async fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), I2cError> {
        // One that was dropped may leave a device in the middle of a byte, whatever the lines say.
        if (self.is_open || !self.comes_to_rest().await) && !self.recover().await {
            return Err(I2cError::Held);
        }
        let mut result = self.attempt(address, operations).await?;
        // The driver has started the block anew, so the lines are free, unless a device holds one.
        if matches!(result, Ok(Err(i2c::Error::Bus))) && self.comes_to_rest().await {
            self.retries = self.retries.saturating_add(1);
            result = self.attempt(address, operations).await?;
        }
        // A refused read the driver waits for in vain; a STOP has followed the refusal.
        let is_refused = match result {
            Ok(Err(i2c::Error::Nack)) => true,
            Ok(Err(i2c::Error::Timeout)) | Err(_) => self.registers.isr().read().stopf(),
            Ok(_) => false,
        };
        if is_refused {
            // The byte behind the refused one waits to be sent: to the next device.
            self.registers.isr().write(|w| w.set_txe(true));
            self.is_open = false;
            return Err(I2cError::NoAcknowledge);
        }
        let error = match result {
            Ok(Ok(())) => {
                self.is_open = false;
                let mut rest = &*self.memory;
                for operation in operations {
                    let length = match operation {
                        Operation::Read(bytes) => bytes.len(),
                        Operation::Write(bytes) => bytes.len(),
                    };
                    let (piece, behind) = rest.split_at_checked(length).unwrap_or_default();
                    rest = behind;
                    if let Operation::Read(bytes) = operation {
                        bytes.copy_from_slice(piece);
                    }
                }
                return Ok(());
            }
            Ok(Err(i2c::Error::Timeout)) | Err(_) => I2cError::Timeout,
            Ok(Err(_)) => I2cError::Bus,
        };
        if self.recover().await { Err(error) } else { Err(I2cError::Held) }
    }
}
