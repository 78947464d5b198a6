//! Simulated ESCs: electronics of some vendor, between a wire and a winding.

use std::any::Any;
use std::borrow::Cow;

use rc10_can::CanFrame;
use rc10_time::Micros;

use crate::Nanos;
use crate::line::Heard;
use crate::motor::Shaft;
use crate::random::Random;

/// An ESC's electronics and firmware, from the device's side: what it takes from its wire, what it
/// puts on it, what it does to the winding. The world gives it power, frames or bytes, time and a
/// shaft.
///
/// Write it from the vendor's manual and with code of its own, never with that of the motor library
/// it is a witness for.
pub trait Device: Any {
    /// Power has come: everything volatile starts afresh. `phase` is a random part of its
    /// [`period`](Self::period): when in it the first report is due.
    fn power_on(&mut self, shaft: &Shaft, now: Micros, phase: Micros);

    /// The time from one regular report to the next; for a device that only answers, anything above
    /// zero.
    fn period(&self) -> Micros {
        Micros::from_millis(1)
    }

    /// Takes a frame that has just ended on the bus. What it answers goes to `out`.
    fn receive(
        &mut self,
        _frame: &CanFrame,
        _shaft: &Shaft,
        _now: Micros,
        _out: &mut Outbox,
    ) -> Taken {
        Taken::NotMine
    }

    /// Takes a byte that has just ended on the serial line.
    fn hear(&mut self, _byte: u8, _shaft: &Shaft, _now: Nanos) -> Heard {
        Heard::Nothing
    }

    /// The time of the next event that it makes by itself. In the past means now. Asked after other calls, and as time begins to pass.
    fn next_event(&self) -> Option<Micros> {
        None
    }

    /// Lets that happen. Asked more often than that; whether it is time is its own business.
    fn advance(&mut self, _shaft: &Shaft, _now: Micros, _out: &mut Outbox) {}

    /// Its effect on the winding for the next 100 µs. Its control loops and time-outs run here.
    fn drive(&mut self, shaft: &Shaft, now: Micros) -> Winding;

    /// The raw command it obeys, where that is a single number.
    fn command(&self) -> i16 {
        0
    }

    /// Has it find something wrong with itself, until power-off. Whether it knows such a fault.
    fn inject(&mut self, _fault: EscFault) -> bool {
        false
    }

    /// Sets another identifier on it. `false`: it can have no such one, and nothing happened.
    fn set_id(&mut self, _id: u8) -> bool {
        false
    }
}

/// Whether a device took a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// The frame was a command or a question for the device.
    Yes,
    /// The frame was for another device.
    NotMine,
    /// The frame has the device's identifier, but not a length or content that it takes.
    Malformed,
}

/// Faults of an encoder that its ESC does not find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoder {
    /// It stands still, whatever the shaft does. The winding makes torque all the same, as with an
    /// encoder of its own for that.
    Frozen,
    /// It counts the other way.
    Flipped,
}

/// Faults that an ESC can find in itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EscFault {
    /// Motor or power stage too hot.
    OverTemperature,
    /// Commands stopped coming.
    CommunicationLost,
    /// Too much current.
    OverCurrent,
    /// Supply too high.
    OverVoltage,
    /// Supply too low.
    UnderVoltage,
    /// The rotor's angle cannot be read.
    Encoder,
}

/// A report of an angle beyond the range of its field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Beyond {
    /// The end of the range.
    #[default]
    Saturates,
    /// The other end, and on from there.
    Wraps,
}

impl Beyond {
    /// What is reported of an angle by a field that ends at ± `end`; it saturates by itself.
    pub(crate) fn of(self, angle: f64, end: f64) -> f64 {
        match self {
            Self::Saturates => angle,
            Self::Wraps => (angle + end).rem_euclid(2.0 * end) - end,
        }
    }
}

/// There is no such device: why it cannot be set up like this.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NoDevice(pub(crate) String);

/// Sets an identifier, if there can be such a one; says whether there can.
pub(crate) const fn set_if(can_be: bool, place: &mut u8, id: u8) -> bool {
    if can_be {
        *place = id;
    }
    can_be
}

