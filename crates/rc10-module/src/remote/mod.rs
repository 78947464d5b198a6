//! Remote controls: what a person's hands do, whatever the receiver speaks.
//!
//! [`listen`] hears a UART, [`listen_pulses`] pulses; each gives a [`Remote`] per good frame.
//! [`Watch`] says how fresh it is, [`Receiver::serial`] the UART's settings.
//!
//! A [`Protocol`](crate::Protocol) for each receiver; a [`ChannelMap`] says which channel is what.

mod channels;
mod crsf;
mod dbus;
mod listen;
mod ppm;
mod sbus;
mod serial;
mod travel;
mod vt03;
mod watch;

use core::fmt;

use rc10_time::Micros;

pub use channels::{Channel, ChannelMap, ChannelMapError, ChannelOrder};
pub use crsf::{Crsf, CrsfFrame, CrsfLink, LinkStatistics};
pub use dbus::{Dbus, DbusFrame};
pub use listen::{NotSerial, listen, listen_pulses};
pub use ppm::{PPM_TRAVEL, Ppm};
pub use sbus::{SBUS_TRAVEL, Sbus, SbusFrame, pulse_width};
pub use serial::{Parity, SerialSettings};
pub use travel::{DEAD_BAND, Travel};
pub use vt03::{Vt03, Vt03Frame};
pub use watch::Watch;

/// The state of a remote control: one frame of any receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[must_use]
pub struct Remote {
    /// The left stick.
    pub left: Stick,
    /// The right stick.
    pub right: Stick,
    /// The switch on the left.
    pub left_switch: Switch,
    /// The switch on the right.
    pub right_switch: Switch,
    /// Two more switches, where there are any.
    pub more_switches: [Switch; 2],
    /// A wheel or dial, -1 ..= 1.
    pub dial: f32,
    /// The mouse of a computer behind the link, where there is one.
    pub mouse: Mouse,
    /// The keys of a computer behind the link, where there is one, and buttons on the remote.
    pub keys: Keys,
    /// The receiver itself says that it does not hear the remote: what else stands here is old.
    pub failsafe: bool,
}

/// A stick: -1 ..= 1 on each axis, 0 in the middle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Stick {
    /// To the right.
    pub x: f32,
    /// Away from the body.
    pub y: f32,
}

/// A switch of three positions; one of two is `Up` or `Down`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Switch {
    /// Away from the body.
    Up,
    /// In the middle.
    #[default]
    Middle,
    /// To the body.
    Down,
}

/// A mouse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mouse {
    /// Counts since the frame before, as the frame has them: x, y, wheel.
    pub motion: [i16; 3],
    /// The left button is pressed.
    pub left: bool,
    /// The right one.
    pub right: bool,
    /// The middle one.
    pub middle: bool,
}

/// Pressed keys: W S A D Shift Ctrl Q E R F G Z X C V B from bit 0, from 16 the remote's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Keys(pub u32);

/// The kind of receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Receiver {
    /// DJI DR16: DBUS.
    #[default]
    Dr16,
    /// Futaba, `FrSky` and others: SBUS.
    Sbus,
    /// `ExpressLRS`, TBS: CRSF.
    Crsf,
    /// Pulses of eight channels.
    Ppm,
    /// DJI VT03 or VT13, the video link of 2025.
    Vt03,
}

impl Receiver {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Dr16, Self::Sbus, Self::Crsf, Self::Ppm, Self::Vt03];

    /// The name in small letters.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dr16 => "dr16",
            Self::Sbus => "sbus",
            Self::Crsf => "crsf",
            Self::Ppm => "ppm",
            Self::Vt03 => "vt03",
        }
    }
}

impl Receiver {
    /// The order of its channels on most transmitters: [`ChannelOrder::AETR`], of pulses
    /// [`ChannelOrder::AIR_JOY`]. DJI's have their own.
    pub const fn channels(self) -> ChannelOrder {
        match self {
            Self::Ppm => ChannelOrder::AIR_JOY,
            _ => ChannelOrder::AETR,
        }
    }

    /// Whether it has these channels: always, unless it is one of DJI's, which have their own.
    ///
    /// # Errors
    /// [`ChannelMapError`]: one that it does not have, or that is two things.
    pub const fn check(self, channels: ChannelOrder) -> Result<(), ChannelMapError> {
        let checked = match self {
            Self::Dr16 | Self::Vt03 => return Ok(()),
            Self::Sbus | Self::Crsf => match ChannelMap::<16>::new(channels, SBUS_TRAVEL) {
                Ok(_) => return Ok(()),
                Err(error) => error,
            },
            Self::Ppm => match ChannelMap::<8>::new(channels, PPM_TRAVEL) {
                Ok(_) => return Ok(()),
                Err(error) => error,
            },
        };
        Err(checked)
    }
}

impl fmt::Display for Receiver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// State of the link to a remote.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RemoteLink {
    /// A good frame came less than [`INTERRUPTED_AFTER`] ago, and it was no failsafe frame.
    Online,
    /// None since then: the robot lets go, and may go on when the next one comes.
    Interrupted,
    /// None for [`LOST_AFTER`], or none yet: the robot is disarmed.
    #[default]
    Lost,
}

rc10_app::states!(RemoteLink: Online, Interrupted, Lost);

/// Time without a good frame after which the robot is suspended.
pub const INTERRUPTED_AFTER: Micros = Micros::from_millis(100);
/// Time without a good frame after which the robot is disarmed.
pub const LOST_AFTER: Micros = Micros::from_millis(1000);
