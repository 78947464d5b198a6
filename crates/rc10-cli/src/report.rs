//! One run as a page to look at: a self-contained HTML file that loads nothing from anywhere.
//!
//! The tables are HTML; the plots are drawn in the browser by `report.js` from the samples, which
//! the page carries as JSON.

use std::fmt::Write as _;

use rc10_can::Micros;
use rc10_motor::{ArmState, Drive, Link, TargetKind, Verdict};
use serde_json::{Value, json};

use crate::figures::sentence;
use crate::recording::{BusTrack, MotorSample, MotorTrack, PathPoint, Recording, SAMPLE_PERIOD};
use crate::remote::{Loss, Receiver, RemoteSample, RemoteTrack};
use crate::robot::Place;

/// Width of the windows of [`BusTrack::load_windows`].
const LOAD_WINDOW: Micros = Micros::from_millis(100);
/// More samples than this would not fit on a screen: of a longer run every so many-th is drawn.
const DRAWN: usize = 4000;
/// A robot that lost its remote lets go within this time from the last good frame on.
const REACTION: Micros = Micros::from_millis(120);
/// More events than this are not listed; the plots have them all.
const LISTED: usize = 60;

/// The run as one HTML page: verdict, events, plots and tables. The same recording gives the same
/// bytes. Values that are not finite are left out of the plots. Of a run of more than 40 s every
/// second (third, ...) sample is drawn; the tables are made from all.
#[must_use]
pub fn report(recording: &Recording) -> String {
    let (motion, currents, loads) =
        (motion_charts(recording), current_charts(recording), load_charts(recording));
    let mut figures = motion.iter().chain(&currents).chain(&loads).enumerate();
    let mut next = |count: usize| -> String {
        figures.by_ref().take(count).map(|(number, chart)| figure(number, chart)).collect()
    };
    let main = motion.len().min(1);
    format!(
        include_str!("report.html"),
        style = include_str!("report.css"),
        script = include_str!("report.js"),
        seed = recording.seed,
        length = seconds(recording.length),
        motors = recording.motors.len(),
        buses = recording.buses.len(),
        lines = match recording.lines.len() {
            0 => String::new(),
            1 => " and <b>1</b> RS-485 line".to_owned(),
            lines => format!(" and <b>{lines}</b> RS-485 lines"),
        },
        verdict = verdict(recording),
        tiles = tiles(recording),
        losses = losses(recording),
        events = events(recording),
        stopped = match recording.base {
            Some(_) => "the wheels do not follow their targets",
            None => "no motor follows its target",
        },
        main_motion = next(main),
        path = if recording.base.is_some() { PATH } else { "" },
        motion = next(motion.len() - main),
        currents = next(currents.len()),
        loads = next(loads.len()),
        motor_table = motor_table(recording),
        bus_table = bus_table(recording),
        line_table = line_table(recording),
        remote = remote_section(recording),
        data = data(recording, motion.iter().chain(&currents).chain(&loads)),
    )
}

// ---- what the run was like ---------------------------------------------------------------------

/// Everything that was not as it should be, in words.
fn problems(recording: &Recording) -> Vec<String> {
    let mut problems = Vec::new();
    for track in &recording.motors {
        let (label, last) = (track.motor.label, &track.last);
        let counters = [
            (u64::from(last.counters.lost), "× lost during the run"),
            (u64::from(last.counters.malformed), "malformed frames"),
            (track.overwritten, "feedback frames overwritten because the bus was busy"),
        ];
        if last.link != Link::Online {
            problems.push(format!("{label}: {} at the end", link_name(last.link)));
        }
        if let Some(fault) = last.fault {
            problems.push(format!("{label}: {} (code {})", fault.text, fault.code));
        }
        let happened = counters.iter().filter(|(count, _)| *count > 0);
        problems.extend(happened.map(|(count, what)| format!("{label}: {count} {what}")));
    }
    for track in &recording.buses {
        let (bus, last) = (track.number, &track.last);
        let counters = [
            (last.overruns, "ticks overrun"),
            (last.health.receive_lost, "received frames lost"),
            (last.replaced, "commands replaced before they left"),
            (last.refused, "frames refused"),
            (last.health.bus_offs, "× bus-off"),
        ];
        let happened = counters.iter().filter(|(count, _)| *count > 0);
        problems.extend(happened.map(|(count, what)| format!("bus {bus}: {count} {what}")));
    }
    if let Some(track) = &recording.remote {
        let heard = track.heard.unwrap_or_default();
        // A train of pulses that a loss has cut off is no problem of its own.
        let cut_off = match track.receiver {
            Receiver::Ppm => u32::try_from(track.losses.len()).unwrap_or(u32::MAX),
            Receiver::Dr16 | Receiver::Sbus | Receiver::Crsf | Receiver::Vt03 => 0,
        };
        let damaged = heard.damaged.saturating_sub(cut_off);
        let counters = [(damaged, "damaged frames"), (heard.port_errors, "port errors")];
        let happened = counters.iter().filter(|(count, _)| *count > 0);
        problems.extend(happened.map(|(count, what)| format!("remote: {count} {what}")));
        let late = track.losses.iter().filter_map(Loss::reaction).filter(|time| *time > REACTION);
        problems.extend(late.map(|time| {
            format!("remote lost: the motors coasted after {:.1} ms only", seconds(time) * 1e3)
        }));
    }
    problems
}

