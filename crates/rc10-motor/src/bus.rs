use core::fmt;

use heapless::Vec;
use rc10_app::Seconds;
use rc10_can::{CanFrame, Micros};

use crate::arm::ArmSwitch;
#[cfg(feature = "embassy")]
use crate::arm::Unfit;
use crate::batch::{TxBatch, TxFull};
use crate::load::BusLoad;
#[cfg(feature = "embassy")]
use crate::load::Verdict;
use crate::motor::{
    CanMotor, FrameError, FrameKind, Loops, Request, RequestError, Response, Target, TargetError,
    TargetSet,
};
use crate::supervision::{LONGEST_PAUSE, MotorStatus, Safety, Supervision, sound_step};
use crate::table::ReceiveTable;
use crate::wiring::{CanIds, Clash, MotorName};

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
    counters: BusCounters,
    last_tick: Option<Micros>,
    /// It runs even if its motors do not fit on it.
    overload_allowed: bool,
}

/// See [`MotorBus::CAPACITY`].
const CAPACITY: usize = 8;

struct Slot<'m> {
    motor: &'m mut dyn CanMotor,
    watch: Supervision,
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
    /// It was this motor's answer to a request that was not made here. Counted; nothing changed.
    Unasked(MotorId),
    /// It has this motor's identifier, but is no feedback. Counted; nothing changed.
    Malformed(MotorId, FrameError),
    /// No motor claims it, or it is a remote request, which no motor sends. Counted.
    Unclaimed,
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

impl BusCounters {
    pub(crate) const NEW: Self =
        Self { received: 0, malformed: 0, unclaimed: 0, last_unclaimed: None, remote: 0 };
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
            counters: BusCounters::NEW,
            last_tick: None,
            overload_allowed: false,
        }
    }

    /// Lets the robot be armed even if the motors of this bus do not fit on it: without this a
    /// runner forbids that ([`Unfit::Overload`]). Frames will be lost, and motors with them.
    pub const fn allow_overload(&mut self) {
        self.overload_allowed = true;
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
        if !safety.is_valid() {
            return Err(AttachError::Expiry { motor: name, asked: safety.command_expiry });
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
        let slot = Slot { motor, watch: Supervision::new(safety, wiring.link_timeout()) };
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
        self.counters.received = self.counters.received.wrapping_add(1);
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
            count(&mut self.counters.remote);
            return Dispatch::Unclaimed;
        }
        if let Some(index) = self.table.find(frame) {
            return self.hear(index, frame, at);
        }
        count(&mut self.counters.unclaimed);
        self.counters.last_unclaimed = Some(frame.key());
        Dispatch::Unclaimed
    }

    #[inline]
    fn hear(&mut self, index: u8, frame: &CanFrame, at: Micros) -> Dispatch {
        // The table only has indices of motors.
        let Some(slot) = self.slots.get_mut(usize::from(index)) else {
            return Dispatch::Unclaimed;
        };
        let heard = slot.motor.unpack_feedback(frame, at);
        if heard == Ok(FrameKind::Feedback) {
            slot.watch.heard_feedback(at);
            return Dispatch::Motor(MotorId(index));
        }
        match slot.watch.heard(heard, at) {
            Ok(()) => Dispatch::Motor(MotorId(index)),
            Err(FrameError::Unasked) => Dispatch::Unasked(MotorId(index)),
            Err(error) => {
                count(&mut self.counters.malformed);
                Dispatch::Malformed(MotorId(index), error)
            }
        }
    }

    /// What its motors need of a bus of `bits_per_second`. If that does not fit, the robot is not
    /// armed until the next start.
    #[cfg(feature = "embassy")]
    pub(crate) fn check_load(&self, bits_per_second: u32) -> BusLoad {
        let load = self.load(bits_per_second);
        if load.verdict() == Verdict::DoesNotFit && !self.overload_allowed {
            self.switch.forbid(Unfit::Overload);
        }
        load
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
        slot.watch.command(&mut *slot.motor, target, now).map_err(CommandError::Target)
    }

    /// Asks something of a motor beside a target. After [`Response::Pending`] its
    /// [`answer`](Self::answer) is to be asked for after each tick.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed.
    pub fn request(&mut self, motor: MotorId, request: Request) -> Result<Response, RequestError> {
        let slot = self.slots.get_mut(motor.index()).ok_or(RequestError::NoSuchMotor)?;
        slot.watch.request(&mut *slot.motor, request)
    }

    /// How a request went that was [`Pending`](Response::Pending), once that is known; told once.
    pub fn answer(&mut self, motor: MotorId) -> Option<Result<Response, RequestError>> {
        let slot = self.slots.get_mut(motor.index())?;
        slot.watch.answer(&mut *slot.motor)
    }

    /// One tick: decides what each motor may do, lets it compute, and adds its frames to `tx`.
    /// `dt` is the time since the last tick: more than 10 ms counts as 10 ms, so that no loop takes a
    /// leap after a pause; what is not above zero counts as 1 ms.
    ///
    /// # Errors
    /// [`TxFull`] if not all frames fit into `tx`; the other motors' frames are in it.
    pub fn tick(&mut self, now: Micros, dt: Seconds, tx: &mut TxBatch) -> Result<(), TxFull> {
        let dt = sound_step(dt);
        let last = self.last_tick.replace(now);
        if last.is_some_and(|last| now.since(last) > LONGEST_PAUSE) {
            self.slots.iter_mut().for_each(|slot| slot.watch.forget());
        }
        let arm = self.switch.for_motors();
        let mut outcome = Ok(());
        for slot in &mut self.slots {
            let drive = slot.watch.decide(arm, now);
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
    pub fn for_each_wiring(&self, mut f: impl FnMut(&CanIds)) {
        for slot in &self.slots {
            f(&slot.motor.wiring());
        }
    }

    /// What targets a motor takes; none for a motor that does not exist.
    #[must_use]
    pub fn supports(&self, motor: MotorId) -> TargetSet {
        self.slots.get(motor.index()).map_or(TargetSet::NONE, |slot| slot.motor.supports())
    }

    /// The control loops of a motor, where they run here; `None` also for a motor that does not
    /// exist.
    #[must_use]
    pub fn loops(&self, motor: MotorId) -> Option<Loops> {
        self.slots.get(motor.index()).and_then(|slot| slot.motor.loops())
    }

    /// All there is to know about a motor.
    #[must_use]
    pub fn status(&self, motor: MotorId, now: Micros) -> Option<MotorStatus> {
        let slot = self.slots.get(motor.index())?;
        let mut status = MotorStatus::NEW;
        slot.watch.write_status(&*slot.motor, now, &mut status);
        Some(status)
    }

    /// The same, written where it is wanted: every tick for every motor. Nothing for a motor that
    /// does not exist.
    #[cfg(feature = "embassy")]
    #[inline]
    pub(crate) fn write_status(&self, motor: MotorId, now: Micros, status: &mut MotorStatus) {
        if let Some(slot) = self.slots.get(motor.index()) {
            slot.watch.write_status(&*slot.motor, now, status);
        }
    }

    /// What the frames of this bus amounted to.
    #[must_use]
    pub const fn counters(&self) -> BusCounters {
        self.counters
    }

    /// The switch that arms this bus.
    #[must_use]
    pub const fn switch(&self) -> &'m ArmSwitch {
        self.switch
    }
}

