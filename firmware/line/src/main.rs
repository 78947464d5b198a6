//! The robot of `rc10_robot::mixed` on the chip: eight motors on an RS-485 line, six more on two CAN
//! buses. It arms itself 100 ms after power-on: a program for a bench.
//!
//! Priorities, most urgent first: the interrupt of time (P0); the supervisor (P3); the buses, on an
//! executor of their own (P6); the line, on an executor of its own with the interrupts of its UART
//! (P7); everything else, in thread mode. The line waits for the buses, a few microseconds of each
//! tick, and for nothing else: each exchange of a motor waits for the one before.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, SpawnError, Spawner};
use embassy_stm32::Peri;
use embassy_stm32::bind_interrupts;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{IWDG1, USART2};
use embassy_time::{Duration, Ticker, Timer};
use rc10_bsp::can::{Bus, FdcanPort};
use rc10_bsp::serial::{self, BaudError, Serial, SerialConfig};
use rc10_bsp::watchdog::Watchdog;
use rc10_bsp::{CORE_CLOCK, crash, cycle_count, dma_buffer, supervisor};
use rc10_firmware::board::Board;
use rc10_message::Cycles;
use rc10_motor::embassy::{BusPort, Runner, run_buses, run_rs485};
use rc10_motor::unitree::Rs485Bus;
use rc10_motor::{Link, MotorBus, MotorId, TxBatch, Unfit};
use rc10_robot::mixed::{self, BUSES, LEGS, Motors, SetupError, Shared};
use rc10_tasks::TickWatch;
use static_cell::StaticCell;

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    TIM7 => supervisor::Interrupt;
    USART2 => serial::Interrupt<USART2>;
    DMA2_STREAM2 => serial::Interrupt<USART2>;
    DMA2_STREAM3 => serial::Interrupt<USART2>;
});

/// Of the line's executor and its UART.
const LINE: Priority = Priority::P7;
/// What the motors speak: 8N1.
const BAUD: SerialConfig = SerialConfig::new(4_000_000);
/// Of a watchdog that is fed every 10 ms.
const WATCHDOG: Duration = Duration::from_millis(80);

