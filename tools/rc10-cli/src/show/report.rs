//! The report of a run: one HTML file that loads nothing from anywhere.
//!
//! The tables are HTML; in the browser `report.js` draws the plots from the samples in the page's
//! JSON.

use std::collections::BTreeSet;
use std::fmt::{Display, Write as _};
use std::fs;
use std::path::{Component, Path};

use anyhow::Result;
use rc10_emu::fault::Fault;
use rc10_motor::{ArmState, DriveMode, Link, TargetKind};
use rc10_time::Micros;
use serde_json::{Map, Value, json};

use crate::files::write_file;
use crate::judge::happened::happened;
use crate::judge::path::{Apart, PathFigures, Paths};
use crate::lang;
use crate::recording::origin::Origin;
use crate::recording::problem::{Problem, Severity};
use crate::recording::remote::{Loss, RemoteTrack};
use crate::recording::sample::{
    Cell, MotorSample, PathPoint, RemoteSample, SAMPLE_PERIOD, Source, is_angle, rounded, seconds,
};
use crate::recording::signal::SignalTrack;
use crate::recording::{BusTrack, MotorTrack, Recording};
use crate::robot::motor::Place;
use crate::show::compare::Comparison;
use crate::show::figures::{
    Figures, Table, drive_name, grouped, headline, number, optional, sentence,
};

/// Width of the windows of [`BusTrack::load_windows`].
const LOAD_WINDOW: Micros = Micros::from_millis(100);
/// Limit of drawn samples: of a longer run only every n-th is drawn.
const DRAWN: usize = 4000;
/// Limit of listed events; the plots have them all.
const LISTED: usize = 60;

/// The HTML report: verdict, events, plots and tables, the same bytes for the same recording. Plots
/// leave out values that are not finite, and merge samples in runs of more than 40 s, keeping
/// lowest and highest values.
pub fn report(recording: &Recording, figures: &Figures) -> String {
    page(recording, figures, "", None)
}

/// The report, with links to the pages in the folder `docs` if that is known, beside an earlier run if there is one.
fn page(
    recording: &Recording,
    figures: &Figures,
    docs: &str,
    against: Option<&Comparison>,
) -> String {
    let before = against.map(|it| &it.before);
    let (motion, signals) = (motion_charts(recording, before), signal_charts(recording, before));
    let (currents, loads) = (current_charts(recording, before), load_charts(recording));
    let all = || motion.iter().chain(&signals).chain(&currents).chain(&loads);
    let charts_of: Vec<&Chart> = all().collect();
    let bad = culprits(figures);
    let mut charts = all().enumerate();
    let mut next = |count: usize| -> String {
        let places = charts.by_ref().take(count);
        let place = |(at, chart): (usize, &Chart)| {
            let axes = format!("{}, over time", chart.kind);
            figure(&at, &chart.title, chart.note, &axes)
        };
        places.map(place).collect()
    };
    let main = motion.len().min(1);
    let table = |it: &Table| table(it, &bad);
    let optional = |it: &Option<Table>| it.as_ref().map_or_else(String::new, table);
    let (seed, is_capture) = (recording.seed, recording.source == Source::Capture);
    let is_real = !recording.source.is_simulated();
    format!(
        include_str!("report.html"),
        style = concat!(include_str!("colours.css"), include_str!("report.css")),
        script = lang::script()
            + concat!(include_str!("plot.js"), include_str!("field.js"), include_str!("report.js")),
        seed = if is_real { String::new() } else { format!("seed <b>{seed}</b> · ") },
        seed_in_title = if is_real { String::new() } else { format!(", seed {seed}") },
        virtual_time = if is_real { "" } else { " of virtual time" },
        length = seconds(recording.length),
        motors = recording.motors.len(),
        buses = recording.buses.len(),
        lines = match recording.lines.len() {
            0 => String::new(),
            1 => " and <b>1</b> RS-485 line".to_owned(),
            lines => format!(" and <b>{lines}</b> RS-485 lines"),
        },
        about = match &recording.about {
            [name, note] if name.is_empty() && note.is_empty() => String::new(),
            [name, note] => format!("<p><b>{}</b> {}</p>\n", escape(name), escape(note)),
        },
        origin = origin(recording),
        verdict = verdict(recording, figures, &charts_of, docs),
        against = against.map_or_else(String::new, |it| {
            let table = it.table().map_or_else(String::new, |it| table(&it));
            let sentence = format!("<p>{}</p>\n", escape(&it.sentence()));
            section("Against the earlier run", &(sentence + &table))
        }),
        standing = standing(figures, docs),
        ran = match recording.source {
            Source::Simulation => "simulated run",
            Source::Emulation => "run on an emulated chip",
            Source::Capture => "capture of its buses",
            Source::Robot => "run",
        },
        tiles = tiles(recording, figures),
        losses = losses(recording),
        events = events(recording),
        stopped = match recording.base {
            // The targets of the motors are not known.
            _ if is_capture => "",
            Some(_) => " · shaded: disarmed or stopped, the wheels do not follow their targets",
            None => " · shaded: disarmed or stopped, no motor follows its target",
        },
        main_motion = next(main),
        path = recording.base.as_ref().map_or_else(String::new, |_| {
            let note = "seen from above, an arrow each 0.5 s";
            figure(&"path", "Path of the base", note, ", in the plane, in metres")
        }),
        mechanisms = match recording.turned.is_empty() {
            true => String::new(),
            false => figure(&"mechanisms", "Mechanisms", "", ", by the angles of their motors"),
        },
        motion = next(motion.len() - main),
        signals = figures.tables.signals.as_ref().map_or_else(String::new, |own| {
            let (plots, table) = (next(signals.len()), table(own));
            section("Signals", &format!("<div class=\"grid\">\n{plots}</div>\n{table}"))
        }),
        currents = next(currents.len()),
        loads = next(loads.len()),
        motor_table = table(&figures.tables.motors),
        bus_table = table(&figures.tables.buses),
        line_table = optional(&figures.tables.lines),
        remote = section("Remote", &remote(recording)),
        parts = section("Parts on UARTs", &optional(&figures.tables.parts)),
        data = data(recording, all(), &bad, before),
    )
}

// ---- what the run was like ---------------------------------------------------------------------

