use core::fmt;

use rc10_app::{Amps, Celsius, Degrees, NewtonMetres, Rpm, TotalAngle, Volts};
use rc10_time::Micros;

/// Measurements of a motor, at the output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[must_use]
pub struct Feedback {
    /// The time at which it arrived.
    pub at: Micros,
    /// Speed.
    pub speed: Rpm,
    /// Angle within the turn, 0 ..< 360 degrees. Behind a gearbox, from power-on or the zero set.
    pub angle: Degrees,
    /// Angle of many turns, exact.
    pub total_angle: TotalAngle,
    /// Times that turns were estimated, for lack of feedback at speed or for 100 ms: watch this.
    pub turn_gaps: u32,
    current: Reading,
    torque: Reading,
    temperature: Reading,
    controller_temperature: Reading,
    supply: Reading,
    effort: Reading,
}

/// A measurement that not every device sends: NaN without; an `Option<f32>` takes twice the room.
#[derive(Clone, Copy)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Reading(f32);

impl Reading {
    const NONE: Self = Self(f32::NAN);

    const fn get(self) -> Option<f32> {
        if self.0.is_nan() { None } else { Some(self.0) }
    }
}

impl Default for Reading {
    fn default() -> Self {
        Self::NONE
    }
}

impl PartialEq for Reading {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl fmt::Debug for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.get().fmt(f)
    }
}

impl Feedback {
    /// Nothing measured: everything zero or absent.
    pub const NEW: Self = Self {
        at: Micros::ZERO,
        speed: Rpm::ZERO,
        angle: Degrees::ZERO,
        total_angle: TotalAngle::ZERO,
        turn_gaps: 0,
        current: Reading::NONE,
        torque: Reading::NONE,
        temperature: Reading::NONE,
        controller_temperature: Reading::NONE,
        supply: Reading::NONE,
        effort: Reading::NONE,
    };

    /// Readings that not every device sends, NaN without: current in A, torque in N m, temperature
    /// of the motor and of what drives it in degrees Celsius, supply in V.
    #[inline]
    #[must_use]
    pub const fn readings(&self) -> [f32; 5] {
        let Self { current, torque, temperature, controller_temperature, supply, .. } = self;
        [current.0, torque.0, temperature.0, controller_temperature.0, supply.0]
    }

    /// The measurements of every device, and no others.
    pub const fn new(at: Micros, speed: Rpm, angle: Degrees, total_angle: TotalAngle) -> Self {
        Self { at, speed, angle, total_angle, ..Self::NEW }
    }

    /// The effort commanded last, in the unit of its [`Loops`](crate::Loops); `None` without loops.
    pub const fn effort(&self) -> Option<f32> {
        self.effort.get()
    }

    /// The same with the effort of its servo.
    pub const fn with_effort(mut self, effort: f32) -> Self {
        self.effort = Reading(effort);
        self
    }
}

/// The readings with a unit, and how they are told.
macro_rules! readings {
    ($($(#[$meta:meta])* $reading:ident, $with:ident: $Unit:ident;)+) => {
        impl Feedback {$(
            $(#[$meta])*
            pub fn $reading(&self) -> Option<$Unit> {
                self.$reading.get().map($Unit::new)
            }

            /// The same with this reading; what is NaN counts as not told.
            pub const fn $with(mut self, reading: $Unit) -> Self {
                self.$reading = Reading(reading.get());
                self
            }
        )+}
    };
}

readings! {
    /// Torque-producing current, positive for positive torque.
    current, with_current: Amps;
    /// Torque, where the device tells it or its torque constant is known.
    torque, with_torque: NewtonMetres;
    /// Temperature of the motor, where the device tells it.
    temperature, with_temperature: Celsius;
    /// Temperature of what drives the motor, where the device tells it.
    controller_temperature, with_controller_temperature: Celsius;
    /// Voltage it is supplied with, where the device tells it.
    supply, with_supply: Volts;
}

/// An error that the device of a motor reports, or a setting of it that differs from the table.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Fault {
    /// The code the device sent.
    pub code: u32,
    /// Meaning of the code.
    #[cfg_attr(feature = "record", serde(skip))]
    pub text: &'static str,
    /// Of a setting: what the device holds, and what the table says, in the unit that the text names.
    pub differs: Option<[f32; 2]>,
}

impl Fault {
    /// A fault.
    pub const fn new(code: u32, text: &'static str) -> Self {
        Self { code, text, differs: None }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text)?;
        let Some([held, wanted]) = self.differs else { return Ok(()) };
        write!(f, ": it holds {held}, the table says {wanted}")
    }
}

/// Whether a motor that may run does what its target says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Condition {
    /// The motor follows its target.
    #[default]
    Ready,
    /// Not yet: its device is being set up or enabled.
    Starting,
    /// The speed asked for is below what its drive regulates: it turns as the load lets it.
    Unregulated,
    /// Feedback comes too seldom to control by.
    SlowFeedback,
    /// The device answers when asked, but sends no feedback: that has to be switched on there.
    NoReports,
    /// The device does not do what it is told, and does not say why: it may have a fault, or an angle is beyond the
    /// range of its own.
    NotFollowing,
}

rc10_app::states!(Condition: Ready, Starting, Unregulated, SlowFeedback, NoReports, NotFollowing);
