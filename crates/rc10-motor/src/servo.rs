//! The servo: an effort or spring from a [`Target`], by a [`Cascade`], with soft starts and stops.
//!
//! ```
//! use rc10_app::{Cascade, Direction, FeedForward, Gear, PidConfig, Rpm, RpmPerSecond};
//! use rc10_time::Micros;
//! use rc10_motor::servo::Servo;
//! use rc10_motor::shaft::Shaft;
//! use rc10_motor::{DriveMode, Target, TargetKind, Tick};
//!
//! // Efforts in N m.
//! let cascade = Cascade {
//!     speed: PidConfig::within(3.0).kp(0.05).ki(0.5),
//!     angle: PidConfig::within(100.0).kp(3.0),
//!     outer_divider: 1,
//!     acceleration: RpmPerSecond::new(500.0),
//!     feed_forward: FeedForward::NONE,
//! };
//! let mut servo = Servo::new(TargetKind::Torque, cascade)?;
//! servo.set_target(Target::Speed(Rpm::new(60.0)))?;
//! let mut shaft = Shaft::new(4096, Gear::DIRECT, Direction::Forward);
//! shaft.follow(0, 0.0, Micros::from_millis(1));
//! servo.update(&Tick::new(DriveMode::Run), &shaft);
//! assert!(servo.effort() > 0.0 && servo.effort() < 3.0);
//! servo.update(&Tick::new(DriveMode::Coast), &shaft);
//! assert!(servo.effort().abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use core::f32::consts::TAU;

use rc10_app::angle::{degrees_within_turn, shortest_way};
use rc10_app::cascade::{Seek, Step};
use rc10_app::maths::{round_to_i32, within};
use rc10_app::{
    Cascade, CascadeState, ConfigError, Degrees, Gravity, PidConfig, Rpm, Seconds, TotalAngle,
};

use crate::goal::{Goal, Goals, Moment};
use crate::motor::{DriveMode, Loops, Tick, Withheld};
use crate::pending::Outcome;
use crate::request::{Gains, Request, Response};
use crate::shaft::{Shaft, TURN};
use crate::target::{Impedance, Target, TargetError, TargetKind, TargetSet};

/// Follows targets by an effort, or by a spring that the device makes.
///
/// Efforts have the unit of the target for one: amperes, newton metres, or a share of the voltage.
#[derive(Clone, Copy, Debug)]
#[must_use]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Servo {
    effort: TargetKind,
    goals: Goals,
    cascade: Cascade,
    /// Largest effort of the device.
    full: f32,
    /// Largest effort of the speed loop by its own gains.
    loop_limit: f32,
    limit: f32,
    /// What the target does not get of its largest effort.
    withheld: Withheld,
    /// Whether the loops have less than the limit.
    is_limited: bool,
    /// Whether it followed its target in the last tick.
    ran: bool,
    state: CascadeState,
    /// The springs that the device can make, if it can make any.
    springs: Option<SpringRange>,
    /// The spring decided last; `None` while an effort drives.
    spring: Option<Spring>,
    /// The share of the limit that a spring may use, 0 ..= 1: it rises in a soft start.
    softness: f32,
}

/// The springs that a device can make.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct SpringRange {
    /// Largest stiffness, N m/rad.
    pub kp: f32,
    /// Largest damping, N m s/rad.
    pub kd: f32,
    /// Largest speed.
    pub speed: Rpm,
}

/// A spring and a damper as the device shall make them, at the output shaft.
///
/// torque = `kp` · `way` + `kd` · (`speed` - measured) + `torque`
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Spring {
    /// The way left to where the spring pulls to.
    pub way: Degrees,
    /// The speed at which the damper does nothing.
    pub speed: Rpm,
    /// Torque on top, N m.
    pub torque: f32,
    /// Stiffness, N m/rad.
    pub kp: f32,
    /// Damping, N m s/rad.
    pub kd: f32,
}

