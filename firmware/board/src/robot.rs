//! The work of every robot's firmware: its log's first words, its buses and their crash frames,
//! watchdog, line of text, and what keeps it from starting.

use core::fmt::Write as _;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use embassy_executor::SpawnError;
use embassy_futures::join::join;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{Input, Pin, Pull};
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{self, Binding};
use embassy_stm32::peripherals::{
    DMA1_CH0, DMA1_CH1, DMA1_CH2, FDCAN1, FDCAN2, FDCAN3, IWDG1, UART5, USART1,
};
use embassy_time::{Duration, Instant, Ticker, Timer};
use embedded_io_async::{Read, Write};
use heapless::String;
use rc10_bsp::can::{Bus, BusParts, FdcanPort};
use rc10_bsp::crash::{self, LastCrash};
use rc10_bsp::dma_buffer;
use rc10_bsp::flash;
use rc10_bsp::pulse_output::PulseOutput;
use rc10_bsp::serial::{
    self, BaudError, Parity, ReceiverParts, Serial, SerialConfig, SerialParts, SerialReceiver,
    StopBits,
};
use rc10_bsp::watchdog::Watchdog;
use rc10_bsp::{CrystalState, TIMER_CLOCK};
use rc10_module::led::ws2812::{BITS, PulseTiming, Pulses, Strip};
use rc10_module::remote::{self, Receiver, SerialSettings};
use rc10_module::store::{Cells, Found, Store, WORD, Word};
use rc10_motor::embassy::{BusPort, Ports, PortsOf, Rs485Port, Runner, run_buses};
use rc10_motor::rc10_app::ConfigError;
use rc10_motor::{ArmSwitch, MotorBus, Names, SetupError, TxBatch, Unfit};
use rc10_tasks::live::{self, Kept, Link, Live};
use rc10_tasks::program::{Declared, LinePart};
use rc10_tasks::{Common, TickWatch, status, status_led};
use static_cell::StaticCell;

use crate::board::{Board, CRYSTAL, NAME, REMOTE_HAS_INVERTER};

/// The chip restarts within 100 ms if a bus does not tick, or if the tasks in thread mode do not
/// run: up to 10 ms go by before that shows, and the watchdog's own clock may be 9 % slow.
const WATCHDOG: Duration = Duration::from_millis(80);
/// Period of feeding it.
const FEED: Duration = Duration::from_millis(10);

/// The pulses of a WS2812, made by any timer.
pub const WS2812: PulseTiming = match PulseTiming::new(TIMER_CLOCK.0) {
    Ok(timing) => timing,
    Err(_) => panic!("the timers' clock hits no pulse width of a WS2812"),
};

/// After the buses' start, when all else begins: past its set-up, and half way between two ticks.
pub const BETWEEN: Duration = Duration::from_micros(2_166);

/// The longest line of text, its end included.
const LINE: usize = 512;

/// A bus that ticks every millisecond.
type BusRunner = Runner<'static, 'static, FdcanPort, &'static mut MotorBus<'static>>;

/// The chip with its clocks, and its board; the log says how the last run ended.
#[must_use]
pub fn begin() -> Board {
    let board = Board::new(rc10_bsp::initialise(CRYSTAL));
    let power_came = crash::power_came();
    let cause = crash::take_last();
    HAS_CRASHED.store(cause.is_some(), Ordering::Relaxed);
    #[cfg(feature = "black-box")]
    CAUSE.store(number(cause.as_ref()), Ordering::Relaxed);
    match cause {
        Some(LastCrash::Hang { program_counter }) => defmt::error!(
            "the last run ended in a crash: Watchdog, hung at {=u32:#010x} (addr2line -fie FILE ADDRESS names it)",
            program_counter
        ),
        Some(cause) => defmt::error!("the last run ended in a crash: {}", cause),
        None if power_came => defmt::info!("start, power came"),
        None => defmt::info!("start"),
    }
    board
}

static HAS_CRASHED: AtomicBool = AtomicBool::new(false);

/// The number of that crash, as a black box keeps it.
#[cfg(feature = "black-box")]
static CAUSE: AtomicU32 = AtomicU32::new(0);

