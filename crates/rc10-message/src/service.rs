use core::cell::RefCell;
use core::fmt;
use core::future::poll_fn;
use core::pin::Pin;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::{Context, Poll};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::WakerRegistration;
use embassy_time::{Duration, with_timeout};
use rc10_time::Micros;

/// Requests and their responses: any task calls, one task serves.
///
/// Up to `CALLERS` calls, served in their order; each caller gets its own response or an error that
/// says why not. A late response is dropped and counted.
///
/// ```
/// # mod clock { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clock/mod.rs")); }
/// use rc10_time::Micros;
/// use rc10_message::{CallError, Service};
///
/// /// The angle to turn to, in degrees, and what came of it.
/// static TURN: Service<u16, Result<(), &'static str>> = Service::new();
///
/// // A task that serves and does nothing else.
/// let mut server = TURN.server()?;
/// let serve = server.serve(async |angle| if angle < 360 { Ok(()) } else { Err("beyond the turn") });
///
/// // Any other task.
/// let caller = async {
///     let timeout = Micros::from_millis(50);
///     assert_eq!(TURN.call(90, timeout).await, Ok(Ok(())));
///     assert_eq!(TURN.call(400, timeout).await, Ok(Err("beyond the turn")));
/// };
/// # let mut tasks = clock::Tasks::new();
/// # tasks.add(async { serve.await; });
/// # tasks.add(caller);
/// # tasks.run(Micros::from_millis(200));
/// # assert_eq!(TURN.calls().answered, 2);
/// # Ok::<(), rc10_message::AlreadyServed>(())
/// ```
///
/// A task with more to do, as a control loop, looks with [`try_next`](Self::try_next).
///
/// A request or response is copied in and out under a critical section: keep them small.
pub struct Service<Request, Response, const CALLERS: usize = 4> {
    /// Whether a request may be there: one load to look. A hint, written where the state is locked.
    pending: AtomicBool,
    state: Mutex<CriticalSectionRawMutex, RefCell<State<Request, Response, CALLERS>>>,
}

/// Microseconds, about twelve days: embassy's sums with it do not overflow, whatever its tick.
const LONGEST_TIMEOUT: u64 = 1 << 40;

struct State<Request, Response, const CALLERS: usize> {
    slots: [Option<Slot<Request, Response>>; CALLERS],
    /// Whether there is a [`Server`], and what wakes it.
    served: bool,
    server: WakerRegistration,
    /// The number of the newest call, and so of all calls.
    sequence: u32,
    timed_out: u32,
    cancelled: u32,
    unserved: u32,
    late: u32,
}

struct Slot<Request, Response> {
    /// Tells one call from the next, so that no caller takes another's response; counts upwards.
    sequence: u32,
    stage: Stage<Request, Response>,
    caller: WakerRegistration,
}

enum Stage<Request, Response> {
    Waiting(Request),
    Taken,
    Answered(Response),
    NotServed,
}

/// Why a call brought no response.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CallError {
    /// The service has no room for another caller. The request was not given to the server.
    #[error("{most} callers wait already")]
    Full {
        /// Largest number of callers that can wait.
        most: usize,
    },
    /// The request was not taken in time, and was taken back: does the server run?
    #[error("no server took the request in time: does the server run?")]
    NotTaken,
    /// The server has taken the request, but not answered in time: the outcome is not known.
    #[error("the server took the request and did not answer in time")]
    TimedOut,
    /// The server has taken the request and dropped it.
    #[error("the server dropped the request")]
    NotServed,
}

/// Counters of a service's calls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Calls {
    /// Calls so far, without those that found no room. Each ends as one of the next four.
    pub calls: u32,
    /// Got their response.
    pub answered: u32,
    /// Did not get it in time.
    pub timed_out: u32,
    /// Were dropped by their caller.
    pub cancelled: u32,
    /// Were told that the server dropped their request.
    pub unserved: u32,
    /// Callers that wait now.
    pub waiting: u32,
    /// Responses whose caller had gone: dropped.
    pub late: u32,
}

