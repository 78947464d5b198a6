//! `rc10 faults`: what every motor model does in every fault, in many phases.

use std::io::Write;
use std::num::NonZero;
use std::sync::Mutex;
use std::{iter, thread};

use anyhow::{Context as _, Result, anyhow, ensure};
use clap::Args;
use rc10_motor::unitree::Rs485Bus;
use rc10_motor::{Safety, Wiring};
use rc10_sim::{Nanos, Random};
use serde_json::{Value, json};

use crate::lang::Language;
use crate::run::fault_bench::{Help, Model, Trouble, models, on_bench};
use crate::show::figures::{Entry as Cell, Table, words};

/// Arguments of `rc10 faults`.
#[derive(Args, Debug)]
pub struct FaultsArgs {
    /// Motor models whose name contains this
    #[arg(long, value_name = "NAME", default_value = "")]
    pub motor: String,
    /// Faults whose name contains this
    #[arg(long, value_name = "NAME", default_value = "")]
    pub fault: String,
    /// Phases of ticks, tasks, remote and devices in which each fault happens
    #[arg(long, value_name = "N", default_value_t = NonZero::<u64>::MIN)]
    pub phases: NonZero<u64>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
    /// Print tables in Markdown
    #[arg(long, conflicts_with = "json")]
    pub md: bool,
}

/// What has to be so in a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bound {
    /// The target is not followed any more after three periods of feedback, or 10 ms, and a tick; and no
    /// torque when that has come to the device.
    Feedback,
    /// The same after a command's expiry and a tick.
    Expired,
    /// No torque after this many milliseconds.
    Safe(u64),
    /// The controller goes back on its bus so many milliseconds after it was off it.
    Back(u64),
    /// Nothing is promised.
    Free,
}

/// A fault: its name, what goes wrong, and that later, for how many milliseconds.
struct Fault(&'static str, &'static [(Trouble, u64)], u64, Bound);

use Bound::{Back, Expired, Feedback, Free, Safe};
use Trouble::Fault as Wrong;

/// All of them.
#[rustfmt::skip]
const FAULTS: [Fault; 31] = [
    Fault("emergency stop", &[(Trouble::Stop, 0)], 100, Safe(2)),
    Fault("disarmed by the remote", &[(Trouble::Disarm, 0)], 100, Safe(27)),
    Fault("tasks hang", &[(Trouble::Hung, 0)], 100, Expired),
    Fault("targets are not numbers", &[(Trouble::NotANumber, 0)], 100, Expired),
    Fault("remote lost", &[(Trouble::RemoteLost, 0)], 200, Safe(120)),
    Fault("remote stuck, a PC stops after 50 ms", &[(Trouble::RemoteStuck, 0)], 150, Safe(52)),
    Fault("feedback lost", &[(Wrong("mute:motor"), 0)], 100, Feedback),
    Fault("motor unplugged from its bus", &[(Wrong("cut:motor"), 0)], 300, Free),
    Fault("brown-out of the motor", &[(Wrong("power:motor"), 0)], 100, Safe(1)),
    Fault("brown-out of the motor, 3 ms", &[(Wrong("power:motor"), 0)], 3, Safe(1)),
    Fault("brown-out of all motors", &[(Wrong("power:*"), 0)], 100, Safe(1)),
    Fault("device reports that it is too hot", &[(Trouble::Reported, 0)], 100, Free),
    Fault("bus unplugged from the board", &[(Wrong("cut:*"), 0)], 300, Free),
    Fault("bus shorted", &[(Wrong("short:*"), 0)], 300, Back(2)),
    Fault("bus held dominant", &[(Wrong("dominant:*"), 0)], 300, Free),
    Fault("another node babbles", &[(Wrong("babble:*"), 0)], 300, Free),
    Fault("bus filled to 99 %", &[(Wrong("load:*"), 0)], 100, Free),
    Fault("bus filled to 99 %, an emergency stop after 50 ms", &[(Wrong("load:*"), 0), (Trouble::Stop, 50)], 100, Free),
    Fault("one frame destroyed", &[(Wrong("noise:*"), 0)], 50, Free),
    Fault("one frame in three lost", &[(Trouble::Lost, 0)], 100, Free),
    Fault("frames too short", &[(Trouble::Short, 0)], 100, Feedback),
    Fault("foreign frames with its identifier", &[(Trouble::Foreign, 0)], 100, Free),
    Fault("two devices with its identifier", &[(Trouble::Double, 0)], 100, Free),
    Fault("encoder frozen", &[(Wrong("frozen:motor"), 0)], 300, Free),
    Fault("encoder frozen, a PC stops after 50 ms", &[(Wrong("frozen:motor"), 0), (Trouble::Stop, 50)], 100, Safe(52)),
    Fault("encoder flipped", &[(Wrong("flipped:motor"), 0)], 300, Free),
    Fault("encoder flipped, a PC stops after 50 ms", &[(Wrong("flipped:motor"), 0), (Trouble::Stop, 50)], 100, Safe(52)),
    Fault("buses' executor stands for 5 ms", &[(Trouble::Blocked, 0)], 5, Free),
    Fault("buses' executor stands for 100 ms", &[(Trouble::Blocked, 0)], 100, Free),
    Fault("clock jumps by 1 s", &[(Trouble::Jump, 0)], 100, Free),
    Fault("feedback lost, then the bus shorted", &[(Wrong("mute:motor"), 0), (Wrong("short:*"), 5)], 100, Free),
];

