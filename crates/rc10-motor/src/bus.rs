use core::ops::{Deref, DerefMut};

use rc10_app::Seconds;
use rc10_can::CanFrame;
use rc10_time::Micros;

#[cfg(feature = "embassy")]
use crate::arm::Unfit;
use crate::arm::{ArmSwitch, Seen};
use crate::batch::{TxBatch, TxFull};
use crate::can_ids::CanIds;
#[cfg(feature = "embassy")]
use crate::load::Verdict;
use crate::load::{BusLoad, LoadSum};
use crate::motor::{CanMotor, FrameError};
use crate::motors::{AttachError, MotorId, Motors};
use crate::supervision::{Safety, count};
use crate::table::ReceiveTable;

/// The motors of one CAN bus, and what keeps them safe.
///
/// Plain synchronous functions; the time comes in as an argument. Every tick: give it the received
/// frames ([`on_frame`](Self::on_frame)) and the newest targets ([`command`](Motors::command)), then
/// [`tick`](Self::tick) fills the frames to send. What it has in common with a bus on RS-485 is that
/// of its [`Motors`].
pub struct MotorBus<'m> {
    motors: CanMotors<'m>,
    table: ReceiveTable,
    counters: BusCounters,
    /// Whether it runs even if its motors do not fit on it.
    overload_allowed: bool,
}

type CanMotors<'m> = Motors<'m, dyn CanMotor + 'm, CAPACITY>;

const CAPACITY: usize = 8;

/// The result of a received frame: the motor that it belongs to, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dispatch {
    /// This motor's feedback.
    Motor(MotorId),
    /// This motor's answer to a request that was not made here. Counted; nothing changed.
    Unasked(MotorId),
    /// A frame with this motor's identifier that is no feedback. Counted; nothing changed.
    Malformed(MotorId, FrameError),
    /// No motor claims it, or it is a remote request, which no motor sends. Counted.
    Unclaimed,
}

/// Counters of the frames that a bus received, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct BusCounters {
    /// Frames given to [`MotorBus::on_frame`].
    pub received: u32,
    /// Those that had a motor's identifier but were no feedback.
    pub malformed: u32,
    /// Those that no motor claims. Of unwanted frames, a port with filters hands out
    /// a sample only; [`Health::ignored`](rc10_can::Health::ignored) counts the others.
    pub unclaimed: u32,
    /// Key ([`CanFrame::key`]) of the newest frame no motor claims.
    pub last_unclaimed: Option<u32>,
    /// Remote requests, which no motor answers.
    pub remote: u32,
}

impl BusCounters {
    pub(crate) const NEW: Self =
        Self { received: 0, malformed: 0, unclaimed: 0, last_unclaimed: None, remote: 0 };
}

impl<'m> Deref for MotorBus<'m> {
    type Target = CanMotors<'m>;

    #[inline]
    fn deref(&self) -> &Self::Target {
        &self.motors
    }
}

impl DerefMut for MotorBus<'_> {
    #[inline]
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.motors
    }
}

impl<'m> MotorBus<'m> {
    /// Motors that a bus holds. More DJI motors than this fit on no wire, whatever their rate.
    pub const CAPACITY: usize = CAPACITY;

    /// A bus without motors, armed and stopped by `switch`.
    pub const fn new(switch: &'m ArmSwitch) -> Self {
        Self {
            motors: Motors::new(switch),
            table: ReceiveTable::new(),
            counters: BusCounters::NEW,
            overload_allowed: false,
        }
    }

    /// Lets the robot be armed although its motors do not fit on the bus: frames will be lost.
    pub const fn allow_overload(&mut self) {
        self.overload_allowed = true;
    }