impl<Request, Response, const CALLERS: usize> Service<Request, Response, CALLERS> {
    /// A service without calls.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(CALLERS > 0, "a service needs room for a caller") };
        Self {
            pending: AtomicBool::new(false),
            state: Mutex::new(RefCell::new(State {
                slots: [const { None }; CALLERS],
                served: false,
                server: WakerRegistration::new(),
                sequence: 0,
                timed_out: 0,
                cancelled: 0,
                unserved: 0,
                late: 0,
            })),
        }
    }

    /// Asks, and waits for the response, at most for `timeout`.
    ///
    /// A request not taken in its time is taken back; a response in the last moment counts.
    ///
    /// # Errors
    /// [`CallError`], which says whether the request was taken.
    ///
    /// # Cancel safety
    /// The future may be dropped: an untaken request is taken back, another's response dropped.
    pub async fn call(&self, request: Request, timeout: Micros) -> Result<Response, CallError> {
        let mut waiting = self.ask(request)?;
        let timeout = Duration::from_micros(timeout.get().min(LONGEST_TIMEOUT));
        match with_timeout(timeout, &mut waiting).await {
            Ok(outcome) => outcome,
            Err(_) => self.with(|state| state.end(waiting.sequence)),
        }
    }

    /// The same, without a limit: for servers that are known to answer. As cancel safe.
    ///
    /// # Errors
    /// [`CallError::Full`], at once, or [`CallError::NotServed`].
    pub async fn call_without_timeout(&self, request: Request) -> Result<Response, CallError> {
        self.ask(request)?.await
    }

    fn ask(&self, request: Request) -> Result<Waiting<'_, Request, Response, CALLERS>, CallError> {
        self.with(|state| {
            let free = state.slots.iter_mut().find(|slot| slot.is_none());
            let free = free.ok_or(CallError::Full { most: CALLERS })?;
            state.sequence = state.sequence.wrapping_add(1);
            let (sequence, stage) = (state.sequence, Stage::Waiting(request));
            *free = Some(Slot { sequence, stage, caller: WakerRegistration::new() });
            self.pending.store(true, Ordering::Release);
            state.server.wake();
            Ok(Waiting { service: self, sequence })
        })
    }

    /// The oldest untaken request and its caller, if any, from any task; never waits.
    ///
    /// ```
    /// # mod clock { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clock/mod.rs")); }
    /// use embassy_time::Timer;
    /// use rc10_time::Micros;
    /// use rc10_message::Service;
    ///
    /// static RAISE: Service<i32, i32> = Service::new();
    ///
    /// // A control task: a tick every millisecond, with or without requests.
    /// let lift = async {
    ///     let (mut height, mut goal) = (0, None);
    ///     loop {
    ///         Timer::after_millis(1).await;
    ///         // A newer request counts: who asked for the older one is told at once.
    ///         goal = RAISE.try_next().or(goal);
    ///         let Some((wanted, _)) = &goal else { continue };
    ///         height += (wanted - height).signum();
    ///         if height == *wanted && let Some((_, caller)) = goal.take() {
    ///             caller.reply(height);
    ///         }
    ///     }
    /// };
    /// let caller = async {
    ///     assert_eq!(RAISE.call(20, Micros::from_millis(100)).await, Ok(20));
    /// };
    /// # let mut tasks = clock::Tasks::new();
    /// # tasks.add(lift);
    /// # tasks.add(caller);
    /// # tasks.run(Micros::from_millis(200));
    /// # assert_eq!(RAISE.calls().answered, 1);
    /// ```
    #[inline]
    pub fn try_next(&self) -> Option<(Request, Caller<'_, Request, Response, CALLERS>)> {
        if self.pending.load(Ordering::Acquire) {
            self.with(|state| self.take(state))
        } else {
            None
        }
    }

    /// The right to wait for requests. Dropped, it leaves them to another server.
    ///
    /// # Errors
    /// [`AlreadyServed`] while there is one: two that wait would wake each other for ever.
    pub fn server(&self) -> Result<Server<'_, Request, Response, CALLERS>, AlreadyServed> {
        let served = self.with(|state| core::mem::replace(&mut state.served, true));
        if served { Err(AlreadyServed) } else { Ok(Server { service: self }) }
    }

    /// Counters of the calls so far. They start over after 2³².
    #[must_use]
    pub fn calls(&self) -> Calls {
        self.with(|state| {
            let &mut State { sequence, timed_out, cancelled, unserved, late, .. } = state;
            #[expect(clippy::cast_possible_truncation, reason = "a service has a few callers")]
            let waiting = state.slots.iter().flatten().count() as u32;
            let others = [timed_out, cancelled, unserved, waiting];
            let answered = others.into_iter().fold(sequence, u32::wrapping_sub);
            Calls { calls: sequence, answered, timed_out, cancelled, unserved, waiting, late }
        })
    }

    fn take(
        &self,
        state: &mut State<Request, Response, CALLERS>,
    ) -> Option<(Request, Caller<'_, Request, Response, CALLERS>)> {
        let newest = state.sequence;
        let mut pending = 0;
        let waiting = state.slots.iter_mut().flatten();
        let oldest = waiting
            .filter(|slot| matches!(slot.stage, Stage::Waiting(_)))
            .inspect(|_| pending += 1)
            .max_by_key(|slot| newest.wrapping_sub(slot.sequence));
        let taken =
            oldest.and_then(|slot| match core::mem::replace(&mut slot.stage, Stage::Taken) {
                Stage::Waiting(request) => Some((request, slot.sequence)),
                _ => None,
            });
        self.pending.store(pending > 1, Ordering::Release);
        taken.map(|(request, sequence)| (request, Caller { service: self, sequence }))
    }

    fn with<R>(&self, f: impl FnOnce(&mut State<Request, Response, CALLERS>) -> R) -> R {
        self.state.lock(|state| f(&mut state.borrow_mut()))
    }
}