/// The worst of all phases of a fault for a motor model.
#[derive(Clone, Debug, Default)]
struct Worst {
    phases: u64,
    /// From the fault to when nothing drives the shaft any more; `None`: something still does at the end.
    safe: Option<u64>,
    /// From the fault to when the bus no longer follows the target; the same.
    ended: Option<u64>,
    /// The greatest current of all, and what the device can have at most, A.
    current: [f64; 2],
    speed: f64,
    gaps: [u64; 2],
    back_on_bus: Option<u64>,
    /// From the end of the fault to when it turns again; `None`: it never did.
    back: Option<u64>,
    help: Help,
    broken: bool,
}

/// One phase of a fault; `None` if the motor cannot have it.
fn phase(model: &Model, fault: &Fault, seed: u64) -> Result<Option<Worst>> {
    on_bench(model, seed, |bench| {
        let mut random = Random::new(seed.wrapping_mul(0xD134_2543_DE82_EF95));
        let began = bench.bring_back(LONGEST).0;
        ensure!(began.is_some(), "{}: it does not turn in {LONGEST} ms", model.name);
        bench.pass(bench.world.now_ns() + Nanos::new(random.below(20_000_000)));
        bench.watch();
        let at = bench.seen.since;
        for (trouble, after) in fault.1 {
            bench.pass(at + Nanos::new(after * 1_000_000));
            if !bench.set(*trouble, true) {
                return Ok(None);
            }
        }
        let end = at + Nanos::new(fault.2 * 1_000_000);
        bench.pass(end);
        let (seen, off) = (bench.seen.clone(), bench.off_for());
        // What stopped has stood still for a while; a dead time of two ticks is no rest.
        let until = |last: Option<Nanos>| {
            let last = last.unwrap_or(at);
            let is_over = end.get().saturating_sub(last.get()) >= 2_000_000;
            is_over.then(|| last.get().saturating_sub(at.get()) / 1000)
        };
        let (safe, ended) = (until(seen.drove), until(seen.ran));
        bench.heal();
        let (back, help) = bench.bring_back(LONGEST);
        let decided = match (fault.3, model.device.wiring()) {
            (Feedback, Wiring::Can(ids)) => Some(ids.link_timeout()),
            (Feedback, Wiring::Line(_)) => Some(Rs485Bus::LINK_TIMEOUT),
            (Expired, _) => Some(Safety::COAST.command_expiry),
            _ => None,
        };
        let decided = decided.map(|after| after.get() + TICK);
        let most = match fault.3 {
            Safe(millis) => Some(millis * 1000),
            _ => decided.map(|decided| decided + WAY),
        };
        let is_later = |time: Option<u64>, most: Option<u64>| {
            most.is_some_and(|most| time.is_none_or(|time| time > most))
        };
        let is_late = is_later(safe, most) || is_later(ended, decided);
        let is_off_too_long = match (fault.3, off) {
            (Back(most), Some(back)) => back.is_none_or(|back| back > most * 1000),
            _ => false,
        };
        Ok(Some(Worst {
            phases: 1,
            safe,
            ended,
            current: [seen.peak[0], bench.twin.plant().current_limit],
            speed: seen.peak[1],
            gaps: seen.gaps,
            back_on_bus: off.flatten(),
            back,
            help,
            broken: is_late || is_off_too_long || back.is_none(),
        }))
    })
}

/// A tick; and the way of its commands to the devices, which wait for frames before them, and a sample. In us.
const TICK: u64 = 1000;
const WAY: u64 = 500;
/// In this time a motor turns, ms.
const LONGEST: u64 = 4000;

