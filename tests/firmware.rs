//! The firmware's release ELF on the emulated chip: what the README promises of it.
//!
//! `cargo xtask emulate` builds the chip's programs, says where they are, and runs these tests.
//! They print the figures that they judge.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

#[path = "common/scratch.rs"]
mod scratch;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use rc10_can::CanFrame;
use rc10_can::embedded_can::{Id, StandardId};
use rc10_cli::run::emulation::{Emulation, Setup, content_hash};
use rc10_emu::fault::ChipFault;
use rc10_emu::peripherals::{ResetCause, Width};
use rc10_emu::{Board, Figures, Image, Machine, Options, Rig};
use rc10_motor::dji::FeedbackRate;
use rc10_motor::plan::{Extra, Plan, Sort};
use rc10_motor::{Names as _, Place};
use rc10_sim::{BusConfig, EscConfig, Model, Nanos, TraceEntry, World};
use rc10_time::Micros;
use serde_json::Value;
use team::table::Name;
use team::{Motors, Shared};

#[path = "firmware/budgets.rs"]
mod budgets;
#[path = "firmware/crystal.rs"]
mod crystal;
#[path = "firmware/dm_mc02.rs"]
mod dm_mc02;
#[path = "firmware/dma_memory.rs"]
mod dma_memory;
#[path = "firmware/first_board.rs"]
mod first_board;
#[path = "firmware/kept.rs"]
mod kept;
#[path = "firmware/lift.rs"]
mod lift_robot;
#[path = "firmware/line.rs"]
mod line;
#[path = "firmware/live.rs"]
mod live;
#[path = "firmware/matches.rs"]
mod matches;
#[path = "firmware/omni.rs"]
mod omni_robot;
#[path = "firmware/owl.rs"]
mod owl_robot;
#[path = "firmware/phases.rs"]
mod phases;
#[path = "firmware/priorities.rs"]
mod priorities;
#[path = "firmware/remote.rs"]
mod remote;
#[path = "firmware/replay.rs"]
mod replay;
#[path = "firmware/selftest.rs"]
mod selftest;
#[path = "firmware/sequences.rs"]
mod sequences;
#[path = "firmware/swerve.rs"]
mod swerve_robot;
#[path = "firmware/two_boards_uart.rs"]
mod two_boards_on_a_uart;
#[path = "firmware/two_boards.rs"]
mod two_boards_robot;
#[path = "firmware/unread.rs"]
mod unread;
#[path = "firmware/wires.rs"]
mod wires;

/// The file of one of the chip's programs, beside the firmware.
fn program(name: &str) -> Vec<u8> {
    let firmware = std::env::var_os("RC10_FIRMWARE").expect("run this with: cargo xtask emulate");
    let firmware = PathBuf::from(firmware);
    let file = firmware.parent().unwrap_or(Path::new("")).join(name);
    fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

fn firmware() -> &'static [u8] {
    static FILE: OnceLock<Vec<u8>> = OnceLock::new();
    FILE.get_or_init(|| program("team-firmware"))
}

const fn millis(millis: u64) -> Nanos {
    Nanos::new(millis * 1_000_000)
}

fn micros(time: Nanos) -> f64 {
    time.get() as f64 * 1e-3
}

