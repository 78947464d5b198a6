//! Bytes of the LK-TECH protocol as values, and back. Pure, without state.

use embedded_can::StandardId;
use rc10_app::maths::{Ratio, round_to_i32};
use rc10_app::{Amps, Celsius, CountsPerTurn, Degrees, RotorRpm, TotalAngle};
use rc10_can::CanFrame;

use super::config::Model;
use crate::can_ids::standard;
use crate::feedback::Fault;
use crate::motor::FrameError;
use crate::not_a_number::NotANumber;

// Command bytes: LK CAN manual V2.3, table of commands.
pub(super) const OFF: u8 = 0x80;
pub(super) const STOP: u8 = 0x81;
pub(super) const RUN: u8 = 0x88;
pub(super) const MULTI_TURN: u8 = 0x92;
pub(super) const SINGLE_TURN: u8 = 0x94;
pub(super) const HEALTH: u8 = 0x9A;
pub(super) const CLEAR_ERRORS: u8 = 0x9B;
pub(super) const MOTION: u8 = 0x9C;
pub(super) const PHASE_CURRENTS: u8 = 0x9D;
pub(super) const OPEN_LOOP: u8 = 0xA0;
pub(super) const CURRENT: u8 = 0xA1;
pub(super) const SPEED: u8 = 0xA2;
pub(super) const TURN_TO: u8 = 0xA3;
pub(super) const TURN_TO_LIMITED: u8 = 0xA4;
pub(super) const TURN_WITHIN: u8 = 0xA5;
pub(super) const TURN_WITHIN_LIMITED: u8 = 0xA6;
pub(super) const TURN_BY: u8 = 0xA7;
pub(super) const TURN_BY_LIMITED: u8 = 0xA8;

/// Commands and answers of a drive stand at this plus its identifier (manual V2.3).
pub(super) const BASE_ID: u16 = 0x140;
const LAST_ID: u8 = 32;

/// The frame that carries the current of drives 1 ..= 4 (manual V2.3, multi-motor command).
pub const MULTI_MOTOR_ID: StandardId = standard(MULTI_MOTOR);
pub(super) const MULTI_MOTOR: u16 = 0x280;

/// Raw iq at full scale, of every model (manual V2.3, answer to `9C`: ±2048; librm too).
pub(super) const FULL_SCALE: i16 = 2048;
/// Raw open-loop power at full scale (manual V2.3, command `A0`: ±850).
const OPEN_LOOP_FULL_SCALE: i16 = 850;
/// Speed in commands: 0.01 degrees/s a step (manual V2.3, command `A2`); 6 degrees/s are 1 rpm.
const SPEED_STEPS_PER_RPM: f32 = 600.0;
/// Speed in answers and as a limit: 1 degree/s a step (manual V2.3, `9C` and `A4`).
const DEGREES_PER_SECOND_PER_RPM: f32 = 6.0;
/// Angles: 0.01 degrees a step (manual V2.3, `A3` and `92`), so 36,000 make a turn.
pub const CENTIDEGREES: CountsPerTurn = CountsPerTurn::new(36_000, 1);
/// The same step in microdegrees.
const STEP: i64 = 10_000;
const STEPS: Ratio = Ratio::new(1, STEP.cast_unsigned());
/// Supply voltage: 0.1 V a step (manual V2.3, answer to `9A`).
const VOLTS_PER_STEP: f32 = 0.1;
/// Phase current: 64 steps an ampere (manual V2.3, answer to `9D`).
const PHASE_AMPS_PER_STEP: f32 = 1.0 / 64.0;

/// The identifier set on a drive: 1 ..= 32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveId {
    number: u8,
    can: StandardId,
}

impl DriveId {
    /// `None` unless 1 ..= 32.
    pub const fn new(number: u8) -> Option<Self> {
        if number == 0 || number > LAST_ID {
            return None;
        }
        Some(Self { number, can: standard(BASE_ID + number as u16) })
    }

    /// The number set on the drive.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.number
    }

    /// The identifier of single commands to the drive and of its answers: `0x140` plus the number.
    #[must_use]
    pub const fn can_id(self) -> StandardId {
        self.can
    }

    /// The first of its two bytes in the frame [`MULTI_MOTOR_ID`]; `None` for drives above 4.
    #[must_use]
    pub const fn multi_motor_lane(self) -> Option<usize> {
        if self.number <= 4 { Some((self.number as usize - 1) * 2) } else { None }
    }
}

