//! `rc10 doctor`: what is wrong with a robot, the likeliest cause first, and what to do.

use std::io::Write;
use std::path::Path;
use std::sync::atomic::Ordering;

use anyhow::{Result, bail, ensure};
use clap::Args;
use rc10_time::Micros;
use serde_json::{Value, json};

use crate::args::seconds;
use crate::decode::BusOfChannel;
use crate::decode::heard::recorded;
use crate::judge::doctor::{Cause, causes};
use crate::lang::Language;
use crate::live::plan::{messages, plan, watch};
use crate::live::session::{Session, stop};
use crate::live::source::PlaceArgs;
use crate::record::replay::{Kit, Replay};
use crate::recording::Recording;
use crate::recording::sample::{Source, seconds as seconds_of};
use crate::world::robot::Robot;

/// Arguments of `rc10 doctor`.
#[derive(Args, Debug)]
pub struct DoctorArgs {
    #[command(flatten)]
    pub(crate) at: PlaceArgs,
    /// Which of the robot's buses an interface of a capture is; canN is bus N+1 unless told. Repeatable
    #[arg(long = "bus", value_name = "CHANNEL=NUMBER")]
    pub buses: Vec<BusOfChannel>,
    /// Seconds for which a robot that runs is looked at
    #[arg(long, value_name = "S", default_value = "10", value_parser = seconds)]
    pub seconds: Micros,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
    /// Exit code 3 if there is a cause
    #[arg(long)]
    pub strict: bool,
}

/// Prints the causes of what is wrong with a robot that runs, or was recorded; returns whether there are any.
/// Fails if there is no robot, or the file cannot be read.
pub fn doctor(args: &DoctorArgs, robot: Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    let place = args.at.place.as_ref().map(Path::new);
    let path = args.at.record().or_else(|| place.filter(|it| it.is_file()));
    ensure!(path.is_some() || args.buses.is_empty(), "--bus is for captures");
    let recording = match path {
        Some(path) => recorded(&[path.into()], &args.buses, robot)?.0,
        None => look(args, robot)?,
    };
    let causes = causes(&recording);
    if args.json {
        let all = causes.iter().map(Cause::to_json).collect::<Vec<_>>();
        let seconds = seconds_of(recording.length);
        writeln!(out, "{}", json!({ "seconds": seconds, "causes": Value::from(all) }))?;
    } else {
        write!(out, "{}", text(&recording, &causes, Language::spoken()))?;
    }
    Ok(!causes.is_empty())
}

/// Looks at a robot that runs.
fn look(args: &DoctorArgs, robot: Robot<'_>) -> Result<Recording> {
    let kit = Kit::of(&robot);
    let stop = stop()?;
    let mut session = Session::meet(args.at.source().open(robot, None)?)?;
    let (topics, _) = plan(&session.client);
    let mut replay = Replay::new(&kit, 1, Source::Robot)?;
    for (id, topic) in (0..).zip(&topics) {
        replay.channel(id, &topic.name, topic.columns());
    }
    watch(&mut session.client, &topics, PERIOD);
    let (begin, mut first) = (session.now(), None);
    while session.now().since(begin) < args.seconds && !stop.load(Ordering::Relaxed) {
        session.step()?;
        for sample in session.client.take_samples() {
            let begun = *first.get_or_insert(sample.at);
            messages(&topics, &sample, |topic, bytes| {
                replay.take(topic as u16, sample.at.since(begun), bytes)
            })?;
        }
    }
    if first.is_none() {
        bail!("{}", session.trouble().unwrap_or_else(|| "it sends no samples".into()));
    }
    replay.finish()
}

/// Period of the motors' samples, ms.
const PERIOD: u16 = 10;

fn text(recording: &Recording, causes: &[Cause], language: Language) -> String {
    let length = seconds_of(recording.length);
    let mut text = language.say(&match causes.len() {
        0 => format!(
            "{length:.1} s: nothing wrong is seen; what shows only while it drives was seen if it drove"
        ),
        1 => format!("{length:.1} s: one cause"),
        more => format!("{length:.1} s: {more} causes, the likeliest first"),
    });
    text.push('\n');
    let colon = if language == Language::Zh { "：" } else { ": " };
    for (number, Cause { problem, so_also }) in (1..).zip(causes) {
        text += &format!("\n{number}. {}\n", language.say(&problem.headline()));
        // Each in its own language: a pattern for a whole sentence would take its name for a part of it.
        let mut line = |name: &str, words: &str| {
            if !words.is_empty() {
                text += &format!("   {}{colon}{}\n", language.say(name), language.say(words));
            }
        };
        line("seen", &problem.text);
        if let Some((begin, end)) = problem.span {
            line("when", &format!("{:.2} to {:.2} s", seconds_of(begin), seconds_of(end)));
        }
        // Alike ones in one line.
        let mut follows: Vec<(&str, Vec<String>)> = Vec::new();
        for problem in so_also {
            let about = problem.about.to_string();
            match follows.iter_mut().find(|(what, _)| *what == problem.cause) {
                Some((_, all)) if all.contains(&about) => {}
                Some((_, all)) => all.push(about),
                None => follows.push((problem.cause, vec![about])),
            }
        }
        for (what, all) in follows {
            line("follows", &format!("{}: {what}", all.join(", ")));
        }
        let [check, mend] = problem.remedy().1;
        line("check", check);
        line("do", mend);
    }
    text
}
