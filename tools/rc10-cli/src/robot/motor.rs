//! A robot's motors for the tools: their devices, their loads, and their simulated twins.

use rc10_motor::dji::Model;
use std::fmt;
use std::rc::Rc;

use anyhow::Result;
use rc10_motor::rc10_app::Direction;
use rc10_motor::signals::Message;
use rc10_motor::{Entry, Loops, MotorName, SafeState, TargetKind, dji};
use rc10_sim::{Esc, Nonlinear};
use rc10_time::Micros;

pub use rc10_motor::{Device, Place};

/// The bit rate of all buses.
pub(crate) const BITS_PER_SECOND: u32 = 1_000_000;

/// One motor of a robot, and what is on its shaft.
#[derive(Clone, Debug)]
pub struct Motor {
    /// Label of the motor. Motors whose labels begin with the same word share a plot.
    pub label: &'static str,
    /// Bus or line of the motor.
    pub on: Place,
    /// Device of the motor.
    pub device: Device,
    /// Direction in which the robot counts.
    pub direction: Direction,
    /// Load on the output shaft.
    pub plant: Plant,
    /// The fastest that a PC may turn it, rpm; `None`: not at all.
    pub jog: Option<f64>,
    /// Whether its safe state is to hold or to brake, so that it may be driven in a stop.
    pub holds: bool,
    /// How old its feedback may be in a command: [`Entry::most_age`].
    pub most_age: Option<Micros>,
}

/// The load of a motor, and the device's simulated twin where that is not one of ours.
///
/// ```
/// use rc10_cli::Plant;
/// // An arm that stands in its own way, and weighs 2 N m.
/// let arm = Plant { load: -2.0, travel: Some([-10.0, 95.0]), ..Plant::inertia(0.02) };
/// // One whose weight depends on its angle, level at power-on, with half a degree of play.
/// use rc10_sim::Nonlinear;
/// let nonlinear = Nonlinear { gravity_torque: 2.0, backlash: 0.5, ..Nonlinear::NONE };
/// let swinging = Plant { nonlinear, ..Plant::inertia(0.02) };
/// ```
#[derive(Clone, Debug, Default)]
pub struct Plant {
    /// Inertia, kg m². The wheels of a [`Base`](crate::robot::base::Base) get theirs from it.
    pub inertia: f64,
    /// Constant torque from outside, such as a weight, N m; positive the way the robot counts.
    pub load: f64,
    /// Gravity by angle, cogging and backlash, the way the robot counts; all off at first.
    pub nonlinear: Nonlinear,
    /// Hard stops of a motor on a bus, such as the floor under a lift: lowest and highest angle,
    /// degrees since power-on in the robot's direction. `None`: no stops.
    pub travel: Option<[f64; 2]>,
    /// Angle of the rotor's encoder at power-on, degrees. `None`: random.
    pub rotor: Option<f64>,
    /// Own twin and messages, for a device that this crate does not know.
    pub own: Option<OwnTwin>,
}

/// An own simulated twin of a device on CAN, and the messages in its frames.
#[derive(Clone)]
pub struct OwnTwin {
    pub(super) twin: Rc<Twin>,
    pub(super) messages: Rc<[Message]>,
    pub(super) not_in_dbc: &'static [&'static str],
}

type Twin = dyn Fn(&rc10_sim::Bus, f64) -> Result<Esc>;

impl Plant {
    /// A load of nothing but an inertia, kg m².
    pub fn inertia(inertia: f64) -> Self {
        Self { inertia, ..Self::default() }
    }

    /// Sets an own twin: `twin` puts it on a wire, with this inertia (kg m²) on its shaft.
    #[must_use]
    pub fn with_twin(self, twin: impl Fn(&rc10_sim::Bus, f64) -> Result<Esc> + 'static) -> Self {
        let own = OwnTwin { twin: Rc::new(twin), messages: Rc::new([]), not_in_dbc: &[] };
        Self { own: Some(own), ..self }
    }

    /// Sets the messages in the frames of the own twin, and facts that a DBC file cannot express.
    #[must_use]
    pub fn with_messages(self, messages: &[Message], not_in_dbc: &'static [&'static str]) -> Self {
        let own = self.own.map(|own| OwnTwin { messages: messages.into(), not_in_dbc, ..own });
        Self { own, ..self }
    }
}

impl fmt::Debug for OwnTwin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OwnTwin").field("messages", &self.messages).finish_non_exhaustive()
    }
}

/// The place for a narrow column: `2`, or `L1` for a line.
pub(crate) fn short(on: Place) -> String {
    match on {
        Place::Bus(number) => number.to_string(),
        Place::Line(number) => format!("L{number}"),
    }
}

impl Motor {
    /// Creates a motor that coasts, with nothing on its shaft.
    pub fn new(label: &'static str, on: Place, device: Device) -> Self {
        let (direction, plant) = (device.direction(), Plant::default());
        let jog = None;
        Self { label, on, device, direction, plant, jog, holds: false, most_age: None }
    }

    /// Creates a DJI motor on a bus.
    #[cfg(test)]
    pub(crate) fn dji_on(label: &'static str, bus: u8, model: &'static Model, id: u8) -> Self {
        let config = rc10_motor::dji::Config::new(model, id);
        Self::new(label, Place::Bus(bus), config.device())
    }

    /// Creates the motor of an entry of a declaration.
    pub fn of(entry: &Entry<Device>, plant: Plant) -> Self {
        let holds = entry.safety.state != SafeState::Coast;
        let (most_age, jog) = (entry.most_age, entry.jog.map(|fastest| f64::from(fastest.get())));
        Self { holds, plant, jog, most_age, ..Self::new(entry.label, entry.on, entry.config) }
    }

    /// Name of the motor on buses and in tables.
    pub const fn name(&self) -> MotorName {
        self.device.name()
    }

    /// Model and identifier of a DJI motor.
    pub const fn dji(&self) -> Option<(&'static Model, u8)> {
        match &self.device {
            Device::Dji(config) => Some((config.model, config.id)),
            _ => None,
        }
    }

    /// Whether the twin obeys another command than to coast.
    pub(crate) fn is_driven(&self, twin: &Esc) -> bool {
        let state = twin.state();
        // DJI motors get a current or a voltage; the others a mode, too.
        if self.dji().is_some() { state.command != 0 } else { !state.open }
    }

    /// Whether the twin obeys a command that makes torque; unlike in
    /// [`is_driven`](Self::is_driven), a closed loop with a command of zero torque does not count.
    pub(crate) fn has_torque(&self, twin: &Esc) -> bool {
        self.is_driven(twin) && (self.dji().is_some() || !twin.state().idle)
    }

    /// The effort that the twin obeys, in the unit of its loops and in the robot's direction.
    pub fn effort(&self, twin: &Esc, loops: Loops) -> f64 {
        let state = twin.state();
        self.sign()
            * match (self.device, loops.effort) {
                (Device::Dji(dji::Config { model, .. }), _) => {
                    let full = match model.effort {
                        dji::Effort::Current(amps) => f64::from(amps),
                        dji::Effort::Voltage => 1.0,
                    };
                    f64::from(state.command) * full / f64::from(model.full_scale)
                }
                (_, TargetKind::Current) => state.current,
                _ => state.torque,
            }
    }

    /// 1 if the robot counts in the motor's direction, else -1.
    pub(crate) fn sign(&self) -> f64 {
        self.direction.sign().into()
    }
}
