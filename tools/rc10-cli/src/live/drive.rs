//! A robot whose tasks run on this PC, on real buses behind slcan adapters or Linux' own CAN interfaces, on RS-485 lines
//! and a receiver of its own at serial ports.
//!
//! Its time is the clock's, in steps of a millisecond: each takes what the adapters have heard, lets the robot go on up
//! to now, and gives them what it sends. A PC keeps no time to the microsecond: the worst delay of a step is told. A
//! step that comes late is as long as it was late; so what has expired meanwhile has, and of what the robot would have
//! sent only the newest leaves. Behind a PC that stood still it is stopped; after one that slept it is disarmed, and when adapters are back that were gone at once.

use std::collections::BTreeMap;
use std::fs;
use std::io::{ErrorKind, Write as _};
use std::path::Path;
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant, SystemTime};

#[cfg(not(all(feature = "socketcan", target_os = "linux")))]
use anyhow::bail;
use anyhow::{Context, Result, ensure};
use rc10_module::remote::SerialSettings;
use rc10_motor::ArmState;
use rc10_motor::unitree::wire::line::COMMAND_LEN;
use rc10_sim::LineConfig;
use rc10_time::Micros;

use super::line::Source;
use super::port::{Port, open_port, plain};
use crate::formats::slcan::host::{CLOSE, HostCounts, OPEN};
use crate::robot::description::Description;
use crate::run::running::Running;
use crate::terminal::tell;
use crate::world::console::ConsoleLine;
use crate::world::environment::{Real, RealEnd};
use crate::world::ports::Ports;

/// Bits a second of an adapter at a UART; one at USB does not care.
const BAUD: u32 = 2_000_000;
/// Length of a step.
const STEP: Micros = Micros::from_millis(1);
/// Steps between two looks of the pages, which take some milliseconds: the step behind them is late.
const STEPS: u32 = 20;
/// Delay of a step from which on the robot is stopped.
const STALLED: Micros = Micros::from_millis(100);
/// Delay above which a step counts as late in a second of so many. Of twenty the one behind the pages is.
const LATE: Micros = Micros::from_millis(2);
const SECOND: u32 = 1000;
/// Period of attempts to open an adapter that is gone.
const AGAIN: Duration = Duration::from_millis(200);
/// Less than this the date may go on beyond the clock.
const NAP: Duration = Duration::from_secs(1);
/// Steps in which a robot that ends tells its motors so.
const LAST: u32 = 30;
/// Most milliseconds for which the adapter at a line may keep what it hears.
const KEPT: u32 = 2;
/// Where Linux has the settings of USB adapters.
const USB: &str = "/sys/bus/usb-serial/devices";

#[cfg(all(feature = "socketcan", target_os = "linux"))]
impl Port for crate::formats::slcan::socket::SocketPort {}

/// An adapter, which may go and come back.
struct Adapter {
    what: Real,
    at: String,
    end: RealEnd,
    settings: SerialSettings,
    port: Option<Box<dyn Port>>,
    /// What it has not taken yet, and what the robot has begun to say on a line.
    out: Vec<u8>,
    begun: Vec<u8>,
    /// Bytes that came, commands to a line that were too late to leave, and times without it.
    heard: u64,
    late: u64,
    gone: u64,
    tried: Instant,
    /// Where it is sought again: one in the network may take a second to say no.
    sought: Option<JoinHandle<Result<Box<dyn Port>>>>,
    trouble: Option<String>,
}

impl Adapter {
    fn open(what: Real, at: &str, end: RealEnd, settings: SerialSettings) -> Result<Self> {
        let port = open_adapter(what, at, settings)?;
        if settings.inverted {
            tell(format_args!(
                "{what}: this receiver is inverted, and no setting of a serial port turns it round: it needs an \
                 inverter, or an adapter that is set so"
            ));
        }
        let mut adapter = Self {
            what,
            at: at.to_owned(),
            end,
            settings,
            port: None,
            out: Vec::new(),
            begun: Vec::new(),
            heard: 0,
            late: 0,
            gone: 0,
            tried: Instant::now(),
            sought: None,
            trouble: None,
        };
        adapter.plug(port);
        Ok(adapter)
    }

    fn plug(&mut self, port: Box<dyn Port>) {
        self.port = Some(port);
        if let RealEnd::Frames(host) = &self.end {
            self.out = OPEN.to_vec();
            host.plug(true);
        }
    }

