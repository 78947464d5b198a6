//! The emulated chip with a program, in the environment of a robot.

use anyhow::{Context, Result, bail, ensure};
use rc10_emu::fault::{Fault, Kind};
use rc10_emu::{Board, LogLine, Machine, Options, Rig};
use rc10_motor::dji::FeedbackRate;
use rc10_motor::record::ring;
use rc10_motor::{Loops, MotorBus, MotorStatus};
use rc10_sim::{Base, Bus, Esc, Nanos, Servo, TraceEntry};
use rc10_time::Micros;
use sha2::{Digest as _, Sha256};

use crate::recording::look::{BusLook, Moment, RobotLook};
use crate::recording::sample::{NOWHERE, hex_digits};
use crate::robot::description::Description;
use crate::robot::mistake::Mistake;
use crate::robot::motor::{Device, Place};
use crate::robot::operator::Operator;
use crate::robot::remote::ReceiverWire;
use crate::run::line::LineListener;
use crate::run::running::Running;
use crate::run::watch::Sight;
use crate::run::{board, foreign};
use crate::world::black_box::{self, BlackBox};
use crate::world::console::{CONSOLE, ConsoleLine};
use crate::world::environment::{Environment, RemoteLink, operate};
use crate::world::robot::Robot;

/// Options of an emulation.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Seed of the world.
    pub seed: u64,
    /// Instructions a second at the full clock, if not as many as a Cortex-M4 executes.
    pub speed: Option<u64>,
    /// Feedback rate of all motors, if not the one that the robot expects.
    pub rate: Option<FeedbackRate>,
    /// Injected faults.
    pub faults: Vec<Fault>,
    /// Differences between the world and the robot's table.
    pub mistakes: Vec<Mistake>,
    /// Bit rate of a PC at the console, if there is to be one.
    pub console: Option<u32>,
    /// Board of the chip, if not the one that the program is for.
    pub board: Option<Board>,
    /// Crystal of the board in hertz, if it is another one than usual.
    pub crystal: Option<u64>,
    /// Program of the robot's other board, if it has one: without a program its chip is not there.
    pub partner: Option<Vec<u8>>,
    /// Whether what reaches the ticks is taken out of the black box, with the state after each.
    pub record: bool,
}

/// A chip in a robot's environment, and the robot's own code on this machine, which listens to the
/// wires.
pub struct Emulation<'r> {
    /// The scenario.
    pub rig: Rig,
    /// The motors, in the order of the description.
    pub motors: Vec<Esc>,
    /// The remote and its receiver, if the robot has one.
    pub remote: Option<RemoteLink>,
    /// The servos, as many as described: the pulses at the chip's pins.
    pub servos: Vec<Servo>,
    /// The line from the console to a PC, if there is one.
    pub console: Option<ConsoleLine>,
    /// What is around the robot's other board, if it has one.
    pub partner: Option<Box<Environment>>,
    pub(crate) description: Description,
    base: Option<Base>,
    pub(crate) seed: u64,
    /// The robot's buses: they only listen.
    listeners: Vec<MotorBus<'r>>,
    lines: Vec<LineListener<'r>>,
    /// The control loops that its code has for each motor.
    pub(crate) loops: Vec<Option<Loops>>,
    heard: Vec<usize>,
    /// Whether frames that were taken are forgotten: it may run for hours.
    pub forgets: bool,
    operator: Option<Operator>,
    /// Where the black box is, if the program has one.
    black_box: Option<u32>,
    /// What was taken of it, if it is.
    taken: Option<BlackBox>,
}

