//! Soldered parts of a DM-MC02: outputs, IMU with heater, lamp, buzzer, key, supply.

use core::cell::Cell;
use core::sync::atomic::Ordering;

use embassy_embedded_hal::shared_bus::asynch::spi::SpiDevice;
#[cfg(feature = "black-box")]
use embassy_futures::join::join;
use embassy_futures::join::{join3, join5};
use embassy_stm32::exti::{self, ExtiInput};
use embassy_stm32::gpio::{self, Level, Pull, Speed};
use embassy_stm32::interrupt::typelevel;
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::peripherals::{DMA1_CH7, DMA2_CH4, DMA2_CH5};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::{bind_interrupts, dma};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_time::{Delay, Duration, Ticker, Timer};
use rc10_bsp::dma_buffer;
use rc10_bsp::pulse_output::{self, PulseOutput};
use rc10_bsp::pwm::PwmOutput;
use rc10_bsp::spi::DmaSpi;
use rc10_bsp::voltage::VoltageInput;
use rc10_module::imu::bmi088::{Bmi088, Config};
use rc10_module::imu::heater::{Heater, HeaterConfig};
use rc10_module::led::ws2812::{BITS, Pulses, Strip};
use rc10_motor::Names;
use rc10_motor::rc10_app::Seconds;
use rc10_tasks::live::Live;
use rc10_tasks::supply::OLDEST_SUPPLY;
use rc10_tasks::{Common, Supply, TickWatch, heading, status_led};
use rc10_time::Micros;

use super::{ImuParts, OutputPins, Soldered};
use crate::Output;
use crate::robot::{WS2812, has_crashed};

bind_interrupts!(struct Irqs {
    DMA1_STREAM7 => pulse_output::Interrupt<DMA1_CH7>;
    DMA2_STREAM4 => dma::InterruptHandler<DMA2_CH4>;
    DMA2_STREAM5 => dma::InterruptHandler<DMA2_CH5>;
    EXTI15_10 => exti::InterruptHandler<typelevel::EXTI15_10>;
});

/// Interrupt priority of all that is no motor.
const PRIORITY: Priority = Priority::P7;

/// Time after switching on in which a motor is not missed: the slowest ESC plays a tune of 2 s.
pub const SETTLING: Duration = Duration::from_secs(3);

/// From one output to the next.
const BETWEEN_OUTPUTS: Duration = Duration::from_millis(100);

/// Longer than from one tick of a bus to the next.
const TICKS: Duration = Duration::from_millis(2);

/// The IMU's clock: half of what it takes. 80 MHz / 16.
const IMU_CLOCK: Hertz = Hertz(5_000_000);

/// Ten resistors of 470 ohms, 12 W at 24 V: teams found a quarter of the time enough for 40 °C.
const HEATER: HeaterConfig =
    HeaterConfig { resistance: 47.0, most: 250, most_power: 3.4, target: 45.0 };
/// Far above what the transistor and the die notice, far below what the gate's resistor follows.
const HEATER_RATE: Hertz = Hertz(1_000);
/// Period of its loop, and of measuring the supply.
const TENTH: Duration = Duration::from_millis(100);

/// 100 and 10 kOhm before the supply's pin.
const SUPPLY_DIVIDER: f32 = 11.0;

/// The buzzer's tone: with 22 ohms at the transistor's base half of the time is the most.
const TONE: Hertz = Hertz(4_000);
const HALF: u16 = 500;
const BEEP: Duration = Duration::from_millis(60);

/// The brightness, for a board on a table before eyes.
const BRIGHTNESS: u8 = 24;

