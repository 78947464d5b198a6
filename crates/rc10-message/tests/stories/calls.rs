//! Callers that give up, servers of every kind that restart, and interrupts, at one service.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;

use embassy_futures::select::{Either, select};
use embassy_time::Timer;
use rc10_message::{AlreadyServed, CallError, Caller, Calls, Server, Service};
use rc10_time::Micros;

use crate::clock::{Random, Tasks, interrupt_with, now};
use crate::tell;

/// Fewer than there are callers, so that it is full at times.
const PLACES: usize = 3;
const CALLERS: u64 = 5;
const CALLS: u64 = 4;
/// Servers are back within milliseconds: who waits this long is served.
const PATIENT: Micros = Micros::from_millis(500);
/// Longest wait for a server: three places, each held for a life at most.
const BOUND: Micros = Micros::from_millis(60);

/// A request, and the response to it.
type Id = u64;

#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Answered,
    TimedOut,
    Cancelled,
    NotServed,
}

struct Story {
    service: Service<Id, Id, PLACES>,
    random: RefCell<Random>,
    /// Requests in the order in which they were made, and were taken.
    asked: RefCell<Vec<Id>>,
    taken: RefCell<Vec<Id>>,
    asked_at: RefCell<BTreeMap<Id, Micros>>,
    /// Since when the server waits, if it does.
    idle_since: Cell<Option<Micros>>,
    /// When a server was done with a request: answered or dropped.
    done: RefCell<BTreeMap<Id, Micros>>,
    replies: Cell<u32>,
    ends: RefCell<BTreeMap<Id, End>>,
    served: Cell<bool>,
    /// Calls that are not over.
    open: Cell<u64>,
}

/// A taken request. Dropped unanswered, the service is to tell its caller.
struct Work<'s> {
    story: &'s Story,
    id: Id,
    caller: Option<Caller<'s, Id, Id, PLACES>>,
}

impl Work<'_> {
    fn reply(mut self) {
        let Some(caller) = self.caller.take() else { return };
        self.story.replies.set(self.story.replies.get() + 1);
        caller.reply(self.id);
    }
}

impl Drop for Work<'_> {
    fn drop(&mut self) {
        self.story.done.borrow_mut().insert(self.id, now());
    }
}

impl Story {
    fn new(seed: u64) -> Self {
        Self {
            service: Service::new(),
            random: RefCell::new(Random::new(seed)),
            asked: RefCell::default(),
            taken: RefCell::default(),
            asked_at: RefCell::default(),
            idle_since: Cell::default(),
            done: RefCell::default(),
            replies: Cell::new(0),
            ends: RefCell::default(),
            served: Cell::new(false),
            open: Cell::new(CALLERS * CALLS),
        }
    }

    fn below(&self, end: u64) -> u64 {
        self.random.borrow_mut().below(end)
    }

    async fn pause(&self, most: u64) {
        let micros = self.below(most);
        if micros > 0 {
            Timer::after_micros(micros).await;
        }
    }

    /// A server has a request in its hands.
    fn take<'s>(&'s self, id: Id, caller: Option<Caller<'s, Id, Id, PLACES>>) -> Work<'s> {
        self.taken.borrow_mut().push(id);
        Work { story: self, id, caller }
    }

    async fn call(&self, id: Id) {
        self.pause(4_000).await;
        let timeout = if self.below(3) == 0 { PATIENT } else { Micros::new(self.below(4_000)) };
        let patience = if self.below(3) == 0 { self.below(3_000) } else { u64::MAX / 4 };
        let start = now();
        self.asked.borrow_mut().push(id);
        self.asked_at.borrow_mut().insert(id, start);
        let call = self.service.call(id, timeout);
        let outcome = match select(call, Timer::after_micros(patience)).await {
            Either::First(outcome) => outcome,
            Either::Second(()) => {
                self.ends.borrow_mut().insert(id, End::Cancelled);
                return;
            }
        };
        let waited = now().since(start);
        assert!(waited <= timeout.min(BOUND), "{id}: {outcome:?} after {waited}");
        let taken = self.taken.borrow().contains(&id);
        let end = match outcome {
            Ok(response) => {
                assert_eq!(response, id, "another's response");
                End::Answered
            }
            Err(CallError::Full { most }) => {
                assert_eq!((most, self.service.calls().waiting), (PLACES, 3));
                assert_eq!(self.asked.borrow_mut().pop(), Some(id));
                assert!(!taken);
                return;
            }
            Err(CallError::NotServed) => End::NotServed,
            Err(CallError::NotTaken) => {
                assert!(!taken, "{id} was taken");
                End::TimedOut
            }
            Err(CallError::TimedOut) => {
                assert!(taken && !self.done.borrow().contains_key(&id), "{id} was done with");
                End::TimedOut
            }
        };
        if end == End::TimedOut {
            assert_eq!(waited, timeout, "not when its time was over");
        } else {
            assert!(taken);
            assert_eq!(self.done.borrow().get(&id), Some(&now()), "{id} heard of it too late");
        }
        self.ends.borrow_mut().insert(id, end);
    }

    async fn caller(&self, number: u64) {
        for call in 0..CALLS {
            self.call(number * CALLS + call).await;
            self.open.set(self.open.get() - 1);
        }
    }

