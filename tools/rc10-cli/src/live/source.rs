//! Connections to a robot: at a port of this PC, over TCP, in the simulator, on the emulated chip; begun here or
//! kept running by another program.

use std::cell::OnceCell;
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use clap::Args;
use rc10_time::Micros;

use crate::args::{Injected, seed};
use crate::live::drive::{Driven, check_adapters};
use crate::live::line::{RobotConnection, Source};
use crate::live::port::{Port, is_missing, missing, open_port, plain, with_limits};
use crate::live::reach::{self, LocalRobot};
use crate::live::shared::Shared;
use crate::robot::build::Wanted;
use crate::run::board::{partner, program};
use crate::run::emulation::{Emulation, Setup};
use crate::run::running::Running;
use crate::run::simulation::Simulation;
use crate::terminal::tell;
use crate::world::console::{BAUD, ConsoleLine};
use crate::world::environment::Real;
use crate::world::robot::Robot;

/// Choice of a robot that runs.
#[derive(Args, Clone, Debug, Default)]
pub struct RunningArgs {
    /// The robot's serial port, such as /dev/ttyUSB0 or COM3; tcp:HOST:PORT of a serial server; or sim or emu, which
    /// another rc10 live keeps running, sim:8010 by its page [default: the only one that there is]
    #[arg(long, value_name = "PORT")]
    pub port: Option<String>,
    /// Bits a second of the console [default: what this robot's firmware has]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1200..=12_000_000))]
    pub baud: Option<u32>,
}

/// Choice of the robot's connection.
#[derive(Args, Clone, Debug, Default)]
pub struct SourceArgs {
    #[command(flatten)]
    pub(crate) running: RunningArgs,
    /// A robot in the simulator, begun for this
    #[arg(long, conflicts_with_all = ["emu", "port"])]
    pub sim: bool,
    /// The robot's firmware on the emulated chip, begun for this; without ELF it is built first
    #[arg(long, value_name = "ELF", num_args = 0..=1, conflicts_with = "port")]
    pub emu: Option<Option<PathBuf>>,
    /// Seed of everything random in the world
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = seed)]
    pub seed: u64,
    #[command(flatten)]
    pub(crate) injected: Injected,
    /// What is real, with its adapter: the robot's tasks run here.
    #[arg(skip)]
    pub(crate) real: Vec<(Real, String)>,
    /// Whether a robot is waited for that is not there yet.
    #[arg(skip)]
    pub(crate) waits: bool,
}

/// Choice of the robot's connection, with its port as the first argument.
#[derive(Args, Clone, Debug, Default)]
pub struct PlaceArgs {
    /// The robot's port; the same as --port
    #[arg(value_name = "PORT", conflicts_with_all = ["port", "sim", "emu"])]
    pub place: Option<String>,
    #[command(flatten)]
    pub(crate) named: SourceArgs,
}

impl PlaceArgs {
    /// The record that the first argument is.
    pub fn record(&self) -> Option<&Path> {
        let path = self.place.as_ref().map(Path::new);
        path.filter(|it| it.extension().is_some_and(|it| it.eq_ignore_ascii_case("mcap")))
    }

    /// The choice without the first argument.
    pub fn source(&self) -> SourceArgs {
        let mut source = self.named.clone();
        source.running.port = self.place.clone().or(source.running.port);
        source
    }
}

impl RunningArgs {
    /// Bit rate of a robot's console.
    pub fn baud_of(&self, robot: &Robot<'_>) -> u32 {
        self.baud.or(robot.description().console).unwrap_or(BAUD)
    }

