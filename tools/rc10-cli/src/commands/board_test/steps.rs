//! The steps that are led, by their numbers in `docs/bring-up.md`, and how each is judged.

use std::io::{self, ErrorKind};

use anyhow::{Context as _, Result};
use rc10_emu::Board;
use serde_json::json;

use super::walk::{Line, Outcome, Walk, wrong};

/// The page that the steps are on.
const PAGE: &str = include_str!("../../../../../docs/bring-up.md");
/// Those before are for the PC, those from the other on for armed motors.
const LED: std::ops::Range<u32> = 3..30;

type Judge = fn(&mut Walk<'_>) -> Result<Outcome>;

/// Steps that are judged; all others but [`BY_STATUS`] the person judges.
const JUDGED: [(&str, Judge); 10] = [
    ("7", termination),
    ("9", brown_out),
    ("11", start),
    ("12", clock),
    ("13", status_line),
    ("14", registers),
    ("15", lonely_buses),
    ("17", reset),
    ("23", remote),
    ("28", one_motor),
];

/// Steps that the robot's status judges, in their order: number, what the person does, if anything, seconds until the
/// status tells, how that begins, or with `!` does not, whether its remote is `lost` or `heard`, and the cause if not.
const BY_STATUS: &str = include_str!("by_status.tsv");

/// A step of the page.
struct Step {
    number: &'static str,
    /// The part of the page.
    part: &'static str,
    /// What to do, what is right, what if not; without marks.
    cells: [String; 3],
}

/// All steps of the page.
fn page() -> impl Iterator<Item = Step> {
    let mut part = "";
    PAGE.lines().filter_map(move |line| {
        part = line.strip_prefix("## ").unwrap_or(part);
        let (number, row) = line.strip_prefix("| ")?.split_once(" |")?;
        let mut cells = row.split('|').map(|cell| {
            // The text of a link stays, its place goes.
            let cell = cell.trim().replace("**", "");
            let mut parts = cell.split("](");
            let first = parts.next().unwrap_or_default().to_owned();
            let rest = parts.filter_map(|part| Some(part.split_once(')')?.1));
            rest.fold(first, |text, part| text + part).replace('[', "")
        });
        let cells = std::array::from_fn(|_| cells.next().unwrap_or_default());
        Some(Step { number, part, cells })
    })
}

/// Numbers of a board's steps, in their order.
pub fn steps(board: &Board) -> impl Iterator<Item = &'static str> {
    let is_dm_mc02 = board.name == "dm-mc02";
    let of_board = move |it: &Step| is_dm_mc02 || !it.cells[0].starts_with("DM-MC02");
    page().filter(of_board).map(|it| it.number).filter(|it| LED.contains(&number_of(it)))
}

/// A step's number without its letter; 0 if it has no number.
fn number_of(step: &str) -> u32 {
    step.trim_end_matches(char::is_alphabetic).parse().unwrap_or(0)
}

fn judge(walk: &mut Walk<'_>, step: &Step) -> Result<Outcome> {
    if let Some((_, judge)) = JUDGED.iter().find(|it| it.0 == step.number) {
        return judge(walk);
    }
    let rows = BY_STATUS.lines().map(|row| row.split('\t'));
    let mut rows = rows.filter(|row| row.clone().next() == Some(step.number)).peekable();
    if rows.peek().is_none() {
        return by_eye(walk, step);
    }
    let mut status = String::new();
    for row in rows {
        let [_, deed, seconds, begin, remote, cause] = row.collect::<Vec<_>>()[..] else {
            continue;
        };
        let seconds = seconds.parse()?;
        status = match deed {
            "" => walk.status(seconds)?,
            deed => walk.after(deed, seconds)?,
        };
        let begins = match begin.strip_prefix('!') {
            Some(other) => !status.starts_with(other),
            None => status.starts_with(begin),
        };
        let is_lost = status.contains("remote missing") || status.contains("no remote");
        if !begins || remote == "heard" && is_lost || remote == "lost" && !is_lost {
            return wrong(cause, &[&status, &begin, &deed]);
        }
    }
    right(status)
}

fn right(seen: impl Into<String>) -> Result<Outcome> {
    Outcome::of("right", seen)
}

/// What a line of the log says of the robot, as `rc10_tasks::status` writes it, behind the level.
fn status_of(line: &Line) -> Option<&str> {
    let is_one = line.from == "log" && line.text.contains(" motors online");
    Some(line.text.split_once(' ').filter(|_| is_one)?.1.trim_start())
}

