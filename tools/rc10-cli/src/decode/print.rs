//! Text for people, JSON for programs.

use std::io::{self, Write};

use rc10_can::CanFrame;
use rc10_can::embedded_can::Id;
use rc10_motor::dji::{Effort, Model};
use rc10_motor::rc10_app::Direction;
use rc10_motor::signals::{Message, Presence, Signal};
use rc10_motor::{FrameError, MotorStatus};
use rc10_time::Micros;
use serde_json::{Value, json};

use super::{Decoder, Lane, Meaning, Summary, known_on};
use crate::formats::candump::{self, CandumpLine, SecondsOf};
use crate::recording::sample::rounded;
use crate::robot::description::Description;
use crate::robot::motor::Motor;

pub(crate) struct Printer<'o> {
    pub(crate) out: &'o mut dyn Write,
    json: bool,
    columns: Columns,
    separator: &'static str,
}

impl<'o> Printer<'o> {
    pub(crate) fn new(out: &'o mut dyn Write, json: bool, robot: &Description) -> io::Result<Self> {
        if json {
            out.write_all(b"{\"frames\": [")?;
        }
        Ok(Self { out, json, columns: Columns::of(robot), separator: "\n" })
    }

    pub(crate) fn frame(
        &mut self,
        number: u64,
        line: &CandumpLine<'_>,
        bus: u8,
        meaning: &Meaning<'_>,
        body: &str,
    ) -> io::Result<()> {
        if !self.json {
            let at = line.at.map_or_else(|| "-".to_owned(), |at| SecondsOf(at).to_string());
            // The time of a run since power-on, without the zeros of a date.
            let at = at.trim_start_matches('0');
            let zero = if at.starts_with('.') { "0" } else { "" };
            return writeln!(self.out, "{:>17}  {body}", format!("{zero}{at}"));
        }
        let separator = std::mem::replace(&mut self.separator, ",\n");
        write!(self.out, "{separator}{}", object(number, line, bus, meaning))
    }

    /// What a frame says, without its time.
    pub(crate) fn body(&self, line: &CandumpLine<'_>, meaning: &Meaning<'_>) -> String {
        text(&self.columns, line, meaning)
    }

    pub(crate) fn finish(self, summary: &Summary, decoder: &Decoder<'_, '_>) -> io::Result<()> {
        if self.json {
            let summary = summary_object(summary, decoder);
            return writeln!(self.out, "\n],\n\"summary\": {summary}}}");
        }
        summary_text(self.out, &self.columns, summary, decoder)
    }
}

fn three(value: f32) -> f64 {
    rounded(value.into(), 3)
}

/// Widths of the columns that name a motor: that of the longest text in them.
struct Columns {
    label: usize,
    device: usize,
}

impl Columns {
    fn of(robot: &Description) -> Self {
        let width =
            |column: fn(&Motor) -> usize| robot.motors.iter().map(column).max().unwrap_or(0);
        let device = width(|motor| motor.name().to_string().len());
        Self { label: width(|motor| motor.label.len()), device }
    }

    /// The columns of a motor, or of several.
    fn name(&self, motor: Option<&Motor>) -> String {
        let label = motor.map_or("several", |motor| motor.label);
        let device = motor.map_or_else(String::new, |motor| motor.name().to_string());
        format!("{label:<0$}  {device:<1$}", self.label, self.device)
    }
}

/// Effort and unit of a raw command in the robot's direction: amperes, or percent of full voltage.
fn effort(motor: &Motor, model: &Model, raw: i16) -> (f64, &'static str) {
    let share = motor.sign() * f64::from(raw) / f64::from(model.full_scale);
    match model.effort {
        Effort::Current(full) => (share * f64::from(full), "A"),
        Effort::Voltage => (share * 100.0, "%"),
    }
}

fn beyond_full_scale(model: &Model, raw: i16) -> bool {
    raw.unsigned_abs() > model.full_scale.unsigned_abs()
}

fn signals<'m>(
    message: &'m Message,
    frame: &CanFrame,
) -> impl Iterator<Item = (&'m Signal, f64, Option<&'static str>)> {
    let switch = message.signals.iter().find(|signal| signal.presence == Presence::Switch);
    let frame = *frame;
    let case = switch.and_then(|switch| switch.raw_in(&frame));
    message.signals.iter().filter_map(move |signal| {
        if let Presence::If(wanted) = signal.presence
            && case != Some(u64::from(wanted))
        {
            return None;
        }
        let raw = signal.raw_in(&frame)?;
        let name = signal.values().find(|(value, _)| u64::from(*value) == raw);
        Some((signal, signal.physical_in(&frame)?, name.map(|(_, name)| name)))
    })
}