/// Share of the limit that a jog may use.
const JOG_SHARE: f32 = 0.2;
/// Share of the limit by which the torque of a spring may grow in a second: all of it in 20 ms.
const SOFT_SLOPE: f32 = 50.0;

impl Servo {
    /// Efforts are those of `effort` ([`TargetKind::Current`], [`TargetKind::Torque`] or
    /// [`TargetKind::Duty`]); the largest is the speed loop's output limit. [`ConfigError`] names a
    /// field that cannot be used.
    pub fn new(effort: TargetKind, cascade: Cascade) -> Result<Self, ConfigError> {
        cascade.validate()?;
        Ok(Self::of(effort, cascade))
    }

    /// The same with gains that are known to be good.
    pub(crate) const fn of(effort: TargetKind, cascade: Cascade) -> Self {
        use TargetKind::{Angle, Coast, Motion, Speed, SpeedMotion, TotalAngle};
        let kinds = [Coast, effort, Speed, Angle, TotalAngle, Motion, SpeedMotion];
        let full = cascade.speed.output_limit;
        Self {
            effort,
            goals: Goals::new(TargetSet::of(&kinds)),
            cascade,
            full,
            loop_limit: full,
            limit: full,
            withheld: Withheld::NONE,
            is_limited: false,
            ran: false,
            state: CascadeState::new(),
            springs: None,
            spring: None,
            softness: 0.0,
        }
    }

    /// With a largest effort that may be above the speed loop's output limit.
    pub const fn with_full_scale(mut self, full: f32) -> Self {
        (self.full, self.limit) = (full, full);
        self.apply_limit();
        self
    }

    /// For a device that makes springs: it takes [`Target::Impedance`] too. Efforts are torques.
    pub const fn with_springs(mut self, range: SpringRange) -> Self {
        self.goals = Goals::new(self.goals.supports().with(TargetKind::Impedance));
        self.springs = Some(range);
        self
    }

    /// Coasting, the effort itself, speeds, angles and motions; impedances [if its device makes
    /// springs](Self::with_springs).
    pub const fn supports(&self) -> TargetSet {
        self.goals.supports()
    }

