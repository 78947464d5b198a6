//! The signals that every robot has, as tables: a line is a signal of each motor, bus or line.

use rc10_app::TotalAngle;
use rc10_app::angle::shortest_way_degrees;
use rc10_can::Timing;
use rc10_link::{Bits, Tell, Topic};
use rc10_module::remote::{Remote, RemoteLink};
use rc10_motor::embassy::{BusStatus, MotorPort, Rs485Status};
use rc10_motor::{ArmState, Fault, Motion, MotorStatus, Target, TargetKind};

use super::Robot;
use super::own::{count as count_of, nth};
use crate::arming::Axis;

/// A signal of something: what it is called, and what it is told in.
struct Field {
    name: &'static str,
    unit: &'static str,
    /// Names of its values, if it is a state.
    states: &'static str,
}

/// The signals of a type, in a table of what they are called and a function of their values: by a jump
/// to each, which takes half the instructions of a call.
macro_rules! signals {
    ($table:ident, $value:ident: $Of:ty {
        $($name:ident: $unit:literal $(of $states:expr)? => |$it:ident| $get:expr;)*
    }) => {
        const $table: &[Field] = &[$(Field {
            name: stringify!($name),
            unit: $unit,
            states: first([$($states,)? ""]),
        }),*];

        #[inline(never)] // Inlined, all values are computed, and one is taken.
        fn $value(at: usize, it: &$Of) -> f32 {
            #[allow(non_camel_case_types, reason = "called as the signals are")]
            enum Number { $($name),* }
            match at {
                $(at if at == Number::$name as usize => { let $it = it; $get })*
                _ => f32::NAN,
            }
        }
    };
}

