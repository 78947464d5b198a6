//! `rc10 faults`: what every motor model does in every fault, in many phases.

use std::io::Write;
use std::num::NonZero;
use std::{iter, thread};

use anyhow::{Result, anyhow, ensure};
use clap::Args;
use rc10_motor::unitree::Rs485Bus;
use rc10_motor::{Device, Safety, Wiring};
use rc10_sim::{Nanos, Random};
use rc10_time::Micros;
use serde_json::{Value, json};

use crate::lang::Language;
use crate::run::fault_bench::{Model, Seen, Trouble, models, on_bench};
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
    #[arg(long, value_name = "N", default_value_t = NonZero::<u64>::MIN, value_parser = phases)]
    pub phases: NonZero<u64>,
    /// Print one JSON object instead of tables
    #[arg(long)]
    pub json: bool,
    /// Print tables in Markdown
    #[arg(long, conflicts_with = "json")]
    pub md: bool,
}

fn phases(text: &str) -> Result<NonZero<u64>, &'static str> {
    text.parse().map_err(|_| "must be a whole number, 1 or more")
}

/// What has to be so in a fault.
#[derive(Clone, Copy)]
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

/// A fault: its name, what goes wrong, and that later, for how many milliseconds; whether motor models differ in it.
struct Fault(&'static str, &'static [(Trouble, u64)], u64, Bound, bool);

use Bound::{Back, Expired, Feedback, Free, Safe};
use Trouble::Fault as Wrong;

/// All of them.
#[rustfmt::skip]
const FAULTS: [Fault; 31] = [
    Fault("emergency stop", &[(Trouble::Stop, 0)], 100, Safe(2), true),
    Fault("disarmed by the remote", &[(Trouble::Disarm, 0)], 100, Safe(27), false),
    Fault("tasks hang", &[(Trouble::Hung, 0)], 100, Expired, false),
    Fault("targets are not numbers", &[(Trouble::NotANumber, 0)], 100, Expired, false),
    Fault("remote lost", &[(Trouble::RemoteLost, 0)], 200, Safe(120), false),
    Fault("remote stuck, a PC stops after 50 ms", &[(Trouble::Stop, 50)], 150, Safe(52), false),
    Fault("feedback lost", &[(Wrong("mute:motor"), 0)], 100, Feedback, true),
    Fault("motor unplugged from its bus", &[(Wrong("cut:motor"), 0)], 300, Free, true),
    Fault("brown-out of the motor", &[(Wrong("power:motor"), 0)], 100, Safe(1), false),
    Fault("brown-out of the motor, 3 ms", &[(Wrong("power:motor"), 0)], 3, Safe(1), false),
    Fault("brown-out of all motors", &[(Wrong("power:*"), 0)], 100, Safe(1), false),
    Fault("device reports that it is too hot", &[(Trouble::Reported, 0)], 100, Free, true),
    Fault("bus unplugged from the board", &[(Wrong("cut:*"), 0)], 300, Free, true),
    Fault("bus shorted", &[(Wrong("short:*"), 0)], 300, Back(2), true),
    Fault("bus held dominant", &[(Wrong("dominant:*"), 0)], 300, Free, true),
    Fault("another node babbles", &[(Wrong("babble:*"), 0)], 300, Free, true),
    Fault("bus filled to 99 %", &[(Wrong("load:*"), 0)], 100, Free, false),
    Fault("bus filled to 99 %, an emergency stop after 50 ms", &[(Wrong("load:*"), 0), (Trouble::Stop, 50)], 100, Free, true),
    Fault("one frame destroyed", &[(Wrong("noise:*"), 0)], 50, Free, false),
    Fault("one frame in three lost", &[(Trouble::Lost, 0)], 100, Free, false),
    Fault("frames too short", &[(Trouble::Short, 0)], 100, Feedback, true),
    Fault("foreign frames with its identifier", &[(Trouble::Foreign, 0)], 100, Free, false),
    Fault("two devices with its identifier", &[(Trouble::Double, 0)], 100, Free, false),
    Fault("encoder frozen", &[(Wrong("frozen:motor"), 0)], 300, Free, false),
    Fault("encoder frozen, a PC stops after 50 ms", &[(Wrong("frozen:motor"), 0), (Trouble::Stop, 50)], 100, Safe(52), false),
    Fault("encoder flipped", &[(Wrong("flipped:motor"), 0)], 300, Free, false),
    Fault("encoder flipped, a PC stops after 50 ms", &[(Wrong("flipped:motor"), 0), (Trouble::Stop, 50)], 100, Safe(52), false),
    Fault("buses' executor stands for 5 ms", &[(Trouble::Blocked, 0)], 5, Free, false),
    Fault("buses' executor stands for 100 ms", &[(Trouble::Blocked, 0)], 100, Free, true),
    Fault("clock jumps by 1 s", &[(Trouble::Jump, 0)], 100, Free, false),
    Fault("feedback lost, then the bus shorted", &[(Wrong("mute:motor"), 0), (Wrong("short:*"), 5)], 100, Free, false),
];

