//! Where the motors of a declaration are plugged in, and how they get there.

use core::fmt;

use heapless::Vec;
use rc10_app::{ConfigError, Rpm};

use super::{Device, Entry, MOST_GAIN, Names, SetupError, Unsound};
use crate::arm::ArmSwitch;
use crate::bus::MotorBus;
use crate::motor::{CanMotor, Motor};
use crate::motors::{AttachError, MotorId};
use crate::supervision::Safety;
use crate::unitree::{GoM8010, Rs485Bus};

/// The bus or line of a motor; the first of each sort is 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Place {
    /// A CAN bus.
    Bus(u8),
    /// An RS-485 line.
    Line(u8),
}

impl Place {
    /// The number of the bus, if it is one.
    #[must_use]
    pub const fn bus(self) -> Option<u8> {
        match self {
            Self::Bus(number) => Some(number),
            Self::Line(_) => None,
        }
    }

    /// The number of the line, if it is one.
    #[must_use]
    pub const fn line(self) -> Option<u8> {
        match self {
            Self::Bus(_) => None,
            Self::Line(number) => Some(number),
        }
    }

    /// Whether it is the same place: `==`, for constants.
    #[must_use]
    pub const fn is(self, other: Self) -> bool {
        match (self, other) {
            (Self::Bus(one), Self::Bus(two)) | (Self::Line(one), Self::Line(two)) => one == two,
            _ => false,
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(number) => write!(f, "bus {number}"),
            Self::Line(number) => write!(f, "line {number}"),
        }
    }
}

/// Label and place of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// The label.
    pub label: &'static str,
    /// The bus or line that it is plugged into.
    pub on: Place,
    /// The number there: as many motors of that place stand before it in the declaration.
    pub motor: MotorId,
    /// The largest speed at which a PC may turn it, if it may.
    pub jog: Option<Rpm>,
    /// How many times the gains declared a PC may set.
    pub most_gain: f32,
}

/// Label and place of each motor. Beyond the 256th of a place they have its last number.
#[must_use]
pub const fn slots<const N: usize>(entries: &[Entry<Device>]) -> [Slot; N] {
    let (on, motor) = (Place::Bus(0), MotorId::new(0));
    let nowhere = Slot { label: "", on, motor, jog: None, most_gain: MOST_GAIN };
    let mut slots = [nowhere; N];
    let mut at = 0;
    while at < N && at < entries.len() {
        let Entry { label, on, jog, most_gain, .. } = entries[at];
        let (mut before, mut number) = (0, 0_u8);
        while before < at {
            number = number.saturating_add(entries[before].on.is(on) as u8);
            before += 1;
        }
        slots[at] = Slot { label, on, motor: MotorId::new(number), jog, most_gain };
        at += 1;
    }
    slots
}

/// Most CAN buses of a robot: the chips have three.
pub const MOST_BUSES: usize = 3;
/// Most RS-485 lines of a robot.
pub const MOST_LINES: usize = 2;

/// How many buses and lines a declaration has: up to the highest that a motor is on, and no more than a board has.
#[must_use]
pub const fn places(entries: &[Entry<Device>]) -> [usize; 2] {
    let (mut places, mut at) = ([0; 2], 0);
    while at < entries.len() {
        let (sort, number, most) = match entries[at].on {
            Place::Bus(number) => (0, number as usize, MOST_BUSES),
            Place::Line(number) => (1, number as usize, MOST_LINES),
        };
        if number > places[sort] {
            places[sort] = if number < most { number } else { most };
        }
        at += 1;
    }
    places
}

/// Whether a new word begins at this byte of a motor's name: `WheelLeft2`.
const fn begins(name: &[u8], at: usize) -> bool {
    at > 0
        && (name[at].is_ascii_uppercase()
            || name[at].is_ascii_digit() && !name[at - 1].is_ascii_digit())
}

/// The length of the label that a motor's name says.
#[must_use]
pub const fn label_length(name: &str) -> usize {
    let (name, mut length, mut at) = (name.as_bytes(), 0, 0);
    while at < name.len() {
        length += 1 + begins(name, at) as usize;
        at += 1;
    }
    length
}

/// The label that a motor's name says: "wheel left 2" of `WheelLeft2`.
#[must_use]
pub const fn label<const N: usize>(name: &str) -> [u8; N] {
    let (name, mut label, mut to, mut at) = (name.as_bytes(), [b' '; N], 0, 0);
    while at < name.len() {
        to += begins(name, at) as usize;
        label[to] = name[at].to_ascii_lowercase();
        (to, at) = (to + 1, at + 1);
    }
    label
}

/// The number of each motor on its bus or line, in this order: for tools without names.
pub fn numbers(places: impl IntoIterator<Item = Place>) -> impl Iterator<Item = MotorId> {
    let mut before = [[0_u8; 256]; 2];
    places.into_iter().map(move |on| {
        let [buses, lines] = &mut before;
        let count = match on {
            Place::Bus(number) => &mut buses[usize::from(number)],
            Place::Line(number) => &mut lines[usize::from(number)],
        };
        let motor = MotorId::new(*count);
        *count = count.saturating_add(1);
        motor
    })
}

