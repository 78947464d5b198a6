//! What the tools of a PC read, and what a robot hears from one; and an IMU whose registers say anything.

use std::cell::RefCell;
use std::io::Cursor;
use std::pin::pin;
use std::rc::Rc;
use std::sync::LazyLock;
use std::task::{Context, Poll, Waker};

use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::{ErrorType, Operation, SpiDevice};
use rc10_cli::Robot;
use rc10_cli::formats::{candump, slcan};
use rc10_cli::live::Client;
use rc10_cli::record::{RecordWriter, replay};
use rc10_cli::run::simulate::simulate_into;
use rc10_cli::world::environment::Environment;
use rc10_link::Declaration;
use rc10_link::commands::{COMMAND_AGE, Head};
use rc10_link::frame::{AROUND, ASK, BODY, Said, WithCommands, Writer, crc};
use rc10_module::Stream;
use rc10_module::imu::bmi088::{Bmi088, Config};
use rc10_motor::{ArmState, Names};
use rc10_sim::World;
use rc10_tasks::Common;
use rc10_tasks::live::{Auto, AutoChannel, Commanded, LOST, Live, RobotView};
use rc10_time::Micros;

/// A frame with a good CRC around anything, of up to 192 bytes.
fn sound(body: &[u8]) -> Vec<u8> {
    let mut other = Writer::<{ BODY + AROUND }>::new();
    other.message(&0_u8);
    let (begin, [low, high]) = (other.bytes()[0], (body.len() as u16).to_le_bytes());
    let head = [begin, low, high, begin ^ low ^ high ^ 0xFF];
    [&head, body, &crc(body).to_le_bytes()].concat()
}

/// Pieces of some bytes, each with its length before it.
fn pieces(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let (&length, rest) = bytes.split_first()?;
        let (piece, rest) = rest.split_at(usize::from(length).min(rest.len()));
        bytes = rest;
        Some(piece)
    })
}

/// Hands the team's robot over.
fn of_team<R>(take: impl FnOnce(Robot<'_>) -> R) -> R {
    let ports = team::Ports::new();
    let (shared, mut motors) = (team::Shared::new(&ports), team::Motors::new());
    take(rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap())
}

/// The PC's end of a link: sound frames of anything, and noise.
pub fn client(bytes: &[u8]) {
    let mut client = Client::new();
    for (at, piece) in (0..).zip(pieces(bytes)) {
        let now = Micros::from_millis(at);
        client.step(now);
        client.hear(&sound(piece), now);
        client.hear(piece, now);
        drop((client.take_out(), client.take_samples(), client.losses(), client.is_described()));
    }
}

/// The robot's end: after whatever it was asked, it answers a hello.
pub fn conversation(bytes: &[u8]) {
    of_team(|robot| {
        let around = Environment::new(robot.description(), 1).unwrap();
        let mut around = around.with_console(2_000_000);
        let mut tasks = robot.tasks(&around).unwrap();
        let line = around.console.clone().unwrap();
        let mut run = |sent: &[u8]| {
            line.send(sent);
            let end = around.world.now() + Micros::from_millis(1);
            around.run(&mut tasks, end);
            (line.take(), end)
        };
        for piece in pieces(bytes).take(32) {
            run(&[sound(piece), piece.to_vec()].concat());
        }
        // What was begun may claim to be as long as the longest frame.
        run(&[0; BODY + AROUND]);
        let mut client = Client::new();
        for _ in 0..50 {
            let out = client.take_out();
            let (heard, now) = run(&out);
            client.step(now);
            client.hear(&heard, now);
        }
        assert!(client.version() != 0, "it does not answer");
    });
}

/// Lines of candump and of slcan: a frame that is understood is written as it was meant.
pub fn lines(bytes: &[u8]) {
    for line in String::from_utf8_lossy(bytes).lines() {
        let Ok(Some(line)) = candump::parse(line) else { continue };
        let mut again = String::new();
        candump::write_line(&mut again, Micros::ZERO, "can0", &line.frame).unwrap();
        let read = candump::parse(again.trim_end()).unwrap().unwrap();
        assert_eq!(read.frame, line.frame, "{again}");
    }
    for command in slcan::Lines::default().take(bytes).into_iter().flatten() {
        let slcan::SlcanCommand::Send(frame) = command else { continue };
        let mut again = Vec::new();
        slcan::write_frame(&mut again, &frame, None);
        assert_eq!(slcan::parse(&again[..again.len() - 1]), Ok(command));
    }
}

/// A record of some milliseconds, without the checksums that would tell what is changed.
static RECORD: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let path = std::env::temp_dir().join(format!("rc10-fuzz-{}.mcap", std::process::id()));
    of_team(|robot| {
        let record =
            RecordWriter::new(&path, true, &rc10_cli::run::simulate::heading(&robot, 1)).unwrap();
        simulate_into(robot, 1, Micros::from_millis(12), Some(record)).unwrap();
    });
    let mut bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    let mut at = 8;
    while let Some(length) = bytes.get(at + 1..at + 9) {
        let length = u64::from_le_bytes(length.try_into().unwrap()) as usize;
        if bytes[at] == 6 {
            bytes[at + 33..at + 37].fill(0);
        }
        at += 9 + length;
    }
    bytes
});

