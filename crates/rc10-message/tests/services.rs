//! The view of callers and servers.
#![cfg(test)]
mod clock;

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use clock::{Tasks, interrupt_with, now};
use embassy_futures::select::select;
use embassy_time::Timer;
use rc10_message::{AlreadyServed, CallError, Calls, Service};
use rc10_time::Micros;

const SHORT: Micros = Micros::from_millis(2);
const LONG: Micros = Micros::from_millis(100);

type Doubling<const CALLERS: usize> = Service<u32, u32, CALLERS>;

async fn pause(millis: u64) {
    Timer::after_millis(millis).await;
}

#[test]
fn callers_are_served_in_the_order_in_which_they_came() {
    let (service, order) = (Doubling::<3>::new(), RefCell::new(Vec::new()));
    for seed in 0..50 {
        let mut tasks = Tasks::with_seed(seed);
        for caller in [1, 2, 3] {
            let (service, order) = (&service, &order);
            tasks.add(async move {
                pause(caller.into()).await;
                assert_eq!(service.call(caller, LONG).await, Ok(2 * caller));
                order.borrow_mut().push(caller);
            });
        }
        tasks.add(async {
            pause(5).await;
            let mut server = service.server().unwrap();
            let serve = server.serve(async |request| {
                pause(1).await;
                2 * request
            });
            select(serve, pause(20)).await;
        });
        assert_eq!(tasks.run(LONG), 0);
        assert_eq!(order.take(), [1, 2, 3]);
    }
}

#[test]
fn a_request_that_was_not_taken_in_time_is_never_seen() {
    let service = Doubling::<1>::new();
    let mut tasks = Tasks::new();
    tasks.add(async {
        let start = now();
        assert_eq!(service.call(1, SHORT).await, Err(CallError::NotTaken));
        assert_eq!(now().since(start), SHORT);
        assert!(service.try_next().is_none());
        // And its place is free again.
        assert_eq!(service.call(2, Micros::ZERO).await, Err(CallError::NotTaken));
    });
    assert_eq!(tasks.run(LONG), 0);
    assert_eq!(service.calls(), Calls { calls: 2, timed_out: 2, ..Calls::default() });
}

#[test]
fn a_late_response_is_counted_and_given_to_no_caller() {
    let service = Doubling::<1>::new();
    let mut tasks = Tasks::new();
    tasks.add(async {
        assert_eq!(service.call(1, SHORT).await, Err(CallError::TimedOut));
        assert_eq!(service.call(2, LONG).await, Ok(4));
    });
    tasks.add(async {
        let mut server = service.server().unwrap();
        let (first, slow) = server.next().await;
        assert!(slow.is_waiting());
        pause(3).await;
        // The next one asks already, and is even taken.
        let (second, caller) = server.next().await;
        assert_eq!((first, second), (1, 2));
        assert!(!slow.is_waiting());
        slow.reply(2 * first);
        pause(1).await;
        caller.reply(2 * second);
    });
    assert_eq!(tasks.run(LONG), 0);
    let all = Calls { calls: 2, answered: 1, timed_out: 1, late: 1, ..Calls::default() };
    assert_eq!(service.calls(), all);
}

#[test]
fn a_caller_that_goes_leaves_no_trace_wherever_it_waited() {
    let service = Doubling::<2>::new();
    let mut tasks = Tasks::new();
    tasks.add(async {
        // Never polled: never asked.
        drop(service.call(0, LONG));
        // Waits in the queue; one too many is told at once.
        let (one, other) = (service.call(1, LONG), service.call(2, LONG));
        let third = async {
            assert_eq!(service.call(3, LONG).await, Err(CallError::Full { most: 2 }));
        };
        select(embassy_futures::join::join(one, other), third).await;
        assert!(service.try_next().is_none());
        // Taken, then given up: the answer is dropped.
        let mut server = service.server().unwrap();
        let (request, caller) = match select(service.call(4, LONG), server.next()).await {
            embassy_futures::select::Either::Second(taken) => taken,
            embassy_futures::select::Either::First(outcome) => panic!("{outcome:?}"),
        };
        caller.reply(request);
        // Answered, then given up before it has looked.
        let mut call = Box::pin(service.call(5, LONG));
        assert!(embassy_futures::poll_once(call.as_mut()).is_pending());
        let (_, caller) = service.try_next().unwrap();
        caller.reply(10);
        drop(call);
    });
    assert_eq!(tasks.run(LONG), 0);
    assert_eq!(service.calls(), Calls { calls: 4, cancelled: 4, late: 2, ..Calls::default() });
}

