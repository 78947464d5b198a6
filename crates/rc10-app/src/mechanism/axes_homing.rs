//! Homing of motors that drive one thing: together.

use super::axes::difference;
use super::{
    Homing, HomingConfig, HomingFailure, HomingStatus, Measured, MotorCommand, Phase, way,
};
use crate::TotalAngle;
use crate::config::{ConfigError, positive};
use crate::ok;
use crate::units::{Degrees, Seconds};

/// How axes are homed together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxesHomingConfig {
    /// How each of them is homed.
    pub homing: HomingConfig,
    /// Ways since the beginning differ by less; > 0: so far apart are touches of a tilted thing.
    pub spread: Degrees,
}

impl AxesHomingConfig {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(self.homing.validate());
        positive("spread", self.spread.get())
    }
}

/// Why homing of axes failed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AxesHomingFailure {
    /// Homing of one motor failed.
    Motor {
        /// The motor's index.
        motor: usize,
        /// Why.
        failure: HomingFailure,
    },
    /// The ways of the motors differ by too much.
    Spread {
        /// The motor that has come least far towards its reference.
        behind: usize,
        /// The difference at that time.
        difference: Degrees,
    },
}

/// How far homing of axes is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AxesHomingStatus<const N: usize> {
    /// On its way.
    Running,
    /// Done.
    Done {
        /// For each motor, its angle at which its axis is at 0.
        zeros: [TotalAngle; N],
    },
    /// Ended without zeros.
    Failed(AxesHomingFailure),
}

/// State of homing of `N` motors at one speed: each stands where it touched until all have.
///
/// ```
/// use rc10_app::mechanism::{
///     AxesHoming, AxesHomingConfig, Braking, MotorCommand, HomingConfig, Measured, Reference,
/// };
/// use rc10_app::{Degrees, Direction, Rpm, RpmPerSecond, Seconds, TotalAngle};
/// let homing = HomingConfig {
///     reference: Reference::Contact { debounce: Seconds::new(0.02) },
///     direction: Direction::Reversed,
///     fast: Rpm::new(60.0),
///     slow: Rpm::new(10.0),
///     back_off: Degrees::new(30.0),
///     tolerance: Degrees::new(5.0),
///     touch_at: TotalAngle::ZERO,
///     travel: Degrees::new(1200.0),
///     braking: Braking { acceleration: RpmPerSecond::new(500.0), reaction: Seconds::new(0.03) },
///     phase_timeout: Seconds::new(5.0),
///     timeout: Seconds::new(10.0),
/// };
/// let config = AxesHomingConfig { homing, spread: Degrees::new(20.0) };
/// assert_eq!(config.validate(), Ok(()));
/// let (mut lift, motors) = (AxesHoming::<2>::new(), [Measured::default(); 2]);
/// let mut step = |closed| lift.update(&config, &motors, &closed, Seconds::new(0.02));
/// assert_eq!(step([false, false]), [MotorCommand::Speed(Rpm::new(-60.0)); 2]);
/// step([true, false]); // the first has touched and lets go
/// assert_eq!(step([true, false]), [MotorCommand::STOP, MotorCommand::Speed(Rpm::new(-60.0))]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxesHoming<const N: usize> {
    axes: [Homing; N],
    began: Option<[TotalAngle; N]>,
    status: AxesHomingStatus<N>,
    commands: [MotorCommand; N],
}

impl<const N: usize> Default for AxesHoming<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> AxesHoming<N> {
    /// Not begun.
    pub const fn new() -> Self {
        Self {
            axes: [Homing::new(); N],
            began: None,
            status: AxesHomingStatus::Running,
            commands: [MotorCommand::Coast; N],
        }
    }

    /// How far it is.
    pub const fn status(&self) -> AxesHomingStatus<N> {
        self.status
    }

    /// Homing of each motor.
    pub const fn axes(&self) -> &[Homing; N] {
        &self.axes
    }

    /// One step, like [`Homing::update`], a contact for each motor; stops at the end.
    pub fn update(
        &mut self,
        config: &AxesHomingConfig,
        motors: &[Measured; N],
        closed: &[bool; N],
        dt: Seconds,
    ) -> [MotorCommand; N] {
        if !dt.is_step() {
            return self.commands;
        }
        if self.status != AxesHomingStatus::Running {
            self.commands = [MotorCommand::STOP; N];
            return self.commands;
        }
        let slowest = self.axes.iter().map(reached).min().unwrap_or_default();
        for (index, axis) in self.axes.iter_mut().enumerate() {
            let proceed = reached(axis) <= slowest;
            self.commands[index] =
                axis.step(&config.homing, &motors[index], closed[index], proceed, dt);
        }
        self.status = self.outcome(config, motors);
        if let AxesHomingStatus::Failed(_) = self.status {
            self.commands = [MotorCommand::Coast; N];
        }
        self.commands
    }

    fn outcome(
        &mut self,
        config: &AxesHomingConfig,
        motors: &[Measured; N],
    ) -> AxesHomingStatus<N> {
        let mut zeros = [None; N];
        for (motor, axis) in self.axes.iter().enumerate() {
            match axis.status() {
                HomingStatus::Failed(failure) => {
                    return AxesHomingStatus::Failed(AxesHomingFailure::Motor { motor, failure });
                }
                HomingStatus::Done { zero } => zeros[motor] = Some(zero),
                HomingStatus::Running(_) => {}
            }
        }
        let angles = motors.map(|motor| motor.angle);
        let began = *self.began.get_or_insert(angles);
        let towards = config.homing.direction;
        let ways: [f32; N] =
            core::array::from_fn(|motor| way(began[motor], angles[motor], towards));
        let spread = difference(&ways);
        if spread > config.spread.get() {
            let least = |least, motor| if ways[motor] < ways[least] { motor } else { least };
            let (behind, difference) = ((0..N).fold(0, least), Degrees::new(spread));
            return AxesHomingStatus::Failed(AxesHomingFailure::Spread { behind, difference });
        }
        if zeros.iter().all(Option::is_some) {
            AxesHomingStatus::Done { zeros: zeros.map(Option::unwrap_or_default) }
        } else {
            AxesHomingStatus::Running
        }
    }
}

/// The phase that an axis has reached. One that is done stays in its last.
const fn reached(axis: &Homing) -> Phase {
    match axis.status() {
        HomingStatus::Running(phase) => phase,
        HomingStatus::Done { .. } | HomingStatus::Failed(_) => Phase::Second,
    }
}
