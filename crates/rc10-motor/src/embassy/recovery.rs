use rc10_can::{BusOffPolicy, ErrorState, Health};
use rc10_time::Micros;

/// Decides by a [`BusOffPolicy`] when a bus that has left goes back; the port knows how.
#[derive(Debug)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Recovery {
    policy: BusOffPolicy,
    /// Since the last attempt, if any of late; doubles each time.
    pause: Micros,
    /// No attempt before.
    earliest: Micros,
    /// Since when the bus has been neither off nor error passive.
    well_since: Option<Micros>,
    bus_offs: Option<u32>,
}

const SHORTEST: Micros = Micros::from_millis(2);
const LONGEST: Micros = Micros::from_millis(50);
/// A bus that has been well for this time is a new one: its next bus-off is the first.
const WELL: Micros = Micros::from_millis(1000);

/// The actions of one tick: bring the bus back, stop all motors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Steps {
    pub(super) recover: bool,
    pub(super) emergency_stop: bool,
}

impl Recovery {
    pub(super) const fn new(policy: BusOffPolicy) -> Self {
        Self {
            policy,
            pause: Micros::ZERO,
            earliest: Micros::ZERO,
            well_since: None,
            bus_offs: None,
        }
    }

    /// Decides from the health of the bus; `asked` is whether it is to come back now.
    pub(super) fn step(&mut self, health: &Health, asked: bool, now: Micros) -> Steps {
        // A driver that goes back by itself may be back before the next look.
        let fell = self.bus_offs.replace(health.bus_offs).is_some_and(|n| n != health.bus_offs);
        let off = health.state == ErrorState::BusOff;
        let due = self.policy != BusOffPolicy::Manual && now >= self.earliest;
        let recover = off && (asked || due);
        if recover {
            self.pause = Micros::new(self.pause.get() * 2).clamp(SHORTEST, LONGEST);
            self.earliest = now + self.pause;
        }
        if health.state >= ErrorState::Passive {
            self.well_since = None;
        } else if now.since(*self.well_since.get_or_insert(now)) >= WELL {
            (self.pause, self.earliest) = (Micros::ZERO, Micros::ZERO);
        }
        let emergency_stop = self.policy == BusOffPolicy::Latched && (off || fell);
        Steps { recover, emergency_stop }
    }
}
