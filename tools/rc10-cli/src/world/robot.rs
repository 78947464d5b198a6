//! A robot that is set up: its description, with the buses and tasks of a robot crate.

use std::any::Any;
use std::iter::zip;
use std::path::Path;
use std::pin::Pin;
use std::rc::Rc;

use anyhow::{Context as _, Result, bail, ensure};
use embassy_time::Instant;
use rc10_emu::fault::{Fault, Kind};
use rc10_module::Reception;
use rc10_module::store::{Cells, Store};
use rc10_motor::embassy::{BusPort, PortsOf, Rs485Port, run_bus, run_rs485};
use rc10_motor::record::FIRST_LINE;
use rc10_motor::unitree::Rs485Bus;
use rc10_motor::{ArmSwitch, Loops, MotorBus, MotorName, Names, Verdict};
use rc10_sim::{Contact, Serial, Servo, TaskName, Tasks, UartPort, Voltage};
use rc10_tasks::boards::{Boards, Role};
use rc10_tasks::live::{self, Link, Live};
use rc10_tasks::{Common, Program, heading, remote, status};
use rc10_time::Micros;

use crate::args::Injected;
use crate::robot::description::{Description, Partner, PoseSignals, Simulated};
use crate::robot::mistake::Mistake;
use crate::robot::motor::{BITS_PER_SECOND, Motor, Place};
use crate::robot::remote::{Receiver, ReceiverPort};
use crate::robot::signal::Signal;
use crate::world::built::Built;
use crate::world::console::ConsolePort;
use crate::world::environment::{Environment, Real, RealEnd};
use crate::world::hang;
use crate::world::inputs::Written;
use crate::world::kept::KeptFlash;
use crate::world::ports::Ports;

/// Bytes in a log of a frame with eight bytes, between a standard and an extended one.
const LOG_LINE: u64 = 47;

/// A robot that is set up and has not begun: its description, its buses with motors, and its tasks.
#[derive(Default)]
#[must_use]
pub struct Robot<'r> {
    description: Description,
    buses: Vec<MotorBus<'r>>,
    lines: Vec<Rs485Bus<'r>>,
    ports: Ports<'r>,
    tasks: Vec<Task<'r>>,
    listen: Option<Box<dyn FnOnce(Receiver, ReceiverPort) -> Task<'r> + 'r>>,
    serials: Vec<Box<dyn FnOnce(UartPort) -> Task<'r> + 'r>>,
    /// Numbers of serial parts, behind the others, of contacts, voltages and servos; and their task.
    parts: Option<([usize; 4], StartParts<'r>)>,
    console: Option<Serve<'r>>,
    /// Where its parameters are kept, and those that it must have.
    kept: (KeptFlash, &'static [&'static str]),
    /// Whether it runs even if motors do not fit on a bus.
    is_forced: bool,
    /// Where what reaches its ticks is written, if it is.
    pub(crate) inputs: Option<&'static Written>,
}

type Serve<'r> = Box<dyn FnOnce(ConsolePort, KeptFlash, &'static [&'static str]) -> Task<'r> + 'r>;
type StartParts<'r> = Box<dyn FnOnce(Parts) -> Task<'r> + 'r>;

/// Ports and pins of what a robot has beside motors.
#[derive(Default)]
pub struct Parts {
    /// The ports of parts on UARTs.
    pub serials: Vec<UartPort>,
    /// The contacts.
    pub contacts: Vec<Contact>,
    /// The voltages.
    pub voltages: Vec<Voltage>,
    /// The servos.
    pub servos: Vec<Servo>,
}

type Task<'r> = (TaskName, Pin<Box<dyn Future<Output = ()> + 'r>>);

fn boxed<'r, T>(name: TaskName, task: impl Future<Output = T> + 'r) -> Task<'r> {
    let future = async {
        task.await;
    };
    (name, Box::pin(future))
}

impl Partner {
    /// The board of another program, for a board with this role.
    #[must_use]
    pub fn of<P: Simulated>(boards: Boards, role: Role) -> Self {
        let robot =
            || anyhow::Ok(Box::new(Robot::for_good::<P>(P::description())?) as Box<dyn Any>);
        Self { boards, role, description: P::description, robot }
    }

