//! The environment of a robot, without the robot: wires, ESCs with their motors and loads, a base.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fmt;
use std::pin::Pin;

use anyhow::{Context, Result, anyhow, ensure};
use rc10_emu::fault::ChipFault;
use rc10_motor::rc10_app::Direction;
use rc10_sim::remote::Remote;
use rc10_sim::{
    ArmLink, Base, BusConfig, Contact, Esc, Faults, LineConfig, Mounting, Nanos, Parts, Serial,
    SerialConfig, Tasks, Voltage, WheelMotors, World,
};
use rc10_time::Micros;

use crate::formats::slcan::host::HostPort;
use crate::robot::description::Description;
use crate::robot::mistake::Mistake;
use crate::robot::operator::Operator;
use crate::robot::remote::{Receiver, ReceiverWire, mixer};
use crate::world::built::Built;
use crate::world::console::ConsoleLine;

/// The environment of a robot: a simulated world.
pub struct Environment {
    /// The simulated world and its time.
    pub world: World,
    /// The wires; bus 1 is the first.
    pub wires: Vec<rc10_sim::Bus>,
    /// The RS-485 lines; line 1 is the first.
    pub lines: Vec<rc10_sim::Line>,
    /// The motors' twins, in the order of [`Description::motors`].
    pub motors: Vec<Esc>,
    /// The base on its wheels, if the robot has one.
    pub base: Option<Base>,
    /// The parts on UARTs, in the order of [`Description::serials`].
    pub serials: Vec<Serial>,
    /// The switches and markers on motors' shafts, in the order of [`Description::contacts`].
    pub contacts: Vec<Contact>,
    /// The voltages, in the order of [`Description::voltages`].
    pub voltages: Vec<Voltage>,
    /// The remote with the receiver, if the robot has one.
    pub remote: Option<RemoteLink>,
    /// The operator of the remote.
    pub operator: Option<Operator>,
    /// The line from the console to a PC: [`with_console`](Self::with_console).
    pub console: Option<ConsoleLine>,
    /// That of the robot's other board, in the same world.
    pub partner: Option<Box<Self>>,
    /// What is not simulated: [`leave_to`](Self::leave_to).
    pub(crate) real: BTreeMap<Real, RealEnd>,
}

/// What of a robot may be real, at an adapter of this PC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Real {
    Bus(u8),
    Line(u8),
    Receiver,
}

/// The adapter's end of it.
#[derive(Clone)]
pub(crate) enum RealEnd {
    Frames(HostPort),
    Bytes(ConsoleLine),
}

impl fmt::Display for Real {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(number) => write!(f, "bus {number}"),
            Self::Line(number) => write!(f, "line {number}"),
            Self::Receiver => f.write_str("remote"),
        }
    }
}

/// A remote, and its receiver at the end of a wire.
#[derive(Clone)]
pub struct RemoteLink {
    /// The remote.
    pub remote: Remote,
    /// The kind of receiver.
    pub receiver: Receiver,
    /// Wire of the receiver.
    pub wire: ReceiverWire,
}