fn verdict(recording: &Recording) -> String {
    let problems = problems(recording);
    if problems.is_empty() {
        let count = recording.motors.len();
        return format!(
            "<div class=\"verdict good\">\
             ✓ All {count} motors online · no frame lost · no overruns</div>"
        );
    }
    let items: String =
        problems.iter().map(|problem| format!("<li>{}</li>", escape(problem))).collect();
    let noun = if problems.len() == 1 { "problem" } else { "problems" };
    format!("<div class=\"verdict bad\">✗ {} {noun}<ul>{items}</ul></div>", problems.len())
}

fn tiles(recording: &Recording) -> String {
    let online = recording.motors.iter().filter(|track| track.last.link == Link::Online).count();
    let frames: u64 = recording.buses.iter().map(|track| track.frames).sum();
    let busiest = recording.buses.iter().map(|track| track.load).reduce(f64::max);
    let longest = recording.buses.iter().filter_map(|track| track.last.period.max()).max();
    let current = recording.motors.iter().filter_map(peak_current).reduce(f64::max);
    let mut tiles = vec![
        (format!("{online} of {}", recording.motors.len()), "motors online at the end"),
        (grouped(frames), "frames on the wires"),
        (optional(busiest, 1, " %"), "load of the busiest bus"),
        (optional(longest.map(f64::from), 0, " µs"), "longest tick period, 1000 µs planned"),
        (optional(current, 1, " A"), "largest current"),
    ];
    if let Some(base) = &recording.base {
        tiles.push((optional(Some(driven(&base.path)), 1, " m"), "driven by the base"));
    }
    tiles
        .iter()
        .map(|(value, name)| {
            format!("<div class=\"tile\"><b>{value}</b><span>{name}</span></div>\n")
        })
        .collect()
}

/// Each time that the remote was lost, in words.
fn losses(recording: &Recording) -> String {
    let losses = recording.remote.iter().flat_map(|track| &track.losses);
    losses.map(|loss| format!("<p class=\"loss\">{}</p>\n", escape(&sentence(loss)))).collect()
}

/// Metres.
fn driven(path: &[PathPoint]) -> f64 {
    let steps = path.windows(2);
    let steps = steps.map(|step| (step[1].x - step[0].x).hypot(step[1].y - step[0].y));
    steps.filter(|metres| metres.is_finite()).sum()
}

/// The driver's events; what happened at the same time is one.
fn merged_events(recording: &Recording) -> Vec<(Micros, String)> {
    let mut merged: Vec<(Micros, String)> = Vec::new();
    for event in &recording.events {
        match merged.last_mut() {
            Some((at, label)) if *at == event.at => {
                label.push_str(" + ");
                label.push_str(event.label);
            }
            _ => merged.push((event.at, event.label.to_owned())),
        }
    }
    merged
}

fn events(recording: &Recording) -> String {
    let mut list = String::new();
    let events = merged_events(recording);
    for (number, (at, label)) in (1..).zip(events.iter().take(LISTED)) {
        let (at, label) = (seconds(*at), escape(label));
        let _ = writeln!(list, "<li><b>{number}</b> {label} <time>{at:.2} s</time></li>");
    }
    if let more @ 1.. = events.len().saturating_sub(LISTED) {
        let _ = writeln!(list, "<li>… and {more} more</li>");
    }
    list
}

