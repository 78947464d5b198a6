//! What can be seen of a motor, a bus, a line, a part and the robot: a table of each, which the robot,
//! the live page, records and CSV files read.
//!
//! A line of a table is a number: its name, its unit, a few words, and its place. [`seen!`](crate::seen!)
//! makes a table.

use rc10_app::angle::shortest_way_degrees;
use rc10_app::{Amps, Celsius, Degrees, NewtonMetres, Rpm, TotalAngle, Volts};
use rc10_can::ErrorState;
use rc10_module::Counters;
use rc10_module::remote::{Remote, RemoteLink};
use rc10_motor::embassy::{BusStatus, Rs485Status};
use rc10_motor::{
    ArmState, Condition, DriveMode, Fault, Link, Motion, MotorStatus, Target, TargetKind,
};
use rc10_time::{Micros, Timing};

use crate::arming::Axis;

/// A number that can be seen of something, as a robot tells of it.
pub struct Field {
    /// Name of the number, in small letters.
    pub name: &'static str,
    /// Its unit, or the names of its states: one text takes less flash than two.
    note: &'static str,
}

impl Field {
    #[doc(hidden)]
    pub const fn new(name: &'static str, unit: &'static str, states: &'static str) -> Self {
        Self { name, note: if states.is_empty() { unit } else { states } }
    }

    /// Unit of the number, or the names of its values from 0 on, with commas between, if it is a state.
    /// Empty if it has no such text.
    #[inline(never)] // For its size.
    #[must_use]
    pub fn unit_and_states(&self) -> (&'static str, &'static str) {
        if self.note.as_bytes().contains(&b',') { ("", self.note) } else { (self.note, "") }
    }
}

/// Something of which numbers can be seen.
pub trait Seen {
    /// The numbers of the type.
    const FIELDS: &'static [Field];
    /// A few words on each.
    const ABOUT: &'static [&'static str];
    /// Which of them count since power-on.
    const COUNTS: &'static [bool];

    /// Returns a number as a link sends it: rounded to 32 bits, counters by their low 24. NaN for a
    /// missing value.
    fn short(&self, at: usize) -> f32;
    /// Returns a number as it is.
    fn exact(&self, at: usize) -> f64;
    /// Puts a number back. One that is computed stays as it is.
    fn put(&mut self, at: usize, number: f64);
}

/// A value that is a number to be seen.
pub trait Value: Copy {
    /// Names of its values, if it is a state.
    const STATES: &'static str = "";
    /// Whether the number counts since power-on.
    const COUNTS: bool = false;

    /// Returns it as a link tells it.
    fn short(self) -> f32;
    /// Returns it as it is.
    fn exact(self) -> f64 {
        self.short().into()
    }
    /// Makes it of a number: the nearest that there is.
    fn of(number: f64) -> Self;
}

/// Makes a [`Value`] of a type: by its link's number, its exact one, and back.
macro_rules! value {
    ($Type:ident $([$const:ident = $is:expr])*: |$it:ident| $short:expr, $exact:expr; |$number:ident| $of:expr) => {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_precision_loss,
            clippy::cast_sign_loss,
            reason = "a number becomes the nearest that there is"
        )]
        impl Value for $Type {
            $(const $const: value!(@ $const) = $is;)*
            fn short(self) -> f32 {
                let $it = self;
                $short
            }
            fn exact(self) -> f64 {
                let $it = self;
                $exact
            }
            fn of($number: f64) -> Self {
                $of
            }
        }
    };
    (@ STATES) => { &'static str };
    (@ COUNTS) => { bool };
}

value!(f32: |it| it, it.into(); |number| number as Self);
value!(f64: |it| it as f32, it; |number| number);
value!(u8: |it| it.into(), it.into(); |number| number as Self);
value!(bool: |it| f32::from(u8::from(it)), f64::from(u8::from(it)); |number| number > 0.0);
// Whole numbers up to 2^24 are exact; counters begin again there, so that their steps stay whole.
value!(u32 [COUNTS = true]: |it| (it & 0x00FF_FFFF) as f32, it.into(); |number| number as Self);
// Beyond that it is only shown.
value!(u64 [COUNTS = true]: |it| it as f32, it as f64; |number| number as Self);
// In seconds.
value!(Micros: |it| it.exact() as f32, it.get() as f64 * 1e-6; |number| Self::new((number * 1e6 + 0.5) as u64));
value!(Rpm: |it| it.get(), it.get().into(); |number| Self::new(number as f32));
value!(Amps: |it| it.get(), it.get().into(); |number| Self::new(number as f32));
value!(NewtonMetres: |it| it.get(), it.get().into(); |number| Self::new(number as f32));
value!(Celsius: |it| it.get(), it.get().into(); |number| Self::new(number as f32));
value!(Volts: |it| it.get(), it.get().into(); |number| Self::new(number as f32));
// In degrees: for a link by the halves of its size, for a conversion of 64 bits takes 60 instructions.
value!(TotalAngle: |it| {
    let size = it.microdegrees().unsigned_abs();
    let (high, low) = ((size >> 32) as u32, size as u32);
    let degrees = (high as f32 * 4_294_967_296.0 + low as f32) * 1e-6;
    if it.microdegrees() < 0 { -degrees } else { degrees }
}, it.microdegrees() as f64 * 1e-6; |number| {
    let micro = number * 1e6;
    Self::from_microdegrees((micro + if micro < 0.0 { -0.5 } else { 0.5 }) as i64)
});