fn buses(status: &str) -> impl Iterator<Item = &str> {
    status.split("; bus ").skip(1)
}

/// The number that stands before some words.
fn number_before(text: &str, words: &str) -> Option<u32> {
    text.split_once(words)?.0.rsplit([' ', ',']).next()?.parse().ok()
}

impl Walk<'_> {
    /// Does the step with this number. Fails if the person ends, or file or terminal cannot be
    /// written.
    pub fn step(&mut self, number: &str) -> Result<Outcome> {
        let step = page().find(|it| it.number == number).context("no such step")?;
        let [what, right, _] = &step.cells;
        let right = if right.is_empty() { "" } else { &format!("   right: {right}\n") };
        self.tell(&format!("\n{number}. {}: {what}\n{right}", step.part))?;
        self.keep(&json!({ "begin": number }))?;
        // What came late belongs to the step before.
        self.listen(0.0)?;
        self.before = self.heard.len();
        let kind = |error: &anyhow::Error| error.downcast_ref().map(io::Error::kind);
        let judged = match judge(self, &step) {
            Err(error) if kind(&error) == Some(ErrorKind::Interrupted) => {
                Outcome::of("skipped", "")?
            }
            Err(error) if error.is::<io::Error>() => return Err(error),
            Err(error) => wrong("unread", &[&format!("{error:#}")])?,
            Ok(outcome) => outcome,
        };
        let Outcome { word, text, mend } = &self.said().unwrap_or(judged);
        self.keep(&json!({ "step": number, "outcome": word, "text": text, "do": mend }))?;
        let sign = match *word {
            "wrong" => "✗",
            "skipped" => "–",
            _ => "✓",
        };
        self.tell(&format!("{sign} {}\n", if text.is_empty() { word } else { text.as_str() }))?;
        if !mend.is_empty() {
            self.tell(&format!("   do: {mend}\n"))?;
        }
        Ok(Outcome { word, text: text.clone(), mend: mend.clone() })
    }

    /// The newest status, after some seconds.
    fn status(&mut self, seconds: f64) -> Result<String> {
        let lines = self.listen(seconds)?;
        let newest = lines.iter().rev().find_map(status_of).map(str::to_owned);
        newest.context("no line of the robot's status came")
    }

    /// The status some seconds after the person has done something.
    fn after(&mut self, deed: &str, seconds: f64) -> Result<String> {
        self.deed(&format!("{deed}; then Enter"))?;
        self.status(seconds)
    }
}

/// Steps in which the person needs the probe, and puts another program into the chip.
const BY_HAND: [&str; 3] = ["18", "19", "20"];

/// The person looks, and says what is seen.
fn by_eye(walk: &mut Walk<'_>, step: &Step) -> Result<Outcome> {
    // From then on there is a log.
    if number_of(step.number) > 11 {
        let is_by_hand = BY_HAND.contains(&step.number);
        if is_by_hand {
            walk.bench.let_go();
        }
        walk.deed("do it; then Enter")?;
        if is_by_hand {
            walk.deed("motor power off? then Enter, and the board gets its program again")?;
            walk.bench.start()?;
        }
        // What it provoked is shown, and judged by the person.
        let lines = walk.listen(1.0)?;
        for line in lines.iter().filter(|it| it.from == "log" && status_of(it).is_none()) {
            walk.tell(&format!("   the log says: {}\n", line.text))?;
        }
        walk.before = walk.heard.len();
    }
    let answer =
        walk.ask("as it should be? Enter: yes; n: no, and what you see; or what you measured")?;
    match answer.split_once(' ').unwrap_or((&answer, "")) {
        ("s", "") => Outcome::of("skipped", ""),
        ("n" | "no" | "No", seen) => wrong("eye", &[&seen, &step.cells[2]]),
        ("", _) => Outcome::of("told", "yes"),
        _ => Outcome::of("told", answer),
    }
}

/// Asks for the ohms between the wires of a bus: them, and what is wrong by them.
fn ohms(walk: &mut Walk<'_>, bus: usize) -> Result<(Option<f64>, Option<Outcome>)> {
    let ohms = walk.measured(&format!("all off: ohms between CANH and CANL of bus {bus}"))?;
    let key = match ohms {
        Some(..10.0) => "short",
        Some(10.0..45.0) => "too-many",
        Some(90.0..) => "too-few",
        _ => return Ok((ohms, None)),
    };
    Ok((ohms, Some(wrong(key, &[&bus, &ohms.unwrap_or_default()])?)))
}

