//! The firmware of `examples/mixed`: the mixed robot, with eight motors on an RS-485 line beside two CAN
//! buses.

use mixed::table::{LEGS as NAMES, REPLY};
use mixed::{Motors, Ports, Shared};
use rc10_cli::recording::MotorTrack;
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_emu::peripherals::Width;
use rc10_emu::{Figures, Machine};
use rc10_motor::Link;
use rc10_motor::unitree::wire::line::{COMMAND_LEN, REPLY_LEN};
use rc10_sim::unitree_line::GoM8010;
use rc10_sim::{Nanos, World};
use rc10_time::Micros;

use super::{is_clean, keeps_its_period, log, micros, millis, priorities, program, setup};

/// The legs are all motors behind these.
const OTHERS: usize = 6;
/// Number of legs.
const LEGS: usize = NAMES.len();
/// The script is past its start-up, and all motors are heard.
const STEADY: Nanos = millis(150);
/// The line's interrupts: USART2, its two streams, and the one that is lent to its executor (UART8).
const INTERRUPTS: [u16; 4] = [38, 58, 59, 83];
/// Instructions that an exchange may take, all in: its interrupts, its share of the line's ticks.
const BUDGET: u64 = 3_500;

/// The program in the mixed robot's environment.
fn run<R>(setup: &Setup, scenario: impl FnOnce(&mut Emulation<'_>) -> R) -> R {
    give(setup, |mut emulation| scenario(&mut emulation))
}

/// The same, for a scenario that needs it as a whole.
fn give<R>(setup: &Setup, scenario: impl FnOnce(Emulation<'_>) -> R) -> R {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::robot_of::<mixed::Robot>(&shared, &mut motors).unwrap();
    scenario(Emulation::new(&program("mixed-firmware"), robot, setup).unwrap())
}

/// The log's line tells of no loss.
fn is_well(line: &str) -> bool {
    !["timeouts", "wrong CRCs", "port errors", "ticks missed"].iter().any(|it| line.contains(it))
}

/// A frame on the line.
struct Frame {
    start: Nanos,
    end: Nanos,
    from_chip: bool,
    bytes: Vec<u8>,
}

impl Frame {
    fn leg(&self) -> usize {
        self.bytes.get(2).map_or(usize::MAX, |byte| usize::from(byte & 0xF))
    }

    /// A reply: how far the leg is from an angle, as it counts: within half a turn of its rotor, because
    /// it counts none of those before power-on.
    fn degrees_from(&self, degrees: f64) -> f64 {
        const GEAR: f64 = 6.33;
        let angle = i32::from_le_bytes(self.bytes[7..11].try_into().unwrap());
        let turns = f64::from(angle) / 32_768.0 - degrees / 360.0 * GEAR;
        (turns - turns.round()) * 360.0 / GEAR
    }

    /// It asks for no torque: none by itself, no stiffness, no damping.
    fn is_idle(&self) -> bool {
        self.bytes[3..5].iter().chain(&self.bytes[11..15]).all(|&byte| byte == 0)
    }
}

/// The frames of the line: bytes of one end without a pause. Not the last one, which may go on.
fn frames(emulation: &mut Emulation<'_>) -> Vec<Frame> {
    let mut frames: Vec<Frame> = Vec::new();
    for entry in emulation.rig.take_line_bytes().remove(0) {
        match frames.last_mut() {
            Some(last) if last.from_chip == entry.from_host && last.end == entry.start => {
                last.end = entry.end;
                last.bytes.push(entry.byte);
            }
            _ => frames.push(Frame {
                start: entry.start,
                end: entry.end,
                from_chip: entry.from_host,
                bytes: vec![entry.byte],
            }),
        }
    }
    frames.pop();
    frames
}

/// Has each leg think for a time of its own, ns, before it replies.
fn think(emulation: &Emulation<'_>, time: impl Fn(u64) -> u64) {
    for (id, esc) in (0..).zip(&emulation.motors[OTHERS..]) {
        let mut device = GoM8010::new(id);
        device.think = Nanos::new(time(id.into()));
        esc.with(|motor: &mut GoM8010| *motor = device).unwrap();
    }
}

/// When a leg was polled, from a time on.
fn polls(frames: &[Frame], leg: usize, from: Nanos, to: Nanos) -> Vec<Nanos> {
    let polls = frames.iter().filter(|frame| frame.from_chip && frame.leg() == leg);
    polls.map(|frame| frame.start).filter(|at| (from..to).contains(at)).collect()
}

/// Least, mean and most time from one poll of a leg to its next, us, over some legs.
fn cycle(
    frames: &[Frame],
    legs: impl Iterator<Item = usize>,
    (from, to): (Nanos, Nanos),
) -> [f64; 3] {
    let (mut least, mut most, mut sum, mut count) = (f64::MAX, 0.0_f64, 0.0, 0.0);
    for leg in legs {
        for pair in polls(frames, leg, from, to).windows(2) {
            let gap = micros(pair[1].since(pair[0]));
            (least, most) = (least.min(gap), most.max(gap));
            (sum, count) = (sum + gap, count + 1.0);
        }
    }
    [least, sum / count, most]
}

/// Checks that the buses keep their periods, whatever happens on the line.
fn buses_are_punctual(emulation: &Emulation<'_>) {
    let figures = Figures::of(&emulation.rig);
    keeps_its_period(&figures);
    is_clean(&emulation.rig, &figures);
    for bus in &figures.buses {
        let mean = bus.tick_period.unwrap().mean();
        assert!(mean.get().abs_diff(1_000_000) < 50, "{mean}");
    }
}

/// All eight, every millisecond, for half a second at several phases of everything else: replies come
/// at other moments of the buses' ticks in each of them.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn eight_motors_are_polled_every_millisecond() {
    for seed in 1..=4 {
        run(&Setup { seed, ..setup(&[]) }, |emulation| {
            let end = millis(650);
            think(emulation, |id| 17_000 + (seed * 977 + id * 391) % 6_000);
            emulation.run(end).unwrap();
            let frames = frames(emulation);
            let [least, mean, most] = cycle(&frames, 0..LEGS, (STEADY, end));
            let polled = (0..LEGS).map(|leg| polls(&frames, leg, STEADY, end).len());
            let polled: Vec<_> = polled.collect();
            // From the end of a reply to the command behind it, within a round.
            let gaps = frames.windows(2).filter(|pair| !pair[0].from_chip && pair[1].leg() != 0);
            let gap = gaps.map(|pair| micros(pair[1].start.since(pair[0].end))).fold(0.0, f64::max);
            println!(
                "seed {seed}: cycle {least:.1} / {mean:.2} / {most:.1} us, reply to command at most \
                 {gap:.1} us"
            );
            assert!((mean - 1000.0).abs() < 0.1 && least > 950.0 && most < 1050.0);
            assert!(gap < 35.0, "more than a bus's tick between");
            assert!(polled.iter().all(|polls| polls.abs_diff(500) <= 1), "{polled:?}");
            // Every command is one, and has its reply.
            let whole = |frame: &Frame| {
                frame.bytes.len() == if frame.from_chip { COMMAND_LEN } else { REPLY_LEN }
            };
            assert!(frames.iter().all(whole));
            let replies = frames.iter().filter(|frame| !frame.from_chip).count();
            assert!((frames.len() - replies).abs_diff(replies) <= 1);
            let counters = emulation.rig.lines[0].counters();
            assert_eq!((counters.collided, emulation.rig.machine.garbled(2)), (0, 0));
            buses_are_punctual(emulation);
            let log = log(emulation);
            let last = log.lines().last().unwrap();
            assert!(last.contains("14 of 14 motors online"), "{last}");
            assert!(last.contains("; line 1 4816 exchanges of ") && is_well(last), "{last}");
        });
    }
}

/// Instructions and clocks of an exchange, all in.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn an_exchange_stays_within_its_budget() {
    run(&setup(&[]), |emulation| {
        emulation.run(STEADY).unwrap();
        emulation.rig.machine.profile.restart();
        emulation.run(millis(650)).unwrap();
        let profile = &emulation.rig.machine.profile;
        let costs = profile.by_exception();
        let of_line = costs.iter().filter(|cost| {
            cost.exception.checked_sub(16).is_some_and(|number| INTERRUPTS.contains(&number))
        });
        let (mut instructions, mut clocks) = (0, 0);
        for cost in of_line {
            (instructions, clocks) = (instructions + cost.instructions, clocks + cost.clocks);
        }
        let exchanges = 500 * LEGS as u64;
        println!(
            "an exchange: {} instructions, {} clocks; the line takes {:.1} % of the core",
            instructions / exchanges,
            clocks / exchanges,
            clocks as f64 / 2_400_000.0,
        );
        assert!(instructions / exchanges <= BUDGET);
        let figures = Figures::of(&emulation.rig);
        println!("stack {} bytes, static {}", figures.stack_bytes, emulation.rig.machine.image.ram);
        // Of 32 KiB.
        assert!(figures.stack_bytes < 26 * 1024, "{}", figures.stack_bytes);
    });
}