/// The signals as text, without error bits that are not set, and no "REGISTER PMAX" before "PMAX
/// 12.5 rad".
fn signals_text(message: &Message, frame: &CanFrame) -> String {
    let all: Vec<_> = signals(message, frame).collect();
    let follows = |name: Option<&str>| all.iter().any(|(signal, ..)| name == Some(signal.name));
    let said = all.iter().filter(|(signal, _, name)| {
        let is_unset = signal.bits == 1 && name.is_none() && signal.values().next().is_some();
        let is_said_again = signal.presence == Presence::Switch && follows(*name);
        !is_unset && !is_said_again
    });
    said.map(|signal| signal_text(*signal)).collect::<Vec<_>>().join("  ")
}

fn signal_text((signal, value, name): (&Signal, f64, Option<&'static str>)) -> String {
    match (name, signal.unit) {
        (Some(name), _) => format!("{} {name}", signal.name),
        (None, "") => format!("{} {}", signal.name, rounded(value, 3)),
        (None, unit) => format!("{} {} {unit}", signal.name, rounded(value, 3)),
    }
}

/// What a frame of a bus says; the first bus is 1.
pub(crate) fn said(robot: &Description, bus: u8, frame: &CanFrame) -> String {
    let messages = (1..=robot.buses).map(|bus| known_on(robot, bus)).collect();
    let mut decoder = Decoder { robot, messages, buses: Vec::new(), newest: Micros::ZERO };
    let line = CandumpLine { at: None, channel: "", frame: *frame, direction: None };
    let meaning = decoder.decode(bus, &line);
    text(&Columns { label: 0, device: 0 }, &line, &meaning)
}

fn text(columns: &Columns, line: &CandumpLine<'_>, meaning: &Meaning<'_>) -> String {
    let start = format!("{:<5}", line.channel);
    match meaning {
        Meaning::Feedback { motor, feedback, .. } => {
            let celsius = feedback.temperature().map(|temperature| temperature.get().to_string());
            let celsius = celsius.unwrap_or_else(|| "-".to_owned());
            format!(
                "{start}  {}  angle {:>7.3} deg  total {:>11.3} deg  speed {:>8.2} rpm  \
                 current {:>7.3} A  {celsius:>3} degC",
                columns.name(Some(motor)),
                three(feedback.angle.get()),
                rounded(millionths(feedback.total_angle.microdegrees()), 3),
                rounded(feedback.speed.get().into(), 2),
                three(feedback.current().unwrap_or_default().get()),
            )
        }
        Meaning::Message { motor, message } => {
            let text = format!("{start}  {}  {}", columns.name(*motor), message.name);
            match signals_text(message, &line.frame) {
                signals if signals.is_empty() => text,
                signals => format!("{text}  {signals}"),
            }
        }
        Meaning::Unasked { motor } => {
            let (whose, frame) = (columns.name(Some(motor)), line.frame);
            format!("{start}  {whose}  an answer to a request: {frame}")
        }
        Meaning::Command(lanes) => {
            let lanes: Vec<String> = lanes.iter().map(lane_text).collect();
            let lanes = if lanes.is_empty() { "no motor".to_owned() } else { lanes.join("  ") };
            format!("{start}  command {:03X}  {lanes}", line.frame.raw_id())
        }
        Meaning::Malformed { motor, error } => {
            let command = || format!("command {:03X}", line.frame.raw_id());
            let whose = motor.map_or_else(command, |motor| columns.name(Some(motor)));
            format!("{start}  {whose}  MALFORMED: {}: {}", reason(line, *motor, *error), line.frame)
        }
        Meaning::Unknown => start,
    }
}

/// The error of a frame, with figures that a motor on the chip does not keep.
fn reason(line: &CandumpLine<'_>, motor: Option<&Motor>, error: FrameError) -> String {
    match error {
        // All frames of DJI motors have eight.
        FrameError::Length if motor.is_none_or(|motor| motor.dji().is_some()) => {
            format!("{} data bytes instead of 8", line.frame.len())
        }
        other => other.to_string(),
    }
}

/// The motor of a lane, if there is one, with its model and identifier.
fn driven<'d>(lane: &Lane<'d>) -> Option<(&'d Motor, &'static Model, u8)> {
    let motor = lane.motor?;
    motor.dji().map(|(model, id)| (motor, model, id))
}

