//! Parameters that outlast a cut of power, in the flash of the emulated chip.
#![expect(clippy::float_cmp, reason = "it compares what was kept")]

use rc10_cli::live::{Action, Answer, Urgent, frame};
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_emu::{Board, Figures};
use rc10_link::frame::FromRobot;
use rc10_link::{AT_ONCE, Ask, Change, Declaration, Tell};
use rc10_module::Stream;
use rc10_sim::{Nanos, Random};
use rc10_time::Micros;

use super::live::Watched;
use super::{is_clean, keeps_its_period, log, run, setup, setup_on};

const BAUD: u32 = 2_000_000;

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn what_was_saved_is_there_after_a_cut_of_power() {
    let faults = ["remote-lost@1ms", "cut-power@1500ms..1600ms"];
    run(&Setup { console: Some(BAUD), ..setup(&faults) }, |emulation| {
        let mut pc = Watched::new(emulation);
        assert!(log(pc.emulation).contains("no parameters are kept"));
        let (wheel, kp) = pc.parameter("wheel front left", "speed_kp");
        let (feeder, _) = pc.parameter("feeder speed", "value");
        let id = pc.client.set(&[(wheel, kp * 0.5), (feeder, 222.0)]).unwrap();
        assert_eq!(pc.ask(id), Answer::Done);
        let before = pc.emulation.rig.machine.now();
        let id = pc.client.act(Action::Save);
        assert_eq!(pc.ask(id), Answer::Done);
        let took = pc.emulation.rig.machine.now().since(before).get() as f64 * 1e-6;
        println!("saved and answered in {took:.1} ms");
        let figures = Figures::of(&pc.emulation.rig);
        is_clean(&pc.emulation.rig, &figures);
        keeps_its_period(&figures);
        // Without having been saved.
        let id = pc.client.set(&[(feeder, 333.0)]).unwrap();
        assert_eq!(pc.ask(id), Answer::Done);
        pc.run(4000);
        let told = log(pc.emulation);
        assert!(told.contains("2 parameters are kept"), "{told}");
        let first = told
            .lines()
            .find(|line| line.contains("motors online") && line.contains("parameters differ"));
        assert!(
            first.is_some_and(|line| line.contains("2 parameters differ from the table")),
            "{told}"
        );
        assert_eq!(pc.parameter("wheel front left", "speed_kp").1, kp * 0.5);
        assert_eq!(pc.parameter("feeder speed", "value").1, 222.0);
        assert_eq!(pc.client.kept().unwrap().count(), 2);
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn an_armed_robot_and_one_that_rolls_save_nothing() {
    run(&Setup { console: Some(BAUD), ..setup(&[]) }, |emulation| {
        let mut pc = Watched::new(emulation);
        let refused = |pc: &mut Watched<'_, '_>, why: &str| {
            let id = pc.client.act(Action::Save);
            let Answer::Refused(told) = pc.ask(id) else { panic!("not refused") };
            assert!(told.contains(why), "{told}");
        };
        refused(&mut pc, "only while the robot is disarmed");
        let id = pc.client.urge(Urgent::Disarm, pc.emulation.rig.machine.now().micros());
        assert_eq!(pc.ask(id), Answer::Done);
        refused(&mut pc, "a motor turns");
        pc.run(50);
        assert_eq!(pc.client.kept().unwrap().count(), 0);
    });
}

/// Asks and hears without the description of the robot, which takes long.
struct Quick<'e, 'r> {
    emulation: &'e mut Emulation<'r>,
    frames: Stream<FromRobot>,
    told: Vec<(u16, f32)>,
    declaration: Option<Declaration>,
    answered: bool,
}

impl Quick<'_, '_> {
    fn now(&self) -> Micros {
        self.emulation.rig.machine.now().micros()
    }

    fn run(&mut self, ask: &[Ask], until: Nanos) {
        let line = self.emulation.console.clone().unwrap();
        ask.iter().for_each(|ask| line.send(&frame(ask)));
        self.emulation.run(until).unwrap();
        let mut bodies = Vec::new();
        let now = self.now();
        self.frames.receive(&line.take(), now, |body| bodies.push(body));
        for body in bodies {
            match postcard::take_from_bytes(&body) {
                Ok((Tell::Parameter { index, value, .. }, _)) => self.told.push((index, value)),
                Ok((Tell::Welcome { declaration, .. }, _)) => self.declaration = Some(declaration),
                Ok((Tell::Answer { .. }, _)) => self.answered = true,
                _ => {}
            }
        }
    }

    /// The value of a parameter, as soon as the robot says it.
    fn value(&mut self, parameter: u16) -> f32 {
        self.told.clear();
        let hello = Ask::Hello { version: rc10_link::VERSION };
        let ask = [hello, Ask::Parameters { first: parameter - parameter % AT_ONCE }];
        for _ in 0..400 {
            let until = self.now() + Micros::from_millis(10);
            self.run(&ask, until.into());
            if let Some((_, value)) = self.told.iter().find(|(index, _)| *index == parameter) {
                return *value;
            }
        }
        panic!("the robot does not say its parameter: {}", log(self.emulation));
    }
}

/// Cuts in the midst of saves: each start finds the old value or the new one.
fn cuts(board: Board, count: u64) {
    let mut random = Random::new(5);
    let times: Vec<u64> = (0..count).map(|cut| 1_000_000_000 + 100_000_000 * cut).collect();
    let faults = times.iter().map(|at| format!("cut-power@{}us..{}us", at / 1000, at / 1000 + 500));
    let faults: Vec<String> = ["remote-lost@1ms".to_owned()].into_iter().chain(faults).collect();
    let faults: Vec<&str> = faults.iter().map(String::as_str).collect();
    run(&Setup { console: Some(BAUD), ..setup_on(board, &faults) }, |emulation| {
        let (feeder, table) = Watched::new(emulation).parameter("feeder speed", "value");
        let mut quick = Quick {
            emulation,
            frames: Stream::new(FromRobot),
            told: vec![],
            declaration: None,
            answered: false,
        };
        let mut old = table;
        let (mut kept, mut lost) = (0, 0);
        for (round, at) in (0_u16..).zip(times) {
            let value = quick.value(feeder);
            assert!(value == old || round == 0, "round {round}: {value}, not {old}");
            let new = 100.0 + f32::from(round);
            let declaration = quick.declaration.unwrap();
            let change = Change { parameter: feeder, value: new };
            let set = Ask::Set { id: 7, changes: [change].into_iter().collect(), declaration };
            let hello = Ask::Hello { version: rc10_link::VERSION };
            // A save is two words in two milliseconds, about 1 ms after it was asked for.
            let ask_at = at - random.below(4_000_000);
            let before = Nanos::new(ask_at - 20_000_000);
            quick.run(&[], before);
            quick.run(&[hello, set], Nanos::new(ask_at));
            quick.answered = false;
            let save = Ask::Act { id: 8, declaration, heard: 0, action: Action::Save };
            quick.run(&[save], Nanos::new(at + 1_000));
            let answered = quick.answered;
            quick.run(&[], Nanos::new(at + 600_000));
            let value = quick.value(feeder);
            assert!(
                value == old || value == new,
                "round {round}: {value}, {old} before, {new} wanted"
            );
            assert!(!answered || value == new, "round {round}: what was confirmed is kept");
            if value == new {
                kept += 1;
            } else {
                lost += 1;
            }
            old = value;
        }
        let told = log(quick.emulation);
        assert!(!told.contains("crash"), "{told}");
        println!("{count} cuts: {kept} times the new value, {lost} times the old one");
        assert!(kept > count / 5 && lost > count / 5);
    });
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn two_hundred_cuts_leave_the_old_or_the_new_value() {
    cuts(Board::H723ZG, 200);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn two_hundred_cuts_leave_the_old_or_the_new_value_on_the_dm_mc02() {
    cuts(Board::DM_MC02, 200);
}
