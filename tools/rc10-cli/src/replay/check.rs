//! Whether a robot can be replayed: two runs in the same world are the same, and so is the replay of one.

use anyhow::{Result, bail};
use rc10_motor::record::{COMMAND, REQUEST, TICK};
use rc10_motor::{Request, Target, Withheld};
use rc10_time::Micros;

use super::engine::{Engine, Told};
use super::entries::{Entry, entries, label, name_of};
use crate::recording::sample::seconds;
use crate::robot::description::Description;
use crate::run::running::Running;
use crate::run::simulation::Simulation;
use crate::world::robot::Robot;

/// Runs a robot for `length` of virtual time, and gives what reached its ticks.
///
/// # Errors
/// Those of a simulation.
pub fn inputs_of(mut robot: Robot<'_>, seed: u64, length: Micros) -> Result<Vec<u32>> {
    robot.record_inputs();
    let mut running = Simulation::new(robot, seed, None)?;
    running.run_to(length)?;
    Ok(running.take_inputs())
}

/// Replays inputs, and compares them with those of another run.
///
/// # Errors
/// They differ, or the replay does: what, when and where.
pub fn compare(first: &[u32], second: &[u32], robot: Robot<'_>) -> Result<Told> {
    let mut now = Micros::ZERO;
    let mut others = entries(second);
    for entry in entries(first) {
        if entry.kind == TICK {
            now = Micros::new(entry.long(0));
        }
        let other = others.next();
        if other != Some(entry) {
            bail!("{}", differs(entry, other, now, robot.description()));
        }
    }
    let mut engine = Engine::new(robot)?;
    match engine.run(first, |_, _| Ok(true))? {
        None => Ok(engine.told),
        Some(difference) => bail!("{}", difference.lines(&engine.description).join("\n")),
    }
}

fn differs(one: Entry<'_>, other: Option<Entry<'_>>, now: Micros, robot: &Description) -> String {
    let place = one.place;
    let whose = |entry: &Entry<'_>| match entry.kind {
        COMMAND | REQUEST => label(robot, place, entry.more),
        _ => None,
    };
    let said = |entry: Option<Entry<'_>>| {
        let bytes = entry.map(|it| it.bytes(0)).unwrap_or_default();
        let known = match entry.map(|it| it.kind) {
            Some(COMMAND) => postcard::take_from_bytes::<(Target, Withheld)>(&bytes)
                .map(|((target, _), _)| format!("{target:?}")),
            Some(REQUEST) => postcard::take_from_bytes::<Request>(&bytes)
                .map(|(request, _)| format!("{request:?}")),
            _ => Ok("nothing".to_owned()),
        };
        known.unwrap_or_else(|_| "something".to_owned())
    };
    let labelled = whose(&one).or_else(|| whose(other.as_ref()?));
    let what = match labelled {
        Some(label) => format!("`{label}` gets {} once, and {} then", said(Some(one)), said(other)),
        None => format!("{} hears something else", name_of(place)),
    };
    format!(
        "two runs in the same world differ at {} s: {what}. Does a task ask a clock of the PC, a random number, or \
         the order of a HashMap?",
        seconds(now)
    )
}