impl<Request, Response, const CALLERS: usize> Default for Service<Request, Response, CALLERS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<Request, Response, const CALLERS: usize> fmt::Debug for Service<Request, Response, CALLERS> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Service").field(&self.calls()).finish()
    }
}

impl<Request, Response, const CALLERS: usize> State<Request, Response, CALLERS> {
    fn slot(&mut self, sequence: u32) -> Option<&mut Option<Slot<Request, Response>>> {
        let of_caller = |slot: &&mut Option<Slot<_, _>>| {
            slot.as_ref().is_some_and(|slot| slot.sequence == sequence)
        };
        self.slots.iter_mut().find(of_caller)
    }

    /// The caller leaves: what its call had come to.
    fn leave(&mut self, sequence: u32) -> Option<Stage<Request, Response>> {
        self.slot(sequence)?.take().map(|slot| slot.stage)
    }

    /// The caller leaves, because its server is done or its time is over: the outcome of its call.
    fn end(&mut self, sequence: u32) -> Result<Response, CallError> {
        let (count, error) = match self.leave(sequence) {
            // Also in the last moment.
            Some(Stage::Answered(response)) => return Ok(response),
            Some(Stage::NotServed) => (&mut self.unserved, CallError::NotServed),
            Some(Stage::Waiting(_)) => (&mut self.timed_out, CallError::NotTaken),
            Some(Stage::Taken) | None => (&mut self.timed_out, CallError::TimedOut),
        };
        *count = count.wrapping_add(1);
        Err(error)
    }

    /// The outcome of a call that its server is done with; its caller has left then.
    fn outcome(
        &mut self,
        sequence: u32,
        context: &Context<'_>,
    ) -> Poll<Result<Response, CallError>> {
        // Without a slot it is polled again after its end.
        let Some(Some(slot)) = self.slot(sequence) else { return Poll::Pending };
        if let Stage::Waiting(_) | Stage::Taken = slot.stage {
            slot.caller.register(context.waker());
            return Poll::Pending;
        }
        Poll::Ready(self.end(sequence))
    }