    /// Opens the connection. Fails if it cannot be opened, with the reason and what helps.
    pub fn open(&self, robot: &Robot<'_>) -> Result<RobotConnection<'static>> {
        let connection = connect(self.place()?, self.baud_of(robot))?;
        self.tell(&connection.name);
        Ok(connection)
    }

    /// The connection to one that is not there yet, as why tells: it is tried as after a loss.
    fn wait(&self, why: &anyhow::Error, robot: &Robot<'_>) -> RobotConnection<'static> {
        tell(format_args!("{why:#}; it is waited for"));
        let (args, baud, found) = (self.clone(), self.baud_of(robot), OnceCell::new());
        let open = move || {
            // The robot that was found once is the one that is meant.
            let (place, name) = found.get().cloned().map_or_else(|| args.place(), Ok)?;
            let port = open_place(&place, baud)?;
            if found.set((place, name.clone())).is_ok() {
                args.tell(&name);
            }
            Ok(port)
        };
        let name = self.port.clone().unwrap_or_else(|| "the only robot".into());
        RobotConnection { source: Box::new(Wire::later(open, why)), name, baud, is_real: true }
    }

    /// Tells which robot is taken without being named.
    fn tell(&self, name: &str) {
        if self.port.is_none() {
            tell(format_args!("the only robot here: {name}"));
        }
    }

    /// The only place that is meant, with its name for people.
    fn place(&self) -> Result<(String, String)> {
        let places = self.places()?;
        only(if self.port.is_some() { places } else { likely(places)? })
    }

    /// Opens every connection that may be meant: a stop reaches one robot too many rather than one too few. Tells what
    /// cannot be opened, and fails if nothing can.
    pub fn open_all(&self, robot: &Robot<'_>) -> Result<Vec<RobotConnection<'static>>> {
        let (mut open, mut refused) = (Vec::new(), Vec::new());
        let places = self.places()?;
        if self.port.is_none() {
            // A built-in port opens without a robot behind it, and its refusal would hide that no robot was reached.
            likely(places.clone())?;
        }
        for place in places {
            match connect(place, self.baud_of(robot)) {
                Ok(connection) => open.push(connection),
                Err(why) => refused.push(why),
            }
        }
        let last = if open.is_empty() { refused.pop() } else { None };
        refused.iter().for_each(|why| tell(format_args!("NOT HEARD: {why:#}")));
        last.map_or(Ok(open), Err)
    }

    /// Ports that may be meant, with names for people.
    fn places(&self) -> Result<Vec<(String, String)>> {
        match &self.port {
            Some(port) if !reach::is_name(port) => Ok(vec![(port.clone(), port.clone())]),
            wanted => meant(wanted.as_deref(), all_places(wanted.is_none())),
        }
    }
}

fn connect((port, name): (String, String), baud: u32) -> Result<RobotConnection<'static>> {
    let source = Box::new(Wire::new(move || open_place(&port, baud))?);
    Ok(RobotConnection { source, name, baud, is_real: true })
}

fn open_place(port: &str, baud: u32) -> Result<Box<dyn Port>> {
    if reach::is_name(port) {
        let robot = reach::all().into_iter().find(|it| it.name == port);
        let stream = robot.with_context(|| format!("{port} has ended"))?.connect()?;
        return with_limits(stream, PATIENCE);
    }
    ensure!(
        !Path::new(port).is_file(),
        "{port}: a file, but no record (.mcap), and no serial port"
    );
    open_port(port, plain(baud), PATIENCE)
}

impl SourceArgs {
    /// Opens the connection. A simulation or emulation runs as fast as it can, or at this share of real
    /// time at most. Fails if it cannot be opened, with the reason and what helps.
    pub fn open<'r>(&self, robot: Robot<'r>, pace: Option<f64>) -> Result<RobotConnection<'r>> {
        if !self.real.is_empty() {
            return self.on_adapters(robot, pace.unwrap_or(1.0));
        }
        if self.sim {
            let (baud, mut robot) = (self.running.baud_of(&robot), robot);
            robot.inject(&self.injected, "--sim")?;
            robot.fit(false)?;
            let simulation = Simulation::new(robot, self.seed, Some(baud))?;
            let source = Box::new(Paced::new(simulation, pace)?);
            let name = "the simulated robot".into();
            return Ok(RobotConnection { source, name, baud, is_real: false });
        }
        if let Some(elf) = &self.emu {
            let baud = self.running.baud_of(&robot);
            let (emulation, path) = emulated(robot, elf.clone(), self)?;
            let name = format!("{} on the emulated chip", path.display());
            let source = Box::new(Paced::new(emulation, pace)?);
            return Ok(RobotConnection { source, name, baud, is_real: false });
        }
        ensure!(
            self.injected.faults.is_empty()
                && self.injected.mistakes.is_empty()
                && pace.is_none_or(|it| it >= 1.0),
            "--fault, --mistake and --pace are for --sim and --emu that are begun here"
        );
        match self.running.open(&robot) {
            Err(why) if self.waits && is_missing(&why) => Ok(self.running.wait(&why, &robot)),
            opened => opened,
        }
    }

