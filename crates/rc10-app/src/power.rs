//! Electrical power of a base's motors: a model, the torques that keep a limit, and a limiter that learns the model
//! while it drives.
//!
//! The model is that of HKUST ENTERPRIZE (2024), with a factor on the mechanical power and a share that braking returns:
//!
//! P = Σ (`mechanical` · τ·ω + `per_speed` · |ω| + `per_torque` · τ²) + `idle`, at the output shafts.
//!
//! [`PowerModel::allocate`] keeps a limit by one common share of all torques, so that the wrench on the body keeps its
//! direction. [`PowerLimiter`] makes the limit of what a referee system says, and learns the model of the buffer's energy.

mod limiter;

pub use limiter::{PowerConfig, PowerInput, PowerLimiter};

use core::f32::consts::PI;

use crate::config::{ConfigError, not_negative};
use crate::maths::fast_sqrt;
use crate::ok;
use crate::units::{NewtonMetres, Rpm, Watts};

/// Radians per second in one revolution per minute.
const RADIANS_PER_SECOND: f32 = PI / 30.0;

/// The electrical power of motors of one kind that share a supply.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct PowerModel {
    /// Power per τ·ω, without unit; ≥ 0: 1 where the torque constant is that of the winding. A constant that has the
    /// gearbox's losses in it, as DJI's, makes it more.
    pub mechanical: f32,
    /// W per rad/s of each shaft: iron and gearbox; ≥ 0.
    pub per_speed: f32,
    /// W per (N m)² of each shaft: the winding's resistance over the torque constant squared; ≥ 0.
    pub per_torque: f32,
    /// W of all together at rest; ≥ 0.
    pub idle: f32,
    /// Share of what a braking wheel gives, less its losses, that the others get, 0 ..= 1: 1 where all speed controllers
    /// hang on the same two wires, 0 where it is not known. The supply takes nothing back.
    pub returned: f32,
}

impl PowerModel {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(not_negative("mechanical", self.mechanical));
        ok!(not_negative("per_speed", self.per_speed));
        ok!(not_negative("per_torque", self.per_torque));
        ok!(not_negative("idle", self.idle));
        ok!(not_negative("returned", self.returned));
        ConfigError::check(self.returned <= 1.0, "returned", self.returned, "0 ..= 1")
    }

    /// The power that motors take with these torques at these speeds; never below zero.
    #[must_use]
    pub fn power(&self, torques: &[NewtonMetres], speeds: &[Rpm]) -> Watts {
        Watts::new(self.loads(torques, speeds, false).sum().max(0.0))
    }

    /// Whether braking with this torque at this speed takes power: its heat is more than what the shaft gives.
    #[must_use]
    pub fn braking_takes_power(&self, torque: NewtonMetres, speed: Rpm) -> bool {
        speed.get().abs() * RADIANS_PER_SECOND * self.mechanical <= torque.get() * self.per_torque
    }

    /// The torques nearest to the `wished` ones that take at most `limit`: the same share of each, so the wrench on the
    /// body keeps its direction. Where the wishes are [`Base::torques`](crate::Base::torques), no other torques with the
    /// same wrench take less.
    ///
    /// A wish that takes less than any smaller share of it is given whole: braking is not limited. Where no share keeps
    /// the limit, as the speed alone takes more, it is the one that takes least. A number that is not finite gives no
    /// torque.
    ///
    /// ```
    /// use rc10_app::{NewtonMetres, PowerModel, Rpm, Watts};
    /// const M3508: PowerModel =
    ///     PowerModel { mechanical: 1.0, per_speed: 0.22, per_torque: 1.2, idle: 2.78, returned: 0.0 };
    /// let (wished, speeds) = ([NewtonMetres::new(3.0); 4], [Rpm::new(200.0); 4]);
    /// let given = M3508.allocate(wished, speeds, Watts::new(100.0));
    /// assert!((given.share - 0.298).abs() < 1e-3);
    /// assert!((M3508.power(&given.torques, &speeds).get() - 100.0).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn allocate<const N: usize>(
        &self,
        wished: [NewtonMetres; N],
        speeds: [Rpm; N],
        limit: Watts,
    ) -> Allocation<N> {
        Allocation::of(wished, self.loads(&wished, &speeds, true).share(limit.get()))
    }

    /// The power by each number of the model. Of a wheel that brakes for more than it takes, the others get a share.
    ///
    /// `at_most`: counted so that no share of the torques takes more than [`Loads::share`] has it. A wheel that gives
    /// takes up to its losses by speed at a smaller share; one that brakes and takes may give at a smaller share.
    fn loads(&self, torques: &[NewtonMetres], speeds: &[Rpm], at_most: bool) -> Loads {
        let [by_power, by_speed] =
            [self.mechanical, self.per_speed].map(|number| number * RADIANS_PER_SECOND);
        let (mut powers, mut speed_sum, mut squares) = (0.0, 0.0, 0.0);
        for (torque, speed) in torques.iter().zip(speeds) {
            let (torque, speed) = (torque.get(), speed.get());
            let (mut power, mut turning, mut square) =
                (torque * speed, speed.abs(), torque * torque);
            if power < 0.0 {
                let gives = by_power * power + self.per_torque * square + by_speed * turning < 0.0;
                if gives {
                    square *= self.returned;
                    turning *= if at_most { 1.0 } else { self.returned };
                }
                if gives || at_most {
                    power *= self.returned;
                }
            }
            powers += power;
            speed_sum += turning;
            squares += square;
        }
        Loads {
            mechanical: by_power * powers,
            speed: by_speed * speed_sum,
            torque: self.per_torque * squares,
            idle: self.idle,
        }
    }
}

