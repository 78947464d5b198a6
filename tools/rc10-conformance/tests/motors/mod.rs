//! Each vendor's motor against its simulated device: two codecs that agree, closed loops, unplug,
//! restart, faults; the signal tables against the codecs.
#![allow(clippy::float_cmp, reason = "exact is meant")]

mod cybergear;
mod damiao;
mod damiao_values;
mod dji;
mod faults;
mod index;
mod lk;
mod odrive;
mod unitree_line;
mod unitree_module;
mod vesc;
mod vesc_values;

use rc10_conformance::Bench;
use rc10_motor::{MotorId, Target};
use rc10_sim::Esc;

/// What a bench borrows, for as long as the tests run: none has to keep it.
fn leak<T>(value: T) -> &'static mut T {
    Box::leak(Box::new(value))
}

fn rpm(esc: &Esc) -> f64 {
    esc.state().output_rpm
}

/// Milliseconds until what is measured stays within `band` of the goal for 200 ms.
fn settles(
    bench: &mut Bench<'_>,
    motor: MotorId,
    target: Target,
    off: impl Fn() -> f64,
    band: f64,
) -> u32 {
    let mut inside_since = 0;
    for millis in 1..4000 {
        bench.hold(motor, target, 1).unwrap();
        if off().abs() > band {
            inside_since = millis;
        }
        if millis - inside_since > 200 {
            return inside_since;
        }
    }
    panic!("does not settle: off by {}", off());
}
