//! Whether a declaration can be: the same function when it is compiled and when it runs.

use rc10_app::{ConfigError, Text, ok};
use rc10_can::{EXTENDED_FILTERS, STANDARD_FILTERS};
use rc10_time::Micros;

use super::{Device, Entry, Place, Slot, Wiring};
use crate::bus::MotorBus;
use crate::can_ids::{CanIds, Clash, MotorName};
use crate::load::{BusLoad, LoadSum};
use crate::motors::{AttachError, MotorId};
use crate::plan::{Extra, Plan};
use crate::table::Room;
use crate::unitree::Rs485Bus;

const BITS_PER_SECOND: u32 = 1_000_000;

/// Why a robot cannot be as it is declared.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.text())]
pub struct SetupError {
    /// Label of the motor.
    pub label: &'static str,
    /// Where it is plugged in.
    pub on: Place,
    /// The reason.
    pub why: Unsound,
}

/// The reason why a motor of a declaration is unsound.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Unsound {
    /// A number in its configuration cannot be used.
    Config(ConfigError),
    /// The motor cannot be attached.
    Attach {
        /// Why not.
        error: AttachError,
        /// Label of the motor that is in its way, if there is one.
        with: Option<&'static str>,
    },
    /// Another motor has its label.
    SameLabel,
    /// There is no such bus or line.
    NoSuchPlace,
    /// A motor on CAN cannot be on a line.
    NotOnLine(MotorName),
    /// A motor on RS-485 cannot be on a bus.
    NotOnBus(MotorName),
    /// With it the bus wants more identifiers than its controller's filters let in one by one.
    Filters {
        /// Filters that are needed, for standard or for extended identifiers.
        needed: usize,
        /// Filters that there are.
        room: usize,
    },
    /// With it the motors of the bus need more of it than they may.
    Overload {
        /// Share that they need typically, percent.
        typical: f32,
        /// Share that they may need, percent.
        most: f32,
    },
    /// Its command can arrive later than the next one should leave.
    LateCommand {
        /// The longest time to its end, microseconds; `None`: it has no bound.
        most: Option<u32>,
        /// The time to the next one.
        next: u32,
    },
    /// Its feedback can be older in a command than it may.
    OldFeedback {
        /// The greatest age, microseconds; `None`: it has no bound.
        most: Option<u32>,
        /// The age that it may have.
        allowed: Micros,
    },
    /// The buses or lines that were handed over are not those that are declared, or have motors.
    OtherPlaces,
}

impl SetupError {
    pub(super) const fn new(slot: Option<&Slot>, why: Unsound) -> Self {
        match slot {
            Some(&Slot { label, on, .. }) => Self { label, on, why },
            None => Self { label: "", on: Place::Bus(0), why },
        }
    }

    /// The message, for a `const`, which cannot use [`Display`](core::fmt::Display).
    pub const fn text(&self) -> Text {
        let Self { label, on, ref why } = *self;
        let text = Text::new().push("`").push(label).push("` on ");
        let (sort, number) = sort_and_number(on);
        let text = text.push(sort).push(" ").push_number(number as u64).push(": ");
        match why {
            Unsound::Config(error) => error.add_to(text),
            Unsound::Attach { error, with } => error.add_to(text, *with),
            Unsound::SameLabel => text.push("another motor has this label: give it its own"),
            Unsound::NoSuchPlace => text.push("the robot has no such ").push(sort),
            Unsound::NotOnLine(name) => name.add_to(text).push(" has CAN only: plug it into a bus"),
            Unsound::NotOnBus(name) => {
                name.add_to(text).push(" has RS-485 only: plug it into a line")
            }
            Unsound::Filters { needed, room } => text
                .push("with it the motors of the bus need ")
                .push_number(*needed as u64)
                .push(" receive filters of ")
                .push_number(*room as u64)
                .push(": have it send fewer kinds of frames, or plug it in elsewhere"),
            Unsound::Overload { typical, most } => text
                .push("with it the motors of the bus need ")
                .push_number(whole(*typical + 0.5))
                .push(" % of it typically, more than ")
                .push_number(whole(*most))
                .push(" %")
                .push(ADVICE),
            Unsound::LateCommand { most, next } => {
                let text = text.push("its command can take ");
                let text = match most {
                    Some(most) => text.push_number(*most as u64).push(" us"),
                    None => text.push("any time"),
                };
                text.push(" to arrive, more than the ")
                    .push_number(*next as u64)
                    .push(" us to its next one")
                    .push(ADVICE)
                    .push(", or say by `with_most_age` what it may be")
            }
            Unsound::OldFeedback { most, allowed } => {
                let text = text.push("its feedback can be ");
                let text = match most {
                    Some(most) => text.push_number(*most as u64).push(" us old"),
                    None => text.push("of any age"),
                };
                text.push(" in a command, more than its ")
                    .push_number(allowed.get())
                    .push(" us")
                    .push(ADVICE)
            }
            Unsound::OtherPlaces => {
                text.push("the buses and lines are not those of the declaration, or not empty")
            }
        }
    }
}