    /// Its robot, before it runs.
    pub(crate) fn start(&self) -> Result<Robot<'static>> {
        let robot = (self.robot)()?.downcast().ok().context("it is no robot")?;
        Ok(*robot)
    }
}

impl Robot<'static> {
    /// Creates the robot of a program with all its tasks, in the world of `description`; its state lives as long as this
    /// program.
    ///
    /// # Errors
    /// Those of [`of`](Self::of).
    pub fn for_good<P: Program>(description: Description) -> Result<Self> {
        let buses: Vec<_> = P::Name::BUSES.iter().map(|_| BusPort::new()).collect();
        let lines: Vec<_> = (0..P::Name::LINES).map(|_| Rs485Port::new()).collect();
        let shared = Box::leak(Box::new(Common::new(PortsOf::new(buses.leak(), lines.leak()))));
        Self::of::<P>(description, shared, Box::leak(Box::default()))
    }
}

impl<'r> Robot<'r> {
    /// Creates a robot without buses and tasks.
    pub fn new(description: Description) -> Self {
        Self { description, ..Self::default() }
    }

    /// Creates the robot of a program with all its tasks, in the world of `description`. Fails if
    /// the motors cannot be attached, or a line cannot have the reply time of the program.
    pub fn of<P: Program>(
        description: Description,
        shared: &'r Common<'_, P::Name, P::Own>,
        motors: &'r mut P::Motors,
    ) -> Result<Self> {
        let switch = &shared.switch;
        let mut buses: Vec<_> = shared.ports.buses.iter().map(|_| MotorBus::new(switch)).collect();
        let lines =
            P::RS485.iter().map(|line| Rs485Bus::new(switch).with_reply_timeout(line.reply));
        let mut lines: Vec<_> = lines.collect::<Result<_, _>>()?;
        let on_lines: &mut [_] = &mut lines.iter_mut().collect::<Vec<_>>();
        P::attach(motors, &mut buses.iter_mut().collect::<Vec<_>>(), on_lines)?;
        Ok(Self::on(description, buses, lines, shared).program::<P>(shared))
    }

    /// Creates a robot without tasks on buses and lines that have its motors: with its arm switch, a console for a
    /// PC and, if a remote is described, the task for its receiver.
    pub fn on<N: Names>(
        description: Description,
        buses: impl IntoIterator<Item = MotorBus<'r>>,
        lines: impl IntoIterator<Item = Rs485Bus<'r>>,
        shared: &'r Common<'_, N, impl Live>,
    ) -> Self {
        let ports = shared.ports;
        let (control, yaw) = (description.remote.clone(), description.yaw);
        let mut robot = Self::new(description).switch(&shared.switch).live(shared);
        robot = zip(buses, ports.buses).fold(robot, |robot, (bus, port)| robot.bus(bus, port));
        robot = zip(lines, ports.lines).fold(robot, |robot, (line, port)| robot.line(line, port));
        let signal = |label| robot.ports.signals.iter().find(|signal| signal.label == label);
        if let Some((label, Signal { read, .. })) = yaw.and_then(|it| Some((it, signal(it)?))) {
            robot.ports.yaw = Some((label, Rc::clone(read)));
        }
        let Some(mut control) = control else { return robot };
        robot.remote(&shared.remote_reception, async move |receiver, port| {
            // Another one may have been plugged in.
            let _ = control.plug(receiver);
            match port {
                ReceiverPort::Serial(port) => {
                    remote::listen(shared, receiver, control.channels, port).await
                }
                ReceiverPort::Pulses(mut port) => {
                    let edges = async || port.rising_edge().await;
                    remote::listen_pulses(shared, control.channels, edges).await
                }
            }
        })
    }

    /// Adds the tasks of a program.
    pub fn program<P: Program>(mut self, shared: &'r Common<'_, P::Name, P::Own>) -> Self {
        self.kept.1 = P::MUST_HAVE;
        if P::HAS_IMU {
            self = self.serial(&shared.imu_reception, async |port| {
                heading::listen_for(shared, port).await;
            });
        }
        self.ports.parts.extend(&shared.receptions[..P::SERIALS.len()]);
        let counts = [P::SERIALS.len(), P::CONTACTS.len(), P::VOLTAGES.len(), P::SERVOS.len()];
        if counts != [0; 4] {
            self = self.parts(counts, |Parts { serials, contacts, voltages, servos }| {
                let read = |mut voltage: Voltage| async move || voltage.read().await;
                P::parts(shared, serials, contacts, voltages.into_iter().map(read), servos)
            });
        }
        self.task(P::run(shared)).task(status::run(shared))
    }