/// Robot, program and command line of the recording, and what was injected.
fn origin(recording: &Recording) -> String {
    let Origin { robot, command, date, revision } = &recording.origin;
    let facts = [("robot", robot), ("", date), ("revision", revision)].into_iter();
    let facts = facts.filter(|(_, text)| !text.is_empty());
    let facts: Vec<_> =
        facts.map(|(name, text)| format!("{name} <b>{}</b>", escape(text))).collect();
    let mut html = String::new();
    if !facts.is_empty() {
        let _ = writeln!(html, "<p class=\"facts\">{}</p>", facts.join(" · "));
    }
    if !command.is_empty() {
        let _ = writeln!(html, "<p class=\"facts\"><code>{}</code></p>", escape(command));
    }
    let faults = recording.faults.iter().map(|Fault { kind, from, until }| {
        let second = |at: Micros| format!("{}s", seconds(at));
        let until = until.map_or_else(String::new, |it| format!("..{}", second(it.micros())));
        format!("fault {kind}@{}{until}", second(from.micros()))
    });
    let mistakes = recording.mistakes.iter().map(|it| format!("mistake {it}"));
    let injected: Vec<_> = faults.chain(mistakes).map(|it| escape(&it)).collect();
    if !injected.is_empty() {
        let _ = writeln!(
            html,
            "<p class=\"facts injected\">Injected: <b>{}</b></p>",
            injected.join(", ")
        );
    }
    html
}

/// The labels of all culprits of problems: of motors and parts, or "bus 1".
fn culprits(figures: &Figures) -> BTreeSet<String> {
    let all = figures.found(Severity::Problem);
    let of = |it: &Problem| match it.culprits.as_slice() {
        [] => vec![it.about.to_string()],
        labels => labels.iter().map(ToString::to_string).collect(),
    };
    all.flat_map(of).collect()
}

/// A text with links to the docs that it names.
fn linked(text: &str, docs: &str) -> String {
    const PAGE: &str = "docs/bring-up.md";
    let link = format!("<a href=\"{}bring-up.md\">{PAGE}</a>", escape(docs));
    let text = escape(text);
    if docs.is_empty() { text } else { text.replace(PAGE, &link) }
}

/// One finding: its headline, with all else folded under it, and links to its time and its plot.
fn finding(problem: &Problem, charts: &[&Chart], docs: &str) -> String {
    let about = problem.about.to_string();
    let is_its = |chart: &&Chart| {
        let is_culprit = |label: &String| problem.culprits.contains(&label.as_str());
        chart.labels.iter().any(|label| *label == about || is_culprit(label))
    };
    let place = match (charts.iter().position(is_its), problem.kind) {
        (Some(at), _) => at.to_string(),
        (None, "base") => "path".to_owned(),
        (None, _) => "timeline".to_owned(),
    };
    let time = problem.span.map_or_else(String::new, |(from, to)| {
        let (from, to) = (seconds(from), seconds(to));
        format!("<a href=\"#plot-{place}\" data-zoom=\"{from} {to}\">{from:.2} s</a> ")
    });
    let (headline, text) = (escape(&problem.headline()), linked(&problem.to_string(), docs));
    let is_to_mend = problem.severity == Severity::Problem;
    let [check, mend] =
        if is_to_mend { problem.remedy().1.map(escape) } else { Default::default() };
    let remedy = match check.as_str() {
        "" => String::new(),
        _ => {
            format!(
                "<div><b>check</b> <span>{check}</span></div><div><b>do</b> <span>{mend}</span></div>"
            )
        }
    };
    let more = if headline == text { remedy } else { text + &remedy };
    let folded = match more.as_str() {
        "" => format!("<p>{headline}</p>"),
        more => format!("<details><summary>{headline}</summary>{more}</details>"),
    };
    format!("<li><span class=\"go\">{time}<a href=\"#plot-{place}\">plot</a></span>{folded}</li>")
}

fn verdict(recording: &Recording, figures: &Figures, charts: &[&Chart], docs: &str) -> String {
    let list = |severity| {
        let told = figures.found(severity).filter(|problem| !problem.is_standing());
        let items: String = told.map(|problem| finding(problem, charts, docs)).collect();
        if items.is_empty() { items } else { format!("<ul>{items}</ul>") }
    };
    let class = if figures.any_problems() { "bad" } else { "good" };
    let (headline, problems) = (headline(recording, figures), list(Severity::Problem));
    let mut html = format!("<div class=\"verdict {class}\">{headline}{problems}</div>");
    let information = list(Severity::Information);
    if !information.is_empty() {
        let _ = write!(html, "<div class=\"verdict information\">Good to know{information}</div>");
    }
    html
}

/// What no run of this robot can show, folded: it is the same after every run.
fn standing(figures: &Figures, docs: &str) -> String {
    let told = figures.problems.iter().filter(|problem| problem.is_standing());
    let items: String =
        told.map(|it| format!("<li>{}</li>", linked(&it.to_string(), docs))).collect();
    if items.is_empty() {
        return items;
    }
    format!(
        "<details class=\"standing\"><summary>What no sensor of this robot checks</summary><ul>{items}</ul></details>\n"
    )
}

fn tiles(recording: &Recording, figures: &Figures) -> String {
    let online = recording.motors.iter().filter(|track| track.last.link == Link::Online).count();
    let frames: u64 = recording.buses.iter().map(|track| track.frames).sum();
    let busiest = recording.buses.iter().map(|track| track.load).reduce(f64::max);
    let longest = recording.buses.iter().filter_map(|track| track.last.period.max()).max();
    let current = recording.motors.iter().map(|track| track.peak_current).reduce(f64::max);
    let mut tiles = vec![
        (format!("{online} / {}", recording.motors.len()), "motors online at the end"),
        (grouped(frames), "frames on the wires"),
        (optional(busiest, 1, " %"), "load of the busiest bus"),
        (optional(current, 1, " A"), "largest current"),
    ];
    if recording.source == Source::Robot {
        // The robot does not count what others say on its wires.
        tiles.drain(1..3);
    }
    if let Some(longest) = longest.filter(|_| recording.source == Source::Simulation) {
        let period = optional(Some(longest.into()), 0, " µs");
        tiles.push((period, "longest tick period, 1000 µs planned"));
    }
    if let Some(base) = &recording.base {
        let (path, by) = match recording.source {
            Source::Robot => (&base.by_wheels(), "driven by the base, as its wheels say"),
            _ => (&base.path, "driven by the base"),
        };
        tiles.push((optional(Some(driven(path)), 1, " m"), by));
    }
    if let Some(PathFigures { is_true, furthest, end, estimate }) = figures.path {
        let metres = |apart: Apart| optional(Some(apart.metres), 3, " m");
        let [furthest_is, end_is] = if is_true {
            ["furthest from its reference path", "from its reference at the end"]
        } else {
            ["furthest from its reference path, by its estimate", "at the end, by its estimate"]
        };
        tiles.extend(furthest.map(|apart| (metres(apart), furthest_is)));
        tiles.extend(end.map(|apart| (metres(apart), end_is)));
        tiles.extend(estimate.map(|apart| (metres(apart), "its odometry is off at the end")));
    }
    tiles
        .iter()
        .map(|(value, name)| {
            format!("<div class=\"tile\"><b>{value}</b><span>{name}</span></div>\n")
        })
        .collect()
}

