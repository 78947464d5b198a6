//! The loops of an axis: position around velocity around torque.

use super::codec::Order;
use crate::motor::STEP;
use crate::plant::Plant;

/// As the firmware's factory settings go: turns/s, turns/s².
const VELOCITY_RAMP: f64 = 50.0;
/// Bandwidth of the position filter, 1/s.
const FILTER: f64 = 20.0;
/// Velocity and acceleration of trapezoids.
const TRAPEZOID: (f64, f64) = (20.0, 100.0);
/// Turns/s per turn.
const POSITION_GAIN: f64 = 20.0;

/// Modes, inputs and limits of an axis, and its loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controller {
    /// 1 torque, 2 velocity, 3 position.
    pub control_mode: u32,
    /// 1 passthrough, 2 velocity ramp, 3 position filter, 5 trapezoid.
    pub input_mode: u32,
    /// Turns.
    pub input_position: f64,
    /// Turns/s.
    pub input_velocity: f64,
    /// N·m at the motor.
    pub input_torque: f64,
    /// Turns/s.
    pub velocity_limit: f64,
    /// A.
    pub current_limit: f64,
    /// The processed input so far: position and velocity.
    position: f64,
    velocity: f64,
    integral: f64,
    /// Current asked for, A.
    pub(super) amps: f64,
}

impl Controller {
    pub(super) const fn new() -> Self {
        Self {
            // From the factory.
            control_mode: 3,
            input_mode: 1,
            input_position: 0.0,
            input_velocity: 0.0,
            input_torque: 0.0,
            velocity_limit: 100.0,
            current_limit: 40.0,
            position: 0.0,
            velocity: 0.0,
            integral: 0.0,
            amps: 0.0,
        }
    }

    /// Closed-loop control begins at this position.
    pub(super) const fn enter(&mut self, position: f64) {
        self.input_position = position;
        self.position = position;
        self.velocity = 0.0;
        self.integral = 0.0;
    }

    pub(super) fn take(&mut self, order: Order) {
        match order {
            Order::Modes(control, input) => (self.control_mode, self.input_mode) = (control, input),
            Order::Position(position, velocity, torque) => {
                self.input_position = position.into();
                self.input_velocity = f64::from(velocity) * 0.001;
                self.input_torque = f64::from(torque) * 0.001;
            }
            Order::Velocity(velocity, torque) => {
                (self.input_velocity, self.input_torque) = (velocity.into(), torque.into());
            }
            Order::Torque(torque) => self.input_torque = torque.into(),
            Order::Limits(velocity, current) => {
                (self.velocity_limit, self.current_limit) = (velocity.into(), current.into());
            }
            Order::EStop | Order::State(_) | Order::ClearErrors => (),
        }
    }

    /// Moves the set-points on towards the inputs.
    fn shape(&mut self) {
        let towards = |from: f64, to: f64, most: f64| from + (to - from).clamp(-most, most);
        match (self.control_mode, self.input_mode) {
            (2, 2) => {
                self.velocity = towards(self.velocity, self.input_velocity, VELOCITY_RAMP * STEP);
            }
            (3, 3) => self.position += (self.input_position - self.position) * FILTER * STEP,
            (3, 5) => {
                let (fastest, steepest) = TRAPEZOID;
                let way = self.input_position - self.position;
                let wanted = (2.0 * steepest * way.abs()).sqrt().min(fastest).copysign(way);
                self.velocity = towards(self.velocity, wanted, steepest * STEP);
                self.position += self.velocity * STEP;
                if way.abs() < 1e-4 {
                    (self.position, self.velocity) = (self.input_position, 0.0);
                }
            }
            _ => (self.position, self.velocity) = (self.input_position, self.input_velocity),
        }
    }

    /// One step; the current to drive, A.
    pub(super) fn step(&mut self, position: f64, velocity: f64, plant: &Plant) -> f64 {
        self.shape();
        let torque_constant = plant.torque_constant / plant.gear_ratio;
        let most = self.current_limit.max(0.0);
        let torque = if self.control_mode == 1 {
            self.input_torque
        } else {
            let mut wanted = self.velocity;
            if self.control_mode == 3 {
                wanted += (self.position - position) * POSITION_GAIN;
            }
            let limit = self.velocity_limit.max(0.0);
            let error = wanted.clamp(-limit, limit) - velocity;
            // N·m at the motor per turn/s: there in 10 ms.
            let inertia = plant.inertia() / plant.gear_ratio / plant.gear_ratio;
            let gain = inertia * std::f64::consts::TAU / 0.01;
            let full = most * torque_constant;
            self.integral = (self.integral + error * gain * STEP / 0.1).clamp(-full, full);
            self.input_torque + error * gain + self.integral
        };
        self.amps = (torque / torque_constant).clamp(-most, most);
        self.amps
    }
}