const ADVICE: &str = ": set some to send feedback less often, or plug some in elsewhere";

#[expect(clippy::cast_possible_truncation, reason = "percent, for people")]
const fn whole(percent: f32) -> u64 {
    percent as u64
}

const fn sort_and_number(on: Place) -> (&'static str, u8) {
    match on {
        Place::Bus(number) => ("bus", number),
        Place::Line(number) => ("line", number),
    }
}

impl From<AttachError> for Unsound {
    fn from(error: AttachError) -> Self {
        Self::Attach { error, with: None }
    }
}

/// Checks labels, places, configurations, identifiers, receive tables, filters and load of a robot.
/// `buses`: the share of each that its motors may need typically, percent at 1 Mbit/s.
///
/// # Errors
/// The first that is wrong, in the order of the declaration.
pub const fn check(entries: &[Entry<Device>], buses: &[f32], lines: u8) -> Result<(), SetupError> {
    let mut at = 0;
    while at < entries.len() {
        let (earlier, rest) = entries.split_at(at);
        let &Entry { label, on, .. } = &rest[0];
        if let Err(why) = check_entry(&rest[0], earlier, buses, lines) {
            return Err(SetupError { label, on, why });
        }
        at += 1;
    }
    check_times(entries, buses.len())
}

/// No error frames, and nothing is set up.
const STEADY: Extra = Extra { errors: 0, set_up: false };

/// Whether the feedback at this place of a plan is older than it may be, or its motor's command late.
pub const fn late(plan: &Plan, at: usize, most_age: Option<Micros>) -> Option<Unsound> {
    match (most_age, plan.sorts()[at].command) {
        _ if !plan.is_feedback(at) => None,
        (None, None) => None,
        (None, Some(command)) => match plan.response(command) {
            Some(most) if most <= plan.period(command) => None,
            most => Some(Unsound::LateCommand { most, next: plan.period(command) }),
        },
        (Some(allowed), _) => match plan.age(at) {
            Some(most) if most as u64 <= allowed.get() => None,
            most => Some(Unsound::OldFeedback { most, allowed }),
        },
    }
}

/// Whether each command arrives in its tick, and each feedback is as young in it as it must be.
const fn check_times(entries: &[Entry<Device>], buses: usize) -> Result<(), SetupError> {
    let mut bus = 1;
    while bus <= buses {
        #[expect(clippy::cast_possible_truncation, reason = "a robot has three at most")]
        let plan = Plan::of(entries, Place::Bus(bus as u8), STEADY);
        let mut at = 0;
        while at < plan.sorts().len() {
            let Entry { label, on, most_age, .. } = entries[plan.sorts()[at].motor];
            if let Some(why) = late(&plan, at, most_age) {
                return Err(SetupError { label, on, why });
            }
            at += 1;
        }
        bus += 1;
    }
    Ok(())
}

/// The load of a bus of a declaration, at 1 Mbit/s.
pub fn load(entries: &[Entry<Device>], on: Place) -> BusLoad {
    let mut load = LoadSum::new(BITS_PER_SECOND);
    for entry in entries.iter().filter(|entry| entry.on == on) {
        if let Wiring::Can(ids) = entry.config.wiring() {
            load.add(&ids);
        }
    }
    load.load
}

/// Panics with the sentence of the [`check`]'s error: in a `const` that does not compile.
#[track_caller]
pub const fn assert_sound(entries: &[Entry<Device>], buses: &[f32], lines: u8) {
    if let Err(error) = check(entries, buses, lines) {
        panic!("{}", error.text().as_str());
    }
}

