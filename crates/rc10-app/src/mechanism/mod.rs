//! Mechanisms: homing, soft limits, jams, axes of several motors, feeders that count.
//!
//! Each is a state machine: measurements and time go in, a [`MotorCommand`] for the motor comes out. None
//! knows a motor or a bus. Angles are [`TotalAngle`]s, exact over many turns. Efforts are in the
//! motor's own unit: A, N m, or a share of the full voltage.
//!
//! | type | what it does |
//! |---|---|
//! | [`Homing`] | finds the zero of an axis by a hard stop, a switch or an index |
//! | [`AbsoluteEncoder`] | finds it without a motion, where the encoder is absolute |
//! | [`SoftLimits`] | keeps commands within a range, with room to brake |
//! | [`Jam`] | detects a jam, reverses, tries again, gives up |
//! | [`Axes`], [`AxesHoming`] | two or more motors that drive one thing and must not drift apart |
//! | [`Feeder`] | feeds a number of pieces, counted by angle |
//!
//! Each tells its [`Stage`], in words for a log, a page and a report.
//!
//! A loop that has pushed against something keeps that effort while it sees no error. So every stop
//! begins with one [`MotorCommand::Coast`], which resets the loop, then [`MotorCommand::STOP`].

mod absolute;
mod axes;
mod axes_homing;
mod contact;
mod feeder;
mod homing;
mod jam;
mod soft_limits;
mod stage;

pub use absolute::{AbsoluteEncoder, OutOfTravel};
pub use axes::{Axes, AxesConfig, AxesFailure};
pub use axes_homing::{AxesHoming, AxesHomingConfig, AxesHomingFailure, AxesHomingStatus};
pub use feeder::{Feeder, FeederConfig};
pub use homing::{Homing, HomingConfig, HomingFailure, HomingStatus, Phase, Reference};
pub use jam::{Jam, JamConfig, JamStatus};
pub use soft_limits::{Limit, Limited, SoftLimits};
pub use stage::Stage;

use crate::config::{ConfigError, not_negative, positive};
use crate::maths::fast_sqrt;
use crate::ok;
use crate::profile::AngleSetpoint;
use crate::units::{Degrees, Direction, Rpm, RpmPerSecond, Seconds};
use crate::{TotalAngle, maths};

/// 1 rpm in degrees a second.
const DEGREES_PER_SECOND: f32 = 6.0;

/// A command to one motor, at its output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MotorCommand {
    /// No effort.
    #[default]
    Coast,
    /// A speed.
    Speed(Rpm),
    /// An angle that moves: where it is now, and for feed-forward its speed and acceleration.
    Angle(AngleSetpoint),
}

impl MotorCommand {
    /// Come to a stand and stay.
    pub const STOP: Self = Self::Speed(Rpm::ZERO);

    /// An angle that stands.
    pub const fn hold(angle: TotalAngle) -> Self {
        Self::Angle(AngleSetpoint::at(angle))
    }

    /// A command that counts angles from `zero`, as the motor counts them.
    ///
    /// ```
    /// use rc10_app::TotalAngle;
    /// use rc10_app::mechanism::MotorCommand;
    /// let degrees = TotalAngle::from_degrees;
    /// let lift = MotorCommand::hold(degrees(90)); // counted from the bottom
    /// assert_eq!(lift.shifted(degrees(1000)), MotorCommand::hold(degrees(1090)));
    /// ```
    #[must_use]
    pub const fn shifted(self, zero: TotalAngle) -> Self {
        match self {
            Self::Coast | Self::Speed(_) => self,
            Self::Angle(setpoint) => {
                Self::Angle(AngleSetpoint { angle: setpoint.angle.plus(zero), ..setpoint })
            }
        }
    }
}

/// The newest measurements of a motor, at its output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub struct Measured {
    /// Angle of many turns.
    pub angle: TotalAngle,
    /// Speed.
    pub speed: Rpm,
    /// Effort in the motor's unit, positive forward; 0 from a motor that does not tell.
    pub effort: f32,
    /// Number of times that the motor's turns had to be estimated.
    pub gaps: u32,
    /// Whether the motor can be used.
    pub health: Health,
}

/// Whether a motor can be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Health {
    /// The motor can be used.
    #[default]
    Ready,
    /// The motor is not heard.
    Offline,
    /// The motor reports a fault.
    Faulty,
}

