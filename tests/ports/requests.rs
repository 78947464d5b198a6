//! Requests to motors while their callers give up, ask again and interrupt the tick, devices take
//! their time, and the bus starts anew.

use super::nth;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Wake, Waker};

use rc10_can::IdPattern;
use rc10_can::embedded_can::StandardId;
use rc10_conformance::{Acts, Dummy};
use rc10_motor::embassy::{BusPort, Runner};
use rc10_motor::pending::Outcome;
use rc10_motor::{
    ArmSwitch, CanIds, Frames, MotorBus, MotorId, Rate, Request, RequestError, Response, Safety,
};
use rc10_sim::Random;
use rc10_sim::{BusConfig, SimPort, World};
use rc10_time::Micros;

std::thread_local! {
    /// An event in the middle of a tick, while a motor is asked.
    static INTERRUPT: RefCell<Option<Rc<dyn Fn()>>> = const { RefCell::new(None) };
}

fn interrupt() {
    if let Some(interrupt) = INTERRUPT.with_borrow(Option::clone) {
        interrupt();
    }
}

fn interrupt_with(interrupt: Option<Rc<dyn Fn()>>) {
    INTERRUPT.set(interrupt);
}

/// Requests that reached the device of a motor.
#[derive(Default)]
struct Log {
    asked: Vec<u16>,
    busy: Vec<u16>,
}

/// A motor whose registers hold their own numbers: so an answer says which request it belongs to.
struct Registers {
    log: Arc<Mutex<Log>>,
    random: Random,
    /// Answers at once; otherwise at times after some ticks.
    quick: bool,
    pending: Option<(u16, u64)>,
}

impl Registers {
    fn motor(number: u8, seed: u64, quick: bool, log: &Arc<Mutex<Log>>) -> Dummy<Self> {
        let random = Random::new(seed + u64::from(number));
        let pattern = IdPattern::exact(StandardId::new(0x10 + u16::from(number)).unwrap());
        let ids = CanIds::new().receives(Frames::new(pattern, 1, Rate::EveryTick));
        let registers = Self { log: Arc::clone(log), random, quick, pending: None };
        Dummy::new("registers", number.into(), ids).with(registers)
    }
}

impl Acts for Registers {
    fn request(&mut self, request: Request) -> Outcome {
        let Request::ReadRegister(register) = request else {
            return Err(RequestError::Unsupported);
        };
        interrupt();
        self.log.lock().unwrap().asked.push(register);
        let outcome = if self.pending.is_some() {
            self.log.lock().unwrap().busy.push(register);
            Err(RequestError::Busy)
        } else if self.quick || self.random.below(2) == 0 {
            Ok(Response::Register(register.into()))
        } else {
            self.pending = Some((register, self.random.below(6)));
            Ok(Response::Pending)
        };
        interrupt();
        outcome
    }

    fn response(&mut self) -> Option<Outcome> {
        interrupt();
        let (register, ticks) = self.pending?;
        self.pending = (ticks > 0).then(|| (register, ticks - 1));
        (ticks == 0).then_some(Ok(Response::Register(register.into())))
    }
}

#[derive(Default)]
struct Woken(AtomicBool);

impl Wake for Woken {
    fn wake(self: Arc<Self>) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A caller that waits, and is polled only when it is woken.
struct Call {
    register: u16,
    future: Pin<Box<dyn Future<Output = Outcome>>>,
    woken: Arc<Woken>,
    since: u64,
}

impl Call {
    fn new(ports: &Arc<BusPort>, motor: MotorId, register: u16, since: u64) -> Self {
        let ports = Arc::clone(ports);
        let request = Request::ReadRegister(register);
        let future = Box::pin(async move { ports.motor(motor).request(request).await });
        Self { register, future, woken: Arc::new(Woken(AtomicBool::new(true))), since }
    }

    fn poll(&mut self) -> Option<Outcome> {
        if !self.woken.0.swap(false, Ordering::Relaxed) {
            return None;
        }
        let waker = Waker::from(Arc::clone(&self.woken));
        match self.future.as_mut().poll(&mut Context::from_waker(&waker)) {
            Poll::Ready(outcome) => Some(outcome),
            Poll::Pending => None,
        }
    }
}

fn motors() -> [MotorId; 2] {
    [nth(0), nth(1)]
}

/// Names the story that fails.
struct Told(u64);

impl Drop for Told {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("seed {}", self.0);
        }
    }
}

