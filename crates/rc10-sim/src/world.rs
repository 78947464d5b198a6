use std::cell::RefCell;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};

use rc10_can::Micros;

use crate::base::{Body, Chassis, Mounting, WheelError, Wheels};
use crate::esc::Device;
use crate::handles::{Base, Bus, Esc};
use crate::random::Random;
use crate::tasks::Awake;
use crate::time::{Clock, make_current};
use crate::wire::{BusConfig, Wire};

/// The physics step in microseconds: [`STEP`](crate::motor::STEP).
const STEP_MICROS: Micros = Micros::new(100);

/// How often a future is polled within one microsecond before time goes on. A computer that waits
/// in a busy loop is not infinitely fast either: so such a loop ends.
const POLLS_PER_INSTANT: u32 = 1000;

/// Everything that exists in a world.
pub(crate) struct Inner {
    pub(crate) clock: Rc<Clock>,
    pub(crate) random: Random,
    next_step: Micros,
    pub(crate) wires: Vec<Wire>,
    pub(crate) devices: Vec<Device>,
    pub(crate) bodies: Vec<Body>,
}

impl Inner {
    fn next_event(&self) -> Micros {
        let ends = self.wires.iter().filter_map(Wire::next_end);
        let feedback = self.devices.iter().filter_map(Device::next_feedback);
        ends.chain(feedback).fold(self.next_step, Micros::min)
    }

    /// Everything that happens at one instant, in a fixed order: physics up to now, then the
    /// frames that end now, then the feedback that is due now.
    fn process(&mut self, now: Micros) {
        if now >= self.next_step {
            self.next_step += STEP_MICROS;
            for body in &mut self.bodies {
                body.step(&mut self.devices);
            }
            self.devices.iter_mut().for_each(Device::step);
        }
        for (bus, wire) in self.wires.iter_mut().enumerate() {
            let Some(arrived) = wire.end(now) else {
                continue;
            };
            let on_bus = self.devices.iter_mut().filter(|device| device.bus == bus);
            for device in on_bus.filter(|device| wire.hears(device.node, &arrived)) {
                device.receive(&arrived.frame, now);
            }
        }
        for device in &mut self.devices {
            if let Some(frame) = device.feedback(now) {
                self.wires[device.bus].send(device.node, frame);
            }
        }
    }
}

/// Buses, ESCs, motors and bases in virtual time. See the [crate's](crate) first page for an
/// example.
///
/// A world starts at time zero and time passes only in [`run`](Self::run) and
/// [`advance`](Self::advance). Each world has its own clock; on a thread, `embassy-time` shows the
/// clock of the world that was made, run or advanced last. Worlds on other threads do not notice
/// each other.
///
/// Physics runs in steps of 100 µs; feedback reports the state of the last step.
pub struct World {
    clock: Rc<Clock>,
    inner: Rc<RefCell<Inner>>,
    awake: Arc<Awake>,
}

impl World {
    /// An empty world at time zero. All chance in it comes from the seed: where rotors stand at
    /// first, and when within its period each ESC sends.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let clock = Rc::<Clock>::default();
        make_current(&clock);
        let inner = Inner {
            clock: Rc::clone(&clock),
            random: Random::new(seed),
            next_step: STEP_MICROS,
            wires: Vec::new(),
            devices: Vec::new(),
            bodies: Vec::new(),
        };
        Self { clock, inner: Rc::new(RefCell::new(inner)), awake: Arc::default() }
    }

    /// The time.
    #[must_use]
    pub fn now(&self) -> Micros {
        self.clock.now()
    }

    /// A new bus with a controller and no ESCs on it.
    #[must_use]
    pub fn add_bus(&mut self, config: BusConfig) -> Bus {
        let mut inner = self.inner.borrow_mut();
        inner.wires.push(Wire::new(config));
        Bus { inner: Rc::clone(&self.inner), index: inner.wires.len() - 1 }
    }

    /// Puts four motors under a base. Each gets the wheel's inertia and rolling friction.
    ///
    /// # Errors
    /// [`WheelError`] if a motor belongs to another world or carries a wheel already.
    pub fn add_base(
        &mut self,
        chassis: Chassis,
        wheels: Wheels<(&Esc, Mounting)>,
    ) -> Result<Base, WheelError> {
        let mut inner = self.inner.borrow_mut();
        let wheels = wheels.into_array();
        for (position, (esc, _)) in wheels.iter().enumerate() {
            if !Rc::ptr_eq(&esc.inner, &self.inner) {
                return Err(WheelError::OtherWorld);
            }
            let twice = wheels[..position].iter().any(|(e, _)| e.index == esc.index);
            if twice || inner.devices[esc.index].is_wheel {
                return Err(WheelError::Taken);
            }
        }
        let wheels = wheels.map(|(esc, mounting)| (esc.index, mounting));
        let body = Body::new(chassis, wheels, &mut inner.devices);
        inner.bodies.push(body);
        Ok(Base { inner: Rc::clone(&self.inner), index: inner.bodies.len() - 1 })
    }

    /// Lets time pass up to and including `until`; timers that fall due wake their tasks, which
    /// nobody polls. Frames that are submitted before or between calls compete for the bus when
    /// the next call begins.
    pub fn advance(&mut self, until: Micros) {
        make_current(&self.clock);
        while self.pass(until) {}
    }

    /// Runs a future up to and including `until`, in virtual time: it is polled until it waits,
    /// then time jumps to the next event. [`Poll::Ready`] as soon as it ends; time stops there.
    ///
    /// The same future can be run on, after a look at the world, a fault, or anything else. Several
    /// futures run as one in [`Tasks`](crate::Tasks) or by `embassy-futures`' `join` and `select`.
    /// At one instant the wires and ESCs come first, then timers; frames submitted at an instant
    /// all compete for the bus at its end. A future that never waits is polled 1000 times, then
    /// time goes on by 1 µs.
    pub fn run<F: Future + ?Sized>(
        &mut self,
        mut future: Pin<&mut F>,
        until: Micros,
    ) -> Poll<F::Output> {
        make_current(&self.clock);
        let waker = Waker::from(Arc::clone(&self.awake));
        let mut context = Context::from_waker(&waker);
        // It may be another future than last time.
        self.awake.set();
        loop {
            let mut polls = 0;
            while polls < POLLS_PER_INSTANT && self.is_awake() {
                if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
                    return Poll::Ready(output);
                }
                polls += 1;
            }
            if polls < POLLS_PER_INSTANT {
                if !self.pass(until) {
                    return Poll::Pending;
                }
            } else if self.now() < until {
                let next = self.now() + Micros::new(1);
                while self.pass(next) {}
            } else {
                return Poll::Pending;
            }
        }
    }

    fn is_awake(&self) -> bool {
        self.clock.wake_due();
        self.awake.take()
    }

    /// Lets time pass until a timer has woken somebody (`true`), or up to `limit`.
    fn pass(&self, limit: Micros) -> bool {
        while self.now() < limit {
            {
                let mut inner = self.inner.borrow_mut();
                let now = self.now();
                // The instant is over: whoever wants an idle wire has said so.
                inner.wires.iter_mut().for_each(|wire| wire.arbitrate(now));
                let timer = self.clock.next_timer().unwrap_or(limit);
                let next = inner.next_event().min(timer).min(limit).max(now);
                self.clock.set(next);
                inner.process(next);
            }
            if self.clock.wake_due() {
                return true;
            }
        }
        false
    }
}
