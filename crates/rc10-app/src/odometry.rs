//! Odometry: the pose of the robot in the field, summed up from the motion of its wheels.
//!
//! The heading comes from a gyro, or without one from the wheels. In each step the robot goes along
//! an arc, not along its chord. The sums of the position carry their rounding errors along, and the
//! heading is an integer, so thousands of small steps far from the origin do not drift in f32.
//!
//! The [`Covariance`] of the pose grows with way, turning, time on a drifting gyro, and measured
//! slip: the wheels' contradiction ([`BaseMotion::slip`](crate::BaseMotion::slip)), and theirs to
//! the gyro.
//!
//! ```
//! use rc10_app::{Odometry, OdometryConfig, OdometryInput, Pose, Seconds, Twist};
//! let mut odometry = Odometry::new(Pose::IDENTITY);
//! // A quarter of a circle of 1 m, to the left.
//! let input = OdometryInput { twist: Twist::new(1.0, 0.0, 1.0), slip: 0.0, heading: None };
//! for _ in 0..1571 {
//!     odometry.update(&OdometryConfig::DEFAULT, input, Seconds::new(0.001));
//! }
//! let pose = odometry.pose();
//! assert!((pose.x - 1.0).abs() < 1e-3 && (pose.y - 1.0).abs() < 1e-3);
//! assert!(odometry.covariance().xx > 0.0);
//! ```

use core::f32::consts::{PI, TAU};

use crate::angle::TotalAngle;
use crate::config::{ConfigError, not_negative, positive};
use crate::maths;
use crate::ok;
use crate::transform::Pose;
use crate::twist::Twist;
use crate::units::{Radians, Seconds};

/// Radians in a millionth of a degree.
const RADIANS_PER_MICRODEGREE: f32 = PI / 180e6;
/// Largest turn of one step, in rad: at 5 ms, 32 turns a second.
const LARGEST_TURN: f32 = 1.0;
/// The heading is counted in 2⁻³² turns, as an integer that goes round as it does.
const PARTS_PER_RADIAN: f32 = 4_294_967_296.0 / TAU;

/// How the uncertainty of the pose grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryConfig {
    /// Variance of the position per way, in m² per m, forward and sideways added; ≥ 0.
    pub per_distance: f32,
    /// Variance of the heading per turn, in rad² per rad; ≥ 0.
    pub per_turn: f32,
    /// Variance of the heading per time, in rad² per s: of a gyro that drifts; ≥ 0.
    pub per_time: f32,
    /// Slip up to this, in m/s, is the noise of the speeds; ≥ 0.
    pub slip_noise: f32,
    /// Metres that the position may be off per metre of measured slip; ≥ 0. A wheel of four that
    /// slips by 4 m leaves a residual of 1 m in each, and moves the pose by √2 m.
    pub per_slip: f32,
    /// Metres of slip at the wheels that make 1 rad of heading: their distance from the middle,
    /// for mecanum wheels half the wheelbase plus half the track; > 0.
    pub lever: f32,
}

impl OdometryConfig {
    /// A start, to be measured on the robot: 2 cm after 4 m, 1 degree after a turn, 1 degree in a
    /// minute; slip from 2 cm/s on of a base whose wheels are 0.4 m from the middle.
    pub const DEFAULT: Self = Self {
        per_distance: 1e-4,
        per_turn: 5e-5,
        per_time: 5e-6,
        slip_noise: 0.02,
        per_slip: 1.5,
        lever: 0.4,
    };

    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(not_negative("per_distance", self.per_distance));
        ok!(not_negative("per_turn", self.per_turn));
        ok!(not_negative("per_time", self.per_time));
        ok!(not_negative("slip_noise", self.slip_noise));
        ok!(not_negative("per_slip", self.per_slip));
        positive("lever", self.lever)
    }
}

/// Covariance of a pose in the field's axes: a symmetric matrix of x, y (m) and heading (rad).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "the elements of the matrix; t is the heading")]
pub struct Covariance {
    pub xx: f32,
    pub xy: f32,
    pub xt: f32,
    pub yy: f32,
    pub yt: f32,
    pub tt: f32,
}

/// Measurements of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryInput {
    /// The motion by the wheels.
    pub twist: Twist,
    /// The wheels' contradiction in m/s: [`BaseMotion::slip`](crate::BaseMotion::slip); 0 if it is
    /// not known.
    pub slip: f32,
    /// A gyro's heading, from any zero; `None` without: then the wheels turn it.
    pub heading: Option<TotalAngle>,
}

/// A sum that carries what rounding took from it. (Kahan, 1965.)
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sum {
    value: f32,
    /// The part by which the value is too large.
    excess: f32,
}

