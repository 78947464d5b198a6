//! The figures of a run on the emulated chip: text for people, JSON for programs.

use std::io::{self, Write};
use std::time::Duration;

use rc10_emu::fault::Fault;
use rc10_emu::memory::FLASH;
use rc10_emu::{Board, BusFigures, ExceptionCost, Figures, LogLine, Rig, Spread};
use rc10_sim::Nanos;
use serde_json::{Value, json};

use crate::commands::emulate::problems::cause_of;
use crate::recording::Recording;
use crate::run::emulation::content_hash;
use crate::show::figures::{
    Figures as RunFigures, lines_json, problems_json, remote_json, remote_lines,
};

const TOP_FUNCTIONS: usize = 12;

pub(super) struct Outcome<'a> {
    pub rig: &'a Rig,
    pub figures: Figures,
    pub recording: &'a Recording,
    pub run: &'a RunFigures,
    pub log: &'a [LogLine],
}

fn micros(time: Nanos) -> f64 {
    time.get() as f64 * 1e-3
}

fn seconds(time: Nanos) -> f64 {
    time.get() as f64 * 1e-9
}

/// The shortest and longest tick of all buses, and the mean over all ticks.
fn over_all(buses: &[BusFigures]) -> Option<Spread> {
    let periods = || buses.iter().filter_map(|bus| bus.tick_period);
    let count: u64 = periods().map(|period| period.count).sum();
    let sum: u64 = periods().map(|period| period.mean().get() * period.count).sum();
    Some(Spread {
        count,
        min: periods().map(|period| period.min).min()?,
        max: periods().map(|period| period.max).max()?,
        sum: Nanos::new(sum),
    })
}

fn spread(period: Spread) -> Value {
    let Spread { min, max, .. } = period;
    json!({ "min": micros(min), "mean": micros(period.mean()), "max": micros(max) })
}

