//! Homing: the zero of an axis, found by a hard stop, a switch or an index.

use super::contact::Debounce;
use super::{Braking, Measured, MotorCommand, Stall, StallTimer, Trouble, way};
use crate::TotalAngle;
use crate::config::{ConfigError, not_negative, positive};
use crate::ok;
use crate::units::{Degrees, Direction, Rpm, Seconds};

/// By which an axis is homed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// A hard stop: it is touched where the motor begins to stall.
    Stop(Stall),
    /// A limit switch at the end, or an index that is passed: touched at the edge from open to closed.
    Contact {
        /// Longer than it bounces, 0 or more: a contact is closed or open after this time, and the
        /// edge is where it began. A marker is wider than the way in this time.
        debounce: Seconds,
    },
}

/// How an axis is homed: a fast first touch, back off, a slow second touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingConfig {
    /// The thing that is touched.
    pub reference: Reference,
    /// Where it is, as the motor counts.
    pub direction: Direction,
    /// Speed of the first touch and of backing off; > 0.
    pub fast: Rpm,
    /// Speed of the second touch; > 0, at most `fast`, and above the standstill of a stall.
    pub slow: Rpm,
    /// How far it backs off from the first touch; > 0. A contact must be open there.
    pub back_off: Degrees,
    /// The touches differ by less; > 0, < `back_off`: for a soft stop, a switch's hysteresis.
    pub tolerance: Degrees,
    /// The axis' angle at the touch: an offset.
    pub touch_at: TotalAngle,
    /// Never further from where it began, either way; > `back_off`.
    pub travel: Degrees,
    /// How the motor brakes before the end of `travel`.
    pub braking: Braking,
    /// No phase takes longer; > 0.
    pub phase_timeout: Seconds,
    /// All of it takes no longer; > 0.
    pub timeout: Seconds,
}

impl HomingConfig {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        let (fast, slow) = (self.fast.get(), self.slow.get());
        let (back_off, tolerance) = (self.back_off.get(), self.tolerance.get());
        ok!(positive("fast", fast));
        ok!(positive("slow", slow));
        ok!(ConfigError::check(slow <= fast, "slow", slow, "at most `fast`"));
        match &self.reference {
            Reference::Stop(stall) => {
                ok!(stall.validate(), in "reference");
                let (effort, standstill) = (stall.effort, stall.standstill.get());
                ok!(positive("effort", effort), in "reference");
                let is_below = standstill < slow;
                let check = ConfigError::check(is_below, "standstill", standstill, "below `slow`");
                ok!(check, in "reference");
            }
            Reference::Contact { debounce } => {
                ok!(not_negative("debounce", debounce.get()), in "reference");
            }
        }
        ok!(positive("back_off", back_off));
        ok!(positive("tolerance", tolerance));
        let is_below = tolerance < back_off;
        ok!(ConfigError::check(is_below, "tolerance", tolerance, "below `back_off`"));
        let travel = self.travel.get();
        ok!(positive("travel", travel));
        ok!(ConfigError::check(travel > back_off, "travel", travel, "above `back_off`"));
        ok!(self.braking.validate(), in "braking");
        ok!(positive("phase_timeout", self.phase_timeout.get()));
        positive("timeout", self.timeout.get())
    }
}

/// The phases of homing, in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// Towards the reference, fast.
    #[default]
    First,
    /// At the first touch.
    Touched,
    /// Away from it.
    BackOff,
    /// Backed off.
    Clear,
    /// Towards the reference again, slowly.
    Second,
}

/// Why homing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HomingFailure {
    /// The motor cannot be relied on.
    Motor(Trouble),
    /// The phase took too long.
    PhaseTimeout(Phase),
    /// All of it took too long; the phase it was in.
    Timeout(Phase),
    /// The travel's end: no reference, or the motor slips past it. The phase it was in.
    Travel(Phase),
    /// The contact stayed closed while the axis backed off, to the end of its way, time or travel.
    NeverOpened,
    /// The touches are too far apart.
    TouchesDiffer {
        /// The motor's angle at the first, or where a contact opened that was closed at the beginning.
        first: TotalAngle,
        /// The motor's angle at the second.
        second: TotalAngle,
    },
}

