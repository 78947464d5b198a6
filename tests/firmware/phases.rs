//! Cost of a fault, wherever it strikes: the same scenario at fifty phases of the ticks (1 ms),
//! the supervisor (4 ms), the watchdog's feeding (10 ms), the motors and the remote, and the least
//! and largest of its times. `cargo xtask phases` runs nothing else.

use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_cli::live::{Urgent, frame};
use rc10_cli::run::emulation::Emulation;
use rc10_emu::Rig;
use rc10_link::Ask;
use rc10_sim::remote::{Controls, Switch};
use rc10_sim::{Nanos, TraceEntry};

use super::{Setup, commands, is_zero, micros, millis, run};

/// Bits a second of the console, at which a PC is that says nothing unless it is told to.
const CONSOLE: u32 = 2_000_000;
const PHASES: u64 = 50;
/// The robot drives by then.
const STRIKES: Nanos = millis(240);

/// Time at which the fault of a phase strikes. The steps hit every part of a tick, and of 20 ms.
fn strikes(phase: u64) -> Nanos {
    STRIKES + Nanos::new(phase * 401_300)
}

/// Time at which it ends, if it ends: later and later, since pauses between two attempts grow up to
/// 50 ms.
fn heals(phase: u64) -> Nanos {
    strikes(phase) + Nanos::new(60_000_000 + phase * 1_013_000)
}

