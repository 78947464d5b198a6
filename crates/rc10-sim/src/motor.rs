//! The physics of one motor with its gearbox and load.

use std::f64::consts::TAU;

use crate::device::Winding;

/// Physics step in seconds, on one grid for all motors and bases of a world.
pub(crate) const STEP: f64 = 100e-6;

/// A motor with its gearbox, its ESC's limits and its load. Everything is seen from the output
/// shaft, in SI units, unless its name says otherwise.
///
/// Gear ratios, torque constants and no-load speeds are DJI's published ones; resistances,
/// inertias, friction and thermal figures are our estimates. A controller that only works with
/// exactly these is too finely tuned: test it with [`Plant::scaled`] by ±30 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// Rotor turns per turn of the output shaft.
    pub gear_ratio: f64,
    /// N·m at the output shaft per ampere.
    pub torque_constant: f64,
    /// V·s/rad at the output shaft.
    pub back_emf: f64,
    /// Ω.
    pub resistance: f64,
    /// V at the ESC.
    pub supply: f64,
    /// Largest current the ESC drives, ± A.
    pub current_limit: f64,
    /// Time constant in s with which the current follows: of the ESC's current loop, or L/R where
    /// the ESC only sets the voltage.
    pub current_time_constant: f64,
    /// Rotor's inertia at the rotor, kg·m².
    pub rotor_inertia: f64,
    /// Inertia of gearbox and load at the output shaft, kg·m².
    pub load_inertia: f64,
    /// Viscous friction, N·m·s/rad.
    pub viscous_friction: f64,
    /// Friction of the moving shaft that does not depend on speed, N·m.
    pub coulomb_friction: f64,
    /// Torque that sets the standing shaft in motion, N·m; not below the Coulomb friction.
    pub static_friction: f64,
    /// °C around the motor.
    pub ambient: f64,
    /// Heating at rest per watt of copper loss, °C/W.
    pub thermal_resistance: f64,
    /// Time constant of the heating, s.
    pub thermal_time_constant: f64,
}

/// Factors on a [`Plant`]; 1 leaves it as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// On rotor and load inertia.
    pub inertia: f64,
    /// On viscous, Coulomb and static friction.
    pub friction: f64,
    /// On the torque constant, and on the back-EMF, which comes from the same magnets.
    pub torque_constant: f64,
}

impl Default for Scale {
    fn default() -> Self {
        Self { inertia: 1.0, friction: 1.0, torque_constant: 1.0 }
    }
}

impl Plant {
    /// M3508 with its gearbox on a C620, 24 V, no load on the shaft.
    #[must_use]
    pub const fn m3508() -> Self {
        Self {
            // C620 / M3508 manual: 3591:187, 0.3 N·m/A, 482 rpm (9250 at the rotor) without load.
            gear_ratio: 3591.0 / 187.0,
            torque_constant: 0.3,
            back_emf: 0.0,
            resistance: 0.194,
            supply: 24.0,
            current_limit: 20.0,
            current_time_constant: 1e-3,
            rotor_inertia: 1e-5,
            load_inertia: 0.0,
            viscous_friction: 2.6e-3,
            coulomb_friction: 0.10,
            static_friction: 0.13,
            ambient: 25.0,
            thermal_resistance: 2.5,
            thermal_time_constant: 300.0,
        }
        .with_no_load_speed(9250.0)
    }

    /// M2006 with its gearbox on a C610, 24 V, no load on the shaft.
    #[must_use]
    pub const fn m2006() -> Self {
        Self {
            // C610 / M2006 manual: 36:1, 0.18 N·m/A, 500 rpm (18000 at the rotor) without load.
            gear_ratio: 36.0,
            torque_constant: 0.18,
            back_emf: 0.0,
            resistance: 0.461,
            supply: 24.0,
            current_limit: 10.0,
            current_time_constant: 1e-3,
            rotor_inertia: 1e-6,
            load_inertia: 0.0,
            viscous_friction: 1.1e-3,
            coulomb_friction: 0.05,
            static_friction: 0.065,
            ambient: 25.0,
            thermal_resistance: 8.0,
            thermal_time_constant: 150.0,
        }
        .with_no_load_speed(18_000.0)
    }

