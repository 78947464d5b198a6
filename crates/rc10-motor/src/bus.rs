use core::fmt;

use heapless::Vec;
use rc10_app::Seconds;
use rc10_can::{CanFrame, Micros};

use crate::arm::{ArmState, ArmSwitch};
use crate::batch::{TxBatch, TxFull};
use crate::load::BusLoad;
use crate::motor::{
    CanMotor, Drive, Fault, Feedback, FrameError, Heard, Request, RequestError, SafeState, Target,
    TargetError, TargetSet,
};
use crate::table::ReceiveTable;
use crate::wiring::{Clash, MotorName, Wiring};

/// The motors of one CAN bus, and what keeps them safe.
///
/// Plain synchronous functions; the time comes in as an argument. Every tick: give it the received
/// frames ([`on_frame`](Self::on_frame)) and the newest targets ([`command`](Self::command)), then
/// [`tick`](Self::tick) fills the frames to send.
///
/// No motor can opt out of: no torque until the [`ArmSwitch`] is armed; its safe state when
/// commands stop coming; no torque when its feedback is lost; its safe state while the emergency
/// stop is latched.
pub struct MotorBus<'m> {
    switch: &'m ArmSwitch,
    slots: Vec<Slot<'m>, CAPACITY>,
    table: ReceiveTable,
    unclaimed: u32,
    last_unclaimed: Option<u32>,
    remote: u32,
    last_tick: Option<Micros>,
}

/// No loop takes a longer step, s.
const LONGEST_STEP: f32 = 0.010;
/// After a longer pause between two ticks nothing that was heard or commanded before still holds.
const LONGEST_PAUSE: Micros = Micros::from_millis(1000);
/// A frame may have arrived so long after the tick began that takes it, µs. What lies further in
/// the future is not fresh, but another clock.
const SKEW: u32 = 2_000;

/// See [`MotorBus::CAPACITY`].
const CAPACITY: usize = 8;

struct Slot<'m> {
    motor: &'m mut dyn CanMotor,
    /// When it was heard last and when it was commanded last: the low 32 bits of the time, which
    /// is enough while `link` and `fresh` keep what was true before.
    heard_at: u32,
    commanded_at: u32,
    /// In microseconds, with [`SKEW`].
    link_timeout: u32,
    command_expiry: u32,
    safety: Safety,
    drive: Drive,
    link: Link,
    fresh: bool,
    /// The motor has told of a fault that nobody has cleared.
    faulted: bool,
    counters: MotorCounters,
}

/// Which motor of a bus: as [`MotorBus::attach`] counted them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorId(u8);

impl MotorId {
    /// The motor attached as number `index`, counted from 0.
    #[must_use]
    pub const fn new(index: u8) -> Self {
        Self(index)
    }

    /// Its number on its bus, counted from 0.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// When and how a motor leaves its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Safety {
    /// What it does then.
    pub state: SafeState,
    /// A command holds for so long: 1 µs ..= [`LONGEST_EXPIRY`](Self::LONGEST_EXPIRY).
    pub command_expiry: Micros,
}

impl Safety {
    /// Nobody needs a motor that runs on for longer than this without a word.
    pub const LONGEST_EXPIRY: Micros = Micros::from_millis(1000);
    /// Coast when no command came for 50 ms.
    pub const COAST: Self = Self::new(SafeState::Coast);
    /// Brake when no command came for 50 ms.
    pub const BRAKE: Self = Self::new(SafeState::Brake);
    /// Hold the angle when no command came for 50 ms.
    pub const HOLD: Self = Self::new(SafeState::Hold);

    /// A safe state, taken when no command came for 50 ms.
    #[must_use]
    pub const fn new(state: SafeState) -> Self {
        Self { state, command_expiry: Micros::from_millis(50) }
    }
}

