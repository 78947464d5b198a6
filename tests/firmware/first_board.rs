//! A first board and a person before it, led by `rc10 board-test`: each fault that a board can have is named.
//!
//! The emulated chip stands for the board, the faults are those of its crystal, pins, parts and wires, and the test
//! plays the person: it presses, switches and measures what it is asked to, and knows nothing else.

use std::time::Duration;

use rc10_cli::commands::board_test::{Bench, Line, Walk, steps};
use rc10_cli::robot::remote::ReceiverWire;
use rc10_cli::run::emulation::{Emulation, Setup};
use rc10_cli::run::running::Running as _;
use rc10_emu::Board;
use rc10_emu::fault::Kind;
use rc10_emu::peripherals::{ResetCause, Width};
use rc10_sim::fault::Wire;
use rc10_sim::remote::{Controls, Switch};
use rc10_sim::{Nanos, Random};
use serde_json::Value;

use super::{give, millis, setup_on};

/// What is wrong with a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seeded {
    Nothing,
    CrystalDead,
    CrystalOther,
    CrystalOff,
    TransceiversUnpowered,
    TransceiverBroken,
    Short,
    Dominant,
    TerminationMissing,
    RemoteInverted,
    RemoteWire,
    ReceiverMakesUp,
    SwitchesExchanged,
    ConsoleWire,
    ResetButton,
    SupplySags,
    CoreSupply,
    BrownOutLevel,
    BusCable,
    Standby,
    PinsExchanged,
    ImuDead,
    KeyStuck,
}
use Seeded::*;

/// Each fault, the step that finds it, and what a person has to be told.
const BOTH: [(Seeded, &str, &[&str]); 18] = [
    (BrownOutLevel, "9", &["brown-out level"]),
    (CrystalDead, "11", &["crystal does not run"]),
    (CrystalOther, "11", &["another crystal", "is for one of"]),
    (SupplySags, "11", &["supply sags"]),
    (CoreSupply, "11", &["core's supply", "VCAP"]),
    // Too little for the chip's own oscillator to see it.
    (CrystalOff, "12", &["clock runs", "fast", "crystal"]),
    (ConsoleWire, "13", &["nothing arrives at the console"]),
    (TransceiversUnpowered, "15", &["transceivers have no supply"]),
    (TransceiverBroken, "15", &["bus 2", "transceiver is broken"]),
    (Short, "15", &["bus 1", "CANH and CANL touch"]),
    (Dominant, "15", &["bus 3", "held dominant"]),
    (ResetButton, "17", &["reset button does not reach"]),
    (RemoteInverted, "23", &["inverted once too often, or not at all"]),
    (RemoteWire, "23", &["receiver is not heard", "nothing arrives"]),
    (SwitchesExchanged, "24", &["switches are exchanged"]),
    (ReceiverMakesUp, "25", &["receiver makes up channels"]),
    (TerminationMissing, "28", &["bus 1", "termination"]),
    (BusCable, "28", &["bus 3", "cable"]),
];
const OF_H723ZG: [(Seeded, &str, &[&str]); 2] = [
    (Standby, "15", &["bus 2", "standby"]),
    (PinsExchanged, "15", &["bus 3", "RX and TX are exchanged"]),
];
const OF_DM_MC02: [(Seeded, &str, &[&str]); 2] =
    [(ImuDead, "13", &["IMU does not answer"]), (KeyStuck, "13", &["key is pressed"])];

/// The board with its fault.
fn made(board: Board, seeded: Seeded) -> Board {
    let all = [true; 3];
    let hz = board.crystal_hz;
    match seeded {
        // The other board's.
        CrystalOther => Board { crystal_hz: 49_000_000 - hz, ..board },
        CrystalOff => Board { crystal_hz: hz / 1000 * 1012, ..board },
        TransceiversUnpowered => Board { transceivers: [false; 3], ..board },
        TransceiverBroken | Standby => Board { transceivers: [true, false, true], ..board },
        PinsExchanged => Board { transceivers: [true, true, false], ..board },
        RemoteInverted => Board { inverts_remote: !board.inverts_remote, ..board },
        CoreSupply => Board { core_supply: false, ..board },
        BrownOutLevel => Board { brown_out: 0, ..board },
        ImuDead => Board { imu: None, ..board },
        _ => Board { transceivers: all, ..board },
    }
}

/// The emulated board, and the person.
struct Desk<'e, 'r> {
    emulation: &'e mut Emulation<'r>,
    seeded: Seeded,
    /// When the program was begun; it is dipped once behind that.
    begun: Option<Nanos>,
    console: Vec<u8>,
    hands: Controls,
    /// Whether the transmitter was ever on, and a motor.
    was_on: bool,
    is_noisy: bool,
    chance: Random,
}

impl Desk<'_, '_> {
    fn now(&self) -> Nanos {
        self.emulation.rig.machine.now()
    }

