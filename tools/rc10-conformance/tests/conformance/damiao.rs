use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::{Declaration, Trial};
use rc10_motor::damiao::{Config, Control, Damiao, models};
use rc10_motor::rc10_app::Direction;
use rc10_motor::{Impedance, Target};
use rc10_sim::damiao::{Damiao as Device, DamiaoConfig};
use rc10_sim::{Bus, Esc};

use super::Check;
use crate::motors::damiao::{LOAD, MOST, cascade, mode_of};

const fn ids(id: u8) -> (u16, u16) {
    (id as u16, id as u16 + 0x20)
}

pub fn motor(id: u8, control: Control, direction: Direction) -> Damiao {
    let (can_id, master_id) = ids(id);
    let config = Config::new(models::J4310, can_id, master_id, control);
    Damiao::new(config.with_direction(direction)).unwrap()
}

pub fn device(wire: &Bus, id: u8, control: &Control) -> Esc {
    let (can_id, master_id) = ids(id);
    let sold = DamiaoConfig::j4310(can_id, master_id);
    let config = DamiaoConfig { mode: mode_of(control), timeout: 2000, ..sold };
    wire.add(Device::new(&config), config.plant.with_load_inertia(LOAD))
}

fn j4310<C: Check>(
    control: Control,
    declared: Declaration,
    direction: Direction,
) -> Result<(), String> {
    C::check(
        &Declaration { direction, ..declared },
        |id| motor(id, control, direction),
        |wire, id| device(wire, id, &control),
    )
}

const SPEEDS: [Trial; 2] = [
    Trial::new(Target::Speed(Rpm::new(100.0)), 2.0, 400),
    Trial::new(Target::Speed(Rpm::new(-50.0)), 2.0, 400),
];
const ANGLES: [Trial; 2] = [
    Trial::new(Target::Angle(Degrees::new(90.0)), 1.0, 5000),
    Trial::new(Target::TotalAngle(TotalAngle::from_degrees(-360)), 1.0, 12_000),
];

/// The registers that it compares before it enables are read one after the other.
fn declared() -> Declaration {
    let declared = Declaration::new([0x11, 0x12], Rpm::new(60.0), NewtonMetres::new(MOST));
    Declaration { enables_within: 60, ..declared }
}

/// With our loops, and its springs.
pub fn mit() -> (Control, Declaration) {
    let spring = Impedance { angle: Degrees::new(90.0), kp: 8.0, kd: 0.8, ..Impedance::default() };
    let declared = declared().with_trials(&[
        Trial::new(Target::Torque(NewtonMetres::new(3.5)), 0.1, 100),
        Trial::new(Target::Impedance(spring), 3.0, 3000),
    ]);
    (Control::Mit(cascade()), declared.with_trials(&SPEEDS).with_trials(&ANGLES))
}

pub fn j4310_mit<C: Check>(direction: Direction) -> Result<(), String> {
    let (control, declared) = mit();
    j4310::<C>(control, declared, direction)
}

pub fn j4310_velocity<C: Check>(direction: Direction) -> Result<(), String> {
    j4310::<C>(Control::Velocity, declared().with_trials(&SPEEDS), direction)
}

/// These take no speed, and reach two turns from zero: they cruise slowly.
fn to_angles<C: Check>(control: Control, direction: Direction) -> Result<(), String> {
    let declared = Declaration {
        cruise: SLOW,
        far: Some(TotalAngle::from_degrees(700)),
        ..declared().with_trials(&ANGLES)
    };
    j4310::<C>(control, declared, direction)
}

const SLOW: Rpm = Rpm::new(15.0);

pub fn j4310_position_velocity<C: Check>(direction: Direction) -> Result<(), String> {
    to_angles::<C>(Control::PositionVelocity { speed: SLOW }, direction)
}

pub fn j4310_force_position<C: Check>(direction: Direction) -> Result<(), String> {
    to_angles::<C>(Control::ForcePosition { speed: SLOW, torque_share: 0.5 }, direction)
}