/// A tick; and the way of its commands to the devices, which wait for frames before them, and a sample. In us.
const TICK: u64 = 1000;
const WAY: u64 = 500;
/// In this time a motor turns, ms.
const LONGEST: u64 = 4000;
/// The longest time between two commands of a tick that is kept, us: they wait for feedback.
const ON_TIME: u64 = 1500;
/// A time of what does not come.
const NEVER: f64 = f64::INFINITY;

impl Bound {
    /// The longest time until a device has no torque, until its commands end, and off its bus, us.
    fn longest(self, device: &Device) -> [f64; 3] {
        let after = |time: Micros| [time.get() + TICK + WAY, time.get() + TICK].map(|it| it as f64);
        let [safe, ended] = match (self, device.wiring()) {
            (Feedback, Wiring::Can(ids)) => after(ids.link_timeout()),
            (Feedback, Wiring::Line(_)) => after(Rs485Bus::LINK_TIMEOUT),
            (Expired, _) => after(Safety::COAST.command_expiry),
            (Safe(millis), _) => [(millis * 1000) as f64, NEVER],
            (Back(_) | Free, _) => [NEVER; 2],
        };
        [safe, ended, if let Back(millis) = self { (millis * 1000) as f64 } else { NEVER }]
    }
}

/// What happened in one phase of a fault.
struct Phase {
    /// Until nothing drove the shaft any more; until the bus no longer followed the target; and off the bus, NaN if it
    /// was not: us.
    times: [f64; 3],
    seen: Seen,
    /// The greatest current that the device can have, A.
    limit: f64,
    /// From the end of the fault to when it turned again, us.
    back: f64,
    /// Whether it had to be armed for that, and its fault to be cleared.
    help: [bool; 2],
    broken: bool,
}

/// One phase of a fault; `None` if the motor cannot have it.
fn phase(fault: &Fault, model: &Model, seed: u64) -> Result<Option<Phase>> {
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
        let seen = bench.seen.clone();
        // What stopped has stood still for a while; a dead time of two ticks is no rest.
        let until = |last: Nanos| match end.get().saturating_sub(last.get()) {
            2_000_000.. => (last.get().saturating_sub(at.get()) / 1000) as f64,
            _ => NEVER,
        };
        let times = [until(seen.drove), until(seen.ran), bench.off_for()];
        bench.heal();
        let (back, help) = bench.bring_back(LONGEST);
        let longest = fault.3.longest(&model.device);
        let is_late = times.iter().zip(longest).any(|(time, longest)| *time > longest);
        Ok(Some(Phase {
            times,
            seen,
            limit: bench.twin.plant().current_limit,
            back: back.map_or(NEVER, |millis| (millis * 1000) as f64),
            help,
            broken: is_late || back.is_none(),
        }))
    })
}

