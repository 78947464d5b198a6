//! Parameters of a motor, its gearbox and its load.

use std::f64::consts::TAU;

/// A motor with its gearbox, its ESC's limits and its load. Everything is seen from the output
/// shaft, in SI units, unless its name says otherwise.
///
/// Gear ratios, torque constants and no-load speeds are DJI's published ones; resistances,
/// inertias, friction and thermal figures are our estimates. A controller that only works with
/// exactly these is too finely tuned: test it with [`Plant::scaled`] by ±30 %.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
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
    /// Gravity, cogging and backlash.
    pub nonlinear: Nonlinear,
}

/// Gravity, cogging and backlash of a [`Plant`]: each is off while it is 0.
///
/// They have no defaults, because no maker of the motors here publishes them. Numbers to begin with, all
/// of them our estimates: cogging of 2 % of the rated torque at the output shaft, with 84 periods per turn
/// of the rotor (12 slots under 14 poles: their least common multiple); backlash of 0.3 degrees behind a
/// planetary gearbox, 1 degree and more behind a chain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nonlinear {
    /// Largest torque of the load's weight, N·m: mass · g · distance of its centre from the shaft.
    pub gravity_torque: f64,
    /// Angle of the centre of that mass over the horizontal at power-on, degrees. A positive torque
    /// pulls an arm back that has turned less than 90 degrees forward from there.
    pub gravity_offset: f64,
    /// Amplitude of the cogging torque at the output shaft, N·m.
    pub cogging_torque: f64,
    /// Periods of the cogging torque per turn of the rotor.
    pub cogging_periods: f64,
    /// Play between gearbox and load at the output shaft, degrees from one end to the other. All
    /// friction of the plant is on the gearbox's side of it, weight and outside torque on the load's.
    pub backlash: f64,
}

impl Nonlinear {
    /// All of them off.
    pub const NONE: Self = Self {
        gravity_torque: 0.0,
        gravity_offset: 0.0,
        cogging_torque: 0.0,
        cogging_periods: 0.0,
        backlash: 0.0,
    };
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
    /// A motor with its gearbox and values that most have in common: 24 V, a current loop of 1 ms, the
    /// torque constant as back-EMF, nothing on the shaft. Neither friction nor heating.
    ///
    /// Turns of the rotor per turn of the shaft, N·m/A at the shaft, Ω, A, kg·m² of the rotor.
    pub(crate) const fn motor(
        gear_ratio: f64,
        torque_constant: f64,
        resistance: f64,
        current_limit: f64,
        rotor_inertia: f64,
    ) -> Self {
        Self {
            gear_ratio,
            torque_constant,
            back_emf: torque_constant,
            resistance,
            supply: 24.0,
            current_limit,
            current_time_constant: 1e-3,
            rotor_inertia,
            load_inertia: 0.0,
            viscous_friction: 0.0,
            coulomb_friction: 0.0,
            static_friction: 0.0,
            ambient: 25.0,
            thermal_resistance: 0.0,
            thermal_time_constant: 0.0,
            nonlinear: Nonlinear::NONE,
        }
    }

    /// The same with friction at the shaft: viscous, N·m·s, and dry, N·m, while it turns and at rest.
    pub(crate) const fn with_friction(mut self, viscous: f64, coulomb: f64, at_rest: f64) -> Self {
        self.viscous_friction = viscous;
        self.coulomb_friction = coulomb;
        self.static_friction = at_rest;
        self
    }

    /// The same with heating: thermal resistance, K/W, and time constant, s.
    pub(crate) const fn with_heating(mut self, resistance: f64, time_constant: f64) -> Self {
        self.thermal_resistance = resistance;
        self.thermal_time_constant = time_constant;
        self
    }

    /// M3508 with its gearbox on a C620, 24 V, no load on the shaft.
    pub const fn m3508() -> Self {
        // C620 / M3508 manual: 3591:187, 0.3 N·m/A, 482 rpm (9250 at the rotor) without load.
        Self::motor(3591.0 / 187.0, 0.3, 0.194, 20.0, 1e-5)
            .with_friction(2.6e-3, 0.10, 0.13)
            .with_heating(2.5, 300.0)
            .with_no_load_speed(9250.0)
    }

    /// M2006 with its gearbox on a C610, 24 V, no load on the shaft.
    pub const fn m2006() -> Self {
        // C610 / M2006 manual: 36:1, 0.18 N·m/A, 500 rpm (18000 at the rotor) without load.
        Self::motor(36.0, 0.18, 0.461, 10.0, 1e-6)
            .with_friction(1.1e-3, 0.05, 0.065)
            .with_heating(8.0, 150.0)
            .with_no_load_speed(18_000.0)
    }

    /// GM6020 in current mode, 24 V, no load on the shaft.
    pub const fn gm6020() -> Self {
        // GM6020 manual: no gearbox, 0.741 N·m/A, about 320 rpm without load. The back-EMF
        // equals the torque constant.
        Self::motor(1.0, 0.741, 1.8, 3.0, 4e-4)
            .with_friction(1e-3, 0.04, 0.05)
            .with_heating(8.0, 400.0)
    }

    /// GM6020 in voltage mode: the current follows the winding's L/R, 5.7 mH / 1.8 Ω.
    pub const fn gm6020_voltage() -> Self {
        Self { current_time_constant: 3.2e-3, ..Self::gm6020() }
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
    pub const fn with_load_inertia(mut self, inertia: f64) -> Self {
        self.load_inertia = inertia;
        self
    }

    /// The same motor behind another gearbox: `ratio` turns of the rotor per turn of the output
    /// shaft. Torque per ampere, cogging and back-EMF grow with it, dry friction too, viscous friction
    /// with its square.
    pub const fn with_gear(mut self, ratio: f64) -> Self {
        let by = ratio / self.gear_ratio;
        self.gear_ratio = ratio;
        self.torque_constant *= by;
        self.back_emf *= by;
        self.coulomb_friction *= by;
        self.static_friction *= by;
        self.nonlinear.cogging_torque *= by;
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
    pub const fn inertia(&self) -> f64 {
        (self.load_inertia + self.reflected_inertia()).max(1e-9)
    }

    /// The rotor's inertia as seen at the output shaft, kg·m².
    pub(crate) const fn reflected_inertia(&self) -> f64 {
        self.rotor_inertia * self.gear_ratio * self.gear_ratio
    }
}
