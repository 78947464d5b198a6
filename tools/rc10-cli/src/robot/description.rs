//! A robot for the tools: plain data of its motors and their surroundings.

use std::any::Any;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, ensure};
use rc10_emu::fault::{Fault, Kind};
use rc10_motor::__declaration::is_same;
use rc10_motor::{MotorId, Names, numbers};
use rc10_sim::fault::{Defect, is_called};
use rc10_sim::imu::Hwt101;
use rc10_sim::{ArmLink, Closed, Esc, Faults, Nanos, Serial, World};
use rc10_tasks::Program;
use rc10_tasks::boards::{Boards, Role};
use rc10_tasks::program::Active;
use rc10_time::Micros;
use serde_json::{Value, json};

use crate::robot::base::Base;
use crate::robot::build::{Wanted, build_firmware_in};
use crate::robot::mistake::Mistake;
use crate::robot::motor::{Motor, Place, Plant};
use crate::robot::remote::{Lost, RemoteControl, ScriptLine};
use crate::robot::script::{Event, Script};

/// A robot before it runs: its motors, buses, base, remote and script.
#[derive(Clone, Debug, Default)]
pub struct Description {
    /// Name of the robot; empty if it has none.
    pub name: String,
    /// All motors; those of one bus in the order in which they are attached to it.
    pub motors: Vec<Motor>,
    /// Number of buses, which are counted from 1 to this.
    pub buses: u8,
    /// RS-485 lines; the first is line 1.
    pub lines: Vec<LinePart>,
    /// The base on its wheels, if that is simulated.
    pub base: Option<Base>,
    /// Arms whose links hang on each other. (The weight of a single one is in its motor's [`Plant`].)
    pub arms: Vec<ArmPart>,
    /// Mechanisms as the page and the report draw them.
    pub mechanisms: Vec<Shape>,
    /// Own signals of the estimated pose: [`Robot::estimate`](crate::Robot::estimate).
    pub estimate: Option<PoseSignals>,
    /// Label of the own signal with the yaw by the IMU, degrees counter-clockwise, all turns counted, which a run
    /// compares with the wheels.
    pub yaw: Option<&'static str>,
    /// Own signals of the reference pose: [`Robot::reference`](crate::Robot::reference).
    pub reference: Option<PoseSignals>,
    /// Remote control with its operator's script, if there is one.
    pub remote: Option<RemoteControl>,
    /// Other parts on UARTs.
    pub serials: Vec<SerialPart>,
    /// Switches and markers on motors' shafts, in the order of the board's inputs for them.
    pub contacts: Vec<ContactPart>,
    /// What is measured at the board's inputs for voltages, in their order.
    pub voltages: Vec<VoltagePart>,
    /// Labels of the servos at the board's outputs for them, in their order.
    pub servos: Vec<&'static str>,
    /// The robot's other board, which is simulated, or emulated, with it.
    pub partner: Option<Partner>,
    /// Bit rate of the firmware's console, if not 921,600.
    pub console: Option<u32>,
    /// Script, for reports.
    pub script: Script,
    /// Builds the firmware and returns the path of its ELF file. `None`: `rc10 emu` needs the path.
    pub firmware: Option<fn(Wanted) -> Result<PathBuf>>,
    /// Injected faults of this run: [`Robot::set_faults`](crate::Robot::set_faults).
    pub faults: Vec<Fault>,
    /// Mistakes of this run: [`Robot::set_mistakes`](crate::Robot::set_mistakes).
    pub mistakes: Vec<Mistake>,
    /// Whether bus logs are only hashed: [`Robot::set_no_logs`](crate::Robot::set_no_logs).
    pub no_logs: bool,
}

/// An RS-485 line of the robot.
#[derive(Clone, Copy, Debug)]
pub struct LinePart {
    /// The chip's UART, with its driver enable: 2 for USART2.
    pub uart: u8,
}

/// A part on a UART of the robot.
#[derive(Clone, Copy, Debug)]
pub struct SerialPart {
    /// Label of the part.
    pub label: &'static str,
    /// The chip's UART: 1 for USART1.
    pub uart: u8,
    /// Bits a second, as declared.
    pub baud: u32,
    /// Puts its simulated twin at the end of a link; `None`: the robot's other board is there.
    pub twin: Option<SerialTwin>,
}

