//! Physical values at a shaft, raw numbers at the rotor.

use core::f64::consts::TAU;

use rc10_app::maths::{Ratio, round_to_i16, round_to_i32, within};
use rc10_app::{CountsPerTurn, Degrees, Gear, NewtonMetres, Rpm, TotalAngle};

use crate::shaft::gear;

/// The gearbox, 6.33 : 1 (user manual; the SDK's `queryGearRatio`). 9.1 belongs to the A1.
pub const GEAR: Gear = gear(633, 100);

// Scales and ranges of the rotor (data manual and the SDK's binary), on the line and the module.

/// Steps per N m of τ.
const TORQUE_STEPS: f64 = 256.0;
/// Largest |τ| in N m.
const TORQUE_LIMIT: f64 = 127.99;
/// Steps per revolution per second of ω.
pub(in crate::unitree) const SPEED_STEPS: f64 = 256.0;
/// Largest |ω| in rad/s.
pub(in crate::unitree) const SPEED_LIMIT: f64 = 804.0;
/// Steps per turn of θ.
pub(in crate::unitree) const ANGLE_STEPS: u32 = 32768;
/// Largest |θ| in rad.
const ANGLE_LIMIT: f64 = 411_774.0;
/// Steps per N m / rad of `k_pos` and per N m s / rad of `k_spd`.
const GAIN_STEPS: f64 = 1280.0;
/// Largest `k_pos` in N m / rad, largest `k_spd` in N m s / rad.
pub(in crate::unitree) const GAIN_LIMIT: f64 = 25.599;

// The ranges in steps, so that clamping does not depend on the gear.
const TORQUE_LIMIT_STEPS: f32 = single(TORQUE_LIMIT * TORQUE_STEPS);
const SPEED_LIMIT_STEPS: f32 = single(SPEED_LIMIT / TAU * SPEED_STEPS);
#[expect(clippy::cast_possible_truncation, reason = "below 2^31")]
const ANGLE_LIMIT_STEPS: i32 = (ANGLE_LIMIT / TAU * ANGLE_STEPS as f64) as i32;
const GAIN_LIMIT_STEPS: f32 = single(GAIN_LIMIT * GAIN_STEPS);

/// The nearest f32, so that constants can be computed exactly.
#[expect(clippy::cast_possible_truncation, reason = "the purpose")]
const fn single(x: f64) -> f32 {
    x as f32
}

/// Torque, speed and angle at a shaft: what a command asks for, and what a motor measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// In a command, the torque that is added to what stiffness and damping make.
    pub torque: NewtonMetres,
    /// Speed.
    pub speed: Rpm,
    /// Angle over many turns, from where the device has its zero.
    pub angle: TotalAngle,
}

/// Stiffness and damping at a shaft: the reaction to a difference of motions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impedance {
    /// `k_pos` in N m / rad, 0 ..= 1025.7 at the output shaft.
    pub stiffness: f32,
    /// `k_spd` in N m s / rad, 0 ..= 1025.7 at the output shaft.
    pub damping: f32,
}

/// τ, ω and θ of the rotor as they stand in commands and replies of both links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct RawMotion {
    /// In 1/256 N m.
    pub torque: i16,
    /// In 1/256 revolutions per second.
    pub speed: i16,
    /// In 1/32768 turns.
    pub angle: i32,
}

/// `k_pos` and `k_spd` of the rotor as they stand in frames of both links, in steps of 1/1280.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct RawImpedance {
    /// `k_pos` in 1/1280 N m / rad.
    pub stiffness: u16,
    /// `k_spd` in 1/1280 N m s / rad.
    pub damping: u16,
}

impl RawImpedance {
    /// Torque alone moves the motor.
    pub const NONE: Self = Self { stiffness: 0, damping: 0 };
}

