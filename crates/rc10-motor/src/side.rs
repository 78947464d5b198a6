//! The side that closes a motor's loops: this crate, or the device.

use rc10_app::TotalAngle;

use crate::goal::Goals;
use crate::motor::{Loops, Withheld};
use crate::pending::Outcome;
use crate::request::Request;
use crate::servo::Servo;
use crate::shaft::Shaft;
use crate::target::{Target, TargetError, TargetSet};

#[expect(clippy::large_enum_variant, reason = "without a heap there is no other place")]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Side<D> {
    /// This crate.
    Here(Servo),
    /// The device, with what else is known of its loops.
    Device(Goals, D),
}

impl<D> Side<D> {
    pub(crate) const fn goals(&self) -> &Goals {
        match self {
            Self::Here(servo) => servo.goals(),
            Self::Device(goals, _) => goals,
        }
    }

    pub(crate) const fn supports(&self) -> TargetSet {
        self.goals().supports()
    }

    pub(crate) fn target(&self) -> Target {
        self.goals().target()
    }

    pub(crate) fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        match self {
            Self::Here(servo) => servo.set_target(target),
            Self::Device(goals, _) => goals.set_target(target),
        }
    }

    pub(crate) fn set_zero(&mut self, zero: TotalAngle) {
        match self {
            Self::Here(servo) => servo.set_zero(zero),
            Self::Device(goals, _) => goals.set_zero(zero),
        }
    }

    /// Nothing drives; what comes next starts softly.
    pub(crate) fn rest(&mut self) {
        match self {
            Self::Here(servo) => servo.rest(),
            Self::Device(goals, _) => goals.rest(),
        }
    }

    /// The effort decided last; NaN for loops of the device.
    pub(crate) const fn effort(&self) -> f32 {
        match self {
            Self::Here(servo) => servo.effort(),
            Self::Device(..) => f32::NAN,
        }
    }

    pub(crate) const fn loops(&self) -> Option<Loops> {
        match self {
            Self::Here(servo) => Some(servo.loops()),
            Self::Device(..) => None,
        }
    }

    /// Withholds a share of the effort from the target it has; loops of the device have none of ours.
    pub(crate) fn withhold(&mut self, withheld: Withheld) {
        if let Self::Here(servo) = self {
            servo.withhold(withheld);
        }
    }

    /// Carries out what a [`Servo`] can; for loops of the device only the zero.
    pub(crate) fn request(&mut self, request: Request, shaft: &mut Shaft) -> Outcome {
        match self {
            Self::Here(servo) => servo.request(request, shaft),
            Self::Device(goals, _) => goals.request(request, shaft),
        }
    }
}
