//! A robot as the tools see it: plain data that say what its motors are and what surrounds them,
//! and the running part that a robot crate hands over.

use std::fmt;
use std::path::PathBuf;
use std::pin::Pin;
use std::rc::Rc;

use anyhow::{Context, Result, anyhow, bail, ensure};
use rc10_can::Micros;
use rc10_module::Reception;
use rc10_motor::dji::{self, FeedbackRate, Model};
use rc10_motor::embassy::{BusPort, MotorPort, Rs485Port, run_bus, run_rs485};
use rc10_motor::rc10_app::Direction;
use rc10_motor::signals::Message;
use rc10_motor::unitree::Rs485Bus;
use rc10_motor::{ArmSwitch, Loops, MotorBus, MotorId, MotorName, Verdict};
use rc10_sim::fault::Kind;
use rc10_sim::{
    Esc, EscConfig, EscState, Fault, Faults, LineMotor, Plant, Serial, Tasks, UartPort, World,
};

use crate::mistake::{Built, Mistake};
use crate::recording::Event;
use crate::remote::{Line, Lost, Receiver, ReceiverPort, RemoteControl};
use crate::surroundings::Surroundings;

/// What the tools must know of a robot before it runs.
#[derive(Clone, Debug, Default)]
pub struct Description {
    /// All motors; those of one bus in the order in which they are attached to it.
    pub motors: Vec<Motor>,
    /// How many buses it has: their numbers are 1 to this.
    pub buses: u8,
    /// How many RS-485 lines it has: their numbers are 1 to this.
    pub lines: u8,
    /// What its wheels carry, if that shall be simulated.
    pub base: Option<Base>,
    /// Its remote control, if it has one, and what somebody does with it.
    pub remote: Option<RemoteControl>,
    /// What else is on its UARTs.
    pub serials: Vec<SerialPart>,
    /// What it does by itself, to be named in reports.
    pub script: Script,
    /// Builds its firmware and says where the ELF file is. `None`: `rc10 emu` must be told.
    pub firmware: Option<fn() -> Result<PathBuf>>,
    /// What goes wrong around it in this run: [`Robot::set_faults`].
    pub faults: Vec<Fault>,
    /// What is built otherwise than described: [`Robot::set_mistakes`].
    pub mistakes: Vec<Mistake>,
    /// The buses' logs are hashed, and not kept: [`Robot::set_no_logs`].
    pub no_logs: bool,
}

/// One motor of a robot, and what is on its shaft.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    /// What people call it. Motors whose labels begin with the same word share a plot.
    pub label: &'static str,
    /// What it is plugged into.
    pub on: Place,
    /// Which motor it is.
    pub device: Device,
    /// Which way the robot counts.
    pub direction: Direction,
    /// Inertia of what is on its output shaft, kg m². The wheels of a [`Base`] get theirs from it.
    pub inertia: f64,
    /// Constant torque on its output shaft from outside, such as a weight, N m; positive the way
    /// the robot counts.
    pub load: f64,
    /// Hard stops of a motor on a bus: the angles between which its output shaft turns, degrees since
    /// power-on the way the robot counts. The floor under a lift, for example. `None`: for ever.
    pub travel: Option<[f64; 2]>,
    /// Its safe state is to hold or to brake: it may be driven while the robot is stopped.
    pub holds: bool,
}

/// A part on a UART of the robot.
#[derive(Clone, Copy, Debug)]
pub struct SerialPart {
    /// What people call it.
    pub label: &'static str,
    /// The chip's UART: 1 for USART1.
    pub uart: u8,
    /// Puts its simulated twin at the end of a link.
    pub twin: fn(world: &mut World, base: Option<&rc10_sim::Base>) -> Result<Serial>,
}

/// What a motor is plugged into; the first of each sort is 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A CAN bus.
    Bus(u8),
    /// An RS-485 line.
    Line(u8),
}

impl Place {
    /// For a narrow column: `2`, or `L1` for a line.
    #[must_use]
    pub fn short(self) -> String {
        match self {
            Self::Bus(number) => number.to_string(),
            Self::Line(number) => format!("L{number}"),
        }
    }

    /// The number of the bus, if it is one.
    #[must_use]
    pub const fn bus(self) -> Option<u8> {
        match self {
            Self::Bus(number) => Some(number),
            Self::Line(_) => None,
        }
    }