    /// What it has heard, for the robot.
    fn hear(&self, bytes: &[u8], at: Micros) {
        match &self.end {
            RealEnd::Frames(host) => host.hear(bytes, at),
            RealEnd::Bytes(line) => line.send(bytes),
        }
    }

    /// Looks whether one that is gone is there again, without waiting for it.
    fn seek(&mut self) {
        if let Some(sought) = self.sought.take_if(|it| it.is_finished()) {
            match sought.join() {
                Ok(Ok(port)) => {
                    self.trouble = None;
                    self.plug(port);
                }
                Ok(Err(why)) => self.trouble = Some(format!("{why:#}")),
                // The other buses go on.
                Err(_) => self.trouble = Some(format!("{}: it cannot be opened", self.at)),
            }
        } else if self.sought.is_none() && self.tried.elapsed() >= AGAIN {
            self.tried = Instant::now();
            let (what, at, settings) = (self.what, self.at.clone(), self.settings);
            self.sought = Builder::new().spawn(move || open_adapter(what, &at, settings)).ok();
        }
    }

    /// What came up to now.
    fn read(&mut self) -> Vec<u8> {
        if self.port.is_none() {
            self.seek();
        }
        let (mut buffer, mut bytes) = ([0; 4096], Vec::new());
        // What comes without end is read on in the next step.
        for _ in 0..16 {
            let Some(port) = &mut self.port else { break };
            match port.read(&mut buffer) {
                Ok(count @ 1..) => bytes.extend(&buffer[..count]),
                Ok(0) => self.lose(&ErrorKind::UnexpectedEof.into()),
                Err(error) if is_patience(&error) => break,
                Err(error) => self.lose(&error),
            }
        }
        self.heard += bytes.len() as u64;
        bytes
    }

    /// Gives it the newest frames, unless it has not taken those before: no old one is to leave.
    fn send(&mut self) {
        match &self.end {
            RealEnd::Frames(host) if self.out.is_empty() => host.write(&mut self.out),
            RealEnd::Frames(_) => {}
            RealEnd::Bytes(line) => {
                self.begun.extend(line.take());
                let commands = self.begun.len() / COMMAND_LEN;
                let said: Vec<_> = self.begun.drain(..commands * COMMAND_LEN).collect();
                self.late += commands as u64;
                // Behind one that waits in this PC it would be late.
                if commands > 0 && self.port.as_ref().is_some_and(|it| it.unsent() == 0) {
                    self.out = said[said.len() - COMMAND_LEN..].to_vec();
                    self.late -= 1;
                }
            }
        }
        while let (Some(port), false) = (&mut self.port, self.out.is_empty()) {
            match port.write(&self.out) {
                Ok(0) => break,
                Ok(count) => drop(self.out.drain(..count)),
                Err(error) if is_patience(&error) => break,
                Err(error) => self.lose(&error),
            }
        }
        if matches!(self.end, RealEnd::Bytes(_)) && !self.out.is_empty() {
            self.out.clear();
            self.late += 1;
        }
    }

    fn lose(&mut self, error: &std::io::Error) {
        self.trouble = Some(format!(
            "{}: the adapter {} is gone ({error}); it is tried again and again",
            self.what, self.at
        ));
        (self.port, self.tried) = (None, Instant::now());
        self.out.clear();
        self.gone += 1;
        if let RealEnd::Frames(host) = &self.end {
            host.plug(false);
        }
    }

    /// One in the network has its address to itself; a name of this PC may be another adapter's when it is back.
    fn is_gone(&self) -> bool {
        self.port.is_none() && !self.at.starts_with("tcp:")
    }

    /// Frames that the adapter of a bus refused.
    fn refused(&self) -> u64 {
        if let RealEnd::Frames(host) = &self.end { host.counts().refused } else { 0 }
    }
}

fn open_adapter(what: Real, at: &str, settings: SerialSettings) -> Result<Box<dyn Port>> {
    let is_interface =
        cfg!(target_os = "linux") && matches!(what, Real::Bus(_)) && !at.contains(['/', ':']);
    let port = if is_interface { interface(at) } else { open_port(at, settings, Duration::ZERO) };
    let port = port.with_context(|| what.to_string())?;
    if let Some(kept) = latency(Path::new(USB), at).filter(|it| *it > 1) {
        let name = at.rsplit('/').next().unwrap_or(at);
        let text = format!(
            "{what}: {at} keeps what it hears for {kept} ms: echo 1 | sudo tee {USB}/{name}/latency_timer"
        );
        match what {
            Real::Bus(_) => {}
            // Of the five milliseconds that a reply has.
            Real::Line(_) => ensure!(kept <= KEPT, "{text}"),
            Real::Receiver => tell(text),
        }
    }
    Ok(port)
}