/// The robot's firmware for its board, in the robot's environment.
fn run<R>(setup: &Setup, scenario: impl FnOnce(&mut Emulation<'_>) -> R) -> R {
    give(setup, |mut emulation| scenario(&mut emulation))
}

/// The same, for a scenario that needs it as a whole.
fn give<R>(setup: &Setup, scenario: impl FnOnce(Emulation<'_>) -> R) -> R {
    let ports = team::Ports::new();
    let shared = Shared::new(&ports);
    let mut motors = Motors::new();
    let robot = rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap();
    let file = match setup.board {
        Some(board) if board.name == Board::DM_MC02.name => &program("team-firmware-dm-mc02"),
        _ => firmware(),
    };
    scenario(Emulation::new(file, robot, setup).unwrap())
}

fn setup(faults: &[&str]) -> Setup {
    let faults = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    Setup { seed: 1, faults, ..Setup::default() }
}

/// The same on another board, by the program for that.
fn setup_on(board: Board, faults: &[&str]) -> Setup {
    Setup { board: Some(board), ..setup(faults) }
}

fn log(emulation: &mut Emulation<'_>) -> String {
    let lines = emulation.rig.machine.take_log();
    lines.iter().map(|line| format!("{} {}\n", line.at, line.text)).collect()
}

/// The chip's frames on a bus, from a time on.
fn commands(rig: &Rig, bus: usize, from: Nanos) -> impl Iterator<Item = &TraceEntry> {
    let frames = rig.logs[bus].iter();
    frames.filter(move |entry| entry.from_controller && entry.start >= from)
}

/// Whether a command asks for no torque.
fn is_zero(entry: &TraceEntry) -> bool {
    entry.frame.bytes().iter().all(|&byte| byte == 0)
}

/// Every bus, also one whose motors come back; one that was off for some ticks is on its grid again.
fn keeps_its_period(figures: &Figures) {
    for (number, bus) in (1..).zip(&figures.buses) {
        let period = bus.tick_period.unwrap();
        let [min, mean, max] = [period.min, period.mean(), period.max].map(micros);
        println!("bus {number}: tick period {min:.2} / {mean:.2} / {max:.2} us");
        let missed = if bus.bus_offs > 0 { (max / 1000.0).round() - 1.0 } else { 0.0 };
        let max = max - 1000.0 * missed;
        assert!(min >= 995.0 && max <= 1005.0, "bus {number}: {period:?}");
    }
}

/// Nothing was touched that must not be, and nothing lost.
fn is_clean(rig: &Rig, figures: &Figures) {
    let reports = &rig.machine.reports;
    assert_eq!((figures.unowned_accesses, figures.gated_accesses), (0, 0), "{reports:?}");
    assert!(reports.is_empty(), "{reports:?}");
    assert!(rig.machine.restarts.is_empty(), "{:?}", rig.machine.restarts);
    let fdcan = rig.machine.fdcan();
    assert_eq!(fdcan.ram_misses(), 0);
    for (index, bus) in figures.buses.iter().enumerate() {
        let counters = fdcan.counters(index);
        assert_eq!((counters.protected_writes, counters.bad_acknowledges), (0, 0));
        assert_eq!((bus.lost, bus.foreign), (0, 0), "bus {}", index + 1);
        // Some were on the wires before the controller was.
        let frames = rig.logs[index].iter();
        let early = frames.take_while(|entry| !entry.from_controller).count() as u64;
        let missed = bus.frames - bus.sent - bus.received;
        assert!(missed <= early, "bus {}: {missed} of {early} early: {bus:?}", index + 1);
    }
}

/// Boots within 10 ms, ticks every millisecond, touches nothing that it must not.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn boots_and_keeps_its_period() {
    run(&setup(&[]), |emulation| {
        emulation.run(millis(1200)).unwrap();
        let figures = Figures::of(&emulation.rig);
        let boot = figures.boot.unwrap();
        println!("boot: {:.1} us from the final clock to the first frames", micros(boot));
        assert!(boot > Nanos::ZERO && boot <= millis(10), "{boot}");
        keeps_its_period(&figures);
        assert!(figures.buses.iter().all(|bus| bus.tick_period.unwrap().count >= 1190));
        is_clean(&emulation.rig, &figures);
        let log = log(emulation);
        assert!(log.contains("start, power came\n"), "{log}");
        assert!(log.contains("11 of 11 motors online"), "{log}");
        // DBGMCU_APB4FZ1, bit 18: a probe that halts the core must not stop the watchdog.
        let soc = &mut emulation.rig.machine.soc();
        let frozen = soc.read(0x5C00_1054, Width::Word, millis(1200)).unwrap();
        assert_eq!(frozen & 1 << 18, 0, "{frozen:#x}");
        // GPIOD, PD4: the driver enable of RS-485, which this firmware leaves alone, is an input that
        // is pulled down. MODER, PUPDR.
        let [mode, pull] = [0x5802_0C00, 0x5802_0C0C]
            .map(|register| soc.read(register, Width::Word, millis(1200)).unwrap() >> 8 & 0b11);
        assert_eq!((mode, pull), (0b00, 0b10));
    });
}

/// At more than 99 % load nothing is lost, also by a slow core.
fn loses_nothing(speed: Option<u64>, faults: &[&str]) {
    let load = ["load:1@0.2s..1.2s", "load:2@0.2s..1.2s", "load:3@0.2s..1.2s"];
    let setup = Setup { speed, ..setup(&[&load[..], faults].concat()) };
    run(&setup, |emulation| {
        emulation.run(millis(200)).unwrap();
        let busy = |rig: &Rig| rig.buses.iter().map(|bus| bus.load()).collect::<Vec<_>>();
        let before = busy(&emulation.rig);
        emulation.run(millis(1200)).unwrap();
        let figures = Figures::of(&emulation.rig);
        for (bus, (before, after)) in before.into_iter().zip(busy(&emulation.rig)).enumerate() {
            // Per cent of 0.2 s and of 1.2 s.
            let load = after * 1.2 - before * 0.2;
            let received = figures.buses[bus].received;
            println!("bus {}: load {load:.2} %, {received} received, 0 lost", bus + 1);
            assert!(load >= 99.0, "bus {}: {load}", bus + 1);
        }
        is_clean(&emulation.rig, &figures);
        let log = log(emulation);
        let last = log.lines().last().unwrap();
        assert!(last.contains("11 of 11 motors online"), "{last}");
        // The firmware's own words: of each bus, and of its motors.
        for loss in [" lost", "malformed", "bus-off"] {
            assert!(!last.contains(loss), "{last}");
        }
        // The supervisor looks every 4 ms: it may well see that no bus ticks for 5 ms.
        assert!(!last.contains("stalled") || !faults.is_empty(), "{last}");
        assert_eq!(last.matches(" received").count(), 3, "{last}");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn loses_nothing_on_full_buses() {
    loses_nothing(None, &[]);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn loses_nothing_on_a_slow_core() {
    loses_nothing(Some(120_000_000), &[]);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn loses_nothing_while_interrupts_are_masked() {
    loses_nothing(None, &["mask@0.7s..0.705s"]);
}

/// What was received 60 us before a frame is to leave decides what that frame says.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn feedback_waits_for_60_us_at_most() {
    let full = ["load:1@0.2s..1.2s", "load:2@0.2s..1.2s", "load:3@0.2s..1.2s"];
    let longest = feedback_waits(&full).max(feedback_waits(&[]));
    // Some came so late that they had to wait: else nothing was measured.
    assert!((30_000..=60_000).contains(&longest), "{longest}");
}

/// The feedback of one motor a bus is a frame of the test's own, fast in the other direction each time.
fn feedback_waits(faults: &[&str]) -> u64 {
    let mut all = 0;
    // Identifiers of feedback and command, the place in the command, and a fast rotor, rpm.
    let motors = [
        (Name::WheelFrontLeft, 0x201, 0x200_u16, 0, 9000_i16),
        (Name::GimbalYaw, 0x205, 0x1FE, 0, 400),
        (Name::LiftFrontLeft, 0x201, 0x200, 0, 9000),
    ];
    run(&setup(faults), |emulation| {
        emulation.run(millis(400)).unwrap();
        motors.iter().for_each(|motor| emulation.motors[motor.0 as usize].set_feedback(false));
        // The shafts stand where they were.
        let angles = [0, 1, 2].map(|bus| {
            let id = Id::Standard(StandardId::new(motors[bus].1).unwrap());
            let frames = &emulation.rig.logs[bus];
            let newest = frames.iter().rfind(|entry| entry.frame.id() == id).unwrap();
            [newest.frame.bytes()[0], newest.frame.bytes()[1]]
        });
        for tick in 0..700 {
            for (bus, (_, id, .., rpm)) in motors.into_iter().enumerate() {
                let [high, low] = (if tick % 2 == 0 { rpm } else { -rpm }).to_be_bytes();
                let ([a, b], id) = (angles[bus], StandardId::new(id).unwrap());
                let frame = CanFrame::eight_bytes(id, [a, b, high, low, 0, 0, 25, 0]);
                emulation.rig.buses[bus].inject(&frame);
            }
            // The phases of a millisecond, one after the other.
            emulation.run(emulation.rig.machine.now() + Nanos::new(997_000)).unwrap();
        }
        for (bus, (_, feedback, command, place, _)) in motors.into_iter().enumerate() {
            let frames = &emulation.rig.logs[bus];
            let is = |entry: &&TraceEntry, id| {
                entry.frame.id() == Id::Standard(StandardId::new(id).unwrap())
                    && entry.start > millis(420)
            };
            let sign = |entry: &TraceEntry, at: usize| entry.frame.bytes()[at] & 0x80 != 0;
            let heard: Vec<_> = frames.iter().filter(|entry| is(entry, feedback)).collect();
            let sent: Vec<_> = frames.iter().filter(|entry| is(entry, command)).collect();
            // A frame on the wire may delay one of ours: the grid is where the earliest ones begin.
            let late = |entry: &TraceEntry| {
                (entry.start.get() + 500_000 - sent[0].start.get()) % 1_000_000
            };
            let grid = sent.iter().map(|entry| late(entry)).min().unwrap();
            let (mut longest, mut judged) = (0, 0);
            for entry in &sent {
                let leaves = entry.start.get() - (late(entry) - grid);
                let known = heard.iter().rev().filter(|it| it.end.get() < leaves);
                // It pushes against the speed that it knows of.
                let used = known.clone().position(|it| sign(it, 2) != sign(entry, place));
                let Some(used) = used else { continue };
                if let Some(newer) = used.checked_sub(1).and_then(|at| known.clone().nth(at)) {
                    longest = longest.max(leaves - newer.end.get());
                }
                judged += 1;
            }
            // Nor does a command leave later than the compiler computed it, on a bus that others fill, too.
            #[expect(clippy::cast_possible_truncation, reason = "three buses")]
            let plan = Plan::of(Name::ENTRIES, Place::Bus(bus as u8 + 1), Extra::default());
            let of_command =
                |sort: &Sort| sort.is_command && sort.frames.pattern.raw() == u32::from(command);
            let place = plan.sorts().iter().position(of_command).unwrap();
            let within = plan.response(place).unwrap();
            let took =
                |entry: &&TraceEntry| late(entry) - grid + entry.end.get() - entry.start.get();
            let latest = sent.iter().map(took).max();
            let latest = latest.unwrap() / 1000;
            println!(
                "bus {}: a command arrived after {latest} us at most, {within} computed",
                bus + 1
            );
            assert!(latest <= within.into(), "bus {}: {latest} {within}", bus + 1);
            println!("bus {}: newer feedback waited {longest} ns at most, of {judged}", bus + 1);
            assert!(judged > 600, "bus {}: {judged}", bus + 1);
            all = all.max(longest);
        }
    });
    all
}

/// Cost of one more received frame, all in; cost of a whole second.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn instructions_stay_within_their_budgets() {
    let second = |rate| {
        let setup = Setup { rate: Some(rate), ..setup(&[]) };
        run(&setup, |emulation| {
            emulation.run(millis(200)).unwrap();
            let before = Figures::of(&emulation.rig);
            emulation.run(millis(1200)).unwrap();
            let after = Figures::of(&emulation.rig);
            let spent = after.instructions - before.instructions;
            (spent, after.received() - before.received(), after)
        })
    };
    let (many, many_frames, figures) = second(FeedbackRate::Hz1000);
    let (few, few_frames, _) = second(FeedbackRate::Hz500);
    assert!(many_frames > few_frames + 5000, "{many_frames} {few_frames}");
    println!("{many} instructions with {many_frames} frames, {few} with {few_frames}");
    let per_frame = many.saturating_sub(few) / (many_frames - few_frames);
    // Three buses tick a thousand times.
    let per_tick = many / 3000;
    budgets::judge(firmware(), &figures, many, per_tick, per_frame);
}

/// The cycles of a tick in the firmware's log, by the chip's cycle counter, are those it took.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn ticks_take_the_cycles_that_the_log_says() {
    const STEP: Nanos = Nanos::new(10_000);
    run(&setup(&[]), |emulation| {
        // Clocks of all that the executor of the buses does in a millisecond, and its longest wake.
        let mut wakes: Vec<(Nanos, u64)> = Vec::new();
        let (mut clocks, mut now) = (0, Nanos::ZERO);
        while now < millis(1500) {
            now = now + STEP;
            emulation.run(now).unwrap();
            let costs = emulation.rig.machine.profile.by_exception();
            let cost = costs.iter().find(|cost| cost.exception == priorities::BUSES_EXCEPTION);
            let before = std::mem::replace(&mut clocks, cost.map_or(0, |cost| cost.clocks));
            if clocks == before {
                continue;
            }
            match wakes.last_mut() {
                Some((at, wake)) if now.since(*at) <= STEP => {
                    (*at, *wake) = (now, *wake + clocks - before);
                }
                _ => wakes.push((now, clocks - before)),
            }
        }
        let log = log(emulation);
        let last = log.lines().last().unwrap();
        let numbers = last.split_once("; ticks take ").unwrap().1;
        let numbers: Vec<f64> =
            numbers.split([' ', '(']).filter_map(|word| word.parse().ok()).collect();
        let [mean, apart, percent, most] = numbers[..] else { panic!("{last}") };
        let newest = wakes.iter().filter(|(at, _)| *at >= millis(1000));
        let newest: Vec<f64> = newest.map(|&(_, clocks)| clocks as f64).collect();
        assert!(newest.len().abs_diff(2000) <= 2, "{}", newest.len());
        let took = newest.iter().sum::<f64>() / newest.len() as f64;
        let longest = wakes.iter().map(|&(_, clocks)| clocks).max().unwrap() as f64;
        println!("mean {took:.0} cycles a tick, {mean} by the log; most {longest}, {most}");
        assert!((mean - took).abs() <= 0.03 * took, "{last}");
        assert!((most - longest).abs() <= 0.03 * longest, "{last}");
        assert!(
            (apart - 120_000.0).abs() < 0.5 && (percent - mean / 1200.0).abs() <= 0.1,
            "{last}"
        );
    });
}

/// Time at which the first of bus 2's motors is heard again.
fn online_again(rig: &Rig, healed: Nanos) -> Nanos {
    let mut frames = rig.logs[1].iter();
    frames.find(|entry| !entry.from_controller && entry.end > healed).unwrap().end
}

/// An unplugged bus does not go off: frames that waited are not sent when it is plugged in again.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn an_unplugged_bus_sends_nothing_old() {
    for fault in ["cut:2@300ms..350ms", "power:2@300ms..350ms"] {
        let (broken, healed) = (millis(300), millis(350));
        run(&setup(&[fault]), |emulation| {
            emulation.run(millis(600)).unwrap();
            let rig = &emulation.rig;
            let torque =
                |from, to| commands(rig, 1, from).any(|entry| entry.start < to && !is_zero(entry));
            assert!(torque(millis(200), broken), "the gimbal moves before");
            assert!(!torque(broken, online_again(rig, healed)), "{fault}: old torque");
            assert!(torque(healed, millis(600)), "{fault}: the gimbal does not move again");
            let figures = Figures::of(rig);
            let bus = &figures.buses[1];
            println!("{fault}: {} transmissions failed", bus.failed);
            assert!(bus.failed > 32 && bus.bus_offs == 0, "{bus:?}");
            // This bus too: also in the ticks where its motors come back.
            keeps_its_period(&figures);
        });
    }
}

/// A frame after a silence costs more than one that comes always.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn ticks_keep_their_period_while_motors_come_back() {
    // At several phases of motors and ticks.
    for fault in ["power:1@300ms..340.3ms", "cut:1@300ms..350.7ms", "power:3@300.2ms..345ms"] {
        run(&setup(&[fault]), |emulation| {
            emulation.run(millis(450)).unwrap();
            println!("{fault}");
            keeps_its_period(&Figures::of(&emulation.rig));
            assert!(log(emulation).lines().last().unwrap().contains("11 of 11 motors online"));
        });
    }
}

/// Bus 2 is unplugged, then shorted until it is off, then healed.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_broken_bus_leaves_the_others_alone_and_comes_back() {
    let (broken, healed) = (millis(300), millis(450));
    let faults = ["cut:2@300ms..350ms", "short:2@350ms..450ms"];
    run(&setup(&faults), |emulation| {
        emulation.run(millis(1200)).unwrap();
        let rig = &emulation.rig;
        let figures = Figures::of(rig);
        keeps_its_period(&figures);
        let torque =
            |from, to| commands(rig, 1, from).any(|entry| entry.start < to && !is_zero(entry));
        assert!(torque(millis(200), broken), "the gimbal moves before");
        let online = online_again(rig, healed);
        assert!(!torque(broken, online), "torque was asked for on a broken bus");
        let back = commands(rig, 1, healed).next().unwrap().start;
        let enabled = commands(rig, 1, healed).find(|entry| !is_zero(entry)).unwrap().start;
        println!(
            "bus 2: back {:.2} ms after it was healed, torque after {:.2} ms",
            micros(back.since(healed)) * 1e-3,
            micros(enabled.since(healed)) * 1e-3
        );
        assert!(enabled > back, "its first command is one of before");
        assert!(enabled.since(healed) <= millis(100));
        let bus = &figures.buses[1];
        println!("bus 2: {} transmissions failed, {} times bus-off", bus.failed, bus.bus_offs);
        assert!(bus.bus_offs > 1 && bus.failed > 32);
        assert_eq!((figures.buses[0].bus_offs, figures.buses[2].bus_offs), (0, 0));
        assert!(rig.machine.restarts.is_empty());
        // The firmware tells the same story.
        let log = log(emulation);
        let at = |time: &str| log.lines().find(|line| line.starts_with(time)).unwrap();
        assert!(at("0.40").contains("bus 2 bus-off"), "{log}");
        assert!(log.contains("alone on the bus"), "{log}");
        let last = log.lines().last().unwrap();
        assert_eq!(last.matches("error active").count(), 3, "{last}");
        assert!(last.contains("11 of 11 motors online"), "{last}");
    });
}

