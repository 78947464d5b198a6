//! A robot's motors as the tools see them: what they are, what is on their shafts, and their
//! simulated twins.

use std::fmt;

use anyhow::{Context, Result, bail};
use rc10_motor::MotorName;
use rc10_motor::dji::{self, FeedbackRate, Model};
use rc10_motor::rc10_app::Direction;
use rc10_motor::signals::Message;
use rc10_sim::{Esc, EscConfig};

/// One motor of a robot, and what is on its shaft.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    /// Label of the motor. Motors whose labels begin with the same word share a plot.
    pub label: &'static str,
    /// The bus or line that it is plugged into.
    pub on: Place,
    /// The device that it is.
    pub device: Device,
    /// Direction in which the robot counts.
    pub direction: Direction,
    /// Inertia of what is on its output shaft, kg m². The wheels of a [`Base`](crate::Base) get
    /// theirs from it.
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

/// The bus or line of a motor; the first of each sort is 1.
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

/// The device of a motor, for the simulator and for tables.
#[derive(Clone, Copy, Debug)]
pub enum Device {
    /// One of DJI's.
    Dji {
        /// The model.
        model: &'static Model,
        /// The identifier set on it.
        id: u8,
        /// The feedback rate set on it.
        rate: FeedbackRate,
    },
    /// Any other on a CAN bus.
    Can {
        /// Its name on the bus.
        name: MotorName,
        /// Puts its simulated twin on a wire, with this inertia (kg m²) on its shaft.
        twin: fn(wire: &rc10_sim::Bus, inertia: f64) -> Result<Esc>,
        /// The messages in its frames.
        messages: fn() -> Vec<Message>,
        /// Facts about them that no DBC file can say: a sentence each.
        not_in_dbc: &'static [&'static str],
    },
    /// One on an RS-485 line.
    Line {
        /// Its name on the line.
        name: MotorName,
        /// Puts its simulated twin on a line, with this inertia (kg m²) on its shaft.
        twin: fn(line: &rc10_sim::Line, inertia: f64) -> Result<Esc>,
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

    /// Its name on buses and in tables.
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

    /// The messages in its frames.
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

    /// Facts about its frames that no DBC file can say: a sentence each.
    #[must_use]
    pub const fn not_in_dbc(&self) -> &'static [&'static str] {
        match self.device {
            Device::Dji { .. } => dji::signals::NOT_IN_DBC,
            Device::Can { not_in_dbc, .. } => not_in_dbc,
            Device::Line { .. } => &[],
        }
    }

    /// Whether its twin obeys another command than to coast.
    pub(crate) fn is_driven(&self, twin: &Esc) -> bool {
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
    pub fn plug_in(&self, wires: &[rc10_sim::Bus], lines: &[rc10_sim::Line]) -> Result<Esc> {
        let index = |number: u8| usize::from(number).checked_sub(1);
        let nowhere = || format!("there is no {}", self.on);
        let twin = match self.on {
            Place::Bus(number) => {
                let wire = index(number).and_then(|at| wires.get(at)).with_context(nowhere)?;
                match self.device {
                    Device::Dji { model, id, rate } => {
                        wire.add_esc(dji_twin(model, id, rate, self.inertia)?)?
                    }
                    Device::Can { twin, .. } => twin(wire, self.inertia)?,
                    Device::Line { .. } => bail!("it has no CAN: {} is nothing for it", self.on),
                }
            }
            Place::Line(number) => {
                let line = index(number).and_then(|at| lines.get(at)).with_context(nowhere)?;
                match self.device {
                    Device::Line { twin, .. } => twin(line, self.inertia)?,
                    _ => bail!("it has only CAN: {} is nothing for it", self.on),
                }
            }
        };
        twin.set_load(self.sign() * self.load);
        if let Some(mut travel) = self.travel {
            travel = travel.map(|end| self.sign() * end);
            travel.sort_by(f64::total_cmp);
            twin.set_travel(Some(travel));
        }
        Ok(twin)
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
