//! A robot's motors as the tools see them: what they are, what is on their shafts, and their
//! simulated twins.

use rc10_motor::dji::Model;
use std::fmt;
use std::rc::Rc;

use anyhow::Result;
use rc10_motor::rc10_app::Direction;
use rc10_motor::signals::Message;
use rc10_motor::{Entry, Loops, MotorName, SafeState, TargetKind, dji};
use rc10_sim::{Esc, Nonlinear};

pub use rc10_motor::{Device, Place};

/// The bit rate of all buses.
pub(crate) const BITS_PER_SECOND: u32 = 1_000_000;

/// One motor of a robot, and what is on its shaft.
#[derive(Clone, Debug)]
pub struct Motor {
    /// Label of the motor. Motors whose labels begin with the same word share a plot.
    pub label: &'static str,
    /// The bus or line that it is plugged into.
    pub on: Place,
    /// The device that it is.
    pub device: Device,
    /// Direction in which the robot counts.
    pub direction: Direction,
    /// What is on its output shaft.
    pub plant: Plant,
    /// Its safe state is to hold or to brake: it may be driven while the robot is stopped.
    pub holds: bool,
}

/// What is on a motor's output shaft, and the device's simulated twin where that is not one of ours.
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
    /// Hard stops of a motor on a bus: the angles between which the shaft turns, degrees since
    /// power-on the way the robot counts. The floor under a lift, for example. `None`: for ever.
    pub travel: Option<[f64; 2]>,
    /// Angle of the rotor in its turn at power-on, as the encoder on it says, degrees. `None`: by chance.
    pub rotor: Option<f64>,
    /// A twin of one's own, and its messages: for a device that this crate does not know.
    pub own: Option<OwnTwin>,
}

/// A simulated twin of a device on CAN that this crate does not know, and the messages in its frames.
#[derive(Clone)]
pub struct OwnTwin {
    pub(super) twin: Rc<Twin>,
    pub(super) messages: Rc<[Message]>,
    pub(super) not_in_dbc: &'static [&'static str],
}

/// Puts a twin on a wire, with an inertia on its shaft.
type Twin = dyn Fn(&rc10_sim::Bus, f64) -> Result<Esc>;

impl Plant {
    /// Nothing but an inertia, kg m².
    #[must_use]
    pub const fn inertia(inertia: f64) -> Self {
        Self {
            inertia,
            load: 0.0,
            nonlinear: Nonlinear::NONE,
            travel: None,
            rotor: None,
            own: None,
        }
    }

    /// With a twin of one's own: `twin` puts it on a wire, with this inertia (kg m²) on its shaft.
    #[must_use]
    pub fn with_twin(self, twin: impl Fn(&rc10_sim::Bus, f64) -> Result<Esc> + 'static) -> Self {
        let own = OwnTwin { twin: Rc::new(twin), messages: Rc::new([]), not_in_dbc: &[] };
        Self { own: Some(own), ..self }
    }

    /// With the messages in the frames of that twin, and facts about them that no DBC file can say: a
    /// sentence each.
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

/// For a narrow column: `2`, or `L1` for a line.
#[must_use]
pub(crate) fn short(on: Place) -> String {
    match on {
        Place::Bus(number) => number.to_string(),
        Place::Line(number) => format!("L{number}"),
    }
}

impl Motor {
    /// A motor that coasts, with nothing on its shaft.
    #[must_use]
    pub fn new(label: &'static str, on: Place, device: Device) -> Self {
        let (direction, plant) = (device.direction(), Plant::default());
        Self { label, on, device, direction, plant, holds: false }
    }

    /// One of DJI's on a bus.
    #[cfg(test)]
    pub(crate) fn dji_on(label: &'static str, bus: u8, model: &'static Model, id: u8) -> Self {
        let config = rc10_motor::dji::Config::new(model, id);
        Self::new(label, Place::Bus(bus), config.device())
    }

    /// The motor of a line of a declaration.
    #[must_use]
    pub fn of(entry: &Entry<Device>, plant: Plant) -> Self {
        let holds = entry.safety.state != SafeState::Coast;
        Self { holds, plant, ..Self::new(entry.label, entry.on, entry.config) }
    }

    /// Its name on buses and in tables.
    #[must_use]
    pub const fn name(&self) -> MotorName {
        self.device.name()
    }

    /// Model and identifier, if it is one of DJI's.
    #[must_use]
    pub const fn dji(&self) -> Option<(&'static Model, u8)> {
        match &self.device {
            Device::Dji(config) => Some((config.model, config.id)),
            _ => None,
        }
    }

    /// Whether its twin obeys another command than to coast.
    pub(crate) fn is_driven(&self, twin: &Esc) -> bool {
        let state = twin.state();
        // Those of DJI are told a current, or a voltage; the others what to do.
        if self.dji().is_some() { state.command != 0 } else { !state.open }
    }

    /// Whether its twin obeys a command that makes torque. Unlike [`is_driven`](Self::is_driven) this is
    /// not so of a device whose loop is on and told to give none.
    pub(crate) fn has_torque(&self, twin: &Esc) -> bool {
        self.is_driven(twin) && (self.dji().is_some() || !twin.state().idle)
    }

    /// The effort that its twin obeys, in the unit of the loops that command it, as the robot counts.
    #[must_use]
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

    /// 1 if it counts as the motor does, -1 if the other way.
    pub(crate) fn sign(&self) -> f64 {
        self.direction.sign().into()
    }
}
