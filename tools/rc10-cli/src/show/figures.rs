//! The figures of a run: tables for people, JSON for programs.

use std::fmt::Write as _;

use rc10_module::Counters;
use rc10_motor::embassy::Rs485Status;
use rc10_motor::{DriveMode, Link, TargetKind, Verdict};
use rc10_sim::remote::Sent;
use rc10_time::{Micros, Timing};
use serde_json::{Value, json};

use crate::judge::path::PathFigures;
use crate::judge::problems;
use crate::lang::Language;
use crate::recording::problem::{Problem, Severity, any};
use crate::recording::remote::{Loss, RemoteTrack};
use crate::recording::sample::{Source, is_angle, seconds};
use crate::recording::signal::SignalTrack;
use crate::recording::{BusTrack, MotorTrack, PartTrack, Recording, Tracking};
use crate::terminal::{width, wrapped};

/// The figures of a run: computed once, and printed as text, JSON and HTML.
pub struct Figures {
    /// Figures of each motor, in the order of the robot's table.
    pub motors: Vec<MotorFigures>,
    /// Figures of the path, if the robot has an estimate or a reference.
    pub path: Option<PathFigures>,
    /// Problems and information.
    pub problems: Vec<Problem>,
    /// The tables of all of it.
    pub tables: Tables,
}

/// The tables of a run.
pub struct Tables {
    /// A line per motor.
    pub motors: Table,
    /// A line per bus.
    pub buses: Table,
    /// A line per RS-485 line, if there is one.
    pub lines: Option<Table>,
    /// A line per part on a UART beside the remote's receiver, if there is one.
    pub parts: Option<Table>,
    /// A line per signal of the robot's own, if there is one.
    pub signals: Option<Table>,
}

/// The figures of one motor.
pub struct MotorFigures {
    /// Unit of the newest target and measurement.
    pub unit: &'static str,
    /// Newest target, if it followed one.
    pub target: Option<f64>,
    /// Newest measurement.
    pub measured: Option<f64>,
    /// Tracking of targets by kind, the one that was followed longest first.
    pub tracking: Vec<Tracking>,
    /// Largest current either way, A.
    pub peak_current: Option<f64>,
    /// Verdict on the control loops.
    pub loops: &'static str,
}

impl Figures {
    /// The figures of a run.
    pub fn of(recording: &Recording) -> Self {
        let of = |track| MotorFigures::of(track, recording.source);
        let motors: Vec<_> = recording.motors.iter().map(of).collect();
        let tables = Tables {
            motors: motor_table(recording, &motors),
            buses: bus_table(recording),
            lines: line_table(recording),
            parts: part_table(recording),
            signals: signal_table(recording),
        };
        let path = PathFigures::of(recording);
        Self { motors, path, problems: problems(recording), tables }
    }

    /// Whether there is a problem.
    pub fn any_problems(&self) -> bool {
        any(&self.problems)
    }

    /// The findings of a severity.
    pub fn found(&self, severity: Severity) -> impl Iterator<Item = &Problem> {
        self.problems.iter().filter(move |problem| problem.severity == severity)
    }
}

impl MotorFigures {
    fn of(track: &MotorTrack, source: Source) -> Self {
        let last = track.samples.last();
        // A device that tells a torque has no current to be seen from outside.
        let has_current = source.is_simulated() || track.last.feedback.current().is_some();
        let mut tracking = track.tracking.clone();
        // Stable: of two that are as long the first one stays first.
        tracking.sort_by_key(|tracking| std::cmp::Reverse(tracking.looks));
        Self {
            unit: unit(last.map_or(TargetKind::Speed, |sample| sample.kind)),
            target: last.and_then(|sample| sample.target),
            measured: last.map(|sample| sample.measured),
            tracking,
            peak_current: (has_current && !track.samples.is_empty()).then_some(track.peak_current),
            loops: match &track.effort {
                None => "not judged",
                Some(effort) if effort.windows == 0 => "not driven",
                Some(effort) if effort.oscillates() => "shakes",
                Some(effort) if effort.saturates() => "at its limit",
                Some(_) => "calm",
            },
        }
    }

    /// The error of each kind of target: `6.70 deg angle, 7.09 rpm speed`.
    pub fn errors(&self) -> String {
        let one = |it: &Tracking| format!("{:.2} {} {}", it.rms(), unit(it.kind), noun(it.kind));
        self.tracking.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}

/// The unit of targets of a kind, and of their measurements.
pub const fn unit(kind: TargetKind) -> &'static str {
    if is_angle(kind) { "deg" } else { "rpm" }
}

