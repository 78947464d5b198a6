//! The signals that every robot has, as tables: a line is a signal of each motor, bus or line.

use heapless::Vec;
use rc10_app::angle::shortest_way_degrees;
use rc10_can::Timing;
use rc10_link::frame::{AROUND, BODY};
use rc10_link::{Bits, SIGNALS, Tell, Topic};
use rc10_module::remote::{Remote, RemoteLink};
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_motor::{ArmState, Fault, MotorStatus, Names, Target};

use super::Live;
use crate::common::Common;

/// A signal of a `T`.
struct Field<T> {
    name: &'static str,
    unit: &'static str,
    /// Names of its values, if it is a state.
    states: &'static str,
    get: fn(&T) -> f32,
}

const fn number<T>(name: &'static str, unit: &'static str, get: fn(&T) -> f32) -> Field<T> {
    Field { name, unit, states: "", get }
}

const fn state<T>(name: &'static str, states: &'static str, get: fn(&T) -> f32) -> Field<T> {
    Field { name, unit: "", states, get }
}

/// Whole numbers up to 2^24 are exact; counters begin again there, so that their steps stay whole.
#[expect(clippy::cast_precision_loss, reason = "of 24 bits there is none")]
const fn count(count: u32) -> f32 {
    (count & 0x00FF_FFFF) as f32
}

/// Beyond that it is only shown.
#[expect(clippy::cast_precision_loss, reason = "seven digits are enough for a person")]
const fn rough(value: u64) -> f32 {
    value as f32
}

fn known(value: Option<f32>) -> f32 {
    value.unwrap_or(f32::NAN)
}

fn longest(timing: Timing) -> f32 {
    known(timing.max().map(|max| rough(max.into())))
}

const TARGETS: &str = "Coast,Current,Duty,Speed,Angle,TotalAngle,Torque,Impedance,Brake,Handbrake";
const LINKS: &str = "NeverSeen,Online,Lost";
const DRIVES: &str = "Off,Coast,Brake,Hold,Run";
const CONDITIONS: &str = "Ready,Starting,Unregulated,SlowFeedback,NoReports,NotFollowing";
const ARMS: &str = "Disarmed,Armed,Suspended,EStopped";
const ERRORS: &str = "Active,Warning,Passive,BusOff";
const REMOTES: &str = "Online,Interrupted,Lost";

const MOTOR: &[Field<MotorStatus>] = &[
    number("target", "", target),
    number("measured", "", measured),
    number("speed", "rpm", |it| it.feedback.speed.get()),
    number("total_angle", "deg", |it| it.feedback.total_angle.degrees().get()),
    number("current", "A", |it| known(it.feedback.current().map(|it| it.get()))),
    number("torque", "N m", |it| known(it.feedback.torque().map(|it| it.get()))),
    number("temperature", "°C", |it| known(it.feedback.temperature().map(|it| it.get()))),
    number("controller_temperature", "°C", |it| {
        known(it.feedback.controller_temperature().map(|it| it.get()))
    }),
    number("supply", "V", |it| known(it.feedback.supply().map(|it| it.get()))),
    state("target_kind", TARGETS, |it| f32::from(it.target.kind() as u8)),
    state("link", LINKS, |it| f32::from(it.link as u8)),
    state("drive", DRIVES, |it| f32::from(it.drive as u8)),
    state("condition", CONDITIONS, |it| f32::from(it.condition as u8)),
    number("fault", "", |it| known(it.fault.map(|Fault { code, .. }| count(code)))),
    number("received", "frames", |it| count(it.counters.received)),
    number("malformed", "frames", |it| count(it.counters.malformed)),
    number("lost", "times", |it| count(it.counters.lost)),
    number("expired", "times", |it| count(it.counters.expired)),
    number("turn_gaps", "times", |it| count(it.feedback.turn_gaps)),
];

/// What it is to do, in rpm or degrees, or as an effort.
fn target(status: &MotorStatus) -> f32 {
    match status.target {
        Target::Speed(it) => it.get(),
        Target::Angle(it) => it.get(),
        Target::TotalAngle(it) => it.degrees().get(),
        Target::Impedance(it) => it.angle.get(),
        Target::Current(it) | Target::Brake(it) | Target::Handbrake(it) => it.get(),
        Target::Duty(it) => it,
        Target::Torque(it) => it.get(),
        _ => f32::NAN,
    }
}