/// Each loss of the remote, in words.
fn losses(recording: &Recording) -> String {
    let losses = recording.remote.iter().flat_map(|track| &track.losses);
    losses.map(|loss| format!("<p class=\"loss\">{}</p>\n", escape(&sentence(loss)))).collect()
}

/// The length of a path in metres.
fn driven(path: &[PathPoint]) -> f64 {
    let steps = path.windows(2);
    let steps = steps.map(|step| (step[1].x - step[0].x).hypot(step[1].y - step[0].y));
    steps.filter(|metres| metres.is_finite()).sum()
}

/// The driver's events, or those of a real robot, and what was injected; events at the same time are merged.
fn merged_events(recording: &Recording) -> Vec<(Micros, String, bool)> {
    let events = match recording.source {
        Source::Robot => happened(recording),
        _ => recording.events.iter().map(|event| (event.at, event.label.to_owned())).collect(),
    };
    let merged = |events: &[(Micros, String)]| {
        let labels: Vec<_> = events.iter().map(|(_, label)| label.as_str()).collect();
        (events[0].0, labels.join(" + "), false)
    };
    let mut all: Vec<_> = events.chunk_by(|(at, _), (next, _)| at == next).map(merged).collect();
    all.extend(recording.mistakes.iter().map(|it| (Micros::ZERO, format!("mistake {it}"), true)));
    for Fault { kind, from, until } in &recording.faults {
        let begins = if until.is_some() { " begins" } else { "" };
        all.push((from.micros(), format!("fault {kind}{begins}"), true));
        let ended = until.map(|until| until.micros()).filter(|until| *until <= recording.length);
        all.extend(ended.map(|until| (until, format!("fault {kind} ends"), true)));
    }
    all.sort_by_key(|(at, ..)| *at);
    all
}

/// The list of events; many are grouped by what happened.
fn events(recording: &Recording) -> String {
    let mut list = String::new();
    let events = merged_events(recording);
    let mut groups: Vec<(&str, Vec<f64>, usize)> = Vec::new();
    for (number, (at, label, _)) in (1..).zip(&events) {
        let known = groups.iter_mut().find(|(known, ..)| known == label && events.len() > LISTED);
        match known {
            Some((_, times, _)) => times.push(seconds(*at)),
            None => groups.push((label, vec![seconds(*at)], number)),
        }
    }
    for (label, times, number) in groups.iter().take(LISTED) {
        let label = escape(label);
        let _ = match times.as_slice() {
            [first, .., last] => {
                let count = times.len();
                writeln!(
                    list,
                    "<li>{label} <b>× {count}</b> <time>{first:.2} s to {last:.2} s</time></li>"
                )
            }
            [at, ..] => writeln!(list, "<li><b>{number}</b> {label} <time>{at:.2} s</time></li>"),
            [] => Ok(()),
        };
    }
    if let more @ 1.. = groups.len().saturating_sub(LISTED) {
        let _ = writeln!(list, "<li>… and {more} more</li>");
    }
    list
}

// ---- tables ------------------------------------------------------------------------------------

/// A section with a title; empty without content.
fn section(title: &str, content: &str) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<section>\n<h2>{title}</h2>\n{content}</section>\n")
}

/// The frames and losses of a remote; empty without a remote.
fn remote(recording: &Recording) -> String {
    let Some(track) = &recording.remote else { return String::new() };
    let RemoteTrack { receiver, sent, heard, losses, .. } = track;
    let [sent, live] = [sent.frames, sent.live].map(grouped);
    let mut html =
        format!("<p class=\"heard\">{receiver}: {sent} frames sent, {live} of them live");
    if let Some(heard) = heard {
        let counts = [heard.frames, heard.damaged, heard.port_errors];
        let [frames, damaged, errors] = counts.map(|count| grouped(count.into()));
        let _ = write!(html, "; {frames} heard, {damaged} damaged, {errors} port errors");
    }
    html.push_str("</p>\n");
    if !losses.is_empty() {
        let at = |time: Option<Micros>| number(time.map(seconds), 4, " s");
        let row = |loss: &Loss| {
            vec![
                at(Some(loss.lost.from)),
                at(loss.lost.until),
                at(loss.last_frame),
                at(loss.coasting),
                number(loss.reaction().map(|time| seconds(time) * 1e3), 1, " ms"),
                at(loss.disarmed),
                at(loss.back),
                at(loss.resumed),
            ]
        };
        let head = "lost at | until | last good frame | all coast | after that frame | disarmed | \
                    good frames again | resumed";
        let (head, rows) = (head.split(" | ").collect(), losses.iter().map(row).collect());
        html.push_str(&table(&Table { head, words: 1, rows }, &BTreeSet::new()));
    }
    html
}