/// The delay of a real motor's reply is unknown. The simulated ones take 20 us.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn slower_motors_are_polled_as_fast_as_they_can() {
    for (thinking, period) in [(30, 1000.0), (60, 1230.0)] {
        run(&setup(&[]), |emulation| {
            self::think(emulation, |_| thinking * 1000);
            emulation.run(millis(450)).unwrap();
            let [least, mean, most] = cycle(&frames(emulation), 0..LEGS, (STEADY, millis(450)));
            println!("replies after {thinking} us: cycle {least:.1} / {mean:.2} / {most:.1} us");
            assert!((mean - period).abs() < 0.02 * period && most < period + 50.0);
            buses_are_punctual(emulation);
            let log = log(emulation);
            let last = log.lines().last().unwrap();
            assert!(last.contains("14 of 14 motors online") && is_well(last), "{last}");
        });
    }
}

/// A motor that hears and does not reply; it is unplugged instead, or has no power; and it returns.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_motor_that_is_gone_leaves_the_others_alone_and_returns() {
    /// The motor that has the longest way to go when it is back.
    const GONE: usize = 7;
    let (away, end) = (millis(300), millis(950));
    for (what, back) in [("silent", 620), ("unplugged", 655), ("without power", 690)] {
        let back = millis(back);
        run(&setup(&[]), |emulation| {
            let esc = emulation.motors[OTHERS + GONE].clone();
            let set = |gone: bool| match what {
                "silent" => esc.set_feedback(!gone),
                "unplugged" => esc.set_cut(gone),
                _ => esc.set_power(!gone),
            };
            emulation.run(away).unwrap();
            set(true);
            emulation.run(back).unwrap();
            set(false);
            // No kick: 10 % of full scale, 2.37 N m, each millisecond at most.
            let (mut now, mut last) = (back, esc.state().current);
            while now < end {
                now = now + millis(1);
                emulation.run(now).unwrap();
                let current = esc.state().current;
                assert!(
                    (current - last).abs() < 2.37 / 0.638_95 + 0.1,
                    "{now}: {last} to {current}"
                );
                last = current;
            }
            let frames = frames(emulation);
            let others = || (0..LEGS).filter(|leg| *leg != GONE);
            let [_, mean, most] = cycle(&frames, others(), (away, end));
            // Until it is lost, it takes its reply's time-out from each round.
            let lost_by = away + millis(22);
            let [.., most_then] = cycle(&frames, others(), (away, lost_by));
            let asked = polls(&frames, GONE, lost_by, back);
            let heard = frames
                .iter()
                .find(|frame| !frame.from_chip && frame.start > back && frame.leg() == GONE);
            let heard = heard.unwrap().start.since(back);
            println!(
                "{what}: others' cycle {mean:.2} us, at most {most:.1} ({most_then:.1} until it is \
                 lost); asked {} times in {:.0} ms; heard {:.1} ms after its return",
                asked.len(),
                micros(back.since(lost_by)) * 1e-3,
                micros(heard) * 1e-3
            );
            assert!(mean < 1005.0 && most < 1050.0 + REPLY.get() as f64, "{mean} {most}");
            assert!((2..=6).contains(&asked.len()), "three times at once, then every 100 ms");
            assert!(heard < millis(102), "{heard}");
            // Lost, it is told to let go; heard again, it goes where the script has it.
            let told = frames.iter().filter(|frame| frame.from_chip && frame.leg() == GONE);
            let mut told = told.filter(|frame| (lost_by..back).contains(&frame.start));
            assert!(told.all(Frame::is_idle));
            for leg in 0..LEGS {
                let last = frames.iter().rfind(|frame| !frame.from_chip && frame.leg() == leg);
                let off = last.unwrap().degrees_from(20.0);
                assert!(off.abs() < 1.5, "leg {leg}: {off}");
            }
            buses_are_punctual(emulation);
            let log = log(emulation);
            let told: Vec<_> = log.lines().filter(|it| it.contains("motors online")).collect();
            let online = |at: usize| told[at].contains("14 of 14 motors online");
            assert!(log.lines().any(|line| line.contains("13 of 14 motors online")), "{log}");
            assert!(online(1) && online(7), "{log}");
        });
    }
}