/// A record with some bytes changed, and the bytes alone as one.
pub fn record(bytes: &[u8]) {
    let mut changed = RECORD.clone();
    for [low, middle, high, value] in bytes.as_chunks().0 {
        let at = u32::from_le_bytes([*low, *middle, *high, 0]) as usize % changed.len();
        changed[at] = *value;
    }
    let read = |file: &[u8]| of_team(|robot| replay(&mut Cursor::new(file), robot)).is_ok();
    assert!(read(&changed) || !bytes.is_empty());
    read(bytes);
}

/// Registers of a chip; what is written is there, and its clock goes on.
#[derive(Clone)]
struct Chip(Rc<RefCell<[u8; 256]>>);

impl Chip {
    fn new(id: u8) -> Self {
        let mut registers = [0; 256];
        registers[0] = id;
        Self(Rc::new(RefCell::new(registers)))
    }
}

impl ErrorType for Chip {
    type Error = std::convert::Infallible;
}

impl SpiDevice for Chip {
    async fn transaction(&mut self, all: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
        let (mut registers, mut at) = (self.0.borrow_mut(), 0);
        for operation in all {
            match operation {
                Operation::Write([register, value]) if *register < 0x80 => {
                    registers[usize::from(*register)] = *value;
                }
                Operation::Write(bytes) => at = usize::from(bytes[0] & 0x7F),
                Operation::Read(bytes) => {
                    registers[0x18] = registers[0x18].wrapping_add(1);
                    bytes.copy_from_slice(&registers[at..][..bytes.len()]);
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// No time goes by.
struct AtOnce;

impl DelayNs for AtOnce {
    async fn delay_ns(&mut self, _: u32) {}
}

/// A BMI088 whose registers say anything from some reading on: what it measures is finite, or an error.
pub fn bmi088(bytes: &[u8]) {
    let [accelerometer, gyroscope] = [0x1E, 0x0F].map(Chip::new);
    let mut imu = Bmi088::new(accelerometer.clone(), gyroscope.clone(), AtOnce, Config::default());
    for [which, register, value] in [[0; 3]].iter().chain(bytes.as_chunks().0) {
        if *which != 0 {
            let chip = if which & 1 == 0 { &accelerometer } else { &gyroscope };
            chip.0.borrow_mut()[usize::from(*register)] = *value;
        }
        let reading = pin!(imu.read());
        let Poll::Ready(read) = reading.poll(&mut Context::from_waker(Waker::noop())) else {
            panic!("it waits")
        };
        let Ok(sample) = read else { continue };
        let mut all = sample.rotation.into_iter().chain(sample.acceleration);
        assert!(all.all(|value| value.abs() < 1000.0), "{sample:?}");
        let temperature = sample.temperature.unwrap_or_default();
        assert!((-300.0..300.0).contains(&temperature), "{sample:?}");
    }
    assert!(imu.counters().starts > 0);
}

/// Channels that a PC may command, by their most.
const MOST: [f32; 4] = [1.5, 1.5, 4.0, 30.0];

/// What is known of a channel: the newest command that was taken, and until when the next one goes on from it.
#[derive(Clone, Copy, Default)]
struct Channel {
    newest: Option<(u32, u32)>,
    goes_on: u64,
    value: f32,
    ends: u64,
}

/// The identity of a robot, by which a command means it.
fn identity<N: Names>(shared: &Common<'_, N, impl Live>) -> Declaration {
    let places = |it: &rc10_motor::Slot| [it.on.bus().unwrap_or(0), it.on.line().unwrap_or(0)];
    let slots = N::SLOTS.iter();
    let mut sum = slots
        .fold(Declaration::default(), |sum, it| sum.with(it.label.as_bytes()).with(&places(it)));
    sum = sum.with(&[N::BUSES.len() as u8]).with(&[N::LINES]);
    shared.own.signals(&mut |it| sum = sum.with(it.label.as_bytes()));
    shared.own.parameters(&mut |it| sum = sum.with(it.label.as_bytes()));
    sum
}

/// Whether a command is taken, by the table in `docs/ros2.md`, and what is known then.
fn is_taken(
    all: &mut [Channel; 4],
    body: &[u8],
    robot: Declaration,
    armed: bool,
    now: u64,
) -> bool {
    let number = |from: usize, count: usize| {
        body[from..][..count].iter().rev().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte))
    };
    if body.len() < 28 || !body.len().is_multiple_of(4) || body[..2] != [0x7F, 1] {
        return false;
    }
    if number(4, 4) != u64::from(robot.0) {
        return false;
    }
    if !armed {
        all.iter_mut().for_each(|it| it.goes_on = 0);
        return false;
    }
    let values: Vec<_> =
        body[28..].as_chunks().0.iter().map(|word| f32::from_le_bytes(*word)).collect();
    let first = usize::from(body[18]);
    let (Some(known), Some(most)) =
        (all.get_mut(first..first + values.len()), MOST.get(first..first + values.len()))
    else {
        return false;
    };
    let (heard, age) = (number(8, 8), number(16, 2) * 1000);
    let (who, count) = (number(20, 4) as u32, number(24, 4) as u32);
    let is_late = heard > now || now - heard + age >= COMMAND_AGE;
    let is_other = |it: &Channel| it.newest.is_some_and(|it| it.0 != who);
    let is_old = |it: &Channel| {
        it.newest.is_some_and(|it| it.0 == who && count.wrapping_sub(it.1) as i32 <= 0)
    };
    let moves = values.iter().any(|it| *it != 0.0);
    let refuses = |it: &Channel| {
        is_old(it)
            || is_other(it) && now < it.goes_on
            || moves && (is_other(it) || now >= it.goes_on)
    };
    if is_late || values.iter().any(|it| !it.is_finite()) || known.iter().any(refuses) {
        return false;
    }
    let share = values.iter().zip(most).map(|(value, most)| most / value.abs()).fold(1.0, f32::min);
    for (it, value) in known.iter_mut().zip(values) {
        *it = Channel {
            newest: Some((who, count)),
            goes_on: now + LOST.get(),
            value: value * share,
            ends: heard.saturating_sub(age) + COMMAND_AGE,
        };
    }
    true
}

/// The robot's end of commands: of frames of anything with a good CRC, noise between them, and time that passes, it
/// takes what the table says and nothing else, refuses the rest by its number, drives by no command for longer than
/// 50 ms or beyond its limits, and hears a good command behind anything.
pub fn command(bytes: &[u8]) {
    let mut world = World::starting_at(Micros::from_millis(1000), 1);
    let auto = Auto::new(MOST.map(|most| AutoChannel::new("auto", "m/s", most)));
    let ports = team::Ports::new();
    let shared = team::Shared::new(&ports);
    let (robot, this) = (RobotView::new(&shared), identity(&shared));
    let mut all = [Channel::default(); 4];
    let mut line = Stream::new(WithCommands);
    let mut refused = 0;
    let mut hear = |sent: &[u8], now: Micros| {
        let mut last = None;
        line.receive(sent, now, |said| {
            let body = match &said {
                Said::Ask(_) => Vec::new(),
                Said::Command(body) => body.to_vec(),
            };
            let mut why = None;
            (&auto).hear(said, &robot, |_| {}, |id, text| why = Some((id, text)));
            if body.is_empty() {
                return assert_eq!(why, None);
            }
            let armed = shared.switch.state() == ArmState::Armed;
            let taken = is_taken(&mut all, &body, this, armed, now.get());
            assert_eq!(why.is_none(), taken, "{why:?}: {body:?}");
            if let Some((id, text)) = why {
                let byte = |at| body.get(at).copied().unwrap_or(0);
                assert!(id == u16::from_le_bytes([byte(2), byte(3)]) && !text.is_empty());
                refused += 1;
            }
            last = Some(taken);
        });
        let driven = auto.values(true).unwrap();
        assert!(auto.values(false).is_none());
        for ((driven, it), most) in driven.iter().zip(&all).zip(MOST) {
            let is_over = now.get() >= it.ends || it.goes_on == 0;
            let value: f32 = if is_over { 0.0 } else { it.value };
            assert!((driven - value).abs() <= 0.0, "{driven}, {value}");
            assert!(driven.abs() <= most * 1.000_001, "{driven}");
        }
        let mut told = f32::NAN;
        auto.signals(&mut |it| told = if it.label == "auto refused" { it.get() } else { told });
        assert_eq!(told.to_bits(), (refused as f32).to_bits());
        last
    };
    for piece in pieces(bytes) {
        let [pause, kind, rest @ ..] = piece else { continue };
        world.advance(world.now() + Micros::from_millis(u64::from(*pause)));
        match kind & 7 {
            7 => shared.switch.disarm(),
            _ => _ = shared.switch.arm(),
        }
        let now = world.now();
        match (kind >> 3 & 3, rest) {
            (0, _) => _ = hear(rest, now),
            (1, _) => _ = hear(&sound(&[&[0x7F], rest].concat()), now),
            (_, [ago, age, first, count, values @ ..]) => {
                let heard = now.get().wrapping_add_signed(-1000 * i64::from(*ago as i8));
                let (who, count) = (u32::from(kind >> 5), i32::from(*count as i8) as u32);
                let (id, age, first) = (u16::from(*ago), u16::from(*age), *first);
                let head = Head { id, declaration: this, heard, age, first, who, count };
                _ = hear(&sound(&[&head.bytes(), values].concat()), now);
            }
            _ => {}
        }
    }
    // What was begun may claim to be as long as the longest frame.
    world.advance(world.now() + LOST);
    _ = shared.switch.arm();
    hear(&[0; ASK + AROUND], world.now());
    let heard = world.now().get();
    let head = Head { declaration: this, heard, who: u32::MAX, count: 1, ..Head::default() };
    let sent = [sound(&[&head.bytes()[..], &[0; 16]].concat()), vec![0; ASK + AROUND]].concat();
    assert_eq!(hear(&sent, world.now()), Some(true), "a good command is not taken");
}