fn lane_text(lane: &Lane<'_>) -> String {
    let Some((motor, model, _)) = driven(lane) else {
        return format!("lane {} of no motor: raw {}", lane.number, lane.raw);
    };
    let (value, unit) = effort(motor, model, lane.raw);
    let beyond = if beyond_full_scale(model, lane.raw) { " (beyond full scale)" } else { "" };
    format!("{} {:>7.3} {unit}{beyond}", motor.label, rounded(value, 3))
}

fn object(number: u64, line: &CandumpLine<'_>, bus: u8, meaning: &Meaning<'_>) -> Value {
    let direction = line.direction.map(|direction| match direction {
        candump::Direction::Received => "received",
        candump::Direction::Sent => "sent",
    });
    let mut object = json!({
        "line": number,
        "time_us": line.at.map(|at| at.get()),
        "channel": line.channel,
        "bus": bus,
        "direction": direction,
    });
    let frame = || line.frame.to_string();
    let rest = match meaning {
        Meaning::Feedback { motor, raw, feedback } => json!({
            "kind": "feedback",
            "motor": motor.label,
            "model": motor.name().model,
            "id": motor.name().id,
            "angle_deg": six(feedback.angle.get()),
            "total_angle_deg": millionths(feedback.total_angle.microdegrees()),
            "speed_rpm": six(feedback.speed.get()),
            "current_a": feedback.current().map(|current| six(current.get())),
            "torque_nm": feedback.torque().map(|torque| six(torque.get())),
            "temperature_c": feedback.temperature().map(|temperature| six(temperature.get())),
            "raw": raw.map(|raw| json!({
                "angle": raw.angle,
                "rpm": raw.rpm,
                "current": raw.current,
                "temperature": raw.temperature,
            })),
        }),
        Meaning::Message { motor, message } => {
            let signals = signals(message, &line.frame).map(|(signal, value, name)| {
                json!({
                    "signal": signal.name,
                    "value": rounded(value, 9),
                    "unit": signal.unit,
                    "name": name,
                })
            });
            json!({
                "kind": "message",
                "frame": frame(),
                "motor": motor.map(|motor| motor.label),
                "model": motor.map(|motor| motor.name().model),
                "id": motor.map(|motor| motor.name().id),
                "message": message.name,
                "from_device": message.from_device,
                "signals": signals.collect::<Value>(),
            })
        }
        Meaning::Unasked { motor } => {
            json!({ "kind": "unasked", "frame": frame(), "motor": motor.label })
        }
        Meaning::Command(lanes) => {
            let lanes: Value = lanes.iter().map(lane_object).collect();
            json!({ "kind": "command", "frame": frame(), "lanes": lanes })
        }
        Meaning::Malformed { motor, error } => json!({
            "kind": "malformed",
            "frame": frame(),
            "motor": motor.map(|motor| motor.label),
            "error": reason(line, *motor, *error),
        }),
        Meaning::Unknown => json!({ "kind": "unknown", "frame": frame() }),
    };
    if let (Value::Object(object), Value::Object(rest)) = (&mut object, rest) {
        object.extend(rest);
    }
    object
}

fn lane_object(lane: &Lane<'_>) -> Value {
    let Lane { number, raw, .. } = *lane;
    let Some((motor, model, id)) = driven(lane) else {
        return json!({ "lane": number, "raw": raw });
    };
    let (value, unit) = effort(motor, model, raw);
    let name = if unit == "A" { "current_a" } else { "voltage_percent" };
    json!({
        "lane": number,
        "raw": raw,
        "motor": motor.label,
        "model": model.name,
        "id": id,
        name: rounded(value, 6),
        "beyond_full_scale": beyond_full_scale(model, raw),
    })
}

/// An f32 with six decimals, so that 0.1 is not 0.10000000149.
fn six(value: f32) -> f64 {
    rounded(value.into(), 6)
}

#[expect(clippy::cast_precision_loss, reason = "exact to a microdegree for 25 million turns")]
fn millionths(count: i64) -> f64 {
    count as f64 / 1e6
}

