//! The chip binary of the team's robot: pins, interrupts, executors; the rest runs on a PC, too.
//!
//! Priorities, most urgent first: time (P0); the supervisor, for hung buses (P3); the buses'
//! executor (P6); UARTs and timers (P7); everything else, in thread mode. So no log, maths or
//! script delays a motor, nor does a noisy serial line, which waits while a DMA receives.
#![no_std]
#![no_main]

mod tasks;

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_stm32::bind_interrupts;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::{DMA1_CH7, UART5, USART1};
use embassy_time::{Duration, Instant};
use rc10_board::board::{Board, StripParts};
use rc10_board::robot::{self, Unstartable};
use rc10_bsp::can::Bus;
use rc10_bsp::pulse_output::{self, PulseOutput};
use rc10_bsp::serial;
use rc10_bsp::{CORE_CLOCK, cycle_count, dma_buffer, supervisor};
use rc10_message::Cycles;
use rc10_module::led::ws2812::BITS;
use rc10_motor::MotorBus;
use static_cell::{ConstStaticCell, StaticCell};
use team::table::{BUSES, CONSOLE, LEDS, RECEIVER};
use team::{Motors, Ports, Shared};

rc10_bsp::crash_handlers!();

bind_interrupts!(struct Irqs {
    TIM7 => supervisor::Interrupt;
    USART1 => serial::Interrupt<USART1>;
    DMA1_STREAM0 => serial::Interrupt<USART1>;
    DMA1_STREAM1 => serial::Interrupt<USART1>;
    UART5 => serial::Interrupt<UART5>;
    DMA1_STREAM2 => serial::Interrupt<UART5>;
    DMA1_STREAM7 => pulse_output::Interrupt<DMA1_CH7>;
});

/// Interrupt priority of all that is no motor: UARTs, timers, their DMA.
const PERIPHERALS: Priority = Priority::P7;

/// After the buses' start, when all else begins: past its set-up, and half way between two ticks.
const BETWEEN: Duration = Duration::from_micros(2_166);

/// Pulses of all LEDs, and two without a pulse.
const PULSES: usize = LEDS * BITS + 2;

// Large values are made where they stay: moved, they would go over the stack.
static PORTS: StaticCell<Ports> = StaticCell::new();
static SHARED: StaticCell<Shared<'static>> = StaticCell::new();
static MOTORS: ConstStaticCell<Motors> = ConstStaticCell::new(Motors::new());
static MOTOR_BUSES: [StaticCell<MotorBus<'static>>; BUSES] = [const { StaticCell::new() }; BUSES];

/// Runs the buses. It borrows the interrupt of a peripheral that the board does not use.
static CONTROL: InterruptExecutor = InterruptExecutor::new();
/// Cycles of each wake, in which a bus sends and the next computes; without the interrupt's own.
static TICKS: Cycles = Cycles::new(CORE_CLOCK.0);

#[interrupt]
unsafe fn UART9() {
    // SAFETY: this is the interrupt that `CONTROL` is started with, and its only caller.
    TICKS.measure(cycle_count, || unsafe { CONTROL.on_interrupt() });
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    if let Err(why) = start(spawner, robot::begin()) {
        why.tell();
    }
}

// Not inlined, and so neither are the parts of it: one after another they use the same stack.
#[inline(never)]
fn start(spawner: Spawner, board: Board) -> Result<(), Unstartable> {
    let shared = SHARED.init_with(|| Shared::new(robot::ports(&PORTS)));
    shared.bus_cycles = Some(&TICKS);
    let shared = &*shared;
    robot::check_chip(&shared.switch);
    let mut motors = robot::buses(&MOTOR_BUSES, &shared.switch);
    MOTORS.take().attach(&mut motors.each_mut().map(|bus| &mut **bus), &mut [])?;

    interrupt::UART9.set_priority(Priority::P6);
    let control = CONTROL.start(interrupt::UART9);
    let ports = [Bus::start(board.bus_1), Bus::start(board.bus_2), Bus::start(board.bus_3)];
    let started = Instant::now();
    control.spawn(robot::three_buses(ports, motors, &shared.ports.buses)?);
    supervisor::start(board.supervisor, Irqs, Priority::P3);

    spawner.spawn(tasks::ten_milliseconds(shared, board.watchdog)?);
    spawner.spawn(tasks::chassis(shared)?);
    let (StripParts { timer, pin, stream }, buffer) = (board.strip, dma_buffer!(u32; PULSES));
    let period = robot::WS2812.period;
    let strip = PulseOutput::start(timer, pin, stream, Irqs, period, buffer, PERIPHERALS);
    spawner.spawn(tasks::tenth_of_a_second(shared, strip)?);

    let text = robot::console_port(board.text, Irqs, PERIPHERALS, CONSOLE)?;
    spawner.spawn(tasks::console(shared, text, started + BETWEEN)?);
    // An HWT101.
    let imu = rc10_board::start_serial!(board, uart_7, 115_200)?;
    spawner.spawn(tasks::imu(shared, imu)?);
    match RECEIVER.serial() {
        Some(_) => {
            let port = robot::remote(board.remote, Irqs, RECEIVER, PERIPHERALS)?;
            spawner.spawn(tasks::remote(shared, port)?);
        }
        None => {
            spawner.spawn(tasks::pulses(shared, rc10_board::start_pulses!(board))?);
        }
    }
    // A bus wakes every third of a millisecond. All else wakes between, to leave them punctual.
    while started.elapsed() < BETWEEN {}
    Ok(())
}
