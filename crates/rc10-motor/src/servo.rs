//! What lies between a [`Target`] and an effort, for motors whose device only takes an effort: the
//! goal, the loops of a [`Cascade`], and the ways to stop. A motor adds its frames to it.
//!
//! ```
//! use rc10_app::{PidConfig, Rpm, RpmPerSecond, Seconds};
//! use rc10_motor::rc10_app::Cascade;
//! use rc10_motor::servo::{Measured, Servo};
//! use rc10_motor::{DriveMode, Target, TargetKind};
//!
//! // Efforts in N m.
//! let cascade = Cascade {
//!     speed: PidConfig::new(0.05, 0.5, 0.0, 3.0),
//!     angle: PidConfig::new(3.0, 0.0, 0.0, 100.0),
//!     outer_divider: 1,
//!     acceleration: RpmPerSecond::new(500.0),
//!     feed_forward: 0.0,
//! };
//! let mut servo = Servo::new(TargetKind::Torque, cascade)?;
//! servo.set_target(Target::Speed(Rpm::new(60.0)))?;
//! let measured = Some(Measured { rpm: 0.0, microdegrees: 0 });
//! let torque = servo.update(Seconds::new(0.001), DriveMode::Run, measured);
//! assert!(torque > 0.0 && torque < 3.0);
//! assert!(servo.update(Seconds::new(0.001), DriveMode::Coast, measured).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use rc10_app::{ConfigError, CountsPerTurn, Degrees, PidConfig, Seconds};

use crate::motor::{
    DriveMode, Gains, Loops, Request, RequestError, Response, Target, TargetError, TargetKind,
    TargetSet,
};
use rc10_app::cascade::{Cascade, CascadeState};

const TURN: i64 = 360_000_000;

/// Where the output shaft is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Speed, rpm.
    pub rpm: f32,
    /// Angle of many turns from the zero, in millionths of a degree.
    pub microdegrees: i64,
}

/// Follows targets by an effort. Efforts are in the unit of the target that asks for one directly:
/// amperes, newton metres, or a share of the full voltage.
#[derive(Clone, Copy, Debug)]
pub struct Servo {
    effort: TargetKind,
    cascade: Cascade,
    /// Full scale: the output limit the cascade came with.
    full: f32,
    /// Largest effort now.
    limit: f32,
    target: Target,
    goal: Goal,
    /// Where to stay while the bus says hold, microdegrees.
    held: Option<i64>,
    /// Whether it followed its target in the last tick.
    ran: bool,
    state: CascadeState,
}

/// The target in numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Goal {
    Rest,
    Effort(f32),
    Rpm(f32),
    /// Within the turn, microdegrees.
    Angle(i64),
    /// Of many turns, microdegrees.
    Total(i64),
}

