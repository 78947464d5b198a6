//! Hours of good runs in which nothing may be found: all shipped robots, with every receiver, any seed, and
//! loads that are up to a tenth off.

use std::fmt;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use rc10_cli::Receiver;
use rc10_cli::judge::doctor::causes;
use rc10_cli::robot::mistake::{Mistake, Quantity};
use rc10_cli::run::simulate::simulate;
use rc10_cli::world::robot::Robot;

use super::*;

/// The packages of the robots.
pub(super) const ROBOTS: [&str; 6] = ["team", "lift", "mixed", "omni", "starter", "swerve"];

/// Sets a robot up and hands it over.
pub(super) fn with_robot<T>(package: &str, work: impl FnOnce(Robot<'_>) -> T) -> T {
    macro_rules! shipped {
        ($robot:ident) => {{
            let ports = $robot::Ports::new();
            let (shared, mut motors) = ($robot::Shared::new(&ports), $robot::Motors::new());
            work(rc10_cli::robot_of::<$robot::Robot>(&shared, &mut motors).unwrap())
        }};
    }
    match package {
        "lift" => shipped!(lift),
        "mixed" => shipped!(mixed),
        "omni" => shipped!(omni),
        "starter" => shipped!(starter),
        "swerve" => shipped!(swerve),
        _ => shipped!(team),
    }
}

/// A run.
struct Good {
    package: &'static str,
    seconds: u64,
    seed: u64,
    receiver: Receiver,
    loads: Vec<Mistake>,
}

impl fmt::Display for Good {
    /// The command that repeats it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { package, seconds, seed, receiver, loads } = self;
        write!(f, "cargo run --package {package} -- run --strict --no-logs")?;
        write!(f, " --seconds {seconds} --seed {seed} --remote {receiver}")?;
        loads.iter().try_for_each(|load| write!(f, " --mistake '{load}'"))
    }
}

impl Good {
    /// The run of a number: every third is as described, of the others one kind of motor is not.
    fn new(number: u64) -> Self {
        // `SplitMix64`.
        let mut state = number.wrapping_mul(0xD134_2543_DE82_EF95);
        let mut below = |end: usize| {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mixed = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
            usize::try_from((mixed ^ mixed >> 31) % end as u64).unwrap()
        };
        let package = ROBOTS[below(ROBOTS.len())];
        let kinds: Vec<_> = with_robot(package, |robot| {
            let motors = robot.description().motors.iter();
            motors.map(|motor| motor.label.split(' ').next().unwrap().to_owned()).collect()
        });
        let kind = &kinds[below(kinds.len())];
        let mut off = |quantity| {
            let thousandths = 900 + u16::try_from(below(201)).unwrap();
            Mistake::Shaft(quantity, kind.clone(), f64::from(thousandths) / 1000.0)
        };
        let loads = [Quantity::Inertia, Quantity::Friction, Quantity::Torque].map(&mut off);
        let loads = if number.is_multiple_of(3) { Vec::new() } else { loads.into() };
        let seconds = [3, 10, 10, 30, 60, 120][below(6)];
        let seed = below(1 << 32) as u64;
        let receiver = Receiver::ALL[below(Receiver::ALL.len())];
        Self { package, seconds, seed, receiver, loads }
    }

    /// The problems that are found in the run.
    fn problems(&self) -> String {
        with_robot(self.package, |mut robot| {
            robot.set_no_logs(true);
            robot.set_remote(self.receiver).unwrap();
            robot.set_mistakes(&self.loads).unwrap();
            let time = Micros::from_millis(1000 * self.seconds);
            let recording = simulate(robot, self.seed, time).unwrap();
            let causes = causes(&recording).into_iter().map(|it| it.problem.headline());
            [problems(&recording)].into_iter().filter(|it| !it.is_empty()).chain(causes).collect()
        })
    }
}

/// `RC10_HOURS=100 cargo test -p rc10-tool --test all -- hours --ignored --nocapture`; a part of them
/// by `RC10_HOURS=25..50`.
#[test]
#[ignore = "takes hours"]
fn nothing_is_found_in_hours_of_good_runs() {
    let hours = std::env::var("RC10_HOURS").unwrap_or_else(|_| "0.2".into());
    let (from, to) = hours.split_once("..").unwrap_or(("0", &hours));
    let [from, to] = [from, to].map(|hours| 3600.0 * hours.parse::<f64>().unwrap());
    let mut at = 0.0;
    let begins = (0..).map(Good::new).map(|run| {
        at += run.seconds as f64;
        (at - run.seconds as f64, run)
    });
    let wanted = begins.take_while(|(at, _)| *at < to).filter(|(at, _)| *at >= from);
    let runs: Vec<_> = wanted.map(|(_, run)| run).collect();
    let (next, found) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(run) = runs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let problems = run.problems();
                    if !problems.is_empty() {
                        println!("{run}\n{problems}");
                        found.lock().unwrap().push(format!("{run}\n{problems}"));
                    }
                }
            });
        }
    });
    println!("{hours} hours, {} runs", runs.len());
    let found = found.into_inner().unwrap();
    assert!(found.is_empty(), "in {} of {} runs:\n{}", found.len(), runs.len(), found.join("\n"));
}
