//! Runs a file of protocol vectors: `RC10_VECTORS=FILE cargo test --test vectors`, or without the
//! variable `tests/vectors/public.json`.
//!
//! Of the protocols that exist, every vector runs: a wrong result fails, and so does a kind or a
//! field this runner does not know. Only vectors of protocols that do not exist yet are skipped.
//! One line per protocol says so; to print it, the test has no harness but its own.

#[path = "vectors/cybergear.rs"]
mod cybergear;
#[path = "vectors/damiao.rs"]
mod damiao;
#[path = "vectors/dji.rs"]
mod dji;
#[path = "vectors/fields.rs"]
mod fields;
#[path = "vectors/led.rs"]
mod led;
#[path = "vectors/lk.rs"]
mod lk;
#[path = "vectors/modules.rs"]
mod modules;
#[path = "vectors/odrive.rs"]
mod odrive;
#[path = "vectors/remotes.rs"]
mod remotes;
#[path = "vectors/self_test.rs"]
mod self_test;
#[path = "vectors/streams.rs"]
mod streams;
#[path = "vectors/unitree.rs"]
mod unitree;
#[path = "vectors/vesc.rs"]
mod vesc;
#[path = "vectors/wire.rs"]
mod wire;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use fields::{Check, Fields, Tolerance};
use serde_json::Value;

/// A vector that was run, or not.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Ran {
    Yes,
    /// There is no code for its protocol yet.
    No,
}

/// Runs one vector; what remains of `vector` afterwards was not looked at.
fn run(vector: Value) -> Check<Ran> {
    let mut vector = Fields::of("vector", vector)?;
    let protocol = vector.text("protocol")?;
    let kind = vector.text("kind")?;
    vector.ignore(&["id", "note", "source", "reason", "optional"]);
    let mut tolerance = Tolerance::of(&mut vector)?;
    match protocol.as_str() {
        "dji" => dji::run(&kind, &mut vector, &mut tolerance)?,
        "vesc" => vesc::run(&kind, &mut vector, &mut tolerance)?,
        "unitree_go" => unitree::line(&kind, &mut vector, &mut tolerance)?,
        "unitree_can" => unitree::module(&kind, &mut vector, &mut tolerance)?,
        "damiao" => damiao::run(&kind, &mut vector, &mut tolerance)?,
        "cybergear" => cybergear::cybergear(&kind, &mut vector, &mut tolerance)?,
        "robstride" => cybergear::robstride(&kind, &mut vector, &mut tolerance)?,
        "lk" => lk::run(&kind, &mut vector, &mut tolerance)?,
        "odrive" => odrive::run(&kind, &mut vector, &mut tolerance)?,
        "tfmini" => modules::tfmini(&kind, &mut vector, &mut tolerance)?,
        "jrt_laser" => modules::jrt(&kind, &mut vector, &mut tolerance)?,
        "stp23l" => modules::stp23l(&kind, &mut vector, &mut tolerance)?,
        "wit_imu" => modules::wit(&kind, &mut vector, &mut tolerance)?,
        "action" => modules::action(&kind, &mut vector, &mut tolerance)?,
        "rc9" => modules::rc9(&kind, &mut vector, &mut tolerance)?,
        "can_bits" => wire::can_bits(&kind, &mut vector, &mut tolerance)?,
        "encoder" => wire::encoder(&kind, &mut vector, &mut tolerance)?,
        "dbus" => remotes::dbus(&kind, &mut vector, &mut tolerance)?,
        "sbus" => remotes::sbus(&kind, &mut vector, &mut tolerance)?,
        "crsf" => remotes::crsf(&kind, &mut vector, &mut tolerance)?,
        "vt03" => remotes::vt03(&kind, &mut vector, &mut tolerance)?,
        "ppm" => remotes::ppm(&kind, &mut vector, &mut tolerance)?,
        "ws2812" => led::ws2812(&kind, &mut vector, &mut tolerance)?,
        _ => return Ok(Ran::No),
    }
    tolerance.finish()?;
    vector.finish()?;
    Ok(Ran::Yes)
}

/// The vectors of a file.
fn vectors(text: &str) -> Check<Vec<Value>> {
    let file = serde_json::from_str(text).map_err(|error| format!("no JSON: {error}"))?;
    let mut file = Fields::of("file", file)?;
    file.ignore(&["meta"]);
    let vectors = file.list("vectors")?;
    file.finish()?;
    Ok(vectors)
}

