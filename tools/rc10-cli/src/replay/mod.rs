//! `rc10 replay`: a record runs again through the robot's own buses and motors, and is compared bit for bit.

pub(crate) mod check;
pub mod command;
mod curves;
mod difference;
mod engine;
pub(crate) mod entries;
mod inputs;

use anyhow::Result;
use rc10_time::Micros;

use crate::world::robot::Robot;

pub use check::{compare, inputs_of};
pub use engine::Told;
pub use inputs::Inputs;

/// Replays what reached a robot's ticks, as [words](rc10_motor::record): what was replayed, and the first difference with
/// its time and the lines that name it.
///
/// # Errors
/// The words are of another robot, or of another program.
pub fn replayed(words: &[u32], robot: Robot<'_>) -> Result<(Told, Option<(Micros, String)>)> {
    let mut engine = engine::Engine::new(robot)?;
    let difference = engine.run(words, |_, _| Ok(true))?;
    let said = difference.map(|it| (it.at, it.lines(&engine.description).join("\n")));
    Ok((engine.told, said))
}
