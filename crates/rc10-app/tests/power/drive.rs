//! A base that drives under a referee: a small plant of its own, in f64, in steps of 10 ms.

use std::f64::consts::PI;

use rc10_app::{NewtonMetres, PowerModel, Rpm, Watts};

use crate::random::Random;

pub const DT: f64 = 0.01;
/// The rules that all of these robots drive by.
pub const LIMITS: [f64; 2] = [45.0, 120.0];
pub const FULL: f64 = 60.0;

/// Numbers of one M3508 as HKUST ENTERPRIZE published theirs.
pub const M3508: PowerModel =
    PowerModel { mechanical: 1.0, per_speed: 0.22, per_torque: 1.2, idle: 2.78, returned: 0.0 };

/// Radius and half of length and width of a mecanum base, m.
const RADIUS: f64 = 0.076;
const ARM: f64 = 0.42;
/// Speeds of the wheels, rad/s, by vx, vy, wz.
const ROWS: [[f64; 3]; 4] =
    [[1.0, -1.0, -ARM], [1.0, 1.0, ARM], [1.0, 1.0, -ARM], [1.0, -1.0, ARM]];

pub type Four = [f64; 4];

/// What a policy is told in each step.
pub struct Sight {
    pub wished: Four,
    /// Torques as measured, with noise.
    pub measured: Four,
    pub speeds: Four,
    /// For the one that knows the truth: the model, the limit, and the buffer.
    pub truth: PowerModel,
    pub limit: f64,
    pub buffer: f64,
}

impl Sight {
    pub fn wished(&self) -> [NewtonMetres; 4] {
        self.wished.map(|torque| NewtonMetres::new(torque as f32))
    }
    pub fn measured(&self) -> [NewtonMetres; 4] {
        self.measured.map(|torque| NewtonMetres::new(torque as f32))
    }
    pub fn speeds(&self) -> [Rpm; 4] {
        self.speeds.map(|speed| Rpm::new((speed * 30.0 / PI) as f32))
    }
}

/// A way to keep the limit.
pub trait Policy {
    fn hear(&mut self, _limit: f64, _buffer: f64) {}
    /// The torques for the next step.
    fn decide(&mut self, sight: &Sight) -> Four;
}

/// What the referee does to its listener.
#[derive(Clone, Copy, Debug, Default)]
pub struct Trouble {
    /// It is silent at times, and at times from the beginning.
    pub silence: bool,
    /// It tells wrong limits at times, for up to three seconds.
    pub limits: bool,
    /// It tells wrong energies at times, for up to half a second, from the tenth second on: before, nothing is learned
    /// that they could contradict.
    pub energies: bool,
}

/// What came of a drive.
#[derive(Clone, Copy, Debug)]
pub struct Driven {
    /// The lowest energy of the buffer, J.
    pub lowest: f64,
    /// Seconds with an empty buffer.
    pub empty: f64,
    /// The way of the base, a turn of 1 rad as 0.3 m.
    pub way: f64,
    /// The energy drawn, J.
    pub energy: f64,
    /// By how much the windings' resistance has grown.
    pub hot: f64,
}

/// The true power of wheels.
pub fn power(model: &PowerModel, hot: f64, torques: &Four, speeds: &Four) -> f64 {
    let [mechanical, per_speed, per_torque, idle, returned] =
        [model.mechanical, model.per_speed, model.per_torque, model.idle, model.returned]
            .map(f64::from);
    let mut sum = idle;
    for (torque, speed) in torques.iter().zip(speeds) {
        let one = mechanical * torque * speed
            + per_speed * speed.abs()
            + per_torque * hot * torque * torque;
        sum += if one < 0.0 { returned * one } else { one };
    }
    sum.max(0.0)
}

/// A robot, its driver and its referee, all by one seed.
pub struct Drive {
    random: Random,
    truth: PowerModel,
    trouble: Trouble,
    volts: f64,
    limit: f64,
}

fn up_to(random: &mut Random, size: f64) -> f64 {
    0.5 * (f64::from(random.within(1.0)) + 1.0) * size
}

fn within(random: &mut Random, size: f64) -> f64 {
    f64::from(random.within(1.0)) * size
}