const fn noun(kind: TargetKind) -> &'static str {
    match kind {
        TargetKind::Angle => "angle",
        TargetKind::TotalAngle => "total angle",
        TargetKind::Impedance => "impedance",
        TargetKind::Motion => "motion",
        _ => "speed",
    }
}

// ---- tables, as text and as HTML ---------------------------------------------------------------

/// A table whose first columns are words.
pub struct Table {
    /// Titles of the columns.
    pub head: Vec<&'static str>,
    /// Number of columns that are words.
    pub words: usize,
    /// The rows.
    pub rows: Vec<Vec<Entry>>,
}

/// One cell of a table.
pub struct Entry {
    /// Words or a number.
    pub text: String,
    /// Whether it is not as it should be.
    pub bad: bool,
    /// Whether it is better than it was.
    pub good: bool,
}

pub(crate) fn words(text: impl ToString) -> Entry {
    Entry { text: text.to_string(), bad: false, good: false }
}

/// A count that should be zero.
fn loss(count: impl Into<u64>) -> Entry {
    let count = count.into();
    Entry { bad: count > 0, ..words(grouped(count)) }
}

fn count(count: impl Into<u64>) -> Entry {
    words(grouped(count.into()))
}

pub(crate) fn number(value: Option<f64>, digits: usize, unit: &str) -> Entry {
    words(optional(value, digits, unit))
}

/// A number with a unit; a dash without one.
pub(crate) fn optional(value: Option<f64>, digits: usize, unit: &str) -> String {
    match value.filter(|value| value.is_finite()) {
        Some(value) => format!("{value:.digits$}{unit}"),
        None => "–".to_owned(),
    }
}

/// 1234567 as "1 234 567", with spaces that do not break.
pub(crate) fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join("\u{202f}")
}