/// Why a motor was not attached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AttachError {
    /// It clashes with one that is attached already.
    Clash {
        /// The motor that was to be attached.
        motor: MotorName,
        /// The one that is in its way.
        with: MotorName,
        /// What they would both use.
        clash: Clash,
    },
    /// The bus has as many motors as it can have.
    Full {
        /// The motor that was to be attached.
        motor: MotorName,
        /// How many motors the bus holds.
        capacity: usize,
    },
    /// The receive table has no room for its identifiers.
    TableFull {
        /// The motor that was to be attached.
        motor: MotorName,
    },
    /// Its commands would hold for no time, or for too long.
    Expiry {
        /// The motor that was to be attached.
        motor: MotorName,
        /// What was asked for.
        asked: Micros,
    },
}

impl fmt::Display for AttachError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Clash { motor, with, clash } => {
                write!(f, "{motor} cannot share a bus with {with}: {clash}")
            }
            Self::Full { motor, capacity } => {
                write!(f, "{motor} finds no room: the bus holds {capacity} motors")
            }
            Self::TableFull { motor } => {
                write!(f, "{motor} finds no room in the bus's receive table")
            }
            Self::Expiry { motor, asked } => write!(
                f,
                "{motor}: a command must expire after 0 to {}, not {asked}",
                Safety::LONGEST_EXPIRY
            ),
        }
    }
}

impl core::error::Error for AttachError {}

/// Why a command was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandError {
    /// The motor does not take it.
    Target(TargetError),
    /// The bus has no such motor.
    NoSuchMotor,
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Target(error) => error.fmt(f),
            Self::NoSuchMotor => f.write_str("the bus has no such motor"),
        }
    }
}

impl core::error::Error for CommandError {}

/// What became of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dispatch {
    /// It was this motor's feedback.
    Motor(MotorId),
    /// It has this motor's identifier, but is no feedback. Counted; nothing changed.
    Malformed(MotorId, FrameError),
    /// No motor claims it, or it is a remote request, which no motor sends. Counted.
    Unclaimed,
}

/// Whether a motor is heard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Link {
    /// No feedback since power-on.
    #[default]
    NeverSeen,
    /// Feedback is fresh.
    Online,
    /// No feedback for max(3 feedback periods, 10 ms).
    Lost,
}

/// What a motor's frames amounted to. `received` starts over after 2³² (49 days at 1 kHz); the
/// others stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct MotorCounters {
    /// Good feedback frames.
    pub received: u32,
    /// Frames with its identifier that were no feedback.
    pub malformed: u32,
    /// Times it went from online to lost.
    pub lost: u32,
    /// Times its command expired while it was armed and online.
    pub expired: u32,
    /// Targets it did not take.
    pub refused: u32,
}

/// What the frames of a bus amounted to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusCounters {
    /// Frames given to [`MotorBus::on_frame`].
    pub received: u32,
    /// Those that had a motor's identifier but were no feedback.
    pub malformed: u32,
    /// Those that no motor claims. Of frames that nobody asked for, a port with filters hands out
    /// a sample only; [`Health::ignored`](rc10_can::Health::ignored) counts the others.
    pub unclaimed: u32,
    /// Key ([`CanFrame::key`]) of the newest frame no motor claims.
    pub last_unclaimed: Option<u32>,
    /// Remote requests: nobody answers them.
    pub remote: u32,
}

/// All there is to know about one motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct MotorStatus {
    /// Whether it is heard.
    pub link: Link,
    /// What the bus let it do in the last tick.
    pub drive: Drive,
    /// The target it has.
    pub target: Target,
    /// What it measured last.
    pub feedback: Feedback,
    /// What is wrong with it, by its own account.
    pub fault: Option<Fault>,
    /// Its counters.
    pub counters: MotorCounters,
}

#[cfg(feature = "embassy")]
impl BusCounters {
    pub(crate) const NEW: Self =
        Self { received: 0, malformed: 0, unclaimed: 0, last_unclaimed: None, remote: 0 };
}