    /// GM6020 in current mode, 24 V, no load on the shaft.
    #[must_use]
    pub const fn gm6020() -> Self {
        Self {
            // GM6020 manual: no gearbox, 0.741 N·m/A, about 320 rpm without load. The back-EMF
            // equals the torque constant.
            gear_ratio: 1.0,
            torque_constant: 0.741,
            back_emf: 0.741,
            resistance: 1.8,
            supply: 24.0,
            current_limit: 3.0,
            current_time_constant: 1e-3,
            rotor_inertia: 4e-4,
            load_inertia: 0.0,
            viscous_friction: 1e-3,
            coulomb_friction: 0.04,
            static_friction: 0.05,
            ambient: 25.0,
            thermal_resistance: 8.0,
            thermal_time_constant: 400.0,
        }
    }

    /// GM6020 in voltage mode: the current follows the winding's L/R, 5.7 mH / 1.8 Ω.
    #[must_use]
    pub const fn gm6020_voltage() -> Self {
        let mut plant = Self::gm6020();
        plant.current_time_constant = 3.2e-3;
        plant
    }

    /// The back-EMF that makes the unloaded rotor reach `rotor_rpm` at full supply.
    pub(crate) const fn with_no_load_speed(mut self, rotor_rpm: f64) -> Self {
        let speed = rotor_rpm / self.gear_ratio * TAU / 60.0;
        let friction = self.coulomb_friction + self.viscous_friction * speed;
        let drop = self.resistance * friction / self.torque_constant;
        self.back_emf = (self.supply - drop) / speed;
        self
    }

    /// The same with a load of this inertia at the output shaft, kg·m².
    #[must_use]
    pub const fn with_load_inertia(mut self, inertia: f64) -> Self {
        self.load_inertia = inertia;
        self
    }

    /// The same motor behind another gearbox: `ratio` turns of the rotor per turn of the output
    /// shaft. Torque per ampere and back-EMF grow with it, dry friction too, viscous friction with
    /// its square.
    #[must_use]
    pub const fn with_gear(mut self, ratio: f64) -> Self {
        let by = ratio / self.gear_ratio;
        self.gear_ratio = ratio;
        self.torque_constant *= by;
        self.back_emf *= by;
        self.coulomb_friction *= by;
        self.static_friction *= by;
        self.viscous_friction *= by * by;
        self
    }

    /// The same with its parameters off by some factors.
    ///
    /// ```
    /// use rc10_sim::{Plant, Scale};
    /// let heavy = Plant::m3508().scaled(Scale { inertia: 1.3, ..Scale::default() });
    /// assert!(heavy.inertia() > 1.29 * Plant::m3508().inertia());
    /// ```
    #[must_use]
    pub const fn scaled(mut self, by: Scale) -> Self {
        self.rotor_inertia *= by.inertia;
        self.load_inertia *= by.inertia;
        self.viscous_friction *= by.friction;
        self.coulomb_friction *= by.friction;
        self.static_friction *= by.friction;
        self.torque_constant *= by.torque_constant;
        self.back_emf *= by.torque_constant;
        self
    }

    /// All inertia as seen at the output shaft, kg·m²; never zero.
    #[must_use]
    pub const fn inertia(&self) -> f64 {
        let reflected = self.rotor_inertia * self.gear_ratio * self.gear_ratio;
        (self.load_inertia + reflected).max(1e-9)
    }
}