/// How far homing is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HomingStatus {
    /// On its way.
    Running(Phase),
    /// Done.
    Done {
        /// The motor's angle at 0: [`Measured::counted_from`](super::Measured::counted_from),
        /// [`MotorCommand::shifted`](super::MotorCommand::shifted).
        zero: TotalAngle,
    },
    /// Ended without a zero.
    Failed(HomingFailure),
}

/// State of homing. It begins at the first [`update`](Self::update), with the axis at a stand.
///
/// A contact that is closed at the beginning counts as touched: the axis backs off until it opens.
///
/// ```
/// use rc10_app::mechanism::{Braking, MotorCommand, Homing, HomingConfig, Measured, Reference, Stall};
/// use rc10_app::{Degrees, Direction, Rpm, RpmPerSecond, Seconds, TotalAngle};
/// const LIFT: HomingConfig = HomingConfig {
///     reference: Reference::Stop(Stall {
///         effort: 4.0, // A
///         standstill: Rpm::new(3.0),
///         time: Seconds::new(0.1),
///     }),
///     direction: Direction::Reversed, // the bottom
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
/// const _: () = assert!(LIFT.validate().is_ok());
/// let mut homing = Homing::new();
/// let command = homing.update(&LIFT, &Measured::default(), false, Seconds::new(0.01));
/// assert_eq!(command, MotorCommand::Speed(Rpm::new(-60.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homing {
    status: HomingStatus,
    /// Angle and gaps at the beginning.
    began: Option<(TotalAngle, u32)>,
    time: f32,
    phase_time: f32,
    /// The first touch; `None` for a contact that was closed at the beginning and has not opened yet.
    first: Option<TotalAngle>,
    stall: StallTimer,
    contact: Debounce,
    command: MotorCommand,
}

impl Default for Homing {
    fn default() -> Self {
        Self::new()
    }
}

impl Homing {
    /// Not begun.
    pub const fn new() -> Self {
        Self {
            status: HomingStatus::Running(Phase::First),
            began: None,
            time: 0.0,
            phase_time: 0.0,
            first: None,
            stall: StallTimer { time: 0.0, began: TotalAngle::ZERO },
            contact: Debounce::NEW,
            command: MotorCommand::Coast,
        }
    }

    /// How far it is.
    pub const fn status(&self) -> HomingStatus {
        self.status
    }

    pub(super) const fn has_begun(&self) -> bool {
        self.began.is_some()
    }

    /// One step. `closed`: the contact, if there is one. After the end the command is a stop.
    ///
    /// A bad `dt` repeats the last command. Bad measurements end it: no axis goes on blindly.
    pub fn update(
        &mut self,
        config: &HomingConfig,
        measured: &Measured,
        closed: bool,
        dt: Seconds,
    ) -> MotorCommand {
        self.step(config, measured, closed, true, dt)
    }

    /// One step. In [`Phase::Touched`] and [`Phase::Clear`] it waits until it may `proceed`.
    pub(super) fn step(
        &mut self,
        config: &HomingConfig,
        measured: &Measured,
        closed: bool,
        proceed: bool,
        dt: Seconds,
    ) -> MotorCommand {
        if dt.is_step() {
            self.command = match self.status {
                HomingStatus::Running(phase) => {
                    match self.advance(phase, config, measured, closed, proceed, dt) {
                        Ok(command) => command,
                        Err(end) => {
                            self.status = end;
                            MotorCommand::Coast
                        }
                    }
                }
                HomingStatus::Done { .. } | HomingStatus::Failed(_) => MotorCommand::STOP,
            };
        }
        self.command
    }

    /// Goes on to a phase. The loop of the motor lets go of what it has gathered.
    const fn enter(&mut self, phase: Phase) -> MotorCommand {
        self.status = HomingStatus::Running(phase);
        self.phase_time = 0.0;
        self.stall = StallTimer { time: 0.0, began: TotalAngle::ZERO };
        MotorCommand::Coast
    }