/// No memory is written before the supply is chosen. Programs with cortex-m-rt's own start do.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn memory_waits_for_the_supply() {
    let reports = |file: &[u8]| {
        let options = Options { reports_early_ram: true, ..Options::default() };
        let mut machine = Machine::with(file, options).unwrap();
        machine.run(&mut World::new(1), millis(3)).unwrap();
        format!("{:?}", machine.reports)
    };
    assert_eq!(reports(firmware()), "[]");
    assert_ne!(reports(&program("superloop-embassy")), "[]");
}

/// The log's buffer has the size that `firmware/.cargo/config.toml` asks for.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_log_has_its_buffer() {
    let image = Image::parse(firmware()).unwrap();
    let buffers = image.statics.iter().filter(|item| item.name.contains("defmt_rtt"));
    let bytes: Vec<_> = buffers.map(|item| item.bytes).collect();
    assert!(bytes.contains(&3072), "{bytes:?}");
}

/// A controller that has fallen into restricted operation sends nothing: it is sent back in its next
/// tick, and that is told.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_controller_in_restricted_operation_is_sent_back_and_told() {
    run(&setup(&[]), |emulation| {
        // Between two ticks. FDCAN1's CCCR: INIT, CCE, ASM; ASM stays when the others go.
        let struck = 400_400_000;
        for (micros, value) in [(0, 0b011), (20, 0b111), (40, 0b100)] {
            emulation.run(Nanos::new(struck + micros * 1000)).unwrap();
            let soc = &mut emulation.rig.machine.soc();
            let now = Nanos::new(struck + micros * 1000);
            soc.write(0x4000_A018, Width::Word, value, now).unwrap();
        }
        emulation.run(millis(700)).unwrap();
        let after = Nanos::new(struck + 40_000);
        let next = commands(&emulation.rig, 0, after).next().unwrap().start;
        println!("bus 1 sends again after {:.2} ms", micros(next.since(after)) * 1e-3);
        assert!(next.since(after) <= millis(2));
        let log = log(emulation);
        let last = log.lines().last().unwrap();
        assert_eq!(last.matches("1 times restricted").count(), 1, "{last}");
        assert!(!last.contains("bus-off"), "{last}");
    });
}

