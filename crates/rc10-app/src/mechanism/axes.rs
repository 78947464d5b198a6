//! Axes of two or more motors that drive one thing.

use super::{Measured, MotorCommand, Trouble, small_angle};
use crate::config::{ConfigError, not_negative, positive};
use crate::maths::within;
use crate::ok;
use crate::profile::AngleSetpoint;
use crate::units::{Degrees, Rpm, Seconds};

/// How far the motors may drift apart, and how they are brought together.
///
/// The **difference** is that between the foremost and the hindmost motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxesConfig {
    /// From this difference on the setpoint is slower; > 0. Halfway to `stop` it stands.
    pub wait: Degrees,
    /// From this difference on all stop; > `wait`.
    pub stop: Degrees,
    /// All stop after this time at less than a tenth of the setpoint's speed; > 0.
    pub patience: Seconds,
    /// Cross-coupling: degrees that a setpoint is moved for each degree from the mean of all; 0 or
    /// more. 0.5 is mild; above the gains' quotient of speed and angle loop it oscillates.
    pub coupling: f32,
    /// A motor's setpoint is moved no further than this; 0 or more.
    pub correction: Degrees,
}

impl AxesConfig {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        let (wait, stop) = (self.wait.get(), self.stop.get());
        ok!(positive("wait", wait));
        ok!(positive("stop", stop));
        ok!(ConfigError::check(stop > wait, "stop", stop, "above `wait`"));
        ok!(positive("patience", self.patience.get()));
        ok!(not_negative("coupling", self.coupling));
        not_negative("correction", self.correction.get())
    }

    /// The setpoint's share of its speed: 1 up to `wait`, linearly to 0 halfway to `stop`.
    fn pace(&self, difference: f32) -> f32 {
        let (wait, stop) = (self.wait.get(), self.stop.get());
        (1.0 - 2.0 * (difference - wait) / (stop - wait)).clamp(0.0, 1.0)
    }
}

/// Below this pace the setpoint waits: [`AxesConfig::patience`].
const WAITING: f32 = 0.1;

/// Why axes stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AxesFailure {
    /// A motor cannot be relied on.
    Motor {
        /// The motor's index.
        motor: usize,
        /// Why not.
        trouble: Trouble,
    },
    /// The motors are too far apart, or the setpoint had to wait for too long.
    Lags {
        /// The hindmost motor; where the setpoint stands, the one that is furthest from it.
        motor: usize,
        /// The difference at that time.
        difference: Degrees,
    },
}

/// State of `N` motors, two or more, that follow one setpoint.
///
/// Angles are counted from each motor's zero ([`Measured::counted_from`], [`MotorCommand::shifted`]).
/// Let the setpoint's profile pass by [`pace`](Self::pace) of `dt`: it waits for the hindmost.
///
/// ```
/// use rc10_app::mechanism::{Axes, AxesConfig, MotorCommand, Measured};
/// use rc10_app::{AngleSetpoint, Degrees, Rpm, Seconds, TotalAngle};
/// let config = AxesConfig {
///     wait: Degrees::new(10.0),
///     stop: Degrees::new(30.0),
///     patience: Seconds::new(0.5),
///     coupling: 0.5,
///     correction: Degrees::new(10.0),
/// };
/// assert_eq!(config.validate(), Ok(()));
/// let mut lift = Axes::<2>::new();
/// let degrees = TotalAngle::from_degrees;
/// // The second motor is 16 degrees behind.
/// let motors = [100, 84].map(|at| Measured { angle: degrees(at), ..Measured::default() });
/// let setpoint = AngleSetpoint { speed: Rpm::new(50.0), ..AngleSetpoint::at(degrees(102)) };
/// let commands = lift.update(&config, &setpoint, &motors, Seconds::new(0.01));
/// assert!((lift.pace() - 0.4).abs() < 1e-6);
/// let slower = AngleSetpoint { speed: Rpm::new(50.0) * lift.pace(), ..setpoint };
/// assert_eq!(commands[0], MotorCommand::Angle(AngleSetpoint { angle: degrees(98), ..slower }));
/// assert_eq!(commands[1], MotorCommand::Angle(AngleSetpoint { angle: degrees(106), ..slower }));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes<const N: usize> {
    gaps: Option<[u32; N]>,
    difference: f32,
    pace: f32,
    waiting: f32,
    failure: Option<AxesFailure>,
    commands: [MotorCommand; N],
}

impl<const N: usize> Default for Axes<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Axes<N> {
    /// At rest. It does not compile for fewer than two motors.
    pub const fn new() -> Self {
        const { assert!(N >= 2, "axes have two motors or more") };
        Self {
            gaps: None,
            difference: 0.0,
            pace: 1.0,
            waiting: 0.0,
            failure: None,
            commands: [MotorCommand::Coast; N],
        }
    }

    /// The difference between the foremost and the hindmost motor.
    pub const fn difference(&self) -> Degrees {
        Degrees::new(self.difference)
    }

    /// The share of its speed at which the common setpoint may go on, 0 ..= 1.
    pub const fn pace(&self) -> f32 {
        self.pace
    }