impl Worst {
    /// With another phase.
    fn and(self, other: Self) -> Self {
        let both = |one: Option<u64>, other: Option<u64>| Some(one?.max(other?));
        Self {
            phases: self.phases + other.phases,
            safe: both(self.safe, other.safe),
            ended: both(self.ended, other.ended),
            current: [0, 1].map(|at| self.current[at].max(other.current[at])),
            speed: self.speed.max(other.speed),
            gaps: [0, 1].map(|at| self.gaps[at].max(other.gaps[at])),
            back_on_bus: self.back_on_bus.max(other.back_on_bus),
            back: both(self.back, other.back),
            help: Help {
                arms: self.help.arms || other.help.arms,
                clears: self.help.clears || other.help.clears,
            },
            broken: self.broken || other.broken,
        }
    }
}

/// Each fault with each motor model that can have it.
type Measured<'t> = Vec<(&'t Fault, &'t Model, Worst)>;

/// Tries all, on all cores.
fn measure<'t>(faults: &[&'t Fault], models: &[&'t Model], phases: u64) -> Result<Measured<'t>> {
    let pairs = faults.iter().flat_map(|fault| models.iter().map(move |model| (*fault, *model)));
    let (left, found) = (Mutex::new(pairs.enumerate()), Mutex::new(Vec::new()));
    let work = || -> Result<()> {
        loop {
            let next = left.lock().map_err(|_| anyhow!("a bench failed"))?.next();
            let Some((at, (fault, model))) = next else { return Ok(()) };
            let mut each = (0..phases).map(|seed| phase(model, fault, seed));
            let Some(Some(mut worst)) = each.next().transpose()? else { continue };
            for other in each {
                worst = worst.and(other?.context("not in all phases")?);
            }
            found.lock().map_err(|_| anyhow!("a bench failed"))?.push((at, (fault, model, worst)));
        }
    };
    thread::scope(|scope| {
        let cores = thread::available_parallelism().map_or(1, NonZero::get);
        let threads: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        threads.into_iter().try_for_each(|it| it.join().map_err(|_| anyhow!("a bench failed"))?)
    })?;
    let mut found = found.into_inner().map_err(|_| anyhow!("a bench failed"))?;
    found.sort_by_key(|(at, _)| *at);
    Ok(found.into_iter().map(|(_, found)| found).collect())
}

/// Prints what each motor does in each fault. Whether a bound was broken.
pub fn faults(args: &FaultsArgs, out: &mut dyn Write) -> Result<bool> {
    let has = |name: &str, part: &str| name.to_lowercase().contains(&part.to_lowercase());
    let all = models();
    let models: Vec<_> = all.iter().filter(|it| has(it.name, &args.motor)).collect();
    let faults: Vec<_> = FAULTS.iter().filter(|it| has(it.0, &args.fault)).collect();
    let names = |names: Vec<&str>| names.join(", ");
    ensure!(
        !models.is_empty(),
        "there is no motor model `{}`; there are: {}",
        args.motor,
        names(all.iter().map(|it| it.name).collect())
    );
    ensure!(
        !faults.is_empty(),
        "there is no fault `{}`; there are: {}",
        args.fault,
        names(FAULTS.iter().map(|it| it.0).collect())
    );
    let measured = measure(&faults, &models, args.phases.get())?;
    let is_broken = measured.iter().any(|(.., worst)| worst.broken);
    if args.json {
        let rows: Vec<_> = measured.iter().map(to_json).collect();
        writeln!(out, "{}", json!({ "phases": args.phases, "faults": rows }))?;
        return Ok(is_broken);
    }
    let language = Language::asked().unwrap_or_else(Language::of_environment);
    let tables = [summary(&faults, &measured), each_motor(&faults, &models, &measured)];
    for mut table in tables {
        for cell in table.rows.iter_mut().flatten() {
            cell.text = language.say(&cell.text);
        }
        let text = if args.md { markdown(&table, language) } else { table.text() };
        writeln!(out, "{text}")?;
    }
    Ok(is_broken)
}

fn markdown(table: &Table, language: Language) -> String {
    let line = |cells: Vec<&str>| format!("| {} |\n", cells.join(" | "));
    let head: Vec<_> = table.head.iter().map(|title| language.say(title)).collect();
    let rows = table.rows.iter().map(|row| line(row.iter().map(|it| &*it.text).collect()));
    line(head.iter().map(String::as_str).collect())
        + &"|---".repeat(head.len())
        + "|\n"
        + &rows.collect::<String>()
}

fn millis(us: u64) -> String {
    format!("{:.1}", us.div_ceil(100) as f64 / 10.0)
}

/// A line a fault: the worst of all motors.
fn summary(faults: &[&'static Fault], measured: &Measured<'_>) -> Table {
    let row = |fault: &&Fault| {
        let of: Vec<_> = measured.iter().filter(|it| it.0.0 == fault.0).collect();
        if of.is_empty() {
            return iter::once(words(fault.0)).chain((1..9).map(|_| words("–"))).collect();
        }
        let time = |of: &dyn Fn(&Worst) -> Option<u64>, all: &[&(&Fault, &Model, Worst)]| {
            let worst = all.iter().filter_map(|it| of(&it.2)).max();
            match (worst, all.iter().all(|it| of(&it.2).is_some())) {
                (Some(worst), true) => millis(worst),
                (Some(worst), false) => format!("{}; not all", millis(worst)),
                (None, _) => "goes on".to_owned(),
            }
        };
        let share = |of: &dyn Fn(&Worst, &Model) -> f64, all: &[&(&Fault, &Model, Worst)]| {
            let shares = all.iter().map(|it| of(&it.2, it.1));
            words(format!("{:.0} %", 100.0 * shares.fold(0.0, f64::max)))
        };
        let bound = match fault.3 {
            Feedback => "3 periods or 10 ms, + a tick".to_owned(),
            Expired => "50 ms + a tick".to_owned(),
            Safe(millis) => format!("{millis} ms"),
            Back(millis) => format!("{millis} ms, back on the bus"),
            Free => "–".to_owned(),
        };
        let kept = |at: usize| of.iter().all(|it| it.2.gaps[at] <= ON_TIME);
        let others = match [kept(0), kept(1)] {
            [true, true] => "all",
            [false, true] => "on other buses",
            _ => "none",
        };
        let (arms, clears) =
            (of.iter().any(|it| it.2.help.arms), of.iter().any(|it| it.2.help.clears));
        let by = match (arms, clears) {
            (false, false) => "by itself",
            (true, false) => "by arming",
            (false, true) => "after ClearFault",
            (true, true) => "after ClearFault, by arming",
        };
        vec![
            words(fault.0),
            Cell { bad: of.iter().any(|it| it.2.broken), ..words(time(&|it| it.safe, &of)) },
            words(bound),
            words(time(&|it| it.ended, &of)),
            share(&|worst, _| worst.current[0] / worst.current[1], &of),
            share(&|worst, model| worst.speed / model.cruise, &of),
            words(others),
            words(by),
            words(time(&|it| it.back.map(|back| back * 1000), &of)),
        ]
    };
    let head = vec![
        "what goes wrong",
        "no torque after ms",
        "bound",
        "commands end after ms",
        "greatest current",
        "greatest speed",
        "others keep their tick",
        "comes back",
        "within ms",
    ];
    Table { head, words: 1, rows: faults.iter().map(row).collect() }
}

/// The longest time between two commands of a tick that is kept, us: they wait for feedback.
const ON_TIME: u64 = 1500;

/// A line a motor model: in each fault the time to no torque, of those in which models differ.
fn each_motor(faults: &[&'static Fault], models: &[&Model], measured: &Measured<'_>) -> Table {
    let shown: Vec<_> =
        faults.iter().filter(|it| it.3 == Feedback || DIFFER.contains(&it.0)).collect();
    let row = |model: &&Model| {
        let cell = |fault: &&&Fault| {
            let it = measured.iter().find(|it| it.0.0 == fault.0 && it.1.name == model.name);
            let Some((.., worst)) = it else { return words("–") };
            let text = worst.safe.map_or_else(|| "goes on".to_owned(), millis);
            Cell { bad: worst.broken, ..words(text) }
        };
        iter::once(words(model.name)).chain(shown.iter().map(cell)).collect()
    };
    let head = iter::once("no torque after ms").chain(shown.iter().map(|it| it.0)).collect();
    Table { head, words: 1, rows: models.iter().map(row).collect() }
}

/// Faults in which models differ.
const DIFFER: [&str; 9] = [
    "emergency stop",
    "motor unplugged from its bus",
    "device reports that it is too hot",
    "bus unplugged from the board",
    "bus filled to 99 %, an emergency stop after 50 ms",
    "bus shorted",
    "bus held dominant",
    "another node babbles",
    "buses' executor stands for 100 ms",
];

fn to_json((fault, model, worst): &(&Fault, &Model, Worst)) -> Value {
    let ms = |us: Option<u64>| us.map(|us| us as f64 / 1000.0);
    json!({
        "fault": fault.0,
        "motor": model.name,
        "phases": worst.phases,
        "safe_ms": ms(worst.safe),
        "commands_end_ms": ms(worst.ended),
        "current_a": worst.current[0],
        "most_current_a": worst.current[1],
        "speed_rpm": worst.speed,
        "cruise_rpm": model.cruise,
        "others_gap_us": { "same_bus": worst.gaps[0], "other_bus": worst.gaps[1] },
        "back_on_bus_ms": ms(worst.back_on_bus),
        "back_ms": worst.back,
        "arming": worst.help.arms,
        "clear_fault": worst.help.clears,
        "broken": worst.broken,
    })
}