/// A motor model in a fault, in every phase.
struct Measured<'t> {
    fault: &'t Fault,
    model: &'t Model,
    phases: Vec<Phase>,
}

impl Measured<'_> {
    /// The greatest number of all phases.
    fn most(&self, of: impl Fn(&Phase) -> f64) -> f64 {
        self.phases.iter().map(of).fold(f64::NAN, f64::max)
    }

    fn any(&self, of: impl Fn(&Phase) -> bool) -> bool {
        self.phases.iter().any(of)
    }

    fn to_json(&self) -> Value {
        let ms = |of: &dyn Fn(&Phase) -> f64| self.most(of) / 1e3;
        let gap = |at: usize| self.phases.iter().map(|it| it.seen.gaps[at]).max();
        let back = ms(&|it| it.back);
        // What is infinite, or no number, is null.
        json!({
            "fault": self.fault.0,
            "motor": self.model.name,
            "phases": self.phases.len(),
            "safe_ms": ms(&|it| it.times[0]),
            "commands_end_ms": ms(&|it| it.times[1]),
            "current_a": self.most(|it| it.seen.peak[0]),
            "most_current_a": self.most(|it| it.limit),
            "speed_rpm": self.most(|it| it.seen.peak[1]),
            "cruise_rpm": self.model.cruise,
            "others_gap_us": { "same_bus": gap(0), "other_bus": gap(1) },
            "back_on_bus_ms": ms(&|it| it.times[2]),
            "back_ms": back.is_finite().then_some(back as u64),
            "arming": self.any(|it| it.help[0]),
            "clear_fault": self.any(|it| it.help[1]),
            "broken": self.any(|it| it.broken),
        })
    }
}

/// Tries each fault with each motor model that can have it, on all cores.
fn measure<'t>(
    faults: &[&'t Fault],
    models: &[&'t Model],
    phases: u64,
) -> Result<Vec<Measured<'t>>> {
    let of = |fault: &'t Fault| models.iter().map(move |model| (fault, *model));
    let pairs: Vec<_> = faults.iter().flat_map(|fault| of(fault)).collect();
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let measured = |&(fault, model): &(&'t Fault, &'t Model)| -> Result<_> {
        let phases = (0..phases).map_while(|seed| phase(fault, model, seed).transpose());
        Ok(Measured { fault, model, phases: phases.collect::<Result<_>>()? })
    };
    thread::scope(|scope| {
        let parts = pairs.chunks(pairs.len().div_ceil(cores));
        let work = |part: &'_ [_]| part.iter().map(measured).collect::<Result<Vec<_>>>();
        let threads: Vec<_> = parts.map(|part| scope.spawn(move || work(part))).collect();
        let parts =
            threads.into_iter().map(|it| it.join().map_err(|_| anyhow!("a bench failed"))?);
        let all = parts.collect::<Result<Vec<_>>>()?.into_iter().flatten();
        Ok(all.filter(|it| !it.phases.is_empty()).collect())
    })
}

/// Those whose name contains a text.
fn named<'t, T>(
    all: &'t [T],
    what: &str,
    name: impl Fn(&T) -> &str,
    text: &str,
) -> Result<Vec<&'t T>> {
    let has = |it: &&T| name(it).to_lowercase().contains(&text.to_lowercase());
    let some: Vec<_> = all.iter().filter(has).collect();
    let names: Vec<_> = all.iter().map(&name).collect();
    ensure!(!some.is_empty(), "there is no {what} `{text}`; there are: {}", names.join(", "));
    Ok(some)
}