// ---- tables ------------------------------------------------------------------------------------

fn motor_table(recording: &Recording) -> String {
    let rows = recording.motors.iter().map(|track| {
        let (motor, last) = (track.motor, &track.last);
        vec![
            words(motor.label),
            words(&motor.name().to_string()),
            words(&motor.on.short()),
            word(link_name(last.link), last.link != Link::Online),
            words(drive_name(last.drive)),
            cell(&optional(tracking_error(track), 2, &format!(" {}", Scale::of(track).unit))),
            cell(&optional(peak_current(track), 2, " A")),
            cell(&grouped(last.counters.received.into())),
            loss(last.counters.malformed.into()),
            loss(last.counters.lost.into()),
            loss(track.overwritten),
        ]
    });
    let head = "motor | model | bus | link | drive | RMS tracking error | peak current | \
                received | malformed | lost (times) | overwritten";
    table(head, 5, rows)
}

fn bus_table(recording: &Recording) -> String {
    let rows = recording.buses.iter().map(|track| {
        let (plan, last) = (&track.last.load, &track.last);
        let percent = |value: f64| optional(Some(value), 1, " %");
        let micros = |value: Option<f64>, digits| cell(&optional(value, digits, " µs"));
        vec![
            words(&format!("bus {}", track.number)),
            word(verdict_name(plan.verdict()), plan.verdict() == Verdict::DoesNotFit),
            cell(&percent(plan.least.into())),
            cell(&percent(plan.typical.into())),
            cell(&percent(plan.worst.into())),
            cell(&percent(track.load)),
            cell(&grouped(track.frames)),
            loss(last.health.receive_lost.into()),
            loss(last.replaced.into()),
            loss(last.refused.into()),
            loss(last.overruns.into()),
            micros(last.period.min().map(f64::from), 0),
            micros(last.period.mean().map(f64::from), 1),
            micros(last.period.max().map(f64::from), 0),
        ]
    });
    let head = "bus | plan | planned: least | typical | worst | measured | frames | \
                lost | replaced | refused | overruns | tick period: min | mean | max";
    table(head, 2, rows)
}

/// Nothing for a robot without RS-485 lines.
fn line_table(recording: &Recording) -> String {
    if recording.lines.is_empty() {
        return String::new();
    }
    let rows = (1..).zip(&recording.lines).map(|(number, line): (u8, _)| {
        let traffic = &line.traffic;
        let micros = |value: Option<f64>, digits| cell(&optional(value, digits, " µs"));
        vec![
            words(&format!("line {number}")),
            cell(&grouped(traffic.exchanges.into())),
            loss(traffic.timeouts.into()),
            loss(traffic.crc_errors.into()),
            loss(traffic.garbage.into()),
            loss(traffic.unexpected.into()),
            loss(line.port_errors.into()),
            loss(line.overruns.into()),
            micros(traffic.exchange.min().map(f64::from), 0),
            micros(traffic.exchange.mean().map(f64::from), 1),
            micros(traffic.exchange.max().map(f64::from), 0),
        ]
    });
    let head = "line | exchanges | timeouts | CRC errors | garbage bytes | unexpected | \
                port errors | overruns | exchange: min | mean | max";
    table(head, 1, rows)
}

/// What became of a lost remote; nothing for a robot without one.
fn remote_section(recording: &Recording) -> String {
    let Some(track) = &recording.remote else { return String::new() };
    let RemoteTrack { receiver, sent, heard, losses, .. } = track;
    let frames = |count: u64| grouped(count);
    let mut html = format!(
        "<section>\n<h2>Remote</h2>\n<p class=\"hint\">{receiver}: {} frames sent, {} of them live",
        frames(sent.frames),
        frames(sent.live),
    );
    if let Some(heard) = heard {
        let (frames, damaged) = (grouped(heard.frames.into()), grouped(heard.damaged.into()));
        let errors = grouped(heard.port_errors.into());
        let _ = write!(html, "; {frames} heard, {damaged} damaged, {errors} port errors");
    }
    html.push_str("</p>\n");
    if !losses.is_empty() {
        let at = |time: Option<Micros>| cell(&optional(time.map(seconds), 4, " s"));
        let rows = losses.iter().map(|loss| {
            let millis = loss.reaction().map(|time| seconds(time) * 1e3);
            vec![
                words(&optional(Some(seconds(loss.lost.from)), 4, " s")),
                at(loss.lost.until),
                at(loss.last_frame),
                at(loss.coasting),
                cell(&optional(millis, 1, " ms")),
                at(loss.disarmed),
                at(loss.back),
                at(loss.resumed),
            ]
        });
        let head = "lost at | until | last good frame | all coast | after that frame | disarmed | \
                    good frames again | resumed";
        html.push_str(&table(head, 1, rows));
    }
    html.push_str("</section>\n");
    html
}

