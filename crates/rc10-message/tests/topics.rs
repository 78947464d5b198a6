//! The view of subscribers.
#![cfg(test)]

use core::task::{Context, Waker};
use std::pin::pin;

use rc10_message::{Latest, Message, Stamped, SubscribersFull, Topic};
use rc10_time::Micros;

fn poll<T>(future: impl Future<Output = T>) -> Option<T> {
    let mut context = Context::from_waker(Waker::noop());
    match pin!(future).poll(&mut context) {
        core::task::Poll::Ready(value) => Some(value),
        core::task::Poll::Pending => None,
    }
}

#[test]
fn every_subscriber_hears_everything_and_a_slow_one_learns_what_it_missed() {
    let topic = Topic::<u32, 4, 2>::new();
    let mut quick = topic.subscribe().unwrap();
    let mut slow = topic.subscribe().unwrap();
    for value in 0..10 {
        topic.publish(value);
        assert_eq!(quick.try_next(), Some(Message { value, missed: 0 }));
    }
    assert_eq!(slow.try_next(), Some(Message { value: 6, missed: 6 }));
    let rest: Vec<_> = std::iter::from_fn(|| slow.try_next()).collect();
    assert_eq!(rest.iter().map(|message| message.value).collect::<Vec<_>>(), [7, 8, 9]);
    assert!(rest.iter().all(|message| message.missed == 0));
}

#[test]
fn waiting_ends_with_a_message() {
    let topic = Topic::<u32, 4, 1>::new();
    let mut listener = topic.subscribe().unwrap();
    assert_eq!(poll(listener.next()), None);
    topic.publish(7);
    assert_eq!(poll(listener.next()), Some(Message { value: 7, missed: 0 }));
}

#[test]
fn too_many_subscribers_are_told_so_and_a_dropped_one_makes_room() {
    let topic = Topic::<u32, 1, 1>::new();
    let first = topic.subscribe().unwrap();
    assert_eq!(topic.subscribe().err(), Some(SubscribersFull { most: 1 }));
    drop(first);
    assert!(topic.subscribe().is_ok());
    let latest = Latest::<u32, 1>::new();
    let _first = latest.subscribe().unwrap();
    assert_eq!(latest.subscribe().err(), Some(SubscribersFull { most: 1 }));
}

#[test]
fn a_value_is_fresh_until_it_is_as_old_as_the_limit() {
    let latest = Latest::<u32, 1>::new();
    let age = Micros::from_millis(50);
    assert_eq!(latest.newer_than(age, Micros::ZERO), None);
    latest.set(7, Micros::from_millis(100));
    assert_eq!(latest.newer_than(age, Micros::new(149_999)), Some(7));
    assert_eq!(latest.newer_than(age, Micros::new(150_000)), None);
    // A reader whose clock reading is older than the value.
    assert_eq!(latest.newer_than(age, Micros::from_millis(99)), Some(7));
    assert_eq!(latest.read().map(|newest| newest.value), Some(7));
}

#[test]
fn each_subscriber_sees_a_change_once() {
    let latest = Latest::<u32, 2>::new();
    let (mut one, mut other) = (latest.subscribe().unwrap(), latest.subscribe().unwrap());
    assert_eq!(poll(one.next()), None);
    latest.set(1, Micros::new(1));
    latest.set(2, Micros::new(2));
    let newest = Stamped { value: 2, at: Micros::new(2) };
    assert_eq!(poll(one.next()), Some(newest));
    assert_eq!(one.try_next(), None);
    assert_eq!(other.try_next(), Some(newest));
}