/// The other board of a robot: a program of its own, on the bus or UART that both are on.
#[derive(Clone, Copy, Debug)]
pub struct Partner {
    pub(crate) boards: Boards,
    /// What this board is to the other one.
    pub(crate) role: Role,
    pub(crate) description: fn() -> Description,
    /// A `Robot<'static>` of it.
    pub(crate) robot: fn() -> Result<Box<dyn Any>>,
}

/// An arm: the links that hang on each other, each on a motor.
#[derive(Clone, Debug)]
pub struct ArmPart {
    /// Indices into [`Description::motors`], and their links.
    pub(crate) links: Vec<(usize, ArmLink)>,
}

impl ArmPart {
    /// Creates an arm from the base outwards, in the robot's directions: they count upwards.
    pub fn new<N: Names>(links: impl IntoIterator<Item = (N, ArmLink)>) -> Self {
        Self { links: links.into_iter().map(|(motor, link)| (motor.index(), link)).collect() }
    }
}

/// A mechanism as the page and the report draw it, by the angles of its motors.
#[derive(Clone, Debug)]
pub struct Shape {
    label: &'static str,
    kind: &'static str,
    /// Indices into [`Description::motors`].
    pub(crate) motors: Vec<usize>,
    /// Degrees at the bottom and at the top.
    span: [f64; 2],
    /// Of each motor: its degrees where its link goes straight on, and the link's length in any unit.
    links: Vec<[f64; 2]>,
}

impl Shape {
    /// A lift, as a bar between two angles of a motor, degrees.
    pub fn lift<N: Names>(label: &'static str, motor: N, span: [f64; 2]) -> Self {
        let motors = vec![motor.index()];
        Self { label, kind: "bar", motors, span, links: Vec::new() }
    }

    /// An arm seen from its side, as a line for each link: its motor, which counts upwards; the degrees that it counts
    /// where the link is level, or stretched from the one before; and the link's length in any unit.
    pub fn arm<N: Names>(
        label: &'static str,
        links: impl IntoIterator<Item = (N, f64, f64)>,
    ) -> Self {
        let link = |(motor, zero, length): (N, f64, f64)| (motor.index(), [zero, length]);
        let (motors, links) = links.into_iter().map(link).unzip();
        Self { label, kind: "arm", motors, span: [0.0; 2], links }
    }

    /// A turret seen from above, as its angle from ahead, where its motor counts these degrees.
    pub fn turret<N: Names>(label: &'static str, motor: N, ahead: f64) -> Self {
        Self { kind: "turret", ..Self::arm(label, [(motor, ahead, 1.0)]) }
    }
}

/// A switch or marker on a motor's shaft: [`rc10_sim::Contact`].
#[derive(Clone, Copy, Debug)]
pub struct ContactPart {
    /// The motor: an index into [`Description::motors`].
    pub(crate) motor: usize,
    /// Where it is closed, in the robot's direction.
    pub closed: Closed,
    /// Whether it is wired by its contact that opens.
    pub opens: bool,
}

impl ContactPart {
    /// Creates a contact on the shaft of a motor, closed there: two angles are those of each turn.
    pub fn new<N: Names>(motor: N, closed: impl Into<Closed>) -> Self {
        Self { motor: motor.index(), closed: closed.into(), opens: false }
    }

    /// The same, wired by its contact that opens: [`Contact::opening`](rc10_sim::Contact::opening).
    #[must_use]
    pub const fn opening(self) -> Self {
        Self { opens: true, ..self }
    }
}

/// A voltage that the robot measures: [`rc10_sim::Voltage`].
#[derive(Clone, Copy, Debug)]
pub struct VoltagePart {
    /// The voltage divided by that at the chip's pin, 1 without a divider.
    pub divider: f64,
    /// The voltage now, volts.
    pub volts: Volts,
}

/// A voltage now, V: by the motors in the order of the description, and the base.
pub type Volts = fn(motors: &[Esc], base: Option<&rc10_sim::Base>) -> f64;