/// Why the measurements of a motor cannot be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Trouble {
    /// [`Health::Offline`].
    Offline,
    /// [`Health::Faulty`].
    Faulty,
    /// A measurement is infinite or NaN.
    NotFinite,
    /// The motor's turns had to be estimated: its angle may have jumped.
    AngleGap,
}

impl Measured {
    /// The same with its angle counted from `zero`.
    pub const fn counted_from(self, zero: TotalAngle) -> Self {
        Self { angle: self.angle.minus(zero), ..self }
    }

    /// Whether the motor can be used and everything measured is finite.
    const fn usable(&self) -> Result<(), Trouble> {
        match self.health {
            Health::Offline => Err(Trouble::Offline),
            Health::Faulty => Err(Trouble::Faulty),
            Health::Ready if self.speed.is_finite() && self.effort.is_finite() => Ok(()),
            Health::Ready => Err(Trouble::NotFinite),
        }
    }

    /// The same, and its angle has not jumped since there were `gaps`.
    const fn reliable(&self, gaps: u32) -> Result<(), Trouble> {
        match self.usable() {
            Ok(()) if self.gaps != gaps => Err(Trouble::AngleGap),
            other => other,
        }
    }
}

/// How a motor brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Braking {
    /// The deceleration reached for sure with load; > 0: half the loops' acceleration limit.
    pub acceleration: RpmPerSecond,
    /// Longest time from measurement to motion: task, bus and loop; 0 or more.
    pub reaction: Seconds,
}

impl Braking {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(positive("acceleration", self.acceleration.get()));
        not_negative("reaction", self.reaction.get())
    }

    /// The way to a stand from a speed, 0 or more: v·t + v² / 2a.
    #[must_use]
    pub fn way(&self, speed: Rpm) -> Degrees {
        let speed = speed.get().abs() * DEGREES_PER_SECOND;
        let acceleration = self.acceleration.get() * DEGREES_PER_SECOND;
        Degrees::new(speed * self.reaction.get() + speed * speed / (2.0 * acceleration))
    }

    /// The largest speed whose [`way`](Self::way) to a stand fits; zero if that is not positive.
    ///
    /// ```
    /// use rc10_app::mechanism::Braking;
    /// use rc10_app::{Degrees, Rpm, RpmPerSecond, Seconds};
    /// let (acceleration, reaction) = (RpmPerSecond::new(500.0), Seconds::new(0.02));
    /// let braking = Braking { acceleration, reaction };
    /// let way = braking.way(Rpm::new(60.0)).get();
    /// assert!((way - 28.8).abs() < 1e-4); // 7.2 at 360 deg/s, then 21.6
    /// assert!((braking.speed(Degrees::new(way)).get() - 60.0).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn speed(&self, way: Degrees) -> Rpm {
        let (way, reaction) = (way.get(), self.reaction.get());
        if !way.is_finite() || way <= 0.0 {
            return Rpm::ZERO;
        }
        let acceleration = self.acceleration.get() * DEGREES_PER_SECOND;
        // The positive root of v·t + v² / 2a = way, without a difference of nearly equal numbers.
        let square = 2.0 * way / acceleration;
        let root = fast_sqrt(reaction * reaction + square) + reaction;
        // A way too short to compute with counts as zero.
        let time = if root > 0.0 { square / root } else { 0.0 };
        Rpm::new(self.acceleration.get() * time)
    }
}

/// When a motor counts as stalled: it pushes, and hardly moves, for a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stall {
    /// Effort from which it pushes, in the motor's unit; 0 or more, above friction and load.
    pub effort: f32,
    /// Speed below which it hardly moves; > 0.
    pub standstill: Rpm,
    /// For this long without a break; > 0, longer than a start takes to exceed `standstill`.
    pub time: Seconds,
}

impl Stall {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(not_negative("effort", self.effort));
        ok!(positive("standstill", self.standstill.get()));
        positive("time", self.time.get())
    }
}

/// For how long a motor has been pushing without moving, and since which angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct StallTimer {
    time: f32,
    began: TotalAngle,
}