/// From a moment on every bus carries its coast image: for every identifier that was commanded
/// before, a frame without torque, and until `armed` no other. When the last of them has ended.
fn coasts(rig: &Rig, struck: Nanos, armed: Nanos) -> Nanos {
    let mut latest = Nanos::ZERO;
    for bus in 0..3 {
        let before = commands(rig, bus, millis(300));
        let before: Vec<_> = before.filter(|entry| entry.end < struck).collect();
        assert!(before.iter().any(|entry| !is_zero(entry)), "bus {}", bus + 1);
        let mut ids: Vec<_> = before.iter().map(|entry| entry.frame.id()).collect();
        ids.sort();
        ids.dedup();
        for id in ids {
            let coast = commands(rig, bus, struck)
                .find(|entry| entry.frame.id() == id && is_zero(entry))
                .unwrap_or_else(|| panic!("bus {}: no coast frame for {id:?}", bus + 1));
            latest = latest.max(coast.end);
            let torque = commands(rig, bus, coast.end)
                .find(|entry| entry.frame.id() == id && !is_zero(entry));
            assert!(torque.is_none_or(|entry| entry.start > armed), "{torque:?}");
        }
    }
    latest
}

/// After a crash every bus carries its coast image, nothing else; the restarted program knows why,
/// and asks for no torque until it is armed.
fn crashes_safely(fault: &str, within: Nanos, cause: ResetCause, words: &[&str]) {
    crashes_safely_on(Board::H723ZG, fault, within, cause, words);
}

