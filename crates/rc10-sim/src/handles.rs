//! What a test holds of the things in a world. Handles are cheap to clone, and may be used inside
//! of a future that the world runs: a fault at a given time is a line of a test's script.

use std::cell::RefCell;
use std::rc::Rc;

use rc10_can::{CanFrame, CanPort, Health, Micros, Submitted};

use crate::base::{Pose, Twist};
use crate::esc::{Device, EscConfig, EscState, IdOutOfRange};
use crate::wire::{BusCounters, TraceEntry};
use crate::world::Inner;

/// A CAN bus of a [`World`](crate::World).
#[derive(Clone)]
pub struct Bus {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Bus {
    /// Puts an ESC with its motor on the bus, powered, at rest.
    ///
    /// Two ESCs of one feedback id are allowed, as on a real bus; see
    /// [`BusCounters::id_clashes`].
    ///
    /// # Errors
    /// [`IdOutOfRange`] if the model has no such id.
    pub fn add_esc(&self, config: EscConfig) -> Result<Esc, IdOutOfRange> {
        let mut inner = self.inner.borrow_mut();
        let angle = inner.random.unit();
        let mut device = Device::new(&config, angle)?;
        let phase = Micros::new(inner.random.below(device.period().get()));
        let now = inner.clock.now();
        device.power(true, now, phase);
        device.bus = self.index;
        device.node = inner.wires[self.index].join(now);
        inner.devices.push(device);
        Ok(Esc { inner: Rc::clone(&self.inner), index: inner.devices.len() - 1 })
    }

    /// The controller's port. A bus has one controller: all its ports share it.
    #[must_use]
    pub fn port(&self) -> SimPort {
        SimPort(self.clone())
    }

    /// A foreign node sends a frame, after those it was given before. It is on the bus, and
    /// acknowledges others' frames, only while it has something to send.
    pub fn inject(&self, frame: &CanFrame) {
        self.inner.borrow_mut().wires[self.index].inject(*frame);
    }

    /// Cuts the controller off the bus, or connects it again.
    ///
    /// Cut off it hears nothing, and nobody acknowledges what it sends: it repeats it until it is
    /// connected again.
    pub fn set_cut(&self, cut: bool) {
        let mut inner = self.inner.borrow_mut();
        let now = inner.clock.now();
        inner.wires[self.index].set_cut(cut, now);
    }

    /// The frames that went over the bus since the last call, in the order of the wire; empty if
    /// tracing is off.
    #[must_use]
    pub fn take_trace(&self) -> Vec<TraceEntry> {
        self.inner.borrow_mut().wires[self.index].take_trace()
    }

    /// How busy the bus was since time zero, in per cent. A frame counts when it has ended, and
    /// counts also if nobody acknowledged it.
    #[expect(clippy::cast_precision_loss, reason = "104 days of nanoseconds are exact")]
    #[must_use]
    pub fn load(&self) -> f64 {
        let inner = self.inner.borrow();
        let passed_ns = inner.clock.now().get() * 1000;
        if passed_ns == 0 {
            return 0.0;
        }
        inner.wires[self.index].busy_ns() as f64 * 100.0 / passed_ns as f64
    }

    /// How busy the bus was in each 100 ms that is over, in per cent.
    #[must_use]
    pub fn load_windows(&self) -> Vec<f64> {
        let inner = self.inner.borrow();
        inner.wires[self.index].load_windows(inner.clock.now())
    }

    /// What happened so far.
    #[must_use]
    pub fn counters(&self) -> BusCounters {
        self.inner.borrow().wires[self.index].counters()
    }
}

/// The host's port to a simulated bus: 32 transmit buffers, newest frame per identifier, and a
/// receive queue of [`BusConfig::receive_capacity`](crate::BusConfig::receive_capacity) frames.
///
/// A frame that is on the wire is not replaced any more: a newer one of its identifier follows it.
/// As nodes acknowledge frames that are whole, the controller never goes bus-off: its transmit
/// error counter stops at 128, error passive.
#[derive(Clone)]
pub struct SimPort(Bus);

impl CanPort for SimPort {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        let mut inner = self.0.inner.borrow_mut();
        inner.wires[self.0.index].controller.receive()
    }

    fn submit(&mut self, frame: &CanFrame) -> Submitted {
        let mut inner = self.0.inner.borrow_mut();
        inner.wires[self.0.index].controller.submit(frame)
    }

    fn cancel_pending(&mut self) -> u8 {
        let mut inner = self.0.inner.borrow_mut();
        inner.wires[self.0.index].controller.cancel_pending()
    }

    fn health(&self) -> Health {
        self.0.inner.borrow().wires[self.0.index].controller.health()
    }
}

/// An ESC with its motor.
#[derive(Clone)]
pub struct Esc {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Esc {
    /// What is true now (of the mechanics: at the last physics step).
    #[must_use]
    pub fn state(&self) -> EscState {
        let inner = self.inner.borrow();
        let device = &inner.devices[self.index];
        device.state(inner.wires[device.bus].overwritten(device.node))
    }

    /// Switches the ESC's power. Without it there is no current, no feedback, no acknowledge; the
    /// rotor coasts. With it again, the ESC starts at command 0 and sends at a new phase, at once
    /// (a real one takes a second or two to start).
    pub fn set_power(&self, powered: bool) {
        let inner = &mut *self.inner.borrow_mut();
        let device = &mut inner.devices[self.index];
        if device.is_powered() != powered {
            let phase = Micros::new(inner.random.below(device.period().get()));
            let now = inner.clock.now();
            device.power(powered, now, phase);
            inner.wires[device.bus].power(device.node, powered, now);
        }
    }

    /// Silences its feedback, or lets it speak again; it goes on driving.
    pub fn set_feedback(&self, enabled: bool) {
        self.inner.borrow_mut().devices[self.index].set_muted(!enabled);
    }

    /// A constant torque on the output shaft from outside, N·m, positive in the motor's positive
    /// direction: the weight on a lift, for example.
    pub fn set_load(&self, torque: f64) {
        self.inner.borrow_mut().devices[self.index].motor.load = torque;
    }
}

/// A mecanum base.
#[derive(Clone)]
pub struct Base {
    pub(crate) inner: Rc<RefCell<Inner>>,
    pub(crate) index: usize,
}

impl Base {
    /// Where it is.
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.inner.borrow().bodies[self.index].pose
    }

    /// How it moves.
    #[must_use]
    pub fn twist(&self) -> Twist {
        self.inner.borrow().bodies[self.index].twist()
    }
}
