use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Vec;
use rc10_message::{CallError, Caller, Calls, Service};

use crate::bus::MotorId;
use crate::motor::{Answer, Request, RequestError, Target, TargetError, TargetSet};
use crate::supervision::MotorStatus;

/// A mailbox and a status for each of `N` motors: what their bus or line shares with all other
/// tasks.
pub(super) struct MotorPorts<const N: usize> {
    cells: [MotorCell; N],
}

struct MotorCell {
    /// Whether there is a command in the mail. The bus asks in every tick.
    commanded: AtomicBool,
    mail: Mutex<CriticalSectionRawMutex, RefCell<Mail>>,
    /// One caller at a time: a motor does one thing beside its target at a time.
    requests: Service<Request, Outcome, 1>,
    status: Mutex<CriticalSectionRawMutex, RefCell<MotorStatus>>,
}

struct Mail {
    supports: TargetSet,
    command: Option<Target>,
}

/// What became of a request.
pub(super) type Outcome = Result<Answer, RequestError>;
/// Who waits for it.
type Asker<'p> = Caller<'p, Request, Outcome, 1>;

impl<const N: usize> MotorPorts<N> {
    /// They refuse all targets until they are [opened](Self::open).
    pub(super) const fn new() -> Self {
        const NOTHING: Mail = Mail { supports: TargetSet::NONE, command: None };
        Self {
            cells: [const {
                MotorCell {
                    commanded: AtomicBool::new(false),
                    mail: Mutex::new(RefCell::new(NOTHING)),
                    requests: Service::new(),
                    status: Mutex::new(RefCell::new(MotorStatus::NEW)),
                }
            }; N],
        }
    }

    /// The port of one motor; without a motor it refuses everything.
    pub(super) fn motor(&self, motor: MotorId) -> MotorPort<'_> {
        MotorPort { cell: self.cells.get(motor.index()) }
    }

    /// From now on targets are checked against what the motor takes.
    pub(super) fn open(&self, motor: MotorId, supports: TargetSet) {
        if let Some(cell) = self.cells.get(motor.index()) {
            cell.mail.lock(|mail| mail.borrow_mut().supports = supports);
        }
    }

    /// The newest command that the bus has not taken yet.
    #[inline]
    pub(super) fn take_command(&self, motor: MotorId) -> Option<Target> {
        let cell = self.cells.get(motor.index())?;
        // Before the mail is looked at: what comes now is seen now or next time.
        if !cell.commanded.load(Ordering::Acquire) {
            return None;
        }
        cell.commanded.store(false, Ordering::Release);
        cell.mail.lock(|mail| mail.borrow_mut().command.take())
    }

    /// The request that the bus has not taken yet, and who waits for its outcome.
    #[inline]
    pub(super) fn take_request(&self, motor: MotorId) -> Option<(Request, Asker<'_>)> {
        self.cells.get(motor.index())?.requests.try_next()
    }

    /// Has a motor's status written where its port reads it.
    #[inline]
    pub(super) fn publish(&self, motor: MotorId, write: impl FnOnce(&mut MotorStatus)) {
        if let Some(cell) = self.cells.get(motor.index()) {
            cell.status.lock(|status| write(&mut status.borrow_mut()));
        }
    }
}

/// Requests that wait for what their devices say. Dropped, it tells those who wait for them.
pub(super) struct Pending<'p, const N: usize>(Vec<(MotorId, Asker<'p>), N>);

impl<'p, const N: usize> Pending<'p, N> {
    pub(super) const NONE: Self = Self(Vec::new());

    /// Tells who asked what came of it, or keeps it until the device has answered.
    pub(super) fn settle(&mut self, motor: MotorId, asker: Asker<'p>, outcome: Outcome) {
        if outcome == Ok(Answer::Pending) {
            // One per motor: while a request is pending the motor is busy for others.
            let _ = self.0.push((motor, asker));
        } else {
            asker.reply(outcome);
        }
    }

    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Passes on what devices have answered.
    pub(super) fn pass_on(&mut self, mut answer: impl FnMut(MotorId) -> Option<Outcome>) {
        for (motor, asker) in core::mem::take(&mut self.0) {
            match answer(motor) {
                Some(outcome) => asker.reply(outcome),
                None => drop(self.0.push((motor, asker))),
            }
        }
    }
}

/// One motor, as other tasks see it: a mailbox and a status.
#[derive(Clone, Copy)]
pub struct MotorPort<'p> {
    cell: Option<&'p MotorCell>,
}

impl MotorPort<'_> {
    /// Gives the motor a new target: it holds from the bus's next tick until it expires (50 ms
    /// unless the motor was attached otherwise), so repeat it. A newer command replaces one that
    /// the bus has not taken yet.
    ///
    /// # Errors
    /// [`TargetError`]: the motor does not take such targets, or a number is not finite. While the
    /// bus is not running yet every target is unsupported.
    pub fn command(&self, target: Target) -> Result<(), TargetError> {
        let cell = self.cell.ok_or(TargetError::Unsupported(target.kind()))?;
        cell.mail.lock(|mail| {
            let mut mail = mail.borrow_mut();
            mail.supports.accepts(&target)?;
            mail.command = Some(target);
            cell.commanded.store(true, Ordering::Release);
            Ok(())
        })
    }

    /// Asks something of the motor beside a target, and waits until it is done: the next tick of
    /// its bus, or when the device has answered. Never [`Answer::Pending`].
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed, unless it is [`RequestError::NoReply`].
    /// [`RequestError::Busy`] while another caller waits or an earlier request is not done yet;
    /// [`RequestError::NoSuchMotor`] also while the bus is not running yet.
    ///
    /// # Cancel safety
    /// The future may be dropped at any time. A request that the bus has not taken yet is taken
    /// back; another is carried out, and its outcome goes to nobody.
    pub async fn request(&self, request: Request) -> Result<Answer, RequestError> {
        let cell = self.cell.ok_or(RequestError::NoSuchMotor)?;
        if self.supports() == TargetSet::NONE {
            // Nobody would ever answer.
            return Err(RequestError::NoSuchMotor);
        }
        match cell.requests.call_without_timeout(request).await {
            Ok(outcome) => outcome,
            Err(CallError::Full { .. }) => Err(RequestError::Busy),
            // The bus ended before its device had answered.
            Err(_) => Err(RequestError::NoReply),
        }
    }

    /// What became of the requests so far.
    #[must_use]
    pub fn requests(&self) -> Calls {
        self.cell.map_or(Calls::default(), |cell| cell.requests.calls())
    }

    /// All there is to know about the motor, as of its bus's last tick.
    #[must_use]
    pub fn status(&self) -> MotorStatus {
        self.cell.map_or(MotorStatus::NEW, |cell| cell.status.lock(|status| *status.borrow()))
    }

    /// The targets it takes; none while its bus is not running yet.
    #[must_use]
    pub fn supports(&self) -> TargetSet {
        self.cell.map_or(TargetSet::NONE, |cell| cell.mail.lock(|mail| mail.borrow().supports))
    }
}
