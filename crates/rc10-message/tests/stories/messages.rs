//! Publishers in tasks and interrupts, subscribers that are slow, give up, leave and come back.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embassy_futures::select::select;
use embassy_time::Timer;
use rc10_message::{Latest, Message, SubscribersFull, Topic};
use rc10_time::Micros;

use crate::clock::{Random, Tasks, interrupt_with, now};
use crate::tell;

const SUBSCRIBERS: usize = 3;
const MESSAGES: u64 = 40;

struct Story {
    topic: Topic<u64, 4, SUBSCRIBERS>,
    latest: Latest<u64, SUBSCRIBERS>,
    random: RefCell<Random>,
    /// How many messages there were: they are numbered, from 0.
    published: Cell<u64>,
    subscribed: Cell<usize>,
    heard: Cell<u64>,
    missed: Cell<u64>,
}

impl Story {
    fn below(&self, end: u64) -> u64 {
        self.random.borrow_mut().below(end)
    }

    async fn pause(&self, most: u64) {
        let micros = self.below(most);
        if micros > 0 {
            Timer::after_micros(micros).await;
        }
    }

    fn publish(&self) {
        let number = self.published.get();
        if number < MESSAGES {
            self.published.set(number + 1);
            self.topic.publish(number);
            self.latest.set(number, now());
        }
    }

    async fn publisher(&self) {
        while self.published.get() < MESSAGES {
            self.pause(1_000).await;
            for _ in 0..self.below(6) {
                self.publish();
            }
        }
    }

    /// Nothing between two messages is lost unreported.
    fn hear(&self, next: &mut u64, message: Message<u64>) {
        assert_eq!(message.value, *next + message.missed);
        *next = message.value + 1;
        self.heard.set(self.heard.get() + 1);
        self.missed.set(self.missed.get() + message.missed);
    }

    /// Subscribes for a while, again and again.
    async fn subscriber(&self) {
        while self.published.get() < MESSAGES {
            self.pause(3_000).await;
            let mut next = self.published.get();
            let mut messages = match self.topic.subscribe() {
                Ok(messages) => messages,
                Err(full) => {
                    let most = SUBSCRIBERS;
                    assert_eq!((full, self.subscribed.get()), (SubscribersFull { most }, most));
                    continue;
                }
            };
            self.subscribed.set(self.subscribed.get() + 1);
            let stay = self.below(8);
            for _ in 0..stay {
                match self.below(3) {
                    // Each with a future that is dropped at some time.
                    0 => {
                        let work = async |message| {
                            self.hear(&mut next, message);
                            self.pause(700).await;
                        };
                        let time = Timer::after_micros(self.below(3_000));
                        select(messages.for_each(work), time).await;
                    }
                    1 => {
                        let listen = async { self.hear(&mut next, messages.next().await) };
                        select(listen, Timer::after_micros(self.below(500))).await;
                    }
                    _ => {
                        self.pause(2_000).await;
                        if let Some(message) = messages.try_next() {
                            self.hear(&mut next, message);
                        }
                    }
                }
            }
            // A reader of all that is there has heard, or heard of, all that there was.
            while let Some(message) = messages.try_next() {
                self.hear(&mut next, message);
            }
            assert_eq!(next, self.published.get());
            self.subscribed.set(self.subscribed.get() - 1);
        }
    }

    /// Sees only newer values, and always the newest.
    async fn watcher(&self) {
        let mut changes = self.latest.subscribe().unwrap();
        let mut newest = None;
        let mut see = |value| {
            assert!(newest < Some(value), "{newest:?} before {value}");
            assert_eq!(value + 1, self.published.get(), "not the newest");
            newest = Some(value);
        };
        while self.published.get() < MESSAGES {
            match self.below(3) {
                0 => {
                    let work = async |change: rc10_message::Stamped<u64>| {
                        see(change.value);
                        self.pause(700).await;
                    };
                    let time = Timer::after_micros(self.below(3_000));
                    select(changes.for_each(work), time).await;
                }
                1 => {
                    let listen = async { see(changes.next().await.value) };
                    select(listen, Timer::after_micros(self.below(500))).await;
                }
                _ => {
                    self.pause(2_000).await;
                    if let Some(change) = changes.try_next() {
                        see(change.value);
                    }
                }
            }
        }
        if let Some(change) = changes.try_next() {
            see(change.value);
        }
        assert_eq!(newest, self.published.get().checked_sub(1));
        assert!(changes.try_next().is_none());
    }
}

#[test]
fn whatever_subscribers_do_they_hear_every_message_or_how_many_they_missed() {
    let (heard, missed) = (Cell::new(0), Cell::new(0));
    tell(|seed| {
        let story = Rc::new(Story {
            topic: Topic::new(),
            latest: Latest::new(),
            random: RefCell::new(Random::new(seed)),
            published: Cell::new(0),
            subscribed: Cell::new(0),
            heard: Cell::new(0),
            missed: Cell::new(0),
        });
        let mut tasks = Tasks::with_seed(seed);
        tasks.add(story.publisher());
        for _ in 0..=SUBSCRIBERS {
            tasks.add(story.subscriber());
        }
        for _ in 0..2 {
            tasks.add(story.watcher());
        }
        let weak = Rc::downgrade(&story);
        interrupt_with(Some(Rc::new(move || {
            if let Some(story) = weak.upgrade()
                && story.below(16) == 0
            {
                story.publish();
            }
        })));
        let left = tasks.run(Micros::from_millis(2_000));
        interrupt_with(None);
        assert_eq!(left, 0, "somebody waits for ever");
        heard.set(heard.get() + story.heard.get());
        missed.set(missed.get() + story.missed.get());
    });
    println!("{} messages heard, {} missed and reported", heard.get(), missed.get());
    assert!(std::env::var("STORY").is_ok() || heard.get().min(missed.get()) > 10_000);
}
