use rc10_app::{Degrees, NewtonMetres, PidConfig, Rpm, RpmPerSecond, TotalAngle};
use rc10_conformance::{Declaration, Trial};
use rc10_motor::damiao::{Config, Control, Damiao, models};
use rc10_motor::rc10_app::Direction;
use rc10_motor::rc10_app::{Cascade, FeedForward};
use rc10_motor::{Impedance, Target};
use rc10_sim::damiao::{Damiao as Device, DamiaoConfig, Mode};

use super::Check;

/// N m.
const FULL: f32 = 7.0;

fn j4310<C: Check>(
    control: Control,
    mode: Mode,
    declared: Declaration,
    direction: Direction,
) -> Result<(), String> {
    let declared = Declaration { direction, ..declared };
    let ids = |id: u8| (u16::from(id), u16::from(id) + 0x20);
    C::check(
        &declared,
        |id| {
            let (can_id, master_id) = ids(id);
            let config = Config::new(models::J4310, can_id, master_id, control);
            Damiao::new(config.with_direction(direction)).unwrap()
        },
        |wire, id| {
            let (can_id, master_id) = ids(id);
            let config = DamiaoConfig { mode, ..DamiaoConfig::j4310(can_id, master_id) };
            wire.add(Device::new(&config), config.plant.with_load_inertia(0.02))
        },
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
    let declared = Declaration::new([0x11, 0x12], Rpm::new(60.0), NewtonMetres::new(FULL));
    Declaration { enables_within: 60, ..declared }
}

pub fn j4310_mit<C: Check>(direction: Direction) -> Result<(), String> {
    let cascade = Cascade {
        speed: PidConfig::new(0.063, 0.5, 0.0, FULL),
        angle: PidConfig::new(1.3, 0.0, 0.0, 150.0),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    };
    let spring = Impedance { angle: Degrees::new(90.0), kp: 8.0, kd: 0.8, ..Impedance::default() };
    let declared = declared().with_trials(&[
        Trial::new(Target::Torque(NewtonMetres::new(3.5)), 0.1, 100),
        Trial::new(Target::Impedance(spring), 3.0, 3000),
    ]);
    j4310::<C>(
        Control::Mit(cascade),
        Mode::Mit,
        declared.with_trials(&SPEEDS).with_trials(&ANGLES),
        direction,
    )
}

pub fn j4310_velocity<C: Check>(direction: Direction) -> Result<(), String> {
    j4310::<C>(Control::Velocity, Mode::Velocity, declared().with_trials(&SPEEDS), direction)
}

/// These take no speed, and reach two turns from zero: they cruise slowly.
fn to_angles<C: Check>(control: Control, mode: Mode, direction: Direction) -> Result<(), String> {
    let declared = Declaration {
        cruise: SLOW,
        far: Some(TotalAngle::from_degrees(700)),
        ..declared().with_trials(&ANGLES)
    };
    j4310::<C>(control, mode, declared, direction)
}

const SLOW: Rpm = Rpm::new(15.0);

pub fn j4310_position_velocity<C: Check>(direction: Direction) -> Result<(), String> {
    to_angles::<C>(Control::PositionVelocity { speed: SLOW }, Mode::PositionVelocity, direction)
}

pub fn j4310_force_position<C: Check>(direction: Direction) -> Result<(), String> {
    let control = Control::ForcePosition { speed: SLOW, torque_share: 0.5 };
    to_angles::<C>(control, Mode::ForcePosition, direction)
}
