//! The physics of one motor with its gearbox and load.

use std::f64::consts::TAU;

use crate::device::Winding;
use crate::plant::{Nonlinear, Plant};

/// Physics step in seconds, on one grid for all motors and bases of a world.
pub(crate) const STEP: f64 = 100e-6;

/// The shaft of a motor with its gearbox and load. A device sees it through its sensors: exact, and as
/// of the last physics step.
#[derive(Clone)]
pub struct Shaft {
    /// The motor with its gearbox and load.
    pub plant: Plant,
    /// The share of a difference that is left after one step: exact exponentials.
    current_decay: f64,
    thermal_decay: f64,
    /// Current in the winding, A.
    pub current: f64,
    /// Speed of the output shaft, rad/s.
    pub speed: f64,
    /// Rotor turns since the start: whole ones, and the rest in 0 .. 1. Exact after any time.
    turns: i64,
    fraction: f64,
    /// The angle of the rotor in its turn at the start, 0 .. 1.
    offset: f64,
    /// Temperature of the motor, °C.
    pub temperature: f64,
    /// How far the output shaft is ahead of the load in its play, rad, and the load's speed, rad/s. Of
    /// no use without backlash.
    lead: f64,
    load_speed: f64,
    /// Constant torque on the load, N·m.
    pub(crate) load: f64,
    /// Angles of the load, in degrees since the start, between which it can turn.
    pub(crate) travel: Option<[f64; 2]>,
    /// Torque of the ground on the wheel, N·m, and the wheel's rolling friction.
    pub(crate) reaction: f64,
    pub(crate) rolling_friction: f64,
}

impl Shaft {
    pub(crate) fn new(plant: Plant, offset: f64) -> Self {
        Self {
            plant,
            current_decay: decay(plant.current_time_constant),
            thermal_decay: decay(plant.thermal_time_constant),
            current: 0.0,
            speed: 0.0,
            turns: 0,
            fraction: 0.0,
            offset,
            temperature: plant.ambient,
            lead: 0.0,
            load_speed: 0.0,
            load: 0.0,
            travel: None,
            reaction: 0.0,
            rolling_friction: 0.0,
        }
    }

    /// Angle of the output shaft since the world's start, rad.
    pub fn radians(&self) -> f64 {
        self.output_degrees().to_radians()
    }

    /// What an encoder shows of it that has stood still, or counted the other way, since `then`.
    pub(crate) fn seen(&self, then: &Self, is_flipped: bool) -> Self {
        let mut seen = self.clone();
        (seen.turns, seen.fraction, seen.speed) = (then.turns, then.fraction, 0.0);
        if is_flipped {
            let back = 2.0 * then.fraction - self.fraction;
            #[expect(clippy::cast_possible_truncation, reason = "-1, 0 or 1")]
            let whole = back.floor() as i64;
            seen.turns = 2 * then.turns - self.turns + whole;
            (seen.fraction, seen.speed) = (back - back.floor(), -self.speed);
        }
        seen
    }

    /// Torque of the winding at the output shaft, N·m.
    pub const fn torque(&self) -> f64 {
        self.plant.torque_constant * self.current
    }

    pub(crate) fn set_plant(&mut self, plant: Plant) {
        (self.load_speed, self.lead) = (self.load_speed(), 0.0);
        self.plant = plant;
        self.current_decay = decay(plant.current_time_constant);
        self.thermal_decay = decay(plant.thermal_time_constant);
    }

    /// Turns of the rotor, of which the whole ones do not matter.
    pub(crate) fn set_rotor_angle(&mut self, turns: f64) {
        self.offset = (turns - self.fraction).rem_euclid(1.0);
    }

    /// What a force on the load meets at least, kg·m²: behind a play the load alone.
    pub(crate) const fn contact_inertia(&self) -> f64 {
        if self.has_play() { self.plant.load_inertia.max(1e-9) } else { self.plant.inertia() }
    }

