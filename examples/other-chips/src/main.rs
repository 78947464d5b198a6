//! Two M3508 on the first CAN bus of an STM32F407 or G473: armed one second after power-on, they turn
//! at 100 rpm. Give them room.
#![no_std]
#![no_main]

mod board;

use cortex_m_rt::exception;
use embassy_executor::Spawner;
use embassy_time::{Duration, Ticker};
use rc10_motor::Place::Bus;
use rc10_motor::dji::{Config, Dji, M3508};
use rc10_motor::embassy::{Ports, Runner, run_buses};
use rc10_motor::rc10_app::{Direction, Rpm};
use rc10_motor::{ArmSwitch, Entry, Names, Started, Target, motors};
use static_cell::StaticCell;

use board::{Board, Port};

motors! {
    /// Names of the wheels.
    pub enum Name;
    /// Where their motors stand.
    pub struct Motors;
    Left: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)).with_label("wheel left"),
    Right: Dji = Entry::new(Bus(1),
        Config::new(&M3508, 2).with_direction(Direction::Reversed),
    ).with_label("wheel right"),
}

static SWITCH: ArmSwitch = ArmSwitch::new();
static PORTS: Ports<Name, 1> = Ports::new();
static MOTORS: StaticCell<Motors> = StaticCell::new();

/// The bus, every millisecond: it comes before everything in `main`.
#[embassy_executor::task]
async fn run(bus: Runner<'static, 'static, Port>) {
    run_buses([bus]).await;
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let mut board = Board::start();
    let started = MOTORS.init(Motors::new()).start(&SWITCH);
    let Started { buses: [bus], .. } = started.expect("checked when it was compiled");
    let runner = Runner::new(board.port, bus, &PORTS.buses[0], board::now());
    board.high.spawn(run(runner).expect("spawned once"));

    board.watchdog.unleash();
    let mut bus_ticks = 0;
    let mut ticker = Ticker::every(Duration::from_millis(10));
    for tick in 0_u64.. {
        ticker.next().await;
        // Of the bus and this loop, either one that hangs restarts the chip.
        let now = PORTS.buses[0].ticks();
        if core::mem::replace(&mut bus_ticks, now) != now {
            board.watchdog.pet();
        }
        if tick == 100 && board.was_switched_on {
            // Refused if the motors do not fit on the bus: it stays disarmed then.
            let _ = SWITCH.arm();
        }
        for wheel in Name::ALL {
            // A motor that does not take speeds counts it in its status.
            let _ = PORTS.motor(*wheel).command(Target::Speed(Rpm::new(100.0)));
        }
    }
}

/// Starts over. Disarmed, the bus sends zeros from its first millisecond on.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    board::restart()
}

/// A fault: cortex-m-rt's own handler would stay here, and the ESCs would keep their last current.
// SAFETY: it uses no memory but the stack, and does not return.
#[exception(trampoline = false)]
unsafe fn HardFault() -> ! {
    board::restart()
}

/// An interrupt or exception without a handler.
// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(_number: i16) -> ! {
    board::restart()
}