/// A column of a table: its title, and its entry of a row.
type Column<R> = (&'static str, fn(&R) -> Entry);

impl Table {
    /// Creates a table of these rows. Its first `words` columns are words; those with the titles in
    /// `hidden` are left out.
    fn new<R>(columns: &[Column<R>], words: usize, hidden: &[&str], rows: &[R]) -> Self {
        let is_shown = |(title, _): &&Column<R>| !hidden.contains(title);
        let shown: Vec<_> = columns.iter().filter(is_shown).collect();
        let row = |row: &R| shown.iter().map(|(_, entry)| entry(row)).collect();
        Self {
            head: shown.iter().map(|(title, _)| *title).collect(),
            words: columns.iter().take(words).filter(is_shown).count(),
            rows: rows.iter().map(row).collect(),
        }
    }

    /// The table as text for a terminal. In one that is too narrow, columns that count nothing are left out, and the
    /// others stand below one another.
    pub fn text(&self) -> String {
        self.text_in(width())
    }

    fn text_in(&self, room: Option<usize>) -> String {
        let wide = |column: usize| {
            let entries = self.rows.iter().filter_map(|row| row.get(column)).map(|it| &*it.text);
            entries
                .chain(self.head.get(column).copied())
                .map(|it| it.chars().count())
                .max()
                .unwrap_or(0)
        };
        let all: Vec<(usize, usize)> = (0..self.head.len()).map(|at| (at, wide(at))).collect();
        let fits = |columns: &[(usize, usize)]| {
            let sum: usize = columns.iter().map(|(_, wide)| wide + 2).sum();
            room.is_none_or(|room| sum <= room + 2)
        };
        if fits(&all) {
            return self.block(&all);
        }
        let counts = |at: usize| {
            at < self.words
                || self.rows.iter().any(|row| row.get(at).is_some_and(|it| it.text != "0"))
        };
        let mut blocks: Vec<Vec<(usize, usize)>> = Vec::new();
        for column in all.iter().copied().skip(1).filter(|(at, _)| counts(*at)) {
            let last =
                blocks.last_mut().filter(|last| fits(&[last.as_slice(), &[column]].concat()));
            match last {
                Some(last) => last.push(column),
                None => blocks.push(vec![all[0], column]),
            }
        }
        blocks.iter().map(|columns| self.block(columns)).collect::<Vec<_>>().join("\n")
    }

    /// Some columns of the table, by number and width.
    fn block(&self, columns: &[(usize, usize)]) -> String {
        let line = |text: &dyn Fn(usize) -> Option<String>| {
            let mut line = String::new();
            for (column, width) in columns {
                let text = text(*column).unwrap_or_default();
                let _ = match *column < self.words {
                    true => write!(line, "{text:<width$}  "),
                    false => write!(line, "{text:>width$}  "),
                };
            }
            line.trim_end().replace('\u{202f}', " ") + "\n"
        };
        let mut text = line(&|at| self.head.get(at).map(ToString::to_string));
        for row in &self.rows {
            text += &line(&|at| row.get(at).map(|entry| entry.text.clone()));
        }
        text
    }
}

fn motor_table(recording: &Recording, figures: &[MotorFigures]) -> Table {
    let columns: &[Column<(&MotorTrack, &MotorFigures)>] = &[
        ("motor", |(track, _)| words(track.motor.label)),
        ("model", |(track, _)| words(track.motor.name())),
        ("bus", |(track, _)| words(crate::robot::motor::short(track.motor.on))),
        ("link", |(track, _)| {
            let (name, bad) = match track.last.link {
                Link::NeverSeen => ("never heard", true),
                Link::Online => ("online", false),
                Link::Lost => ("lost", true),
            };
            Entry { bad, ..words(name) }
        }),
        ("drive", |(track, _)| words(drive_name(track.last.drive))),
        ("loop", |(_, figures)| {
            let bad = matches!(figures.loops, "shakes" | "at its limit");
            Entry { bad, ..words(figures.loops) }
        }),
        ("target", |(_, figures)| number(figures.target, 1, &format!(" {}", figures.unit))),
        ("measured", |(_, figures)| number(figures.measured, 1, &format!(" {}", figures.unit))),
        ("RMS error", |(_, figures)| {
            words(if figures.tracking.is_empty() { "–".into() } else { figures.errors() })
        }),
        ("peak", |(_, figures)| number(figures.peak_current, 2, " A")),
        ("received", |(track, _)| count(track.last.counters.received)),
        ("malformed", |(track, _)| loss(track.last.counters.malformed)),
        ("lost", |(track, _)| loss(track.last.counters.lost)),
        ("overwritten", |(track, _)| loss(track.overwritten)),
        ("refused", |(track, _)| loss(track.last.counters.refused.total())),
    ];
    let hidden: &[&str] = match recording.source {
        Source::Simulation => &[],
        // The robot knows what it has heard.
        Source::Robot => &["loop", "overwritten"],
        // Only the chip knows these.
        Source::Emulation => &["drive", "target", "RMS error", "refused"],
        Source::Capture => {
            &["drive", "loop", "target", "RMS error", "lost", "overwritten", "refused"]
        }
    };
    let rows: Vec<_> = recording.motors.iter().zip(figures).collect();
    Table::new(columns, 6, hidden, &rows)
}

fn percent(value: f64) -> Entry {
    number(Some(value), 1, " %")
}

fn micros(value: Option<impl Into<f64>>, digits: usize) -> Entry {
    number(value.map(Into::into), digits, " µs")
}

fn bus_table(recording: &Recording) -> Table {
    let columns: &[Column<&BusTrack>] = &[
        ("bus", |track| words(format!("bus {}", track.number))),
        ("plan", |track| {
            let (name, bad) = match track.last.load.verdict() {
                Verdict::Fits => ("fits", false),
                Verdict::Tight => ("tight", false),
                Verdict::DoesNotFit => ("does not fit", true),
            };
            Entry { bad, ..words(name) }
        }),
        ("planned load: least", |track| percent(track.last.load.least.into())),
        ("typical", |track| percent(track.last.load.typical.into())),
        ("worst", |track| percent(track.last.load.worst.into())),
        ("measured", |track| percent(track.load)),
        ("frames", |track| count(track.frames)),
        ("rx lost", |track| loss(track.last.health.receive_lost)),
        ("replaced", |track| loss(track.last.replaced)),
        ("refused", |track| loss(track.last.refused)),
        ("overruns", |track| loss(track.last.overruns)),
        ("tick period: min", |track| micros(track.last.period.min(), 0)),
        ("mean", |track| micros(track.last.period.mean(), 1)),
        ("max", |track| micros(track.last.period.max(), 0)),
    ];
    const PERIOD: [&str; 3] = ["tick period: min", "mean", "max"];
    let hidden = match recording.source {
        Source::Simulation => Vec::new(),
        // The robot does not count what others say on its wires.
        Source::Robot => [&["measured", "frames"], &PERIOD[..]].concat(),
        Source::Emulation | Source::Capture => {
            [&["rx lost", "replaced", "refused", "overruns"], &PERIOD[..]].concat()
        }
    };
    Table::new(columns, 2, &hidden, &recording.buses.iter().collect::<Vec<_>>())
}

fn line_table(recording: &Recording) -> Option<Table> {
    let columns: &[Column<(u8, &Rs485Status)>] = &[
        ("line", |(number, _)| words(format!("line {number}"))),
        ("exchanges", |(_, line)| count(line.traffic.exchanges)),
        ("timeouts", |(_, line)| loss(line.traffic.timeouts)),
        ("CRC errors", |(_, line)| loss(line.traffic.crc_errors)),
        ("garbage bytes", |(_, line)| loss(line.traffic.garbage)),
        ("unexpected", |(_, line)| loss(line.traffic.unexpected)),
        ("port errors", |(_, line)| loss(line.port_errors)),
        ("overruns", |(_, line)| loss(line.overruns)),
        ("exchange: min", |(_, line)| micros(line.traffic.exchange.min(), 0)),
        ("mean", |(_, line)| micros(line.traffic.exchange.mean(), 1)),
        ("max", |(_, line)| micros(line.traffic.exchange.max(), 0)),
        ("cycle: min", |(_, line)| micros(line.traffic.cycle.min(), 0)),
        ("mean", |(_, line)| micros(line.traffic.cycle.mean(), 1)),
        ("max", |(_, line)| micros(line.traffic.cycle.max(), 0)),
    ];
    // Only the robot knows these.
    let hidden: &[&str] =
        if recording.source.is_told() { &[] } else { &["port errors", "overruns"] };
    let rows: Vec<_> = (1..).zip(&recording.lines).collect();
    (!rows.is_empty()).then(|| Table::new(columns, 1, hidden, &rows))
}

pub(crate) const fn drive_name(drive: DriveMode) -> &'static str {
    match drive {
        DriveMode::Off => "off",
        DriveMode::Coast => "coast",
        DriveMode::Brake => "brake",
        DriveMode::Hold => "hold",
        DriveMode::Run => "run",
    }
}

