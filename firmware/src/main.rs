//! The chip binary of the robot in `rc10-robot`: which pins, which interrupts, which executor runs
//! what. All else is in the library crates, where it also runs on a PC.
//!
//! Priorities, most urgent first: the interrupts of FDCAN and of time (P0); the buses, on an
//! executor of their own (P6); everything else, in thread mode. So no log line, no chassis maths
//! and no script can delay a motor.
#![no_std]
#![no_main]

mod board;
mod tasks;

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_stm32::bind_interrupts;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{FDCAN1, FDCAN2, FDCAN3};
use rc10_bsp::can::{Bus, Interrupt};
use rc10_bsp::crash;
use rc10_robot::Robot;
use static_cell::StaticCell;

use crate::board::Board;
use crate::tasks::Unstartable;

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    FDCAN1_IT0 => Interrupt<FDCAN1>;
    FDCAN2_IT0 => Interrupt<FDCAN2>;
    FDCAN3_IT0 => Interrupt<FDCAN3>;
});

static ROBOT: StaticCell<Robot> = StaticCell::new();

/// Runs the buses. It borrows the interrupt of a peripheral that the board does not use.
static CONTROL: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
unsafe fn UART9() {
    // SAFETY: this is the interrupt that `CONTROL` is started with, and its only caller.
    unsafe { CONTROL.on_interrupt() }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = Board::new(rc10_bsp::initialise());
    match crash::take_last() {
        Some(cause) => defmt::error!("the last run ended in a crash: {}", cause),
        None => defmt::info!("start"),
    }
    if let Err(why) = start(spawner, board) {
        // No crash: after a restart it would be the same, and a buffer that starts anew again and
        // again is hard to read. Nobody commands the buses that run already: they coast.
        defmt::error!("the robot does not start: {}", why);
    }
}

fn start(spawner: Spawner, board: Board) -> Result<(), Unstartable> {
    let robot = ROBOT.init(Robot::new()?);
    let (io, [first, second, third]) = robot.start()?;

    interrupt::UART9.set_priority(Priority::P6);
    let control = CONTROL.start(interrupt::UART9);
    let [port_1, port_2, port_3] = io.buses.each_ref();
    Bus::start(control, board.bus_1, Irqs, |can| tasks::bus(can, first, port_1))?;
    Bus::start(control, board.bus_2, Irqs, |can| tasks::bus(can, second, port_2))?;
    Bus::start(control, board.bus_3, Irqs, |can| tasks::bus(can, third, port_3))?;

    spawner.spawn(tasks::chassis(io)?);
    spawner.spawn(tasks::mechanisms(io)?);
    spawner.spawn(tasks::driver(io)?);
    spawner.spawn(tasks::status(io)?);
    spawner.spawn(tasks::log(io)?);
    spawner.spawn(tasks::watch(board.watchdog, io)?);
    Ok(())
}
