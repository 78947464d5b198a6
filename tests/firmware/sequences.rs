//! Random sequences of faults on the chip, each while others last; then all is well, and it drives again.
//! `RC10_SEQUENCES=300 cargo xtask emulate sequences` plays 300 of them.

use rc10_cli::live::{Urgent, frame};
use rc10_cli::run::emulation::Emulation;
use rc10_cli::run::running::Running as _;
use rc10_link::Ask;
use rc10_sim::remote::Switch::{Down, Middle};
use rc10_sim::remote::{Controls, Stick};
use rc10_sim::{Nanos, Random};

use crate::{Setup, commands, is_zero, log, millis, run};

/// It drives by then; by then all faults have ended.
const BEGINS: u64 = 340_000;
/// The last of them ends 30 ms before: the remote is heard as it is then.
const ENDS: Nanos = millis(840);
/// When the remote disarms, and arms.
const DISARMS: Nanos = millis(920);
const ARMS: Nanos = millis(1140);
const OVER: Nanos = millis(1640);

/// Kinds of fault that end. `#` is a bus, `@` a motor.
const KINDS: [&str; 14] = [
    "cut:#",
    "short:#",
    "dominant:#",
    "power:#",
    "load:#",
    "babble:#",
    "noise:#",
    "mute:@",
    "frozen:@",
    "flipped:@",
    "cut:@",
    "power:@",
    "mask",
    "remote-lost",
];
/// Bits a second of its console.
const CONSOLE: u32 = 2_000_000;
const CRASHES: [&str; 3] = ["panic", "hardfault", "hang"];
/// Time (µs) in which a chip that crashes has its buses coast: the longest that interrupts are masked beside 12 ms.
const COASTS: u64 = 20_000;

/// What happens, with its times in microseconds.
struct Story {
    faults: Vec<String>,
    crash: Option<u64>,
    /// When a PC asks for a stop, and when the remote does.
    stops: [Option<u64>; 2],
    lost: Vec<[u64; 2]>,
}

impl Story {
    fn new(random: &mut Random) -> Self {
        let (mut faults, mut lost) = (Vec::new(), Vec::new());
        let when = |random: &mut Random| BEGINS + random.below(430_000);
        for _ in 0..2 + random.below(5) {
            let kind = KINDS[random.index(KINDS.len())];
            let most = match kind {
                "mask" => 5_000,
                "remote-lost" => 400_000,
                _ => 150_000,
            };
            let at = when(random);
            let until = (at + 1_000 + random.below(most)).min(ENDS.get() / 1000 - 30_000);
            let motor = ["wheel-front-left", "wheel-rear-right", "gimbal-yaw", "lift-rear-left"]
                [random.index(4)];
            let kind = kind.replace('#', &(1 + random.below(3)).to_string()).replace('@', motor);
            if faults.iter().any(|it: &String| it.starts_with(&kind)) {
                continue;
            }
            if kind == "remote-lost" {
                lost.push([at, until]);
            }
            let end =
                if kind.starts_with("noise") { String::new() } else { format!("..{until}us") };
            faults.push(format!("{kind}@{at}us{end}"));
        }
        let crash = (random.below(5) < 2).then(|| when(random));
        faults.extend(crash.map(|at| format!("{}@{at}us", CRASHES[random.index(CRASHES.len())])));
        let stops = [(); 2].map(|()| (random.below(3) == 0).then(|| when(random)));
        Self { faults, crash, stops, lost }
    }

    /// Spans in which buses carry no torque, µs, and how many of the buses: the lift's is held when it is stopped.
    fn quiet(&self) -> Vec<(u64, u64, usize)> {
        let [disarms, arms] = [DISARMS, ARMS].map(|it| it.get() / 1000);
        let mut quiet = vec![(disarms + 40_000, arms, 2)];
        let coasts = self.crash.map(|at| at + COASTS);
        quiet.extend(coasts.map(|from| (from, arms, 3)));
        let [by_pc, by_remote] = self.stops;
        let heard = |at: u64, within: u64| {
            // A chip that crashes meanwhile does not hear it, and coasts.
            let crashes = coasts.filter(|coasts| at + within > coasts - COASTS);
            crashes.map_or(at + within, |coasts| coasts.max(at + within))
        };
        quiet.extend(by_pc.map(|at| (heard(at, 15_000), arms, 2)));
        // A remote that is lost is not heard; then it is missed.
        quiet.extend(by_remote.map(|at| {
            let is_lost = self.lost.iter().any(|[from, until]| *from < at + 35_000 && at < *until);
            (heard(at, if is_lost { 150_000 } else { 35_000 }), arms, 2)
        }));
        quiet.extend(self.lost.iter().map(|[at, until]| (at + 135_000, *until, 2)));
        quiet
    }

