//! What the firmware of every robot does, whatever its motors: the first words of its log, its buses
//! with what keeps them safe in a crash, its watchdog, its line of text, and what keeps it from
//! starting.

use core::fmt::Write as _;

use embassy_executor::SpawnError;
use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG1;
use embassy_time::{Duration, Instant, Ticker, Timer};
use embedded_io_async::Write as _;
use heapless::String;
use rc10_bsp::can::FdcanPort;
use rc10_bsp::crash;
use rc10_bsp::serial::{BaudError, Parity, Serial, SerialConfig, StopBits};
use rc10_bsp::watchdog::Watchdog;
use rc10_module::remote::{self, SerialSettings};
use rc10_motor::embassy::{BusPort, Ports, Runner};
use rc10_motor::rc10_app::ConfigError;
use rc10_motor::{ArmSwitch, MotorBus, Names, SetupError, TxBatch, Unfit};
use rc10_tasks::{Common, TickWatch};

use crate::board::{Board, REMOTE_HAS_INVERTER};

/// The chip restarts within 100 ms if a bus does not tick, or if the tasks in thread mode do not
/// run: up to 10 ms go by before that shows, and the watchdog's own clock may be 9 % slow.
const WATCHDOG: Duration = Duration::from_millis(80);
/// Period of feeding it.
const FEED: Duration = Duration::from_millis(10);

/// The longest line of text, its end included.
const LINE: usize = 512;

/// A bus that ticks every millisecond.
pub type BusRunner = Runner<'static, 'static, FdcanPort, &'static mut MotorBus<'static>>;

/// The chip with its clocks, and its board; the log says how the last run ended.
#[must_use]
pub fn begin() -> Board {
    let board = Board::new(rc10_bsp::initialise());
    match crash::take_last() {
        Some(cause) => defmt::error!("the last run ended in a crash: {}", cause),
        None => defmt::info!("start"),
    }
    board
}

/// Forbids arming without the crystal: the buses' bit rate is wrong then.
pub fn check_crystal(switch: &ArmSwitch) {
    if !rc10_bsp::has_crystal() {
        defmt::error!("the crystal does not start: the robot cannot be armed");
        switch.forbid(Unfit::Clock);
    }
}

/// A bus with its motors. The frames that make them safe are stored before the first tick.
///
/// # Panics
/// If there are more of those than a crash can send.
#[must_use]
pub fn runner(
    mut can: FdcanPort,
    motors: &'static mut MotorBus<'static>,
    shared: &'static BusPort,
) -> BusRunner {
    let mut coast = TxBatch::new();
    if motors.coast_image(&mut coast).is_err() || can.keep_coast_image(coast.frames()).is_err() {
        // Not defmt's: with that one, the crash record would name a line of defmt.
        panic!("a bus has more motors than its coast image holds");
    }
    Runner::new(can, motors, shared, rc10_message::now())
}

/// Settings of the UART for a receiver at the board's pin.
#[must_use]
pub const fn receiver(settings: SerialSettings) -> SerialConfig {
    SerialConfig {
        baud: settings.baud,
        parity: match settings.parity {
            remote::Parity::None => Parity::None,
            remote::Parity::Even => Parity::Even,
        },
        stop_bits: if settings.stop_bits == 1 { StopBits::One } else { StopBits::Two },
        invert_receive: settings.inverted && !REMOTE_HAS_INVERTER,
        invert_transmit: false,
    }
}

/// Feeds the watchdog while every bus and line ticks.
pub async fn watch<N: Names, const BUSES: usize, const LINES: usize>(
    watchdog: Peri<'static, IWDG1>,
    ports: &Ports<N, BUSES, LINES>,
) -> ! {
    let mut watchdog = Watchdog::start(watchdog, WATCHDOG);
    if !watchdog.is_set() {
        defmt::warn!("the watchdog does not take its timeout: a hung robot may not restart");
    }
    let mut ticker = Ticker::every(FEED);
    let mut ticks = TickWatch::new(ports);
    loop {
        ticker.next().await;
        watchdog.feed_if(|| ticks.have_all_ticked(ports));
    }
}

/// Writes the status, ten times a second, as a line of text: to the UART, and into
/// the debug probe's buffer. Never faster, because writing there blocks interrupts; and the text is
/// made before, so that they wait for a copy of it only, and written whole milliseconds after `quiet`,
/// when no bus is about to send.
pub async fn log<N: Names, const BUSES: usize, const LINES: usize>(
    shared: &Common<'_, N, BUSES, LINES>,
    mut port: Serial,
    quiet: Instant,
) {
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

/// Reasons why the robot cannot start: mistakes in the program, not on the board.
pub enum Unstartable {
    /// Its declaration.
    Robot(SetupError),
    /// A number in its program.
    Config(ConfigError),
    /// A task was spawned more often than its pool allows.
    Task(SpawnError),
    /// A UART cannot have its bit rate.
    Baud(BaudError),
}

impl From<SetupError> for Unstartable {
    fn from(error: SetupError) -> Self {
        Self::Robot(error)
    }
}

impl From<ConfigError> for Unstartable {
    fn from(error: ConfigError) -> Self {
        Self::Config(error)
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

impl Unstartable {
    /// Tells the log. No crash: after a restart it would be the same, and a buffer that starts anew
    /// again and again is hard to read. The buses that run already get no commands: they coast.
    pub fn tell(&self) {
        // Short: all about it is in `cargo test`, and float formatting takes 15 KiB of flash.
        match self {
            Self::Robot(SetupError { label, .. }) => {
                defmt::error!("the robot does not start: {=str} cannot be as declared", label);
            }
            Self::Config(ConfigError { field, must_be, .. }) => {
                defmt::error!("the robot does not start: `{=str}` must be {=str}", field, must_be);
            }
            Self::Task(error) => defmt::error!("the robot does not start: a task: {}", error),
            Self::Baud(error) => defmt::error!("the robot does not start: a UART: {}", error),
        }
    }
}
