//! The status of a robot, in one small message that a log, an LED or a display can use; and whether
//! its buses and lines tick.

use core::fmt;
use core::sync::atomic::Ordering;

use embassy_time::{Duration, Ticker};
use heapless::Vec;
use rc10_can::ErrorState;
use rc10_message::{CycleCount, Cycles};
use rc10_module::Counters;
use rc10_module::remote::RemoteLink;
use rc10_motor::embassy::{BusPort, BusStatus, PortsOf, Rs485Port, Rs485Status};
use rc10_motor::{ArmState, Link, MOST_BUSES, MOST_LINES, Names, TargetError, Unfit};
use rc10_time::{Micros, Timing};

use crate::arming::Axis;
use crate::common::Common;
use crate::live::{KeptState, Live, changed};
use crate::program::MOST_SERIALS;
use crate::supply::{OLDEST_SUPPLY, Supply};

/// Status of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotStatus<N> {
    /// Time of this status.
    pub at: Micros,
    /// Whether it is armed.
    pub arm: ArmState,
    /// Why it cannot be armed, if it cannot.
    pub unfit: Option<Unfit>,
    /// The axis that was not at rest when the remote was to arm the robot.
    pub not_at_rest: Option<Axis>,
    /// Parameters that differ from the robot's table.
    pub changed: u16,
    /// What is to be told of kept parameters.
    pub kept: KeptState,
    /// Motors that are heard.
    pub online: u8,
    /// Targets that motors refused, of all of them.
    pub refused: u32,
    /// The newest of those that came from a task of the robot: which motor, and why.
    pub last_refused: Option<(N, TargetError)>,
    /// Whether the remote control is heard; `None` of a robot that listens to none.
    pub remote: Option<RemoteLink>,
    /// Counters of the bytes and frames of its receiver, of the IMU, and of its serial parts.
    pub receptions: [(&'static str, Counters); PARTS],
    /// Status of each bus.
    pub buses: Vec<BusSummary, MOST_BUSES>,
    /// Status of each line.
    pub lines: Vec<LineSummary, MOST_LINES>,
    /// The error of the IMU, in a few words behind that word.
    pub imu_trouble: Option<&'static str>,
    /// The supply, of a board that measures it.
    pub supply: Option<Supply>,
    /// Cycles of the core that a tick of a bus takes, of any bus; `None` where no chip counts them.
    pub bus_cycles: Option<CycleCount>,
}

/// Parts whose reception is told: the remote's receiver, the IMU, those on other serial ports.
pub const PARTS: usize = 2 + MOST_SERIALS;

/// For people: what is as it should be takes few words.
impl<N: Names> fmt::Display for RobotStatus<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.arm)?;
        if let Some(why) = self.unfit {
            write!(f, ", cannot be armed: {why}")?;
        }
        if let Some(axis) = self.not_at_rest {
            write!(f, ", not armed: {axis} is not at rest; put it there and arm again")?;
        }
        write!(f, ", {} of {} motors online", self.online, N::ALL.len())?;
        match self.changed {
            0 => {}
            1 => write!(f, ", 1 parameter differs from the table")?,
            count => write!(f, ", {count} parameters differ from the table")?,
        }
        match self.kept.unused {
            0 => {}
            1 => write!(f, ", 1 kept parameter is not used")?,
            count => write!(f, ", {count} kept parameters are not used")?,
        }
        if let Some(trouble) = self.kept.trouble {
            write!(f, ", {trouble}")?;
        }
        if self.refused > 0 {
            write!(f, ", {} targets refused", self.refused)?;
        }
        if let Some((motor, why)) = self.last_refused {
            write!(f, " ({}: {why})", motor.label())?;
        }
        match self.remote {
            None | Some(RemoteLink::Online) => {}
            Some(RemoteLink::Interrupted) => write!(f, ", remote missing")?,
            Some(RemoteLink::Lost) => write!(f, ", no remote")?,
        }
        if let Some(trouble) = self.imu_trouble {
            write!(f, ", IMU {trouble}")?;
        }
        if let Some(supply) = self.supply {
            write!(f, ", {supply}")?;
            if supply.is_low() {
                write!(f, " (low)")?;
            }
        }
        for (name, counters) in &self.receptions {
            let Counters { damaged, skipped, port_errors, .. } = counters;
            if *damaged > 0 || *skipped > 0 || *port_errors > 0 {
                write!(f, ", {name}: {damaged} damaged, {skipped} bytes skipped, ")?;
                write!(f, "{port_errors} port errors")?;
            }
        }
        for (number, bus) in (1_u8..).zip(&self.buses) {
            write!(f, "; bus {number} {bus}")?;
        }
        for (number, line) in (1_u8..).zip(&self.lines) {
            write!(f, "; line {number} {line}")?;
        }
        if let Some(CycleCount { mean, most, a_second }) = self.bus_cycles {
            // In each millisecond the first bus computes, each sends as the next computes, the last sends.
            let wakes = self.buses.iter().fold(1000_u32, |wakes, _| wakes.saturating_add(1000));
            let apart = a_second / wakes;
            let share = mean.saturating_mul(1000) / apart.max(1);
            let (percent, tenths) = (share / 10, share % 10);
            write!(f, "; ticks take {mean} of {apart} cycles ({percent}.{tenths} %)")?;
            write!(f, ", at most {most}")?;
        }
        Ok(())
    }
}

