//! `rc10 report` and `rc10 csv`: a record, or captures, as a report and as tables.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;

use crate::decode::BusOfChannel;
use crate::decode::heard::recorded;
use crate::files::{PAGES, Unfinished, is_record, make_folder, open};
use crate::record::file::{Channel, Item, label, walk};
use crate::record::replay::{numbers, replay_of};
use crate::recording::sample::seconds;
use crate::show::compare::Comparison;
use crate::show::figures::{Figures, to_json};
use crate::show::print::print;
use crate::show::report::write_files;
use crate::terminal::tell;
use crate::world::robot::Robot;

/// Arguments of `rc10 report`.
#[derive(Args, Debug)]
pub struct ReportArgs {
    /// A record, which --record of `rc10 run` or `rc10 emu` wrote; or captures of the robot's buses: logs
    /// of candump or python-can
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Which of the robot's buses an interface of a capture is; canN is bus N+1 unless told. Repeatable
    #[arg(long = "bus", value_name = "CHANNEL=NUMBER")]
    pub buses: Vec<BusOfChannel>,
    /// Folder for report.html
    #[arg(long, value_name = "DIR", default_value = PAGES)]
    pub out: PathBuf,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
    /// An earlier record, for comparison: both runs' curves, and what is better and what is worse
    #[arg(long, value_name = "FILE.mcap")]
    pub against: Option<PathBuf>,
    /// Exit code 3 if the run had problems
    #[arg(long)]
    pub strict: bool,
}

/// Makes the report of a record; returns whether the run had problems. Fails if it cannot be read, is of another robot, or
/// the folder cannot be written.
pub fn report(args: &ReportArgs, mut robot: Robot<'_>, out: &mut dyn Write) -> Result<bool> {
    let before = args.against.as_ref().map(|file| {
        let named = || format!("--against {}", file.display());
        ensure!(is_record(file).with_context(named)?, "{}: it is no record (.mcap)", named());
        let (before, cut) = replay_of(&mut open(file)?, &mut robot, false).with_context(named)?;
        if let Some(why) = cut {
            tell(format_args!("{}: cut off: {why}", named()));
        }
        Ok((before, file.display().to_string()))
    });
    let before = before.transpose()?;
    let (recording, named) = recorded(&args.files, &args.buses, robot)?;
    let figures = Figures::of(&recording);
    make_folder(&args.out)?;
    let against =
        before.map(|(before, name)| Comparison::new((&recording, &figures), name, before));
    write_files(&recording, &figures, &args.out, against.as_ref())?;
    if args.json {
        let mut json = to_json(&recording, &figures, None);
        if let Some(against) = &against {
            json["against"] = against.to_json();
        }
        writeln!(out, "{json}")?;
    } else {
        let mut headline = format!("{} s of {named}", seconds(recording.length));
        if recording.source.is_simulated() {
            headline += &format!(", seed {}", recording.seed);
        }
        print(&recording, &figures, &headline, &args.out, out)?;
        if let Some(against) = against {
            let table = against.table().map_or_else(String::new, |table| table.text());
            writeln!(out, "\n{table}{}", against.sentence())?;
        }
    }
    Ok(figures.any_problems())
}

/// Arguments of `rc10 csv`.
#[derive(Args, Debug)]
pub struct CsvArgs {
    /// The record: what --record of `rc10 run` and `rc10 emu` wrote, or another MCAP file of `ros2msg`
    /// numbers
    pub record: PathBuf,
    /// Folder for the files, one for each topic
    #[arg(long, value_name = "DIR", default_value = "target/rc10-csv")]
    pub out: PathBuf,
}

/// Writes the numbers and events of a record as CSV files, one for each topic. Fails if the file is
/// invalid or the folder cannot be written.
pub fn csv(args: &CsvArgs, out: &mut dyn Write) -> Result<()> {
    let mut file = open(&args.record)?;
    let named = || args.record.display().to_string();
    let mut tables: BTreeMap<u16, Table> = BTreeMap::new();
    let mut names = BTreeSet::new();
    let cut = walk(&mut file, |item| {
        match item {
            Item::Channel(id, Channel { topic, columns, .. }) if !tables.contains_key(&id) => {
                make_folder(&args.out)?;
                let name = file_name(&topic, &mut names);
                let beside = Unfinished::new(&args.out.join(&name));
                let mut file = BufWriter::new(beside.create()?);
                let head = columns.as_ref().map_or_else(|| "label".into(), |all| all.join(","));
                writeln!(file, "time_s,{head}")?;
                let is_text = columns.is_none();
                tables.insert(id, Table { name, rows: 0, is_text, file, beside });
            }
            Item::Message(id, time, bytes) => {
                let Some(Table { rows, is_text, file, .. }) = tables.get_mut(&id) else {
                    bail!("a message of a channel that is not declared");
                };
                *rows += 1;
                write!(file, "{}.{:09}", time / 1_000_000_000, time % 1_000_000_000)?;
                if *is_text {
                    write!(file, ",{}", label(bytes).replace([',', '\n', '"'], " "))?;
                } else {
                    for value in numbers(bytes)? {
                        let value = if value.is_nan() { String::new() } else { value.to_string() };
                        write!(file, ",{value}")?;
                    }
                }
                writeln!(file)?;
            }
            _ => {}
        }
        Ok(())
    })
    .with_context(named)?;
    for Table { name, rows, mut file, beside, .. } in tables.into_values() {
        let path = args.out.join(name);
        let written = file.flush().and_then(|()| beside.put(&path));
        written.with_context(|| format!("cannot write {}", path.display()))?;
        writeln!(out, "{rows:>8} rows  {}", path.display())?;
    }
    if let Some(why) = cut {
        tell(format_args!("{}: cut off: {why}", args.record.display()));
    }
    Ok(())
}

/// A table, which gets its final name when it is whole.
struct Table {
    name: String,
    rows: usize,
    is_text: bool,
    file: BufWriter<File>,
    beside: Unfinished,
}

/// A file name for a topic, valid on every system and not taken yet.
fn file_name(topic: &str, taken: &mut BTreeSet<String>) -> String {
    let safe = |letter: char| match letter {
        '/' => '-',
        letter if letter.is_alphanumeric() || letter == '-' => letter,
        _ => '_',
    };
    let mut name: String = topic.trim_start_matches('/').chars().take(80).map(safe).collect();
    let device = name.to_lowercase();
    let numbered = device.strip_prefix("com").or_else(|| device.strip_prefix("lpt"));
    if matches!(device.as_str(), "con" | "prn" | "aux" | "nul")
        || numbered.is_some_and(|rest| rest.chars().count() == 1)
    {
        name.push('_');
    }
    // Files that differ by case alone are one file elsewhere.
    while !taken.insert(name.to_lowercase()) {
        name.push('_');
    }
    name + ".csv"
}