/// The way round to an angle within a turn: the manual's `spinDirection`, byte 1 of `A5` and `A6`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpinDirection {
    /// The way angles count up.
    Clockwise = 0,
    /// The other way.
    CounterClockwise = 1,
}

/// A command to a drive. Angles and speeds are the rotor's, and limited to their range.
#[derive(Clone, Copy, Debug)]
pub enum Command {
    /// `80`: no torque, and what it was doing is forgotten. Echoed.
    Off,
    /// `81`: stops, but knows what it was doing. Echoed.
    Stop,
    /// `88`: goes on after a stop. Echoed.
    Run,
    /// `A0`, MS only: a voltage in the drive's own steps, ±850 at full scale.
    OpenLoop(i16),
    /// `A1`, not MS: torque current, ±2048 steps of the model.
    Current(Amps),
    /// `A2`: speed in steps of 0.01 degrees/s, ±3,579,139 rpm.
    Speed(RotorRpm),
    /// `A3`; `A4` if there is a limit: to an angle over many turns, ±59,652 turns.
    TurnTo {
        /// The angle to turn to.
        angle: TotalAngle,
        /// Largest speed on the way, 0 ..= 10,922 rpm, in steps of 1 degree/s.
        speed_limit: Option<RotorRpm>,
    },
    /// `A5`; `A6` if there is a limit: to an angle within a turn.
    TurnWithin {
        /// The angle to turn to, 0 ..= 359.99 degrees.
        angle: Degrees,
        /// The way round.
        direction: SpinDirection,
        /// The limit, like [`TurnTo`](Self::TurnTo)'s.
        speed_limit: Option<RotorRpm>,
    },
    /// `A7`; `A8` if there is a limit: by an angle from here, ±59,652 turns.
    TurnBy {
        /// The angle to turn by.
        angle: TotalAngle,
        /// The limit, like [`TurnTo`](Self::TurnTo)'s.
        speed_limit: Option<RotorRpm>,
    },
    /// `9A`: asks for [`Health`].
    ReadHealth,
    /// `9B`: clears the errors whose cause is gone; answered by [`Health`].
    ClearErrors,
    /// `9C`: asks for [`Motion`].
    ReadMotion,
    /// `9D`: asks for [`PhaseCurrents`].
    ReadPhaseCurrents,
    /// `92`: asks for [`Reply::MultiTurn`].
    ReadMultiTurn,
    /// `94`: asks for [`Reply::SingleTurn`].
    ReadSingleTurn,
}

impl Command {
    /// The frame for a drive. The model matters only to [`Command::Current`].
    ///
    /// # Errors
    /// [`NotANumber`]; neutral is current or speed zero, and [`Command::ReadMotion`] for angles.
    pub fn pack(&self, id: DriveId, model: &Model) -> Result<CanFrame, NotANumber> {
        const READ_MOTION: [u8; 8] = [MOTION, 0, 0, 0, 0, 0, 0, 0];
        let plain = |command| Ok([command, 0, 0, 0, 0, 0, 0, 0]);
        let number = |field, value: f32, bytes| {
            if value.is_nan() { Err((field, bytes)) } else { Ok(bytes) }
        };
        let turn = |[free, limited]: [u8; 2], direction, angle: i32, limit: Option<RotorRpm>| {
            let [e, f, g, h] = angle.to_le_bytes();
            let Some(limit) = limit else { return Ok([free, direction, 0, 0, e, f, g, h]) };
            let steps = round_to_i32(limit.get() * DEGREES_PER_SECOND_PER_RPM);
            let [c, d, ..] = steps.clamp(0, 0xFFFF).to_le_bytes();
            number("speed limit", limit.get(), READ_MOTION)?;
            Ok([limited, direction, c, d, e, f, g, h])
        };
        let packed = match *self {
            Self::Off => plain(OFF),
            Self::Stop => plain(STOP),
            Self::Run => plain(RUN),
            Self::ReadHealth => plain(HEALTH),
            Self::ClearErrors => plain(CLEAR_ERRORS),
            Self::ReadMotion => plain(MOTION),
            Self::ReadPhaseCurrents => plain(PHASE_CURRENTS),
            Self::ReadMultiTurn => plain(MULTI_TURN),
            Self::ReadSingleTurn => plain(SINGLE_TURN),
            Self::OpenLoop(power) => {
                let [e, f] = power.clamp(-OPEN_LOOP_FULL_SCALE, OPEN_LOOP_FULL_SCALE).to_le_bytes();
                Ok([OPEN_LOOP, 0, 0, 0, e, f, 0, 0])
            }
            Self::Current(current) => {
                let [e, f] = model.raw_current(current).to_le_bytes();
                number("current", current.get(), [CURRENT, 0, 0, 0, e, f, 0, 0])
            }
            Self::Speed(speed) => {
                let [e, f, g, h] = round_to_i32(speed.get() * SPEED_STEPS_PER_RPM).to_le_bytes();
                number("speed", speed.get(), [SPEED, 0, 0, 0, e, f, g, h])
            }
            Self::TurnTo { angle, speed_limit } => {
                turn([TURN_TO, TURN_TO_LIMITED], 0, steps(angle), speed_limit)
            }
            Self::TurnBy { angle, speed_limit } => {
                turn([TURN_BY, TURN_BY_LIMITED], 0, steps(angle), speed_limit)
            }
            Self::TurnWithin { angle, direction, speed_limit } => {
                let steps = round_to_i32(angle.get() * 100.0).clamp(0, 35_999);
                let commands = [TURN_WITHIN, TURN_WITHIN_LIMITED];
                number("angle", angle.get(), READ_MOTION)
                    .and_then(|_| turn(commands, direction as u8, steps, speed_limit))
            }
        };
        let frame = |bytes| CanFrame::eight_bytes(id.can, bytes);
        packed.map(frame).map_err(|(field, bytes)| NotANumber { field, neutral: frame(bytes) })
    }
}

