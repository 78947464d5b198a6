//! A board whose USB port is a robot's console, without its buses: all motors are there, and none is ever
//! heard. Not for a robot: a first look at a board and at its port, and how a robot has its console there.
//!
//! `cargo run --release --package usb` flashes it, `rc10 live /dev/ttyACM0` looks at it. It is compiled in
//! every check, and has not run: neither a board nor an emulated USB was at hand.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_futures::join::join;
use embassy_stm32::bind_interrupts;
use embassy_stm32::interrupt::Priority;
use embassy_time::Instant;
use rc10_board::board::Board;
use rc10_board::robot;
use rc10_bsp::usb::{self, UsbConfig, UsbDevice, UsbMemory};
use rc10_tasks::status;
use static_cell::StaticCell;
use team::{Ports, Shared};

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    OTG_HS => usb::Interrupt;
});

static PORTS: StaticCell<Ports> = StaticCell::new();
static SHARED: StaticCell<Shared<'static>> = StaticCell::new();
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
    let board = Board::new(rc10_bsp::initialise(rc10_board::board::CRYSTAL));
    let memory = MEMORY.init(UsbMemory::new());
    let parts = board.usb;
    let (task, receiver, transmitter) = usb::start(
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
    let shared = SHARED.init_with(|| Shared::new(robot::ports(&PORTS)));
    let kept = robot::kept(&shared.switch, &[]);
    let console = robot::console(shared, (receiver, transmitter), Instant::now(), kept);
    join(status::run(shared), console).await.0
}