    /// A robot that runs here, at adapters. Fails if an adapter cannot be opened, or nothing could arm it.
    fn on_adapters<'r>(&self, mut robot: Robot<'r>, pace: f64) -> Result<RobotConnection<'r>> {
        let (baud, ports) = (self.running.baud_of(&robot), robot.ports());
        robot.fit(false)?;
        let description = robot.description();
        ensure!(
            description.remote.is_some(),
            "this robot has no remote in its table: nothing could arm it"
        );
        check_adapters(&self.real, description)?;
        let names: Vec<_> = self.real.iter().map(|(what, at)| format!("{what} at {at}")).collect();
        let name = format!("the robot on this PC, {}", names.join(", "));
        let real: Vec<_> = self.real.iter().map(|(what, _)| *what).collect();
        let robot = Simulation::with(robot, 1, Some(baud), &real)?;
        let ends = robot.around.real.clone();
        let source = Box::new(Driven::new(robot, &self.real, &ends, ports, pace)?);
        Ok(RobotConnection { source, name, baud, is_real: false })
    }

    /// Opens the connection, not paced; the remote of a simulation or emulation lies there.
    pub(crate) fn open_disarmed<'r>(&self, robot: Robot<'r>) -> Result<RobotConnection<'r>> {
        let mut connection = self.open(robot, None)?;
        // Its script would arm the robot.
        if let Some(operator) = connection.source.world().and_then(|world| world.operator()) {
            operator.lay_down();
        }
        Ok(connection)
    }

    /// Opens the connection, paced. Shells reach what is begun here, by the port of its page.
    pub(super) fn open_for_shells<'r>(
        &self,
        robot: Robot<'r>,
        page: u16,
        pace: f64,
    ) -> Result<RobotConnection<'r>> {
        let RobotConnection { mut source, mut name, baud, is_real } =
            self.open(robot, Some(pace))?;
        let kind = match () {
            () if self.sim => "sim",
            () if self.real.is_empty() => "emu",
            () => "drive",
        };
        if !is_real {
            match LocalRobot::announce(format!("{kind}:{page}"), &name) {
                Ok((robot, listener)) => {
                    name = robot.to_string();
                    source = Box::new(Shared::new(source, listener, robot));
                }
                Err(why) => tell(format_args!("other shells do not reach this robot: {why:#}")),
            }
        }
        Ok(RobotConnection { source, name, baud, is_real })
    }
}

/// Ports at which a robot may be, with names for people: serial ones if wanted, and robots that run on this PC.
fn all_places(with_serial: bool) -> Vec<(String, String)> {
    let ports = serialport::available_ports().unwrap_or_default().into_iter();
    let ports = ports.filter(|_| with_serial).map(|it| (it.port_name.clone(), it.port_name));
    let running = reach::all().into_iter().map(|it| (it.name.clone(), it.to_string()));
    ports.chain(running).collect()
}

/// The places of a name, or of a kind; fails if there are none.
fn meant(wanted: Option<&str>, mut places: Vec<(String, String)>) -> Result<Vec<(String, String)>> {
    let is_it = |port: &str, wanted| port == wanted || port.split(':').next() == Some(wanted);
    places.retain(|(port, _)| wanted.is_none_or(|wanted| is_it(port, wanted)));
    ensure!(
        !places.is_empty(),
        missing(match wanted {
            Some(name) => format!("no robot `{name}` runs on this PC"),
            None => "no serial port is there, and no robot runs on this PC: plug the robot in, or begin with \
                     rc10 live --sim"
                .into(),
        })
    );
    Ok(places)
}