/// A table; a row whose first entry is one of `bad` is marked.
fn table(table: &Table, bad: &BTreeSet<String>) -> String {
    let mut html = "<div class=\"table\" tabindex=\"0\" role=\"region\" aria-label=\"Table\"><table>\n<thead><tr>".to_owned();
    for (column, title) in table.head.iter().enumerate() {
        let class = if column < table.words { " class=\"words\"" } else { "" };
        let _ = write!(html, "<th scope=\"col\"{class}>{title}</th>");
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        let is_bad = row.first().is_some_and(|entry| bad.contains(&entry.text));
        html.push_str(if is_bad { "<tr class=\"bad\">" } else { "<tr>" });
        for (column, entry) in row.iter().enumerate() {
            let class = match (column < table.words, entry.bad, entry.good) {
                (true, true, _) => " class=\"words bad\"",
                (true, _, true) => " class=\"words good\"",
                (true, false, false) => " class=\"words\"",
                (false, true, _) => " class=\"bad\"",
                (false, ..) => "",
            };
            let _ = write!(html, "<td{class}>{}</td>", escape(&entry.text));
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody>\n</table></div>\n");
    html
}

// ---- numbers -----------------------------------------------------------------------------------

/// The kind of a motor's first target that is an angle or a speed; the speed without one.
fn plotted(track: &MotorTrack) -> TargetKind {
    let followed = track.samples.iter().find(|sample| sample.target.is_some());
    match followed.map_or(TargetKind::Speed, |sample| sample.kind) {
        kind if is_angle(kind) || kind == TargetKind::SpeedMotion => kind,
        _ => TargetKind::Speed,
    }
}

/// The measurements since the last sample; empty during targets of another kind than this angle.
fn measured(kind: TargetKind, sample: &MotorSample) -> Cell {
    match kind {
        kind if kind == sample.kind => sample.measured_cell,
        TargetKind::Speed | TargetKind::SpeedMotion => sample.rpm_cell,
        _ => Cell::of(f64::NAN),
    }
}

/// The length of so many samples, s.
fn periods(count: usize) -> f64 {
    rounded(count as f64 * seconds(SAMPLE_PERIOD), 2)
}

/// The path of the base; empty without one.
fn path(recording: &Recording) -> &[PathPoint] {
    recording.base.as_ref().map_or(&[], |base| &base.path)
}

/// The number of samples per drawn sample.
fn stride(recording: &Recording) -> usize {
    let samples = recording.motors.iter().map(|track| track.samples.len());
    samples.max().unwrap_or(0).max(path(recording).len()).div_ceil(DRAWN).max(1)
}

/// A curve of a motor's samples: `stride` of them are one point.
fn cells(
    name: &str,
    samples: &[MotorSample],
    stride: usize,
    of: impl Fn(&MotorSample) -> Cell,
) -> Value {
    let merged = samples.chunks(stride).map(|chunk| {
        let cells = chunk.iter().map(&of);
        let (newest, whole) = (cells.clone().last().unwrap_or_default(), joined(cells));
        // An angle that went round has no range: the newest is taken.
        let is_angle = chunk.iter().all(|sample| sample.kind == TargetKind::Angle);
        if is_angle && whole.max - whole.min > 180.0 { newest } else { whole }
    });
    curve(name, &merged.collect::<Vec<_>>())
}

/// A curve: means, and the distances of lowest and highest values from them, in hundredths.
fn curve(name: &str, merged: &[Cell]) -> Value {
    let hundredths = |span: f32| {
        let span = (span * 100.0).round();
        // Whole numbers are short.
        if span.is_finite() { span as u32 } else { 0 }
    };
    let mut curve = json!({ "measured": null, "below": null, "above": null, "name": name });
    curve["measured"] = numbers(merged.iter().map(|cell| cell.mean.into()), 2);
    curve["below"] = merged.iter().map(|cell| hundredths(cell.mean - cell.min)).collect();
    curve["above"] = merged.iter().map(|cell| hundredths(cell.max - cell.mean)).collect();
    curve
}

/// Several cells as one; NaN without any.
fn joined(cells: impl Iterator<Item = Cell> + Clone) -> Cell {
    let count = cells.clone().count() as f32;
    Cell {
        min: cells.clone().map(|cell| cell.min).fold(f32::NAN, f32::min),
        max: cells.clone().map(|cell| cell.max).fold(f32::NAN, f32::max),
        mean: cells.map(|cell| cell.mean).sum::<f32>() / count,
    }
}

/// Numbers of few digits; null for those that are not finite.
fn numbers(values: impl Iterator<Item = f64>, digits: i32) -> Value {
    values.map(|value| rounded(value, digits)).collect()
}

/// Text that can stand anywhere in HTML.
fn escape(text: &str) -> String {
    // The first is in all the others.
    let signs = [('&', "&amp;"), ('<', "&lt;"), ('>', "&gt;"), ('"', "&quot;"), ('\'', "&#39;")];
    signs.into_iter().fold(text.to_owned(), |text, (sign, name)| text.replace(sign, name))
}

// ---- plots -------------------------------------------------------------------------------------

struct Chart {
    title: String,
    /// Its values in words, and what they are of: labels of motors and signals, or a bus.
    kind: &'static str,
    labels: Vec<String>,
    note: &'static str,
    body: Value,
}

/// The place of a plot; `axes` is what its title is shown over.
fn figure(plot: &dyn Display, title: &str, note: &str, axes: &str) -> String {
    let title = escape(title);
    format!(
        "<figure id=\"plot-{plot}\">\n<figcaption><h3>{title} <small>{note}</small></h3></figcaption>\n\
         <div class=\"legend\"></div>\n<div class=\"plot\"><canvas data-plot=\"{plot}\" \
         role=\"img\" aria-label=\"{title}{axes}\"></canvas></div>\n</figure>\n"
    )
}

/// Plots of measurements and targets: one for all motors with the same first word and kind of
/// target.
fn motion_charts(recording: &Recording, before: Option<&Recording>) -> Vec<Chart> {
    let plot = |track: &MotorTrack| (split(track.motor.label).0, plotted(track));
    let stride = stride(recording);
    let chart = |((word, kind), tracks): ((&str, TargetKind), Vec<&MotorTrack>)| {
        let target = |sample: &MotorSample| sample.target.filter(|_| kind == sample.kind);
        let series = tracks.iter().map(|track| {
            let targets = track.samples.iter().step_by(stride).map(target);
            let name = split(track.motor.label).1;
            let mut curve = cells(name, &track.samples, stride, |sample| measured(kind, sample));
            if recording.source.is_told() {
                curve["target"] = numbers(targets.map(|it| it.unwrap_or(f64::NAN)), 2);
            }
            beside(&mut curve, same(before, track), |other| {
                cells("", &other.samples, stride, |sample| measured(kind, sample))
            });
            curve
        });
        let (noun, unit) = if is_angle(kind) { ("angle", "°") } else { ("speed", "rpm") };
        let mut body = curves(stride, unit, 1, 2.0, series.collect());
        // 360 degrees are 0.
        body["wraps"] = (kind == TargetKind::Angle).into();
        let labels = tracks.iter().map(|track| track.motor.label.to_owned()).collect();
        Chart { title: format!("{} {noun}", capital(word)), kind: "", labels, note: "", body }
    };
    by_plot(&recording.motors, plot).into_iter().map(chart).collect()
}

/// The track of the same motor in an earlier run, if that was heard there.
fn same<'r>(before: Option<&'r Recording>, track: &MotorTrack) -> Option<&'r MotorTrack> {
    let mut tracks = before?.motors.iter().filter(|it| it.last.counters.received > 0);
    tracks.find(|it| it.motor.label == track.motor.label)
}

/// Lays the curve of an earlier run beside one.
fn beside<T>(curve: &mut Value, earlier: Option<T>, of: impl Fn(T) -> Value) {
    if let Some(earlier) = earlier {
        curve["before"] = of(earlier)["measured"].take();
    }
}

/// Groups of tracks with the same key, in order of appearance.
fn by_plot<T, K: PartialEq>(tracks: &[T], key: impl Fn(&T) -> K) -> Vec<(K, Vec<&T>)> {
    let mut groups: Vec<(K, Vec<&T>)> = Vec::new();
    for track in tracks {
        let key = key(track);
        match groups.iter_mut().find(|group| group.0 == key) {
            Some((_, tracks)) => tracks.push(track),
            None => groups.push((key, vec![track])),
        }
    }
    groups
}

/// A plot of samples: `places` decimals, and an axis that spans at least `least`.
fn curves(stride: usize, unit: &str, places: u8, least: f64, series: Value) -> Value {
    let mut curves = json!({
        "unit": unit,
        "from": periods(1),
        "step": periods(stride),
        "places": places,
        "least": least,
        "series": null,
    });
    curves["series"] = series;
    curves
}