/// Serves the soldered parts for ever: outputs on, heading of the IMU, which it warms, lamp,
/// supply, a beep at a start (three after a crash), stop by the key.
pub async fn serve<N: Names>(
    shared: &Common<'_, N, impl Live>,
    soldered: Soldered,
    outputs: &[Output],
) {
    let Soldered { imu, heater, lamp, buzzer, supply, key, outputs: pins, .. } = soldered;
    // When the buses run, and with them all that keeps motors safe.
    let mut ticks = TickWatch::new(shared.ports);
    loop {
        Timer::after(TICKS).await;
        if ticks.have_all_ticked() {
            break;
        }
    }
    let settled = Micros::new((BETWEEN_OUTPUTS * 2 + SETTLING).as_micros());
    shared.settled.set(rc10_message::now() + settled, rc10_message::now());
    let switch_on = switch_on(pins, outputs);

    let temperature = Cell::new(None);
    let heat = async {
        let mut output = PwmOutput::start(heater.0, heater.1, HEATER_RATE, HEATER.most);
        let (mut heater, mut ticker) = (Heater::new(HEATER), Ticker::every(TENTH));
        loop {
            ticker.next().await;
            let now = rc10_message::now();
            let temperature = temperature
                .get()
                .and_then(|(degrees, at)| (now.since(at) <= OLDEST_SUPPLY).then_some(degrees));
            let supply = shared.supply.newer_than(OLDEST_SUPPLY, now);
            let volts = supply.map(|supply| f32::from(supply.millivolts) / 1000.0);
            output.set(heater.update(temperature, volts, Seconds::from_micros(TENTH.as_micros())));
        }
    };
    let lamp = async {
        let buffer = dma_buffer!(u32; BITS + 2);
        let (timer, pin, stream) = lamp;
        let mut output =
            PulseOutput::start(timer, pin, stream, Irqs, WS2812.period, buffer, PRIORITY);
        let pulses = Pulses::new(WS2812, async |widths: &[u16]| output.send(widths).await);
        status_led::run(shared, Strip::<_, 1>::new(pulses).with_brightness(BRIGHTNESS), 1).await;
    };
    let measure = async {
        let mut input = VoltageInput::new(supply, SUPPLY_DIVIDER);
        let mut ticker = Ticker::every(TENTH);
        loop {
            if let Some(volts) = input.read().await {
                #[expect(clippy::cast_possible_truncation, reason = "36,300 at most")]
                let millivolts = (volts * 1000.0) as u16;
                shared.supply.set(Supply { millivolts }, rc10_message::now());
            }
            ticker.next().await;
        }
    };
    let beep = async {
        let mut output = PwmOutput::start(buzzer.0, buzzer.1, TONE, HALF);
        for _ in 0..if has_crashed() { 3 } else { 1 } {
            output.set(HALF);
            Timer::after(BEEP).await;
            output.set(0);
            Timer::after(BEEP).await;
        }
    };
    let stop = async {
        interrupt::EXTI15_10.set_priority(PRIORITY);
        // The board has a pull-up of its own.
        let mut key = ExtiInput::new(key.0, key.1, Pull::None, Irqs);
        loop {
            key.wait_for_low().await;
            shared.switch.emergency_stop();
            key.wait_for_high().await;
        }
    };
    #[cfg(feature = "black-box")]
    let beep = join(beep, super::matches::keep(soldered.memory, &shared.switch));
    let parts = join5(tell_heading(shared, imu, &temperature), heat, lamp, measure, beep);
    join3(parts, stop, switch_on).await;
}

/// Switches outputs on, one after the other: each charges its ESCs' capacitors at once.
async fn switch_on((first, second, five_volts): OutputPins, outputs: &[Output]) {
    let level = |output| Level::from(outputs.contains(&output));
    // PC13 to PC15 drive little, and slowly (data sheet: 3 mA, 2 MHz). Dropped, they would be inputs again.
    core::mem::forget(gpio::Output::new(five_volts, level(Output::FiveVolts), Speed::Low));
    Timer::after(BETWEEN_OUTPUTS).await;
    core::mem::forget(gpio::Output::new(first, level(Output::First), Speed::Low));
    Timer::after(BETWEEN_OUTPUTS).await;
    core::mem::forget(gpio::Output::new(second, level(Output::Second), Speed::Low));
}

/// Reads the IMU, and tells the heading; keeps the temperature of its die and when that was read.
async fn tell_heading<N: Names>(
    shared: &Common<'_, N, impl Live>,
    parts: ImuParts,
    temperature: &Cell<Option<(f32, Micros)>>,
) {
    interrupt::DMA2_STREAM4.set_priority(PRIORITY);
    interrupt::DMA2_STREAM5.set_priority(PRIORITY);
    let mut config = spi::Config::default();
    config.frequency = IMU_CLOCK;
    config.mode = spi::MODE_3;
    let ImuParts { peripheral, clock, receive, transmit, .. } = parts;
    let (receive_stream, transmit_stream) = (parts.receive_stream, parts.transmit_stream);
    let bus = Spi::new(
        peripheral,
        clock,
        transmit,
        receive,
        transmit_stream,
        receive_stream,
        Irqs,
        config,
    );
    let bus = Mutex::<NoopRawMutex, _>::new(DmaSpi::new(bus, dma_buffer!(u8; 64)));
    let accelerometer =
        SpiDevice::new(&bus, gpio::Output::new(parts.accelerometer, Level::High, Speed::Medium));
    let gyroscope =
        SpiDevice::new(&bus, gpio::Output::new(parts.gyroscope, Level::High, Speed::Medium));
    shared.has_imu.store(true, Ordering::Relaxed);
    let imu = Bmi088::new(accelerometer, gyroscope, Delay, Config::default());
    heading::measure(
        imu,
        &shared.switch,
        &shared.imu_reception,
        |heading, at| shared.heading.set(heading, at),
        |sample, at| {
            shared.imu_trouble.set(sample.err(), at);
            if let Ok(sample) = sample {
                temperature.set(sample.temperature.map(|degrees| (degrees, at)));
            }
        },
    )
    .await;
}