/// Places without the PC's built-in serial ports, at which a robot seldom is; fails if nothing else is there.
fn likely(places: Vec<(String, String)>) -> Result<Vec<(String, String)>> {
    let is_built_in = |port: &str| {
        let port = port.strip_prefix("/dev/").unwrap_or(port);
        let numbered = port.strip_prefix("ttyS").or_else(|| port.strip_prefix("ttyAMA"));
        numbered.is_some_and(|number| number.bytes().all(|it| it.is_ascii_digit()))
    };
    let (built_in, others): (Vec<_>, Vec<_>) =
        places.into_iter().partition(|(port, _)| is_built_in(port));
    let names: Vec<_> = built_in.into_iter().map(|(port, _)| port).collect();
    ensure!(
        !others.is_empty(),
        missing(format!(
            "only built-in ports are here, which are not taken by themselves: --port with one of {}",
            names.join(", ")
        ))
    );
    Ok(others)
}

/// The only place; fails with a list if there are more.
fn only(mut places: Vec<(String, String)>) -> Result<(String, String)> {
    let names: Vec<_> = places.iter().map(|(_, name)| name.as_str()).collect();
    ensure!(names.len() < 2, "which robot? --port with one of these: {}", names.join(", "));
    places.pop().context("no robot")
}

/// Puts a program into a chip: the robot's own firmware, unless one is named. Where it is, too.
fn emulated<'r>(
    mut robot: Robot<'r>,
    elf: Option<PathBuf>,
    args: &SourceArgs,
) -> Result<(Emulation<'r>, PathBuf)> {
    robot.fit(false)?;
    let (path, program) = program(elf.as_deref(), robot.description(), Wanted::default())?;
    let console = Some(args.running.baud_of(&robot));
    let Injected { faults, mistakes } = args.injected.clone();
    let partner = partner(robot.description(), Wanted::default())?;
    let setup = Setup { seed: args.seed, console, faults, mistakes, partner, ..Setup::default() };
    let named = || path.display().to_string();
    let mut emulation = Emulation::new(&program, robot, &setup).with_context(named)?;
    emulation.forgets = true;
    Ok((emulation, path))
}

/// A world that is not faster than the wall clock, or than a share of it.
struct Paced<W> {
    world: W,
    line: ConsoleLine,
    /// When the world began, by this clock; it is moved when the world cannot follow. And the share.
    began: Option<(Instant, f64)>,
}

const STEP: Micros = Micros::from_millis(4);
/// Largest delay behind the clock that is caught up.
const BEHIND: Duration = Duration::from_millis(100);

impl<W: Running> Paced<W> {
    fn new(world: W, pace: Option<f64>) -> Result<Self> {
        let line = world.console().cloned().context("no console")?;
        Ok(Self { world, line, began: pace.map(|it| (Instant::now(), it)) })
    }
}

impl<W: Running> Source for Paced<W> {
    fn exchange(&mut self, out: &[u8]) -> Result<(Vec<u8>, Micros)> {
        self.line.send(out);
        let until = self.world.now() + STEP;
        self.world.run_to(until)?;
        // A page shows what the robot tells, and no frames.
        drop(self.world.take_frames());
        if let Some((began, pace)) = &mut self.began {
            let due = *began + Duration::from_micros(until.get()).div_f64(*pace);
            let now = Instant::now();
            if now > due + BEHIND {
                *began += now - due;
            } else {
                std::thread::sleep(due.saturating_duration_since(now));
            }
        }
        Ok((self.line.take(), until))
    }

    fn world(&mut self) -> Option<&mut dyn Running> {
        Some(&mut self.world)
    }
}

