//! Gain margins of a motor's control loops: how far they are from oscillation.
//!
//! A run shows how loops behave with the motions of its script, and with simulated motors that are
//! better than real ones. The gain margin says how many times higher a gain may be until a loop
//! shakes whatever it is told: from its gains, the inertia that it moves, and its delays.
//!
//! The speed loop is a gain on torque, inertia and friction of back-EMF, the current's time
//! constant, and a dead time of [`DELAY`]. The angle loop is a gain on an integrator behind the
//! closed speed loop, which follows as a first-order lag does, and runs in every n-th tick. Integral
//! parts and feed-forward are left out.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use rc10_motor::{Loops, TargetKind};
use rc10_sim::Plant;

/// From a measurement to the effort that it causes: half a feedback period, half a tick of holding,
/// and up to a tick on the bus and in the ESC.
pub const DELAY: f64 = 2e-3;
/// A gain margin below this is a problem: 14 dB.
pub const LEAST: f64 = 5.0;

/// Gain margins: factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Of the speed loop.
    pub speed: f64,
    /// Of the angle loop around it.
    pub angle: f64,
}

impl Margins {
    /// Of loops that move this.
    #[must_use]
    pub fn of(loops: Loops, plant: &Plant) -> Self {
        let cascade = &loops.cascade;
        // N m per unit of effort, and N m s/rad of what resists: friction, and in voltage mode the
        // back-EMF.
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
        let speed = margin(PI, phase, level);
        // rad/s: the closed speed loop, and what the angle loop asks it for. 1 rpm is 6 degrees a
        // second.
        let follows = gain / inertia;
        let asks = 6.0 * f64::from(cascade.angle.kp);
        let delay = DELAY + 1e-3 * f64::from(cascade.outer_divider.max(1));
        let phase = |w: f64| (w / follows).atan() + w * delay;
        let angle = margin(FRAC_PI_2, phase, |w| asks / w / (w / follows).hypot(1.0));
        Self { speed, angle }
    }
}

/// One divided by the level where the phase has reached `turn`.
fn margin(turn: f64, phase: impl Fn(f64) -> f64, level: impl Fn(f64) -> f64) -> f64 {
    // Phases rise with the frequency: halved until it is known to a millionth.
    let (mut low, mut high) = (0.0, 1e5);
    while high - low > 1e-6 * high {
        let middle = f64::midpoint(low, high);
        *(if phase(middle) < turn { &mut low } else { &mut high }) = middle;
    }
    1.0 / level(high)
}
