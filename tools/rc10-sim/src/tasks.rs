use std::any::type_name;
use std::fmt;
use std::future::Future;
use std::panic::Location;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Wake, Waker};

use rc10_time::Micros;

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
}

/// Several futures that run as one, each polled only when it was woken, in the order in which they
/// were added: an executor's tasks.
///
/// It is a future itself, for [`World::run`](crate::World::run), and ends when all have ended.
///
/// ```
/// use rc10_sim::{Tasks, World};
/// use rc10_time::Micros;
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
    running: Arc<Running>,
    ended: Vec<(TaskName, Micros)>,
}

/// The name of a task: the function of its future, and the line that added it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskName {
    function: &'static str,
    added: &'static Location<'static>,
}

impl TaskName {
    /// The name of a future of this type, which the caller adds.
    #[track_caller]
    pub fn of<F>() -> Self {
        Self { function: type_name::<F>(), added: Location::caller() }
    }
}

impl fmt::Display for TaskName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let function = self.function.replace("::{{closure}}", "");
        write!(f, "`{function}` (added in {}:{})", self.added.file(), self.added.line())
    }
}

/// The task that is polled now, for another thread.
#[derive(Debug, Default)]
pub struct Running(Mutex<(u64, Option<TaskName>)>);

impl Running {
    fn set(&self, task: Option<TaskName>) {
        let mut now = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *now = (now.0 + 1, task);
    }

    /// The task, and a number that is another one at each poll; `None` between polls.
    pub fn now(&self) -> Option<(u64, TaskName)> {
        let now = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        now.1.map(|task| (now.0, task))
    }
}

struct Task<'a> {
    name: TaskName,
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
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a task; it is polled first when the tasks are run next.
    #[track_caller]
    pub fn add<F: Future<Output = ()> + 'a>(&mut self, future: F) {
        self.add_as(TaskName::of::<F>(), Box::pin(future));
    }

    /// The same, of another name.
    pub fn add_as(&mut self, name: TaskName, future: Pin<Box<dyn Future<Output = ()> + 'a>>) {
        let signal = Arc::<Signal>::default();
        signal.awake.set();
        self.tasks.push(Task { name, future: Some(future), signal });
    }

    /// The task that is polled now.
    pub fn running(&self) -> Arc<Running> {
        Arc::clone(&self.running)
    }

    /// The tasks that have ended, and when.
    pub fn ended(&self) -> &[(TaskName, Micros)] {
        &self.ended
    }
}

impl Future for Tasks<'_> {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<()> {
        let mut all_ended = true;
        let Self { tasks, running, ended } = &mut *self;
        for task in tasks {
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
                running.set(Some(task.name));
                let poll = future.as_mut().poll(&mut Context::from_waker(&waker));
                running.set(None);
                if poll.is_ready() {
                    task.future = None;
                    ended.push((task.name, crate::now()));
                    continue;
                }
            }
            all_ended = false;
        }
        if all_ended { Poll::Ready(()) } else { Poll::Pending }
    }
}