/// The verdict of a run, in a line or more: for the end of the output.
pub fn verdict(recording: &Recording, figures: &Figures) -> String {
    // What no run of this robot shows is told where somebody tries it out.
    let is_told = |it: &&Problem| !it.is_standing() || !recording.mistakes.is_empty();
    let list = |severity| -> String {
        figures.found(severity).filter(is_told).map(Problem::lines).collect()
    };
    let language = Language::spoken();
    let mut all = headline(recording, figures) + "\n" + &list(Severity::Problem);
    let information = list(Severity::Information);
    if !information.is_empty() {
        all += &format!("Good to know\n{information}");
    }
    wrapped(&language.say(&all))
}

/// The first line of the verdict.
pub fn headline(recording: &Recording, figures: &Figures) -> String {
    match figures.found(Severity::Problem).count() {
        0 if recording.faults.is_empty() => {
            let count = recording.motors.len();
            match recording.source {
                Source::Capture => format!("✓ All {count} motors of the captured buses online"),
                _ => format!("✓ All {count} motors online · no frame lost · no overruns"),
            }
        }
        0 => "✓ No problem but the faults that were asked for".into(),
        1 => "✗ 1 problem".into(),
        count => format!("✗ {count} problems"),
    }
}

/// An empty line, one for the receiver and one for each loss of the remote; empty without a remote.
pub fn remote_lines(recording: &Recording) -> String {
    let Some(track) = &recording.remote else { return String::new() };
    let RemoteTrack { receiver, sent, heard, losses, .. } = track;
    let heard = heard.map_or_else(String::new, |heard| {
        let Counters { frames, damaged, skipped, port_errors, .. } = heard;
        let good = format!("; {frames} heard, {damaged} damaged");
        format!("{good}, {skipped} bytes skipped, {port_errors} port errors")
    });
    let losses: String = losses.iter().map(|loss| sentence(loss) + "\n").collect();
    let Sent { frames, live, .. } = sent;
    format!("\nremote {receiver}: {frames} frames sent, {live} of them live{heard}\n{losses}")
}