    /// Adds a motor.
    ///
    /// # Errors
    /// [`AttachError`], naming both motors of a clash; the bus is as it was.
    pub fn attach(
        &mut self,
        motor: &'m mut (dyn CanMotor + 'm),
        safety: Safety,
    ) -> Result<MotorId, AttachError> {
        let (ids, name) = (motor.can_ids(), motor.name());
        if !ids.is_complete() {
            return Err(AttachError::TooManyIds { motor: name });
        }
        for (other, slot) in self.motors.iter().zip(self.motors.ids()) {
            if let Some(clash) = ids.clash(&other.can_ids()) {
                return Err(AttachError::Clash { motor: name, with: other.name(), slot, clash });
            }
        }
        if !self.table.has_room(ids.received()) {
            return Err(AttachError::TableFull { motor: name });
        }
        let motor = self.motors.attach(motor, safety, ids.link_timeout())?;
        for frames in ids.received() {
            self.table.insert(frames, motor);
        }
        Ok(motor)
    }

    /// Takes a frame that arrived at `at`; constant time.
    #[inline]
    pub fn on_frame(&mut self, frame: &CanFrame, at: Micros) -> Dispatch {
        self.counters.received = self.counters.received.wrapping_add(1);
        // Nearly always the first place looked at is the right one.
        match self.table.find_first(frame) {
            Some(motor) => self.hear(motor, frame, at),
            None => self.on_other_frame(frame, at),
        }
    }

    #[cold] // Not one of the usual frames, which have a straight way.
    fn on_other_frame(&mut self, frame: &CanFrame, at: Micros) -> Dispatch {
        if frame.is_remote() {
            count(&mut self.counters.remote);
            return Dispatch::Unclaimed;
        }
        if let Some(motor) = self.table.find(frame) {
            return self.hear(motor, frame, at);
        }
        count(&mut self.counters.unclaimed);
        self.counters.last_unclaimed = Some(frame.key());
        Dispatch::Unclaimed
    }

    #[inline]
    fn hear(&mut self, motor: MotorId, frame: &CanFrame, at: Micros) -> Dispatch {
        let heard = self.motors.hear(motor, at, |it, link| it.unpack_feedback(frame, at, link));
        match heard {
            Some(Ok(())) => Dispatch::Motor(motor),
            Some(Err(FrameError::Unasked)) => Dispatch::Unasked(motor),
            Some(Err(error)) => {
                count(&mut self.counters.malformed);
                Dispatch::Malformed(motor, error)
            }
            // The table only has motors of this bus.
            None => Dispatch::Unclaimed,
        }
    }

    /// The load on a bus of `bits_per_second`. If it does not fit, the robot cannot be armed.
    #[cfg(feature = "embassy")]
    pub(crate) fn check_load(&self, bits_per_second: u32) -> BusLoad {
        let load = self.load(bits_per_second);
        if load.verdict() == Verdict::DoesNotFit && !self.overload_allowed {
            self.switch().forbid(Unfit::Overload);
        }
        load
    }

    /// One tick: decides what each motor may do, lets it compute, and adds its frames to `tx`. `dt`
    /// since the last tick: 10 ms at most, so that no loop leaps; 1 ms if not above zero.
    ///
    /// # Errors
    /// [`TxFull`] if not all frames fit into `tx`; the other motors' frames are in it.
    pub fn tick(&mut self, now: Micros, dt: Seconds, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.tick_as(self.switch().seen(), now, dt, tx)
    }

    pub(crate) fn tick_as(
        &mut self,
        seen: Seen,
        now: Micros,
        dt: Seconds,
        tx: &mut TxBatch,
    ) -> Result<(), TxFull> {
        let mut outcome = Ok(());
        self.motors.tick(seen, now, dt, |_, motor, _| {
            if let Err(full) = motor.pack_command(tx) {
                outcome = Err(full);
            }
        });
        outcome
    }

    /// The frames that leave every motor without torque, if all fit: for a panic handler to keep.
    pub fn coast_image(&self, tx: &mut TxBatch) -> Result<(), TxFull> {
        self.motors.iter().try_for_each(|motor| motor.coast_frames(tx))
    }

    /// The share of a bus of `bits_per_second` that the attached motors need.
    pub fn load(&self, bits_per_second: u32) -> BusLoad {
        let mut sum = LoadSum::new(bits_per_second);
        self.for_each_can_ids(|ids| sum.add(ids));
        sum.load
    }

    /// Each motor's identifiers, in order: all at once would take much of a chip's stack.
    pub fn for_each_can_ids(&self, mut f: impl FnMut(&CanIds)) {
        self.motors.iter().for_each(|motor| f(&motor.can_ids()));
    }

    #[cfg(feature = "record")]
    pub(crate) const fn set_counters(&mut self, counters: BusCounters) {
        self.counters = counters;
    }

    /// Counters of the frames that this bus received.
    pub const fn counters(&self) -> BusCounters {
        self.counters
    }
}
