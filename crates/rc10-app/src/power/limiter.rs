//! The limiter: how much power may be taken now, and what is learned of the model.

use super::{Allocation, Loads, PowerModel};
use crate::config::{ConfigError, positive};
use crate::maths::fast_sqrt;
use crate::ok;
use crate::units::{Joules, NewtonMetres, Rpm, Seconds, Watts};

/// What a [`PowerLimiter`] is told before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerConfig {
    /// The motors, as well as they are known.
    pub model: PowerModel,
    /// Each true number of the model is within its own over this factor, and times it; above 1: 2.2 where they are
    /// another team's.
    pub uncertainty: f32,
    /// The lowest and the highest limit of the rules. What a referee says beyond is not believed; until one is heard it
    /// is the lowest.
    pub limits: [Watts; 2],
    /// Energy of a full buffer.
    pub buffer: Joules,
}

impl PowerConfig {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(self.model.validate(), in "model");
        let [lowest, highest] = self.limits;
        ok!(ConfigError::check(
            self.uncertainty > 1.0 && self.uncertainty.is_finite(),
            "uncertainty",
            self.uncertainty,
            "above 1 and finite"
        ));
        ok!(positive("limits[0]", lowest.get()));
        ok!(positive("limits[1]", highest.get()));
        ok!(ConfigError::check(
            highest.get() >= lowest.get(),
            "limits[1]",
            highest.get(),
            "limits[0] or more"
        ));
        ConfigError::check(
            self.buffer.get() >= 2.0 * RESERVE && self.buffer.is_finite(),
            "buffer",
            self.buffer.get(),
            "12 J or more",
        )
    }
}

/// What the motors do and shall do, for a step of a [`PowerLimiter`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerInput<const N: usize> {
    /// Torques that are wished for.
    pub wished: [NewtonMetres; N],
    /// Torques as measured, by the currents.
    pub measured: [NewtonMetres; N],
    /// Speeds as measured.
    pub speeds: [Rpm; N],
    /// Power that others take from the same supply, as a base's steering.
    pub others: Watts,
    /// Share of the limit that the battery and the motors' temperatures allow, 0 ..= 1.
    pub derating: f32,
}

/// The referee's silence, s: three of its periods.
const SILENCE: f32 = 0.3;
/// Share of the last limit that is used in silence: the buffer does not correct the model then, and what is learned is
/// within 5 %; the rest is for the motors' heat.
const UNHEARD: f32 = 0.85;
/// How fast a limit that rises is believed, W/s; at once when it falls. A limit rises by a level in a second or two, and
/// a wrong one does little in that time.
const RISE: f32 = 2.0;
/// The guard keeps this energy, J: 5, and one that the referee rounds away.
const RESERVE: f32 = 6.0;
/// The time in which the guard would use up what is above that, s.
const HORIZON: f32 = 0.1;
/// After so long, s, a reading was lost: the buffer may have been full between, which the sums do not know.
const LATE: f32 = 0.15;
/// Nothing is learned for so long after the limit has changed, s: it may be wrong.
const STEADY: f32 = 5.0;
/// So many readings in a row may contradict what is known.
const CONTRADICTED: u8 = 6;
/// The age of a reading when it comes, s: the line, and a task's period.
const LAG: f32 = 0.02;
/// Energy that the limiter leaves in the buffer, J, and W for each joule above or below.
const TARGET: f32 = 15.0;
const GAIN: f32 = 4.0;
/// Variances: of a reading, J² (a joule is cut off); of each share, by second, as windings warm up; of the
/// energy, by reading.
const READING: f32 = 0.15;
const DRIFT: f32 = 1e-5;
const WANDER: f32 = 0.02;

/// Numbers of the model.
const NUMBERS: usize = 4;
/// Those and the energy, which is the first.
const STATES: usize = NUMBERS + 1;

