//! The motors of a CAN or RS-485 bus, and what keeps them safe.

use heapless::Vec;
use rc10_app::{Seconds, Text};
use rc10_time::Micros;

use crate::arm::{ArmState, ArmSwitch, Seen};
use crate::can_ids::{Clash, MotorName};
use crate::motor::{DriveMode, FrameError, FrameKind, Heard, Link, Loops, Motor, Tick, Withheld};
#[cfg(feature = "record")]
use crate::record::save;
use crate::request::{Request, RequestError, Response};
use crate::supervision::{MotorStatus, Safety, Supervision};
use crate::target::{Target, TargetError, TargetSet};

/// The number of a motor on its bus, from `attach` or [`Names`](crate::Names) only.
///
/// ```compile_fail
/// let turret = rc10_motor::MotorId::new(1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct MotorId(u8);

impl MotorId {
    pub(crate) const fn new(index: u8) -> Self {
        Self(index)
    }

    /// The number on its bus, counted from 0.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Why a motor was not attached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("{}", self.add_to(Text::new(), None))]
pub enum AttachError {
    /// Another motor that is attached already clashes with it.
    Clash {
        /// The motor that was to be attached.
        motor: MotorName,
        /// The one that is in its way.
        with: MotorName,
        /// The number of that one on the bus.
        slot: MotorId,
        /// The identifier or address that both would use.
        clash: Clash,
    },
    /// The bus has as many motors as it can have.
    Full {
        /// The motor that was to be attached.
        motor: MotorName,
        /// Largest number of motors on the bus.
        capacity: usize,
    },
    /// The receive table has no room for its identifiers.
    TableFull {
        /// The motor that was to be attached.
        motor: MotorName,
    },
    /// The motor declares more identifiers than a [`CanIds`](crate::CanIds) holds.
    TooManyIds {
        /// The motor that was to be attached.
        motor: MotorName,
    },
    /// Commands would hold for no time, or for too long.
    Expiry {
        /// The motor that was to be attached.
        motor: MotorName,
        /// The expiry asked for.
        asked: Micros,
    },
}

impl AttachError {
    /// A text with what it says at its end; `with` is what the robot calls the motor in the way.
    pub(crate) const fn add_to(&self, text: Text, label: Option<&str>) -> Text {
        match *self {
            Self::Clash { motor, with, clash, .. } => {
                let text = with.add_to(motor.add_to(text).push(" cannot share a bus with "));
                let text = match label {
                    Some(label) => text.push(" (`").push(label).push("`)"),
                    None => text,
                };
                clash.add_to(text.push(": ")).push("; set another on one, or plug it in elsewhere")
            }
            Self::Full { motor, capacity } => motor
                .add_to(text)
                .push(" finds no room: the bus holds ")
                .push_number(capacity as u64)
                .push(" motors"),
            Self::TableFull { motor } => {
                motor.add_to(text).push(" finds no room in the bus's receive table")
            }
            Self::TooManyIds { motor } => motor
                .add_to(text)
                .push(" declares more than 8 received, 8 transmitted or 2 listened-to patterns"),
            Self::Expiry { motor, asked } => motor
                .add_to(text)
                .push(": a command must expire after 1 to ")
                .push_number(Safety::LONGEST_EXPIRY.get())
                .push(" us, not ")
                .push_number(asked.get()),
        }
    }
}

/// Why a command was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandError {
    /// The motor does not take it.
    #[error(transparent)]
    Target(TargetError),
    /// The bus has no such motor.
    #[error("the bus has no such motor")]
    NoSuchMotor,
}

/// The part that a [`MotorBus`](crate::MotorBus) and an `Rs485Bus` have in common.
///
/// No motor can opt out: no torque unless the [`ArmSwitch`] is armed and its feedback comes, and
/// its safe state without commands or in an emergency stop.
pub struct Motors<'m, M: ?Sized, const N: usize> {
    switch: &'m ArmSwitch,
    slots: Vec<Slot<'m, M>, N>,
    last_tick: Option<Micros>,
    ticks: u32,
    /// Whether one of them turns by a jog, perhaps.
    jogs: bool,
}

struct Slot<'m, M: ?Sized> {
    motor: &'m mut M,
    supervision: Supervision,
}

/// After a longer pause between two ticks nothing that was heard or commanded before still holds.
const LONGEST_PAUSE: Micros = Micros::from_millis(1000);

impl<'m, M: Motor + ?Sized, const N: usize> Motors<'m, M, N> {
    pub(crate) const fn new(switch: &'m ArmSwitch) -> Self {
        Self { switch, slots: Vec::new(), last_tick: None, ticks: 0, jogs: false }
    }

