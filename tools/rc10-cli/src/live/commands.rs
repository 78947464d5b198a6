//! `rc10 params`, `rc10 get`, `rc10 set`, `rc10 save`, `rc10 forget` and `rc10 record`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use rc10_link::{Action, Urgent};
use rc10_time::Micros;

use super::client::Urgency;
use super::plan::{plan, watch};
use super::record::{LiveRecord, room, tell_leftovers};
use super::session::{Session, full_name};
use super::source::{PlaceArgs, RunningArgs};
use super::table::table_lines;
use crate::args::seconds;
use crate::live::session::stop;
use crate::record::replay::Kit;
use crate::terminal::tell;
use crate::world::robot::Robot;

/// Arguments of `rc10 params`.
#[derive(Args, Debug)]
pub struct ParamsArgs {
    #[command(flatten)]
    pub(crate) at: PlaceArgs,
    /// Only those that are not as in the robot's table, as lines for it
    #[arg(long)]
    pub rust: bool,
    /// Only those that are kept over a power-off, and those that are not saved
    #[arg(long = "kept", conflicts_with = "rust")]
    pub only_kept: bool,
}

/// Arguments of `rc10 get`.
#[derive(Args, Debug)]
pub struct GetArgs {
    /// Names of parameters, as rc10 params has them
    #[arg(required = true, value_name = "NAME")]
    pub names: Vec<String>,
    #[command(flatten)]
    pub(crate) running: RunningArgs,
}

/// Arguments of `rc10 set`.
#[derive(Args, Debug)]
pub struct SetArgs {
    /// Changes, made together or not at all
    #[arg(required = true, value_name = "NAME=VALUE")]
    pub changes: Vec<String>,
    #[command(flatten)]
    pub(crate) running: RunningArgs,
}

/// Arguments of `rc10 save`.
#[derive(Args, Debug)]
pub struct SaveArgs {
    #[command(flatten)]
    pub(crate) running: RunningArgs,
}

/// Arguments of `rc10 forget`.
#[derive(Args, Debug)]
pub struct ForgetArgs {
    /// Names of kept values, as rc10 params --kept has them [default: all]
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
    #[command(flatten)]
    pub(crate) running: RunningArgs,
}

/// Arguments of `rc10 record`.
#[derive(Args, Debug)]
pub struct RecordArgs {
    #[command(flatten)]
    pub(crate) at: PlaceArgs,
    /// Seconds to record [default: until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<Micros>,
    /// From one sample of the motors to the next, ms
    #[arg(long, value_name = "MS", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub period: u16,
    /// The file
    #[arg(short, long, value_name = "FILE.mcap")]
    pub output: PathBuf,
    /// Write over the file, if it is there
    #[arg(long)]
    pub force: bool,
}

/// Arguments of `rc10 stop`.
#[derive(Args, Debug)]
pub struct StopArgs {
    /// The robot's port; the same as --port
    #[arg(value_name = "PORT", conflicts_with = "port")]
    pub place: Option<String>,
    #[command(flatten)]
    pub(crate) running: RunningArgs,
    /// Only disarms the robot: its remote may arm it again
    #[arg(long)]
    pub disarm: bool,
}

/// Stops the robot, or without its port every robot that is here: repeats it until each confirms, or until Ctrl-C. Fails
/// without an answer.
pub fn stop_robot(args: &StopArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let ended = stop()?;
    let RunningArgs { port, baud } = args.running.clone();
    let running = RunningArgs { port: args.place.clone().or(port), baud };
    let (what, done) = match args.disarm {
        true => (Urgent::Disarm, "disarmed"),
        false => (Urgent::Stop, "stopped"),
    };
    let begun = |connection| {
        let mut session = Session::new(connection);
        let id = session.client.urge(what, session.now());
        (session, id, false)
    };
    let mut waiting: Vec<_> = running.open_all(&robot)?.into_iter().map(begun).collect();
    while !ended.load(Ordering::Relaxed) {
        let mut at = 0;
        while let Some((session, id, is_told)) = waiting.get_mut(at) {
            session.step()?;
            if session.client.answer(*id).is_some() {
                let millis = session.now().get() / 1000;
                writeln!(out, "{done} after {millis} ms: {}", session.name())?;
                waiting.swap_remove(at);
                continue;
            }
            if session.client.urgency(what, session.now()) == Some(Urgency::NotHeard) && !*is_told {
                *is_told = true;
                let why = session.trouble().unwrap_or_else(|| "it does not answer".into());
                let name = session.name();
                tell(format_args!(
                    "NOT HEARD by the robot ({name}): {why}. It is sent on and on; Ctrl-C ends that"
                ));
            }
            at += 1;
        }
        if waiting.is_empty() {
            return Ok(());
        }
    }
    let names: Vec<_> = waiting.iter().map(|(session, ..)| session.name()).collect();
    bail!("no answer: {} may not be stopped", names.join(", "))
}

