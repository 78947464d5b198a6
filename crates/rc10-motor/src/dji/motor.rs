//! The motor: its shaft, its loops, its frames.

use embedded_can::{Id, StandardId};
use rc10_app::maths::round_to_i16;
use rc10_app::{Amps, Cascade, Celsius, ConfigError, Direction, Gear, NewtonMetres};
use rc10_can::{CanFrame, IdPattern, Micros};

use super::config::{Effort, FeedbackRate, IdOutOfRange, Model};
use super::wire::{ENCODER_COUNTS, RawFeedback};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, Frames, MotorName, Ownership, Rate};
use crate::feedback::{Fault, Feedback};
use crate::motor::{CanMotor, FrameError, FrameKind, Loops, Motor, Tick};
use crate::request::{Request, RequestError, Response};
use crate::servo::Servo;
use crate::shaft::Shaft;
use crate::supervision::Link;
use crate::target::{Target, TargetError, TargetKind, TargetSet};

/// One DJI motor.
#[derive(Clone, Debug)]
pub struct Dji {
    model: &'static Model,
    id: u8,
    feedback_key: u32,
    command_id: StandardId,
    lane: usize,
    gear: Gear,
    direction: Direction,
    rate: FeedbackRate,
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
    /// The device set to identifier `id`, with its stock gearbox, turning forward, at 1 kHz
    /// feedback and with the gains that come with the model.
    ///
    /// # Errors
    /// [`IdOutOfRange`].
    pub fn new(model: &'static Model, id: u8) -> Result<Self, IdOutOfRange> {
        let feedback_id = model.feedback_id(id)?;
        let (command_id, lane) = model.command_lane(id)?;
        Ok(Self {
            model,
            id,
            feedback_key: CanFrame::key_of(feedback_id),
            command_id,
            lane,
            gear: model.gear,
            direction: Direction::Forward,
            rate: FeedbackRate::Hz1000,
            servo: servo(model, model.cascade),
            shaft: Shaft::new(ENCODER_COUNTS, model.gear, Direction::Forward),
            raw_per_effort: 0.0,
            amps_per_count: 0.0,
            torque_per_amp: 0.0,
            bytes: [0; 8],
        }
        .scaled())
    }

    /// With what follows from model, gear and direction.
    fn scaled(mut self) -> Self {
        let Model { full_scale, effort, amps_per_count, rotor_torque_constant, .. } = *self.model;
        let sign = f32::from(self.direction.sign());
        self.shaft = Shaft::new(ENCODER_COUNTS, self.gear, self.direction);
        self.raw_per_effort = sign * f32::from(full_scale) / effort.full();
        self.amps_per_count = sign * amps_per_count;
        self.torque_per_amp = rotor_torque_constant * self.gear.ratio();
        self
    }

    /// With another gearbox ([`Gear::DIRECT`] for none). The gains are scaled so that the rotor is
    /// driven as before; an explicit [`with_cascade`](Self::with_cascade) comes after this.
    #[must_use]
    pub fn with_gear(mut self, gear: Gear) -> Self {
        let factor = gear.ratio() / self.gear.ratio();
        let mut cascade = *self.servo.cascade();
        cascade.speed.kp *= factor;
        cascade.speed.ki *= factor;
        cascade.speed.kd *= factor;
        cascade.feed_forward *= factor;
        cascade.angle.output_limit /= factor;
        cascade.acceleration = cascade.acceleration / factor;
        (self.gear, self.servo) = (gear, servo(self.model, cascade));
        self.scaled()
    }

    /// Turning the given way.
    #[must_use]
    pub fn with_direction(mut self, direction: Direction) -> Self {
        self.direction = direction;
        self.scaled()
    }

    /// With the feedback rate that is set in the controller.
    #[must_use]
    pub const fn with_feedback_rate(mut self, rate: FeedbackRate) -> Self {
        self.rate = rate;
        self
    }

    /// With gains of your own.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn with_cascade(mut self, cascade: Cascade) -> Result<Self, ConfigError> {
        let named = |error: ConfigError| error.of_device(self.model.name, self.id.into());
        cascade.validate().map_err(named)?;
        self.servo = servo(self.model, cascade);
        Ok(self)
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
    fn reject(&self, frame: &CanFrame) -> Result<FrameKind, FrameError> {
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
    fn name(&self) -> MotorName {
        MotorName { model: self.model.name, id: self.id.into() }
    }

    fn supports(&self) -> TargetSet {
        self.servo.supports()
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        self.servo.set_target(target)
    }

    fn target(&self) -> Target {
        self.servo.target()
    }

    fn feedback(&self) -> Feedback {
        let feedback = self.shaft.feedback();
        if !self.shaft.is_known() {
            return feedback;
        }
        let raw = RawFeedback::unpack(&self.bytes);
        let amps = f32::from(raw.current) * self.amps_per_count;
        let torque = amps * self.torque_per_amp;
        let feedback =
            feedback.with_current(Amps::new(amps)).with_torque(NewtonMetres::new(torque));
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

    fn loops(&self) -> Option<Loops> {
        Some(self.servo.loops())
    }
}

impl CanMotor for Dji {
    fn can_ids(&self) -> CanIds {
        let feedback = StandardId::new(self.model.feedback_base + u16::from(self.id));
        let feedback = IdPattern::exact(Id::Standard(feedback.unwrap_or(StandardId::ZERO)));
        let command = IdPattern::exact(Id::Standard(self.command_id));
        CanIds::new().receives(Frames::new(feedback, 8, Rate::Hz(self.rate.hz()))).transmits(
            Frames::new(command, 8, Rate::EveryTick).owned(Ownership::Bytes(0b11 << self.lane)),
        )
    }

    fn unpack_feedback(
        &mut self,
        frame: &CanFrame,
        at: Micros,
        _: Link,
    ) -> Result<FrameKind, FrameError> {
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
