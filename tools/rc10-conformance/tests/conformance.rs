//! Every motor of `rc10-motor` keeps the rules. One entry a model: put yours into [`motors`].

mod cybergear;
pub mod damiao;
mod dji;
mod lk;
mod odrive;
pub mod unitree_line;
mod unitree_module;
mod vesc;

use rc10_conformance::Declaration;
use rc10_motor::CanMotor;
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::GoM8010;
use rc10_sim::{Bus, Esc, Line};

/// A check of motors.
pub trait Check {
    fn check<M: CanMotor + 'static>(
        declared: &Declaration,
        motor: impl Fn(u8) -> M,
        device: impl Fn(&Bus, u8) -> Esc,
    ) -> Result<(), String>;

    fn check_line(
        declared: &Declaration,
        motor: impl Fn(u8) -> GoM8010,
        device: impl Fn(&Line, u8) -> Esc,
    ) -> Result<(), String>;
}

/// The rules.
struct Rules;

impl Check for Rules {
    fn check<M: CanMotor + 'static>(
        declared: &Declaration,
        motor: impl Fn(u8) -> M,
        device: impl Fn(&Bus, u8) -> Esc,
    ) -> Result<(), String> {
        rc10_conformance::check(declared, motor, device).map_err(|report| report.to_string())
    }

    fn check_line(
        declared: &Declaration,
        motor: impl Fn(u8) -> GoM8010,
        device: impl Fn(&Line, u8) -> Esc,
    ) -> Result<(), String> {
        rc10_conformance::check_line(declared, motor, device).map_err(|report| report.to_string())
    }
}

/// A model, and what its check says of one made to turn that way.
type Entry = (&'static str, fn(Direction) -> Result<(), String>);

fn motors<C: Check>() -> [Entry; 20] {
    [
        ("M3508", dji::m3508::<C>),
        ("M2006", dji::m2006::<C>),
        ("GM6020, current mode", dji::gm6020_current::<C>),
        ("GM6020, voltage mode", dji::gm6020_voltage::<C>),
        ("Damiao J4310, MIT", damiao::j4310_mit::<C>),
        ("Damiao J4310, velocity", damiao::j4310_velocity::<C>),
        ("Damiao J4310, position-velocity", damiao::j4310_position_velocity::<C>),
        ("Damiao J4310, force-position", damiao::j4310_force_position::<C>),
        ("GO-M8010-6 behind a module", unitree_module::go_m8010::<C>),
        ("VESC", vesc::vesc::<C>),
        ("VESC, relative currents", vesc::vesc_relative::<C>),
        ("VESC with angle loops", vesc::vesc_with_servo::<C>),
        ("MG4010E-i10", lk::mg4010e::<C>),
        ("MF9025 in the multi-motor frame", lk::mf9025_multi_motor::<C>),
        ("ODrive, torque", odrive::torque::<C>),
        ("ODrive, velocity", odrive::velocity::<C>),
        ("ODrive, position", odrive::position::<C>),
        ("CyberGear", cybergear::cybergear::<C>),
        ("RobStride RS04", cybergear::rs04::<C>),
        ("GO-M8010-6 on RS-485", unitree_line::go_m8010::<C>),
        // One line for each further model, one file for each vendor in `conformance/`.
    ]
}

/// Tries every `step`th motor from the `first` one on.
pub fn all_pass<C: Check>(direction: Direction, first: usize, step: usize) {
    let report = |(model, check): Entry| Some(format!("{model}: {}", check(direction).err()?));
    let some = motors::<C>().into_iter().skip(first).step_by(step);
    let wrong: Vec<String> = some.filter_map(report).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn every_motor_keeps_the_rules() {
    all_pass::<Rules>(Direction::Forward, 0, 1);
}

#[test]
fn every_reversed_motor_keeps_the_rules_in_the_mirror() {
    all_pass::<Rules>(Direction::Reversed, 0, 1);
}
