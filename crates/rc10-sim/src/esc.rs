//! DJI ESCs from the device's side: what they take from the bus, what they put on it.
//!
//! Nothing here is shared with the motor library: an error in one of the two shows as a
//! disagreement.

use std::fmt;

use rc10_can::embedded_can::{Id, StandardId};
use rc10_can::{CanFrame, Micros};

use crate::motor::{Drive, Motor, Plant};

/// Which ESC, in which mode.
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
    #[must_use]
    pub const fn last_id(self) -> u8 {
        match self {
            Self::C620 | Self::C610 => 8,
            Self::Gm6020Voltage | Self::Gm6020Current => 7,
        }
    }

    /// The motor that comes with it.
    #[must_use]
    pub const fn plant(self) -> Plant {
        match self {
            Self::C620 => Plant::m3508(),
            Self::C610 => Plant::m2006(),
            Self::Gm6020Voltage => Plant::gm6020_voltage(),
            Self::Gm6020Current => Plant::gm6020(),
        }
    }

    /// Command frames of ids 1 to 4 and of the rest.
    const fn command_ids(self) -> [u16; 2] {
        match self {
            Self::C620 | Self::C610 => [0x200, 0x1FF],
            Self::Gm6020Voltage => [0x1FF, 0x2FF],
            Self::Gm6020Current => [0x1FE, 0x2FE],
        }
    }

    const fn feedback_base(self) -> u16 {
        match self {
            Self::C620 | Self::C610 => 0x200,
            Self::Gm6020Voltage | Self::Gm6020Current => 0x204,
        }
    }

    /// Largest raw command that means something; more counts as this much.
    const fn full_scale(self) -> i16 {
        match self {
            Self::C620 | Self::Gm6020Current => 16384,
            Self::C610 => 10000,
            Self::Gm6020Voltage => 25000,
        }
    }

    /// Raw units per ampere in the feedback.
    const fn raw_per_ampere(self) -> f64 {
        match self {
            Self::C620 => 16384.0 / 20.0,
            Self::C610 => 10000.0 / 10.0,
            Self::Gm6020Voltage | Self::Gm6020Current => 16384.0 / 3.0,
        }
    }

    fn drive(self, raw: i16, plant: &Plant) -> Drive {
        let full = self.full_scale();
        let raw = f64::from(raw.clamp(-full, full));
        match self {
            // The fraction of full scale is all that is documented.
            Self::Gm6020Voltage => Drive::Voltage(raw / f64::from(full) * plant.supply),
            _ => Drive::Current(raw / self.raw_per_ampere()),
        }
    }
}

/// How often an ESC sends feedback (RoboMaster Assistant; factory setting 1 kHz). The GM6020 knows
/// only 1 kHz.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedbackRate {
    /// Every millisecond.
    #[default]
    Hz1000,
    /// Every 2 ms.
    Hz500,
    /// Every 4 ms.
    Hz250,
    /// Every 8 ms.
    Hz125,
}

impl FeedbackRate {
    /// Time from one feedback frame to the next.
    #[must_use]
    pub const fn period(self) -> Micros {
        Micros::from_millis(match self {
            Self::Hz1000 => 1,
            Self::Hz500 => 2,
            Self::Hz250 => 4,
            Self::Hz125 => 8,
        })
    }
}

/// An ESC with its motor, to be put on a bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscConfig {
    /// Which one.
    pub model: Model,
    /// Its id, 1 ..= [`Model::last_id`].
    pub id: u8,
    /// How often it reports.
    pub rate: FeedbackRate,
    /// The motor and its load.
    pub plant: Plant,
}

impl EscConfig {
    /// A model with its own motor, nothing on the shaft, feedback at 1 kHz.
    #[must_use]
    pub const fn new(model: Model, id: u8) -> Self {
        Self { model, id, rate: FeedbackRate::Hz1000, plant: model.plant() }
    }
}

/// An ESC cannot be set to this id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdOutOfRange {
    /// The ESC.
    pub model: Model,
    /// The id asked for.
    pub id: u8,
}

impl fmt::Display for IdOutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { model, id } = self;
        write!(f, "{model:?} takes ids 1 to {}, not {id}", model.last_id())
    }
}

impl std::error::Error for IdOutOfRange {}

/// What is true of an ESC and its motor, whatever its feedback says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscState {
    /// Speed of the rotor, rpm.
    pub rotor_rpm: f64,
    /// Speed of the output shaft, rpm.
    pub output_rpm: f64,
    /// Angle of the output shaft since the start of the world, degrees, over many turns.
    pub output_degrees: f64,
    /// Torque current, A.
    pub current: f64,
    /// Temperature of the motor, °C.
    pub temperature: f64,
    /// Whether the ESC has power.
    pub powered: bool,
    /// The raw command it obeys: the last one it got since power-on, 0 before.
    pub command: i16,
    /// Command frames it took.
    pub commands: u64,
    /// When the last of them arrived.
    pub last_command_at: Option<Micros>,
    /// Command frames it ignored because they had not eight bytes.
    pub wrong_length: u64,
    /// Feedback frames a newer one overwrote before the bus was free.
    pub feedback_overwritten: u64,
}