fn termination(walk: &mut Walk<'_>) -> Result<Outcome> {
    let mut told = String::new();
    for bus in 1..=walk.buses {
        match ohms(walk, bus)? {
            (_, Some(wrong)) => return Ok(wrong),
            (Some(ohms), None) => told += &format!("bus {bus}: {ohms} ohms "),
            (None, None) => {}
        }
    }
    Outcome::of(if told.is_empty() { "skipped" } else { "told" }, told.trim())
}

/// `FLASH_OPTSR_CUR`; `BOR_LEV` is in bits 3 and 2 (RM0468).
const OPTIONS: u32 = 0x5200_201C;
/// `PWR_CSR1`; `ACTVOSRDY`: the core's supply is there.
const SUPPLIED: (u32, u32) = (0x5802_4804, 1 << 13);
/// FDCAN1 to 3, their CCCR, ECR and PSR, and CCFG of the clock calibration unit.
const FDCANS: [u32; 3] = [0x4000_A000, 0x4000_A400, 0x4000_D400];
const CCCR: u32 = 0x18;
const ECR: u32 = 0x40;
const PSR: u32 = 0x44;
const CALIBRATION: u32 = 0x4000_A804;

fn brown_out(walk: &mut Walk<'_>) -> Result<Outcome> {
    match walk.read(OPTIONS)? >> 2 & 3 {
        3 => right("BOR_LEV is 3"),
        level => wrong("brown-out", &[&level]),
    }
}

fn is_start(line: &&Line) -> bool {
    line.text.ends_with(" start") || line.text.ends_with(" start, power came")
}

fn start(walk: &mut Walk<'_>) -> Result<Outcome> {
    walk.deed("motor power off? then Enter, and it is flashed")?;
    walk.bench.start()?;
    let mut lines = walk.listen(6.0)?;
    lines.retain(|line| line.from == "log");
    let hsi = lines.iter().find(|it| it.text.contains("HSI is "));
    match (lines.iter().filter(is_start).count(), hsi) {
        _ if lines.is_empty() && walk.read(SUPPLIED.0)? & SUPPLIED.1 == 0 => {
            wrong("core-supply", &[])
        }
        _ if lines.is_empty() => wrong("no-line", &[]),
        (2.., _) => wrong("restarts", &[&lines.iter().filter(is_start).count()]),
        (_, Some(hsi)) => right(format!("it starts; {}", hsi.text)),
        _ => wrong("no-begin", &[]),
    }
}

fn clock(walk: &mut Walk<'_>) -> Result<Outcome> {
    walk.listen(10.0)?;
    let begun = walk.heard.iter().rposition(|it| is_start(&it)).unwrap_or(0);
    let seconds =
        |line: &Line| Some(f64::from(number_before(status_of(line)?, " ticks of")?) / 1e3);
    let all = walk.heard.iter().skip(begun);
    let seen: Vec<_> = all.filter_map(|line| Some((line.at, seconds(line)?))).collect();
    // Lines come late now and then: those that came soonest in the first and in the last third are compared.
    let soonest = |part: &[(f64, f64)]| {
        part.iter().copied().min_by(|a, b| (a.0 - a.1).total_cmp(&(b.0 - b.1)))
    };
    let third = seen.len() / 3;
    let first = seen.get(..third).and_then(soonest);
    let last = seen.get(seen.len() - third..).and_then(soonest);
    let (Some(first), Some(last)) = (first, last) else { return wrong("few", &[]) };
    let off = (last.1 - first.1) / (last.0 - first.0) - 1.0;
    let percent = format!("{:.1}", off.abs() * 100.0);
    match off {
        -0.005..=0.005 => right(format!("the clocks are {percent} % apart")),
        _ => wrong("clock", &[&percent, &if off > 0.0 { "fast" } else { "slow" }]),
    }
}

