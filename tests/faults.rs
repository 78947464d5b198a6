//! Every motor model in every fault, and in random sequences of faults.

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use rc10_cli::run::fault_bench::{Bench, Model, Trouble, models, on_bench};
use rc10_motor::{Condition, DriveMode};
use rc10_sim::Random;
use rc10_time::Micros;
use serde_json::Value;

fn rc10(arguments: &[&str]) -> (bool, String) {
    let program = env!("CARGO_BIN_EXE_rc10");
    let output = Command::new(program).arg("faults").args(arguments).output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    (output.status.success(), text.concat())
}

fn asked_for(variable: &str, usual: u64) -> u64 {
    std::env::var(variable).map_or(usual, |count| count.parse().unwrap())
}

/// The tables of a page, by the first cells of row and column.
fn tables(page: &str) -> BTreeMap<(String, String), String> {
    let mut cells = BTreeMap::new();
    let mut head: Vec<String> = Vec::new();
    for line in page.lines() {
        let Some(row) = line.strip_prefix("| ").and_then(|row| row.strip_suffix(" |")) else {
            if !line.starts_with("|---") {
                head.clear();
            }
            continue;
        };
        let row: Vec<_> = row.split(" | ").map(str::to_owned).collect();
        if head.is_empty() {
            head = row;
            continue;
        }
        for (title, cell) in head.iter().zip(&row).skip(1) {
            cells.insert((row[0].clone(), title.clone()), cell.clone());
        }
    }
    cells
}

/// `RC10_PHASES=200 cargo test -p rc10-tool --test all faults::` takes 200 phases of each.
#[test]
fn every_motor_keeps_every_bound_and_comes_back() {
    let phases = asked_for("RC10_PHASES", 1).to_string();
    let (is_fine, text) = rc10(&["--json", "--phases", &phases]);
    let measured: Value = serde_json::from_str(&text).unwrap();
    let rows = measured["faults"].as_array().unwrap();
    let mut worst: BTreeMap<&str, f64> = BTreeMap::new();
    let mut found: BTreeMap<&str, usize> = BTreeMap::new();
    for row in rows {
        let (fault, motor) = (row["fault"].as_str().unwrap(), row["motor"].as_str().unwrap());
        let about = || format!("{fault}, {motor}: {row}");
        *found.entry(fault).or_default() += 1;
        // A VESC reports 200 times a second; on RS-485 a motor has up to fourteen neighbours.
        let lost = match motor {
            _ if motor.starts_with("VESC") => 15.0,
            "GO-M8010-6, RS-485" => 20.0,
            _ => 10.0,
        };
        let is_starved = motor == "MF9025, multi-motor";
        // When the bus stops following the target, and when nothing drives the shaft, ms.
        let (ends, safe) = match fault {
            "emergency stop" => (2.0, 2.0),
            "tasks hang" | "targets are not numbers" => (51.0, 51.5),
            "remote lost" => (120.0, 120.0),
            "feedback lost" | "frames too short" => (lost + 1.0, lost + 1.5),
            _ if fault.ends_with("after 50 ms") && !is_starved => (52.0, 52.0),
            _ => (f64::MAX, f64::MAX),
        };
        for (name, most) in [("commands_end_ms", ends), ("safe_ms", safe)] {
            if most < f64::MAX {
                let time = row[name].as_f64();
                assert!(time.is_some_and(|time| time <= most), "{}", about());
                let worst = worst.entry(fault).or_default();
                *worst = worst.max(time.unwrap());
            }
        }
        if fault == "bus shorted" {
            let back = row["back_on_bus_ms"].as_f64();
            assert!(back.is_some_and(|back| back <= 2.0), "{}", about());
        }
        assert!(row["back_ms"].is_u64(), "{}", about());
        // What is wrong on one bus does not cost another one its tick.
        let is_of_a_bus = !fault.starts_with("buses' executor");
        assert!(
            !is_of_a_bus || row["others_gap_us"]["other_bus"].as_u64().unwrap() <= 1500,
            "{}",
            about()
        );
    }
    println!("worst of {phases} phases, ms: {worst:?}");
    assert!(is_fine, "a bound is broken");
    let all = models().len();
    assert_eq!((found.len(), found["emergency stop"], found["feedback lost"]), (31, all, all));
}

/// A question has its turn in every other tick: the command that switches it off goes first.
#[test]
fn an_lk_drive_is_switched_off_in_the_tick_that_finds_it_lost() {
    let (is_fine, text) =
        rc10(&["--motor", "mg4010", "--fault", "feedback lost", "--phases", "20"]);
    assert!(is_fine, "{text}");
}

