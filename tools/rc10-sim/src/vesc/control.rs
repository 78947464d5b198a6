//! A VESC's control modes.

use std::f64::consts::TAU;

use super::{Order, VescConfig};
use crate::device::Winding;
use crate::motor::{STEP, Shaft};

/// Control mode of a VESC.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Mode {
    /// Nothing: the bridge is open.
    #[default]
    Released,
    /// This share of the supply voltage.
    Duty(f64),
    /// This current, A.
    Current(f64),
    /// This current against the movement, A.
    Brake(f64),
    /// This speed, electrical rpm.
    Speed(f64),
    /// This angle of its position controller, degrees.
    Position(f64),
    /// A still field of this current, A.
    Handbrake(f64),
}

/// Least current that is driven (`cc_min_current`), A.
const LEAST_CURRENT: f64 = 0.05;
/// Most change of the duty in a second (`m_duty_ramp_step`, 0.02 in a millisecond).
const DUTY_RAMP: f64 = 20.0;

#[derive(Default)]
pub(super) struct Control {
    pub(super) mode: Mode,
    /// Speed on its ramp, electrical rpm, once it is known where it starts.
    ramp: Option<f64>,
    /// Whether the speed controller has begun to drive.
    running: bool,
    integral: f64,
    /// Duty on its ramp.
    duty: Option<f64>,
    last_position: Option<f64>,
}

impl Control {
    pub(super) fn take(&mut self, order: &Order, (min, max): (f64, f64)) {
        let share = |share: f64| share.clamp(-1.0, 1.0);
        let mode = match *order {
            Order::Duty(duty) => Mode::Duty(share(duty)),
            Order::Current(amps) => Mode::Current(amps),
            Order::CurrentShare(part) => {
                Mode::Current(share(part) * if part < 0.0 { -min } else { max })
            }
            Order::Brake(amps) => Mode::Brake(amps.abs()),
            Order::BrakeShare(part) => Mode::Brake(share(part).abs() * -min),
            Order::Speed(erpm) => Mode::Speed(erpm),
            Order::Position(degrees) => Mode::Position(degrees.rem_euclid(360.0)),
            Order::Handbrake(amps) => Mode::Handbrake(amps),
            Order::HandbrakeShare(part) => Mode::Handbrake(share(part) * -min),
            Order::Ping(_) | Order::CurrentLimits { .. } | Order::Shutdown => return,
        };
        let mode = match mode {
            Mode::Current(amps) | Mode::Brake(amps) | Mode::Handbrake(amps)
                if amps.abs() < LEAST_CURRENT =>
            {
                Mode::Released
            }
            mode => mode,
        };
        if std::mem::discriminant(&mode) != std::mem::discriminant(&self.mode) {
            *self = Self::default();
        }
        self.mode = mode;
    }

    /// `position` in degrees, as the position controller sees it.
    pub(super) fn drive(
        &mut self,
        config: &VescConfig,
        limits: (f64, f64),
        shaft: &Shaft,
        position: f64,
    ) -> Winding {
        let plant = &shaft.plant;
        let own_volts = plant.back_emf * shaft.speed;
        match self.mode {
            Mode::Released => Winding::Open,
            Mode::Duty(wanted) => {
                let from = self.duty.unwrap_or(own_volts / plant.supply);
                let step = DUTY_RAMP * STEP;
                let duty = from + (wanted - from).clamp(-step, step);
                self.duty = Some(duty);
                // The current limit bends the duty.
                let most = limits.1.max(-limits.0) * plant.resistance;
                let volts = (duty * plant.supply).clamp(own_volts - most, own_volts + most);
                Winding::Voltage(volts)
            }
            Mode::Current(amps) => Winding::Current(limited(amps, limits, shaft)),
            Mode::Brake(amps) => {
                let shorted = (own_volts / plant.resistance).abs();
                Winding::Current(-shaft.speed.signum() * amps.min(-limits.0).min(shorted))
            }
            Mode::Speed(erpm) => self.speed(erpm, config, limits, shaft),
            Mode::Position(wanted) => {
                let error = (wanted - position + 180.0).rem_euclid(360.0) - 180.0;
                let last = self.last_position.replace(position).unwrap_or(position);
                let moved = (position - last + 180.0).rem_euclid(360.0) - 180.0;
                let [kp, kd] = config.position_gains;
                let share = (kp * error - kd * moved / STEP).clamp(-1.0, 1.0);
                Winding::Current(limited(share * limits.1, limits, shaft))
            }
            Mode::Handbrake(amps) => {
                // A field that stands at phase zero pulls the rotor there.
                let phase = shaft.rotor_angle() * f64::from(config.pole_pairs) * TAU;
                Winding::Current(-amps.min(-limits.0) * phase.sin())
            }
        }
    }

    fn speed(
        &mut self,
        erpm: f64,
        config: &VescConfig,
        limits: (f64, f64),
        shaft: &Shaft,
    ) -> Winding {
        let measured = shaft.rotor_rpm() * f64::from(config.pole_pairs);
        let step = config.speed_ramp * STEP;
        let from = self.ramp.unwrap_or(measured);
        let ramp = from + (erpm - from).clamp(-step, step);
        self.ramp = Some(ramp);
        self.running |= erpm.abs() >= config.minimum_erpm;
        if ramp.abs() < config.minimum_erpm {
            self.integral = 0.0;
            // A motor that ran is shorted, one that stood is not started.
            return if self.running { Winding::Voltage(0.0) } else { Winding::Open };
        }
        let [kp, ki] = config.speed_gains.map(|gain| gain / 20.0);
        let error = ramp - measured;
        let share = (kp * error + self.integral).clamp(-1.0, 1.0);
        self.integral = (self.integral + ki * error * STEP).clamp(-1.0, 1.0);
        Winding::Current(limited(share * limits.1, limits, shaft))
    }
}

/// A current held to the limits: one for driving, one for braking.
fn limited(amps: f64, (min, max): (f64, f64), shaft: &Shaft) -> f64 {
    let most = if amps * shaft.speed < 0.0 { -min } else { max };
    amps.clamp(-most, most)
}
