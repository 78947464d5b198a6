//! Lines of **Copy for the table**, where a robot's table has them: the test compares the marked ones with what the
//! page gave, and this program does not compile if they are no Rust.

use rc10_app::{Cascade, PidConfig};
use rc10_motor::Entry;
use rc10_motor::Place::Bus;
use rc10_motor::dji::{Config, Dji, GM6020_CURRENT, M3508};

rc10_motor::motors! {
    pub enum Name;
    pub struct Motors;
    WheelFrontLeft: Dji = Entry::new(Bus(1), Config::new(&M3508, 1).with_cascade(WHEEL)),
    GimbalYaw: Dji = Entry::new(Bus(2), Config::new(&GM6020_CURRENT, 1).with_cascade(YAW)),
}

const WHEEL: Cascade = Cascade {
    // wheel front left, wheel front right, wheel rear left, wheel rear right: speed_kp was 0.4
    speed: PidConfig::within(20.0).kp(0.5).ki(4.0),
    ..M3508.cascade
};

const YAW: Cascade = Cascade {
    // gimbal yaw: angle_kp was 1.5, limit was 3.0
    speed: PidConfig::within(2.5).kp(0.12).ki(0.6),
    angle: PidConfig::within(250.0).kp(1.25),
    ..GM6020_CURRENT.cascade
};

rc10_tasks::live! {
    /// Values of its own.
    pub struct Own {
        parameters {
            feeder:
            // feeder speed: in live!, was 300.0
            "feeder speed", "rpm", 200.0, [0.0, 450.0];
        }
    }
}
