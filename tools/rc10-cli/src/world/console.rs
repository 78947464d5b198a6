//! A simulated line to a PC: the robot's console in a world of virtual time.

use std::collections::VecDeque;

use embedded_io_async::{ErrorType, Read, Write};
use rc10_sim::{Nanos, Serial, SerialConfig, SerialDevice, UartFault, UartPort, World};

/// The console of the board: USART1.
pub const CONSOLE: u8 = 1;

#[derive(Default)]
struct Pc {
    heard: Vec<u8>,
    to_send: VecDeque<u8>,
}

impl SerialDevice for Pc {
    fn power_on(&mut self, _: Nanos) {}

    fn next_event(&self) -> Option<Nanos> {
        (!self.to_send.is_empty()).then_some(Nanos::ZERO)
    }

    fn advance(&mut self, _: Nanos, send: &mut VecDeque<u8>) {
        send.append(&mut self.to_send);
    }

    fn receive(&mut self, byte: u8, _: Nanos) {
        self.heard.push(byte);
    }
}

/// The PC's end of a console.
#[derive(Clone)]
pub struct ConsoleLine(Serial);

impl ConsoleLine {
    /// Creates a line with this bit rate.
    #[must_use]
    pub fn new(world: &mut World, baud: u32) -> Self {
        let config = SerialConfig { baud, receive_capacity: 4096, ..SerialConfig::default() };
        Self(world.add_serial(config, Pc::default()))
    }

    /// The wire of the line.
    pub const fn serial(&self) -> &Serial {
        &self.0
    }

    /// The robot's port, which waits like a chip's until its bytes have left.
    pub fn port(&self) -> ConsolePort {
        ConsolePort(self.0.port())
    }

    /// Sends bytes to the robot.
    pub fn send(&self, bytes: &[u8]) {
        self.0.with(|pc: &mut Pc| pc.to_send.extend(bytes));
    }

    /// The bytes that the robot sent since the last call.
    #[must_use]
    pub fn take(&self) -> Vec<u8> {
        self.0.with(|pc: &mut Pc| std::mem::take(&mut pc.heard)).unwrap_or_default()
    }
}

/// The robot's end of a [`ConsoleLine`].
#[derive(Clone)]
pub struct ConsolePort(UartPort);

impl ErrorType for ConsolePort {
    type Error = UartFault;
}

impl Read for ConsolePort {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, UartFault> {
        self.0.read(buffer).await
    }
}

impl Write for ConsolePort {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, UartFault> {
        let count = self.0.write(bytes).await?;
        self.0.flush().await?;
        Ok(count)
    }

    async fn flush(&mut self) -> Result<(), UartFault> {
        self.0.flush().await
    }
}

/// Default bit rate of a console, in bit/s: every USB adapter has it.
pub const BAUD: u32 = 921_600;
