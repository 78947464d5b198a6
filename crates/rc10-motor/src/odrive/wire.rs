//! Bytes of `ODrive`'s `CANSimple` as values, and back. Pure, without state.

use embedded_can::StandardId;
use rc10_app::maths::round_to_i16;
use rc10_app::{Amps, Celsius, NewtonMetres};
use rc10_can::CanFrame;

use crate::can_ids::standard;
use crate::mit::sendable;
use crate::motor::FrameError;
use crate::not_a_number::NotANumber;

// Message numbers: ODrive firmware 0.5.6, `can_simple.hpp`; the same in 0.6.
pub(super) const HEARTBEAT: u8 = 0x01;
pub(super) const STATE: u8 = 0x07;
pub(super) const ESTIMATES: u8 = 0x09;
pub(super) const MODES: u8 = 0x0B;
pub(super) const POSITION: u8 = 0x0C;
pub(super) const VELOCITY: u8 = 0x0D;
pub(super) const TORQUE: u8 = 0x0E;
pub(super) const LIMITS: u8 = 0x0F;
pub(super) const CURRENTS: u8 = 0x14;
/// Firmware 0.6 only; in 0.5 it is something else.
pub(super) const TEMPERATURES: u8 = 0x15;
pub(super) const SUPPLY: u8 = 0x17;
pub(super) const CLEAR_ERRORS: u8 = 0x18;

const LAST_NODE: u8 = 63;
pub(super) const MESSAGE_BITS: u32 = 5;
const MESSAGE_MASK: u16 = (1 << MESSAGE_BITS) - 1;

/// A position's feed-forwards: 0.001 turns/s, 0.001 N m (0.5.6, `set_input_pos_callback`).
const STEPS_PER_FEED_FORWARD: f32 = 1000.0;

/// An axis on the bus: 0 ..= 63.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Node(u8);

impl Node {
    /// `None` above 63.
    pub const fn new(number: u8) -> Option<Self> {
        if number <= LAST_NODE { Some(Self(number)) } else { None }
    }

    /// The number set on the device.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// The identifier of one of its messages, of which the lower five bits count.
    #[must_use]
    pub const fn can_id(self, message: u8) -> StandardId {
        standard((self.0 as u16) << MESSAGE_BITS | message as u16 & MESSAGE_MASK)
    }

    /// Node and message number of an identifier: every standard one has both.
    pub fn of(id: StandardId) -> (Self, u8) {
        let [node, message] = [id.as_raw() >> MESSAGE_BITS, id.as_raw() & MESSAGE_MASK];
        #[expect(clippy::cast_possible_truncation, reason = "six bits, five bits")]
        return (Self(node as u8), message as u8);
    }
}

/// The state of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct AxisState(u8);

/// Names of the states, in order (0.5.6 `AxisState`, 0.6.7 from 11 on; 5 up to 0.5.1).
pub(super) const AXIS_STATES: [&str; 15] = [
    "undefined",
    "idle",
    "startup sequence",
    "full calibration",
    "motor calibration",
    "sensorless control",
    "encoder index search",
    "encoder offset calibration",
    "closed-loop control",
    "lock-in spin",
    "encoder direction search",
    "homing",
    "encoder hall polarity calibration",
    "encoder hall phase calibration",
    "anticogging calibration",
];

impl AxisState {
    /// No torque.
    pub const IDLE: Self = Self(1);
    /// Follows its inputs.
    pub const CLOSED_LOOP: Self = Self(8);

    /// Any state, by its number.
    pub const fn new(number: u8) -> Self {
        Self(number)
    }

    /// The number on the wire.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// The name; `None` for a state that is not documented.
    #[must_use]
    pub fn name(self) -> Option<&'static str> {
        AXIS_STATES.get(usize::from(self.0)).copied()
    }
}

/// The control mode of an axis: the loops that run (firmware 0.5.6 `ControlMode`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum ControlMode {
    /// None: a voltage, for gimbal motors.
    Voltage = 0,
    /// Only the current's.
    Torque = 1,
    /// And the velocity's.
    Velocity = 2,
    /// And the position's.
    Position = 3,
}

/// The processing of an input before it reaches the loops (firmware 0.5.6 `InputMode`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub enum InputMode {
    /// Inputs are ignored.
    Inactive = 0,
    /// Nothing.
    Passthrough = 1,
    /// Velocities are ramped.
    VelocityRamp = 2,
    /// Positions are filtered.
    PositionFilter = 3,
    /// Not implemented by the vendor.
    MixChannels = 4,
    /// Positions become trapezoidal trajectories.
    Trapezoid = 5,
    /// Torques are ramped.
    TorqueRamp = 6,
    /// Another axis is followed.
    Mirror = 7,
    /// A test signal is added.
    Tuning = 8,
}

