use rc10_app::{Cascade, PidConfig, Seconds};
use rc10_can::CanFrame;
use rc10_time::Micros;

use crate::batch::{TxBatch, TxFull};
use crate::can_ids::{CanIds, MotorName};
use crate::feedback::{Condition, Fault, Feedback};
use crate::request::{Gains, Request, RequestError, Response};
use crate::target::{Target, TargetError, TargetKind, TargetSet};

/// A drive mode: what a motor may do in a tick, as its bus decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum DriveMode {
    /// The robot is disarmed: no torque; a device that can be disabled is.
    #[default]
    Off,
    /// No torque.
    Coast,
    /// Slow down and stand still.
    Brake,
    /// Slow down and keep the angle at which the shaft comes to a stand.
    Hold,
    /// Follow the target.
    Run,
}

rc10_app::states!(DriveMode: Off, Coast, Brake, Hold, Run);

/// The behaviour with an expired command or in an emergency stop. (A motor not heard coasts.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum SafeState {
    /// Turn freely. Right for wheels.
    #[default]
    Coast,
    /// Slow down actively and stand still.
    Brake,
    /// Hold the angle. Right for a lift, which would fall.
    Hold,
}

impl SafeState {
    /// The drive mode that brings it about.
    #[must_use]
    pub const fn mode(self) -> DriveMode {
        match self {
            Self::Coast => DriveMode::Coast,
            Self::Brake => DriveMode::Brake,
            Self::Hold => DriveMode::Hold,
        }
    }
}

/// The kind of a frame that a motor understood as its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    /// Feedback: it keeps the link alive.
    Feedback,
    /// Feedback with a fault: the safe state until [`Request::ClearFault`].
    Fault,
    /// Something else, such as the reply to a request: it does not keep the link alive.
    Other,
}

/// Why a frame is no feedback. It changes nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum FrameError {
    /// Another identifier, or a remote request.
    #[error("not a frame of this motor")]
    NotMine,
    /// Not the length that this frame always has.
    #[error("not the length that this frame always has")]
    Length,
    /// An encoder value that the device cannot have.
    #[error("an encoder value that the device cannot have")]
    Encoder,
    /// Content that the device cannot send.
    #[error("content that the device cannot send")]
    Unexpected,
    /// An answer to another program's request, or a late one. Not bad, but no feedback either.
    #[error("an answer to a request that was not made here")]
    Unasked,
}

/// The outcome of taking a frame.
pub type Heard = Result<FrameKind, FrameError>;

/// The control loops that follow speeds and angles, where they run here and not in the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loops {
    /// The effort: [`TargetKind::Current`], [`TargetKind::Torque`] or [`TargetKind::Duty`].
    pub effort: TargetKind,
    /// Their gains and limits. The speed loop's output limit is the largest effort.
    pub cascade: Cascade,
}

/// The numbers in a motor's [`Loops`] that [requests](Request) change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// The quantity of the effort, as in [`Loops`].
    pub effort: TargetKind,
    /// Gains of the speed loop.
    pub speed: Gains,
    /// Gains of the angle loop.
    pub angle: Gains,
    /// The largest effort.
    pub limit: f32,
}

impl Tuning {
    /// The tuning of some loops.
    #[must_use]
    pub const fn of(loops: &Loops) -> Self {
        const fn gains(pid: &PidConfig) -> Gains {
            Gains { kp: pid.kp, ki: pid.ki, kd: pid.kd }
        }
        let Loops { effort, cascade: Cascade { speed, angle, .. } } = loops;
        Self {
            effort: *effort,
            speed: gains(speed),
            angle: gains(angle),
            limit: speed.output_limit,
        }
    }
}

/// Whether a motor is heard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Link {
    /// No feedback since power-on.
    #[default]
    NeverSeen,
    /// Feedback is fresh.
    Online,
    /// No feedback for max(3 feedback periods, 10 ms).
    Lost,
}

rc10_app::states!(Link: NeverSeen, Online, Lost);

/// Data that a bus gives to a motor in every tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Time since the last tick, above 0 and at most 10 ms.
    pub dt: Seconds,
    /// The drive mode of the motor in this tick.
    pub mode: DriveMode,
    /// Whether it is heard. One that was lost may come back restarted, its turns counted anew.
    pub link: Link,
    /// Ticks so far, each motor from another number: slower work falls in different ticks.
    pub count: u32,
    /// Whether it runs by a [`Request::Jog`] in this tick: with little effort.
    pub is_jog: bool,
}

