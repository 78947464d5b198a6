//! Virtual time: timers wake at the exact microsecond, runs can be cut anywhere, worlds do not
//! disturb each other.

use std::cell::RefCell;
use std::pin::{Pin, pin};
use std::task::Poll;

use embassy_futures::{join::join, select::select, yield_now};
use embassy_time::{Duration, Instant, Ticker, Timer};
use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, CanPort};
use rc10_sim::{BusConfig, Esc, EscConfig, Model, SimPort, Tasks, TraceEntry, World};
use rc10_time::Micros;

const fn millis(millis: u64) -> Micros {
    Micros::from_millis(millis)
}

#[test]
fn a_timer_wakes_at_the_exact_microsecond() {
    let mut world = World::new(1);
    let mut future = pin!(async {
        Timer::after_micros(1_234_567).await;
        let first = Instant::now().as_micros();
        Timer::after_micros(1).await;
        let second = Instant::now().as_micros();
        Timer::at(Instant::from_micros(5)).await; // long past
        (first, second, Instant::now().as_micros())
    });
    assert_eq!(world.run(future.as_mut(), Micros::new(1_234_566)), Poll::Pending);
    assert_eq!(world.now(), Micros::new(1_234_566));
    let output = world.run(future.as_mut(), Micros::from_millis(5000));
    assert_eq!(output, Poll::Ready((1_234_567, 1_234_568, 1_234_568)));
    assert_eq!(world.now(), Micros::new(1_234_568));
}

#[test]
fn many_timers_in_one_future_all_fire() {
    let mut world = World::new(1);
    let log = RefCell::new(Vec::new());
    let every = async |period: u64| {
        let mut ticker = Ticker::every(Duration::from_millis(period));
        loop {
            ticker.next().await;
            log.borrow_mut().push((Instant::now().as_millis(), period));
        }
    };
    let mut future = pin!(join(every(2), select(every(3), Timer::after_millis(7))));
    assert!(world.run(future.as_mut(), millis(8)).is_pending());
    let expected = [(2, 2), (3, 3), (4, 2), (6, 2), (6, 3), (8, 2)];
    assert_eq!(*log.borrow(), expected);
}

#[test]
fn tasks_wake_each_other_at_one_instant() {
    let mut world = World::new(1);
    let log = RefCell::new(Vec::new());
    let note = |name| log.borrow_mut().push((name, Instant::now().as_millis()));
    let mut tasks = Tasks::new();
    tasks.add(async {
        Timer::after_millis(2).await;
        note("a");
        yield_now().await;
        note("a again");
    });
    tasks.add(async {
        Timer::after_millis(1).await;
        note("b");
        Timer::after_millis(1).await;
        note("b again");
    });
    assert_eq!(world.run(Pin::new(&mut tasks), millis(1)), Poll::Pending);
    tasks.add(async { note("late") });
    assert_eq!(world.run(Pin::new(&mut tasks), millis(9)), Poll::Ready(()));
    drop(tasks);
    let expected = [("b", 1), ("late", 1), ("a", 2), ("b again", 2), ("a again", 2)];
    assert_eq!(log.into_inner(), expected);
}

#[test]
fn a_busy_loop_ends_because_time_goes_on() {
    let mut world = World::new(1);
    let mut future = pin!(async {
        while Instant::now().as_micros() < 50 {
            yield_now().await;
        }
    });
    assert_eq!(world.run(future.as_mut(), Micros::new(20)), Poll::Pending);
    assert_eq!(world.now(), Micros::new(20));
    assert_eq!(world.run(future.as_mut(), millis(1)), Poll::Ready(()));
    assert_eq!(world.now(), Micros::new(50));
}

#[test]
fn each_world_keeps_its_own_time() {
    let mut old = World::new(1);
    let mut waiting = pin!(Timer::after_millis(10));
    assert_eq!(old.run(waiting.as_mut(), millis(4)), Poll::Pending);
    let mut new = World::new(1);
    assert_eq!((Instant::now().as_micros(), rc10_sim::now()), (0, Micros::ZERO));
    new.advance(millis(50));
    assert_eq!(Instant::now().as_millis(), 50);
    assert_eq!(old.run(waiting.as_mut(), millis(100)), Poll::Ready(()));
    assert_eq!((old.now(), new.now()), (millis(10), millis(50)));
}

async fn command_each_millisecond(mut port: SimPort) {
    let mut ticker = Ticker::every(Duration::from_millis(1));
    let mut tick: u8 = 0;
    loop {
        ticker.next().await;
        tick = tick.wrapping_add(1);
        while port.receive().is_some() {}
        let data = [tick, 0, tick, 0, 0, 0, 0, 0];
        let _ = port.submit(&CanFrame::eight_bytes(StandardId::new(0x200).unwrap(), data));
    }
}

/// Runs a small robot to 100 ms, with stops on the way; what went over the wire and where motor 1
/// ended.
fn run(seed: u64, stops: &[Micros]) -> (Vec<TraceEntry>, f64) {
    let mut world = World::new(seed);
    let bus = world.add_bus(BusConfig::default());
    let escs: [Esc; 4] =
        [1, 2, 3, 4].map(|id| bus.add_esc(EscConfig::new(Model::C620, id)).unwrap());
    let mut future = pin!(command_each_millisecond(bus.port()));
    for &stop in stops {
        assert_eq!(world.run(future.as_mut(), stop), Poll::Pending);
    }
    assert_eq!(world.run(future.as_mut(), millis(100)), Poll::Pending);
    (bus.take_trace(), escs[0].state().output_degrees)
}

#[test]
fn the_same_seed_is_the_same_run_and_another_is_not() {
    assert_eq!(run(5, &[]), run(5, &[]));
    assert_ne!(run(5, &[]).0, run(6, &[]).0);
}

#[test]
fn stops_change_nothing() {
    let whole = run(5, &[]);
    assert!(whole.0.len() > 400);
    let everywhere: Vec<_> = (0..1000).map(|step| Micros::new(step * 97)).collect();
    assert_eq!(run(5, &everywhere), whole);
    let ticks: Vec<_> = (0..100).map(millis).collect();
    assert_eq!(run(5, &ticks), whole);
}

#[test]
fn worlds_on_two_threads_do_not_notice_each_other() {
    let alone = run(8, &[]);
    let stops: Vec<_> = (0..100).map(millis).collect();
    let threads: Vec<_> = (0..2)
        .map(|_| {
            let stops = stops.clone();
            std::thread::spawn(move || {
                let result = run(8, &stops);
                (result, Instant::now().as_millis())
            })
        })
        .collect();
    for thread in threads {
        assert_eq!(thread.join().unwrap(), (alone.clone(), 100));
    }
}

#[test]
fn a_fault_can_be_a_line_of_the_script() {
    let mut world = World::new(3);
    let bus = world.add_bus(BusConfig::default());
    let esc = bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
    let witness = esc.clone();
    let mut script = pin!(async move {
        Timer::after_millis(10).await;
        esc.set_power(false);
        Timer::after_millis(10).await;
        esc.state().powered
    });
    assert_eq!(world.run(script.as_mut(), millis(15)), Poll::Pending);
    assert!(!witness.state().powered);
    assert_eq!(world.run(script.as_mut(), millis(30)), Poll::Ready(false));
    let sent = bus.take_trace();
    assert!(sent.iter().all(|entry| entry.at < millis(11)));
}
