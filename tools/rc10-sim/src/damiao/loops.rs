//! Its control loops. What the vendor documents is their structure (a position loop around a
//! velocity loop with limited acceleration); their gains here are our estimates, from the inertia.

use super::codec::{Limits, Setpoint};
use crate::motor::STEP;

/// Bandwidth of the velocity loop, 1/s.
const VELOCITY_BANDWIDTH: f64 = 80.0;
/// Rate of its integral part, 1/s.
const VELOCITY_INTEGRAL: f64 = 6.0;
/// Bandwidth of the position loop, 1/s.
const POSITION_BANDWIDTH: f64 = 12.0;

/// State of the loops.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Loops {
    /// Velocity reference after the limit of acceleration, rad/s; `None` at rest.
    reference: Option<f64>,
    /// N·m.
    integral: f64,
}

/// The shaft, and what limits it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conditions {
    pub position: f64,
    pub velocity: f64,
    pub inertia: f64,
    pub limits: Limits,
    /// rad/s², above zero.
    pub acceleration: f64,
    /// rad/s², above zero.
    pub deceleration: f64,
}

impl Loops {
    /// The torque it gives, N·m.
    pub(super) fn torque(&mut self, setpoint: Setpoint, at: &Conditions) -> f64 {
        let most = at.limits.torque;
        match setpoint {
            Setpoint::Mit { position, velocity, kp, kd, torque } => {
                let spring = kp * (position - at.position);
                (spring + kd * (velocity - at.velocity) + torque).clamp(-most, most)
            }
            Setpoint::Velocity(velocity) => self.follow(velocity, most, at),
            Setpoint::PositionVelocity { position, velocity } => {
                self.follow(approach(position, velocity, at), most, at)
            }
            Setpoint::ForcePosition { position, velocity, share } => {
                self.follow(approach(position, velocity, at), share * most, at)
            }
        }
    }

    fn follow(&mut self, wanted: f64, most: f64, at: &Conditions) -> f64 {
        let last = self.reference.unwrap_or(at.velocity);
        let slows = wanted.abs() < last.abs();
        let step = STEP * if slows { at.deceleration } else { at.acceleration };
        let reference = last + (wanted - last).clamp(-step, step);
        self.reference = Some(reference);
        let gain = at.inertia * VELOCITY_BANDWIDTH;
        let error = reference - at.velocity;
        let integral = self.integral + gain * VELOCITY_INTEGRAL * error * STEP;
        let torque = gain * error + integral;
        // What is at its limit gathers nothing.
        if torque.abs() <= most {
            self.integral = integral;
        }
        torque.clamp(-most, most)
    }
}

/// The velocity towards a position from which it can still stop there.
fn approach(position: f64, velocity: f64, at: &Conditions) -> f64 {
    let way = position - at.position;
    let in_time = (2.0 * at.deceleration * way.abs()).sqrt();
    let most = velocity.abs().min(in_time);
    (POSITION_BANDWIDTH * way).clamp(-most, most)
}
