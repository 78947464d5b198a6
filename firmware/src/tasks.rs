//! The robot's `async fn`s as tasks of the chip's executors.

use core::fmt::Write as _;

use embassy_executor::SpawnError;
use embassy_futures::join::{join, join3};
use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG1;
use embassy_time::{Duration, Instant, Ticker, Timer};
use embedded_io_async::Write as _;
use heapless::String;
use rc10_bsp::TIMER_CLOCK;
use rc10_bsp::can::FdcanPort;
use rc10_bsp::pulse_input::PulseInput;
use rc10_bsp::pulse_output::PulseOutput;
use rc10_bsp::serial::{BaudError, Serial, SerialReceiver};
use rc10_bsp::watchdog::Watchdog;
use rc10_module::led::ws2812::{PulseTiming, Pulses, Strip};
use rc10_motor::embassy::{BusPort, Runner, run_buses};
use rc10_motor::{MotorBus, SetupError, TxBatch};
use rc10_robot::table::{BUSES, LED_BRIGHTNESS, LEDS, RECEIVER};
use rc10_robot::{Shared, chassis, driver, imu, mechanisms};
use rc10_tasks::{TickWatch, remote, status, status_led};

/// The chip restarts within 100 ms if a bus does not tick, or if the tasks in thread mode do not
/// run: up to 10 ms go by before that shows, and the watchdog's own clock may be 9 % slow.
const WATCHDOG: Duration = Duration::from_millis(80);
/// Period of feeding it.
const FEED: Duration = Duration::from_millis(10);

/// The longest line of text, its end included.
const LINE: usize = 512;

/// The pulses of the LED strip.
pub const STRIP: PulseTiming = match PulseTiming::new(TIMER_CLOCK.0) {
    Ok(timing) => timing,
    Err(_) => panic!("the timer's clock hits no pulse width of a WS2812"),
};

/// The buses: frames in, motors, frames out, every millisecond. The frames that make their motors
/// safe are stored before the first tick.
///
/// One task, because setting a timer walks past those of all tasks. Not an `async fn`: that
/// keeps a second copy of its arguments, 2 KiB a bus.
#[embassy_executor::task]
pub fn buses(
    ports: [FdcanPort; BUSES],
    motors: [&'static mut MotorBus<'static>; BUSES],
    shared: [&'static BusPort; BUSES],
) -> impl Future<Output = ()> {
    let ([a, b, c], [d, e, f], [g, h, i]) = (ports, motors, shared);
    run_buses([runner(a, d, g), runner(b, e, h), runner(c, f, i)])
}

fn runner(
    mut can: FdcanPort,
    motors: &'static mut MotorBus<'static>,
    shared: &'static BusPort,
) -> Runner<'static, 'static, FdcanPort, &'static mut MotorBus<'static>> {
    let mut coast = TxBatch::new();
    if motors.coast_image(&mut coast).is_err() || can.keep_coast_image(coast.frames()).is_err() {
        // Not defmt's: with that one, the crash record would name a line of defmt.
        panic!("a bus has more motors than its coast image holds");
    }
    Runner::new(can, motors, shared, rc10_message::now())
}

/// The base.
#[embassy_executor::task]
pub async fn chassis(shared: &'static Shared<'static>) -> ! {
    chassis::run(shared).await
}

/// Gimbal, feeder and lift, the driver, and the watchdog's feeding. One task for everything that
/// happens every ten milliseconds, because setting a timer walks past those of all tasks. The driver
/// comes last, so that motors start in another tick than the one in which the robot is armed: in one
/// tick that would be a lot.
#[embassy_executor::task]
pub async fn ten_milliseconds(
    shared: &'static Shared<'static>,
    watchdog: Peri<'static, IWDG1>,
) -> ! {
    join3(mechanisms::run(shared), watch(watchdog, shared), driver::run(shared)).await.0
}

/// Publishes the status, and shows it on the LED strip.
#[embassy_executor::task]
pub async fn tenth_of_a_second(shared: &'static Shared<'static>, strip: PulseOutput) -> ! {
    join(status::run(shared, [("IMU", &shared.imu_reception)]), show(shared, strip)).await.0
}

async fn show(shared: &Shared<'_>, mut output: PulseOutput) -> ! {
    let pulses = Pulses::new(STRIP, async |widths: &[u16]| output.send(widths).await);
    let strip = Strip::<_, LEDS>::new(pulses).with_brightness(LED_BRIGHTNESS);
    status_led::run(shared, strip, LEDS).await
}

/// Writes the status, ten times a second, as a line of text: to the UART, and into
/// the debug probe's buffer. Never faster, because writing there blocks interrupts; and the text is
/// made before, so that they wait for a copy of it only, and written whole milliseconds after `quiet`,
/// when no bus is about to send.
#[embassy_executor::task]
pub async fn log(shared: &'static Shared<'static>, mut port: Serial, quiet: Instant) {
    let Ok(mut messages) = shared.status.subscribe() else {
        defmt::error!("no room for the log to subscribe to the status");
        return;
    };
    let mut line = String::<LINE>::new();
    loop {
        let message = messages.next().await;
        if message.missed > 0 {
            defmt::warn!("the log was too slow for {} lines", message.missed);
        }
        line.clear();
        // The part that does not fit is cut off; the line still ends.
        let _ = write!(line, "{}", message.value);
        // Interrupts wait for up to 20 us.
        let since = quiet.elapsed().as_micros() % 1000;
        Timer::after_micros(1000 - since).await;
        defmt::info!("{=str}", line);
        line.truncate(LINE - 2);
        let _ = line.push_str("\r\n");
        // Counted by the port; the next line is a new chance.
        let _ = port.write_all(line.as_bytes()).await;
    }
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

/// Feeds the watchdog while every bus ticks.
async fn watch(watchdog: Peri<'static, IWDG1>, shared: &Shared<'_>) -> ! {
    let mut watchdog = Watchdog::start(watchdog, WATCHDOG);
    if !watchdog.is_set() {
        defmt::warn!("the watchdog does not take its timeout: a hung robot may not restart");
    }
    let mut ticker = Ticker::every(FEED);
    let mut ticks = TickWatch::new(shared.ports);
    loop {
        ticker.next().await;
        watchdog.feed_if(|| ticks.have_all_ticked(shared.ports));
    }
}

/// Reasons why the robot cannot start: mistakes in the program, not on the board.
pub enum Unstartable {
    /// Its table of motors.
    Robot(SetupError),
    /// A task was spawned more often than its pool allows.
    Task(SpawnError),
    /// A baud rate.
    Baud(BaudError),
}

impl From<SetupError> for Unstartable {
    fn from(error: SetupError) -> Self {
        Self::Robot(error)
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
            // Short: all about it is in `cargo test`, and float formatting takes 15 KiB of flash.
            Self::Robot(SetupError { label, .. }) => {
                defmt::write!(f, "{=str}: cannot be as declared", label);
            }
            Self::Task(error) => defmt::write!(f, "a task does not start: {}", error),
            Self::Baud(error) => defmt::write!(f, "a UART does not start: {}", error),
        }
    }
}