/// Plots of own signals: one for all with the same unit and first word.
fn signal_charts(recording: &Recording, before: Option<&Recording>) -> Vec<Chart> {
    let plot = |track: &SignalTrack| (split(track.label).0, track.unit);
    let stride = stride(recording);
    let chart = |((word, unit), tracks): ((&str, &str), Vec<&SignalTrack>)| {
        let series = tracks.iter().map(|track| {
            let of = |track: &SignalTrack| {
                let chunks = track.samples.chunks(stride);
                let merged = chunks.map(|chunk| joined(chunk.iter().copied().flatten()));
                curve(split(track.label).1, &merged.collect::<Vec<_>>())
            };
            let mut others = before.iter().flat_map(|before| &before.signals);
            let mut curve = of(track);
            beside(&mut curve, others.find(|it| it.label == track.label), of);
            curve
        });
        let title = if let [track] = tracks.as_slice() { track.label } else { word };
        let body = curves(stride, unit, 2, 0.1, series.collect());
        let labels = tracks.iter().map(|track| track.label.to_owned()).collect();
        Chart { title: capital(title), kind: "", labels, note: "", body }
    };
    by_plot(&recording.signals, plot).into_iter().map(chart).collect()
}

fn current_charts(recording: &Recording, before: Option<&Recording>) -> Vec<Chart> {
    let stride = stride(recording);
    let chart = |bus: &BusTrack| {
        let is_on = |track: &&MotorTrack| track.motor.on == Place::Bus(bus.number);
        let series = recording.motors.iter().filter(is_on).map(|track| {
            let of = |track: &MotorTrack| {
                cells(track.motor.label, &track.samples, stride, |sample| sample.current_cell)
            };
            let mut curve = of(track);
            beside(&mut curve, same(before, track), of);
            curve
        });
        let body = curves(stride, "A", 2, 0.2, series.collect());
        let note = match recording.source {
            Source::Capture | Source::Robot => "current by feedback, where it is told",
            _ => "current in the windings",
        };
        Chart {
            title: format!("Bus {}", bus.number),
            kind: " currents",
            labels: vec![],
            note,
            body,
        }
    };
    recording.buses.iter().map(chart).collect()
}

fn load_charts(recording: &Recording) -> Vec<Chart> {
    let chart = |bus: &BusTrack| {
        let plan = bus.last.load;
        let plan = [plan.least, plan.typical, plan.worst];
        let body = json!({
            "unit": "%",
            "from": 0,
            "step": seconds(LOAD_WINDOW),
            "places": 1,
            "least": 1,
            "stairs": true,
            "plan": numbers(plan.into_iter().map(f64::from), 1),
            "series": [{
                "name": "measured in each 100 ms",
                "measured": numbers(bus.load_windows.iter().copied(), 1),
            }],
        });
        let note = "dashed: planned, typically · band: planned, least to worst";
        let labels = vec![format!("bus {}", bus.number)];
        Chart { title: format!("Bus {}", bus.number), kind: " load", labels, note, body }
    };
    recording.buses.iter().map(chart).collect()
}

/// A label as its first word and the rest; a label of one word is both.
fn split(label: &str) -> (&str, &str) {
    label.split_once(' ').unwrap_or((label, label))
}

fn capital(word: &str) -> String {
    let mut rest = word.chars();
    rest.next().map_or_else(String::new, |first| first.to_uppercase().chain(rest).collect())
}

/// The data of the plots, as JSON that can stand in a script element.
fn data<'c>(
    recording: &Recording,
    charts: impl Iterator<Item = &'c Chart>,
    bad: &BTreeSet<String>,
    before: Option<&Recording>,
) -> String {
    let events = merged_events(recording);
    let stride = stride(recording);
    let path =
        |of: fn(&PathPoint) -> f64| numbers(path(recording).iter().step_by(stride).map(of), 3);
    let motor_lanes = recording.motors.iter().map(|track| motor_lane(track, recording.source));
    let event = |(at, label, is_injected): &(Micros, String, bool)| match is_injected {
        false => json!([seconds(*at), label]),
        true => json!([seconds(*at), label, true]),
    };
    let lanes = remote_lanes(recording).into_iter().chain(motor_lanes).map(|mut lane| {
        if lane["name"].as_str().is_some_and(|name| bad.contains(name)) {
            lane["bad"] = true.into();
        }
        lane
    });
    let bases = recording.base.iter().filter(|base| !base.steering.is_empty());
    let steered = bases.flat_map(|base| &base.heard).step_by(stride);
    let steered = steered.map(|it| numbers(it.wheels.iter().map(|wheel| wheel.steered), 1));
    let turned = recording.turned.iter().filter_map(|(line, angles)| {
        let angles = numbers(angles.iter().step_by(stride).copied(), 1);
        Some((recording.motors.get(*line)?.motor.label.to_owned(), angles))
    });
    let mut data = json!({
        "length": seconds(recording.length),
        "period": periods(1),
        "events": events.iter().map(event).collect::<Value>(),
        "states": STATES.split(' ').collect::<Vec<_>>(),
        "lanes": lanes.collect::<Value>(),
        "stops": stops(recording),
        "charts": null,
        "path": {
            "from": periods(1),
            "step": periods(stride),
            "x": path(|at| at.x),
            "y": path(|at| at.y),
            "yaw": path(|at| at.yaw),
            "steered": steered.collect::<Value>(),
            "lines": path_lines(recording, before, stride),
        },
        "drawn": recording.drawn,
        "turned": turned.collect::<Map<_, _>>(),
    });
    // Behind the macro, which would write and read each number.
    data["charts"] = charts.map(|chart| chart.body.clone()).collect();
    // Only strings have this sign in JSON.
    data.to_string().replace('<', "\\u003c")
}

/// The other lines of the path plot: by the wheels, the estimate and the reference; `report.css`
/// has the colours.
fn path_lines(recording: &Recording, before: Option<&Recording>, stride: usize) -> Vec<Value> {
    let Some(base) = &recording.base else { return Vec::new() };
    let Paths { estimate, reference } = Paths::of(base);
    let line = |(name, paint, points): (&str, &str, Vec<PathPoint>)| {
        let numbers = |of: fn(&PathPoint) -> f64| numbers(points.iter().step_by(stride).map(of), 3);
        (!points.is_empty()).then(|| {
            json!({ "name": name, "paint": paint, "x": numbers(|at| at.x), "y": numbers(|at| at.y), "yaw": numbers(|at| at.yaw) })
        })
    };
    [
        ("by its wheels", "muted", base.by_wheels()),
        ("by its own estimate", "line-4", estimate),
        ("its reference", "line-2", reference),
        ("the base before", "line-5", before.map_or_else(Vec::new, |it| path(it).to_vec())),
    ]
    .into_iter()
    .filter_map(line)
    .collect()
}

/// States of a motor, a robot, and a remote; `colours.css` has a colour for each.
const STATES: &str = "run hold brake coast off lost unheard armed suspended stopped disarmed heard \
                      driven";

const fn state(sample: &MotorSample) -> &'static str {
    match sample.link {
        Link::NeverSeen => "unheard",
        Link::Lost => "lost",
        Link::Online => drive_name(sample.drive),
    }
}