impl Tick {
    /// One millisecond of a motor that is heard: for tests and loops without a bus.
    pub const fn new(mode: DriveMode) -> Self {
        Self { dt: Seconds::new(0.001), mode, link: Link::Online, count: 0, is_jog: false }
    }
}

/// A motor, whatever it is connected by.
pub trait Motor: Send {
    /// Model and identifier, for errors and tables.
    fn name(&self) -> MotorName;

    /// The targets it takes, so that a port can refuse the others where the caller sees it.
    fn supports(&self) -> TargetSet;

    /// Takes a new target; it takes effect in the next [`update`](Self::update).
    ///
    /// # Errors
    /// [`TargetError`]; the old target stays.
    fn set_target(&mut self, target: Target) -> Result<(), TargetError>;

    /// The target; of a motion, where it is now. [`Request::SetZero`] moves it to the new zero.
    fn target(&self) -> Target;

    /// The newest measurements; all zero before the first feedback.
    fn feedback(&self) -> Feedback;

    /// The fault that the device reports.
    fn fault(&self) -> Option<Fault>;

    /// One step of its control loops. Only maths: what it decides leaves with the next command.
    fn update(&mut self, tick: &Tick);

    /// Makes a request. After [`Response::Pending`] all further requests are
    /// [`Busy`](RequestError::Busy), until [`response`](Self::response) has told the outcome.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed.
    fn request(&mut self, request: Request) -> Result<Response, RequestError>;

    /// The outcome of a [`Pending`](Response::Pending) request, told once, also of a silent device.
    fn response(&mut self) -> Option<Result<Response, RequestError>> {
        None
    }

    /// Whether it does what its target says, given that it may run.
    fn condition(&self) -> Condition {
        Condition::Ready
    }

    /// The loops for [`Target::Speed`] and angles; `None` if they run in the device.
    fn loops(&self) -> Option<Loops> {
        None
    }

    /// Withholds a part of the largest effort of its [`loops`](Self::loops) from the target that it has, a speed, an
    /// angle or a motion. The next target has all of it again.
    fn withhold(&mut self, _withheld: Withheld) {}

    /// Writes all that changes while it runs, for [a record](crate::record::save).
    #[cfg(feature = "record")]
    fn save(&self, _to: &mut dyn FnMut(&[u8])) {}

    /// Takes back what [`save`](Self::save) has written; false for something else.
    #[cfg(feature = "record")]
    fn load(&mut self, _from: &[u8]) -> bool {
        true
    }

    /// The same as a text, a field a line.
    #[cfg(all(feature = "record", not(target_os = "none")))]
    fn show(&self, _to: &mut dyn core::fmt::Write) -> core::fmt::Result {
        Ok(())
    }
}

/// Shares of a motor's largest effort that a command withholds from its loops, 0 ..= 1 (beyond is limited).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Withheld {
    /// From what drives the shaft the way it turns, or from a standstill.
    pub driving: f32,
    /// From what brakes it. A motor that is stopped brakes with all of it.
    pub braking: f32,
}

impl Withheld {
    /// Nothing.
    pub const NONE: Self = Self { driving: 0.0, braking: 0.0 };

    /// Whether it is anything.
    #[must_use]
    pub fn is_any(self) -> bool {
        self.driving != 0.0 || self.braking != 0.0
    }
}

/// A motor on a CAN bus.
pub trait CanMotor: Motor {
    /// The identifiers it occupies on its bus. Always the same.
    fn can_ids(&self) -> CanIds;

    /// Takes an own frame of `at`, and says what it was. `link` is the bus's knowledge until then.
    ///
    /// # Errors
    /// [`FrameError`]; the frame changed nothing.
    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, link: Link) -> Heard;

    /// Adds its frames of this tick, also while disarmed or lost, to enable, poll, or say "zero".
    /// They leave in arbitration order: what must follow waits for the next tick.
    ///
    /// # Errors
    /// [`TxFull`] if the batch has no room.
    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull>;

    /// Adds the frames, if all fit, that leave it without torque in any state: for a panic handler.
    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull>;
}