impl Sum {
    fn add(&mut self, step: f32) {
        let step = step - self.excess;
        let value = self.value + step;
        self.excess = (value - self.value) - step;
        self.value = value;
    }
}

/// State of an odometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Odometry {
    x: Sum,
    y: Sum,
    /// In 2⁻³² turns.
    heading: i32,
    /// The low half of its last heading.
    gyro: Option<i32>,
    covariance: Covariance,
    slipped: f32,
}

impl Odometry {
    /// At this pose, exactly.
    #[must_use]
    pub fn new(pose: Pose) -> Self {
        let mut odometry = Self::default();
        odometry.reset(pose, Covariance::default());
        odometry
    }

    /// Goes on from a pose that something else measured, a landmark or a wall, with its covariance.
    /// A pose that is not finite is ignored.
    pub fn reset(&mut self, pose: Pose, covariance: Covariance) {
        if pose.x.is_finite() && pose.y.is_finite() && pose.heading.is_finite() {
            let turned = crate::angle::shortest_way_f32(0.0, pose.heading.get(), TAU);
            let at = |value| Sum { value, excess: 0.0 };
            (self.x, self.y, self.heading) = (at(pose.x), at(pose.y), parts(turned));
            (self.covariance, self.slipped) = (covariance, 0.0);
        }
    }

    /// Where the robot is, and which way it looks: −π ..= π.
    pub const fn pose(&self) -> Pose {
        #[expect(clippy::cast_precision_loss, reason = "the nearest f32")]
        let heading = self.heading as f32 * maths::RADIANS_PER_PART;
        Pose::new(self.x.value, self.y.value, Radians::new(heading))
    }

    /// How wrong the pose may be.
    #[must_use]
    pub const fn covariance(&self) -> Covariance {
        self.covariance
    }

    /// Measured slip since the last [`reset`](Self::reset), in metres.
    #[must_use]
    pub const fn slipped(&self) -> f32 {
        self.slipped
    }

    /// Goes on by one step. A `dt` that is not finite and positive, a twist or a slip that is not
    /// finite, and a turn of more than 1 rad in the step change nothing. A gyro's step of more than 1 rad
    /// is a jump, not a motion: that step's turn is the wheels'.
    pub fn update(&mut self, config: &OdometryConfig, input: OdometryInput, dt: Seconds) {
        let twist = input.twist * dt.get();
        let way = twist.vx.abs() + twist.vy.abs();
        let all = way + input.slip.abs();
        // Sizes are ordered as their bits are; NaN is above all others.
        let is_far = all.to_bits() >= f32::INFINITY.to_bits();
        let is_round = twist.wz.abs().to_bits() > LARGEST_TURN.to_bits();
        if is_far || is_round || !dt.is_step() {
            return;
        }
        let by_gyro = self.turn_by(input.heading);
        let turn = by_gyro.unwrap_or(twist.wz);
        // The exponential of SE(2): an arc is its chord, which points along the mean heading and is
        // shorter than the arc by sin(h) / h, h half the turn.
        let turn_parts = parts(turn);
        let (sin, cos) = maths::sin_cos_of_parts(self.heading.wrapping_add(turn_parts >> 1));
        let chord = sinc(0.5 * turn);
        let x = chord * (twist.vx * cos - twist.vy * sin);
        let y = chord * (twist.vx * sin + twist.vy * cos);
        self.x.add(x);
        self.y.add(y);
        self.heading = self.heading.wrapping_add(turn_parts);
        self.covariance.move_by(x, y);
        let mut position = config.per_distance * way;
        let mut heading = config.per_turn * turn.abs() + config.per_time * dt.get();
        let slip = input.slip.abs() * dt.get();
        let contradicted = (turn - twist.wz).abs() * config.lever;
        let slip = if contradicted > slip { contradicted } else { slip };
        if slip > config.slip_noise * dt.get() {
            // Slip goes on in one direction while it lasts. So its error grows as the slip does, not
            // as its root: the variance by the difference of two squares.
            let before = self.slipped;
            self.slipped += slip;
            let grown = config.per_slip * config.per_slip * slip * (before + self.slipped);
            position += grown;
            if by_gyro.is_none() {
                heading += grown / (config.lever * config.lever);
            }
        }
        self.covariance.add(position, heading);
    }

    /// The turn since the gyro's last heading, if there are two of them.
    fn turn_by(&mut self, heading: Option<TotalAngle>) -> Option<f32> {
        #[expect(clippy::cast_possible_truncation, reason = "the low half tells small steps")]
        let heading = heading.map(|heading| heading.microdegrees() as i32);
        let last = core::mem::replace(&mut self.gyro, heading);
        #[expect(clippy::cast_precision_loss, reason = "seven digits of a step")]
        let turn = heading?.wrapping_sub(last?) as f32 * RADIANS_PER_MICRODEGREE;
        (turn.abs().to_bits() <= LARGEST_TURN.to_bits()).then_some(turn)
    }
}