/// Both motors on a bus; `scene` has a port for each runner that it makes.
fn with_bus(
    seed: u64,
    quick: bool,
    scene: impl FnOnce(&mut MotorBus<'_>, &dyn Fn() -> SimPort, &Arc<Mutex<Log>>),
) {
    let _told = Told(seed);
    let wire = World::new(seed).add_bus(BusConfig::default());
    let (switch, log) = (ArmSwitch::new(), Arc::default());
    let mut motors = [0, 1].map(|number| Registers::motor(number, seed, quick, &log));
    let mut bus = MotorBus::new(&switch);
    for motor in &mut motors {
        bus.attach(motor, Safety::COAST).unwrap();
    }
    scene(&mut bus, &|| wire.port(), &log);
    interrupt_with(None);
}

/// The next tick, both halves of it.
fn tick<'m>(runner: &mut Runner<'m, '_, SimPort, &mut MotorBus<'m>>) {
    for _ in 0..2 {
        let now = runner.next();
        runner.tick(|| now);
    }
}

const fn register(number: u16) -> Outcome {
    Ok(Response::Register(number as u32))
}

#[test]
fn a_request_whose_caller_has_gone_reaches_no_motor() {
    with_bus(1, true, |bus, port, log| {
        let ports = Arc::<BusPort>::default();
        let mut runner = Runner::new(port(), bus, &ports, Micros::ZERO);
        let mut gone = Call::new(&ports, motors()[0], 1, 0);
        assert_eq!(gone.poll(), None);
        drop(gone);
        let mut next = Call::new(&ports, motors()[0], 2, 0);
        assert_eq!(next.poll(), None);
        tick(&mut runner);
        assert_eq!(next.poll(), Some(register(2)));
        assert_eq!(log.lock().unwrap().asked, [2]);
    });
}

/// A task above the bus's priority: while the motor is asked the caller goes and another asks.
#[test]
fn an_answer_never_goes_to_who_asked_while_it_was_made() {
    with_bus(1, true, |bus, port, _| {
        let ports = Arc::<BusPort>::default();
        let mut runner = Runner::new(port(), bus, &ports, Micros::ZERO);
        let calls = Rc::new(RefCell::new(vec![Call::new(&ports, motors()[0], 1, 0)]));
        assert_eq!(calls.borrow_mut()[0].poll(), None);
        let (others, theirs) = (Rc::clone(&calls), Arc::clone(&ports));
        interrupt_with(Some(Rc::new(move || {
            let mut calls = others.borrow_mut();
            if calls[0].register == 1 {
                calls.clear();
                calls.push(Call::new(&theirs, motors()[0], 2, 0));
                assert_eq!(calls[0].poll(), None, "it waits for its turn");
            }
        })));
        // It may be asked in this tick or the next one.
        tick(&mut runner);
        tick(&mut runner);
        assert_eq!(calls.borrow_mut()[0].poll(), Some(register(2)));
        assert_eq!(ports.requests().late, 1);
    });
}

/// A bus that ends tells the waiting callers; its successor is not held up by requests left behind.
#[test]
fn a_bus_that_starts_anew_answers() {
    // A seed with which the first request waits for its device.
    for seed in 0..20 {
        with_bus(seed, false, |bus, port, log| {
            let ports = Arc::<BusPort>::default();
            let mut runner = Runner::new(port(), &mut *bus, &ports, Micros::ZERO);
            let mut first = Call::new(&ports, motors()[0], 1, 0);
            assert_eq!(first.poll(), None);
            tick(&mut runner);
            drop(runner);
            let outcome = first.poll();
            assert!(outcome == Some(register(1)) || outcome == Some(Err(RequestError::Timeout)));
            let mut runner = Runner::new(port(), bus, &ports, Micros::ZERO);
            let answered = (2..12).any(|number| {
                let mut call = Call::new(&ports, motors()[0], number, 0);
                assert_eq!(call.poll(), None);
                let outcome = (0..10).find_map(|_| {
                    tick(&mut runner);
                    call.poll()
                });
                // Not before the device is done with what the bus before has asked of it.
                if outcome == Some(Err(RequestError::Busy)) {
                    assert!(log.lock().unwrap().busy.contains(&number));
                    return false;
                }
                assert_eq!(outcome, Some(register(number)));
                true
            });
            assert!(answered, "{seed}: busy for ever");
        });
    }
}

struct Story {
    ports: Arc<BusPort>,
    random: RefCell<Random>,
    calls: RefCell<Vec<Call>>,
    /// Requests in the order in which they were made, less those that found no room.
    made: RefCell<Vec<u16>>,
    ends: RefCell<BTreeMap<u16, Option<Outcome>>>,
    ticks: RefCell<u64>,
    restarts: RefCell<u64>,
}

/// A device takes 6 ticks, and every motor is asked within two.
const LONGEST: u64 = 10;