/// A line of states over time.
fn lane(name: &str, states: impl Iterator<Item = &'static str>) -> Value {
    let index = |state| STATES.split(' ').position(|known| known == state);
    json!({ "name": name, "runs": runs(states.map(index)) })
}

fn motor_lane(track: &MotorTrack, source: Source) -> Value {
    // An emulated chip shows whether a motor is driven, not why; a capture whether it is heard.
    let seen = |sample: &MotorSample| match (state(sample), source) {
        ("run", Source::Emulation) => "driven",
        (state @ ("unheard" | "lost"), _) => state,
        (_, Source::Capture) => "heard",
        (state, _) => state,
    };
    lane(track.motor.label, track.samples.iter().map(seen))
}

/// Whether the remote was heard, and whether the robot was armed.
fn remote_lanes(recording: &Recording) -> Vec<Value> {
    let Some(track) = &recording.remote else { return Vec::new() };
    let heard = track.samples.iter().map(|sample| if sample.is_live { "heard" } else { "lost" });
    let arm = |sample: &RemoteSample| {
        Some(match sample.arm? {
            ArmState::Armed => "armed",
            ArmState::Suspended => "suspended",
            ArmState::EStopped => "stopped",
            ArmState::Disarmed => "disarmed",
        })
    };
    let arms = track.samples.iter().map(arm).collect::<Option<Vec<_>>>();
    let robot = arms.map(|arms| lane("robot", arms.into_iter()));
    [lane("remote", heard)].into_iter().chain(robot).collect()
}

/// The times in which no wheel (without a base: no motor) follows its target, in a stop for
/// example.
fn stops(recording: &Recording) -> Value {
    if recording.source == Source::Capture {
        return json!([]);
    }
    let wheel =
        |place: usize| recording.base.as_ref().is_none_or(|base| base.wheels.contains(&place));
    let wheels = recording.motors.iter().enumerate().filter(|(place, _)| wheel(*place));
    let wheels: Vec<_> = wheels.map(|(_, track)| track.samples.as_slice()).collect();
    let samples = wheels.iter().map(|samples| samples.len()).min().unwrap_or(0);
    let state = |index: usize| {
        let all = |test: fn(DriveMode) -> bool| wheels.iter().all(|wheel| test(wheel[index].drive));
        if all(|drive| drive == DriveMode::Off) {
            "disarmed"
        } else if all(|drive| drive != DriveMode::Run) {
            "stopped"
        } else {
            ""
        }
    };
    let stopped = |run: &Value| run[2] != "";
    runs((0..samples).map(state)).into_iter().filter(stopped).collect()
}

/// `[from, to, value]` in seconds, for each stretch of equal values.
fn runs<T: Copy + PartialEq + Into<Value>>(values: impl Iterator<Item = T>) -> Vec<Value> {
    let (values, mut end) = (values.collect::<Vec<_>>(), 0);
    let json = |stretch: &[T]| {
        end += stretch.len();
        json!([periods(end - stretch.len()), periods(end), stretch[0].into()])
    };
    values.chunk_by(T::eq).map(json).collect()
}

/// The folder of the docs, as seen from another folder; empty if it is not here.
fn docs_from(folder: &Path) -> String {
    if !Path::new("docs/bring-up.md").is_file() {
        return String::new();
    }
    let is_below = folder.components().all(|it| matches!(it, Component::Normal(_)));
    match std::env::current_dir() {
        _ if is_below => "../".repeat(folder.components().count()) + "docs/",
        Ok(here) => format!("file://{}/docs/", here.display()),
        Err(_) => String::new(),
    }
}

