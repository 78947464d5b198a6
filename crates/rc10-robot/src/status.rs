//! The status of the robot, in one small message that a log, an LED or a display can use.

use core::fmt;

use embassy_time::{Duration, Ticker};
use rc10_can::Micros;
use rc10_message::{CycleCount, Cycles};
use rc10_module::Counters;
use rc10_module::remote::RemoteLink;
use rc10_motor::{ArmState, Link, Names, TargetError, Unfit};
use rc10_tasks::BusSummary;

use crate::robot::Shared;
use crate::table::{BUSES, Name};

/// Ticks a second, of all buses: one after the other, at equal distance.
#[expect(clippy::cast_possible_truncation, reason = "three buses")]
const TICKS: u32 = BUSES as u32 * 1000;

/// Status of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotStatus {
    /// Time of this status.
    pub at: Micros,
    /// Whether it is armed.
    pub arm: ArmState,
    /// Why it cannot be armed, if it cannot.
    pub unfit: Option<Unfit>,
    /// Motors that are heard.
    pub online: u8,
    /// Targets that motors refused, of all of them.
    pub refused: u32,
    /// The newest of those that came from a task of the robot: which motor, and why.
    pub last_refused: Option<(Name, TargetError)>,
    /// Whether the remote control is heard.
    pub remote: RemoteLink,
    /// Counters of its receiver's bytes and frames.
    pub remote_reception: Counters,
    /// Counters of the IMU's bytes and frames.
    pub imu_reception: Counters,
    /// Status of each bus.
    pub buses: [BusSummary; BUSES],
    /// Cycles of the core that a tick of a bus takes, of any bus; `None` where no chip counts them.
    pub bus_cycles: Option<CycleCount>,
}

/// For people: what is as it should be takes few words.
impl fmt::Display for RobotStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.arm)?;
        if let Some(why) = self.unfit {
            write!(f, ", cannot be armed: {why}")?;
        }
        write!(f, ", {} of {} motors online", self.online, Name::ALL.len())?;
        if self.refused > 0 {
            write!(f, ", {} targets refused", self.refused)?;
        }
        if let Some((motor, why)) = self.last_refused {
            write!(f, " ({}: {why})", motor.label())?;
        }
        match self.remote {
            RemoteLink::Online => {}
            RemoteLink::Interrupted => write!(f, ", remote missing")?,
            RemoteLink::Lost => write!(f, ", no remote")?,
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
        if let Some(CycleCount { mean, most, a_second }) = self.bus_cycles {
            let apart = a_second / TICKS;
            let share = mean.saturating_mul(1000) / apart.max(1);
            let (percent, tenths) = (share / 10, share % 10);
            write!(f, "; ticks take {mean} of {apart} cycles ({percent}.{tenths} %)")?;
            write!(f, ", at most {most}")?;
        }
        Ok(())
    }
}

/// The status task.
pub async fn run(shared: &Shared<'_>) -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(100));
    loop {
        ticker.next().await;
        shared.status.publish(now(shared));
    }
}

/// The status of the robot now.
#[must_use]
pub fn now(shared: &Shared<'_>) -> RobotStatus {
    let (mut online, mut refused) = (0, 0_u32);
    for name in Name::ALL {
        let status = shared.motor(*name).status();
        online += u8::from(status.link == Link::Online);
        refused = refused.saturating_add(status.counters.refused.total());
    }
    RobotStatus {
        at: rc10_message::now(),
        arm: shared.switch.state(),
        unfit: shared.switch.unfit(),
        online,
        refused,
        last_refused: shared.refused.read().map(|refused| refused.value),
        remote: shared.remote_link.read().map_or(RemoteLink::Lost, |freshness| freshness.value),
        remote_reception: shared.remote_reception.read(),
        imu_reception: shared.imu_reception.read(),
        buses: shared.ports.buses.each_ref().map(|bus| bus.status().into()),
        bus_cycles: shared.bus_cycles.and_then(Cycles::read),
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use rc10_motor::TargetKind;

    use super::*;

    #[test]
    fn what_keeps_the_robot_from_driving_is_said_first() {
        let status = RobotStatus {
            at: Micros::ZERO,
            arm: ArmState::Disarmed,
            unfit: Some(Unfit::Overload),
            online: 11,
            refused: 9800,
            last_refused: Some((Name::FrontLeft, TargetError::NotFinite(TargetKind::Speed))),
            remote: RemoteLink::Online,
            remote_reception: Counters::default(),
            imu_reception: Counters::default(),
            buses: [BusSummary::default(); BUSES],
            bus_cycles: Some(CycleCount { mean: 7_740, most: 11_772, a_second: 480_000_000 }),
        };
        let expected = "disarmed, cannot be armed: the motors of a bus do not fit on it, 11 of 11 \
                        motors online, 9800 targets refused (wheel front left: the Speed target is \
                        infinite or NaN); bus 1 ";
        assert!(status.to_string().starts_with(expected), "{status}");
        let expected = "; ticks take 7740 of 160000 cycles (4.8 %), at most 11772";
        assert!(status.to_string().ends_with(expected), "{status}");
    }
}
