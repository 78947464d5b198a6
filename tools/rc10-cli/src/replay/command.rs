//! `rc10 replay`: the command.

use std::cell::RefCell;
use std::io::{self, BufRead, Write};
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use rc10_motor::embassy::MotorPort;
use rc10_motor::record::ring::PRINT;
use rc10_motor::{Request, Tuning};
use rc10_tasks::live::request_to_set;
use rc10_time::Micros;

use super::curves::{Efforts, page, table};
use super::engine::{Engine, Told};
use super::inputs::Inputs;
use crate::args::{seconds as whole_seconds, seed};
use crate::files::{PAGES, make_folder, open, write_file};
use crate::lang::Language;
use crate::recording::origin::Origin;
use crate::recording::sample::seconds;
use crate::terminal::tell;
use crate::world::robot::Robot;

/// Arguments of `rc10 replay`.
#[derive(Args, Debug)]
#[command(allow_negative_numbers = true)]
pub struct ReplayArgs {
    /// What --record of `rc10 run` or `rc10 emu` wrote, or the memory of a black box
    #[arg(value_name = "FILE", required_unless_present = "check")]
    pub file: Option<PathBuf>,
    /// What would the loops have commanded with another gain or limit, where everything moves as it was recorded:
    /// NAME=VALUE, names as of rc10 params. Repeatable
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Stop before the first tick at this time, and show the motors
    #[arg(long, value_name = "S", value_parser = whole_seconds)]
    pub until: Option<Micros>,
    /// From there on a tick at each Enter: for a debugger
    #[arg(long, requires = "until")]
    pub pause: bool,
    /// Simulate this robot twice and replay it: is it the same each time?
    #[arg(long, conflicts_with_all = ["file", "set", "until"])]
    pub check: bool,
    /// Virtual seconds of --check
    #[arg(long, value_name = "S", default_value = "10", value_parser = whole_seconds)]
    pub seconds: Micros,
    /// Seed of the world of --check
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = seed)]
    pub seed: u64,
    /// Folder for replay.html
    #[arg(long, value_name = "DIR", default_value = PAGES)]
    pub out: PathBuf,
}

/// The page with the curves.
const PAGE: &str = "replay.html";
/// Seconds around a difference that are drawn.
const AROUND: f64 = 0.25;

/// Replays a record; returns whether it differs.
///
/// # Errors
/// The file cannot be read, has no inputs, or is of another robot.
pub fn replay(args: &ReplayArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    let file = args
        .file
        .as_ref()
        .context("--check needs a robot that can be set up again: see `rc10::sim::main_of`")?;
    let named = || file.display().to_string();
    let inputs = Inputs::read(&mut open(file)?).with_context(named)?;
    inputs.check(&robot).with_context(named)?;
    if let Some(why) = &inputs.cut {
        tell(format_args!("{}: cut off: {why}", named()));
    }
    let changes = changes(&args.set, &robot)?;
    let (is_open, own) = (!changes.is_empty(), Origin::now(&robot.description().name).revision);
    let mut engine = Engine::new(robot)?;
    if let Some(black_box) = &inputs.black_box {
        ensure!(
            black_box.word(PRINT) == engine.print(),
            "{}: it is of another program: its motors, their gains or what is kept of them differ from those here. \
             Replay it with the program that was flashed",
            named()
        );
    }
    let (was, is) = (RefCell::<Efforts>::default(), RefCell::<Efforts>::default());
    if let Some(until) = args.until {
        engine.change(changes);
        let mut was_there = false;
        engine.run(&inputs.words, |engine, now| {
            was_there |= now >= until;
            if now < until { Ok(true) } else { stopped(engine, now, args.pause, out) }
        })?;
        ensure!(was_there, "{}: it ends before {} s", named(), seconds(until));
        return Ok(false);
    }
    let look = |efforts: &RefCell<Efforts>, engine: &Engine<'_>, now| {
        efforts.borrow_mut().look(engine, now);
        Ok(true)
    };
    let difference = engine.run(&inputs.words, |engine, now| look(&is, engine, now));
    let difference = difference.with_context(named)?;
    let (told, spoken) = (engine.told, Language::spoken());
    ensure!(told.ticks > 0, "{}: no tick is in it", named());
    if told.lost > 0 {
        let before = difference.as_ref().map(|it| format!(", before {} s", seconds(it.at)));
        let before = before.unwrap_or_default();
        tell(format_args!("{}: {} words are missing in it{before}", named(), told.lost));
    }
    let (head, differs) = match difference {
        None if !is_open => {
            writeln!(out, "{}", spoken.say(&equal(&told)))?;
            return Ok(false);
        }
        None => {
            was.swap(&is);
            engine.change(changes);
            engine.run(&inputs.words, |engine, now| look(&is, engine, now)).with_context(named)?;
            let table = table(&was.borrow(), &is.borrow(), &engine.description);
            let head = format!(
                "with {}, open loop: everything moves as it was recorded, so what the motors would have done with it \
                 is not known\nlargest difference of what the loops command:\n{}",
                args.set.join(", "),
                if table.is_empty() { "none\n" } else { &table }
            );
            (head, false)
        }
        Some(difference) => {
            let mut lines = difference.lines(&engine.description);
            if inputs.revision != own && !inputs.revision.is_empty() && !own.is_empty() {
                lines.push(format!("recorded by {}, replayed by {own}", inputs.revision));
            }
            *was.borrow_mut() =
                Efforts::recorded(&inputs, &engine.description).around(difference.at, AROUND);
            is.replace_with(|it| std::mem::take(it).around(difference.at, AROUND));
            (lines.join("\n") + "\n", true)
        }
    };
    make_folder(&args.out)?;
    let page = page(&head, &was.borrow(), &is.borrow(), &engine.description);
    write_file(&args.out, PAGE, page.as_bytes())?;
    for line in head.lines() {
        writeln!(out, "{}", spoken.say(line))?;
    }
    writeln!(out, "open  {}", args.out.join(PAGE).display())?;
    Ok(differs)
}

