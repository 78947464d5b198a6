//! The bytes of VESC frames: commands to frames, frames to values. No state.
//!
//! Values are limited, scaled and rounded to the nearest step, and saturate at i32's ends. No
//! number on the wire stands for NaN, so it is an error instead of a frame.

use core::fmt;

use rc10_app::maths::{round_to_i32, within};
use rc10_app::{Amps, Celsius, Degrees};
use rc10_can::CanFrame;

use super::{Address, ElectricalRpm, Packet, VescId};

// Raw units of a command per unit (bldc `comm_can.c`, `comm_can_set_*` and `comm_can_conf_*`).

/// Of duty and of relative current, per 1.
const STEPS_PER_SHARE: f32 = 1e5;
/// Of current, per ampere.
const STEPS_PER_AMPERE: f32 = 1e3;
/// Of `SET_POS`, per degree.
const STEPS_PER_DEGREE: i32 = 1_000_000;
/// Of both numbers of a setting, per ampere, electrical rpm or volt.
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

/// What a motor is told to do; each lasts until the next one, or until the VESC's timeout.
///
/// A VESC holds values beyond its own limits to them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Ownership of the supply voltage, -1 ..= 1. 0 shorts the motor: it brakes.
    Duty(f32),
    /// Torque current. 0 leaves the motor free.
    Current(Amps),
    /// Current against the movement, whichever way it goes; no torque at rest.
    Brake(Amps),
    /// Speed. Not regulated below the VESC's minimum: see [`Shaft`](super::Shaft).
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

/// A value to be sent was not a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NotANumber {
    /// The packet that could not be made.
    pub packet: Packet,
}

impl fmt::Display for NotANumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of what is not a number", self.packet)
    }
}

impl core::error::Error for NotANumber {}

impl Command {
    /// The packet it is sent as.
    #[inline]
    #[must_use]
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
    /// [`NotANumber`]. The neutral command to send then is [`coast`], whatever was wanted: duty 0
    /// would brake, and position 0 would move.
    ///
    /// ```
    /// use rc10_motor::vesc::{Command, ElectricalRpm, VescId};
    /// let wheel = VescId::new(1).unwrap();
    /// let frame = Command::Speed(ElectricalRpm::new(21_000.0)).pack(wheel)?;
    /// assert_eq!(frame.to_string(), "00000301#00005208");
    /// # Ok::<(), rc10_motor::vesc::NotANumber>(())
    /// ```
    #[inline]
    pub fn pack(&self, to: impl Into<Address>) -> Result<CanFrame, NotANumber> {
        let packet = self.packet();
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
            return Err(NotANumber { packet });
        }
        let raw = match self {
            Self::Position(_) => position_steps(value),
            _ => round_to_i32(value * per_unit),
        };
        Ok(frame(packet, to.into(), raw.to_be_bytes()))
    }
}

/// A millionth of a degree is less than the last place of an f32 times a million: whole degrees
/// and the rest are scaled by themselves.
#[inline]
fn position_steps(degrees: f32) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "saturation is the purpose")]
    let whole = degrees as i32;
    #[expect(clippy::cast_precision_loss, reason = "whole came from this f32: exact")]
    let rest = degrees - whole as f32;
    #[expect(clippy::cast_precision_loss, reason = "a power of ten below 2^24")]
    let rest = round_to_i32(rest * STEPS_PER_DEGREE as f32);
    whole.saturating_mul(STEPS_PER_DEGREE).saturating_add(rest)
}

/// `SET_CURRENT` 0: no torque, no braking.
#[inline]
#[must_use]
pub fn coast(to: impl Into<Address>) -> CanFrame {
    frame(Packet::SetCurrent, to.into(), [0; 4])
}

/// Asks a VESC to answer with a [`Reply::Pong`] to `sender`, whether or not its status frames are
/// switched on. It answers within 10 ms: the firmware's own search waits that long. Never to all at
/// once: their answers would differ under one identifier.
#[must_use]
pub fn ping(to: VescId, sender: VescId) -> CanFrame {
    frame(Packet::Ping, to.into(), [sender.get()])
}

/// Switches the power off, on hardware that can.
#[must_use]
pub fn shutdown(to: impl Into<Address>) -> CanFrame {
    frame(Packet::Shutdown, to.into(), [])
}

