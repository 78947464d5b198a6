//! The bytes of VESC frames: commands to frames, frames to values. No state.
//!
//! Values are limited, rounded to the nearest step, and saturate. NaN is an error, not a frame.

use embedded_can::ExtendedId;
use rc10_app::maths::{round_to_i32, within};
use rc10_app::{Amps, Celsius, Degrees, ElectricalRpm};
use rc10_can::CanFrame;

use crate::motor::FrameError;
use crate::not_a_number::NotANumber;

/// The number a VESC is set to: 0 ..= 254.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct VescId(u8);

/// The id that every VESC listens to.
pub(super) const EVERY: u8 = 255;

impl VescId {
    /// The highest number: 254.
    pub const LAST: Self = Self(EVERY - 1);

    /// `None` for 255, which means all of them.
    pub const fn new(id: u8) -> Option<Self> {
        if id == EVERY { None } else { Some(Self(id)) }
    }

    /// The number.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }
}

/// The receiver of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Address {
    /// This VESC.
    One(VescId),
    /// All VESCs on the bus (id 255).
    Every,
}

impl From<VescId> for Address {
    fn from(id: VescId) -> Self {
        Self::One(id)
    }
}

impl Address {
    /// The lowest byte of the identifier.
    #[must_use]
    pub const fn byte(self) -> u8 {
        match self {
            Self::One(id) => id.get(),
            Self::Every => EVERY,
        }
    }
}