impl Servo {
    /// Efforts are those of `effort` ([`TargetKind::Current`], [`TargetKind::Torque`] or
    /// [`TargetKind::Duty`]); the largest is the speed loop's output limit.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn new(effort: TargetKind, cascade: Cascade) -> Result<Self, ConfigError> {
        cascade.validate()?;
        let full = cascade.speed.output_limit;
        Ok(Self {
            effort,
            cascade,
            full,
            limit: full,
            target: Target::Coast,
            goal: Goal::Rest,
            held: None,
            ran: false,
            state: CascadeState::new(),
        })
    }

    /// Coasting, the effort itself, speeds and angles.
    #[must_use]
    pub const fn supports(&self) -> TargetSet {
        use TargetKind::{Angle, Coast, Speed, TotalAngle};
        TargetSet::of(&[Coast, self.effort, Speed, Angle, TotalAngle])
    }

    /// Takes a new target; it takes effect in the next [`update`](Self::update).
    ///
    /// # Errors
    /// [`TargetError`]; the old target stays.
    pub fn set_target(&mut self, target: Target) -> Result<(), TargetError> {
        // The usual case is the same target again; but coasting is also what a target becomes whose
        // number lies elsewhere since a new zero.
        let is_same = target == self.target && (target != Target::Coast || self.goal == Goal::Rest);
        if !is_same {
            self.supports().accepts(&target)?;
            self.goal = goal_of(target);
            self.target = target;
        }
        Ok(())
    }

    /// The target it has.
    #[must_use]
    pub const fn target(&self) -> Target {
        self.target
    }

    /// The effort decided last.
    #[must_use]
    pub const fn effort(&self) -> f32 {
        self.state.effort()
    }

    /// One step; the effort to give. Without a measurement there is none.
    pub fn update(&mut self, dt: Seconds, drive: DriveMode, measured: Option<Measured>) -> f32 {
        let Some(measured) = measured else {
            self.rest();
            return 0.0;
        };
        if drive == DriveMode::Run {
            (self.held, self.ran) = (None, true);
            self.pursue(self.goal, measured, dt);
        } else {
            let ran = core::mem::take(&mut self.ran);
            if ran && matches!(drive, DriveMode::Brake | DriveMode::Hold) {
                self.state.start_over(drive == DriveMode::Hold);
            }
            self.held = match drive {
                DriveMode::Hold => self.held.or_else(|| Some(self.standstill(measured))),
                _ => None,
            };
            let goal = match (drive, self.held) {
                (DriveMode::Brake, _) => Goal::Rpm(0.0),
                (_, Some(microdegrees)) => Goal::Total(microdegrees),
                _ => Goal::Rest,
            };
            self.pursue(goal, measured, dt);
        }
        self.effort()
    }

    /// No effort, and whatever drives next starts softly: while the device cannot follow.
    pub fn rest(&mut self) {
        (self.held, self.ran) = (None, false);
        self.state.rest();
    }

    /// All angles count from `zero` (as measured until now) from now on. What is sought or held
    /// stays where it is.
    pub fn set_zero(&mut self, zero: i64) {
        self.held = self.held.map(|held| held.saturating_sub(zero));
        if let Goal::Total(microdegrees) = self.goal {
            self.goal = Goal::Total(microdegrees.saturating_sub(zero));
            // The same number commanded again lies elsewhere now.
            self.target = Target::Coast;
        }
    }

    /// Never more effort than this, nor than full scale.
    ///
    /// # Errors
    /// [`ConfigError`] with the name of the `field`, if it is negative or NaN.
    pub fn set_limit(&mut self, field: &'static str, limit: f32) -> Result<(), ConfigError> {
        if limit.is_nan() || limit < 0.0 {
            return Err(ConfigError::new(field, limit, "zero or more"));
        }
        self.limit = limit.min(self.full);
        self.cascade.speed.output_limit = self.limit;
        Ok(())
    }

    /// New gains and limits; a limit that was lowered stays lowered.
    ///
    /// # Errors
    /// [`ConfigError`], naming the field that cannot be used.
    pub fn set_cascade(&mut self, cascade: Cascade) -> Result<(), ConfigError> {
        cascade.validate()?;
        self.full = cascade.speed.output_limit;
        self.limit = self.limit.min(self.full);
        self.cascade = cascade;
        self.cascade.speed.output_limit = self.limit;
        Ok(())
    }

    /// Its gains and limits.
    #[must_use]
    pub const fn cascade(&self) -> &Cascade {
        &self.cascade
    }

    /// What its effort is, its gains and limits.
    #[must_use]
    pub const fn loops(&self) -> Loops {
        Loops { effort: self.effort, cascade: self.cascade }
    }

    /// What a servo can do of a request itself: gains, and the limit of its own effort.
    ///
    /// # Errors
    /// [`RequestError`]; nothing changed. [`RequestError::Unsupported`] for what the motor has to do.
    pub fn request(
        &mut self,
        request: Request,
        measured: Option<Measured>,
    ) -> Result<Response, RequestError> {
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
            _ => return Err(RequestError::Unsupported),
        }
        if let Some(measured) = measured {
            let way = way(self.goal, measured);
            self.state.change_gains(&self.cascade, measured.rpm, way);
        }
        Ok(Response::Done)
    }

    fn pursue(&mut self, goal: Goal, measured: Measured, dt: Seconds) {
        let Self { state, cascade, limit, .. } = self;
        match goal {
            Goal::Rest => state.rest(),
            Goal::Effort(effort) => state.give(effort, *limit, dt),
            Goal::Rpm(rpm) => state.seek_speed(cascade, rpm, measured.rpm, *limit, dt),
            Goal::Angle(_) | Goal::Total(_) => {
                if !state.keep_seeking_angle(cascade, measured.rpm, dt) {
                    state.seek_angle(cascade, way(goal, measured), measured.rpm, *limit, dt);
                }
            }
        }
    }

    /// Where the shaft can come to a stand: holding the angle at which it still turns would throw
    /// it back there.
    fn standstill(&self, measured: Measured) -> i64 {
        // s = v² / 2 a, in degrees and rpm: 1 rpm = 6 degrees a second.
        let rpm = measured.rpm;
        let degrees = 3.0 * rpm * rpm.abs() / self.cascade.acceleration.get();
        measured.microdegrees.saturating_add(microdegrees(degrees))
    }
}

