//! A serial port on USB (CDC-ACM, full speed), as one more byte link: no driver to install on a PC.
//!
//! On embassy-usb and embassy-stm32's driver of the OTG controller. The H723 has one, `USB_OTG_HS`,
//! here with its own transceiver of full speed at PA11 and PA12. Its 48 MHz come from HSI48, which
//! CRS keeps in step with the frames of the host (RM0468, CRS): with the feature `usb`,
//! [`clocks`](super::clocks) says so. It uses no DMA, so its memory may lie anywhere.
//!
//! **A robot does not wait for a PC**: what is sent while none listens is dropped and counted,
//! [`UsbTransmitter::lost`]. What a PC sends waits there until it is read.
//!
//! No test runs this module: `firmware/usb` tries it on a board, with `VDD33USB` supplied.

use core::convert::Infallible;
use core::ops::Range;

use embassy_stm32::Peri;
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{self, Binding, Interrupt as _};
use embassy_stm32::peripherals::USB_OTG_HS;
use embassy_stm32::usb::{DmPin, DpPin, Driver, InterruptHandler};
use embassy_time::{Duration, with_timeout};
use embassy_usb::Builder;
use embassy_usb::class::cdc_acm::{CdcAcmClass, Receiver, Sender, State};
use embedded_io_async::{ErrorType, Read, Write};

pub use embassy_usb::Config as UsbConfig;

/// Bytes of a packet of full speed.
const PACKET: u16 = 64;
/// Bytes sent in one: a packet that is not full ends a transfer.
const PIECE: usize = PACKET as usize - 1;
/// A PC that listens fetches a packet every millisecond or more often.
const PATIENCE: Duration = Duration::from_millis(50);

type Controller = Driver<'static, USB_OTG_HS>;

/// The interrupt handler, for `bind_interrupts!`: `OTG_HS => usb::Interrupt;`.
pub type Interrupt = InterruptHandler<USB_OTG_HS>;

/// Memory for the port's descriptors and state; to be put into a `StaticCell`.
pub struct UsbMemory {
    /// A packet for each of the endpoints out: control and data.
    received: [u8; 2 * PACKET as usize],
    configuration: [u8; 128],
    capabilities: [u8; 16],
    control: [u8; PACKET as usize],
    state: State<'static>,
}

impl UsbMemory {
    /// Empty.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "it is made once, for a static")]
    pub const fn new() -> Self {
        Self {
            received: [0; 2 * PACKET as usize],
            configuration: [0; 128],
            capabilities: [0; 16],
            control: [0; PACKET as usize],
            state: State::new(),
        }
    }
}

/// The device, as the PC sees it: it answers while [`run`](Self::run) runs.
pub struct UsbDevice(embassy_usb::UsbDevice<'static, Controller>);

impl UsbDevice {
    /// For ever, in a task of its own.
    pub async fn run(&mut self) -> ! {
        self.0.run().await
    }
}

/// Starts the port. `config` says who the device is; `priority` is that of its interrupt.
pub fn start(
    peripheral: Peri<'static, USB_OTG_HS>,
    plus: Peri<'static, impl DpPin<USB_OTG_HS>>,
    minus: Peri<'static, impl DmPin<USB_OTG_HS>>,
    interrupt: impl Binding<typelevel::OTG_HS, Interrupt> + 'static,
    config: UsbConfig<'static>,
    memory: &'static mut UsbMemory,
    priority: Priority,
) -> (UsbDevice, UsbReceiver, UsbTransmitter) {
    // Its clock is off until the device runs: so is its interrupt.
    typelevel::OTG_HS::set_priority(priority);
    let UsbMemory { received, configuration, capabilities, control, state } = memory;
    // On a board that has its own supply VBUS says nothing; it has no pin here anyway.
    let driver = Driver::new_fs(peripheral, interrupt, plus, minus, received, Default::default());
    let mut builder = Builder::new(driver, config, configuration, capabilities, &mut [], control);
    let class = CdcAcmClass::new(&mut builder, state, PACKET);
    let (sender, receiver) = class.split();
    let receiver = UsbReceiver { receiver, packet: [0; PACKET as usize], unread: 0..0 };
    let transmitter = UsbTransmitter { sender, lost: 0, is_deaf: false };
    (UsbDevice(builder.build()), receiver, transmitter)
}

/// The bytes from the PC: an [`embedded_io_async::Read`]. A dropped `read` has read nothing.
pub struct UsbReceiver {
    receiver: Receiver<'static, Controller>,
    packet: [u8; PACKET as usize],
    /// The part of the packet that was not read yet.
    unread: Range<usize>,
}

impl ErrorType for UsbReceiver {
    type Error = Infallible;
}

impl Read for UsbReceiver {
    /// Waits for a PC, and for what it sends.
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        if buffer.is_empty() {
            return Ok(0);
        }
        while self.unread.is_empty() {
            match self.receiver.read_packet(&mut self.packet).await {
                Ok(count) => self.unread = 0..count.min(self.packet.len()),
                // Unplugged, or not configured yet. (A packet is never longer than this one.)
                Err(_) => self.receiver.wait_connection().await,
            }
        }
        let count = self.unread.len().min(buffer.len());
        let bytes = self.packet.iter().skip(self.unread.start);
        buffer.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.unread.start += count;
        Ok(count)
    }
}

/// The bytes to the PC: an [`embedded_io_async::Write`] that waits 50 ms at most, once.
pub struct UsbTransmitter {
    sender: Sender<'static, Controller>,
    lost: u32,
    /// The last packet was not fetched.
    is_deaf: bool,
}

impl UsbTransmitter {
    /// Bytes dropped without a PC, modulo 2³², but for the last packet of 63 at most.
    #[must_use]
    pub const fn lost(&self) -> u32 {
        self.lost
    }

    /// Whether a program on the PC has the port open (DTR), and fetches.
    #[must_use]
    pub fn is_heard(&self) -> bool {
        self.sender.dtr() && !self.is_deaf
    }
}

impl ErrorType for UsbTransmitter {
    type Error = Infallible;
}

impl Write for UsbTransmitter {
    /// Takes up to 63 bytes, on their way or counted as lost. Dropped, it has taken nothing.
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let piece = &bytes[..bytes.len().min(PIECE)];
        let patience = if self.is_deaf { Duration::MIN } else { PATIENCE };
        let is_heard = self.sender.dtr()
            && match with_timeout(patience, self.sender.write_packet(piece)).await {
                Ok(sent) => {
                    self.is_deaf = false;
                    sent.is_ok()
                }
                Err(_) => {
                    self.is_deaf = true;
                    false
                }
            };
        if !is_heard {
            self.lost = self.lost.wrapping_add(u32::try_from(piece.len()).unwrap_or(u32::MAX));
        }
        Ok(piece.len())
    }

    /// There is nothing to wait for: see [`write`](Self::write).
    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