    /// The number of the line, if it is one.
    #[must_use]
    pub const fn line(self) -> Option<u8> {
        match self {
            Self::Bus(_) => None,
            Self::Line(number) => Some(number),
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(number) => write!(f, "bus {number}"),
            Self::Line(number) => write!(f, "line {number}"),
        }
    }
}

/// Which motor it is, for the simulator and for tables.
#[derive(Clone, Copy, Debug)]
pub enum Device {
    /// One of DJI's.
    Dji {
        /// Which one.
        model: &'static Model,
        /// The identifier set on it.
        id: u8,
        /// The feedback rate set on it.
        rate: FeedbackRate,
    },
    /// Any other on a CAN bus.
    Can {
        /// What the bus calls it.
        name: MotorName,
        /// Puts its simulated twin on a wire, with so much inertia (kg m²) on its shaft.
        twin: fn(wire: &rc10_sim::Bus, inertia: f64) -> Result<Esc>,
        /// What stands where in its frames.
        messages: fn() -> Vec<Message>,
        /// What no DBC file can say of them: a sentence each.
        not_in_dbc: &'static [&'static str],
    },
    /// One on an RS-485 line.
    Line {
        /// What the line calls it.
        name: MotorName,
        /// Puts its simulated twin on a line, with so much inertia (kg m²) on its shaft.
        twin: fn(line: &rc10_sim::Line, inertia: f64) -> Result<LineMotor>,
    },
}

impl Motor {
    /// A motor of DJI on a bus (the first one is 1) that counts forward, speaks 1000 times a second,
    /// and has a bare shaft.
    #[must_use]
    pub const fn new(label: &'static str, bus: u8, model: &'static Model, id: u8) -> Self {
        let device = Device::Dji { model, id, rate: FeedbackRate::Hz1000 };
        Self::with_device(label, Place::Bus(bus), device)
    }

    /// Any motor that counts forward and has a bare shaft.
    #[must_use]
    pub const fn with_device(label: &'static str, on: Place, device: Device) -> Self {
        let direction = Direction::Forward;
        Self { label, on, device, direction, inertia: 0.0, load: 0.0, travel: None, holds: false }
    }

    /// What buses and tables call it.
    #[must_use]
    pub const fn name(&self) -> MotorName {
        match self.device {
            Device::Dji { model, id, .. } => MotorName { model: model.name, id: id as u16 },
            Device::Can { name, .. } | Device::Line { name, .. } => name,
        }
    }

    /// Model and identifier, if it is one of DJI's.
    #[must_use]
    pub const fn dji(&self) -> Option<(&'static Model, u8)> {
        match self.device {
            Device::Dji { model, id, .. } => Some((model, id)),
            Device::Can { .. } | Device::Line { .. } => None,
        }
    }

    /// What stands where in its frames.
    #[must_use]
    pub fn messages(&self) -> Vec<Message> {
        match self.device {
            Device::Dji { model, id, .. } => {
                dji::signals::messages(model, id).into_iter().flatten().collect()
            }
            Device::Line { .. } => Vec::new(),
            Device::Can { messages, .. } => messages(),
        }
    }

    /// What no DBC file can say of its frames: a sentence each.
    #[must_use]
    pub const fn not_in_dbc(&self) -> &'static [&'static str] {
        match self.device {
            Device::Dji { .. } => dji::signals::NOT_IN_DBC,
            Device::Can { not_in_dbc, .. } => not_in_dbc,
            Device::Line { .. } => &[],
        }
    }

    /// Whether its twin obeys another command than to coast.
    pub(crate) fn is_driven(&self, twin: &Twin) -> bool {
        let state = twin.state();
        // Those of DJI are told a current, or a voltage; the others what to do.
        if self.dji().is_some() { state.command != 0 } else { !state.open }
    }

    /// 1 if it counts as the motor does, -1 if the other way.
    pub(crate) fn sign(&self) -> f64 {
        self.direction.sign().into()
    }

    /// Puts its simulated twin where it belongs: on one of the wires or lines.
    ///
    /// # Errors
    /// If there is no such bus or line, the device is not made for it, there is no simulated ESC
    /// for its model, or its identifier is none.
    pub fn plug_in(&self, wires: &[rc10_sim::Bus], lines: &[rc10_sim::Line]) -> Result<Twin> {
        let index = |number: u8| usize::from(number).checked_sub(1);
        let nowhere = || format!("there is no {}", self.on);
        let twin = match self.on {
            Place::Bus(number) => {
                let wire = index(number).and_then(|at| wires.get(at)).with_context(nowhere)?;
                Twin::Esc(match self.device {
                    Device::Dji { model, id, rate } => {
                        wire.add_esc(dji_twin(model, id, rate, self.inertia)?)?
                    }
                    Device::Can { twin, .. } => twin(wire, self.inertia)?,
                    Device::Line { .. } => bail!("it has no CAN: {} is nothing for it", self.on),
                })
            }
            Place::Line(number) => {
                let line = index(number).and_then(|at| lines.get(at)).with_context(nowhere)?;
                match self.device {
                    Device::Line { twin, .. } => Twin::Line(twin(line, self.inertia)?),
                    _ => bail!("it has only CAN: {} is nothing for it", self.on),
                }
            }
        };
        twin.set_load(self.sign() * self.load);
        if let (Some(esc), Some(mut travel)) = (twin.esc(), self.travel) {
            travel = travel.map(|end| self.sign() * end);
            travel.sort_by(f64::total_cmp);
            esc.set_travel(Some(travel));
        }
        Ok(twin)
    }
}