impl MotorStatus {
    /// Of a motor that was never heard.
    pub const NEW: Self = Self {
        link: Link::NeverSeen,
        drive: Drive::Off,
        target: Target::Coast,
        feedback: Feedback::NEW,
        fault: None,
        counters: MotorCounters { received: 0, malformed: 0, lost: 0, expired: 0, refused: 0 },
    };
}

impl<'m> MotorBus<'m> {
    /// Motors that a bus holds. More DJI motors than this fit on no wire, whatever their rate.
    pub const CAPACITY: usize = CAPACITY;

    /// A bus without motors, armed and stopped by `switch`.
    #[must_use]
    pub const fn new(switch: &'m ArmSwitch) -> Self {
        Self {
            switch,
            slots: Vec::new(),
            table: ReceiveTable::new(),
            unclaimed: 0,
            last_unclaimed: None,
            remote: 0,
            last_tick: None,
        }
    }

    /// Adds a motor.
    ///
    /// # Errors
    /// [`AttachError`], naming both motors of a clash; the bus is as it was.
    pub fn attach(
        &mut self,
        motor: &'m mut dyn CanMotor,
        safety: Safety,
    ) -> Result<MotorId, AttachError> {
        let wiring = motor.wiring();
        let name = wiring.name();
        let asked = safety.command_expiry;
        if asked == Micros::ZERO || asked > Safety::LONGEST_EXPIRY {
            return Err(AttachError::Expiry { motor: name, asked });
        }
        for slot in &self.slots {
            let other = slot.motor.wiring();
            if let Some(clash) = wiring.clash(&other) {
                return Err(AttachError::Clash { motor: name, with: other.name(), clash });
            }
        }
        if !self.table.has_room(wiring.received()) {
            return Err(AttachError::TableFull { motor: name });
        }
        let slot = Slot {
            motor,
            heard_at: 0,
            commanded_at: 0,
            link_timeout: micros(wiring.link_timeout()),
            command_expiry: micros(asked),
            safety,
            drive: Drive::Off,
            link: Link::NeverSeen,
            fresh: false,
            faulted: false,
            counters: MotorCounters::default(),
        };
        let full = AttachError::Full { motor: name, capacity: Self::CAPACITY };
        let index = u8::try_from(self.slots.len()).map_err(|_| full)?;
        self.slots.push(slot).map_err(|_| full)?;
        for receive in wiring.received() {
            self.table.insert(receive, index);
        }
        Ok(MotorId(index))
    }

    /// Takes a frame that arrived at `at`; constant time.
    #[inline]
    pub fn on_frame(&mut self, frame: &CanFrame, at: Micros) -> Dispatch {
        // Nearly always the first place looked at is the right one.
        match self.table.find_first(frame) {
            Some(index) => self.hear(index, frame, at),
            None => self.on_other_frame(frame, at),
        }
    }

    #[cold]
    #[inline(never)]
    fn on_other_frame(&mut self, frame: &CanFrame, at: Micros) -> Dispatch {
        if frame.is_remote() {
            count(&mut self.remote);
            return Dispatch::Unclaimed;
        }
        if let Some(index) = self.table.find(frame) {
            return self.hear(index, frame, at);
        }
        count(&mut self.unclaimed);
        self.last_unclaimed = Some(frame.key());
        Dispatch::Unclaimed
    }

    #[inline]
    fn hear(&mut self, index: u8, frame: &CanFrame, at: Micros) -> Dispatch {
        // The table only has indices of motors.
        let Some(slot) = self.slots.get_mut(usize::from(index)) else {
            return Dispatch::Unclaimed;
        };
        let heard = slot.motor.unpack_feedback(frame, at);
        if heard != Ok(Heard::Feedback) {
            return slot.heard_otherwise(MotorId(index), heard, at);
        }
        slot.counters.received = slot.counters.received.wrapping_add(1);
        slot.heard_at = low(at);
        slot.link = Link::Online;
        Dispatch::Motor(MotorId(index))
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
        let slot = self.slots.get_mut(motor.index()).ok_or(CommandError::NoSuchMotor)?;
        if let Err(error) = slot.motor.set_target(target) {
            count(&mut slot.counters.refused);
            return Err(CommandError::Target(error));
        }
        slot.commanded_at = low(now);
        slot.fresh = true;
        Ok(())
    }