fn crashes_safely_on(board: Board, fault: &str, within: Nanos, cause: ResetCause, words: &[&str]) {
    run(&setup_on(board, &[fault]), |emulation| {
        emulation.run(millis(700)).unwrap();
        let rig = &emulation.rig;
        // A fault that needs no instruction to be executed strikes when it is due: see the callers.
        let struck = rig.machine.struck.unwrap_or(millis(400));
        let restarts = &rig.machine.restarts;
        assert_eq!(restarts.len(), 1, "{restarts:?}");
        assert_eq!(restarts[0].cause, cause);
        // The script arms the robot 100 ms after its start.
        let latest = coasts(rig, struck, restarts[0].at + millis(100));
        let reset = restarts[0].at.since(struck);
        println!(
            "{fault}: all coast after {:.2} ms, reset after {:.2} ms",
            micros(latest.since(struck)) * 1e-3,
            micros(reset) * 1e-3
        );
        assert!(latest.since(struck) <= within, "{}", latest.since(struck));
        assert!(reset <= millis(100), "{reset}");
        let log = log(emulation);
        for word in words {
            assert!(log.contains(word), "{word} is not in:\n{log}");
        }
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_panic_makes_every_bus_safe() {
    let words = ["the last run ended in a crash: Panic", "injected.rs", "2300"];
    crashes_safely("panic@0.4s", millis(2), ResetCause::Software, &words);
}

/// The coast image leaves although the FDCANs' clock was gone, and so do all frames after the restart,
/// by a core and bit rates on HSI.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_crystal_that_stops_makes_every_bus_safe() {
    let words = [
        "the last run ended in a crash: CrystalStopped",
        "the crystal does not start",
        "disarmed, cannot be armed: the crystal does not work or is another, 11 of 11 motors online",
    ];
    crashes_safely("crystal-stops@0.4s", millis(2), ResetCause::Software, &words);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_hard_fault_makes_every_bus_safe() {
    let words = ["the last run ended in a crash: Fault"];
    crashes_safely("hardfault@0.4s", millis(2), ResetCause::Software, &words);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_hung_control_task_makes_every_bus_safe() {
    let words = ["the last run ended in a crash: Watchdog, hung at 0x"];
    crashes_safely("hang@0.4s", millis(10), ResetCause::Watchdog, &words);
}

/// A function of the team's robot that a task calls every 10 ms.
const OF_A_TASK: &str = "team::mechanisms::follow";
/// `B` to itself.
const LOOP: [u8; 2] = [0xFE, 0xE7];

/// What hangs is named by the next run, and by its function in what the command says: a handler, a task; not where
/// nothing of ours runs any more.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn what_hangs_has_a_name() {
    let scratch = scratch::Scratch::new("what_hangs");
    // A task that loops for ever, in the file.
    let mut file = firmware().to_vec();
    let image = Image::parse(&file).unwrap();
    let function = image.functions.iter().find(|(_, name)| *name == OF_A_TASK).unwrap();
    let (start, bytes) = image
        .segments
        .iter()
        .find(|(start, bytes)| (function.0.wrapping_sub(*start) as usize) < bytes.len())
        .unwrap();
    let code = &bytes[(function.0 - start) as usize..][..64];
    let mut places = (0..file.len() - 64).filter(|&at| file[at..at + 64] == *code);
    let (Some(place), None) = (places.next(), places.next()) else { panic!("{function:?}") };
    file[place..place + 2].copy_from_slice(&LOOP);
    let busy = scratch.join("busy");
    fs::write(&busy, &file).unwrap();

    let sound = PathBuf::from(std::env::var_os("RC10_FIRMWARE").unwrap());
    let said = |file: &Path, arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_rc10"))
            .args(["emu", "--strict", "--seconds", "0.5", "--out"])
            .arg(scratch.join("out"))
            .arg(file)
            .args(arguments)
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let text = said(&busy, &[]);
    let named = format!("Watchdog, hung in {OF_A_TASK}");
    assert!(text.contains(&format!("CHIP  restart, cause: {named}")), "{text}");
    assert!(text.contains(&format!("ms: {named}")), "no problem names it: {text}");
    for (fault, name) in [("hang@0.3s", "UART9"), ("hang:UART5@0.3s", "UART5")] {
        let text = said(&sound, &["--fault", fault]);
        let words = format!("CHIP  restart, cause: Watchdog, hung in {name}\n");
        assert!(text.contains(&words), "{fault}: {text}");
    }
    // Above the supervisor, or with interrupts masked, nothing looks.
    for fault in ["hang:TIM2@0.3s", "mask@0.3s"] {
        let text = said(&sound, &["--fault", fault]);
        assert!(text.contains("CHIP  restart, cause: Watchdog\n"), "{fault}: {text}");
    }
}

/// The supervisor's looks may fall into the buses' ticks, all of them: a task that hangs is named all the same.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn what_hangs_is_named_at_every_phase_of_the_supervisor() {
    const TIM7: u32 = 0x4000_1400;
    // Ticks take some 24 us, three of them a millisecond.
    for phase in 0..14 {
        run(&setup(&[]), |emulation| {
            emulation.run(millis(150)).unwrap();
            let machine = &emulation.rig.machine;
            let functions = &machine.image.functions;
            let (&start, _) = functions.iter().find(|(_, name)| *name == OF_A_TASK).unwrap();
            let mut whole = [0; 2];
            machine.memory.read(start, &mut whole).unwrap();
            machine.memory.write(start, &LOOP).unwrap();
            let mut soc = machine.soc();
            let period = soc.read(TIM7 + 0x2C, Width::Word, machine.now()).unwrap();
            let count = period / 4000 * 24 * phase;
            soc.write(TIM7 + 0x24, Width::Word, count, machine.now()).unwrap();
            drop(soc);
            while emulation.rig.machine.restarts.is_empty() {
                let next = emulation.rig.machine.now() + millis(1);
                emulation.run(next).unwrap();
            }
            emulation.rig.machine.memory.write(start, &whole).unwrap();
            let soon = emulation.rig.machine.now() + millis(10);
            emulation.run(soon).unwrap();
            let log = log(emulation);
            let words = format!("crash: Watchdog, hung at {start:#010x}");
            assert!(log.contains(&words), "phase {phase}: {words} is not in {log}");
        });
    }
}

/// What is late and comes back has not hung: the next reset is no hang, whatever it is.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn what_was_only_late_is_forgotten() {
    run(&setup(&["hang@0.3s..0.365s"]), |emulation| {
        emulation.run(millis(500)).unwrap();
        assert!(emulation.rig.machine.restarts.is_empty());
        emulation.rig.machine.inject(&ChipFault::Mask, true).unwrap();
        emulation.run(millis(700)).unwrap();
        assert_eq!(emulation.rig.machine.restarts[0].cause, ResetCause::Watchdog);
        let log = log(emulation);
        assert!(log.contains("crash: Watchdog\n"), "{log}");
    });
}

/// Nothing may read system flash: the fault is precise, and the record has the address.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn system_flash_is_out_of_bounds() {
    run(&setup(&[]), |emulation| {
        emulation.run(millis(300)).unwrap();
        let machine = &emulation.rig.machine;
        let functions = &machine.image.functions;
        let (&start, _) = functions.iter().find(|(_, name)| *name == OF_A_TASK).unwrap();
        // MOVW R0, #0xE800; MOVT R0, #0x1FF1; LDR R0, [R0]: the chip's unique number.
        let code = [0xF64E_u16, 0x0000, 0xF6C1, 0x70F1, 0x6800].map(u16::to_le_bytes);
        let mut whole = [0; 10];
        machine.memory.read(start, &mut whole).unwrap();
        machine.memory.write(start, code.as_flattened()).unwrap();
        emulation.run(millis(315)).unwrap();
        let machine = &emulation.rig.machine;
        assert_eq!(machine.restarts.len(), 1, "{:?}", machine.restarts);
        machine.memory.write(start, &whole).unwrap();
        emulation.run(millis(350)).unwrap();
        let log = log(emulation);
        // MMFSR: MMARVALID, DACCVIOL.
        let pc = start + 8;
        let words = format!("Fault {{ program_counter: {pc}, ");
        let of = format!("status: {}, address: {} }}", 0x82, 0x1FF1_E800);
        assert!(log.contains(&words) && log.contains(&of), "{words} {of} {log}");
    });
}