impl Outcome<'_> {
    fn timeline(&self) -> Vec<(Nanos, String)> {
        let machine = &self.rig.machine;
        let mut lines: Vec<(Nanos, String)> = Vec::new();
        for Fault { kind, from, until } in &self.recording.faults {
            let begins = if until.is_some() { " begins" } else { "" };
            lines.push((*from, format!("fault {kind}{begins}")));
            let ended = until.filter(|&until| until <= self.figures.length);
            lines.extend(ended.map(|until| (until, format!("fault {kind} ends"))));
        }
        lines.extend(self.log.iter().map(|line| (line.at, line.text.clone())));
        let chip = |at, what: &str| (at, format!("CHIP  {what}"));
        lines.extend(machine.reports.iter().map(|report| chip(report.at, &report.text)));
        for restart in &machine.restarts {
            let cause = cause_of(restart, machine, self.log);
            lines.push(chip(restart.at, &format!("restart, cause: {cause}")));
        }
        // Stable: the program's last words come before the restart.
        lines.sort_by_key(|line| line.0);
        lines
    }

    pub(super) fn to_json(&self) -> Value {
        let Self { rig, figures, recording, .. } = self;
        let machine = &rig.machine;
        let per = |part: u64| figures.instructions.checked_div(part);
        let at = |at: Nanos, text: &str| json!({ "at_us": micros(at), "text": text });
        let functions = machine.profile.by_function(&machine.image);
        json!({
            "seed": recording.seed,
            "board": machine.board().name,
            "crystal_hz": machine.board().crystal_hz,
            "virtual_seconds": seconds(figures.length),
            "frames": figures.buses.iter().map(|bus| bus.frames).sum::<u64>(),
            "content_hash": content_hash(rig),
            "rx_lost": figures.lost(),
            "tick_period_us": over_all(&figures.buses).map(spread),
            "boot_us": figures.boot.map(micros),
            "instructions": figures.instructions,
            "instructions_per_tick": per(figures.ticks()),
            "instructions_per_received_frame": per(figures.received()),
            "stack_bytes": figures.stack_bytes,
            "static_ram_bytes": machine.image.ram,
            "flash_bytes": machine.image.flash,
            "unowned_accesses": figures.unowned_accesses,
            "gated_accesses": figures.gated_accesses,
            "restarts": machine.restarts.iter().map(|restart| json!({
                "at_us": micros(restart.at),
                "cause": cause_of(restart, machine, self.log),
            })).collect::<Vec<_>>(),
            "buses": figures.buses.iter().zip(1..).map(|(bus, number)| json!({
                "bus": number,
                "frames": bus.frames,
                "sent": bus.sent,
                "received": bus.received,
                "rx_lost": bus.lost,
                "foreign": bus.foreign,
                "failed": bus.failed,
                "bus_offs": bus.bus_offs,
                "load_percent": bus.load,
                "tick_period_us": bus.tick_period.map(spread),
            })).collect::<Vec<_>>(),
            "lines": lines_json(recording),
            "motors": recording.motors.iter().map(|track| json!({
                "motor": track.motor.label,
                "bus": track.motor.on.bus(),
                "line": track.motor.on.line(),
                "link": format!("{:?}", track.last.link),
                "rpm": track.samples.last().map(|sample| sample.rpm),
                "received": track.last.counters.received,
                "malformed": track.last.counters.malformed,
                "feedback_overwritten": track.overwritten,
            })).collect::<Vec<_>>(),
            "remote": remote_json(recording),
            "problems": problems_json(self.run),
            "functions": functions.iter().take(TOP_FUNCTIONS).map(|(name, instructions)| json!({
                "function": name,
                "instructions": instructions,
            })).collect::<Vec<_>>(),
            "reports": machine.reports.iter().map(|report| at(report.at, &report.text))
                .collect::<Vec<_>>(),
            "log": self.log.iter().map(|line| at(line.at, &line.text)).collect::<Vec<_>>(),
        })
    }

    /// Writes the figures as text; `took` is how long the run took on this machine.
    pub(super) fn write(&self, text: &mut dyn Write, took: Duration) -> io::Result<()> {
        for (at, line) in self.timeline() {
            writeln!(text, "{:>10.3} ms  {line}", micros(at) * 1e-3)?;
        }
        let (length, took) = (seconds(self.figures.length), took.as_secs_f64());
        let Board { name, chip, crystal_hz, .. } = self.rig.machine.board();
        let (seed, crystal) = (self.recording.seed, crystal_hz as f64 * 1e-6);
        writeln!(
            text,
            "\n{length:.3} s on the emulated chip in {took:.1} s, seed {seed}; board {name}, {chip} \
             with {crystal} MHz\n"
        )?;
        writeln!(text, "{}", self.run.tables.motors.text())?;
        self.write_buses(text)?;
        if let Some(lines) = &self.run.tables.lines {
            writeln!(text, "\n{}", lines.text())?;
        }
        writeln!(text, "{}", remote_lines(self.recording))?;
        self.write_figures(text)?;
        self.write_exceptions(text)?;
        self.write_functions(text)
    }

    fn write_buses(&self, text: &mut dyn Write) -> io::Result<()> {
        writeln!(
            text,
            "{:<5} {:>8} {:>8} {:>8} {:>9} {:>6} {:>8} {:>8} {:>8}  tick period us, min / mean / max",
            "bus", "load %", "frames", "sent", "received", "lost", "foreign", "failed", "bus-offs",
        )?;
        for (bus, number) in self.figures.buses.iter().zip(1..) {
            let period = bus.tick_period.map_or("-".into(), |period| {
                let [min, mean, max] = [period.min, period.mean(), period.max].map(micros);
                format!("{min:.2} / {mean:.2} / {max:.2}")
            });
            let BusFigures { load, frames, sent, received, lost, .. } = bus;
            let BusFigures { foreign, failed, bus_offs, .. } = bus;
            writeln!(
                text,
                "{number:<5} {load:>8.1} {frames:>8} {sent:>8} {received:>9} {lost:>6} {foreign:>8} \
                 {failed:>8} {bus_offs:>8}  {period}",
            )?;
        }
        Ok(())
    }

    fn write_figures(&self, text: &mut dyn Write) -> io::Result<()> {
        let figures = &self.figures;
        let image = &self.rig.machine.image;
        let boot = match figures.boot.map(micros) {
            Some(boot) => format!("{boot:.1} us from the final clock to the first frames"),
            None => "never: a bus has seen no frame from the chip".to_owned(),
        };
        let total = figures.instructions;
        let per = |part: u64| total.checked_div(part).map_or("-".into(), |n| n.to_string());
        writeln!(
            text,
            "boot           {boot}\n\
             instructions   {total} ({:.2} million a second), {} a tick, {} a received frame\n\
             memory         stack {} + static {} bytes of RAM, {} bytes of flash\n\
             bad accesses   {} unowned, {} without a clock\n\
             content        {}\n",
            total as f64 * 1e-6 / seconds(figures.length),
            per(figures.ticks()),
            per(figures.received()),
            figures.stack_bytes,
            image.ram,
            image.flash,
            figures.unowned_accesses,
            figures.gated_accesses,
            content_hash(self.rig)
        )
    }

    fn share(&self, instructions: u64) -> f64 {
        instructions as f64 * 100.0 / self.figures.instructions.max(1) as f64
    }

    fn write_exceptions(&self, text: &mut dyn Write) -> io::Result<()> {
        writeln!(text, "{:>12} {:>6} {:>10}  exception", "instructions", "%", "entries")?;
        for cost in self.rig.machine.profile.by_exception() {
            let ExceptionCost { exception, entries, instructions, .. } = cost;
            let name = match exception.checked_sub(16) {
                Some(number) => format!("interrupt {number} ({})", self.handler(exception)),
                None if exception == 0 => "thread mode".into(),
                None => format!("exception {exception} ({})", self.handler(exception)),
            };
            let share = self.share(instructions);
            writeln!(text, "{instructions:>12} {share:>6.1} {entries:>10}  {name}")?;
        }
        Ok(())
    }

    /// The function that handles an exception.
    fn handler(&self, exception: u16) -> &str {
        let machine = &self.rig.machine;
        let address = machine.memory.word(FLASH + 4 * u32::from(exception)).unwrap_or(0) & !1;
        machine.image.function_at(address).map_or("?", |(_, name)| name)
    }

    fn write_functions(&self, text: &mut dyn Write) -> io::Result<()> {
        writeln!(text, "\n{:>12} {:>6}  function", "instructions", "%")?;
        let machine = &self.rig.machine;
        let functions = machine.profile.by_function(&machine.image);
        for (name, instructions) in functions.into_iter().take(TOP_FUNCTIONS) {
            writeln!(text, "{instructions:>12} {:>6.1}  {name}", self.share(instructions))?;
        }
        Ok(())
    }
}