    /// Takes a new target; it takes effect in the next [`update`](Self::update).
    ///
    /// # Errors
    /// [`TargetError`]; the old target stays. `OutOfRange` for a spring beyond the device's.
    pub fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        if let (Target::Impedance(impedance), Some(range)) = (&target, &self.springs) {
            self.supports().accepts(&target)?;
            range.check(impedance)?;
        }
        self.goals.set_target(target)?;
        if target.kind() != TargetKind::Impedance {
            self.spring = None;
        }
        self.withheld = Withheld::NONE;
        Ok(())
    }

    /// Withholds a part of the largest effort from the target that it has, a speed, an angle or a motion; the next one
    /// has all of it again, and so has whatever stops it.
    pub fn withhold(&mut self, withheld: Withheld) {
        (self.withheld, self.is_limited) = (withheld, true);
    }

    /// The loops of a tick with less than the limit, or of the first one that has all of it again. Returns full scale.
    #[cold]
    fn limit_tick(&mut self, is_jog: bool, measured: f32) -> f32 {
        self.is_limited = is_jog || self.withheld.is_any();
        // It runs with gains from a PC: never with much effort.
        let full = if is_jog { self.limit * JOG_SHARE } else { self.limit };
        // By whether the last tick drove or braked, or this one is about to.
        let effort = self.effort();
        let push = if effort == 0.0 { self.state.reference() - measured } else { effort };
        let Withheld { driving, braking } = if self.ran { self.withheld } else { Withheld::NONE };
        let left = 1.0 - if push * measured >= 0.0 { driving } else { braking };
        self.cascade.speed.output_limit = self.loop_limit.min(full) * left.clamp(0.0, 1.0);
        full
    }

    /// The target it has.
    pub fn target(&self) -> Target {
        self.goals.target()
    }

    /// The effort decided last.
    pub const fn effort(&self) -> f32 {
        self.state.effort()
    }

    /// The spring decided last; `None` while it is an [`effort`](Self::effort).
    pub const fn spring(&self) -> Option<&Spring> {
        self.spring.as_ref()
    }

    /// One step. A shaft that was never measured gets no effort.
    pub fn update(&mut self, tick: &Tick, shaft: &Shaft) {
        if !shaft.is_known() {
            return self.rest();
        }
        let goal = if tick.mode == DriveMode::Run {
            self.ran = true;
            *self.goals.goal()
        } else {
            self.stop(tick.mode, shaft)
        };
        self.pursue(goal, tick, shaft);
    }

    /// The goal of a tick that does not follow the target.
    fn stop(&mut self, mode: DriveMode, shaft: &Shaft) -> Goal {
        self.spring = None;
        if core::mem::take(&mut self.ran) {
            self.goals.rest();
            if matches!(mode, DriveMode::Brake | DriveMode::Hold) {
                self.state.start_over(mode == DriveMode::Hold);
            }
        }
        let acceleration = self.cascade.acceleration.get();
        self.goals.update(mode, || Some(stand(shaft, acceleration)))
    }

    pub(crate) const fn goals(&self) -> &Goals {
        &self.goals
    }

    /// One step in [`DriveMode::Run`] towards an angle that stands for the one of the target: for a
    /// device that may have to go the longer way round. The shaft has been measured.
    pub(crate) fn update_towards(&mut self, tick: &Tick, shaft: &Shaft, angle: TotalAngle) {
        self.ran = true;
        self.goals.rest();
        self.pursue(Goal::Total(angle), tick, shaft);
    }

    /// One step towards a goal, of a shaft that has been measured.
    fn pursue(&mut self, goal: Goal, tick: &Tick, shaft: &Shaft) {
        let (seek, effort) = match goal {
            Goal::Rest => return self.state.rest(),
            Goal::Effort(effort) => return self.state.give(effort, self.limit, tick.dt),
            Goal::Impedance(angle) => {
                return self.impede(way(angle, shaft), shaft.speed().get(), tick.dt);
            }
            Goal::Speed(rpm) => (Seek::Speed(rpm), 0.0),
            Goal::Angle(phase) => {
                (Seek::Angle(degrees(shortest_way(shaft.phase(), phase, TURN))), 0.0)
            }
            Goal::Total(angle) => (Seek::Angle(way(angle, shaft)), 0.0),
            Goal::Motion => self.motion(tick.dt, shaft),
        };
        let weight = match self.cascade.feed_forward.gravity {
            Gravity::None => 0.0,
            gravity => gravity.at(degrees_within_turn(shaft.phase())),
        };
        let (measured, load, mut full) = (shaft.speed().get(), effort + weight, self.limit);
        if self.is_limited || tick.is_jog {
            full = self.limit_tick(tick.is_jog, measured);
        }
        let step = Step { measured, load, full, dt: tick.dt, count: tick.count };
        self.state.seek(&self.cascade, &seek, &step);
    }

    /// Where a motion is after one more tick, and the effort that goes with it.
    fn motion(&mut self, dt: Seconds, shaft: &Shaft) -> (Seek, f32) {
        let Moment { motion, gone } = self.goals.advance(dt);
        let seek = Seek::Motion {
            way: motion.angle.map(|angle| way(angle, shaft) + gone),
            speed: motion.speed.get(),
            acceleration: motion.acceleration.get(),
            inertia: motion.inertia,
        };
        (seek, motion.effort)
    }

    /// No effort, and whatever drives next starts softly: while the device cannot follow.
    pub fn rest(&mut self) {
        (self.ran, self.spring) = (false, None);
        self.goals.rest();
        self.state.rest();
    }

    /// Counts all angles from `zero`, as measured until now; what is sought stays where it is.
    pub fn set_zero(&mut self, zero: TotalAngle) {
        self.goals.set_zero(zero);
    }

    /// Never more effort than this, nor than full scale. An error, with the name of the `field`, if
    /// it is negative or NaN.
    pub fn set_limit(&mut self, field: &'static str, limit: f32) -> Result<(), ConfigError> {
        if limit.is_nan() || limit < 0.0 {
            return Err(ConfigError::new(field, limit, "zero or more"));
        }
        self.limit = limit.min(self.full);
        self.apply_limit();
        Ok(())
    }

    /// The speed loop never asks for more than the limit.
    const fn apply_limit(&mut self) {
        self.cascade.speed.output_limit = self.own_limit();
    }

    /// The speed loop's limit, whatever the target withholds.
    const fn own_limit(&self) -> f32 {
        self.loop_limit.min(self.limit)
    }

    /// The quantity of its effort, its gains and limits.
    pub const fn loops(&self) -> Loops {
        let mut cascade = self.cascade;
        cascade.speed.output_limit = self.own_limit();
        Loops { effort: self.effort, cascade }
    }

    /// Carries out what a servo can: the zero of its shaft, gains, and the limit of its own effort.
    ///
    /// # Errors
    /// [`RequestError`](crate::RequestError); nothing changed. Its `Unsupported` for what the motor has to do.
    pub fn request(&mut self, request: Request, shaft: &mut Shaft) -> Outcome {
        match request {
            Request::SpeedGains(gains) => with_gains(&mut self.cascade.speed, gains)?,
            Request::AngleGains(gains) => with_gains(&mut self.cascade.angle, gains)?,
            Request::CurrentLimit(limit) if self.effort == TargetKind::Current => {
                self.set_limit("current limit", limit.get())?;
                return Ok(Response::Done);
            }
            Request::TorqueLimit(limit) if self.effort == TargetKind::Torque => {
                self.set_limit("torque limit", limit.get())?;
                return Ok(Response::Done);
            }
            _ => return self.goals.request(request, shaft),
        }
        self.state.change_gains(&self.cascade, shaft.speed().get());
        Ok(Response::Done)
    }

    /// Decides the spring of a tick. Too much torque is taken back by one factor: its place stays.
    fn impede(&mut self, way: f32, measured: f32, dt: Seconds) {
        let Target::Impedance(Impedance { speed, torque, kp, kd, .. }) = self.target() else {
            return self.rest();
        };
        let slip = (speed.get() - measured) * (TAU / 60.0);
        self.state.rest();
        let softness = if self.spring.is_some() { self.softness } else { 0.0 };
        self.softness = (softness + SOFT_SLOPE * dt.get()).min(1.0);
        let torque = within(torque.get(), self.limit);
        let law = kp * way.to_radians() + kd * slip + torque;
        let limit = self.limit * self.softness;
        let share = if law.abs() > limit { limit / law.abs() } else { 1.0 };
        self.spring = Some(Spring {
            way: Degrees::new(way),
            speed,
            torque: torque * share,
            kp: kp * share,
            kd: kd * share,
        });
    }
}