/// Milliseconds for which an FTDI adapter keeps bytes before it hands them over.
fn latency(usb: &Path, at: &str) -> Option<u32> {
    let place = fs::canonicalize(at).ok()?;
    let kept = fs::read_to_string(usb.join(place.file_name()?).join("latency_timer")).ok()?;
    kept.trim().parse().ok()
}

#[cfg(all(feature = "socketcan", target_os = "linux"))]
fn interface(name: &str) -> Result<Box<dyn Port>> {
    let port = crate::formats::slcan::socket::SocketPort::open(name);
    let port = port.with_context(|| {
        format!("{name}: no CAN interface that is up; ip link set {name} up type can bitrate 1000000 restart-ms 100")
    })?;
    Ok(Box::new(port))
}

#[cfg(not(all(feature = "socketcan", target_os = "linux")))]
fn interface(name: &str) -> Result<Box<dyn Port>> {
    bail!(
        "{name}: this program was built without SocketCAN: cargo run --release --features socketcan -- drive. \
         A serial port is /dev/{name}"
    )
}

fn is_patience(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

/// A robot that runs here, at adapters.
pub(super) struct Driven<'r, W: Running> {
    robot: W,
    line: ConsoleLine,
    adapters: Vec<Adapter>,
    /// Several of them were gone at once, and not all are back: those that come may have exchanged their names.
    may_be_mixed: bool,
    ports: Ports<'r>,
    /// When it began, by this PC's clock, and the share of that clock's pace.
    began: (Instant, f64),
    /// By how much this PC's date has gone on beyond that clock, which stands while the PC sleeps.
    slept: Duration,
    dated: SystemTime,
    steps: u64,
    /// Steps that began later than half a millisecond, and the greatest delay.
    late: u64,
    worst: Micros,
    /// Steps of this second, and those of them that were [`LATE`]; what is said of the second before.
    second: [u32; 2],
    trouble: Option<String>,
}

/// Fails if the robot has no such bus or line, two of them have one adapter, or one has two.
pub(super) fn check_adapters(real: &[(Real, String)], robot: &Description) -> Result<()> {
    for (index, (what, at)) in real.iter().enumerate() {
        let lines = robot.lines.len() as u64;
        match *what {
            Real::Bus(bus) => {
                let most = robot.buses;
                ensure!((1..=most).contains(&bus), "--bus {bus}: the robot has buses 1 to {most}");
            }
            Real::Line(line) => {
                ensure!(lines > 0, "--line {line}: the robot has no RS-485 lines");
                let has = (1..=lines).contains(&line.into());
                ensure!(has, "--line {line}: the robot has lines 1 to {lines}");
                // Nothing says how long a network keeps a command.
                let is_here = !at.starts_with("tcp:");
                ensure!(is_here, "--line {line}={at}: a line needs a serial port of this PC");
            }
            Real::Receiver => {
                // It would stop the robot as late as it drives it.
                let is_here = !at.starts_with("tcp:");
                ensure!(is_here, "--remote {at}: a receiver needs a serial port of this PC");
                settings(*what, robot)?;
            }
        }
        let is_new = real[..index].iter().all(|(other, place)| other != what && place != at);
        ensure!(is_new, "{what} at {at}: one adapter for each bus, line and remote");
    }
    Ok(())
}

/// Settings of the serial port of this. Fails for a receiver that sends no bytes.
fn settings(what: Real, robot: &Description) -> Result<SerialSettings> {
    Ok(match what {
        Real::Bus(_) => plain(BAUD),
        Real::Line(_) => plain(LineConfig::default().baud),
        Real::Receiver => {
            let receiver = robot.remote.as_ref().map(|it| it.receiver).unwrap_or_default();
            receiver.serial().with_context(|| {
                format!("--remote: {receiver} sends pulses, which no serial port hears; --remote sbus=PORT")
            })?
        }
    })
}

