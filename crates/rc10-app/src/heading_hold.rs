//! Heading hold: while the driver turns nothing, the robot keeps looking where it looks.
//!
//! A robot that drives sideways turns a little, by unequal wheels or a push. This sets the yaw rate
//! that turns it back; the stick passes through.
//!
//! It keeps the heading where the robot comes to a stand (yaw rate,
//! [`HeadingHoldConfig::deceleration_rad_s2`]): the one where the stick was let go would throw it back.
//!
//! ```
//! use rc10_app::{HeadingHold, HeadingHoldConfig, Radians};
//! let config = HeadingHoldConfig { kp: 6.0, kd: 0.1, max_rate_rad_s: 3.0, deceleration_rad_s2: 12.0, deadband_rad_s: 0.05 };
//! let mut hold = HeadingHold::new();
//! assert_eq!(hold.update(&config, 2.0, Radians::new(0.5), 1.9), 2.0); // the driver turns
//! hold.update(&config, 0.0, Radians::new(0.5), 0.0); // lets go: 0.5 rad are kept
//! assert!(hold.update(&config, 0.0, Radians::new(0.4), 0.0) > 0.5); // and turned back to
//! ```

use core::f32::consts::TAU;

use crate::angle::shortest_way_f32;
use crate::config::{ConfigError, not_negative, positive};
use crate::maths;
use crate::ok;
use crate::units::Radians;

/// Gains and limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingHoldConfig {
    /// Yaw rate per error of the heading: rad/s per rad, so 1/s; > 0.
    pub kp: f32,
    /// Yaw rate that is taken off per measured yaw rate, without unit; ≥ 0.
    pub kd: f32,
    /// Largest yaw rate for turning back, in rad/s; > 0.
    pub max_rate_rad_s: f32,
    /// How fast the robot stops turning, rad/s²; > 0: the
    /// [`angular_rad_s2`](crate::TwistLimits::angular_rad_s2) of its base, or a little less. It turns
    /// back no faster than it can stop at the heading.
    pub deceleration_rad_s2: f32,
    /// A stick up to this, in rad/s, turns nothing; ≥ 0.
    pub deadband_rad_s: f32,
}

impl HeadingHoldConfig {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(positive("kp", self.kp));
        ok!(not_negative("kd", self.kd));
        ok!(positive("max_rate_rad_s", self.max_rate_rad_s));
        ok!(positive("deceleration_rad_s2", self.deceleration_rad_s2));
        not_negative("deadband_rad_s", self.deadband_rad_s)
    }
}

/// State of a heading hold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeadingHold {
    held: Option<Radians>,
}

impl HeadingHold {
    /// Nothing is held.
    #[must_use]
    pub const fn new() -> Self {
        Self { held: None }
    }

    /// The heading that is kept, −π ..= π; `None` while the driver turns.
    #[must_use]
    pub const fn held(&self) -> Option<Radians> {
        self.held
    }

    /// Forgets the heading, of a robot that is disarmed: the next is where it then is.
    pub const fn release(&mut self) {
        self.held = None;
    }