    /// Asks something of a motor beside a target.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed.
    pub fn request(&mut self, motor: MotorId, request: Request) -> Result<(), RequestError> {
        let slot = self.slots.get_mut(motor.index()).ok_or(RequestError::NoSuchMotor)?;
        slot.motor.request(request)?;
        if request == Request::ClearFault {
            // If the fault is still there, the motor's next frame says so.
            slot.faulted = false;
        }
        Ok(())
    }

    /// One tick: decides what each motor may do, lets it compute, and adds its frames to `tx`.
    /// `dt` is the time since the last tick: more than 10 ms counts as 10 ms, so that no loop takes a
    /// leap after a pause; what is not above zero counts as 1 ms.
    ///
    /// # Errors
    /// [`TxFull`] if not all frames fit into `tx`; the other motors' frames are in it.
    pub fn tick(&mut self, now: Micros, dt: Seconds, tx: &mut TxBatch) -> Result<(), TxFull> {
        let dt = Seconds::new(if dt.get() > 0.0 { dt.get().min(LONGEST_STEP) } else { 0.001 });
        let last = self.last_tick.replace(now);
        if last.is_some_and(|last| now.since(last) > LONGEST_PAUSE) {
            self.slots.iter_mut().for_each(Slot::forget);
        }
        let arm = self.switch.for_motors();
        let mut outcome = Ok(());
        for slot in &mut self.slots {
            let drive = slot.decide(arm, now);
            slot.motor.update(dt, drive);
            if let Err(full) = slot.motor.pack_command(tx) {
                outcome = Err(full);
            }
        }
        outcome
    }

    /// The frames that leave every motor without torque: for a panic handler to keep.
    ///
    /// # Errors
    /// [`TxFull`] if not all fit.
    pub fn coast_image(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.slots.iter().try_for_each(|slot| slot.motor.coast_frames(tx))
    }

    /// How much of a bus of `bits_per_second` the attached motors need.
    #[must_use]
    pub fn load(&self, bits_per_second: u32) -> BusLoad {
        BusLoad::of(self.slots.iter().map(|slot| slot.motor.wiring()), bits_per_second)
    }

    /// The motors attached, in order.
    pub fn motors(&self) -> impl Iterator<Item = (MotorId, MotorName)> {
        (0..).map(MotorId).zip(self.slots.iter().map(|slot| slot.motor.wiring().name()))
    }

    /// The attached motors' numbers, in order.
    pub fn ids(&self) -> impl Iterator<Item = MotorId> + use<> {
        (0..).take(self.slots.len()).map(MotorId)
    }

    /// What each motor occupies, in order. One after the other: all at once they would take a large
    /// part of a chip's stack.
    pub fn for_each_wiring(&self, mut f: impl FnMut(&Wiring)) {
        for slot in &self.slots {
            f(&slot.motor.wiring());
        }
    }

    /// What targets a motor takes; none for a motor that does not exist.
    #[must_use]
    pub fn supports(&self, motor: MotorId) -> TargetSet {
        self.slots.get(motor.index()).map_or(TargetSet::NONE, |slot| slot.motor.supports())
    }

    /// All there is to know about a motor.
    #[must_use]
    pub fn status(&self, motor: MotorId, now: Micros) -> Option<MotorStatus> {
        let slot = self.slots.get(motor.index())?;
        let mut status = MotorStatus::NEW;
        slot.write_status(now, &mut status);
        Some(status)
    }

    /// The same, written where it is wanted: every tick for every motor. Nothing for a motor that
    /// does not exist.
    #[cfg(feature = "embassy")]
    #[inline]
    pub(crate) fn write_status(&self, motor: MotorId, now: Micros, status: &mut MotorStatus) {
        if let Some(slot) = self.slots.get(motor.index()) {
            slot.write_status(now, status);
        }
    }