impl<'r, W: Running> Driven<'r, W> {
    /// A robot at these adapters, whose ends it has. Fails without a console, or if an adapter cannot be opened.
    pub(super) fn new(
        robot: W,
        real: &[(Real, String)],
        ends: &BTreeMap<Real, RealEnd>,
        ports: Ports<'r>,
        pace: f64,
    ) -> Result<Self> {
        let open = |(what, at): &(Real, String)| {
            let end = ends.get(what).context("it has no end here")?.clone();
            Adapter::open(*what, at, end, settings(*what, robot.description())?)
        };
        let adapters = real.iter().map(open).collect::<Result<_>>()?;
        if cfg!(debug_assertions) {
            tell(
                "built to be compiled fast, ticks are late by 10 ms at times: cargo run --release -- drive",
            );
        }
        let line = robot.console().cloned().context("no console")?;
        Ok(Self {
            robot,
            line,
            adapters,
            may_be_mixed: false,
            ports,
            began: (Instant::now(), pace),
            slept: Duration::ZERO,
            dated: SystemTime::now(),
            steps: 0,
            late: 0,
            worst: Micros::ZERO,
            second: [0; 2],
            trouble: None,
        })
    }
}

impl<W: Running> Driven<'_, W> {
    fn disarm(&self) {
        if let Some(switch) = self.ports.switch {
            switch.disarm();
        }
    }

    /// Disarms, if an adapter is back that may be another one: before the robot's next tick.
    fn mistrust(&mut self, were_gone: &[bool]) {
        let were_gone = self.adapters.iter().zip(were_gone);
        // Also one that has just come, perhaps as the one that has just gone.
        let gone = were_gone.clone().filter(|(it, was_gone)| **was_gone || it.is_gone()).count();
        self.may_be_mixed = gone > 1 || gone == 1 && self.may_be_mixed;
        let mut back = were_gone.filter(|(it, was_gone)| **was_gone && !it.is_gone());
        if let (true, Some((Adapter { what, at, .. }, _))) = (self.may_be_mixed, back.next()) {
            tell(format_args!(
                "{what}: {at} is back, but not it alone was gone, and adapters may have exchanged their names: \
                 disarmed; names in /dev/serial/by-path stay with the USB socket"
            ));
            self.disarm();
        }
    }

    /// Notes whether a step was late: one of ten is a trouble.
    fn judge(&mut self, is_late: bool) {
        let [steps, late] = &mut self.second;
        (*steps, *late) = (*steps + 1, *late + u32::from(is_late));
        if *steps == SECOND {
            self.trouble = (*late > SECOND / 10).then(|| {
                format!("this PC is too slow or busy: {late} of {steps} steps came over 2 ms late")
            });
            self.second = [0; 2];
        }
    }

    fn step(&mut self) -> Result<()> {
        let before = self.robot.now();
        let (due, (began, pace)) = (before + STEP, self.began);
        sleep(Duration::from_micros(due.get()).div_f64(pace).saturating_sub(began.elapsed()));
        let now = began.elapsed().mul_f64(pace).as_micros();
        let now = Micros::new(u64::try_from(now)?).max(due);
        let delay = now.since(due);
        self.steps += 1;
        self.late += u64::from(delay.get() > 500);
        self.worst = self.worst.max(delay);
        if delay >= STALLED {
            // For so long its motors had their last commands, and no hand could stop them. What is stopped stays as it is.
            let switch = self
                .ports
                .switch
                .filter(|it| matches!(it.state(), ArmState::Armed | ArmState::Suspended));
            if let Some(switch) = switch {
                switch.emergency_stop();
                tell(format_args!("this PC stood still for {} ms: stopped", delay.get() / 1000));
            }
        }
        self.judge(delay > LATE);
        let were_gone: Vec<_> = self.adapters.iter().map(Adapter::is_gone).collect();
        let heard: Vec<_> = self.adapters.iter_mut().map(Adapter::read).collect();
        self.mistrust(&were_gone);
        // What came while this PC was late came all the time.
        let pieces = (now.since(before).get() / STEP.get()) as usize;
        for piece in 1..=pieces {
            let at = self.robot.now();
            for (adapter, bytes) in self.adapters.iter().zip(&heard) {
                let [from, to] = [piece - 1, piece].map(|it| bytes.len() * it / pieces);
                adapter.hear(&bytes[from..to], at);
            }
            self.robot.run_to(if piece == pieces { now } else { at + STEP })?;
        }
        drop(self.robot.take_frames());
        self.adapters.iter_mut().for_each(Adapter::send);
        Ok(())
    }
}