/// A command to an axis, in turns and turns a second of the encoder's shaft, the wire's units:
/// every value arrives as given. What is infinite becomes the largest f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// `07`: do this.
    State(AxisState),
    /// `0B`: how inputs are understood.
    Modes(ControlMode, InputMode),
    /// `0C`: be there.
    Position {
        /// Turns.
        position: f32,
        /// Feed-forward, ±32.767 turns/s.
        velocity: f32,
        /// Feed-forward, ±32.767 N m.
        torque: NewtonMetres,
    },
    /// `0D`: turn as fast.
    Velocity {
        /// Turns a second.
        velocity: f32,
        /// Feed-forward.
        torque: NewtonMetres,
    },
    /// `0E`: push as much.
    Torque(NewtonMetres),
    /// `0F`: never more than this.
    Limits {
        /// Turns a second, not negative.
        velocity: f32,
        /// The motor's current limit, not negative.
        current: Amps,
    },
    /// `18`: forget the errors.
    ClearErrors,
}

impl Command {
    /// The frame for an axis.
    ///
    /// # Errors
    /// [`NotANumber`]; neutral is zero for the NaN; for a position, velocity and torque zero, which
    /// leave it; for limits zero both.
    pub fn pack(&self, node: Node) -> Result<CanFrame, NotANumber> {
        let frame = |message, low: [u8; 4], high: [u8; 4]| {
            let ([a, b, c, d], [e, f, g, h]) = (low, high);
            CanFrame::eight_bytes(node.can_id(message), [a, b, c, d, e, f, g, h])
        };
        let floats = |message, low: f32, high: f32| {
            frame(message, sendable(low).to_le_bytes(), sendable(high).to_le_bytes())
        };
        // Of a command with up to two numbers: the one that is NaN.
        let checked = |frame, numbers: [(f32, &'static str); 2]| match numbers
            .iter()
            .find(|(number, _)| number.is_nan())
        {
            None => Ok(frame),
            Some(&(_, field)) => Err(NotANumber { field, neutral: frame }),
        };
        match *self {
            Self::State(state) => Ok(frame(STATE, [state.0, 0, 0, 0], [0; 4])),
            Self::Modes(control, input) => {
                Ok(frame(MODES, [control as u8, 0, 0, 0], [input as u8, 0, 0, 0]))
            }
            Self::Position { position, velocity, torque } => {
                if position.is_nan() {
                    let neutral = floats(VELOCITY, 0.0, 0.0);
                    return Err(NotANumber { field: "position", neutral });
                }
                let torque = torque.get();
                let [e, f] = round_to_i16(velocity * STEPS_PER_FEED_FORWARD).to_le_bytes();
                let [g, h] = round_to_i16(torque * STEPS_PER_FEED_FORWARD).to_le_bytes();
                checked(
                    frame(POSITION, sendable(position).to_le_bytes(), [e, f, g, h]),
                    [(velocity, "velocity"), (torque, "torque")],
                )
            }
            Self::Velocity { velocity, torque } => checked(
                floats(VELOCITY, velocity, torque.get()),
                [(velocity, "velocity"), (torque.get(), "torque")],
            ),
            Self::Torque(torque) => {
                checked(floats(TORQUE, torque.get(), 0.0), [(torque.get(), "torque"), (0.0, "")])
            }
            Self::Limits { velocity, current } => {
                let current = current.get();
                let is_nan = velocity.is_nan() || current.is_nan();
                let [low, high] =
                    [velocity, current].map(|x| if is_nan { 0.0 } else { x.max(0.0) });
                let numbers = [(velocity, "velocity limit"), (current, "current limit")];
                checked(floats(LIMITS, low, high), numbers)
            }
            Self::ClearErrors => Ok(CanFrame::exact(node.can_id(CLEAR_ERRORS), [])),
        }
    }
}

/// A message that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// `09`.
    Estimates = ESTIMATES as isize,
    /// `14`.
    Currents = CURRENTS as isize,
    /// `17`.
    Supply = SUPPLY as isize,
}

impl Query {
    /// The remote frame that asks an axis for it.
    #[must_use]
    pub fn pack(self, node: Node) -> CanFrame {
        let id = node.can_id(self as u8);
        // Eight bytes are not too many.
        CanFrame::remote_frame(id, 8).unwrap_or_else(|_| CanFrame::exact(id, []))
    }
}

/// State and errors of an axis: message `01`, sent every 100 ms from the factory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// Bits of [`Firmware::errors`](super::Firmware::errors); 0 if nothing is wrong.
    pub errors: u32,
    /// State of the axis.
    pub state: AxisState,
    /// Bytes 5 ..= 7. 0.5: errors of motor, encoder, controller (bit 0 each), bit 7 of the last:
    /// trajectory done. 0.6: result of the last procedure, trajectory done, reserved.
    pub details: [u8; 3],
}