macro_rules! packets {
    ($($variant:ident = $number:literal $name:literal,)*) => {
        /// The kind of a frame: identifier bits 15 to 8 (bldc's `datatypes.h`, `CAN_PACKET_ID`).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Packet {
            $(#[doc = concat!("`", $name, "`")] $variant = $number,)*
        }

        impl Packet {
            /// The packet of a number; `None` for another.
            pub const fn from_number(number: u8) -> Option<Self> {
                match number {
                    $($number => Some(Self::$variant),)*
                    _ => None,
                }
            }

            /// The name in the firmware's source, without `CAN_PACKET_`.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

packets! {
    SetDuty = 0 "SET_DUTY",
    SetCurrent = 1 "SET_CURRENT",
    SetCurrentBrake = 2 "SET_CURRENT_BRAKE",
    SetRpm = 3 "SET_RPM",
    SetPos = 4 "SET_POS",
    Status = 9 "STATUS",
    SetCurrentRel = 10 "SET_CURRENT_REL",
    SetCurrentBrakeRel = 11 "SET_CURRENT_BRAKE_REL",
    SetCurrentHandbrake = 12 "SET_CURRENT_HANDBRAKE",
    SetCurrentHandbrakeRel = 13 "SET_CURRENT_HANDBRAKE_REL",
    Status2 = 14 "STATUS_2",
    Status3 = 15 "STATUS_3",
    Status4 = 16 "STATUS_4",
    Ping = 17 "PING",
    Pong = 18 "PONG",
    ConfCurrentLimits = 21 "CONF_CURRENT_LIMITS",
    ConfStoreCurrentLimits = 22 "CONF_STORE_CURRENT_LIMITS",
    ConfCurrentLimitsIn = 23 "CONF_CURRENT_LIMITS_IN",
    ConfStoreCurrentLimitsIn = 24 "CONF_STORE_CURRENT_LIMITS_IN",
    ConfFocErpms = 25 "CONF_FOC_ERPMS",
    ConfStoreFocErpms = 26 "CONF_STORE_FOC_ERPMS",
    Status5 = 27 "STATUS_5",
    ConfBatteryCut = 29 "CONF_BATTERY_CUT",
    ConfStoreBatteryCut = 30 "CONF_STORE_BATTERY_CUT",
    Shutdown = 31 "SHUTDOWN",
    Status6 = 58 "STATUS_6",
}

impl Packet {
    /// The number of the packet.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The identifier with an address: the receiver's of a command, the sender's of a status.
    #[must_use]
    pub fn id(self, address: impl Into<Address>) -> ExtendedId {
        let raw = u32::from(u16::from_be_bytes([self.number(), address.into().byte()]));
        // Sixteen bits always fit; the compiler knows.
        ExtendedId::new(raw).unwrap_or(ExtendedId::ZERO)
    }
}

/// The status frames, in the order of their numbers.
pub(super) const STATUSES: [Packet; 6] = [
    Packet::Status,
    Packet::Status2,
    Packet::Status3,
    Packet::Status4,
    Packet::Status5,
    Packet::Status6,
];

// Raw units of a command per unit (bldc `comm_can.c`, `comm_can_set_*` and `comm_can_conf_*`).

/// Steps of duty and of relative current, per 1.
const STEPS_PER_SHARE: f32 = 1e5;
/// Steps of current, per ampere.
const STEPS_PER_AMPERE: f32 = 1e3;
/// Steps of `SET_POS`, per degree.
const STEPS_PER_DEGREE: i32 = 1_000_000;
/// Steps of both numbers of a setting, per ampere, electrical rpm or volt.
const STEPS_PER_SETTING: f32 = 1e3;

// Units per raw unit of a status (bldc `comm_can.c`, `send_status1` to `send_status6`).

const AMPS_PER_STEP: f32 = 1.0 / 10.0;
const DUTY_PER_STEP: f32 = 1.0 / 1e3;
/// Ampere hours or watt hours.
const HOURS_PER_STEP: f32 = 1.0 / 1e4;
const CELSIUS_PER_STEP: f32 = 1.0 / 10.0;
const DEGREES_PER_STEP: f32 = 1.0 / 50.0;
const SUPPLY_VOLTS_PER_STEP: f32 = 1.0 / 10.0;
/// Volts of an analogue input, or share of the PPM input.
const INPUT_PER_STEP: f32 = 1.0 / 1e3;

/// A command to a VESC; it lasts until the next one, or until the VESC's timeout.
///
/// A VESC holds values beyond its own limits to them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Command {
    /// Share of the supply voltage, -1 ..= 1. 0 shorts the motor: it brakes.
    Duty(f32),
    /// Torque current. 0 leaves the motor free.
    Current(Amps),
    /// Current against the movement, whichever way it goes; no torque at rest.
    Brake(Amps),
    /// Speed. Not regulated below the VESC's minimum: see [`ElectricalScale`](super::ElectricalScale).
    Speed(ElectricalRpm),
    /// Angle of the VESC's position controller, 0 ..= 360 degrees: one turn, not many.
    Position(Degrees),
    /// [`Current`](Self::Current) as a share of the VESC's limit, -1 ..= 1.
    RelativeCurrent(f32),
    /// [`Brake`](Self::Brake) as a share of the VESC's limit, -1 ..= 1.
    RelativeBrake(f32),
    /// Current of a field that stands still: keeps a shaft where it is.
    Handbrake(Amps),
    /// [`Handbrake`](Self::Handbrake) as a share of the VESC's limit, -1 ..= 1.
    RelativeHandbrake(f32),
}

impl Command {
    /// The packet it is sent as.
    pub const fn packet(&self) -> Packet {
        match self {
            Self::Duty(_) => Packet::SetDuty,
            Self::Current(_) => Packet::SetCurrent,
            Self::Brake(_) => Packet::SetCurrentBrake,
            Self::Speed(_) => Packet::SetRpm,
            Self::Position(_) => Packet::SetPos,
            Self::RelativeCurrent(_) => Packet::SetCurrentRel,
            Self::RelativeBrake(_) => Packet::SetCurrentBrakeRel,
            Self::Handbrake(_) => Packet::SetCurrentHandbrake,
            Self::RelativeHandbrake(_) => Packet::SetCurrentHandbrakeRel,
        }
    }

    /// The frame, of exactly four bytes.
    ///
    /// # Errors
    /// [`NotANumber`]; neutral is [`coast`]: duty 0 would brake, and position 0 would move.
    ///
    /// ```
    /// use rc10_motor::vesc::{Command, ElectricalRpm, VescId};
    /// let wheel = VescId::new(1).unwrap();
    /// let frame = Command::Speed(ElectricalRpm::new(21_000.0)).pack(wheel)?;
    /// assert_eq!(frame.to_string(), "00000301#00005208");
    /// # Ok::<(), rc10_motor::vesc::NotANumber>(())
    /// ```
    pub fn pack(&self, to: impl Into<Address>) -> Result<CanFrame, NotANumber> {
        let (packet, to) = (self.packet(), to.into());
        let (value, per_unit) = match *self {
            Self::Duty(share)
            | Self::RelativeCurrent(share)
            | Self::RelativeBrake(share)
            | Self::RelativeHandbrake(share) => (within(share, 1.0), STEPS_PER_SHARE),
            Self::Current(amps) | Self::Brake(amps) | Self::Handbrake(amps) => {
                (amps.get(), STEPS_PER_AMPERE)
            }
            Self::Speed(speed) => (speed.get(), 1.0),
            Self::Position(angle) => (angle.get(), 0.0),
        };
        if value.is_nan() {
            return Err(not_a_number(packet, to));
        }
        let raw = match self {
            Self::Position(_) => position_steps(value),
            _ => round_to_i32(value * per_unit),
        };
        Ok(frame(packet, to, raw.to_be_bytes()))
    }
}

/// An f32's last place is coarser: whole degrees and the rest are scaled by themselves.
fn position_steps(degrees: f32) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "saturation is the purpose")]
    let whole = degrees as i32;
    #[expect(clippy::cast_precision_loss, reason = "whole came from this f32: exact")]
    let rest = degrees - whole as f32;
    #[expect(clippy::cast_precision_loss, reason = "a power of ten below 2^24")]
    let rest = round_to_i32(rest * STEPS_PER_DEGREE as f32);
    whole.saturating_mul(STEPS_PER_DEGREE).saturating_add(rest)
}
fn not_a_number(packet: Packet, to: Address) -> NotANumber {
    NotANumber { field: packet.name(), neutral: coast(to) }
}