/// A coast image that is being cancelled when the program crashes, on a bus that heals a moment later.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_coast_image_that_is_being_cancelled_is_sent_all_the_same() {
    for micros in [420_010, 420_030, 420_060, 420_090] {
        let panic = format!("panic@{micros}us");
        let setup = setup(&["cut:1@0.39s..0.4207s", "hang@0.4s..0.42s", &panic]);
        run(&setup, |emulation| {
            emulation.run(millis(500)).unwrap();
            let rig = &emulation.rig;
            let restart = rig.machine.restarts[0].at;
            let coast = commands(rig, 0, Nanos::new(420_700_000));
            let coast = coast.filter(|entry| entry.end < restart).count();
            println!("{panic}: {coast} coast frames on bus 1, restart at {restart}");
            assert!(coast > 0 && restart < Nanos::new(430_000_000), "{coast}, {restart}");
        });
    }
}

/// The buses' executor hangs for 20 ms, which the watchdog does not mind.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_stall_is_survived_without_a_restart() {
    run(&setup(&["hang@0.4s..0.42s"]), |emulation| {
        emulation.run(millis(800)).unwrap();
        let rig = &emulation.rig;
        let (struck, ended) = (rig.machine.struck.unwrap(), millis(420));
        assert!(rig.machine.restarts.is_empty(), "{:?}", rig.machine.restarts);
        let coast = coasts(rig, struck, ended).since(struck);
        println!("20 ms without the buses: all coast after {:.2} ms", micros(coast) * 1e-3);
        assert!(coast <= millis(10), "{coast}");
        // The wheels' torque currents, of the C620's 16384 for 20 A.
        let largest = |from, to| {
            let frames = commands(rig, 0, from).filter(|entry| entry.end < to);
            let currents = frames.flat_map(|entry| {
                let bytes = entry.frame.bytes().as_chunks().0.to_vec();
                bytes.into_iter().map(|bytes| i16::from_be_bytes(bytes).unsigned_abs())
            });
            currents.max().unwrap()
        };
        let before = largest(millis(380), struck);
        let again = largest(ended, millis(425));
        println!("largest torque current {before} before, {again} after");
        // No integral has wound up meanwhile.
        assert!(again > 100 && again < 2 * before, "{again} {before}");
        let log = log(emulation);
        let last = log.lines().last().unwrap();
        assert_eq!(last.matches(", 1 times stalled").count(), 3, "{last}");
        assert!(last.contains("armed, 11 of 11 motors online"), "{last}");
    });
}

