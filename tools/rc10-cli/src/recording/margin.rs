//! Gain and phase margins of a motor's control loops: their distance from oscillation.
//!
//! A run shows only the motions of its script, with simulated motors that are better than real
//! ones. The gain margin is the factor by which a gain may rise until a loop oscillates, from its
//! gains, inertia and delays. The phase margin is what is left to oscillation where the loop's gain is one.
//!
//! The speed loop is a gain on torque, inertia and friction of back-EMF, the current's time
//! constant, and a dead time of [`DELAY`]. The angle loop is a gain on an integrator behind the
//! closed speed loop, which follows as a first-order lag, and runs in every n-th tick. Integral
//! parts and feed-forward are left out.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use rc10_motor::{Loops, TargetKind};
use rc10_sim::Plant;

/// Time from a measurement to its effort, s: half a feedback period and half a tick, and up to a
/// tick on the bus and in the ESC.
pub const DELAY: f64 = 2e-3;
/// Gain margin below which there is a problem: 14 dB.
pub const LEAST: f64 = 5.0;

/// Gain margins: factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Factor of the speed loop.
    pub speed: f64,
    /// Factor of the angle loop around it.
    pub angle: f64,
    /// Phase margins of the two, degrees; `None` of a record.
    pub phases: Option<[f64; 2]>,
}

impl Margins {
    /// The gain margins of loops that move this load.
    pub fn of(loops: Loops, plant: &Plant) -> Self {
        let cascade = &loops.cascade;
        // N m per unit of effort, and N m s/rad of friction and, in voltage mode, back-EMF.
        let (torque, resists) = match loops.effort {
            TargetKind::Torque => (1.0, 0.0),
            TargetKind::Current => (plant.torque_constant, 0.0),
            _ => {
                let per_volt = plant.torque_constant / plant.resistance;
                (per_volt * plant.supply, per_volt * plant.back_emf)
            }
        };
        let resists = resists + plant.viscous_friction;
        let inertia = plant.inertia();
        // N m s/rad: gains are per rpm.
        let gain = f64::from(cascade.speed.kp) * torque * 60.0 / TAU;
        let lag = plant.current_time_constant;
        let phase = |w: f64| (w * inertia / resists).atan() + (w * lag).atan() + w * DELAY;
        let level = |w: f64| gain / resists.hypot(w * inertia) / (w * lag).hypot(1.0);
        let (speed, of_speed) = margin(PI, phase, level);
        // rad/s: of the closed speed loop, and of its command. 1 rpm is 6 degrees a second.
        let follows = gain / inertia;
        let asks = 6.0 * f64::from(cascade.angle.kp);
        let delay = DELAY + 1e-3 * f64::from(cascade.outer_divider.max(1));
        let phase = |w: f64| (w / follows).atan() + w * delay;
        let (angle, of_angle) = margin(FRAC_PI_2, phase, |w| asks / w / (w / follows).hypot(1.0));
        Self { speed, angle, phases: Some([of_speed, of_angle]) }
    }
}

/// One divided by the level where the phase has reached `turn`; and what is left to `turn` where the level is one, degrees.
fn margin(turn: f64, phase: impl Fn(f64) -> f64, level: impl Fn(f64) -> f64) -> (f64, f64) {
    // Phases rise with the frequency and levels fall, so bisection finds both, to a millionth.
    let find = |is_below: &dyn Fn(f64) -> bool| {
        let (mut low, mut high) = (0.0, 1e5);
        while high - low > 1e-6 * high {
            let middle = f64::midpoint(low, high);
            *(if is_below(middle) { &mut low } else { &mut high }) = middle;
        }
        high
    };
    let left = turn - phase(find(&|w| level(w) > 1.0));
    (1.0 / level(find(&|w| phase(w) < turn)), left.to_degrees())
}