    /// One step of a phase; `Err`: how it ends.
    fn advance(
        &mut self,
        phase: Phase,
        config: &HomingConfig,
        measured: &Measured,
        closed: bool,
        proceed: bool,
        dt: Seconds,
    ) -> Result<MotorCommand, HomingStatus> {
        let (start, gaps) = *self.began.get_or_insert((measured.angle, measured.gaps));
        let fail = |failure| Err(HomingStatus::Failed(failure));
        if let Err(trouble) = measured.reliable(gaps) {
            return fail(HomingFailure::Motor(trouble));
        }
        let edge = match config.reference {
            Reference::Contact { debounce } => {
                self.contact.update(debounce, closed, measured.angle, dt)
            }
            Reference::Stop(_) => None,
        };
        let limits = self.within_limits(phase, config, measured, start, dt);
        if let Err(failure) = limits {
            let is_stuck = phase == Phase::BackOff && self.contact.state == Some(true);
            return fail(if is_stuck { HomingFailure::NeverOpened } else { failure });
        }

        let towards = |speed: Rpm| MotorCommand::Speed(speed * f32::from(config.direction.sign()));
        let touch = match &config.reference {
            Reference::Stop(stall) => {
                self.stall.update(stall, measured, Some(config.direction), dt)
            }
            Reference::Contact { .. } => edge.filter(|edge| edge.closed).map(|edge| edge.angle),
        };
        Ok(match (phase, touch) {
            (Phase::First, Some(_)) => {
                // A contact that was never open has been closed since before the beginning.
                self.first = touch.filter(|_| edge.is_none_or(|edge| edge.was_open));
                self.enter(Phase::Touched)
            }
            (Phase::First, None) => {
                let unknown = self.contact.state.is_none();
                if unknown && matches!(config.reference, Reference::Contact { .. }) {
                    MotorCommand::STOP
                } else {
                    towards(config.fast)
                }
            }
            (Phase::Touched, _) if proceed => {
                self.enter(Phase::BackOff);
                towards(-config.fast)
            }
            (Phase::BackOff, _) => {
                if self.first.is_none() {
                    self.first = edge.filter(|edge| !edge.closed).map(|edge| edge.angle);
                }
                let so_far = self.first.map(|first| -way(first, measured.angle, config.direction));
                if so_far.is_some_and(|way| way >= config.back_off.get()) {
                    self.enter(Phase::Clear)
                } else {
                    towards(-config.fast)
                }
            }
            (Phase::Touched, _) => MotorCommand::STOP,
            (Phase::Clear, _) => {
                if self.contact.is_steadily_closed() {
                    return fail(HomingFailure::NeverOpened);
                }
                if !proceed || self.contact.state == Some(true) {
                    return Ok(MotorCommand::STOP);
                }
                self.enter(Phase::Second);
                towards(config.slow)
            }
            (Phase::Second, None) => towards(config.slow),
            (Phase::Second, Some(second)) => {
                let first = self.first.unwrap_or(second);
                let apart = way(first, second, config.direction).abs();
                if apart > config.tolerance.get() {
                    return fail(HomingFailure::TouchesDiffer { first, second });
                }
                return Err(HomingStatus::Done { zero: second.minus(config.touch_at) });
            }
        })
    }