/// The simulated twin of a motor.
#[derive(Clone)]
pub enum Twin {
    /// On a CAN bus.
    Esc(Esc),
    /// On an RS-485 line.
    Line(LineMotor),
}

impl Twin {
    /// What is true now (of the mechanics: at the last physics step).
    #[must_use]
    pub fn state(&self) -> EscState {
        match self {
            Self::Esc(esc) => esc.state(),
            Self::Line(motor) => motor.state(),
        }
    }

    /// Its motor, gearbox and load; a wheel of a base with its wheel, without the base.
    #[must_use]
    pub fn plant(&self) -> Plant {
        match self {
            Self::Esc(esc) => esc.plant(),
            Self::Line(motor) => motor.plant(),
        }
    }

    /// A constant torque on the output shaft from outside, N m, the way the device counts.
    pub fn set_load(&self, torque: f64) {
        match self {
            Self::Esc(esc) => esc.set_load(torque),
            Self::Line(motor) => motor.set_load(torque),
        }
    }

    /// The ESC, if it is on a bus.
    #[must_use]
    pub const fn esc(&self) -> Option<&Esc> {
        match self {
            Self::Esc(esc) => Some(esc),
            Self::Line(_) => None,
        }
    }
}

fn dji_twin(model: &Model, id: u8, rate: FeedbackRate, inertia: f64) -> Result<EscConfig> {
    let twin = match model {
        model if *model == dji::M3508 => rc10_sim::Model::C620,
        model if *model == dji::M2006 => rc10_sim::Model::C610,
        model if *model == dji::GM6020_CURRENT => rc10_sim::Model::Gm6020Current,
        model if *model == dji::GM6020_VOLTAGE => rc10_sim::Model::Gm6020Voltage,
        model => bail!("no simulated ESC for a {}", model.name),
    };
    let mut config = EscConfig::new(twin, id);
    config.plant = config.plant.with_load_inertia(inertia);
    config.rate = match rate {
        FeedbackRate::Hz1000 => rc10_sim::FeedbackRate::Hz1000,
        FeedbackRate::Hz500 => rc10_sim::FeedbackRate::Hz500,
        FeedbackRate::Hz250 => rc10_sim::FeedbackRate::Hz250,
        FeedbackRate::Hz125 => rc10_sim::FeedbackRate::Hz125,
    };
    Ok(config)
}

/// A mecanum base on four of the motors.
#[derive(Clone, Copy, Debug)]
pub struct Base {
    /// Front left, front right, rear left, rear right: lines of [`Description::motors`]. A
    /// reversed motor is mounted mirrored.
    pub wheels: [usize; 4],
    /// Its masses and measures.
    pub chassis: rc10_sim::Chassis,
}

/// What a robot does by itself at known times.
#[derive(Clone, Debug, Default)]
pub struct Script {
    /// What happens first, in order of time.
    pub events: Vec<Event>,
    /// After how long the same happens again, if it does.
    pub repeats_after: Option<Micros>,
}

impl Script {
    /// All events before `end`.
    #[must_use]
    pub fn until(&self, end: Micros) -> Vec<Event> {
        let period = self.repeats_after.map_or(0, Micros::get);
        let repeats = end.get().checked_div(period).unwrap_or(0);
        let later = |round: u64| {
            let delay = Micros::new(round * period);
            self.events.iter().map(move |event| Event { at: event.at + delay, ..*event })
        };
        (0..=repeats).flat_map(later).filter(|event| event.at < end).collect()
    }
}