/// One loss in words.
pub fn sentence(loss: &Loss) -> String {
    let &Loss { lost, last_frame, coasting, back, resumed, disarmed } = loss;
    let at = |what: &str, time: Micros| format!("{what} {:.4} s", seconds(time));
    let mut parts = Vec::new();
    parts
        .push(last_frame.map_or("no good frame before".into(), |time| at("last good frame", time)));
    parts.push(match (coasting, loss.reaction()) {
        (Some(time), Some(reaction)) => {
            format!("{}, {:.1} ms after it", at("all coast", time), seconds(reaction) * 1e3)
        }
        (Some(time), None) if time > lost.from => at("all coast", time),
        (Some(_), _) => "all coasted already".into(),
        (None, _) if back.is_some() => "back before the robot let go".into(),
        (None, _) => "the run ended before the robot let go".into(),
    });
    match disarmed {
        Some(time) if time > lost.from => parts.push(at("disarmed", time)),
        Some(_) => parts.push("not armed".into()),
        None if coasting.is_some() && back.is_none() => {
            parts.push("the run ended before more happened".into());
        }
        None => (),
    }
    parts.extend(back.map(|time| at("good frames again", time)));
    parts.extend(resumed.map(|time| at("resumed", time)));
    let from = seconds(lost.from);
    let until = lost.until.map_or(String::new(), |until| format!(" to {:.3} s", seconds(until)));
    let lost = if until.is_empty() { "at" } else { "from" };
    format!("remote lost {lost} {from:.3} s{until}: {}", parts.join("; "))
}

/// The remote as JSON; null without one.
pub fn remote_json(recording: &Recording) -> Value {
    let Some(track) = &recording.remote else { return Value::Null };
    let micros = |time: Option<Micros>| time.map(Micros::get);
    let losses = track.losses.iter().map(|loss| {
        json!({
            "from_us": loss.lost.from.get(),
            "until_us": micros(loss.lost.until),
            "last_good_frame_us": micros(loss.last_frame),
            "all_coast_us": micros(loss.coasting),
            "frame_to_coast_us": micros(loss.reaction()),
            "disarmed_us": micros(loss.disarmed),
            "good_frame_again_us": micros(loss.back),
            "resumed_us": micros(loss.resumed),
        })
    });
    let heard = track.heard.as_ref().map(heard_json);
    json!({
        "receiver": track.receiver.to_string(),
        "frames_sent": track.sent.frames,
        "live_frames_sent": track.sent.live,
        "heard": heard,
        "losses": losses.collect::<Vec<_>>(),
    })
}

fn part_table(recording: &Recording) -> Option<Table> {
    let columns: &[Column<&PartTrack>] = &[
        ("part", |part| words(part.label)),
        ("at", |part| words(format!("UART {}", part.uart))),
        ("frames", |part| count(part.heard.frames)),
        ("damaged", |part| loss(part.heard.damaged)),
        ("bytes skipped", |part| loss(part.heard.skipped)),
        ("port errors", |part| loss(part.heard.port_errors)),
    ];
    let rows: Vec<_> = recording.parts.iter().collect();
    (!rows.is_empty()).then(|| Table::new(columns, 2, &[], &rows))
}

/// The parts on UARTs as JSON.
pub fn parts_json(recording: &Recording) -> Value {
    let part = |part: &PartTrack| {
        let mut json = heard_json(&part.heard);
        (json["part"], json["uart"]) = (part.label.into(), part.uart.into());
        json
    };
    recording.parts.iter().map(part).collect()
}

fn heard_json(heard: &Counters) -> Value {
    json!({
        "frames": heard.frames,
        "damaged": heard.damaged,
        "bytes_skipped": heard.skipped,
        "port_errors": heard.port_errors,
    })
}