impl<W: Running> Source for Driven<'_, W> {
    fn exchange(&mut self, out: &[u8]) -> Result<(Vec<u8>, Micros)> {
        self.line.send(out);
        for _ in 0..STEPS {
            self.step()?;
        }
        let date = self.dated.elapsed().unwrap_or_default();
        if let Some(slept) = has_slept([date, self.began.0.elapsed(), self.slept]) {
            self.slept = slept;
            tell(format_args!("this PC slept, or its date was set: disarmed"));
            self.disarm();
        }
        Ok((self.line.take(), self.robot.now()))
    }

    fn trouble(&self) -> Option<&str> {
        self.adapters.iter().find_map(|it| it.trouble.as_deref()).or(self.trouble.as_deref())
    }

    fn world(&mut self) -> Option<&mut dyn Running> {
        Some(&mut self.robot)
    }
}

/// However it ends, its motors are told; but for a program that is killed, whose motors do what they do by themselves.
impl<W: Running> Drop for Driven<'_, W> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            return;
        }
        // A receiver could arm it again.
        for receiver in self.adapters.iter_mut().filter(|it| it.what == Real::Receiver) {
            (receiver.port, receiver.tried) = (None, Instant::now());
        }
        self.disarm();
        let refused = |it: &Self| -> Vec<_> { it.adapters.iter().map(Adapter::refused).collect() };
        let before = refused(self);
        for _ in 0..LAST {
            if self.step().is_err() {
                break;
            }
        }
        let took_all = before.into_iter().zip(refused(self)).map(|(before, now)| before == now);
        for (adapter, took_all) in self.adapters.iter_mut().zip(took_all) {
            let Adapter { what, at, end, port, .. } = adapter;
            let is_line = matches!(what, Real::Line(_));
            let has_left = port.as_ref().is_some_and(|it| it.unsent() == 0);
            if !took_all || is_line && !has_left {
                tell(format_args!(
                    "{what}: nothing took the last frames, and {at} may hold older ones, which drive: unplug it \
                     before its motors have power"
                ));
            }
            if let (Some(port), RealEnd::Frames(_)) = (port, end) {
                let _ = port.write_all(CLOSE).and_then(|()| port.flush());
            }
            tell(summary(adapter, &self.ports));
        }
        let Self { steps, late, worst, .. } = self;
        let worst = worst.get() as f64 * 1e-3;
        tell(format_args!(
            "{steps} ticks, {late} of them over 0.5 ms late, the worst {worst:.3} ms"
        ));
    }
}

fn summary(adapter: &Adapter, ports: &Ports<'_>) -> String {
    let Adapter { what, end, heard, late, gone, .. } = adapter;
    let mut losses = vec![(*gone, "times without the adapter")];
    let line = if let Real::Line(it) = what { ports.lines.get(usize::from(*it) - 1) } else { None };
    let went = match (end, line) {
        (RealEnd::Frames(host), _) => {
            let HostCounts { heard, sent, refused, malformed } = host.counts();
            losses.push((refused, "frames refused by the adapter"));
            losses.push((malformed, "lines of it that are no frames"));
            format!("{heard} frames heard, {sent} sent")
        }
        (_, Some(line)) => {
            let traffic = line.status().traffic;
            losses.push((traffic.timeouts.into(), "commands without a reply in time"));
            losses.push((*late, "commands too late, not sent"));
            let mean = f64::from(traffic.exchange.mean().unwrap_or(0.0)) * 1e-3;
            format!("{} commands answered, after {mean:.1} ms on average", traffic.exchanges)
        }
        _ => format!("{heard} bytes heard"),
    };
    let losses: Vec<_> = losses.iter().filter(|(count, _)| *count > 0).collect();
    let lost: Vec<_> = losses.iter().map(|(count, what)| format!("{count} {what}")).collect();
    let lost = if lost.is_empty() { "nothing lost".into() } else { lost.join(", ") };
    format!("{what}: {went}, {lost}")
}

/// How long this PC has slept in all by its date and its clock, if that is longer than was known.
fn has_slept([date, clock, known]: [Duration; 3]) -> Option<Duration> {
    let slept = date.saturating_sub(clock);
    (slept > known + NAP).then_some(slept)
}

#[cfg(test)]
mod tests {
    use std::env::temp_dir;
    use std::io::{Read, Result as IoResult, Write};
    use std::net::TcpListener;
    use std::sync::{Arc, Mutex};

    use rc10_sim::World;

    use super::*;

    /// A port that takes so many bytes, of which so many have not left.
    #[derive(Clone, Default)]
    struct Slow(Arc<Mutex<(usize, u32, Vec<u8>)>>);

    impl Read for Slow {
        fn read(&mut self, _: &mut [u8]) -> IoResult<usize> {
            Err(ErrorKind::TimedOut.into())
        }
    }

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> IoResult<usize> {
            let (room, _, taken) = &mut *self.0.lock().unwrap();
            let count = bytes.len().min(*room);
            *room -= count;
            taken.extend(&bytes[..count]);
            if count > 0 { Ok(count) } else { Err(ErrorKind::TimedOut.into()) }
        }