/// `SET_CURRENT` 0: no torque, no braking.
pub fn coast(to: impl Into<Address>) -> CanFrame {
    frame(Packet::SetCurrent, to.into(), [0; 4])
}

/// Asks a VESC for a [`Reply::Pong`] to `sender`, whatever its status frames, within 10 ms as the
/// firmware's own search. Never all at once: their answers would differ under one identifier.
pub fn ping(to: VescId, sender: VescId) -> CanFrame {
    frame(Packet::Ping, to.into(), [sender.get()])
}

/// Switches the power off, on hardware that can.
pub fn shutdown(to: impl Into<Address>) -> CanFrame {
    frame(Packet::Shutdown, to.into(), [])
}

/// A setting of a VESC: a pair of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setting {
    /// The motor's current.
    MotorCurrent {
        /// Most negative: braking.
        min: Amps,
        /// Most positive: driving.
        max: Amps,
    },
    /// The supply's current.
    InputCurrent {
        /// Most negative: back into the battery.
        min: Amps,
        /// Most positive.
        max: Amps,
    },
    /// Speeds at which field-oriented control changes its way of knowing the angle.
    FieldOriented {
        /// Speed while started blindly.
        openloop: ElectricalRpm,
        /// From here on without sensor.
        sensorless: ElectricalRpm,
    },
    /// Supply voltages at which power is reduced to save the battery, in volts.
    BatteryCut {
        /// Less power below this.
        start: f32,
        /// None below this.
        end: f32,
    },
}

impl Setting {
    /// The frame, of exactly eight bytes, that holds until the VESC restarts.
    ///
    /// # Errors
    /// [`NotANumber`]; neutral is [`coast`]: no setting is.
    pub fn pack(&self, to: impl Into<Address>) -> Result<CanFrame, NotANumber> {
        self.pack_as(self.packets().0, to.into())
    }

