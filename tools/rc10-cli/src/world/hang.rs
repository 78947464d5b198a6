//! Ends a program whose robot stops virtual time: one of its tasks never waits.

use std::sync::{Arc, Mutex, Once, PoisonError, Weak};
use std::thread;
use std::time::Duration;

use rc10_sim::Running;

use crate::terminal::tell;

/// Period of looks. Looks are counted, not time, so that a suspended program goes on.
const LOOK: Duration = Duration::from_millis(100);
/// Number of looks at one poll of a task: 5 s.
const LOOKS: u32 = 50;

struct Watched {
    running: Weak<Running>,
    poll: Option<u64>,
    looks: u32,
}

static WATCHED: Mutex<Vec<Watched>> = Mutex::new(Vec::new());

/// Watches tasks until they are dropped; one that does not return for 5 s ends the program with
/// code 3.
pub(crate) fn watch(running: &Arc<Running>) {
    static THREAD: Once = Once::new();
    let watched = Watched { running: Arc::downgrade(running), poll: None, looks: 0 };
    WATCHED.lock().unwrap_or_else(PoisonError::into_inner).push(watched);
    // Without a thread nothing is watched, and all else goes on.
    THREAD.call_once(|| drop(thread::Builder::new().name("hang".into()).spawn(look)));
}

fn look() {
    loop {
        thread::sleep(LOOK);
        let mut watched = WATCHED.lock().unwrap_or_else(PoisonError::into_inner);
        watched.retain(|it| it.running.strong_count() > 0);
        for Watched { running, poll, looks } in &mut *watched {
            let now = running.upgrade().and_then(|running| running.now());
            let seen = now.map(|(poll, _)| poll);
            *looks = if seen == *poll { *looks + 1 } else { 0 };
            *poll = seen;
            if let Some((_, task)) = now.filter(|_| *looks >= LOOKS) {
                tell(format_args!(
                    "the robot hangs: virtual time has stood still for 5 s, in its task {task}. It \
                     loops and never waits: is an `.await` missing? On the chip all tasks would hang \
                     with it, until the watchdog restarts it"
                ));
                std::process::exit(3);
            }
        }
    }
}
