//! The robot's `async fn`s as tasks of the chip's executors.

use core::fmt::Write as _;

use embassy_executor::SpawnError;
use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG1;
use embassy_time::{Duration, Ticker};
use embedded_io_async::Write as _;
use heapless::String;
use rc10_bsp::can::FdcanPort;
use rc10_bsp::pulse_input::PulseInput;
use rc10_bsp::serial::{BaudError, Serial, SerialReceiver};
use rc10_bsp::watchdog::Watchdog;
use rc10_motor::TxBatch;
use rc10_motor::embassy::{BusPort, run_bus};
use rc10_robot::table::RECEIVER;
use rc10_robot::{Io, SetupError, chassis, driver, imu, mechanisms, remote, status};

/// The chip restarts within 100 ms if a bus does not tick, or if the tasks in thread mode do not
/// run: up to 10 ms go by before that shows, and the watchdog's own clock may be 9 % slow.
const WATCHDOG: Duration = Duration::from_millis(80);
/// How often it is fed.
const FEED: Duration = Duration::from_millis(10);

/// The longest line of text, its end included.
const TEXT: usize = 512;

/// One bus: frames in, motors, frames out, every millisecond. The frames that make its motors safe
/// are stored before the first tick.
///
/// Not an `async fn`: that keeps a second copy of its arguments, 2 KiB a bus.
#[embassy_executor::task(pool_size = 3)]
pub fn bus(
    mut can: FdcanPort,
    motors: &'static mut rc10_robot::Bus<'static>,
    shared: &'static BusPort,
) -> impl Future<Output = ()> {
    let mut coast = TxBatch::new();
    if motors.coast_image(&mut coast).is_err() || can.keep_coast_image(coast.frames()).is_err() {
        // Not defmt's: with that one, the crash record would name a line of defmt.
        panic!("a bus has more motors than its coast image holds");
    }
    run_bus(can, motors, shared)
}

/// The base.
#[embassy_executor::task]
pub async fn chassis(io: &'static Io<'static>) -> ! {
    chassis::run(io).await
}

/// Gimbal, feeder, lift.
#[embassy_executor::task]
pub async fn mechanisms(io: &'static Io<'static>) -> ! {
    mechanisms::run(io).await
}

/// Who decides.
#[embassy_executor::task]
pub async fn driver(io: &'static Io<'static>) -> ! {
    driver::run(io).await
}

/// Publishes the status.
#[embassy_executor::task]
pub async fn status(io: &'static Io<'static>) -> ! {
    status::run(io).await
}

/// Writes the status, ten times a second, into the debug probe's buffer: never faster, because
/// writing there blocks interrupts.
#[embassy_executor::task]
pub async fn log(io: &'static Io<'static>) {
    let Ok(mut messages) = io.status.subscribe() else {
        defmt::error!("no room for the log to subscribe to the status");
        return;
    };
    loop {
        let message = messages.next().await;
        if message.missed > 0 {
            defmt::warn!("the log was too slow for {} lines", message.missed);
        }
        defmt::info!("{}", defmt::Display2Format(&message.value));
    }
}

/// Writes the status as a line of text, ten times a second, to whoever listens at the UART.
#[embassy_executor::task]
pub async fn text(io: &'static Io<'static>, mut port: Serial) {
    let Ok(mut messages) = io.status.subscribe() else {
        defmt::error!("no room for the line of text to subscribe to the status");
        return;
    };
    let mut line = String::<TEXT>::new();
    loop {
        let status = messages.next().await.value;
        line.clear();
        // What does not fit is cut off; the line still ends.
        let _ = write!(line, "{status}");
        line.truncate(TEXT - 2);
        let _ = line.push_str("\r\n");
        // Counted by the port; the next line is a new chance.
        let _ = port.write_all(line.as_bytes()).await;
    }
}

/// Listens to the remote control's receiver.
#[embassy_executor::task]
pub async fn remote(io: &'static Io<'static>, port: SerialReceiver) -> ! {
    remote::listen(io, RECEIVER, port).await
}

/// Listens to a receiver that speaks in pulses.
#[embassy_executor::task]
pub async fn pulses(io: &'static Io<'static>, mut input: PulseInput) -> ! {
    remote::listen_pulses(io, async || input.rising_edge().await).await
}

/// Listens to the IMU.
#[embassy_executor::task]
pub async fn imu(io: &'static Io<'static>, port: Serial) -> ! {
    imu::run(io, port).await
}

/// Feeds the watchdog while every bus ticks.
#[embassy_executor::task]
pub async fn watch(watchdog: Peri<'static, IWDG1>, io: &'static Io<'static>) -> ! {
    let mut watchdog = Watchdog::start(watchdog, WATCHDOG);
    let mut ticker = Ticker::every(FEED);
    let ticks = || io.buses.map(|bus| bus.status().ticks);
    let mut before = ticks();
    loop {
        ticker.next().await;
        let now = ticks();
        watchdog.feed_if(|| now.iter().zip(before).all(|(now, before)| *now != before));
        before = now;
    }
}

/// Why the robot cannot start: something in it is wrong, not on the board.
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
            Self::Robot(SetupError::Id(motor, _)) => defmt::write!(f, "{}: no such id", motor),
            Self::Robot(SetupError::Gains(motor, _)) => defmt::write!(f, "{}: bad gains", motor),
            Self::Robot(SetupError::Attach(motor, _)) => {
                defmt::write!(f, "{}: cannot be on its bus", motor);
            }
            Self::Task(error) => defmt::write!(f, "a task does not start: {}", error),
            Self::Baud(error) => defmt::write!(f, "a UART does not start: {}", error),
        }
    }
}