pub(crate) struct Device {
    model: Model,
    command_id: Id,
    slot: usize,
    feedback_id: StandardId,
    period: Micros,
    next_feedback: Micros,
    powered: bool,
    muted: bool,
    command: i16,
    commands: u64,
    last_command_at: Option<Micros>,
    wrong_length: u64,
    pub(crate) motor: Motor,
    /// Where it is plugged in.
    pub(crate) bus: usize,
    pub(crate) node: usize,
    /// Carries a wheel of a base.
    pub(crate) is_wheel: bool,
}

impl Device {
    /// Its place on the bus is the caller's to set.
    pub(crate) fn new(config: &EscConfig, rotor_angle: f64) -> Result<Self, IdOutOfRange> {
        let EscConfig { model, id, .. } = *config;
        let error = IdOutOfRange { model, id };
        if !(1..=model.last_id()).contains(&id) {
            return Err(error);
        }
        let index = usize::from(id - 1);
        let command_id = StandardId::new(model.command_ids()[index / 4]).ok_or(error)?;
        Ok(Self {
            model,
            command_id: command_id.into(),
            slot: index % 4,
            feedback_id: StandardId::new(model.feedback_base() + u16::from(id)).ok_or(error)?,
            period: config.rate.period(),
            next_feedback: Micros::ZERO,
            powered: true,
            muted: false,
            command: 0,
            commands: 0,
            last_command_at: None,
            wrong_length: 0,
            motor: Motor::new(config.plant, rotor_angle),
            bus: 0,
            node: 0,
            is_wheel: false,
        })
    }

    pub(crate) const fn period(&self) -> Micros {
        self.period
    }

    /// Feedback starts `phase` after now. Power on forgets the last command.
    pub(crate) fn power(&mut self, powered: bool, now: Micros, phase: Micros) {
        self.powered = powered;
        self.command = 0;
        self.next_feedback = now + phase;
    }

    pub(crate) const fn is_powered(&self) -> bool {
        self.powered
    }

    /// Muted or not: it goes on driving.
    pub(crate) const fn set_muted(&mut self, muted: bool) {
        self.muted = muted;
    }

    pub(crate) fn next_feedback(&self) -> Option<Micros> {
        self.powered.then_some(self.next_feedback)
    }

    /// The feedback that is due by now, if one is.
    pub(crate) fn feedback(&mut self, now: Micros) -> Option<CanFrame> {
        if !self.powered || now < self.next_feedback {
            return None;
        }
        self.next_feedback += self.period;
        (!self.muted).then(|| self.feedback_frame())
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "float casts saturate, as the ESC's own numbers do"
    )]
    fn feedback_frame(&self) -> CanFrame {
        let motor = &self.motor;
        let angle = ((motor.rotor_angle() * 8192.0) as u16).min(8191);
        let rpm = motor.rotor_rpm().round() as i16;
        let current = (motor.current * self.model.raw_per_ampere()).round() as i16;
        let temperature = match self.model {
            // C610 manual: this byte is null.
            Model::C610 => 0,
            _ => motor.temperature.round() as u8,
        };
        let [a, b] = angle.to_be_bytes();
        let [c, d] = rpm.to_be_bytes();
        let [e, f] = current.to_be_bytes();
        CanFrame::eight_bytes(self.feedback_id, [a, b, c, d, e, f, temperature, 0])
    }

    pub(crate) fn receive(&mut self, frame: &CanFrame, now: Micros) {
        if frame.is_remote() || frame.id() != self.command_id {
            return;
        }
        let Some(bytes) = frame.all_eight() else {
            self.wrong_length += 1;
            return;
        };
        self.command = i16::from_be_bytes([bytes[2 * self.slot], bytes[2 * self.slot + 1]]);
        self.commands += 1;
        self.last_command_at = Some(now);
    }

    pub(crate) fn step(&mut self) {
        let drive = if self.powered {
            self.model.drive(self.command, self.motor.plant())
        } else {
            Drive::Off
        };
        self.motor.step(drive);
    }

    pub(crate) fn state(&self, feedback_overwritten: u64) -> EscState {
        EscState {
            rotor_rpm: self.motor.rotor_rpm(),
            output_rpm: self.motor.output_rpm(),
            output_degrees: self.motor.output_degrees(),
            current: self.motor.current,
            temperature: self.motor.temperature,
            powered: self.powered,
            command: self.command,
            commands: self.commands,
            last_command_at: self.last_command_at,
            wrong_length: self.wrong_length,
            feedback_overwritten,
        }
    }
}