/// A table whose first `left` columns are words; `|` parts the titles of its columns.
fn table(head: &str, left: usize, rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut html = "<div class=\"table\"><table>\n<thead><tr>".to_owned();
    for (column, title) in head.split(" | ").enumerate() {
        let class = if column < left { " class=\"words\"" } else { "" };
        let _ = write!(html, "<th scope=\"col\"{class}>{title}</th>");
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for row in rows {
        html.push_str("<tr>");
        html.extend(row);
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody>\n</table></div>\n");
    html
}

fn cell(text: &str) -> String {
    format!("<td>{}</td>", escape(text))
}

fn words(text: &str) -> String {
    word(text, false)
}

fn word(text: &str, bad: bool) -> String {
    format!("<td class=\"words{}\">{}</td>", if bad { " bad" } else { "" }, escape(text))
}

/// A count that should be zero.
fn loss(count: u64) -> String {
    if count == 0 { cell("0") } else { format!("<td class=\"bad\">{}</td>", grouped(count)) }
}

const fn link_name(link: Link) -> &'static str {
    match link {
        Link::NeverSeen => "never heard",
        Link::Online => "online",
        Link::Lost => "lost",
    }
}

const fn drive_name(drive: Drive) -> &'static str {
    match drive {
        Drive::Off => "off",
        Drive::Coast => "coast",
        Drive::Brake => "brake",
        Drive::Hold => "hold",
        Drive::Run => "run",
    }
}

const fn verdict_name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Fits => "fits",
        Verdict::Tight => "tight",
        Verdict::DoesNotFit => "does not fit",
    }
}

// ---- numbers -----------------------------------------------------------------------------------

/// What the target and the measured value of a motor are.
#[derive(Clone, Copy, PartialEq)]
struct Scale {
    kind: TargetKind,
    noun: &'static str,
    unit: &'static str,
    /// 360 is 0.
    wraps: bool,
}

impl Scale {
    /// Of the first target the motor had; a motor that never had one shows its speed.
    fn of(track: &MotorTrack) -> Self {
        let kind = track.samples.iter().find(|sample| sample.target.is_some());
        match kind.map_or(TargetKind::Speed, |sample| sample.kind) {
            kind @ TargetKind::Angle => Self { kind, noun: "angle", unit: "°", wraps: true },
            kind @ (TargetKind::TotalAngle | TargetKind::Impedance) => {
                Self { kind, noun: "angle", unit: "°", wraps: false }
            }
            kind @ TargetKind::Current => Self { kind, noun: "current", unit: "A", wraps: false },
            _ => Self { kind: TargetKind::Speed, noun: "speed", unit: "rpm", wraps: false },
        }
    }

    /// The measured value; none while the motor followed targets of another kind.
    fn measured(self, sample: &MotorSample) -> f64 {
        match self.kind {
            kind if kind == sample.kind => sample.measured,
            TargetKind::Speed => sample.rpm,
            _ => f64::NAN,
        }
    }

    fn target(self, sample: &MotorSample) -> f64 {
        sample.target.filter(|_| self.kind == sample.kind).unwrap_or(f64::NAN)
    }
}