fn goal_of(target: Target) -> Goal {
    match target {
        Target::Current(amps) => Goal::Effort(amps.get()),
        Target::Torque(torque) => Goal::Effort(torque.get()),
        Target::Duty(duty) => Goal::Effort(duty),
        Target::Speed(rpm) => Goal::Rpm(rpm.get()),
        Target::Angle(degrees) => Goal::Angle(within_turn(degrees)),
        Target::TotalAngle(angle) => Goal::Total(angle.counts_at(CountsPerTurn::MICRODEGREES)),
        // What is not supported was refused before.
        _ => Goal::Rest,
    }
}

/// Whole microdegrees; saturates at a little above 2000 degrees, where a motor that seeks an angle
/// has long reached its largest speed.
fn microdegrees(degrees: f32) -> i64 {
    rc10_app::maths::round_to_i32(degrees * 1e6).into()
}

/// 0 ..= 360 degrees in microdegrees.
fn within_turn(degrees: Degrees) -> i64 {
    let degrees = degrees.get() % 360.0;
    microdegrees(if degrees < 0.0 { degrees + 360.0 } else { degrees })
}

/// How far it is to an angle, in degrees; 0 where none is sought.
fn way(goal: Goal, measured: Measured) -> f32 {
    let way = match goal {
        Goal::Total(wanted) => wanted.saturating_sub(measured.microdegrees),
        Goal::Angle(wanted) => {
            let way = wanted.saturating_sub(measured.microdegrees) % TURN;
            match way {
                way if way > TURN / 2 => way - TURN,
                way if way < -TURN / 2 => way + TURN,
                way => way,
            }
        }
        Goal::Rest | Goal::Effort(_) | Goal::Rpm(_) => 0,
    };
    // Six turns away, some more or less do not matter.
    let most = if way < 0 { i32::MIN } else { i32::MAX };
    #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of the way to go")]
    return i32::try_from(way).unwrap_or(most) as f32 * 1e-6;
}

