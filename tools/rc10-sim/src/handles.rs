//! Handles of the things in a world. They are cheap to clone, and may be used inside of a future
//! that the world runs: a fault at a given time is a line of a test's script.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::rc::Rc;

use rc10_can::{CanFrame, CanPort, Health, Queued, Submitted};
use rc10_time::Micros;

use crate::base::{Motion, Pose, Twist};
use crate::device::{Device, Encoder, EscFault, EscState, Place, Unit};
use crate::dji::{Dji, EscConfig, IdOutOfRange};
use crate::host::Host;
use crate::motor::Shaft;
use crate::plant::Plant;
use crate::time::Clock;
use crate::wire::{BusCounters, ESC_TOLERANCE, TraceEntry, Wire};
use crate::world::Inner;
use crate::{Controller, Nanos};

/// A CAN bus of a [`World`](crate::World).
#[derive(Clone)]
pub struct Bus {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
    /// Whose end it is: of the controllers on the wire the first, or another.
    pub(crate) plug: usize,
}

impl Bus {
    /// The same wire as another board on it has it: with a controller of its own, its own cut, and its own trace.
    #[must_use]
    pub fn another_end(&self) -> Self {
        let plug = self.with_wire(|wire, _| wire.add_plug());
        Self { plug, ..self.clone() }
    }

    /// Puts an ESC with its motor on the bus, powered, at rest.
    ///
    /// Two ESCs of one feedback id are allowed, as on a real bus; see
    /// [`BusCounters::id_clashes`]. Fails if the model has no such id.
    pub fn add_esc(&self, config: EscConfig) -> Result<Esc, IdOutOfRange> {
        Ok(self.add(Dji::new(config)?, config.plant))
    }

    /// Puts any device with its motor on the bus, powered, at rest: DJI's own
    /// [`add_esc`](Self::add_esc) does it with one of DJI.
    pub fn add(&self, device: impl Device, plant: Plant) -> Esc {
        let bus = self.index;
        Esc::plug_in(&self.inner, device, plant, |inner, now| Place::Bus {
            bus,
            node: inner.wires[bus].join(now),
        })
    }

    /// The port of the bus's own controller: all its ports share it.
    pub fn port(&self) -> SimPort {
        let inner = self.inner.borrow();
        let host = Rc::clone(inner.wires[self.index].host(self.plug));
        SimPort { host, clock: Rc::clone(&inner.clock) }
    }

    /// Puts another controller in the place of the bus's own one, or of the one attached before.
    ///
    /// It is told at once what the wire carries. From then on the bus's own controller is plugged
    /// in nowhere: its [`port`](Self::port)s hear nothing, and what is submitted there waits for
    /// ever. A frame of the old controller that is on the wire breaks off.
    ///
    /// The world borrows the controller while time passes; between its calls it is the caller's.
    pub fn attach(&self, controller: Rc<RefCell<dyn Controller>>) {
        self.with_wire(|wire, now| wire.attach(self.plug, controller, now));
    }

    /// A foreign node sends a frame, after those it was given before. It is on the bus, and
    /// acknowledges others' frames, only while it has something to send.
    pub fn inject(&self, frame: &CanFrame) {
        self.with_wire(|wire, _| wire.foreign.push_back(*frame));
    }

    /// Number of those that it still has to send; one that is on the wire does not count.
    pub fn foreign_waiting(&self) -> usize {
        self.with_wire(|wire, _| wire.foreign.len())
    }

    /// Cuts the controller off the bus, or connects it again.
    ///
    /// Cut off it hears nothing, and its frames are not acknowledged: it repeats them until it is
    /// connected again. Faults of the wire do not reach it there.
    pub fn set_cut(&self, cut: bool) {
        self.with_wire(|wire, now| wire.set_cut(self.plug, cut, now));
    }

    /// Shorts the two wires of the bus (CANH to CANL), or takes the short away.
    ///
    /// Shorted the bus is recessive whatever its nodes send: each attempt fails with a bit error at
    /// its first bit and takes 18 bit times, error frame and interframe space included. A frame
    /// that is on the wire is destroyed.
    pub fn set_shorted(&self, shorted: bool) {
        self.with_wire(|wire, now| wire.set_shorted(shorted, now));
    }

    /// Holds the bus dominant, as a node does that is stuck, or lets it go.
    ///
    /// Held it is never idle: no node can send or come back from bus-off. A frame that is
    /// on the wire is destroyed. The bus is idle 11 bit times after it was let go.
    pub fn set_held_dominant(&self, held: bool) {
        self.with_wire(|wire, now| wire.set_held_dominant(held, now));
    }

    /// Switches the power of all ESCs on the bus, in the order in which they were added: as
    /// [`Esc::set_power`] each.
    pub fn set_power(&self, powered: bool) {
        let is_here = |place| matches!(place, Place::Bus { bus, .. } if bus == self.index);
        Esc::set_power_of(&self.inner, is_here, powered);
    }

