use rc10_can::CanFrame;
use rc10_motor::pending::Outcome;
use rc10_motor::{
    CanIds, CanMotor, Fault, Feedback, FrameKind, Heard, Link, Motor, MotorName, Request,
    RequestError, Target, TargetError, TargetKind, TargetSet, Tick, TxBatch, TxFull,
};
use rc10_time::Micros;

/// A motor without a device, for tests of a bus: it occupies identifiers and takes speeds, of which
/// nothing comes. Without a behaviour it takes every frame for feedback and sends nothing.
#[derive(Clone, Copy, Debug)]
pub struct Dummy<A = ()> {
    name: MotorName,
    ids: CanIds,
    /// The behaviour.
    pub acts: A,
}

/// Behaviour of a [`Dummy`]: none by default.
pub trait Acts: Send {
    /// Answers [`Motor::feedback`].
    fn feedback(&self) -> Feedback {
        Feedback::NEW
    }

    /// Does [`Motor::update`].
    fn update(&mut self, _tick: &Tick) {}

    /// Answers [`Motor::request`].
    fn request(&mut self, _request: Request) -> Outcome {
        Err(RequestError::Unsupported)
    }

    /// Answers [`Motor::response`].
    fn response(&mut self) -> Option<Outcome> {
        None
    }

    /// Does [`CanMotor::unpack_feedback`].
    fn unpack(&mut self, _frame: &CanFrame, _link: Link) -> Heard {
        Ok(FrameKind::Feedback)
    }

    /// Does [`CanMotor::pack_command`].
    fn pack(&mut self, _tx: &mut TxBatch) -> Result<(), TxFull> {
        Ok(())
    }
}

impl Acts for () {}

impl Dummy {
    /// A motor that is nothing but its identifiers.
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
        TargetSet::of(&[TargetKind::Coast, TargetKind::Speed])
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        self.supports().accepts(&target)
    }

    fn target(&self) -> Target {
        Target::Coast
    }

    fn feedback(&self) -> Feedback {
        self.acts.feedback()
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

    fn unpack_feedback(&mut self, frame: &CanFrame, _: Micros, link: Link) -> Heard {
        self.acts.unpack(frame, link)
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.acts.pack(tx)
    }

    fn coast_frames(&self, _: &mut TxBatch) -> Result<(), TxFull> {
        Ok(())
    }
}
