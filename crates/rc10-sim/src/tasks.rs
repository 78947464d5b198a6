use std::future::Future;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Wake, Waker};

/// Set by wakers.
#[derive(Default)]
pub(crate) struct Awake(AtomicBool);

impl Awake {
    pub(crate) fn set(&self) {
        self.0.store(true, Ordering::Release);
    }

    pub(crate) fn take(&self) -> bool {
        self.0.swap(false, Ordering::AcqRel)
    }
}

impl Wake for Awake {
    fn wake(self: Arc<Self>) {
        self.set();
    }
    fn wake_by_ref(self: &Arc<Self>) {
        self.set();
    }
}

/// Several futures that run as one, each polled only when it was woken, in the order in which they
/// were added: an executor's tasks.
///
/// It is a future itself, for [`World::run`](crate::World::run), and ends when all have ended.
///
/// ```
/// use rc10_sim::{Tasks, World};
/// use rc10_can::Micros;
/// use std::pin::Pin;
/// use embassy_time::Timer;
///
/// let mut world = World::new(1);
/// let mut tasks = Tasks::new();
/// tasks.add(async { Timer::after_millis(3).await });
/// tasks.add(async { Timer::after_millis(7).await });
/// assert!(world.run(Pin::new(&mut tasks), Micros::from_millis(10)).is_ready());
/// assert_eq!(world.now(), Micros::from_millis(7));
/// ```
#[derive(Default)]
pub struct Tasks<'a> {
    tasks: Vec<Task<'a>>,
}

struct Task<'a> {
    /// `None` once it has ended.
    future: Option<Pin<Box<dyn Future<Output = ()> + 'a>>>,
    signal: Arc<Signal>,
}

/// One task's waker: marks the task, and wakes the future that runs the tasks.
#[derive(Default)]
struct Signal {
    awake: Awake,
    runner: Mutex<Option<Waker>>,
}

impl Wake for Signal {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }
    fn wake_by_ref(self: &Arc<Self>) {
        self.awake.set();
        // A lock that a panic left behind holds a whole waker all the same.
        let runner = self.runner.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runner) = &*runner {
            runner.wake_by_ref();
        }
    }
}

impl<'a> Tasks<'a> {
    /// No tasks.
    #[must_use]
    pub const fn new() -> Self {
        Self { tasks: Vec::new() }
    }

    /// Adds a task; it is polled first when the tasks are run next.
    pub fn add(&mut self, future: impl Future<Output = ()> + 'a) {
        let signal = Arc::<Signal>::default();
        signal.awake.set();
        self.tasks.push(Task { future: Some(Box::pin(future)), signal });
    }
}

impl Future for Tasks<'_> {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        let mut all_ended = true;
        for task in &mut self.tasks {
            let Some(future) = &mut task.future else {
                continue;
            };
            {
                let runner = task.signal.runner.lock();
                let mut runner = runner.unwrap_or_else(PoisonError::into_inner);
                runner.get_or_insert_with(|| context.waker().clone()).clone_from(context.waker());
            }
            if task.signal.awake.take() {
                let waker = Waker::from(Arc::clone(&task.signal));
                let poll = future.as_mut().poll(&mut Context::from_waker(&waker));
                if poll.is_ready() {
                    task.future = None;
                    continue;
                }
            }
            all_ended = false;
        }
        if all_ended { Poll::Ready(()) } else { Poll::Pending }
    }
}