impl Drive {
    /// A robot, and its model as its team believes it to be: each number off by up to 50 %.
    pub fn new(seed: u64, trouble: Trouble, returned: f32) -> (Self, PowerModel) {
        let mut random = Random(seed);
        let mut vary = |number: f32| number * (0.95 + 0.25 * random.within(1.0));
        let truth = PowerModel {
            mechanical: vary(1.1),
            per_speed: vary(M3508.per_speed),
            per_torque: vary(M3508.per_torque),
            idle: vary(M3508.idle),
            returned,
        };
        let mut off = |number: f32| number * (1.0 + 0.5 * random.within(1.0));
        let believed = PowerModel {
            mechanical: off(truth.mechanical),
            per_speed: off(truth.per_speed),
            per_torque: off(truth.per_torque),
            idle: off(truth.idle),
            returned,
        };
        let volts = 24.0 + within(&mut random, 2.0);
        let limit = LIMITS[0] + 5.0 * up_to(&mut random, 14.0).floor();
        (Self { random, truth, trouble, volts, limit }, believed)
    }

    pub const fn truth(&self) -> &PowerModel {
        &self.truth
    }

    /// Drives for some seconds. The same drive for each policy: its driver and its referee do not look at the robot.
    pub fn run(&self, policy: &mut dyn Policy, seconds: f64) -> Driven {
        let mut random = Random(self.random.0);
        let (mut limit, mut buffer) = (self.limit, FULL);
        let (mut twist, mut torques) = ([0.0; 3], [0.0; 4]);
        let mut driven = Driven { lowest: FULL, empty: 0.0, way: 0.0, energy: 0.0, hot: 1.0 };
        let (mut target, mut until, mut slope, mut is_wall) = ([0.0; 3], 0, [0.0; 2], false);
        let (mut silent_until, mut lies_until, mut lie) = (0, 0, [None::<f64>; 2]);
        let mut fell = 0;
        let (mut taken, mut hot, mut said) = (0.0, 1.0, None::<(f64, f64, u64)>);
        let steps = (seconds / DT) as u64;
        for step in 0..steps {
            if step >= until {
                let shape = up_to(&mut random, 6.0) as u8;
                // At the highest speed the lowest limit just pays for turning wheels, without a torque.
                let speed = 1.0 + up_to(&mut random, 2.0);
                let way = within(&mut random, PI);
                let turn = within(&mut random, 6.5);
                target = match shape {
                    0 => [0.0; 3],
                    1 => [speed * way.cos().signum(), 0.0, 0.0],
                    2 => [0.0, 0.0, turn],
                    3 => [0.6 * speed * way.cos(), 0.6 * speed * way.sin(), 0.6 * turn],
                    _ => [speed * way.cos(), speed * way.sin(), 0.0],
                };
                until = step + (20.0 + up_to(&mut random, 250.0)) as u64;
                let tilt = if up_to(&mut random, 1.0) < 0.3 { 35.0 } else { 0.0 };
                slope = [within(&mut random, tilt), within(&mut random, tilt)];
                is_wall = up_to(&mut random, 1.0) < 0.05;
            }
            // The limit rises by a level, or is another robot's.
            if step % 100 == 50 && up_to(&mut random, 60.0) < 2.0 {
                let up = if up_to(&mut random, 1.0) < 0.8 { 5.0 } else { -15.0 };
                // A fall is told: what is never heard no policy can know.
                if up > 0.0 || step >= silent_until {
                    fell = if up < 0.0 { step } else { fell };
                    limit = (limit + up).clamp(LIMITS[0], LIMITS[1]);
                }
            }
            let mut speeds = [0.0; 4];
            for (speed, row) in speeds.iter_mut().zip(&ROWS) {
                *speed = (row[0] * twist[0] + row[1] * twist[1] + row[2] * twist[2]) / RADIUS;
            }
            let mut wished = [0.0_f64; 4];
            for (at, wished) in wished.iter_mut().enumerate() {
                let row = ROWS[at];
                let to = (row[0] * target[0] + row[1] * target[1] + row[2] * target[2]) / RADIUS;
                let hold = 0.15 * to.signum() * f64::from(u8::from(to != 0.0));
                *wished = (0.9 * (to - speeds[at]) + hold).clamp(-6.0, 6.0);
            }
            let measured = torques.map(|torque: f64| {
                torque * (1.0 + within(&mut random, 0.01)) + within(&mut random, 0.01)
            });
            if let Some((limit, buffer, _)) = said.take_if(|(_, _, at)| *at <= step) {
                policy.hear(limit, buffer);
            }
            let truth = PowerModel { per_torque: self.truth.per_torque * hot as f32, ..self.truth };
            let sight = Sight { wished, measured, speeds, truth, limit, buffer };
            torques = policy.decide(&sight);
            let amps: f64 = torques.iter().map(|torque| torque.abs() / 0.3).sum();
            let volts = self.volts - 0.02 * amps;
            for (torque, speed) in torques.iter_mut().zip(&speeds) {
                let room = |sign: f64| ((volts - sign * 0.48 * speed) / 0.2 * 0.3).max(0.0);
                *torque = torque.clamp(-room(-1.0), room(1.0));
            }
            let [mut force, mut sideways, mut moment] = [slope[0], slope[1], 0.0];
            for (at, torque) in torques.iter().enumerate() {
                let friction = 0.15 * (speeds[at] / 0.5).clamp(-1.0, 1.0) + 0.003 * speeds[at];
                let rim = (torque - friction) / RADIUS;
                force += ROWS[at][0] * rim;
                sideways += ROWS[at][1] * rim;
                moment += ROWS[at][2] * rim;
            }
            // 18 kg and 1 kg m², and the rotors of four motors.
            twist[0] += DT * force / 20.5;
            twist[1] += DT * sideways / 20.5;
            twist[2] += DT * moment / 1.45;
            if is_wall {
                twist = [0.0, 0.0, twist[2] * 0.5];
            }
            for (speed, row) in speeds.iter_mut().zip(&ROWS) {
                *speed = (row[0] * twist[0] + row[1] * twist[1] + row[2] * twist[2]) / RADIUS;
            }
            let watts = power(&self.truth, hot, &torques, &speeds);
            // The windings warm up by up to a quarter.
            let loss: f64 = torques.iter().map(|torque| torque * torque).sum();
            hot += DT / 60.0 * ((1.0 + 0.02 * loss).min(1.25) - hot);
            taken += watts * DT;
            driven.energy += watts * DT;
            driven.way += DT * twist[0].hypot(twist[1]).hypot(0.3 * twist[2]);
            if step % 10 == 9 {
                let left = buffer + 0.1 * limit - taken;
                driven.empty += if left < 0.0 { 0.1 } else { 0.0 };
                (buffer, taken) = (left.clamp(0.0, FULL), 0.0);
                driven.lowest = driven.lowest.min(left);
                let begins = self.trouble.silence && up_to(&mut random, 200.0) < 1.0;
                if begins && (fell == 0 || step > fell + 200) {
                    silent_until = step + (30.0 + up_to(&mut random, 1000.0)) as u64;
                }
                if step == 9 && self.trouble.silence && up_to(&mut random, 1.0) < 0.1 {
                    silent_until = step + (100.0 + up_to(&mut random, 3000.0)) as u64;
                }
                if step >= lies_until {
                    lie = [None; 2];
                    let chance = up_to(&mut random, 200.0) < 1.0;
                    let (what, how) = (up_to(&mut random, 2.0), up_to(&mut random, 250.0));
                    if chance && what < 1.0 && self.trouble.limits {
                        lie = [Some(how), None];
                        lies_until = step + up_to(&mut random, 300.0) as u64;
                    } else if chance && what >= 1.0 && self.trouble.energies && step > 1_000 {
                        lie = [None, Some(how)];
                        lies_until = step + up_to(&mut random, 50.0) as u64;
                    }
                }
                let is_lost = up_to(&mut random, 50.0) < 1.0;
                if step >= silent_until && !is_lost {
                    let told = [lie[0].unwrap_or(limit), lie[1].unwrap_or(buffer)];
                    // It comes in the next step or in the one after.
                    let late = 1 + u64::from(up_to(&mut random, 1.0) < 0.5);
                    said = Some((told[0], told[1].floor(), step + late));
                }
            }
        }
        Driven { hot, ..driven }
    }
}

pub fn watts(limit: f64) -> Watts {
    Watts::new(limit as f32)
}