fn status_line(walk: &mut Walk<'_>) -> Result<Outcome> {
    walk.listen(0.0)?;
    let from = walk.heard.len();
    let status = walk.status(6.0)?;
    if let Some(bus) = buses(&status).position(|bus| bus.contains("ticks missed")) {
        return wrong("missed", &[&(bus + 1)]);
    }
    if let Some(trouble) = status.split(", ").find_map(|it| it.strip_prefix("IMU ")) {
        return wrong("imu", &[&trouble]);
    }
    if status.starts_with("emergency stop") && status.contains("no remote") {
        return wrong("key", &[]);
    }
    let heard = walk.heard.iter().skip(from);
    let console: Vec<_> = heard.filter(|it| it.from == "console").collect();
    let says = console.iter().any(|it| it.text.contains(" motors online"));
    match (walk.has_console, console.is_empty()) {
        (false, _) => right("every bus ticks; the console was not looked at (--port)"),
        (true, true) => wrong("no-console", &[]),
        (true, false) if says => right("every bus ticks; the console says so, too"),
        (true, false) => wrong("garbage", &[]),
    }
}

fn registers(walk: &mut Walk<'_>) -> Result<Outcome> {
    let calibration = walk.read(CALIBRATION)?;
    for (bus, base) in (1..=walk.buses).zip(FDCANS) {
        let cccr = walk.read(base + CCCR)?;
        // ASM: restricted operation.
        if cccr & 0b100 != 0 || calibration != 0x40 {
            let hex = |word| format!("{word:#x}");
            return wrong("restricted", &[&bus, &hex(cccr), &hex(calibration)]);
        }
    }
    right("no bus is restricted")
}

fn lonely_buses(walk: &mut Walk<'_>) -> Result<Outcome> {
    let status = walk.status(3.0)?;
    if let Some(bus) = buses(&status).position(|said| said.contains("bus-off")) {
        return does_not_hear_itself(walk, bus + 1);
    }
    for ((bus, base), said) in (1..).zip(FDCANS).zip(buses(&status)) {
        if !said.contains("alone on the bus") {
            // PSR.ACT: has it ever seen the bus idle?
            let is_idle = walk.read(base + PSR)? >> 3 & 3 != 0;
            return wrong(if is_idle { "speaks" } else { "dominant" }, &[&bus]);
        }
    }
    right("each bus is alone, and none is bus-off")
}

/// TX of each bus of a board.
const TX: [(&str, [&str; 3]); 2] =
    [("h723zg", ["PD1", "PB13", "PF7"]), ("dm-mc02", ["PD1", "PB6", "PD13"])];

/// A bus is off at once: a meter tells why.
fn does_not_hear_itself(walk: &mut Walk<'_>, bus: usize) -> Result<Outcome> {
    let volts = walk.measured(&format!("volts at VCC (5 V) of the transceiver of bus {bus}"))?;
    if let Some(volts) = volts.filter(|it| *it < 4.5) {
        return wrong("no-5-V", &[&bus, &volts]);
    }
    let (ohms, by_ohms) = ohms(walk, bus)?;
    if let Some(wrong) = by_ohms {
        return Ok(wrong);
    }
    let standby = walk
        .ask("volts at its STB, S or SILENT [Enter: it has none; of a pin EN: e and the volts]")?;
    let (enables, level) =
        standby.strip_prefix('e').map_or((false, &*standby), |it| (true, it.trim()));
    if level.parse::<f64>().is_ok_and(|it| (it > 1.5) != enables) {
        return wrong("standby", &[&bus]);
    }
    let pins = TX.iter().find(|it| it.0 == walk.board.name);
    let pin = pins.and_then(|it| it.1.get(bus - 1)).copied().unwrap_or("TX");
    let beeps = walk.ask(&format!(
        "all off: does a meter beep between {pin} and the transceiver's TXD? y, n"
    ))?;
    match (&*beeps, volts.and(ohms)) {
        ("n", _) => wrong("crossed", &[&bus]),
        ("y", Some(_)) => wrong("broken", &[&bus]),
        _ => wrong("deaf", &[&bus]),
    }
}

fn reset(walk: &mut Walk<'_>) -> Result<Outcome> {
    // Also what it said long ago.
    walk.status(3.0)?;
    walk.deed("press reset and let go; then Enter")?;
    let starts = walk.listen(4.0)?.iter().any(|it| is_start(&it));
    if starts { right("it starts again") } else { wrong("reset", &[]) }
}

