//! What every simulated ESC is: electronics of some vendor, between a wire and a winding.

use std::any::Any;

use rc10_can::{CanFrame, Micros};

use crate::motor::{Motor, Plant};

/// An ESC's electronics and firmware, from the device's side: what it takes from the bus, what it
/// puts on it, what it does to the winding. The world gives it power, frames, time and a shaft.
///
/// Write it from the vendor's manual and with code of its own, never with that of the motor library
/// it is a witness for.
pub trait Device: Any {
    /// Power has come: everything volatile starts afresh. `phase` is a random part of its
    /// [`period`](Self::period): when in it the first report is due.
    fn power_on(&mut self, now: Micros, phase: Micros);

    /// The time from one regular report to the next; for a device that only answers, anything above
    /// zero.
    fn period(&self) -> Micros {
        Micros::from_millis(1)
    }

    /// Takes a frame that has just ended on the bus. What it answers goes to `out`.
    fn receive(
        &mut self,
        frame: &CanFrame,
        shaft: &Shaft<'_>,
        now: Micros,
        out: &mut Outbox,
    ) -> Taken;

    /// When it does something by itself next. In the past means now.
    fn next_event(&self) -> Option<Micros> {
        None
    }

    /// Lets that happen. Asked at every event in the world; whether it is time is its own business.
    fn advance(&mut self, _shaft: &Shaft<'_>, _now: Micros, _out: &mut Outbox) {}

    /// What it does to the winding for the next 100 µs. Its control loops and time-outs run here.
    fn drive(&mut self, shaft: &Shaft<'_>, now: Micros) -> Winding;

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

/// What became of a frame at a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// It was a command or a question for it.
    Yes,
    /// It was for somebody else.
    NotMine,
    /// It has the device's identifier, but not the length or content that it takes.
    Malformed,
}

/// What an ESC can find wrong with itself.
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

/// What an ESC does to the winding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Winding {
    /// Bridge open.
    Open,
    /// Regulated current, A: positive gives positive torque.
    Current(f64),
    /// Fixed voltage, V.
    Voltage(f64),
}

/// Frames that a device wants on the bus, in order.
#[derive(Debug, Default)]
pub struct Outbox {
    frames: Vec<CanFrame>,
}

impl Outbox {
    /// Sends a frame as soon as the bus is free; it takes the place of one of the same identifier
    /// that still waits.
    pub fn send(&mut self, frame: CanFrame) {
        self.frames.push(frame);
    }

    pub(crate) fn drain(&mut self) -> impl Iterator<Item = CanFrame> {
        self.frames.drain(..)
    }
}

/// A shaft as its ESC's sensors see it: exact, and as of the last physics step.
#[derive(Clone, Copy)]
pub struct Shaft<'m>(&'m Motor);

impl<'m> Shaft<'m> {
    pub(crate) const fn new(motor: &'m Motor) -> Self {
        Self(motor)
    }

    /// Where in its turn the rotor is, 0 .. 1.
    #[must_use]
    pub fn rotor_angle(&self) -> f64 {
        self.0.rotor_angle()
    }

    /// Rotor speed, rpm.
    #[must_use]
    pub fn rotor_rpm(&self) -> f64 {
        self.0.rotor_rpm()
    }

    /// Turns of the rotor since the world's start, with where it stood then (0 .. 1).
    #[must_use]
    pub fn rotor_turns(&self) -> f64 {
        self.0.rotor_turns()
    }

    /// Angle of the output shaft since the world's start, rad.
    #[must_use]
    pub fn radians(&self) -> f64 {
        self.0.output_degrees().to_radians()
    }

    /// Speed of the output shaft, rad/s.
    #[must_use]
    pub const fn speed(&self) -> f64 {
        self.0.speed
    }

    /// Current in the winding, A.
    #[must_use]
    pub const fn current(&self) -> f64 {
        self.0.current
    }

    /// Torque of the winding at the output shaft, N·m.
    #[must_use]
    pub const fn torque(&self) -> f64 {
        self.0.plant().torque_constant * self.0.current
    }

    /// Temperature of the motor, °C.
    #[must_use]
    pub const fn temperature(&self) -> f64 {
        self.0.temperature
    }

    /// The motor, gearbox and load.
    #[must_use]
    pub const fn plant(&self) -> &'m Plant {
        self.0.plant()
    }
}

/// An ESC with its motor, at its place.
pub(crate) struct Unit {
    device: Box<dyn Device>,
    pub(crate) motor: Motor,
    /// Where it is plugged in.
    pub(crate) bus: usize,
    pub(crate) node: usize,
    /// Carries a wheel of a base.
    pub(crate) is_wheel: bool,
    powered: bool,
    /// What it did to the winding in the last step.
    winding: Winding,
    muted: bool,
    commands: u64,
    last_command_at: Option<Micros>,
    malformed: u64,
    out: Outbox,
}

