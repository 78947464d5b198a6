//! The robot's `async fn`s as tasks of the chip's executors.

use embassy_futures::join::{join, join3};
use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG1;
use embassy_time::Instant;
use rc10_board::robot::{self, WS2812};
use rc10_bsp::pulse_input::PulseInput;
use rc10_bsp::pulse_output::PulseOutput;
use rc10_bsp::serial::{Serial, SerialReceiver};
use rc10_module::led::ws2812::{Pulses, Strip};
use rc10_tasks::{remote, status, status_led};
use team::table::{LED_BRIGHTNESS, LEDS, RECEIVER};
use team::{Shared, chassis, driver, imu, mechanisms};

/// The base.
#[embassy_executor::task]
pub async fn chassis(shared: &'static Shared<'static>) -> ! {
    chassis::run(shared).await
}

/// Gimbal, feeder and lift, driver, watchdog: one task each ten milliseconds, because a timer walks
/// past all others. The driver comes last: motors start a tick after arming.
#[embassy_executor::task]
pub async fn ten_milliseconds(
    shared: &'static Shared<'static>,
    watchdog: Peri<'static, IWDG1>,
) -> ! {
    join3(mechanisms::run(shared), robot::watch(watchdog, shared.ports), driver::run(shared))
        .await
        .0
}

/// Publishes the status, and shows it on the LED strip.
#[embassy_executor::task]
pub async fn tenth_of_a_second(shared: &'static Shared<'static>, strip: PulseOutput) -> ! {
    join(status::run(shared), show(shared, strip)).await.0
}

async fn show(shared: &Shared<'_>, mut output: PulseOutput) -> ! {
    let pulses = Pulses::new(WS2812, async |widths: &[u16]| output.send(widths).await);
    let strip = Strip::<_, LEDS>::new(pulses).with_brightness(LED_BRIGHTNESS);
    status_led::run(shared, strip, LEDS).await
}

/// The console.
#[embassy_executor::task]
pub async fn console(shared: &'static Shared<'static>, port: Serial, quiet: Instant) {
    robot::console(shared, port.split(), quiet).await;
}

/// Listens to the remote control's receiver.
#[embassy_executor::task]
pub async fn remote(shared: &'static Shared<'static>, port: SerialReceiver) -> ! {
    remote::listen(shared, RECEIVER, port).await
}

/// Listens to a receiver that speaks in pulses.
#[embassy_executor::task]
pub async fn pulses(shared: &'static Shared<'static>, mut input: PulseInput) -> ! {
    remote::listen_pulses(shared, async || input.rising_edge().await).await
}

/// Listens to the IMU.
#[embassy_executor::task]
pub async fn imu(shared: &'static Shared<'static>, port: Serial) -> ! {
    imu::run(shared, port).await
}