/// The nearest step of an angle, halves away from zero.
fn steps(angle: TotalAngle) -> i32 {
    let steps = STEPS.times(angle.microdegrees());
    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
    return steps.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
}

fn angle(steps: i64) -> TotalAngle {
    TotalAngle::from_microdegrees(steps.saturating_mul(STEP))
}

/// The raw iq of drives 1 ..= 4 ([`Model::raw_current`]), not limited, at [`MULTI_MOTOR_ID`].
pub fn pack_multi_motor(raw: [i16; 4]) -> CanFrame {
    let [[a, b], [c, d], [e, f], [g, h]] = raw.map(i16::to_le_bytes);
    CanFrame::eight_bytes(MULTI_MOTOR_ID, [a, b, c, d, e, f, g, h])
}

/// The measurement in the answer to every command that moves, and to [`Command::ReadMotion`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Motion {
    /// The command that this answers: `9C`, `A0` ..= `A8`.
    pub command: u8,
    /// Degrees Celsius.
    pub temperature: i8,
    /// Torque current in steps ([`Model::current`]); after `A0` and from MS drives open-loop power.
    pub effort: i16,
    /// Degrees a second.
    pub speed: i16,
    /// Angle within the turn, in steps of the model's encoder ([`Model::angle`]).
    pub encoder: u16,
}

impl Motion {
    const fn unpack(bytes: &[u8; 8]) -> Self {
        let [command, temperature, c, d, e, f, g, h] = *bytes;
        Self {
            command,
            temperature: i8::from_le_bytes([temperature]),
            effort: i16::from_le_bytes([c, d]),
            speed: i16::from_le_bytes([e, f]),
            encoder: u16::from_le_bytes([g, h]),
        }
    }

    /// The rotor's speed.
    pub fn speed(&self) -> RotorRpm {
        RotorRpm::new(f32::from(self.speed) * (1.0 / DEGREES_PER_SECOND_PER_RPM))
    }

    /// The motor's temperature.
    pub fn temperature(&self) -> Celsius {
        Celsius::new(self.temperature.into())
    }
}

/// Temperature, supply and errors of a drive: the response to `9A` and `9B`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Health {
    /// The command that was answered.
    pub command: u8,
    /// The motor's temperature.
    pub temperature: Celsius,
    /// The supply's voltage, in volts.
    pub supply: f32,
    /// Error bits.
    pub errors: Errors,
}

/// Error bits of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Errors(u8);

/// Text of each error bit, lowest first. Bits 0 and 3: manual V2.3; all: librm, newer firmware.
pub(super) static ERROR_TEXTS: [&str; 8] = [
    "supply voltage too low",
    "supply voltage too high",
    "controller too hot",
    "motor too hot",
    "current too high",
    "motor short-circuited",
    "motor stalled",
    "commands have stopped",
];

