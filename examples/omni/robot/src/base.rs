//! The kinematics of four omni wheels, each a quarter of a turn behind the one before, the first 45
//! degrees to the left of ahead. A wheel that turns forward pushes the base counter-clockwise.

use rc10_app::{Rpm, Twist};

use crate::table::{WHEEL_DISTANCE, WHEEL_RADIUS};

/// rpm per rad/s.
const RPM: f32 = 30.0 / core::f32::consts::PI;
/// Cosine of 45 degrees.
const HALF: f32 = core::f32::consts::FRAC_1_SQRT_2;
/// The ways in which the wheels push, forward and to the left.
const WAYS: [[f32; 2]; 4] = [[-HALF, HALF], [-HALF, -HALF], [HALF, -HALF], [HALF, HALF]];

/// The speeds of the [wheels](crate::table::WHEELS) that move the base so.
#[must_use]
pub fn wheels(twist: Twist) -> [Rpm; 4] {
    WAYS.map(|[forward, left]| {
        let speed = forward * twist.vx + left * twist.vy + WHEEL_DISTANCE * twist.wz;
        Rpm::new(speed / WHEEL_RADIUS * RPM)
    })
}

/// The motion of the base by the speeds of its wheels.
#[must_use]
pub fn motion(wheels: [Rpm; 4]) -> Twist {
    let mut twist = Twist::STOP;
    for ([forward, left], speed) in WAYS.into_iter().zip(wheels) {
        let speed = speed.get() / RPM * WHEEL_RADIUS;
        // Each way stands at right angles to two others: the sums are 2, 2 and 4.
        twist.vx += forward * speed / 2.0;
        twist.vy += left * speed / 2.0;
        twist.wz += speed / WHEEL_DISTANCE / 4.0;
    }
    twist
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_move_the_base_as_it_shall_move() {
        for twist in [
            Twist::new(1.0, 0.0, 0.0),
            Twist::new(0.0, -0.7, 0.0),
            Twist::new(0.0, 0.0, 3.0),
            Twist::new(0.4, 0.9, -2.0),
        ] {
            let back = motion(wheels(twist));
            let off = [back.vx - twist.vx, back.vy - twist.vy, back.wz - twist.wz];
            assert!(off.iter().all(|off| off.abs() < 1e-5), "{twist:?}: {back:?}");
        }
        // Forward: the left wheels turn back, the right ones forward.
        let [front_left, rear_left, rear_right, front_right] =
            wheels(Twist::new(1.0, 0.0, 0.0)).map(Rpm::get);
        assert!(front_left < 0.0 && rear_left < 0.0 && rear_right > 0.0 && front_right > 0.0);
    }
}