    /// Adds the task of this many serial parts, behind the others, contacts, voltages and servos: it gets their ports
    /// and pins in the order of the description. A servo's pulse is a signal of its label, µs.
    #[track_caller]
    pub fn parts<F: Future + 'r>(
        mut self,
        counts: [usize; 4],
        start: impl FnOnce(Parts) -> F + 'r,
    ) -> Self {
        let name = TaskName::of::<F>();
        let servos: Vec<_> = self.description.servos.iter().map(|_| Servo::default()).collect();
        for (label, servo) in zip(self.description.servos.clone(), servos.clone()) {
            let label = String::leak(format!("{label} pulse"));
            self = self.signal(label, "us", move |_| servo.pulse());
        }
        let start = move |parts| boxed(name, start(Parts { servos, ..parts }));
        self.parts = Some((counts, Box::new(start)));
        self
    }

    /// Adds the next bus, and its port for tasks.
    pub fn bus(mut self, bus: MotorBus<'r>, port: &'r BusPort) -> Self {
        self.buses.push(bus);
        self.ports.buses.push(port);
        self
    }

    /// Adds the next RS-485 line, and its port for tasks.
    pub fn line(mut self, line: Rs485Bus<'r>, port: &'r Rs485Port) -> Self {
        self.lines.push(line);
        self.ports.lines.push(port);
        self
    }

    /// Adds an own task, beside those of the buses.
    #[track_caller]
    pub fn task<T, F: Future<Output = T> + 'r>(mut self, task: F) -> Self {
        self.tasks.push(boxed(TaskName::of::<F>(), task));
        self
    }

    /// Sets the arm switch, for the times in reports.
    pub const fn switch(mut self, switch: &'r ArmSwitch) -> Self {
        self.ports.switch = Some(switch);
        self
    }

    /// Sets the own signals of the pose by odometry, which a run compares with the true one: labels
    /// of x and y in m, and of the yaw in rad if that is the signal's unit, else in degrees. The
    /// first pose is taken as right.
    ///
    /// ```
    /// # use rc10_cli::{Description, Robot};
    /// # let (robot, x, y, heading) = (Robot::new(Description::default()), 0.0, 0.0, 0.0);
    /// let robot = robot
    ///     .signal("odometry x", "m", move |_| Some(x))
    ///     .signal("odometry y", "m", move |_| Some(y))
    ///     .signal("odometry yaw", "rad", move |_| Some(heading))
    ///     .estimate(["odometry x", "odometry y", "odometry yaw"]);
    /// ```
    pub const fn estimate(mut self, signals: PoseSignals) -> Self {
        self.description.estimate = Some(signals);
        self
    }

    /// Sets the own signals of the reference pose, in the axes and form of the
    /// [`estimate`](Self::estimate), which a run compares with the path.
    pub const fn reference(mut self, signals: PoseSignals) -> Self {
        self.description.reference = Some(signals);
        self
    }

    /// Adds the task that listens to the remote's receiver, and its counters.
    #[track_caller]
    pub fn remote<F: Future + 'r>(
        mut self,
        reception: &'r Reception,
        listen: impl FnOnce(Receiver, ReceiverPort) -> F + 'r,
    ) -> Self {
        self.ports.reception = Some(reception);
        let name = TaskName::of::<F>();
        self.listen = Some(Box::new(move |receiver, port| boxed(name, listen(receiver, port))));
        self
    }

    /// Adds an own signal: a value of the tasks that a run records, with its unit; `None` without a
    /// value.
    pub fn signal(
        mut self,
        label: &'static str,
        unit: &'static str,
        read: impl Fn(Micros) -> Option<f64> + 'r,
    ) -> Self {
        self.ports.signals.push(Signal { label, unit, states: "", read: Rc::new(read) });
        self
    }

    /// Adds the console for a PC, and the robot's own signals and parameters; a run records the signals.
    pub(crate) fn live<N: Names>(mut self, shared: &'r Common<'_, N, impl Live>) -> Self {
        let own: &dyn Live = &shared.own;
        let seen = Rc::new(live::RobotView::new(shared));
        self.ports.whole = Some(Rc::new(move || seen.whole()));
        own.signals(&mut |signal| {
            let read = move |_| Some(f64::from(signal.get())).filter(|value| !value.is_nan());
            let live::Signal { label, unit, states, .. } = *signal;
            self.ports.signals.push(Signal { label, unit, states, read: Rc::new(read) });
        });
        own.parameters(&mut |parameter| self.ports.parameters.push(parameter));
        let name = TaskName::of::<Link<ConsolePort>>();
        self.console = Some(Box::new(move |port, flash, must_have| {
            // Of a robot that runs there is one in a program.
            let flash: &'static mut dyn Cells = Box::leak(Box::new(flash));
            let kept = live::Kept::new(Store::start(flash), must_have, &shared.switch);
            boxed(name, async move {
                let robot = live::RobotView::new(shared).with_kept(&kept);
                let link = Link::new(port.clone());
                link.serve(&robot, port, Instant::from_ticks(0), shared.own.auto()).await;
            })
        }));
        self
    }

    /// Adds the task of the next part on a UART, and the counters of its bytes.
    #[track_caller]
    pub fn serial<F: Future + 'r>(
        mut self,
        reception: &'r Reception,
        speak: impl FnOnce(UartPort) -> F + 'r,
    ) -> Self {
        self.ports.parts.push(reception);
        let name = TaskName::of::<F>();
        self.serials.push(Box::new(move |port| boxed(name, speak(port))));
        self
    }

    /// Plugs in another receiver; fails without a remote, or if it does not support this receiver.
    pub fn set_remote(&mut self, receiver: Receiver) -> Result<()> {
        match &mut self.description.remote {
            Some(remote) => remote.plug(receiver),
            None => bail!("this robot has no remote control: no --remote"),
        }
    }

    /// Sets the file in which its parameters are kept, instead of the memory of one run. Fails if
    /// the file cannot be used, or is another one.
    pub fn keep_in(&mut self, file: &Path) -> Result<()> {
        self.kept.0 = KeptFlash::open(file)?;
        Ok(())
    }

    /// Sets the faults of a run. Fails if a fault is on a missing bus or line; or a remote is
    /// missing or lost already.
    pub fn set_faults(&mut self, faults: &[Fault]) -> Result<()> {
        self.description.check(faults)?;
        let remote = &mut self.description.remote;
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

    /// Sets the mistakes, which the world has and the robot does not know. Fails if one concerns a
    /// missing motor or base.
    pub fn set_mistakes(&mut self, mistakes: &[Mistake]) -> Result<()> {
        self.description.mistakes = mistakes.into();
        Built::new(&self.description).map(|_| ())
    }

    /// Injects faults and mistakes into a simulation by `command`; fails if the robot or a
    /// simulation cannot have them.
    pub fn inject(&mut self, injected: &Injected, command: &str) -> Result<()> {
        let Injected { faults, mistakes } = injected;
        let mut kinds = faults.iter().map(|fault| &fault.kind);
        if let Some(kind) = kinds.find(|kind| matches!(kind, Kind::Other(_))) {
            bail!("--fault {kind}: {command} has no chip to do that to; rc10 emu does it");
        }
        self.set_faults(faults)?;
        self.set_mistakes(mistakes)
    }

    /// Has what reaches its ticks written, for a replay.
    pub fn record_inputs(&mut self) {
        self.inputs = Some(Written::new());
    }

    /// Sets whether bus logs are only hashed: those of an hour take much memory.
    pub const fn set_no_logs(&mut self, no_logs: bool) {
        self.description.no_logs = no_logs;
    }

    /// Bytes of a run's bus logs, by the planned load; 0 if they are not kept.
    pub fn log_size(&self, length: Micros) -> u64 {
        if self.description.no_logs {
            return 0;
        }
        let frames = |bus: &MotorBus<'_>| u64::from(bus.load(BITS_PER_SECOND).frames_per_second);
        let a_second: u64 = self.buses.iter().map(frames).sum();
        a_second * LOG_LINE * length.get() / 1_000_000
    }

    pub(crate) const fn has_console(&self) -> bool {
        self.console.is_some()
    }

    /// The description of the robot.
    pub const fn description(&self) -> &Description {
        &self.description
    }

    pub(crate) fn signals(&self) -> &[Signal<'r>] {
        &self.ports.signals
    }

    /// The ports of the buses and lines.
    pub fn ports(&self) -> Ports<'r> {
        self.ports.clone()
    }

    /// Checks that the motors fit on their buses, and prints to stderr which buses are tight. With
    /// `force` the robot runs all the same, and losses are printed. Fails if its buses are not as
    /// described; or, without `force`, motors do not fit on a bus.
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

    /// The control loops of each motor in the table; `None` if they run in the device.
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

    /// Creates all tasks: those of buses and lines on the wires and lines of `around`, in order,
    /// those of parts on UARTs, and own ones. Fails if buses, lines or UARTs are not as described.
    pub fn tasks(self, around: &Environment) -> Result<Tasks<'r>> {
        let mut tasks = Tasks::new();
        if let (Some(partner), Some(around)) = (self.description.partner, &around.partner) {
            partner.start().context("the other board")?.add_to(&mut tasks, around)?;
        }
        self.add_to(&mut tasks, around)?;
        hang::watch(&tasks.running());
        Ok(tasks)
    }

    fn add_to<'t>(self, tasks: &mut Tasks<'t>, around: &Environment) -> Result<()>
    where
        'r: 't,
    {
        self.check()?;
        let buses = self.buses.into_iter().zip(self.ports.buses);
        for (number, ((bus, shared), wire)) in (1..=u8::MAX).zip(buses.zip(&around.wires)) {
            if let Some(inputs) = self.inputs {
                shared.record(inputs, number - 1);
            }
            match around.real.get(&Real::Bus(number)) {
                Some(RealEnd::Frames(port)) => tasks.add(run_bus(port.clone(), bus, shared)),
                _ => tasks.add(run_bus(wire.port(), bus, shared)),
            }
        }
        let lines = self.lines.into_iter().zip(self.ports.lines);
        for (number, ((line, shared), wire)) in (0..).zip(lines.zip(&around.lines)) {
            if let Some(inputs) = self.inputs {
                shared.record(inputs, FIRST_LINE + number);
            }
            match around.real.get(&Real::Line(number + 1)) {
                Some(RealEnd::Bytes(end)) => {
                    tasks.add(run_rs485(end.serial().port(), line.behind_usb(), shared));
                }
                _ => tasks.add(run_rs485(wire.port(), line, shared)),
            }
        }
        let mut own = self.tasks;
        if let (Some(listen), Some(remote)) = (self.listen, &around.remote) {
            own.push(listen(remote.receiver, remote.wire.port()));
        }
        if let (Some(serve), Some(line)) = (self.console, &around.console) {
            let (flash, must_have) = self.kept;
            own.push(serve(line.port(), flash, must_have));
        }
        let mut links = around.serials.iter().map(Serial::port);
        for (speak, port) in self.serials.into_iter().zip(&mut links) {
            own.push(speak(port));
        }
        if let Some((_, start)) = self.parts {
            let (contacts, voltages) = (around.contacts.clone(), around.voltages.clone());
            own.push(start(Parts {
                serials: links.collect(),
                contacts,
                voltages,
                ..Parts::default()
            }));
        }
        own.into_iter().for_each(|(name, task)| tasks.add_as(name, task));
        Ok(())
    }

    /// Takes it apart into its description, buses and lines; fails if they do not match.
    pub fn into_buses(self) -> Result<(Description, Vec<MotorBus<'r>>, Vec<Rs485Bus<'r>>)> {
        self.check()?;
        Ok((self.description, self.buses, self.lines))
    }

    /// Checks the motors on buses and lines against the description, whose names the figures have.
    fn check(&self) -> Result<()> {
        let Description { buses, lines, serials, contacts, voltages, servos, .. } =
            &self.description;
        let [spoken, read, measured, driven] =
            self.parts.as_ref().map_or([0; 4], |(counts, _)| *counts);
        for (is, described, what) in [
            (self.buses.len(), usize::from(*buses), "buses"),
            (self.lines.len(), lines.len(), "lines"),
            (self.serials.len() + spoken, serials.len(), "parts on UARTs"),
            (read, contacts.len(), "contacts are read"),
            (measured, voltages.len(), "voltages are read"),
            (driven, servos.len(), "servos are driven"),
        ] {
            ensure!(is == described, "{is} {what}, but {described} described");
        }
        match (&self.description.remote, &self.listen) {
            (None, Some(_)) => bail!("it listens to a remote, but none is described"),
            (Some(_), None) => bail!("a remote is described, but it listens to none"),
            _ => (),
        }
        let signals = &self.ports.signals;
        for (index, Signal { label, .. }) in signals.iter().enumerate() {
            let is_new = signals[..index].iter().all(|other| other.label != *label);
            ensure!(is_new, "two signals are called `{label}`");
        }
        let Description { estimate, reference, .. } = &self.description;
        for label in estimate.iter().chain(reference).flatten() {
            let is_there = signals.iter().any(|signal| signal.label == *label);
            ensure!(is_there, "its pose is said by a signal `{label}`, which there is not");
        }
        for (number, bus) in (1..=u8::MAX).zip(&self.buses) {
            let fits = bus.load(BITS_PER_SECOND).verdict() != Verdict::DoesNotFit;
            let text = || overload(number, bus, &self.description);
            ensure!(fits || self.is_forced, "{}\n--force runs it all the same", text());
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
        let (is, said) = (list(&attached), list(&described));
        ensure!(attached == described, "{on} has the motors [{is}], but described are [{said}]");
        Ok(())
    }
}