/// The plug of the line is out, a reply is damaged: counted, and the buses do not notice.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn faults_of_the_line_are_counted_and_stay_there() {
    let faults = ["noise:L1@0.25s", "cut:L1@0.3s..0.35s", "power:L1@0.5s..0.51s"];
    run(&setup(&faults), |emulation| {
        emulation.run(millis(900)).unwrap();
        let frames = frames(emulation);
        assert!(polls(&frames, 0, millis(300), millis(350)).is_empty(), "nothing is on the line");
        let log = log(emulation);
        let counts = |at: usize| {
            let mut told = log.lines().filter(|it| it.contains("motors online"));
            let line = told.nth(at).unwrap().to_owned();
            assert!(!line.contains("port errors") && !line.contains("ticks missed"), "{line}");
            line
        };
        assert!(counts(2).contains("14 of 14 motors online"), "{log}");
        assert!(counts(2).contains(" 1 wrong CRCs"), "{log}");
        assert!(counts(7).contains("14 of 14 motors online"), "{log}");
        buses_are_punctual(emulation);
    });
}

/// Tables and report show what a listener on the line hears: it is what the chip has counted.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_listener_on_the_line_counts_as_the_chip_does() {
    give(&setup(&["noise:L1@0.25s", "power:L1@0.3s..0.31s"]), |emulation| {
        let (mut emulation, recording) = emulation.record(Micros::new(509_100)).unwrap();
        let log = log(&mut emulation);
        let traffic = recording.lines[0].traffic;
        // What the log's last line tells is 0.1 to 2.1 ms old: up to two rounds.
        let last = log.lines().last().unwrap();
        let number = |what: &str| -> u32 {
            let (before, _) = last.split_once(what).unwrap();
            before.rsplit(' ').next().unwrap().parse().unwrap()
        };
        println!("{} {} {}", traffic.exchanges, traffic.timeouts, traffic.crc_errors);
        assert!(traffic.exchanges.abs_diff(number(" exchanges")) <= 17, "{last}");
        assert_eq!((traffic.timeouts, traffic.crc_errors), (number(" timeouts"), 1), "{last}");
        assert!(traffic.timeouts > 8 && traffic.unexpected == 0);
        assert_eq!((traffic.exchange.min(), traffic.exchange.max()), (Some(102), Some(103)));
        let legs = &recording.motors[OTHERS..];
        assert!(legs.len() == LEGS && legs.iter().all(|leg| leg.last.link == Link::Online));
        assert!(legs.iter().all(|leg| leg.last.counters.received.abs_diff(490) < 12));
    });
}