fn id_text(id: Id) -> String {
    match id {
        Id::Standard(id) => format!("{:03X}", id.as_raw()),
        Id::Extended(id) => format!("{:08X}", id.as_raw()),
    }
}

fn buses(summary: &Summary) -> impl Iterator<Item = (&str, u8)> {
    let channels = summary.channels.iter();
    channels.filter_map(|(name, channel)| Some((name.as_str(), channel.bus?)))
}

fn summary_object(summary: &Summary, decoder: &Decoder<'_, '_>) -> Value {
    let channels = summary.channels.iter().map(
        |(name, channel)| json!({ "channel": name, "bus": channel.bus, "frames": channel.frames }),
    );
    let motors = buses(summary).flat_map(|(name, bus)| {
        decoder.motors(bus).map(move |(motor, status)| {
            json!({
                "motor": motor.label,
                "model": motor.name().model,
                "id": motor.name().id,
                "channel": name,
                "bus": bus,
                "mirrored": motor.direction == Direction::Reversed,
                "feedback": status.counters.received,
                "malformed": status.counters.malformed,
                "unasked": status.counters.unasked,
                "turn_gaps": status.feedback.turn_gaps,
            })
        })
    });
    let unknown = summary.channels.iter().flat_map(|(name, channel)| {
        channel.unknown.iter().map(move |((id, remote), frames)| {
            json!({ "channel": name, "id": id_text(*id), "remote": remote, "frames": frames })
        })
    });
    let further: u64 = summary.channels.values().map(|channel| channel.unknown_further).sum();
    json!({
        "lines": summary.lines,
        "frames": summary.frames,
        "feedback": summary.feedback,
        "commands": summary.commands,
        "malformed": summary.malformed,
        "unknown": summary.unknown,
        "broken_lines": summary.broken_lines,
        "channels": channels.collect::<Value>(),
        "motors": motors.collect::<Value>(),
        "unknown_ids": unknown.collect::<Value>(),
        "unknown_of_further_ids": further,
    })
}

fn summary_text(
    out: &mut dyn Write,
    columns: &Columns,
    summary: &Summary,
    decoder: &Decoder<'_, '_>,
) -> io::Result<()> {
    let Summary { lines, frames, feedback, commands, malformed, unknown, broken_lines, .. } =
        summary;
    if *frames > 0 {
        writeln!(out)?;
    }
    match (lines, frames) {
        (0, _) => writeln!(out, "The log is empty.")?,
        (_, 0) => writeln!(out, "The log has no frames.")?,
        _ => {}
    }
    writeln!(out, "lines {lines}, of which broken {broken_lines}")?;
    writeln!(
        out,
        "frames {frames}: feedback {feedback}, commands {commands}, malformed {malformed}, \
         unknown {unknown}"
    )?;
    for (name, bus) in buses(summary) {
        writeln!(out, "\n{name} is bus {bus}")?;
        for (motor, status) in decoder.motors(bus) {
            let summary = motor_summary(motor, &status);
            writeln!(out, "  {}  {summary}", columns.name(Some(motor)))?;
        }
    }
    if *unknown > 0 {
        writeln!(out, "\nunknown identifiers")?;
    }
    for (name, channel) in &summary.channels {
        for ((id, remote), count) in &channel.unknown {
            let what = if *remote { "remote requests" } else { "frames" };
            writeln!(out, "  {name:<5}  {:>8}  {what} {count}", id_text(*id))?;
        }
        if channel.unknown_further > 0 {
            writeln!(out, "  {name:<5}   further  frames {}", channel.unknown_further)?;
        }
    }
    Ok(())
}

fn motor_summary(motor: &Motor, status: &MotorStatus) -> String {
    let mut text = match status.counters.received {
        0 => "never heard".to_owned(),
        received => format!("feedback {received}"),
    };
    if status.counters.malformed > 0 {
        text += &format!(", malformed {}", status.counters.malformed);
    }
    if status.counters.unasked > 0 {
        text += &format!(", answers to requests {}", status.counters.unasked);
    }
    if status.feedback.turn_gaps > 0 {
        text += &format!(", turns estimated over {} gaps", status.feedback.turn_gaps);
    }
    if motor.direction == Direction::Reversed {
        text += "; mirrored: signs are turned";
    }
    text
}
