//! The motor: its shaft, its loops, its frames.

use embedded_can::StandardId;
use rc10_app::maths::round_to_i16;
use rc10_app::{Amps, Cascade, Celsius, ConfigError, NewtonMetres};
use rc10_can::CanFrame;
use rc10_time::Micros;

use super::config::{Config, Effort, FeedbackRate, Model};
use super::wire::{ENCODER_COUNTS, RawFeedback};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, MotorName};
use crate::feedback::{Fault, Feedback};
use crate::motor::{CanMotor, FrameError, FrameKind, Heard, Link, Motor, Tick};
use crate::request::{Request, RequestError, Response};
use crate::servo::Servo;
use crate::shaft::Shaft;
use crate::target::TargetKind;

/// One DJI motor.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Dji {
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::dji"))]
    model: &'static Model,
    id: u8,
    #[cfg_attr(feature = "record", serde(skip))]
    rate: FeedbackRate,
    feedback_key: u32,
    #[cfg_attr(feature = "record", serde(skip, default = "crate::record::any::id"))]
    command_id: StandardId,
    lane: usize,
    servo: Servo,
    shaft: Shaft,
    /// Raw command per effort, with the direction.
    raw_per_effort: f32,
    /// Amperes per count of the current in the feedback, with the direction.
    amps_per_count: f32,
    /// Torque at the output per ampere, N m.
    torque_per_amp: f32,
    /// The newest feedback as received: what is rarely asked for is decoded when it is.
    bytes: [u8; 8],
}

impl Dji {
    /// The motor that is set up like this; [`ConfigError`] names a field that cannot be used.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        config.validate()?;
        let Config { model, id, gear, direction, rate, cascade } = config;
        let (feedback_id, command_id, lane) = model.ids(id)?;
        let Model { full_scale, effort, amps_per_count, rotor_torque_constant, .. } = *model;
        let sign = f32::from(direction.sign());
        Ok(Self {
            model,
            id,
            rate,
            feedback_key: CanFrame::key_of(feedback_id),
            command_id,
            lane,
            servo: servo(model, cascade),
            shaft: Shaft::new(ENCODER_COUNTS, gear, direction),
            raw_per_effort: sign * f32::from(full_scale) / effort.full(),
            amps_per_count: sign * amps_per_count,
            torque_per_amp: rotor_torque_constant * gear.ratio(),
            bytes: [0; 8],
        })
    }

    /// The model.
    pub const fn model(&self) -> &'static Model {
        self.model
    }

    /// The command it sends now: raw, as on the wire.
    pub fn raw_command(&self) -> i16 {
        round_to_i16(self.servo.effort() * self.raw_per_effort)
    }

    /// The error for a frame that is no feedback of this motor.
    #[cold] // An error: the good frame goes straight on.
    fn reject(&self, frame: &CanFrame) -> Heard {
        Err(if frame.key() != self.feedback_key {
            FrameError::NotMine
        } else if frame.all_eight().is_some() {
            FrameError::Encoder
        } else {
            FrameError::Length
        })
    }
}

/// A direct command may use full scale, whatever the speed loop's own limit.
const fn servo(model: &Model, cascade: Cascade) -> Servo {
    let effort = match model.effort {
        Effort::Current(_) => TargetKind::Current,
        Effort::Voltage => TargetKind::Duty,
    };
    Servo::of(effort, cascade).with_full_scale(model.effort.full())
}

impl Motor for Dji {
    handed_on!(supports, set_target, target, loops of [servo]);
    handed_on!(state but [model, rate, command_id]);

    fn name(&self) -> MotorName {
        MotorName { model: self.model.name, id: self.id.into() }
    }

    fn feedback(&self) -> Feedback {
        let feedback = self.shaft.feedback();
        if !self.shaft.is_known() {
            return feedback;
        }
        let raw = RawFeedback::unpack(&self.bytes);
        let amps = f32::from(raw.current) * self.amps_per_count;
        let torque = amps * self.torque_per_amp;
        let feedback = feedback
            .with_current(Amps::new(amps))
            .with_torque(NewtonMetres::new(torque))
            .with_effort(self.servo.effort());
        if self.model.has_temperature {
            feedback.with_temperature(Celsius::new(f32::from(raw.temperature)))
        } else {
            feedback
        }
    }

    /// None of these controllers has a documented error code.
    fn fault(&self) -> Option<Fault> {
        None
    }

    fn update(&mut self, tick: &Tick) {
        self.servo.update(tick, &self.shaft);
    }

    fn request(&mut self, request: Request) -> Result<Response, RequestError> {
        self.servo.request(request, &mut self.shaft)
    }
}

impl CanMotor for Dji {
    fn can_ids(&self) -> CanIds {
        Config::new(self.model, self.id).with_feedback_rate(self.rate).can_ids()
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, _: Link) -> Heard {
        let Some(bytes) = frame.all_eight() else { return self.reject(frame) };
        let RawFeedback { angle, rpm, .. } = RawFeedback::unpack(bytes);
        if frame.key() != self.feedback_key || u32::from(angle) >= ENCODER_COUNTS {
            return self.reject(frame);
        }
        self.bytes = *bytes;
        self.shaft.follow(angle.into(), rpm.into(), at);
        Ok(FrameKind::Feedback)
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        // The lane is one of 0, 2, 4, 6; said in a way that the compiler understands too.
        tx.lane(self.command_id, self.lane & 6, self.raw_command().to_be_bytes())
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        tx.lane(self.command_id, self.lane, [0, 0])
    }
}

#[cfg(test)]
mod tests;