impl SpringRange {
    fn check(&self, impedance: &Impedance) -> Result<(), TargetError> {
        let Impedance { speed, kp, kd, .. } = impedance;
        let is_good = (0.0..=self.kp).contains(kp)
            && (0.0..=self.kd).contains(kd)
            && speed.get().abs() <= self.speed.get();
        if is_good { Ok(()) } else { Err(TargetError::OutOfRange(TargetKind::Impedance)) }
    }
}

/// The angle at which a turning shaft stands: the present one would throw it back. rpm/s.
fn stand(shaft: &Shaft, acceleration: f32) -> TotalAngle {
    // s = v² / 2 a, in degrees and rpm: 1 rpm = 6 degrees a second.
    let rpm = shaft.speed().get();
    let microdegrees = round_to_i32(3e6 * rpm * rpm.abs() / acceleration);
    shaft.angle().plus(TotalAngle::from_microdegrees(microdegrees.into()))
}

/// The distance to an angle, in degrees.
fn way(angle: TotalAngle, shaft: &Shaft) -> f32 {
    let way = angle.minus(shaft.angle()).microdegrees();
    // Six turns away, some more or less do not matter.
    let way = i32::try_from(way).unwrap_or(if way < 0 { i32::MIN } else { i32::MAX });
    degrees(way)
}