/// Root mean square of measured minus target, over the samples in which the motor followed one.
fn tracking_error(track: &MotorTrack) -> Option<f64> {
    let scale = Scale::of(track);
    let (mut sum, mut count) = (0.0, 0_u32);
    for sample in track.samples.iter().filter(|sample| sample.drive == Drive::Run) {
        let error = scale.measured(sample) - scale.target(sample);
        let error = if scale.wraps { (error + 180.0).rem_euclid(360.0) - 180.0 } else { error };
        if error.is_finite() {
            sum += error * error;
            count += 1;
        }
    }
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

fn peak_current(track: &MotorTrack) -> Option<f64> {
    let currents = track.samples.iter().map(|sample| sample.current.abs());
    currents.filter(|current| current.is_finite()).reduce(f64::max)
}

fn seconds(time: Micros) -> f64 {
    time.get() as f64 / 1e6
}

/// So many sample periods, in seconds.
fn periods(count: usize) -> Value {
    let count = u64::try_from(count).unwrap_or(u64::MAX);
    number(seconds(Micros::new(count.saturating_mul(SAMPLE_PERIOD.get()))), 2)
}

/// Where the base was; nowhere, if there is none.
fn path(recording: &Recording) -> &[PathPoint] {
    recording.base.as_ref().map_or(&[], |base| &base.path)
}

/// Every so many-th sample is drawn.
fn stride(recording: &Recording) -> usize {
    let samples = recording.motors.iter().map(|track| track.samples.len());
    samples.max().unwrap_or(0).max(path(recording).len()).div_ceil(DRAWN).max(1)
}

/// A JSON number of few digits; null if it is not finite.
fn number(value: f64, digits: i32) -> Value {
    let power = 10_f64.powi(digits);
    // Adding zero turns -0 into 0.
    json!((value * power).round() / power + 0.0)
}

fn numbers(values: impl Iterator<Item = f64>, digits: i32) -> Value {
    values.map(|value| number(value, digits)).collect()
}

fn optional(value: Option<f64>, digits: usize, unit: &str) -> String {
    match value.filter(|value| value.is_finite()) {
        Some(value) => format!("{value:.digits$}{unit}"),
        None => "–".to_owned(),
    }
}

/// 1234567 as "1 234 567", with spaces that do not break.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (index, digit) in digits.char_indices() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// Text that can stand anywhere in HTML.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            other => escaped.push(other),
        }
    }
    escaped
}

// ---- plots -------------------------------------------------------------------------------------

/// One plot over time.
struct Chart {
    title: String,
    note: &'static str,
    /// What `report.js` draws.
    body: Value,
}

fn figure(number: usize, chart: &Chart) -> String {
    let (title, note) = (escape(&chart.title), chart.note);
    format!(
        "<figure>\n<figcaption><h3>{title} <small>{note}</small></h3></figcaption>\n\
         <div class=\"legend\"></div>\n<div class=\"plot\"><canvas data-plot=\"{number}\" \
         role=\"img\" aria-label=\"{title} over time\"></canvas></div>\n</figure>\n"
    )
}

/// The plot of the path, which has no time axis.
const PATH: &str = "<figure>
<figcaption><h3>Path of the base <small>seen from above, an arrow each 0.5 s</small></h3></figcaption>
<div class=\"legend\"></div>
<div class=\"plot\"><canvas data-plot=\"path\" role=\"img\" aria-label=\"Path of the base in the plane, in metres\"></canvas></div>
</figure>
";

/// Measured values and targets. Motors whose labels start with the same word share a plot, if
/// they have targets of the same kind: a new motor finds its place by itself.
fn motion_charts(recording: &Recording) -> Vec<Chart> {
    let mut groups: Vec<(&str, Scale, Vec<&MotorTrack>)> = Vec::new();
    for track in &recording.motors {
        let (word, scale) = (split(track.motor.label).0, Scale::of(track));
        match groups.iter_mut().find(|group| (group.0, group.1) == (word, scale)) {
            Some((_, _, tracks)) => tracks.push(track),
            None => groups.push((word, scale, vec![track])),
        }
    }
    let stride = stride(recording);
    let chart = |(word, scale, tracks): (&str, Scale, Vec<&MotorTrack>)| {
        let series = tracks.iter().map(|track| {
            let samples = || track.samples.iter().step_by(stride);
            json!({
                "name": split(track.motor.label).1,
                "measured": numbers(samples().map(|sample| scale.measured(sample)), 2),
                "target": numbers(samples().map(|sample| scale.target(sample)), 2),
            })
        });
        let body = json!({
            "unit": scale.unit,
            "from": periods(1),
            "step": periods(stride),
            "places": 1,
            "least": 2,
            "wraps": scale.wraps,
            "series": series.collect::<Value>(),
        });
        Chart { title: format!("{} {}", capital(word), scale.noun), note: "", body }
    };
    groups.into_iter().map(chart).collect()
}

