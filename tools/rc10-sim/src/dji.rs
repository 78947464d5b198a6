//! DJI ESCs from the device's side: what they take from the bus, what they put on it.

use rc10_can::CanFrame;
use rc10_can::embedded_can::{Id, StandardId};
use rc10_time::Micros;

use crate::device::{Device, Outbox, Taken, Winding};
use crate::motor::Shaft;
use crate::plant::Plant;

/// ESC and mode.
///
/// | model | commands, ids 1 – 4 / 5 – 8 | full scale | feedback |
/// |---|---|---|---|
/// | C620 | `0x200` / `0x1FF` | 16384 = 20 A | `0x200` + id |
/// | C610 | `0x200` / `0x1FF` | 10000 = 10 A | `0x200` + id |
/// | GM6020, voltage | `0x1FF` / `0x2FF` | 25000 = supply | `0x204` + id |
/// | GM6020, current | `0x1FE` / `0x2FE` | 16384 = 3 A | `0x204` + id |
///
/// Sources: C620, C610 and GM6020 manuals, CAN tables. The GM6020's current mode and its full
/// scale of 25000 are not in the 2018 manual (which says 30000): several teams' code agrees on
/// them. That 25000 stands for the whole supply is our estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// C620 with an M3508.
    C620,
    /// C610 with an M2006.
    C610,
    /// GM6020 set to voltage control.
    Gm6020Voltage,
    /// GM6020 set to current control.
    Gm6020Current,
}

impl Model {
    /// The highest id that can be set; the lowest is 1.
    pub const fn last_id(self) -> u8 {
        match self {
            Self::C620 | Self::C610 => 8,
            Self::Gm6020Voltage | Self::Gm6020Current => 7,
        }
    }

    /// The motor that comes with it.
    pub const fn plant(self) -> Plant {
        match self {
            Self::C620 => Plant::m3508(),
            Self::C610 => Plant::m2006(),
            Self::Gm6020Voltage => Plant::gm6020_voltage(),
            Self::Gm6020Current => Plant::gm6020(),
        }
    }

    /// Command frames of ids 1 to 4 and of the rest, and what is added to the id for feedback.
    const fn identifiers(self) -> ([u16; 2], u16) {
        match self {
            Self::C620 | Self::C610 => ([0x200, 0x1FF], 0x200),
            Self::Gm6020Voltage => ([0x1FF, 0x2FF], 0x204),
            Self::Gm6020Current => ([0x1FE, 0x2FE], 0x204),
        }
    }

    /// Largest raw command that means something, and raw units per ampere in the feedback.
    const fn scale(self) -> (i16, f64) {
        match self {
            Self::C620 => (16384, 16384.0 / 20.0),
            Self::C610 => (10000, 10000.0 / 10.0),
            Self::Gm6020Voltage => (25000, 16384.0 / 3.0),
            Self::Gm6020Current => (16384, 16384.0 / 3.0),
        }
    }

    fn drive(self, raw: i16, plant: &Plant) -> Winding {
        let (full, per_ampere) = self.scale();
        let raw = f64::from(raw.clamp(-full, full));
        match self {
            // The fraction of full scale is all that is documented.
            Self::Gm6020Voltage => Winding::Voltage(raw / f64::from(full) * plant.supply),
            _ => Winding::Current(raw / per_ampere),
        }
    }
}

/// Feedback rate of an ESC (RoboMaster Assistant; factory setting 1 kHz). The GM6020 knows
/// only 1 kHz.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedbackRate {
    /// Every millisecond.
    #[default]
    Hz1000 = 1,
    /// Every 2 ms.
    Hz500 = 2,
    /// Every 4 ms.
    Hz250 = 4,
    /// Every 8 ms.
    Hz125 = 8,
}

impl FeedbackRate {
    /// Time from one feedback frame to the next.
    pub const fn period(self) -> Micros {
        Micros::from_millis(self as u64)
    }
}

