use core::fmt;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::watch::{Receiver, Watch};
use rc10_time::Micros;

use crate::SubscribersFull;

/// The newest value of something, and how old it is.
///
/// Any task may look; `SUBSCRIBERS` may wait. A late one sees the newest value once.
///
/// ```
/// use rc10_message::Latest;
/// use rc10_time::Micros;
///
/// static YAW: Latest<i32, 2> = Latest::new();
///
/// YAW.set(90, Micros::from_millis(10));
/// let (now, age) = (Micros::from_millis(14), Micros::from_millis(5));
/// assert_eq!(YAW.newer_than(age, now), Some(90));
/// assert_eq!(YAW.newer_than(age, Micros::from_millis(15)), None);
/// ```
pub struct Latest<T: Clone, const SUBSCRIBERS: usize> {
    watch: Watch<CriticalSectionRawMutex, Stamped<T>, SUBSCRIBERS>,
}

/// A value and when it was true.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamped<T> {
    /// The value.
    pub value: T,
    /// Time at which it was measured, or set.
    pub at: Micros,
}

impl<T: Clone, const SUBSCRIBERS: usize> Latest<T, SUBSCRIBERS> {
    /// No value yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { watch: Watch::new() }
    }

    /// Replaces the value and wakes who waits for it.
    pub fn set(&self, value: T, at: Micros) {
        self.watch.sender().send(Stamped { value, at });
    }

    /// The newest value, however old; `None` before the first.
    #[must_use]
    pub fn read(&self) -> Option<Stamped<T>> {
        self.watch.try_get()
    }

    /// The newest value if it is younger than `age`.
    #[must_use]
    pub fn newer_than(&self, age: Micros, now: Micros) -> Option<T> {
        let newest = self.read()?;
        (now.since(newest.at) < age).then_some(newest.value)
    }

    /// A subscription to changes; a value that is there counts as one. Dropping it makes room.
    ///
    /// # Errors
    /// [`SubscribersFull`] if there are `SUBSCRIBERS` already.
    pub fn subscribe(&self) -> Result<Changes<'_, T, SUBSCRIBERS>, SubscribersFull> {
        let full = SubscribersFull { most: SUBSCRIBERS };
        Ok(Changes { receiver: self.watch.receiver().ok_or(full)? })
    }
}

impl<T: Clone, const SUBSCRIBERS: usize> Default for Latest<T, SUBSCRIBERS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Clone + fmt::Debug, const SUBSCRIBERS: usize> fmt::Debug for Latest<T, SUBSCRIBERS> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Latest").field(&self.read()).finish()
    }
}

/// One that waits for a [`Latest`] to change.
pub struct Changes<'l, T: Clone, const SUBSCRIBERS: usize> {
    receiver: Receiver<'l, CriticalSectionRawMutex, Stamped<T>, SUBSCRIBERS>,
}

impl<T: Clone, const SUBSCRIBERS: usize> Changes<'_, T, SUBSCRIBERS> {
    /// Waits for a value that this subscription has not returned yet.
    ///
    /// # Cancel safety
    /// Dropping the future loses nothing.
    pub async fn next(&mut self) -> Stamped<T> {
        self.receiver.changed().await
    }

    /// Does `work` for every change, for ever; of those that come meanwhile it sees the newest.
    ///
    /// ```
    /// # mod clock { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clock/mod.rs")); }
    /// use rc10_time::Micros;
    /// use rc10_message::Latest;
    ///
    /// static MODE: Latest<&str, 1> = Latest::new();
    ///
    /// let mut shown = Vec::new();
    /// let mut modes = MODE.subscribe()?;
    /// let lamp = modes.for_each(async |mode| shown.push(mode.value));
    /// MODE.set("armed", Micros::from_millis(10));
    /// MODE.set("stopped", Micros::from_millis(11));
    /// # let mut tasks = clock::Tasks::new();
    /// # tasks.add(async { lamp.await; });
    /// # tasks.run(Micros::from_millis(20));
    /// # drop(tasks);
    /// assert_eq!(shown, ["stopped"]);
    /// # Ok::<(), rc10_message::SubscribersFull>(())
    /// ```
    ///
    /// # Cancel safety
    /// Dropping the future drops the `work` that it is in; a newer value is still there.
    pub async fn for_each(&mut self, mut work: impl AsyncFnMut(Stamped<T>)) -> ! {
        loop {
            work(self.next().await).await;
        }
    }

    /// The newest value if this subscription has not returned it yet.
    pub fn try_next(&mut self) -> Option<Stamped<T>> {
        self.receiver.try_changed()
    }
}

impl<T: Clone, const SUBSCRIBERS: usize> fmt::Debug for Changes<'_, T, SUBSCRIBERS> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Changes").finish_non_exhaustive()
    }
}