fn current_charts(recording: &Recording) -> Vec<Chart> {
    let stride = stride(recording);
    let chart = |bus: &BusTrack| {
        let tracks =
            recording.motors.iter().filter(|track| track.motor.on == Place::Bus(bus.number));
        let series = tracks.map(|track| {
            let samples = track.samples.iter().step_by(stride);
            json!({
                "name": track.motor.label,
                "measured": numbers(samples.map(|sample| sample.current), 2),
            })
        });
        let body = json!({
            "unit": "A",
            "from": periods(1),
            "step": periods(stride),
            "places": 2,
            "least": 0.2,
            "series": series.collect::<Value>(),
        });
        Chart { title: format!("Bus {}", bus.number), note: "current in the windings", body }
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
        Chart { title: format!("Bus {}", bus.number), note, body }
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

/// What the plots are drawn from, as JSON that can stand in a script element.
fn data<'c>(recording: &Recording, charts: impl Iterator<Item = &'c Chart>) -> String {
    let events = merged_events(recording);
    let stride = stride(recording);
    let path =
        |of: fn(&PathPoint) -> f64| numbers(path(recording).iter().step_by(stride).map(of), 3);
    let data = json!({
        "length": seconds(recording.length),
        "period": periods(1),
        "events": events.iter().map(|(at, label)| json!([seconds(*at), label])).collect::<Value>(),
        "states": STATES,
        "lanes": remote_lanes(recording).into_iter().chain(recording.motors.iter().map(lane))
            .collect::<Value>(),
        "stops": stops(recording),
        "charts": charts.map(|chart| &chart.body).collect::<Vec<_>>(),
        "path": {
            "from": periods(1),
            "step": periods(stride),
            "x": path(|at| at.x),
            "y": path(|at| at.y),
            "yaw": path(|at| at.yaw),
        },
    });
    // Inside strings only, because JSON has no such sign elsewhere.
    data.to_string().replace('<', "\\u003c")
}

/// What a motor can be seen to do, and a robot, and a remote; `report.css` has a colour for each.
const STATES: [&str; 12] = [
    "run",
    "hold",
    "brake",
    "coast",
    "off",
    "lost",
    "unheard",
    "armed",
    "suspended",
    "stopped",
    "disarmed",
    "heard",
];

const fn state(sample: &MotorSample) -> u8 {
    match (sample.link, sample.drive) {
        (Link::NeverSeen, _) => 6,
        (Link::Lost, _) => 5,
        (Link::Online, Drive::Off) => 4,
        (Link::Online, Drive::Coast) => 3,
        (Link::Online, Drive::Brake) => 2,
        (Link::Online, Drive::Hold) => 1,
        (Link::Online, Drive::Run) => 0,
    }
}

fn lane(track: &MotorTrack) -> Value {
    json!({ "name": track.motor.label, "runs": runs(track.samples.iter().map(state)) })
}

/// Whether the remote was heard, and whether the robot was armed.
fn remote_lanes(recording: &Recording) -> Vec<Value> {
    let Some(track) = &recording.remote else { return Vec::new() };
    let heard = track.samples.iter().map(|sample| if sample.is_live { 11 } else { 5_u8 });
    let mut lanes = vec![json!({ "name": "remote", "runs": runs(heard) })];
    let arm = |sample: &RemoteSample| {
        Some(match sample.arm? {
            ArmState::Armed => 7_u8,
            ArmState::Suspended => 8,
            ArmState::EStopped => 9,
            ArmState::Disarmed => 10,
        })
    };
    if let Some(arms) = track.samples.iter().map(arm).collect::<Option<Vec<u8>>>() {
        lanes.push(json!({ "name": "robot", "runs": runs(arms.into_iter()) }));
    }
    lanes
}

/// When no wheel of the base, or without one no motor, follows its target: the robot is disarmed,
/// or something stopped it.
fn stops(recording: &Recording) -> Value {
    let wheel = |place: usize| match &recording.base {
        Some(base) => base.wheels.contains(&place),
        None => true,
    };
    let wheels = recording.motors.iter().enumerate().filter(|(place, _)| wheel(*place));
    let wheels: Vec<_> = wheels.map(|(_, track)| track.samples.as_slice()).collect();
    let samples = wheels.iter().map(|samples| samples.len()).min().unwrap_or(0);
    let state = |index: usize| {
        let all = |test: fn(Drive) -> bool| wheels.iter().all(|wheel| test(wheel[index].drive));
        if all(|drive| drive == Drive::Off) {
            "disarmed"
        } else if all(|drive| drive != Drive::Run) {
            "stopped"
        } else {
            ""
        }
    };
    let stopped = |run: &Value| run[2] != "";
    runs((0..samples).map(state)).into_iter().filter(stopped).collect()
}

/// `[from, to, value]` in seconds, for each stretch of equal values.
fn runs<T: PartialEq + Into<Value>>(values: impl Iterator<Item = T>) -> Vec<Value> {
    let mut stretches: Vec<(usize, usize, T)> = Vec::new();
    for (index, value) in values.enumerate() {
        match stretches.last_mut() {
            Some((_, end, same)) if *same == value => *end = index + 1,
            _ => stretches.push((index, index + 1, value)),
        }
    }
    let json =
        |(from, to, value): (usize, usize, T)| json!([periods(from), periods(to), value.into()]);
    stretches.into_iter().map(json).collect()
}

#[cfg(test)]
mod tests {
    use rc10_module::Counters;
    use rc10_motor::embassy::BusStatus;
    use rc10_motor::{BusLoad, MotorStatus};

    use rc10_sim::remote::Sent;

    use super::*;
    use crate::recording::{BaseTrack, Event};
    use crate::remote::Lost;
    use crate::team;

    /// All motors follow a target exactly; nothing is wrong.
    fn recording(length: Micros) -> Recording {
        let samples = usize::try_from(length.get() / SAMPLE_PERIOD.get()).unwrap();
        let motors = team::description().motors.into_iter().map(|motor| {
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
                    kind,
                    current: wave / 10.0,
                    rpm: wave,
                    link: Link::Online,
                    drive: Drive::Run,
                }
            };
            let mut last = MotorStatus::NEW;
            (last.link, last.drive) = (Link::Online, Drive::Run);
            MotorTrack { motor, samples: (0..samples).map(sample).collect(), last, overwritten: 0 }
        });
        let mut status = BusStatus::default();
        status.load = BusLoad { frames_per_second: 5000, least: 55.5, typical: 59.0, worst: 67.5 };
        let bus = |number| BusTrack {
            number,
            load: 57.25,
            load_windows: vec![57.25; samples / 10],
            last: status,
            frames: 50_123,
            log: Default::default(),
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
                wheels: [0, 1, 2, 3],
                path: (0..samples).map(path).collect(),
                chassis: rc10_sim::Chassis::default(),
                heard: Vec::new(),
            }),
            events: vec![
                event(100, "arm"),
                event(900, "square: forward"),
                event(900, "feeder on"),
                event(1500, "stand <still> & \"wait\""),
            ],
            remote: None,
        }
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
        let page = report(&two_seconds());
        for motor in team::description().motors {
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
        let page = report(&two_seconds());
        for reference in ["http", "src=", "href=", "url(", "@import", "fetch("] {
            assert!(!page.contains(reference), "{reference}");
        }
    }

    #[test]
    fn is_the_same_for_the_same_recording() {
        assert_eq!(report(&two_seconds()), report(&two_seconds()));
    }

    #[test]
    fn stays_small_however_long_the_run() {
        let ten_seconds = report(&recording(Micros::from_millis(10_000)));
        assert!(ten_seconds.len() < 500_000, "{} bytes", ten_seconds.len());
        let page = report(&recording(Micros::from_millis(100_000)));
        assert!(page.len() < 1_500_000, "{} bytes", page.len());
        let chart = &embedded(&page)["charts"][0];
        assert_eq!(chart["series"][0]["measured"].as_array().unwrap().len(), 3334);
        assert_eq!(chart["step"], 0.03);
    }

    #[test]
    fn text_is_escaped() {
        let page = report(&two_seconds());
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
        recording.motors[0].samples[3].measured = f64::NAN;
        recording.motors[0].samples[4].target = None;
        recording.motors[0].samples[5].current = f64::INFINITY;
        recording.base.as_mut().unwrap().path[6].x = f64::NAN;
        recording.buses[0].load = f64::NAN;
        let data = embedded(&report(&recording));
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
        assert!(report(&recording).contains(good));
        recording.motors[4].last.link = Link::Lost;
        recording.motors[4].last.counters.lost = 2;
        recording.motors[5].overwritten = 7;
        recording.buses[2].last.overruns = 3;
        let page = report(&recording);
        assert!(!page.contains(good));
        for text in [
            "✗ 4 problems",
            "<li>gimbal yaw: lost at the end</li>",
            "<li>gimbal yaw: 2 × lost during the run</li>",
            "<li>gimbal pitch: 7 feedback frames overwritten because the bus was busy</li>",
            "<li>bus 3: 3 ticks overrun</li>",
            "<b>10 of 11</b>",
            "<td class=\"bad\">7</td>",
        ] {
            assert!(page.contains(text), "{text}");
        }
    }

    #[test]
    fn an_angle_is_off_by_the_shorter_way() {
        let mut recording = two_seconds();
        for sample in &mut recording.motors[4].samples {
            (sample.target, sample.measured) = (Some(359.0), 2.0);
        }
        // Not following a target is no error.
        recording.motors[4].samples[0].drive = Drive::Off;
        recording.motors[4].samples[0].measured = 180.0;
        let error = tracking_error(&recording.motors[4]);
        assert!(error.is_some_and(|error| (error - 3.0).abs() < 1e-9), "{error:?}");
        recording.motors[4].samples.clear();
        assert_eq!(tracking_error(&recording.motors[4]), None);
    }

    #[test]
    fn a_stop_is_when_no_wheel_runs() {
        let mut recording = two_seconds();
        for motor in &mut recording.motors[..4] {
            motor.samples[..10].iter_mut().for_each(|sample| sample.drive = Drive::Off);
            motor.samples[50..100].iter_mut().for_each(|sample| sample.drive = Drive::Coast);
        }
        recording.motors[0].samples[150].drive = Drive::Coast;
        let stops = embedded(&report(&recording))["stops"].clone();
        assert_eq!(stops, json!([[0.0, 0.1, "disarmed"], [0.5, 1.0, "stopped"]]));
    }

    #[test]
    fn a_robot_without_a_base_has_no_path_and_stops_when_no_motor_runs() {
        let mut recording = two_seconds();
        let with = report(&recording);
        recording.base = None;
        for motor in &mut recording.motors[..4] {
            motor.samples[50..100].iter_mut().for_each(|sample| sample.drive = Drive::Coast);
        }
        assert_eq!(embedded(&report(&recording))["stops"], json!([]));
        for motor in &mut recording.motors[4..] {
            motor.samples[60..100].iter_mut().for_each(|sample| sample.drive = Drive::Hold);
        }
        let without = report(&recording);
        assert_eq!(embedded(&without)["stops"], json!([[0.6, 1.0, "stopped"]]));
        for text in ["data-plot=\"path\"", "driven by the base", "the wheels do not follow"] {
            assert!(with.contains(text) && !without.contains(text), "{text}");
        }
    }

    #[test]
    fn a_remote_has_its_lanes_and_a_line_for_each_time_that_it_was_lost() {
        let mut recording = two_seconds();
        assert!(!report(&recording).contains("<h2>Remote</h2>"));
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
        let page = report(&recording);
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
        assert!(report(&recording).contains("no frame lost"));
        heard.damaged = 2;
        track.heard = Some(heard);
        recording.remote = Some(track.clone());
        assert!(report(&recording).contains("<li>remote: 1 damaged frames</li>"));
        track.heard = None;
        track.losses[0].coasting = at(618);
        track.samples[0].arm = None;
        recording.remote = Some(track);
        let page = report(&recording);
        assert!(page.contains("<li>remote lost: the motors coasted after 121.0 ms only</li>"));
        assert_eq!(embedded(&page)["lanes"].as_array().unwrap().len(), 12);
    }

    #[test]
    fn an_empty_recording_is_a_page_too() {
        let nothing = Recording {
            seed: 0,
            length: Micros::ZERO,
            motors: Vec::new(),
            buses: Vec::new(),
            lines: Vec::new(),
            base: None,
            events: Vec::new(),
            remote: None,
        };
        assert_eq!(embedded(&report(&nothing))["charts"], json!([]));
    }
}