    /// What the frames of this bus amounted to.
    #[must_use]
    pub fn counters(&self) -> BusCounters {
        let mut sum = BusCounters {
            received: self.unclaimed.saturating_add(self.remote),
            malformed: 0,
            unclaimed: self.unclaimed,
            last_unclaimed: self.last_unclaimed,
            remote: self.remote,
        };
        for MotorCounters { received, malformed, .. } in self.slots.iter().map(|slot| slot.counters)
        {
            sum.received = sum.received.saturating_add(received).saturating_add(malformed);
            sum.malformed = sum.malformed.saturating_add(malformed);
        }
        sum
    }

    /// The switch that arms this bus.
    #[must_use]
    pub const fn switch(&self) -> &'m ArmSwitch {
        self.switch
    }
}

impl Slot<'_> {
    /// A frame of the motor was something else than its plain feedback.
    #[cold]
    fn heard_otherwise(
        &mut self,
        motor: MotorId,
        heard: Result<Heard, FrameError>,
        at: Micros,
    ) -> Dispatch {
        let heard = match heard {
            Ok(heard) => heard,
            Err(error) => {
                count(&mut self.counters.malformed);
                return Dispatch::Malformed(motor, error);
            }
        };
        self.counters.received = self.counters.received.wrapping_add(1);
        if heard != Heard::Other {
            (self.heard_at, self.link) = (low(at), Link::Online);
        }
        if heard == Heard::Fault {
            self.faulted = true;
            // The next tick decides afresh.
            self.drive = Drive::Off;
        }
        Dispatch::Motor(motor)
    }

    /// Nothing from before a long pause holds any more.
    fn forget(&mut self) {
        self.fresh = false;
        self.drive = Drive::Off;
        if self.link == Link::Online {
            self.link = Link::Lost;
            count(&mut self.counters.lost);
        }
    }

    #[inline]
    fn write_status(&self, now: Micros, status: &mut MotorStatus) {
        status.link = self.link(now);
        status.drive = self.drive;
        status.target = self.motor.target();
        status.feedback = self.motor.feedback();
        status.fault = self.motor.fault();
        status.counters = self.counters;
    }

    fn is_online(&self, now: Micros) -> bool {
        self.link == Link::Online && since(self.heard_at, now) <= self.link_timeout
    }

    fn link(&self, now: Micros) -> Link {
        match self.link {
            Link::Online if !self.is_online(now) => Link::Lost,
            link => link,
        }
    }

    /// What the motor may do now. This and [`change`](Self::change) are the one place where motors
    /// are stopped.
    #[inline]
    fn decide(&mut self, arm: ArmState, now: Micros) -> Drive {
        if arm == ArmState::Armed
            && self.drive == Drive::Run
            && since(self.heard_at, now) <= self.link_timeout
            && since(self.commanded_at, now) < self.command_expiry
        {
            return Drive::Run;
        }
        self.change(arm, now)
    }

    /// What the motor may do when it does not simply go on running.
    #[cold]
    fn change(&mut self, arm: ArmState, now: Micros) -> Drive {
        let online = self.is_online(now);
        let fresh = self.fresh && since(self.commanded_at, now) < self.command_expiry;
        let drive = match arm {
            ArmState::Disarmed => Drive::Off,
            _ if !online => Drive::Coast,
            ArmState::Armed if fresh && !self.faulted => Drive::Run,
            ArmState::Armed | ArmState::EStopped => self.safety.state.drive(),
        };
        if self.link == Link::Online && !online {
            self.link = Link::Lost;
            count(&mut self.counters.lost);
        } else if self.drive == Drive::Run && arm == ArmState::Armed && !fresh {
            count(&mut self.counters.expired);
        }
        (self.drive, self.fresh) = (drive, fresh);
        drive
    }
}

/// The low half of a time.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "the low half is what is wanted")]
const fn low(time: Micros) -> u32 {
    time.get() as u32
}

