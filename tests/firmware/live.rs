//! A PC at the console of the flashed firmware.

use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_cli::live::{Action, Answer, Client, Sample, Urgent};
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_emu::Figures;
use rc10_motor::Names;
use rc10_sim::{Nanos, UartFault};
use rc10_time::Micros;
use team::table::Name;

use super::{commands, is_clean, keeps_its_period, log, run, setup};

/// The console's.
const BAUD: u32 = 2_000_000;
/// Instructions of a second with 66 signals at 500 Hz.
const SECOND: u64 = 19_300_000;
/// Instructions of one more signal in a sample.
const SIGNAL: u64 = 60;

/// The firmware with a PC.
pub(super) struct Watched<'e, 'r> {
    pub(super) emulation: &'e mut Emulation<'r>,
    pub(super) client: Client,
    pub(super) samples: Vec<Sample>,
    /// All bytes received so far.
    heard: Vec<u8>,
}

impl<'e, 'r> Watched<'e, 'r> {
    /// From now on, until it has described itself.
    pub(super) fn new(emulation: &'e mut Emulation<'r>) -> Self {
        let (client, samples, heard) = (Client::new(), Vec::new(), Vec::new());
        let mut watched = Self { emulation, client, samples, heard };
        watched.run(600);
        assert!(watched.client.is_described(), "{}", log(watched.emulation));
        watched
    }

    fn now(&self) -> Micros {
        self.emulation.rig.machine.now().micros()
    }

    /// Lets time pass, and the PC speak every millisecond.
    pub(super) fn run(&mut self, millis: u64) {
        (0..millis).for_each(|_| self.run_with(&[]));
    }

    /// A millisecond in which the PC also says this.
    fn run_with(&mut self, more: &[u8]) {
        let line = self.emulation.console.clone().unwrap();
        let now = self.now();
        self.client.step(now);
        line.send(&self.client.take_out());
        line.send(more);
        let next: Nanos = (now + Micros::from_millis(1)).into();
        self.emulation.run(next).unwrap();
        let heard = line.take();
        self.client.hear(&heard, next.micros());
        self.heard.extend(heard);
        self.samples.extend(self.client.take_samples());
    }

    /// Lets time pass; the PC is silent.
    fn listen(&mut self, millis: u64) {
        let now = self.now();
        self.emulation.run((now + Micros::from_millis(millis)).into()).unwrap();
        self.heard.extend(self.emulation.console.clone().unwrap().take());
    }

    pub(super) fn ask(&mut self, id: u16) -> Answer {
        for _ in 0..200 {
            if let Some(answer) = self.client.answer(id) {
                return answer;
            }
            self.run(1);
        }
        panic!("no answer");
    }

    pub(super) fn signals(&self, names: &[&str]) -> Vec<u16> {
        let all = self.client.signals();
        let all = all.filter(|(_, it)| it.folder == "motors" && names.contains(&it.name.as_str()));
        all.map(|(index, _)| index).collect()
    }

    pub(super) fn parameter(&self, label: &str, name: &str) -> (u16, f32) {
        let mut all = self.client.parameters();
        let found = all.find(|it| it.label == label && it.name == name).unwrap();
        (found.index, found.value)
    }

    fn is_undisturbed(&self) {
        let figures = Figures::of(&self.emulation.rig);
        is_clean(&self.emulation.rig, &figures);
        keeps_its_period(&figures);
    }
}

fn watched(scenario: impl FnOnce(&mut Watched<'_, '_>)) {
    let setup = Setup { console: Some(BAUD), ..setup(&[]) };
    run(&setup, |emulation| {
        scenario(&mut Watched::new(emulation));
    });
}