    /// Why they stand until [`reset`](Self::reset), if they do.
    pub const fn failure(&self) -> Option<AxesFailure> {
        self.failure
    }

    /// Starts over after a failure. Motors that are still too far apart fail again in the next step.
    pub const fn reset(&mut self) {
        *self = Self::new();
    }

    /// One step to the setpoint of full pace: at a pace p motors get p and p² of it.
    ///
    /// A `dt` or setpoint that is not finite, or a `dt` not positive, repeats the last commands.
    pub fn update(
        &mut self,
        config: &AxesConfig,
        setpoint: &AngleSetpoint,
        motors: &[Measured; N],
        dt: Seconds,
    ) -> [MotorCommand; N] {
        if !(dt.is_step() && setpoint.is_finite()) {
            return self.commands;
        }
        let &AngleSetpoint { angle, speed, acceleration } = setpoint;
        if self.failure.is_some() {
            self.commands = [MotorCommand::STOP; N];
            return self.commands;
        }
        let off = motors.map(|motor| motor.angle.minus(angle).degrees().get());
        self.difference = difference(&off);
        self.pace = config.pace(self.difference);
        self.waiting = if self.pace < WAITING { self.waiting + dt.get() } else { 0.0 };
        self.failure = self.fails(config, speed, motors, &off);
        if self.failure.is_some() {
            self.pace = 0.0;
            self.commands = [MotorCommand::Coast; N];
            return self.commands;
        }
        #[expect(clippy::cast_precision_loss, reason = "a few motors")]
        let mean = off.iter().sum::<f32>() / N as f32;
        let speed = speed * self.pace;
        let acceleration = acceleration * (self.pace * self.pace);
        self.commands = off.map(|off| {
            let correction = within(config.coupling * (mean - off), config.correction.get());
            let angle = angle.plus(small_angle(correction));
            MotorCommand::Angle(AngleSetpoint { angle, speed, acceleration })
        });
        self.commands
    }

    fn fails(
        &mut self,
        config: &AxesConfig,
        speed: Rpm,
        motors: &[Measured; N],
        off: &[f32; N],
    ) -> Option<AxesFailure> {
        let gaps = *self.gaps.get_or_insert(motors.map(|motor| motor.gaps));
        for (index, motor) in motors.iter().enumerate() {
            if let Err(trouble) = motor.reliable(gaps[index]) {
                return Some(AxesFailure::Motor { motor: index, trouble });
            }
        }
        let is_level = self.difference < config.stop.get() && self.waiting <= config.patience.get();
        // How far a motor is behind.
        let behind = |motor: usize| match speed.get() {
            up if up > 0.0 => -off[motor],
            down if down < 0.0 => off[motor],
            _ => off[motor].abs(),
        };
        let further = |most, motor| if behind(motor) > behind(most) { motor } else { most };
        (!is_level).then(|| AxesFailure::Lags {
            motor: (0..N).fold(0, further),
            difference: self.difference(),
        })
    }
}

/// Between the greatest and the least of angles in degrees.
pub(super) fn difference<const N: usize>(degrees: &[f32; N]) -> f32 {
    let least = degrees.iter().fold(f32::INFINITY, |least, degrees| least.min(*degrees));
    let greatest =
        degrees.iter().fold(f32::NEG_INFINITY, |greatest, degrees| greatest.max(*degrees));
    greatest - least
}

#[cfg(test)]
mod tests {
    use super::super::Health;
    use super::*;
    use crate::TotalAngle;
    use crate::units::RpmPerSecond;

    const DT: Seconds = Seconds::new(0.01);
    const CONFIG: AxesConfig = AxesConfig {
        wait: Degrees::new(10.0),
        stop: Degrees::new(30.0),
        patience: Seconds::new(0.1),
        coupling: 0.5,
        correction: Degrees::new(4.0),
    };

    fn motors<const N: usize>(degrees: [i32; N]) -> [Measured; N] {
        degrees.map(|at| Measured { angle: TotalAngle::from_degrees(at), ..Measured::default() })
    }

    fn step<const N: usize>(axes: &mut Axes<N>, degrees: [i32; N]) -> [MotorCommand; N] {
        step_at(20.0, axes, degrees)
    }

    fn step_at<const N: usize>(
        rpm: f32,
        axes: &mut Axes<N>,
        degrees: [i32; N],
    ) -> [MotorCommand; N] {
        axes.update(&CONFIG, &setpoint(rpm), &motors(degrees), DT)
    }

    fn setpoint(rpm: f32) -> AngleSetpoint {
        let (speed, acceleration) = (Rpm::new(rpm), RpmPerSecond::new(200.0));
        AngleSetpoint { angle: TotalAngle::from_degrees(100), speed, acceleration }
    }