/// The same as measured: next to the target, also across the end of a turn.
fn measured(status: &MotorStatus) -> f32 {
    let feedback = &status.feedback;
    match status.target {
        Target::Angle(wanted) => {
            let way = shortest_way_degrees(wanted, feedback.angle).get();
            if way.is_finite() { wanted.get() + way } else { feedback.angle.get() }
        }
        Target::TotalAngle(_) | Target::Impedance(_) => feedback.total_angle.degrees().get(),
        Target::Current(_) | Target::Brake(_) | Target::Handbrake(_) => {
            known(feedback.current().map(|it| it.get()))
        }
        Target::Torque(_) => known(feedback.torque().map(|it| it.get())),
        _ => feedback.speed.get(),
    }
}

const BUS: &[Field<BusStatus>] = &[
    state("state", ERRORS, |it| f32::from(it.health.state as u8)),
    number("planned_typical", "%", |it| it.load.typical),
    number("ticks", "ticks", |it| count(it.ticks)),
    number("overruns", "ticks", |it| count(it.overruns)),
    number("submitted", "frames", |it| count(it.submitted)),
    number("replaced", "frames", |it| count(it.replaced)),
    number("refused", "frames", |it| count(it.refused)),
    number("received", "frames", |it| count(it.received.received)),
    number("malformed", "frames", |it| count(it.received.malformed)),
    number("unclaimed", "frames", |it| count(it.received.unclaimed)),
    number("receive_lost", "frames", |it| count(it.health.receive_lost)),
    number("transmit_lost", "frames", |it| count(it.health.transmit_lost)),
    number("transmit_errors", "", |it| f32::from(it.health.transmit_errors)),
    number("receive_errors", "", |it| f32::from(it.health.receive_errors)),
    number("bus_offs", "times", |it| count(it.health.bus_offs)),
    number("stalls", "times", |it| count(it.health.stalls)),
    number("execution_max", "us", |it| longest(it.execution)),
    number("period_max", "us", |it| longest(it.period)),
];

const LINE: &[Field<Rs485Status>] = &[
    number("overruns", "ticks", |it| count(it.overruns)),
    number("port_errors", "times", |it| count(it.port_errors)),
    number("exchanges", "times", |it| count(it.traffic.exchanges)),
    number("timeouts", "times", |it| count(it.traffic.timeouts)),
    number("crc_errors", "replies", |it| count(it.traffic.crc_errors)),
    number("exchange_max", "us", |it| longest(it.traffic.exchange)),
    number("cycle_max", "us", |it| longest(it.traffic.cycle)),
];

/// The robot as a whole, now.
struct Whole {
    arm: ArmState,
    remote: Remote,
    link: Option<RemoteLink>,
    remote_frames: u32,
    remote_damaged: u32,
    cycles: Option<u32>,
    refused: u32,
}

const ROBOT: &[Field<Whole>] = &[
    state("arm", ARMS, |it| f32::from(it.arm as u8)),
    state("remote", REMOTES, |it| known(it.link.map(|it| f32::from(it as u8)))),
    number("remote_frames", "frames", |it| count(it.remote_frames)),
    number("remote_damaged", "frames", |it| count(it.remote_damaged)),
    number("left_x", "", |it| it.remote.left.x),
    number("left_y", "", |it| it.remote.left.y),
    number("right_x", "", |it| it.remote.right.x),
    number("right_y", "", |it| it.remote.right.y),
    number("dial", "", |it| it.remote.dial),
    number("tick_cycles", "cycles", |it| known(it.cycles.map(count))),
    number("refused", "targets", |it| count(it.refused)),
];

