use std::cell::RefCell;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};

use rc10_time::Micros;

use crate::Nanos;
use crate::arm::{Arm, ArmLink};
use crate::base::{Body, Chassis, Mounting, WheelError, WheelMotors};
use crate::device::{Place, Unit};
use crate::handles::{Base, Bus, Esc};
use crate::line::{Line, LineConfig, LineWire};
use crate::pulses::{PulseDevice, PulseLine, Pulses};
use crate::random::Random;
use crate::serial::{Link, Repeater, Serial, SerialConfig, SerialDevice};
use crate::tasks::Awake;
use crate::time::{Clock, make_current};
use crate::uart::Hosted;
use crate::wire::{BusConfig, Wire};

/// The physics step: [`STEP`](crate::motor::STEP).
const STEP: Nanos = Nanos::new(100_000);

/// Number of polls of a future within one microsecond before time goes on. A computer that waits in
/// a busy loop is not infinitely fast either: so such a loop ends.
const POLLS_PER_INSTANT: u32 = 1000;

/// Everything that exists in a world.
pub(crate) struct Inner {
    pub(crate) clock: Rc<Clock>,
    pub(crate) random: Random,
    start: Nanos,
    next_step: Nanos,
    pub(crate) wires: Vec<Wire>,
    pub(crate) lines: Vec<LineWire>,
    pub(crate) serials: Vec<Link>,
    pub(crate) pulses: Vec<PulseLine>,
    pub(crate) units: Vec<Unit>,
    pub(crate) bodies: Vec<Body>,
    arms: Vec<Arm>,
}

impl Inner {
    /// Looks into a world, or changes it, at its time now.
    pub(crate) fn with<T>(world: &RefCell<Self>, f: impl FnOnce(&mut Self, Nanos) -> T) -> T {
        let inner = &mut *world.borrow_mut();
        let now = inner.clock.now_ns();
        f(inner, now)
    }

    /// Anything may have been done to everything. While time passes, what nothing is done to is not asked again.
    fn touch(&mut self) {
        self.wires.iter_mut().for_each(|wire| wire.touched = true);
        self.serials.iter_mut().for_each(|link| link.touched = true);
        self.units.iter_mut().for_each(|unit| unit.due = unit.next_event());
    }

    fn next_event(&self) -> Nanos {
        let now = self.clock.now_ns();
        let mut next = self.next_step;
        let mut is_due = |at: Nanos| next = next.min(at);
        self.wires.iter().for_each(|wire| is_due(wire.due));
        self.units.iter().for_each(|unit| is_due(unit.due));
        self.serials.iter().for_each(|link| is_due(link.due));
        self.lines.iter().filter_map(|line| line.next_event(now)).for_each(&mut is_due);
        self.pulses.iter().filter_map(|line| line.next_event(now)).for_each(is_due);
        next
    }

    /// Everything that happens at one instant, in a fixed order: physics up to now, then the wires
    /// and controllers, then the ESCs' answers and the feedback that is due now.
    fn process(&mut self, now: Nanos) {
        let micros = now.micros();
        if now >= self.next_step {
            self.next_step = self.next_step + STEP;
            for body in &mut self.bodies {
                body.step(&mut self.units);
            }
            for arm in &mut self.arms {
                arm.step(&mut self.units);
            }
            self.units.iter_mut().for_each(|unit| unit.step(now));
        }
        for line in &mut self.lines {
            line.process(now, &mut self.random, &mut self.units);
        }
        let mut has_one_heard = false;
        for link in self.serials.iter_mut().filter(|link| link.due <= now) {
            link.process(now);
            has_one_heard |= link.repeats;
        }
        self.serials.iter_mut().for_each(|link| link.touched |= has_one_heard && link.repeats);
        self.pulses.iter_mut().for_each(|line| line.process(now));
        for (bus, wire) in self.wires.iter_mut().enumerate() {
            let Some(heard) = wire.process(now) else {
                continue;
            };
            for unit in &mut self.units {
                let is_told = |node| wire.hears(node, &heard);
                if matches!(unit.place, Place::Bus { bus: its, node } if its == bus && is_told(node))
                {
                    unit.receive(&heard.frame, micros);
                }
            }
        }
        for unit in self.units.iter_mut().filter(|unit| unit.due <= now) {
            unit.advance(micros);
            unit.due = unit.next_event();
            if let Place::Bus { bus, node } = unit.place {
                unit.take_frames().for_each(|frame| self.wires[bus].send(node, frame));
            }
        }
    }