/// What the environment of the other board has of this one's.
enum Shared<'w> {
    /// A bus, which has this number there.
    Bus(u8, &'w rc10_sim::Bus),
    /// The other end of a serial line.
    Uart(&'w Serial),
}

impl Environment {
    /// Builds the environment of a description, with its mistakes, and all chance from `seed`.
    /// Fails if a mistake cannot be made; a motor has no simulated ESC, or is on a missing bus; the
    /// wheels of the base are not as many motors, one each; or a contact is on no motor, never
    /// closed or never open.
    pub fn new(description: &Description, seed: u64) -> Result<Self> {
        Self::starting_at(Micros::ZERO, description, seed)
    }

    /// Builds it like [`new`](Self::new), in a world that starts at a later time.
    pub fn starting_at(start: Micros, description: &Description, seed: u64) -> Result<Self> {
        Self::within(World::starting_at(start, seed), description, None)
    }

    /// Builds it within a world, of whose wires it shares one.
    fn within(
        mut world: World,
        description: &Description,
        shared: Option<Shared<'_>>,
    ) -> Result<Self> {
        let mut wire = |number| match &shared {
            Some(Shared::Bus(here, wire)) if *here == number => wire.another_end(),
            _ => world.add_bus(BusConfig::default()),
        };
        let wires: Vec<_> = (1..=description.buses).map(&mut wire).collect();
        let lines: Vec<_> =
            description.lines.iter().map(|_| world.add_line(LineConfig::default())).collect();
        let mut motors = Vec::new();
        let built = Built::new(description)?;
        for (index, motor) in built.motors.iter().enumerate() {
            let twin = motor.plug_in(&wires, &lines);
            let twin = twin.with_context(|| format!("motor table, {}", motor.label))?;
            built.finish(index, &twin).with_context(|| format!("mistake, {}", motor.label))?;
            motors.push(twin);
        }
        let mounted = |line: usize| {
            let motor = built.motors.get(line).zip(motors.get(line));
            let (motor, esc) =
                motor.with_context(|| format!("there is no motor in line {line}"))?;
            let mounting = match motor.direction {
                Direction::Forward => Mounting::Normal,
                Direction::Reversed => Mounting::Mirrored,
            };
            anyhow::Ok((esc, mounting))
        };
        for arm in &built.arms {
            let link = |(line, link): &(usize, ArmLink)| {
                mounted(*line).map(|(esc, mounting)| (esc, mounting, *link))
            };
            let links: Vec<_> = arm.links.iter().map(link).collect::<Result<_>>().context("arm")?;
            world.add_arm(links).context("arm")?;
        }
        let mut base = None;
        if let Some((under, chassis)) = description.base.as_ref().zip(built.chassis) {
            let mut steering = under.steering.iter();
            let mut wheels = Vec::new();
            for (line, wheel) in under.wheels.iter().zip(&chassis.wheels) {
                let steers = wheel.steering.and_then(|_| steering.next());
                let steering = steers.map(|line| mounted(*line)).transpose().context("base")?;
                wheels.push(WheelMotors { drive: mounted(*line).context("base")?, steering });
            }
            let (turn, steer, all) =
                (under.wheels.len(), under.steering.len(), chassis.wheels.len());
            ensure!(
                turn == all && steering.next().is_none(),
                "base: {turn} motors turn and {steer} steer, but that is not what its {all} wheels need"
            );
            let mut added = world.add_base(chassis, wheels).context("base")?;
            added.is_imu_over = description.mistakes.contains(&Mistake::ImuOver);
            base = Some(added);
        }
        let (mut serials, mut other_end, mut is_taken) = (Vec::new(), None, false);
        for part in &description.serials {
            let baud = description.partner.and_then(|other| other.boards.baud());
            let twin = match (part.twin, &shared, baud) {
                (Some(twin), ..) => twin(&mut world, base.as_ref()),
                (None, _, Some(baud)) if baud != part.baud => {
                    Err(anyhow!("it is declared at {} baud, the boards are at {baud}", part.baud))
                }
                (None, Some(Shared::Uart(end)), _) if !is_taken => {
                    is_taken = true;
                    Ok((*end).clone())
                }
                (None, None, Some(baud)) if other_end.is_none() => {
                    let [here, there] =
                        world.add_serial_pair(SerialConfig { baud, ..<_>::default() });
                    other_end = Some(there);
                    Ok(here)
                }
                _ => Err(anyhow!("there is no other board for it on a UART")),
            };
            serials.push(twin.with_context(|| format!("parts on UARTs, {}", part.label))?);
        }
        let mut contacts = Vec::new();
        for part in &description.contacts {
            let line = part.motor;
            let (motor, esc) = (built.motors.get(line).zip(motors.get(line)))
                .with_context(|| format!("contacts: there is no motor in line {line}"))?;
            let is_mirrored = motor.direction == Direction::Reversed;
            let closed = if is_mirrored { part.closed.mirrored() } else { part.closed };
            let contact = Contact::new(esc, closed);
            let contact = contact.with_context(|| format!("contacts, {}", motor.label))?;
            contacts.push(if part.opens { contact.opening() } else { contact });
        }
        let voltages = description.voltages.iter().map(|part| {
            let (volts, motors, base) = (part.volts, motors.clone(), base.clone());
            Voltage::new(move || volts(&motors, base.as_ref()))
        });
        let voltages = voltages.collect();
        let (mut remote, mut operator) = (None, None);
        if let Some(control) = &description.remote {
            let hands = Remote::new();
            operator = Some(Operator::new(&hands, control));
            hands.set_mixer(mixer(&control.channels));
            let receiver = control.receiver;
            let wire = ReceiverWire::new(receiver, &mut world, &hands);
            remote = Some(RemoteLink { remote: hands, receiver, wire });
        }
        let mut partner = None;
        // That of the other board is this one.
        if let (Some(other), None) = (&description.partner, &shared) {
            let shared = if let Some([here, there]) = other.boards.buses(other.role) {
                let wire = usize::from(here).checked_sub(1).and_then(|at| wires.get(at));
                let wire = wire.with_context(|| format!("the other board: there is no bus {here}"));
                Shared::Bus(there, wire?)
            } else {
                let end = other_end.as_ref();
                Shared::Uart(end.context("the other board: no `Twin::Board` says at which UART")?)
            };
            let around = Self::within(world.another(), &(other.description)(), Some(shared));
            let mut around = around.context("the other board")?;
            // One of the two has the remote.
            operator = operator.or(around.operator.take());
            remote = remote.or_else(|| around.remote.clone());
            partner = Some(Box::new(around));
        }
        let console = None;
        Ok(Self {
            world,
            wires,
            lines,
            motors,
            base,
            serials,
            contacts,
            voltages,
            remote,
            operator,
            console,
            partner,
            real: BTreeMap::new(),
        })
    }

    /// The faults of a description in this environment; fails if a bus or line does not exist.
    pub fn faults(&self, description: &Description) -> Result<Faults<ChipFault>> {
        let mut faults = Faults::new(&self.wires, &self.lines, &description.faults)?;
        faults.set_parts(self.parts(description));
        Ok(faults)
    }

    /// The parts on UARTs, contacts and motors by their labels.
    pub(crate) fn parts(&self, description: &Description) -> Parts {
        let serials = description.serials.iter().map(|part| part.label.to_owned());
        let motors = description.contacts.iter().filter_map(|it| description.motors.get(it.motor));
        let labels = motors.map(|motor| motor.label.to_owned());
        let motors = description.motors.iter().map(|motor| motor.label.to_owned());
        Parts {
            serials: serials.zip(self.serials.iter().cloned()).collect(),
            contacts: labels.zip(self.contacts.iter().cloned()).collect(),
            motors: motors.zip(self.motors.iter().cloned()).collect(),
        }
    }

    /// Adds a PC at the console.
    #[must_use]
    pub fn with_console(mut self, baud: u32) -> Self {
        self.console = Some(ConsoleLine::new(&mut self.world, baud));
        self
    }

    /// Leaves only the remote of this world, unless it is real, too: all else that is not real is not there.
    pub(crate) fn leave_to(&mut self, real: impl IntoIterator<Item = Real>) {
        self.motors.iter().for_each(|twin| twin.set_power(false));
        self.serials.iter().for_each(|part| part.set_cut(true));
        (self.base, self.partner) = (None, None);
        for real in real {
            let end = if matches!(real, Real::Bus(_)) {
                RealEnd::Frames(HostPort::default())
            } else {
                // The adapter's bit rate has spaced the bytes.
                RealEnd::Bytes(ConsoleLine::new(&mut self.world, LineConfig::default().baud))
            };
            if let (Real::Receiver, RealEnd::Bytes(line), Some(remote)) =
                (real, &end, &mut self.remote)
            {
                remote.wire = ReceiverWire::Serial(line.serial().clone());
                self.operator = None;
            }
            self.real.insert(real, end);
        }
    }

    /// Runs the robot's tasks and its operator up to a time; time goes on also without tasks.
    pub fn run(&mut self, tasks: &mut Tasks<'_>, until: Micros) {
        let Self { world, operator, .. } = self;
        operate(operator.as_mut(), until, |until| {
            if world.run(Pin::new(tasks), until).is_ready() {
                world.advance(until);
            }
            Ok(())
        })
        .unwrap_or_else(|never: Infallible| match never {});
    }
}

/// Advances time by `run` to each action of an operator, and to `until`; fails if `run` does.
pub fn operate<E>(
    mut operator: Option<&mut Operator>,
    until: Micros,
    mut run: impl FnMut(Micros) -> Result<(), E>,
) -> Result<(), E> {
    loop {
        let next = operator.as_ref().and_then(|operator| operator.next());
        let next = next.filter(|next| *next < until);
        run(next.unwrap_or(until))?;
        match (&mut operator, next) {
            (Some(operator), Some(next)) => operator.act(next),
            _ => return Ok(()),
        }
    }
}

/// The first whole microsecond that is not before a time: tasks know no finer time.
pub(crate) const fn rounded_up(time: Nanos) -> Micros {
    Micros::new(time.get().div_ceil(1000))
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji;

    use super::*;
    use crate::robot::base::Base;
    use crate::robot::description::ContactPart;
    use crate::robot::motor::{Motor, Place};

    #[test]
    fn what_cannot_be_built_is_named() {
        const OTHER: dji::Model = dji::Model { name: "M3508 without gearbox", ..dji::M3508 };
        let complaint = |motor: Motor, wheels: Option<&[usize]>| {
            let base = wheels.map(|wheels| Base {
                wheels: wheels.into(),
                steering: Vec::new(),
                chassis: <_>::default(),
            });
            let description =
                Description { motors: vec![motor; 4], buses: 2, base, ..<_>::default() };
            Environment::new(&description, 1).err().map(|error| format!("{error:#}"))
        };
        let arm = Motor::dji_on("arm", 2, &dji::M2006, 1);
        assert_eq!(complaint(arm.clone(), None), None);
        for (motor, wheels, words) in [
            (
                Motor { on: Place::Bus(0), ..arm.clone() },
                None,
                "motor table, arm: there is no bus 0",
            ),
            (
                Motor { on: Place::Bus(3), ..arm.clone() },
                None,
                "motor table, arm: there is no bus 3",
            ),
            (
                Motor::dji_on("arm", 2, &OTHER, 1),
                None,
                "motor table, arm: there is no simulated M3508 without gearbox: give the motor a \
                 twin of its own, by `Plant::with_twin`",
            ),
            (arm.clone(), Some(&[0, 1, 2, 4][..]), "base: there is no motor in line 4"),
            (
                arm.clone(),
                Some(&[0, 1, 2][..]),
                "base: 3 motors turn and 0 steer, but that is not what its 4 wheels need",
            ),
        ] {
            assert_eq!(complaint(motor, wheels).as_deref(), Some(words));
        }
        for (motor, closed, words) in [
            (0, [350.0, 370.0], None),
            (4, [350.0, 370.0], Some("contacts: there is no motor in line 4")),
            (
                1,
                [20.0, 20.0],
                Some(
                    "contacts, arm: closed from 20 to 20 degrees is no part of a turn: less than all \
                     of it, the lower angle first",
                ),
            ),
        ] {
            let contacts = vec![ContactPart { motor, closed: closed.into(), opens: false }];
            let motors = vec![arm.clone(); 4];
            let description = Description { motors, buses: 2, contacts, ..<_>::default() };
            let said = Environment::new(&description, 1).err().map(|error| format!("{error:#}"));
            assert_eq!(said.as_deref(), words);
        }
        assert!(complaint(Motor::dji_on("arm", 2, &dji::M2006, 9), None).is_some());
        assert!(complaint(arm, Some(&[0, 1, 2, 2])).is_some());
    }
}
