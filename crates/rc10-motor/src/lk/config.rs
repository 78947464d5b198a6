//! Models of drives, and the setup of one drive.

use rc10_app::maths::within;
use rc10_app::{Amps, Cascade, ConfigError, Degrees, Direction, Gear, ok};
use rc10_can::IdPattern;

use super::wire::{BASE_ID, DriveId, FULL_SCALE, MULTI_MOTOR, Motion, OPEN_LOOP};
use crate::can_ids::{CanIds, Frames, Ownership, Rate};
use crate::motor::FrameError;
use crate::shaft::gear;

/// Width of the encoder value in answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderBits {
    /// 14 bit devices: 0 ..= 16383.
    Fourteen = 14,
    /// 15 bit devices: 0 ..= 32767.
    Fifteen = 15,
    /// 16 bit devices, and 18 bit devices, which report their upper 16: 0 ..= 65535.
    Sixteen = 16,
}

impl EncoderBits {
    /// Steps in a turn of the rotor.
    #[must_use]
    pub const fn counts(self) -> u32 {
        1 << self as u32
    }
}

/// Properties of one model of drive, as seen on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// The name, as the vendor writes it.
    pub name: &'static str,
    /// Amperes in a step of iq, in commands and answers alike.
    pub amps_per_count: f32,
    /// Width of the encoder.
    pub encoder: EncoderBits,
    /// The gearbox behind the rotor; the encoder sits in front of it.
    pub gear: Gear,
    /// Torque at the output shaft, N m per ampere of iq, where a source gives one.
    pub torque_constant: Option<f32>,
}

impl Model {
    const fn bare(name: &'static str, amps_per_count: f32, encoder: EncoderBits) -> Self {
        Self { name, amps_per_count, encoder, gear: Gear::DIRECT, torque_constant: None }
    }

    /// The same under another name, with `turns` rotor turns for one of the output shaft.
    const fn with(self, name: &'static str, turns: u32, torque_constant: Option<f32>) -> Self {
        Self { name, gear: gear(turns, 1), torque_constant, ..self }
    }

    /// MG drives: 2048 steps are 33 A (manual V2.3). Without a gearbox, until one is given.
    pub const fn mg(encoder: EncoderBits) -> Self {
        Self::bare("MG", 33.0 / 2048.0, encoder)
    }

    /// MF drives: 2048 steps are 16.5 A (librm).
    pub const fn mf(encoder: EncoderBits) -> Self {
        Self::bare("MF", 16.5 / 2048.0, encoder)
    }

    /// MS drives, without a current loop and so a step of iq: open loop, speed and angles only.
    pub const fn ms(encoder: EncoderBits) -> Self {
        Self::bare("MS", 0.0, encoder)
    }

    /// The raw iq, within ±2048, 0 for NaN, cut off towards zero as librm does: never more.
    pub fn raw_current(&self, current: Amps) -> i16 {
        let full = self.full_scale().get();
        // Divided, not multiplied by the inverse: whole steps must stay whole.
        #[expect(clippy::cast_possible_truncation, reason = "within ±2048, or NaN, which is 0")]
        return (within(current.get(), full) / self.amps_per_count) as i16;
    }

    /// The largest torque current, A.
    pub const fn full_scale(&self) -> Amps {
        Amps::new(FULL_SCALE as f32 * self.amps_per_count)
    }

    /// The torque current of an answer; `None` where it carries no current, see [`Motion::effort`].
    pub fn current(&self, motion: &Motion) -> Option<Amps> {
        let current = Amps::new(f32::from(motion.effort) * self.amps_per_count);
        (motion.command != OPEN_LOOP && self.amps_per_count > 0.0).then_some(current)
    }

    /// The rotor's angle of an answer, 0 ..< 360 degrees, unless the encoder is narrower.
    pub fn angle(&self, motion: &Motion) -> Result<Degrees, FrameError> {
        let counts = self.encoder.counts();
        if u32::from(motion.encoder) >= counts {
            return Err(FrameError::Encoder);
        }
        Ok(Degrees::new(f32::from(motion.encoder) * (360.0 / counts as f32)))
    }
}

/// Models by name.
///
/// Gears and rated torque by current are the data sheets' (SMC, shops; MF9025 V2: teams' code).
/// `torque_constant` is `None` where figures do not agree. Encoders: SCUT librmcs; check yours.
pub mod models {
    use super::{EncoderBits, Model};

    const MG: Model = Model::mg(EncoderBits::Sixteen);
    const MF: Model = Model::mf(EncoderBits::Sixteen);