/// A part of a robot in simulation, under its name in the declaration.
#[derive(Clone, Copy, Debug)]
pub enum Twin {
    /// What is at the other end of a serial port.
    Serial(&'static str, SerialTwin),
    /// The robot's other board is there: [`Description::partner`].
    Board(&'static str),
    /// Where a contact is closed.
    Contact(&'static str, fn() -> ContactPart),
    /// What is measured.
    Voltage(&'static str, Volts),
}

/// Puts the twin of a serial part at the end of a link.
pub type SerialTwin = fn(world: &mut World, base: Option<&rc10_sim::Base>) -> Result<Serial>;

impl Twin {
    const fn label(&self) -> &'static str {
        match self {
            Self::Serial(label, _)
            | Self::Board(label)
            | Self::Contact(label, _)
            | Self::Voltage(label, _) => label,
        }
    }
}

/// A program in simulation: `rc10_cli::main_of` runs it.
pub trait Simulated: Program {
    /// The twins of its parts, one for each: others than declared do not compile.
    const TWINS: &'static [Twin] = &[];

    /// Its description: [`Description::of_program`], and what more is to be said.
    fn description() -> Description;
}

const fn assert_twins<P: Simulated>() {
    assert!(
        P::TWINS.len() == P::SERIALS.len() + P::CONTACTS.len() + P::VOLTAGES.len(),
        "`TWINS` has not one twin for each `serial`, `contact` and `voltage` of the declaration"
    );
    let mut at = 0;
    while at < P::TWINS.len() {
        let (mut found, mut part) = (false, 0);
        match P::TWINS[at] {
            Twin::Serial(label, _) | Twin::Board(label) => {
                while part < P::SERIALS.len() {
                    found |= is_same(label, P::SERIALS[part].label);
                    part += 1;
                }
            }
            Twin::Contact(label, _) => {
                while part < P::CONTACTS.len() {
                    found |= is_same(label, P::CONTACTS[part].0);
                    part += 1;
                }
            }
            Twin::Voltage(label, _) => {
                while part < P::VOLTAGES.len() {
                    found |= is_same(label, P::VOLTAGES[part].0);
                    part += 1;
                }
            }
        }
        assert!(found, "`TWINS` has a twin that the declaration does not have, or of another sort");
        at += 1;
    }
}

/// UART of the IMU, on the board that has a port for one.
const IMU_UART: u8 = 7;

/// An HWT101 or WT901 on the base.
fn wit(world: &mut World, base: Option<&rc10_sim::Base>) -> Result<Serial> {
    let base = base.context("the IMU must stand on a base")?;
    let phase = world.chance(Nanos::new(5_000_000));
    Ok(world.add_serial(Hwt101::SERIAL, Hwt101::new(base, phase)))
}

/// Labels of the three signals of a pose: m forward and m to the left of the odometry's start, and
/// the yaw in the signal's unit: `rad`, else degrees counter-clockwise.
pub type PoseSignals = [&'static str; 3];

/// Number of times that a text names a motor: `M3508 id 1` is not in `M3508 id 12`.
fn mentions(text: &str, name: &str) -> usize {
    let ends = text.match_indices(name).map(|(at, name)| &text[at + name.len()..]);
    ends.filter(|rest| !rest.starts_with(|next: char| next.is_ascii_digit())).count()
}

impl Description {
    /// The robot of a declaration: its motors with the loads of `plant`, its buses, and its lines on
    /// USART2 and further UARTs. The rest is set in the fields:
    ///
    /// ```
    /// use rc10_cli::{Description, Plant};
    /// # use rc10_motor::{Entry, Place::Bus, dji::{Config, Dji, M2006}, motors};
    /// # motors! {
    /// #     pub enum Name;
    /// #     pub struct Motors;
    /// #     Arm: Dji = Entry::new(Bus(1), Config::new(&M2006, 1)),
    /// # }
    /// let robot = Description::of(|name| match name {
    ///     Name::Arm => Plant::inertia(0.02),
    /// });
    /// assert_eq!((robot.buses, robot.motors[0].label), (1, "arm"));
    /// ```
    pub fn of<N: Names>(plant: impl Fn(N) -> Plant) -> Self {
        let motors = N::ALL.iter().map(|name| Motor::of(name.entry(), plant(*name)));
        Self {
            motors: motors.collect(),
            buses: u8::try_from(N::BUSES.len()).unwrap_or(u8::MAX),
            lines: (0..N::LINES).map(|line| LinePart { uart: 2 + line }).collect(),
            ..Self::default()
        }
    }

    /// The robot of a program, as [`of`](Self::of): with its console, its firmware in the folder `firmware` of its
    /// package, its IMU on the base, and the twins of its parts.
    pub fn of_program<P: Simulated>(plant: impl Fn(P::Name) -> Plant) -> Self {
        const { assert_twins::<P>() };
        let twin = |label: &str| P::TWINS.iter().find(|twin| twin.label() == label);
        let imu = P::HAS_IMU.then_some(SerialPart {
            label: "IMU",
            uart: IMU_UART,
            baud: Hwt101::SERIAL.baud,
            twin: Some(wit),
        });
        let serials = P::SERIALS.iter().filter_map(|part| match twin(part.label)? {
            &Twin::Serial(label, twin) => {
                Some(SerialPart { label, uart: part.uart, baud: part.baud, twin: Some(twin) })
            }
            &Twin::Board(label) => {
                Some(SerialPart { label, uart: part.uart, baud: part.baud, twin: None })
            }
            Twin::Contact(..) | Twin::Voltage(..) => None,
        });
        let contacts = P::CONTACTS.iter().filter_map(|(label, active)| match twin(label)? {
            Twin::Contact(_, part) => {
                Some(ContactPart { opens: *active == Active::High, ..part() })
            }
            Twin::Serial(..) | Twin::Board(_) | Twin::Voltage(..) => None,
        });
        let voltages = P::VOLTAGES.iter().filter_map(|(label, divider)| match twin(label)? {
            &Twin::Voltage(_, volts) => Some(VoltagePart { divider: f64::from(*divider), volts }),
            Twin::Serial(..) | Twin::Board(_) | Twin::Contact(..) => None,
        });
        let folder = Path::new(P::FOLDER).file_name().unwrap_or_default();
        let board = P::BOARD.to_lowercase();
        let name = if board.is_empty() { folder.to_string_lossy().into_owned() } else { board };
        Self {
            name,
            console: Some(P::CONSOLE),
            firmware: Some(|wanted| build_firmware_in(P::FOLDER, P::BOARD, wanted)),
            serials: imu.into_iter().chain(serials).collect(),
            contacts: contacts.collect(),
            voltages: voltages.collect(),
            servos: P::SERVOS.to_vec(),
            ..Self::of(plant)
        }
    }

    /// The motors of a bus, in the order in which they are attached.
    pub fn on_bus(&self, bus: u8) -> impl Iterator<Item = &Motor> {
        self.motors.iter().filter(move |motor| motor.on == Place::Bus(bus))
    }

    /// Checks that the robot can have such faults; fails if one is on a missing bus, line or part.
    pub fn check(&self, faults: &[Fault]) -> Result<()> {
        let Self { buses, lines, serials, contacts, motors, .. } = self;
        Faults::check(faults, usize::from(*buses), lines.len())?;
        for Fault { kind, .. } in faults {
            let Kind::Part(defect, name) = kind else { continue };
            let all_motors = || motors.iter().map(|motor| motor.label);
            let parts = || serials.iter().map(|part| part.label);
            let (what, labels): (_, Vec<&str>) = match defect {
                Defect::Cut | Defect::Power => {
                    ("part on a UART or motor", parts().chain(all_motors()).collect())
                }
                _ if defect.is_of_motor() => ("motor", all_motors().collect()),
                Defect::Noise => ("part on a UART", parts().collect()),
                _ => {
                    let motors = contacts.iter().filter_map(|it| motors.get(it.motor));
                    ("contact", motors.map(|motor| motor.label).collect())
                }
            };
            let is_there = labels.iter().any(|label| is_called(label, name));
            let all = if labels.is_empty() { "none".into() } else { labels.join(", ") };
            ensure!(is_there, "{kind}: there is no {what} `{name}`; there are: {all}");
        }
        Ok(())
    }

    /// The index of the motor of this name as a command line has it: `-` or `_` for spaces. Fails unless there is one.
    pub(crate) fn motor_called(&self, name: &str) -> Result<usize> {
        let meant = name.replace('_', "-");
        let at = self.motors.iter().position(|it| is_called(it.label, &meant));
        at.with_context(|| {
            let labels: Vec<_> = self.motors.iter().map(|it| it.label.replace(' ', "-")).collect();
            format!("there is no motor `{name}`; there are: {}", labels.join(", "))
        })
    }

    /// Indices of the motors of the mechanisms that are drawn.
    pub(crate) fn drawn_motors(&self) -> impl Iterator<Item = usize> {
        self.mechanisms.iter().flat_map(|it| &it.motors).copied()
    }

    /// What page and report draw: the wheels' places and ways, and the mechanisms.
    pub fn drawn(&self) -> Value {
        let wheels = self.base.iter().flat_map(|base| &base.chassis.wheels);
        let wheels = wheels.map(|it| json!([it.x, it.y, it.direction, it.radius]));
        let label = |line: &usize| self.motors.get(*line).map(|motor| motor.label);
        let mechanisms = self.mechanisms.iter().map(|it| {
            let motors: Vec<_> = it.motors.iter().map(label).collect();
            let Shape { label, kind, span, links, .. } = it;
            json!({ "label": label, "kind": kind, "motors": motors, "span": span, "links": links })
        });
        json!({ "wheels": wheels.collect::<Value>(), "mechanisms": mechanisms.collect::<Value>() })
    }

    /// The events before `end`, in order of time: the script's, the operator's, and the losses of
    /// the remote. Of the operator's actions in a loss only the last one is received, at its end.
    pub fn events(&self, end: Micros) -> Vec<Event> {
        let mut events = self.script.until(end);
        if let Some(remote) = &self.remote {
            let line = |line: &ScriptLine| Event { at: line.at, label: line.label };
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

    /// Adds a line with label and place for each motor that an error names by model and identifier.
    pub fn label(&self, error: anyhow::Error) -> anyhow::Error {
        let text = format!("{error:#}");
        let named = |motor: &&Motor| mentions(&text, &motor.name().to_string()) > 0;
        let motors: Vec<&Motor> = self.motors.iter().filter(named).collect();
        // Motors that conflict are on the same bus; others may have the same name.
        let mentioned = |on| -> usize {
            let mut names: Vec<String> = Vec::new();
            names.extend(motors.iter().filter(|m| m.on == on).map(|m| m.name().to_string()));
            let count = names.len();
            names.dedup();
            names.iter().map(|name| mentions(&text, name)).sum::<usize>().min(count)
        };
        let most = motors.iter().map(|motor| mentioned(motor.on)).max();
        if motors.is_empty() {
            return error;
        }
        let best = motors.iter().filter(|motor| Some(mentioned(motor.on)) == most);
        let whose =
            |motor: &&Motor| format!("\n      {}: {} is {}", motor.on, motor.label, motor.name());
        let whose: String = best.map(whose).collect();
        anyhow!("{text}{whose}")
    }

    /// The number of the motor with this index into [`Description::motors`] on its bus or line.
    pub fn number(&self, entry: usize) -> Option<MotorId> {
        numbers(self.motors.iter().map(|motor| motor.on)).nth(entry)
    }
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji::{self, Dji};
    use rc10_motor::{ArmSwitch, MotorBus, Safety};

    use super::*;
    use crate::robot::remote::tests as tests_of_remotes;

    #[test]
    fn actions_during_a_loss_become_events_at_its_end() {
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
            Motor::dji_on("wheel left", 1, &dji::M3508, 1),
            Motor::dji_on("wheel right", 1, &dji::M3508, 1),
            Motor::dji_on("lift", 2, &dji::M3508, 1),
            Motor::dji_on("yaw", 2, &dji::GM6020_CURRENT, 11),
        ];
        let description = Description { motors, buses: 2, ..<_>::default() };
        let labelled = |error: anyhow::Error| description.label(error).to_string();
        let switch = ArmSwitch::new();
        let mut motors = [1, 1].map(|id| Dji::new(dji::Config::new(&dji::M3508, id)).unwrap());
        let mut bus = MotorBus::new(&switch);
        let [left, right] = &mut motors;
        bus.attach(left, Safety::COAST).unwrap();
        let clash = bus.attach(right, Safety::COAST).unwrap_err();
        assert_eq!(
            labelled(clash.into()),
            "M3508 id 1 cannot share a bus with M3508 id 1: both send feedback with identifier \
             0x201; set another on one, or plug it in elsewhere\n      bus 1: wheel left is M3508 id 1\n      bus 1: wheel right is M3508 id 1"
        );
        let id = Dji::new(dji::Config::new(&dji::GM6020_CURRENT, 11)).unwrap_err();
        assert_eq!(
            labelled(id.into()),
            "GM6020 (current mode) id 11: `id` is 11, but must be 1 to 7\n      \
             bus 2: yaw is GM6020 (current mode) id 11"
        );
        let mut gains = dji::M3508.cascade;
        gains.speed.kp = -0.063;
        let gains = Dji::new(dji::Config::new(&dji::M3508, 1).with_cascade(gains)).unwrap_err();
        assert!(labelled(gains.into()).starts_with(
            "M3508 id 1: `speed.kp` is -0.063, but must be finite and not negative\n      bus 1: "
        ));
        assert_eq!(
            labelled(anyhow!("M3508 id 12 is not one of them")),
            "M3508 id 12 is not one of them"
        );
    }
}