const fn first<const N: usize>(texts: [&'static str; N]) -> &'static str {
    texts[0]
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

const LINKS: &str = "NeverSeen,Online,Lost";
const DRIVES: &str = "Off,Coast,Brake,Hold,Run";
const CONDITIONS: &str = "Ready,Starting,Unregulated,SlowFeedback,NoReports,NotFollowing";
const ARMS: &str = "Disarmed,Armed,Suspended,EStopped";
const ERRORS: &str = "Active,Warning,Passive,BusOff";
const STICKS: &str = "all,left x,left y,right x,right y,dial";
const REMOTES: &str = "Online,Interrupted,Lost";

signals!(MOTOR, of_motor: MotorStatus {
    target: "rpm or deg" => |it| target(it);
    measured: "rpm or deg" => |it| measured(it);
    speed: "rpm" => |it| it.feedback.speed.get();
    total_angle: "deg" => |it| degrees(it.feedback.total_angle);
    current: "A" => |it| it.feedback.readings()[0];
    torque: "N m" => |it| it.feedback.readings()[1];
    effort: "" => |it| known(it.effort());
    temperature: "°C" => |it| it.feedback.readings()[2];
    controller_temperature: "°C" => |it| it.feedback.readings()[3];
    supply: "V" => |it| it.feedback.readings()[4];
    target_kind: "" of TargetKind::NAMES => |it| f32::from(it.target.kind() as u8);
    link: "" of LINKS => |it| f32::from(it.link as u8);
    drive: "" of DRIVES => |it| f32::from(it.drive as u8);
    condition: "" of CONDITIONS => |it| f32::from(it.condition as u8);
    fault: "" => |it| known(it.fault.map(|Fault { code, .. }| count(code)));
    received: "frames" => |it| count(it.counters.received);
    malformed: "frames" => |it| count(it.counters.malformed);
    lost: "times" => |it| count(it.counters.lost);
    expired: "times" => |it| count(it.counters.expired);
    turn_gaps: "times" => |it| count(it.feedback.turn_gaps);
});

/// An angle in degrees, to seven digits, by way of its halves: a conversion of 64 bits takes 60
/// instructions.
#[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "it is in halves")]
fn degrees(angle: TotalAngle) -> f32 {
    let microdegrees = angle.microdegrees();
    let (high, low) = ((microdegrees >> 32) as i32, microdegrees as u32);
    (high as f32 * 4_294_967_296.0 + low as f32) * 1e-6
}

/// What it is to do, in rpm or degrees, or as an effort.
fn target(status: &MotorStatus) -> f32 {
    match status.target {
        Target::Speed(it) => it.get(),
        Target::Angle(it) => it.get(),
        Target::TotalAngle(it) => degrees(it),
        Target::Impedance(it) => it.angle.get(),
        Target::Motion(it) => it.angle.map_or(it.speed.get(), degrees),
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
        Target::TotalAngle(_)
        | Target::Impedance(_)
        | Target::Motion(Motion { angle: Some(_), .. }) => degrees(feedback.total_angle),
        Target::Current(_) | Target::Brake(_) | Target::Handbrake(_) => {
            known(feedback.current().map(|it| it.get()))
        }
        Target::Torque(_) => known(feedback.torque().map(|it| it.get())),
        _ => feedback.speed.get(),
    }
}

signals!(BUS, of_bus: BusStatus {
    state: "" of ERRORS => |it| f32::from(it.health.state as u8);
    planned_least: "%" => |it| it.load.least;
    planned_typical: "%" => |it| it.load.typical;
    planned_worst: "%" => |it| it.load.worst;
    ticks: "ticks" => |it| count(it.ticks);
    overruns: "ticks" => |it| count(it.overruns);
    submitted: "frames" => |it| count(it.submitted);
    replaced: "frames" => |it| count(it.replaced);
    refused: "frames" => |it| count(it.refused);
    received: "frames" => |it| count(it.received.received);
    malformed: "frames" => |it| count(it.received.malformed);
    unclaimed: "frames" => |it| count(it.received.unclaimed);
    receive_lost: "frames" => |it| count(it.health.receive_lost);
    transmit_lost: "frames" => |it| count(it.health.transmit_lost);
    transmit_errors: "" => |it| f32::from(it.health.transmit_errors);
    receive_errors: "" => |it| f32::from(it.health.receive_errors);
    bus_offs: "times" => |it| count(it.health.bus_offs);
    stalls: "times" => |it| count(it.health.stalls);
    execution_max: "us" => |it| longest(it.execution);
    period_max: "us" => |it| longest(it.period);
});

signals!(LINE, of_line: Rs485Status {
    overruns: "ticks" => |it| count(it.overruns);
    port_errors: "times" => |it| count(it.port_errors);
    exchanges: "times" => |it| count(it.traffic.exchanges);
    timeouts: "times" => |it| count(it.traffic.timeouts);
    crc_errors: "replies" => |it| count(it.traffic.crc_errors);
    exchange_max: "us" => |it| longest(it.traffic.exchange);
    cycle_max: "us" => |it| longest(it.traffic.cycle);
});

/// The robot as a whole, now.
struct Whole {
    arm: ArmState,
    remote: Remote,
    link: Option<RemoteLink>,
    remote_frames: u32,
    remote_damaged: u32,
    cycles: Option<u32>,
    refused: u32,
    not_at_rest: Option<Axis>,
}

signals!(ROBOT, of_robot: Whole {
    arm: "" of ARMS => |it| f32::from(it.arm as u8);
    remote: "" of REMOTES => |it| known(it.link.map(|it| f32::from(it as u8)));
    remote_frames: "frames" => |it| count(it.remote_frames);
    remote_damaged: "frames" => |it| count(it.remote_damaged);
    left_x: "" => |it| it.remote.left.x;
    left_y: "" => |it| it.remote.left.y;
    right_x: "" => |it| it.remote.right.x;
    right_y: "" => |it| it.remote.right.y;
    dial: "" => |it| it.remote.dial;
    tick_cycles: "cycles" => |it| known(it.cycles.map(count));
    refused: "targets" => |it| count(it.refused);
    not_at_rest: "" of STICKS => |it| it.not_at_rest.map_or(0.0, |axis| f32::from(axis as u8 + 1));
});

/// Buses and lines are counted from 1.
const NUMBERS: [&str; 9] = ["1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// A motor, a bus, a line, the robot as a whole: each has this many numbers, not all in use. So its
/// signals are those of one word of [`Bits`](rc10_link::Bits).
const EACH: u16 = 32;

const _: () = {
    let most = EACH as usize;
    assert!(MOTOR.len() <= most && BUS.len() <= most && LINE.len() <= most && ROBOT.len() <= most);
};

/// A number of motors, or of their parameters.
#[expect(clippy::cast_possible_truncation, reason = "there are fewer: `Robot::new` asserts it")]
pub(super) const fn short(count: usize) -> u16 {
    count as u16
}

impl Robot<'_> {
    /// The number of the first signal of its own.
    fn own_signals(&self) -> u16 {
        EACH * short(self.motors.len() + self.buses.len() + self.lines.len() + 1)
    }
}

/// The number of signals of a robot without any of its own.
pub(super) const fn signals_of(motors: usize, buses: usize, lines: usize) -> usize {
    EACH as usize * (motors + buses + lines + 1)
}

/// The number of its signals, those included that are not there.
pub(super) fn signals(robot: &Robot<'_>) -> u16 {
    robot.own_signals() + count_of(|see| robot.own.signals(see))
}

/// A signal in words; one without a name if there is none with this number.
pub(super) fn signal<'r>(index: u16, robot: &Robot<'r>) -> Tell<'r> {
    let nothing = Topic { folder: "", label: "" };
    let none = Tell::Signal { index, topic: nothing, name: "", unit: "", states: "" };
    let told = |folder, label, table: &[Field]| match table.get(usize::from(index % EACH)) {
        Some(&Field { name, unit, states }) => {
            Tell::Signal { index, topic: Topic { folder, label }, name, unit, states }
        }
        None => none,
    };
    if let Some(own) = index.checked_sub(robot.own_signals()) {
        return nth(own, |see| robot.own.signals(see)).map_or(none, |signal| {
            let topic = Topic { folder: "signals", label: signal.label };
            Tell::Signal { index, topic, name: "value", unit: signal.unit, states: signal.states }
        });
    }
    let mut at = usize::from(index / EACH);
    if let Some(slot) = robot.slots.get(at) {
        return match told("motors", slot.label, MOTOR) {
            Tell::Signal { index, topic, name: name @ "effort", states, .. } => {
                Tell::Signal { index, topic, name, unit: unit_of_effort(at, robot), states }
            }
            other => other,
        };
    }
    at -= robot.slots.len();
    if at < robot.buses.len() {
        return told("buses", NUMBERS.get(at).unwrap_or(&""), BUS);
    }
    at -= robot.buses.len();
    if at < robot.lines.len() {
        return told("lines", NUMBERS.get(at).unwrap_or(&""), LINE);
    }
    told("robot", "", ROBOT)
}

/// The unit of a motor's effort, as its loops have it; none where no loops run here.
fn unit_of_effort(motor: usize, robot: &Robot<'_>) -> &'static str {
    match robot.motors.get(motor).and_then(MotorPort::tuning).map(|[it, _]| it.effort) {
        Some(TargetKind::Current) => "A",
        Some(TargetKind::Torque) => "N m",
        Some(_) => "of full voltage",
        None => "",
    }
}

/// Where values go.
type Room<'b> = core::slice::IterMut<'b, [u8; 4]>;

#[inline]
fn put(value: f32, room: &mut Room<'_>) {
    // A PC that asks for more than a frame holds gets as many as fit.
    if let Some(place) = room.next() {
        *place = value.to_le_bytes();
    }
}

/// The values of those that are wanted.
#[inline]
fn take(wanted: u32, room: &mut Room<'_>, value: impl Fn(usize) -> f32) {
    let mut left = wanted;
    while left != 0 {
        let at = left.trailing_zeros() as usize;
        left &= left - 1;
        put(value(at), room);
    }
}

/// Writes the values of these signals now; returns how many.
pub(super) fn sample(wanted: &Bits, robot: &Robot<'_>, room: &mut [[u8; 4]]) -> usize {
    let whole = room.len();
    let room = &mut room.iter_mut();
    let mut words = (0..).map(|at| wanted.word(at));
    for (motor, word) in robot.motors.iter().zip(&mut words) {
        if word != 0 {
            motor.look(|status| take(word, room, |at| of_motor(at, status)));
        }
    }
    for (bus, word) in robot.buses.iter().zip(&mut words) {
        if word != 0 {
            let status = bus.status();
            take(word, room, |at| of_bus(at, &status));
        }
    }
    for (line, word) in robot.lines.iter().zip(&mut words) {
        if word != 0 {
            let status = line.status();
            take(word, room, |at| of_line(at, &status));
        }
    }
    if let Some(word) = words.next().filter(|word| *word != 0) {
        let now = Whole::of(robot);
        take(word, room, |at| of_robot(at, &now));
    }
    if !wanted.is_below(robot.own_signals()) {
        let mut index = robot.own_signals();
        robot.own.signals(&mut |signal| {
            if wanted.contains(index) {
                put(signal.get(), room);
            }
            index += 1;
        });
    }
    whole - room.len()
}

impl Whole {
    fn of(robot: &Robot<'_>) -> Self {
        let counters = robot.remote_reception.read();
        let refused = |motor: &MotorPort<'_>| motor.status().counters.refused.total();
        Self {
            arm: robot.switch.state(),
            remote: robot.remote.read().map(|it| it.value).unwrap_or_default(),
            link: robot.remote_link.read().map(|it| it.value),
            remote_frames: counters.frames,
            remote_damaged: counters.damaged,
            cycles: robot.cycles.and_then(|it| it.read()).map(|it| it.mean),
            refused: robot.motors.iter().map(refused).fold(0, u32::wrapping_add),
            not_at_rest: robot.not_at_rest.read().and_then(|it| it.value),
        }
    }
}