/// Keeps a limit of power, by the buffer's energy, and learns the model.
///
/// Each number of the model has a share of its nominal one that is learned, by a Kalman filter of buffer and shares
/// (recursive least squares with forgetting). A share never leaves the uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct PowerLimiter {
    /// Learned shares of `mechanical`, `per_speed`, `per_torque`, `idle`.
    shares: [f32; NUMBERS],
    covariance: [[f32; STATES]; STATES],
    /// Energy as estimated at the last reading, and the most that it can have been, J.
    energy: f32,
    most: f32,
    /// The least that the buffer can have now, J.
    least: f32,
    /// The limit as it was read, and as far as it is believed, W.
    limit: f32,
    believed: f32,
    /// Time since the last reading, s; infinite before the first.
    age: f32,
    /// Since the last reading: J by nominal numbers, and J that the limit gave beside what others took.
    drawn: [f32; NUMBERS],
    gained: f32,
    /// For how long the limit has been the same, s.
    steady: f32,
    /// Readings that contradict what is known: in a row, and all.
    contradicted: u8,
    rejected: u32,
}

impl PowerLimiter {
    /// Nothing has been heard, and nothing is learned.
    pub const fn new(config: &PowerConfig) -> Self {
        let lowest = config.limits[0].get();
        Self {
            shares: [1.0; NUMBERS],
            covariance: prior(config),
            energy: config.buffer.get(),
            most: config.buffer.get(),
            least: config.buffer.get(),
            limit: lowest,
            believed: lowest,
            age: f32::INFINITY,
            drawn: [0.0; NUMBERS],
            gained: 0.0,
            steady: STEADY,
            contradicted: 0,
            rejected: 0,
        }
    }

    /// The model as it is learned.
    pub fn model(&self, config: &PowerConfig) -> PowerModel {
        let [mechanical, per_speed, per_torque, idle] = self.shares;
        let PowerModel { returned, .. } = config.model;
        PowerModel {
            mechanical: config.model.mechanical * mechanical,
            per_speed: config.model.per_speed * per_speed,
            per_torque: config.model.per_torque * per_torque,
            idle: config.model.idle * idle,
            returned,
        }
    }

    /// Whether the referee has been silent for 300 ms, or was never heard.
    #[must_use]
    pub const fn is_unheard(&self) -> bool {
        self.age >= SILENCE
    }

    /// The limit that is kept: as far as it is believed, and with a reserve in silence.
    pub fn limit(&self) -> Watts {
        let is_known = self.age < SILENCE || self.age.is_infinite();
        Watts::new(if is_known { self.believed } else { UNHEARD * self.believed })
    }

    /// The energy of the buffer by what was read last and drawn since.
    pub fn energy(&self) -> Joules {
        Joules::new(self.energy + self.gained - dot(&self.shares, &self.drawn))
    }

    /// Number of readings that contradicted the model, or the ones before.
    #[must_use]
    pub const fn rejected(&self) -> u32 {
        self.rejected
    }

    /// Takes what the referee says: its limit, and whole joules in the buffer.
    pub fn hear(&mut self, config: &PowerConfig, limit: Watts, buffer: Joules) {
        let [lowest, highest] = config.limits.map(Watts::get);
        let full = config.buffer.get();
        // Of NaN the lowest.
        let between = |x: f32, least: f32, most: f32| if x > least { x.min(most) } else { least };
        let limit = between(limit.get(), lowest, highest);
        let read = between(buffer.get(), 0.0, full);
        if self.age <= 0.0 {
            // No step since the last reading, so the motors do nothing that is known of.
            (self.most, self.least, self.limit) = (read + 1.0, read, limit);
            self.believed = self.believed.min(limit);
            return self.restart(read);
        }
        // It cannot have more than it had and gained, whatever is said.
        let drawn = dot(&self.shares, &self.drawn);
        let fewest = dot(&[1.0 / config.uncertainty; NUMBERS], &self.drawn);
        let fewest = fewest.max(drawn - self.spread(&self.drawn)).max(0.0);
        self.most = (self.most + self.gained - fewest).min(read + 1.0);
        let is_known = self.follow(config, read);
        let since = (drawn - self.gained).max(0.0) * (LAG / self.age.max(LAG));
        let least = read.min(self.most) - since;
        self.least = if is_known { least } else { least.min(self.least) };
        let is_same = (limit - self.limit).abs() < 0.5 || self.age.is_infinite();
        self.steady = if is_same { self.steady + self.age } else { 0.0 };
        (self.drawn, self.gained, self.age) = ([0.0; NUMBERS], 0.0, 0.0);
        self.limit = limit;
        self.believed = self.believed.min(limit);
    }

