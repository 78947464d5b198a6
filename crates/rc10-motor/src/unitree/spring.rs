use core::f32::consts::TAU;

use rc10_app::maths::within;
use rc10_app::{NewtonMetres, Rpm, Seconds, TotalAngle};

use super::wire::Impedance as Gains;
use crate::motor::{Impedance, Target, TargetError, TargetKind};
use crate::servo::Measured;

/// A target for the controller's own law, and how gently it is handed over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spring {
    asked: Impedance,
    /// Where it pulls to, microdegrees from the zero.
    goal: i64,
    /// For how long it has driven, s: up to [`SOFT_TIME`].
    driven: f32,
}

/// What the controller is told, at the output shaft.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    /// The way left, degrees.
    pub(super) way: f32,
    pub(super) speed: Rpm,
    pub(super) torque: NewtonMetres,
    pub(super) gains: Gains,
}

/// After driving starts the torque may only grow to its limit in this time: as a cascade's.
const SOFT_TIME: f32 = 0.020;
/// Largest stiffness (N m/rad) and damping (N m s/rad) of the output shaft: 25.599 at the rotor
/// (data manual), through a gearbox of 6.33.
const STIFFEST: f32 = 1025.7;
/// Largest speed that a command carries: 804 rad/s of the rotor, in rpm of the output.
const FASTEST: f32 = 1212.0;
/// Largest torque that any limit allows, N m.
pub(super) const STRONGEST: f32 = 23.7;

impl Spring {
    /// # Errors
    /// [`TargetError`] for numbers that are not finite, a gain that the wire does not carry, and an
    /// angle beyond the exact range of [`TotalAngle::try_from_degrees`].
    pub(super) fn new(asked: Impedance) -> Result<Self, TargetError> {
        let kind = TargetKind::Impedance;
        if !Target::Impedance(asked).is_finite() {
            return Err(TargetError::NotFinite(kind));
        }
        let carried = 0.0..=STIFFEST;
        let goal = TotalAngle::try_from_degrees(asked.angle);
        match goal {
            Some(goal) if carried.contains(&asked.kp) && carried.contains(&asked.kd) => {
                Ok(Self { asked, goal: goal.counts(), driven: 0.0 })
            }
            _ => Err(TargetError::OutOfRange(kind)),
        }
    }

    pub(super) const fn asked(&self) -> Impedance {
        self.asked
    }

    /// Another target for the same drive.
    pub(super) const fn replace(&mut self, newer: Self) {
        (self.asked, self.goal) = (newer.asked, newer.goal);
    }

    /// Angles count from `zero`, as measured until now, from now on; it pulls where it pulled.
    pub(super) const fn set_zero(&mut self, zero: i64) {
        self.goal = self.goal.saturating_sub(zero);
    }

    /// It does not drive: when it does again, it starts softly.
    pub(super) const fn rest(&mut self) {
        self.driven = 0.0;
    }

    /// One step. Where the law would give more than `limit` at what is measured, all of it is taken
    /// back by the same factor: the equilibrium stays.
    pub(super) fn update(&mut self, dt: Seconds, measured: Measured, limit: f32) -> Pull {
        let Impedance { speed, torque, kp, kd, .. } = self.asked;
        let limit = limit * (self.driven * (1.0 / SOFT_TIME));
        self.driven = (self.driven + dt.get()).min(SOFT_TIME);

        let way = way(self.goal, measured.microdegrees);
        // Large numbers would make an infinite torque, and less than nothing of it.
        let speed = within(speed.get(), FASTEST);
        let torque = within(torque.get(), STRONGEST);
        let slip = speed - measured.rpm;
        let law = kp * (way * (TAU / 360.0)) + kd * (slip * (TAU / 60.0)) + torque;
        let share = if law.abs() > limit { limit / law.abs() } else { 1.0 };
        Pull {
            way,
            speed: Rpm::new(speed),
            torque: NewtonMetres::new(torque * share),
            gains: Gains { stiffness: kp * share, damping: kd * share },
        }
    }
}