/// The same seed gives the same frames, another one others.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_run_can_be_repeated() {
    let hash = |seed| {
        run(&Setup { seed, ..setup(&["noise:1@0.2s"]) }, |emulation| {
            emulation.run(millis(400)).unwrap();
            content_hash(&emulation.rig)
        })
    };
    assert_eq!(hash(1), hash(1));
    assert_ne!(hash(1), hash(2));
}

fn rc10_emu(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rc10"));
    let file = std::env::var_os("RC10_FIRMWARE").unwrap();
    let output = command.arg("emu").arg(file).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The command tells everything, in the order in which it happened.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_command_tells_what_happened() {
    let faults = ["--seconds", "0.4", "--fault", "hang@0.3s..0.31s", "--fault", "panic@0.35s"];
    let text = rc10_emu(&faults);
    let story = [
        "start",
        "fault hang begins",
        "fault hang ends",
        "fault panic",
        "CHIP  restart, cause: Software",
        "the last run ended in a crash: Panic",
        "s on the emulated chip",
        "tick period us",
        "million a second",
        "thread mode",
    ];
    let mut rest = text.as_str();
    for part in story {
        let at =
            rest.find(part).unwrap_or_else(|| panic!("{part} is not, or too early, in:\n{text}"));
        rest = &rest[at..];
    }
    let times = text.lines().map_while(|line| line.split_once(" ms  "));
    let times: Vec<f64> = times.map(|(time, _)| time.trim().parse().unwrap()).collect();
    assert!(times.len() > 6 && times.is_sorted(), "{text}");

    let json = rc10_emu(&[&faults[..], &["--json"]].concat());
    let figures: Value = serde_json::from_str(&json).unwrap();
    for number in
        ["frames", "rx_lost", "instructions", "stack_bytes", "unowned_accesses", "gated_accesses"]
    {
        assert!(figures[number].is_u64(), "{number}: {json}");
    }
    let period = &figures["tick_period_us"];
    let [min, mean, max] = ["min", "mean", "max"].map(|name| period[name].as_f64().unwrap());
    assert!(0.0 < min && min < mean && mean < max, "{period}");
    assert_eq!(figures["restarts"][0]["cause"], "Software");
    // Another process, and the same frames.
    let hash = figures["content_hash"].as_str().unwrap();
    assert!(hash.len() == 64 && text.contains(hash), "{json}");
}

/// Response of a motor: root of the mean square of its distance from the reference, and how long
/// it needs after a moment to stay within a band around where it ends up.
struct Response {
    error: f64,
    settled: Micros,
}

fn response(measured: &[f64], wanted: &[f64], band: f64) -> Response {
    let pairs = measured.iter().zip(wanted);
    let squares: f64 = pairs.map(|(is, shall)| (is - shall).powi(2)).sum();
    let last = *measured.last().unwrap();
    let outside = measured.iter().rposition(|is| (is - last).abs() > band).unwrap_or(0);
    Response {
        error: (squares / measured.len() as f64).sqrt(),
        settled: Micros::from_millis(outside as u64),
    }
}

/// The first millisecond in which it turns.
fn onset(rpm: &[f64]) -> usize {
    rpm.iter().position(|rpm| rpm.abs() > 1.0).unwrap()
}

/// The robot moves as it does in the simulator.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_chip_drives_as_the_simulator_does() {
    // The operator: forward from 200 ms on, to the left from 1100 ms on.
    let end = 1050_u64;
    let wheel = Name::WheelFrontLeft as usize;
    let simulated: Vec<(f64, f64)> = {
        let ports = team::Ports::new();
        let shared = Shared::new(&ports);
        let mut motors = Motors::new();
        let robot = rc10_cli::robot_of::<team::Robot>(&shared, &mut motors).unwrap();
        let description = robot.description().clone();
        let mut around = rc10_cli::world::environment::Environment::new(&description, 1).unwrap();
        let mut tasks = robot.tasks(&around).unwrap();
        (1..=end)
            .map(|millisecond| {
                let until = Micros::from_millis(millisecond);
                around.run(&mut tasks, until);
                let target = match shared.motor(Name::WheelFrontLeft).status().target {
                    rc10_motor::Target::Motion(motion) => f64::from(motion.speed.get()),
                    _ => 0.0,
                };
                (around.motors[wheel].state().output_rpm, target)
            })
            .collect()
    };
    let emulated: Vec<f64> = run(&setup(&[]), |emulation| {
        (1..=end)
            .map(|millisecond| {
                emulation.run(millis(millisecond)).unwrap();
                emulation.motors[wheel].state().output_rpm
            })
            .collect()
    });
    let wanted: Vec<f64> = simulated.iter().map(|sample| sample.1).collect();
    let simulated: Vec<f64> = simulated.iter().map(|sample| sample.0).collect();
    assert!(wanted.iter().any(|&rpm| rpm > 100.0), "{wanted:?}");
    // The time at which the wheel begins depends on how the receiver's 14 ms, the driver's 10
    // and the chassis's 5 lie to each other, and the chip boots some milliseconds after the world
    // begins; how the wheel moves then does not.
    let onsets = [&simulated, &emulated].map(|rpm| onset(rpm));
    println!("the wheel turns at {} ms simulated, {} ms on the chip", onsets[0], onsets[1]);
    assert!(onsets[0].abs_diff(onsets[1]) <= 29);
    let length = 780;
    let wanted = &wanted[onsets[0]..][..length];
    let [here, there] = [(&simulated, onsets[0]), (&emulated, onsets[1])]
        .map(|(rpm, onset)| response(&rpm[onset..][..length], wanted, 0.05 * wanted[length - 1]));
    println!(
        "wheel: tracking error {:.3} rpm simulated, {:.3} rpm on the chip; settled after {} and {}",
        here.error, there.error, here.settled, there.settled
    );
    // Half a per cent of the speed: by which millisecond of its period the chassis task speaks.
    assert!((here.error - there.error).abs() <= 0.5);
    let [here, there] = [here.settled, there.settled].map(|time| time.get() as f64);
    assert!(here > 50_000.0 && (here - there).abs() <= 0.05 * here, "{here} {there}");
}