/// The status task: tells it ten times a second.
pub async fn run<N: Names>(shared: &Common<'_, N, impl Live>) -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(100));
    loop {
        ticker.next().await;
        shared.status.publish(now(shared));
    }
}

/// The status of the robot now.
#[must_use]
pub fn now<N: Names>(shared: &Common<'_, N, impl Live>) -> RobotStatus<N> {
    let (mut online, mut refused) = (0, 0_u32);
    let mut differ = 0;
    shared.own.parameters(&mut |it| differ += usize::from(it.is_changed()));
    for name in N::ALL {
        let motor = shared.motor(*name);
        let status = motor.status();
        differ += motor.tuning().map_or(0, changed);
        online += u8::from(status.link == Link::Online);
        refused = refused.saturating_add(status.counters.refused.total());
    }
    let [one, two, three, four] = &shared.receptions;
    let receptions: [_; PARTS] = [
        ("remote", &shared.remote_reception),
        ("IMU", &shared.imu_reception),
        ("serial part 1", one),
        ("serial part 2", two),
        ("serial part 3", three),
        ("serial part 4", four),
    ];
    let at = rc10_message::now();
    RobotStatus {
        at,
        arm: shared.switch.state(),
        unfit: shared.switch.unfit(),
        not_at_rest: shared.not_at_rest.read().and_then(|axis| axis.value),
        changed: u16::try_from(differ).unwrap_or(u16::MAX),
        kept: shared.kept_state.read().map(|it| it.value).unwrap_or_default(),
        online,
        refused,
        last_refused: shared.refused.read().map(|refused| refused.value),
        remote: shared.remote_link.read().map(|freshness| freshness.value),
        receptions: receptions.map(|(label, reception)| (label, reception.read())),
        buses: shared.ports.buses.iter().map(|bus| bus.status().into()).collect(),
        lines: shared.ports.lines.iter().map(|line| line.status().into()).collect(),
        imu_trouble: imu_trouble(shared, at),
        supply: shared.supply.newer_than(OLDEST_SUPPLY, at),
        bus_cycles: shared.bus_cycles.and_then(Cycles::read),
    }
}

/// A heading that is older is told as missing; and so is one that has not come by this time.
const OLDEST_HEADING: Micros = Micros::from_millis(200);
const HEADING_BY: Micros = Micros::from_millis(1000);

fn imu_trouble<N: Names>(shared: &Common<'_, N, impl Live>, at: Micros) -> Option<&'static str> {
    let told = shared.imu_trouble.read().and_then(|trouble| trouble.value);
    let is_due = shared.has_imu.load(Ordering::Relaxed) && at >= HEADING_BY;
    let is_missing = is_due && shared.heading.newer_than(OLDEST_HEADING, at).is_none();
    told.or(is_missing.then_some("gives no heading"))
}

/// Status of a bus, for a log.
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
    /// No other node acknowledges its frames: it seems to be alone on the bus.
    pub alone: bool,
    /// Number of times that the controller went bus-off.
    pub bus_offs: u32,
    /// Number of times that the controller was found unable to send (restricted operation).
    pub restrictions: u32,
    /// Number of times that the bus stood still and was made safe.
    pub stalls: u32,
}

