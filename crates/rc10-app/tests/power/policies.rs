//! Ways to keep the limit: ours, one that knows the truth, and what three teams' code does, restated.

use rc10_app::{
    Allocation, Joules, PowerConfig, PowerInput, PowerLimiter, PowerModel, Seconds, Watts,
};

use super::drive::{DT, FULL, Four, LIMITS, Policy, Sight, watts};

fn four(given: &Allocation<4>) -> Four {
    given.torques.map(|torque| f64::from(torque.get()))
}

pub const fn config(model: PowerModel) -> PowerConfig {
    PowerConfig {
        model,
        uncertainty: 2.2,
        limits: [Watts::new(LIMITS[0] as f32), Watts::new(LIMITS[1] as f32)],
        buffer: Joules::new(FULL as f32),
    }
}

pub struct Ours {
    pub config: PowerConfig,
    pub limiter: PowerLimiter,
}

impl Ours {
    pub const fn new(believed: PowerModel) -> Self {
        let config = config(believed);
        Self { config, limiter: PowerLimiter::new(&config) }
    }
}

impl Policy for Ours {
    fn hear(&mut self, limit: f64, buffer: f64) {
        self.limiter.hear(&self.config, watts(limit), Joules::new(buffer as f32));
    }
    fn decide(&mut self, sight: &Sight) -> Four {
        let input = PowerInput {
            wished: sight.wished(),
            measured: sight.measured(),
            speeds: sight.speeds(),
            others: Watts::ZERO,
            derating: 1.0,
        };
        four(&self.limiter.allocate(&self.config, &input, Seconds::new(DT as f32)))
    }
}

/// Knows the model, the limit and the buffer to the last digit, and uses the buffer to 5 J.
pub struct Truth;

impl Policy for Truth {
    fn decide(&mut self, sight: &Sight) -> Four {
        let limit = sight.limit + (sight.buffer - 11.0).max(0.0) / 0.15;
        four(&sight.truth.allocate(sight.wished(), sight.speeds(), watts(limit)))
    }
}

/// No limit at all.
pub struct Nothing;

impl Policy for Nothing {
    fn decide(&mut self, sight: &Sight) -> Four {
        sight.wished
    }
}

/// taproot: a ratio of the buffer's energy on all currents; none while the referee is silent.
pub struct Taproot {
    energy: f64,
    age: f64,
}

impl Taproot {
    pub const fn new() -> Self {
        Self { energy: FULL, age: 0.0 }
    }
}

impl Policy for Taproot {
    fn hear(&mut self, _limit: f64, buffer: f64) {
        (self.energy, self.age) = (buffer, 0.0);
    }
    fn decide(&mut self, sight: &Sight) -> Four {
        self.age += DT;
        // Thresholds of 40 and 5 J; it is off the receiver's list after a second.
        let ratio = if self.age > 1.0 || self.energy >= 40.0 {
            1.0
        } else {
            ((self.energy - 5.0) / 40.0).clamp(0.0, 1.0)
        };
        sight.wished.map(|torque| torque * ratio)
    }
}

/// The largest torque of a motor, towards its wish, that takes this power by a model; half of the wish where the
/// root is of a negative number, as their code has it.
fn root(model: &PowerModel, wish: f64, speed: f64, power: f64) -> f64 {
    let [gain, per_speed, a] = [model.mechanical, model.per_speed, model.per_torque].map(f64::from);
    let (b, c) = (gain * speed, per_speed * speed.abs() - power);
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return 0.5 * wish;
    }
    let of = discriminant.sqrt();
    if wish > 0.0 {
        ((of - b) / (2.0 * a)).clamp(0.0, wish)
    } else {
        ((-of - b) / (2.0 * a)).clamp(wish, 0.0)
    }
}

fn one(model: &PowerModel, torque: f64, speed: f64) -> f64 {
    f64::from(model.mechanical) * torque * speed
        + f64::from(model.per_speed) * speed.abs()
        + f64::from(model.per_torque) * torque * torque
}

/// The community's (XJTLU's and its copies): constants of a regression, power of each motor scaled down by one
/// factor, and its quadratic solved; a loop holds the buffer at 30 J.
pub struct Community {
    pub model: PowerModel,
    limit: f64,
    energy: f64,
}

impl Community {
    pub const fn new(model: PowerModel) -> Self {
        Self { model, limit: LIMITS[0], energy: FULL }
    }
}

impl Policy for Community {
    fn hear(&mut self, limit: f64, buffer: f64) {
        (self.limit, self.energy) = (limit, buffer);
    }
    fn decide(&mut self, sight: &Sight) -> Four {
        let most = (self.limit + 2.0 * (self.energy - 30.0) - f64::from(self.model.idle)).max(0.0);
        let powers: Four =
            core::array::from_fn(|at| one(&self.model, sight.wished[at], sight.speeds[at]));
        let sum: f64 = powers.iter().filter(|power| **power > 0.0).sum();
        if sum <= most {
            return sight.wished;
        }
        core::array::from_fn(|at| {
            let (wish, speed) = (sight.wished[at], sight.speeds[at]);
            if powers[at] < 0.0 {
                wish
            } else {
                root(&self.model, wish, speed, powers[at] * most / sum)
            }
        })
    }
}

/// HKUST ENTERPRIZE 2024 without a supercapacitor, so that it learns nothing: shares by the errors of the speeds, a
/// loop on the root of the energy, 0.85 of the last limit in silence.
pub struct Hkust {
    pub model: PowerModel,
    limit: f64,
    energy: f64,
    age: f64,
}

impl Hkust {
    pub const fn new(model: PowerModel) -> Self {
        Self { model, limit: LIMITS[0], energy: FULL, age: 0.0 }
    }
}

impl Policy for Hkust {
    fn hear(&mut self, limit: f64, buffer: f64) {
        (self.limit, self.energy, self.age) = (limit, buffer, 0.0);
    }
    fn decide(&mut self, sight: &Sight) -> Four {
        self.age += DT;
        let of_energy = 20.0 * (self.energy.sqrt() - 50.0_f64.sqrt());
        let limit = if self.age > 0.5 { 0.85 * self.limit } else { self.limit + of_energy };
        let most = (limit - f64::from(self.model.idle)).max(0.0);
        let powers: Four =
            core::array::from_fn(|at| one(&self.model, sight.wished[at], sight.speeds[at]));
        let back: f64 = powers.iter().filter(|power| **power < 0.0).sum();
        let sum: f64 = powers.iter().filter(|power| **power > 0.0).sum();
        let most = most - back * f64::from(self.model.returned);
        if sum <= most {
            return sight.wished;
        }
        let errors: f64 = sight.wished.iter().map(|wish| wish.abs()).sum();
        core::array::from_fn(|at| {
            let (wish, speed) = (sight.wished[at], sight.speeds[at]);
            // By error where it is large, by power where it is small.
            let by_error = wish.abs() / errors.max(1e-6);
            let by_power = powers[at] / sum;
            let confidence = ((errors - 4.0) / 8.0).clamp(0.0, 1.0);
            let share = confidence * by_error + (1.0 - confidence) * by_power;
            if powers[at] < 0.0 { wish } else { root(&self.model, wish, speed, most * share) }
        })
    }
}
