//! The recording of a capture: what the robot's own motors understand of the traffic of its buses.

use std::io::{self, BufReader, Write};
use std::path::PathBuf;

use anyhow::{Context, Result, bail, ensure};
use rc10_can::CanFrame;
use rc10_motor::{DriveMode, MotorStatus, TargetKind};
use rc10_time::Micros;

use super::{BusOfChannel, Decoder, Summary, excerpt, known_on};
use crate::files::{is_record, open, unreadable};
use crate::formats::candump::{CandumpLine, Numbered, Reader};
use crate::record::recorder::Recorder;
use crate::record::replay::replay;
use crate::recording::Recording;
use crate::recording::look::{BusLook, Moment, MotorLook, Shaft};
use crate::recording::sample::{LOOK_PERIOD, WireEnd, seconds};
use crate::robot::description::Description;
use crate::robot::motor::{BITS_PER_SECOND, Place};
use crate::terminal::{Plain, tell};
use crate::world::robot::Robot;

/// Longest capture, in virtual time: a clock that jumped would make one of years.
const LONGEST: Micros = Micros::from_millis(3_600_000);
/// Times from here on are calendar times: they are counted from the first frame.
const A_DAY: Micros = Micros::from_millis(86_400_000);
const MOST_TOLD: u64 = 10;
const WINDOW: Micros = Micros::from_millis(100);

/// Gaps of a record that are told one by one.
const GAPS: usize = 5;

/// The recording of a record, or of captures of the robot's buses, and its name. Says where it is cut off, and what it
/// lacks. Fails like [`replay`].
pub(crate) fn recorded(
    files: &[PathBuf],
    buses: &[BusOfChannel],
    robot: Robot<'_>,
) -> Result<(Recording, String)> {
    let names = files.iter().map(|file| file.display().to_string());
    let named = names.collect::<Vec<_>>().join(", ");
    let (recording, cut) = if is_record(&files[0])? {
        let [file] = files else { bail!("{named}: one record at a time") };
        ensure!(buses.is_empty(), "--bus is for captures: a record has the robot's own buses");
        replay(&mut open(file)?, robot).with_context(|| named.clone())?
    } else {
        let heard = hear(files, buses, robot, &mut Plain(io::stderr().lock()));
        (heard.with_context(|| named.clone())?, None)
    };
    if let Some(why) = cut {
        tell(format_args!("{named}: cut off after {} s: {why}", seconds(recording.length)));
    }
    for gap in recording.gaps.iter().take(GAPS) {
        let hint = "it is left out, and what follows is that much nearer";
        tell(format_args!("{named}: {gap} at {} s; {hint}", seconds(gap.at)));
    }
    if let more @ 1.. = recording.gaps.len().saturating_sub(GAPS) {
        tell(format_args!("{named}: {more} such gaps more"));
    }
    Ok((recording, named))
}

struct CapturedFrame {
    at: Micros,
    bus: u8,
    frame: CanFrame,
}

/// Makes the recording of candump logs: the motors and buses that occur in them. Broken lines and
/// unknown interfaces are reported on `err`. Fails if a file cannot be read; no file has a frame
/// with a time on a bus of the robot; they last more than an hour; a bus or an interface is given
/// twice; or the robot is not as described.
pub(crate) fn hear(
    files: &[PathBuf],
    told: &[BusOfChannel],
    robot: Robot<'_>,
    err: &mut dyn Write,
) -> Result<Recording> {
    let (description, buses, _) = robot.into_buses()?;
    let robot = Description { base: None, remote: None, serials: Vec::new(), ..description };
    let mut summary = Summary::new(told, robot.buses)?;
    let (mut heard, mut broken) = (Vec::new(), 0_u64);
    for file in files {
        let mut log = Reader::new(BufReader::new(open(file)?));
        let named = file.display();
        while let Some(Numbered { number, text, line }) =
            log.next_line().with_context(|| unreadable(file))?
        {
            let line = match line {
                Ok(Some(line)) => line,
                Ok(None) => continue,
                Err(error) => {
                    broken += 1;
                    if broken <= MOST_TOLD {
                        writeln!(err, "{named}: line {number}: {error}: {}", excerpt(text))?;
                    }
                    continue;
                }
            };
            if let Some(hint) = summary.greet(line.channel) {
                writeln!(err, "{hint}")?;
            }
            let Some(bus) = summary.bus_of(line.channel) else { continue };
            let Some(at) = line.at else {
                bail!("{named}: line {number} has no time: write the log with candump -l or -ta");
            };
            heard.push(CapturedFrame { at, bus, frame: line.frame });
        }
    }
    if broken > MOST_TOLD {
        writeln!(err, "{} more lines cannot be read", broken - MOST_TOLD)?;
    }
    for hint in summary.silent() {
        writeln!(err, "{hint}")?;
    }
    heard.sort_by_key(|heard| heard.at);
    let first = heard.first().context("no frame of a bus of the robot is in it")?.at;
    let start = if first >= A_DAY { first } else { Micros::ZERO };
    heard.iter_mut().for_each(|heard| heard.at = heard.at.since(start));
    let last = heard.last().map_or(Micros::ZERO, |heard| heard.at);
    ensure!(
        last <= LONGEST,
        "from the first to the last frame are {} s, and a report is made of 3600 at most",
        last.get() / 1_000_000
    );
    let messages = (1..=robot.buses).map(|bus| known_on(&robot, bus)).collect();
    let mut decoder = Decoder { robot: &robot, messages, buses, newest: Micros::ZERO };
    record(&robot, &mut decoder, &heard, last)
}