/// An ESC with its motor, to be put on a bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscConfig {
    /// ESC and mode.
    pub model: Model,
    /// The id, 1 ..= [`Model::last_id`].
    pub id: u8,
    /// The rate at which it reports.
    pub rate: FeedbackRate,
    /// The motor and its load.
    pub plant: Plant,
}

impl EscConfig {
    /// A model with its own motor, nothing on the shaft, feedback at 1 kHz.
    pub const fn new(model: Model, id: u8) -> Self {
        Self { model, id, rate: FeedbackRate::Hz1000, plant: model.plant() }
    }
}

/// An ESC cannot be set to this id.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{model:?} takes ids 1 to {}, not {id}", .model.last_id())]
pub struct IdOutOfRange {
    /// The ESC.
    pub model: Model,
    /// The id asked for.
    pub id: u8,
}

/// The electronics of one of them.
pub(crate) struct Dji {
    config: EscConfig,
    command_id: Id,
    slot: usize,
    feedback_id: StandardId,
    next_feedback: Micros,
    command: i16,
}

impl Dji {
    pub(crate) fn new(config: EscConfig) -> Result<Self, IdOutOfRange> {
        let EscConfig { model, id, .. } = config;
        let error = IdOutOfRange { model, id };
        if !(1..=model.last_id()).contains(&id) {
            return Err(error);
        }
        let index = usize::from(id - 1);
        let (commands, feedback) = model.identifiers();
        let command_id = StandardId::new(commands[index / 4]).ok_or(error)?;
        Ok(Self {
            config,
            command_id: command_id.into(),
            slot: index % 4,
            feedback_id: StandardId::new(feedback + u16::from(id)).ok_or(error)?,
            next_feedback: Micros::ZERO,
            command: 0,
        })
    }

    #[expect(clippy::cast_possible_truncation, reason = "saturates, as the ESC's own numbers do")]
    fn feedback(&self, shaft: &Shaft) -> CanFrame {
        let angle = ((shaft.rotor_angle() * 8192.0) as u16).min(8191);
        let rpm = shaft.rotor_rpm().round() as i16;
        let current = (shaft.current * self.config.model.scale().1).round() as i16;
        let temperature = match self.config.model {
            // C610 manual: this byte is null.
            Model::C610 => 0,
            _ => shaft.temperature.round() as u8,
        };
        let [a, b] = angle.to_be_bytes();
        let [c, d] = rpm.to_be_bytes();
        let [e, f] = current.to_be_bytes();
        CanFrame::eight_bytes(self.feedback_id, [a, b, c, d, e, f, temperature, 0])
    }
}

impl Device for Dji {
    fn set_id(&mut self, id: u8) -> bool {
        let Ok(other) = Self::new(EscConfig { id, ..self.config }) else { return false };
        *self = Self { next_feedback: self.next_feedback, command: self.command, ..other };
        true
    }

    fn power_on(&mut self, _shaft: &Shaft, now: Micros, phase: Micros) {
        self.command = 0;
        self.next_feedback = now + phase;
    }

    fn period(&self) -> Micros {
        self.config.rate.period()
    }

    fn receive(&mut self, frame: &CanFrame, _: &Shaft, _: Micros, _: &mut Outbox) -> Taken {
        if frame.is_remote() || frame.id() != self.command_id {
            return Taken::NotMine;
        }
        let Some(bytes) = frame.all_eight() else {
            return Taken::Malformed;
        };
        self.command = i16::from_be_bytes([bytes[2 * self.slot], bytes[2 * self.slot + 1]]);
        Taken::Yes
    }

    fn next_event(&self) -> Option<Micros> {
        Some(self.next_feedback)
    }

    fn advance(&mut self, shaft: &Shaft, now: Micros, out: &mut Outbox) {
        if now >= self.next_feedback {
            self.next_feedback += self.config.rate.period();
            out.push(self.feedback(shaft));
        }
    }

    fn drive(&mut self, shaft: &Shaft, _now: Micros) -> Winding {
        self.config.model.drive(self.command, &shaft.plant)
    }

    fn command(&self) -> i16 {
        self.command
    }
}
