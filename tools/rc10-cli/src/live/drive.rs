//! A robot whose tasks run on this PC, on real buses behind slcan adapters or Linux' own CAN interfaces.
//!
//! Its time is the clock's, in steps of a millisecond: each takes what the adapters have heard, lets the robot go on up
//! to now, and gives them what it sends. A PC keeps no time to the microsecond: the worst delay of a step is told. A
//! step that comes late is as long as it was late; so what has expired meanwhile has, and of what the robot would have
//! sent only the newest leaves. After a PC that slept it is disarmed.

use std::io::{ErrorKind, Write as _};
use std::thread::{Builder, JoinHandle, sleep};
use std::time::{Duration, Instant, SystemTime};

#[cfg(not(all(feature = "socketcan", target_os = "linux")))]
use anyhow::bail;
use anyhow::{Context, Result, ensure};
use rc10_motor::ArmSwitch;
use rc10_time::Micros;

use super::line::Source;
use super::port::{Port, open_port};
use crate::formats::slcan::host::{CLOSE, HostCounts, HostPort, OPEN};
use crate::run::running::Running;
use crate::terminal::tell;
use crate::world::console::ConsoleLine;

/// Bits a second of an adapter at a UART; one at USB does not care.
const BAUD: u32 = 2_000_000;
/// Length of a step.
const STEP: Micros = Micros::from_millis(1);
/// Steps between two looks of the pages, which take some milliseconds: the step behind them is late.
const STEPS: u32 = 20;
/// Period of attempts to open an adapter that is gone.
const AGAIN: Duration = Duration::from_millis(200);
/// Less than this the date may go on beyond the clock.
const NAP: Duration = Duration::from_secs(1);
/// Steps in which a robot that ends tells its motors so.
const LAST: u32 = 30;

/// An adapter, which may go and come back.
pub(super) struct Adapter {
    pub(super) bus: u8,
    pub(super) at: String,
    pub(super) host: HostPort,
    port: Option<Box<dyn Port>>,
    /// What it has not taken yet.
    out: Vec<u8>,
    tried: Instant,
    /// Where it is sought again: one in the network may take a second to say no.
    sought: Option<JoinHandle<Result<Box<dyn Port>>>>,
    trouble: Option<String>,
}

impl Adapter {
    fn open(bus: u8, at: &str) -> Result<Self> {
        let (at, host, out) = (at.to_owned(), HostPort::default(), Vec::new());
        let (tried, sought, trouble) = (Instant::now(), None, None);
        let mut adapter = Self { bus, at, host, port: None, out, tried, sought, trouble };
        adapter.plug(open_adapter(bus, &adapter.at)?);
        Ok(adapter)
    }

    fn plug(&mut self, port: Box<dyn Port>) {
        self.port = Some(port);
        self.out = OPEN.to_vec();
        self.host.plug(true);
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
            let (bus, at) = (self.bus, self.at.clone());
            self.sought = Builder::new().spawn(move || open_adapter(bus, &at)).ok();
        }
    }

    /// What came up to now.
    fn read(&mut self) -> Vec<u8> {
        if self.port.is_none() {
            self.seek();
        }
        let (mut buffer, mut bytes) = ([0; 4096], Vec::new());
        while let Some(port) = &mut self.port {
            match port.read(&mut buffer) {
                Ok(count @ 1..) => bytes.extend(&buffer[..count]),
                Ok(0) => self.lose(&ErrorKind::UnexpectedEof.into()),
                Err(error) if is_patience(&error) => break,
                Err(error) => self.lose(&error),
            }
        }
        bytes
    }

    /// Gives it the newest frames, unless it has not taken those before: no old one is to leave.
    fn send(&mut self) {
        if self.out.is_empty() {
            self.host.write(&mut self.out);
        }
        while let (Some(port), false) = (&mut self.port, self.out.is_empty()) {
            match port.write(&self.out) {
                Ok(0) => break,
                Ok(count) => drop(self.out.drain(..count)),
                Err(error) if is_patience(&error) => break,
                Err(error) => self.lose(&error),
            }
        }
    }

    fn lose(&mut self, error: &std::io::Error) {
        self.trouble = Some(format!(
            "bus {}: the adapter {} is gone ({error}); it is tried again and again",
            self.bus, self.at
        ));
        (self.port, self.tried) = (None, Instant::now());
        self.out.clear();
        self.host.plug(false);
    }
}

