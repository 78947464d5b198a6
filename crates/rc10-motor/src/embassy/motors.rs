use core::cell::{Cell, RefCell};
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Vec;
use rc10_message::{CallError, Caller, Calls, Service};
use rc10_time::Micros;

use crate::arm::Seen;
use crate::motor::{Motor, Tuning, Withheld};
use crate::motors::{MotorId, Motors};
use crate::pending::Outcome;
#[cfg(feature = "record")]
use crate::record::{COMMAND, REQUEST, Recorder, Sink, To};
use crate::request::{Request, RequestError, Response};
use crate::supervision::{MotorStatus, Refusals};
use crate::target::{Target, TargetError, TargetKind, TargetSet};

/// The port of a bus of up to `N` motors: a mailbox and status each, from any task or interrupt.
pub struct MotorPorts<S, const N: usize> {
    cells: [MotorCell; N],
    /// To all of its motors.
    requests: Requests,
    status: Mutex<CriticalSectionRawMutex, RefCell<S>>,
    /// Where what reaches its ticks is recorded.
    #[cfg(feature = "record")]
    sink: Mutex<CriticalSectionRawMutex, Cell<To>>,
}

struct MotorCell {
    /// Whether there is a command in the mail. The bus asks in every tick.
    commanded: AtomicBool,
    command: Mutex<CriticalSectionRawMutex, (Cell<Option<Target>>, Cell<Withheld>)>,
    supports: Mutex<CriticalSectionRawMutex, Cell<TargetSet>>,
    status: Mutex<CriticalSectionRawMutex, RefCell<MotorStatus>>,
    /// Targets that did not come as far as the mail.
    refused: Mutex<CriticalSectionRawMutex, Cell<Refusals>>,
    /// The tuning as declared, and as of the last request.
    tuning: Mutex<CriticalSectionRawMutex, Cell<Option<[Tuning; 2]>>>,
}

/// Requests to the motors of a bus that may wait at once.
const CALLERS: usize = 4;

type Requests = Service<(MotorId, Request), Outcome, CALLERS>;
/// The task that waits for it.
type Asker<'p> = Caller<'p, (MotorId, Request), Outcome, CALLERS>;

impl MotorCell {
    /// The newest command that the bus has not taken yet.
    #[inline]
    fn take_command(&self) -> Option<(Target, Withheld)> {
        // Before the mail is looked at: what comes now is seen now or next time.
        if !self.commanded.load(Ordering::Acquire) {
            return None;
        }
        self.commanded.store(false, Ordering::Release);
        self.command.lock(|(target, withheld)| target.take().map(|it| (it, withheld.get())))
    }

    fn refuse(&self, error: TargetError) {
        self.refused.lock(|place| {
            let mut refused = place.get();
            refused.add(error);
            place.set(refused);
        });
    }
}

impl<S: Copy, const N: usize> MotorPorts<S, N> {
    /// They refuse all targets until their bus runs.
    pub(super) const fn with_status(status: S) -> Self {
        Self {
            cells: [const {
                MotorCell {
                    commanded: AtomicBool::new(false),
                    command: Mutex::new((Cell::new(None), Cell::new(Withheld::NONE))),
                    supports: Mutex::new(Cell::new(TargetSet::NONE)),
                    status: Mutex::new(RefCell::new(MotorStatus::NEW)),
                    refused: Mutex::new(Cell::new(Refusals::NONE)),
                    tuning: Mutex::new(Cell::new(None)),
                }
            }; N],
            requests: Service::new(),
            status: Mutex::new(RefCell::new(status)),
            #[cfg(feature = "record")]
            sink: Mutex::new(Cell::new(None)),
        }
    }

    /// Records what reaches the ticks of its bus, of this [place](crate::record); before the bus begins.
    #[cfg(feature = "record")]
    pub fn record(&self, sink: &'static dyn Sink, place: u8) {
        self.sink.lock(|it| it.set(Some((sink, place))));
    }