    fn play(&self, emulation: &mut Emulation<'_>) -> Result<(), String> {
        // Left stick and switches, as far as a time.
        let hold = |emulation: &mut Emulation<'_>, until, (y, left_switch, right_switch)| {
            let operator = emulation.operator().unwrap();
            let left = Stick { x: 0.0, y };
            let controls = Controls { left, left_switch, right_switch, ..operator.safe() };
            operator.hold(controls, None);
            emulation.run(until).unwrap();
        };
        let (safe, armed) = ((0.0, Middle, Down), (0.0, Middle, Middle));
        let (drives, stopped) = ((0.6, Middle, Middle), (0.6, Down, Middle));
        let arm = |emulation: &mut Emulation<'_>, at: Nanos| {
            hold(emulation, at, safe);
            hold(emulation, at + millis(100), armed);
        };
        arm(emulation, millis(100));
        let mut stops: Vec<_> =
            (0..2).filter_map(|who| Some((self.stops[who]?, who == 1))).collect();
        stops.sort_unstable();
        let mut held = drives;
        hold(emulation, Nanos::new(BEGINS * 1000), held);
        if !turn(emulation) {
            return Err("it does not drive at first".into());
        }
        for (at, by_remote) in stops {
            hold(emulation, Nanos::new(at * 1000), held);
            if by_remote {
                held = stopped;
            } else {
                let console = emulation.console.as_ref().unwrap();
                console.send(&frame(&Ask::Urge { id: 0, what: Urgent::Stop }));
            }
        }
        hold(emulation, ENDS, held);
        // A stop ends when the switch has been moved: a remote that was lost may not have been seen before.
        hold(emulation, DISARMS, armed);
        arm(emulation, ARMS);
        hold(emulation, OVER, drives);

        let rig = &emulation.rig;
        for (from, until, buses) in self.quiet() {
            let [from, until] = [from, until].map(|it| Nanos::new(it * 1000));
            for bus in 0..buses {
                let torque = commands(rig, bus, from).find(|it| it.start < until && !is_zero(it));
                if let Some(torque) = torque {
                    return Err(format!("{from} .. {until}, bus {}: {torque:?}", bus + 1));
                }
            }
        }
        let restarts = &rig.machine.restarts;
        if restarts.len() != usize::from(self.crash.is_some()) {
            return Err(format!("{restarts:?}"));
        }
        let log = log(emulation);
        let last = log.lines().last().unwrap_or_default();
        let is_well = last.contains(" armed, 11 of 11 motors online");
        if is_well && turn(emulation) {
            return Ok(());
        }
        Err(format!("it does not drive again: {last}"))
    }
}

/// Whether all wheels turn.
fn turn(emulation: &Emulation<'_>) -> bool {
    emulation.motors[..4].iter().all(|it| it.state().output_rpm.abs() > 20.0)
}

fn play(seed: u64) -> Result<(), String> {
    let story = Story::new(&mut Random::new(seed));
    let faults = story.faults.iter().map(|it| it.parse().unwrap()).collect();
    let setup = Setup { seed, faults, console: Some(CONSOLE), ..Setup::default() };
    let outcome = run(&setup, |emulation| story.play(emulation));
    let Story { faults, stops, .. } = &story;
    outcome.map_err(|why| format!("sequence {seed}, stops {stops:?}, {faults:?}: {why}"))
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn sequences_of_faults_leave_it_safe_and_it_drives_again() {
    let asked = |name, else_ask| {
        std::env::var(name).map_or(else_ask, |it| it.parse::<u64>().expect("a number"))
    };
    let (first, count) = (asked("RC10_SEQUENCE", 0), asked("RC10_SEQUENCES", 6));
    let wrong: Vec<String> = std::thread::scope(|scope| {
        let part = |part| {
            let mine = (first..first + count).filter(move |seed| seed % 2 == part);
            scope.spawn(|| mine.filter_map(|seed| play(seed).err()).collect::<Vec<_>>())
        };
        [0, 1].map(part).into_iter().flat_map(|it| it.join().unwrap()).collect()
    });
    println!(
        "{} of {count} random sequences of faults: safe, and it drives again",
        count - wrong.len() as u64
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}