        fn flush(&mut self) -> IoResult<()> {
            Ok(())
        }
    }

    impl Port for Slow {
        fn unsent(&self) -> u32 {
            self.0.lock().unwrap().1
        }
    }

    #[test]
    fn of_commands_to_a_line_the_newest_leaves_in_time_or_none() {
        let mut world = World::new(1);
        let line = ConsoleLine::new(&mut world, 4_000_000);
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let at = format!("tcp:{}", listener.local_addr().unwrap());
        let end = RealEnd::Bytes(line.clone());
        let mut adapter = Adapter::open(Real::Line(1), &at, end, plain(4_000_000)).unwrap();
        let port = Slow::default();
        adapter.port = Some(Box::new(port.clone()));
        let mut step = |commands: &[u8], micros, room, unsent| {
            for command in commands {
                line.serial().port().send(&[*command; COMMAND_LEN]);
            }
            let until = world.now() + Micros::new(micros);
            world.advance(until);
            *port.0.lock().unwrap() = (room, unsent, Vec::new());
            adapter.send();
            (std::mem::take(&mut port.0.lock().unwrap().2), adapter.late)
        };
        let whole = |command| vec![command; COMMAND_LEN];
        assert_eq!(step(&[1], 1000, 100, 0), (whole(1), 0));
        assert_eq!(step(&[], 1000, 100, 0), (vec![], 0));
        // A step that was late: the older two have expired.
        assert_eq!(step(&[2, 3, 4], 1000, 100, 0), (whole(4), 2));
        // One waits in this PC; nothing is put behind it, and nothing later than the newest.
        assert_eq!(step(&[5], 1000, 100, 17), (vec![], 3));
        assert_eq!(step(&[], 1000, 100, 0), (vec![], 3));
        // A port that is full, or becomes so: the rest of a command never follows.
        assert_eq!(step(&[6], 1000, 0, 0), (vec![], 4));
        assert_eq!(step(&[7], 1000, 9, 0), (vec![7; 9], 5));
        assert_eq!(step(&[8], 1000, 100, 0), (whole(8), 5));
        // Said in two steps.
        assert_eq!(step(&[9], 20, 100, 0), (vec![], 5));
        assert_eq!(step(&[], 1000, 100, 0), (whole(9), 5));
        // Gone meanwhile.
        adapter.lose(&ErrorKind::UnexpectedEof.into());
        line.serial().port().send(&whole(10));
        world.advance(Micros::from_millis(20));
        adapter.send();
        adapter.port = Some(Box::new(port.clone()));
        adapter.send();
        assert_eq!((port.0.lock().unwrap().2.len(), adapter.late, adapter.gone), (0, 6, 1));
    }

    #[cfg(unix)]
    #[test]
    fn how_long_an_adapter_keeps_bytes_is_read_also_behind_a_link() {
        let folder = temp_dir().join(format!("rc10-latency-{}", std::process::id()));
        let (usb, dev) = (folder.join("usb"), folder.join("dev"));
        fs::create_dir_all(usb.join("ttyUSB3")).unwrap();
        fs::create_dir_all(&dev).unwrap();
        fs::write(usb.join("ttyUSB3/latency_timer"), "16\n").unwrap();
        let _ = ["ttyUSB3", "ttyACM0"].map(|it| fs::write(dev.join(it), "").unwrap());
        std::os::unix::fs::symlink("ttyUSB3", dev.join("leg")).unwrap();
        let kept = |name: &str| latency(&usb, dev.join(name).to_str().unwrap());
        assert_eq!(
            ["ttyUSB3", "leg", "ttyACM0", "none"].map(kept),
            [Some(16), Some(16), None, None]
        );
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_nap_is_told_once() {
        let told =
            |times: [u64; 3]| has_slept(times.map(Duration::from_millis)).map(|it| it.as_millis());
        assert_eq!(told([5000, 5000, 0]), None);
        // A date that is set right.
        assert_eq!(told([5900, 5000, 0]), None);
        assert_eq!(told([4000, 5000, 0]), None);
        assert_eq!(told([65_000, 5000, 0]), Some(60_000));
        assert_eq!(told([66_000, 6000, 60_000]), None);
        assert_eq!(told([69_000, 6000, 60_000]), Some(63_000));
    }
}
