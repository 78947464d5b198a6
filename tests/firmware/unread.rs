//! What the program does not read, and what it warns of, is told by the command.

use rc10_cli::Simulated as _;
use std::collections::VecDeque;

use rc10_cli::CommandLine;
use rc10_cli::robot::description::SerialPart;
use rc10_module::Reception;
use rc10_sim::imu::Hwt101;
use rc10_sim::{Nanos, SerialDevice};

use super::{Motors, Shared};
use crate::scratch::Scratch;

/// Says nothing.
struct Mute;

impl SerialDevice for Mute {
    fn power_on(&mut self, _: Nanos) {}
    fn next_event(&self) -> Option<Nanos> {
        None
    }
    fn advance(&mut self, _: Nanos, _: &mut VecDeque<u8>) {}
    fn receive(&mut self, _: u8, _: Nanos) {}
}

/// Exit code and output of `emu --strict` of the team's robot, with these parts on its UARTs.
fn emulated(name: &str, parts: &[SerialPart]) -> (u8, String) {
    let mut description = team::Robot::description();
    description.serials = parts.into();
    let scratch = Scratch::new(name);
    let file = std::env::var("RC10_FIRMWARE").unwrap();
    let out = scratch.to_str().unwrap();
    let line = ["rc10", "emu", "--strict", "--seconds", "1.3", "--out", out, &file];
    let (ports, unread) = (team::Ports::new(), Reception::new());
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let robot = rc10_cli::Robot::of::<team::Robot>(description, &shared, &mut motors).unwrap();
    let robot = parts.iter().skip(1).fold(robot, |it, _| it.serial(&unread, async |_| {}));
    let mut text = Vec::new();
    let code = CommandLine::parse(line).unwrap().run_to(robot, &mut text).unwrap();
    (code, String::from_utf8(text).unwrap())
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn a_part_that_the_chip_never_reads_is_told() {
    let [imu] = team::Robot::description().serials.try_into().unwrap();
    let twin = |world: &mut rc10_sim::World, base: Option<&rc10_sim::Base>| {
        Ok(world.add_serial(Hwt101::SERIAL, Hwt101::new(base.unwrap(), Nanos::ZERO)))
    };
    let (code, text) = emulated(
        "unread",
        &[imu, SerialPart { label: "wall", uart: 10, baud: 115_200, twin: Some(twin) }],
    );
    assert_eq!(code, 3, "{text}");
    assert!(text.contains("✗ 1 problem\n  wall: never read by the chip"), "{text}");
}

#[test]
#[ignore = "needs the firmware: cargo xtask emulate"]
fn an_imu_that_says_nothing_is_told() {
    let [imu] = team::Robot::description().serials.try_into().unwrap();
    let twin = |world: &mut rc10_sim::World, _: Option<&rc10_sim::Base>| {
        Ok(world.add_serial(Hwt101::SERIAL, Mute))
    };
    let (code, text) = emulated("mute", &[SerialPart { twin: Some(twin), ..imu }]);
    assert_eq!(code, 3, "{text}");
    assert!(text.contains("the program warns from 1.0"), "{text}");
    assert!(text.contains("s on: IMU gives no heading"), "{text}");
}
