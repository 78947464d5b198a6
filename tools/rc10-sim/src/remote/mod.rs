//! Remote controls with their receivers: what hands do comes out of a receiver as it would of a
//! real one, byte by byte or edge by edge, and so does what happens when the radio link breaks.
//!
//! | receiver | goes on a | sends | when the radio link is lost |
//! |---|---|---|---|
//! | [`Dr16`] | serial link | 18 bytes every 14 ms | falls silent |
//! | [`Sbus`] | serial link | 25 bytes every 7 or 14 ms | goes on: first "frame lost", then "failsafe" |
//! | [`Crsf`] | serial link | 26 bytes 150 times a second, and statistics | only statistics |
//! | [`Vt03`] | serial link | 21 bytes every 14 ms | falls silent |
//! | [`Ppm`] | pulse line | 9 pulses every 22 ms | falls silent |
//!
//! ```
//! use rc10_time::Micros;
//! use rc10_sim::remote::{Controls, Dr16, Remote, Stick};
//! use rc10_sim::{Nanos, World};
//!
//! let mut world = World::new(1);
//! let remote = Remote::new();
//! let uart = world.add_serial(Dr16::SERIAL, Dr16::new(&remote, Nanos::ZERO));
//! remote.set(Controls { left: Stick { x: 0.0, y: 0.5 }, ..Controls::REST });
//! world.advance(Micros::from_millis(100));
//! remote.set_transmitter(false);
//! world.advance(Micros::from_millis(200));
//! assert_eq!(remote.sent().frames, 8);
//! assert_eq!(uart.counters().from_device, 8 * 18);
//! ```

mod channels;
mod crsf;
mod dji;
mod ppm;
mod sbus;

use std::cell::RefCell;
use std::rc::Rc;

use crate::Nanos;

pub use channels::Mixer;
pub use crsf::Crsf;
pub use dji::{Dji, Dr16, Vt03};
pub use ppm::Ppm;
pub use sbus::{Failsafe, Sbus};

/// Positions of all sticks and switches of a remote.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controls {
    /// The left stick.
    pub left: Stick,
    /// The right stick.
    pub right: Stick,
    /// The switch on the left.
    pub left_switch: Switch,
    /// The switch on the right.
    pub right_switch: Switch,
    /// Two more switches, on remotes that have them.
    pub more_switches: [Switch; 2],
    /// A wheel or dial, -1 ..= 1.
    pub dial: f64,
    /// Keys of a computer's keyboard behind the link, a bit each: W S A D Shift Ctrl Q E R F G Z X C
    /// V B from bit 0 on. Only a DR16 and a VT03 carry them.
    pub keys: u16,
}

impl Controls {
    /// An untouched remote: sticks and switches in the middle.
    pub const REST: Self = Self {
        left: Stick::MIDDLE,
        right: Stick::MIDDLE,
        left_switch: Switch::Middle,
        right_switch: Switch::Middle,
        more_switches: [Switch::Middle; 2],
        dial: 0.0,
        keys: 0,
    };
}

/// A stick, -1 ..= 1 on each axis; it does not go further.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stick {
    /// To the right.
    pub x: f64,
    /// Away from the body.
    pub y: f64,
}

impl Stick {
    /// Let go.
    pub const MIDDLE: Self = Self { x: 0.0, y: 0.0 };
}

/// A switch of three positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Switch {
    /// Away from the body.
    Up,
    /// In the middle.
    #[default]
    Middle,
    /// To the body.
    Down,
}

/// Counters of what a receiver has sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// Frames, whatever they say.
    pub frames: u64,
    /// Those that say where the controls are now, and not that the remote is lost.
    pub live: u64,
    /// The time at which the first of those that were sent without a break ended on the wire: the
    /// last bit or edge of it. A break is a frame that was not sent or not live.
    pub back_since: Option<Nanos>,
    /// The time at which the newest of those ended on the wire, or will have ended: it may be on it
    /// yet.
    pub last_live: Option<Nanos>,
}

/// A remote control, as its receiver and a test's script see it. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Remote(Rc<RefCell<State>>);

#[derive(Debug, Default)]
struct State {
    controls: Controls,
    is_off: bool,
    mixer: Option<Mixer>,
    sent: Sent,
}

impl Remote {
    /// A remote that is switched on and untouched.
    pub fn new() -> Self {
        Self::default()
    }

    /// Hands move: what the receiver sends from its next frame on.
    pub fn set(&self, controls: Controls) {
        self.0.borrow_mut().controls = controls;
    }

    /// Sets up the transmitter of a receiver with channels in another way than the usual one.
    pub fn set_mixer(&self, mixer: Mixer) {
        self.0.borrow_mut().mixer = Some(mixer);
    }

    fn mixer(&self, usual: Mixer) -> Mixer {
        self.0.borrow().mixer.unwrap_or(usual)
    }

    /// Positions of its sticks and switches.
    pub fn controls(&self) -> Controls {
        self.0.borrow().controls
    }

    /// Switches the transmitter off, or on again: or it is out of reach, or jammed.
    pub fn set_transmitter(&self, on: bool) {
        self.0.borrow_mut().is_off = !on;
    }

    /// Counters of what its receiver has sent.
    pub fn sent(&self) -> Sent {
        self.0.borrow().sent
    }

    /// The positions of the controls, if the receiver hears the transmitter now.
    fn heard(&self) -> Option<Controls> {
        let state = self.0.borrow();
        (!state.is_off).then_some(state.controls)
    }

    /// The receiver sends nothing now that says where the controls are.
    fn pauses(&self) {
        self.0.borrow_mut().sent.back_since = None;
    }

    /// The receiver sends a frame now that says nothing about the controls.
    fn reports(&self) {
        self.0.borrow_mut().sent.frames += 1;
    }

    /// The receiver sends a frame now that will have ended at a time.
    fn sends(&self, is_live: bool, end: Nanos) {
        let sent = &mut self.0.borrow_mut().sent;
        sent.frames += 1;
        if is_live {
            sent.live += 1;
            sent.last_live = Some(end);
            sent.back_since = sent.back_since.or(Some(end));
        } else {
            sent.back_since = None;
        }
    }
}

/// The time that a number of characters takes on a link.
const fn characters(count: usize, character: Nanos) -> Nanos {
    Nanos::new(count as u64 * character.get())
}
