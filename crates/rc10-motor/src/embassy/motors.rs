use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

use crate::bus::MotorId;
use crate::motor::{Answer, Request, RequestError, Target, TargetError, TargetSet};
use crate::supervision::MotorStatus;

/// A mailbox and a status for each of `N` motors: what their bus or line shares with all other
/// tasks.
pub(super) struct MotorPorts<const N: usize> {
    cells: [MotorCell; N],
}

struct MotorCell {
    /// Whether there is a command or a request in the mail. The bus asks in every tick.
    commanded: AtomicBool,
    asked: AtomicBool,
    mail: Mutex<CriticalSectionRawMutex, RefCell<Mail>>,
    /// The answer to the request with this ticket.
    answer: Signal<CriticalSectionRawMutex, (Ticket, Result<Answer, RequestError>)>,
    status: Mutex<CriticalSectionRawMutex, RefCell<MotorStatus>>,
}

/// Tells one request from the next, so that nobody takes another's answer.
type Ticket = u32;

struct Mail {
    supports: TargetSet,
    command: Option<Target>,
    request: Option<Request>,
    /// Of the newest request.
    ticket: Ticket,
    /// Whether its caller still waits.
    awaited: bool,
    /// Whether it has not been answered yet. Not even a caller that gave up makes room before.
    outstanding: bool,
}

impl<const N: usize> MotorPorts<N> {
    /// They refuse all targets until they are [opened](Self::open).
    pub(super) const fn new() -> Self {
        const NOTHING: Mail = Mail {
            supports: TargetSet::NONE,
            command: None,
            request: None,
            ticket: 0,
            awaited: false,
            outstanding: false,
        };
        Self {
            cells: [const {
                MotorCell {
                    commanded: AtomicBool::new(false),
                    asked: AtomicBool::new(false),
                    mail: Mutex::new(RefCell::new(NOTHING)),
                    answer: Signal::new(),
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

    /// The request that the bus has not taken yet.
    #[inline]
    pub(super) fn take_request(&self, motor: MotorId) -> Option<Request> {
        let cell = self.cells.get(motor.index())?;
        if !cell.asked.load(Ordering::Acquire) {
            return None;
        }
        cell.asked.store(false, Ordering::Release);
        cell.mail.lock(|mail| mail.borrow_mut().request.take())
    }

    /// Gives the outcome of the request that was taken last to who waits for it.
    pub(super) fn answer(&self, motor: MotorId, outcome: Result<Answer, RequestError>) {
        if let Some(cell) = self.cells.get(motor.index()) {
            let ticket = cell.mail.lock(|mail| {
                let mut mail = mail.borrow_mut();
                mail.outstanding = false;
                mail.ticket
            });
            cell.answer.signal((ticket, outcome));
        }
    }

    /// Has a motor's status written where its port reads it.
    #[inline]
    pub(super) fn publish(&self, motor: MotorId, write: impl FnOnce(&mut MotorStatus)) {
        if let Some(cell) = self.cells.get(motor.index()) {
            cell.status.lock(|status| write(&mut status.borrow_mut()));
        }
    }
}

/// The right to wait for an answer; given back on drop.
struct Turn<'p>(&'p MotorCell);

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.0.mail.lock(|mail| mail.borrow_mut().awaited = false);
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
    /// its bus, or when the device has answered. If the future is dropped the request may still be
    /// carried out. Never [`Answer::Pending`].
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed. [`RequestError::Busy`] while another caller waits or an
    /// earlier request is not done yet;
    /// [`RequestError::NoSuchMotor`] also while the bus is not running yet.
    pub async fn request(&self, request: Request) -> Result<Answer, RequestError> {
        let cell = self.cell.ok_or(RequestError::NoSuchMotor)?;
        let ticket = cell.mail.lock(|mail| {
            let mut mail = mail.borrow_mut();
            if mail.supports == TargetSet::NONE {
                // Nobody would ever answer.
                return Err(RequestError::NoSuchMotor);
            }
            if mail.awaited || mail.outstanding {
                return Err(RequestError::Busy);
            }
            mail.ticket = mail.ticket.wrapping_add(1);
            (mail.request, mail.awaited, mail.outstanding) = (Some(request), true, true);
            cell.asked.store(true, Ordering::Release);
            Ok(mail.ticket)
        })?;
        // Also when this future is dropped, the next caller gets its turn.
        let _turn = Turn(cell);
        loop {
            let (answered, outcome) = cell.answer.wait().await;
            // An answer that an earlier, dropped caller left behind is not ours.
            if answered == ticket {
                return outcome;
            }
        }
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
