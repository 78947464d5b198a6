//! How a turning shaft is brought to a stand and kept there.

use rc10_app::Seconds;

use super::ElectricalRpm;

/// Slower than this a still field catches the rotor (estimate): five turns of the field a second.
const CATCHABLE: f32 = 300.0;
/// A brake that has not taken a tenth of the speed in this time, s, will not stop the shaft: it
/// fades at low speed, and a weight sinks on.
const BRAKE_TIME: f32 = 0.25;
/// A field that has not caught the rotor in this time, s, will not.
const CATCH_TIME: f32 = 0.2;

/// A still field holds; a rotor that runs past it is neither held nor braked. So the shaft is
/// braked first, and again if the field does not catch it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hold {
    /// The field stands; else the shaft is braked.
    locks: bool,
    /// Seconds since it last looked.
    time: f32,
    /// How fast the shaft was then.
    before: f32,
}

impl Hold {
    /// One step; whether the field shall stand.
    pub(super) fn update(&mut self, dt: Seconds, speed: ElectricalRpm) -> bool {
        let speed = speed.get().abs();
        self.time += dt.get();
        if speed < CATCHABLE {
            (self.locks, self.time) = (true, 0.0);
        } else if self.locks {
            if self.time > CATCH_TIME {
                *self = Self { before: speed, ..Self::default() };
            }
        } else if self.time > BRAKE_TIME {
            self.locks = speed > 0.9 * self.before;
            (self.time, self.before) = (0.0, speed);
        }
        self.locks
    }

    /// Whatever is held next begins afresh.
    pub(super) fn start_over(&mut self) {
        // Nothing is known of how fast it was: a first look decides nothing.
        *self = Self { before: f32::INFINITY, ..Self::default() };
    }
}
