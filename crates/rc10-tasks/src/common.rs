//! The state that tasks of every robot share.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::Mutex;
use rc10_message::{Cycles, Latest, Topic};
use rc10_module::Reception;
use rc10_module::imu::Heading;
use rc10_module::remote::{Remote, RemoteLink};
use rc10_motor::embassy::{MotorPort, PortsOf};
use rc10_motor::{ArmSwitch, Names, Target, TargetError, Withheld};
use rc10_time::Micros;

use crate::arming::{Arming, Axis};
use crate::live::KeptState;
use crate::program::MOST_SERIALS;
use crate::status::RobotStatus;
use crate::supply::Supply;

/// The state that a robot's tasks share: what every robot has, and what this one has of its [`own`](Self::own).
///
/// `N` are the names of its declaration.
pub struct Common<'p, N: Names, OWN = ()> {
    /// Arms and stops all motors.
    pub switch: ArmSwitch,
    /// The ports of its buses, lines and motors.
    pub ports: PortsOf<'p, N>,
    /// Newest frame of the remote control.
    pub remote: Latest<Remote, 1>,
    /// Counters of its receiver's bytes and frames.
    pub remote_reception: Reception,
    /// State of the link to the remote control.
    pub remote_link: Latest<RemoteLink, 1>,
    /// The control that was not at rest when the remote was to arm the robot.
    pub not_at_rest: Latest<Option<Axis>, 1>,
    /// The newest target that a motor refused: which motor, and why.
    pub refused: Latest<(N, TargetError), 1>,
    /// Status of the robot, ten times a second.
    pub status: Topic<RobotStatus<N>, 4, 2>,
    /// Cycles of the core that a tick of the buses takes, on a chip that counts its cycles: a run
    /// is a tick.
    pub bus_cycles: Option<&'p Cycles>,
    /// What is to be told of kept parameters.
    pub kept_state: Latest<KeptState, 1>,
    /// Changes of parameters by PCs.
    pub changes: Changes,
    /// The heading of the robot in the world, by its IMU: [`heading`](crate::heading) says from where that counts.
    pub heading: Latest<Heading, 1>,
    /// Whether the robot has an IMU, so that a heading is to come.
    pub has_imu: AtomicBool,
    /// The error of the IMU, in a few words behind that word, of a board that reads one.
    pub imu_trouble: Latest<Option<&'static str>, 1>,
    /// Counters of the IMU's frames or samples.
    pub imu_reception: Reception,
    /// Counters of the parts on UARTs, in the order of the declaration.
    pub receptions: [Reception; MOST_SERIALS],
    /// The supply, of a board that measures it.
    pub supply: Latest<Supply, 1>,
    /// Until then motors that have not been heard yet are not missing: their supply has just been switched on.
    pub settled: Latest<Micros, 1>,
    /// The robot's own: signals and parameters for a PC, and topics of its tasks, as
    /// [`live!`](crate::live!) declares them; `()` has none.
    pub own: OWN,
}

/// Counts the changes of parameters, and keeps those of two PCs from mixing.
pub struct Changes {
    count: AtomicU32,
    /// Held while a change is carried out.
    pub(crate) turn: Mutex<CriticalSectionRawMutex, ()>,
    /// The motor that a PC turns, or [`NO_MOTOR`]; and when it asked for it last, the low half of the time.
    jogged: AtomicU8,
    jogged_at: AtomicU32,
}

const NO_MOTOR: u8 = u8::MAX;
/// Longer than any motor still turns by what was asked for last, µs.
const JOG: u32 = 150_000;

impl Changes {
    const fn new() -> Self {
        Self {
            count: AtomicU32::new(0),
            turn: Mutex::new(()),
            jogged: AtomicU8::new(NO_MOTOR),
            jogged_at: AtomicU32::new(0),
        }
    }

    /// Whether a PC may turn this motor now: no other one turns. `goes_on` says whether it wants to.
    /// All PCs are served in thread mode, one after the other.
    pub(crate) fn may_jog(&self, motor: u8, goes_on: bool, now: Micros) -> bool {
        #[expect(clippy::cast_possible_truncation, reason = "the low half is what is wanted")]
        let now = now.get() as u32;
        let other = self.jogged.load(Ordering::Relaxed);
        let is_old = now.wrapping_sub(self.jogged_at.load(Ordering::Relaxed)) > JOG;
        if other != motor && other != NO_MOTOR && !is_old {
            return false;
        }
        self.jogged.store(if goes_on { motor } else { NO_MOTOR }, Ordering::Relaxed);
        self.jogged_at.store(now, Ordering::Relaxed);
        true
    }

    /// How many there were.
    pub fn read(&self) -> u32 {
        self.count.load(Ordering::Relaxed)
    }

    pub(crate) fn add(&self) {
        self.count.store(self.read().wrapping_add(1), Ordering::Relaxed);
    }
}

impl<'p, N: Names, OWN: Default> Common<'p, N, OWN> {
    /// Creates the state of a robot that has not begun.
    // Always inlined, so that it is made where it stays and does not pass over the stack.
    #[inline(always)]
    #[must_use]
    pub fn new(ports: impl Into<PortsOf<'p, N>>) -> Self {
        Self {
            switch: ArmSwitch::new(),
            ports: ports.into(),
            remote: Latest::new(),
            remote_reception: Reception::new(),
            remote_link: Latest::new(),
            not_at_rest: Latest::new(),
            refused: Latest::new(),
            status: Topic::new(),
            bus_cycles: None,
            kept_state: Latest::new(),
            changes: Changes::new(),
            heading: Latest::new(),
            has_imu: AtomicBool::new(false),
            imu_trouble: Latest::new(),
            imu_reception: Reception::new(),
            receptions: [const { Reception::new() }; MOST_SERIALS],
            supply: Latest::new(),
            settled: Latest::new(),
            own: OWN::default(),
        }
    }
}

impl<N: Names, OWN> Common<'_, N, OWN> {
    /// Lets the remote arm, disarm and stop the robot, at least every 20 ms, and tells the status how well
    /// it is heard. The remote, if the robot is armed and is to do what its sticks say.
    pub fn obey(&self, arming: &mut Arming) -> Option<Remote> {
        let now = rc10_message::now();
        let obeyed = arming.step(self.remote.read(), &self.switch, now);
        self.remote_link.set(arming.link(), now);
        self.not_at_rest.set(arming.refused(), now);
        obeyed
    }

    /// The port of a motor.
    #[must_use]
    pub fn motor(&self, name: N) -> MotorPort<'_> {
        self.ports.motor(name)
    }

    /// Gives a motor a target; repeat it, for it expires in 50 ms.
    ///
    /// A motor that refuses it (a number that is not finite, a kind it does not take) keeps the old
    /// one until that expires, and then is safe. The status names the motor and the reason.
    pub fn command(&self, name: N, target: Target) {
        self.command_within(name, target, Withheld::NONE);
    }

    /// The same, with a part of its largest effort [withheld](rc10_motor::embassy::MotorPort::command_within).
    pub fn command_within(&self, name: N, target: Target, withheld: Withheld) {
        if let Err(why) = self.motor(name).command_within(target, withheld) {
            self.refused.set((name, why), rc10_message::now());
        }
    }
}