/// Instructions of a second in which some signals of every motor are watched at 500 Hz, and the number
/// of values.
fn second(names: &[&str]) -> [u64; 2] {
    let mut spent = [0; 2];
    watched(|pc| {
        let signals = pc.signals(names);
        pc.client.watch(0, 2, signals.iter().copied());
        pc.run(100);
        pc.samples.clear();
        let before = Figures::of(&pc.emulation.rig).instructions;
        pc.run(1000);
        let instructions = Figures::of(&pc.emulation.rig).instructions - before;
        assert_eq!(pc.samples.len(), if names.is_empty() { 0 } else { 500 });
        assert_eq!(pc.client.losses(), <_>::default());
        pc.is_undisturbed();
        spent = [instructions, 500 * signals.len() as u64];
    });
    spent
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn being_watched_costs_little() {
    const ALL: [&str; 6] = ["target", "measured", "speed", "total_angle", "current", "temperature"];
    let [none, _] = second(&[]);
    let [first, fewer] = second(&ALL[..3]);
    let [last, _] = second(&ALL[3..]);
    let [all, many] = second(&ALL);
    assert_eq!(many, 500 * 6 * Name::ALL.len() as u64);
    // The dearer half.
    let each = (all - first.min(last)) / (many - fewer);
    println!("a second with a PC that watches nothing {none:>9} instructions");
    println!("a second with 66 signals at 500 Hz      {all:>9} instructions, budget {SECOND}");
    println!("one more signal in a sample             {each:>9} instructions, budget {SIGNAL}");
    println!("all in, by the number of values         {:>9}", (all - none) / many);
    assert!(all <= SECOND && each <= SIGNAL);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn what_is_shown_is_what_is_there_and_a_gain_changes_the_response() {
    let mut errors = Vec::new();
    for factor in [1.0, 0.1] {
        watched(|pc| {
            let label = Name::ALL[0].label();
            let (kp, value) = pc.parameter(label, "speed_kp");
            if factor < 1.0 {
                let id = pc.client.set(&[(kp, factor * value)]).unwrap();
                assert_eq!(pc.ask(id), Answer::Done);
            }
            let signals = pc.signals(&["target", "measured", "speed"]);
            pc.client.watch(0, 2, signals.iter().take(3).copied());
            let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
            for _ in 0..1500 {
                pc.run(1);
                let Some(sample) = pc.samples.pop() else { continue };
                let [target, measured, speed] = [0, 1, 2].map(|at| f64::from(sample.values[at].1));
                let there = pc.emulation.motors[0].state().output_rpm;
                // A sample is at most two milliseconds old, and so is the feedback in it.
                worst = worst.max((speed - there).abs());
                squares += (target - measured).powi(2);
                count += 1.0;
            }
            println!("kp x {factor}: the speed shown is at most {worst:.2} rpm off");
            assert!(worst < 8.0);
            errors.push((squares / count).sqrt());
        });
    }
    println!(
        "error of the wheel: {:.2} rpm, {:.2} rpm with a tenth of the gain",
        errors[0], errors[1]
    );
    assert!(errors[1] > 1.5 * errors[0]);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_full_line_and_garbage_disturb_no_bus() {
    watched(|pc| {
        // Three times what the line carries, and all that it carries the other way.
        let signals: Vec<_> = pc.client.signals().map(|(index, _)| index).collect();
        for (group, some) in signals.chunks(150).take(4).enumerate() {
            pc.client.watch(group, 1, some.iter().copied());
        }
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Some of it looks as a frame begins.
            if state >> 28 == 0 { 0xE7 } else { (state >> 20 & 0xFF) as u8 }
        };
        for _ in 0..1000 {
            let garbage: Vec<u8> = (0..150).map(|_| noise()).collect();
            pc.run_with(&garbage);
        }
        let losses = pc.client.losses();
        println!("{losses:?}");
        assert!(losses.skipped > 1000 && losses.samples == 0, "{losses:?}");
        pc.is_undisturbed();
        pc.run(500);
        assert!(pc.client.is_up(pc.now()), "it is heard again when the garbage ends");
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_cable_pulled_at_any_byte_is_no_harm_and_the_text_comes_back() {
    watched(|pc| {
        let signals = pc.signals(&["target", "measured", "speed"]);
        pc.client.watch(0, 2, signals.iter().copied());
        let line = pc.emulation.console.clone().unwrap();
        for pull in 0..40_u64 {
            // At another byte each time: one lasts 5 us.
            let now: Nanos = pc.now().into();
            pc.emulation.run(now + Nanos::new(pull * 5_300)).unwrap();
            line.serial().set_cut(true);
            if pull % 4 == 0 {
                line.serial().inject(UartFault::ALL[(pull / 4) as usize % 5]);
            }
            pc.run(3);
            line.serial().set_cut(false);
            pc.run(7);
        }
        pc.run(500);
        assert!(pc.client.is_up(pc.now()));
        pc.samples.clear();
        pc.run(100);
        assert_eq!(pc.samples.len(), 50);
        pc.is_undisturbed();
        // Nothing is sent to a PC that is gone, and a second later people can read again.
        line.serial().set_cut(true);
        pc.listen(1200);
        line.serial().set_cut(false);
        pc.heard.clear();
        pc.listen(300);
        let text = String::from_utf8(pc.heard.clone()).unwrap();
        assert!(text.contains("11 of 11 motors online"), "{text}");
        pc.heard.clear();
        pc.run(400);
        assert!(pc.client.is_up(pc.now()), "and it hears the next PC");
    });
}

/// When a wheel was last commanded a current, in the frames since a time.
fn last_effort(pc: &Watched<'_, '_>, wheel: usize, from: Micros) -> Option<Nanos> {
    let entries = commands(&pc.emulation.rig, 0, from.into());
    let wheels =
        entries.filter(|it| it.frame.key() == CanFrame::key_of(StandardId::new(0x200).unwrap()));
    let driven = wheels.filter(|it| it.frame.bytes()[2 * wheel..2 * wheel + 2] != [0; 2]);
    driven.last().map(|it| it.end)
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_jog_turns_one_motor_of_a_disarmed_robot_and_ends_with_its_link() {
    watched(|pc| {
        let refused = |answer: Answer, why: &str| {
            let Answer::Refused(told) = answer else { panic!("not refused: {why}") };
            assert!(told.contains(why), "{told}");
        };
        let hold = |pc: &mut Watched<'_, '_>, motor: u8, tenths: i16, millis: u64| {
            let mut last = Answer::Done;
            for _ in 0..millis / 25 {
                let id = pc.client.act(Action::Jog(motor, tenths));
                pc.run(25);
                last = pc.client.answer(id).expect("an answer within 25 ms");
            }
            last
        };
        refused(hold(pc, 0, 50, 25), "disarmed");
        let id = pc.client.urge(Urgent::Disarm, pc.now());
        assert_eq!(pc.ask(id), Answer::Done);
        pc.run(1500);
        // One that rolls on, faster than twice what is asked for, is not jogged.
        refused(hold(pc, 0, 10, 25), "twice as fast");
        let rolls = |pc: &Watched<'_, '_>| pc.emulation.motors[0].state().output_rpm.abs() > 5.0;
        for _ in 0..60 {
            if !rolls(pc) {
                break;
            }
            pc.run(100);
        }
        let begin = pc.now();
        assert_eq!(hold(pc, 0, 100, 600), Answer::Done);
        let rpm = pc.emulation.motors[0].state().output_rpm;
        assert!((rpm - 10.0).abs() < 1.5, "{rpm}");
        refused(hold(pc, 1, 50, 25), "another motor turns");
        refused(hold(pc, 0, 201, 25), "faster than the robot's table allows");
        refused(hold(pc, 7, 10, 25), "does not allow");
        for wheel in 1..4 {
            assert_eq!(last_effort(pc, wheel, begin), None);
        }
        // Released.
        pc.run(300);
        assert_eq!(hold(pc, 0, 100, 100), Answer::Done);
        let id = pc.client.act(Action::Jog(0, 0));
        let released = pc.now();
        assert_eq!(pc.ask(id), Answer::Done);
        pc.run(100);
        let last = last_effort(pc, 0, released)
            .map_or(0.0, |at| at.since(released.into()).get() as f64 * 1e-6);
        println!("released: its last current {last:.2} ms later");
        assert!(last <= 5.0);
        // The link is lost, at some times after the last word; the script stops the robot at 8.6 s.
        let mut latest = 0.0_f64;
        for phase in 0..5 {
            pc.run(100);
            assert_eq!(hold(pc, 0, 100, 200), Answer::Done);
            pc.client.act(Action::Jog(0, 100));
            pc.run(1);
            let said = pc.now();
            let now: Nanos = said.into();
            pc.emulation.run(now + Nanos::new(phase * 206_000)).unwrap();
            let line = pc.emulation.console.clone().unwrap();
            line.serial().set_cut(true);
            pc.listen(150);
            line.serial().set_cut(false);
            let last = last_effort(pc, 0, said).unwrap().since(said.into());
            latest = latest.max(last.get() as f64 * 1e-6);
            pc.run(100);
        }
        println!("link lost: its last current {latest:.2} ms after the last word");
        assert!(latest <= 100.0);
        // Disarming makes the frames of one tick late, as docs/architecture.md says: not judged here.
        is_clean(&pc.emulation.rig, &Figures::of(&pc.emulation.rig));
    });
}
