//! The omni robot on the chip.
//!
//! Priorities, most urgent first: the interrupt of time (P0); the supervisor (P3); the buses, on an
//! executor of their own (P6); the interrupts of UARTs (P7); everything else, in thread mode.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_futures::join::join3;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{IWDG1, UART5, USART1};
use embassy_stm32::{Peri, bind_interrupts, interrupt};
use embassy_time::Instant;
use omni_robot::table::{BUSES, RECEIVER};
use omni_robot::{Motors, Ports, Shared, task};
use rc10_bsp::can::Bus;
use rc10_bsp::serial::{self, Serial, SerialReceiver};
use rc10_bsp::supervisor;
use rc10_firmware::board::Board;
use rc10_firmware::robot::{self, Unstartable};
use rc10_motor::MotorBus;
use rc10_tasks::remote;
use static_cell::{ConstStaticCell, StaticCell};

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    TIM7 => supervisor::Interrupt;
    USART1 => serial::Interrupt<USART1>;
    DMA1_STREAM0 => serial::Interrupt<USART1>;
    DMA1_STREAM1 => serial::Interrupt<USART1>;
    UART5 => serial::Interrupt<UART5>;
    DMA1_STREAM2 => serial::Interrupt<UART5>;
});

// Large values are made where they stay: moved, they would go over the stack.
static PORTS: StaticCell<Ports> = StaticCell::new();
static SHARED: StaticCell<Shared<'static>> = StaticCell::new();
static MOTORS: ConstStaticCell<Motors> = ConstStaticCell::new(Motors::new());
static MOTOR_BUSES: [StaticCell<MotorBus<'static>>; BUSES] = [const { StaticCell::new() }; BUSES];

rc10_firmware::executor! {
    /// Runs the buses.
    CONTROL on UART9
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
    let shared = &*SHARED.init_with(|| Shared::new(robot::ports(&PORTS)));
    robot::check_crystal(&shared.switch);
    let mut motors = robot::buses(&MOTOR_BUSES, &shared.switch);
    MOTORS.take().attach(&mut motors.each_mut().map(|bus| &mut **bus), &mut [])?;

    interrupt::UART9.set_priority(Priority::P6);
    let ports = [Bus::start(board.bus_1), Bus::start(board.bus_2), Bus::start(board.bus_3)];
    let started = Instant::now();
    CONTROL.start(interrupt::UART9).spawn(robot::three_buses(ports, motors, &shared.ports.buses)?);
    supervisor::start(board.supervisor, Irqs, Priority::P3);

    let text = robot::console_port(board.text, Irqs, Priority::P7, 921_600)?;
    let remote = robot::remote(board.remote, Irqs, RECEIVER, Priority::P7)?;
    spawner.spawn(others(shared, board.watchdog, text, started, remote)?);
    Ok(())
}

#[embassy_executor::task]
async fn others(
    shared: &'static Shared<'static>,
    watchdog: Peri<'static, IWDG1>,
    text: Serial,
    quiet: Instant,
    receiver: SerialReceiver,
) {
    let tend = robot::tend(shared, &(), watchdog, text, quiet);
    join3(task::run(shared), remote::listen(shared, RECEIVER, receiver), tend).await;
}