impl StallTimer {
    /// One step: the angle where the stall began, once long enough. `towards` is its way, if any.
    fn update(
        &mut self,
        stall: &Stall,
        measured: &Measured,
        towards: Option<Direction>,
        dt: Seconds,
    ) -> Option<TotalAngle> {
        let pushes = towards.is_some_and(|towards| {
            measured.effort * f32::from(towards.sign()) >= stall.effort
                && measured.speed.get().abs() < stall.standstill.get()
        });
        if !pushes {
            *self = Self::default();
            return None;
        }
        if self.time <= 0.0 {
            self.began = measured.angle;
        }
        self.time += dt.get();
        (self.time >= stall.time.get()).then_some(self.began)
    }
}

/// From one angle to another in a direction, in degrees.
const fn way(from: TotalAngle, to: TotalAngle, towards: Direction) -> f32 {
    to.minus(from).degrees().get() * towards.sign() as f32
}

/// The nearest angle to a small number of degrees; zero for what is not finite.
fn small_angle(degrees: f32) -> TotalAngle {
    TotalAngle::from_microdegrees(maths::round_to_i32(degrees * 1e6).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::tests::Random;

    #[test]
    fn the_speed_to_brake_from_is_the_inverse_of_the_way() {
        let mut random = Random(11);
        for _ in 0..1000 {
            let acceleration = RpmPerSecond::new(1000.0 + random.within(990.0));
            let braking =
                Braking { acceleration, reaction: Seconds::new(0.05 + random.within(0.05)) };
            let speed = 100.0 + random.within(100.0);
            let back = braking.speed(braking.way(Rpm::new(-speed))).get();
            assert!((back - speed).abs() < 1e-3 * speed + 0.01, "{speed}: {back}, {braking:?}");
        }
        let braking =
            Braking { acceleration: RpmPerSecond::new(500.0), reaction: Seconds::new(0.01) };
        for no_way in [0.0, -1.0, 1e-45, f32::NAN, f32::INFINITY] {
            assert_eq!(braking.speed(Degrees::new(no_way)), Rpm::ZERO);
        }
    }

    #[test]
    fn a_stall_lasts_without_a_break() {
        let time = Seconds::new(0.045);
        let stall = Stall { effort: 5.0, standstill: Rpm::new(2.0), time };
        let mut timer = StallTimer::default();
        let mut step = |effort, rpm, degrees| {
            let angle = TotalAngle::from_degrees(degrees);
            let measured = Measured { angle, speed: Rpm::new(rpm), effort, ..Measured::default() };
            timer.update(&stall, &measured, Some(Direction::Forward), Seconds::new(0.01))
        };
        for _ in 0..4 {
            assert_eq!(step(6.0, 1.0, 70), None);
        }
        // It moves, it does not push, it pushes the other way: each begins anew.
        for (effort, rpm) in [(6.0, 3.0), (4.0, 1.0), (-6.0, 1.0)] {
            assert_eq!(step(effort, rpm, 71), None);
            for tick in 0..4 {
                assert_eq!(step(6.0, -1.0, 72 + tick), None);
            }
        }
        assert_eq!(step(6.0, 0.0, 76), Some(TotalAngle::from_degrees(72)));
    }

    #[test]
    fn the_configuration_is_checked() {
        let braking =
            Braking { acceleration: RpmPerSecond::new(500.0), reaction: Seconds::new(0.0) };
        assert_eq!(braking.validate(), Ok(()));
        let bad = Braking { acceleration: RpmPerSecond::ZERO, ..braking };
        assert_eq!(bad.validate().unwrap_err().field, "acceleration");
        let bad = Braking { reaction: Seconds::new(-0.1), ..braking };
        assert_eq!(bad.validate().unwrap_err().field, "reaction");
        let stall = Stall { effort: 0.0, standstill: Rpm::new(1.0), time: Seconds::new(0.1) };
        assert_eq!(stall.validate(), Ok(()));
        let bad = Stall { effort: -1.0, ..stall };
        assert_eq!(bad.validate().unwrap_err().field, "effort");
        let bad = Stall { standstill: Rpm::ZERO, ..stall };
        assert_eq!(bad.validate().unwrap_err().field, "standstill");
        let bad = Stall { time: Seconds::new(f32::NAN), ..stall };
        assert_eq!(bad.validate().unwrap_err().field, "time");
    }
}