    /// The current the winding settles at.
    fn settled_current(&self, winding: Winding) -> f64 {
        let plant = &self.plant;
        let at_voltage = |volts: f64| (volts - plant.back_emf * self.speed) / plant.resistance;
        let limit = plant.current_limit;
        match winding {
            Winding::Open => 0.0,
            // Near the no-load speed the supply no longer drives the current that is asked for.
            Winding::Current(amps) => amps
                .max(-limit)
                .min(limit)
                .max(at_voltage(-plant.supply))
                .min(at_voltage(plant.supply)),
            Winding::Voltage(volts) => {
                let volts = volts.max(-plant.supply).min(plant.supply);
                at_voltage(volts).max(-limit).min(limit)
            }
        }
    }

    pub(crate) fn step(&mut self, winding: Winding) {
        let settled = self.settled_current(winding);
        self.current = match winding {
            Winding::Open => 0.0,
            _ => settled + (self.current - settled) * self.current_decay,
        };

        if self.has_play() {
            self.move_with_play();
        } else {
            self.move_as_one();
        }

        let plant = &self.plant;
        let moved = self.fraction + self.speed * STEP / TAU * plant.gear_ratio;
        let whole = moved.floor();
        #[expect(clippy::cast_possible_truncation, reason = "a whole number of turns; saturates")]
        {
            self.turns = self.turns.saturating_add(whole as i64);
        }
        self.fraction = moved - whole;

        let copper_loss = plant.resistance * self.current * self.current;
        let settled = plant.ambient + plant.thermal_resistance * copper_loss;
        self.temperature = settled + (self.temperature - settled) * self.thermal_decay;
        self.stop_at_ends();
    }

    const fn has_play(&self) -> bool {
        self.plant.nonlinear.backlash > 0.0
    }

    /// Half of the play, rad.
    fn half_play(&self) -> f64 {
        self.plant.nonlinear.backlash.max(0.0).to_radians() / 2.0
    }

    /// Dry friction of the gearbox, N·m: more of it while it stands.
    fn dry_friction(&self) -> f64 {
        if self.speed == 0.0 {
            self.plant.static_friction.max(self.plant.coulomb_friction)
        } else {
            self.plant.coulomb_friction
        }
    }

    /// A step of speed without backlash.
    fn move_as_one(&mut self) {
        let plant = &self.plant;
        let per_torque = STEP / plant.inertia();
        let mut torque = plant.torque_constant * self.current + self.load + self.reaction;
        if plant.nonlinear != Nonlinear::NONE {
            torque += self.gravity() + self.cogging();
        }
        let free = (self.speed + per_torque * torque) / (1.0 + per_torque * plant.viscous_friction);
        self.speed = slowed(free, per_torque * (self.dry_friction() + self.rolling_friction));
    }

    /// A step of both speeds with backlash: the shaft and the load move apart, each with its own friction,
    /// unless that would lead beyond an end of the play. Then they meet there without a bounce: one
    /// impulse between them, which keeps their momentum, takes away what is too much of the difference of
    /// their speeds (Moreau's time stepping). So the contact needs no stiffness, is stable whatever the
    /// inertias, and never adds energy.
    fn move_with_play(&mut self) {
        let plant = &self.plant;
        let shaft = plant.reflected_inertia().max(1e-9);
        let load = plant.load_inertia.max(1e-9);
        let torque = plant.torque_constant * self.current + self.cogging();
        let outside = self.load + self.reaction + self.gravity();
        let driven =
            (self.speed + STEP / shaft * torque) / (1.0 + STEP / shaft * plant.viscous_friction);
        let pulled = self.load_speed + STEP / load * outside;
        let (dry, rolling) = (self.dry_friction(), self.rolling_friction);

        let apart = (slowed(driven, STEP / shaft * dry), slowed(pulled, STEP / load * rolling));
        let lead = self.lead + STEP * (apart.0 - apart.1);
        let half = self.half_play();
        if lead.abs() <= half {
            (self.speed, self.load_speed) = apart;
            self.lead = lead;
            return;
        }
        let end = half.copysign(lead);
        let difference = (end - self.lead) / STEP;
        let both = shaft + load;
        let together =
            slowed((shaft * driven + load * pulled) / both, STEP / both * (dry + rolling));
        self.speed = together + load / both * difference;
        self.load_speed = together - shaft / both * difference;
        self.lead = end;
    }