    /// The yaw rate to command, rad/s, for the driver's `stick` and the measured `yaw_rate`. The
    /// error of `heading` goes the shorter way. What is not finite lets the stick through.
    pub fn update(
        &mut self,
        config: &HeadingHoldConfig,
        stick: f32,
        heading: Radians,
        yaw_rate: f32,
    ) -> f32 {
        if !(stick.is_finite() && heading.is_finite() && yaw_rate.is_finite()) {
            return stick;
        }
        if stick.abs() > config.deadband_rad_s {
            self.held = None;
            return stick;
        }
        let held = *self.held.get_or_insert_with(|| {
            let stops_after = yaw_rate * yaw_rate.abs() / (2.0 * config.deceleration_rad_s2);
            Radians::new(shortest_way_f32(0.0, heading.get() + stops_after, TAU))
        });
        let left = shortest_way_f32(heading.get(), held.get(), TAU);
        // The speed from which it stops within the error.
        let can_stop = maths::fast_sqrt(2.0 * config.deceleration_rad_s2 * left.abs());
        let back = maths::within(config.kp * left, can_stop.min(config.max_rate_rad_s));
        maths::within(back - config.kd * yaw_rate, config.max_rate_rad_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f32::consts::PI;

    const CONFIG: HeadingHoldConfig = HeadingHoldConfig {
        kp: 8.0,
        kd: 0.0,
        max_rate_rad_s: 4.0,
        deceleration_rad_s2: 12.0,
        deadband_rad_s: 0.02,
    };

    /// A base that turns, as `TwistLimiter` lets it, in steps of 5 ms.
    struct Turning {
        heading: f32,
        rate: f32,
    }

    impl Turning {
        fn step(&mut self, hold: &mut HeadingHold, stick: f32) {
            let wanted = hold.update(&CONFIG, stick, Radians::new(self.heading), self.rate);
            self.rate += maths::within(wanted - self.rate, 12.0 * 0.005);
            self.heading += self.rate * 0.005;
        }
    }

    #[test]
    fn it_keeps_the_heading_where_it_stops_without_turning_back() {
        for sign in [1.0, -1.0] {
            let (mut hold, mut robot) = (HeadingHold::new(), Turning { heading: 3.0, rate: 0.0 });
            for _ in 0..200 {
                robot.step(&mut hold, sign * 3.5);
            }
            assert_eq!(hold.held(), None);
            let let_go = robot.heading;
            let mut farthest = 0.0_f32;
            for _ in 0..400 {
                robot.step(&mut hold, 0.0);
                farthest = farthest.max(sign * (robot.heading - let_go));
            }
            // 3.5² / 24 = 0.510 rad.
            let turned = sign * (robot.heading - let_go);
            assert!((turned - 0.510).abs() < 0.01, "{sign}: {turned}");
            // It brakes one step after it is told: half a step of 3.5 rad/s more, 9 mrad.
            assert!(farthest - turned < 0.012, "{sign}: {farthest} {turned}");
        }
    }

    #[test]
    fn the_measured_yaw_rate_is_braked_to_either_side() {
        let config = HeadingHoldConfig { kd: 0.2, ..CONFIG };
        for rate in [0.5, -0.5, 3.0, -3.0] {
            let mut hold = HeadingHold::new();
            hold.update(&config, 0.0, Radians::new(1.0), 0.0);
            let braked = hold.update(&config, 0.0, Radians::new(1.0), rate);
            assert!((braked + 0.2 * rate).abs() < 1e-6, "{rate}: {braked}");
            // With an error of 0.1 rad to either side on top of it, and never above the largest.
            for off in [0.1, -0.1] {
                let back = hold.update(&config, 0.0, Radians::new(1.0 + off), rate);
                assert!((back + 8.0 * off + 0.2 * rate).abs() < 1e-5, "{rate} {off}: {back}");
            }
            let most = hold.update(&config, 0.0, Radians::new(1.0), rate * 100.0);
            assert!((most + 4.0 * rate.signum()).abs() < 1e-6, "{rate}: {most}");
        }
    }

    #[test]
    fn a_push_is_turned_back_the_shorter_way_within_the_limits() {
        // Near the seam of the circle.
        let (mut hold, mut robot) = (HeadingHold::new(), Turning { heading: PI - 0.05, rate: 0.0 });
        robot.step(&mut hold, 0.0);
        for push in [0.4, -0.4, 2.0, -2.0] {
            robot.heading += push;
            let mut over = 0.0_f32;
            for _ in 0..600 {
                let before = robot.rate;
                robot.step(&mut hold, 0.0);
                assert!(robot.rate.abs() <= 4.0 && (robot.rate - before).abs() <= 0.061);
                over = over.max((robot.heading - PI + 0.05) * -push.signum());
            }
            assert!((robot.heading - PI + 0.05).abs() < 1e-3, "{push}: {}", robot.heading);
            assert!(over < 0.02, "{push}: {over}");
        }
        hold.release();
        assert_eq!(hold.held(), None);
    }

    #[test]
    fn the_stick_passes_through_and_bad_input_changes_nothing() {
        let mut hold = HeadingHold::new();
        hold.update(&CONFIG, 0.0, Radians::new(1.0), 0.0);
        let before = hold;
        for bad in [f32::NAN, f32::INFINITY] {
            assert!(hold.update(&CONFIG, 0.0, Radians::new(bad), 0.0).abs() < f32::EPSILON);
            assert!(hold.update(&CONFIG, 0.0, Radians::new(0.0), bad).abs() < f32::EPSILON);
            assert!(!hold.update(&CONFIG, bad, Radians::new(0.0), 0.0).is_finite());
        }
        assert_eq!(hold, before);
        assert!((hold.update(&CONFIG, 5.0, Radians::new(0.0), 0.0) - 5.0).abs() < f32::EPSILON);
        assert_eq!(CONFIG.validate(), Ok(()));
        for bad in [-1.0, f32::NAN] {
            let field = |config: HeadingHoldConfig| config.validate().unwrap_err().field;
            assert_eq!(field(HeadingHoldConfig { kp: bad, ..CONFIG }), "kp");
            assert_eq!(field(HeadingHoldConfig { kd: bad, ..CONFIG }), "kd");
            assert_eq!(
                field(HeadingHoldConfig { max_rate_rad_s: bad, ..CONFIG }),
                "max_rate_rad_s"
            );
            assert_eq!(
                field(HeadingHoldConfig { deceleration_rad_s2: bad, ..CONFIG }),
                "deceleration_rad_s2"
            );
            assert_eq!(
                field(HeadingHoldConfig { deadband_rad_s: bad, ..CONFIG }),
                "deadband_rad_s"
            );
        }
    }
}