    /// Like [`pack`](Self::pack), but also writes the VESC's flash, which wears out: use it rarely.
    pub fn pack_store(&self, to: impl Into<Address>) -> Result<CanFrame, NotANumber> {
        self.pack_as(self.packets().1, to.into())
    }

    /// Until a restart, and for good.
    const fn packets(&self) -> (Packet, Packet) {
        match self {
            Self::MotorCurrent { .. } => {
                (Packet::ConfCurrentLimits, Packet::ConfStoreCurrentLimits)
            }
            Self::InputCurrent { .. } => {
                (Packet::ConfCurrentLimitsIn, Packet::ConfStoreCurrentLimitsIn)
            }
            Self::FieldOriented { .. } => (Packet::ConfFocErpms, Packet::ConfStoreFocErpms),
            Self::BatteryCut { .. } => (Packet::ConfBatteryCut, Packet::ConfStoreBatteryCut),
        }
    }

    fn pack_as(&self, packet: Packet, to: Address) -> Result<CanFrame, NotANumber> {
        let (first, second) = match *self {
            Self::MotorCurrent { min, max } | Self::InputCurrent { min, max } => {
                (min.get(), max.get())
            }
            Self::FieldOriented { openloop, sensorless } => (openloop.get(), sensorless.get()),
            Self::BatteryCut { start, end } => (start, end),
        };
        if first.is_nan() || second.is_nan() {
            return Err(not_a_number(packet, to));
        }
        let [a, b, c, d] = round_to_i32(first * STEPS_PER_SETTING).to_be_bytes();
        let [e, f, g, h] = round_to_i32(second * STEPS_PER_SETTING).to_be_bytes();
        Ok(frame(packet, to, [a, b, c, d, e, f, g, h]))
    }
}

fn frame<const LEN: usize>(packet: Packet, to: Address, data: [u8; LEN]) -> CanFrame {
    CanFrame::exact(packet.id(to), data)
}

/// A frame of a VESC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply {
    /// One of its periodic frames.
    Status {
        /// The sender.
        from: VescId,
        /// The content of the frame.
        status: Status,
    },
    /// The answer to a [`ping`].
    Pong {
        /// The sender.
        from: VescId,
        /// The sender of the PING.
        to: VescId,
        /// Kind of hardware; 0 is a VESC.
        hardware: u8,
    },
}

/// The content of a status frame; positive is forward, as the VESC counts it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Status {
    /// STATUS
    Motion {
        /// Speed.
        speed: ElectricalRpm,
        /// Current of the motor, 0.1 A a step.
        current: Amps,
        /// Share of the supply voltage, -1 ..= 1.
        duty: f32,
    },
    /// `STATUS_2`
    AmpHours {
        /// Drawn from the battery, in ampere hours.
        used: f32,
        /// Fed back, in ampere hours.
        charged: f32,
    },
    /// `STATUS_3`
    WattHours {
        /// Drawn from the battery, in watt hours.
        used: f32,
        /// Fed back, in watt hours.
        charged: f32,
    },
    /// `STATUS_4`
    Temperatures {
        /// The transistors' temperature.
        transistors: Celsius,
        /// The motor's temperature.
        motor: Celsius,
        /// Current of the supply.
        input_current: Amps,
        /// Angle of the position controller, within one turn.
        position: Degrees,
    },
    /// `STATUS_5`
    Tachometer {
        /// Commutation steps, six an electrical turn; goes round after 2³² of them.
        steps: i32,
        /// Supply voltage in volts.
        volts: f32,
    },
    /// `STATUS_6`, from firmware 6.00 on
    Inputs {
        /// Voltages of the analogue inputs 1 to 3.
        analogue: [f32; 3],
        /// PPM input, -1 ..= 1.
        ppm: f32,
    },
}