/// Buses and lines are counted from 1.
const NUMBERS: [&str; 9] = ["1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// So many signals fit into a word of [`Bits`].
const _: () =
    assert!(MOTOR.len() <= 32 && BUS.len() <= 32 && LINE.len() <= 32 && ROBOT.len() <= 32);

const fn size<T>(fields: &[Field<T>]) -> u16 {
    fields.len() as u16
}

/// Numbers of the first signal of buses, lines, the robot, and its own; motors come first.
const fn firsts<N: Names, const BUSES: usize, const LINES: usize>() -> [u16; 4] {
    let buses = N::ALL.len() as u16 * size(MOTOR);
    let lines = buses + BUSES as u16 * size(BUS);
    let robot = lines + LINES as u16 * size(LINE);
    let own = robot + size(ROBOT);
    assert!(own as usize <= SIGNALS, "the robot has more signals than a link can tell apart");
    assert!(BUSES <= NUMBERS.len() && LINES <= NUMBERS.len());
    [buses, lines, robot, own]
}

/// The number of its signals.
pub(super) fn signals<N: Names, const BUSES: usize, const LINES: usize>(own: &impl Live) -> u16 {
    let [.., first] = const { firsts::<N, BUSES, LINES>() };
    first + own.signals().count() as u16
}

/// A signal in words; `None` if there is none with this number.
pub(super) fn signal<N: Names, const BUSES: usize, const LINES: usize>(
    index: u16,
    own: &impl Live,
) -> Option<Tell<'static>> {
    fn told<T>(
        index: u16,
        folder: &'static str,
        label: &'static str,
        field: &Field<T>,
    ) -> Tell<'static> {
        let &Field { name, unit, states, .. } = field;
        Tell::Signal { index, topic: Topic { folder, label }, name, unit, states }
    }
    /// Of each thing in a folder the same.
    fn of<T>(
        index: u16,
        first: u16,
        fields: &'static [Field<T>],
    ) -> Option<(usize, &'static Field<T>)> {
        let at = index.checked_sub(first)?;
        Some((usize::from(at / size(fields)), fields.get(usize::from(at % size(fields)))?))
    }
    let [buses, lines, robot, first] = const { firsts::<N, BUSES, LINES>() };
    Some(if index < buses {
        let (motor, field) = of(index, 0, MOTOR)?;
        told(index, "motors", N::ALL.get(motor)?.label(), field)
    } else if index < lines {
        let (bus, field) = of(index, buses, BUS)?;
        told(index, "buses", NUMBERS.get(bus)?, field)
    } else if index < robot {
        let (line, field) = of(index, lines, LINE)?;
        told(index, "lines", NUMBERS.get(line)?, field)
    } else if index < first {
        told(index, "robot", "", of(index, robot, ROBOT)?.1)
    } else {
        let signal = own.signals().nth(usize::from(index - first))?;
        let topic = Topic { folder: "signals", label: signal.label };
        Tell::Signal { index, topic, name: "value", unit: signal.unit, states: "" }
    })
}

/// A sample's body.
type Body = Vec<u8, { BODY + AROUND }>;

#[inline]
fn put(body: &mut Body, value: f32) {
    // A PC that asks for more than a frame holds gets as many as fit.
    if body.len() + 4 <= 4 + BODY {
        let _ = body.extend_from_slice(&value.to_le_bytes());
    }
}

#[inline]
fn take<T>(wanted: u32, fields: &[Field<T>], it: &T, body: &mut Body) {
    let mut left = wanted;
    while left != 0 {
        let at = left.trailing_zeros() as usize;
        left &= left - 1;
        // The bits behind the last field are those of the next motor.
        let Some(field) = fields.get(at) else { break };
        put(body, (field.get)(it));
    }
}

/// The values of these signals now.
pub(super) fn sample<N: Names, const BUSES: usize, const LINES: usize>(
    wanted: &Bits,
    shared: &Common<'_, N, BUSES, LINES>,
    own: &impl Live,
    body: &mut Body,
) {
    let [buses, lines, robot, first] = const { firsts::<N, BUSES, LINES>() };
    let has = |wanted: u32, size: u16| wanted & (u32::MAX >> (32 - size)) != 0;
    let mut at = 0;
    for name in N::ALL {
        let word = wanted.word(at);
        at += size(MOTOR);
        if has(word, size(MOTOR)) {
            shared.motor(*name).look(|status| take(word, MOTOR, status, body));
        }
    }
    at = buses;
    for bus in &shared.ports.buses {
        let word = wanted.word(at);
        at += size(BUS);
        if has(word, size(BUS)) {
            take(word, BUS, &bus.status(), body);
        }
    }
    at = lines;
    for line in &shared.ports.lines {
        let word = wanted.word(at);
        at += size(LINE);
        if has(word, size(LINE)) {
            take(word, LINE, &line.status(), body);
        }
    }
    let word = wanted.word(robot);
    if has(word, size(ROBOT)) {
        take(word, ROBOT, &Whole::of(shared), body);
    }
    for (index, signal) in (first..).zip(own.signals()) {
        if wanted.contains(index) {
            put(body, signal.get());
        }
    }
}

impl Whole {
    fn of<N: Names, const BUSES: usize, const LINES: usize>(
        shared: &Common<'_, N, BUSES, LINES>,
    ) -> Self {
        let counters = shared.remote_reception.read();
        let refused = |name: &N| shared.motor(*name).status().counters.refused.total();
        Self {
            arm: shared.switch.state(),
            remote: shared.remote.read().map(|it| it.value).unwrap_or_default(),
            link: shared.remote_link.read().map(|it| it.value),
            remote_frames: counters.frames,
            remote_damaged: counters.damaged,
            cycles: shared.bus_cycles.and_then(|it| it.read()).map(|it| it.mean),
            refused: N::ALL.iter().map(refused).fold(0, u32::wrapping_add),
        }
    }
}
