use core::fmt;

use heapless::Vec;
use rc10_app::Seconds;
use rc10_can::{CanFrame, IdPattern, Micros};

use crate::arm::{ArmState, ArmSwitch};
use crate::batch::{TxBatch, TxFull};
use crate::load::BusLoad;
use crate::motor::{
    CanMotor, Drive, Fault, Feedback, FrameError, Request, RequestError, SafeState, Target,
    TargetError, TargetSet,
};
use crate::table::ReceiveTable;
use crate::wiring::{Clash, MotorName};

/// The motors of one CAN bus, and what keeps them safe.
///
/// Plain synchronous functions; the time comes in as an argument. Every tick: give it the received
/// frames ([`on_frame`](Self::on_frame)) and the newest targets ([`command`](Self::command)), then
/// [`tick`](Self::tick) fills the frames to send.
///
/// No motor can opt out of: no torque until the [`ArmSwitch`] is armed; its safe state when
/// commands stop coming; no torque when its feedback is lost; its safe state while the emergency
/// stop is latched.
pub struct MotorBus<'m, const N: usize = 8> {
    switch: &'m ArmSwitch,
    slots: Vec<Slot<'m>, N>,
    table: ReceiveTable,
    counters: BusCounters,
}

struct Slot<'m> {
    motor: &'m mut dyn CanMotor,
    last_seen: Option<Micros>,
    link_timeout: Micros,
    valid_until: Option<Micros>,
    safety: Safety,
    drive: Drive,
    online: bool,
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
    /// No motor claims it. Counted.
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

/// What a motor's frames amounted to. Counters stay at their largest value instead of wrapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotorCounters {
    /// Good feedback frames.
    pub received: u32,
    /// Frames with its identifier that were no feedback.
    pub malformed: u32,
    /// Times it went from online to lost.
    pub lost: u32,
    /// Times its command expired while it was armed and online.
    pub expired: u32,
}

/// What the frames of a bus amounted to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusCounters {
    /// Frames given to [`MotorBus::on_frame`].
    pub received: u32,
    /// Those that had a motor's identifier but were no feedback.
    pub malformed: u32,
    /// Those that no motor claims.
    pub unclaimed: u32,
    /// Key ([`CanFrame::key`]) of the newest frame no motor claims.
    pub last_unclaimed: Option<u32>,
}

/// All there is to know about one motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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

impl BusCounters {
    pub(crate) const NEW: Self =
        Self { received: 0, malformed: 0, unclaimed: 0, last_unclaimed: None };
}

impl MotorStatus {
    /// Of a motor that was never heard.
    pub const NEW: Self = Self {
        link: Link::NeverSeen,
        drive: Drive::Off,
        target: Target::Coast,
        feedback: Feedback::NEW,
        fault: None,
        counters: MotorCounters { received: 0, malformed: 0, lost: 0, expired: 0 },
    };
}