    /// Ends an instant: nodes that want an idle wire compete for it, stations that want a line
    /// talk. Returns the time of the next event.
    fn end_instant(&mut self, now: Nanos) -> Nanos {
        self.let_start(now);
        let next = self.next_event();
        if next > now {
            return next;
        }
        // Asked for within this instant: an ESC was switched on, a controller was written to.
        self.process(now);
        self.let_start(now);
        self.next_event()
    }

    fn let_start(&mut self, now: Nanos) {
        let wires = self.wires.iter_mut().filter(|wire| wire.touched);
        wires.for_each(|wire| wire.arbitrate(now));
        self.lines.iter_mut().for_each(|line| line.start(now));
        let serials = self.serials.iter_mut().filter(|link| link.touched);
        serials.for_each(|link| link.start(now));
    }
}

/// Time never stands still, whatever a controller says.
fn later(event: Nanos, now: Nanos) -> Nanos {
    event.max(now + Nanos::new(1))
}

/// Buses, ESCs, motors and bases in virtual time. See the [crate's](crate) first page for an
/// example.
///
/// A world starts at time zero, or [later](Self::starting_at), and time passes only in
/// [`run`](Self::run) and [`advance`](Self::advance). Each world has its own clock; on a thread, `embassy-time` shows the
/// clock of the world that was made, run or advanced last. Worlds on other threads do not notice
/// each other.
///
/// Physics runs in steps of 100 µs; feedback reports the state of the last step.
#[must_use]
pub struct World {
    clock: Rc<Clock>,
    inner: Rc<RefCell<Inner>>,
    awake: Arc<Awake>,
    /// Whether [`next_event`](Self::next_event) has ended the present instant.
    is_instant_over: bool,
}

impl World {
    /// An empty world at time zero. All chance in it comes from the seed: where rotors stand at
    /// first, and when within its period each ESC sends.
    pub fn new(seed: u64) -> Self {
        Self::starting_at(Micros::ZERO, seed)
    }

    /// The same at a later time, before which nothing was: for clocks that wrap after hours or days.
    pub fn starting_at(start: Micros, seed: u64) -> Self {
        let clock = Rc::<Clock>::default();
        clock.set(start.into());
        make_current(&clock);
        let inner = Inner {
            clock: Rc::clone(&clock),
            random: Random::new(seed),
            start: start.into(),
            next_step: Nanos::from(start) + STEP,
            wires: Vec::new(),
            lines: Vec::new(),
            serials: Vec::new(),
            pulses: Vec::new(),
            units: Vec::new(),
            bodies: Vec::new(),
            arms: Vec::new(),
        };
        Self {
            clock,
            inner: Rc::new(RefCell::new(inner)),
            awake: Arc::default(),
            is_instant_over: false,
        }
    }

    /// Another handle of this world, to put more into it. One of them lets time pass.
    pub fn another(&self) -> Self {
        let (clock, inner) = (Rc::clone(&self.clock), Rc::clone(&self.inner));
        Self { clock, inner, awake: Arc::default(), is_instant_over: false }
    }

    /// The time, in whole microseconds.
    pub fn now(&self) -> Micros {
        self.clock.now()
    }

    /// The time.
    pub fn now_ns(&self) -> Nanos {
        self.clock.now_ns()
    }

    /// A new bus with a controller and no ESCs on it.
    #[must_use]
    pub fn add_bus(&mut self, config: BusConfig) -> Bus {
        let mut inner = self.inner.borrow_mut();
        let wire = Wire::new(config, inner.start);
        inner.wires.push(wire);
        Bus { inner: Rc::clone(&self.inner), index: inner.wires.len() - 1, plug: 0 }
    }

    /// A new serial line in half duplex (RS-485) with a host and no devices on it.
    #[must_use]
    pub fn add_line(&mut self, config: LineConfig) -> Line {
        let mut inner = self.inner.borrow_mut();
        inner.lines.push(LineWire::new(config));
        Line { inner: Rc::clone(&self.inner), index: inner.lines.len() - 1 }
    }