/// Effect of an ESC on the winding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Winding {
    /// Bridge open.
    Open,
    /// Regulated current, A: positive gives positive torque.
    Current(f64),
    /// Fixed voltage, V.
    Voltage(f64),
}

impl Winding {
    fn is_idle(self) -> bool {
        match self {
            Self::Open => true,
            Self::Current(amps) => amps.abs() < 0.02,
            Self::Voltage(_) => false,
        }
    }
}

/// Frames that a device wants on the bus, in order: each as soon as the bus is free, in the place of
/// one of the same identifier that still waits.
pub type Outbox = Vec<CanFrame>;

/// The place of a device: a node of a bus, or a station of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    Bus { bus: usize, node: usize },
    Line { line: usize, station: usize },
}

/// An ESC with its motor, at its place.
pub(crate) struct Unit {
    pub(crate) device: Box<dyn Device>,
    pub(crate) motor: Shaft,
    pub(crate) place: Place,
    /// Turns or steers a wheel of a base, or carries a link of an arm.
    pub(crate) is_taken: bool,
    powered: bool,
    /// Whether the data lines are unplugged.
    cut: bool,
    /// The state of the winding in the last step.
    winding: Winding,
    /// The fault of its encoder, and the shaft as it was when that began.
    encoder: Option<(Encoder, Box<Shaft>)>,
    /// Silent: it goes on driving.
    pub(crate) muted: bool,
    commands: u64,
    last_command_at: Option<Micros>,
    malformed: u64,
    out: Outbox,
    /// The time of its next event; zero after something was done to it.
    pub(crate) due: Nanos,
}

impl Unit {
    /// Without power.
    pub(crate) fn new(device: Box<dyn Device>, motor: Shaft, place: Place) -> Self {
        Self {
            device,
            motor,
            place,
            is_taken: false,
            powered: false,
            cut: false,
            winding: Winding::Open,
            encoder: None,
            muted: false,
            commands: 0,
            last_command_at: None,
            malformed: 0,
            out: Outbox::new(),
            due: Nanos::ZERO,
        }
    }

    /// Switches its power; a device that reports by itself does so at a random time in its period.
    /// Whether that changed anything.
    pub(crate) fn power(&mut self, powered: bool, now: Nanos, random: &mut Random) -> bool {
        if self.powered == powered {
            return false;
        }
        self.powered = powered;
        let phase = match self.place {
            Place::Bus { .. } => Micros::new(random.below(self.device.period().get())),
            Place::Line { .. } => Micros::ZERO,
        };
        if powered {
            self.device.power_on(&seen(&self.encoder, &self.motor), now.micros(), phase);
        }
        true
    }

    /// Whether it has power and is plugged in.
    pub(crate) const fn is_present(&self) -> bool {
        self.powered && !self.cut
    }

    /// Whether that changed anything.
    pub(crate) const fn set_cut(&mut self, cut: bool) -> bool {
        core::mem::replace(&mut self.cut, cut) != cut
    }

    /// Gives its encoder a fault, or takes that away: then it shows where the shaft really is.
    pub(crate) fn set_encoder(&mut self, fault: Option<Encoder>) {
        self.encoder = fault.map(|fault| (fault, Box::new(self.motor.clone())));
    }

    pub(crate) fn next_event(&self) -> Nanos {
        let next = if self.powered { self.device.next_event() } else { None };
        next.map_or(Nanos::NEVER, Nanos::from)
    }

    /// Takes a frame from its bus.
    pub(crate) fn receive(&mut self, frame: &CanFrame, now: Micros) {
        if !self.powered {
            return;
        }
        self.due = Nanos::ZERO;
        match self.device.receive(frame, &seen(&self.encoder, &self.motor), now, &mut self.out) {
            Taken::Yes => self.count_command(now),
            Taken::Malformed => self.malformed += 1,
            Taken::NotMine => (),
        }
    }