#[cfg(feature = "black-box")]
const fn number(cause: Option<&LastCrash>) -> u32 {
    match cause {
        None => 0,
        Some(LastCrash::Panic { .. }) => 1,
        Some(LastCrash::Fault { .. }) => 2,
        Some(LastCrash::Interrupt { .. }) => 3,
        Some(LastCrash::CrystalStopped) => 4,
        Some(LastCrash::Watchdog | LastCrash::Hang { .. }) => 5,
        Some(LastCrash::Supply) => 6,
    }
}

/// Whether the last run ended in a crash, as [`begin`] has found.
pub fn has_crashed() -> bool {
    HAS_CRASHED.load(Ordering::Relaxed)
}

/// The chip's flash for what is kept.
struct KeptFlash;

/// µs since the start of a moment half way between two ticks; [`u32::MAX`]: nothing ticks yet.
static QUIET: AtomicU32 = AtomicU32::new(u32::MAX);

/// Whether a word may be programmed from now on: it takes 200 µs at most, and the buses wake 274 µs behind the middle.
fn is_quiet() -> bool {
    const LATEST: u32 = 50;
    const EARLIEST: u32 = 1000 - 350;
    #[expect(clippy::cast_possible_truncation, reason = "as QUIET is")]
    let now = Instant::now().as_micros() as u32;
    let quiet = QUIET.load(Ordering::Relaxed);
    let since = now.wrapping_sub(quiet) % 1000;
    quiet == u32::MAX || !(LATEST..EARLIEST).contains(&since)
}

#[expect(clippy::cast_possible_truncation, reason = "there are two sectors")]
impl Cells for KeptFlash {
    fn words(&self) -> u32 {
        flash::WORDS
    }

    fn read(&mut self, sector: u32, word: u32) -> Word {
        flash::read(sector as u8, word).unwrap_or([0; WORD])
    }

    fn program(&mut self, sector: u32, word: u32, bytes: &Word) {
        let _ = flash::program(sector as u8, word, bytes, is_quiet);
    }

    fn erase(&mut self, sector: u32) {
        let _ = flash::erase(sector as u8);
    }

    fn free(&mut self, sector: u32) -> u32 {
        flash::free(sector as u8)
    }
}

