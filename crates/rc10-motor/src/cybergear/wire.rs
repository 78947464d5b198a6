//! Commands and replies as frames: rad, rad/s and N m at the output shaft.
//!
//! Packing limits first and never fails; NaN becomes zero, which for an angle
//! with stiffness is a place to go to: check before.

use embedded_can::ExtendedId;
use rc10_app::Celsius;
use rc10_can::CanFrame;

use crate::mit::{Limits, Setpoint, full, pack_positive, pack_signed, sendable, unpack_signed};
use crate::motor::FrameError;

/// The identifiers of a motor and of the host that talks to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Address {
    /// The motor's identifier; 127 as it is sold.
    pub motor: u8,
    /// Ours; the motor puts it into its replies.
    pub host: u8,
}

/// Types of frames: bits 28 to 24 of the identifier.
pub(super) mod kind {
    pub const IDENTITY: u8 = 0;
    pub const MOTION: u8 = 1;
    pub const FEEDBACK: u8 = 2;
    pub const ENABLE: u8 = 3;
    pub const STOP: u8 = 4;
    pub const SET_ZERO: u8 = 6;
    pub const SET_ID: u8 = 7;
    pub const READ: u8 = 17;
    pub const WRITE: u8 = 18;
    pub const FAULTS: u8 = 21;
    /// RobStride only: a CyberGear changes its bit rate.
    pub const SAVE: u8 = 22;
    /// RobStride only.
    pub const REPORT: u8 = 24;
}

/// `middle` fills bits 23 to 8.
fn frame(kind: u8, middle: u16, motor: u8, data: [u8; 8]) -> CanFrame {
    let raw = u32::from(kind) << 24 | u32::from(middle) << 8 | u32::from(motor);
    CanFrame::eight_bytes(ExtendedId::new(raw).unwrap_or(ExtendedId::MAX), data)
}

const fn first(byte: u8) -> [u8; 8] {
    [byte, 0, 0, 0, 0, 0, 0, 0]
}

/// Asks which motor this is; answered with [`Reply::Identity`].
pub fn identify(to: Address) -> CanFrame {
    frame(kind::IDENTITY, to.host.into(), to.motor, first(0))
}

/// Lets the motor move; answered with feedback, like all that follow up to [`set_zero`].
pub fn enable(to: Address) -> CanFrame {
    frame(kind::ENABLE, to.host.into(), to.motor, first(0))
}

/// Stops the motor: no torque.
pub fn stop(to: Address) -> CanFrame {
    frame(kind::STOP, to.host.into(), to.motor, first(0))
}

/// Stops the motor, and makes it forget its faults.
pub fn clear_faults(to: Address) -> CanFrame {
    frame(kind::STOP, to.host.into(), to.motor, first(1))
}

/// A setpoint in four fields of 16 bits, and the torque **in the identifier**, bits 23 to 8.
pub fn motion(motor: u8, setpoint: &Setpoint, limits: &Limits) -> CanFrame {
    let position = pack_signed::<16>(setpoint.position, limits.position);
    let velocity = pack_signed::<16>(setpoint.velocity, limits.velocity);
    let kp = pack_positive::<16>(setpoint.kp, limits.kp);
    let kd = pack_positive::<16>(setpoint.kd, limits.kd);
    let torque = pack_signed::<16>(setpoint.torque, limits.torque);
    let [a, b, c, d] = (position << 16 | velocity).to_be_bytes();
    let [e, f, g, h] = (kp << 16 | kd).to_be_bytes();
    #[expect(clippy::cast_possible_truncation, reason = "a field of 16 bits")]
    return frame(kind::MOTION, torque as u16, motor, [a, b, c, d, e, f, g, h]);
}

/// Makes the position zero at once: never while it runs. A CyberGear forgets it without power.
pub fn set_zero(to: Address) -> CanFrame {
    frame(kind::SET_ZERO, to.host.into(), to.motor, first(1))
}

/// Gives the motor another identifier, at once; answered with [`Reply::Identity`].
pub fn set_id(to: Address, new: u8) -> CanFrame {
    frame(kind::SET_ID, u16::from_be_bytes([new, to.host]), to.motor, first(1))
}