impl<'r> Emulation<'r> {
    /// Puts a program into a chip, and the chip into the environment of a robot. Fails if the
    /// program or the robot's description is invalid, or a fault concerns a missing bus.
    pub fn new(program: &[u8], robot: Robot<'r>, setup: &Setup) -> Result<Self> {
        let mut robot = robot;
        robot.set_faults(&setup.faults)?;
        robot.set_mistakes(&setup.mistakes)?;
        let loops = robot.loops();
        let (mut description, listeners, lines) = robot.into_buses()?;
        if let Some(rate) = setup.rate {
            for motor in &mut description.motors {
                if let Device::Dji(config) = &mut motor.device {
                    config.rate = rate;
                }
            }
        }
        let lines: Vec<_> = lines.into_iter().map(LineListener::new).collect();
        let mut around = Environment::new(&description, setup.seed)?;
        if let Some(baud) = setup.console {
            around = around.with_console(baud);
        }
        let parts = around.parts(&description);
        let servos: Vec<_> = description.servos.iter().map(|_| Servo::default()).collect();
        let machine = chip(program, &description, setup, &around, &servos)?;
        let mut other_chip = None;
        if let (Some(program), Some(other), Some(around)) =
            (&setup.partner, &description.partner, &around.partner)
        {
            let description = (other.description)();
            let servos: Vec<_> = description.servos.iter().map(|_| Servo::default()).collect();
            let machine = chip(program, &description, setup, around, &servos);
            let machine = machine.context("the other board")?;
            other_chip = Some((machine, around.wires.clone(), around.lines.clone(), description));
        }
        let Environment { world, wires, lines: ends, motors, base, partner, .. } = around;
        let (remote, operator, console) = (around.remote, around.operator, around.console);
        let on_buses = description.motors.iter().zip(&motors);
        let on_buses = on_buses.filter_map(|(motor, esc)| match motor.on {
            Place::Bus(bus) => Some((usize::from(bus) - 1, esc.clone())),
            Place::Line(_) => None,
        });
        let heard = vec![0; wires.len()];
        let mut of_chip = setup.faults.clone();
        of_chip.retain(|fault| fault.kind != Kind::RemoteLost);
        let uarts = description.lines.iter().map(|part| part.uart);
        let ends = uarts.zip(ends).collect();
        let mut rig = Rig::new(machine, world, wires, ends, on_buses.collect(), &of_chip)?;
        rig.connect_parts(parts);
        if let Some((machine, wires, lines, description)) = other_chip {
            let uarts = description.lines.iter().map(|part| part.uart);
            rig.set_partner(machine, &wires, uarts.zip(lines)).context("the other board")?;
        }
        let seed = setup.seed;
        let black_box = rig.machine.image.symbol(black_box::NAME).ok();
        if let Some(at) = black_box.filter(|_| setup.record) {
            rig.machine.memory.write(at + 4 * ring::WISH as u32, &ring::PROOF.to_le_bytes())?;
        }
        Ok(Self {
            rig,
            motors,
            partner,
            description,
            base,
            seed,
            listeners,
            lines,
            loops,
            heard,
            forgets: false,
            remote,
            servos,
            console,
            operator,
            black_box,
            taken: setup.record.then(BlackBox::default),
        })
    }

    /// What the chip's black box holds, as it lies in memory; `None` without one.
    pub fn black_box(&self) -> Option<Vec<u8>> {
        let mut memory = vec![0; black_box::BYTES];
        self.rig.machine.memory.read(self.black_box?, &mut memory).ok()?;
        BlackBox::of(&memory).map(|_| memory)
    }

    /// The base on its wheels, if that is simulated.
    pub const fn base(&self) -> Option<&Base> {
        self.base.as_ref()
    }

    /// Runs up to a time since power-on; fails as [`Rig::run`] does.
    pub fn run(&mut self, until: Nanos) -> Result<()> {
        let Self { rig, operator, .. } = self;
        operate(operator.as_mut(), until.micros(), |until| rig.run(until.into()))?;
        rig.run(until)
    }
}

impl Running for Emulation<'_> {
    fn description(&self) -> &Description {
        &self.description
    }

    fn now(&self) -> Micros {
        self.rig.machine.now().micros()
    }

    fn run_to(&mut self, until: Micros) -> Result<()> {
        self.run(until.into())?;
        let machine = &self.rig.machine;
        if let (None, Some(other)) = (machine.ready, foreign::chip_of(&machine.reports)) {
            bail!("this ELF is not for an STM32H723: {other}");
        }
        Ok(())
    }

    fn console(&self) -> Option<&ConsoleLine> {
        self.console.as_ref()
    }

    fn operator(&mut self) -> Option<&mut Operator> {
        self.operator.as_mut()
    }

    fn inject(&mut self, begins: bool, kind: &Kind) -> Result<()> {
        if *kind != Kind::RemoteLost {
            self.rig.plan(begins, kind.clone());
        } else if let Some(operator) = &mut self.operator {
            operator.lose(begins);
        }
        Ok(())
    }

    fn base(&self) -> Option<&Base> {
        self.base.as_ref()
    }

    fn twins(&self) -> &[Esc] {
        &self.motors
    }

    fn log(&mut self) -> Vec<LogLine> {
        self.rig.machine.take_log()
    }

    fn wires(&self) -> &[Bus] {
        &self.rig.buses
    }

    fn sight(&self) -> Option<Sight<'_>> {
        let sent = self.remote.as_ref()?.remote.sent();
        Some(Sight { sent, motors: &self.description.motors, twins: &self.motors, arm: None })
    }

    /// The listeners have heard them.
    fn take_frames(&mut self) -> Vec<Vec<TraceEntry>> {
        let mut frames = Vec::new();
        for ((log, heard), bus) in
            self.rig.logs.iter_mut().zip(&mut self.heard).zip(&mut self.listeners)
        {
            let new = log.get(*heard..).unwrap_or_default().to_vec();
            if self.forgets {
                log.clear();
            }
            *heard = log.len();
            for entry in new.iter().filter(|entry| !entry.from_controller) {
                bus.on_frame(&entry.frame, entry.at);
            }
            frames.push(new);
        }
        for (bytes, line) in self.rig.take_line_bytes().iter().zip(&mut self.lines) {
            line.listen(bytes);
        }
        frames
    }

    fn take_inputs(&mut self) -> Vec<u32> {
        let (Some(at), Some(taken)) = (self.black_box, &mut self.taken) else { return Vec::new() };
        let mut memory = vec![0; black_box::BYTES];
        let read = self.rig.machine.memory.read(at, &mut memory);
        read.map(|()| taken.news_of(&memory)).unwrap_or_default()
    }

    /// The chip's memory is not looked into.
    fn signals(&self, _: Micros) -> Vec<Option<f64>> {
        Vec::new()
    }

    /// By the frames that are heard of it.
    fn status(&self, entry: usize, now: Micros) -> MotorStatus {
        let index = |number: u8| usize::from(number).checked_sub(1);
        let heard = || {
            let motor = self.description.number(entry)?;
            match self.description.motors.get(entry)?.on {
                Place::Bus(bus) => self.listeners.get(index(bus)?)?.status(motor, now),
                Place::Line(line) => self.lines.get(index(line)?)?.motors.status(motor, now),
            }
        };
        heard().unwrap_or(MotorStatus::NEW)
    }

    fn moment(&self, _: Micros) -> Moment {
        let pose = self.base.as_ref().map_or(NOWHERE, Base::pose);
        Moment {
            // What the chip hears of its IMU is not seen from here.
            robot: RobotLook { pose, ..RobotLook::default() },
            buses: self.listeners.iter().map(BusLook::heard).collect(),
            lines: self.lines.iter().map(LineListener::status).collect(),
            parts: Vec::new(),
            remote: self.sight().map(|sight| sight.remote(None)),
        }
    }
}