/// All figures as one JSON object; `wall` is the real time of the run in seconds, if it is a run.
pub fn to_json(recording: &Recording, figures: &Figures, wall: Option<f64>) -> Value {
    let motors = recording.motors.iter().zip(&figures.motors).map(|(track, figures)| {
        let MotorFigures { unit, target, measured, peak_current, loops, .. } = figures;
        let longest = figures.tracking.first();
        let refused = track.last.counters.refused;
        json!({
            "motor": track.motor.label,
            "model": track.motor.name().model,
            "id": track.motor.name().id,
            "bus": track.motor.on.bus(),
            "line": track.motor.on.line(),
            "link": format!("{:?}", track.last.link),
            "drive": format!("{:?}", track.last.drive),
            "unit": unit,
            "target": target,
            "measured": measured,
            "error_rms": longest.map(Tracking::rms),
            "tracking": figures.tracking.iter().map(tracking_json).collect::<Vec<_>>(),
            "loop": loops,
            "peak_current_a": peak_current,
            "received": track.last.counters.received,
            "malformed": track.last.counters.malformed,
            "lost": track.last.counters.lost,
            "expired": track.last.counters.expired,
            "refused": {
                "not_finite": refused.not_finite,
                "out_of_range": refused.out_of_range,
                "unsupported": refused.unsupported,
            },
            "feedback_overwritten": track.overwritten,
        })
    });
    let buses = recording.buses.iter().map(|bus| {
        json!({
            "bus": bus.number,
            "planned_load_percent": {
                "least": f64::from(bus.last.load.least),
                "typical": f64::from(bus.last.load.typical),
                "worst": f64::from(bus.last.load.worst),
            },
            "load_percent": bus.load,
            "frames": bus.frames,
            "received": bus.last.received.received,
            "malformed": bus.last.received.malformed,
            "unclaimed": bus.last.received.unclaimed,
            "lost": bus.last.health.receive_lost,
            "submitted": bus.last.submitted,
            "replaced": bus.last.replaced,
            "refused": bus.last.refused,
            "overruns": bus.last.overruns,
            "ticks": bus.last.ticks,
            "tick_period_us": timing(&bus.last.period),
            "tick_execution_us": timing(&bus.last.execution),
        })
    });
    let ticks: u64 = recording.buses.iter().map(|bus| u64::from(bus.last.ticks)).sum();
    json!({
        "seed": recording.seed,
        "virtual_seconds": recording.length.get() as f64 * 1e-6,
        "wall_seconds": wall,
        "ticks": ticks,
        "trace_hash": recording.trace_hash(),
        "motors": motors.collect::<Vec<_>>(),
        "buses": buses.collect::<Vec<_>>(),
        "lines": lines_json(recording),
        "remote": remote_json(recording),
        "parts": parts_json(recording),
        "signals": signals_json(recording),
        "path": figures.path.as_ref().map(PathFigures::to_json),
        "problems": problems_json(figures),
    })
}

fn timing(timing: &Timing) -> Value {
    json!({ "min": timing.min(), "mean": timing.mean(), "max": timing.max() })
}

/// The RS-485 lines as JSON, without the ticks of an emulated chip, which are unknown.
pub(crate) fn lines_json(recording: &Recording) -> Value {
    let lines = (1..).zip(&recording.lines).map(|(number, line): (u8, _)| {
        let traffic = &line.traffic;
        let mut figures = json!({
            "line": number,
            "exchanges": traffic.exchanges,
            "timeouts": traffic.timeouts,
            "crc_errors": traffic.crc_errors,
            "garbage_bytes": traffic.garbage,
            "unexpected": traffic.unexpected,
            "exchange_us": timing(&traffic.exchange),
            "cycle_us": timing(&traffic.cycle),
        });
        if recording.source.is_told() {
            figures["port_errors"] = line.port_errors.into();
            figures["overruns"] = line.overruns.into();
            figures["ticks"] = line.ticks.into();
            figures["tick_period_us"] = timing(&line.period);
        }
        figures
    });
    lines.collect()
}

/// The problems and the information as JSON.
pub fn problems_json(figures: &Figures) -> Value {
    figures.problems.iter().map(Problem::to_json).collect()
}

fn tracking_json(tracking: &Tracking) -> Value {
    json!({
        "kind": noun(tracking.kind),
        "unit": unit(tracking.kind),
        "seconds": seconds(tracking.time()),
        "rms": tracking.rms(),
        "peak": tracking.peak,
    })
}

/// A value of a signal: a number, or the name of a state.
fn signal_value(track: &SignalTrack, value: Option<f64>) -> Entry {
    match value {
        Some(value) if !track.states.is_empty() => {
            words(track.states.split(',').nth(value as usize).unwrap_or_default())
        }
        value if track.unit.is_empty() => number(value, 2, ""),
        value => number(value, 2, &format!(" {}", track.unit)),
    }
}

fn signal_table(recording: &Recording) -> Option<Table> {
    let columns: &[Column<&SignalTrack>] = &[
        ("signal", |track| words(track.label)),
        ("at the end", |track| signal_value(track, track.last)),
        ("lowest", |track| signal_value(track, track.range.map(|range| range[0]))),
        ("mean", |track| {
            let range = track.range.filter(|_| track.states.is_empty());
            signal_value(track, range.map(|range| range[1]))
        }),
        ("highest", |track| signal_value(track, track.range.map(|range| range[2]))),
        ("without a value", |track| {
            number(Some(seconds(track.absent)).filter(|time| *time > 0.0), 3, " s")
        }),
    ];
    let rows: Vec<_> = recording.signals.iter().collect();
    (!rows.is_empty()).then(|| Table::new(columns, 1, &[], &rows))
}