    /// Takes a byte from its line; what it answers, and how much later.
    pub(crate) fn hear(&mut self, byte: u8, now: Nanos) -> Option<(Vec<u8>, Nanos)> {
        self.due = Nanos::ZERO;
        let heard = self.device.hear(byte, &seen(&self.encoder, &self.motor), now);
        match heard {
            Heard::Nothing => return None,
            Heard::Malformed => self.malformed += 1,
            Heard::Command | Heard::Question(..) => self.count_command(now.micros()),
        }
        match heard {
            Heard::Question(answer, after) if !self.muted => Some((answer, after)),
            _ => None,
        }
    }

    const fn count_command(&mut self, now: Micros) {
        self.commands += 1;
        self.last_command_at = Some(now);
    }

    /// Lets events happen that it makes by itself now.
    pub(crate) fn advance(&mut self, now: Micros) {
        if self.powered {
            self.device.advance(&seen(&self.encoder, &self.motor), now, &mut self.out);
        }
    }

    /// The frames that it has to send.
    pub(crate) fn take_frames(&mut self) -> impl Iterator<Item = CanFrame> {
        let is_heard = !self.muted && !self.cut;
        self.out.drain(..).filter(move |_| is_heard)
    }

    pub(crate) fn step(&mut self, now: Nanos) {
        self.due = Nanos::ZERO;
        self.winding = if self.powered {
            self.device.drive(&seen(&self.encoder, &self.motor), now.micros())
        } else {
            Winding::Open
        };
        self.motor.step(self.winding);
    }

    pub(crate) fn state(&self, feedback_overwritten: u64) -> EscState {
        let command = if self.powered { self.device.command() } else { 0 };
        EscState {
            rotor_rpm: self.motor.rotor_rpm(),
            output_rpm: self.motor.output_rpm(),
            output_degrees: self.motor.output_degrees(),
            load_rpm: self.motor.load_rpm(),
            load_degrees: self.motor.load_degrees(),
            current: self.motor.current,
            torque: self.motor.torque(),
            temperature: self.motor.temperature,
            powered: self.powered,
            open: self.winding == Winding::Open,
            idle: self.winding.is_idle(),
            shorted: self.winding == Winding::Voltage(0.0),
            command,
            commands: self.commands,
            last_command_at: self.last_command_at,
            malformed: self.malformed,
            feedback_overwritten,
        }
    }
}

/// The shaft as its encoder shows it.
fn seen<'s>(encoder: &Option<(Encoder, Box<Shaft>)>, shaft: &'s Shaft) -> Cow<'s, Shaft> {
    match encoder {
        None => Cow::Borrowed(shaft),
        Some((fault, then)) => Cow::Owned(shaft.seen(then, *fault == Encoder::Flipped)),
    }
}

/// True state of an ESC and its motor, independent of its feedback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscState {
    /// Speed of the rotor, rpm.
    pub rotor_rpm: f64,
    /// Speed of the output shaft, rpm.
    pub output_rpm: f64,
    /// Angle of the output shaft since the start of the world, degrees, over many turns.
    pub output_degrees: f64,
    /// Speed of the load, rpm: the output shaft's, unless there is backlash between them.
    pub load_rpm: f64,
    /// Angle of the load since the start of the world, degrees. The same.
    pub load_degrees: f64,
    /// Torque current, A.
    pub current: f64,
    /// Torque of the winding at the output shaft, N·m.
    pub torque: f64,
    /// Temperature of the motor, °C.
    pub temperature: f64,
    /// Whether the ESC has power.
    pub powered: bool,
    /// Whether its bridge is open: it has no power, or drives nothing, not even no current.
    pub open: bool,
    /// Whether nothing drives the shaft: its bridge is open, or regulates no current but for what a
    /// code of 12 bits makes of zero, 20 mA.
    pub idle: bool,
    /// Whether its bridge shorts the winding: zero volts, which brake a shaft that turns, and do
    /// nothing to one that stands.
    pub shorted: bool,
    /// The raw command it obeys: the last one it got since power-on, 0 before. 0 also of devices
    /// whose commands are more than one number.
    pub command: i16,
    /// Command frames it took.
    pub commands: u64,
    /// The time at which the last of them arrived.
    pub last_command_at: Option<Micros>,
    /// Frames with its identifier whose length or content it does not take.
    pub malformed: u64,
    /// Feedback frames a newer one overwrote before the bus was free.
    pub feedback_overwritten: u64,
}
