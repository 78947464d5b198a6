//! How the robot is, in one small message that a log, a lamp or a display can use.

use core::fmt;

use embassy_time::{Duration, Ticker};
use rc10_can::{ErrorState, Micros};
use rc10_module::Counters;
use rc10_module::remote::Freshness;
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
    /// Whether the remote control is heard.
    pub remote: Freshness,
    /// What the bytes of its receiver amounted to.
    pub remote_reception: Counters,
    /// What the bytes of the IMU amounted to.
    pub imu_reception: Counters,
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
    /// How often the controller was found unable to send (restricted operation).
    pub restrictions: u32,
    /// How often the bus stood still and was made safe.
    pub stalls: u32,
}

/// For people: what is as it should be takes few words.
impl fmt::Display for RobotStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {} of {} motors online", self.arm, self.online, MOTORS.len())?;
        match self.remote {
            Freshness::Fresh => {}
            Freshness::Missing => write!(f, ", remote missing")?,
            Freshness::Lost => write!(f, ", no remote")?,
        }
        for (name, counters) in [("remote", self.remote_reception), ("IMU", self.imu_reception)] {
            let Counters { damaged, skipped, port_errors, .. } = counters;
            if damaged > 0 || skipped > 0 || port_errors > 0 {
                write!(f, ", {name}: {damaged} damaged, {skipped} bytes skipped, ")?;
                write!(f, "{port_errors} port errors")?;
            }
        }
        for (number, bus) in (1_u8..).zip(&self.buses) {
            write!(f, "; bus {number} {bus}")?;
        }
        Ok(())
    }
}

impl fmt::Display for BusSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.state)?;
        if self.alone {
            write!(f, ", alone on the bus")?;
        }
        let Self { ticks, longest_tick, longest_period, received, .. } = self;
        write!(f, ": {ticks} ticks of {longest_tick} us, {longest_period} us apart")?;
        write!(f, ", {received} received")?;
        for (count, what) in [
            (self.overruns, "ticks missed"),
            (self.malformed, "malformed"),
            (self.lost, "lost"),
            (self.bus_offs, "times bus-off"),
            (self.restrictions, "times restricted"),
            (self.stalls, "times stalled"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        Ok(())
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
            restrictions: status.health.restrictions,
            stalls: status.health.stalls,
        }
    };
    RobotStatus {
        at: rc10_bsp::now(),
        arm: io.switch.state(),
        online: u8::try_from(online.count()).unwrap_or(u8::MAX),
        remote: io.freshness.read().map_or(Freshness::Lost, |freshness| freshness.value),
        remote_reception: io.remote_reception.read(),
        imu_reception: io.imu_reception.read(),
        buses: core::array::from_fn(summary),
    }
}