    fn pass(&mut self, time: u64) {
        let end = self.now() + Nanos::new(time);
        while self.now() < end {
            // Ringing at the end of a cable destroys some frames, whoever sends them.
            let mut next = end;
            if self.is_noisy {
                self.emulation.rig.buses[0].damage(1);
                let apart = 300_000 + self.chance.below(1_400_000);
                next = (self.now() + Nanos::new(apart)).min(end);
            } else if self.seeded == SupplySags {
                next = (self.now() + millis(20)).min(end);
            }
            self.emulation.run(next).unwrap();
            let is_due = self.begun.is_some_and(|begun| self.now() >= begun + millis(100));
            if self.seeded == SupplySags && is_due {
                self.begun = None;
                self.emulation.rig.machine.restart(ResetCause::BrownOut);
            }
        }
    }

    fn hold(&mut self, left: Option<Switch>, right: Option<Switch>) {
        self.hands.left_switch = left.unwrap_or(self.hands.left_switch);
        self.hands.right_switch = right.unwrap_or(self.hands.right_switch);
        let mut controls = self.hands;
        if self.seeded == SwitchesExchanged {
            std::mem::swap(&mut controls.left_switch, &mut controls.right_switch);
        }
        self.was_on = true;
        self.emulation.operator().unwrap().hold(controls, None);
    }

    fn switch_off(&mut self) {
        // A receiver of this kind goes on with the channels that it had last.
        if self.seeded != ReceiverMakesUp || !self.was_on {
            self.emulation.operator().unwrap().leave();
        }
    }

    /// What a meter says; before the program began the person has no meter.
    fn ohms(&self, bus: &str) -> &'static str {
        match (self.begun, self.seeded, bus) {
            (None, ..) => "",
            (_, Short, "1") => "0.3",
            (_, TerminationMissing, "1") => "120",
            _ => "60",
        }
    }
}

impl Bench for Desk<'_, '_> {
    fn start(&mut self) -> anyhow::Result<()> {
        self.emulation.rig.machine.restart(ResetCause::Pin);
        let _ = self.emulation.rig.machine.take_log();
        self.begun = Some(self.now());
        Ok(())
    }

    fn listen(&mut self, seconds: f64) -> anyhow::Result<Vec<Line>> {
        self.pass(Duration::from_secs_f64(seconds).as_nanos().try_into().unwrap());
        let log = self.emulation.rig.machine.take_log().into_iter();
        let at = |at: Nanos| at.get() as f64 / 1e9;
        let log = log.map(|line| Line { from: "log", at: at(line.at), text: line.text });
        let mut lines: Vec<_> = log.collect();
        self.console.extend(self.emulation.console.as_ref().unwrap().take());
        while let Some(end) = self.console.iter().position(|byte| *byte == b'\n') {
            let text: Vec<_> = self.console.drain(..=end).collect();
            let text = String::from_utf8_lossy(&text).trim_end().to_owned();
            lines.push(Line { from: "console", at: at(self.now()), text });
        }
        Ok(lines)
    }

    fn read(&mut self, address: u32) -> anyhow::Result<u32> {
        // Such a program takes its time.
        self.pass(10_000_000);
        let (now, machine) = (self.now(), &self.emulation.rig.machine);
        let read = machine.soc().read(address, Width::Word, now);
        read.map_err(|_| anyhow::anyhow!("the bus refuses {address:#x}"))
    }

    fn ask(&mut self, question: &str) -> anyhow::Result<Option<String>> {
        let (machine, seeded) = (&mut self.emulation.rig.machine, self.seeded);
        let begins = |words: &str| question.starts_with(words);
        let bus = question.split("bus ").nth(1).map_or("", |rest| &rest[..1]);
        let answer = match question {
            _ if begins("volts at VCC") && seeded == TransceiversUnpowered => "0.1",
            _ if begins("volts at VCC") => "4.9",
            _ if begins("volts at its STB") && seeded == Standby => "3.3",
            _ if begins("volts at its STB") && machine.board().name == "h723zg" => "0",
            _ if begins("all off: ohms") => self.ohms(bus),
            _ if begins("all off: does a meter beep") && seeded == PinsExchanged => "n",
            _ if begins("all off: does a meter beep") => "y",
            _ if begins("press reset") => {
                if seeded != ResetButton {
                    machine.restart(ResetCause::Pin);
                }
                ""
            }
            _ if begins("power one motor on bus") => {
                let bus: usize = bus.parse().unwrap();
                self.emulation.rig.plan(false, Kind::Power(Wire::Bus(bus - 1)));
                self.is_noisy |= seeded == TerminationMissing;
                ""
            }
            _ if begins("the transmitter off") => {
                self.switch_off();
                ""
            }
            _ if begins("the transmitter on, the right switch down") => {
                self.hold(Some(Switch::Middle), Some(Switch::Down));
                ""
            }
            _ if begins("the transmitter on, the right switch up") => {
                self.hold(None, Some(Switch::Up));
                ""
            }
            _ if begins("the right switch to the middle") => {
                self.hold(None, Some(Switch::Middle));
                ""
            }
            _ if begins("the right switch down") => {
                self.hold(None, Some(Switch::Down));
                ""
            }
            _ if begins("the left switch down") => {
                self.hold(Some(Switch::Down), None);
                ""
            }
            _ if begins("the left switch to the middle, the right one") => {
                self.hold(Some(Switch::Middle), Some(Switch::Middle));
                self.pass(100_000_000);
                self.hold(None, Some(Switch::Down));
                ""
            }
            // It has no such pin; nothing odd is seen on a scope, either.
            _ if begins("volts at its STB") || begins("as it should") || begins("do it;") => "",
            _ if begins("motor power off") => "",
            _ => panic!("the person does not understand: {question}"),
        };
        Ok(Some(answer.into()))
    }
}