    /// The port of one motor. A motor the bus does not have refuses everything.
    pub fn motor(&self, motor: MotorId) -> MotorPort<'_> {
        MotorPort { cell: self.cells.get(motor.index()), requests: &self.requests, motor }
    }

    /// The status of the bus, as of its last tick.
    pub fn status(&self) -> S {
        self.look(|status| *status)
    }

    /// Counts of the requests to its motors, by outcome.
    pub fn requests(&self) -> Calls {
        self.requests.calls()
    }

    pub(super) fn look<R>(&self, look: impl FnOnce(&S) -> R) -> R {
        self.status.lock(|status| look(&status.borrow()))
    }

    /// Has the bus's status written.
    #[inline]
    pub(super) fn publish(&self, write: impl FnOnce(&mut S)) {
        self.status.lock(|status| write(&mut status.borrow_mut()));
    }
}

/// The part of a runner that serves its motors; dropped, it tells the tasks that wait.
pub(super) struct Server<'p, S, const N: usize> {
    ports: &'p MotorPorts<S, N>,
    pending: Vec<(MotorId, Asker<'p>), N>,
    #[cfg(feature = "record")]
    pub(super) recorder: Recorder,
}

impl<'p, S: Copy, const N: usize> Server<'p, S, N> {
    /// From now on targets are checked against what the motors take.
    pub(super) fn new<M: Motor + ?Sized>(
        ports: &'p MotorPorts<S, N>,
        motors: &Motors<'_, M, N>,
    ) -> Self {
        for (motor, cell) in motors.ids().zip(&ports.cells) {
            cell.supports.lock(|place| place.set(motors.supports(motor)));
            let tuning = motors.loops(motor).map(|loops| [Tuning::of(&loops); 2]);
            cell.tuning.lock(|place| place.set(tuning));
        }
        Self {
            ports,
            pending: Vec::new(),
            #[cfg(feature = "record")]
            recorder: Recorder::new(ports.sink.lock(Cell::get)),
        }
    }

    /// Gives the motors what tasks want of them, and passes on what they say. Never waits.
    #[inline]
    pub(super) fn take<M: Motor + ?Sized>(
        &mut self,
        motors: &mut Motors<'_, M, N>,
        seen: Seen,
        now: Micros,
    ) {
        for (motor, cell) in motors.ids().zip(&self.ports.cells) {
            if let Some((target, withheld)) = cell.take_command() {
                #[cfg(feature = "record")]
                self.recorder.given(COMMAND, motor.index(), &(target, withheld));
                // The port has checked it; what the motor refuses all the same is counted.
                let _ = motors.command_within(motor, target, withheld, now);
            }
        }
        let cells = &self.ports.cells;
        self.serve(|motor, request| {
            let outcome = match request {
                Some(request) => Some(motors.request_as(seen, motor, request)),
                None => motors.response(motor),
            };
            if let (Some(Ok(Response::Done)), Some(cell)) = (&outcome, cells.get(motor.index())) {
                let now = motors.loops(motor).map(|loops| Tuning::of(&loops));
                cell.tuning.lock(|place| {
                    let declared = place.get().map(|[declared, _]| declared);
                    place.set(declared.zip(now).map(<[_; 2]>::from));
                });
            }
            outcome
        });
    }

    /// Shows the tasks how the motors are.
    #[inline]
    pub(super) fn publish<M: Motor + ?Sized>(&self, motors: &Motors<'_, M, N>, now: Micros) {
        for (motor, cell) in motors.ids().zip(&self.ports.cells) {
            cell.status.lock(|status| motors.write_status(motor, now, &mut status.borrow_mut()));
        }
    }