/// Microseconds from a time kept by its low half to `now`, and [`SKEW`]: a time a little in the
/// future is fresh, one further off is old. Right for an hour, and no tick is later than a second.
#[inline]
const fn since(earlier: u32, now: Micros) -> u32 {
    low(now).wrapping_sub(earlier.wrapping_sub(SKEW))
}

/// A time-out as a number of microseconds to compare [`since`] with; half an hour at most.
fn micros(time: Micros) -> u32 {
    u32::try_from(time.get()).unwrap_or(u32::MAX).min(u32::MAX / 2).saturating_add(SKEW)
}

#[inline]
const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Dji, M3508};
    use embedded_can::StandardId;
    use rc10_app::Rpm;
    use rc10_can::IdPattern;

    const MS: Seconds = Seconds::new(0.001);

    /// A motor that says of itself whatever byte 0 tells it to.
    struct Talker {
        drive: Drive,
    }

    impl crate::motor::Motor for Talker {
        fn supports(&self) -> TargetSet {
            TargetSet::of(&[crate::TargetKind::Coast, crate::TargetKind::Speed])
        }
        fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
            self.supports().accepts(&target)
        }
        fn target(&self) -> Target {
            Target::Coast
        }
        /// Tells as its speed what it was allowed to do.
        fn feedback(&self) -> Feedback {
            Feedback { speed: Rpm::new(f32::from(self.drive as u8)), ..Feedback::NEW }
        }
        fn fault(&self) -> Option<Fault> {
            None
        }
        fn update(&mut self, _: Seconds, drive: Drive) {
            self.drive = drive;
        }
        fn request(&mut self, _: Request) -> Result<(), RequestError> {
            Ok(())
        }
    }

    impl CanMotor for Talker {
        fn wiring(&self) -> crate::Wiring {
            let pattern = IdPattern::exact(StandardId::new(0x10).unwrap());
            let rate = crate::Rate::EveryTick;
            let receive = crate::Receive { pattern, len: 1, rate, guard: None };
            crate::Wiring::new("talker", 1).receives(receive).unwrap()
        }
        fn unpack_feedback(&mut self, frame: &CanFrame, _: Micros) -> Result<Heard, FrameError> {
            match frame.bytes() {
                [0] => Ok(Heard::Feedback),
                [1] => Ok(Heard::Fault),
                [2] => Ok(Heard::Other),
                _ => Err(FrameError::Length),
            }
        }
        fn pack_command(&mut self, _: &mut TxBatch) -> Result<(), TxFull> {
            Ok(())
        }
        fn coast_frames(&self, _: &mut TxBatch) -> Result<(), TxFull> {
            Ok(())
        }
    }

    fn says(byte: u8) -> CanFrame {
        CanFrame::data_frame(StandardId::new(0x10).unwrap(), &[byte]).unwrap()
    }

    /// One tick with a frame and a fresh command; what the motor was allowed.
    fn tick(bus: &mut MotorBus<'_>, now: u64, byte: Option<u8>) -> (Drive, Link) {
        let now = Micros::from_millis(now);
        if let Some(byte) = byte {
            bus.on_frame(&says(byte), now);
        }
        bus.command(MotorId(0), Target::Speed(Rpm::new(1.0)), now).unwrap();
        bus.tick(now, MS, &mut TxBatch::new()).unwrap();
        let status = bus.status(MotorId(0), now).unwrap();
        let told = status.feedback.speed;
        assert_eq!(told, Rpm::new(f32::from(status.drive as u8)), "the motor was told otherwise");
        (status.drive, status.link)
    }

    #[test]
    fn a_fault_stops_the_motor_until_it_is_cleared() {
        let switch = ArmSwitch::new();
        let mut talker = Talker { drive: Drive::Off };
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut talker, Safety::BRAKE).unwrap();
        switch.arm().unwrap();
        assert_eq!(tick(&mut bus, 1, Some(0)), (Drive::Run, Link::Online));
        assert_eq!(tick(&mut bus, 2, Some(1)), (Drive::Brake, Link::Online));
        // That the fault goes by itself is not enough.
        assert_eq!(tick(&mut bus, 3, Some(0)), (Drive::Brake, Link::Online));
        bus.request(MotorId(0), Request::ClearFault).unwrap();
        assert_eq!(tick(&mut bus, 4, Some(0)), (Drive::Run, Link::Online));
        assert_eq!(bus.status(MotorId(0), Micros::ZERO).unwrap().counters.expired, 0);
    }

    #[test]
    fn a_reply_that_is_no_feedback_does_not_keep_the_link_alive() {
        let switch = ArmSwitch::new();
        let mut talker = Talker { drive: Drive::Off };
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut talker, Safety::HOLD).unwrap();
        switch.arm().unwrap();
        assert_eq!(tick(&mut bus, 1, Some(2)), (Drive::Coast, Link::NeverSeen));
        assert_eq!(tick(&mut bus, 2, Some(0)), (Drive::Run, Link::Online));
        for now in 3..=12 {
            assert_eq!(tick(&mut bus, now, Some(2)).1, Link::Online);
        }
        assert_eq!(tick(&mut bus, 13, Some(2)), (Drive::Coast, Link::Lost));
        // A motor once lost stays lost, also when the low half of the time has gone round.
        for millis in [4_294_967_u64, 4_294_972, 4_294_980] {
            assert_eq!(tick(&mut bus, millis, None), (Drive::Coast, Link::Lost));
        }
        let counters = bus.status(MotorId(0), Micros::ZERO).unwrap().counters;
        assert_eq!((counters.lost, counters.received), (1, 13));
    }

    #[test]
    fn a_frame_that_arrives_during_the_tick_is_not_old() {
        let switch = ArmSwitch::new();
        let mut talker = Talker { drive: Drive::Off };
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut talker, Safety::COAST).unwrap();
        switch.arm().unwrap();
        let now = Micros::from_millis(5);
        bus.on_frame(&says(0), now + Micros::new(40));
        bus.command(MotorId(0), Target::Coast, now).unwrap();
        bus.tick(now, MS, &mut TxBatch::new()).unwrap();
        assert_eq!(bus.status(MotorId(0), now).unwrap().drive, Drive::Run);
    }

    #[test]
    fn refusals_and_strangers_are_counted() {
        let switch = ArmSwitch::new();
        let mut talker = Talker { drive: Drive::Off };
        let mut bus = MotorBus::new(&switch);
        let motor = bus.attach(&mut talker, Safety::COAST).unwrap();
        assert!(bus.command(motor, Target::Duty(0.5), Micros::ZERO).is_err());
        let nobody = bus.command(MotorId(5), Target::Coast, Micros::ZERO);
        assert_eq!(nobody, Err(CommandError::NoSuchMotor));
        let stranger = CanFrame::data_frame(StandardId::new(0x55).unwrap(), &[]).unwrap();
        assert_eq!(bus.on_frame(&stranger, Micros::ZERO), Dispatch::Unclaimed);
        let wrong = Dispatch::Malformed(motor, FrameError::Length);
        assert_eq!(bus.on_frame(&says(9), Micros::ZERO), wrong);
        let counters = bus.counters();
        assert_eq!((counters.received, counters.malformed, counters.unclaimed), (2, 1, 1));
        assert_eq!(counters.last_unclaimed, Some(0x55));
        assert_eq!(bus.status(motor, Micros::ZERO).unwrap().counters.refused, 1);
    }

    #[test]
    fn an_expiry_that_is_none_is_refused() {
        let switch = ArmSwitch::new();
        for micros in [0, 1_000_001] {
            let mut wheel = Dji::new(&M3508, 1).unwrap();
            let mut bus = MotorBus::new(&switch);
            let safety = Safety { command_expiry: Micros::new(micros), ..Safety::COAST };
            let refused = bus.attach(&mut wheel, safety);
            assert!(matches!(refused, Err(AttachError::Expiry { .. })));
        }
    }
}