/// What a VESC keeps to, in pairs of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Setting {
    /// Of the motor.
    MotorCurrent {
        /// Most negative: braking.
        min: Amps,
        /// Most positive: driving.
        max: Amps,
    },
    /// Of the supply.
    InputCurrent {
        /// Most negative: back into the battery.
        min: Amps,
        /// Most positive.
        max: Amps,
    },
    /// Where field-oriented control changes its way of knowing the angle.
    FieldOriented {
        /// Speed while started blindly.
        openloop: ElectricalRpm,
        /// From here on without sensor.
        sensorless: ElectricalRpm,
    },
    /// Where power is reduced to save the battery, in volts.
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
    /// [`NotANumber`]: there is no neutral setting, so send nothing.
    pub fn pack(&self, to: impl Into<Address>) -> Result<CanFrame, NotANumber> {
        let packet = match self {
            Self::MotorCurrent { .. } => Packet::ConfCurrentLimits,
            Self::InputCurrent { .. } => Packet::ConfCurrentLimitsIn,
            Self::FieldOriented { .. } => Packet::ConfFocErpms,
            Self::BatteryCut { .. } => Packet::ConfBatteryCut,
        };
        self.pack_as(packet, to.into())
    }

    /// The frame that also writes the VESC's flash memory, which wears out: never periodically.
    ///
    /// # Errors
    /// As of [`pack`](Self::pack).
    pub fn pack_store(&self, to: impl Into<Address>) -> Result<CanFrame, NotANumber> {
        let packet = match self {
            Self::MotorCurrent { .. } => Packet::ConfStoreCurrentLimits,
            Self::InputCurrent { .. } => Packet::ConfStoreCurrentLimitsIn,
            Self::FieldOriented { .. } => Packet::ConfStoreFocErpms,
            Self::BatteryCut { .. } => Packet::ConfStoreBatteryCut,
        };
        self.pack_as(packet, to.into())
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
            return Err(NotANumber { packet });
        }
        let [a, b, c, d] = round_to_i32(first * STEPS_PER_SETTING).to_be_bytes();
        let [e, f, g, h] = round_to_i32(second * STEPS_PER_SETTING).to_be_bytes();
        Ok(frame(packet, to, [a, b, c, d, e, f, g, h]))
    }
}

/// A frame of exactly this length.
#[inline]
fn frame<const LEN: usize>(packet: Packet, to: Address, data: [u8; LEN]) -> CanFrame {
    CanFrame::exact(packet.id(to), data)
}

/// What a VESC tells, by itself or asked.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply {
    /// One of its periodic frames.
    Status {
        /// Who sent it.
        from: VescId,
        /// What it says.
        status: Status,
    },
    /// The answer to a [`ping`].
    Pong {
        /// Who sent it.
        from: VescId,
        /// Who asked.
        to: VescId,
        /// 0: a VESC.
        hardware: u8,
    },
}

/// What a status frame says; positive is forward, as the VESC counts it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Status {
    /// STATUS
    Motion {
        /// Speed.
        speed: ElectricalRpm,
        /// Current of the motor, 0.1 A a step.
        current: Amps,
        /// Ownership of the supply voltage, -1 ..= 1.
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
        /// Of the transistors.
        transistors: Celsius,
        /// Of the motor.
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

/// Why a frame tells nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UnpackError {
    /// A standard identifier.
    Standard,
    /// A remote request.
    Remote,
    /// An identifier above 0xFFFF: of another protocol.
    UpperBits(u32),
    /// A packet with this number is not known.
    UnknownPacket(u8),
    /// No VESC says this: it is said to a VESC.
    NotAReply(Packet),
    /// Not the length that this packet always has.
    Length(Packet, usize),
    /// Id 255 as sender, or as who asked.
    Broadcast(Packet),
}

impl fmt::Display for UnpackError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Standard => f.write_str("a standard identifier; VESCs have extended ones"),
            Self::Remote => f.write_str("a remote request"),
            Self::UpperBits(id) => write!(f, "identifier {id:08X} is above FFFF: not of a VESC"),
            Self::UnknownPacket(number) => write!(f, "packet {number} is not known"),
            Self::NotAReply(packet) => write!(f, "{packet} is nothing a VESC tells"),
            Self::Length(packet, len) => write!(f, "{packet} of {len} bytes"),
            Self::Broadcast(packet) => write!(f, "{packet} of id 255, which no VESC has"),
        }
    }
}

impl core::error::Error for UnpackError {}

