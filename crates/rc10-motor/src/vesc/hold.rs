//! Braking of a turning shaft to a stand, and holding it there, without angle loops.

use rc10_app::{ElectricalRpm, Seconds};

/// Slower than this a still field catches the rotor (estimate): five turns of the field a second.
const CATCHABLE: f32 = 300.0;
/// Turns of the field that a rotor which runs past it covers; one that swings covers less than one.
const SLIP: f32 = 1.5;

/// Brake or handbrake: a still field holds a rotor that nearly stands, and no other. So the shaft
/// is braked first, and again if it slips. A weight that pulls on at low speed sinks on the brake:
/// a field that does not catch it would let it fall.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Hold {
    /// The field stands; else the shaft is braked.
    locks: bool,
    /// Turns of the field that the rotor has covered since it was last slow enough.
    turns: f32,
}

impl Hold {
    /// One step; whether the field shall stand.
    pub(super) fn update(&mut self, dt: Seconds, speed: ElectricalRpm) -> bool {
        let nearly_stands = speed.get().abs() < CATCHABLE;
        let covered = self.turns + speed.get() * dt.get() * (1.0 / 60.0);
        self.turns = if nearly_stands { 0.0 } else { covered };
        self.locks = nearly_stands || self.locks && self.turns.abs() < SLIP;
        self.locks
    }
}
