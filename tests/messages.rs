//! `docs/messages.md`: its code is that of this file, which runs it; its table is the robot's `Shared`.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use embassy_time::Timer;
use rc10_app::Rpm;
use rc10_cli::world::environment::Environment;
use rc10_message::{Latest, Service, Topic, now};
use rc10_module::ranging::Range;
use rc10_motor::{Request, Target};
use rc10_time::Micros;
use team::{Motors, Name, Shared};

const PAGE: &str = include_str!("../docs/messages.md");
const ROBOT: &str = include_str!("../examples/team/src/robot.rs");
const COMMON: &str = include_str!("../crates/rc10-tasks/src/common.rs");

/// Strength of each bump, in g. Four wait for the slowest of two readers.
static BUMPS: Topic<f32, 4, 2> = Topic::new();
/// Distance of the wall.
static WALL: Latest<Range, 1> = Latest::new();
/// Turn to an angle in degrees; the response is the angle reached.
static TURN: Service<u16, Result<u16, &'static str>> = Service::new();

async fn write() {
    BUMPS.publish(3.2);
    WALL.set(Range::Distance(1230), now());
}

async fn listen() -> Result<(), rc10_message::SubscribersFull> {
    let mut bumps = BUMPS.subscribe()?;
    bumps
        .for_each(async |bump| {
            if bump.missed > 0 {
                println!("{} bumps came too fast", bump.missed);
            }
            println!("{} g", bump.value);
        })
        .await;
}

async fn look() {
    match WALL.newer_than(Micros::from_millis(50), now()) {
        Some(Range::Distance(millimetres)) => println!("{millimetres} mm"),
        // Out of reach, in doubt, unplugged: no wall to rely on.
        _ => println!("stop"),
    }
}

async fn serve() -> Result<(), rc10_message::AlreadyServed> {
    let mut server = TURN.server()?;
    server.serve(async |angle| if angle < 360 { Ok(angle) } else { Err("more than a turn") }).await;
}

async fn call() {
    match TURN.call(90, Micros::from_millis(500)).await {
        Ok(Ok(angle)) => println!("at {angle} degrees"),
        Ok(Err(why)) => println!("refused: {why}"),
        // There is no server, it was too slow, or it dropped the request: the error says which.
        Err(error) => println!("{error}"),
    }
}

async fn turn_a_wheel(shared: &Shared<'_>) -> Result<(), rc10_motor::TargetError> {
    let wheel = shared.motor(Name::WheelFrontLeft);
    wheel.command(Target::Speed(Rpm::new(60.0)))?;
    let outcome = wheel.request(Request::ClearFault).await;
    println!("{outcome:?}, and it turns at {}", wheel.status().feedback.speed.get());
    Ok(())
}

#[test]
fn the_code_of_the_page_runs() {
    let (ports, ended) = (team::Ports::new(), Cell::new(false));
    let shared = &Shared::new(&ports);
    let mut motors = Motors::new();
    let robot = rc10_cli::robot_of::<team::Robot>(shared, &mut motors).unwrap();
    let mut around = Environment::new(robot.description(), 1).unwrap();
    let mut tasks = robot.tasks(&around).unwrap();
    tasks.add(async { listen().await.unwrap() });
    tasks.add(async { serve().await.unwrap() });
    tasks.add(async {
        // Those that listen and serve have begun, and the buses know their motors.
        Timer::after_millis(50).await;
        write().await;
        look().await;
        call().await;
        turn_a_wheel(shared).await.unwrap();
        ended.set(true);
    });
    around.run(&mut tasks, Micros::from_millis(200));
    assert!(ended.get());
    assert_eq!(TURN.calls().answered, 1);
}

/// Lines without their indentation and their breaks: a page may show a part of a function.
fn flat(code: &str) -> String {
    code.split_whitespace().collect()
}

#[test]
fn every_block_of_the_page_stands_in_this_file() {
    let own = flat(include_str!("messages.rs"));
    let blocks: Vec<_> =
        PAGE.split("```rust\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert!(blocks.len() >= 7, "{}", blocks.len());
    for block in blocks {
        assert!(own.contains(&flat(block)), "not in tests/messages.rs:\n{block}");
    }
}

/// The sources of a crate's tasks, by the names of their files.
fn sources(folder: &str) -> BTreeMap<String, String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut sources = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "rs") {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            sources.insert(name, fs::read_to_string(path).unwrap());
        }
    }
    sources
}