impl Reply {
    /// From a frame.
    ///
    /// # Errors
    /// [`UnpackError`] for everything but PONG and STATUS to `STATUS_6` in their exact lengths.
    ///
    /// ```
    /// use rc10_can::{CanFrame, embedded_can::ExtendedId};
    /// use rc10_motor::vesc::{Packet, Reply, Status, UnpackError, VescId};
    /// let wheel = VescId::new(1).unwrap();
    /// let bytes = [0, 0, 0x03, 0xE8, 0, 0xF5, 0, 0];
    /// let told = Reply::unpack(&CanFrame::eight_bytes(Packet::Status5.id(wheel), bytes))?;
    /// let status = Status::Tachometer { steps: 1000, volts: 24.5 };
    /// assert_eq!(told, Reply::Status { from: wheel, status });
    /// # Ok::<(), UnpackError>(())
    /// ```
    #[inline]
    pub fn unpack(frame: &CanFrame) -> Result<Self, UnpackError> {
        let raw = frame.raw_id();
        if !frame.is_extended_id() {
            return Err(UnpackError::Standard);
        }
        if frame.is_remote() {
            return Err(UnpackError::Remote);
        }
        let [0, 0, number, id] = raw.to_be_bytes() else {
            return Err(UnpackError::UpperBits(raw));
        };
        let packet = Packet::from_number(number).ok_or(UnpackError::UnknownPacket(number))?;
        let vesc = |id| VescId::new(id).ok_or(UnpackError::Broadcast(packet));
        if packet == Packet::Pong {
            let &[from, hardware] = frame.bytes() else {
                return Err(UnpackError::Length(packet, frame.len()));
            };
            return Ok(Self::Pong { from: vesc(from)?, to: vesc(id)?, hardware });
        }
        let status = status(packet, frame)?;
        Ok(Self::Status { from: vesc(id)?, status })
    }
}

/// Of a data frame.
#[inline]
fn status(packet: Packet, frame: &CanFrame) -> Result<Status, UnpackError> {
    let bytes = || frame.all_eight().ok_or(UnpackError::Length(packet, frame.len()));
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
        other => return Err(UnpackError::NotAReply(other)),
    })
}

/// As two numbers.
#[inline]
const fn words(&[a, b, c, d, e, f, g, h]: &[u8; 8]) -> [i32; 2] {
    [i32::from_be_bytes([a, b, c, d]), i32::from_be_bytes([e, f, g, h])]
}