/// Writes the report and the bus logs of a run into an existing folder, beside an earlier run if there is one; fails if
/// it cannot.
pub fn write_files(
    recording: &Recording,
    figures: &Figures,
    folder: &Path,
    against: Option<&Comparison>,
) -> Result<()> {
    let page = page(recording, figures, &docs_from(folder), against);
    write_file(folder, "report.html", page.as_bytes())?;
    for bus in &recording.buses {
        let name = format!("bus{}.log", bus.number);
        if recording.no_logs {
            // The file of an earlier run would be taken for this one's.
            let _ = fs::remove_file(folder.join(name));
        } else {
            write_file(folder, &name, bus.log.as_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rc10_module::Counters;
    use rc10_motor::embassy::BusStatus;
    use rc10_motor::{BusLoad, MotorCounters, MotorStatus};

    use rc10_sim::remote::Sent;

    use super::*;
    use crate::recording::{BaseTrack, PartTrack, Tracking};
    use crate::robot::remote::{Lost, Receiver};
    use crate::robot::script::Event;
    use crate::tests;

    /// All motors follow a target exactly; nothing is wrong.
    fn recording(length: Micros) -> Recording {
        let samples = usize::try_from(length.get() / SAMPLE_PERIOD.get()).unwrap();
        let motors = tests::description().motors.into_iter().map(|motor| {
            let kind = match motor.label.split_once(' ') {
                Some(("gimbal", _)) => TargetKind::Angle,
                Some(("lift", _)) => TargetKind::TotalAngle,
                _ => TargetKind::Speed,
            };
            let sample = |index: usize| {
                let wave = 123.4 * (index as f64 / 40.0 + f64::from(motor.name().id)).sin();
                MotorSample {
                    target: Some(wave),
                    measured: wave,
                    measured_cell: Cell::of(wave),
                    kind,
                    current: wave / 10.0,
                    current_cell: Cell::of(wave / 10.0),
                    rpm: wave,
                    rpm_cell: Cell::of(wave),
                    link: Link::Online,
                    drive: DriveMode::Run,
                    counters: MotorCounters::default(),
                    overwritten: 0,
                    temperature: f32::NAN,
                    supply: f32::NAN,
                }
            };
            let mut last = MotorStatus::NEW;
            (last.link, last.drive) = (Link::Online, DriveMode::Run);
            let tracking =
                vec![Tracking { kind, looks: samples as u64 * 10, squares: 0.0, peak: 0.0 }];
            let samples = (0..samples).map(sample).collect();
            MotorTrack {
                motor,
                samples,
                last,
                overwritten: 0,
                tracking,
                peak_current: 12.34,
                effort: None,
            }
        });
        let mut status = BusStatus::default();
        status.load = BusLoad { frames_per_second: 5000, least: 55.5, typical: 59.0, worst: 67.5 };
        let bus = |number| BusTrack {
            number,
            load: 57.25,
            load_windows: vec![57.25; samples / 10],
            last: status,
            samples: Vec::new(),
            frames: 50_123,
            log: Default::default(),
            log_hash: Default::default(),
        };
        let path = |index: usize| PathPoint { x: index as f64 / 100.0, y: 0.5, yaw: -0.0 };
        let event = |millis, label| Event { at: Micros::from_millis(millis), label };
        Recording {
            seed: 42,
            length,
            motors: motors.collect(),
            buses: (1..=3).map(bus).collect(),
            lines: Vec::new(),
            base: Some(BaseTrack {
                wheels: vec![0, 1, 2, 3],
                steering: Vec::new(),
                path: (0..samples).map(path).collect(),
                estimate: Vec::new(),
                reference: Vec::new(),
                chassis: rc10_sim::Chassis::default(),
                heard: Vec::new(),
            }),
            events: vec![
                event(100, "arm"),
                event(900, "square: forward"),
                event(900, "feeder on"),
                event(1500, "stand <still> & \"wait\""),
            ],
            ..Recording::default()
        }
    }

    /// The page without its script, which has the table of all texts.
    fn page_of(recording: &Recording) -> String {
        let page = report(recording, &Figures::of(recording));
        page.split("<script>").next().unwrap().to_owned()
    }

    fn two_seconds() -> Recording {
        recording(Micros::from_millis(2000))
    }

    /// The data the plots are drawn from, as a browser would read it.
    fn embedded(page: &str) -> Value {
        let (_, rest) = page.split_once("type=\"application/json\">").unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    #[test]
    fn shows_every_motor_bus_and_event() {
        let page = page_of(&two_seconds());
        for motor in tests::description().motors {
            assert!(page.contains(&format!("<td class=\"words\">{}</td>", motor.label)));
        }
        for text in ["bus 1", "bus 3", "seed 42", "<b>2</b> s of", "arm <time>0.10 s", "59.0 %"] {
            assert!(page.contains(text), "{text}");
        }
        let data = embedded(&page);
        assert_eq!(data["events"][1], json!([0.9, "square: forward + feeder on"]));
        let drawn = data["charts"].as_array().unwrap().len();
        assert_eq!(drawn, 4 + 3 + 3);
        assert_eq!(page.matches("data-plot=").count(), drawn + 2);
    }

    #[test]
    fn loads_nothing() {
        let mut recording = two_seconds();
        recording.motors[4].last.link = Link::Lost;
        let page = page_of(&recording);
        assert!(page.contains("href=\"#plot-"));
        // Links to its own plots load nothing.
        let page = page.replace("href=\"#plot-", "");
        for reference in ["http", "src=", "href=", "url(", "@import", "fetch("] {
            assert!(!page.contains(reference), "{reference}");
        }
    }

    #[test]
    fn is_the_same_for_the_same_recording() {
        assert_eq!(page_of(&two_seconds()), page_of(&two_seconds()));
    }

    #[test]
    fn stays_small_however_long_the_run() {
        let ten_seconds = page_of(&recording(Micros::from_millis(10_000)));
        assert!(ten_seconds.len() < 500_000, "{} bytes", ten_seconds.len());
        let page = page_of(&recording(Micros::from_millis(100_000)));
        assert!(page.len() < 1_500_000, "{} bytes", page.len());
        let chart = &embedded(&page)["charts"][0];
        assert_eq!(chart["series"][0]["measured"].as_array().unwrap().len(), 3334);
        assert_eq!(chart["step"], 0.03);
    }

    #[test]
    fn text_is_escaped() {
        let page = page_of(&two_seconds());
        assert!(page.contains("stand &lt;still&gt; &amp; &quot;wait&quot;"));
        assert!(!page.contains("<still>"));
        assert_eq!(embedded(&page)["events"][2][1], "stand <still> & \"wait\"");
        assert_eq!(escape("it's"), "it&#39;s");
    }

    #[test]
    fn numbers_are_short_and_what_is_not_finite_is_null() {
        let values = [1.0 / 3.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.001, 2.0];
        assert_eq!(numbers(values.into_iter(), 2).to_string(), "[0.33,null,null,null,0.0,2.0]");
        let mut recording = two_seconds();
        recording.motors[0].samples[3].measured_cell = Cell::of(f64::NAN);
        recording.motors[0].samples[4].target = None;
        recording.motors[0].samples[5].current_cell = Cell::of(f64::INFINITY);
        recording.base.as_mut().unwrap().path[6].x = f64::NAN;
        recording.buses[0].load = f64::NAN;
        let data = embedded(&page_of(&recording));
        let wheel = &data["charts"][0]["series"][0];
        assert!(wheel["measured"][2].is_f64() && wheel["measured"][3].is_null());
        assert!(wheel["target"][3].is_f64() && wheel["target"][4].is_null());
        assert!(data["charts"][4]["series"][0]["measured"][5].is_null());
        assert!(data["path"]["x"][6].is_null());
    }

    #[test]
    fn the_verdict_names_what_is_wrong() {
        let mut recording = two_seconds();
        let good = "✓ All 11 motors online · no frame lost · no overruns";
        assert!(page_of(&recording).contains(good));
        recording.motors[4].last.link = Link::Lost;
        recording.motors[4].last.counters.lost = 2;
        recording.motors[5].overwritten = 7;
        recording.buses[2].last.overruns = 3;
        let page = page_of(&recording);
        assert!(!page.contains(good));
        for text in [
            "✗ 4 problems",
            "<summary>gimbal yaw: lost at the end</summary><div><b>check</b> <span>does its light still blink?</span></div>",
            "<summary>gimbal yaw: lost during the run</summary>gimbal yaw: 2 × lost during the run<",
            ">gimbal pitch: 7 feedback frames overwritten because the bus was busy<",
            ">bus 3: 3 ticks overrun<",
            "<b>10 / 11</b>",
            "<td class=\"bad\">7</td>",
        ] {
            assert!(page.contains(text), "{text}");
        }
    }

    #[test]
    fn a_stop_is_when_no_wheel_runs() {
        let mut recording = two_seconds();
        for motor in &mut recording.motors[..4] {
            motor.samples[..10].iter_mut().for_each(|sample| sample.drive = DriveMode::Off);
            motor.samples[50..100].iter_mut().for_each(|sample| sample.drive = DriveMode::Coast);
        }
        recording.motors[0].samples[150].drive = DriveMode::Coast;
        let stops = embedded(&page_of(&recording))["stops"].clone();
        assert_eq!(stops, json!([[0.0, 0.1, "disarmed"], [0.5, 1.0, "stopped"]]));
    }

    #[test]
    fn a_robot_without_a_base_has_no_path_and_stops_when_no_motor_runs() {
        let mut recording = two_seconds();
        let with = page_of(&recording);
        recording.base = None;
        for motor in &mut recording.motors[..4] {
            motor.samples[50..100].iter_mut().for_each(|sample| sample.drive = DriveMode::Coast);
        }
        assert_eq!(embedded(&page_of(&recording))["stops"], json!([]));
        for motor in &mut recording.motors[4..] {
            motor.samples[60..100].iter_mut().for_each(|sample| sample.drive = DriveMode::Hold);
        }
        let without = page_of(&recording);
        assert_eq!(embedded(&without)["stops"], json!([[0.6, 1.0, "stopped"]]));
        for text in ["data-plot=\"path\"", "driven by the base", "the wheels do not follow"] {
            assert!(with.contains(text) && !without.contains(text), "{text}");
        }
    }

    #[test]
    fn the_path_has_lines_for_what_its_robot_says() {
        let mut recording = two_seconds();
        assert_eq!(embedded(&page_of(&recording))["path"]["lines"], json!([]));
        let base = recording.base.as_mut().unwrap();
        let moved = |by: f64| base.path.iter().map(move |at| PathPoint { y: at.y + by, ..*at });
        // Where it begins its estimate is right.
        base.estimate = moved(0.0)
            .enumerate()
            .map(|(index, at)| PathPoint { y: at.y + if index > 100 { 0.02 } else { 0.0 }, ..at })
            .collect();
        base.reference = moved(0.25).collect();
        let page = page_of(&recording);
        for text in [
            "<b>0.250 m</b><span>furthest from its reference path",
            "<b>0.250 m</b><span>from its reference at the end",
            "<b>0.020 m</b><span>its odometry is off at the end",
        ] {
            assert!(page.contains(text), "{text}");
        }
        let lines = &embedded(&page)["path"]["lines"];
        let names: Vec<_> = (0..2).map(|index| &lines[index]["name"]).collect();
        assert_eq!(names, ["by its own estimate", "its reference"]);
        assert_eq!((&lines[0]["y"][150], &lines[1]["y"][150]), (&json!(0.52), &json!(0.75)));
        assert_eq!(lines[1]["x"].as_array().unwrap().len(), 200);
    }

    #[test]
    fn a_remote_has_its_lanes_and_a_line_for_each_time_that_it_was_lost() {
        let mut recording = two_seconds();
        assert!(!page_of(&recording).contains("<h2>Remote</h2>"));
        let at = |millis| Some(Micros::from_millis(millis));
        let loss = Loss {
            lost: Lost { from: Micros::from_millis(500), until: at(1500) },
            last_frame: at(497),
            coasting: at(600),
            back: None,
            resumed: None,
            disarmed: at(1497),
        };
        let sample = |index: usize| RemoteSample {
            is_live: index < 50,
            arm: Some(match index {
                ..60 => ArmState::Armed,
                60..150 => ArmState::Suspended,
                _ => ArmState::Disarmed,
            }),
        };
        let mut track = RemoteTrack {
            receiver: Receiver::Sbus,
            sent: Sent::default(),
            heard: None,
            losses: vec![loss],
            samples: (0..200).map(sample).collect(),
        };
        recording.remote = Some(track.clone());
        let page = page_of(&recording);
        for text in [
            "<p class=\"loss\">remote lost from 0.500 s to 1.500 s: last good frame 0.4970 s; ",
            "sbus: 0 frames",
            "<td>0.4970 s</td>",
            "<td>103.0 ms</td>",
            "<td>1.4970 s</td>",
        ] {
            assert!(page.contains(text), "{text}");
        }
        assert!(page.contains("no frame lost"), "let go in time");
        let data = embedded(&page);
        let name = |state: &Value| data["states"][state.as_u64().unwrap() as usize].clone();
        let lane = |index: usize| -> Vec<Value> {
            data["lanes"][index]["runs"]
                .as_array()
                .unwrap()
                .iter()
                .map(|run| name(&run[2]))
                .collect()
        };
        assert_eq!(lane(0), ["heard", "lost"]);
        assert_eq!(lane(1), ["armed", "suspended", "disarmed"]);
        assert_eq!(data["lanes"].as_array().unwrap().len(), 13);
        // A train of pulses that was cut off by it, and another one.
        track.receiver = Receiver::Ppm;
        let mut heard = Counters::default();
        heard.damaged = 1;
        track.heard = Some(heard);
        recording.remote = Some(track.clone());
        assert!(page_of(&recording).contains("no frame lost"));
        heard.damaged = 31;
        track.heard = Some(heard);
        recording.remote = Some(track.clone());
        assert!(page_of(&recording).contains(">remote: 30 damaged frames<"));
        track.heard = None;
        track.losses[0].coasting = at(618);
        track.samples[0].arm = None;
        recording.remote = Some(track);
        let page = page_of(&recording);
        assert!(page.contains(">remote: lost: the motors coasted after 121.0 ms only<"));
        assert_eq!(embedded(&page)["lanes"].as_array().unwrap().len(), 12);
    }

    #[test]
    fn signals_of_its_own_have_plots_and_a_table() {
        let mut recording = two_seconds();
        assert!(!page_of(&recording).contains("<h2>Signals</h2>"));
        let track = |label, unit| SignalTrack {
            states: "",
            label,
            unit,
            samples: (0..200).map(|at: u8| (at >= 50).then(|| Cell::of(at.into()))).collect(),
            last: Some(199.0),
            range: Some([50.0, 124.5, 199.0]),
            absent: Micros::from_millis(500),
        };
        recording.signals =
            vec![track("wall left", "mm"), track("wall right", "mm"), track("heading <x>", "deg")];
        let page = page_of(&recording);
        for text in
            ["<h2>Signals</h2>", "<h3>Wall <small>", "<h3>Heading &lt;x&gt; <small>", "199.00 mm"]
        {
            assert!(page.contains(text), "{text}");
        }
        let data = embedded(&page);
        let charts = data["charts"].as_array().unwrap();
        assert_eq!(charts.len(), 4 + 2 + 3 + 3);
        assert_eq!(page.matches("data-plot=").count(), charts.len() + 2);
        let wall = &charts[4];
        assert_eq!((&wall["unit"], &wall["series"][1]["name"]), (&json!("mm"), &json!("right")));
        let measured = &wall["series"][0]["measured"];
        assert!(measured[49].is_null() && measured[50] == 50.0 && measured[199] == 199.0);
        assert_eq!(charts[5]["series"].as_array().unwrap().len(), 1);
    }

    #[test]
    fn parts_on_uarts_have_a_table() {
        let mut recording = two_seconds();
        assert!(!page_of(&recording).contains("Parts on UARTs"));
        let mut heard = Counters::default();
        (heard.frames, heard.damaged) = (1234, 5);
        recording.parts = vec![PartTrack { label: "IMU", uart: 7, heard }];
        let page = page_of(&recording);
        for text in ["Parts on UARTs", "<td class=\"words\">UART 7</td>", ">IMU: 5 damaged frames"]
        {
            assert!(page.contains(text), "{text}");
        }
        recording.parts[0].heard = Counters::default();
        assert!(page_of(&recording).contains(">IMU: never heard at UART 7<"));
    }

    #[test]
    fn an_empty_recording_is_a_page_too() {
        assert_eq!(embedded(&page_of(&Recording::default()))["charts"], json!([]));
    }
}