/// Degrees from one angle to another; six turns are as far as it gets.
fn way(goal: i64, measured: i64) -> f32 {
    let way = goal.saturating_sub(measured);
    let most = if way < 0 { i32::MIN } else { i32::MAX };
    #[expect(clippy::cast_precision_loss, reason = "a part in 2^24 of the way to go")]
    return i32::try_from(way).unwrap_or(most) as f32 * 1e-6;
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_app::Degrees;

    const MS: Seconds = Seconds::new(0.001);
    const STILL: Measured = Measured { rpm: 0.0, microdegrees: 0 };

    fn spring(degrees: f32, kp: f32, kd: f32, torque: f32) -> Spring {
        let angle = Degrees::new(degrees);
        let torque = NewtonMetres::new(torque);
        Spring::new(Impedance { angle, kp, kd, torque, ..Impedance::default() }).unwrap()
    }

    fn torque_of(pull: &Pull, rpm: f32) -> f32 {
        let Pull { way, speed, torque, gains } = pull;
        gains.stiffness * way.to_radians()
            + gains.damping * (speed.get() - rpm) * TAU / 60.0
            + torque.get()
    }

    #[test]
    fn it_starts_from_nothing_and_ends_at_the_law() {
        let mut spring = spring(90.0, 2.0, 0.1, 1.0);
        let law = 2.0 * core::f32::consts::FRAC_PI_2 + 1.0;
        let torques: [f32; 40] =
            core::array::from_fn(|_| torque_of(&spring.update(MS, STILL, 23.7), 0.0));
        assert!(torques[0].abs() < 1e-9);
        assert!(torques.windows(2).all(|pair| pair[1] >= pair[0] && pair[1] - pair[0] < 1.2));
        assert!((torques[39] - law).abs() < 1e-4, "{}", torques[39]);
        spring.rest();
        assert!(torque_of(&spring.update(MS, STILL, 23.7), 0.0).abs() < 1e-9);
    }

    #[test]
    fn it_never_asks_for_more_than_the_limit() {
        let speed = Rpm::new(f32::MAX);
        let racing = Spring::new(Impedance { speed, kd: 1000.0, ..Impedance::default() }).unwrap();
        for (mut spring, rpm) in [
            (spring(3.6e6, 1025.0, 0.0, 0.0), 0.0),
            (spring(-90.0, 500.0, 1000.0, f32::MAX), 190.0),
            (spring(0.0, 0.0, 1000.0, -f32::MAX), -190.0),
            (racing, 0.0),
        ] {
            let mut last = 0.0;
            for _ in 0..40 {
                last = torque_of(&spring.update(MS, Measured { rpm, ..STILL }, 5.0), rpm).abs();
                assert!(last < 5.0 + 1e-3, "{last}");
            }
            // Nor for less, where the law wants more.
            assert!((last - 5.0).abs() < 1e-3, "{last}");
        }
    }

    #[test]
    fn what_the_wire_does_not_carry_is_refused() {
        let good = Impedance { kp: 1.0, kd: 1.0, ..Impedance::default() };
        assert!(Spring::new(good).is_ok());
        let out = Some(TargetError::OutOfRange(TargetKind::Impedance));
        let not_finite = Some(TargetError::NotFinite(TargetKind::Impedance));
        let refused = |impedance| Spring::new(impedance).err();
        assert_eq!(refused(Impedance { kp: -0.1, ..good }), out);
        assert_eq!(refused(Impedance { kd: 1026.0, ..good }), out);
        assert_eq!(refused(Impedance { angle: Degrees::new(1e13), ..good }), out);
        assert_eq!(refused(Impedance { kp: f32::NAN, ..good }), not_finite);
        assert_eq!(refused(Impedance { speed: Rpm::new(f32::INFINITY), ..good }), not_finite);
    }
}