/// The pages say what the command measured; here it is measured again, in fewer phases.
#[test]
fn the_tables_of_the_page_are_those_of_the_command() {
    let page = tables(&fs::read_to_string("docs/failures.md").unwrap());
    let (_, text) = rc10(&["--md", "--lang", "en"]);
    let measured = tables(&text);
    let number =
        |cell: &str| cell.split([' ', ';', '；']).next().and_then(|it| it.parse::<f64>().ok());
    for (at, cell) in &measured {
        let told = page.get(at).unwrap_or_else(|| panic!("the page has no {at:?}: {cell}"));
        match (number(cell), number(told)) {
            // Of more phases it is the worst, of the models that stopped in all of them.
            _ if told.contains("not all") => {}
            (Some(now), Some(told)) => assert!(now <= told + 0.1, "{at:?}: {now}, told {told}"),
            (Some(_), None) => assert!(told.contains("goes on"), "{at:?}: {cell}, told {told}"),
            (None, _) if at.1 == "bound" => assert_eq!(cell, told, "{at:?}"),
            // In other phases fewer are disturbed.
            (None, _) if at.1 == "others keep their tick" => {
                assert!(told == cell || told != "all", "{at:?}: {cell}, told {told}");
            }
            (None, _) if at.1 == "comes back" => {
                assert!(
                    told.contains(&**cell) || cell == "by itself",
                    "{at:?}: {cell}, told {told}"
                );
            }
            (None, _) => assert!(
                told.contains(&**cell) || told.contains("not all"),
                "{at:?}: {cell}, told {told}"
            ),
        }
    }
    // The Chinese page has the same numbers in the same order.
    let numbers = |page: &str| -> Vec<String> {
        let page = fs::read_to_string(page).unwrap();
        let rows = page.lines().filter(|line| line.starts_with("| ") && line.contains(" % | "));
        let cells = rows.flat_map(|row| row.split('|').map(str::to_owned).collect::<Vec<_>>());
        cells.filter_map(|cell| Some(format!("{}", number(cell.trim())?))).collect()
    };
    let english = numbers("docs/failures.md");
    assert!(english.len() > 100);
    assert_eq!(english, numbers("docs/failures.zh-CN.md"));
}

#[test]
fn wrong_arguments_are_told() {
    for (arguments, says) in [
        (["--motor", "M3509"], "there is no motor model `M3509`; there are: M3508, M2006"),
        (["--fault", "flood"], "there is no fault `flood`; there are: emergency stop"),
        (["--phases", "0"], "invalid value '0'"),
    ] {
        let (is_fine, text) = rc10(&arguments);
        assert!(!is_fine && text.contains(says), "{arguments:?}: {text}");
    }
}

const TROUBLES: [Trouble; 24] = [
    Trouble::Fault("mute:motor"),
    Trouble::Fault("cut:motor"),
    Trouble::Fault("power:motor"),
    Trouble::Fault("frozen:motor"),
    Trouble::Fault("flipped:motor"),
    Trouble::Fault("cut:*"),
    Trouble::Fault("power:*"),
    Trouble::Fault("noise:*"),
    Trouble::Fault("short:*"),
    Trouble::Fault("dominant:*"),
    Trouble::Fault("load:*"),
    Trouble::Fault("babble:*"),
    Trouble::Lost,
    Trouble::Short,
    Trouble::Foreign,
    Trouble::Double,
    Trouble::Reported,
    Trouble::Stop,
    Trouble::Disarm,
    Trouble::Hung,
    Trouble::NotANumber,
    Trouble::Blocked,
    Trouble::Jump,
    Trouble::RemoteLost,
];

/// Commands that a device has heard when it obeys, after others were lost, and questions among them.
const HEARD: u64 = 8;

/// The commands that the device had heard when the robot was stopped, and when its target was too old.
#[derive(Default)]
struct Since {
    stop: Option<u64>,
    old: Option<u64>,
}

impl Since {
    /// What must hold in every millisecond; the error if it does not.
    fn look(&mut self, bench: &Bench<'_>, is_blocked: bool) -> Result<(), String> {
        let (now, state, status) = (bench.world.now(), bench.twin.state(), bench.status());
        let rests = state.idle || state.open || state.shorted;
        if bench.seen.pushed > 0 {
            return Err("a torque on the wire after a stop".into());
        }
        let Some(stop) = bench.stopped_at else {
            self.stop = None;
            return self.look_at_age(bench, is_blocked);
        };
        let is_late = now.since(stop) > Micros::from_millis(2) && status.drive == DriveMode::Run;
        let heard = state.commands - *self.stop.get_or_insert(state.commands);
        if is_late || heard >= HEARD && !rests {
            return Err(format!("driven while stopped: {:?} {state:?}", status.drive));
        }
        self.look_at_age(bench, is_blocked)
    }

    fn look_at_age(&mut self, bench: &Bench<'_>, is_blocked: bool) -> Result<(), String> {
        let (state, status) = (bench.twin.state(), bench.status());
        let expired = bench.commanded_at + Micros::from_millis(52);
        if bench.world.now() <= expired || is_blocked {
            self.old = None;
            return Ok(());
        }
        let heard = state.commands - *self.old.get_or_insert(state.commands);
        let rests = state.idle || state.open || state.shorted;
        if status.drive == DriveMode::Run || heard >= HEARD && !rests {
            return Err(format!("an old target is followed: {:?} {state:?}", status.drive));
        }
        Ok(())
    }
}