/// The world of firmware/interop: an M3508 and a GM6020 on bus 1. Its programs leave the FDCANs' clock
/// calibration unit alone, as ST's HAL does: on a chip that lets them.
fn interop(name: &str, faults: &[&str]) -> Rig {
    interop_on(Options { calibration_needed: false, ..Options::default() }, name, faults)
}

fn interop_on(options: Options, name: &str, faults: &[&str]) -> Rig {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let models = [Model::C620, Model::Gm6020Voltage];
    let motors = models.map(|model| (0, bus.add_esc(EscConfig::new(model, 1)).unwrap()));
    let machine = Machine::with(&program(name), options).unwrap();
    let faults: Vec<_> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    Rig::new(machine, world, vec![bus], vec![], motors.into(), &faults).unwrap()
}

/// On the chip of the manual's stricter reading such a program hears its motors and says nothing.
#[test]
#[ignore = "needs the chip's programs: cargo xtask emulate"]
fn a_program_that_leaves_the_calibration_unit_alone_sends_nothing() {
    for name in ["superloop-embassy", "superloop-fdcan"] {
        let mut rig = interop_on(Options::default(), name, &[]);
        rig.run(millis(100)).unwrap();
        let bus = &Figures::of(&rig).buses[0];
        println!("{name}: {} sent, {} received", bus.sent, bus.received);
        assert!(bus.sent == 0 && bus.received > 100, "{bus:?}");
        // CCCR.ASM: restricted operation.
        let (now, mut fdcan) = (rig.machine.now(), rig.machine.fdcan());
        assert_eq!(fdcan.read(0, 0x18, now).unwrap() & 0b101, 0b100);
    }
}

/// Drivers of other people's run on the model as they are.
fn drives_with(name: &str) {
    let mut rig = interop(name, &[]);
    rig.run(millis(600)).unwrap();
    let figures = Figures::of(&rig);
    let bus = &figures.buses[0];
    println!("{name}: {} sent, {} received, {} lost", bus.sent, bus.received, bus.lost);
    assert!(bus.sent > 1000 && bus.received > 1000, "{bus:?}");
    assert_eq!((figures.unowned_accesses, figures.gated_accesses), (0, 0));
    assert!(rig.machine.restarts.is_empty());
    // It asks its M3508 for 60 rpm.
    let rpm = rig.motors[0].1.state().output_rpm;
    assert!((rpm - 60.0).abs() < 6.0, "{rpm} rpm");
}

#[test]
#[ignore = "needs the chip's programs: cargo xtask emulate"]
fn embassys_buffered_can_drives_a_motor() {
    drives_with("superloop-embassy");
}

#[test]
#[ignore = "needs the chip's programs: cargo xtask emulate"]
fn the_fdcan_crate_drives_a_motor() {
    drives_with("superloop-fdcan");
}

/// The scenario that our driver survives with three full buses is not an easy one.
#[test]
#[ignore = "needs the chip's programs: cargo xtask emulate"]
fn a_fifo_of_three_loses_frames_while_interrupts_are_masked() {
    let mut rig = interop("superloop-embassy", &["mask@0.3s..0.305s"]);
    rig.run(millis(400)).unwrap();
    let bus = &Figures::of(&rig).buses[0];
    println!("embassy's driver: {} of {} frames lost", bus.lost, bus.frames - bus.sent);
    assert!(bus.lost >= 5, "{bus:?}");
}