impl Reply {
    /// From a frame.
    ///
    /// # Errors
    /// [`FrameError::NotMine`] for everything but PONG and STATUS to `STATUS_6` of an id below 255,
    /// [`FrameError::Length`] for these in another length than they always have.
    ///
    /// ```
    /// use rc10_can::{CanFrame, embedded_can::ExtendedId};
    /// use rc10_motor::vesc::{Packet, Reply, Status, VescId};
    /// let wheel = VescId::new(1).unwrap();
    /// let bytes = [0, 0, 0x03, 0xE8, 0, 0xF5, 0, 0];
    /// let told = Reply::unpack(&CanFrame::eight_bytes(Packet::Status5.id(wheel), bytes))?;
    /// let status = Status::Tachometer { steps: 1000, volts: 24.5 };
    /// assert_eq!(told, Reply::Status { from: wheel, status });
    /// # Ok::<(), rc10_motor::FrameError>(())
    /// ```
    pub fn unpack(frame: &CanFrame) -> Result<Self, FrameError> {
        if !frame.is_extended_id() || frame.is_remote() {
            return Err(FrameError::NotMine);
        }
        let [0, 0, number, id] = frame.raw_id().to_be_bytes() else {
            return Err(FrameError::NotMine);
        };
        let packet = Packet::from_number(number).ok_or(FrameError::NotMine)?;
        let vesc = |id| VescId::new(id).ok_or(FrameError::NotMine);
        if packet == Packet::Pong {
            let &[from, hardware] = frame.bytes() else { return Err(FrameError::Length) };
            return Ok(Self::Pong { from: vesc(from)?, to: vesc(id)?, hardware });
        }
        let status = status(packet, frame)?;
        Ok(Self::Status { from: vesc(id)?, status })
    }
}

fn status(packet: Packet, frame: &CanFrame) -> Result<Status, FrameError> {
    let bytes = || frame.all_eight().ok_or(FrameError::Length);
    Ok(match packet {
        Packet::Status => {
            let ([speed, _], [.., current, duty]) = (words(bytes()?), halves(bytes()?));
            Status::Motion {
                speed: ElectricalRpm::new(speed as f32),
                current: Amps::new(current * AMPS_PER_STEP),
                duty: duty * DUTY_PER_STEP,
            }
        }
        Packet::Status2 => {
            let [used, charged] = words(bytes()?).map(|raw| raw as f32 * HOURS_PER_STEP);
            Status::AmpHours { used, charged }
        }
        Packet::Status3 => {
            let [used, charged] = words(bytes()?).map(|raw| raw as f32 * HOURS_PER_STEP);
            Status::WattHours { used, charged }
        }
        Packet::Status4 => {
            let [transistors, motor, input_current, position] = halves(bytes()?);
            Status::Temperatures {
                transistors: Celsius::new(transistors * CELSIUS_PER_STEP),
                motor: Celsius::new(motor * CELSIUS_PER_STEP),
                input_current: Amps::new(input_current * AMPS_PER_STEP),
                position: Degrees::new(position * DEGREES_PER_STEP),
            }
        }
        Packet::Status5 => {
            let ([steps, _], [_, _, volts, _]) = (words(bytes()?), halves(bytes()?));
            Status::Tachometer { steps, volts: volts * SUPPLY_VOLTS_PER_STEP }
        }
        Packet::Status6 => {
            let [first, second, third, ppm] = halves(bytes()?).map(|raw| raw * INPUT_PER_STEP);
            Status::Inputs { analogue: [first, second, third], ppm }
        }
        _ => return Err(FrameError::NotMine),
    })
}

const fn words(&[a, b, c, d, e, f, g, h]: &[u8; 8]) -> [i32; 2] {
    [i32::from_be_bytes([a, b, c, d]), i32::from_be_bytes([e, f, g, h])]
}

fn halves(&[a, b, c, d, e, f, g, h]: &[u8; 8]) -> [f32; 4] {
    [[a, b], [c, d], [e, f], [g, h]].map(|half| i16::from_be_bytes(half).into())
}

#[cfg(test)]
mod tests;
