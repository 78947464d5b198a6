//! One step of a PID controller, as it is mostly used and with everything that it can do.

use core::hint::black_box;

use rc10_app::{PidConfig, PidState, Seconds};

const PLAIN: PidConfig = PidConfig::within(20.0).kp(0.4).ki(2.0);
const WHOLE: PidConfig = PidConfig {
    derivative_filter: Seconds::new(0.005),
    setpoint_weight: 0.7,
    tracking: 20.0,
    deadband: 0.01,
    integral_separation: 100.0,
    ..PidConfig::within(20.0).kp(0.4).ki(2.0).kd(0.01)
};

/// A motor's speed on its way to a setpoint, and one that is far below it.
pub fn measure() {
    let dt = black_box(1e-3);
    let (mut plain, mut whole, mut limited) = (PidState::new(), PidState::new(), PidState::new());
    for step in 0..400_u16 {
        let measured = black_box(50.0 + 0.05 * f32::from(step));
        black_box(pid_plain(&mut plain, &PLAIN, 60.0, measured, 0.1, dt));
        black_box(pid_whole(&mut whole, &WHOLE, 60.0, measured, 0.1, dt));
        black_box(pid_limited(&mut limited, &WHOLE, 160.0, measured, 0.1, dt));
    }
}

macro_rules! step {
    ($symbol:literal, $name:ident) => {
        // SAFETY: nothing else has this name.
        #[unsafe(export_name = $symbol)]
        #[inline(never)]
        extern "C" fn $name(
            state: &mut PidState,
            config: &PidConfig,
            setpoint: f32,
            measured: f32,
            feed_forward: f32,
            dt: f32,
        ) -> f32 {
            // SAFETY: a comment. It keeps the compiler from merging functions that are equal.
            unsafe { core::arch::asm!(concat!("// ", $symbol), options(nomem, nostack)) };
            state.update(config, setpoint, measured, feed_forward, Seconds::new(dt))
        }
    };
}

step! { "count_1_pid_plain", pid_plain }
step! { "count_1_pid_whole", pid_whole }
step! { "count_1_limited_pid", pid_limited }