/// Time limit of a read.
const PATIENCE: Duration = Duration::from_millis(4);
/// Period of attempts to open a port that is gone: a stop may wait for it.
const AGAIN: Duration = Duration::from_millis(100);
/// A port, which may go and come back.
struct Wire<F> {
    open: F,
    port: Option<Box<dyn Port>>,
    trouble: Option<String>,
    tried: Instant,
    began: Instant,
}

impl<F: Fn() -> Result<Box<dyn Port>>> Wire<F> {
    fn new(open: F) -> Result<Self> {
        let port = Some(open()?);
        let now = Instant::now();
        Ok(Self { open, port, trouble: None, tried: now, began: now })
    }

    /// One whose port is not there yet.
    fn later(open: F, why: &anyhow::Error) -> Self {
        let (trouble, now) = (Some(format!("{why:#}")), Instant::now());
        Self { open, port: None, trouble, tried: now, began: now }
    }

    fn try_exchange(&mut self, out: &[u8], bytes: &mut Vec<u8>) -> io::Result<()> {
        let Some(port) = &mut self.port else { return Ok(()) };
        port.write_all(out)?;
        let mut buffer = [0; 4096];
        match port.read(&mut buffer) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => {
                bytes.extend(&buffer[..count]);
                Ok(())
            }
            Err(error) => match error.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => Ok(()),
                _ => Err(error),
            },
        }
    }
}

impl<F: Fn() -> Result<Box<dyn Port>>> Source for Wire<F> {
    fn exchange(&mut self, out: &[u8]) -> Result<(Vec<u8>, Micros)> {
        let mut bytes = Vec::new();
        if let Err(error) = self.try_exchange(out, &mut bytes) {
            self.port = None;
            self.trouble = Some(format!("the port is gone ({error}); it is tried again and again"));
            self.tried = Instant::now();
        }
        if self.port.is_none() {
            std::thread::sleep(PATIENCE);
            if self.tried.elapsed() >= AGAIN {
                self.tried = Instant::now();
                match (self.open)() {
                    Ok(port) => (self.port, self.trouble) = (Some(port), None),
                    Err(error) => self.trouble = Some(format!("{error:#}")),
                }
            }
        }
        let now = self.began.elapsed().as_micros();
        Ok((bytes, Micros::new(u64::try_from(now).unwrap_or(u64::MAX))))
    }

    fn trouble(&self) -> Option<&str> {
        self.trouble.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A real robot is never taken for a simulated one, or the other way round.
    #[test]
    fn with_several_robots_none_is_chosen() {
        let of = |wanted, ports: &[&str]| {
            let places =
                ports.iter().map(|port| ((*port).to_owned(), format!("a robot at {port}")));
            let found = meant(wanted, places.collect());
            let found = found.and_then(|it| if wanted.is_none() { likely(it) } else { Ok(it) });
            let found = found.and_then(only);
            found.map_or_else(|why| why.to_string(), |(port, _)| port)
        };
        let real = "/dev/ttyUSB0";
        assert_eq!(of(None, &[real]), real);
        assert_eq!(of(None, &["sim:8010"]), "sim:8010");
        assert_eq!(of(None, &["/dev/ttyS0", real]), real);
        assert_eq!(of(None, &["/dev/ttyAMA10", "/dev/ttyACM0"]), "/dev/ttyACM0");
        let refused = of(None, &["/dev/ttyS0", "/dev/ttyS1"]);
        assert!(refused.contains("--port with one of /dev/ttyS0, /dev/ttyS1"), "{refused}");
        let both =
            "which robot? --port with one of these: a robot at /dev/ttyUSB0, a robot at sim:8010";
        assert_eq!(of(None, &[real, "sim:8010"]), both);
        let several = ["sim:8010", "sim:8011", "emu:8012"];
        assert_eq!(of(Some("emu"), &several), "emu:8012");
        assert_eq!(of(Some("sim:8011"), &several), "sim:8011");
        assert!(of(Some("sim"), &several).ends_with("a robot at sim:8010, a robot at sim:8011"));
        assert_eq!(of(Some("sim:801"), &several), "no robot `sim:801` runs on this PC");
        assert!(of(None, &[]).contains("plug the robot in"));
    }
}