/// The tasks that a cell of the table names.
fn tasks_of(cell: &str, all: &BTreeMap<String, String>) -> BTreeSet<String> {
    cell.split('`').filter(|name| all.contains_key(*name)).map(str::to_owned).collect()
}

#[test]
fn the_table_is_that_of_the_robot() {
    let (_, table) = PAGE.split_once("## This robot").unwrap();
    let (table, _) = table.split_once("Behind `ports`").unwrap();
    let rows = table.lines().filter(|line| line.starts_with("| `"));
    let rows: Vec<Vec<&str>> =
        rows.map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect();

    let fields_of = |source: &'static str, name: &str| {
        let (_, fields) = source.split_once(&format!("pub struct {name}<'p")).unwrap();
        let (fields, _) = fields.split_once("\n}").unwrap();
        fields.lines().filter_map(|line| line.trim().strip_prefix("pub "))
    };
    let (_, own) = ROBOT.split_once("        fields {\n").unwrap();
    let own = own.split_once("\n        }").unwrap().0.lines().map(str::trim);
    let own = own.filter(|line| !line.starts_with("//")).map(|line| format!("own.{line}"));
    let fields: Vec<_> = fields_of(COMMON, "Common").map(str::to_owned).chain(own).collect();
    let fields: Vec<_> = fields
        .iter()
        .map(|line| line.trim_end_matches([',', ';']).split_once(": ").unwrap())
        .collect();
    assert!(fields.len() >= 10, "{fields:?}");

    let told: Vec<_> =
        rows.iter().map(|row| (row[0].trim_matches('`'), row[1].trim_matches('`'))).collect();
    assert_eq!(
        told, fields,
        "the fields of `Common`, and of its own, in their order, with their types"
    );

    let mut tasks = sources("examples/team/src");
    tasks.extend(sources("crates/rc10-tasks/src"));
    // Of two boards this robot has one.
    for no_task in ["lib", "robot", "table", "common", "program", "boards"] {
        tasks.remove(no_task).unwrap();
    }
    // What `Common::obey` does, its caller does.
    let (_, obey) = COMMON.split_once("pub fn obey").unwrap();
    let obey = obey.split_once("\n    }").unwrap().0.replace("self.", "shared.");
    tasks.values_mut().filter(|code| code.contains("shared.obey(")).for_each(|code| *code += &obey);
    for row in &rows {
        let [field, kind, written, read, _] = row[..] else { panic!("other columns: {row:?}") };
        let field = field.trim_matches('`');
        let mentions = |code: &str, what: &str| {
            let what = format!("shared.{what}");
            code.match_indices(&what).any(|(at, _)| {
                let next = code[at + what.len()..].chars().next();
                next.is_none_or(|next| !next.is_alphanumeric() && next != '_')
            })
        };
        let using = tasks.iter().filter(|(_, code)| {
            mentions(code, field) || field == "ports" && mentions(code, "motor")
        });
        let using: BTreeSet<_> = using.map(|(name, _)| name.clone()).collect();
        let writing = tasks_of(written, &tasks);
        let named = &writing | &tasks_of(read, &tasks);
        assert_eq!(named, using, "the tasks that use `{field}`");
        if kind.starts_with("`Latest") || kind.starts_with("`Topic") {
            let verbs = [format!("{field}.set"), format!("{field}.publish")];
            // What `live` hands on to the keeping.
            let verbs = if field == "kept_state" {
                [format!("{field},"), String::from("-")]
            } else {
                verbs
            };
            let setting =
                tasks.iter().filter(|(_, code)| verbs.iter().any(|verb| mentions(code, verb)));
            let setting: BTreeSet<_> = setting.map(|(name, _)| name.clone()).collect();
            assert_eq!(writing, setting, "the tasks that write `{field}`");
        }
    }
}

/// "100 ms (`OLDEST_MOTION`)" is what that constant says.
#[test]
fn ages_are_those_of_the_code() {
    let folders = [
        "examples/team/src",
        "crates/rc10-tasks/src",
        "crates/rc10-module/src/remote",
        "crates/rc10-module/src/imu",
    ];
    let code: String = folders.into_iter().flat_map(sources).map(|(_, code)| code).collect();
    let mut checked = 0;
    for (at, _) in PAGE.match_indices(" ms (`") {
        let number = PAGE[..at].rsplit(' ').next().unwrap();
        let name = PAGE[at..].split('`').nth(1).unwrap();
        let line = format!("const {name}: Micros = Micros::from_millis({number});");
        assert!(code.contains(&line), "the code has no `{line}`");
        checked += 1;
    }
    assert!(checked >= 6, "{checked}");
}
