//! How the robot is, in one small message that a log, a lamp or a display can use.

use embassy_time::{Duration, Ticker};
use rc10_can::{ErrorState, Micros};
use rc10_motor::{ArmState, Link};

use crate::robot::Io;
use crate::table::{BUSES, MOTORS};

/// How the robot is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotStatus {
    /// When.
    pub at: Micros,
    /// Whether it is armed.
    pub arm: ArmState,
    /// Motors that are heard.
    pub online: u8,
    /// How the buses are.
    pub buses: [BusSummary; BUSES],
}

/// How a bus is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusSummary {
    /// Ticks so far.
    pub ticks: u32,
    /// Ticks that did not happen in time.
    pub overruns: u32,
    /// Longest time from tick to tick, in microseconds.
    pub longest_period: u32,
    /// Longest tick, in microseconds.
    pub longest_tick: u32,
    /// Frames that its motors understood.
    pub received: u32,
    /// Frames that had a motor's identifier and were no feedback.
    pub malformed: u32,
    /// Received frames that were lost.
    pub lost: u32,
    /// Error state of the controller.
    pub state: ErrorState,
    /// Nobody acknowledges: alone on the bus, as it seems.
    pub alone: bool,
    /// How often the controller went bus-off.
    pub bus_offs: u32,
    /// How often the bus stood still and was made safe.
    pub stalls: u32,
}

/// For people: what is as it should be takes few words.
#[cfg(feature = "defmt")]
impl defmt::Format for RobotStatus {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}, {} of {} motors online", self.arm, self.online, MOTORS.len());
        for (number, bus) in (1_u8..).zip(&self.buses) {
            defmt::write!(f, "; bus {} {}", number, bus);
        }
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for BusSummary {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}", self.state);
        if self.alone {
            defmt::write!(f, ", alone on the bus");
        }
        let Self { ticks, longest_tick, longest_period, received, .. } = self;
        defmt::write!(f, ": {} ticks of {} us, {} us apart", ticks, longest_tick, longest_period);
        defmt::write!(f, ", {} received", received);
        if self.overruns > 0 {
            defmt::write!(f, ", {} ticks missed", self.overruns);
        }
        if self.malformed > 0 {
            defmt::write!(f, ", {} malformed", self.malformed);
        }
        if self.lost > 0 {
            defmt::write!(f, ", {} lost", self.lost);
        }
        if self.bus_offs > 0 {
            defmt::write!(f, ", {} times bus-off", self.bus_offs);
        }
        if self.stalls > 0 {
            defmt::write!(f, ", {} times stalled", self.stalls);
        }
    }
}

/// The status task.
pub async fn run(io: &Io<'_>) -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(100));
    loop {
        ticker.next().await;
        io.status.publish(now(io));
    }
}

/// How the robot is now.
#[must_use]
pub fn now(io: &Io<'_>) -> RobotStatus {
    let online = MOTORS.iter().filter(|motor| io.motor(motor.name).status().link == Link::Online);
    let summary = |bus: usize| {
        let status = io.buses[bus].status();
        BusSummary {
            ticks: status.ticks,
            overruns: status.overruns,
            longest_period: status.period.max().unwrap_or(0),
            longest_tick: status.execution.max().unwrap_or(0),
            received: status.received.received,
            malformed: status.received.malformed,
            lost: status.health.receive_lost,
            state: status.health.state,
            alone: status.health.is_alone(),
            bus_offs: status.health.bus_offs,
            stalls: status.health.stalls,
        }
    };
    RobotStatus {
        at: rc10_bsp::now(),
        arm: io.switch.state(),
        online: u8::try_from(online.count()).unwrap_or(u8::MAX),
        buses: core::array::from_fn(summary),
    }
}