/// Runs all vectors of a text and prints what became of them.
fn run_text(text: &str) -> Check {
    let mut counts: Vec<(String, [u32; 3])> = Vec::new();
    for vector in vectors(text)? {
        let name = |field| vector.get(field).and_then(Value::as_str).map(str::to_owned);
        let protocol = name("protocol").unwrap_or_else(|| "no protocol".into());
        let id = name("id").unwrap_or_else(|| "a vector without id".into());
        let index = counts.iter().position(|(known, _)| *known == protocol).unwrap_or_else(|| {
            counts.push((protocol, [0; 3]));
            counts.len() - 1
        });
        let [ran, failed, skipped] = &mut counts[index].1;
        match run(vector) {
            Ok(Ran::Yes) => *ran += 1,
            Ok(Ran::No) => *skipped += 1,
            Err(error) => {
                *ran += 1;
                *failed += 1;
                println!("FAILED {id}: {error}");
            }
        }
    }
    for (protocol, [ran, failed, skipped]) in &counts {
        println!("{protocol}: ran {ran}, failed {failed}, skipped {skipped}");
    }
    let sum = |index: usize| counts.iter().map(|(_, counts)| counts[index]).sum::<u32>();
    match (sum(0), sum(1)) {
        (0, _) => Err("no vector of a protocol that exists".into()),
        (_, 0) => Ok(()),
        (ran, failed) => Err(format!("{failed} of {ran} vectors failed")),
    }
}

const PUBLIC: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/vectors/public.json");

fn read(path: PathBuf) -> Check<String> {
    std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
}

fn vector_file() -> Check {
    let path = std::env::var_os("RC10_VECTORS").map_or_else(|| PUBLIC.into(), PathBuf::from);
    println!("vectors of {}", path.display());
    run_text(&read(path)?)
}

type Test = (&'static str, fn() -> Check);

const TESTS: [Test; 5] = [
    ("vector_file", vector_file),
    ("self_test::every_expectation_counts", self_test::every_expectation_counts),
    ("self_test::nothing_unknown_is_skipped", self_test::nothing_unknown_is_skipped),
    ("self_test::tolerances_are_kept", self_test::tolerances_are_kept),
    ("self_test::a_useless_file_fails", self_test::a_useless_file_fails),
];

/// The usual test arguments that are understood: names, `--exact`, `--skip`, `--ignored`,
/// `--list`. The rest changes nothing here.
#[derive(Default)]
struct Arguments {
    names: Vec<String>,
    skip: Vec<String>,
    exact: bool,
    ignored: bool,
    list: bool,
}

impl Arguments {
    fn read(mut given: impl Iterator<Item = String>) -> Self {
        let mut arguments = Self::default();
        while let Some(argument) = given.next() {
            match argument.as_str() {
                "--exact" => arguments.exact = true,
                "--ignored" => arguments.ignored = true,
                "--list" => arguments.list = true,
                "--skip" => arguments.skip.extend(given.next()),
                "--test-threads" | "--format" | "--color" | "--logfile" | "--shuffle-seed"
                | "-Z" => drop(given.next()),
                flag if flag.starts_with('-') => {}
                name => arguments.names.push(name.into()),
            }
        }
        arguments
    }

    fn selects(&self, name: &str) -> bool {
        let among = |list: &[String]| {
            list.iter().any(|part| if self.exact { name == part } else { name.contains(part) })
        };
        !self.ignored && (self.names.is_empty() || among(&self.names)) && !among(&self.skip)
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::read(std::env::args().skip(1));
    let selected: Vec<_> = TESTS.iter().filter(|(name, _)| arguments.selects(name)).collect();
    if arguments.list {
        selected.iter().for_each(|(name, _)| println!("{name}: test"));
        return ExitCode::SUCCESS;
    }
    let start = Instant::now();
    println!("\nrunning {} tests", selected.len());
    let mut failed = 0;
    for (name, test) in &selected {
        match test() {
            Ok(()) => println!("test {name} ... ok"),
            Err(error) => {
                failed += 1;
                println!("test {name} ... FAILED: {error}");
            }
        }
    }
    println!(
        "\ntest result: {}. {} passed; {failed} failed; 0 ignored; 0 measured; {} filtered out; \
         finished in {:.2}s\n",
        if failed == 0 { "ok" } else { "FAILED" },
        selected.len() - failed,
        TESTS.len() - selected.len(),
        start.elapsed().as_secs_f32()
    );
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::from(101) }
}