fn with_gains(pid: &mut PidConfig, gains: Gains) -> Result<(), ConfigError> {
    let Gains { kp, ki, kd } = gains;
    // Its limits stand already; one of them may be zero.
    PidConfig::new(kp, ki, kd, 1.0).validate()?;
    *pid = PidConfig { kp, ki, kd, ..*pid };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_app::{Amps, NewtonMetres, Rpm, RpmPerSecond, TotalAngle};

    const MS: Seconds = Seconds::new(0.001);

    fn servo() -> Servo {
        let cascade = Cascade {
            speed: PidConfig::new(0.1, 0.0, 0.0, 5.0),
            angle: PidConfig::new(3.0, 0.0, 0.0, 100.0),
            outer_divider: 1,
            acceleration: RpmPerSecond::new(1e5),
            feed_forward: 0.0,
        };
        Servo::new(TargetKind::Torque, cascade).unwrap()
    }

    fn at(degrees: i32, rpm: f32) -> Option<Measured> {
        Some(Measured { rpm, microdegrees: i64::from(degrees) * 1_000_000 })
    }

    /// The effort once the soft start is over.
    fn settled(servo: &mut Servo, drive: DriveMode, measured: Option<Measured>) -> f32 {
        (0..40).map(|_| servo.update(MS, drive, measured)).last().unwrap()
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
    fn it_holds_where_it_comes_to_a_stand_and_brakes_to_no_speed() {
        let mut servo = servo();
        servo.set_target(Target::Torque(NewtonMetres::new(1.0))).unwrap();
        assert!((settled(&mut servo, DriveMode::Run, at(10, 0.0)) - 1.0).abs() < 1e-3);
        assert!(settled(&mut servo, DriveMode::Hold, at(10, 0.0)).abs() < 1e-3);
        assert!(settled(&mut servo, DriveMode::Hold, at(12, 0.0)) < -0.3);
        assert!(settled(&mut servo, DriveMode::Brake, at(12, 30.0)) < -2.9);
        assert!(settled(&mut servo, DriveMode::Coast, at(12, 30.0)).abs() < 1e-9);
        assert!(settled(&mut servo, DriveMode::Off, at(12, 30.0)).abs() < 1e-9);
        assert!(settled(&mut servo, DriveMode::Run, None).abs() < 1e-9);
    }

    #[test]
    fn setting_zero_moves_nothing() {
        let mut servo = servo();
        servo.set_target(Target::TotalAngle(TotalAngle::from_degrees(100))).unwrap();
        let before = settled(&mut servo, DriveMode::Run, at(99, 0.0));
        servo.set_zero(99_000_000);
        let after = settled(&mut servo, DriveMode::Run, at(0, 0.0));
        assert!((before - after).abs() < 1e-3, "{before} {after}");
        let _ = settled(&mut servo, DriveMode::Hold, at(5, 0.0));
        servo.set_zero(5_000_000);
        assert!(settled(&mut servo, DriveMode::Hold, at(0, 0.0)).abs() < 1e-3);
    }

    #[test]
    fn limits_and_gains_are_checked_and_obeyed() {
        let mut servo = servo();
        let limit = |newton_metres| Request::TorqueLimit(NewtonMetres::new(newton_metres));
        assert!(servo.request(limit(-1.0), None).is_err());
        assert!(servo.request(limit(f32::NAN), None).is_err());
        assert_eq!(
            servo.request(Request::CurrentLimit(Amps::new(1.0)), None),
            Err(RequestError::Unsupported)
        );
        assert_eq!(servo.request(limit(2.0), None), Ok(Response::Done));
        servo.set_target(Target::Speed(Rpm::new(1000.0))).unwrap();
        assert!((settled(&mut servo, DriveMode::Run, at(0, 0.0)) - 2.0).abs() < 1e-3);
        servo.set_target(Target::Torque(NewtonMetres::new(9.0))).unwrap();
        assert!((settled(&mut servo, DriveMode::Run, at(0, 0.0)) - 2.0).abs() < 1e-3);
        assert_eq!(servo.request(limit(9.0), None), Ok(Response::Done));
        assert!((settled(&mut servo, DriveMode::Run, at(0, 0.0)) - 5.0).abs() < 1e-3);
        let bad = Request::SpeedGains(Gains { kp: -1.0, ..Gains::default() });
        assert!(servo.request(bad, at(0, 0.0)).is_err());
        let wrong = servo.set_target(Target::Current(Amps::new(1.0)));
        assert_eq!(wrong, Err(TargetError::Unsupported(TargetKind::Current)));
    }
}