/// Bytes that a frame of eight bytes takes in a log, between those of a standard and an extended
/// one.
const LOG_LINE: u64 = 47;

/// How often a text names a motor: `M3508 id 1` is not in `M3508 id 12`.
fn mentions(text: &str, name: &str) -> usize {
    let ends = text.match_indices(name).map(|(at, name)| &text[at + name.len()..]);
    ends.filter(|rest| !rest.starts_with(|next: char| next.is_ascii_digit())).count()
}

impl Description {
    /// The motors of a bus, in the order in which they are attached.
    pub fn on_bus(&self, bus: u8) -> impl Iterator<Item = &Motor> {
        self.motors.iter().filter(move |motor| motor.on == Place::Bus(bus))
    }

    /// What happens by itself before `end`, in the order of time: in its script, in the hands of
    /// whoever holds its remote, and to that remote. What hands do while the remote is lost nobody
    /// hears, but for the last of it, when the remote is back.
    #[must_use]
    pub fn events(&self, end: Micros) -> Vec<Event> {
        let mut events = self.script.until(end);
        if let Some(remote) = &self.remote {
            let line = |line: &Line| Event { at: line.at, label: line.label };
            let script = Script {
                events: remote.script.iter().map(line).collect(),
                repeats_after: remote.repeats_after,
            };
            let mut hands = script.until(end);
            for &Lost { from, until } in &remote.lost {
                let unheard =
                    |event: &Event| event.at >= from && until.is_none_or(|until| event.at < until);
                let last = hands.iter().copied().rfind(unheard);
                hands.retain(|event| !unheard(event));
                events.push(Event { at: from, label: "remote lost" });
                events.extend(until.map(|at| Event { at, label: "remote back" }));
                events.extend(until.zip(last).map(|(at, last)| Event { at, ..last }));
            }
            events.extend(hands);
        }
        events.retain(|event| event.at < end);
        events.sort_by_key(|event| event.at);
        events
    }

    /// Adds to an error that names motors by model and identifier what the robot calls them, and
    /// where they are plugged in: a line each.
    #[must_use]
    pub fn label(&self, error: anyhow::Error) -> anyhow::Error {
        let text = format!("{error:#}");
        let named = |motor: &&Motor| mentions(&text, &motor.name().to_string()) > 0;
        let mut motors: Vec<&Motor> = self.motors.iter().filter(named).collect();
        // Two that are in each other's way hang on the same bus; others may be called the same.
        let mentioned = |on| -> usize {
            let mut names: Vec<String> = Vec::new();
            names.extend(motors.iter().filter(|m| m.on == on).map(|m| m.name().to_string()));
            let count = names.len();
            names.dedup();
            names.iter().map(|name| mentions(&text, name)).sum::<usize>().min(count)
        };
        let most = motors.iter().map(|motor| mentioned(motor.on)).max();
        let places: Vec<Place> = motors.iter().map(|motor| motor.on).collect();
        let best: Vec<Place> =
            places.into_iter().filter(|on| Some(mentioned(*on)) == most).collect();
        motors.retain(|motor| best.contains(&motor.on));
        if motors.is_empty() {
            return error;
        }
        let whose =
            |motor: &&Motor| format!("\n      {}: {} is {}", motor.on, motor.label, motor.name());
        let whose: String = motors.iter().map(whose).collect();
        anyhow!("{text}{whose}")
    }

    /// Which of the motors that are plugged in at the same place the one in an entry of
    /// [`Description::motors`] is.
    #[must_use]
    pub fn number(&self, entry: usize) -> Option<MotorId> {
        let on = self.motors.get(entry)?.on;
        let before = self.motors[..entry].iter().filter(|motor| motor.on == on).count();
        Some(MotorId::new(u8::try_from(before).ok()?))
    }
}

/// What a running robot's tasks know its buses and lines by; the first of each is number 1.
#[derive(Clone, Default)]
pub struct Ports<'r> {
    /// The buses.
    pub buses: Vec<&'r BusPort>,
    /// The lines.
    pub lines: Vec<&'r Rs485Port>,
    /// What arms it.
    pub switch: Option<&'r ArmSwitch>,
    /// What it hears of its remote.
    pub reception: Option<&'r Reception>,
    /// Which way it looks by its IMU at this time: degrees counter-clockwise, all turns counted.
    pub yaw: Option<Yaw<'r>>,
}

/// Which way a robot looks at a time, if it knows.
pub type Yaw<'r> = Rc<dyn Fn(Micros) -> Option<f64> + 'r>;