fn open_adapter(bus: u8, at: &str) -> Result<Box<dyn Port>> {
    let is_interface = cfg!(target_os = "linux") && !at.contains(['/', ':']);
    let port = if is_interface { interface(at) } else { open_port(at, BAUD, Duration::ZERO) };
    port.with_context(|| format!("bus {bus}"))
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

/// A robot that runs here, on real buses.
pub(super) struct Driven<'r, W: Running> {
    robot: W,
    line: ConsoleLine,
    adapters: Vec<Adapter>,
    switch: Option<&'r ArmSwitch>,
    /// When it began, by this PC's clock, and the share of that clock's pace.
    began: (Instant, f64),
    /// By how much this PC's date has gone on beyond that clock, which stands while the PC sleeps.
    slept: Duration,
    dated: SystemTime,
    steps: u64,
    /// Steps that began later than half a millisecond, and the greatest delay.
    late: u64,
    worst: Micros,
}

/// Opens the adapters of buses 1 to `most`; fails if one cannot be opened, or has not a bus of its own.
pub(super) fn open_adapters(buses: &[(u8, String)], most: u8) -> Result<Vec<Adapter>> {
    let mut adapters: Vec<Adapter> = Vec::new();
    for (bus, at) in buses {
        ensure!((1..=most).contains(bus), "--bus {bus}: the robot has buses 1 to {most}");
        let is_new = adapters.iter().all(|it| it.bus != *bus && it.at != *at);
        ensure!(is_new, "--bus {bus}={at}: one adapter for each bus");
        adapters.push(Adapter::open(*bus, at)?);
    }
    Ok(adapters)
}

impl<'r, W: Running> Driven<'r, W> {
    /// A robot whose buses have these adapters, and what disarms it. Fails without a console.
    pub(super) fn new(
        robot: W,
        adapters: Vec<Adapter>,
        switch: Option<&'r ArmSwitch>,
        pace: f64,
    ) -> Result<Self> {
        if cfg!(debug_assertions) {
            tell(
                "built to be compiled fast, ticks are late by 10 ms at times: cargo run --release -- drive",
            );
        }
        let line = robot.console().cloned().context("no console")?;
        let (began, dated) = ((Instant::now(), pace), SystemTime::now());
        let (slept, worst) = (Duration::ZERO, Micros::ZERO);
        Ok(Self { robot, line, adapters, switch, began, slept, dated, steps: 0, late: 0, worst })
    }
}

impl<W: Running> Driven<'_, W> {
    fn disarm(&self) {
        if let Some(switch) = self.switch {
            switch.disarm();
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
        let heard: Vec<_> = self.adapters.iter_mut().map(Adapter::read).collect();
        // What came while this PC was late came all the time.
        let pieces = (now.since(before).get() / STEP.get()) as usize;
        for piece in 1..=pieces {
            let at = self.robot.now();
            for (adapter, bytes) in self.adapters.iter().zip(&heard) {
                let [from, to] = [piece - 1, piece].map(|it| bytes.len() * it / pieces);
                adapter.host.hear(&bytes[from..to], at);
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
        self.adapters.iter().find_map(|it| it.trouble.as_deref())
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
        self.disarm();
        let refused = |it: &Self| -> Vec<_> {
            it.adapters.iter().map(|it| it.host.counts().refused).collect()
        };
        let before = refused(self);
        for _ in 0..LAST {
            if self.step().is_err() {
                break;
            }
        }
        let took_all = before.into_iter().zip(refused(self)).map(|(before, now)| before == now);
        for (Adapter { bus, at, host, port, .. }, took_all) in
            self.adapters.iter_mut().zip(took_all)
        {
            if !took_all {
                tell(format_args!(
                    "bus {bus}: nothing took the last frames, and {at} may hold older ones, which drive: unplug it \
                     before its motors have power"
                ));
            }
            if let Some(port) = port {
                let _ = port.write_all(CLOSE).and_then(|()| port.flush());
            }
            tell(summary(*bus, &host.counts()));
        }
        let Self { steps, late, worst, .. } = self;
        let worst = worst.get() as f64 * 1e-3;
        tell(format_args!(
            "{steps} ticks, {late} of them over 0.5 ms late, the worst {worst:.3} ms"
        ));
    }
}

fn summary(bus: u8, counts: &HostCounts) -> String {
    let HostCounts { heard, sent, refused, malformed, gone } = *counts;
    let losses = [
        (refused, "frames refused by the adapter"),
        (malformed, "lines of it that are no frames"),
        (gone, "times without the adapter"),
    ];
    let losses: Vec<_> = losses.iter().filter(|(count, _)| *count > 0).collect();
    let lost: Vec<_> = losses.iter().map(|(count, what)| format!("{count} {what}")).collect();
    let lost = if lost.is_empty() { "nothing lost".into() } else { lost.join(", ") };
    format!("bus {bus}: {heard} frames heard, {sent} sent, {lost}")
}

/// How long this PC has slept in all by its date and its clock, if that is longer than was known.
fn has_slept([date, clock, known]: [Duration; 3]) -> Option<Duration> {
    let slept = date.saturating_sub(clock);
    (slept > known + NAP).then_some(slept)
}

#[cfg(test)]
mod tests {
    use super::*;

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