/// Shows the motors before a tick, and goes on when it is told to; returns whether it does. A place for a breakpoint.
#[inline(never)]
fn stopped(engine: &Engine<'_>, now: Micros, pauses: bool, out: &mut dyn Write) -> Result<bool> {
    writeln!(out, "before the tick at {} s:", seconds(now))?;
    let width = engine.description.motors.iter().map(|it| it.label.len()).max().unwrap_or(0);
    for (entry, motor) in engine.description.motors.iter().enumerate() {
        let Some(status) = engine.port(entry).as_ref().map(MotorPort::status) else { continue };
        let (angle, speed) = (status.feedback.total_angle, status.feedback.speed.get());
        let effort = status.effort().map_or_else(|| "-".to_owned(), |it| format!("{it:.3}"));
        writeln!(
            out,
            "  {:<width$}  {:?}  {:?}  {:?}  at {:.3} deg, {speed:.2} rpm, effort {effort}",
            motor.label,
            status.link,
            status.drive,
            status.target,
            angle.microdegrees() as f64 * 1e-6,
        )?;
    }
    if !pauses {
        return Ok(false);
    }
    write!(out, "process {}: Enter runs this tick, q ends: ", std::process::id())?;
    out.flush()?;
    let mut line = String::new();
    let read = io::stdin().lock().read_line(&mut line)?;
    Ok(read > 0 && line.trim() != "q")
}

/// The line of a replay that is equal.
pub(crate) fn equal(told: &Told) -> String {
    let [from, to] = told.times.unwrap_or_default();
    let unknown = match told.unknown {
        0 => String::new(),
        count => format!("; {count} ticks before its state was known are not compared"),
    };
    format!(
        "equal: {} ticks from {} s to {} s, {} frames and {} states, bit for bit; hash {:016x}{unknown}",
        told.ticks,
        seconds(from),
        seconds(to),
        told.frames,
        told.states,
        told.hash
    )
}

/// What is to be set otherwise: the motor's line in the table, and the request.
fn changes(wanted: &[String], robot: &Robot<'_>) -> Result<Vec<(usize, Request)>> {
    let mut tunings: Vec<_> = robot.loops().iter().map(|it| it.as_ref().map(Tuning::of)).collect();
    let mut changes = Vec::new();
    for change in wanted {
        let (name, value) = change
            .split_once('=')
            .with_context(|| format!("`{change}`: it is to be NAME=VALUE"))?;
        let value: f32 =
            value.parse().with_context(|| format!("`{change}`: `{value}` is no number"))?;
        let split = name.rsplit_once('.');
        let (label, name) = split.with_context(|| {
            format!("`{change}`: only gains and limits of motors can be replayed, MOTOR.NAME=VALUE")
        })?;
        let line = robot.description().motor_called(label)?;
        let Some(tuning) = &mut tunings[line] else {
            bail!("`{change}`: the loops of `{label}` run in its device");
        };
        let request = request_to_set(name, value, tuning);
        let request = request.with_context(|| format!("`{change}`: no parameter of that name"))?;
        changes.push((line, request));
    }
    Ok(changes)
}
