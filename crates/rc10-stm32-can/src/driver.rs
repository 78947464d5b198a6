use core::fmt;

use heapless::Deque;
use rc10_can::embedded_can::Id;
use rc10_can::{CanFrame, Health, IdPattern, Mailboxes, Queued, Submitted};
use rc10_time::Micros;

use crate::hardware::{Ended, Hardware, MAILBOXES};

/// Unsent frames at most, those in the mailboxes included: one frame a stream.
pub const TRANSMIT_QUEUE: usize = 24;
/// Received frames that wait: 3 ms of the shortest, 7 ms of eight bytes, at 1 Mbit/s.
pub const RECEIVE_QUEUE: usize = 64;

/// A controller, the frames that wait for it, and those that wait for the task.
///
/// The most urgent unsent frames are in mailboxes, emptied for more urgent ones that wait here:
/// frames leave in the order of arbitration, the newest of each stream.
pub struct Driver<H> {
    hardware: H,
    mailboxes: [Option<Loaded>; MAILBOXES],
    waiting: Mailboxes<TRANSMIT_QUEUE>,
    received: Deque<(CanFrame, Micros), RECEIVE_QUEUE>,
    health: Health,
    unreplaced: u32,
    presence: Presence,
}

/// Whether the controller takes part in the bus.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Presence {
    /// The controller takes part, or is on its way back.
    On,
    /// The controller has left, and has not been told to go back.
    Off,
    /// The controller has left, and has not begun the way back that was asked for.
    Asked,
}

#[derive(Clone, Copy)]
struct Loaded {
    queued: Queued,
    purpose: Purpose,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Purpose {
    /// The frame is to be sent.
    Send,
    /// The frame is being aborted to make room for a more urgent one; then it waits again.
    MakeRoom,
    /// The frame is being aborted: there is a newer one of its stream.
    Superseded,
    /// The frame is being aborted: nothing of it is wanted any more.
    Cancelled,
}

impl Loaded {
    /// Whether it is still to be sent, now or later.
    fn is_wanted(&self) -> bool {
        matches!(self.purpose, Purpose::Send | Purpose::MakeRoom)
    }
}

impl<H: Hardware> Driver<H> {
    /// The driver of a controller that was just started, with empty mailboxes.
    pub const fn new(hardware: H) -> Self {
        Self {
            hardware,
            mailboxes: [None; MAILBOXES],
            waiting: Mailboxes::new(),
            received: Deque::new(),
            health: Health::NEW,
            unreplaced: 0,
            presence: Presence::On,
        }
    }

    /// For each interrupt of the controller: takes what was received, and fills the mailboxes.
    pub fn serve(&mut self) {
        self.hardware.acknowledge();
        self.take_received();
        match self.presence {
            Presence::On if self.hardware.is_off() => self.leave_bus(),
            Presence::Asked => self.go_back(),
            Presence::On | Presence::Off => (),
        }
        if self.hardware.leave_restricted() {
            count(&mut self.health.restrictions);
        }
        self.settle_all();
        self.fill();
    }

    /// The next frame and its time in hardware: [`CanPort::receive`](rc10_can::CanPort::receive).
    pub fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        if self.received.is_empty() {
            // Also where interrupts are masked, or come too late.
            self.serve();
        }
        self.received.pop_front()
    }

    /// Takes a frame: [`CanPort::submit_as`](rc10_can::CanPort::submit_as). One on the wire is not
    /// replaced: the answer is [`Submitted::Queued`], and the newer one follows.
    pub fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted {
        if self.presence != Presence::On {
            return Submitted::Refused;
        }
        self.settle_all();
        let older = self.mailboxes.iter().position(|loaded| {
            loaded.is_some_and(|loaded| loaded.is_wanted() && loaded.queued.stream == stream)
        });
        let replaces = older.is_some() || self.waiting.holds(stream);
        if !replaces && self.unsent() >= TRANSMIT_QUEUE {
            return Submitted::Refused;
        }
        let aborted = older.and_then(|mailbox| self.abort(mailbox, Purpose::Superseded));
        let submitted = self.waiting.put(Queued { frame: *frame, stream });
        self.fill();
        if aborted == Some(Ended::Aborted) { Submitted::Replaced } else { submitted }
    }

    /// Drops frames, for [`CanPort::cancel_pending`](rc10_can::CanPort::cancel_pending). A frame
    /// that is on the wire is not repeated if it fails, and not among those that it says.
    pub fn cancel_pending(&mut self) -> u8 {
        self.settle_all();
        let mut cancelled = self.waiting.clear();
        for mailbox in 0..MAILBOXES {
            if self.mailboxes[mailbox].is_some_and(|loaded| loaded.is_wanted())
                && self.abort(mailbox, Purpose::Cancelled) == Some(Ended::Aborted)
            {
                cancelled = cancelled.saturating_add(1);
            }
        }
        cancelled
    }

    /// The health, for [`CanPort::health`](rc10_can::CanPort::health).
    pub fn health(&mut self) -> Health {
        let errors = self.hardware.errors();
        self.health.state = errors.state;
        self.health.transmit_errors = errors.transmit;
        self.health.receive_errors = errors.receive;
        if errors.last.is_some() {
            self.health.last_error = errors.last;
        }
        self.health
    }