    /// The next frames on the bus, one that is on it now included, are destroyed by noise just
    /// before their end: an error frame follows, and their senders repeat them. Replaces the number
    /// given before; 0 for no more noise.
    pub fn damage(&self, frames: u32) {
        self.with_wire(|wire, _| wire.to_damage = frames);
    }

    /// The frames that went over the bus since the last call, in the order of the wire; empty if
    /// tracing is off.
    #[must_use]
    pub fn take_trace(&self) -> Vec<TraceEntry> {
        self.with_wire(|wire, _| wire.take_trace(self.plug))
    }

    /// Load of the bus since the world's start, in per cent. A frame counts when it has ended, and
    /// counts also if it was not acknowledged.
    pub fn load(&self) -> f64 {
        self.with_wire(|wire, now| wire.occupancy.load(now))
    }

    /// Load of the bus in each 100 ms that is over, in per cent.
    pub fn load_windows(&self) -> Vec<f64> {
        self.with_wire(|wire, now| wire.occupancy.windows(now))
    }

    /// Length of a bit, nanoseconds.
    pub fn bit_time_ns(&self) -> u64 {
        self.with_wire(|wire, _| wire.bit_time_ns)
    }

    /// Whether the nodes understand a controller with bits of this length, and it them: up to half a
    /// per cent off they do.
    pub fn follows(&self, bit_time_ns: u32) -> bool {
        self.with_wire(|wire, _| wire.is_within(bit_time_ns, ESC_TOLERANCE))
    }

    /// Counters since the world began.
    pub fn counters(&self) -> BusCounters {
        self.with_wire(|wire, _| wire.counters)
    }

    fn with_wire<T>(&self, f: impl FnOnce(&mut Wire, Nanos) -> T) -> T {
        Inner::with(&self.inner, |inner, now| f(&mut inner.wires[self.index], now))
    }
}

/// The host's port to a simulated bus: 32 transmit buffers, newest frame per stream, and a
/// receive queue of [`BusConfig::receive_capacity`](crate::BusConfig::receive_capacity) frames.
///
/// A frame that is on the wire is not replaced any more: a newer one of its stream follows it.
///
/// Its controller keeps the error counters of ISO 11898-1: each failed transmission counts 8 (a
/// missing acknowledge no further once it is error-passive), each disturbed frame of others 1, and
/// each good frame takes 1 off; a receive error counter above 127 goes to 127 then. In bus-off it
/// keeps what is submitted.
#[derive(Clone)]
pub struct SimPort {
    host: Rc<RefCell<Host>>,
    clock: Rc<Clock>,
}

impl CanPort for SimPort {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        self.host.borrow_mut().received.pop_front()
    }

    fn submit_as(&mut self, frame: &CanFrame, stream: u32) -> Submitted {
        self.host.borrow_mut().submit(Queued { frame: *frame, stream })
    }

    fn cancel_pending(&mut self) -> u8 {
        self.host.borrow_mut().cancel_pending()
    }

    fn health(&self) -> Health {
        self.host.borrow().health
    }

    fn recover(&mut self) {
        self.host.borrow_mut().recover(self.clock.now_ns());
    }
}

/// A device with its motor, on a [`Bus`] or a [`Line`](crate::Line).
#[derive(Clone)]
pub struct Esc {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Esc {
    /// Plugs a device in where `join` finds a place for it, powered, at rest.
    pub(crate) fn plug_in(
        world: &Rc<RefCell<Inner>>,
        device: impl Device,
        plant: Plant,
        join: impl FnOnce(&mut Inner, Nanos) -> Place,
    ) -> Self {
        let inner = &mut *world.borrow_mut();
        let motor = Shaft::new(plant, inner.random.unit());
        let now = inner.clock.now_ns();
        let mut unit = Unit::new(Box::new(device), motor, join(inner, now));
        unit.power(true, now, &mut inner.random);
        inner.units.push(unit);
        Self { inner: Rc::clone(world), index: inner.units.len() - 1 }
    }

    /// Switches the power of all that are plugged in there, in the order in which they were added.
    pub(crate) fn set_power_of(
        world: &Rc<RefCell<Inner>>,
        is_there: impl Fn(Place) -> bool,
        powered: bool,
    ) {
        let count = world.borrow().units.len();
        for index in 0..count {
            if is_there(world.borrow().units[index].place) {
                Self { inner: Rc::clone(world), index }.set_power(powered);
            }
        }
    }

    /// Its true state (of the mechanics: at the last physics step).
    pub fn state(&self) -> EscState {
        let inner = self.inner.borrow();
        let unit = &inner.units[self.index];
        unit.state(match unit.place {
            Place::Bus { bus, node } => inner.wires[bus].nodes[node].overwritten,
            Place::Line { .. } => 0,
        })
    }

    pub(crate) fn now(&self) -> Nanos {
        self.inner.borrow().clock.now_ns()
    }

    /// Its motor, gearbox and load; a wheel of a base with its wheel, without the base.
    pub fn plant(&self) -> Plant {
        self.inner.borrow().units[self.index].motor.plant
    }