    /// A new serial link in full duplex, with a device that has power.
    #[must_use]
    pub fn add_serial(&mut self, config: SerialConfig, device: impl SerialDevice) -> Serial {
        let mut inner = self.inner.borrow_mut();
        inner.serials.push(Link::new(config, Box::new(device), self.clock.now_ns()));
        Serial { inner: Rc::clone(&self.inner), index: inner.serials.len() - 1 }
    }

    /// Both ends of a new serial line between two hosts, with a repeater in its middle.
    pub fn add_serial_pair(&mut self, config: SerialConfig) -> [Serial; 2] {
        let Repeater { from, to } = Repeater::default();
        let (there, back) = (Rc::clone(&to), Rc::clone(&from));
        [Repeater { from, to }, Repeater { from: there, to: back }]
            .map(|repeater| self.add_serial(config, repeater))
    }

    /// A new line for pulses, with a device that has power.
    #[must_use]
    pub fn add_pulses(&mut self, device: impl PulseDevice) -> Pulses {
        let mut inner = self.inner.borrow_mut();
        inner.pulses.push(PulseLine::new(Box::new(device), self.clock.now_ns()));
        Pulses { inner: Rc::clone(&self.inner), index: inner.pulses.len() - 1 }
    }

    /// A number below `end`, or zero, from the world's chance: for what begins at some time.
    pub fn chance(&mut self, end: Nanos) -> Nanos {
        Nanos::new(self.inner.borrow_mut().random.below(end.get()))
    }

    /// Puts motors under a base, in the order of its wheels. Each gets the wheel's inertia and rolling
    /// friction; one that steers gets the fork's inertia and the scrubbing of the wheel. Fails if a
    /// motor belongs to another world or turns or steers a wheel already, or if the motors are not
    /// those that the wheels need.
    ///
    /// ```
    /// use rc10_sim::{BusConfig, Chassis, EscConfig, Model, Mounting, World};
    /// let mut world = World::new(1);
    /// let bus = world.add_bus(BusConfig::default());
    /// let [left, right] = [1, 2].map(|id| bus.add_esc(EscConfig::new(Model::C620, id)).unwrap());
    /// let wheels = [(&left, Mounting::Normal), (&right, Mounting::Mirrored)];
    /// let base = world.add_base(Chassis::differential(0.05, 0.4), wheels).unwrap();
    /// assert_eq!(base.pose().x, 0.0);
    /// ```
    pub fn add_base<'e, M: Into<WheelMotors<'e>>>(
        &mut self,
        chassis: Chassis,
        motors: impl IntoIterator<Item = M>,
    ) -> Result<Base, WheelError> {
        let mut inner = self.inner.borrow_mut();
        let motors: Vec<WheelMotors<'_>> = motors.into_iter().map(Into::into).collect();
        if motors.len() != chassis.wheels.len() {
            return Err(WheelError::Count);
        }
        let mut taken = Vec::new();
        for (motors, wheel) in motors.iter().zip(&chassis.wheels) {
            if motors.steering.is_some() != wheel.steering.is_some() {
                return Err(WheelError::Steering);
            }
            for (esc, _) in [Some(motors.drive), motors.steering].into_iter().flatten() {
                self.take(&inner, &mut taken, esc)?;
            }
        }
        let place = |(esc, mounting): (&Esc, Mounting)| (esc.index, mounting);
        let motors = motors.iter().map(|motors| (place(motors.drive), motors.steering.map(place)));
        let body = Body::new(chassis, &motors.collect::<Vec<_>>(), &mut inner.units);
        let base = Base { motion: Rc::clone(&body.motion), is_imu_over: false };
        inner.bodies.push(body);
        Ok(base)
    }

    /// Hangs an arm on motors, from the base outwards: the weight of each link is on its own motor and on those
    /// of all links before it. Motors whose positive direction is downwards are [`Mounting::Mirrored`]. Fails
    /// if a motor belongs to another world, or carries a wheel or a link already.
    pub fn add_arm<'e>(
        &mut self,
        links: impl IntoIterator<Item = (&'e Esc, Mounting, ArmLink)>,
    ) -> Result<(), WheelError> {
        let mut inner = self.inner.borrow_mut();
        let (links, mut taken): (Vec<_>, _) = (links.into_iter().collect(), Vec::new());
        for (esc, ..) in &links {
            self.take(&inner, &mut taken, esc)?;
        }
        taken.into_iter().for_each(|unit| inner.units[unit].is_taken = true);
        let links = links.into_iter().map(|(esc, mounting, link)| (esc.index, mounting, link));
        inner.arms.push(Arm::new(links));
        Ok(())
    }