/// The signals as JSON.
pub fn signals_json(recording: &Recording) -> Value {
    let signal = |track: &SignalTrack| {
        let of = |index: usize| track.range.map(|range| range[index]);
        json!({
            "signal": track.label,
            "unit": track.unit,
            "last": track.last,
            "lowest": of(0),
            "mean": of(1),
            "highest": of(2),
            "absent_us": track.absent.get(),
        })
    };
    recording.signals.iter().map(signal).collect()
}

#[cfg(test)]
mod tests {
    use rc10_motor::dji::M3508;
    use rc10_motor::{MotorCounters, MotorStatus};

    use super::*;
    use crate::recording::sample::{Cell, MotorSample};
    use crate::recording::signal::SignalRecorder;
    use crate::robot::motor::Motor;
    use crate::robot::remote::Lost;
    use crate::robot::signal::Signal;
    use std::rc::Rc;

    /// A track of three samples, the second without a target, and with these errors in its looks.
    fn track(label: &'static str, kind: TargetKind, errors: &[f64]) -> MotorTrack {
        let sample = |(target, measured)| MotorSample {
            target,
            measured,
            measured_cell: Cell::of(measured),
            kind,
            current: 0.0,
            current_cell: Cell::of(0.0),
            rpm: 0.0,
            rpm_cell: Cell::of(0.0),
            link: Link::Online,
            drive: DriveMode::Run,
            counters: MotorCounters::default(),
            overwritten: 0,
            temperature: f32::NAN,
            supply: f32::NAN,
        };
        MotorTrack {
            motor: Motor::dji_on(label, 1, &M3508, 1),
            samples: [(Some(30.0), 27.0), (None, -90.0), (Some(30.0), 26.0)].map(sample).into(),
            last: MotorStatus::NEW,
            overwritten: 0,
            tracking: vec![Tracking {
                kind,
                looks: errors.len() as u64,
                squares: errors.iter().map(|error| error * error).sum(),
                peak: errors.iter().fold(0.0, |peak: f64, error| peak.max(error.abs())),
            }],
            peak_current: 12.5,
            effort: None,
        }
    }

    #[test]
    fn numbers_stand_with_their_units_in_table_and_json() {
        let recording = Recording {
            motors: vec![
                track("wheel", TargetKind::Speed, &[3.0, 4.0]),
                track("gimbal", TargetKind::Angle, &[3.0, -4.0]),
                track("lift", TargetKind::TotalAngle, &[3.0, 4.0]),
                track("leg", TargetKind::Impedance, &[3.0, 4.0]),
            ],
            ..Recording::default()
        };
        let figures = Figures::of(&recording);
        let table = &figures.tables.motors;
        let json = to_json(&recording, &figures, None);
        let column = |title| table.head.iter().position(|head| *head == title).unwrap();
        for (index, (unit, noun)) in
            [("rpm", "speed"), ("deg", "angle"), ("deg", "total angle"), ("deg", "impedance")]
                .into_iter()
                .enumerate()
        {
            let text = |title| table.rows[index][column(title)].text.as_str();
            assert_eq!(text("target"), format!("30.0 {unit}"));
            assert_eq!(text("measured"), format!("26.0 {unit}"));
            assert_eq!(text("RMS error"), format!("3.54 {unit} {noun}"));
            assert_eq!(text("peak"), "12.50 A");
            let motor = &json["motors"][index];
            assert_eq!((&motor["unit"], &motor["target"]), (&json!(unit), &json!(30.0)));
            assert_eq!(
                (&motor["measured"], &motor["peak_current_a"]),
                (&json!(26.0), &json!(12.5))
            );
            assert_eq!(motor["error_rms"], json!(12.5_f64.sqrt()));
            let tracking = json!([{
                "kind": noun,
                "unit": unit,
                "seconds": 0.002,
                "rms": 12.5_f64.sqrt(),
                "peak": 4.0,
            }]);
            assert_eq!(motor["tracking"], tracking);
        }
    }