impl Covariance {
    /// After a step (x, y) in field axes: J P Jᵀ with J = [1 0 −y; 0 1 x; 0 0 1].
    fn move_by(&mut self, x: f32, y: f32) {
        let Self { xt, yt, tt, .. } = *self;
        self.xt -= y * tt;
        self.yt += x * tt;
        self.xx -= y * (xt + self.xt);
        self.yy += x * (yt + self.yt);
        self.xy += x * xt - y * self.yt;
    }

    fn add(&mut self, position: f32, heading: f32) {
        self.xx += position;
        self.yy += position;
        self.tt += heading;
    }
}

/// An angle within ±π in 2⁻³² turns.
#[expect(clippy::cast_possible_truncation, reason = "saturates: π is 2³¹")]
const fn parts(radians: f32) -> i32 {
    (radians * PARTS_PER_RADIAN) as i32
}

/// sin(x) / x within 1.2e-7 for x up to 0.5, least error with 1 at zero.
fn sinc(x: f32) -> f32 {
    let z = x * x;
    1.0 + z * (8.264_548e-3 * z - 0.166_661_35)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Seconds = Seconds::new(0.001);

    fn driven(odometry: &mut Odometry, twist: Twist, steps: u32, dt: Seconds) {
        for _ in 0..steps {
            let input = OdometryInput { twist, slip: 0.0, heading: None };
            odometry.update(&OdometryConfig::DEFAULT, input, dt);
        }
    }

    #[test]
    fn ten_million_steps_far_away_do_not_drift() {
        let start = Pose::new(100.0, -50.0, Radians::new(0.0));
        let mut odometry = Odometry::new(start);
        // 10 µm each: a plain f32 sum at 100 m loses them wholly or takes 15 µm.
        driven(&mut odometry, Twist::new(0.01, 0.0, 0.0), 5_000_000, MS);
        assert!((odometry.pose().x - 150.0).abs() < 2e-5, "{:?}", odometry.pose());
        driven(&mut odometry, Twist::new(-0.01, 0.0, 0.0), 5_000_000, MS);
        assert!((odometry.pose().x - 100.0).abs() < 2e-5, "{:?}", odometry.pose());
    }

    #[test]
    fn thousands_of_turns_do_not_drift() {
        let mut odometry = Odometry::new(Pose::IDENTITY);
        driven(&mut odometry, Twist::new(0.0, 0.0, 0.5), 20_000, Seconds::new(1.0));
        let exact = 10_000.0_f64 % core::f64::consts::TAU;
        let heading = f64::from(odometry.pose().heading.get());
        // A step is rounded to seven digits, always the same way, and nothing comes on top.
        let off = heading - exact;
        assert!(off.sin().abs() < 6e-8 * 10_000.0 && off.cos() > 0.0, "{heading} {exact}");
        // Turned back, it is where it was.
        driven(&mut odometry, Twist::new(0.0, 0.0, -0.5), 20_000, Seconds::new(1.0));
        assert!(odometry.pose().heading.get().abs() < 1e-4, "{:?}", odometry.pose());
    }

    #[test]
    fn millions_of_small_turns_do_not_drift() {
        let mut odometry = Odometry::new(Pose::IDENTITY);
        // 0.1 mrad each: within a unit of 2⁻³² turns, 1.5e-9 rad.
        driven(&mut odometry, Twist::new(0.0, 0.0, 0.1), 1_000_000, MS);
        let exact = 100.0_f64 % core::f64::consts::TAU;
        let off = f64::from(odometry.pose().heading.get()) - exact;
        assert!(off.sin().abs() < 1e-3 && off.cos() > 0.0, "{off}");
        driven(&mut odometry, Twist::new(0.0, 0.0, -0.1), 1_000_000, MS);
        assert!(odometry.pose().heading.get().abs() < 1e-6, "{:?}", odometry.pose());
    }

    #[test]
    fn circles_close_however_long_the_steps_are() {
        for (steps, turns) in [(7_u16, 1.0), (20, 1.0), (1000, 1.0), (60_000, 100.0)] {
            let mut odometry = Odometry::new(Pose::new(1.0, 2.0, Radians::new(0.3)));
            let dt = Seconds::new(turns * TAU / f32::from(steps));
            driven(&mut odometry, Twist::new(0.8, -0.4, 1.0), steps.into(), dt);
            let pose = odometry.pose();
            let off = maths::hypot(pose.x - 1.0, pose.y - 2.0);
            // A step of dt itself is rounded: a part in 2^24 of all the way.
            let allowed = 2e-6 + turns * 1e-6;
            assert!(off < allowed && (pose.heading.get() - 0.3).abs() < 3.0 * allowed, "{pose:?}");
        }
    }

    #[test]
    fn a_gyro_takes_over_from_the_wheels_and_gives_back() {
        let mut odometry = Odometry::new(Pose::IDENTITY);
        let mut step = |heading, wz| {
            let input = OdometryInput { twist: Twist::new(0.0, 0.0, wz), slip: 0.0, heading };
            odometry.update(&OdometryConfig::DEFAULT, input, Seconds::new(0.01));
            odometry.pose().heading.get()
        };
        let at = |degrees| Some(TotalAngle::from_degrees(degrees));
        // The first reading is only where it begins; the wheels turn by 0.01 rad.
        assert!((step(at(700), 1.0) - 0.01).abs() < 1e-6);
        assert!((step(at(701), 1.0) - 0.01 - 1.0_f32.to_radians()).abs() < 1e-6);
        // Not heard, and heard again.
        let before = step(at(701), 1.0);
        assert!((step(None, 1.0) - before - 0.01).abs() < 1e-6);
        assert!((step(at(750), 1.0) - before - 0.02).abs() < 1e-6);
        assert!((step(at(751), 1.0) - before - 0.02 - 1.0_f32.to_radians()).abs() < 1e-6);
        // A jump.
        let before = step(at(751), 0.0);
        assert!((step(at(2000), 1.0) - before - 0.01).abs() < 1e-6);
        assert!(odometry.slipped() > 0.0);
    }

    #[test]
    fn covariance_grows_as_it_says() {
        let config = OdometryConfig { per_time: 0.0, per_turn: 0.0, ..OdometryConfig::DEFAULT };
        let mut odometry = Odometry::new(Pose::IDENTITY);
        // A heading that is off by 0.1 rad puts it 0.4 m off after 4 m.
        odometry.reset(Pose::IDENTITY, Covariance { tt: 0.01, ..Covariance::default() });
        let input = OdometryInput { twist: Twist::new(1.0, 0.0, 0.0), slip: 0.0, heading: None };
        for _ in 0..4000 {
            odometry.update(&config, input, MS);
        }
        let Covariance { xx, xy, xt, yy, yt, tt } = odometry.covariance();
        assert!((xx - 4e-4).abs() < 1e-6 && (yy - 0.16 - 4e-4).abs() < 1e-4, "{xx} {yy}");
        assert!(xy.abs() < 1e-6 && xt.abs() < 1e-6 && (yt - 0.04).abs() < 1e-5, "{xy} {xt} {yt}");
        assert!((tt - 0.01).abs() < 1e-6);
        // 1 m of slip: 1.5 m², and the heading without a gyro.
        let slips = OdometryInput { twist: Twist::STOP, slip: 0.5, heading: None };
        for _ in 0..2000 {
            odometry.update(&config, slips, MS);
        }
        let grown = odometry.covariance();
        assert!((odometry.slipped() - 1.0).abs() < 1e-4);
        assert!((grown.xx - xx - 2.25).abs() < 1e-3, "{grown:?}");
        assert!((grown.tt - tt - 2.25 / 0.16).abs() < 1e-2, "{grown:?}");
    }

    #[test]
    fn bad_input_changes_nothing() {
        let mut odometry = Odometry::new(Pose::IDENTITY);
        let good = OdometryInput { twist: Twist::new(1.0, 0.5, 0.2), slip: 0.1, heading: None };
        odometry.update(&OdometryConfig::DEFAULT, good, MS);
        let before = odometry;
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for twist in
                [Twist::new(bad, 0.0, 0.0), Twist::new(0.0, bad, 0.0), Twist::new(0.0, 0.0, bad)]
            {
                let input = OdometryInput { twist, ..good };
                odometry.update(&OdometryConfig::DEFAULT, input, MS);
            }
            let input = OdometryInput { slip: bad, ..good };
            odometry.update(&OdometryConfig::DEFAULT, input, MS);
            odometry.update(&OdometryConfig::DEFAULT, good, Seconds::new(bad));
            odometry.reset(Pose::new(bad, 0.0, Radians::ZERO), Covariance::default());
        }
        odometry.update(&OdometryConfig::DEFAULT, good, Seconds::ZERO);
        odometry.update(&OdometryConfig::DEFAULT, good, Seconds::new(-0.001));
        assert_eq!(odometry, before);
        assert_eq!(OdometryConfig::DEFAULT.validate(), Ok(()));
        let broken = OdometryConfig { lever: 0.0, ..OdometryConfig::DEFAULT };
        assert_eq!(broken.validate().unwrap_err().field, "lever");
    }
}