/// A moving motor.
pub(crate) struct Motor {
    plant: Plant,
    /// The share of a difference that is left after one step: exact exponentials.
    current_decay: f64,
    thermal_decay: f64,
    /// A.
    pub(crate) current: f64,
    /// Output shaft, rad/s.
    pub(crate) speed: f64,
    /// Rotor turns since the start: whole ones, and the rest in 0 .. 1. Exact after any time.
    turns: i64,
    fraction: f64,
    /// The angle of the rotor in its turn at the start, 0 .. 1.
    offset: f64,
    /// °C.
    pub(crate) temperature: f64,
    /// Constant torque on the output shaft, N·m.
    pub(crate) load: f64,
    /// Angles of the output shaft, in degrees since the start, between which it can turn.
    pub(crate) travel: Option<[f64; 2]>,
    /// Torque of the ground on the wheel, N·m, and the wheel's rolling friction.
    pub(crate) reaction: f64,
    pub(crate) rolling_friction: f64,
}

impl Motor {
    pub(crate) fn new(plant: Plant, offset: f64) -> Self {
        Self {
            plant,
            current_decay: (-STEP / plant.current_time_constant).exp(),
            thermal_decay: (-STEP / plant.thermal_time_constant).exp(),
            current: 0.0,
            speed: 0.0,
            turns: 0,
            fraction: 0.0,
            offset,
            temperature: plant.ambient,
            load: 0.0,
            travel: None,
            reaction: 0.0,
            rolling_friction: 0.0,
        }
    }

    pub(crate) const fn plant(&self) -> &Plant {
        &self.plant
    }

    pub(crate) const fn set_gear(&mut self, ratio: f64) {
        self.plant = self.plant.with_gear(ratio);
    }

    pub(crate) const fn add_load_inertia(&mut self, inertia: f64) {
        self.plant.load_inertia += inertia;
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
        let plant = &self.plant;
        let settled = self.settled_current(winding);
        self.current = match winding {
            Winding::Open => 0.0,
            _ => settled + (self.current - settled) * self.current_decay,
        };

        let per_torque = STEP / plant.inertia();
        let torque = plant.torque_constant * self.current + self.load + self.reaction;
        let free = (self.speed + per_torque * torque) / (1.0 + per_torque * plant.viscous_friction);
        // Dry friction takes away what speed it can, but never turns it round: a shaft that it can
        // hold stands exactly still.
        let dry = if self.speed == 0.0 {
            plant.static_friction.max(plant.coulomb_friction)
        } else {
            plant.coulomb_friction
        };
        let lost = per_torque * (dry + self.rolling_friction);
        self.speed = free.signum() * (free.abs() - lost).max(0.0);

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

    /// Stops at an end of its travel: hard, and without a bounce.
    fn stop_at_ends(&mut self) {
        let Some([lowest, highest]) = self.travel else { return };
        let degrees = self.output_degrees();
        let end = if degrees < lowest && self.speed <= 0.0 {
            lowest
        } else if degrees > highest && self.speed >= 0.0 {
            highest
        } else {
            return;
        };
        let turns = end / 360.0 * self.plant.gear_ratio;
        #[expect(clippy::cast_possible_truncation, reason = "a whole number of turns; saturates")]
        {
            self.turns = turns.floor() as i64;
        }
        self.fraction = turns - turns.floor();
        self.speed = 0.0;
    }

    /// Rotor speed, rpm.
    pub(crate) fn rotor_rpm(&self) -> f64 {
        self.output_rpm() * self.plant.gear_ratio
    }

    /// Output shaft's speed, rpm.
    pub(crate) fn output_rpm(&self) -> f64 {
        self.speed * 60.0 / TAU
    }

    /// The angle of the rotor in its turn, 0 .. 1.
    pub(crate) fn rotor_angle(&self) -> f64 {
        (self.fraction + self.offset).fract()
    }

    /// Rotor turns since the start, and where it stood then.
    #[expect(clippy::cast_precision_loss, reason = "exact up to 2^53 turns")]
    pub(crate) fn rotor_turns(&self) -> f64 {
        self.turns as f64 + self.fraction + self.offset
    }

    /// Output shaft's angle since the start, degrees, over many turns.
    #[expect(clippy::cast_precision_loss, reason = "exact up to 2^53 turns")]
    pub(crate) fn output_degrees(&self) -> f64 {
        (self.turns as f64 + self.fraction) * 360.0 / self.plant.gear_ratio
    }
}
