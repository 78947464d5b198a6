use rc10_app::ConfigError;

use super::models::Model;
use super::wire::DriveId;
use crate::dji;
use rc10_app::Cascade;

/// By which frames a drive is commanded. What is right is set in the drive, with the vendor's tool.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Commands {
    /// By frames of its own, as it is sold.
    #[default]
    Single,
    /// By two bytes of the frame that four drives share. The drive is never off then, does not tell
    /// its errors and takes no other command.
    MultiMotor,
}

/// How a drive is set up, and how it shall be controlled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Current step, encoder, gearbox, torque constant.
    pub model: Model,
    /// Loops and limits: amperes of iq, at the output shaft. The largest current is the speed
    /// loop's output limit.
    pub cascade: Cascade,
    /// By which frames it is commanded.
    pub commands: Commands,
    /// Which way the output shaft counts.
    pub direction: rc10_app::Direction,
}

impl Config {
    /// A drive as it is sold: commands of its own, counting as the drive does.
    #[must_use]
    pub const fn new(model: Model, cascade: Cascade) -> Self {
        Self { model, cascade, commands: Commands::Single, direction: rc10_app::Direction::Forward }
    }

    /// Commanded by these frames.
    #[must_use]
    pub const fn with_commands(self, commands: Commands) -> Self {
        Self { commands, ..self }
    }

    /// Counting this way.
    #[must_use]
    pub const fn with_direction(self, direction: rc10_app::Direction) -> Self {
        Self { direction, ..self }
    }

    /// Whether a drive set to `id` can be like that; its identifier and its lane.
    pub(super) fn checked(&self, id: u8) -> Result<(DriveId, usize), ConfigError> {
        let check = |good: bool, field, value, must_be| {
            if good { Ok(()) } else { Err(ConfigError::new(field, value, must_be)) }
        };
        let number = DriveId::new(id);
        let error = |must_be| ConfigError::new("id", id.into(), must_be);
        let drive = number.ok_or_else(|| error("1 to 32"))?;
        let lane = match self.commands {
            Commands::Single => 0,
            Commands::MultiMotor => {
                drive.multi_motor_lane().ok_or_else(|| error("1 to 4 in the multi-motor frame"))?
            }
        };
        let Model { amps_per_count, gear, torque_constant, .. } = self.model;
        let usable = |value: f32| value.is_finite() && value > 0.0;
        check(
            usable(amps_per_count),
            "amps_per_count",
            amps_per_count,
            "finite and above zero: an MS drive has no current loop",
        )?;
        let constant = torque_constant.unwrap_or(1.0);
        check(usable(constant), "torque_constant", constant, "finite and above zero")?;
        let ratio = gear.ratio();
        check(ratio >= 1.0, "gear", ratio, "one rotor turn or more for a turn of the output")?;
        self.cascade.validate()?;
        let limit = self.cascade.speed.output_limit;
        let fits = limit <= self.model.full_scale().get();
        check(fits, "output_limit", limit, "at most 2048 steps of the model's current")?;
        Ok((drive, lane))
    }
}