    /// Whether time and travel are left, with the way to brake.
    fn within_limits(
        &mut self,
        phase: Phase,
        config: &HomingConfig,
        measured: &Measured,
        start: TotalAngle,
        dt: Seconds,
    ) -> Result<(), HomingFailure> {
        self.time += dt.get();
        self.phase_time += dt.get();
        let from_start = measured.angle.minus(start).degrees().get();
        let outward = if from_start < 0.0 { -measured.speed } else { measured.speed };
        let braking = if outward.get() > 0.0 { config.braking.way(outward).get() } else { 0.0 };
        if from_start.abs() + braking >= config.travel.get() {
            Err(HomingFailure::Travel(phase))
        } else if self.phase_time > config.phase_timeout.get() {
            Err(HomingFailure::PhaseTimeout(phase))
        } else if self.time > config.timeout.get() {
            Err(HomingFailure::Timeout(phase))
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: Seconds = Seconds::new(0.01);

    const CONFIG: HomingConfig = HomingConfig {
        reference: Reference::Contact { debounce: Seconds::new(0.015) },
        direction: Direction::Forward,
        fast: Rpm::new(60.0),
        slow: Rpm::new(10.0),
        back_off: Degrees::new(20.0),
        tolerance: Degrees::new(5.0),
        touch_at: TotalAngle::ZERO,
        travel: Degrees::new(100.0),
        braking: Braking {
            acceleration: crate::units::RpmPerSecond::new(500.0),
            reaction: Seconds::new(0.02),
        },
        phase_timeout: Seconds::new(2.0),
        timeout: Seconds::new(3.0),
    };

    /// Steps at these angles, until something is asked for that is not `command`.
    fn while_asked(homing: &mut Homing, degrees: i32, closed: bool, command: MotorCommand) -> u32 {
        let angle = TotalAngle::from_degrees(degrees);
        let measured = Measured { angle, ..Measured::default() };
        let is_other = |_: &u32| homing.update(&CONFIG, &measured, closed, DT) != command;
        (0..1000).find(is_other).unwrap()
    }

    #[test]
    fn the_whole_has_a_time_out_too() {
        let mut homing = Homing::new();
        let fast = MotorCommand::Speed(Rpm::new(60.0));
        while_asked(&mut homing, 0, false, MotorCommand::STOP);
        // 1.5 s, then the touch at 50; 1.5 s of backing off are too much together.
        for _ in 0..150 {
            let measured = Measured::default();
            assert_eq!(homing.update(&CONFIG, &measured, false, DT), fast);
        }
        while_asked(&mut homing, 50, true, fast);
        assert_eq!(homing.status(), HomingStatus::Running(Phase::Touched));
        let back = MotorCommand::Speed(Rpm::new(-60.0));
        assert_eq!(while_asked(&mut homing, 50, true, MotorCommand::STOP), 0);
        let steps = while_asked(&mut homing, 50, true, back);
        assert!((140..150).contains(&steps), "{steps}");
        // A contact that is still closed is why.
        let failure = HomingFailure::NeverOpened;
        assert_eq!(homing.status(), HomingStatus::Failed(failure));
    }

    #[test]
    fn bad_input_changes_nothing_or_ends_it() {
        let mut homing = Homing::new();
        while_asked(&mut homing, 0, false, MotorCommand::STOP);
        let (before, measured) = (homing, Measured::default());
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let command = homing.update(&CONFIG, &measured, true, Seconds::new(bad));
            assert_eq!((homing, command), (before, MotorCommand::Speed(CONFIG.fast)));
        }
        let blind = Measured { speed: Rpm::new(f32::NAN), ..measured };
        assert_eq!(homing.update(&CONFIG, &blind, false, DT), MotorCommand::Coast);
        let failure = HomingFailure::Motor(Trouble::NotFinite);
        assert_eq!(homing.status(), HomingStatus::Failed(failure));
        assert_eq!(homing.update(&CONFIG, &measured, false, DT), MotorCommand::STOP);
    }

    #[test]
    fn the_configuration_is_checked() {
        let time = Seconds::new(0.1);
        let stall = Stall { effort: 5.0, standstill: Rpm::new(3.0), time };
        let of = |stall| HomingConfig { reference: Reference::Stop(stall), ..CONFIG };
        let zero = Seconds::ZERO;
        assert_eq!(CONFIG.validate(), Ok(()));
        assert_eq!(of(stall).validate(), Ok(()));
        let debounce = Seconds::new(f32::NAN);
        for (bad, field) in [
            (of(Stall { effort: 0.0, ..stall }), "effort"),
            (of(Stall { standstill: Rpm::new(10.0), ..stall }), "standstill"),
            (of(Stall { time: zero, ..stall }), "time"),
            (HomingConfig { reference: Reference::Contact { debounce }, ..CONFIG }, "debounce"),
            (HomingConfig { fast: Rpm::ZERO, ..CONFIG }, "fast"),
            (HomingConfig { slow: Rpm::new(61.0), ..CONFIG }, "slow"),
            (HomingConfig { back_off: Degrees::ZERO, ..CONFIG }, "back_off"),
            (HomingConfig { tolerance: CONFIG.back_off, ..CONFIG }, "tolerance"),
            (HomingConfig { travel: CONFIG.back_off, ..CONFIG }, "travel"),
            (HomingConfig { phase_timeout: zero, ..CONFIG }, "phase_timeout"),
            (HomingConfig { timeout: zero, ..CONFIG }, "timeout"),
        ] {
            assert_eq!(bad.validate().unwrap_err().field, field);
        }
    }
}