/// A setting or measurement, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Parameter(pub u16);

impl Parameter {
    /// One byte: 0 motion, 1 position, 2 velocity, 3 current.
    pub const RUN_MODE: Self = Self(0x7005);
    /// Current to follow, A.
    pub const CURRENT: Self = Self(0x7006);
    /// Velocity to follow, rad/s.
    pub const VELOCITY: Self = Self(0x700A);
    /// Largest torque, N m.
    pub const TORQUE_LIMIT: Self = Self(0x700B);
    /// Position to go to, rad.
    pub const POSITION: Self = Self(0x7016);
    /// Largest velocity on the way there, rad/s.
    pub const VELOCITY_LIMIT: Self = Self(0x7017);
    /// Largest current, A.
    pub const CURRENT_LIMIT: Self = Self(0x7018);
    /// `canTimeout` of a RobStride: silence after which it stops, in steps of 50 µs; 0: never.
    pub const TIMEOUT: Self = Self(0x7028);
    /// Position of the shaft, rad, all turns counted; read only.
    pub const MEASURED_POSITION: Self = Self(0x7019);
    /// Velocity of the shaft, rad/s; read only.
    pub const MEASURED_VELOCITY: Self = Self(0x701B);
    /// Supply, V; read only.
    pub const SUPPLY: Self = Self(0x701C);
}

/// Asks for a parameter; answered with [`Reply::Parameter`].
pub fn read(to: Address, parameter: Parameter) -> CanFrame {
    access(kind::READ, to, parameter, [0; 4])
}

/// Sets a parameter, little endian, until the power is cut; answered with feedback.
pub fn write(to: Address, parameter: Parameter, bytes: [u8; 4]) -> CanFrame {
    access(kind::WRITE, to, parameter, bytes)
}

/// Sets a parameter of one byte, until the power is cut.
pub fn write_byte(to: Address, parameter: Parameter, value: u8) -> CanFrame {
    access(kind::WRITE, to, parameter, [value, 0, 0, 0])
}

/// Sets an f32 parameter, until the power is cut.
pub fn write_real(to: Address, parameter: Parameter, value: f32) -> CanFrame {
    access(kind::WRITE, to, parameter, sendable(value).to_le_bytes())
}

/// A RobStride keeps its parameters. **Never to a CyberGear**: there it is a new bit rate.
pub fn save(to: Address) -> CanFrame {
    frame(kind::SAVE, to.host.into(), to.motor, [1, 2, 3, 4, 5, 6, 7, 8])
}

fn access(kind: u8, to: Address, parameter: Parameter, value: [u8; 4]) -> CanFrame {
    let [low, high] = parameter.0.to_le_bytes();
    let [a, b, c, d] = value;
    frame(kind, to.host.into(), to.motor, [low, high, 0, 0, a, b, c, d])
}

/// A frame from a motor, decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reply {
    /// The state of the motor: the answer to a command, or a RobStride's report of its own accord.
    Feedback(Feedback),
    /// The value of a parameter.
    Parameter(ParameterValue),
    /// All faults in detail.
    Faults(FaultReport),
    /// The identity of the motor: its identifier, and the number of its chip.
    Identity {
        /// The motor's identifier.
        motor: u8,
        /// Eight bytes as they came, big endian.
        chip: u64,
    },
}

/// Whether a motor moves: bits 23 and 22 of the identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Mode {
    /// The motor stands: stopped, or never enabled.
    Reset = 0,
    /// The motor calibrates itself.
    Calibration = 1,
    /// The motor does what it is told.
    Run = 2,
    /// Not documented.
    Unknown = 3,
}

/// The feedback of a motor: types 2 and 24.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Feedback {
    /// From, and to.
    pub address: Address,
    /// Whether it moves.
    pub mode: Mode,
    /// Fault bits of the motor, 0 ..= 0x3F: bits 21 to 16 of the identifier.
    pub faults: u8,
    /// Position as its field, 0 ..= 65535.
    pub steps: u16,
    /// In rad.
    pub position: f32,
    /// In rad/s.
    pub velocity: f32,
    /// In N m.
    pub torque: f32,
    /// The motor's temperature, in steps of 0.1.
    pub temperature: Celsius,
}