impl<T: Value> Value for Option<T> {
    const STATES: &'static str = T::STATES;
    const COUNTS: bool = T::COUNTS;

    fn short(self) -> f32 {
        self.map_or(f32::NAN, T::short)
    }
    fn exact(self) -> f64 {
        self.map_or(f64::NAN, T::exact)
    }
    fn of(number: f64) -> Self {
        (!number.is_nan()).then(|| T::of(number))
    }
}

/// Makes a [`Value`] of each state. A number that no state has is the first.
macro_rules! state_values {
    ($($State:ident),+) => {
        $(value!($State [STATES = Self::NAMES]: |it| (it as u8).into(), (it as u8).into(); |number| {
            Self::ALL.get(number as usize).copied().unwrap_or(Self::ALL[0])
        });)+
    };
}
state_values!(Link, DriveMode, TargetKind, Condition, ArmState, ErrorState, RemoteLink);

/// One of the four numbers of a [`Timing`].
#[derive(Clone, Copy)]
struct Part(u64);
value!(Part: |it| it.0 as f32, it.0 as f64; |number| Self(number as u64));

fn whole(Part(part): Part) -> u32 {
    u32::try_from(part).unwrap_or(u32::MAX)
}

fn part(timing: &Timing, at: usize) -> Part {
    Part(timing.parts()[at])
}

fn set_part(timing: &mut Timing, at: usize, Part(part): Part) {
    let mut parts = timing.parts();
    parts[at] = part;
    *timing = Timing::from_parts(parts);
}

/// An angle, or another number, or none.
#[derive(Clone, Copy)]
enum Wanted {
    Number(f32),
    Angle(TotalAngle),
}
value!(Wanted: |it| match it {
    Self::Number(number) => number,
    Self::Angle(angle) => angle.short(),
}, match it {
    Self::Number(number) => number.into(),
    Self::Angle(angle) => angle.exact(),
}; |number| Self::Number(number as f32));

/// The target, in rpm or degrees, or as an effort.
fn target(status: &MotorStatus) -> Wanted {
    match status.target {
        Target::Speed(it) => Wanted::Number(it.get()),
        Target::Angle(it) => Wanted::Number(it.get()),
        Target::TotalAngle(it) => Wanted::Angle(it),
        Target::Impedance(it) => Wanted::Number(it.angle.get()),
        Target::Motion(it) => it.angle.map_or(Wanted::Number(it.speed.get()), Wanted::Angle),
        Target::Current(it) | Target::Brake(it) | Target::Handbrake(it) => Wanted::Number(it.get()),
        Target::Duty(it) => Wanted::Number(it),
        Target::Torque(it) => Wanted::Number(it.get()),
        _ => Wanted::Number(f32::NAN),
    }
}

/// The angle next to the wanted one, also across the end of a turn.
#[inline(never)] // The other numbers need no registers saved.
fn near(wanted: Degrees, angle: Degrees) -> f32 {
    let way = shortest_way_degrees(wanted, angle).get();
    if way.is_finite() { wanted.get() + way } else { angle.get() }
}

/// The measurement beside the target.
fn measured(status: &MotorStatus) -> Wanted {
    let feedback = &status.feedback;
    match status.target {
        Target::Angle(wanted) => Wanted::Number(near(wanted, feedback.angle)),
        Target::TotalAngle(_)
        | Target::Motion(Motion { angle: Some(_), .. })
        | Target::Impedance(_) => Wanted::Angle(feedback.total_angle),
        Target::Current(_) | Target::Brake(_) | Target::Handbrake(_) => {
            Wanted::Number(feedback.current().short())
        }
        Target::Torque(_) => Wanted::Number(feedback.torque().short()),
        _ => Wanted::Number(feedback.speed.get()),
    }
}