fn record(
    robot: &Description,
    decoder: &mut Decoder<'_, '_>,
    heard: &[CapturedFrame],
    last: Micros,
) -> Result<Recording> {
    // Whole milliseconds, up to the last frame's effect.
    let length = Micros::from_millis(last.get().div_ceil(1000).max(1));
    let mut recorder = Recorder::of_capture(robot);
    let mut traffic = vec![Traffic::default(); robot.buses.into()];
    let mut rest = heard.iter().peekable();
    let mut now = Micros::ZERO;
    while now < length {
        now += LOOK_PERIOD;
        while let Some(CapturedFrame { at, bus, frame }) = rest.next_if(|heard| heard.at <= now) {
            traffic[usize::from(*bus) - 1].add(*at, frame);
            let line = CandumpLine { at: Some(*at), channel: "", frame: *frame, direction: None };
            decoder.decode(*bus, &line);
        }
        let status = |entry: usize| {
            let Place::Bus(bus) = robot.motors.get(entry)?.on else { return None };
            decoder.buses.get(usize::from(bus) - 1)?.status(robot.number(entry)?, now)
        };
        let looks = (0..robot.motors.len()).map(|entry| look(status(entry)));
        recorder.take_look(now, &looks.collect::<Vec<_>>())?;
        if Recorder::is_sample_due(now, length) {
            let seen = decoder.buses.iter().zip(&traffic).map(|(bus, traffic)| {
                let load = load(traffic.bits, now);
                BusLook { frames: traffic.frames, load, ..BusLook::heard(bus) }
            });
            recorder.take_sample(now, Moment { buses: seen.collect(), ..Moment::default() })?;
        }
    }
    let wires = traffic
        .iter()
        .map(|traffic| WireEnd { load_windows: traffic.windows(length), ..WireEnd::default() });
    let mut recording = recorder.finish_with(length, wires.collect(), Vec::new())?;
    // Nothing is known of lines, and of a bus that was not captured.
    let is_captured = |bus: u8| traffic[usize::from(bus) - 1].frames > 0;
    recording.motors.retain(|track| track.motor.on.bus().is_some_and(is_captured));
    recording.buses.retain(|track| is_captured(track.number));
    recording.events.clear();
    recording.no_logs = true;
    Ok(recording)
}

/// Bus load in percent, from the bits in a time.
fn load(bits: u64, time: Micros) -> f64 {
    100.0 * bits as f64 / (f64::from(BITS_PER_SECOND) * time.get() as f64 * 1e-6)
}

/// A look at a motor whose feedback alone is known.
fn look(status: Option<MotorStatus>) -> MotorLook {
    let mut status = status.unwrap_or(MotorStatus::NEW);
    status.drive = DriveMode::Coast;
    let shaft = Shaft::told(&status.feedback);
    MotorLook { kind: TargetKind::Speed, measured: shaft.rpm, shaft, ..MotorLook::of(status) }
}

#[derive(Clone, Default)]
struct Traffic {
    frames: u64,
    bits: u64,
    in_window: Vec<u64>,
}

impl Traffic {
    fn add(&mut self, at: Micros, frame: &CanFrame) {
        let bits = u64::from(frame.wire_length().total());
        self.frames += 1;
        self.bits += bits;
        let window = (at.get() / WINDOW.get()) as usize;
        self.in_window.resize(self.in_window.len().max(window + 1), 0);
        self.in_window[window] += bits;
    }

    /// The load in each 100 ms that is over, percent.
    fn windows(&self, length: Micros) -> Vec<f64> {
        let count = (length.get() / WINDOW.get()) as usize;
        let bits = |window: usize| self.in_window.get(window).copied().unwrap_or(0);
        (0..count).map(|window| load(bits(window), WINDOW)).collect()
    }
}