#[test]
fn who_looks_finds_all_that_wait() {
    let service = Doubling::<3>::new();
    let mut tasks = Tasks::new();
    for caller in 0..3 {
        let service = &service;
        tasks.add(async move { assert_eq!(service.call(caller, LONG).await, Ok(2 * caller)) });
    }
    tasks.add(async {
        pause(1).await;
        while let Some((request, caller)) = service.try_next() {
            caller.reply(2 * request);
        }
    });
    assert_eq!(tasks.run(LONG), 0);
}

#[test]
fn a_dropped_request_is_answered_at_once() {
    let service = Doubling::<4>::new();
    let mut tasks = Tasks::new();
    tasks.add(async {
        assert_eq!(service.call(1, LONG).await, Err(CallError::NotServed));
        assert_eq!(now(), Micros::from_millis(5));
    });
    tasks.add(async {
        pause(5).await;
        drop(service.server().unwrap().next().await);
    });
    assert_eq!(tasks.run(LONG), 0);
    assert_eq!(service.calls(), Calls { calls: 1, unserved: 1, ..Calls::default() });
}

#[test]
fn a_server_that_restarts_drops_what_it_works_on_and_nothing_that_waits() {
    let service = Doubling::<4>::new();
    let outcomes = RefCell::new(Vec::new());
    let mut tasks = Tasks::new();
    tasks.add(async {
        for caller in [1, 2] {
            let answer = async |request: u32| {
                pause(10).await;
                2 * request
            };
            // The first life ends in the middle of its first request.
            let mut server = service.server().unwrap();
            assert_eq!(service.server().err(), Some(AlreadyServed));
            select(server.serve(answer), pause(if caller == 1 { 5 } else { 50 })).await;
        }
    });
    for caller in [1, 2] {
        let (service, outcomes) = (&service, &outcomes);
        tasks.add(async move {
            pause(caller.into()).await;
            let outcome = service.call(caller, LONG).await;
            outcomes.borrow_mut().push((caller, outcome, now()));
        });
    }
    assert_eq!(tasks.run(LONG), 0);
    let expected = [
        (1, Err(CallError::NotServed), Micros::from_millis(5)),
        (2, Ok(4), Micros::from_millis(15)),
    ];
    assert_eq!(outcomes.take(), expected);
}

/// A future that was begun in one task and goes on in another wakes that one.
#[test]
fn who_waits_may_move_to_another_task() {
    let (one, other) = (Doubling::<1>::new(), Doubling::<1>::new());
    let mut server = one.server().unwrap();
    let mut next = Box::pin(server.next());
    assert!(embassy_futures::poll_once(next.as_mut()).is_pending());
    let mut call = Box::pin(other.call_without_timeout(1));
    assert!(embassy_futures::poll_once(call.as_mut()).is_pending());
    let mut tasks = Tasks::new();
    tasks.add(async {
        let (request, caller) = next.await;
        caller.reply(2 * request);
        let (request, caller) = other.try_next().unwrap();
        caller.reply(2 * request);
    });
    tasks.add(async { assert_eq!(call.await, Ok(2)) });
    tasks.add(async {
        pause(1).await;
        assert_eq!(one.call(2, LONG).await, Ok(4));
    });
    assert_eq!(tasks.run(LONG), 0);
}

/// An interrupt answers between a caller's last look and the end of its time.
#[test]
fn a_response_in_the_last_moment_counts() {
    for drops in [false, true] {
        let service = Rc::new(Doubling::<1>::new());
        let mut tasks = Tasks::new();
        let caller = Rc::clone(&service);
        tasks.add(async move {
            let outcome = caller.call(1, SHORT).await;
            let expected = if drops { Err(CallError::NotServed) } else { Ok(2) };
            assert_eq!((outcome, now()), (expected, SHORT));
        });
        let server = Rc::clone(&service);
        let done = Cell::new(false);
        interrupt_with(Some(Rc::new(move || {
            // Its own place was looked at in vain: the clock is read next.
            if now() == SHORT && !done.replace(true) {
                let (request, caller) = server.try_next().unwrap();
                if !drops {
                    caller.reply(2 * request);
                }
            }
        })));
        assert_eq!(tasks.run(SHORT), 0);
        interrupt_with(None);
        let calls = service.calls();
        let (answered, unserved) = (u32::from(!drops), u32::from(drops));
        assert_eq!(calls, Calls { calls: 1, answered, unserved, ..Calls::default() });
        clock::rewind();
    }
}

#[test]
fn the_longest_timeout_is_no_overflow() {
    let service = Doubling::<1>::new();
    let mut tasks = Tasks::new();
    tasks.add(async { assert_eq!(service.call(1, Micros::new(u64::MAX)).await, Ok(2)) });
    tasks.add(async {
        pause(1).await;
        let (request, caller) = service.try_next().unwrap();
        caller.reply(2 * request);
    });
    assert_eq!(tasks.run(LONG), 0);
}