    /// Takes a power that a meter or a supercapacitor's controller measured while the motors did this.
    pub fn measure(
        &mut self,
        config: &PowerConfig,
        power: Watts,
        torques: &[NewtonMetres],
        speeds: &[Rpm],
    ) {
        let [a, b, c, d] = self.drawing(config, torques, speeds);
        let off = power.get() - dot(&self.shares, &[a, b, c, d]);
        // Within 3 % and half a watt.
        let error = 0.03 * power.get() + 0.5;
        // While the motors brake, the supply tells nothing.
        if off.is_finite() && power.get() > 0.0 {
            self.correct(config, &[0.0, a, b, c, d], off, error * error);
        }
    }

    /// A step: the torques that may be given for the coming `dt`, which has passed since the last step, too. An input that
    /// is not finite gives no torque, and changes nothing.
    pub fn allocate<const N: usize>(
        &mut self,
        config: &PowerConfig,
        input: &PowerInput<N>,
        dt: Seconds,
    ) -> Allocation<N> {
        let model = self.model(config);
        let loads = model.loads(&input.wished, &input.speeds, true);
        let drawn = self.drawing(config, &input.measured, &input.speeds);
        let (wish, others) = (loads.sum(), input.others.get());
        if !(dt.is_step() && (wish + others + dot(&self.shares, &drawn)).is_finite()) {
            return Allocation::of(input.wished, 0.0);
        }
        self.draw(config, &drawn, others, dt.get());

        let room = self.limit().get();
        let of_heat = if input.derating >= 0.0 { input.derating.min(1.0) } else { 0.0 };
        // What the buffer allows by what is learned...
        let energy = self.energy().get().min(self.most + self.gained);
        let learned = if self.is_unheard() { room } else { room + GAIN * (energy - TARGET) };
        // ...and at worst: the last word.
        let floor = if self.is_unheard() { room } else { config.limits[0].get() };
        let worst = self.worst(config, &self.by_nominal(&loads));
        let unsure = if worst > wish && wish > 0.0 { worst / wish } else { 1.0 };
        let certain = (floor + (self.least - RESERVE).max(0.0) / HORIZON) / unsure;
        let limit = of_heat * learned.min(certain).max(0.0) - others;
        Allocation::of(input.wished, loads.share(limit))
    }

    /// The power by each nominal number that motors draw.
    fn drawing(
        &self,
        config: &PowerConfig,
        torques: &[NewtonMetres],
        speeds: &[Rpm],
    ) -> [f32; NUMBERS] {
        self.by_nominal(&self.model(config).loads(torques, speeds, false))
    }

    fn by_nominal(&self, loads: &Loads) -> [f32; NUMBERS] {
        let [mechanical, speed, torque, idle] = self.shares;
        let Loads { mechanical: of_both, speed: of_speed, torque: of_torque, idle: alone } = *loads;
        [of_both / mechanical, of_speed / speed, of_torque / torque, alone / idle]
    }

    /// What was drawn in a step.
    fn draw(&mut self, config: &PowerConfig, drawn: &[f32; NUMBERS], others: f32, dt: f32) {
        self.age += dt;
        // What was said last is not believed more the longer nothing is said.
        if self.age < SILENCE {
            self.believed = self.limit.min(self.believed + RISE * dt);
        }
        let room = if self.age.is_finite() { self.limit().get() } else { self.believed };
        let full = config.buffer.get();
        let worst = self.worst(config, drawn).max(0.0) + others;
        self.least = (self.least + (room - worst) * dt).min(full);
        // What comes back beyond what the others take is not taken by the supply.
        if dot(&self.shares, drawn) > 0.0 {
            for (sum, drawn) in self.drawn.iter_mut().zip(drawn) {
                *sum += drawn * dt;
            }
        }
        self.gained += (self.limit - others) * dt;
    }

    /// Three standard deviations of what loads take, and never more than the uncertainty.
    fn worst(&self, config: &PowerConfig, row: &[f32; NUMBERS]) -> f32 {
        let likely = dot(&self.shares, row) + self.spread(row);
        let most = config.uncertainty * dot(&[1.0; NUMBERS], row);
        if row[0] >= 0.0 { likely.min(most) } else { likely }
    }