/// Does all steps up to the first that is wrong: number and cause of that, and the file.
fn walk(board: Board, seeded: Seeded) -> (Option<(&'static str, String)>, String) {
    let faults: &[&str] = match seeded {
        CrystalDead => &["crystal-dead"],
        Short => &["short:1@0s"],
        Dominant => &["dominant:3@0s"],
        BusCable => &["cut:3@0s"],
        _ => &[],
    };
    let faults = [&["power:1@0s", "power:2@0s", "power:3@0s"], faults].concat();
    let console = Some(<team::Robot as rc10_tasks::Program>::CONSOLE);
    let setup = Setup { console, ..setup_on(made(board, seeded), &faults) };
    give(&setup, |mut emulation| {
        emulation.operator().unwrap().lay_down();
        emulation.operator().unwrap().leave();
        match (seeded, &emulation.remote.as_ref().unwrap().wire) {
            (RemoteWire, ReceiverWire::Serial(wire)) => wire.set_cut(true),
            (KeyStuck, _) => emulation.rig.machine.press_key(true).unwrap(),
            (ConsoleWire, _) => emulation.console.as_ref().unwrap().serial().set_cut(true),
            _ => {}
        }
        let (console, hands) = (Vec::new(), Controls::REST);
        let mut desk = Desk {
            emulation: &mut emulation,
            seeded,
            begun: None,
            console,
            hands,
            was_on: false,
            is_noisy: false,
            chance: Random::new(1),
        };
        let (mut out, mut file) = (Vec::new(), Vec::new());
        let mut walk = Walk {
            bench: &mut desk,
            out: &mut out,
            file: &mut file,
            board,
            buses: 3,
            has_console: true,
            pace: 0.05,
            heard: Vec::new(),
            before: 0,
        };
        let mut found = None;
        for number in steps(&board) {
            let outcome = walk.step(number).unwrap();
            if outcome.word == "wrong" {
                assert!(!outcome.mend.is_empty(), "{}", outcome.text);
                found = Some((number, outcome.text));
                break;
            }
        }
        (found, String::from_utf8(file).unwrap())
    })
}

fn each_is_named(board: Board, own: &[(Seeded, &str, &[&str])]) {
    let all = BOTH.iter().chain(own);
    let count = all.clone().count();
    let mut named = 0;
    for (seeded, at, words) in all {
        let (found, file) = walk(board, *seeded);
        let (step, cause) = found.unwrap_or(("-", "nothing".into()));
        let is_named = step == *at && words.iter().all(|it| cause.contains(it));
        println!("{} {seeded:?}, step {step}: {cause}", if is_named { "named" } else { "MISSED" });
        named += usize::from(is_named);
        // The file has it, with what was heard before.
        let last: Value = serde_json::from_str(file.lines().last().unwrap()).unwrap();
        assert!(!is_named || last["text"] == cause && last["outcome"] == "wrong", "{last}");
        if !is_named {
            println!("{}", file.lines().rev().take(30).collect::<Vec<_>>().join("\n"));
        }
    }
    println!("{named} of {count} faults of a {} are named", board.name);
    assert_eq!((named, count), (20, 20));
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn each_fault_of_an_h723zg_is_named() {
    each_is_named(Board::H723ZG, &OF_H723ZG);
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn each_fault_of_a_dm_mc02_is_named() {
    each_is_named(Board::DM_MC02, &OF_DM_MC02);
}

/// A board without a fault goes through all steps, and nothing is said against it.
#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_good_board_passes() {
    for board in Board::ALL {
        let (found, file) = walk(board, Nothing);
        assert_eq!(found, None, "{}", board.name);
        let records = file.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        let ended: Vec<_> = records.filter(|it| it.get("step").is_some()).collect();
        assert_eq!(ended.len(), steps(&board).count());
        let right = ended.iter().filter(|it| it["outcome"] == "right").count();
        println!("{}: {right} steps of {} judged right", board.name, ended.len());
        assert_eq!(right, 12, "{ended:#?}");
    }
}