    #[test]
    fn a_loss_is_described_to_its_end() {
        let at = |millis| Some(Micros::from_millis(millis));
        let lost = Lost { from: Micros::from_millis(4000), until: at(4500) };
        let (last_frame, coasting) = (at(3995), at(4101));
        let back =
            Loss { lost, last_frame, coasting, back: at(4512), resumed: at(4520), disarmed: None };
        let for_good = Loss {
            lost: Lost { until: None, ..lost },
            back: None,
            resumed: None,
            disarmed: at(5000),
            ..back
        };
        let nothing = Loss { coasting: None, disarmed: None, ..for_good };
        // Stopped by hand before.
        let stopped = Loss { coasting: at(4000), disarmed: at(4000), ..for_good };
        assert_eq!((back.reaction(), stopped.reaction()), (at(106), None));
        for (loss, words) in [
            (
                back,
                "remote lost from 4.000 s to 4.500 s: last good frame 3.9950 s; all coast \
                 4.1010 s, 106.0 ms after it; good frames again 4.5120 s; resumed 4.5200 s",
            ),
            (
                for_good,
                "remote lost at 4.000 s: last good frame 3.9950 s; all coast 4.1010 s, 106.0 ms \
                 after it; disarmed 5.0000 s",
            ),
            (
                Loss { disarmed: None, ..for_good },
                "remote lost at 4.000 s: last good frame 3.9950 s; all coast 4.1010 s, 106.0 ms \
                 after it; the run ended before more happened",
            ),
            (
                nothing,
                "remote lost at 4.000 s: last good frame 3.9950 s; the run ended before the robot \
                 let go",
            ),
            (
                Loss { lost, back: at(4010), ..nothing },
                "remote lost from 4.000 s to 4.500 s: last good frame 3.9950 s; back before \
                 the robot let go; good frames again 4.0100 s",
            ),
            (
                stopped,
                "remote lost at 4.000 s: last good frame 3.9950 s; all coasted already; not armed",
            ),
            (
                Loss { last_frame: None, ..stopped },
                "remote lost at 4.000 s: no good frame before; all coasted already; not armed",
            ),
        ] {
            assert_eq!(sentence(&loss), words);
        }
    }

    #[test]
    fn a_signal_has_its_range_and_the_time_without_a_value() {
        let signal = Signal { label: "wall", unit: "mm", states: "", read: Rc::new(|_| None) };
        let mut recorder = SignalRecorder::new(&signal);
        let values = [Some(1.0), Some(4.0), None, Some(-2.0), Some(f64::NAN), Some(f64::INFINITY)];
        for pair in values.chunks(2) {
            pair.iter().for_each(|value| recorder.look(*value));
            recorder.sample();
        }
        let track = recorder.finish();
        let cell = |min, mean, max| Some(Cell { min, mean, max });
        assert_eq!(track.samples, [cell(1.0, 2.5, 4.0), cell(-2.0, -2.0, -2.0), None]);
        assert_eq!((track.last, track.range), (None, Some([-2.0, 1.0, 4.0])));
        assert_eq!(track.absent, Micros::from_millis(3));
        let recording = Recording { signals: vec![track], ..Recording::default() };
        let text = Figures::of(&recording).tables.signals.unwrap().text();
        let line: Vec<&str> = text.lines().nth(1).unwrap().split_whitespace().collect();
        assert_eq!(line.join(" "), "wall – -2.00 mm 1.00 mm 4.00 mm 0.003 s");
        let json = signals_json(&recording);
        assert_eq!((&json[0]["lowest"], &json[0]["last"]), (&json!(-2.0), &Value::Null));
        assert_eq!(json[0]["absent_us"], 3000);
    }

    #[test]
    fn a_table_fits_the_terminal_without_what_counts_nothing() {
        let head = vec!["motor", "received", "malformed", "lost", "measured"];
        let row = |label: &str, lost: u32| {
            vec![
                words(label),
                count(20_000_u32),
                loss(0_u32),
                loss(lost),
                number(Some(1.5), 1, " rpm"),
            ]
        };
        let table = Table { head, words: 1, rows: vec![row("wheel left", 0), row("arm", 3)] };
        let wide = table.text_in(None);
        assert_eq!((wide.lines().count(), table.text_in(Some(47)).as_str()), (3, wide.as_str()));
        assert_eq!(wide.lines().map(|line| line.chars().count()).max(), Some(47), "{wide}");
        let narrow = table.text_in(Some(26));
        assert!(narrow.lines().all(|line| line.chars().count() <= 26), "{narrow}");
        assert!(!narrow.contains("malformed") && narrow.contains("lost"), "{narrow}");
        assert_eq!(narrow.matches("wheel left").count(), 2, "{narrow}");
    }

    #[test]
    fn a_robot_without_signals_has_no_table() {
        assert!(Figures::of(&Recording::default()).tables.signals.is_none());
        assert_eq!(signals_json(&Recording::default()), json!([]));
    }
}