/// Position and velocity of an axis: message `09`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimates {
    /// Turns.
    pub position: f32,
    /// Turns a second.
    pub velocity: f32,
}

/// Torque current of an axis: message `14`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Currents {
    /// Setpoint of the current loop.
    pub setpoint: Amps,
    /// Measured current.
    pub measured: Amps,
}

/// Supply of an axis: message `17`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Volts.
    pub voltage: f32,
    /// Negative if the axis feeds the supply.
    pub current: Amps,
}

/// Temperatures: message `15` of firmware 0.6; in 0.5 it is another, so no [`Message`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Temperatures {
    /// The power stage's temperature; NaN without a sensor.
    pub controller: Celsius,
    /// The motor's temperature; NaN without a sensor.
    pub motor: Celsius,
}

impl Temperatures {
    /// From such a frame of an axis with firmware 0.6. What is infinite counts as not measured.
    pub fn from_frame(frame: &CanFrame, node: Node) -> Result<Self, FrameError> {
        let (message, [a, b, c, d, e, f, g, h]) = parts(frame, node)?;
        if message != TEMPERATURES {
            return Err(FrameError::Unexpected);
        }
        let celsius = |bytes| {
            let celsius = f32::from_le_bytes(bytes);
            Celsius::new(if celsius.is_finite() { celsius } else { f32::NAN })
        };
        Ok(Self { controller: celsius([a, b, c, d]), motor: celsius([e, f, g, h]) })
    }
}

/// A message of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// `01`.
    Heartbeat(Heartbeat),
    /// `09`.
    Estimates(Estimates),
    /// `14`.
    Currents(Currents),
    /// `17`.
    Supply(Supply),
}

/// Number and bytes of a message: of this node, standard, no request, and eight bytes long.
fn parts(frame: &CanFrame, node: Node) -> Result<(u8, [u8; 8]), FrameError> {
    // The key of a standard data frame is its identifier, and larger for every other frame.
    if frame.key() >> MESSAGE_BITS != u32::from(node.0) {
        return Err(FrameError::NotMine);
    }
    #[expect(clippy::cast_possible_truncation, reason = "five bits")]
    let message = (frame.key() as u16 & MESSAGE_MASK) as u8;
    frame.all_eight().map(|bytes| (message, *bytes)).ok_or(FrameError::Length)
}

impl Message {
    /// From a frame of an axis.
    ///
    /// # Errors
    /// [`FrameError::NotMine`], [`FrameError::Length`] unless eight bytes,
    /// [`FrameError::Unexpected`] for a message not read here, or a number that is infinite or NaN.
    pub fn from_frame(frame: &CanFrame, node: Node) -> Result<Self, FrameError> {
        let (message, [a, b, c, d, e, f, g, h]) = parts(frame, node)?;
        let floats = || {
            let low = f32::from_le_bytes([a, b, c, d]);
            let high = f32::from_le_bytes([e, f, g, h]);
            let finite = low.is_finite() && high.is_finite();
            if finite { Ok((low, high)) } else { Err(FrameError::Unexpected) }
        };
        match message {
            ESTIMATES => floats()
                .map(|(position, velocity)| Self::Estimates(Estimates { position, velocity })),
            HEARTBEAT => Ok(Self::Heartbeat(Heartbeat {
                errors: u32::from_le_bytes([a, b, c, d]),
                state: AxisState(e),
                details: [f, g, h],
            })),
            CURRENTS => floats().map(|(setpoint, measured)| {
                Self::Currents(Currents {
                    setpoint: Amps::new(setpoint),
                    measured: Amps::new(measured),
                })
            }),
            SUPPLY => floats().map(|(voltage, current)| {
                Self::Supply(Supply { voltage, current: Amps::new(current) })
            }),
            _ => Err(FrameError::Unexpected),
        }
    }
}

#[cfg(test)]
mod tests;
