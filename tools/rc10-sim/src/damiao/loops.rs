//! Its control loops. What the vendor documents is their structure (a position loop around a
//! velocity loop with limited acceleration); their gains here are our estimates, from the inertia.

use super::codec::Setpoint;
use super::registers::{Registers, number};
use crate::motor::{STEP, Shaft};

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

impl Loops {
    /// The torque it gives, N·m, where the device says that its shaft stands at `here`.
    pub(super) fn torque(
        &mut self,
        setpoint: Setpoint,
        here: f64,
        shaft: &Shaft,
        registers: &Registers,
    ) -> f64 {
        let most = registers.limits().torque;
        let approach = |position, velocity| approach(position - here, velocity, registers);
        match setpoint {
            Setpoint::Mit { position, velocity, kp, kd, torque } => {
                let spring = kp * (position - here);
                (spring + kd * (velocity - shaft.speed) + torque).clamp(-most, most)
            }
            Setpoint::Velocity(velocity) => self.follow(velocity, most, shaft, registers),
            Setpoint::PositionVelocity { position, velocity } => {
                self.follow(approach(position, velocity), most, shaft, registers)
            }
            Setpoint::ForcePosition { position, velocity, share } => {
                self.follow(approach(position, velocity), share * most, shaft, registers)
            }
        }
    }

    fn follow(&mut self, wanted: f64, most: f64, shaft: &Shaft, registers: &Registers) -> f64 {
        let last = self.reference.unwrap_or(shaft.speed);
        let slows = wanted.abs() < last.abs();
        let step = STEP
            * if slows { deceleration(registers) } else { registers.real(number::ACCELERATION) };
        let reference = last + (wanted - last).clamp(-step, step);
        self.reference = Some(reference);
        let gain = shaft.plant.inertia() * VELOCITY_BANDWIDTH;
        let error = reference - shaft.speed;
        let integral = self.integral + gain * VELOCITY_INTEGRAL * error * STEP;
        let torque = gain * error + integral;
        // What is at its limit gathers nothing.
        if torque.abs() <= most {
            self.integral = integral;
        }
        torque.clamp(-most, most)
    }
}

/// The deceleration: the register is below zero; rad/s².
fn deceleration(registers: &Registers) -> f64 {
    -registers.real(number::DECELERATION)
}

/// The velocity towards a position from which it can still stop there.
fn approach(way: f64, velocity: f64, registers: &Registers) -> f64 {
    let in_time = (2.0 * deceleration(registers) * way.abs()).sqrt();
    let most = velocity.abs().min(in_time);
    (POSITION_BANDWIDTH * way).clamp(-most, most)
}