    fn spread(&self, row: &[f32; NUMBERS]) -> f32 {
        let mut sum = 0.0;
        for (of_state, share) in self.covariance.iter().skip(1).zip(row) {
            let [_, a, b, c, d] = *of_state;
            sum += share * dot(&[a, b, c, d], row);
        }
        3.0 * fast_sqrt(sum)
    }

    /// Takes the filter to a reading; whether that is believed.
    fn follow(&mut self, config: &PowerConfig, read: f32) -> bool {
        let full = config.buffer.get();
        let drawn = self.drawn;
        let energy = self.energy().get().min(full);
        // A full buffer is exactly full; of others a joule is cut off.
        let read = if read >= full { full } else { read + 0.5 };
        // It is predicted: each share drew its part.
        let of_shares: [f32; NUMBERS] = core::array::from_fn(|at| {
            let [_, a, b, c, d] = self.covariance[at + 1];
            dot(&[a, b, c, d], &drawn)
        });
        let [variance, a, b, c, d] = self.covariance[0];
        let of_energy = dot(&[a, b, c, d], &drawn);
        self.covariance[0][0] = variance - 2.0 * of_energy + dot(&of_shares, &drawn) + WANDER;
        for (at, less) in of_shares.into_iter().enumerate() {
            let covariance = self.covariance[0][at + 1] - less;
            self.covariance[0][at + 1] = covariance;
            self.covariance[at + 1][0] = covariance;
            self.covariance[at + 1][at + 1] += DRIFT * self.age.min(60.0);
        }
        let late = 0.5 * LAG * (self.gained - dot(&self.shares, &drawn)) / self.age.max(LAG);
        self.energy = energy;
        let off = read - energy;
        let noise = READING + late * late;
        let learns = self.age < LATE && self.steady >= STEADY;
        let is_far = off * off > 25.0 * (self.covariance[0][0] + noise) + 4.0;
        // Less than predicted may be by a limit that is not known, or a buffer that was full.
        if is_far && (learns || off > 0.0) {
            self.rejected = self.rejected.wrapping_add(1);
            self.contradicted += 1;
            if self.contradicted <= CONTRADICTED {
                return false;
            }
            if learns {
                // The model is wrong, then: nothing that was learned is certain.
                self.covariance = prior(config);
            }
        }
        self.contradicted = 0;
        if read >= full || is_far || !learns {
            // How much more was left over a full one does not say.
            self.restart(read);
        } else {
            self.correct(config, &[1.0, 0.0, 0.0, 0.0, 0.0], off, noise);
        }
        true
    }

    /// The energy is known anew, whatever the shares are.
    fn restart(&mut self, energy: f32) {
        self.energy = energy;
        let [of_energy, of_shares @ ..] = &mut self.covariance;
        *of_energy = [READING, 0.0, 0.0, 0.0, 0.0];
        for [with_energy, ..] in of_shares {
            *with_energy = 0.0;
        }
    }

    /// A measurement of `row` · states that is `off` by this, with this variance.
    fn correct(&mut self, config: &PowerConfig, row: &[f32; STATES], off: f32, noise: f32) {
        let of_row = self.covariance.map(|of_state| dot(&of_state, row));
        let by = 1.0 / (dot(&of_row, row) + noise);
        let [of_energy, of_shares @ ..] = of_row;
        self.energy += of_energy * by * off;
        let (least, most) = (1.0 / config.uncertainty, config.uncertainty);
        for (share, of_share) in self.shares.iter_mut().zip(of_shares) {
            *share = (*share + of_share * by * off).max(least).min(most);
        }
        for (of_state, left) in self.covariance.iter_mut().zip(of_row) {
            for (covariance, right) in of_state.iter_mut().zip(of_row) {
                *covariance -= left * right * by;
            }
        }
    }
}

/// Every share may be anywhere within the uncertainty.
const fn prior(config: &PowerConfig) -> [[f32; STATES]; STATES] {
    let deviation = 0.5 * (config.uncertainty - 1.0);
    let mut covariance = [[0.0; STATES]; STATES];
    let mut at = 0;
    while at < STATES {
        covariance[at][at] = if at == 0 { READING } else { deviation * deviation };
        at += 1;
    }
    covariance
}

fn dot<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b)
}