/// Whether no bus can know what is right. Replies of an LK drive have the identifier of its commands: what another
/// node sends there commands it. An angle that is counted is lost by false ones. No `ODrive` tells its modes: one that
/// restarts while a second one answers for it is in modes of its own.
fn cannot_be_told_apart(model: &Model, trouble: Trouble) -> bool {
    let is_by_angle = matches!(model.target, rc10_motor::Target::TotalAngle(_));
    let is_lk = matches!(model.device, rc10_motor::Device::Lk(_));
    let is_false = matches!(trouble, Trouble::Foreign | Trouble::Double);
    let is_odrive = matches!(model.device, rc10_motor::Device::ODrive(_));
    is_false && (is_by_angle || is_lk) || is_odrive && trouble == Trouble::Double
}

/// A random sequence of faults, each while others last; then all is well.
fn play(model: &Model, seed: u64) -> Result<(), String> {
    let mut random = Random::new(seed);
    let (mut told, mut since) = (Vec::new(), Since::default());
    let outcome = on_bench(model, seed, |bench| {
        Ok((|| {
            bench.bring_back(4000).0.ok_or("it does not turn at first")?;
            bench.watch();
            let mut ends: Vec<(Micros, Trouble)> = Vec::new();
            for _ in 0..2 + random.below(5) {
                let trouble = TROUBLES[random.index(TROUBLES.len())];
                if cannot_be_told_apart(model, trouble) {
                    continue;
                }
                let until = bench.world.now() + Micros::new(1_000 + random.below(150_000));
                if ends.iter().any(|it| it.1 == trouble) || !bench.set(trouble, true) {
                    bench.set(trouble, false);
                    continue;
                }
                told.push(format!("{trouble:?} at {} until {until}", bench.world.now()));
                ends.push((until, trouble));
                let next = bench.world.now() + Micros::new(random.below(100_000));
                while bench.world.now() < next {
                    let blocked = ends.iter().any(|it| it.1 == Trouble::Blocked);
                    bench.wait(1);
                    since.look(bench, blocked)?;
                    let now = bench.world.now();
                    for (_, trouble) in ends.extract_if(.., |it| it.0 <= now) {
                        bench.set(trouble, false);
                    }
                }
            }
            bench.heal();
            bench.wait(2);
            told.push(format!("well at {}", bench.world.now()));
            let (back, _) = bench.bring_back(6000);
            since.look(bench, false)?;
            // An angle that is lost may be where a device has no number for; then it says so.
            let is_by_angle = matches!(model.target, rc10_motor::Target::TotalAngle(_));
            let status = bench.status();
            if back.is_none() && !(is_by_angle && status.condition == Condition::NotFollowing) {
                return Err(format!("it does not come back: {status:?}"));
            }
            bench.set(Trouble::Disarm, true);
            for _ in 0..60 {
                bench.wait(1);
                since.look(bench, false)?;
            }
            let state = bench.twin.state();
            let rests = state.idle || state.open || state.shorted;
            if rests { Ok(()) } else { Err(format!("disarmed it drives: {state:?}")) }
        })())
    });
    outcome.unwrap().map_err(|what: String| {
        format!("{}, sequence {seed}: {what}\n  {}", model.name, told.join("\n  "))
    })
}

/// Sequences that once left this motor pushing the wrong way for seconds. Of other models, or with other faults, a seed is
/// another sequence: then `RC10_SEQUENCES=100000` finds others.
const FOUND: [u64; 4] = [20_517, 23_493, 66_339, 72_658];
const FOUND_WITH: &str = "GM6020";

/// `RC10_SEQUENCES=100000 cargo test -p rc10-tool --test all faults::` takes so many.
#[test]
fn random_sequences_of_faults_leave_every_motor_safe_and_it_comes_back() {
    let (first, count) = (asked_for("RC10_SEQUENCE", 0), asked_for("RC10_SEQUENCES", 300));
    let models = models();
    let of = &|seed| &models[Random::new(seed).index(models.len())];
    assert!(FOUND.iter().all(|seed| of(*seed).name.contains(FOUND_WITH)));
    let wrong: Vec<_> = std::thread::scope(|scope| {
        let part = |part: u64| {
            scope.spawn(move || {
                let seeds = (first..first + count).chain(FOUND).filter(|seed| seed % 2 == part);
                let played = seeds.filter_map(|seed| play(of(seed), seed).err());
                played.take(10).collect::<Vec<_>>()
            })
        };
        let parts = [0, 1].map(part);
        parts.into_iter().flat_map(|part| part.join().unwrap()).collect()
    });
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}
