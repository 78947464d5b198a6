//! A target in the device's terms, if it can go there.

use rc10_app::maths::round_to_i32;
use rc10_app::{CountsPerTurn, TotalAngle};

use super::control::Steering;
use super::shaft::{PHASE_TURN, RPM_PER_RADIAN_PER_SECOND, Shaft};
use crate::mit::{Limits, Setpoint};
use crate::motor::{Impedance, Target, TargetError};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Goal {
    Rest,
    /// The servo has it.
    Servo,
    /// Microdegrees within the turn.
    Angle(i32),
    /// Microdegrees of many turns.
    Total(i64),
    /// rad/s, as the device counts.
    Velocity(f32),
    /// As the device counts.
    Impedance(Setpoint),
}

impl Goal {
    /// Of a target that this sort of steering takes.
    pub(super) fn of(
        target: Target,
        steering: &Steering,
        shaft: &Shaft,
        limits: &Limits,
    ) -> Result<Self, TargetError> {
        let beyond = TargetError::OutOfRange(target.kind());
        let is_mit = matches!(steering, Steering::Mit(_));
        Ok(match target {
            Target::Speed(rpm) => {
                // The device cannot tell of a higher speed either.
                let velocity = rpm.get() / RPM_PER_RADIAN_PER_SECOND;
                if velocity.abs() > limits.velocity() {
                    return Err(beyond);
                }
                if is_mit { Self::Servo } else { Self::Velocity(velocity * shaft.sign()) }
            }
            Target::Angle(degrees) => {
                let phase = phase_of(degrees.get());
                shaft.nearest(phase).ok_or(beyond)?;
                Self::Angle(phase)
            }
            Target::TotalAngle(angle) => {
                let total = angle.counts_at(CountsPerTurn::MICRODEGREES);
                if !shaft.reaches(total) {
                    return Err(beyond);
                }
                if is_mit { Self::Servo } else { Self::Total(total) }
            }
            Target::Torque(_) => Self::Servo,
            Target::Impedance(impedance) => {
                Self::Impedance(setpoint_of(&impedance, shaft, limits).ok_or(beyond)?)
            }
            // Others are not taken.
            _ => Self::Rest,
        })
    }
}

/// `None` for what the wire cannot carry; a torque is limited later.
fn setpoint_of(impedance: &Impedance, shaft: &Shaft, limits: &Limits) -> Option<Setpoint> {
    let total = TotalAngle::try_from_degrees(impedance.angle)?.microdegrees();
    let velocity = impedance.speed.get() / RPM_PER_RADIAN_PER_SECOND;
    let fits = shaft.reaches(total)
        && velocity.abs() <= limits.velocity()
        && (0.0..=limits.kp()).contains(&impedance.kp)
        && (0.0..=limits.kd()).contains(&impedance.kd);
    fits.then(|| Setpoint {
        position: shaft.device_radians(total),
        velocity: velocity * shaft.sign(),
        kp: impedance.kp,
        kd: impedance.kd,
        torque: impedance.torque.get() * shaft.sign(),
    })
}

/// Any number of degrees as microdegrees within the turn.
fn phase_of(degrees: f32) -> i32 {
    let degrees = degrees % 360.0;
    let degrees = if degrees < 0.0 { degrees + 360.0 } else { degrees };
    let phase = round_to_i32(degrees * 1e6);
    // The last steps before a full turn may round up to it.
    if phase < PHASE_TURN { phase } else { 0 }
}