/// Powers by the numbers of a model, W.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Loads {
    mechanical: f32,
    speed: f32,
    torque: f32,
    idle: f32,
}

impl Loads {
    fn sum(&self) -> f32 {
        self.mechanical + self.torque + self.speed + self.idle
    }

    /// The share of the torques, 0 ..= 1, nearest to 1 that keeps the limit, or else takes least.
    ///
    /// P(s) = a s² + b s + c is convex, as a ≥ 0. Where P'(1) ≤ 0, it is least at 1. Else the shares that keep the limit
    /// are an interval between the roots, and 1 is above it: its upper end is the nearest. There 1 - s = λ P'(s) with
    /// λ ≥ 0, which are the KKT conditions of the least |τ - wish|². Without roots P is above the limit everywhere, and
    /// least at the vertex -b / 2a, or at 0 where that is below.
    fn share(&self, limit: f32) -> f32 {
        let (a, half) = (self.torque, 0.5 * self.mechanical);
        let room = limit - self.speed - self.idle;
        let slope = a + half;
        if slope + half <= room || slope <= 0.0 {
            return 1.0;
        }
        let discriminant = half * half + a * room;
        let share = if discriminant < 0.0 {
            -half / a
        } else if half >= 0.0 {
            // The same root as below, without a difference of nearly equal numbers.
            room / (half + fast_sqrt(discriminant))
        } else {
            (fast_sqrt(discriminant) - half) / a
        };
        // NaN is no share.
        if share > 0.0 { share } else { 0.0 }
    }
}

/// Torques within a limit of power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allocation<const N: usize> {
    /// The torques.
    pub torques: [NewtonMetres; N],
    /// Their share of the wished ones, 0 ..= 1 but for a part in 10⁵.
    pub share: f32,
}

impl<const N: usize> Allocation<N> {
    /// A wish that is not finite has no share.
    fn of(wished: [NewtonMetres; N], share: f32) -> Self {
        let torques =
            if share > 0.0 { wished.map(|wish| wish * share) } else { [NewtonMetres::ZERO; N] };
        Self { torques, share }
    }
}