/// Error bits, the gravest first.
const GRAVEST: [u8; 8] = [5, 4, 3, 2, 1, 0, 6, 7];

impl Errors {
    /// From byte 7 of the answer.
    pub const fn new(bits: u8) -> Self {
        Self(bits)
    }

    /// The bits as the drive sent them.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The text of each error, lowest bit first.
    pub fn texts(self) -> impl Iterator<Item = &'static str> {
        let texts = ERROR_TEXTS.iter().enumerate();
        texts.filter(move |(bit, _)| self.0 >> bit & 1 == 1).map(|(_, text)| *text)
    }

    /// All bits, with the text of the gravest; `None` without an error.
    #[must_use]
    pub fn fault(self) -> Option<Fault> {
        let bit = GRAVEST.iter().find(|bit| self.0 >> **bit & 1 == 1)?;
        let text = ERROR_TEXTS.get(usize::from(*bit))?;
        Some(Fault::new(self.0.into(), text))
    }
}

/// Phase currents of a drive: the response to `9D`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseCurrents {
    /// The motor's temperature.
    pub temperature: Celsius,
    /// Phases A, B, C.
    pub phases: [Amps; 3],
}

/// An answer of a drive.
#[derive(Clone, Copy, Debug)]
pub enum Reply {
    /// Echo of [`Command::Off`].
    Off,
    /// Echo of [`Command::Stop`].
    Stop,
    /// Echo of [`Command::Run`].
    Run,
    /// To every command that moves, and to [`Command::ReadMotion`].
    Motion(Motion),
    /// To [`Command::ReadHealth`] and [`Command::ClearErrors`].
    Health(Health),
    /// To [`Command::ReadPhaseCurrents`].
    PhaseCurrents(PhaseCurrents),
    /// To [`Command::ReadMultiTurn`], in steps of 0.01 degrees.
    MultiTurn(TotalAngle),
    /// To [`Command::ReadSingleTurn`], never negative, in steps of 0.01 degrees.
    SingleTurn(TotalAngle),
}

impl Reply {
    /// From a frame of the drive `id`.
    ///
    /// # Errors
    /// [`FrameError::NotMine`], [`FrameError::Length`] if it has not eight bytes, and as
    /// [`unpack`](Self::unpack).
    pub fn from_frame(frame: &CanFrame, id: DriveId) -> Result<Self, FrameError> {
        if frame.key() != CanFrame::key_of(id.can) {
            return Err(FrameError::NotMine);
        }
        Self::unpack(frame.all_eight().ok_or(FrameError::Length)?)
    }

    /// From the eight bytes of an answer.
    ///
    /// # Errors
    /// [`FrameError::Unexpected`] if byte 0 is no command that this crate knows.
    pub fn unpack(bytes: &[u8; 8]) -> Result<Self, FrameError> {
        let [command, b, c, d, e, f, g, h] = *bytes;
        let temperature = || Celsius::new(i8::from_le_bytes([b]).into());
        Ok(match command {
            MOTION | OPEN_LOOP..=TURN_BY_LIMITED => Self::Motion(Motion::unpack(bytes)),
            OFF => Self::Off,
            STOP => Self::Stop,
            RUN => Self::Run,
            HEALTH | CLEAR_ERRORS => Self::Health(Health {
                command,
                temperature: temperature(),
                supply: f32::from(u16::from_le_bytes([d, e])) * VOLTS_PER_STEP,
                errors: Errors(h),
            }),
            PHASE_CURRENTS => {
                let phases = [[c, d], [e, f], [g, h]].map(|bytes| {
                    Amps::new(f32::from(i16::from_le_bytes(bytes)) * PHASE_AMPS_PER_STEP)
                });
                Self::PhaseCurrents(PhaseCurrents { temperature: temperature(), phases })
            }
            MULTI_TURN => {
                // Seven bytes behind the command: shifting the command out extends the sign.
                Self::MultiTurn(angle(i64::from_le_bytes(*bytes) >> 8))
            }
            SINGLE_TURN => Self::SingleTurn(angle(u32::from_le_bytes([e, f, g, h]).into())),
            _ => return Err(FrameError::Unexpected),
        })
    }
}

#[cfg(test)]
mod tests;