/// Converts between a shaft and the rotor.
///
/// Through a gearbox of ratio r: torque / r, speed and angle · r, stiffness and damping / r².
///
/// ```
/// use rc10_app::{NewtonMetres, Rpm, TotalAngle};
/// use rc10_motor::unitree::wire::{Motion, RotorScale};
/// let quarter_turn = Motion {
///     torque: NewtonMetres::new(6.33),
///     speed: Rpm::new(60.0),
///     angle: TotalAngle::from_degrees(90),
/// };
/// let raw = RotorScale::OUTPUT.raw(&quarter_turn);
/// assert_eq!((raw.torque, raw.speed, raw.angle), (256, 1620, 51855)); // 1 N m, 6.33 turns/s
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorScale {
    torque_steps: f32,
    speed_steps: f32,
    angle_steps: f32,
    gain_steps: f32,
    /// Counts per microdegree, and microdegrees per count.
    to_counts: Ratio,
    to_microdegrees: Ratio,
    counts_per_turn: CountsPerTurn,
}

impl RotorScale {
    /// The output shaft of a GO-M8010-6.
    pub const OUTPUT: Self = Self::new(GEAR);

    /// The shaft behind a gearbox; [`Gear::DIRECT`] is the rotor itself.
    pub const fn new(gear: Gear) -> Self {
        let ratio = gear.rotor_turns() as f64 / gear.output_turns() as f64;
        let counts = ANGLE_STEPS as u64 * gear.rotor_turns() as u64;
        let microdegrees = 360_000_000 * gear.output_turns() as u64;
        Self {
            torque_steps: single(TORQUE_STEPS / ratio),
            speed_steps: single(SPEED_STEPS * ratio / 60.0),
            angle_steps: single(ANGLE_STEPS as f64 * ratio / 360.0),
            gain_steps: single(GAIN_STEPS / (ratio * ratio)),
            to_counts: Ratio::new(counts, microdegrees),
            to_microdegrees: Ratio::new(microdegrees, counts),
            counts_per_turn: CountsPerTurn::new(
                ANGLE_STEPS * gear.rotor_turns(),
                gear.output_turns(),
            ),
        }
    }

    /// Counts of the rotor per turn of this shaft.
    pub const fn counts_per_turn(&self) -> CountsPerTurn {
        self.counts_per_turn
    }

    /// To the wire: clamped, nearest step; zero for what is not a number.
    pub fn raw(&self, motion: &Motion) -> RawMotion {
        RawMotion {
            torque: self.raw_torque(motion.torque),
            speed: self.raw_speed(motion.speed),
            angle: angle(self.to_counts.times(motion.angle.microdegrees())),
        }
    }

    /// From the wire.
    pub fn motion(&self, raw: RawMotion) -> Motion {
        Motion {
            torque: self.torque(raw.torque),
            speed: Rpm::new(f32::from(raw.speed) / self.speed_steps),
            angle: TotalAngle::from_microdegrees(self.to_microdegrees.times(raw.angle.into())),
        }
    }

    /// A torque from the wire.
    pub fn torque(&self, raw: i16) -> NewtonMetres {
        NewtonMetres::new(f32::from(raw) / self.torque_steps)
    }

    /// A torque, as [`raw`](Self::raw) has it.
    pub fn raw_torque(&self, torque: NewtonMetres) -> i16 {
        round_to_i16(within(torque.get() * self.torque_steps, TORQUE_LIMIT_STEPS))
    }

    /// A speed, as [`raw`](Self::raw) has it.
    pub fn raw_speed(&self, speed: Rpm) -> i16 {
        round_to_i16(within(speed.get() * self.speed_steps, SPEED_LIMIT_STEPS))
    }

    /// The angle that lies so far from another: cheaper than an angle of many turns.
    pub fn raw_angle_from(&self, from: i32, way: Degrees) -> i32 {
        let steps = from.saturating_add(round_to_i32(way.get() * self.angle_steps));
        steps.clamp(-ANGLE_LIMIT_STEPS, ANGLE_LIMIT_STEPS)
    }

    /// To the wire, as [`raw`](Self::raw).
    pub fn raw_impedance(&self, impedance: &Impedance) -> RawImpedance {
        RawImpedance {
            stiffness: gain(impedance.stiffness * self.gain_steps),
            damping: gain(impedance.damping * self.gain_steps),
        }
    }

    /// From the wire.
    pub fn impedance(&self, raw: RawImpedance) -> Impedance {
        Impedance {
            stiffness: f32::from(raw.stiffness) / self.gain_steps,
            damping: f32::from(raw.damping) / self.gain_steps,
        }
    }
}

