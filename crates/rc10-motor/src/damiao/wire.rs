//! Commands and feedback as frames: rad, rad/s and N m at the output shaft.
//!
//! Packing limits first and never fails; NaN becomes zero, which for an angle
//! with stiffness is a place to go to: check before.

use embedded_can::StandardId;
use rc10_app::Celsius;
use rc10_can::CanFrame;

use crate::can_ids::standard;
use crate::feedback::Fault;
use crate::mit::{Limits, Setpoint, full, pack_positive, pack_signed, sendable, unpack_signed};
use crate::motor::FrameError;

/// The `CAN_ID` of a motor, register 8: of frames that it takes. It compares the low byte only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct DeviceId(u16);

impl DeviceId {
    /// The largest with which no command is a register frame.
    const LAST: u16 = REGISTERS - Mode::ForcePosition.offset() - 1;

    /// `None` above 0x4FE: with the largest offset added, it would be 0x7FF or no identifier.
    pub const fn new(raw: u16) -> Option<Self> {
        if raw <= Self::LAST { Some(Self(raw)) } else { None }
    }

    /// The number.
    #[must_use]
    pub const fn raw(self) -> u16 {
        self.0
    }

    /// The identifier of this motor's commands in a mode.
    #[must_use]
    pub fn command_id(self, mode: Mode) -> StandardId {
        standard(self.0 + mode.offset())
    }

    /// Whether a feedback with these four bits can be from this motor.
    #[must_use]
    pub const fn answers_as(self, id: u8) -> bool {
        self.0 & 0xF == id as u16
    }
}

/// Identifier of all register frames.
pub(super) const REGISTERS: u16 = 0x7FF;

/// The control mode: register 10, `CTRL_MODE`. Another mode's frames are not documented.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Mode {
    /// Position, velocity, gains and torque at once: [`mit`].
    #[default]
    Mit = 1,
    /// A position, at a velocity: [`position_velocity`].
    PositionVelocity = 2,
    /// A velocity: [`velocity`].
    Velocity = 3,
    /// A position, at a velocity and with a current: [`force_position`]. Not every model has it.
    ForcePosition = 4,
}

impl Mode {
    /// All four.
    pub const ALL: [Self; 4] =
        [Self::Mit, Self::PositionVelocity, Self::Velocity, Self::ForcePosition];

    /// Offset that is added to `CAN_ID` in commands of this mode: 0, 0x100, 0x200, 0x300.
    #[must_use]
    pub const fn offset(self) -> u16 {
        (self as u16 - 1) << 8
    }
}

/// A special command: seven bytes of 0xFF and one of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum Operation {
    /// Clear errors.
    ClearError = 0xFB,
    /// Let it move.
    Enable = 0xFC,
    /// No torque. (One vendor table swaps this with the next; the vendor's code does not.)
    Disable = 0xFD,
    /// The shaft's position now is zero, at once and for ever: never while it is enabled.
    StoreZero = 0xFE,
}

/// An operation's frame. New firmware takes the low byte only, old firmware its mode's offset.
pub fn operate(id: DeviceId, mode: Mode, operation: Operation) -> CanFrame {
    let last = operation as u8;
    let bytes = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last];
    CanFrame::eight_bytes(id.command_id(mode), bytes)
}

/// A setpoint in MIT mode: position in 16 bits, the others in 12 each, highest bit first.
///
/// With every field at its end it would be an [`Operation`]: `kd` goes one step lower then.
pub fn mit(id: DeviceId, setpoint: &Setpoint, limits: &Limits) -> CanFrame {
    let position = pack_signed::<16>(setpoint.position, limits.position);
    let velocity = pack_signed::<12>(setpoint.velocity, limits.velocity);
    let kp = pack_positive::<12>(setpoint.kp, limits.kp);
    let kd = pack_positive::<12>(setpoint.kd, limits.kd);
    let torque = pack_signed::<12>(setpoint.torque, limits.torque);
    let high = position << 16 | velocity << 4 | kp >> 8;
    let mut low = (kp & 0xFF) << 24 | kd << 12 | torque;
    if high == u32::MAX && (LOWEST_OPERATION..=HIGHEST_OPERATION).contains(&low) {
        low -= 1 << 12;
    }
    let [a, b, c, d] = high.to_be_bytes();
    let [e, f, g, h] = low.to_be_bytes();
    CanFrame::eight_bytes(id.command_id(Mode::Mit), [a, b, c, d, e, f, g, h])
}

/// Bytes 4 to 7 of the operations.
const LOWEST_OPERATION: u32 = 0xFFFF_FF00 | Operation::ClearError as u32;
const HIGHEST_OPERATION: u32 = 0xFFFF_FF00 | Operation::StoreZero as u32;

/// A position, approached with at most this velocity: two f32, little endian.
pub fn position_velocity(id: DeviceId, position: f32, velocity: f32) -> CanFrame {
    let [a, b, c, d] = sendable(position).to_le_bytes();
    let [e, f, g, h] = sendable(velocity).to_le_bytes();
    CanFrame::eight_bytes(id.command_id(Mode::PositionVelocity), [a, b, c, d, e, f, g, h])
}