#[inline]
const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dji::{Dji, M3508};
    use crate::motor::{DriveMode, Fault, Feedback};
    use crate::supervision::Link;
    use embedded_can::StandardId;
    use rc10_app::Rpm;
    use rc10_can::IdPattern;

    const MS: Seconds = Seconds::new(0.001);

    /// A motor that says of itself whatever byte 0 tells it to.
    #[derive(Default)]
    struct Talker {
        drive: DriveMode,
        /// Whether it first asks its device.
        asks: bool,
        answer: Option<Result<Response, RequestError>>,
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
            let mut told = Feedback::NEW;
            told.speed = Rpm::new(f32::from(self.drive as u8));
            told
        }
        fn fault(&self) -> Option<Fault> {
            None
        }
        fn update(&mut self, _: Seconds, drive: DriveMode) {
            self.drive = drive;
        }
        fn request(&mut self, _: Request) -> Result<Response, RequestError> {
            Ok(if self.asks { Response::Pending } else { Response::Done })
        }
        fn answer(&mut self) -> Option<Result<Response, RequestError>> {
            self.answer.take()
        }
    }

    impl CanMotor for Talker {
        fn wiring(&self) -> crate::CanIds {
            let pattern = IdPattern::exact(StandardId::new(0x10).unwrap());
            let rate = crate::Rate::EveryTick;
            let receive = crate::RxFrames { pattern, len: 1, rate, guard: None };
            crate::CanIds::new("talker", 1).receives(receive).unwrap()
        }
        fn unpack_feedback(
            &mut self,
            frame: &CanFrame,
            _: Micros,
        ) -> Result<FrameKind, FrameError> {
            match frame.bytes() {
                [0] => Ok(FrameKind::Feedback),
                [1] => Ok(FrameKind::Fault),
                [2] => Ok(FrameKind::Other),
                [3] => {
                    self.answer = Some(Ok(Response::Done));
                    Ok(FrameKind::Feedback)
                }
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
    fn tick(bus: &mut MotorBus<'_>, now: u64, byte: Option<u8>) -> (DriveMode, Link) {
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
        let mut talker = Talker::default();
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut talker, Safety::BRAKE).unwrap();
        switch.arm().unwrap();
        assert_eq!(tick(&mut bus, 1, Some(0)), (DriveMode::Run, Link::Online));
        assert_eq!(tick(&mut bus, 2, Some(1)), (DriveMode::Brake, Link::Online));
        // That the fault goes by itself is not enough.
        assert_eq!(tick(&mut bus, 3, Some(0)), (DriveMode::Brake, Link::Online));
        bus.request(MotorId(0), Request::ClearFault).unwrap();
        assert_eq!(tick(&mut bus, 4, Some(0)), (DriveMode::Run, Link::Online));
        assert_eq!(bus.status(MotorId(0), Micros::ZERO).unwrap().counters.expired, 0);
    }

    #[test]
    fn a_fault_is_cleared_when_the_device_says_so_and_not_before() {
        let switch = ArmSwitch::new();
        let mut talker = Talker { asks: true, ..Talker::default() };
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut talker, Safety::COAST).unwrap();
        switch.arm().unwrap();
        assert_eq!(tick(&mut bus, 1, Some(1)), (DriveMode::Coast, Link::Online));
        assert_eq!(bus.request(MotorId(0), Request::ClearFault), Ok(Response::Pending));
        assert_eq!(bus.answer(MotorId(0)), None);
        // A frame that was on its way still tells of the fault, and it is gone with the answer.
        assert_eq!(tick(&mut bus, 2, Some(1)), (DriveMode::Coast, Link::Online));
        assert_eq!(tick(&mut bus, 3, Some(3)), (DriveMode::Coast, Link::Online));
        assert_eq!(bus.answer(MotorId(0)), Some(Ok(Response::Done)));
        assert_eq!(bus.answer(MotorId(0)), None);
        assert_eq!(tick(&mut bus, 4, Some(0)), (DriveMode::Run, Link::Online));
    }

    #[test]
    fn a_reply_that_is_no_feedback_does_not_keep_the_link_alive() {
        let switch = ArmSwitch::new();
        let mut talker = Talker::default();
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut talker, Safety::HOLD).unwrap();
        switch.arm().unwrap();
        assert_eq!(tick(&mut bus, 1, Some(2)), (DriveMode::Coast, Link::NeverSeen));
        assert_eq!(tick(&mut bus, 2, Some(0)), (DriveMode::Run, Link::Online));
        for now in 3..=12 {
            assert_eq!(tick(&mut bus, now, Some(2)).1, Link::Online);
        }
        assert_eq!(tick(&mut bus, 13, Some(2)), (DriveMode::Coast, Link::Lost));
        // A motor once lost stays lost, also when the low half of the time has gone round.
        for millis in [4_294_967_u64, 4_294_972, 4_294_980] {
            assert_eq!(tick(&mut bus, millis, None), (DriveMode::Coast, Link::Lost));
        }
        let counters = bus.status(MotorId(0), Micros::ZERO).unwrap().counters;
        assert_eq!((counters.lost, counters.received), (1, 13));
    }

    #[test]
    fn a_frame_that_arrives_during_the_tick_is_not_old() {
        let switch = ArmSwitch::new();
        let mut talker = Talker::default();
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut talker, Safety::COAST).unwrap();
        switch.arm().unwrap();
        let now = Micros::from_millis(5);
        bus.on_frame(&says(0), now + Micros::new(40));
        bus.command(MotorId(0), Target::Coast, now).unwrap();
        bus.tick(now, MS, &mut TxBatch::new()).unwrap();
        assert_eq!(bus.status(MotorId(0), now).unwrap().drive, DriveMode::Run);
    }

    #[test]
    fn refusals_and_strangers_are_counted() {
        let switch = ArmSwitch::new();
        let mut talker = Talker::default();
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
        assert_eq!(bus.status(motor, Micros::ZERO).unwrap().counters.refused.total(), 1);
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
