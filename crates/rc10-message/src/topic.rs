use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pubsub::{PubSubChannel, Subscriber, WaitResult};

type Channel<T, const CAPACITY: usize, const SUBSCRIBERS: usize> =
    PubSubChannel<CriticalSectionRawMutex, T, CAPACITY, SUBSCRIBERS, 0>;

/// A stream of messages: every subscriber hears every message.
///
/// Publishing never waits. Slow readers of the `SUBSCRIBERS` miss the oldest, and are told.
///
/// ```
/// use rc10_message::Topic;
///
/// static BUTTONS: Topic<u8, 2, 4> = Topic::new();
///
/// let mut display = BUTTONS.subscribe()?;
/// BUTTONS.publish(1);
/// BUTTONS.publish(2);
/// BUTTONS.publish(3); // pushes out 1, which `display` has not read yet
/// let message = display.try_next().unwrap();
/// assert_eq!((message.value, message.missed), (2, 1));
/// # Ok::<(), rc10_message::SubscribersFull>(())
/// ```
#[derive(Debug)]
pub struct Topic<T: Clone, const CAPACITY: usize, const SUBSCRIBERS: usize> {
    channel: Channel<T, CAPACITY, SUBSCRIBERS>,
}

/// A message and what was missed before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message<T> {
    /// The published message.
    pub value: T,
    /// Number of messages that this subscriber missed just before this one.
    pub missed: u64,
}

impl<T: Clone, const CAPACITY: usize, const SUBSCRIBERS: usize> Topic<T, CAPACITY, SUBSCRIBERS> {
    /// A topic without messages and subscribers.
    #[must_use]
    pub const fn new() -> Self {
        Self { channel: Channel::new() }
    }

    /// Sends a message to all subscribers there are now.
    pub fn publish(&self, message: T) {
        self.channel.immediate_publisher().publish_immediate(message);
    }

    /// A subscription to what is published from now on. Dropping it makes room for another.
    ///
    /// # Errors
    /// [`SubscribersFull`] if there are `SUBSCRIBERS` already.
    pub fn subscribe(&self) -> Result<Subscription<'_, T, CAPACITY, SUBSCRIBERS>, SubscribersFull> {
        let subscriber =
            self.channel.subscriber().map_err(|_| SubscribersFull { most: SUBSCRIBERS })?;
        Ok(Subscription { subscriber, missed: 0 })
    }
}

impl<T: Clone, const CAPACITY: usize, const SUBSCRIBERS: usize> Default
    for Topic<T, CAPACITY, SUBSCRIBERS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// One listener of a [`Topic`].
#[derive(Debug)]
pub struct Subscription<'t, T: Clone, const CAPACITY: usize, const SUBSCRIBERS: usize> {
    subscriber: Subscriber<'t, CriticalSectionRawMutex, T, CAPACITY, SUBSCRIBERS, 0>,
    missed: u64,
}

impl<T: Clone, const CAPACITY: usize, const SUBSCRIBERS: usize>
    Subscription<'_, T, CAPACITY, SUBSCRIBERS>
{
    /// Waits for the next message.
    ///
    /// # Cancel safety
    /// Nothing is lost, and no count of what was missed, if the future is dropped.
    pub async fn next(&mut self) -> Message<T> {
        loop {
            let result = self.subscriber.next_message().await;
            if let Some(message) = self.sort(result) {
                return message;
            }
        }
    }

    /// The next message if there is one.
    pub fn try_next(&mut self) -> Option<Message<T>> {
        loop {
            let result = self.subscriber.try_next_message()?;
            if let Some(message) = self.sort(result) {
                return Some(message);
            }
        }
    }

    /// Does `work` for every message, for ever. Those that come meanwhile are kept as for any
    /// subscriber; the next one tells what did not fit.
    ///
    /// ```
    /// # mod clock { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clock/mod.rs")); }
    /// use rc10_time::Micros;
    /// use rc10_message::Topic;
    ///
    /// static BUMPS: Topic<u8, 4, 2> = Topic::new();
    ///
    /// let mut heard = Vec::new();
    /// let mut bumps = BUMPS.subscribe()?;
    /// let task = bumps.for_each(async |message| {
    ///     if message.missed > 0 {
    ///         heard.push(format!("{} missed", message.missed));
    ///     }
    ///     heard.push(format!("bump {}", message.value));
    /// });
    /// // Five, and room for four.
    /// (1..=5).for_each(|bump| BUMPS.publish(bump));
    /// # let mut tasks = clock::Tasks::new();
    /// # tasks.add(async { task.await; });
    /// # tasks.run(Micros::from_millis(1));
    /// # drop(tasks);
    /// assert_eq!(heard, ["1 missed", "bump 2", "bump 3", "bump 4", "bump 5"]);
    /// # Ok::<(), rc10_message::SubscribersFull>(())
    /// ```
    ///
    /// # Cancel safety
    /// Dropping the future drops the `work` that it is in, and no other message.
    pub async fn for_each(&mut self, mut work: impl AsyncFnMut(Message<T>)) -> ! {
        loop {
            work(self.next().await).await;
        }
    }

    fn sort(&mut self, result: WaitResult<T>) -> Option<Message<T>> {
        match result {
            WaitResult::Lagged(count) => {
                self.missed += count;
                None
            }
            WaitResult::Message(value) => {
                Some(Message { value, missed: core::mem::take(&mut self.missed) })
            }
        }
    }
}

/// A [`Topic`] or a [`Latest`](crate::Latest) has as many subscribers as it has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is room for {most} subscribers")]
pub struct SubscribersFull {
    /// Largest number of subscribers.
    pub most: usize,
}
