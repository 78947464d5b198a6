use core::cell::{Cell, RefCell};
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Vec;
use rc10_message::{CallError, Caller, Service};

use crate::bus::MotorId;
use crate::motor::{Request, RequestError, Response, Target, TargetError, TargetSet};
use crate::supervision::{MotorStatus, Refusals};

/// A mailbox and a status for each of `N` motors, and one service for the requests to all of them:
/// what their bus or line shares with all other tasks.
pub(super) struct MotorPorts<const N: usize> {
    cells: [MotorCell; N],
    requests: Requests,
}

struct MotorCell {
    /// Whether there is a command in the mail. The bus asks in every tick.
    commanded: AtomicBool,
    command: Mutex<CriticalSectionRawMutex, Cell<Option<Target>>>,
    supports: Mutex<CriticalSectionRawMutex, Cell<TargetSet>>,
    status: Mutex<CriticalSectionRawMutex, RefCell<MotorStatus>>,
    /// Targets that did not come as far as the mail.
    refused: Mutex<CriticalSectionRawMutex, Cell<Refusals>>,
}

/// How many requests to the motors of a bus or line may wait at once.
const CALLERS: usize = 4;

type Requests = Service<(MotorId, Request), Outcome, CALLERS>;
/// What became of a request.
type Outcome = Result<Response, RequestError>;
/// Who waits for it.
type Asker<'p> = Caller<'p, (MotorId, Request), Outcome, CALLERS>;

impl MotorCell {
    #[cold]
    fn refuse(&self, error: TargetError) {
        self.refused.lock(|place| {
            let mut refused = place.get();
            refused.add(error);
            place.set(refused);
        });
    }
}

impl<const N: usize> MotorPorts<N> {
    /// They refuse all targets until they are [opened](Self::open).
    pub(super) const fn new() -> Self {
        Self {
            cells: [const {
                MotorCell {
                    commanded: AtomicBool::new(false),
                    command: Mutex::new(Cell::new(None)),
                    supports: Mutex::new(Cell::new(TargetSet::NONE)),
                    status: Mutex::new(RefCell::new(MotorStatus::NEW)),
                    refused: Mutex::new(Cell::new(Refusals::NONE)),
                }
            }; N],
            requests: Service::new(),
        }
    }

    /// The port of one motor; without a motor it refuses everything.
    pub(super) fn motor(&self, motor: MotorId) -> MotorPort<'_> {
        MotorPort { cell: self.cells.get(motor.index()), requests: &self.requests, motor }
    }

    /// From now on targets are checked against what the motor takes.
    pub(super) fn open(&self, motor: MotorId, supports: TargetSet) {
        if let Some(cell) = self.cells.get(motor.index()) {
            cell.supports.lock(|place| place.set(supports));
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
        cell.command.lock(Cell::take)
    }

    /// What was asked of motors, and what became of it.
    #[inline]
    pub(super) const fn requests(&self) -> &Requests {
        &self.requests
    }

    /// Has a motor's status written where its port reads it.
    #[inline]
    pub(super) fn publish(&self, motor: MotorId, write: impl FnOnce(&mut MotorStatus)) {
        if let Some(cell) = self.cells.get(motor.index()) {
            cell.status.lock(|status| write(&mut status.borrow_mut()));
        }
    }
}

/// Serves the requests to the `N` motors of a bus or line, and keeps those that wait for what their
/// devices say. Dropped, it tells who waits for them.
pub(super) struct Server<'p, const N: usize> {
    requests: &'p Requests,
    pending: Vec<(MotorId, Asker<'p>), N>,
}

impl<'p, const N: usize> Server<'p, N> {
    pub(super) const fn new(ports: &'p MotorPorts<N>) -> Self {
        Self { requests: &ports.requests, pending: Vec::new() }
    }

