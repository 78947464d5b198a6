//! Problems of the emulated chip itself.

use std::collections::BTreeSet;

use rc10_emu::fault::{ChipFault, Fault, Kind};
use rc10_emu::{Figures, LogLine, Machine, Restart, Rig};
use rc10_time::Micros;

use crate::recording::Recording;
use crate::recording::excuse::is_excused;
use crate::recording::problem::{About, Problem, counted};
use crate::robot::description::Description;
use crate::robot::motor::Place;
use crate::run::board;

/// Adds the warnings of the program's log, once each; not in a run with faults, which cause some.
pub(super) fn warnings(log: &[LogLine], recording: &Recording, found: &mut Vec<Problem>) {
    let mut told = BTreeSet::new();
    for line in log.iter().filter(|_| recording.faults.is_empty()) {
        let Some(text) = line.text.strip_prefix("warn").map(str::trim_start) else { continue };
        if told.insert(text) {
            let at = line.at.get() as f64 * 1e-9;
            let text = format!("the program warns from {at:.2} s on: {text}");
            let problem = Problem::new(About::Chip, "warning", text);
            found.push(problem.in_time(line.at.micros(), Micros::ZERO));
        }
    }
}

/// The cause of a restart; after a hang with the function, by the address that the next run logged.
pub(super) fn cause_of(restart: &Restart, machine: &Machine, log: &[LogLine]) -> String {
    let cause = format!("{:?}", restart.cause);
    let next = machine.restarts.iter().map(|other| other.at).find(|&at| at > restart.at);
    let mut after = log.iter().skip_while(|line| line.at <= restart.at);
    let told = after.find_map(|line| Some((line.at, line.text.split_once("hung at 0x")?.1)));
    let address = told.filter(|(at, _)| next.is_none_or(|next| *at <= next));
    let address = address.and_then(|(_, text)| u32::from_str_radix(text.get(..8)?, 16).ok());
    match address.and_then(|address| machine.function_at(address)) {
        Some(function) => format!("{cause}, hung in {function}"),
        None => cause,
    }
}

/// Adds the problems of the chip. The effects that its faults must have are no problem.
pub(super) fn search(
    rig: &Rig,
    description: &Description,
    recording: &Recording,
    log: &[LogLine],
    found: &mut Vec<Problem>,
) {
    let (machine, figures) = (&rig.machine, Figures::of(rig));
    let mut problem = |kind, text| found.push(Problem::new(About::Chip, kind, text));
    if let Some(text) = board::mismatch(machine.image.made_for.as_ref(), &machine.board()) {
        problem("wrong-board", text);
    }
    if figures.boot.is_none() {
        problem("silent", "a bus has seen no frame from it".to_owned());
    }
    // Between a crystal that stops and the restart the PLL is the chip's own oscillator's, and its
    // outputs run for a moment before the core has switched to it: no order of steps avoids that.
    let is_rescue = |at| {
        recording.faults.iter().any(|fault| {
            let mut restarts = machine.restarts.iter().map(|restart| restart.at);
            let rescued = restarts.find(|&rescued| rescued > fault.from);
            let stops = fault.kind == Kind::Other(ChipFault::CrystalStops);
            stops && at >= fault.from && rescued.is_some_and(|rescued| at <= rescued)
        })
    };
    for report in machine.reports.iter().filter(|report| !is_rescue(report.at)) {
        let at = report.at.get() as f64 * 1e-6;
        let text = format!("{} at {at:.3} ms", report.text);
        let problem = Problem::new(About::Chip, "bad-access", text);
        found.push(problem.in_time(report.at.micros(), Micros::ZERO));
    }
    let crashes =
        |kind: &Kind| matches!(kind, Kind::Other(fault) if *fault != ChipFault::CrystalDead);
    let crashed = recording.faults.iter().filter(|fault| crashes(&fault.kind)).count();
    for restart in machine.restarts.iter().skip(crashed) {
        let at = restart.at.get() as f64 * 1e-6;
        let cause = cause_of(restart, machine, log);
        let text = format!("restarted at {at:.3} ms: {cause}");
        let problem = Problem::new(About::Chip, "restart", text);
        found.push(problem.in_time(restart.at.micros(), Micros::ZERO));
    }
    for part in description.serials.iter().filter(|part| !machine.soc().listens(part.uart)) {
        let uart = part.uart;
        let (about, name) = (About::Part(part.label), machine.board().name);
        found.push(if part.label == "IMU" && machine.board().imu.is_some() {
            let text = format!("not read at UART {uart}: {name} has one of its own");
            Problem::information(about, "not-read", text)
        } else {
            let text = format!(
                "never read by the chip: the program does not switch on UART {uart}, at which it is"
            );
            Problem::new(about, "not-read", text)
        });
    }
    for (number, part) in (1..).zip(&description.lines) {
        let (about, garbled) = (About::Line(number), machine.garbled(part.uart));
        let what = "bytes of another baud rate or format";
        found.extend(counted(about, [(garbled, "garbled", what)]));
        let line = recording.lines.get(usize::from(number) - 1);
        if line.is_some_and(|line| line.traffic.exchanges + line.traffic.timeouts == 0) {
            let text = format!("no command from UART {}: is its driver enabled?", part.uart);
            found.push(Problem::new(about, "silent", text));
        }
    }
    for (number, bus) in (1..).zip(&figures.buses) {
        // Counted over the whole run: a fault on the bus excuses all of it.
        let faults = &recording.faults;
        let begins = |fault: &Fault| is_excused(faults, Place::Bus(number), fault.from.micros());
        if !faults.iter().any(begins) {
            let lost = (bus.lost, "rx-lost", "received frames lost");
            let offs = (bus.bus_offs, "bus-off", "× bus-off");
            found.extend(counted(About::Bus(number), [lost, offs]));
        }
    }
}