/// Lists the robot's parameters; fails without a robot.
pub fn params(args: &ParamsArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let kit = Kit::of(&robot);
    let mut session = Session::meet(args.at.source().open(robot, None)?)?;
    if args.only_kept {
        return list_kept(&mut session, out);
    }
    if args.rust {
        write!(out, "{}", table_lines(session.client.parameters(), &kit))?;
        return Ok(());
    }
    for it in session.client.parameters() {
        let [least, most] = it.range;
        let initial = match it.is_changed() {
            true => format!(", {} in the table", it.initial),
            false => String::new(),
        };
        let unit = if it.unit.is_empty() { "" } else { &format!(" {}", it.unit) };
        writeln!(out, "{} = {}{unit}  ({least} to {most}{initial})", full_name(it), it.value)?;
    }
    Ok(())
}

/// Lists the values that are kept, what becomes of each, and what is not saved.
fn list_kept(session: &mut Session<'_>, out: &mut dyn Write) -> Result<()> {
    let kept = session.kept()?;
    if kept.is_empty() {
        writeln!(out, "nothing is kept")?;
    }
    let parameters: Vec<_> = session.client.parameters().collect();
    let of = |index| parameters.iter().find(|it| Some(it.index) == index);
    for (name, it) in &kept {
        let note = match of(it.parameter) {
            None => "not known to this program, and kept for the one that knows it".into(),
            Some(_) if !it.is_used => "NOT USED: its unit or range is another".into(),
            Some(now) if now.value.to_bits() == it.value.to_bits() => {
                format!("{} in the table", now.initial)
            }
            Some(now) => format!("{} now, {} in the table", now.value, now.initial),
        };
        writeln!(out, "{name} = {}  ({note})", it.value)?;
    }
    for it in &parameters {
        let is_kept = kept.iter().any(|(_, kept)| kept.is_used && kept.parameter == Some(it.index));
        if !is_kept && it.value.to_bits() != it.initial.to_bits() {
            let (name, value, initial) = (full_name(it), it.value, it.initial);
            writeln!(out, "{name} = {value}  (NOT SAVED, {initial} in the table)")?;
        }
    }
    Ok(())
}

/// Keeps the parameters over a power-off. Fails without a robot, or if it refuses: armed, or a motor turns.
pub fn save(args: &SaveArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let mut session = Session::meet(args.running.open(&robot)?)?;
    session.kept()?;
    session.carry_out(Action::Save)?;
    let what = match session.kept()?.len() {
        1 => "1 parameter is".into(),
        count => format!("{count} parameters are"),
    };
    writeln!(out, "{what} kept over a power-off: {}", session.name())?;
    list_kept(&mut session, out)
}

/// Keeps values no longer: these, or all. Fails without a robot or such a value, or if it refuses.
pub fn forget(args: &ForgetArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let mut session = Session::meet(args.running.open(&robot)?)?;
    let kept = session.kept()?;
    let id_of = |name: &String| {
        let found = kept.iter().find(|(other, _)| other == name);
        let found = found
            .with_context(|| format!("no value `{name}` is kept: rc10 params --kept lists them"))?;
        Ok(Action::Forget(found.1.id))
    };
    let actions = match args.names.as_slice() {
        [] => vec![Action::ForgetAll],
        names => names.iter().map(id_of).collect::<Result<_>>()?,
    };
    for action in actions {
        session.carry_out(action)?;
    }
    let what = if args.names.is_empty() { "all kept values".into() } else { args.names.join(", ") };
    writeln!(
        out,
        "forgotten: {what}. The robot's table counts from its next start on: {}",
        session.name()
    )?;
    Ok(())
}