impl<'r> Ports<'r> {
    /// The port of the motor in an entry of [`Description::motors`], if it is plugged in here.
    #[must_use]
    pub fn motor(&self, description: &Description, entry: usize) -> Option<MotorPort<'r>> {
        let motor = description.number(entry)?;
        let index = |number: u8| usize::from(number).checked_sub(1);
        match description.motors.get(entry)?.on {
            Place::Bus(number) => Some(self.buses.get(index(number)?)?.motor(motor)),
            Place::Line(number) => Some(self.lines.get(index(number)?)?.motor(motor)),
        }
    }
}

/// A robot that is set up and has not begun: its description, its buses with their motors, and its
/// tasks.
pub struct Robot<'r> {
    description: Description,
    buses: Vec<MotorBus<'r>>,
    lines: Vec<Rs485Bus<'r>>,
    ports: Ports<'r>,
    tasks: Vec<Task<'r>>,
    listen: Option<Box<dyn FnOnce(Receiver, ReceiverPort) -> Task<'r> + 'r>>,
    serials: Vec<Box<dyn FnOnce(UartPort) -> Task<'r> + 'r>>,
    /// It runs even if motors do not fit on a bus.
    is_forced: bool,
}

type Task<'r> = Pin<Box<dyn Future<Output = ()> + 'r>>;

fn boxed<'r, T>(task: impl Future<Output = T> + 'r) -> Task<'r> {
    Box::pin(async {
        task.await;
    })
}

impl<'r> Robot<'r> {
    /// A robot without buses and tasks.
    #[must_use]
    pub const fn new(description: Description) -> Self {
        let ports = Ports {
            buses: Vec::new(),
            lines: Vec::new(),
            switch: None,
            reception: None,
            yaw: None,
        };
        Self {
            description,
            buses: Vec::new(),
            lines: Vec::new(),
            ports,
            tasks: Vec::new(),
            listen: None,
            serials: Vec::new(),
            is_forced: false,
        }
    }

    /// Adds its next bus, and the port that its tasks know it by.
    #[must_use]
    pub fn bus(mut self, bus: MotorBus<'r>, port: &'r BusPort) -> Self {
        self.buses.push(bus);
        self.ports.buses.push(port);
        self
    }

    /// Adds its next RS-485 line, and the port that its tasks know it by.
    #[must_use]
    pub fn line(mut self, line: Rs485Bus<'r>, port: &'r Rs485Port) -> Self {
        self.lines.push(line);
        self.ports.lines.push(port);
        self
    }

    /// Adds a task of its own; the buses' tasks are there already.
    #[must_use]
    pub fn task<T>(mut self, task: impl Future<Output = T> + 'r) -> Self {
        self.tasks.push(boxed(task));
        self
    }

    /// Says what arms it, so that reports can show when it was.
    #[must_use]
    pub const fn switch(mut self, switch: &'r ArmSwitch) -> Self {
        self.ports.switch = Some(switch);
        self
    }

    /// Says which way its IMU says that it looks, degrees counter-clockwise with all turns counted:
    /// so that a run can compare its wheels with that.
    #[must_use]
    pub fn yaw(mut self, yaw: impl Fn(Micros) -> Option<f64> + 'r) -> Self {
        self.ports.yaw = Some(Rc::new(yaw));
        self
    }