impl<'m, const N: usize> MotorBus<'m, N> {
    /// A bus without motors, armed and stopped by `switch`.
    #[must_use]
    pub const fn new(switch: &'m ArmSwitch) -> Self {
        Self { switch, slots: Vec::new(), table: ReceiveTable::new(), counters: BusCounters::NEW }
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
            last_seen: None,
            link_timeout: wiring.link_timeout(),
            valid_until: None,
            safety,
            drive: Drive::Off,
            online: false,
            counters: MotorCounters::default(),
        };
        let full = AttachError::Full { motor: name, capacity: N };
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
        count(&mut self.counters.received);
        let owner = self.table.find(frame);
        let Some((index, slot)) =
            owner.and_then(|index| Some((index, self.slots.get_mut(usize::from(index))?)))
        else {
            count(&mut self.counters.unclaimed);
            self.counters.last_unclaimed = Some(frame.key());
            return Dispatch::Unclaimed;
        };
        match slot.motor.unpack_feedback(frame, at) {
            Ok(()) => {
                slot.last_seen = Some(at);
                count(&mut slot.counters.received);
                Dispatch::Motor(MotorId(index))
            }
            Err(error) => {
                count(&mut slot.counters.malformed);
                count(&mut self.counters.malformed);
                Dispatch::Malformed(MotorId(index), error)
            }
        }
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
        slot.motor.set_target(target).map_err(CommandError::Target)?;
        slot.valid_until = Some(now + slot.safety.command_expiry);
        Ok(())
    }

    /// Asks something of a motor beside a target.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed.
    pub fn request(&mut self, motor: MotorId, request: Request) -> Result<(), RequestError> {
        let slot = self.slots.get_mut(motor.index()).ok_or(RequestError::NoSuchMotor)?;
        slot.motor.request(request)
    }

    /// One tick: decides what each motor may do, lets it compute, and adds its frames to `tx`.
    /// `dt` is the time since the last tick.
    ///
    /// # Errors
    /// [`TxFull`] if not all frames fit into `tx`; the other motors' frames are in it.
    pub fn tick(&mut self, now: Micros, dt: Seconds, tx: &mut TxBatch) -> Result<(), TxFull> {
        let arm = self.switch.state();
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
        let wirings: Vec<_, N> = self.slots.iter().map(|slot| slot.motor.wiring()).collect();
        BusLoad::of(wirings.iter(), bits_per_second)
    }

    /// The motors attached, in order.
    pub fn motors(&self) -> impl Iterator<Item = (MotorId, MotorName)> {
        (0..).map(MotorId).zip(self.slots.iter().map(|slot| slot.motor.wiring().name()))
    }

    /// The attached motors' numbers, in order.
    pub fn ids(&self) -> impl Iterator<Item = MotorId> + use<N> {
        (0..).take(self.slots.len()).map(MotorId)
    }

    /// The identifiers that motors of this bus are commanded with; shared ones come repeatedly.
    pub fn command_patterns(&self) -> impl Iterator<Item = IdPattern> {
        self.slots.iter().flat_map(|slot| {
            let patterns: Vec<_, 8> =
                slot.motor.wiring().transmitted().iter().map(|sent| sent.pattern).collect();
            patterns
        })
    }

    /// What targets a motor takes; none for a motor that does not exist.
    #[must_use]
    pub fn supports(&self, motor: MotorId) -> TargetSet {
        self.slots.get(motor.index()).map_or(TargetSet::NONE, |slot| slot.motor.supports())
    }

    /// All there is to know about a motor.
    #[must_use]
    pub fn status(&self, motor: MotorId, now: Micros) -> Option<MotorStatus> {
        self.slots.get(motor.index()).map(|slot| MotorStatus {
            link: slot.link(now),
            drive: slot.drive,
            target: slot.motor.target(),
            feedback: slot.motor.feedback(),
            fault: slot.motor.fault(),
            counters: slot.counters,
        })
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

impl Slot<'_> {
    #[inline]
    fn link(&self, now: Micros) -> Link {
        match self.last_seen {
            None => Link::NeverSeen,
            Some(seen) if now.since(seen) > self.link_timeout => Link::Lost,
            Some(_) => Link::Online,
        }
    }

    /// What the motor may do now. The one place where motors are stopped.
    #[inline]
    fn decide(&mut self, arm: ArmState, now: Micros) -> Drive {
        let online = self.link(now) == Link::Online;
        let fresh = self.valid_until.is_some_and(|until| now <= until);
        let drive = match arm {
            ArmState::Disarmed => Drive::Off,
            _ if !online => Drive::Coast,
            ArmState::Armed if fresh => Drive::Run,
            ArmState::Armed | ArmState::EStopped => self.safety.state.drive(),
        };
        if drive != self.drive || online != self.online {
            self.note_change(arm, online, drive);
        }
        drive
    }

    /// Rare, and so kept out of the tick's straight path.
    #[cold]
    fn note_change(&mut self, arm: ArmState, online: bool, drive: Drive) {
        if self.online && !online {
            count(&mut self.counters.lost);
        } else if self.drive == Drive::Run && arm == ArmState::Armed {
            count(&mut self.counters.expired);
        }
        self.drive = drive;
        self.online = online;
    }
}

#[inline]
const fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}