impl From<BusStatus> for BusSummary {
    fn from(status: BusStatus) -> Self {
        let BusStatus { ticks, overruns, period, execution, received, health, .. } = status;
        Self {
            ticks,
            overruns,
            longest_period: period.max().unwrap_or(0),
            longest_tick: execution.max().unwrap_or(0),
            received: received.received,
            malformed: received.malformed,
            lost: health.receive_lost,
            state: health.state,
            alone: health.is_alone(),
            bus_offs: health.bus_offs,
            restrictions: health.restrictions,
            stalls: health.stalls,
        }
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

/// Status of an RS-485 line, for a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineSummary {
    /// Ticks that did not happen in time.
    pub overruns: u32,
    /// Commands with a reply.
    pub exchanges: u32,
    /// Commands without a whole reply in time.
    pub timeouts: u32,
    /// Replies with a wrong CRC.
    pub crc_errors: u32,
    /// Times the serial port could not read or write.
    pub port_errors: u32,
    /// Shortest and longest time from a command to the next one to the same motor, in microseconds.
    pub cycle: [u32; 2],
    /// The same from a command to the end of its reply.
    pub exchange: [u32; 2],
}

impl From<Rs485Status> for LineSummary {
    fn from(status: Rs485Status) -> Self {
        let Rs485Status { overruns, traffic, port_errors, .. } = status;
        let range = |timing: Timing| [timing.min().unwrap_or(0), timing.max().unwrap_or(0)];
        Self {
            overruns,
            exchanges: traffic.exchanges,
            timeouts: traffic.timeouts,
            crc_errors: traffic.crc_errors,
            port_errors,
            cycle: range(traffic.cycle),
            exchange: range(traffic.exchange),
        }
    }
}

impl fmt::Display for LineSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { exchanges, cycle: [least, most], exchange: [short, long], .. } = self;
        write!(f, "{exchanges} exchanges of {short} to {long} us, {least} to {most} us apart")?;
        for (count, what) in [
            (self.overruns, "ticks missed"),
            (self.timeouts, "timeouts"),
            (self.crc_errors, "wrong CRCs"),
            (self.port_errors, "port errors"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        Ok(())
    }
}

/// Sees whether every bus and line ticks: a watchdog is fed only then.
#[derive(Clone)]
pub struct TickWatch<'p> {
    buses: &'p [BusPort],
    lines: &'p [Rs485Port],
    ticks: Ticks,
}

type Ticks = Vec<u32, { MOST_BUSES + MOST_LINES }>;

impl<'p> TickWatch<'p> {
    /// From now on.
    #[must_use]
    pub fn new<N>(ports: PortsOf<'p, N>) -> Self {
        let PortsOf { buses, lines, .. } = ports;
        Self { buses, lines, ticks: Self::ticks(buses, lines) }
    }

    fn ticks(buses: &[BusPort], lines: &[Rs485Port]) -> Ticks {
        buses.iter().map(BusPort::ticks).chain(lines.iter().map(Rs485Port::ticks)).collect()
    }

    /// Whether every bus and line has ticked since the last call. Ask less often than they tick.
    pub fn have_all_ticked(&mut self) -> bool {
        let now = Self::ticks(self.buses, self.lines);
        let before = core::mem::replace(&mut self.ticks, now);
        self.ticks.iter().zip(before).all(|(now, before)| *now != before)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use rc10_motor::Place::Bus;
    use rc10_motor::dji::{Config, Dji, M3508};
    use rc10_motor::{Entry, TargetKind};

    use super::*;

    rc10_motor::motors! {
        enum Name;
        struct Motors;
        FrontLeft: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)).with_label("wheel front left"),
    }

    #[test]
    fn what_keeps_the_robot_from_driving_is_said_first() {
        let status = RobotStatus {
            at: Micros::ZERO,
            arm: ArmState::Disarmed,
            unfit: Some(Unfit::Overload),
            not_at_rest: Some(Axis::LeftY),
            changed: 3,
            kept: KeptState { unused: 1, trouble: Some("the flash of the parameters is worn out") },
            online: 1,
            refused: 9800,
            last_refused: Some((Name::FrontLeft, TargetError::NotFinite(TargetKind::Speed))),
            remote: Some(RemoteLink::Online),
            receptions: [("remote", Counters::default()); PARTS],
            buses: [BusSummary::default(); 3].into_iter().collect(),
            lines: Vec::new(),
            imu_trouble: None,
            supply: None,
            bus_cycles: Some(CycleCount { mean: 7_740, most: 11_772, a_second: 480_000_000 }),
        };
        let expected = "disarmed, cannot be armed: the motors of a bus do not fit on it, not \
                        armed: left stick (up and down) is not at rest; put it there and arm again, \
                        1 of 1 motors online, 3 parameters differ from the table, 1 kept parameter is \
                        not used, the flash of the parameters is worn out, 9800 targets refused (wheel front left: the Speed target is \
                        infinite or NaN); bus 1 ";
        assert!(status.to_string().starts_with(expected), "{status}");
        let expected = "; ticks take 7740 of 120000 cycles (6.4 %), at most 11772";
        assert!(status.to_string().ends_with(expected), "{status}");
    }
}