impl Story {
    /// One thing that a caller may do.
    fn act(&self) {
        let mut random = self.random.borrow_mut();
        let mut calls = self.calls.borrow_mut();
        match random.below(4) {
            0 if calls.len() < 7 => {
                let number = self.ends.borrow().len() + calls.len() + 1;
                let number = u16::try_from(number).unwrap();
                let motor = motors()[random.index(2)];
                let mut call = Call::new(&self.ports, motor, number, *self.ticks.borrow());
                let waiting = self.ports.requests().waiting;
                match call.poll() {
                    None => {
                        self.made.borrow_mut().push(number);
                        calls.push(call);
                    }
                    Some(full) => {
                        assert_eq!((full, waiting), (Err(RequestError::Busy), 4));
                        self.ends.borrow_mut().insert(number, None);
                    }
                }
            }
            1 if !calls.is_empty() => {
                let gone = random.index(calls.len());
                let gone = calls.remove(gone);
                self.ends.borrow_mut().insert(gone.register, None);
            }
            _ => calls.retain_mut(|call| !self.look(call)),
        }
    }

    /// Polls a caller; whether that was its last time.
    fn look(&self, call: &mut Call) -> bool {
        let waited = *self.ticks.borrow() - call.since;
        assert!(waited <= LONGEST, "{} waits for ever", call.register);
        let Some(outcome) = call.poll() else { return false };
        match outcome {
            Ok(_) => assert_eq!(outcome, register(call.register), "another's answer"),
            Err(RequestError::Timeout) => assert!(*self.restarts.borrow() > 0),
            Err(RequestError::Busy) => (),
            Err(_) => panic!("{outcome:?}"),
        }
        self.ends.borrow_mut().insert(call.register, Some(outcome));
        true
    }

    fn look_at_all(&self) {
        self.calls.borrow_mut().retain_mut(|call| !self.look(call));
    }
}

#[test]
fn whatever_callers_and_devices_do_every_request_ends_with_its_own_answer() {
    let (mut answered, mut busy, mut late, mut without) = (0, 0, 0, 0);
    for seed in 0..10_000 {
        with_bus(seed, false, |bus, port, log| {
            let story = Rc::new(Story {
                ports: Arc::default(),
                random: RefCell::new(Random::new(seed)),
                calls: RefCell::default(),
                made: RefCell::default(),
                ends: RefCell::default(),
                ticks: RefCell::default(),
                restarts: RefCell::default(),
            });
            let weak = Rc::downgrade(&story);
            interrupt_with(Some(Rc::new(move || {
                if let Some(story) = weak.upgrade() {
                    story.act();
                }
            })));
            let ports = Arc::clone(&story.ports);
            let mut runner = Runner::new(port(), &mut *bus, &ports, Micros::ZERO);
            for _ in 0..60 {
                let step = story.random.borrow_mut().below(24);
                match step {
                    0 => {
                        drop(runner);
                        runner = Runner::new(port(), &mut *bus, &ports, Micros::ZERO);
                        *story.restarts.borrow_mut() += 1;
                    }
                    1..10 => {
                        tick(&mut runner);
                        *story.ticks.borrow_mut() += 1;
                    }
                    _ => story.act(),
                }
                story.look_at_all();
            }
            interrupt_with(None);
            for _ in 0..LONGEST {
                tick(&mut runner);
                story.look_at_all();
            }
            assert!(story.calls.borrow().is_empty(), "{seed}: somebody waits for ever");
            let log = log.lock().unwrap();
            let (made, ends, calls) = (story.made.borrow(), story.ends.borrow(), ports.requests());
            // In turn, and none twice.
            let place = |number| made.iter().position(|other| other == number).unwrap();
            let order: Vec<_> = log.asked.iter().map(place).collect();
            assert!(order.is_sorted_by(|a, b| a <= b), "{seed}: not in turn: {order:?}");
            for (number, end) in ends.iter() {
                // A request that its motor did not answer was not answered at all.
                assert!(end.is_none() || log.asked.contains(number), "{seed}: {number} {end:?}");
                if *end == Some(Err(RequestError::Busy)) {
                    assert!(log.busy.contains(number), "{seed}: {number} was not busy");
                    busy += 1;
                }
            }
            let all = made.iter().map(|_| 1).sum::<u32>();
            assert_eq!((calls.calls, calls.waiting), (all, 0), "{seed}");
            answered += calls.answered;
            (late, without) = (late + calls.late, without + calls.unserved);
        });
    }
    println!("{answered} answered, {busy} of them busy, {late} late, {without} without a bus");
    assert!([answered, busy, late, without].iter().all(|&n| n > 1_000));
}
