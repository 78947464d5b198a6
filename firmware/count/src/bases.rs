//! The inverse kinematics of bases.

use core::hint::black_box;

use rc10_app::base::WheelSpeeds;
use rc10_app::{Base, Rpm, Twist, TwistNotFinite};

const LIMIT: Rpm = Rpm::new(400.0);

/// Measures all of it.
pub fn measure() {
    let (mecanum, omni) =
        (Base::mecanum(0.076, 0.20, 0.22, LIMIT), Base::omni_4(0.076, 0.25, LIMIT));
    // The last but one is limited, the last is refused.
    for twist in [
        Twist::STOP,
        Twist::new(1.0, 0.5, -2.0),
        Twist::new(-0.3, 1.5, 1.0),
        Twist::new(6.0, -2.0, 8.0),
        Twist::new(1.0, f32::NAN, 0.0),
    ] {
        for base in [&mecanum, &omni] {
            black_box(inverse(black_box(base), black_box(twist)).is_ok());
        }
    }
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_1_base_inverse")]
#[inline(never)]
fn inverse(base: &Base<4>, twist: Twist) -> Result<WheelSpeeds<4>, TwistNotFinite> {
    base.inverse(twist)
}