// Large values are made where they stay: moved, they would go over the stack.
static SHARED: Shared = Shared::new();
static MOTORS: StaticCell<Motors> = StaticCell::new();
static MOTOR_BUSES: [StaticCell<MotorBus<'static>>; BUSES] = [const { StaticCell::new() }; BUSES];
static MOTOR_LINE: StaticCell<Rs485Bus<'static>> = StaticCell::new();

/// Runs the buses. It borrows the interrupt of a peripheral that the board does not use.
static CONTROL: InterruptExecutor = InterruptExecutor::new();
/// Runs the line. The same.
static LINE_CONTROL: InterruptExecutor = InterruptExecutor::new();
/// Cycles of each wake of the line.
static WAKES: Cycles = Cycles::new(CORE_CLOCK.0);

#[interrupt]
unsafe fn UART9() {
    // SAFETY: this is the interrupt that `CONTROL` is started with, and its only caller.
    unsafe { CONTROL.on_interrupt() }
}

#[interrupt]
unsafe fn UART8() {
    // SAFETY: this is the interrupt that `LINE_CONTROL` is started with, and its only caller.
    WAKES.measure(cycle_count, || unsafe { LINE_CONTROL.on_interrupt() });
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = Board::new(rc10_bsp::initialise());
    match crash::take_last() {
        Some(cause) => defmt::error!("the last run ended in a crash: {}", cause),
        None => defmt::info!("start"),
    }
    if let Err(why) = start(spawner, board) {
        defmt::error!("the robot does not start: {}", why);
    }
}

// Not inlined, so that its stack is free again when the tasks run.
#[inline(never)]
fn start(spawner: Spawner, board: Board) -> Result<(), Unstartable> {
    if !rc10_bsp::has_crystal() {
        defmt::error!("the crystal does not start: the robot cannot be armed");
        SHARED.switch.forbid(Unfit::Clock);
    }
    let buses = MOTOR_BUSES.each_ref();
    let mut buses = buses.map(|place| place.init_with(|| MotorBus::new(&SHARED.switch)));
    let line = MOTOR_LINE.init(mixed::line(&SHARED.switch).map_err(SetupError::from)?);
    let motors = MOTORS.init(Motors::new()?);
    motors.attach(buses.each_mut().map(|bus| &mut **bus), line)?;

    interrupt::UART9.set_priority(Priority::P6);
    let control = CONTROL.start(interrupt::UART9);
    let ports = [Bus::start(board.bus_1), Bus::start(board.bus_2)];
    control.spawn(run(ports, buses)?);
    supervisor::start(board.supervisor, Irqs, Priority::P3);

    let (ring, buffer) = (dma_buffer!(u8; 256), dma_buffer!(u8; 32));
    let uart = Serial::start(board.rs485, Irqs, &BAUD, ring, buffer, LINE)?;
    interrupt::UART8.set_priority(LINE);
    LINE_CONTROL.start(interrupt::UART8).spawn(poll(uart, line)?);

    spawner.spawn(robot(board.watchdog)?);
    spawner.spawn(log()?);
    Ok(())
}

/// The buses. Their frames of no torque are stored before the first tick.
#[embassy_executor::task]
fn run(
    ports: [FdcanPort; BUSES],
    motors: [&'static mut MotorBus<'static>; BUSES],
) -> impl Future<Output = ()> {
    let ([a, b], [c, d], [e, f]) = (ports, motors, SHARED.buses.each_ref());
    run_buses([runner(a, c, e), runner(b, d, f)])
}

fn runner(
    mut can: FdcanPort,
    motors: &'static mut MotorBus<'static>,
    shared: &'static BusPort,
) -> Runner<'static, 'static, FdcanPort, &'static mut MotorBus<'static>> {
    let mut coast = TxBatch::new();
    if motors.coast_image(&mut coast).is_err() || can.keep_coast_image(coast.frames()).is_err() {
        panic!("a bus has more motors than its coast image holds");
    }
    Runner::new(can, motors, shared, rc10_message::now())
}

/// The line.
#[embassy_executor::task]
fn poll(uart: Serial, motors: &'static mut Rs485Bus<'static>) -> impl Future<Output = ()> {
    run_rs485(uart, motors, &SHARED.line)
}

/// Targets of all motors, and the watchdog's feeding.
#[embassy_executor::task]
async fn robot(watchdog: Peri<'static, IWDG1>) {
    embassy_futures::join::join(mixed::run(&SHARED), feed(watchdog)).await.0
}

/// While every bus ticks, and the line.
async fn feed(watchdog: Peri<'static, IWDG1>) -> ! {
    let mut watchdog = Watchdog::start(watchdog, WATCHDOG);
    let mut ticker = Ticker::every(Duration::from_millis(10));
    let buses = SHARED.buses.each_ref();
    let (mut watch, mut line) = (TickWatch::new(buses), SHARED.line.status().ticks);
    loop {
        ticker.next().await;
        let before = core::mem::replace(&mut line, SHARED.line.status().ticks);
        watchdog.feed_if(|| watch.have_all_ticked(buses) && line != before);
    }
}

/// The state of the line, ten times a second.
#[embassy_executor::task]
async fn log() {
    loop {
        Timer::after_millis(100).await;
        let status = SHARED.line.status();
        let traffic = status.traffic;
        let is_online = |leg: &usize| {
            let leg = MotorId::new(u8::try_from(*leg).unwrap_or(u8::MAX));
            SHARED.line.motor(leg).status().link == Link::Online
        };
        let online = (0..LEGS).filter(is_online).fold(0_u8, |legs, leg| legs | 1 << leg);
        let wakes = WAKES.read();
        defmt::info!(
            "line: {=u8:08b} online, {} exchanges, {} timeouts, {} CRC errors, {} port errors, \
             {} ticks missed, cycle {}..{} us, exchange {}..{} us, wakes take {} cycles, \
             at most {}",
            online,
            traffic.exchanges,
            traffic.timeouts,
            traffic.crc_errors,
            status.port_errors,
            status.overruns,
            traffic.cycle.min().unwrap_or(0),
            traffic.cycle.max().unwrap_or(0),
            traffic.exchange.min().unwrap_or(0),
            traffic.exchange.max().unwrap_or(0),
            wakes.map_or(0, |wakes| wakes.mean),
            wakes.map_or(0, |wakes| wakes.most),
        );
    }
}

/// Reasons why the robot cannot start: mistakes in the program, not on the board.
enum Unstartable {
    Robot,
    Task(SpawnError),
    Baud(BaudError),
}

impl From<SetupError> for Unstartable {
    fn from(_: SetupError) -> Self {
        Self::Robot
    }
}

impl From<BaudError> for Unstartable {
    fn from(error: BaudError) -> Self {
        Self::Baud(error)
    }
}

impl From<SpawnError> for Unstartable {
    fn from(error: SpawnError) -> Self {
        Self::Task(error)
    }
}

impl defmt::Format for Unstartable {
    fn format(&self, f: defmt::Formatter<'_>) {
        match self {
            // Short: `cargo test` says all about it.
            Self::Robot => defmt::write!(f, "its motors cannot be"),
            Self::Task(error) => defmt::write!(f, "a task does not start: {}", error),
            Self::Baud(error) => defmt::write!(f, "a UART does not start: {}", error),
        }
    }
}