    /// A motor of this world that carries nothing, and none of those that are taken.
    fn take(&self, inner: &Inner, taken: &mut Vec<usize>, esc: &Esc) -> Result<(), WheelError> {
        if !Rc::ptr_eq(&esc.inner, &self.inner) {
            return Err(WheelError::OtherWorld);
        }
        if taken.contains(&esc.index) || inner.units[esc.index].is_taken {
            return Err(WheelError::Taken);
        }
        taken.push(esc.index);
        Ok(())
    }

    /// Lets time pass up to and including `until`; timers that fall due wake their tasks, which
    /// are not polled. Frames that are submitted before or between calls compete for the bus when
    /// the next call begins.
    pub fn advance(&mut self, until: Micros) {
        self.advance_to(until.into());
    }

    /// As [`advance`](Self::advance), to the nanosecond. Cheap if nothing happens meanwhile.
    pub fn advance_to(&mut self, until: Nanos) {
        make_current(&self.clock);
        while self.pass(until) {}
    }

    /// Ends the present instant: what was submitted or is offered by a
    /// [`Controller`](crate::Controller) competes for the bus now. Then says when the next thing
    /// happens by itself, always later than now: a frame ends, an ESC reports, physics makes a
    /// step, a controller has an event, a timer falls due.
    ///
    /// For who emulates a computer. It runs on its own up to that time, or until it touches a
    /// controller; then [`advance_to`](Self::advance_to) lets the world catch up. What was done
    /// between the two calls happens at the time advanced to, to the nanosecond.
    pub fn next_event(&mut self) -> Nanos {
        make_current(&self.clock);
        self.clock.wake_due();
        self.is_instant_over = true;
        let now = self.now_ns();
        let inner = &mut *self.inner.borrow_mut();
        inner.touch();
        let next = inner.end_instant(now);
        self.earlier_timer(later(next, now))
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
        self.is_instant_over = false;
        loop {
            let mut polls = 0;
            while polls < POLLS_PER_INSTANT && self.is_awake() {
                if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
                    return Poll::Ready(output);
                }
                polls += 1;
            }
            if polls < POLLS_PER_INSTANT {
                if !self.pass(until.into()) {
                    return Poll::Pending;
                }
            } else if self.now() < until {
                let next = Nanos::from(self.now() + Micros::new(1));
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

    /// Lets time pass until a timer or a serial port has woken a task (`true`), or up to `limit`.
    fn pass(&mut self, limit: Nanos) -> bool {
        self.inner.borrow_mut().touch();
        while self.now_ns() < limit {
            let now = self.now_ns();
            {
                let mut inner = self.inner.borrow_mut();
                let next = if std::mem::take(&mut self.is_instant_over) {
                    inner.wires.iter_mut().for_each(Wire::ask);
                    inner.serials.iter_mut().for_each(Link::ask);
                    inner.next_event()
                } else {
                    inner.end_instant(now)
                };
                let next = self.earlier_timer(later(next, now)).min(limit).max(now);
                self.clock.set(next);
                inner.process(next);
            }
            if self.wake_ports() | self.clock.wake_due() {
                return true;
            }
        }
        false
    }

    /// Wakes the tasks that wait at a serial port for what is there now; says whether there were
    /// any.
    fn wake_ports(&self) -> bool {
        let mut due = Vec::new();
        let mut inner = self.inner.borrow_mut();
        inner.lines.iter_mut().for_each(|line| line.take_wakers(&mut due));
        inner.serials.iter_mut().for_each(|link| link.take_wakers(&mut due));
        due.extend(inner.pulses.iter_mut().filter_map(PulseLine::take_waker));
        drop(inner);
        // As timers: woken after everything is free again.
        let any = !due.is_empty();
        due.into_iter().for_each(Waker::wake);
        any
    }

    fn earlier_timer(&self, event: Nanos) -> Nanos {
        self.clock.next_timer().map_or(event, |timer| event.min(timer.into()))
    }
}