#[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of the way to go")]
fn degrees(microdegrees: i32) -> f32 {
    microdegrees as f32 * 1e-6
}

fn with_gains(pid: &mut PidConfig, gains: Gains) -> Result<(), ConfigError> {
    // Its limits stand already; one of them may be zero.
    PidConfig::within(1.0).with_gains(gains).validate()?;
    *pid = pid.with_gains(gains);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::RequestError;
    use rc10_app::{Amps, Direction, Gear, NewtonMetres, RpmPerSecond};
    use rc10_time::Micros;

    fn servo() -> Servo {
        let cascade = Cascade {
            speed: PidConfig::within(5.0).kp(0.1),
            angle: PidConfig::within(100.0).kp(3.0),
            outer_divider: 1,
            acceleration: RpmPerSecond::new(1e5),
            feed_forward: rc10_app::FeedForward::NONE,
        };
        Servo::new(TargetKind::Torque, cascade).unwrap()
    }

    fn at(degrees: i32, rpm: f32) -> Shaft {
        let mut shaft = Shaft::new(360, Gear::DIRECT, Direction::Forward);
        shaft.start(degrees.into());
        shaft.measure(rpm, Micros::ZERO);
        shaft
    }

    /// The effort once the soft start is over.
    fn settled(servo: &mut Servo, mode: DriveMode, shaft: Shaft) -> f32 {
        (0..40).for_each(|_| servo.update(&Tick::new(mode), &shaft));
        servo.effort()
    }

    #[test]
    fn an_angle_within_the_turn_is_sought_the_shorter_way() {
        let mut servo = servo();
        for (wanted, from, sign) in
            [(350.0, 10, -1.0), (10.0, 350, 1.0), (-10.0, 370, -1.0), (90.0, -300, 1.0)]
        {
            servo.set_target(Target::Angle(Degrees::new(wanted))).unwrap();
            let effort = settled(&mut servo, DriveMode::Run, at(from, 0.0));
            assert!(effort * sign > 0.5, "{wanted} from {from}: {effort}");
        }
    }

    #[test]
    fn total_angles_are_exact_after_many_turns() {
        let mut servo = servo();
        let far = 360 * 5_000_000;
        servo.set_target(Target::TotalAngle(TotalAngle::from_degrees(far))).unwrap();
        let effort = settled(&mut servo, DriveMode::Run, at(far - 1, 0.0));
        assert!((effort - 0.3).abs() < 1e-3, "{effort}");
        assert!((settled(&mut servo, DriveMode::Run, at(0, 0.0)) - 5.0).abs() < 1e-3);
    }

    #[test]
    fn a_share_of_the_effort_is_withheld_from_a_target_and_not_from_a_stop() {
        let mut servo = servo();
        for (driving, most) in [(0.0, 5.0), (0.6, 2.0), (1.0, 0.0), (1.5, 0.0), (-1.0, 5.0)] {
            for (braking, most_braking) in [(0.0, 5.0), (0.8, 1.0), (1.0, 0.0)] {
                for sign in [1.0, -1.0] {
                    let withheld = Withheld { driving, braking };
                    let mut is = |mode, speed, wanted: f32| {
                        // Given again, also while it is stopped, it changes nothing of the stop.
                        servo.set_target(Target::Speed(Rpm::new(sign * 400.0))).unwrap();
                        servo.withhold(withheld);
                        let effort = settled(&mut servo, mode, at(10, sign * speed)) * sign;
                        assert!((effort - wanted).abs() < 1e-3, "{withheld:?} {mode:?}: {effort}");
                        // What its loops are is not what a target leaves of them.
                        assert!((servo.loops().cascade.speed.output_limit - 5.0).abs() < 1e-6);
                    };
                    is(DriveMode::Run, 0.0, most);
                    is(DriveMode::Brake, 400.0, -5.0);
                    is(DriveMode::Hold, 400.0, -5.0);
                    is(DriveMode::Run, 100.0, most);
                    // It is turned the other way: that is to brake.
                    is(DriveMode::Run, -100.0, most_braking);
                    servo.rest();
                }
            }
        }
        servo.set_target(Target::Speed(Rpm::new(400.0))).unwrap();
        assert!((settled(&mut servo, DriveMode::Run, at(10, 0.0)) - 5.0).abs() < 1e-3);
    }

    #[test]
    fn it_holds_where_it_comes_to_a_stand_and_brakes_to_no_speed() {
        let mut servo = servo();
        servo.set_target(Target::Torque(NewtonMetres::new(1.0))).unwrap();
        assert!((settled(&mut servo, DriveMode::Run, at(10, 0.0)) - 1.0).abs() < 1e-3);
        assert!(settled(&mut servo, DriveMode::Hold, at(10, 0.0)).abs() < 1e-3);
        assert!(settled(&mut servo, DriveMode::Hold, at(12, 0.0)) < -0.3);
        assert!(settled(&mut servo, DriveMode::Brake, at(12, 30.0)) < -2.9);
        assert!(settled(&mut servo, DriveMode::Coast, at(12, 30.0)).abs() < 1e-9);
        assert!(settled(&mut servo, DriveMode::Off, at(12, 30.0)).abs() < 1e-9);
        assert!(
            settled(&mut servo, DriveMode::Run, Shaft::new(1, Gear::DIRECT, Direction::Forward))
                .abs()
                < 1e-9
        );
    }

    #[test]
    fn setting_zero_moves_nothing() {
        let mut servo = servo();
        servo.set_target(Target::TotalAngle(TotalAngle::from_degrees(100))).unwrap();
        let before = settled(&mut servo, DriveMode::Run, at(99, 0.0));
        servo.set_zero(TotalAngle::from_degrees(99));
        let after = settled(&mut servo, DriveMode::Run, at(0, 0.0));
        assert!((before - after).abs() < 1e-3, "{before} {after}");
        let _ = settled(&mut servo, DriveMode::Hold, at(5, 0.0));
        servo.set_zero(TotalAngle::from_degrees(5));
        assert!(settled(&mut servo, DriveMode::Hold, at(0, 0.0)).abs() < 1e-3);
    }

    #[test]
    fn limits_and_gains_are_checked_and_obeyed() {
        let mut servo = servo();
        let limit = |newton_metres| Request::TorqueLimit(NewtonMetres::new(newton_metres));
        assert!(servo.request(limit(-1.0), &mut at(0, 0.0)).is_err());
        assert!(servo.request(limit(f32::NAN), &mut at(0, 0.0)).is_err());
        assert_eq!(
            servo.request(Request::CurrentLimit(Amps::new(1.0)), &mut at(0, 0.0)),
            Err(RequestError::Unsupported)
        );
        assert_eq!(servo.request(limit(2.0), &mut at(0, 0.0)), Ok(Response::Done));
        servo.set_target(Target::Speed(Rpm::new(1000.0))).unwrap();
        assert!((settled(&mut servo, DriveMode::Run, at(0, 0.0)) - 2.0).abs() < 1e-3);
        servo.set_target(Target::Torque(NewtonMetres::new(9.0))).unwrap();
        assert!((settled(&mut servo, DriveMode::Run, at(0, 0.0)) - 2.0).abs() < 1e-3);
        assert_eq!(servo.request(limit(9.0), &mut at(0, 0.0)), Ok(Response::Done));
        assert!((settled(&mut servo, DriveMode::Run, at(0, 0.0)) - 5.0).abs() < 1e-3);
        let bad = Request::SpeedGains(Gains { kp: -1.0, ..Gains::default() });
        assert!(servo.request(bad, &mut at(0, 0.0)).is_err());
        let wrong = servo.set_target(Target::Current(Amps::new(1.0)));
        assert_eq!(wrong, Err(TargetError::Unsupported(TargetKind::Current)));
    }
}