/// A line of a declaration, after those that stand before it.
const fn check_entry(
    entry: &Entry<Device>,
    earlier: &[Entry<Device>],
    buses: &[f32],
    lines: u8,
) -> Result<(), Unsound> {
    let mut at = 0;
    while at < earlier.len() {
        if is_same(entry.label, earlier[at].label) {
            return Err(Unsound::SameLabel);
        }
        at += 1;
    }
    let (number, last) = match entry.on {
        Place::Bus(number) => (number as usize, buses.len()),
        Place::Line(number) => (number as usize, lines as usize),
    };
    if number == 0 || number > last {
        return Err(Unsound::NoSuchPlace);
    }
    if let Err(error) = entry.config.validate() {
        return Err(Unsound::Config(error));
    }
    match (entry.on, entry.config.wiring()) {
        (Place::Bus(_), Wiring::Can(ids)) => check_on_bus(entry, &ids, earlier, buses[number - 1]),
        (Place::Line(_), Wiring::Line(address)) => check_on_line(entry, address, earlier),
        (Place::Bus(_), Wiring::Line(_)) => Err(Unsound::NotOnBus(entry.config.name())),
        (Place::Line(_), Wiring::Can(_)) => Err(Unsound::NotOnLine(entry.config.name())),
    }
}

/// In the order in which [`MotorBus::attach`] checks it.
const fn check_on_bus(
    entry: &Entry<Device>,
    ids: &CanIds,
    earlier: &[Entry<Device>],
    most: f32,
) -> Result<(), Unsound> {
    let motor = entry.config.name();
    if !ids.is_complete() {
        return attach_error(AttachError::TooManyIds { motor });
    }
    let (mut room, mut load, mut number) = (Room::NONE, LoadSum::new(BITS_PER_SECOND), 0);
    let mut at = 0;
    while at < earlier.len() {
        let other = &earlier[at];
        at += 1;
        if !other.on.is(entry.on) {
            continue;
        }
        let Wiring::Can(theirs) = other.config.wiring() else { continue };
        if let Some(clash) = ids.clash(&theirs) {
            return Err(in_the_way(entry, other, number, clash));
        }
        room = room.with(theirs.received());
        load.add(&theirs);
        number += 1;
    }
    room = room.with(ids.received());
    load.add(ids);
    if !room.is_enough_in_table() {
        return attach_error(AttachError::TableFull { motor });
    }
    ok!(check_expiry(entry));
    if number as usize >= MotorBus::CAPACITY {
        return attach_error(AttachError::Full { motor, capacity: MotorBus::CAPACITY });
    }
    let [standard, extended] = room.filters;
    if standard > STANDARD_FILTERS {
        let (needed, room) = (standard, STANDARD_FILTERS);
        return Err(Unsound::Filters { needed, room });
    }
    if extended > EXTENDED_FILTERS {
        let (needed, room) = (extended, EXTENDED_FILTERS);
        return Err(Unsound::Filters { needed, room });
    }
    let typical = load.load.typical;
    if typical > most {
        return Err(Unsound::Overload { typical, most });
    }
    Ok(())
}

/// In the order in which [`Rs485Bus::attach`] checks it.
const fn check_on_line(
    entry: &Entry<Device>,
    address: u8,
    earlier: &[Entry<Device>],
) -> Result<(), Unsound> {
    let (mut at, mut number) = (0, 0);
    while at < earlier.len() {
        let other = &earlier[at];
        at += 1;
        if !other.on.is(entry.on) {
            continue;
        }
        if let Wiring::Line(taken) = other.config.wiring()
            && taken == address
        {
            return Err(in_the_way(entry, other, number, Clash::Address(address)));
        }
        number += 1;
    }
    // A line has room for every address: 0 to 14.
    const { assert!(Rs485Bus::CAPACITY == 15) };
    check_expiry(entry)
}

const fn attach_error(error: AttachError) -> Result<(), Unsound> {
    Err(Unsound::Attach { error, with: None })
}

const fn check_expiry(entry: &Entry<Device>) -> Result<(), Unsound> {
    if entry.safety.is_valid() {
        return Ok(());
    }
    let (motor, asked) = (entry.config.name(), entry.safety.command_expiry);
    attach_error(AttachError::Expiry { motor, asked })
}

const fn in_the_way(
    entry: &Entry<Device>,
    other: &Entry<Device>,
    number: u8,
    clash: Clash,
) -> Unsound {
    let (motor, with, slot) = (entry.config.name(), other.config.name(), MotorId::new(number));
    let error = AttachError::Clash { motor, with, slot, clash };
    Unsound::Attach { error, with: Some(other.label) }
}

/// Whether two names are the same.
pub const fn is_same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut at = 0;
    while at < one.len() && at < other.len() && one[at] == other[at] {
        at += 1;
    }
    at == one.len() && at == other.len()
}
