//! A robot with something at every kind of port, for `tests/firmware/parts.rs`.
#![no_std]
#![no_main]

#[macro_use]
#[path = "robot.rs"]
mod robot_of;

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_futures::join::join4;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{IWDG1, USART1};
use embassy_stm32::{Peri, bind_interrupts, interrupt};
use embassy_time::Instant;
use embedded_io_async::{Read, Write};
use rc10_board::board::{self, Board, Soldered, SwitchParts};
use rc10_board::robot::{self, Unstartable};
use rc10_board::{start_listener, start_pulses};
use rc10_bsp::can::Bus;
use rc10_bsp::pulse_input::PulseInput;
use rc10_bsp::serial::{self, Serial};
use rc10_bsp::servo::ServoOutput;
use rc10_bsp::supervisor;
use rc10_bsp::voltage::VoltageInput;
use rc10_motor::MotorBus;
use rc10_tasks::remote;
use static_cell::{ConstStaticCell, StaticCell};

#[cfg(feature = "h723zg")]
robot!(1, Line(1));
#[cfg(feature = "dm-mc02")]
robot!(2, Line(2));

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    TIM7 => supervisor::Interrupt;
    USART1 => serial::Interrupt<USART1>;
    DMA1_STREAM0 => serial::Interrupt<USART1>;
    DMA1_STREAM1 => serial::Interrupt<USART1>;
});

static PORTS: StaticCell<Ports> = StaticCell::new();
static SHARED: StaticCell<Shared<'static>> = StaticCell::new();
static MOTORS: ConstStaticCell<Motors> = ConstStaticCell::new(Motors::new());
static MOTOR_BUSES: [StaticCell<MotorBus<'static>>; BUSES] = [const { StaticCell::new() }; BUSES];

rc10_board::executor! {
    /// Runs the buses.
    CONTROL on UART9
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    if let Err(why) = start(spawner, robot::begin()) {
        why.tell();
    }
}

#[inline(never)]
fn start(spawner: Spawner, board: Board) -> Result<(), Unstartable> {
    let shared = &*SHARED.init_with(|| Shared::new(robot::ports(&PORTS)));
    robot::check_chip(&shared.switch);
    let mut motors = robot::buses(&MOTOR_BUSES, &shared.switch);
    #[cfg(feature = "h723zg")]
    let mut lines = rc10_board::motor_lines!(shared, REPLY);
    #[cfg(feature = "dm-mc02")]
    let mut lines = rc10_board::motor_lines!(shared, REPLY, REPLY);
    MOTORS.take().attach(
        &mut motors.each_mut().map(|bus| &mut **bus),
        &mut lines.each_mut().map(|line| &mut **line),
    )?;
    interrupt::UART9.set_priority(Priority::P6);
    let ports = [Bus::start(board.bus_1), Bus::start(board.bus_2)];
    let started = Instant::now();
    CONTROL.start(interrupt::UART9).spawn(robot::two_buses(ports, motors, &shared.ports.buses)?);
    supervisor::start(board.supervisor, Irqs, Priority::P3);
    #[cfg(feature = "h723zg")]
    rc10_board::start_lines!(shared, lines, board, rs485 at 4_000_000);
    #[cfg(feature = "dm-mc02")]
    rc10_board::start_lines!(shared, lines, board, rs485 at 4_000_000, rs485_2 at 4_000_000);

    #[cfg(feature = "h723zg")]
    start_listener!(shared, spawner, board, uart_3 at 9_600, echo);
    start_listener!(shared, spawner, board, uart_7 at 115_200, echo);
    start_listener!(shared, spawner, board, uart_10 at 921_600, echo);
    // The last of each.
    #[cfg(feature = "h723zg")]
    let voltage = VoltageInput::new(board.voltage_4, 11.0);
    #[cfg(feature = "dm-mc02")]
    let voltage = VoltageInput::new(board.voltage_1, 11.0);
    let servos = [board.servo_1.start(), board.servo_2.start()];
    let (third, fourth) = (board.servo_3.start(), board.servo_4.start());
    drop((third, fourth));
    let text = robot::console_port(board.text, Irqs, Priority::P7, 921_600)?;
    let pins = (board.switches, voltage, servos, start_pulses!(board));
    spawner.spawn(others(shared, board.watchdog, text, started, board.soldered, pins)?);
    Ok(())
}

type Pins = (SwitchParts, VoltageInput, [ServoOutput; 2], PulseInput);

#[embassy_executor::task]
async fn others(
    shared: &'static Shared<'static>,
    watchdog: Peri<'static, IWDG1>,
    text: Serial,
    quiet: Instant,
    soldered: Soldered,
    pins: Pins,
) {
    let (switches, mut voltage, servos, mut input) = pins;
    rc10_board::switches!(switches, a, b, c, d, e, f, g, h);
    drop((b, d, e, f, g));
    join4(
        work(shared, [a, c, h], async || voltage.read().await, servos),
        remote::listen_pulses(shared, async || input.rising_edge().await),
        robot::tend(shared, watchdog, text, quiet),
        board::serve(shared, soldered, &[]),
    )
    .await;
}

/// Bytes of a message, more than the port sends at once.
const MESSAGE: usize = 100;

/// Says a message, and whether it came back.
async fn echo(_: &Shared<'_>, port: Serial) {
    let (mut receiver, mut transmitter) = port.split();
    let message: [u8; MESSAGE] = core::array::from_fn(|index| index.to_le_bytes()[0]);
    let mut back = [0; MESSAGE];
    let _ = transmitter.write_all(&message).await;
    let is_read = receiver.read_exact(&mut back).await.is_ok();
    defmt::info!("{=usize} bytes, back: {=bool}", MESSAGE, is_read && back == message);
}