/// The text on a bus that is tight or too small: its load, its motors, and what to change.
fn overload(number: u8, bus: &MotorBus<'_>, description: &Description) -> String {
    let load = bus.load(BITS_PER_SECOND);
    let mut rates: Vec<(u32, Vec<String>)> = Vec::new();
    let mut described = description.on_bus(number);
    let mut motors = bus.motors();
    bus.for_each_can_ids(|ids| {
        let rate: u32 = ids.received().iter().map(|frames| frames.rate.per_second()).sum();
        let label = described.next().map_or_else(String::new, |motor| format!("{} ", motor.label));
        let name = motors.next().map_or_else(String::new, |(_, name)| format!("{label}({name})"));
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
    use rc10_motor::Safety;
    use rc10_motor::dji::{self, Dji};

    use super::*;

    #[test]
    fn buses_that_are_not_as_described_are_refused_in_words() {
        let (switch, port) = (ArmSwitch::new(), BusPort::new());
        let mut motors = [1, 2].map(|id| Dji::new(dji::Config::new(&dji::M3508, id)).unwrap());
        let mut complaint = |description: Description| {
            let mut bus = MotorBus::new(&switch);
            for motor in &mut motors {
                bus.attach(motor, Safety::COAST).unwrap();
            }
            let robot = Robot::new(description).bus(bus, &port);
            robot.into_buses().err().map(|error| error.to_string())
        };
        let left = Motor::dji_on("left", 1, &dji::M3508, 1);
        let right = Motor::dji_on("right", 1, &dji::M3508, 2);
        let described = |buses, motors: [Motor; 2]| Description {
            buses,
            motors: motors.into(),
            ..<_>::default()
        };
        assert_eq!(complaint(described(1, [left.clone(), right.clone()])), None);
        let two = "1 buses, but 2 described";
        assert_eq!(complaint(described(2, [left.clone(), right.clone()])).as_deref(), Some(two));
        let turned = "bus 1 has the motors [M3508 id 1, M3508 id 2], \
                      but described are [M3508 id 2, M3508 id 1]";
        assert_eq!(complaint(described(1, [right, left])).as_deref(), Some(turned));
        let robot = Robot::new(Description::default());
        let robot = ["wall", "speed", "wall"]
            .into_iter()
            .fold(robot, |robot, label| robot.signal(label, "", |_| None));
        let error = robot.into_buses().err().map(|error| error.to_string());
        assert_eq!(error.as_deref(), Some("two signals are called `wall`"));
        let robot = Robot::new(Description::default()).signal("x", "m", |_| None);
        let error = robot.estimate(["x", "y", "yaw"]).into_buses().err().map(|it| it.to_string());
        let missing = "its pose is said by a signal `y`, which there is not";
        assert_eq!(error.as_deref(), Some(missing));
    }
}
