// An executor for tests, in virtual time: it polls one woken task after the other, in an order drawn
// from a seed, and when none is woken the clock jumps to the next deadline. A task that is not woken
// is not polled: a forgotten wake-up shows as a task that does not end.
//
// One clock per thread, so that tests do not disturb each other.

use std::cell::{Cell, RefCell};
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Wake, Waker};

use rc10_time::Micros;

struct Clock;

std::thread_local! {
    static NOW: Cell<u64> = const { Cell::new(0) };
    static TIMERS: RefCell<Vec<(u64, Waker)>> = const { RefCell::new(Vec::new()) };
    static INTERRUPT: RefCell<Option<Rc<dyn Fn()>>> = const { RefCell::new(None) };
}

impl embassy_time_driver::Driver for Clock {
    fn now(&self) -> u64 {
        // A reader of the clock holds no lock: a place as good as any for an interrupt.
        let interrupt = INTERRUPT.with_borrow_mut(Option::take);
        if let Some(interrupt) = interrupt {
            interrupt();
            INTERRUPT.with_borrow_mut(|place| {
                place.get_or_insert(interrupt);
            });
        }
        NOW.get()
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        TIMERS.with_borrow_mut(|timers| timers.push((at, waker.clone())));
    }
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock);

/// From now on this happens whenever the clock is read, wherever that is.
#[allow(dead_code, reason = "not everybody needs interrupts")]
pub fn interrupt_with(interrupt: Option<Rc<dyn Fn()>>) {
    INTERRUPT.with_borrow_mut(|place| *place = interrupt);
}

/// Lets time pass while code runs.
#[allow(dead_code, reason = "not every test has work that takes time")]
pub fn spend(time: Micros) {
    NOW.set(NOW.get() + time.get());
}

/// Runs one task until the clock would pass `end`.
#[allow(dead_code, reason = "for tests of one task")]
pub fn run_until<T>(end: Micros, task: impl Future<Output = T>) {
    let mut tasks = Tasks::new();
    tasks.add(async move {
        let _ = task.await;
    });
    tasks.run(Micros::new(end.get().saturating_sub(NOW.get())));
}

#[allow(dead_code, reason = "not every test asks")]
pub fn now() -> Micros {
    Micros::new(NOW.get())
}

/// Whole numbers from a seed (xorshift64*).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        // Neighbours must not begin alike, and zero never changes.
        Self(seed.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// 0 ..< `end`.
    pub fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) % end
    }

    /// An index below a length.
    pub fn index(&mut self, len: usize) -> usize {
        usize::try_from(self.below(len as u64)).unwrap()
    }
}

struct Awake(AtomicBool);

impl Wake for Awake {
    fn wake(self: Arc<Self>) {
        self.0.store(true, Ordering::Relaxed);
    }
}

type Task<'a> = Pin<Box<dyn Future<Output = ()> + 'a>>;

/// More polls than tasks need at one moment.
const RESTLESS: u32 = 100_000;

/// Tasks that run together.
pub struct Tasks<'a> {
    tasks: Vec<(Task<'a>, Arc<Awake>)>,
    random: Random,
}

impl<'a> Tasks<'a> {
    #[allow(dead_code, reason = "not everybody needs a seed, nor needs none")]
    pub fn new() -> Self {
        Self::with_seed(0)
    }

    pub fn with_seed(seed: u64) -> Self {
        Self { tasks: Vec::new(), random: Random::new(seed) }
    }

    pub fn add(&mut self, task: impl Future<Output = ()> + 'a) {
        self.tasks.push((Box::pin(task), Arc::new(Awake(AtomicBool::new(true)))));
    }

    /// Runs until all have ended, or a time is over. How many have not ended.
    pub fn run(&mut self, time: Micros) -> usize {
        let end = NOW.get() + time.get();
        let mut polls = 0;
        while !self.tasks.is_empty() {
            let woken =
                |(_, (_, awake)): &(usize, &(_, Arc<Awake>))| awake.0.load(Ordering::Relaxed);
            let woken: Vec<usize> =
                self.tasks.iter().enumerate().filter(woken).map(|(index, _)| index).collect();
            if woken.is_empty() {
                let next = TIMERS.with_borrow(|timers| timers.iter().map(|timer| timer.0).min());
                NOW.set(next.map_or(end, |next| next.max(NOW.get())).min(end));
                if next.is_none_or(|next| next > end) {
                    break;
                }
                let due = TIMERS.with_borrow_mut(|timers| {
                    timers.extract_if(.., |timer| timer.0 <= NOW.get()).collect::<Vec<_>>()
                });
                due.into_iter().for_each(|(_, waker)| waker.wake());
                polls = 0;
                continue;
            }
            polls += 1;
            assert!(polls < RESTLESS, "they wake each other for ever at {}", now());
            let chosen = woken[self.random.index(woken.len())];
            let (task, awake) = &mut self.tasks[chosen];
            awake.0.store(false, Ordering::Relaxed);
            let waker = Waker::from(Arc::clone(awake));
            if task.as_mut().poll(&mut Context::from_waker(&waker)).is_ready() {
                drop(self.tasks.remove(chosen));
            }
        }
        self.tasks.len()
    }
}

/// Time starts again at zero.
#[allow(dead_code, reason = "not everybody starts twice")]
pub fn rewind() {
    NOW.set(0);
    TIMERS.take();
}