/// Prints what each motor does in each fault. Whether a bound was broken.
pub fn faults(args: &FaultsArgs, out: &mut dyn Write) -> Result<bool> {
    let all = models();
    let models = named(&all, "motor model", |it| it.name, &args.motor)?;
    let faults = named(&FAULTS, "fault", |it| it.0, &args.fault)?;
    let measured = measure(&faults, &models, args.phases.get())?;
    let is_broken = measured.iter().any(|it| it.any(|phase| phase.broken));
    if args.json {
        let rows: Vec<_> = measured.iter().map(Measured::to_json).collect();
        writeln!(out, "{}", json!({ "phases": args.phases, "faults": rows }))?;
        return Ok(is_broken);
    }
    let language = Language::asked().unwrap_or_else(Language::of_environment);
    for mut table in [summary(&faults, &measured), each_motor(&faults, &models, &measured)] {
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

/// The longest of some times, ms, of which those that are infinite are not over.
fn longest(times: &[f64]) -> String {
    let over: Vec<_> = times.iter().copied().filter(|it| it.is_finite()).collect();
    let longest = (over.iter().copied().fold(0.0, f64::max) / 100.0).ceil() / 10.0;
    match over.len() {
        0 => "goes on".to_owned(),
        all if all == times.len() => format!("{longest:.1}"),
        _ => format!("{longest:.1}; not all"),
    }
}

/// A line a fault: the worst of all motors.
fn summary(faults: &[&'static Fault], measured: &[Measured<'_>]) -> Table {
    let row = |fault: &&Fault| {
        let of: Vec<_> = measured.iter().filter(|it| it.fault.0 == fault.0).collect();
        if of.is_empty() {
            return iter::once(words(fault.0)).chain((1..9).map(|_| words("–"))).collect();
        }
        let time = |time: fn(&Phase) -> f64| {
            words(longest(&of.iter().map(|it| it.most(time)).collect::<Vec<_>>()))
        };
        let share = |share: fn(&Phase, &Model) -> f64| {
            let shares = of.iter().map(|it| it.most(|phase| share(phase, it.model)));
            words(format!("{:.0} %", 100.0 * shares.fold(0.0, f64::max)))
        };
        let any = |what: &dyn Fn(&Phase) -> bool| of.iter().any(|it| it.any(what));
        let bound = match fault.3 {
            Feedback => "3 periods or 10 ms, + a tick".to_owned(),
            Expired => "50 ms + a tick".to_owned(),
            Safe(millis) => format!("{millis} ms"),
            Back(millis) => format!("{millis} ms, back on the bus"),
            Free => "–".to_owned(),
        };
        let others = match [0, 1].map(|bus| any(&|it| it.seen.gaps[bus] > ON_TIME)) {
            [false, false] => "all",
            [true, false] => "on other buses",
            _ => "none",
        };
        let by = match [0, 1].map(|help| any(&|it| it.help[help])) {
            [false, false] => "by itself",
            [true, false] => "by arming",
            [false, true] => "after ClearFault",
            [true, true] => "after ClearFault, by arming",
        };
        vec![
            words(fault.0),
            Cell { bad: any(&|it| it.broken), ..time(|it| it.times[0]) },
            words(bound),
            time(|it| it.times[1]),
            share(|it, _| it.seen.peak[0] / it.limit),
            share(|it, model| it.seen.peak[1] / model.cruise),
            words(others),
            words(by),
            time(|it| it.back),
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

/// A line a motor model: in each fault the time to no torque, of those in which models differ.
fn each_motor(faults: &[&'static Fault], models: &[&Model], measured: &[Measured<'_>]) -> Table {
    let shown: Vec<_> = faults.iter().filter(|it| it.4).collect();
    let row = |model: &&Model| {
        let cell = |fault: &&&Fault| {
            let mut of = measured.iter().filter(|it| it.model.name == model.name);
            let Some(it) = of.find(|it| it.fault.0 == fault.0) else { return words("–") };
            let safe = words(longest(&[it.most(|it| it.times[0])]));
            Cell { bad: it.any(|it| it.broken), ..safe }
        };
        iter::once(words(model.name)).chain(shown.iter().map(cell)).collect()
    };
    let head = iter::once("no torque after ms").chain(shown.iter().map(|it| it.0)).collect();
    Table { head, words: 1, rows: models.iter().map(row).collect() }
}