fn remote(walk: &mut Walk<'_>) -> Result<Outcome> {
    let off = walk.after("the transmitter off", 4.0)?;
    if !off.contains("no remote") {
        return wrong("made-up", &[]);
    }
    let deed =
        "the transmitter on, the right switch down, the left one in the middle, sticks let go";
    let on = walk.after(deed, 6.0)?;
    let errors = |status: &str| number_before(status, " port errors").unwrap_or(0);
    let inverter = if walk.board.inverts_remote { "has" } else { "has not" };
    match on.contains("no remote") {
        false => right("no remote, and then it is heard"),
        true if errors(&on) > errors(&off) => wrong("inverted", &[&inverter]),
        true => wrong("unheard", &[]),
    }
}

/// Looks at the error counters of a bus: one disturbance lasts for one of them.
const LOOKS: usize = 16;

fn one_motor(walk: &mut Walk<'_>) -> Result<Outcome> {
    let online = |status: &str| number_before(status, " of ").unwrap_or(0);
    let (mut seen, mut before) = (String::new(), online(&walk.status(4.0)?));
    for (bus, base) in (1..=walk.buses).zip(FDCANS) {
        let deed = format!("power one motor on bus {bus}, disarmed; then Enter; s: there is none");
        if walk.ask(&deed)? == "s" {
            continue;
        }
        let status = walk.status(10.0)?;
        let said = buses(&status).nth(bus - 1).unwrap_or_default();
        if said.contains("alone on the bus") {
            return wrong("no-node", &[&bus]);
        }
        let mut failed = 0;
        for _ in 0..LOOKS {
            // TEC and REC.
            failed += usize::from(walk.read(base + ECR)? & 0x7FFF != 0);
        }
        if failed > 1 || said.contains("error passive") || said.contains("bus-off") {
            let (_, by_ohms) = ohms(walk, bus)?;
            return by_ohms.map_or_else(|| wrong("errors", &[&bus, &failed, &LOOKS]), Ok);
        }
        if online(&status) <= before {
            return wrong("other-id", &[&bus]);
        }
        before = online(&status);
        seen += &format!("bus {bus}: {before} motors are heard ");
    }
    Outcome::of(if seen.is_empty() { "skipped" } else { "right" }, seen.trim())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::walk::CAUSES;
    use super::*;

    #[test]
    fn table_and_page_have_the_same_steps() {
        let all: Vec<_> = steps(&Board::DM_MC02).collect();
        let count = |board: &Board| steps(board).count();
        assert_eq!((all.first(), all.last()), (Some(&"3"), Some(&"29")));
        assert_eq!((all.len(), count(&Board::H723ZG)), (29, 27));
        let by_status = BY_STATUS.lines().map(|row| row.split('\t').collect::<Vec<_>>());
        for row in by_status.clone() {
            assert!(row.len() == 6 && row[2].parse::<f64>().is_ok(), "{row:?}");
        }
        for number in JUDGED.iter().map(|it| it.0).chain(by_status.map(|row| row[0])) {
            assert!(all.contains(&number), "{number} is not on the page");
        }
        for Step { number, cells: [what, right, not], .. } in
            page().filter(|it| all.contains(&it.number))
        {
            assert!(!what.is_empty() && (number == "10") == right.is_empty(), "{number}: {what}");
            assert!(!format!("{what}{right}").contains(['[', '|']), "{number}: {what} {right}");
            let text = "not at all (wiring.md, part `remote`)";
            assert!(number != "23" || not.contains(text), "{not}");
        }
    }

    /// Each cause says what to do, and each that the code names is there.
    #[test]
    fn causes_say_what_to_do() {
        let rows: Vec<Vec<_>> = CAUSES.lines().map(|row| row.split('\t').collect()).collect();
        assert!(rows.iter().all(|row| row.len() == 3 && row.iter().all(|it| !it.is_empty())));
        let code = include_str!("steps.rs");
        let keys: BTreeSet<_> = rows.iter().map(|row| row[0]).collect();
        assert_eq!(keys.len(), rows.len());
        for key in keys.iter().filter(|key| !key.starts_with("said ")) {
            let is_said =
                code.contains(&format!("\"{key}\"")) || BY_STATUS.contains(&format!("\t{key}\n"));
            assert!(is_said, "{key} is never said");
        }
        let named = code.split("wrong(\"").skip(1).filter_map(|rest| rest.split('"').next());
        let by_status = BY_STATUS.lines().filter_map(|row| row.split('\t').next_back());
        for key in named.chain(by_status).filter(|key| !key.contains('(') && !key.is_empty()) {
            assert!(keys.contains(key), "{key} has no words");
        }
    }
}