/// Makes the table of a type: implements [`Seen`](crate::seen::Seen) for it. A line has a name, a unit, a
/// few words, and a place in the type, or how to compute it, and how to put it back.
///
/// ```
/// struct Wall {
///     distance: f32,
///     frames: u32,
/// }
/// rc10_tasks::seen!(Wall {
///     distance: "m", "from the sensor to the wall" => .distance;
///     frames: "frames", "good frames" => .frames;
///     is_near: "", "1 if it is nearer than half a metre" => |it| it.distance < 0.5;
/// });
/// use rc10_tasks::seen::Seen;
/// let wall = Wall { distance: 0.25, frames: 7 };
/// assert_eq!((Wall::FIELDS[1].name, wall.exact(1), wall.exact(2)), ("frames", 7.0, 1.0));
/// ```
#[macro_export]
macro_rules! seen {
    (@ $Of:ty, $(.$place:ident)+) => { |it: &$Of| it$(.$place)+ };
    (@ $Of:ty, |$it:ident| $get:expr) => { |$it: &$Of| $get };
    (! $of:expr, $(.$place:ident)+) => { $of$(.$place)+ };
    (! $of:expr, |$it:ident| $get:expr) => {{ let $it = $of; $get }};
    ($Of:ty {
        $($name:ident: $unit:literal, $about:literal =>
            $($(.$place:ident)+)? $(|$it:ident| $get:expr $(, |$to:ident, $number:ident| $set:expr)?)?;)*
    }) => {
        impl $crate::seen::Seen for $Of {
            const FIELDS: &'static [$crate::seen::Field] = {
                const fn states<V: $crate::seen::Value>(_: fn(&$Of) -> V) -> &'static str {
                    V::STATES
                }
                &[$($crate::seen::Field::new(
                    stringify!($name),
                    $unit,
                    states($crate::seen!(@ $Of, $($(.$place)+)? $(|$it| $get)?)),
                )),*]
            };
            const ABOUT: &'static [&'static str] = &[$($about),*];
            const COUNTS: &'static [bool] = {
                const fn counts<V: $crate::seen::Value>(_: fn(&$Of) -> V) -> bool {
                    V::COUNTS
                }
                &[$(counts($crate::seen!(@ $Of, $($(.$place)+)? $(|$it| $get)?))),*]
            };

            // Not inlined: else all values are computed, and one is taken. A jump takes half the
            // instructions of a call.
            #[inline(never)]
            fn short(&self, at: usize) -> f32 {
                #[allow(non_camel_case_types, reason = "called as the numbers are")]
                enum Number { $($name),* }
                match at {
                    $(at if at == Number::$name as usize => {
                        $crate::seen::Value::short($crate::seen!(! self, $($(.$place)+)? $(|$it| $get)?))
                    })*
                    _ => f32::NAN,
                }
            }

            fn exact(&self, at: usize) -> f64 {
                #[allow(non_camel_case_types, reason = "called as the numbers are")]
                enum Number { $($name),* }
                match at {
                    $(at if at == Number::$name as usize => {
                        $crate::seen::Value::exact($crate::seen!(! self, $($(.$place)+)? $(|$it| $get)?))
                    })*
                    _ => f64::NAN,
                }
            }

            fn put(&mut self, at: usize, number: f64) {
                #[allow(non_camel_case_types, reason = "called as the numbers are")]
                enum Number { $($name),* }
                match at {
                    $(at if at == Number::$name as usize => {
                        $(self$(.$place)+ = $crate::seen::Value::of(number);)?
                        $($({
                            let ($to, $number) = (self, $crate::seen::Value::of(number));
                            $set;
                        })?)?
                    })*
                    _ => {}
                }
            }
        }
    };
}

/// Numbers of a [`MotorStatus`] from the first on that are watched often.
pub const OFTEN: usize = 10;