/// A scenario at every phase; `fault` with what follows its `@`. What it took, in milliseconds, is
/// printed and must lie between two bounds.
fn at_every_phase<const N: usize>(
    fault: &str,
    names: [&str; N],
    bounds: [(f64, f64); N],
    scenario: impl Fn(&mut Emulation<'_>, u64) -> [f64; N],
) {
    let mut spans = [(f64::MAX, 0.0_f64); N];
    for phase in 0..PHASES {
        let at = strikes(phase);
        let micros = |time: Nanos| format!("{}us", time.get() / 1000);
        let fault = fault.replace("{}", &micros(at)).replace("{+}", &micros(heals(phase)));
        let faults = (!fault.is_empty()).then(|| fault.parse().unwrap());
        // The world's own phases, too.
        let faults = faults.into_iter().collect();
        let setup = Setup { seed: phase + 1, faults, console: Some(CONSOLE), ..Setup::default() };
        let took = run(&setup, |emulation| scenario(emulation, phase));
        for (span, took) in spans.iter_mut().zip(took) {
            *span = (span.0.min(took), span.1.max(took));
        }
    }
    for ((name, (least, most)), (from, to)) in names.iter().zip(spans).zip(bounds) {
        println!("{name}: {least:.2} .. {most:.2} ms in {PHASES} phases");
        assert!(least >= from && most <= to, "{name}: {least} .. {most}, not {from} .. {to}");
    }
}

fn since(later: Nanos, earlier: Nanos) -> f64 {
    micros(later.since(earlier)) * 1e-3
}

/// Time at which the last identifier of these buses has got a command without torque.
fn coast(rig: &Rig, buses: &[usize], struck: Nanos) -> Nanos {
    let mut latest = Nanos::ZERO;
    for &bus in buses {
        let before = commands(rig, bus, struck.since(millis(30)));
        let mut ids: Vec<_> =
            before.filter(|entry| entry.end < struck).map(|entry| entry.frame.id()).collect();
        ids.sort();
        ids.dedup();
        assert!(!ids.is_empty(), "bus {}", bus + 1);
        for id in ids {
            let zero = commands(rig, bus, struck)
                .find(|entry| entry.frame.id() == id && is_zero(entry))
                .unwrap_or_else(|| panic!("bus {}: {id:?} is not let go", bus + 1));
            latest = latest.max(zero.end);
        }
    }
    latest
}

/// From the fault to the end of the last coast frame, and from the fault to the restart.
fn crash(emulation: &mut Emulation<'_>, phase: u64, length: u64) -> [f64; 2] {
    let until = emulation.rig.machine.now().max(STRIKES) + millis(length);
    emulation.run(until).unwrap();
    let rig = &emulation.rig;
    // A fault that needs no instruction to be executed strikes when it is due.
    let struck = rig.machine.struck.unwrap_or(strikes(phase));
    let reset = rig.machine.restarts.first().expect("a restart").at;
    [since(coast(rig, &[0, 1, 2], struck), struck), since(reset, struck)]
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_a_hung_executor() {
    let names = ["hung executor: all coast after", "hung executor: reset after"];
    at_every_phase("hang@{}", names, [(3.0, 9.0), (65.0, 100.0)], |emulation, phase| {
        crash(emulation, phase, 20 + 100)
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_a_panic() {
    let names = ["panic: all coast after", "panic: reset after"];
    at_every_phase("panic@{}", names, [(0.0, 1.0); 2], |emulation, phase| {
        crash(emulation, phase, 20 + 3)
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_a_hard_fault() {
    let names = ["HardFault: all coast after", "HardFault: reset after"];
    at_every_phase("hardfault@{}", names, [(0.0, 1.0); 2], |emulation, phase| {
        crash(emulation, phase, 20 + 3)
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_a_crystal_that_stops() {
    let names = ["crystal stops: all coast after", "crystal stops: reset after"];
    at_every_phase("crystal-stops@{}", names, [(0.0, 2.0), (0.0, 100.0)], |emulation, phase| {
        crash(emulation, phase, 20 + 3)
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_a_bus_that_was_off() {
    let name = ["bus-off: back after it was healed by"];
    at_every_phase("short:2@{}..{+}", name, [(0.0, 52.0)], |emulation, phase| {
        let healed = heals(phase);
        emulation.run(healed + millis(55)).unwrap();
        let back = commands(&emulation.rig, 1, healed).next().expect("it is back").start;
        [since(back, healed)]
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_a_lost_motor() {
    let name = ["lost motor: its command is zero after its last feedback by"];
    at_every_phase("", name, [(9.0, 12.5)], |emulation, phase| {
        emulation.run(strikes(phase)).unwrap();
        // The first wheel, M3508 with id 1; the others acknowledge.
        emulation.rig.motors[0].1.set_power(false);
        emulation.run(strikes(phase) + millis(20)).unwrap();
        let key = |id| move |entry: &&TraceEntry| entry.frame.key() == CanFrame::key_of(id);
        let [feedback, command] = [0x201, 0x200].map(|id| StandardId::new(id).unwrap());
        let mut frames = emulation.rig.logs[0].iter();
        let last = frames.rfind(key(feedback)).unwrap().end;
        let zero = commands(&emulation.rig, 0, last)
            .filter(key(command))
            .find(|entry| entry.frame.bytes()[..2] == [0; 2])
            .expect("its lane becomes zero");
        [since(zero.end, last)]
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_an_emergency_stop() {
    let name = ["emergency stop: wheels coast after the remote's last byte by"];
    at_every_phase("", name, [(0.0, 15.0)], |emulation, phase| {
        // Not while a frame is on its way: it would carry older values.
        let sent = |emulation: &Emulation<'_>| emulation.remote.as_ref().unwrap().remote.sent();
        let next_frame = |emulation: &mut Emulation<'_>| {
            let before = sent(emulation).frames;
            while sent(emulation).frames == before {
                let now = emulation.rig.machine.now();
                emulation.run(now + Nanos::new(20_000)).unwrap();
            }
        };
        emulation.run(strikes(phase)).unwrap();
        next_frame(emulation);
        let remote = emulation.remote.as_ref().unwrap().remote.clone();
        remote.set(Controls { left_switch: Switch::Down, ..remote.controls() });
        next_frame(emulation);
        let last_byte = sent(emulation).last_live.unwrap();
        emulation.run(last_byte + millis(25)).unwrap();
        [since(coast(&emulation.rig, &[0], last_byte), last_byte)]
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_a_lost_remote() {
    let name = ["lost remote: wheels coast after its last byte by"];
    at_every_phase("remote-lost@{}", name, [(95.0, 115.0)], |emulation, phase| {
        emulation.run(strikes(phase) + millis(125)).unwrap();
        let last_byte = emulation.remote.as_ref().unwrap().remote.sent().last_live.unwrap();
        [since(coast(&emulation.rig, &[0], last_byte), last_byte)]
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn of_a_stop_by_a_pc() {
    let name = ["stop by a PC: wheels coast after its last byte by"];
    at_every_phase("", name, [(0.0, 5.0)], |emulation, phase| {
        let line = emulation.console.clone().unwrap();
        emulation.run(strikes(phase)).unwrap();
        let bytes = frame(&Ask::Urge { id: 0, what: Urgent::Stop });
        line.send(&bytes);
        let heard =
            strikes(phase) + Nanos::new(bytes.len() as u64 * 10_000_000_000 / u64::from(CONSOLE));
        emulation.run(heard + millis(8)).unwrap();
        [since(coast(&emulation.rig, &[0], heard), heard)]
    });
}
