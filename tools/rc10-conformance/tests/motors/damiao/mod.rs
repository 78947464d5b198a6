//! Damiao: our motor and the simulated one.

mod attach;
mod closed_loop;
mod codecs;
mod failures;
mod registers;
mod table;

use rc10_app::{PidConfig, Rpm, RpmPerSecond};
use rc10_motor::Safety;
use rc10_motor::damiao::{Config, Control, Damiao, DeviceId, models};
use rc10_motor::rc10_app::{Cascade, FeedForward};
use rc10_sim::damiao::{Damiao as Device, DamiaoConfig, Mode};

use crate::motors::One;

pub const CAN_ID: u16 = 0x11;
pub const MASTER_ID: u16 = 0x31;
/// On the shaft, kg m².
pub const LOAD: f64 = 0.02;
/// The largest torque of [`cascade`].
pub const MOST: f32 = 7.0;

pub fn cascade() -> Cascade {
    Cascade {
        speed: PidConfig::within(MOST).kp(0.063).ki(0.5),
        angle: PidConfig::within(150.0).kp(1.3),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    }
}

pub fn controls() -> [Control; 4] {
    let speed = Rpm::new(100.0);
    [
        Control::Mit(cascade()),
        Control::PositionVelocity { speed },
        Control::Velocity,
        Control::ForcePosition { speed, torque_share: 0.5 },
    ]
}

pub fn config(control: Control) -> Config {
    Config::new(models::J4310, CAN_ID, MASTER_ID, control)
}

pub fn device_id(control: Control) -> DeviceId {
    DeviceId::new(config(control).can_id).unwrap()
}

pub fn motor(control: Control) -> Damiao {
    Damiao::new(config(control)).unwrap()
}

/// The mode of a control, register 10.
pub fn mode_of(control: &Control) -> Mode {
    match control {
        Control::Mit(_) => Mode::Mit,
        Control::PositionVelocity { .. } => Mode::PositionVelocity,
        Control::Velocity => Mode::Velocity,
        Control::ForcePosition { .. } => Mode::ForcePosition,
    }
}

pub fn device(control: &Control) -> DamiaoConfig {
    let config = DamiaoConfig::j4310(CAN_ID, MASTER_ID);
    let plant = config.plant.with_load_inertia(LOAD);
    DamiaoConfig { mode: mode_of(control), timeout: 2000, plant, ..config }
}

/// A motor and its device.
type Rig = One<Device>;

fn on_bus(motor: Damiao, config: &DamiaoConfig, safety: Safety) -> Rig {
    One::new(motor, Device::new(config), config.plant, safety)
}

impl Rig {
    pub fn is_enabled(&self) -> bool {
        self.device(|device| device.is_enabled())
    }
}
