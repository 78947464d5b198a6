use core::cell::RefCell;
use core::ops::Deref;
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embedded_can::Id;
use heapless::Vec;
use rc10_can::{CanFrame, Health, IdPattern};
use rc10_time::Timing;

use super::motors::MotorPorts;
use super::subscription::{Filter, NoFreeSubscription, Subscription, Subscriptions};
use crate::arm::ArmState;
use crate::bus::{BusCounters, MotorBus};
use crate::load::BusLoad;

/// The shared side of a CAN bus: the ports of its motors, an outbox, and subscriptions.
pub struct BusPort {
    motors: MotorPorts<BusStatus, { MotorBus::CAPACITY }>,
    outbox: Channel<CriticalSectionRawMutex, CanFrame, OUTBOX>,
    /// Identifiers that motors are commanded with: not for the outbox.
    claimed: Mutex<CriticalSectionRawMutex, RefCell<Claimed>>,
    subscriptions: Subscriptions,
    /// The bus is to be brought back.
    recover: AtomicBool,
}

const OUTBOX: usize = 16;
/// Identifiers that are remembered. A bus that has more keeps all for itself.
const CLAIMED: usize = 24;

struct Claimed {
    patterns: Vec<IdPattern, CLAIMED>,
    all: bool,
}

/// The state of a CAN bus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct BusStatus {
    /// Ticks so far; starts over after 2³² (49 days).
    pub ticks: u32,
    /// Ticks that did not happen because the one before ended too late, or the processor was busy.
    pub overruns: u32,
    /// Time from one tick's start to the next one's.
    pub period: Timing,
    /// Time that a tick takes to receive and to compute: what it does before its frames leave.
    pub execution: Timing,
    /// Frames handed to the port, the outbox's included.
    pub submitted: u32,
    /// Frames that replaced an older one of the same identifier that had not been sent yet.
    pub replaced: u32,
    /// Frames that port or batch had no room for, or that came while the bus was off.
    pub refused: u32,
    /// Frames received.
    pub received: BusCounters,
    /// Error state, error counters and losses of the controller.
    pub health: Health,
    /// Share of the bus that the attached motors need, at 1 Mbit/s.
    pub load: BusLoad,
    /// Whether the robot is armed.
    pub arm: ArmState,
}

/// Why a frame was not put into the outbox.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OutboxError {
    /// The outbox is full.
    #[error("{OUTBOX} frames wait in the outbox already")]
    Full,
    /// A motor of this bus is commanded with this identifier, and only its bus may do that.
    #[error("{} commands a motor of this bus", IdPattern::exact(*.0))]
    BelongsToMotor(Id),
}

impl BusPort {
    /// The port of a bus that does not run yet: it refuses all targets until it does.
    pub const fn new() -> Self {
        Self {
            motors: MotorPorts::with_status(BusStatus::NEW),
            outbox: Channel::new(),
            claimed: Mutex::new(RefCell::new(Claimed { patterns: Vec::new(), all: false })),
            subscriptions: Subscriptions::new(),
            recover: AtomicBool::new(false),
        }
    }

    /// Number of ticks so far, as of the bus's last one: [`BusStatus::ticks`] alone.
    pub fn ticks(&self) -> u32 {
        self.look(|status| status.ticks)
    }

    /// Sends a frame after the motors' frames of the next tick.
    ///
    /// # Errors
    /// [`OutboxError`]; the frame is not sent.
    pub fn send(&self, frame: &CanFrame) -> Result<(), OutboxError> {
        let id = frame.id();
        if self.is_claimed(id) {
            return Err(OutboxError::BelongsToMotor(id));
        }
        self.outbox.try_send(*frame).map_err(|_| OutboxError::Full)
    }

    /// Whether a motor is commanded with this identifier; known once the bus runs.
    pub(super) fn is_claimed(&self, id: Id) -> bool {
        self.claimed.lock(|claimed| {
            let claimed = claimed.borrow();
            claimed.all || claimed.patterns.iter().any(|own| own.contains(id))
        })
    }

    /// A stream of the frames that pass `filter`.
    ///
    /// # Errors
    /// [`NoFreeSubscription`] if four exist already.
    pub fn subscribe(&self, filter: Filter) -> Result<Subscription<'_>, NoFreeSubscription> {
        self.subscriptions.subscribe(filter)
    }

    /// Brings back a bus that is off in its next tick: the only way under `BusOffPolicy::Manual`.
    pub fn recover(&self) {
        self.recover.store(true, Ordering::Release);
    }

    /// Whether the bus is to be brought back; asked once.
    pub(super) fn take_recover(&self) -> bool {
        self.recover.load(Ordering::Acquire) && self.recover.swap(false, Ordering::AcqRel)
    }

    /// The bus starts: from now on its motors' identifiers are theirs.
    pub(super) fn claim(&self, bus: &MotorBus<'_>) {
        self.claimed.lock(|claimed| {
            let mut claimed = claimed.borrow_mut();
            let Claimed { patterns, all } = &mut *claimed;
            patterns.clear();
            *all = false;
            bus.for_each_can_ids(|ids| {
                for sent in ids.transmitted() {
                    // Lanes of one frame repeat its identifier.
                    *all |=
                        !patterns.contains(&sent.pattern) && patterns.push(sent.pattern).is_err();
                }
            });
        });
    }

    pub(super) fn take_outgoing(&self) -> Option<CanFrame> {
        self.outbox.try_receive().ok()
    }

    pub(super) const fn subscriptions(&self) -> &Subscriptions {
        &self.subscriptions
    }
}

impl Deref for BusPort {
    type Target = MotorPorts<BusStatus, { MotorBus::CAPACITY }>;

    #[inline]
    fn deref(&self) -> &Self::Target {
        &self.motors
    }
}

impl Default for BusPort {
    fn default() -> Self {
        Self::new()
    }
}

impl BusStatus {
    pub(super) const NEW: Self = Self {
        ticks: 0,
        overruns: 0,
        period: Timing::new(),
        execution: Timing::new(),
        submitted: 0,
        replaced: 0,
        refused: 0,
        received: BusCounters::NEW,
        health: Health::NEW,
        load: BusLoad::NONE,
        arm: ArmState::Disarmed,
    };
}