seen!(MotorStatus {
    target_kind: "", "kind of its target" => |it| it.target.kind();
    target: "rpm or deg", "its target, as its kind has it: rpm, degrees, A, N m, or a share" => |it| target(it);
    measured: "rpm or deg", "the same as measured" => |it| measured(it);
    link: "", "whether it is heard" => .link;
    drive: "", "what it does" => .drive;
    effort: "", "effort of its loops, in their unit; NaN while they decide nothing" => |it| it.effort();
    speed: "rpm", "speed by its feedback" => .feedback.speed;
    total_angle: "deg", "angle of the output shaft by its feedback, all turns counted" => .feedback.total_angle;
    current: "A", "current by its feedback" =>
        |it| it.feedback.current(), |to, it| to.feedback = to.feedback.with_current(it);
    torque: "N m", "torque by its feedback" =>
        |it| it.feedback.torque(), |to, it| to.feedback = to.feedback.with_torque(it);
    received: "frames", "good feedback frames" => .counters.received;
    malformed: "frames", "frames with its identifier that were no feedback" => .counters.malformed;
    unasked: "frames", "answers to requests that were not made" => .counters.unasked;
    lost: "times", "times it went from online to lost" => .counters.lost;
    expired: "times", "times its command expired" => .counters.expired;
    refused_unsupported: "targets", "targets of a kind that it does not take" => .counters.refused.unsupported;
    refused_not_finite: "targets", "targets that were infinite or NaN" => .counters.refused.not_finite;
    refused_out_of_range: "targets", "targets out of its range" => .counters.refused.out_of_range;
    condition: "", "whether it does what its target says" => .condition;
    turn_gaps: "times", "times that turns had to be estimated" => .feedback.turn_gaps;
    fault: "", "code of the fault that it reports; NaN without one" =>
        |it| it.fault.map(|fault| fault.code), |to, code| to.fault = Option::map(code, |code| Fault::new(code, ""));
    temperature: "°C", "temperature of the motor" =>
        |it| it.feedback.temperature(), |to, it| to.feedback = to.feedback.with_temperature(it);
    controller_temperature: "°C", "temperature of what drives the motor" =>
        |it| it.feedback.controller_temperature(), |to, it| to.feedback = to.feedback.with_controller_temperature(it);
    supply: "V", "voltage that it is supplied with" =>
        |it| it.feedback.supply(), |to, it| to.feedback = to.feedback.with_supply(it);
});

seen!(BusStatus {
    ticks: "ticks", "ticks of its task" => .ticks;
    overruns: "ticks", "ticks that did not happen" => .overruns;
    submitted: "frames", "frames handed to the port" => .submitted;
    replaced: "frames", "frames replaced before they left" => .replaced;
    refused: "frames", "frames refused" => .refused;
    received: "frames", "frames received" => .received.received;
    malformed: "frames", "frames that were no feedback" => .received.malformed;
    unclaimed: "frames", "frames that no motor claims" => .received.unclaimed;
    last_unclaimed: "", "key of the newest of those" =>
        |it| it.received.last_unclaimed.map(|key| Part(key.into())),
        |to, key| to.received.last_unclaimed = Option::map(key, whole);
    remote_requests: "frames", "remote requests" => .received.remote;
    state: "", "error state of the controller" => .health.state;
    transmit_errors: "", "transmit error counter" => .health.transmit_errors;
    receive_errors: "", "receive error counter" => .health.receive_errors;
    receive_lost: "frames", "received frames lost" => .health.receive_lost;
    transmit_lost: "frames", "frames that never left" => .health.transmit_lost;
    ignored: "frames", "received frames that were not asked for" => .health.ignored;
    bus_offs: "times", "times the controller went off" => .health.bus_offs;
    restrictions: "times", "times it was found unable to send" => .health.restrictions;
    stalls: "times", "times its motors were made safe because it stood still" => .health.stalls;
    planned_frames: "frames/s", "frames a second that its motors need" =>
        |it| Part(it.load.frames_per_second.into()),
        |to, frames| to.load.frames_per_second = whole(frames);
    planned_least: "%", "load by its motors without stuff bits" => .load.least;
    planned_typical: "%", "load by its motors typically" => .load.typical;
    planned_worst: "%", "load by its motors at worst" => .load.worst;
    periods: "", "number of tick periods" => |it| part(&it.period, 0), |to, it| set_part(&mut to.period, 0, it);
    period_min: "us", "the shortest" => |it| part(&it.period, 1), |to, it| set_part(&mut to.period, 1, it);
    period_max: "us", "the longest" => |it| part(&it.period, 2), |to, it| set_part(&mut to.period, 2, it);
    period_sum: "us", "all together" => |it| part(&it.period, 3), |to, it| set_part(&mut to.period, 3, it);
    executions: "", "number of ticks that were measured" =>
        |it| part(&it.execution, 0), |to, it| set_part(&mut to.execution, 0, it);
    execution_min: "us", "the shortest" => |it| part(&it.execution, 1), |to, it| set_part(&mut to.execution, 1, it);
    execution_max: "us", "the longest" => |it| part(&it.execution, 2), |to, it| set_part(&mut to.execution, 2, it);
    execution_sum: "us", "all together" => |it| part(&it.execution, 3), |to, it| set_part(&mut to.execution, 3, it);
});