    /// Switches its power. Without it there is no current, no feedback, no acknowledge; the rotor
    /// coasts. With it again, the device starts afresh, a DJI at command 0 and sending at a new
    /// phase, at once (a real one takes a second or two to start).
    pub fn set_power(&self, powered: bool) {
        let inner = &mut *self.inner.borrow_mut();
        let (unit, now) = (&mut inner.units[self.index], inner.clock.now_ns());
        if unit.power(powered, now, &mut inner.random) {
            let is_present = unit.is_present();
            match unit.place {
                Place::Bus { bus, node } => inner.wires[bus].power(node, is_present, now),
                Place::Line { line, station } => inner.lines[line].silence(station),
            }
        }
    }

    /// Unplugs its data lines, or plugs them in again; it keeps its power.
    pub fn set_cut(&self, cut: bool) {
        let inner = &mut *self.inner.borrow_mut();
        let (unit, now) = (&mut inner.units[self.index], inner.clock.now_ns());
        let (changed, is_present) = (unit.set_cut(cut), unit.is_present());
        match unit.place {
            Place::Bus { bus, node } if changed => inner.wires[bus].power(node, is_present, now),
            Place::Bus { .. } => (),
            Place::Line { line, station } => inner.lines[line].set_station_cut(station, cut),
        }
    }

    /// Silences its feedback, or lets it speak again; it goes on driving.
    pub fn set_feedback(&self, enabled: bool) {
        self.inner.borrow_mut().units[self.index].muted = !enabled;
    }

    /// Gives its encoder a fault that it does not find, or takes that away.
    pub fn set_encoder(&self, fault: Option<Encoder>) {
        self.inner.borrow_mut().units[self.index].set_encoder(fault);
    }

    /// Has it find something wrong with itself, until power-off. `false`: such a device knows no
    /// such fault, and nothing happened.
    pub fn inject(&self, fault: EscFault) -> bool {
        self.inner.borrow_mut().units[self.index].device.inject(fault)
    }

    /// Sets another identifier on it, as before power-on. `false`: it can have no such one, and
    /// nothing happened.
    pub fn set_id(&self, id: u8) -> bool {
        self.inner.borrow_mut().units[self.index].device.set_id(id)
    }

    /// Puts its motor behind another gearbox: `ratio` turns of the rotor per turn of the output
    /// shaft, above 0. Torque, speed and friction follow ([`Plant::with_gear`]).
    pub fn set_gear(&self, ratio: f64) {
        let motor = &mut self.inner.borrow_mut().units[self.index].motor;
        motor.plant = motor.plant.with_gear(ratio);
    }

    /// Puts another motor, gearbox or load in the place of its own; what turned turns on, and the load
    /// begins in the middle of its play. With backlash, cogging and a weight, for example:
    /// `esc.set_plant(Plant { nonlinear, ..esc.plant() })`. Of a wheel, [`plant`](Self::plant) has its
    /// inertia.
    pub fn set_plant(&self, plant: Plant) {
        self.inner.borrow_mut().units[self.index].motor.set_plant(plant);
    }

    /// Turns what its encoder says: this angle of the rotor in its turn now, degrees, where at first
    /// chance decides. So one can know how a device with an absolute encoder stands at power-on.
    pub fn set_rotor_angle(&self, degrees: f64) {
        self.inner.borrow_mut().units[self.index].motor.set_rotor_angle(degrees / 360.0);
    }

    /// A look into its electronics, or a hand: `None` if it is not a `D`.
    pub fn with<D: Any, T>(&self, look: impl FnOnce(&mut D) -> T) -> Option<T> {
        let inner = &mut *self.inner.borrow_mut();
        let device: &mut dyn Any = &mut *inner.units[self.index].device;
        device.downcast_mut().map(look)
    }

    /// A constant torque on the load from outside, N·m, positive in the motor's positive
    /// direction: the weight on a lift, for example.
    pub fn set_load(&self, torque: f64) {
        self.inner.borrow_mut().units[self.index].motor.load = torque;
    }

    /// Hard stops: the load turns between these two angles, in degrees since the start. The
    /// floor under a lift, for example. `None`: it turns for ever.
    pub fn set_travel(&self, travel: Option<[f64; 2]>) {
        self.inner.borrow_mut().units[self.index].motor.travel = travel;
    }
}

/// A base on its wheels. What stands on it, an IMU for example, keeps a handle to see how it moves.
#[derive(Clone)]
pub struct Base {
    pub(crate) motion: Rc<Cell<Motion>>,
    /// Whether its IMU is mounted upside down.
    pub is_imu_over: bool,
}

impl Base {
    /// The position and heading.
    pub fn pose(&self) -> Pose {
        self.motion.get().pose
    }

    /// The velocity.
    pub fn twist(&self) -> Twist {
        self.motion.get().twist()
    }

    /// The sign of its IMU's vertical axis: -1 of one that is mounted upside down.
    pub(crate) fn imu_sign(&self) -> f64 {
        if self.is_imu_over { -1.0 } else { 1.0 }
    }
}
