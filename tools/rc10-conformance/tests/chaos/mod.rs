//! Seeded random stories: everything that can happen to a motor, at any time and in any order. What
//! must hold is looked at in every millisecond, and at the end everything is well again.
//!
//! `RC10_STORIES=500 cargo test -p rc10-conformance --test all chaos` tells more of them, `RC10_STORY=7`
//! only number 7.

#[path = "../conformance/cybergear.rs"]
mod cybergear;
#[path = "../conformance/damiao.rs"]
mod damiao;
#[path = "../conformance/dji.rs"]
mod dji;
mod line;
#[path = "../conformance/lk.rs"]
mod lk;
#[path = "../conformance/odrive.rs"]
mod odrive;
mod random;
mod scene;
mod story;
#[path = "../conformance/unitree_line.rs"]
mod unitree_line;
#[path = "../conformance/unitree_module.rs"]
mod unitree_module;
#[path = "../conformance/vesc.rs"]
mod vesc;
mod watch;

use rc10_conformance::Declaration;
use rc10_motor::CanMotor;
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::GoM8010;
use rc10_sim::{Bus, Esc, Line};

use line::LineScene;
use scene::CanScene;

/// What broke, and in which story.
pub type Report = String;

/// Stories of a motor, unless `RC10_STORIES` asks for more.
const STORIES: u64 = 60;

/// The numbers of the stories to tell.
pub fn seeds() -> std::ops::Range<u64> {
    let first = std::env::var("RC10_STORY").ok().and_then(|text| text.parse().ok());
    let count = std::env::var("RC10_STORIES").ok().and_then(|text| text.parse().ok());
    first.map_or(0..count.unwrap_or(STORIES), |first| first..first + count.unwrap_or(1))
}

/// As [`rc10_conformance::check`], which the makers in `conformance_of` call in another test.
pub fn check<M: CanMotor + 'static>(
    declared: &Declaration,
    motor: impl Fn(u8) -> M,
    device: impl Fn(&Bus, u8) -> Esc,
) -> Result<(), Report> {
    seeds().try_for_each(|seed| {
        let mut motor = motor(declared.ids[0]);
        CanScene::play(declared, &mut motor, &device, seed)
            .map_err(|what| format!("story {seed}: {what}"))
    })
}

/// As [`rc10_conformance::check_line`].
pub fn check_line(
    declared: &Declaration,
    motor: impl Fn(u8) -> GoM8010,
    device: impl Fn(&Line, u8) -> Esc,
) -> Result<(), Report> {
    seeds().try_for_each(|seed| {
        LineScene::play(declared, &mut motor(declared.ids[0]), &device, seed)
            .map_err(|what| format!("story {seed}: {what}"))
    })
}

/// A model, and what its stories say.
type Entry = (&'static str, fn(Direction) -> Result<(), Report>);

fn all(motors: &[Entry]) {
    let broken: Vec<String> = motors
        .iter()
        .filter_map(|(name, check)| {
            check(Direction::Forward).err().map(|report| format!("{name}: {report}"))
        })
        .collect();
    assert!(broken.is_empty(), "\n{}\n", broken.join("\n\n"));
}

#[test]
fn dji_motors() {
    all(&[
        ("M3508", dji::m3508),
        ("M2006", dji::m2006),
        ("GM6020, current mode", dji::gm6020_current),
        ("GM6020, voltage mode", dji::gm6020_voltage),
    ]);
}

#[test]
fn damiao_motors() {
    all(&[
        ("J4310, MIT", damiao::j4310_mit),
        ("J4310, velocity", damiao::j4310_velocity),
        ("J4310, position-velocity", damiao::j4310_position_velocity),
        ("J4310, force-position", damiao::j4310_force_position),
    ]);
}

#[test]
fn cybergears_and_robstrides() {
    all(&[("CyberGear", cybergear::cybergear), ("RobStride RS04", cybergear::rs04)]);
}

#[test]
fn unitree_motors() {
    all(&[
        ("GO-M8010-6 behind a module", unitree_module::go_m8010),
        ("GO-M8010-6 on a line", unitree_line::go_m8010),
    ]);
}

#[test]
fn vescs() {
    all(&[
        ("VESC", vesc::vesc),
        ("VESC, relative currents", vesc::vesc_relative),
        ("VESC with angle loops", vesc::vesc_with_servo),
    ]);
}

#[test]
fn lk_drives() {
    all(&[
        ("MG4010E-i10", lk::mg4010e),
        ("MF9025 in the multi-motor frame", lk::mf9025_multi_motor),
    ]);
}

#[test]
fn odrive_axes() {
    all(&[
        ("ODrive, torque", odrive::torque),
        ("ODrive, velocity", odrive::velocity),
        ("ODrive, position", odrive::position),
    ]);
}
