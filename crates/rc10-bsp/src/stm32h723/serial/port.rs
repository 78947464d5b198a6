use core::future::poll_fn;
use core::mem::ManuallyDrop;
use core::sync::atomic::{Ordering, fence};
use core::task::Poll;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::Binding;
use embassy_stm32::usart::{DePin, RxDma, RxPin, TxDma, TxPin};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};

use super::config::{BaudError, SerialConfig};
use super::ring::{Next, SerialCounters, SerialError};
use super::uart::{Direction, Interrupt, SerialPeripheral, Uart};
use crate::dma::{DmaBuffer, DmaMemory, DmaStream, Stream, Transfer, enable};

/// A pin, and the alternate function that connects it.
type Pin = (Flex<'static>, u8);

/// The parts of a receiver: a UART, its receive pin, and the DMA stream `D`.
pub struct ReceiverParts<T: SerialPeripheral, D: DmaStream> {
    /// Holding it is what makes this the only port of the UART.
    _peripheral: Peri<'static, T>,
    pin: Pin,
    _stream: Peri<'static, D>,
    request: u8,
}

/// The parts of a port that receives and sends: the stream `D` in, the stream `E` out.
pub struct SerialParts<T: SerialPeripheral, D: DmaStream, E: DmaStream> {
    receiver: ReceiverParts<T, D>,
    pin: Pin,
    /// Never disconnected: see [`with_driver_enable`](SerialParts::with_driver_enable).
    driver_enable: Option<ManuallyDrop<Pin>>,
    _stream: Peri<'static, E>,
    request: u8,
}

impl<T: SerialPeripheral, D: DmaStream + RxDma<T>> ReceiverParts<T, D> {
    /// Pin and stream are checked against the UART at compile time.
    pub fn new<R: RxPin<T>>(
        peripheral: Peri<'static, T>,
        receive: Peri<'static, R>,
        stream: Peri<'static, D>,
    ) -> Self {
        let function = receive.af_num();
        let request = stream.request();
        Self {
            _peripheral: peripheral,
            pin: (Flex::new(receive), function),
            _stream: stream,
            request,
        }
    }
}

impl<T: SerialPeripheral, D: DmaStream + RxDma<T>, E: DmaStream + TxDma<T>> SerialParts<T, D, E> {
    /// Pins and streams are checked against the UART at compile time.
    pub fn new<R: RxPin<T>, X: TxPin<T>>(
        peripheral: Peri<'static, T>,
        receive: Peri<'static, R>,
        transmit: Peri<'static, X>,
        receive_stream: Peri<'static, D>,
        transmit_stream: Peri<'static, E>,
    ) -> Self {
        let function = transmit.af_num();
        let request = transmit_stream.request();
        Self {
            receiver: ReceiverParts::new(peripheral, receive, receive_stream),
            pin: (Flex::new(transmit), function),
            driver_enable: None,
            _stream: transmit_stream,
            request,
        }
    }

    /// An RS-485 driver's enable pin, high while the UART sends, by the peripheral itself. Until
    /// the port is started it is pulled down: the transceiver listens.
    #[must_use]
    pub fn with_driver_enable<P: DePin<T>>(mut self, pin: Peri<'static, P>) -> Self {
        let function = pin.af_num();
        let mut pin = Flex::new(pin);
        pin.set_as_input(Pull::Down);
        self.driver_enable = Some(ManuallyDrop::new((pin, function)));
        self
    }
}

/// Connects a pin for good.
fn connect((mut pin, function): Pin, kind: AfType) {
    pin.set_as_af_unchecked(function, kind);
    // Dropped, it would disconnect.
    core::mem::forget(pin);
}

/// The receiving half of a UART: an [`embedded_io_async::Read`].
///
/// `read` returns bytes when the line pauses for a byte, or at half the ring; a dropped one has
/// read nothing. Each error is told once, in its place, and costs its byte only: the DMA never
/// stops. (Of several between two reads the first is told, and what lies between is dropped.) An
/// untold error stops the interrupts: a reader that pauses then bounds their cost. What is lost by
/// slow reading is [`SerialError::TooSlow`].
pub struct SerialReceiver {
    uart: Uart,
    stream: Stream,
    request: u8,
    memory: DmaMemory<u8>,
}

/// The sending half of a UART: an [`embedded_io_async::Write`].
///
/// `write` returns when its buffer took the bytes, after those before have left; `flush` when the
/// last stop bit has. A dropped `write` has taken nothing, or all that it would have said.
pub struct SerialTransmitter {
    uart: Uart,
    stream: Stream,
    request: u8,
    memory: DmaMemory<u8>,
}

/// A UART: [`Read`] and [`Write`].
pub struct Serial {
    receiver: SerialReceiver,
    transmitter: SerialTransmitter,
}

impl SerialReceiver {
    /// Starts a UART that only receives. The ring, a power of two, is to hold what comes between
    /// two reads, twice over: interrupts later than half of it lose bytes.
    ///
    /// UART and stream interrupts are bound to its [`Interrupt`], of this `priority`.
    pub fn start<T: SerialPeripheral, D: DmaStream, const N: usize>(
        parts: ReceiverParts<T, D>,
        _interrupts: impl Binding<T::Interrupt, Interrupt<T>> + Binding<D::Interrupt, Interrupt<T>>,
        config: &SerialConfig,
        ring: DmaBuffer<u8, N>,
        priority: Priority,
    ) -> Result<Self, BaudError> {
        Self::start_with(parts, config, Direction::default(), ring, priority)
    }

    fn start_with<T: SerialPeripheral, D: DmaStream, const N: usize>(
        parts: ReceiverParts<T, D>,
        config: &SerialConfig,
        direction: Direction,
        ring: DmaBuffer<u8, N>,
        priority: Priority,
    ) -> Result<Self, BaudError> {
        // First, so that the UART sees a line at rest. An open pin reads as one, too.
        let rest = if config.invert_receive { Pull::Down } else { Pull::Up };
        connect(parts.pin, AfType::input(rest));
        T::UART.start::<T>(config, direction)?;
        let receiver = Self::listen(T::UART, D::STREAM, parts.request, ring);
        enable::<T::Interrupt>(priority);
        enable::<D::Interrupt>(priority);
        Ok(receiver)
    }

    fn listen<const N: usize>(
        uart: Uart,
        stream: Stream,
        request: u8,
        ring: DmaBuffer<u8, N>,
    ) -> Self {
        const { assert!(N.is_power_of_two() && N >= 16, "a ring of 16, 32, 64 .. bytes") };
        let receiver = Self { uart, stream, request, memory: ring.memory() };
        uart.shared.line.lock(|line| {
            let line = &mut *line.borrow_mut();
            line.ring.set_length(u32::try_from(N).unwrap_or(u32::MAX));
            line.receive = Some(stream);
            receiver.fill();
        });
        receiver
    }

    /// Lets the DMA begin at the front of the ring.
    fn fill(&self) {
        let transfer = Transfer {
            request: self.request,
            peripheral: self.uart.receive_register(),
            to_peripheral: false,
            circular: true,
            is_serial: true,
        };
        self.stream.start(&transfer, &self.memory, self.memory.length());
    }

    /// Counters of lost or damaged bytes so far, in both directions.
    pub fn counters(&self) -> SerialCounters {
        self.uart.shared.line.lock(|line| line.borrow().ring.counters)
    }

    /// Reads the bytes that are there, copied again if the DMA overtook that.
    fn try_read(&mut self, buffer: &mut [u8]) -> Option<Result<usize, SerialError>> {
        let room = u32::try_from(buffer.len()).unwrap_or(u32::MAX);
        let shared = self.uart.shared;
        loop {
            let next = shared.line.lock(|line| {
                let line = &mut *line.borrow_mut();
                if !self.stream.is_running() {
                    line.ring.restart();
                    self.fill();
                }
                match line.ring.next(room) {
                    Next::Nothing if self.uart.go_on(line) => line.ring.next(room),
                    next => next,
                }
            });
            let (from, count) = match next {
                Next::Nothing => return None,
                Next::Error(error) => return Some(Err(error)),
                Next::Bytes { from, count } => (from, count),
            };
            // Bytes are looked at after the accounts that say they are there, and before those that
            // say they still are: nothing else keeps the processor from taking them in another order.
            fence(Ordering::SeqCst);
            // The ring's length is a power of two and divides the number of positions.
            let last = self.memory.length() - 1;
            for (position, byte) in (0..count).zip(buffer.iter_mut()) {
                *byte = self.memory.read(from.wrapping_add(position) as usize & last);
            }
            fence(Ordering::SeqCst);
            let is_whole = shared.line.lock(|line| {
                let line = &mut *line.borrow_mut();
                line.look();
                // How far a stream came that has stopped meanwhile is not known.
                self.stream.is_running() && line.ring.take(from, count)
            });
            if is_whole {
                return Some(Ok(count as usize));
            }
        }
    }
}

impl SerialTransmitter {
    fn broken(&self) -> Option<SerialError> {
        self.uart.shared.line.lock(|line| {
            let line = &mut *line.borrow_mut();
            core::mem::take(&mut line.is_transmit_broken).then(|| {
                line.ring.counters.dma = line.ring.counters.dma.wrapping_add(1);
                SerialError::Dma
            })
        })
    }

    /// Waits until nothing is left of what `write` took, in the buffer or on the wire.
    async fn sent(&mut self, is_over: impl Fn(&Self) -> bool) -> Result<(), SerialError> {
        let outcome = || match self.broken() {
            Some(error) => Some(Err(error)),
            None => is_over(self).then_some(Ok(())),
        };
        poll_fn(|context| {
            // A task that does not wait is not woken for it.
            if let Some(outcome) = outcome() {
                return Poll::Ready(outcome);
            }
            self.uart.shared.writer.register(context.waker());
            outcome().map_or(Poll::Pending, Poll::Ready)
        })
        .await
    }
}

impl Serial {
    /// Starts a UART like [`SerialReceiver::start`]; `buffer` holds what is sent at once.
    pub fn start<T, D, E, const N: usize, const M: usize>(
        parts: SerialParts<T, D, E>,
        _interrupts: impl Binding<T::Interrupt, Interrupt<T>>
        + Binding<D::Interrupt, Interrupt<T>>
        + Binding<E::Interrupt, Interrupt<T>>,
        config: &SerialConfig,
        ring: DmaBuffer<u8, N>,
        buffer: DmaBuffer<u8, M>,
        priority: Priority,
    ) -> Result<Self, BaudError>
    where
        T: SerialPeripheral,
        D: DmaStream,
        E: DmaStream,
    {
        let direction = Direction { transmits: true, drives_enable: parts.driver_enable.is_some() };
        let receiver =
            SerialReceiver::start_with(parts.receiver, config, direction, ring, priority)?;
        T::UART.shared.line.lock(|line| line.borrow_mut().transmit = Some(E::STREAM));
        enable::<E::Interrupt>(priority);
        // Only now: without a UART behind them the pins could hold line or transceiver.
        let push_pull = AfType::output(OutputType::PushPull, Speed::High);
        connect(parts.pin, push_pull);
        if let Some(pin) = parts.driver_enable.map(ManuallyDrop::into_inner) {
            connect(pin, push_pull);
        }
        let transmitter = SerialTransmitter {
            uart: T::UART,
            stream: E::STREAM,
            request: parts.request,
            memory: buffer.memory(),
        };
        Ok(Self { receiver, transmitter })
    }

    /// The two halves, for two tasks.
    #[must_use]
    pub fn split(self) -> (SerialReceiver, SerialTransmitter) {
        (self.receiver, self.transmitter)
    }

    /// Counters of lost or damaged bytes so far, in both directions.
    pub fn counters(&self) -> SerialCounters {
        self.receiver.counters()
    }
}

impl embedded_io_async::Error for SerialError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::Overrun | Self::TooSlow | Self::Dma => ErrorKind::Other,
            Self::Framing | Self::Parity | Self::Noise | Self::Break => ErrorKind::InvalidData,
        }
    }
}