fn angle(steps: i64) -> i32 {
    let limit = i64::from(ANGLE_LIMIT_STEPS);
    #[expect(clippy::cast_possible_truncation, reason = "the limit has 31 bits")]
    return steps.clamp(-limit, limit) as i32;
}

fn gain(steps: f32) -> u16 {
    round_to_i16(steps.clamp(0.0, GAIN_LIMIT_STEPS)).unsigned_abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROTOR: RotorScale = RotorScale::new(Gear::DIRECT);

    fn motion(torque: f32, rad_per_s: f32, radians: f64) -> Motion {
        #[expect(clippy::cast_possible_truncation, reason = "a test's own numbers")]
        let microdegrees = (radians.to_degrees() * 1e6).round() as i64;
        Motion {
            torque: NewtonMetres::new(torque),
            speed: Rpm::new(rad_per_s * 60.0 / core::f32::consts::TAU),
            angle: TotalAngle::from_microdegrees(microdegrees),
        }
    }

    #[test]
    fn rotor_values_of_the_vendor_s_examples() {
        // π/2 and π, of which the SDK makes 8191 and 127 because it truncates with 6.2832.
        let raw = ROTOR.raw(&motion(0.75, core::f32::consts::PI, core::f64::consts::FRAC_PI_2));
        assert_eq!(raw, RawMotion { torque: 192, speed: 128, angle: 8192 });
        // The manual's 1.57 rad: 8188 by exact 2π, 8187 by its own.
        assert_eq!(ROTOR.raw(&motion(-1.25, -20.0, 1.57)).angle, 8188);
        let gains = ROTOR.raw_impedance(&Impedance { stiffness: 0.1, damping: 0.2 });
        assert_eq!(gains, RawImpedance { stiffness: 128, damping: 256 });
    }

    #[test]
    fn the_gearbox_scales_each_quantity_its_way() {
        let raw = RawMotion { torque: 256, speed: 256, angle: 32768 };
        let output = RotorScale::OUTPUT.motion(raw);
        assert!((output.torque.get() - 6.33).abs() < 1e-6);
        assert!((output.speed.get() - 60.0 / 6.33).abs() < 1e-5);
        assert!((output.angle.degrees().get() - 360.0 / 6.33).abs() < 1e-4);
        assert_eq!(RotorScale::OUTPUT.raw(&output), raw);
        let gains = RawImpedance { stiffness: 1280, damping: 640 };
        let output = RotorScale::OUTPUT.impedance(gains);
        assert!((output.stiffness - 6.33 * 6.33).abs() < 1e-4);
        assert!((output.damping - 0.5 * 6.33 * 6.33).abs() < 1e-4);
        assert_eq!(RotorScale::OUTPUT.raw_impedance(&output), gains);
    }

    #[test]
    fn the_ends_of_the_ranges_are_the_protocol_s() {
        let end = RawMotion { torque: 32765, speed: 32758, angle: 2_147_479_307 };
        let minus = RawMotion { torque: -end.torque, speed: -end.speed, angle: -end.angle };
        for (scale, beyond) in [(1.0, 411_774.0), (f32::MAX, 1e12), (f32::INFINITY, 1e300)] {
            let most = ROTOR.raw(&motion(127.99 * scale, 804.0 * scale, beyond));
            assert_eq!(most, end, "{scale}");
            let least = ROTOR.raw(&motion(-127.99 * scale, -804.0 * scale, -beyond));
            assert_eq!(least, minus, "{scale}");
            let gain = 25.599 * scale;
            let gains = ROTOR.raw_impedance(&Impedance { stiffness: gain, damping: -gain });
            assert_eq!(gains, RawImpedance { stiffness: 32767, damping: 0 });
        }
    }

    #[test]
    fn what_is_not_a_number_is_zero() {
        let nan = f32::NAN;
        let strange = motion(nan, nan, 1.0);
        assert_eq!((ROTOR.raw(&strange).torque, ROTOR.raw(&strange).speed), (0, 0));
        let strange = Impedance { stiffness: nan, damping: nan };
        assert_eq!(ROTOR.raw_impedance(&strange), RawImpedance::default());
    }
}