/// The kept parameters, before the buses and the watchdog run: now and then a sector is erased, in 1 to 2 s. Those that
/// the robot must have are named.
#[must_use]
pub fn kept(switch: &ArmSwitch, must_have: &'static [&'static str]) -> Kept {
    static FLASH: StaticCell<KeptFlash> = StaticCell::new();
    let (store, found) = Store::start(FLASH.init(KeptFlash) as &'static mut dyn Cells);
    let Found { length, erased, worn, is_damaged } = found;
    match length {
        Some(count) => defmt::info!("{=u32} parameters are kept", count),
        None => defmt::info!("no parameters are kept"),
    }
    if erased > 0 {
        defmt::info!("{=u8} of 2 sectors of their flash were erased", erased);
    }
    if worn > 0 {
        defmt::warn!("{=u8} of 2 sectors of their flash are worn out", worn);
    }
    if is_damaged {
        defmt::warn!("the newest of them are damaged: those before are used");
    }
    Kept::new((store, found), must_have, switch)
}

/// Forbids arming on another chip than the board's, and without its crystal: the buses' bit rate is wrong then.
pub fn check_chip(switch: &ArmSwitch) {
    if let Some(id) = rc10_bsp::other_chip() {
        defmt::error!(
            "this chip is no STM32H723 but has DEV_ID {=u16:#x}: the robot cannot be armed",
            id
        );
        switch.forbid(Unfit::Chip);
    }
    match rc10_bsp::crystal() {
        CrystalState::Works { hsi } => {
            let (sign, off) = (if hsi < 0 { "-" } else { "+" }, hsi.unsigned_abs());
            defmt::info!("HSI is {=str}{=u32}.{=u32:02} %", sign, off / 100, off % 100);
            return;
        }
        CrystalState::Unmeasured => {
            defmt::warn!(
                "the crystal could not be measured: whether it is the right one is not known"
            );
            return;
        }
        CrystalState::Dead => {
            defmt::error!("the crystal does not start: the robot cannot be armed");
        }
        CrystalState::Other { hz } => {
            let (khz, wanted) = (hz / 1000, CRYSTAL.hz() / 1000);
            let rate = CRYSTAL.bit_rate_with(hz) / 1000;
            defmt::error!(
                "the crystal has {=u32} kHz, within 1.5 %, and this program is for one of {=u32} kHz ({=str}): \
                 with it the buses would run at {=u32} kbit/s; the robot cannot be armed",
                khz,
                wanted,
                NAME,
                rate
            );
        }
    }
    switch.forbid(Unfit::Clock);
}

/// An executor on an interrupt, which is that of a peripheral that the board does not use.
#[macro_export]
macro_rules! executor {
    ($(#[$meta:meta])* $EXECUTOR:ident on $INTERRUPT:ident $(, measured by $TIMES:ident)?) => {
        $(#[$meta])*
        static $EXECUTOR: $crate::embassy_executor::InterruptExecutor =
            $crate::embassy_executor::InterruptExecutor::new();

        // SAFETY: the vector table's name for this interrupt.
        #[allow(non_snake_case)]
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $INTERRUPT() {
            // SAFETY: this is the interrupt that the executor is started with, and its only caller.
            let run = || unsafe { $EXECUTOR.on_interrupt() };
            $crate::run!(run $(, $TIMES)?);
        }
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! run {
    ($run:ident) => {
        $run()
    };
    ($run:ident, $TIMES:ident) => {
        $TIMES.measure($crate::rc10_bsp::cycle_count, $run)
    };
}

/// Ports of buses and lines, made in place: on their way they would take 10 KiB of stack.
pub fn ports<N: Names, const BUSES: usize, const LINES: usize>(
    place: &'static StaticCell<Ports<N, BUSES, LINES>>,
) -> &'static Ports<N, BUSES, LINES> {
    // For the check of the numbers that this does.
    let _: fn() -> Ports<N, BUSES, LINES> = Ports::new;
    let place = place.uninit();
    let ports = place.as_mut_ptr();
    for bus in 0..BUSES {
        // SAFETY: the place is there, nothing else refers to it, and each element is written once.
        unsafe { (&raw mut (*ports).buses[bus]).write(const { BusPort::new() }) };
    }
    for line in 0..LINES {
        // SAFETY: as above.
        unsafe { (&raw mut (*ports).lines[line]).write(const { Rs485Port::new() }) };
    }
    // SAFETY: all buses and lines have been written, and there is nothing else in it.
    unsafe { place.assume_init_ref() }
}

/// Buses without motors, where they stay.
pub fn buses<const BUSES: usize>(
    places: &'static [StaticCell<MotorBus<'static>>; BUSES],
    switch: &'static ArmSwitch,
) -> [&'static mut MotorBus<'static>; BUSES] {
    places.each_ref().map(|place| place.init_with(|| MotorBus::new(switch)))
}

/// A bus with its motors. The frames that make them safe are stored before the first tick: panics
/// if they are more than a crash can send.
fn runner(
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

/// Records what reaches the ticks of a robot's buses and lines, for `rc10 replay`. What an earlier run has left of a crash
/// stays until the robot has been armed [`ARMED_AFTER_CRASH`](crate::board::ARMED_AFTER_CRASH) times.
#[cfg(feature = "black-box")]
pub fn record<N>(ports: PortsOf<'static, N>) {
    use core::cell::UnsafeCell;

    use rc10_bsp::black_box::RC10_BLACK_BOX;
    use rc10_motor::record::ring::{self, Memory, Writer};
    use rc10_motor::record::{FIRST_LINE, START, Sink, TICK};

    use crate::board::ARMED_AFTER_CRASH;

    struct BlackBox;
    struct Place(UnsafeCell<Writer>);
    // SAFETY: it is touched beside the memory only, in the critical section of that.
    unsafe impl Sync for Place {}
    static WRITER: Place = Place(UnsafeCell::new(Writer::NEW));
    /// Number of times that it must still be armed, as the ring has it, and in the top bit whether it is.
    static HELD: AtomicU32 = AtomicU32::new(0);
    const IS_ARMED: u32 = 1 << 31;
    /// The program's fingerprint: of all its buses.
    static PRINT: AtomicU32 = AtomicU32::new(0);

    fn with<R>(work: impl FnOnce(&mut Writer, &mut Memory) -> R) -> R {
        // SAFETY: as above; this is not called within itself.
        RC10_BLACK_BOX.with(|memory| work(unsafe { &mut *WRITER.0.get() }, memory))
    }

    impl Sink for BlackBox {
        fn put(&self, entry: &[u32]) {
            let [kind, place, _, arm] = entry[0].to_le_bytes();
            let mut held = HELD.load(Ordering::Relaxed);
            if kind == START {
                let print = PRINT.load(Ordering::Relaxed) ^ entry[3];
                PRINT.store(print, Ordering::Relaxed);
                if held == 0 {
                    with(|_, memory| memory[ring::PRINT] = print);
                }
            }
            // Any one place: all see the same switch. Suspended, by a remote that is lost, it is armed.
            let is_armed = matches!(arm, 1 | 4);
            let is_news = is_armed != (held & IS_ARMED != 0);
            if held != 0 && kind == TICK && matches!(place, 0 | FIRST_LINE) && is_news {
                let left = (held & !IS_ARMED) - u32::from(is_armed);
                held = left | if is_armed && left > 0 { IS_ARMED } else { 0 };
                HELD.store(held, Ordering::Relaxed);
                with(|writer, memory| {
                    if left == 0 {
                        return writer.clear(memory, PRINT.load(Ordering::Relaxed));
                    }
                    memory[ring::HELD..][..2].fill(left);
                });
                return;
            }
            if held == 0 {
                with(|writer, memory| writer.put(memory, entry));
            }
        }

        fn is_proof(&self) -> bool {
            RC10_BLACK_BOX.with(|memory| memory[ring::WISH] == ring::PROOF)
        }
    }

    let held = with(|writer, memory| {
        let is_kept = ring::is_kept(memory);
        // A reset may have lost one half.
        let held = memory[ring::HELD].max(memory[ring::HELD + 1]).min(ARMED_AFTER_CRASH);
        if is_kept && memory[ring::WISH] == ring::PROOF {
            // The test bench takes it all, over every start.
            writer.resume(memory);
        } else if is_kept && held > 0 {
            memory[ring::HELD..][..2].fill(held);
            return held;
        } else if is_kept && has_crashed() {
            memory[ring::HELD..][..2].fill(ARMED_AFTER_CRASH);
            memory[ring::CAUSE] = CAUSE.load(Ordering::Relaxed);
            return ARMED_AFTER_CRASH;
        } else {
            writer.clear(memory, 0);
        }
        0
    });
    HELD.store(held, Ordering::Relaxed);
    if held > 0 {
        defmt::info!(
            "what happened before the crash is kept until the robot was armed {=u32} times",
            held
        );
    }
    for (place, port) in (0..).zip(ports.buses) {
        port.record(&BlackBox, place);
    }
    for (place, port) in (FIRST_LINE..).zip(ports.lines) {
        port.record(&BlackBox, place);
    }
}

/// Nothing is recorded.
#[cfg(not(feature = "black-box"))]
pub const fn record<N>(_: PortsOf<'static, N>) {}

/// The first buses of the board, started: as many as the robot has.
#[must_use]
pub fn start_buses<const BUSES: usize>(
    bus_1: BusParts<FDCAN1>,
    bus_2: BusParts<FDCAN2>,
    bus_3: BusParts<FDCAN3>,
) -> [FdcanPort; BUSES] {
    let (mut bus_1, mut bus_2, mut bus_3) = (Some(bus_1), Some(bus_2), Some(bus_3));
    core::array::from_fn(|bus| {
        let port = match bus {
            0 => bus_1.take().map(Bus::start),
            1 => bus_2.take().map(Bus::start),
            _ => bus_3.take().map(Bus::start),
        };
        port.expect("a robot has at most three buses")
    })
}

/// All buses: frames in, motors, frames out, every millisecond.
///
/// One task: a timer walks past all tasks' timers. An `async fn` would keep 2 KiB a bus twice.
pub fn run<const BUSES: usize>(
    ports: [FdcanPort; BUSES],
    motors: [&'static mut MotorBus<'static>; BUSES],
    shared: &'static [BusPort],
) -> impl Future<Output = ()> {
    let mut others = motors.into_iter().zip(shared);
    run_buses(ports.map(|port| {
        let (motors, shared) = others.next().expect("as many as ports");
        runner(port, motors, shared)
    }))
}

/// The declared line on a UART.
#[must_use]
pub const fn line_part<P: Declared>(uart: u8) -> LinePart {
    let mut at = 0;
    while at < P::RS485.len() {
        if P::RS485[at].uart == uart {
            return P::RS485[at];
        }
        at += 1;
    }
    panic!("no such line is declared")
}

/// The declared rate of the part on a UART.
#[must_use]
pub const fn baud<P: Declared>(uart: u8) -> u32 {
    let mut at = 0;
    while at < P::SERIALS.len() {
        if P::SERIALS[at].uart == uart {
            return P::SERIALS[at].baud;
        }
        at += 1;
    }
    panic!("no such part is declared")
}

/// LEDs and brightness of the declared strip.
#[must_use]
pub const fn strip<P: Declared>() -> (usize, u8) {
    match P::STRIP {
        Some(strip) => strip,
        None => panic!("no strip is declared"),
    }
}

/// Shows the state of the robot on a strip of WS2812.
pub async fn show<N: Names, const LEDS: usize>(
    shared: &Common<'_, N, impl Live>,
    mut output: PulseOutput,
    brightness: u8,
) {
    let pulses = Pulses::new(WS2812, async |widths: &[u16]| output.send(widths).await);
    let strip = Strip::<_, LEDS>::new(pulses).with_brightness(brightness);
    status_led::run(shared, strip, LEDS).await;
}

/// Pulses of all LEDs of a strip, and two without a pulse.
#[must_use]
pub const fn pulses(leds: usize) -> usize {
    leds * BITS + 2
}

/// The console, at `baud` bits a second: 921,600, which every USB adapter can, or 2,000,000.
pub fn console_port(
    parts: SerialParts<USART1, DMA1_CH0, DMA1_CH1>,
    interrupts: impl Binding<typelevel::USART1, serial::Interrupt<USART1>>
    + Binding<typelevel::DMA1_STREAM0, serial::Interrupt<USART1>>
    + Binding<typelevel::DMA1_STREAM1, serial::Interrupt<USART1>>,
    priority: Priority,
    baud: u32,
) -> Result<Serial, BaudError> {
    // What a PC asks in 5 ms, and the longest frame to it.
    let (ring, buffer) = (dma_buffer!(u8; 1024), dma_buffer!(u8; 1056));
    Serial::start(parts, interrupts, &SerialConfig::new(baud), ring, buffer, priority)
}

/// The receiver of a remote control, if it speaks serially.
pub fn remote(
    parts: ReceiverParts<UART5, DMA1_CH2>,
    interrupts: impl Binding<typelevel::UART5, serial::Interrupt<UART5>>
    + Binding<typelevel::DMA1_STREAM2, serial::Interrupt<UART5>>,
    receiver: Receiver,
    priority: Priority,
) -> Result<SerialReceiver, Unstartable> {
    let settings = receiver.serial().ok_or(Unstartable::Pulses)?;
    // What comes in 5 ms twice over, at the highest rate of what may be there.
    let ring = dma_buffer!(u8; 1024);
    Ok(SerialReceiver::start(parts, interrupts, &config(settings), ring, priority)?)
}

/// The bytes of a port's ring: what comes in 5 ms twice over, 64 to 1024.
#[must_use]
pub const fn ring(baud: u32) -> usize {
    let bytes = (baud as usize / 1000).next_power_of_two();
    if bytes < 64 {
        64
    } else if bytes > 1024 {
        1024
    } else {
        bytes
    }
}

/// Settings of the UART for a receiver at the board's pin.
const fn config(settings: SerialSettings) -> SerialConfig {
    SerialConfig {
        baud: settings.baud,
        parity: match settings.parity {
            remote::Parity::None => Parity::None,
            remote::Parity::Even => Parity::Even,
        },
        stop_bits: if settings.stop_bits == 1 { StopBits::One } else { StopBits::Two },
        invert_receive: settings.inverted != REMOTE_HAS_INVERTER,
        invert_transmit: false,
    }
}

/// Feeds the watchdog while every bus and line ticks.
pub async fn watch<N: Names>(watchdog: Peri<'static, IWDG1>, ports: PortsOf<'_, N>) -> ! {
    let mut watchdog = Watchdog::start(watchdog, WATCHDOG);
    if !watchdog.is_set() {
        defmt::warn!("the watchdog does not take its timeout: a hung robot may not restart");
    }
    let mut ticker = Ticker::every(FEED);
    let mut ticks = TickWatch::new(ports);
    loop {
        ticker.next().await;
        watchdog.feed_if(|| ticks.have_all_ticked());
    }
}

/// Feeds the watchdog, and tells the status.
pub async fn tend<N: Names>(shared: &Common<'_, N, impl Live>, watchdog: Peri<'static, IWDG1>) {
    join(watch(watchdog, shared.ports), status::run(shared)).await;
}

/// Writes the status as a line, ten times a second: to the console, unless a PC speaks there as
/// [`rc10_link`](mod@rc10_tasks::live) does, and to the probe's buffer. That blocks interrupts: so
/// no faster, of text made before, and whole milliseconds after `quiet`, when no bus sends. The parameters that are kept
/// are used first.
pub async fn console<N: Names>(
    shared: &Common<'_, N, impl Live>,
    (receiver, transmitter): (impl Read, impl Write),
    quiet: Instant,
    kept: Kept,
) {
    #[expect(clippy::cast_possible_truncation, reason = "it is soon after the start")]
    QUIET.store(quiet.as_micros() as u32, Ordering::Relaxed);
    let (link, robot) = (Link::new(transmitter), live::RobotView::new(shared).with_kept(&kept));
    #[cfg(feature = "black-box")]
    let robot = robot.with_black_box(crate::board::BLACK_BOX);
    join(link.serve(&robot, receiver, quiet, shared.own.auto()), lines(shared, &link, quiet)).await;
}

async fn lines<N: Names>(
    shared: &Common<'_, N, impl Live>,
    link: &Link<impl Write>,
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
        shared.own.signals(&mut |signal| {
            if let Some(stage) = signal.failure() {
                let _ = write!(line, "; {} gave up: {}", signal.label, stage.name());
                defmt::warn!("{=str} gave up: {=str}", signal.label, stage.name());
            }
        });
        if let Some(trouble) = message.value.imu_trouble {
            defmt::warn!("IMU {=str}", trouble);
        }
        // Interrupts wait for up to 20 us.
        let since = quiet.elapsed().as_micros() % 1000;
        Timer::after_micros(1000 - since).await;
        defmt::info!("{=str}", line);
        line.truncate(LINE - 2);
        let _ = line.push_str("\r\n");
        link.say(line.as_bytes()).await;
    }
}

/// A switch to ground: low while it is closed.
#[must_use]
pub fn switch(pin: Peri<'static, impl Pin>) -> Input<'static> {
    Input::new(pin, Pull::Up)
}

/// Reasons why the robot cannot start: mistakes in the program, not on the board.
pub enum Unstartable {
    /// The robot's declaration.
    Robot(SetupError),
    /// A number in its program.
    Config(ConfigError),
    /// A task was spawned more often than its pool allows.
    Task(SpawnError),
    /// A UART cannot have its bit rate.
    Baud(BaudError),
    /// The receiver of the remote speaks in pulses, where bytes are listened to.
    Pulses,
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
            Self::Pulses => {
                defmt::error!("the robot does not start: its receiver speaks in pulses");
            }
        }
    }
}