    /// Adds the task that listens to the receiver of its remote, and where that counts.
    #[must_use]
    pub fn remote<F: Future + 'r>(
        mut self,
        reception: &'r Reception,
        listen: impl FnOnce(Receiver, ReceiverPort) -> F + 'r,
    ) -> Self {
        self.ports.reception = Some(reception);
        self.listen = Some(Box::new(|receiver, port| boxed(listen(receiver, port))));
        self
    }

    /// Adds the task that speaks with its next part on a UART.
    #[must_use]
    pub fn serial<F: Future + 'r>(mut self, speak: impl FnOnce(UartPort) -> F + 'r) -> Self {
        self.serials.push(Box::new(|port| boxed(speak(port))));
        self
    }

    /// Plugs another receiver in.
    ///
    /// # Errors
    /// If it has no remote, or none with such a receiver.
    pub fn set_remote(&mut self, receiver: Receiver) -> Result<()> {
        match &mut self.description.remote {
            Some(remote) => remote.plug(receiver),
            None => bail!("this robot has no remote control: no --remote"),
        }
    }

    /// Says what will go wrong around it.
    ///
    /// # Errors
    /// If a fault is on a bus or a line that it does not have; if it has no remote to lose, or one
    /// is lost that is lost already.
    pub fn set_faults(&mut self, faults: &[Fault]) -> Result<()> {
        let Description { buses, lines, remote, .. } = &mut self.description;
        Faults::check(faults, usize::from(*buses), usize::from(*lines))?;
        match remote {
            Some(remote) => remote.lose(faults)?,
            None => ensure!(
                faults.iter().all(|fault| fault.kind != Kind::RemoteLost),
                "this robot has no remote control: no remote-lost"
            ),
        }
        self.description.faults = faults.into();
        Ok(())
    }

    /// Says what is built otherwise than described: the world around it will be, and it will not
    /// know.
    ///
    /// # Errors
    /// If a mistake concerns a motor or a base that it does not have.
    pub fn set_mistakes(&mut self, mistakes: &[Mistake]) -> Result<()> {
        self.description.mistakes = mistakes.into();
        Built::new(&self.description).map(|_| ())
    }

    /// Whether the buses' logs are only hashed: those of an hour are too large for many a memory.
    pub const fn set_no_logs(&mut self, no_logs: bool) {
        self.description.no_logs = no_logs;
    }

    /// Bytes that the buses' logs of a run take, by the planned load; 0 if they are not kept.
    #[must_use]
    pub fn log_size(&self, length: Micros) -> u64 {
        if self.description.no_logs {
            return 0;
        }
        let frames = |bus: &MotorBus<'_>| u64::from(bus.load(BITS_PER_SECOND).frames_per_second);
        let a_second: u64 = self.buses.iter().map(frames).sum();
        a_second * LOG_LINE * length.get() / 1_000_000
    }

    /// What it was described as.
    #[must_use]
    pub const fn description(&self) -> &Description {
        &self.description
    }

    /// The ports of its buses and lines.
    #[must_use]
    pub fn ports(&self) -> Ports<'r> {
        self.ports.clone()
    }

    /// Whether the motors fit on their buses: says on stderr which buses are tight. `force` lets the
    /// robot run all the same, and then says what will be lost.
    ///
    /// # Errors
    /// If its buses are not as described; without `force`, if the motors of a bus do not fit on it.
    pub fn fit(&mut self, force: bool) -> Result<()> {
        self.is_forced = force;
        if force {
            self.buses.iter_mut().for_each(MotorBus::allow_overload);
        }
        self.check()?;
        for (number, bus) in (1..=u8::MAX).zip(&self.buses) {
            if bus.load(BITS_PER_SECOND).verdict() != Verdict::Fits {
                eprintln!("rc10: warning: {}", overload(number, bus, &self.description));
            }
        }
        Ok(())
    }

    /// The control loops of each motor in its table, where they run here and not in the device.
    #[must_use]
    pub fn loops(&self) -> Vec<Option<Loops>> {
        let loops = |entry: usize| {
            let motor = self.description.number(entry)?;
            let index = |number: u8| usize::from(number).checked_sub(1);
            match self.description.motors.get(entry)?.on {
                Place::Bus(number) => self.buses.get(index(number)?)?.loops(motor),
                Place::Line(number) => self.lines.get(index(number)?)?.loops(motor),
            }
        };
        (0..self.description.motors.len()).map(loops).collect()
    }

    /// Its buses' runners on the wires around it, bus 1 on the first of them, those of its lines on
    /// the lines, its own tasks, and those of what is on its UARTs.
    ///
    /// # Errors
    /// If its buses, lines or UARTs are not as described.
    pub fn tasks(self, around: &Surroundings) -> Result<Tasks<'r>> {
        self.check()?;
        let mut tasks = Tasks::new();
        let buses = self.buses.into_iter().zip(self.ports.buses);
        for ((bus, shared), wire) in buses.zip(&around.wires) {
            tasks.add(run_bus(wire.port(), bus, shared));
        }
        let lines = self.lines.into_iter().zip(self.ports.lines);
        for ((line, shared), wire) in lines.zip(&around.lines) {
            tasks.add(run_rs485(wire.port(), line, shared));
        }
        self.tasks.into_iter().for_each(|task| tasks.add(task));
        if let (Some(listen), Some(remote)) = (self.listen, &around.remote) {
            tasks.add(listen(remote.receiver, remote.wire.port()));
        }
        for (speak, link) in self.serials.into_iter().zip(&around.serials) {
            tasks.add(speak(link.port()));
        }
        Ok(tasks)
    }

    /// Its description, and its buses, which nobody runs.
    ///
    /// # Errors
    /// If its buses are not as described.
    pub fn into_buses(self) -> Result<(Description, Vec<MotorBus<'r>>)> {
        self.check()?;
        Ok((self.description, self.buses))
    }

    /// Whether the motors on the buses and lines are those of the description: otherwise every
    /// figure would stand beside another motor's name.
    fn check(&self) -> Result<()> {
        let (buses, described) = (self.buses.len(), self.description.buses);
        ensure!(buses == usize::from(described), "{buses} buses, but {described} described");
        let (lines, described) = (self.lines.len(), self.description.lines);
        ensure!(lines == usize::from(described), "{lines} lines, but {described} described");
        match (&self.description.remote, &self.listen) {
            (None, Some(_)) => bail!("it listens to a remote, but none is described"),
            (Some(_), None) => bail!("a remote is described, but it listens to none"),
            _ => (),
        }
        let (serials, described) = (self.serials.len(), self.description.serials.len());
        ensure!(serials == described, "{serials} parts on UARTs, but {described} described");
        for (number, bus) in (1..=u8::MAX).zip(&self.buses) {
            let fits = bus.load(BITS_PER_SECOND).verdict() != Verdict::DoesNotFit;
            ensure!(
                fits || self.is_forced,
                "{}\n--force runs it all the same",
                overload(number, bus, &self.description)
            );
            self.check_place(Place::Bus(number), bus.motors().map(|(_, name)| name))?;
        }
        for (number, line) in (1..=u8::MAX).zip(&self.lines) {
            self.check_place(Place::Line(number), line.motors().map(|(_, name)| name))?;
        }
        Ok(())
    }

    fn check_place(&self, on: Place, attached: impl Iterator<Item = MotorName>) -> Result<()> {
        let described = self.description.motors.iter().filter(|motor| motor.on == on);
        let described: Vec<MotorName> = described.map(Motor::name).collect();
        let attached: Vec<MotorName> = attached.collect();
        let list = |motors: &[MotorName]| {
            motors.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
        };
        ensure!(
            attached == described,
            "{on} has the motors [{}], but described are [{}]",
            list(&attached),
            list(&described)
        );
        Ok(())
    }
}