/// The value of a parameter: type 17.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterValue {
    /// From, and to.
    pub address: Address,
    /// The parameter.
    pub parameter: Parameter,
    /// There is no such one, and the bytes mean nothing (RobStride manuals, type 17: bits 23 to 16).
    pub refused: bool,
    /// Little endian.
    pub bytes: [u8; 4],
}

impl ParameterValue {
    /// The bytes as an f32; `None` if it is infinite or NaN.
    pub const fn real(&self) -> Option<f32> {
        let real = f32::from_le_bytes(self.bytes);
        if real.is_finite() { Some(real) } else { None }
    }

    /// The first byte.
    pub const fn byte(&self) -> u8 {
        self.bytes[0]
    }
}

/// The faults and warnings of a motor: type 21. The models have the texts of the bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultReport {
    /// From, and to. The vendor's table prints the two the other way round for this frame alone.
    pub address: Address,
    /// Nothing is wrong if it is zero.
    pub faults: u32,
    /// Bit 0: the motor is getting hot (75 °C).
    pub warnings: u32,
}

impl Reply {
    /// From a frame; whose it is, the [`Address`] in it tells.
    ///
    /// # Errors
    /// [`FrameError::NotMine`] for a standard or remote frame, or one that only a host sends;
    /// [`FrameError::Length`] unless there are eight bytes.
    pub fn unpack(frame: &CanFrame, limits: &Limits) -> Result<Self, FrameError> {
        if !frame.is_extended_id() || frame.is_remote() {
            return Err(FrameError::NotMine);
        }
        let [kind, upper, motor, host] = frame.raw_id().to_be_bytes();
        let address = Address { motor, host };
        let bytes = frame.all_eight().ok_or(FrameError::Length);
        match kind {
            kind::FEEDBACK | kind::REPORT => {
                Ok(Self::Feedback(feedback(address, upper, bytes?, limits)))
            }
            kind::READ => {
                let [low, high, _, _, a, b, c, d] = *bytes?;
                let parameter = Parameter(u16::from_le_bytes([low, high]));
                let bytes = [a, b, c, d];
                let refused = upper != 0;
                Ok(Self::Parameter(ParameterValue { address, parameter, refused, bytes }))
            }
            kind::FAULTS => {
                let [a, b, c, d, e, f, g, h] = *bytes?;
                let faults = u32::from_le_bytes([a, b, c, d]);
                let warnings = u32::from_le_bytes([e, f, g, h]);
                Ok(Self::Faults(FaultReport { address, faults, warnings }))
            }
            // 0xFE instead of a host: to everybody.
            kind::IDENTITY if host == 0xFE => {
                Ok(Self::Identity { motor, chip: u64::from_be_bytes(*bytes?) })
            }
            _ => Err(FrameError::NotMine),
        }
    }
}

fn feedback(address: Address, upper: u8, bytes: &[u8; 8], limits: &Limits) -> Feedback {
    let [a, b, c, d, e, f, g, h] = *bytes;
    let motion = u32::from_be_bytes([a, b, c, d]);
    let rest = u32::from_be_bytes([e, f, g, h]);
    Feedback {
        address,
        mode: match upper >> 6 {
            0 => Mode::Reset,
            1 => Mode::Calibration,
            2 => Mode::Run,
            _ => Mode::Unknown,
        },
        faults: upper & 0x3F,
        steps: u16::from_be_bytes([a, b]),
        position: unpack_signed::<16>(motion >> 16, limits.position),
        velocity: unpack_signed::<16>(motion & full(16), limits.velocity),
        torque: unpack_signed::<16>(rest >> 16, limits.torque),
        temperature: Celsius::new((rest & full(16)) as f32 * DEGREES_PER_STEP),
    }
}

const DEGREES_PER_STEP: f32 = 0.1;

#[cfg(test)]
mod tests;