    /// A server that lives for a while, and then another, perhaps of another kind.
    async fn servers(&self) {
        loop {
            self.pause(2_000).await;
            if self.below(3) == 0 {
                select(self.look(), self.life()).await;
                continue;
            }
            let mut server = match self.service.server() {
                Ok(server) => server,
                Err(AlreadyServed) => {
                    assert!(self.served.get());
                    continue;
                }
            };
            assert!(!self.served.replace(true));
            if self.below(2) == 0 {
                select(self.serve(&mut server), self.life()).await;
            } else {
                select(self.keep(&mut server), self.life()).await;
            }
            self.served.set(false);
        }
    }

    fn life(&self) -> Timer {
        Timer::after_micros(self.below(5_000))
    }

    /// The server has waited, and has a request: it must not have waited longer.
    fn found(&self, id: Id) {
        let asked_at = self.asked_at.borrow()[&id];
        let idle_since = self.idle_since.take().unwrap();
        assert_eq!(now(), asked_at.max(idle_since), "{id} was left waiting");
    }

    /// One request after the other.
    async fn serve(&self, server: &mut Server<'_, Id, Id, PLACES>) {
        self.idle_since.set(Some(now()));
        server
            .serve(async |id| {
                self.found(id);
                let work = self.take(id, None);
                self.pause(800).await;
                self.replies.set(self.replies.get() + 1);
                drop(work);
                self.idle_since.set(Some(now()));
                id
            })
            .await;
    }

    /// Keeps requests, and answers or drops any of them, later.
    async fn keep<'s>(&'s self, server: &mut Server<'s, Id, Id, PLACES>) {
        let mut kept = Vec::new();
        loop {
            self.idle_since.set(Some(now()));
            let (id, caller) = server.next().await;
            self.found(id);
            kept.push(self.take(id, Some(caller)));
            self.pause(800).await;
            while !kept.is_empty() && self.below(2) == 0 {
                let work = kept.swap_remove(self.random.borrow_mut().index(kept.len()));
                if self.below(4) > 0 {
                    work.reply();
                }
            }
        }
    }

    /// A control task: looks, and does not wait.
    async fn look(&self) {
        loop {
            Timer::after_micros(500).await;
            while let Some((id, caller)) = self.service.try_next() {
                let work = self.take(id, Some(caller));
                self.pause(300).await;
                work.reply();
            }
        }
    }

    /// Answers at once, or not at all.
    fn interrupt(&self) {
        if self.below(8) == 0
            && let Some((id, caller)) = self.service.try_next()
        {
            let work = self.take(id, Some(caller));
            if self.below(3) > 0 {
                work.reply();
            }
        }
    }

    fn judge(&self) {
        let (asked, ends) = (self.asked.borrow(), self.ends.borrow());
        // In turn: who was taken later had asked later.
        let place = |id| asked.iter().position(|other| other == id).unwrap();
        let order: Vec<_> = self.taken.borrow().iter().map(place).collect();
        assert!(order.is_sorted_by(|a, b| a < b), "not in turn: {order:?} of {asked:?}");
        assert_eq!(asked.len(), ends.len(), "a call that never ended");
        let count = |end| ends.values().map(|&other| u32::from(other == end)).sum::<u32>();
        let answered = count(End::Answered);
        let expected = Calls {
            calls: ends.values().map(|_| 1).sum(),
            answered,
            timed_out: count(End::TimedOut),
            cancelled: count(End::Cancelled),
            unserved: count(End::NotServed),
            waiting: 0,
            late: self.replies.get() - answered,
        };
        assert_eq!(self.service.calls(), expected);
    }
}

/// The events of all stories, to see that everything happens.
#[derive(Debug, Default)]
struct Total {
    calls: Calls,
}

#[test]
fn whatever_callers_and_servers_do_every_call_ends_with_its_own_answer_or_why_not() {
    let total = RefCell::new(Total::default());
    tell(|seed| {
        let story = Rc::new(Story::new(seed));
        let mut tasks = Tasks::with_seed(seed);
        for number in 0..CALLERS {
            tasks.add({
                let story = Rc::clone(&story);
                async move { story.caller(number).await }
            });
        }
        for _ in 0..=story.below(2) {
            tasks.add({
                let story = Rc::clone(&story);
                async move { story.servers().await }
            });
        }
        let weak = Rc::downgrade(&story);
        interrupt_with(Some(Rc::new(move || {
            if let Some(story) = weak.upgrade() {
                story.interrupt();
            }
        })));
        for _ in 0..1000 {
            if story.open.get() == 0 {
                break;
            }
            tasks.run(Micros::from_millis(1));
        }
        interrupt_with(None);
        assert_eq!(story.open.get(), 0, "somebody waits for ever");
        // Servers answer no more.
        drop(tasks);
        story.judge();
        let (calls, all) = (story.service.calls(), &mut total.borrow_mut().calls);
        all.calls += calls.calls;
        all.answered += calls.answered;
        all.timed_out += calls.timed_out;
        all.cancelled += calls.cancelled;
        all.unserved += calls.unserved;
        all.late += calls.late;
    });
    let Total { calls } = total.into_inner();
    println!("{calls:?}");
    let rarest = [calls.answered, calls.timed_out, calls.cancelled, calls.unserved, calls.late];
    assert!(std::env::var("STORY").is_ok() || rarest.iter().all(|&n| n > 1000), "{calls:?}");
}