    /// Ends a call that was taken, if its caller still waits.
    fn finish(&mut self, sequence: u32, stage: Stage<Request, Response>) -> bool {
        let Some(Some(slot)) = self.slot(sequence) else {
            return false;
        };
        slot.stage = stage;
        slot.caller.wake();
        true
    }
}

/// The server of a [`Service`]: takes its requests.
pub struct Server<'s, Request, Response, const CALLERS: usize = 4> {
    service: &'s Service<Request, Response, CALLERS>,
}

impl<'s, Request, Response, const CALLERS: usize> Server<'s, Request, Response, CALLERS> {
    /// Waits for a request: the oldest that was not taken yet, and who waits for the response.
    ///
    /// # Cancel safety
    /// Dropping the future loses no request.
    pub async fn next(&mut self) -> (Request, Caller<'s, Request, Response, CALLERS>) {
        let service = self.service;
        poll_fn(|context| {
            service.with(|state| match service.take(state) {
                Some(request) => Poll::Ready(request),
                None => {
                    state.server.register(context.waker());
                    Poll::Pending
                }
            })
        })
        .await
    }

    /// Serves for ever: one request after the other.
    ///
    /// # Cancel safety
    /// Dropped while it answers, it tells that caller [`NotServed`](CallError::NotServed).
    pub async fn serve(&mut self, mut answer: impl AsyncFnMut(Request) -> Response) -> ! {
        loop {
            let (request, caller) = self.next().await;
            caller.reply(answer(request).await);
        }
    }
}

impl<Request, Response, const CALLERS: usize> Drop for Server<'_, Request, Response, CALLERS> {
    fn drop(&mut self) {
        self.service.with(|state| state.served = false);
    }
}

impl<Request, Response, const CALLERS: usize> fmt::Debug
    for Server<'_, Request, Response, CALLERS>
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Server").field(self.service).finish()
    }
}

/// Another task serves already.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("another task serves already")]
pub struct AlreadyServed;

/// A caller's slot in the queue; left on drop.
struct Waiting<'s, Request, Response, const CALLERS: usize> {
    service: &'s Service<Request, Response, CALLERS>,
    sequence: u32,
}

impl<Request, Response, const CALLERS: usize> Future for Waiting<'_, Request, Response, CALLERS> {
    type Output = Result<Response, CallError>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        self.service.with(|state| state.outcome(self.sequence, context))
    }
}

impl<Request, Response, const CALLERS: usize> Drop for Waiting<'_, Request, Response, CALLERS> {
    fn drop(&mut self) {
        self.service.with(|state| {
            let Some(stage) = state.leave(self.sequence) else { return };
            if let Stage::Answered(_) = stage {
                state.late = state.late.wrapping_add(1);
            }
            state.cancelled = state.cancelled.wrapping_add(1);
        });
    }
}

/// The caller that waits: [`reply`](Self::reply) now or later; dropped, it is not served.
#[must_use = "dropped, it tells the caller that its request is not served"]
pub struct Caller<'s, Request, Response, const CALLERS: usize = 4> {
    service: &'s Service<Request, Response, CALLERS>,
    sequence: u32,
}

impl<Request, Response, const CALLERS: usize> Caller<'_, Request, Response, CALLERS> {
    /// Answers. If the caller has gone the response is dropped, and counted as late.
    pub fn reply(self, response: Response) {
        self.service.with(|state| {
            if !state.finish(self.sequence, Stage::Answered(response)) {
                state.late = state.late.wrapping_add(1);
            }
        });
        core::mem::forget(self);
    }

    /// Whether it still waits: who has gone wants a long job stopped.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        self.service.with(|state| state.slot(self.sequence).is_some())
    }
}

impl<Request, Response, const CALLERS: usize> Drop for Caller<'_, Request, Response, CALLERS> {
    fn drop(&mut self) {
        self.service.with(|state| state.finish(self.sequence, Stage::NotServed));
    }
}

impl<Request, Response, const CALLERS: usize> fmt::Debug
    for Caller<'_, Request, Response, CALLERS>
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Caller").field("sequence", &self.sequence).finish_non_exhaustive()
    }
}