    /// Asks the motors what tasks ask of them, and passes on what they say. Never waits.
    ///
    /// `ask` gives a request to a motor, or without one asks for the outcome of a pending one.
    #[inline]
    pub(super) fn tick(
        &mut self,
        mut ask: impl FnMut(MotorId, Option<Request>) -> Option<Outcome>,
    ) {
        // Not more: who asks again and again at a higher priority must not keep the tick.
        for _ in 0..CALLERS {
            let Some(((motor, request), asker)) = self.requests.try_next() else { break };
            let mut outcome = ask(motor, Some(request));
            // Busy with what was asked before this bus began: nobody but us will hear the answer.
            if outcome == Some(Err(RequestError::Busy))
                && self.pending.iter().all(|(busy, _)| *busy != motor)
                && ask(motor, None).is_some()
            {
                outcome = ask(motor, Some(request));
            }
            self.settle(motor, asker, outcome);
        }
        if !self.pending.is_empty() {
            for (motor, asker) in core::mem::take(&mut self.pending) {
                self.settle(motor, asker, ask(motor, None));
            }
        }
    }

    #[cold]
    fn settle(&mut self, motor: MotorId, asker: Asker<'p>, outcome: Option<Outcome>) {
        match outcome {
            // One per motor: while a request is pending the motor is busy for others.
            None | Some(Ok(Response::Pending)) => drop(self.pending.push((motor, asker))),
            Some(outcome) => asker.reply(outcome),
        }
    }
}

/// One motor, as other tasks see it: a mailbox and a status.
#[derive(Clone, Copy)]
pub struct MotorPort<'p> {
    cell: Option<&'p MotorCell>,
    requests: &'p Requests,
    motor: MotorId,
}

impl MotorPort<'_> {
    /// Gives the motor a new target: it holds from the bus's next tick until it expires (50 ms
    /// unless the motor was attached otherwise), so repeat it. A newer command replaces one that
    /// the bus has not taken yet.
    ///
    /// # Errors
    /// [`TargetError`]: the motor does not take such targets, or a number is not finite. While the
    /// bus is not running yet every target is unsupported. The motor keeps the target it had until
    /// that expires; [`MotorCounters::refused`](crate::MotorCounters::refused) counts it.
    pub fn command(&self, target: Target) -> Result<(), TargetError> {
        let cell = self.cell.ok_or(TargetError::Unsupported(target.kind()))?;
        if let Err(error) = cell.supports.lock(Cell::get).accepts(&target) {
            cell.refuse(error);
            return Err(error);
        }
        cell.command.lock(|command| command.set(Some(target)));
        cell.commanded.store(true, Ordering::Release);
        Ok(())
    }

    /// Asks something of the motor beside a target, and waits until it is done: the next tick of
    /// its bus, or when the device has answered. Never [`Response::Pending`].
    ///
    /// It is a call of a [`Service`] that the motors of a bus share: requests are carried out in the
    /// order in which they came, and nobody gets the answer to another's. There is no timeout,
    /// because every motor gives up by itself on a device that does not answer.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed, unless it is [`RequestError::NoReply`].
    /// [`RequestError::Busy`] while this motor's device has not answered an earlier request, or
    /// while four requests to motors of this bus wait;
    /// [`RequestError::NoSuchMotor`] also while the bus is not running yet.
    ///
    /// # Cancel safety
    /// The future may be dropped at any time. A request that the bus has not taken yet is taken
    /// back; another is carried out, and nobody hears what came of it.
    pub async fn request(&self, request: Request) -> Result<Response, RequestError> {
        if self.supports() == TargetSet::NONE {
            // Nobody would ever answer.
            return Err(RequestError::NoSuchMotor);
        }
        match self.requests.call_without_timeout((self.motor, request)).await {
            Ok(outcome) => outcome,
            Err(CallError::Full { .. }) => Err(RequestError::Busy),
            // The bus ended before the device had answered.
            Err(_) => Err(RequestError::NoReply),
        }
    }

    /// All there is to know about the motor, as of its bus's last tick.
    #[must_use]
    pub fn status(&self) -> MotorStatus {
        self.cell.map_or(MotorStatus::NEW, |cell| {
            let mut status = cell.status.lock(|status| *status.borrow());
            let refused = &mut status.counters.refused;
            *refused = refused.plus(cell.refused.lock(Cell::get));
            status
        })
    }

    /// The targets it takes; none while its bus is not running yet.
    #[must_use]
    pub fn supports(&self) -> TargetSet {
        self.cell.map_or(TargetSet::NONE, |cell| cell.supports.lock(Cell::get))
    }
}