/// As four numbers.
#[inline]
fn halves(&[a, b, c, d, e, f, g, h]: &[u8; 8]) -> [f32; 4] {
    [[a, b], [c, d], [e, f], [g, h]].map(|half| i16::from_be_bytes(half).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rc10_can::embedded_can::{ExtendedId, StandardId};
    extern crate std;
    use std::string::ToString;

    fn id(raw: u8) -> VescId {
        VescId::new(raw).unwrap()
    }

    fn received(raw: u32, data: &[u8]) -> Result<Reply, UnpackError> {
        Reply::unpack(&CanFrame::data_frame(ExtendedId::new(raw).unwrap(), data).unwrap())
    }

    fn status(raw: u32, data: [u8; 8]) -> Status {
        match received(raw, &data) {
            Ok(Reply::Status { status, .. }) => status,
            other => panic!("{other:?}"),
        }
    }

    /// Frames of bldc's own sender (firmware 7.01).
    #[test]
    fn commands_are_those_of_the_firmware() {
        for (command, to, frame) in [
            (Command::Duty(0.25), 1, "00000001#000061A8"),
            (Command::Current(Amps::new(51.0)), 23, "00000117#0000C738"),
            (Command::Current(Amps::new(-0.001)), 42, "0000012A#FFFFFFFF"),
            (Command::Brake(Amps::new(12.25)), 33, "00000221#00002FDA"),
            (Command::Speed(ElectricalRpm::new(-100_000.0)), 6, "00000306#FFFE7960"),
            (Command::Position(Degrees::new(180.0)), 1, "00000401#0ABA9500"),
            (Command::Position(Degrees::new(-45.25)), 11, "0000040B#FD4D8A30"),
            (Command::RelativeCurrent(0.0625), 77, "00000A4D#0000186A"),
            (Command::RelativeBrake(0.75), 2, "00000B02#000124F8"),
            (Command::Handbrake(Amps::new(5.5)), 2, "00000C02#0000157C"),
            (Command::RelativeHandbrake(0.25), 2, "00000D02#000061A8"),
        ] {
            assert_eq!(command.pack(id(to)).unwrap().to_string(), frame);
        }
        assert_eq!(coast(Address::Every).to_string(), "000001FF#00000000");
        assert_eq!(ping(id(23), id(200)).to_string(), "00001117#C8");
        assert_eq!(shutdown(id(5)).to_string(), "00001F05#");
    }

    #[test]
    fn settings_are_those_of_the_firmware() {
        let limits = |min, max| (Amps::new(min), Amps::new(max));
        let (min, max) = limits(-60.0, 60.0);
        let setting = Setting::MotorCurrent { min, max };
        assert_eq!(setting.pack(id(1)).unwrap().to_string(), "00001501#FFFF15A00000EA60");
        let (min, max) = limits(-25.5, 40.25);
        let setting = Setting::MotorCurrent { min, max };
        assert_eq!(setting.pack_store(id(21)).unwrap().to_string(), "00001615#FFFF9C6400009D3A");
        let (min, max) = limits(-10.0, 30.0);
        let setting = Setting::InputCurrent { min, max };
        assert_eq!(setting.pack(id(1)).unwrap().to_string(), "00001701#FFFFD8F000007530");
        let (min, max) = limits(-5.0, 12.5);
        let setting = Setting::InputCurrent { min, max };
        assert_eq!(setting.pack_store(id(8)).unwrap().to_string(), "00001808#FFFFEC78000030D4");
        let setting = Setting::FieldOriented {
            openloop: ElectricalRpm::new(700.0),
            sensorless: ElectricalRpm::new(2500.0),
        };
        assert_eq!(setting.pack(id(1)).unwrap().to_string(), "00001901#000AAE60002625A0");
        assert_eq!(setting.pack_store(id(1)).unwrap().raw_id(), 0x1A01);
        let setting = Setting::BatteryCut { start: 20.0, end: 18.5 };
        assert_eq!(setting.pack(id(1)).unwrap().to_string(), "00001D01#00004E2000004844");
        assert_eq!(setting.pack_store(id(1)).unwrap().raw_id(), 0x1E01);
    }

    #[test]
    fn beyond_the_ends_is_at_the_ends() {
        let raw = |command: Command| {
            i32::from_be_bytes(command.pack(id(0)).unwrap().bytes().try_into().unwrap())
        };
        for huge in [f32::INFINITY, f32::MAX, 3e9] {
            assert_eq!(raw(Command::Duty(huge)), 100_000);
            assert_eq!(raw(Command::RelativeCurrent(-huge)), -100_000);
            assert_eq!(raw(Command::RelativeBrake(huge)), 100_000);
            assert_eq!(raw(Command::RelativeHandbrake(-huge)), -100_000);
            assert_eq!(raw(Command::Current(Amps::new(-huge))), i32::MIN);
            assert_eq!(raw(Command::Brake(Amps::new(huge))), i32::MAX);
            assert_eq!(raw(Command::Handbrake(Amps::new(huge))), i32::MAX);
            assert_eq!(raw(Command::Speed(ElectricalRpm::new(-huge))), i32::MIN);
            assert_eq!(raw(Command::Position(Degrees::new(huge))), i32::MAX);
            assert_eq!(raw(Command::Position(Degrees::new(-huge))), i32::MIN);
        }
        // To the last step: an f32 times a million alone would be 7 steps off.
        assert_eq!(raw(Command::Position(Degrees::new(359.9))), 359_899_994);
    }

    #[test]
    fn what_is_not_a_number_is_not_sent() {
        let nan = f32::NAN;
        for command in [
            Command::Duty(nan),
            Command::Current(Amps::new(nan)),
            Command::Brake(Amps::new(nan)),
            Command::Speed(ElectricalRpm::new(nan)),
            Command::Position(Degrees::new(nan)),
            Command::RelativeCurrent(nan),
            Command::RelativeBrake(nan),
            Command::Handbrake(Amps::new(nan)),
            Command::RelativeHandbrake(nan),
        ] {
            assert_eq!(command.pack(id(1)), Err(NotANumber { packet: command.packet() }));
        }
        let setting = Setting::BatteryCut { start: 20.0, end: nan };
        let packet = Packet::ConfStoreBatteryCut;
        assert_eq!(setting.pack_store(id(1)), Err(NotANumber { packet }));
        let setting = Setting::MotorCurrent { min: Amps::new(nan), max: Amps::ZERO };
        assert_eq!(setting.pack(id(1)), Err(NotANumber { packet: Packet::ConfCurrentLimits }));
    }

    fn near(actual: f32, expected: f32) {
        assert!((actual - expected).abs() <= 1e-6 * expected.abs(), "{actual} {expected}");
    }

    /// Frames of bldc's own broadcast (firmware 7.01).
    #[test]
    fn statuses_are_those_of_the_firmware() {
        let bytes = [0x00, 0x01, 0x86, 0xA0, 0x01, 0xC9, 0xFF, 0x06];
        let Status::Motion { speed, current, duty } = status(0x917, bytes) else { panic!() };
        near(speed.get(), 100_000.0);
        near(current.get(), 45.7);
        near(duty, -0.25);
        let bytes = [0x00, 0x00, 0x30, 0xD4, 0x00, 0x00, 0x13, 0x88];
        let Status::AmpHours { used, charged } = status(0xE01, bytes) else { panic!() };
        near(used, 1.25);
        near(charged, 0.5);
        let bytes = [0x00, 0x03, 0xBD, 0x08, 0x00, 0x00, 0x57, 0xE4];
        let Status::WattHours { used, charged } = status(0xF01, bytes) else { panic!() };
        near(used, 24.5);
        near(charged, 2.25);
        let bytes = [0x01, 0x6D, 0x01, 0x9C, 0x00, 0x37, 0x18, 0x1F];
        let Status::Temperatures { transistors, motor, input_current, position } =
            status(0x1001, bytes)
        else {
            panic!()
        };
        near(transistors.get(), 36.5);
        near(motor.get(), 41.2);
        near(input_current.get(), 5.5);
        near(position.get(), 123.5);
        let bytes = [0xFF, 0xFF, 0xFF, 0xFB, 0x00, 0xF5, 0x12, 0x34];
        let Status::Tachometer { steps, volts } = status(0x1B01, bytes) else { panic!() };
        assert_eq!(steps, -5);
        near(volts, 24.5);
        let bytes = [0x04, 0xE2, 0x09, 0xC4, 0x02, 0xEE, 0x01, 0xF4];
        let Status::Inputs { analogue: [first, second, third], ppm } = status(0x3A01, bytes) else {
            panic!()
        };
        near(first, 1.25);
        near(second, 2.5);
        near(third, 0.75);
        near(ppm, 0.5);
        let pong = Reply::Pong { from: id(23), to: id(200), hardware: 0 };
        assert_eq!(received(0x12C8, &[0x17, 0x00]), Ok(pong));
    }

    #[test]
    fn what_is_no_status_says_why() {
        use UnpackError::{Broadcast, Length, NotAReply, UnknownPacket, UpperBits};
        for (raw, len, error) in [
            (0x901, 7, Length(Packet::Status, 7)),
            (0x1B05, 5, Length(Packet::Status5, 5)),
            (0x3A05, 0, Length(Packet::Status6, 0)),
            (0x12C8, 1, Length(Packet::Pong, 1)),
            (0x12C8, 8, Length(Packet::Pong, 8)),
            (0x1C64, 8, NotAReply(Packet::PollTs5700n8501)),
            (0x301, 4, NotAReply(Packet::SetRpm)),
            (0x1117, 1, NotAReply(Packet::Ping)),
            (0xFF01, 8, UnknownPacket(0xFF)),
            (0x1_0901, 8, UpperBits(0x1_0901)),
            (0x1000_0901, 8, UpperBits(0x1000_0901)),
            (0x9FF, 8, Broadcast(Packet::Status)),
            (0x12FF, 2, Broadcast(Packet::Pong)),
        ] {
            assert_eq!(received(raw, &[0; 8][..len]), Err(error), "{raw:X} {len}");
        }
        assert_eq!(received(0x12C8, &[0xFF, 0]), Err(Broadcast(Packet::Pong)));
        let short = CanFrame::eight_bytes(StandardId::new(0x101).unwrap(), [0; 8]);
        assert_eq!(Reply::unpack(&short), Err(UnpackError::Standard));
        let remote = CanFrame::remote_frame(Packet::Status.id(id(1)), 8).unwrap();
        assert_eq!(Reply::unpack(&remote), Err(UnpackError::Remote));
    }
}
