//! The figures of a run: tables for people, JSON for programs.

use std::fmt::Write as _;

use rc10_can::{Micros, Timing};
use rc10_module::Counters;
use rc10_motor::TargetKind;
use serde_json::{Value, json};

use crate::recording::{MotorTrack, Recording};
use crate::remote::{Loss, RemoteTrack};

/// What a track's samples amount to.
struct Tracking {
    unit: &'static str,
    /// Root of the mean square difference of target and measurement, while it followed a target.
    rms: Option<f64>,
    /// Newest target and measurement.
    last: (Option<f64>, f64),
    /// Largest current, A, either way.
    peak_current: f64,
}

fn tracking(track: &MotorTrack) -> Tracking {
    let errors: Vec<f64> = (track.samples.iter())
        .filter_map(|sample| Some(sample.target? - sample.measured))
        .collect();
    let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
    let last = track.samples.last();
    let kind = last.map_or(TargetKind::Coast, |sample| sample.kind);
    Tracking {
        unit: match kind {
            TargetKind::Angle | TargetKind::TotalAngle | TargetKind::Impedance => "deg",
            _ => "rpm",
        },
        rms: (!errors.is_empty()).then(|| mean_square.sqrt()),
        last: last.map_or((None, 0.0), |sample| (sample.target, sample.measured)),
        peak_current: track.samples.iter().fold(0.0, |peak, sample| peak.max(sample.current.abs())),
    }
}

/// A line per motor.
#[must_use]
pub fn motor_table(recording: &Recording) -> String {
    let mut text = String::new();
    let _ = write_motors(&mut text, recording);
    text
}

fn write_motors(text: &mut String, recording: &Recording) -> std::fmt::Result {
    let names = recording.motors.iter().map(|track| track.motor.name().to_string().len());
    let width = names.max().unwrap_or(0).max(26);
    writeln!(
        text,
        "{:<18} {:<width$} {:>3}  {:<9} {:>9} {:>9}     {:>10} {:>8} {:>8} {:>5} {:>5}",
        "motor",
        "model",
        "bus",
        "link",
        "target",
        "measured",
        "error rms",
        "peak A",
        "received",
        "bad",
        "lost"
    )?;
    for track in &recording.motors {
        let Tracking { unit, rms, last: (target, measured), peak_current } = tracking(track);
        let target = target.map_or("-".into(), |target| format!("{target:.1}"));
        let rms = rms.map_or("-".into(), |rms| format!("{rms:.2}"));
        let model = track.motor.name().to_string();
        let counters = track.last.counters;
        writeln!(
            text,
            "{:<18} {:<width$} {:>3}  {:<9} {:>9} {:>9.1} {:<3} {:>10} {:>8.2} {:>8} {:>5} {:>5}",
            track.motor.label,
            model,
            track.motor.on.short(),
            format!("{:?}", track.last.link),
            target,
            measured,
            unit,
            rms,
            peak_current,
            counters.received,
            counters.malformed,
            counters.lost + u32::try_from(track.overwritten).unwrap_or(u32::MAX),
        )?;
    }
    Ok(())
}

/// A line per bus.
#[must_use]
pub fn bus_table(recording: &Recording) -> String {
    let mut text = String::new();
    let _ = write_buses(&mut text, recording);
    text
}

fn write_buses(text: &mut String, recording: &Recording) -> std::fmt::Result {
    writeln!(
        text,
        "{:<5} {:>15} {:>8} {:>8} {:>6} {:>9} {:>8} {:>9}  {:<24} {:<18}",
        "bus",
        "planned load %",
        "load %",
        "frames",
        "lost",
        "replaced",
        "refused",
        "overruns",
        "tick period us",
        "tick takes us"
    )?;
    for bus in &recording.buses {
        let last = &bus.last;
        writeln!(
            text,
            "{:<5} {:>15} {:>8.1} {:>8} {:>6} {:>9} {:>8} {:>9}  {:<24} {:<18}",
            bus.number,
            format!("{:.0}..{:.0}", last.load.least, last.load.worst),
            bus.load,
            bus.frames,
            last.health.receive_lost,
            last.replaced,
            last.refused,
            last.overruns,
            min_mean_max(&last.period),
            min_mean_max(&last.execution),
        )?;
    }
    Ok(())
}

/// An empty line and one per RS-485 line; nothing for a robot without any.
#[must_use]
pub fn line_table(recording: &Recording) -> String {
    let mut text = String::new();
    let _ = write_lines(&mut text, recording);
    text
}

