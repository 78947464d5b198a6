//! The signals that every robot has: those of its motors, buses and lines, and of itself.

use rc10_link::{Bits, Tell, Topic};
use rc10_motor::embassy::{BusStatus, MotorPort, Rs485Status};
use rc10_motor::{MotorStatus, TargetKind};

use super::RobotView;
use super::own::{count as count_of, nth};
use crate::seen::{Field, Seen, Whole};

/// Buses and lines are counted from 1.
const NUMBERS: [&str; 9] = ["1", "2", "3", "4", "5", "6", "7", "8", "9"];

/// A motor, a bus, a line, the robot as a whole: each has this many numbers, not all in use. So its
/// signals are those of one word of [`Bits`](rc10_link::Bits).
const EACH: u16 = 32;

const _: () = {
    let most = EACH as usize;
    assert!(MotorStatus::FIELDS.len() <= most && BusStatus::FIELDS.len() <= most);
    assert!(Rs485Status::FIELDS.len() <= most && Whole::FIELDS.len() <= most);
};

/// A number of motors, or of their parameters.
#[expect(clippy::cast_possible_truncation, reason = "there are fewer: `RobotView::new` asserts it")]
pub(super) const fn short(count: usize) -> u16 {
    count as u16
}

impl RobotView<'_> {
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
pub(super) fn signals(robot: &RobotView<'_>) -> u16 {
    robot.own_signals() + count_of(|see| robot.own.signals(see))
}

/// A signal in words; without a name if no signal has this number.
pub(super) fn signal<'r>(index: u16, robot: &RobotView<'r>) -> Tell<'r> {
    let nothing = Topic { folder: "", label: "" };
    let none = Tell::Signal { index, topic: nothing, name: "", unit: "", states: "" };
    let told = |folder, label, table: &[Field]| match table.get(usize::from(index % EACH)) {
        Some(field) => {
            let (unit, states) = field.unit_and_states();
            Tell::Signal { index, topic: Topic { folder, label }, name: field.name, unit, states }
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
        return match told("motors", slot.label, MotorStatus::FIELDS) {
            Tell::Signal { index, topic, name: name @ "effort", states, .. } => {
                Tell::Signal { index, topic, name, unit: unit_of_effort(at, robot), states }
            }
            other => other,
        };
    }
    at -= robot.slots.len();
    if at < robot.buses.len() {
        return told("buses", NUMBERS.get(at).unwrap_or(&""), BusStatus::FIELDS);
    }
    at -= robot.buses.len();
    if at < robot.lines.len() {
        return told("lines", NUMBERS.get(at).unwrap_or(&""), Rs485Status::FIELDS);
    }
    told("robot", "", Whole::FIELDS)
}

/// The unit of a motor's effort, as its loops have it; none where no loops run here.
fn unit_of_effort(motor: usize, robot: &RobotView<'_>) -> &'static str {
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

/// Writes the numbers of something that are wanted.
#[inline]
fn take(wanted: u32, room: &mut Room<'_>, seen: &impl Seen) {
    let mut left = wanted;
    while left != 0 {
        let at = left.trailing_zeros() as usize;
        left &= left - 1;
        put(seen.short(at), room);
    }
}

/// Writes the values of these signals now; returns how many.
pub(super) fn sample(wanted: &Bits, robot: &RobotView<'_>, room: &mut [[u8; 4]]) -> usize {
    let whole = room.len();
    let room = &mut room.iter_mut();
    let mut words = (0..).map(|at| wanted.word(at));
    for (motor, word) in robot.motors.iter().zip(&mut words) {
        if word != 0 {
            motor.look(|status| take(word, room, status));
        }
    }
    for (bus, word) in robot.buses.iter().zip(&mut words) {
        if word != 0 {
            take(word, room, &bus.status());
        }
    }
    for (line, word) in robot.lines.iter().zip(&mut words) {
        if word != 0 {
            take(word, room, &line.status());
        }
    }
    if let Some(word) = words.next().filter(|word| *word != 0) {
        take(word, room, &robot.whole());
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

impl RobotView<'_> {
    /// Looks at the robot as a whole, now.
    pub fn whole(&self) -> Whole {
        let refused = |motor: &MotorPort<'_>| motor.status().counters.refused.total();
        Whole {
            arm: Some(self.switch.state()),
            remote: self.remote.read().map(|it| it.value).unwrap_or_default(),
            link: self.remote_link.read().map(|it| it.value),
            heard: self.remote_reception.read(),
            cycles: self.cycles.and_then(|it| it.read()).map(|it| it.mean),
            refused: self.motors.iter().map(refused).fold(0, u32::wrapping_add),
            not_at_rest: self.not_at_rest.read().and_then(|it| it.value),
        }
    }
}