/// A chip with a program on the parts of a robot's environment, but not yet on its buses and lines.
fn chip(
    program: &[u8],
    description: &Description,
    setup: &Setup,
    around: &Environment,
    servos: &[Servo],
) -> Result<Machine> {
    let buses = around.wires.len();
    ensure!(buses <= 3, "the chip has three buses, the robot {buses}");
    let board = board::of(program, setup.board, setup.crystal)?;
    let options = Options { seed: setup.seed, board, ..Options::default() };
    let mut machine = Machine::with(program, options)?;
    machine.parts.base.clone_from(&around.base);
    if let Some(speed) = setup.speed {
        machine.set_speed(speed);
    }
    for (part, link) in description.serials.iter().zip(&around.serials) {
        machine.connect_serial(part.uart, link, false).context(part.label)?;
    }
    for (has, what, wants, of_robot) in [
        (board.switches.len(), "inputs for switches", around.contacts.len(), "contacts"),
        (board.voltages.len(), "inputs for voltages", around.voltages.len(), "voltages"),
        (board.servos.len(), "outputs for servos", servos.len(), "servos"),
    ] {
        let name = board.name;
        ensure!(wants <= has, "{name} has {has} {what}, the robot {wants} {of_robot}");
    }
    for (contact, pin) in around.contacts.iter().zip(board.switches) {
        machine.connect_contact(pin, contact).context("contacts")?;
    }
    let voltages = description.voltages.iter().zip(&around.voltages);
    for ((part, voltage), pin) in voltages.zip(board.voltages) {
        machine.connect_voltage(*pin, voltage, part.divider).context("voltages")?;
    }
    for (servo, pin) in servos.iter().zip(board.servos) {
        machine.connect_servo(pin, servo).context("servos")?;
    }
    if let Some(line) = &around.console {
        machine.connect_serial(CONSOLE, line.serial(), false).context("console")?;
    }
    if let (Some(control), Some(link)) = (&description.remote, &around.remote) {
        match &link.wire {
            ReceiverWire::Serial(wire) => {
                let inverted = link.receiver.serial().is_some_and(|serial| serial.inverted);
                let inverted = inverted != board.inverts_remote;
                machine.connect_serial(control.uart, wire, inverted)
            }
            ReceiverWire::Pulses(wire) => machine.connect_pulses(board.pulses, wire),
        }
        .context("remote")?;
    }
    Ok(machine)
}

/// SHA-256 over identifier, length and data of all frames in the order of the wire, bus by bus.
pub fn content_hash(rig: &Rig) -> String {
    let mut hash = Sha256::new();
    for log in &rig.logs {
        for TraceEntry { frame, .. } in log {
            hash.update(frame.key().to_le_bytes());
            hash.update([frame.len() as u8]);
            hash.update(frame.bytes());
        }
    }
    hex_digits(hash)
}