/// The bit rate of all buses.
const BITS_PER_SECOND: u32 = 1_000_000;

/// What is to be said of a bus that is tight, or too small for its motors: how much they need,
/// which they are, and what to change.
fn overload(number: u8, bus: &MotorBus<'_>, description: &Description) -> String {
    let load = bus.load(BITS_PER_SECOND);
    let mut rates: Vec<(u32, Vec<String>)> = Vec::new();
    let mut described = description.on_bus(number);
    bus.for_each_wiring(|wiring| {
        let rate: u32 = wiring.received().iter().map(|receive| receive.rate.per_second()).sum();
        let label = described.next().map_or_else(String::new, |motor| format!("{} ", motor.label));
        let name = format!("{label}({})", wiring.name());
        match rates.iter_mut().find(|(known, _)| *known == rate) {
            Some((_, names)) => names.push(name),
            None => rates.push((rate, vec![name])),
        }
    });
    let mut text = format!("bus {number}: {load}");
    for (rate, names) in rates {
        text += &format!("\n  {rate} feedback frames/s each: {}", names.join(", "));
    }
    text + "\nset their feedback to 500 Hz, on the devices and in the robot's table, or put some of \
            them on another bus"
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji::Dji;
    use rc10_motor::{ArmSwitch, Safety};

    use super::*;
    use crate::remote::tests as tests_of_remotes;

    fn event(millis: u64, label: &'static str) -> Event {
        Event { at: Micros::from_millis(millis), label }
    }

    fn times(script: &Script, end: u64) -> Vec<u64> {
        let events = script.until(Micros::from_millis(end));
        events.iter().map(|event| event.at.get() / 1000).collect()
    }

    #[test]
    fn a_script_may_repeat_and_ends_before_the_end() {
        let mut script =
            Script { events: vec![event(100, "a"), event(300, "b")], ..<_>::default() };
        assert_eq!(times(&script, 5000), [100, 300]);
        assert_eq!(times(&script, 300), [100]);
        script.repeats_after = Some(Micros::from_millis(1000));
        assert_eq!(times(&script, 2300), [100, 300, 1100, 1300, 2100]);
        script.repeats_after = Some(Micros::ZERO);
        assert_eq!(times(&script, 5000), [100, 300]);
        let nothing = Script { events: Vec::new(), ..script };
        assert!(nothing.until(Micros::from_millis(5000)).is_empty());
    }

    #[test]
    fn what_hands_do_while_the_remote_is_lost_is_told_when_it_is_back() {
        let told = |faults: &[&str]| {
            let mut remote = tests_of_remotes::control();
            (remote.script[0].label, remote.script[1].label) = ("down", "up");
            remote.lose(&tests_of_remotes::faults(faults)).unwrap();
            let description = Description { remote: Some(remote), ..<_>::default() };
            let events = description.events(Micros::from_millis(2500));
            let told = |event: &Event| format!("{} {}", event.at.get() / 1000, event.label);
            events.iter().map(told).collect::<Vec<_>>().join(", ")
        };
        assert_eq!(told(&[]), "0 down, 100 up, 1000 down, 1100 up, 2000 down, 2100 up");
        assert_eq!(told(&["remote-lost@50ms"]), "0 down, 50 remote lost");
        let twice = told(&["remote-lost@1s..1.05s", "remote-lost@1.1s..2.2s"]);
        let expected = "0 down, 100 up, 1000 remote lost, 1050 remote back, 1050 down, \
                        1100 remote lost, 2200 remote back, 2200 up";
        assert_eq!(twice, expected);
    }

    #[test]
    fn errors_say_what_the_robot_calls_their_motors() {
        let motors = vec![
            Motor::new("wheel left", 1, &dji::M3508, 1),
            Motor::new("wheel right", 1, &dji::M3508, 1),
            Motor::new("lift", 2, &dji::M3508, 1),
            Motor::new("yaw", 2, &dji::GM6020_CURRENT, 11),
        ];
        let description = Description { motors, buses: 2, ..<_>::default() };
        let labelled = |error: anyhow::Error| description.label(error).to_string();
        let switch = ArmSwitch::new();
        let mut motors = [1, 1].map(|id| Dji::new(&dji::M3508, id).unwrap());
        let mut bus = MotorBus::new(&switch);
        let [left, right] = &mut motors;
        bus.attach(left, Safety::COAST).unwrap();
        let clash = bus.attach(right, Safety::COAST).unwrap_err();
        assert_eq!(
            labelled(clash.into()),
            "M3508 id 1 cannot share a bus with M3508 id 1: both send feedback with identifier \
             0x201\n      bus 1: wheel left is M3508 id 1\n      bus 1: wheel right is M3508 id 1"
        );
        let id = Dji::new(&dji::GM6020_CURRENT, 11).unwrap_err();
        assert_eq!(
            labelled(id.into()),
            "GM6020 (current mode) id 11: its identifiers are 1 to 7\n      \
             bus 2: yaw is GM6020 (current mode) id 11"
        );
        let mut gains = dji::M3508.cascade;
        gains.speed.kp = -0.063;
        let gains = Dji::new(&dji::M3508, 1).unwrap().with_cascade(gains).unwrap_err();
        assert!(labelled(gains.into()).starts_with(
            "M3508 id 1: `speed.kp` is -0.063, but must be finite and not negative\n      bus 1: "
        ));
        assert_eq!(labelled(anyhow!("M3508 id 12 is none of them")), "M3508 id 12 is none of them");
    }

    #[test]
    fn buses_that_are_not_as_described_are_refused_in_words() {
        let (switch, port) = (ArmSwitch::new(), BusPort::new());
        let mut motors = [1, 2].map(|id| Dji::new(&dji::M3508, id).unwrap());
        let mut complaint = |description: Description| {
            let mut bus = MotorBus::new(&switch);
            for motor in &mut motors {
                bus.attach(motor, Safety::COAST).unwrap();
            }
            let robot = Robot::new(description).bus(bus, &port);
            robot.into_buses().err().map(|error| error.to_string())
        };
        let left = Motor::new("left", 1, &dji::M3508, 1);
        let right = Motor::new("right", 1, &dji::M3508, 2);
        let described = |buses, motors: [Motor; 2]| Description {
            buses,
            motors: motors.into(),
            ..<_>::default()
        };
        assert_eq!(complaint(described(1, [left, right])), None);
        let two = "1 buses, but 2 described";
        assert_eq!(complaint(described(2, [left, right])).as_deref(), Some(two));
        let turned = "bus 1 has the motors [M3508 id 1, M3508 id 2], \
                      but described are [M3508 id 2, M3508 id 1]";
        assert_eq!(complaint(described(1, [right, left])).as_deref(), Some(turned));
    }
}