    /// Frames that left, on the wire already, although a newer one of their stream was there.
    pub const fn unreplaced(&self) -> u32 {
        self.unreplaced
    }

    /// Sets the filters, for [`CanPort::accept`](rc10_can::CanPort::accept).
    pub fn accept(&mut self, patterns: &[IdPattern]) {
        self.hardware.accept(patterns);
    }

    /// Goes back: [`CanPort::recover`](rc10_can::CanPort::recover). If it cannot begin,
    /// [`serve`](Self::serve) asks again, and frames are refused.
    pub fn recover(&mut self) {
        if self.presence != Presence::On {
            self.take_received();
            self.cancel_pending();
            self.go_back();
        }
    }

    /// Received frames must have been taken before.
    #[cold]
    fn go_back(&mut self) {
        self.presence = if self.hardware.restart() { Presence::On } else { Presence::Asked };
    }

    fn take_received(&mut self) {
        while let Some(frame) = self.hardware.receive() {
            if self.received.push_back((frame, self.hardware.now())).is_err() {
                count(&mut self.health.receive_lost);
            }
        }
        if self.hardware.overrun() {
            count(&mut self.health.receive_lost);
        }
    }

    #[cold]
    fn leave_bus(&mut self) {
        self.presence = Presence::Off;
        count(&mut self.health.bus_offs);
        self.settle_all();
        let unsent = u32::try_from(self.unsent()).unwrap_or(u32::MAX);
        self.health.transmit_lost = self.health.transmit_lost.saturating_add(unsent);
        self.cancel_pending();
    }

    fn unsent(&self) -> usize {
        let loaded = self.mailboxes.iter().flatten().filter(|loaded| loaded.is_wanted());
        self.waiting.len() + loaded.count()
    }

    /// Aborts the frame in a mailbox; says how it ended, if that is known at once.
    fn abort(&mut self, mailbox: usize, purpose: Purpose) -> Option<Ended> {
        self.mailboxes[mailbox].as_mut()?.purpose = purpose;
        self.hardware.abort(mailbox);
        self.settle(mailbox)
    }

    fn settle_all(&mut self) {
        for mailbox in 0..MAILBOXES {
            self.settle(mailbox);
            if self.mailboxes[mailbox].is_some_and(|loaded| loaded.purpose != Purpose::Send) {
                // The hardware may have missed the request: asked twice it does no more than once.
                self.hardware.abort(mailbox);
            }
        }
    }

    /// Looks what became of the frame in a mailbox.
    fn settle(&mut self, mailbox: usize) -> Option<Ended> {
        let loaded = self.mailboxes[mailbox]?;
        let ended = self.hardware.ended(mailbox)?;
        self.mailboxes[mailbox] = None;
        match ended {
            Ended::Sent if loaded.purpose == Purpose::Superseded => count(&mut self.unreplaced),
            Ended::Aborted if loaded.is_wanted() => {
                // There is room: `unsent` counted it.
                if self.waiting.put_back(loaded.queued) == Submitted::Refused {
                    count(&mut self.health.transmit_lost);
                }
            }
            Ended::Sent | Ended::Aborted => (),
        }
        Some(ended)
    }

    /// Loads the most urgent waiting frames, but none with an older one of its stream or identifier
    /// in a mailbox: of equal identifiers the lower mailbox leaves first.
    fn fill(&mut self) {
        while let Some(next) = self.waiting.peek_if(may_leave(&self.mailboxes)).copied() {
            let free = self.mailboxes.iter().position(Option::is_none);
            let Some(mailbox) = free.or_else(|| self.make_room(&next)) else { return };
            // The frame that made room may be back by now, and is not more urgent.
            let may_leave = may_leave(&self.mailboxes);
            let Some(queued) = self.waiting.pop_if(may_leave) else { return };
            self.hardware.load(mailbox, &queued.frame);
            self.mailboxes[mailbox] = Some(Loaded { queued, purpose: Purpose::Send });
        }
    }

    /// Empties the mailbox of the least urgent frame, if less than `next`; which is free at once.
    fn make_room(&mut self, next: &Queued) -> Option<usize> {
        let loaded = || self.mailboxes.iter().flatten();
        if loaded().any(|loaded| loaded.purpose != Purpose::Send) {
            // Room is being made.
            return None;
        }
        let least = (0..MAILBOXES)
            .max_by_key(|&mailbox| self.mailboxes[mailbox].map(|loaded| urgency(&loaded.queued)))?;
        if urgency(&self.mailboxes[least]?.queued) <= urgency(next) {
            return None;
        }
        self.abort(least, Purpose::MakeRoom).map(|_| least)
    }
}

impl<H> fmt::Debug for Driver<H> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Driver").field("waiting", &self.waiting).finish_non_exhaustive()
    }
}

/// Whether no frame of the same stream or identifier is in a mailbox.
fn may_leave(mailboxes: &[Option<Loaded>; MAILBOXES]) -> impl Fn(&Queued) -> bool {
    |waiting| {
        !mailboxes.iter().flatten().any(|Loaded { queued, .. }| {
            queued.stream == waiting.stream || queued.frame.key() == waiting.frame.key()
        })
    }
}

/// Lowest leaves first: `Id`'s order; data before remote of the same id.
fn urgency(queued: &Queued) -> (Id, bool) {
    (queued.frame.id(), queued.frame.is_remote())
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
