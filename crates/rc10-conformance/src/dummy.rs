use rc10_can::{CanFrame, Micros};
use rc10_motor::pending::Outcome;
use rc10_motor::{
    CanIds, CanMotor, Fault, Feedback, FrameError, FrameKind, Link, Motor, MotorName, Request,
    RequestError, Target, TargetError, TargetKind, TargetSet, Tick, TxBatch, TxFull,
};

/// A motor without a device, for tests of a bus: it occupies identifiers, takes every frame for
/// feedback, only coasts and sends nothing.
#[derive(Clone, Copy, Debug)]
pub struct Dummy<A = ()> {
    name: MotorName,
    ids: CanIds,
    acts: A,
}

/// Behaviour of a [`Dummy`]: none by default.
pub trait Acts: Send {
    /// As [`Motor::update`].
    fn update(&mut self, _tick: &Tick) {}

    /// As [`Motor::request`].
    ///
    /// # Errors
    /// [`RequestError`].
    fn request(&mut self, _request: Request) -> Outcome {
        Err(RequestError::Unsupported)
    }

    /// As [`Motor::response`].
    fn response(&mut self) -> Option<Outcome> {
        None
    }
}

impl Acts for () {}

impl Dummy {
    /// A motor that is nothing but its identifiers.
    #[must_use]
    pub const fn new(model: &'static str, id: u16, ids: CanIds) -> Self {
        Self { name: MotorName { model, id }, ids, acts: () }
    }

    /// The same with a behaviour.
    pub fn with<A: Acts>(self, acts: A) -> Dummy<A> {
        Dummy { name: self.name, ids: self.ids, acts }
    }
}

impl<A: Acts> Motor for Dummy<A> {
    fn name(&self) -> MotorName {
        self.name
    }

    fn supports(&self) -> TargetSet {
        TargetSet::of(&[TargetKind::Coast])
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        self.supports().accepts(&target)
    }

    fn target(&self) -> Target {
        Target::Coast
    }

    fn feedback(&self) -> Feedback {
        Feedback::NEW
    }

    fn fault(&self) -> Option<Fault> {
        None
    }

    fn update(&mut self, tick: &Tick) {
        self.acts.update(tick);
    }

    fn request(&mut self, request: Request) -> Outcome {
        self.acts.request(request)
    }

    fn response(&mut self) -> Option<Outcome> {
        self.acts.response()
    }
}

impl<A: Acts> CanMotor for Dummy<A> {
    fn can_ids(&self) -> CanIds {
        self.ids
    }

    fn unpack_feedback(
        &mut self,
        _: &CanFrame,
        _: Micros,
        _: Link,
    ) -> Result<FrameKind, FrameError> {
        Ok(FrameKind::Feedback)
    }

    fn pack_command(&mut self, _: &mut TxBatch) -> Result<(), TxFull> {
        Ok(())
    }

    fn coast_frames(&self, _: &mut TxBatch) -> Result<(), TxFull> {
        Ok(())
    }
}