    #[test]
    fn the_pace_falls_from_the_first_bound_to_halfway_and_corrections_are_limited() {
        let mut axes = Axes::<4>::new();
        for (hindmost, pace) in [(100, 1.0), (90, 1.0), (85, 0.5), (80, 0.0), (75, 0.0)] {
            let commands = step(&mut axes, [100, 100, hindmost, 100]);
            assert!((axes.pace() - pace).abs() < 1e-6);
            for command in commands {
                let MotorCommand::Angle(told) = command else { panic!("{command:?}") };
                let correction = told.angle.minus(TotalAngle::from_degrees(100)).degrees().get();
                assert!((told.speed.get() - 20.0 * pace).abs() < 1e-4 && correction.abs() <= 4.0);
                assert!((told.acceleration.get() - 200.0 * pace * pace).abs() < 1e-3);
            }
        }
        assert_eq!(axes.failure(), None);
        // 4 degrees behind, the mean 1: the others give way by a half, it is hurried by one and a half.
        let moved = step(&mut axes, [100, 100, 96, 100]).map(|command| match command {
            MotorCommand::Angle(told) => told.angle.microdegrees() - 100_000_000,
            _ => panic!("{command:?}"),
        });
        assert_eq!(moved, [-500_000, -500_000, 1_500_000, -500_000]);
    }

    #[test]
    fn beyond_the_second_bound_all_stop_and_it_says_which_lags() {
        for (degrees, rpm, motor) in [
            ([100, 70, 99, 101], 20.0, 1),
            ([100, 70, 99, 101], -20.0, 3),
            ([101, 131, 100, 101], 20.0, 2),
            ([101, 131, 100, 101], 0.0, 1),
        ] {
            let mut axes = Axes::<4>::new();
            assert_eq!(step_at(rpm, &mut axes, degrees), [MotorCommand::Coast; 4]);
            let Some(AxesFailure::Lags { motor: named, difference }) = axes.failure() else {
                panic!("{axes:?}");
            };
            assert!(axes.pace().abs() < f32::EPSILON, "{axes:?}");
            assert_eq!((named, difference), (motor, Degrees::new(31.0)));
            assert_eq!(step(&mut axes, [100; 4]), [MotorCommand::STOP; 4]);
            axes.reset();
            assert_eq!(step(&mut axes, [100; 4])[0], MotorCommand::Angle(setpoint(20.0)));
        }
    }

    #[test]
    fn waiting_ends() {
        let mut axes = Axes::<2>::new();
        let waited = (1..).find(|_| step(&mut axes, [101, 80]) == [MotorCommand::Coast; 2]);
        assert_eq!(waited, Some(11));
        assert!(matches!(axes.failure(), Some(AxesFailure::Lags { motor: 1, .. })));
        // At half its pace it does not wait.
        let mut axes = Axes::<2>::new();
        for _ in 0..1000 {
            step(&mut axes, [100, 85]);
        }
        assert_eq!(axes.failure(), None);
        // Short waits are not added up, whichever lags.
        for (foremost, hindmost) in [(101, 80), (80, 101)] {
            for _ in 0..10 {
                for _ in 0..10 {
                    step(&mut axes, [foremost, hindmost]);
                }
                step(&mut axes, [100, 85]);
            }
            assert_eq!(axes.failure(), None);
        }
    }

    #[test]
    fn a_motor_that_cannot_be_relied_on_stops_all() {
        let good = motors([100, 100]);
        for (bad, trouble) in [
            (Measured { health: Health::Offline, ..good[1] }, Trouble::Offline),
            (Measured { health: Health::Faulty, ..good[1] }, Trouble::Faulty),
            (Measured { speed: Rpm::new(f32::NAN), ..good[1] }, Trouble::NotFinite),
            (Measured { gaps: 1, ..good[1] }, Trouble::AngleGap),
        ] {
            let mut axes = Axes::<2>::new();
            let mut step = |second| {
                let motors = [good[0], second];
                axes.update(&CONFIG, &AngleSetpoint::at(good[0].angle), &motors, DT);
                (axes.failure(), axes.pace())
            };
            assert_eq!(step(good[1]), (None, 1.0));
            // And the setpoint stands, until they are reset.
            let failed = (Some(AxesFailure::Motor { motor: 1, trouble }), 0.0);
            assert_eq!([step(bad), step(good[1])], [failed; 2]);
        }
    }

    #[test]
    fn bad_input_changes_nothing() {
        let mut axes = Axes::<2>::new();
        step(&mut axes, [100, 90]);
        let before = axes;
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let zero = AngleSetpoint::at(TotalAngle::ZERO);
            axes.update(&CONFIG, &zero, &motors([0, 90]), Seconds::new(bad));
        }
        axes.update(&CONFIG, &setpoint(f32::NAN), &motors([0, 90]), DT);
        assert_eq!(axes, before);
    }

    #[test]
    fn the_configuration_is_checked() {
        assert_eq!(CONFIG.validate(), Ok(()));
        for (bad, field) in [
            (AxesConfig { wait: Degrees::ZERO, ..CONFIG }, "wait"),
            (AxesConfig { stop: CONFIG.wait, ..CONFIG }, "stop"),
            (AxesConfig { patience: Seconds::ZERO, ..CONFIG }, "patience"),
            (AxesConfig { coupling: -0.1, ..CONFIG }, "coupling"),
            (AxesConfig { correction: Degrees::new(f32::NAN), ..CONFIG }, "correction"),
        ] {
            assert_eq!(bad.validate().unwrap_err().field, field);
        }
    }
}