/// Prints the values of parameters, one a line. Fails without a robot or without such a parameter.
pub fn get(args: &GetArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let session = Session::meet(args.running.open(&robot)?)?;
    for name in &args.names {
        writeln!(out, "{}", session.parameter(name)?.value)?;
    }
    Ok(())
}

/// Changes parameters, all or none. Fails without a robot or such a parameter, or if it refuses.
pub fn set(args: &SetArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let wanted = args.changes.iter().map(|change| {
        let both = change.split_once('=');
        let (name, value) = both.with_context(|| format!("`{change}`: it is to be NAME=VALUE"))?;
        let number = value.parse();
        let number = number.with_context(|| format!("`{change}`: `{value}` is no number"))?;
        Ok((name.to_owned(), number))
    });
    let wanted: Vec<(String, f32)> = wanted.collect::<Result<_>>()?;
    let mut session = Session::meet(args.running.open(&robot)?)?;
    let before = wanted.iter().map(|(name, _)| session.parameter(name));
    let before: Vec<_> = before.collect::<Result<_>>()?;
    session.set(&wanted)?;
    for ((name, value), before) in wanted.iter().zip(before) {
        writeln!(out, "{name} = {value}, before {}: {}", before.value, session.name())?;
    }
    Ok(())
}

/// Records a robot; fails without a robot, or if the file cannot be written.
pub fn record(args: &RecordArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<()> {
    let description = robot.description().clone();
    let stop = stop()?;
    let mut session = Session::meet(args.at.source().open(robot, None)?)?;
    let (topics, left) = plan(&session.client);
    if let Some(first) = left.first() {
        let (count, first) = (left.len(), &first.name);
        tell(format_args!("{count} signals have no room and are not recorded, such as {first}"));
    }
    ensure!(!topics.is_empty(), "the robot has no signals");
    let folder = args.output.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or_else(|| Path::new("."));
    tell_leftovers(folder);
    let mut record =
        LiveRecord::new(&args.output, args.force, &topics, &description, Default::default())?;
    room(folder, args.period).into_iter().for_each(tell);
    watch(&mut session.client, &topics, args.period);
    let outcome = go_on(args, &mut session, &mut record, &stop);
    let (length, samples) = (record.length().get() as f64 / 1e6, record.samples);
    record.finish(outcome)?;
    let losses = session.client.losses();
    writeln!(
        out,
        "{length} s, {samples} samples of {} topics of {}: {}",
        topics.len(),
        session.name(),
        args.output.display()
    )?;
    for (count, what) in [
        (losses.samples, "samples were lost on the way"),
        (losses.skipped, "samples the line was too slow for: try a longer --period"),
        (losses.damaged, "frames were damaged"),
    ] {
        if count > 0 {
            writeln!(out, "{count} {what}")?;
        }
    }
    Ok(())
}

/// Records until the time is over or Ctrl-C.
fn go_on(
    args: &RecordArgs,
    session: &mut Session<'_>,
    record: &mut LiveRecord,
    stop: &AtomicBool,
) -> Result<()> {
    let (mut was_up, begin) = (true, session.now());
    while !stop.load(Ordering::Relaxed) {
        session.step()?;
        for sample in session.client.take_samples() {
            record.take(&sample)?;
        }
        let trouble = session.trouble();
        if was_up != trouble.is_none() {
            was_up = trouble.is_none();
            tell(trouble.unwrap_or_else(|| "the robot is back".into()));
        }
        let length = record.length();
        if args.seconds.is_some_and(|wanted| length >= wanted) {
            break;
        }
        if length == Micros::ZERO && session.now().since(begin) > Micros::from_millis(5000) {
            bail!("nothing to record came in 5 s");
        }
    }
    Ok(())
}