    /// MF9025 V2: direct drive, 0.32 N m/A.
    pub const MF9025: Model = MF.with("MF9025", 1, Some(0.32));
    /// MG4010E-i10: 10 : 1, 2.5 N m at 3.5 A.
    pub const MG4010E_I10: Model = MG.with("MG4010E-i10", 10, Some(0.7));
    /// MG4010E-i36: 36 : 1, 9 N m at 3.5 A.
    pub const MG4010E_I36: Model = MG.with("MG4010E-i36", 36, Some(2.58));
    /// MG5010E-i10: 10 : 1, 4 N m at 4.4 A.
    pub const MG5010E_I10: Model = MG.with("MG5010E-i10", 10, Some(0.91));
    /// MG6012E-i36: 36 : 1, 15 N m at 3.8 A.
    pub const MG6012E_I36: Model = MG.with("MG6012E-i36", 36, Some(3.94));
    /// MG8008E-i9: 9 : 1, 10 N m at 4.9 A.
    pub const MG8008E_I9: Model = MG.with("MG8008E-i9", 9, Some(2.07));
    /// MG8016E-i6: 6 : 1. Printed as 3.3 N m/A, and as 13 N m at 6.5 A: no constant.
    pub const MG8016E_I6: Model = MG.with("MG8016E-i6", 6, None);

    /// All models that are known by name.
    pub const ALL: &[Model] =
        &[MF9025, MG4010E_I10, MG4010E_I36, MG5010E_I10, MG6012E_I36, MG8008E_I9, MG8016E_I6];
}

/// The frames that command a drive: a setting of the drive, made with the vendor's tool.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Commands {
    /// By frames of its own, as it is sold.
    #[default]
    Single,
    /// By two bytes of a frame that four drives share: never off, no errors, no other command.
    MultiMotor,
}

/// The setup of a drive, and how it is controlled.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Config {
    /// Current step, encoder, gearbox, torque constant.
    pub model: Model,
    /// The identifier set on it: 1 to 32, 1 to 4 in the multi-motor frame.
    pub id: u8,
    /// Loops and limits: amperes of iq at the output; the speed loop's output limit is the largest.
    pub cascade: Cascade,
    /// By which frames it is commanded.
    pub commands: Commands,
    /// Which way the output shaft counts.
    pub direction: Direction,
}

impl Config {
    /// A drive as it is sold: commands of its own, counting as the drive does.
    pub const fn new(model: Model, id: u8, cascade: Cascade) -> Self {
        Self { model, id, cascade, commands: Commands::Single, direction: Direction::Forward }
    }

    /// Commanded by these frames.
    pub const fn with_commands(self, commands: Commands) -> Self {
        Self { commands, ..self }
    }

    pub(crate) const fn check(&self) -> Result<(), ConfigError> {
        ok!(self.lane());
        let Model { amps_per_count, gear, torque_constant, .. } = self.model;
        let must_be = "finite and above zero: an MS drive has no current loop";
        let is_good = is_usable(amps_per_count);
        ok!(ConfigError::check(is_good, "amps_per_count", amps_per_count, must_be));
        if let Some(constant) = torque_constant {
            let must_be = "finite and above zero";
            ok!(ConfigError::check(is_usable(constant), "torque_constant", constant, must_be));
        }
        let ratio = gear.ratio();
        let must_be = "one rotor turn or more for a turn of the output";
        ok!(ConfigError::check(ratio >= 1.0, "gear", ratio, must_be));
        ok!(self.cascade.validate());
        let limit = self.cascade.speed.output_limit;
        let fits = limit <= self.model.full_scale().get();
        let must_be = "at most 2048 steps of the model's current";
        ConfigError::check(fits, "output_limit", limit, must_be)
    }

    /// The identifier, and the first of its two bytes in the multi-motor frame.
    pub(super) const fn lane(&self) -> Result<(DriveId, usize), ConfigError> {
        let Some(drive) = DriveId::new(self.id) else {
            return Err(ConfigError::new("id", self.id as f32, "1 to 32"));
        };
        match (self.commands, drive.multi_motor_lane()) {
            (Commands::Single, _) => Ok((drive, 0)),
            (Commands::MultiMotor, Some(lane)) => Ok((drive, lane)),
            (Commands::MultiMotor, None) => {
                Err(ConfigError::new("id", self.id as f32, "1 to 4 in the multi-motor frame"))
            }
        }
    }

    /// The identifiers on its bus, of a [valid](Self::validate) configuration; else no identifier.
    pub const fn can_ids(&self) -> CanIds {
        match self.lane() {
            Ok((id, lane)) => can_ids(id, self.commands, lane),
            Err(_) => CanIds::new(),
        }
    }
}

const fn is_usable(value: f32) -> bool {
    value.is_finite() && value > 0.0
}

pub(super) const fn can_ids(id: DriveId, commands: Commands, lane: usize) -> CanIds {
    let own = IdPattern::standard(BASE_ID + id.number() as u16);
    let command = match commands {
        Commands::Single => Frames::new(own, 8, Rate::EveryTick),
        Commands::MultiMotor => Frames::new(IdPattern::standard(MULTI_MOTOR), 8, Rate::EveryTick)
            .owned(Ownership::Bytes(0b11 << lane)),
    };
    CanIds::new().receives(Frames::new(own, 8, Rate::EveryTick)).transmits(command)
}