impl ErrorType for SerialReceiver {
    type Error = SerialError;
}
impl ErrorType for SerialTransmitter {
    type Error = SerialError;
}
impl ErrorType for Serial {
    type Error = SerialError;
}

impl Read for SerialReceiver {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, SerialError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        poll_fn(|context| {
            self.uart.shared.reader.register(context.waker());
            self.try_read(buffer).map_or(Poll::Pending, Poll::Ready)
        })
        .await
    }
}

impl Write for SerialTransmitter {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, SerialError> {
        if bytes.is_empty() {
            return Ok(0);
        }
        self.sent(|this| !this.stream.is_running()).await?;
        let count = self.memory.copy(bytes);
        let transfer = Transfer {
            request: self.request,
            peripheral: self.uart.transmit_register(),
            to_peripheral: true,
            circular: false,
            is_serial: true,
        };
        self.uart.forget_sent();
        self.stream.start(&transfer, &self.memory, count);
        Ok(count)
    }

    async fn flush(&mut self) -> Result<(), SerialError> {
        self.sent(|this| {
            if this.stream.is_running() {
                return false;
            }
            this.uart.shared.line.lock(|_| {
                let sent = this.uart.has_sent();
                if !sent {
                    this.uart.tell_when_sent();
                }
                sent
            })
        })
        .await
    }
}

impl Read for Serial {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, SerialError> {
        self.receiver.read(buffer).await
    }
}

impl Write for Serial {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, SerialError> {
        self.transmitter.write(bytes).await
    }

    async fn flush(&mut self) -> Result<(), SerialError> {
        self.transmitter.flush().await
    }
}
