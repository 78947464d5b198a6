use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rc10_can::CanFrame;
use rc10_motor::pending::Outcome;
use rc10_motor::{
    CanIds, CanMotor, Condition, DriveMode, Fault, Feedback, FrameKind, Heard, Link, Motor,
    MotorName, Request, Target, TargetError, TargetSet, Tick, TxBatch, TxFull,
};
use rc10_time::Micros;

use crate::harness::Subject;

/// What was asked of a motor, to be asked of another one again.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Call {
    Target(Target),
    Request(Request),
    Response,
    Frame(CanFrame, Micros, Link),
    Update(Tick),
    Pack,
}

/// Name and identifiers of a motor, written out.
pub(crate) fn name_and_ids(motor: &dyn CanMotor) -> String {
    format!("{}: {:?}", motor.name(), motor.can_ids())
}

/// Answers of a motor after a tick.
#[derive(Clone, Debug)]
pub(crate) struct Moment {
    pub(crate) at: Micros,
    pub(crate) drive: DriveMode,
    pub(crate) frames: Vec<(CanFrame, u32)>,
    pub(crate) coast: Vec<CanFrame>,
    pub(crate) feedback: Feedback,
    /// [`name_and_ids`], every tenth tick.
    pub(crate) ids: Option<String>,
}

#[derive(Debug, Default)]
pub(crate) struct Log {
    pub(crate) calls: Vec<Call>,
    pub(crate) moments: Vec<Moment>,
    /// Plain feedback: when it arrived, and when the motor says it did.
    pub(crate) arrivals: Vec<(Micros, Micros)>,
}

#[derive(Clone, Default)]
pub(crate) struct Shared(Arc<Mutex<Log>>);

impl Shared {
    /// A motor that panicked leaves what was written until then.
    pub(crate) fn log(&self) -> MutexGuard<'_, Log> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn note(&self, call: Call) {
        self.log().calls.push(call);
    }
}

/// A motor of which everything is written down.
struct Recorded {
    motor: Box<dyn CanMotor>,
    shared: Shared,
    ticks: u64,
    drive: DriveMode,
}

/// The same motor, and what is written down of it: nothing, if it has no frames.
pub(crate) fn recorded(motor: Subject) -> (Subject, Shared) {
    let shared = Shared::default();
    let Subject::OnBus(motor) = motor else {
        return (motor, shared);
    };
    let recorded = Recorded { motor, shared: shared.clone(), ticks: 0, drive: DriveMode::Off };
    (Subject::OnBus(Box::new(recorded)), shared)
}

impl Motor for Recorded {
    fn name(&self) -> MotorName {
        self.motor.name()
    }

    fn supports(&self) -> TargetSet {
        self.motor.supports()
    }

    fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        self.shared.note(Call::Target(target));
        self.motor.set_target(target)
    }

    fn target(&self) -> Target {
        self.motor.target()
    }

    fn feedback(&self) -> Feedback {
        self.motor.feedback()
    }

    fn fault(&self) -> Option<Fault> {
        self.motor.fault()
    }

    fn update(&mut self, tick: &Tick) {
        self.shared.note(Call::Update(*tick));
        (self.ticks, self.drive) = (self.ticks + 1, tick.mode);
        self.motor.update(tick);
    }

    fn request(&mut self, request: Request) -> Outcome {
        self.shared.note(Call::Request(request));
        self.motor.request(request)
    }

    fn response(&mut self) -> Option<Outcome> {
        self.shared.note(Call::Response);
        self.motor.response()
    }

    fn condition(&self) -> Condition {
        self.motor.condition()
    }
}

impl CanMotor for Recorded {
    fn can_ids(&self) -> CanIds {
        self.motor.can_ids()
    }

    fn unpack_feedback(&mut self, frame: &CanFrame, at: Micros, link: Link) -> Heard {
        self.shared.note(Call::Frame(*frame, at, link));
        let heard = self.motor.unpack_feedback(frame, at, link);
        if heard == Ok(FrameKind::Feedback) {
            self.shared.log().arrivals.push((at, self.motor.feedback().at));
        }
        heard
    }

    fn pack_command(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.shared.note(Call::Pack);
        let mut own = TxBatch::new();
        self.motor.pack_command(&mut own)?;
        let mut coast = TxBatch::new();
        self.motor.coast_frames(&mut coast)?;
        let ids = self.ticks.is_multiple_of(10).then(|| name_and_ids(&*self.motor));
        self.shared.log().moments.push(Moment {
            at: Micros::from_millis(self.ticks),
            drive: self.drive,
            frames: own.entries().map(|(frame, stream)| (*frame, stream)).collect(),
            coast: coast.frames().to_vec(),
            feedback: self.motor.feedback(),
            ids,
        });
        own.entries().try_for_each(|(frame, stream)| tx.push_as(*frame, stream))
    }

    fn coast_frames(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.motor.coast_frames(tx)
    }
}

/// Asks all of it of another motor; its frames of the last tick.
pub(crate) fn replay(motor: &mut dyn CanMotor, calls: &[Call]) -> Vec<(CanFrame, u32)> {
    let mut last = Vec::new();
    for call in calls {
        match *call {
            Call::Target(target) => drop(motor.set_target(target)),
            Call::Request(request) => drop(motor.request(request)),
            Call::Response => drop(motor.response()),
            Call::Frame(frame, at, link) => drop(motor.unpack_feedback(&frame, at, link)),
            Call::Update(tick) => motor.update(&tick),
            Call::Pack => {
                let mut tx = TxBatch::new();
                // What does not fit is missing from the frames.
                let _ = motor.pack_command(&mut tx);
                last = tx.entries().map(|(frame, stream)| (*frame, stream)).collect();
            }
        }
    }
    last
}

/// All that a motor says of itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Told {
    pub(crate) feedback: Feedback,
    fault: Option<Fault>,
    condition: Condition,
    target: Target,
}

impl Told {
    pub(crate) fn of(motor: &dyn CanMotor) -> Self {
        Self {
            feedback: motor.feedback(),
            fault: motor.fault(),
            condition: motor.condition(),
            target: motor.target(),
        }
    }
}

/// The first number in it that is infinite or NaN.
pub(crate) fn not_finite(feedback: &Feedback) -> Option<&'static str> {
    let numbers = [
        ("speed", Some(feedback.speed.get())),
        ("angle", Some(feedback.angle.get())),
        ("current", feedback.current().map(|amps| amps.get())),
        ("torque", feedback.torque().map(|torque| torque.get())),
        ("temperature", feedback.temperature().map(|celsius| celsius.get())),
        ("controller temperature", feedback.controller_temperature().map(|celsius| celsius.get())),
        ("supply", feedback.supply().map(|volts| volts.get())),
    ];
    numbers.into_iter().find(|(_, number)| number.is_some_and(|n| !n.is_finite())).map(|n| n.0)
}
