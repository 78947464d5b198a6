//! A board that is a serial port on USB: it sends back what it hears, and once a second says how much
//! of what it has sent unheard. Not for a robot: a first look at a board, and at the port.
//!
//! `cargo run --release --package usb` flashes it. On Linux the port is `/dev/ttyACM0`.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_futures::select::{Either, select};
use embassy_stm32::bind_interrupts;
use embassy_stm32::interrupt::Priority;
use embassy_time::{Duration, Ticker};
use embedded_io_async::{Read, Write};
use rc10_bsp::usb::{self, UsbConfig, UsbDevice, UsbMemory};
use rc10_firmware::board::Board;
use static_cell::StaticCell;

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    OTG_HS => usb::Interrupt;
});

static MEMORY: StaticCell<UsbMemory> = StaticCell::new();

/// Vendor and product of <https://pid.codes/1209/0001/>: for tests, not to be given to others.
fn identity() -> UsbConfig<'static> {
    let mut config = UsbConfig::new(0x1209, 0x0001);
    config.manufacturer = Some("RC10");
    config.product = Some("RC10 board");
    config
}

#[embassy_executor::task]
async fn device(mut device: UsbDevice) -> ! {
    device.run().await
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = Board::new(rc10_bsp::initialise());
    let memory = MEMORY.init(UsbMemory::new());
    let parts = board.usb;
    let (task, mut receiver, mut transmitter) = usb::start(
        parts.peripheral,
        parts.plus,
        parts.minus,
        Irqs,
        identity(),
        memory,
        Priority::P7,
    );
    match device(task) {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::panic!("there is room for one task"),
    }
    let mut ticker = Ticker::every(Duration::from_secs(1));
    let mut buffer = [0; 64];
    loop {
        match select(receiver.read(&mut buffer), ticker.next()).await {
            Either::First(Ok(count)) => {
                let Ok(()) = transmitter.write_all(&buffer[..count]).await;
            }
            Either::Second(()) => {
                defmt::info!("heard {}, {} bytes lost", transmitter.is_heard(), transmitter.lost());
            }
        }
    }
}
