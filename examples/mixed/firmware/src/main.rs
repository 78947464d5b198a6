//! The mixed robot on the chip: eight motors on an RS-485 line, six more on two CAN buses. It arms
//! itself 100 ms after power-on: a program for a bench.
//!
//! Priorities, most urgent first: the interrupt of time (P0); the supervisor (P3); the buses, on an
//! executor of their own (P6); the line, on an executor of its own with the interrupts of its UART
//! (P7); everything else, in thread mode. The line waits for the buses, a few microseconds of each
//! tick, and for nothing else: each exchange of a motor waits for the one before.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_futures::join::join;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{IWDG1, USART1, USART2};
use embassy_stm32::{Peri, bind_interrupts, interrupt};
use embassy_time::Instant;
use mixed_robot::table::{BUSES, REPLY};
use mixed_robot::{Motors, Ports, Shared, task};
use rc10_bsp::can::{Bus, FdcanPort};
use rc10_bsp::serial::{self, Serial, SerialConfig};
use rc10_bsp::{dma_buffer, supervisor};
use rc10_firmware::board::Board;
use rc10_firmware::robot::{self, Unstartable, runner};
use rc10_motor::MotorBus;
use rc10_motor::embassy::{run_buses, run_rs485};
use rc10_motor::unitree::Rs485Bus;
use rc10_tasks::status;
use static_cell::{ConstStaticCell, StaticCell};

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    TIM7 => supervisor::Interrupt;
    USART1 => serial::Interrupt<USART1>;
    DMA1_STREAM0 => serial::Interrupt<USART1>;
    DMA1_STREAM1 => serial::Interrupt<USART1>;
    USART2 => serial::Interrupt<USART2>;
    DMA2_STREAM2 => serial::Interrupt<USART2>;
    DMA2_STREAM3 => serial::Interrupt<USART2>;
});

/// Of the line's executor and its UART, and of the line of text.
const LINE: Priority = Priority::P7;
/// What the motors speak: 8N1.
const BAUD: SerialConfig = SerialConfig::new(4_000_000);

// Large values are made where they stay: moved, they would go over the stack.
static PORTS: StaticCell<Ports> = StaticCell::new();
static SHARED: StaticCell<Shared<'static>> = StaticCell::new();
static MOTORS: ConstStaticCell<Motors> = ConstStaticCell::new(Motors::new());
static MOTOR_BUSES: [StaticCell<MotorBus<'static>>; BUSES] = [const { StaticCell::new() }; BUSES];
static MOTOR_LINE: StaticCell<Rs485Bus<'static>> = StaticCell::new();

/// Runs the buses. It borrows the interrupt of a peripheral that the board does not use.
static CONTROL: InterruptExecutor = InterruptExecutor::new();
/// Runs the line. The same.
static LINE_CONTROL: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
unsafe fn UART9() {
    // SAFETY: this is the interrupt that `CONTROL` is started with, and its only caller.
    unsafe { CONTROL.on_interrupt() }
}

#[interrupt]
unsafe fn UART8() {
    // SAFETY: this is the interrupt that `LINE_CONTROL` is started with, and its only caller.
    unsafe { LINE_CONTROL.on_interrupt() }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    if let Err(why) = start(spawner, robot::begin()) {
        why.tell();
    }
}

// Not inlined, so that its stack is free again when the tasks run.
#[inline(never)]
fn start(spawner: Spawner, board: Board) -> Result<(), Unstartable> {
    let shared = &*SHARED.init_with(|| Shared::new(PORTS.init_with(Ports::new)));
    robot::check_crystal(&shared.switch);
    let places = MOTOR_BUSES.each_ref();
    let mut motors = places.map(|place| place.init_with(|| MotorBus::new(&shared.switch)));
    let line = MOTOR_LINE.init(Rs485Bus::new(&shared.switch).with_reply_timeout(REPLY)?);
    MOTORS.take().attach(&mut motors.each_mut().map(|bus| &mut **bus), &mut [line])?;

    interrupt::UART9.set_priority(Priority::P6);
    let ports = [Bus::start(board.bus_1), Bus::start(board.bus_2)];
    let started = Instant::now();
    CONTROL.start(interrupt::UART9).spawn(buses(ports, motors, shared)?);
    supervisor::start(board.supervisor, Irqs, Priority::P3);

    let (ring, buffer) = (dma_buffer!(u8; 256), dma_buffer!(u8; 32));
    let uart = Serial::start(board.rs485, Irqs, &BAUD, ring, buffer, LINE)?;
    interrupt::UART8.set_priority(LINE);
    LINE_CONTROL.start(interrupt::UART8).spawn(poll(uart, line, shared)?);

    let (ring, buffer) = (dma_buffer!(u8; 64), dma_buffer!(u8; 256));
    let text = &SerialConfig::new(115_200);
    let text = Serial::start(board.text, Irqs, text, ring, buffer, LINE)?;
    spawner.spawn(follow(shared, board.watchdog)?);
    spawner.spawn(log(shared, text, started)?);
    Ok(())
}

#[embassy_executor::task]
fn buses(
    ports: [FdcanPort; BUSES],
    motors: [&'static mut MotorBus<'static>; BUSES],
    shared: &'static Shared<'static>,
) -> impl Future<Output = ()> {
    let ([a, b], [c, d], [e, f]) = (ports, motors, shared.ports.buses.each_ref());
    run_buses([runner(a, c, e), runner(b, d, f)])
}

#[embassy_executor::task]
fn poll(
    uart: Serial,
    motors: &'static mut Rs485Bus<'static>,
    shared: &'static Shared<'static>,
) -> impl Future<Output = ()> {
    run_rs485(uart, motors, &shared.ports.lines[0])
}

#[embassy_executor::task]
async fn follow(shared: &'static Shared<'static>, watchdog: Peri<'static, IWDG1>) {
    join(task::run(shared), robot::watch(watchdog, shared.ports)).await.0
}

#[embassy_executor::task]
async fn log(shared: &'static Shared<'static>, port: Serial, quiet: Instant) {
    join(status::run(shared, []), robot::log(shared, port, quiet)).await.0
}