seen!(Rs485Status {
    ticks: "ticks", "ticks of its task" => .ticks;
    overruns: "ticks", "ticks that did not happen" => .overruns;
    port_errors: "times", "times its UART could not read or write" => .port_errors;
    exchanges: "times", "commands with a reply" => .traffic.exchanges;
    timeouts: "times", "commands without a whole reply in time" => .traffic.timeouts;
    crc_errors: "replies", "replies with a wrong CRC" => .traffic.crc_errors;
    garbage: "bytes", "bytes that were no reply" => .traffic.garbage;
    unexpected: "replies", "replies of a motor that was not polled" => .traffic.unexpected;
    periods: "", "number of tick periods" => |it| part(&it.period, 0), |to, it| set_part(&mut to.period, 0, it);
    period_min: "us", "the shortest" => |it| part(&it.period, 1), |to, it| set_part(&mut to.period, 1, it);
    period_max: "us", "the longest" => |it| part(&it.period, 2), |to, it| set_part(&mut to.period, 2, it);
    period_sum: "us", "all together" => |it| part(&it.period, 3), |to, it| set_part(&mut to.period, 3, it);
    exchange_count: "", "number of exchanges that were measured" =>
        |it| part(&it.traffic.exchange, 0), |to, it| set_part(&mut to.traffic.exchange, 0, it);
    exchange_min: "us", "the shortest" =>
        |it| part(&it.traffic.exchange, 1), |to, it| set_part(&mut to.traffic.exchange, 1, it);
    exchange_max: "us", "the longest" =>
        |it| part(&it.traffic.exchange, 2), |to, it| set_part(&mut to.traffic.exchange, 2, it);
    exchange_sum: "us", "all together" =>
        |it| part(&it.traffic.exchange, 3), |to, it| set_part(&mut to.traffic.exchange, 3, it);
    cycles: "", "number of rounds through its motors" =>
        |it| part(&it.traffic.cycle, 0), |to, it| set_part(&mut to.traffic.cycle, 0, it);
    cycle_min: "us", "the shortest" =>
        |it| part(&it.traffic.cycle, 1), |to, it| set_part(&mut to.traffic.cycle, 1, it);
    cycle_max: "us", "the longest" =>
        |it| part(&it.traffic.cycle, 2), |to, it| set_part(&mut to.traffic.cycle, 2, it);
    cycle_sum: "us", "all together" =>
        |it| part(&it.traffic.cycle, 3), |to, it| set_part(&mut to.traffic.cycle, 3, it);
});

seen!(Counters {
    frames: "frames", "good frames" => .frames;
    damaged: "frames", "frames whose contents were not sound" => .damaged;
    skipped: "bytes", "bytes that belonged to no good frame" => .skipped;
    port_errors: "times", "times that its UART lost or damaged bytes" => .port_errors;
});

/// The robot as a whole, at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Whole {
    /// Whether it is armed, if that is known.
    pub arm: Option<ArmState>,
    /// Newest frame of its remote.
    pub remote: Remote,
    /// State of the link to its remote, once it was heard.
    pub link: Option<RemoteLink>,
    /// Counters of the receiver's frames.
    pub heard: Counters,
    /// Cycles of the core that a tick of the buses takes, on a chip that counts them.
    pub cycles: Option<u32>,
    /// Targets that its motors refused.
    pub refused: u32,
    /// The axis that was not at rest when the remote was to arm the robot.
    pub not_at_rest: Option<Axis>,
}

seen!(Whole {
    arm: "", "whether it is armed" => .arm;
    remote: "", "state of the link to its remote" => .link;
    remote_frames: "frames", "good frames of the remote's receiver" => .heard.frames;
    remote_damaged: "frames", "damaged ones" => .heard.damaged;
    left_x: "", "left stick of the remote, to the right" => .remote.left.x;
    left_y: "", "forward" => .remote.left.y;
    right_x: "", "right stick of the remote, to the right" => .remote.right.x;
    right_y: "", "forward" => .remote.right.y;
    dial: "", "dial of the remote" => .remote.dial;
    tick_cycles: "cycles", "cycles of the core that a tick of the buses takes" => .cycles;
    refused: "targets", "targets that its motors refused" => .refused;
    not_at_rest: "", "what was not at rest when the remote was to arm it" => .not_at_rest;
});

/// 0 if all of it was at rest.
impl Value for Option<Axis> {
    const STATES: &'static str = "all,left x,left y,right x,right y,dial";

    fn short(self) -> f32 {
        self.map_or(0.0, |axis| f32::from(axis as u8 + 1))
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a state's number")]
    fn of(number: f64) -> Self {
        Axis::ALL.get((number as usize).checked_sub(1)?).copied()
    }
}
