//! The setup of a motor, and the values of its data sheet.

use super::codec::{Limits, Mode};
use crate::device::Beyond;
use crate::plant::Plant;

/// A motor, to be put on a bus.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct DamiaoConfig {
    /// Identifier of the frames that it takes, 0 ..= 0x7FF.
    pub can_id: u16,
    /// Identifier of the frames that it sends, 0 ..= 0x7FF.
    pub master_id: u16,
    /// Control mode.
    pub mode: Mode,
    /// The ranges.
    pub limits: Limits,
    /// Silence after which it stops, in 50 µs; 0 for never, as it is sold.
    pub timeout: u32,
    /// Acceleration by its own loops, rad/s².
    pub acceleration: f64,
    /// Code by which it acknowledges a written register: 0x55 (J10010L) or 0x33 (S3519).
    pub acknowledges_with: u8,
    /// Old firmware takes frames only with the offset of the mode it is in.
    pub old_firmware: bool,
    /// Reports beyond ±PMAX: no source tells.
    pub beyond: Beyond,
    /// The motor and its load.
    pub plant: Plant,
}

impl DamiaoConfig {
    /// A DM-J4310 on 24 V in MIT mode, as it is sold, nothing on its shaft.
    pub const fn j4310(can_id: u16, master_id: u16) -> Self {
        let limits = Limits { position: 12.5, velocity: 30.0, torque: 10.0 };
        Self::new(can_id, master_id, limits, j4310())
    }

    /// A DM-J8009 on 48 V in MIT mode, as it is sold, nothing on its shaft.
    pub const fn j8009(can_id: u16, master_id: u16) -> Self {
        let limits = Limits { position: 12.5, velocity: 45.0, torque: 54.0 };
        Self::new(can_id, master_id, limits, j8009())
    }

    /// Any other, in MIT mode.
    pub const fn new(can_id: u16, master_id: u16, limits: Limits, plant: Plant) -> Self {
        Self {
            can_id,
            master_id,
            mode: Mode::Mit,
            limits,
            timeout: 0,
            acceleration: 200.0,
            acknowledges_with: 0x55,
            old_firmware: false,
            beyond: Beyond::Saturates,
            plant,
        }
    }
}

/// DM-J4310-2EC V1.1. Data sheet: gear 10, 0.945 N·m/A, 200 rpm without load at 24 V, 0.85 Ω,
/// 1.8e-5 kg·m², 10.261 A. Friction and heating are estimates.
const fn j4310() -> Plant {
    Plant::motor(10.0, 0.945, 0.85, 10.261, 1.8e-5)
        .with_friction(5e-3, 0.05, 0.07)
        .with_heating(4.0, 200.0)
        .with_no_load_speed(2000.0)
}

/// DM-J8009-2EC. Data sheet: gear 9, 1.261575 N·m/A, 335 rpm without load at 48 V, 0.145 Ω,
/// 1.95e-4 kg·m², 41.045 A. Friction and heating are estimates.
const fn j8009() -> Plant {
    Plant {
        supply: 48.0,
        ..Plant::motor(9.0, 1.261_575, 0.145, 41.045, 1.95e-4)
            .with_friction(2e-2, 0.25, 0.35)
            .with_heating(1.5, 400.0)
    }
    .with_no_load_speed(3015.0)
}