impl Unit {
    /// Powered from now on.
    pub(crate) fn new(
        device: Box<dyn Device>,
        motor: Motor,
        (bus, node): (usize, usize),
        now: Micros,
        phase: Micros,
    ) -> Self {
        let mut unit = Self {
            device,
            motor,
            bus,
            node,
            is_wheel: false,
            powered: false,
            winding: Winding::Open,
            muted: false,
            commands: 0,
            last_command_at: None,
            malformed: 0,
            out: Outbox::default(),
        };
        unit.power(true, now, phase);
        unit
    }

    pub(crate) fn period(&self) -> Micros {
        self.device.period()
    }

    pub(crate) fn power(&mut self, powered: bool, now: Micros, phase: Micros) {
        self.powered = powered;
        if powered {
            self.device.power_on(now, phase);
        }
    }

    pub(crate) const fn is_powered(&self) -> bool {
        self.powered
    }

    /// Muted or not: it goes on driving.
    pub(crate) const fn set_muted(&mut self, muted: bool) {
        self.muted = muted;
    }

    pub(crate) fn inject(&mut self, fault: EscFault) -> bool {
        self.device.inject(fault)
    }

    pub(crate) fn set_id(&mut self, id: u8) -> bool {
        self.device.set_id(id)
    }

    pub(crate) fn device(&mut self) -> &mut dyn Any {
        &mut *self.device
    }

    pub(crate) fn next_event(&self) -> Option<Micros> {
        if self.powered { self.device.next_event() } else { None }
    }

    pub(crate) fn receive(&mut self, frame: &CanFrame, now: Micros) {
        if !self.powered {
            return;
        }
        match self.device.receive(frame, &Shaft::new(&self.motor), now, &mut self.out) {
            Taken::Yes => {
                self.commands += 1;
                self.last_command_at = Some(now);
            }
            Taken::Malformed => self.malformed += 1,
            Taken::NotMine => (),
        }
    }

    /// What it does by itself now.
    pub(crate) fn advance(&mut self, now: Micros) {
        if self.powered {
            self.device.advance(&Shaft::new(&self.motor), now, &mut self.out);
        }
    }

    /// What it has to send.
    pub(crate) fn take_frames(&mut self) -> impl Iterator<Item = CanFrame> {
        let is_heard = !self.muted;
        self.out.drain().filter(move |_| is_heard)
    }

    pub(crate) fn step(&mut self, now: Micros) {
        self.winding = if self.powered {
            self.device.drive(&Shaft::new(&self.motor), now)
        } else {
            Winding::Open
        };
        self.motor.step(self.winding);
    }

    pub(crate) fn state(&self, feedback_overwritten: u64) -> EscState {
        EscState {
            powered: self.powered,
            command: if self.powered { self.device.command() } else { 0 },
            commands: self.commands,
            last_command_at: self.last_command_at,
            malformed: self.malformed,
            feedback_overwritten,
            ..EscState::of(&self.motor, self.winding)
        }
    }
}

/// What is true of an ESC and its motor, whatever its feedback says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscState {
    /// Speed of the rotor, rpm.
    pub rotor_rpm: f64,
    /// Speed of the output shaft, rpm.
    pub output_rpm: f64,
    /// Angle of the output shaft since the start of the world, degrees, over many turns.
    pub output_degrees: f64,
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
    /// Whether its bridge shorts the winding: zero volts, which brake a shaft that turns, and do
    /// nothing to one that stands.
    pub shorted: bool,
    /// The raw command it obeys: the last one it got since power-on, 0 before. 0 also of devices
    /// whose commands are more than one number.
    pub command: i16,
    /// Command frames it took.
    pub commands: u64,
    /// When the last of them arrived.
    pub last_command_at: Option<Micros>,
    /// Frames with its identifier whose length or content it does not take.
    pub malformed: u64,
    /// Feedback frames a newer one overwrote before the bus was free.
    pub feedback_overwritten: u64,
}

impl EscState {
    /// Of a motor whose electronics do this to it, and have heard nothing.
    pub(crate) fn of(motor: &Motor, winding: Winding) -> Self {
        Self {
            rotor_rpm: motor.rotor_rpm(),
            output_rpm: motor.output_rpm(),
            output_degrees: motor.output_degrees(),
            current: motor.current,
            torque: motor.plant().torque_constant * motor.current,
            temperature: motor.temperature,
            powered: false,
            open: winding == Winding::Open,
            shorted: winding == Winding::Voltage(0.0),
            command: 0,
            commands: 0,
            last_command_at: None,
            malformed: 0,
            feedback_overwritten: 0,
        }
    }
}
