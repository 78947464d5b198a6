//! The package `mcap-ros2-support` reads a record: its schemas say what stands in it, without our code.

use std::fs::{self, File};
use std::process::Command;

use rc10_cli::record::RecordWriter;
use rc10_cli::recording::Recording;
use rc10_cli::replay::Inputs;
use rc10_cli::run::simulate::{heading, simulate_into};
use rc10_time::Micros;
use serde_json::Value;
use team::{Motors, Ports, Shared};

use super::scratch::Scratch;
use super::{must_succeed, python, script};
use crate::black_box::{plain, ring};

const LENGTH: Micros = Micros::from_millis(2000);

#[test]
fn mcap_ros2_reads_every_value_of_a_record() {
    let Some(python) = python() else { return };
    let folder = Scratch::new("record");
    let path = folder.join("run.mcap");
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    let record = RecordWriter::new(&path, false, &heading(&robot, 4)).unwrap();
    let run = simulate_into(robot, 4, LENGTH, Some(record)).unwrap();
    let printed = must_succeed(Command::new(python).arg(script("read_record.py")).arg(&path));
    let topics: Value = serde_json::from_str(&printed).unwrap();
    compare(&run, &topics);
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[allow(clippy::float_cmp, reason = "the very same numbers")]
fn compare(run: &Recording, topics: &Value) {
    for track in &run.motors {
        let topic = format!("/motors/{}", track.motor.label.replace(' ', "_"));
        let (looks, health) = (&topics[&topic], &topics[format!("{topic}/health")]);
        let shafts = &topics[format!("{topic}/shaft")];
        assert_eq!((&looks["count"], &health["count"]), (&2000.into(), &200.into()), "{topic}");
        let (last, sample) = (&looks["last"], track.samples.last().unwrap());
        assert_eq!(last["at"], LENGTH.get() * 1000);
        assert_eq!(last["target"].as_f64(), sample.target);
        let feedback = &track.last.feedback;
        for (field, value) in [
            ("measured", sample.measured),
            ("link", 1.0),
            ("speed", feedback.speed.get().into()),
            ("total_angle", feedback.total_angle.microdegrees() as f64 * 1e-6),
        ] {
            assert_eq!(number(&last[field]), value, "{topic} {field}");
        }
        let shaft = &shafts["last"];
        assert_eq!(number(&shaft["shaft_speed"]), sample.rpm);
        assert_eq!(number(&shaft["winding_current"]), sample.current);
        assert_eq!(last["current"].as_f64(), feedback.current().map(|amps| amps.get().into()));
        let counters = &track.last.counters;
        assert_eq!(number(&health["last"]["received"]), f64::from(counters.received));
        assert_eq!(number(&health["last"]["lost"]), 0.0);
        // All of them: the mean of the run is that of its samples.
        let means = track.samples.iter().map(|sample| f64::from(sample.rpm_cell.mean));
        let mean = means.sum::<f64>() / track.samples.len() as f64;
        let read = number(&shafts["sums"]["shaft_speed"]) / 2000.0;
        assert!((read - mean).abs() < 1e-3 * mean.abs().max(1.0), "{topic}: {read}, {mean}");
    }
    for bus in &run.buses {
        let found = &topics[format!("/buses/{}", bus.number)]["last"];
        let wire = &topics[format!("/buses/{}/wire", bus.number)]["last"];
        assert_eq!(number(&wire["frames"]), bus.frames as f64);
        assert_eq!(number(&wire["load"]), bus.load);
        assert_eq!(number(&found["period_max"]), f64::from(bus.last.period.max().unwrap()));
        let windows = &topics[format!("/buses/{}/window_load", bus.number)];
        assert_eq!(windows["count"], bus.load_windows.len());
    }
    for signal in &run.signals {
        let found = &topics[format!("/signals/{}", signal.label.replace(' ', "_"))];
        assert_eq!((&found["count"], found["last"]["value"].as_f64()), (&2000.into(), signal.last));
    }
    let (first, last) = (run.events.first().unwrap(), run.events.last().unwrap());
    assert_eq!(topics["/events"]["count"], run.events.len());
    assert_eq!(topics["/events"]["first"]["label"], first.label);
    assert_eq!(topics["/events"]["last"]["label"], last.label);
    assert_eq!(topics["/events"]["last"]["at"], last.at.get() * 1000);
    assert_eq!(topics["/robot"]["last"]["arm"], 1.0);
}

/// FNV-1a, 64 bits.
fn mix(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3))
}

/// What reached the ticks, read by the page's words alone: the frames that were on the wires, with their times.
#[test]
fn python_finds_the_same_inputs() {
    let Some(python) = python() else { return };
    let folder = Scratch::new("inputs");
    let path = folder.join("run.mcap");
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let mut robot = rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    robot.record_inputs();
    let record = RecordWriter::new(&path, false, &heading(&robot, 4)).unwrap();
    let run = simulate_into(robot, 4, LENGTH, Some(record)).unwrap();
    let read = |path| {
        let printed = must_succeed(Command::new(python).arg(script("read_inputs.py")).arg(path));
        serde_json::from_str::<Value>(&printed).unwrap()
    };
    let found = read(&path);
    // The same as a chip's black box has it.
    let words = Inputs::read(&mut File::open(&path).unwrap()).unwrap().words;
    let (mut writer, mut memory) = ring();
    plain(&words).iter().for_each(|entry| writer.put(&mut memory, entry));
    let bytes: Vec<u8> = memory.iter().flat_map(|word| word.to_le_bytes()).collect();
    let packed = folder.join("packed.bin");
    fs::write(&packed, bytes).unwrap();
    assert!(read(&packed) == found, "the packed inputs are others");
    for (place, bus) in run.buses.iter().enumerate() {
        let found = &found[place.to_string()];
        // DJI's motors are commanded with these; all others are theirs.
        let is_theirs = |line: &&str| {
            let (id, _) = line.rsplit_once(' ').unwrap().1.split_once('#').unwrap();
            !["1FE", "1FF", "200", "2FE", "2FF"].contains(&id)
        };
        let heard: Vec<_> = bus.log.lines().filter(is_theirs).collect();
        let count = usize::try_from(found["frames"].as_u64().unwrap()).unwrap();
        // What came behind the last tick was not taken.
        assert!(count > 1000 && heard.len() - count < 20, "{count} of {}", heard.len());
        let times = found["times"].as_array().unwrap();
        let hash = heard[..count].iter().zip(times).fold(0, |hash, (line, began)| {
            let (at, frame) = (line.split_once(')').unwrap().0, line.rsplit_once(' ').unwrap().1);
            let at: f64 = at.trim_start_matches('(').parse().unwrap();
            // The log has the end of a frame, the port its begin.
            let took = (at * 1e6).round() - began.as_f64().unwrap();
            assert!((100.0..140.0).contains(&took), "{line}: {took}");
            let (id, data) = frame.split_once('#').unwrap();
            let key = u32::from_str_radix(id, 16).unwrap().to_le_bytes();
            let data = u64::from_str_radix(data, 16).unwrap().to_be_bytes();
            mix(mix(mix(hash, &key), &[8]), &data)
        });
        assert_eq!(found["hash"].as_u64(), Some(hash), "bus {}", place + 1);
        let [ticks, halves] = [u64::from(bus.last.ticks), found["halves"].as_u64().unwrap()];
        assert!((2 * ticks).abs_diff(halves) <= 1, "{ticks} {halves}");
        let given = found["given"].as_object().unwrap();
        assert!(given.len() > 2 && given.values().all(|it| it.as_object().unwrap().len() == 1));
    }
}