fn write_lines(text: &mut String, recording: &Recording) -> std::fmt::Result {
    if recording.lines.is_empty() {
        return Ok(());
    }
    writeln!(
        text,
        "\n{:<5} {:>10} {:>9} {:>11} {:>8} {:>11} {:>9}  {:<24}",
        "line",
        "exchanges",
        "timeouts",
        "crc errors",
        "garbage",
        "unexpected",
        "overruns",
        "exchange us"
    )?;
    for (number, line) in (1..).zip(&recording.lines) {
        let number: u8 = number;
        let traffic = &line.traffic;
        writeln!(
            text,
            "{number:<5} {:>10} {:>9} {:>11} {:>8} {:>11} {:>9}  {:<24}",
            traffic.exchanges,
            traffic.timeouts,
            traffic.crc_errors,
            traffic.garbage,
            traffic.unexpected,
            line.overruns,
            min_mean_max(&traffic.exchange),
        )?;
    }
    Ok(())
}

/// An empty line, one for the receiver and one per time that the remote was lost; nothing for a
/// robot without one.
#[must_use]
pub fn remote_lines(recording: &Recording) -> String {
    let Some(track) = &recording.remote else { return String::new() };
    let mut text = String::new();
    let _ = write_remote(&mut text, track);
    text
}

fn write_remote(text: &mut String, track: &RemoteTrack) -> std::fmt::Result {
    let RemoteTrack { receiver, sent, heard, losses, .. } = track;
    write!(text, "\nremote {receiver}: {} frames sent, {} of them live", sent.frames, sent.live)?;
    if let Some(heard) = heard {
        let Counters { frames, damaged, skipped, port_errors, .. } = heard;
        write!(text, "; {frames} heard, {damaged} damaged, {skipped} bytes skipped, ")?;
        write!(text, "{port_errors} port errors")?;
    }
    writeln!(text)?;
    for loss in losses {
        writeln!(text, "{}", sentence(loss))?;
    }
    Ok(())
}

/// One loss in words.
#[must_use]
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

fn seconds(time: Micros) -> f64 {
    time.get() as f64 * 1e-6
}

/// The remote as JSON; null without one.
#[must_use]
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
    let heard = track.heard.map(|heard| {
        json!({
            "frames": heard.frames,
            "damaged": heard.damaged,
            "bytes_skipped": heard.skipped,
            "port_errors": heard.port_errors,
        })
    });
    json!({
        "receiver": track.receiver.to_string(),
        "frames_sent": track.sent.frames,
        "live_frames_sent": track.sent.live,
        "heard": heard,
        "losses": losses.collect::<Vec<_>>(),
    })
}

fn min_mean_max(timing: &Timing) -> String {
    match (timing.min(), timing.mean(), timing.max()) {
        (Some(min), Some(mean), Some(max)) => format!("{min} / {mean:.1} / {max}"),
        _ => "-".into(),
    }
}

/// All figures as one JSON object. `wall` is how many seconds of real time the run took.
#[must_use]
pub fn to_json(recording: &Recording, wall: f64) -> Value {
    let motors = recording.motors.iter().map(|track| {
        let Tracking { unit, rms, last: (target, measured), peak_current } = tracking(track);
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
            "error_rms": rms,
            "peak_current_a": peak_current,
            "received": track.last.counters.received,
            "malformed": track.last.counters.malformed,
            "lost": track.last.counters.lost,
            "expired": track.last.counters.expired,
            "feedback_overwritten": track.overwritten,
        })
    });
    let timing = |timing: &Timing| json!({ "min": timing.min(), "mean": timing.mean(), "max": timing.max() });
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
    let lines = (1..).zip(&recording.lines).map(|(number, line): (u8, _)| {
        let traffic = &line.traffic;
        json!({
            "line": number,
            "exchanges": traffic.exchanges,
            "timeouts": traffic.timeouts,
            "crc_errors": traffic.crc_errors,
            "garbage_bytes": traffic.garbage,
            "unexpected": traffic.unexpected,
            "port_errors": line.port_errors,
            "overruns": line.overruns,
            "ticks": line.ticks,
            "tick_period_us": timing(&line.period),
            "exchange_us": timing(&traffic.exchange),
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
        "lines": lines.collect::<Vec<_>>(),
        "remote": remote_json(recording),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remote::Lost;

    #[test]
    fn a_loss_is_told_to_its_end() {
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
}