/// A velocity: one f32, little endian, four bytes as in the manual; Python code sends eight.
pub fn velocity(id: DeviceId, velocity: f32) -> CanFrame {
    CanFrame::exact(id.command_id(Mode::Velocity), sendable(velocity).to_le_bytes())
}

/// A position, with a velocity (0 ..= 100 rad/s, steps of 0.01) and a current (a share, 0.0001).
pub fn force_position(id: DeviceId, position: f32, velocity: f32, current: f32) -> CanFrame {
    let [a, b, c, d] = sendable(position).to_le_bytes();
    let [e, f] = steps(velocity, VELOCITY_STEPS).to_le_bytes();
    let [g, h] = steps(current, CURRENT_STEPS).to_le_bytes();
    CanFrame::eight_bytes(id.command_id(Mode::ForcePosition), [a, b, c, d, e, f, g, h])
}

/// Per rad/s.
const VELOCITY_STEPS: f32 = 100.0;
const CURRENT_STEPS: f32 = 10_000.0;

/// The nearest number of steps, 0 ..= 10000; none for NaN.
fn steps(x: f32, per_unit: f32) -> u16 {
    const MOST: f32 = 10_000.0;
    // Selects the limit only for what is certainly above it: NaN goes on, and `as` makes it zero.
    let scaled = x * per_unit;
    let limited = if scaled > MOST { MOST } else { scaled };
    #[expect(clippy::cast_possible_truncation, reason = "`as` saturates")]
    return (limited + 0.5) as u16;
}

/// Whether a motor moves, by its own account: the high four bits of byte 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum State {
    /// The motor makes no torque, as told. (Not every model turns freely then: an H3510 brakes.)
    Disabled,
    /// The motor does what it is told.
    Enabled,
    /// The motor has stopped by itself; the code.
    Error(u8),
}

/// The state of a motor whose [time-out](super::registers::Register::TIMEOUT) ran out.
pub(super) const TIMED_OUT: State = State::Error(0xD);

/// States of a motor on the wire: manuals of J4310 and S3519 (5, 6).
pub(super) const ERRORS: [(u32, &str); 11] = [
    (0x0, "disabled"),
    (0x1, "enabled"),
    (0x5, "sensor error"),
    (0x6, "parameter error"),
    (0x8, "over-voltage"),
    (0x9, "under-voltage"),
    (0xA, "over-current"),
    (0xB, "transistors too hot"),
    (0xC, "coil too hot"),
    (0xD, "communication lost"),
    (0xE, "overload"),
];

impl State {
    /// The code on the wire, 0 ..= 15.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Disabled => 0,
            Self::Enabled => 1,
            Self::Error(code) => code,
        }
    }

    const fn from_code(code: u8) -> Self {
        match code {
            0 => Self::Disabled,
            1 => Self::Enabled,
            code => Self::Error(code),
        }
    }

    /// The fault that the state reports; `None` unless it is an error.
    #[must_use]
    pub fn fault(self) -> Option<Fault> {
        let Self::Error(code) = self else { return None };
        let known = ERRORS.iter().find(|(known, _)| *known == u32::from(code));
        let text = known.map_or("an error the manual does not name", |&(_, text)| text);
        Some(Fault::new(code.into(), text))
    }
}

/// The answer of a motor to every command.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Feedback {
    /// The low four bits of its `CAN_ID`: all that fits.
    pub id: u8,
    /// Whether it is enabled, or what is wrong.
    pub state: State,
    /// Position as its field, 0 ..= 65535.
    pub steps: u16,
    /// In rad.
    pub position: f32,
    /// In rad/s.
    pub velocity: f32,
    /// In N m.
    pub torque: f32,
    /// Temperature of the transistors.
    pub driver_temperature: Celsius,
    /// Temperature of the motor.
    pub motor_temperature: Celsius,
}

impl Feedback {
    /// From a frame with the motor's `MST_ID`; a [register](super::registers) reply looks alike.
    ///
    /// # Errors
    /// [`FrameError::NotMine`] if extended or remote, [`FrameError::Length`] unless eight bytes.
    pub fn unpack(frame: &CanFrame, limits: &Limits) -> Result<Self, FrameError> {
        if frame.is_extended_id() || frame.is_remote() {
            return Err(FrameError::NotMine);
        }
        let [head, a, b, c, d, e, driver, motor] = *frame.all_eight().ok_or(FrameError::Length)?;
        let steps = u16::from_be_bytes([a, b]);
        let rest = u32::from_be_bytes([0, c, d, e]);
        Ok(Self {
            id: head & 0xF,
            state: State::from_code(head >> 4),
            steps,
            position: unpack_signed::<16>(steps.into(), limits.position),
            velocity: unpack_signed::<12>(rest >> 12, limits.velocity),
            torque: unpack_signed::<12>(rest & full(12), limits.torque),
            driver_temperature: Celsius::new(driver.into()),
            motor_temperature: Celsius::new(motor.into()),
        })
    }
}

#[cfg(test)]
mod tests;