/// The place where one motor of a robot stands; empty until it is attached.
pub struct Held<M>(Vec<M, 1>);

impl<M> Held<M> {
    /// An empty one.
    pub const fn new() -> Self {
        // All zeros, so that robots that are statics cost no flash: an `Option` is not.
        Self(Vec::new())
    }
}

impl<M> Default for Held<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// The buses and lines of a robot, with its motors: each goes to a runner.
pub struct Started<'m, const BUSES: usize, const LINES: usize> {
    /// Bus 1 is the first.
    pub buses: [MotorBus<'m>; BUSES],
    /// Line 1 is the first.
    pub lines: [Rs485Bus<'m>; LINES],
}

impl<'m, const BUSES: usize, const LINES: usize> Started<'m, BUSES, LINES> {
    /// Without motors, armed and stopped by `switch`.
    #[must_use]
    pub fn new(switch: &'m ArmSwitch) -> Self {
        Self {
            buses: [(); BUSES].map(|()| MotorBus::new(switch)),
            lines: [(); LINES].map(|()| Rs485Bus::new(switch)),
        }
    }
}

/// A motor that a declaration can name: one on a CAN bus, or a GO-M8010-6 on RS-485.
pub trait Placed: Motor {
    /// Attaches it where it belongs, or tells why it cannot be there.
    fn attach<'m>(
        &'m mut self,
        on: Place,
        safety: Safety,
        buses: &mut [&mut MotorBus<'m>],
        lines: &mut [&mut Rs485Bus<'m>],
    ) -> Result<MotorId, Unsound>;
}

impl<M: CanMotor> Placed for M {
    fn attach<'m>(
        &'m mut self,
        on: Place,
        safety: Safety,
        buses: &mut [&mut MotorBus<'m>],
        _: &mut [&mut Rs485Bus<'m>],
    ) -> Result<MotorId, Unsound> {
        let number = on.bus().ok_or(Unsound::NotOnLine(self.name()))?;
        let bus = usize::from(number).checked_sub(1).and_then(|index| buses.get_mut(index));
        Ok(bus.ok_or(Unsound::NoSuchPlace)?.attach(self, safety)?)
    }
}

impl Placed for GoM8010 {
    fn attach<'m>(
        &'m mut self,
        on: Place,
        safety: Safety,
        _: &mut [&mut MotorBus<'m>],
        lines: &mut [&mut Rs485Bus<'m>],
    ) -> Result<MotorId, Unsound> {
        let number = on.line().ok_or(Unsound::NotOnBus(self.name()))?;
        let line = usize::from(number).checked_sub(1).and_then(|index| lines.get_mut(index));
        Ok(line.ok_or(Unsound::NoSuchPlace)?.attach(self, safety)?)
    }
}

/// Makes buses and lines, as many as declared, ready for its motors; then [`place`] each.
pub fn prepare<N: Names>(
    buses: &mut [&mut MotorBus<'_>],
    lines: &mut [&mut Rs485Bus<'_>],
) -> Result<(), SetupError> {
    if buses.len() != N::BUSES.len() || lines.len() != usize::from(N::LINES) {
        return Err(SetupError::new(N::SLOTS.first(), Unsound::OtherPlaces));
    }
    for (bus, most) in buses.iter_mut().zip(N::BUSES) {
        if *most > 100.0 {
            bus.allow_overload();
        }
    }
    Ok(())
}

/// Makes a motor of a declaration and attaches it.
///
/// # Errors
/// [`SetupError`], with the labels of those it concerns.
#[inline(never)] // Once for each vendor, and not for each motor.
pub fn place<'m, N: Names, C: Copy, M: Placed>(
    held: &'m mut Held<M>,
    name: N,
    entry: &'static Entry<C>,
    new: impl Fn(C) -> Result<M, ConfigError>,
    buses: &mut [&mut MotorBus<'m>],
    lines: &mut [&mut Rs485Bus<'m>],
) -> Result<(), SetupError> {
    let slot = name.slot();
    let failed = |why| SetupError::new(Some(slot), why);
    let motor = new(entry.config).map_err(|error| failed(Unsound::Config(error)))?;
    held.0.clear();
    // It has room for one.
    let _ = held.0.push(motor);
    let Some(motor) = held.0.first_mut() else { return Ok(()) };
    match motor.attach(slot.on, entry.safety, buses, lines) {
        Ok(number) if number == slot.motor => Ok(()),
        Ok(_) => Err(failed(Unsound::OtherPlaces)),
        Err(mut why) => {
            if let Unsound::Attach { error: AttachError::Clash { slot: other, .. }, with } =
                &mut why
            {
                let mut all = N::SLOTS.iter();
                let taken = all.find(|it| it.on == slot.on && it.motor == *other);
                *with = taken.map(|slot| slot.label);
            }
            Err(failed(why))
        }
    }
}