    /// `ask` makes a request to a motor, or without one asks for the outcome of a pending one.
    #[inline]
    fn serve(&mut self, mut ask: impl FnMut(MotorId, Option<Request>) -> Option<Outcome>) {
        // Not more: a task that asks again and again at a higher priority must not keep the tick.
        for _ in 0..CALLERS {
            let Some(((motor, request), asker)) = self.ports.requests.try_next() else { break };
            #[cfg(feature = "record")]
            self.recorder.given(REQUEST, motor.index(), &request);
            let mut outcome = ask(motor, Some(request));
            // Busy with a request from before this bus began: no task waits for that any more.
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
    /// Gives a new target, from the next tick until it expires (50 ms by default): repeat it.
    ///
    /// # Errors
    /// [`TargetError`]: the motor does not take such targets, or a number is not finite. While the
    /// bus is not running yet every target is unsupported. The motor keeps the target it had until
    /// that expires; [`MotorCounters::refused`](crate::MotorCounters::refused) counts it.
    pub fn command(&self, target: Target) -> Result<(), TargetError> {
        self.command_within(target, Withheld::NONE)
    }

    /// The same, with a part of the motor's largest effort withheld from this target, a speed, an angle or a motion: a
    /// limit of power.
    ///
    /// # Errors
    /// [`TargetError`] as above; `OutOfRange` for something withheld from another target, or if the device closes the
    /// motor's loops.
    pub fn command_within(&self, target: Target, withheld: Withheld) -> Result<(), TargetError> {
        use TargetKind::{Angle, Motion, Speed, SpeedMotion, TotalAngle};
        const SOUGHT: TargetSet = TargetSet::of(&[Speed, Angle, TotalAngle, Motion, SpeedMotion]);
        let kind = target.kind();
        let cell = self.cell.ok_or(TargetError::Unsupported(kind))?;
        let accepted = cell.supports.lock(Cell::get).accepts(&target);
        let checked = accepted.and_then(|()| {
            if !withheld.is_any() {
                Ok(())
            } else if !(withheld.driving + withheld.braking).is_finite() {
                Err(TargetError::NotFinite(kind))
            } else if !SOUGHT.contains(kind) || self.tuning().is_none() {
                Err(TargetError::OutOfRange(kind))
            } else {
                Ok(())
            }
        });
        if let Err(error) = checked {
            cell.refuse(error);
            return Err(error);
        }
        cell.command.lock(|(command, rest)| {
            command.set(Some(target));
            rest.set(withheld);
        });
        cell.commanded.store(true, Ordering::Release);
        Ok(())
    }

    /// Asks something of the motor beside a target, and waits until it is done. Never `Pending`.
    ///
    /// It is a call of the [`Service`] that a bus's motors share: in the order of the calls, each
    /// with its own response, and without a timeout, because motors give up on silent devices.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed but for [`RequestError::Timeout`]. [`RequestError::Busy`]
    /// while an earlier request is not answered, or four wait; [`RequestError::NoSuchMotor`] also
    /// while the bus is not running yet.
    ///
    /// # Cancel safety
    /// The future may be dropped: a request not taken yet is taken back, another is carried out.
    pub async fn request(&self, request: Request) -> Result<Response, RequestError> {
        if self.supports() == TargetSet::NONE {
            // No bus would ever take it.
            return Err(RequestError::NoSuchMotor);
        }
        match self.requests.call_without_timeout((self.motor, request)).await {
            Ok(outcome) => outcome,
            Err(CallError::Full { .. }) => Err(RequestError::Busy),
            // The bus ended before the device had answered.
            Err(_) => Err(RequestError::Timeout),
        }
    }

    /// The status of the motor, as of its bus's last tick.
    pub fn status(&self) -> MotorStatus {
        self.cell.map_or(MotorStatus::NEW, |cell| {
            let mut status = cell.status.lock(|status| *status.borrow());
            let refused = &mut status.counters.refused;
            *refused = refused.plus(cell.refused.lock(Cell::get));
            status
        })
    }

    /// A part of its status, without a copy, and without targets that its port refused.
    #[inline]
    pub fn look<R>(&self, look: impl FnOnce(&MotorStatus) -> R) -> R {
        match self.cell {
            Some(cell) => cell.status.lock(|status| look(&status.borrow())),
            None => look(&MotorStatus::NEW),
        }
    }

    /// Gains and limit of its loops, at the beginning and now; `None` without loops or bus.
    pub fn tuning(&self) -> Option<[Tuning; 2]> {
        self.cell.and_then(|cell| cell.tuning.lock(Cell::get))
    }

    /// The targets it takes; none while its bus is not running yet.
    pub fn supports(&self) -> TargetSet {
        self.cell.map_or(TargetSet::NONE, |cell| cell.supports.lock(Cell::get))
    }
}
