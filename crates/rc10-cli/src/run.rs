//! `rc10 run`: drives the simulated robot and says how it went.

use std::fmt::Write as _;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;
use rc10_can::{Micros, Timing};
use rc10_motor::TargetKind;
use serde_json::{Value, json};

use crate::recording::{BusTrack, MotorTrack, Recording};
use crate::report::report;
use crate::simulate::{simulate, trace_hash};

/// What `rc10 run` is told.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// Virtual seconds to run, up to 3600
    #[arg(long, value_name = "S", default_value = "10", value_parser = seconds)]
    pub seconds: Micros,
    /// Seed of everything random in the world: two runs with one seed are the same to the bit
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Folder for report.html and the bus logs
    #[arg(long, value_name = "DIR", default_value = "target/rc10")]
    pub out: PathBuf,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
}

/// What `rc10` does without any argument.
impl Default for RunArgs {
    fn default() -> Self {
        Self {
            seconds: Micros::from_millis(10_000),
            seed: 1,
            out: "target/rc10".into(),
            json: false,
        }
    }
}

/// A number of seconds with up to six decimals, exactly.
fn seconds(text: &str) -> Result<Micros, String> {
    const WANTED: &str = "must be a number of seconds from 0.001 to 3600";
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty()
        || whole.len() > 4
        || !digits(whole)
        || !digits(fraction)
        || fraction.len() > 6
    {
        return Err(WANTED.into());
    }
    let micros = format!("{whole}{fraction:0<6}").parse().map_err(|_| WANTED)?;
    match micros {
        1000..=3_600_000_000 => Ok(Micros::new(micros)),
        _ => Err(WANTED.into()),
    }
}

/// Runs the robot, writes the files, prints the figures.
///
/// # Errors
/// If the folder cannot be written, or the robot's table is wrong.
pub fn run(args: &RunArgs, out: &mut dyn Write) -> Result<()> {
    // Before the work, so that a wrong folder is known at once.
    fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot make the folder {}", args.out.display()))?;
    let started = Instant::now();
    let recording = simulate(args.seed, args.seconds)?;
    let wall = started.elapsed().as_secs_f64();

    write_file(&args.out, "report.html", &report(&recording))?;
    for bus in &recording.buses {
        write_file(&args.out, &format!("bus{}.log", bus.number), &bus.log)?;
    }
    if args.json {
        writeln!(out, "{}", to_json(&recording, wall))?;
    } else {
        out.write_all(to_text(&recording, wall, &args.out).as_bytes())?;
    }
    Ok(())
}

/// Writes a whole file or none: first beside it, then in its place.
fn write_file(folder: &Path, name: &str, content: &str) -> Result<()> {
    let path = folder.join(name);
    let beside = folder.join(format!(".{name}.{}", std::process::id()));
    let write = || {
        fs::write(&beside, content)?;
        fs::rename(&beside, &path)
    };
    let written = write();
    if written.is_err() {
        let _ = fs::remove_file(&beside);
    }
    written.with_context(|| format!("cannot write {}", path.display()))
}

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
        unit: if matches!(kind, TargetKind::Angle | TargetKind::TotalAngle) {
            "deg"
        } else {
            "rpm"
        },
        rms: (!errors.is_empty()).then(|| mean_square.sqrt()),
        last: last.map_or((None, 0.0), |sample| (sample.target, sample.measured)),
        peak_current: track.samples.iter().fold(0.0, |peak, sample| peak.max(sample.current.abs())),
    }
}

fn to_text(recording: &Recording, wall: f64, folder: &Path) -> String {
    let mut text = String::new();
    let _ = print(&mut text, recording, wall, folder);
    text
}

fn print(text: &mut String, recording: &Recording, wall: f64, folder: &Path) -> std::fmt::Result {
    let length = recording.length.get() as f64 * 1e-6;
    writeln!(text, "{length} s of virtual time in {wall:.2} s, seed {}\n", recording.seed)?;
    writeln!(
        text,
        "{:<18} {:<26} {:>3}  {:<9} {:>9} {:>9}     {:>10} {:>8} {:>8} {:>5} {:>5}",
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
        let model = format!("{} id {}", track.entry.model.name, track.entry.id);
        let counters = track.last.counters;
        writeln!(
            text,
            "{:<18} {:<26} {:>3}  {:<9} {:>9} {:>9.1} {:<3} {:>10} {:>8.2} {:>8} {:>5} {:>5}",
            track.entry.label,
            model,
            track.entry.bus,
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
    writeln!(
        text,
        "\n{:<5} {:>15} {:>8} {:>8} {:>6} {:>9} {:>8} {:>9}  {:<24} {:<18}",
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
        let BusTrack { plan, last, .. } = bus;
        writeln!(
            text,
            "{:<5} {:>15} {:>8.1} {:>8} {:>6} {:>9} {:>8} {:>9}  {:<24} {:<18}",
            bus.number,
            format!("{:.0}..{:.0}", plan.least, plan.worst),
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
    writeln!(
        text,
        "\nA tick takes 0 us here: virtual time stands still while code runs. Instructions per tick\n\
         on the chip: cargo xtask count.\n"
    )?;
    writeln!(text, "trace {}", trace_hash(recording))?;
    writeln!(text, "open  {}", folder.join("report.html").display())?;
    writeln!(text, "logs  {}  (rc10 decode reads them)", folder.join("bus*.log").display())
}

fn min_mean_max(timing: &Timing) -> String {
    match (timing.min(), timing.mean(), timing.max()) {
        (Some(min), Some(mean), Some(max)) => format!("{min} / {mean:.1} / {max}"),
        _ => "-".into(),
    }
}

fn to_json(recording: &Recording, wall: f64) -> Value {
    let motors = recording.motors.iter().map(|track| {
        let Tracking { unit, rms, last: (target, measured), peak_current } = tracking(track);
        json!({
            "motor": track.entry.label,
            "model": track.entry.model.name,
            "id": track.entry.id,
            "bus": track.entry.bus,
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
                "least": bus.plan.least,
                "typical": bus.plan.typical,
                "worst": bus.plan.worst,
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
        "trace_hash": trace_hash(recording),
        "motors": motors.collect::<Vec<_>>(),
        "buses": buses.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_exact_and_bounded() {
        assert_eq!(seconds("0.1").unwrap(), Micros::new(100_000));
        assert_eq!(seconds("10").unwrap(), Micros::new(10_000_000));
        assert_eq!(seconds("3600").unwrap(), Micros::new(3_600_000_000));
        for bad in
            ["", ".", "-1", "0", "0.0009", "3600.1", "1e3", "nan", "1.0000001", "99999", "1.-1"]
        {
            assert!(seconds(bad).is_err(), "{bad}");
        }
    }
}