    pub(crate) fn attach(
        &mut self,
        motor: &'m mut M,
        safety: Safety,
        link_timeout: Micros,
    ) -> Result<MotorId, AttachError> {
        let name = motor.name();
        if !safety.is_valid() {
            return Err(AttachError::Expiry { motor: name, asked: safety.command_expiry });
        }
        let full = AttachError::Full { motor: name, capacity: N };
        let index = u8::try_from(self.slots.len()).map_err(|_| full)?;
        let slot = Slot { motor, supervision: Supervision::new(safety, link_timeout) };
        self.slots.push(slot).map_err(|_| full)?;
        Ok(MotorId(index))
    }

    fn slot(&self, motor: MotorId) -> Option<&Slot<'m, M>> {
        self.slots.get(motor.index())
    }

    fn slot_mut(&mut self, motor: MotorId) -> Option<&mut Slot<'m, M>> {
        self.slots.get_mut(motor.index())
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &M> {
        self.slots.iter().map(|slot| &*slot.motor)
    }

    /// Has a motor take a frame of `at`, with its link until then; `None` for an unknown motor.
    pub(crate) fn hear(
        &mut self,
        motor: MotorId,
        at: Micros,
        take: impl FnOnce(&mut M, Link) -> Heard,
    ) -> Option<Result<(), FrameError>> {
        let slot = self.slots.get_mut(motor.index())?;
        let heard = take(slot.motor, slot.supervision.link(at));
        if heard == Ok(FrameKind::Feedback) {
            slot.supervision.heard_feedback(at);
            return Some(Ok(()));
        }
        Some(slot.supervision.heard(heard, at))
    }

    /// One tick: decides what each motor may do, lets it compute, and has `send` take its frames.
    pub(crate) fn tick(
        &mut self,
        seen: Seen,
        now: Micros,
        dt: Seconds,
        mut send: impl FnMut(usize, &mut M, &Tick),
    ) {
        let dt = Seconds::new(if dt.get() > 0.0 { dt.get().min(0.010) } else { 0.001 });
        let last = self.last_tick.replace(now);
        if last.is_some_and(|last| now.since(last) > LONGEST_PAUSE) {
            self.slots.iter_mut().for_each(|slot| slot.supervision.forget());
        }
        if self.jogs {
            self.watch_jogs(seen);
        }
        let arm = seen.for_motors();
        self.ticks = self.ticks.wrapping_add(1);
        let (mode, link, count) = (DriveMode::Off, Link::Online, self.ticks);
        // Without arming nothing else runs.
        let mut tick = Tick { dt, mode, link, count, is_jog: arm == ArmState::Disarmed };
        for (index, slot) in self.slots.iter_mut().enumerate() {
            tick.mode = slot.supervision.decide(arm, now);
            tick.link = slot.supervision.link_in_tick();
            slot.motor.update(&tick);
            send(index, slot.motor, &tick);
            // Each has its own beat.
            tick.count = tick.count.wrapping_add(1);
        }
    }

    #[cold] // A jog is rare.
    fn watch_jogs(&mut self, seen: Seen) {
        self.jogs = false;
        for slot in self.slots.iter_mut().filter(|slot| slot.supervision.jogs()) {
            slot.supervision.watch_jog(&*slot.motor, seen.state());
            self.jogs |= slot.supervision.jogs();
        }
    }

    pub(crate) fn get(&self, motor: MotorId) -> Option<&M> {
        self.slot(motor).map(|slot| &*slot.motor)
    }

    pub(crate) fn is_online(&self, motor: MotorId, now: Micros) -> bool {
        self.slot(motor).is_some_and(|slot| slot.supervision.link(now) == Link::Online)
    }

    /// Gives a motor a new target, which holds from `now` until it expires.
    ///
    /// # Errors
    /// [`CommandError`]; the old target stays, and stays as old as it was.
    pub fn command(
        &mut self,
        motor: MotorId,
        target: Target,
        now: Micros,
    ) -> Result<(), CommandError> {
        self.command_within(motor, target, Withheld::NONE, now)
    }

    /// The same, with a part of the motor's largest effort [withheld](Motor::withhold) from this target: of a motor
    /// whose loops run here.
    pub(crate) fn command_within(
        &mut self,
        motor: MotorId,
        target: Target,
        withheld: Withheld,
        now: Micros,
    ) -> Result<(), CommandError> {
        let Slot { motor, supervision } = self.slot_mut(motor).ok_or(CommandError::NoSuchMotor)?;
        supervision.command(&mut **motor, target, now).map_err(CommandError::Target)?;
        if withheld.is_any() {
            motor.withhold(withheld);
        }
        Ok(())
    }

    /// Makes a request. After [`Response::Pending`] ask [`response`](Self::response) each tick.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed.
    pub fn request(&mut self, motor: MotorId, request: Request) -> Result<Response, RequestError> {
        self.request_as(self.switch.seen(), motor, request)
    }

    pub(crate) fn request_as(
        &mut self,
        seen: Seen,
        motor: MotorId,
        request: Request,
    ) -> Result<Response, RequestError> {
        let (arm, now) = (seen.state(), self.last_tick.unwrap_or_default());
        let for_motors = seen.for_motors();
        self.jogs |= matches!(request, Request::Jog(_));
        let slot = self.slot_mut(motor).ok_or(RequestError::NoSuchMotor)?;
        let Slot { motor, supervision } = slot;
        match request {
            Request::Jog(speed) => supervision.jog(&mut **motor, speed, arm, now),
            Request::SetZero if supervision.is_driven(for_motors, now) => {
                Err(RequestError::WhileDriven)
            }
            Request::SetZeroOfDriven => supervision.request(&mut **motor, Request::SetZero),
            _ => supervision.request(&mut **motor, request),
        }
    }

    /// The outcome of a [`Pending`](Response::Pending) request, once it is known; told once.
    pub fn response(&mut self, motor: MotorId) -> Option<Result<Response, RequestError>> {
        let slot = self.slot_mut(motor)?;
        slot.supervision.response(&mut *slot.motor)
    }

    /// The motors attached, in order.
    pub fn motors(&self) -> impl Iterator<Item = (MotorId, MotorName)> {
        self.ids().zip(self.iter().map(Motor::name))
    }

    /// The attached motors' numbers, in order.
    pub fn ids(&self) -> impl Iterator<Item = MotorId> + use<M, N> {
        (0..).take(self.slots.len()).map(MotorId)
    }

    /// The targets a motor takes; none for a motor that does not exist.
    pub fn supports(&self, motor: MotorId) -> TargetSet {
        self.slot(motor).map_or(TargetSet::NONE, |slot| slot.motor.supports())
    }

    /// A motor's control loops that run here; `None` also for a motor that does not exist.
    pub fn loops(&self, motor: MotorId) -> Option<Loops> {
        self.slot(motor).and_then(|slot| slot.motor.loops())
    }

    /// The status of a motor; `None` for a motor that does not exist.
    pub fn status(&self, motor: MotorId, now: Micros) -> Option<MotorStatus> {
        let mut status = MotorStatus::NEW;
        self.slot(motor)?;
        self.write_status(motor, now, &mut status);
        Some(status)
    }

    /// Writes a motor's status in place, every tick; nothing for a motor that does not exist.
    pub(crate) fn write_status(&self, motor: MotorId, now: Micros, status: &mut MotorStatus) {
        if let Some(slot) = self.slot(motor) {
            slot.supervision.write_status(&*slot.motor, now, status);
        }
    }

    /// Number of motors in a record.
    #[cfg(feature = "record")]
    #[expect(clippy::cast_possible_truncation, reason = "at most 15")]
    pub(crate) fn recorded(&self) -> u8 {
        self.slots.len() as u8
    }

    /// Of [`Recorded`](crate::record::Recorded).
    #[cfg(feature = "record")]
    pub(crate) fn save_part(&self, part: u8, to: &mut dyn FnMut(&[u8])) {
        match self.slots.get(usize::from(part)) {
            Some(slot) => {
                save(&slot.supervision, to);
                slot.motor.save(to);
            }
            None => save(&(self.last_tick, self.ticks), to),
        }
    }

    /// Of [`Recorded`](crate::record::Recorded); what is left of the bytes.
    #[cfg(feature = "record")]
    pub(crate) fn load_part<'b>(&mut self, part: u8, from: &'b [u8]) -> Option<&'b [u8]> {
        self.jogs = true;
        match self.slots.get_mut(usize::from(part)) {
            Some(slot) => {
                let (supervision, rest) = postcard::take_from_bytes(from).ok()?;
                slot.supervision = supervision;
                slot.motor.load(rest).then_some(&[])
            }
            None => {
                let rest;
                ((self.last_tick, self.ticks), rest) = postcard::take_from_bytes(from).ok()?;
                Some(rest)
            }
        }
    }

    /// Of [`Recorded`](crate::record::Recorded).
    #[cfg(all(feature = "record", not(target_os = "none")))]
    pub(crate) fn show_part(&self, part: u8, to: &mut dyn core::fmt::Write) -> core::fmt::Result {
        match self.slots.get(usize::from(part)) {
            Some(slot) => {
                writeln!(to, "{:#?}", slot.supervision)?;
                slot.motor.show(to)
            }
            None => writeln!(to, "{:#?}", (self.last_tick, self.ticks)),
        }
    }

    /// The switch that arms this bus.
    pub const fn switch(&self) -> &'m ArmSwitch {
        self.switch
    }
}