    /// Torque of the weight on the load, N·m.
    fn gravity(&self) -> f64 {
        let Nonlinear { gravity_torque, gravity_offset, .. } = self.plant.nonlinear;
        if gravity_torque == 0.0 {
            return 0.0;
        }
        -gravity_torque * (self.load_degrees() + gravity_offset).to_radians().cos()
    }

    /// Cogging torque at the output shaft, N·m: the mean over the way of this step, so that a rotor that
    /// goes on by a whole period in every step does not see it as a constant.
    fn cogging(&self) -> f64 {
        let Nonlinear { cogging_torque, cogging_periods, .. } = self.plant.nonlinear;
        if cogging_torque == 0.0 {
            return 0.0;
        }
        let half_way = cogging_periods * self.speed * self.plant.gear_ratio * STEP / 2.0;
        let mean = if half_way.abs() < 1e-6 { 1.0 } else { half_way.sin() / half_way };
        cogging_torque * mean * (TAU * cogging_periods * self.rotor_angle()).sin()
    }

    /// Stops at an end of its travel: hard, and without a bounce.
    fn stop_at_ends(&mut self) {
        let Some([lowest, highest]) = self.travel else { return };
        let (degrees, speed) = (self.load_degrees(), self.load_speed());
        let end = if degrees < lowest && speed <= 0.0 {
            lowest
        } else if degrees > highest && speed >= 0.0 {
            highest
        } else {
            return;
        };
        let mut at = end;
        if self.has_play() {
            self.load_speed = 0.0;
            let lead = (self.output_degrees() - end).to_radians();
            self.lead = lead.max(-self.half_play()).min(self.half_play());
            if lead.abs() <= self.half_play() {
                return;
            }
            at += self.lead.to_degrees();
        }
        let turns = at / 360.0 * self.plant.gear_ratio;
        #[expect(clippy::cast_possible_truncation, reason = "a whole number of turns; saturates")]
        {
            self.turns = turns.floor() as i64;
        }
        self.fraction = turns - turns.floor();
        self.speed = 0.0;
    }

    /// Rotor speed, rpm.
    pub fn rotor_rpm(&self) -> f64 {
        self.output_rpm() * self.plant.gear_ratio
    }

    /// Output shaft's speed, rpm.
    pub(crate) fn output_rpm(&self) -> f64 {
        self.speed * 60.0 / TAU
    }

    /// Speed of the load, rad/s.
    pub(crate) const fn load_speed(&self) -> f64 {
        if self.has_play() { self.load_speed } else { self.speed }
    }

    /// Speed of the load, rpm.
    pub(crate) fn load_rpm(&self) -> f64 {
        self.load_speed() * 60.0 / TAU
    }

    /// Angle of the rotor within its turn, 0 .. 1.
    pub fn rotor_angle(&self) -> f64 {
        (self.fraction + self.offset).fract()
    }

    /// Turns of the rotor since the world's start, with where it stood then (0 .. 1).
    #[expect(clippy::cast_precision_loss, reason = "exact up to 2^53 turns")]
    pub fn rotor_turns(&self) -> f64 {
        self.turns as f64 + self.fraction + self.offset
    }

    /// Output shaft's angle since the start, degrees, over many turns.
    #[expect(clippy::cast_precision_loss, reason = "exact up to 2^53 turns")]
    pub(crate) fn output_degrees(&self) -> f64 {
        (self.turns as f64 + self.fraction) * 360.0 / self.plant.gear_ratio
    }

    /// The load's angle since the start, degrees.
    pub(crate) fn load_degrees(&self) -> f64 {
        if self.has_play() {
            self.output_degrees() - self.lead.to_degrees()
        } else {
            self.output_degrees()
        }
    }
}

/// The share of a difference that is left after one step, by a time constant in s.
fn decay(time_constant: f64) -> f64 {
    (-STEP / time_constant).exp()
}

/// A speed that dry friction takes so much away from, but never turns round: a shaft that it can hold
/// stands exactly still.
fn slowed(free: f64, lost: f64) -> f64 {
    free.signum() * (free.abs() - lost).max(0.0)
}