/// The line is below the buses, and its UART not below the line.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn the_line_has_a_priority_of_its_own() {
    let mut machine = Machine::new(&program("mixed-firmware")).unwrap();
    machine.run(&mut World::new(1), millis(20)).unwrap();
    let found = priorities::of(&machine);
    assert!(INTERRUPTS.iter().all(|&interrupt| found.contains(&(interrupt, 7))), "{found:?}");
    priorities::judge(&found, &[&[priorities::TIME], &priorities::BUSES[..]].concat());
    // GPIOD, PD4: the UART's own. MODER.
    let mode = machine.soc().read(0x5802_0C00, Width::Word, millis(20)).unwrap() >> 8 & 0b11;
    assert_eq!(mode, 0b10);
}

/// Every motor is without torque after a panic, those of the line when the watchdog's silence has
/// begun; the restarted program waits for a hand that arms it.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_panic_and_a_cut_bus_are_survived() {
    give(&setup(&["cut:1@0.3s..0.35s", "panic@0.5s"]), |emulation| {
        let (mut emulation, recording) = emulation.record(Micros::from_millis(1500)).unwrap();
        assert_eq!(emulation.rig.machine.restarts.len(), 1);
        let log = log(&mut emulation);
        assert!(log.contains("the last run ended in a crash: Panic"), "{log}");
        assert!(log.lines().last().unwrap().contains("disarmed, 14 of 14 motors online"), "{log}");
        for track in &recording.motors[..OTHERS] {
            let currents = track.samples[52..].iter().map(|sample| sample.current.abs());
            let most = currents.fold(0.0, f64::max);
            assert!(most < 0.05, "{}: {most} A", track.motor.label);
        }
        // Those of the line go on until they miss their commands.
        for track in &recording.motors[OTHERS..] {
            let currents = track.samples[70..].iter().map(|sample| sample.current.abs());
            let most = currents.fold(0.0, f64::max);
            assert!(most < 0.05, "{}: {most} A", track.motor.label);
        }
    });
}

/// On both buses and on the line.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_lost_remote_makes_every_motor_safe_and_disarms() {
    give(&setup(&["remote-lost@0.6s"]), |emulation| {
        let (mut emulation, recording) = emulation.record(Micros::from_millis(2000)).unwrap();
        assert!(emulation.rig.machine.reports.is_empty());
        assert!(emulation.rig.machine.restarts.is_empty());
        let driven = |track: &MotorTrack, samples: std::ops::Range<usize>| {
            track.samples[samples].iter().any(|sample| sample.current.abs() > 0.05)
        };
        assert!(recording.motors.iter().any(|track| driven(track, 50..60)));
        for track in &recording.motors {
            // The wheel brakes and the joints hold until the robot is disarmed, a second later.
            let since = if track.motor.holds { 175 } else { 75 };
            assert!(!driven(track, since..200), "{}", track.motor.label);
        }
        let [loss] = recording.remote.unwrap().losses.try_into().unwrap();
        assert!(loss.reaction().is_some_and(|time| time < Micros::from_millis(115)), "{loss:?}");
        let log = log(&mut emulation);
        let last = log.lines().last().unwrap();
        assert!(last.contains("disarmed, 14 of 14 motors online, no remote"), "{last}");
    });
}
