//! The frames that `rc10 decode` prints.

use std::collections::HashMap;

use anyhow::{Result, ensure};
use clap::Args;
use rc10_time::Micros;

use super::Meaning;
use crate::formats::candump::CandumpLine;
use crate::robot::description::Description;
use crate::robot::motor::Motor;

/// The frames that a person wants.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct Wanted {
    /// Only frames of this motor: its label or the beginning of it, with - for spaces, or its identifier
    #[arg(long, value_name = "NAME|ID")]
    motor: Option<String>,
    /// Only from this many seconds after the first frame on
    #[arg(long, value_name = "S", value_parser = moment)]
    from: Option<Micros>,
    /// Only up to this many seconds after the first frame
    #[arg(long, value_name = "S", value_parser = moment)]
    to: Option<Micros>,
    /// Only frames that say something else than the one before of their kind
    #[arg(long)]
    changes: bool,
}

/// A number of seconds from 0 on.
fn moment(text: &str) -> Result<Micros, &'static str> {
    let seconds: Option<f64> = text.parse().ok().filter(|it| (0.0..=1e9).contains(it));
    let micros = seconds.map(|it| Micros::new((it * 1e6).round() as u64));
    micros.ok_or("must be a number of seconds, 0 or more")
}

/// What a frame must be to be printed.
pub(crate) struct Filter<'a> {
    args: &'a Wanted,
    first: Option<Micros>,
    /// What was said last, by interface, identifier and kind.
    said: HashMap<String, String>,
}

impl<'a> Filter<'a> {
    /// The filter of these arguments; fails if the robot has no such motor.
    pub(crate) fn new(args: &'a Wanted, robot: &Description) -> Result<Self> {
        if let Some(name) = &args.motor {
            let labels: Vec<_> = robot.motors.iter().map(|motor| motor.label).collect();
            ensure!(
                robot.motors.iter().any(|motor| is_meant(motor, name)),
                "--motor {name}: there is no such motor; there are: {}",
                labels.join(", ")
            );
        }
        let is_turned = args.from.zip(args.to).is_some_and(|(from, to)| to < from);
        ensure!(!is_turned, "--to is before --from");
        Ok(Self { args, first: None, said: HashMap::new() })
    }

    /// Whether a frame is printed; `body` is what it says.
    pub(crate) fn takes(
        &mut self,
        line: &CandumpLine<'_>,
        meaning: &Meaning<'_>,
        body: &str,
    ) -> bool {
        let Wanted { motor, from, to, changes } = self.args;
        let first = *self.first.get_or_insert(line.at.unwrap_or_default());
        let at = line.at.map(|at| at.since(first));
        let is_in_time = at.map_or(from.is_none() && to.is_none(), |at| {
            from.is_none_or(|from| at >= from) && to.is_none_or(|to| at <= to)
        });
        let is_meant = |name: &String| meaning.concerns(|motor| is_meant(motor, name));
        if !is_in_time || !motor.as_ref().is_none_or(is_meant) {
            return false;
        }
        let kind = if let Meaning::Message { message, .. } = meaning { message.name } else { "" };
        let key = || format!("{} {} {kind}", line.channel, line.frame.raw_id());
        !changes || self.said.insert(key(), body.to_owned()).is_none_or(|last| last != body)
    }
}

/// Whether a motor is meant by its identifier, or by its label or the beginning of that.
fn is_meant(motor: &Motor, name: &str) -> bool {
    let (label, name) = (motor.label.to_lowercase(), name.replace('-', " ").to_lowercase());
    label.starts_with(&name) || name.parse().ok() == Some(motor.name().id)
}
