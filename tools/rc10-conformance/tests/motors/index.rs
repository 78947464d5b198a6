//! `docs/motors/README.md` says what is so: each motor's targets and load, and who may not share a
//! bus.

use std::num::NonZeroU8;

use rc10_app::{Amps, Gear, Rpm};
use rc10_motor::cybergear::{self, CyberGear};
use rc10_motor::damiao::{self, Control, Damiao};
use rc10_motor::dji::{self, Dji};
use rc10_motor::lk::{self, Commands, Lk};
use rc10_motor::odrive::{self, Firmware, InputMode, Limits, ODrive, Rates};
use rc10_motor::unitree::{GoM8010, GoModule, LineConfig, ModuleConfig};
use rc10_motor::vesc::{self, Currents, Vesc};
use rc10_motor::{ArmSwitch, CanMotor, Motor, MotorBus, Safety, TargetKind, TargetSet, Verdict};

use super::lk::JOINT as CASCADE;

const PAGE: &str = include_str!("../../../../docs/motors/README.md");

fn dji(model: &'static dji::Model, id: u8) -> Dji {
    Dji::new(dji::Config::new(model, id)).unwrap()
}

fn vesc_config(id: u8) -> vesc::Config {
    let scale = vesc::ElectricalScale::new(NonZeroU8::new(7).unwrap(), Gear::DIRECT);
    let amps = Amps::new(10.0);
    let currents = Currents { limit: amps, brake: amps, handbrake: amps };
    vesc::Config::new(id, scale, currents)
}

fn vesc(id: u8) -> Vesc {
    Vesc::new(vesc_config(id)).unwrap()
}

fn module(module: u8, motor: u8) -> GoModule {
    GoModule::new(ModuleConfig::new(module, motor)).unwrap()
}

/// `None` for identifiers that the constructor refuses.
fn damiao(can_id: u16, master_id: u16, control: Control) -> Option<Damiao> {
    Damiao::new(damiao::Config::new(damiao::models::J4310, can_id, master_id, control)).ok()
}

fn robstride(model: &'static cybergear::Model, motor: u8, host: u8) -> CyberGear {
    CyberGear::new(cybergear::Config::new(model, cybergear::Address { motor, host })).unwrap()
}

fn lk(id: u8, commands: Commands) -> Lk {
    let config = lk::Config::new(lk::models::MG4010E_I10, id, CASCADE);
    Lk::new(config.with_commands(commands)).unwrap()
}

fn odrive(node: u8, control: odrive::Control) -> ODrive {
    let limits = Limits { speed: Rpm::new(300.0), current: Amps::new(30.0) };
    let config = odrive::Config::new(node, Firmware::V0_6, control, Rates::new(500, 50));
    ODrive::new(config.with_limits(limits)).unwrap()
}

/// Kinds of target, and their names on the page.
const KINDS: [(TargetKind, &str); 12] = [
    (TargetKind::Coast, "coast"),
    (TargetKind::Current, "current"),
    (TargetKind::Duty, "duty"),
    (TargetKind::Torque, "torque"),
    (TargetKind::Speed, "speed"),
    (TargetKind::Angle, "angle"),
    (TargetKind::TotalAngle, "total angle"),
    (TargetKind::Impedance, "impedance"),
    (TargetKind::Brake, "brake"),
    (TargetKind::Handbrake, "handbrake"),
    (TargetKind::Motion, "motion"),
    (TargetKind::SpeedMotion, "speed motion"),
];

/// The cell of a motor's row; the first column is 0.
fn cell(row: &str, column: usize) -> &'static str {
    let begin = format!("| {row} |");
    let mut rows = PAGE.lines().filter(|line| line.starts_with(&begin));
    let line = rows.next().unwrap_or_else(|| panic!("no row of {row}"));
    assert!(rows.next().is_none(), "two rows of {row}");
    line.split('|').nth(column + 1).unwrap().trim()
}

fn assert_targets(row: &str, supports: TargetSet) {
    let named = KINDS.iter().filter(|(kind, _)| supports.contains(*kind));
    let named: Vec<_> = named.map(|(_, name)| *name).collect();
    let mut told: Vec<_> = cell(row, 2).split(", ").collect();
    told.sort_by_key(|told| KINDS.iter().position(|(_, name)| name == told));
    assert_eq!(told, named, "{row}");
}

#[test]
fn targets_and_loads_are_those_of_the_page() {
    let speed = Rpm::new(50.0);
    let of_damiao = |control| Box::new(damiao(0x11, 0x31, control).unwrap());
    let of_odrive = |control| Box::new(odrive(3, control));
    let rows: [(&str, Box<dyn CanMotor>); 19] = [
        ("M3508 with C620", Box::new(dji(&dji::M3508, 1))),
        ("M2006 with C610", Box::new(dji(&dji::M2006, 1))),
        ("GM6020, current mode", Box::new(dji(&dji::GM6020_CURRENT, 1))),
        ("GM6020, voltage mode", Box::new(dji(&dji::GM6020_VOLTAGE, 1))),
        ("VESC", Box::new(vesc(1))),
        (
            "VESC with our loops",
            Box::new(Vesc::new(vesc_config(1).with_angle_loops(CASCADE)).unwrap()),
        ),
        ("GO-M8010-6, CAN module", Box::new(module(3, 0))),
        ("Damiao, MIT", of_damiao(Control::Mit(CASCADE))),
        ("Damiao, position-velocity", of_damiao(Control::PositionVelocity { speed })),
        ("Damiao, velocity", of_damiao(Control::Velocity)),
        ("Damiao, force-position", of_damiao(Control::ForcePosition { speed, torque_share: 0.5 })),
        ("CyberGear", Box::new(robstride(&cybergear::models::CYBERGEAR, 1, 0xFD))),
        ("RobStride RS00 to RS06", Box::new(robstride(&cybergear::models::RS00, 1, 0xFD))),
        ("LK MF, MG", Box::new(lk(1, Commands::Single))),
        ("LK, multi-motor frame", Box::new(lk(1, Commands::MultiMotor))),
        ("ODrive, torque", of_odrive(odrive::Control::Torque(CASCADE))),
        ("ODrive, velocity", of_odrive(odrive::Control::Velocity(InputMode::VelocityRamp))),
        (
            "ODrive, position (Passthrough)",
            of_odrive(odrive::Control::Position(InputMode::Passthrough)),
        ),
        (
            "ODrive, position (other modes)",
            of_odrive(odrive::Control::Position(InputMode::Trapezoid)),
        ),
    ];
    let switch = ArmSwitch::new();
    for (row, mut motor) in rows {
        assert_targets(row, motor.supports());
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut *motor, Safety::COAST).unwrap();
        let load = bus.load(1_000_000);
        assert_eq!(cell(row, 5), format!("{:.0} / {:.0}", load.typical, load.worst), "{row}");
    }
    assert_targets("GO-M8010-6, RS-485", GoM8010::new(LineConfig::new(0)).unwrap().supports());
}

/// A name, what makes its motors by number, how many of them, their load, and what is said of it.
type Loaded<'a> = (&'a str, &'a dyn Fn(u8) -> Box<dyn CanMotor>, u8, (f32, f32), Verdict);

/// Percent of 1 Mbit/s of equal motors, typically and at worst.
#[test]
fn loads_add_up() {
    use Verdict::{DoesNotFit, Fits, Tight};
    let torque = odrive::Control::Torque(CASCADE);
    let lk_alone = |id| Box::new(lk(id, Commands::Single)) as Box<dyn CanMotor>;
    let lk_multi = |id| Box::new(lk(id, Commands::MultiMotor)) as Box<dyn CanMotor>;
    let of_odrive = |node| {
        let config = odrive::Config::new(node, Firmware::V0_6, torque, Rates::new(1000, 50));
        Box::new(ODrive::new(config).unwrap()) as Box<dyn CanMotor>
    };
    let gear =
        |id| Box::new(robstride(&cybergear::models::CYBERGEAR, id, 0xFD)) as Box<dyn CanMotor>;
    let arm = |id: u8| {
        let can_id = u16::from(id);
        Box::new(damiao(can_id, 0x20 + can_id, Control::Velocity).unwrap()) as Box<dyn CanMotor>
    };
    let behind = |id| Box::new(module(3, id)) as Box<dyn CanMotor>;
    let switch = ArmSwitch::new();
    let makers: [Loaded<'_>; 11] = [
        ("Damiao", &arm, 3, (71.0, 81.0), Fits),
        ("Damiao", &arm, 4, (94.0, 108.0), Tight),
        ("Damiao", &arm, 5, (118.0, 135.0), DoesNotFit),
        ("CyberGear", &gear, 3, (83.0, 96.0), Fits),
        ("CyberGear", &gear, 4, (111.0, 128.0), DoesNotFit),
        ("GO-M8010-6", &behind, 3, (83.0, 96.0), Fits),
        ("ODrive", &of_odrive, 1, (24.0, 28.0), Fits),
        ("ODrive", &of_odrive, 3, (73.0, 83.0), Fits),
        ("LK", &lk_alone, 3, (71.0, 81.0), Fits),
        ("LK", &lk_alone, 4, (94.0, 108.0), Tight),
        ("LK in one frame", &lk_multi, 4, (59.0, 68.0), Fits),
    ];
    for (name, make, count, percent, verdict) in makers {
        let mut motors: Vec<_> = (1..=count).map(make).collect();
        let mut bus = MotorBus::new(&switch);
        for motor in &mut motors {
            bus.attach(&mut **motor, Safety::COAST).unwrap();
        }
        let load = bus.load(1_000_000);
        let told = (load.typical.round(), load.worst.round());
        assert_eq!((told, load.verdict()), (percent, verdict), "{count} {name}");
    }
}

/// Whether the bus refuses them.
fn clash(one: &dyn CanMotor, other: &dyn CanMotor) -> bool {
    one.can_ids().clash(&other.can_ids()).is_some()
}

fn all_dji() -> impl Iterator<Item = (&'static dji::Model, u8)> {
    [&dji::M3508, &dji::M2006, &dji::GM6020_CURRENT, &dji::GM6020_VOLTAGE]
        .into_iter()
        .flat_map(|model| (1..=model.last_id).map(move |id| (model, id)))
}

/// All with standard identifiers, and their rules exactly: what they do not forbid is let in.
#[test]
fn motors_with_standard_identifiers_are_refused_as_the_page_says() {
    let mit = Control::Mit(CASCADE);
    let answers = |id: u16| id + 0x20;
    let odrive = |node| odrive(node, odrive::Control::Torque(CASCADE));
    let is_of_node = |id: u16, node: u8| id >> 5 == u16::from(node);
    for (model, id) in all_dji() {
        let wheel = dji(model, id);
        let feedback = model.feedback_id(id).unwrap().as_raw();
        let command = model.command_lane(id).unwrap().0.as_raw();
        for can_id in 1..0xFF {
            let Some(arm) = damiao(can_id, answers(can_id), mit) else { continue };
            let expected = can_id == feedback & 0xFF || can_id == command & 0xFF;
            assert_eq!(clash(&arm, &wheel), expected, "{can_id:#x} {} {id}", model.name);
        }
        for node in 0..63 {
            let expected = is_of_node(feedback, node) || is_of_node(command, node);
            assert_eq!(clash(&odrive(node), &wheel), expected, "{node} {} {id}", model.name);
        }
        for drive in 1..=4 {
            assert!(!clash(&lk(drive, Commands::Single), &wheel));
            assert!(!clash(&lk(drive, Commands::MultiMotor), &wheel));
        }
    }
    for id in 1..=32 {
        for commands in [Commands::Single, Commands::MultiMotor] {
            if commands == Commands::MultiMotor && id > 4 {
                continue;
            }
            let drive = lk(id, commands);
            let shared = if commands == Commands::MultiMotor { Some(0x280) } else { None };
            let ids = [Some(0x140 + u16::from(id)), shared];
            for can_id in 1..0xFF {
                let Some(arm) = damiao(can_id, answers(can_id), mit) else { continue };
                let expected = ids.into_iter().flatten().any(|taken| taken & 0xFF == can_id);
                assert_eq!(clash(&arm, &drive), expected, "{can_id:#x} {id} {commands:?}");
            }
            for node in 0..63 {
                let expected = ids.into_iter().flatten().any(|taken| is_of_node(taken, node));
                assert_eq!(clash(&odrive(node), &drive), expected, "{node} {id} {commands:?}");
            }
        }
    }
    for node in 0..63 {
        let axis = odrive(node);
        for can_id in 1..0xFF {
            let Some(arm) = damiao(can_id, answers(can_id), mit) else { continue };
            let obeys = can_id >> 5 == u16::from(node % 8);
            let expected = obeys || is_of_node(answers(can_id), node);
            assert_eq!(clash(&arm, &axis), expected, "{can_id:#x} {node}");
        }
    }
}

#[test]
fn motors_with_extended_identifiers_are_refused_as_the_page_says() {
    const HOST: u8 = 0xFD;
    let gear = |motor| robstride(&cybergear::models::CYBERGEAR, motor, HOST);
    for id in 0..254 {
        let wheel = vesc(id);
        for number in 0..4 {
            assert_eq!(clash(&wheel, &module(number, 5)), number == 0, "{id} {number}");
        }
        for motor in 1..128 {
            assert_eq!(clash(&wheel, &gear(motor)), id == motor || id == HOST, "{id} {motor}");
        }
    }
    for motor in 1..128 {
        for number in 0..4 {
            assert!(clash(&gear(motor), &module(number, 0)), "{motor} {number}");
        }
    }
    let standard: [Box<dyn CanMotor>; 4] = [
        Box::new(dji(&dji::M3508, 1)),
        Box::new(damiao(0x11, 0x31, Control::Velocity).unwrap()),
        Box::new(lk(1, Commands::Single)),
        Box::new(odrive(3, odrive::Control::Torque(CASCADE))),
    ];
    for other in &standard {
        for extended in [&vesc(1) as &dyn CanMotor, &module(0, 0), &gear(1)] {
            assert!(!clash(&**other, extended));
        }
    }
}

/// Any eight of these numbers.
#[test]
fn the_numbers_that_live_well_together_do() {
    let torque = odrive::Control::Torque(CASCADE);
    let mut all: Vec<Box<dyn CanMotor>> = Vec::new();
    for (model, id) in [&dji::M3508, &dji::GM6020_CURRENT].into_iter().zip([1, 5]) {
        all.push(Box::new(dji(model, id)));
    }
    for id in 0x11..=0x1F {
        all.push(Box::new(damiao(id, id + 0x20, Control::Velocity).unwrap()));
    }
    all.extend((1..=31).map(|id| Box::new(lk(id, Commands::Single)) as Box<dyn CanMotor>));
    all.extend((2..=7).map(|node| Box::new(odrive(node, torque)) as Box<dyn CanMotor>));
    all.extend((1..=100).map(|id| Box::new(vesc(id)) as Box<dyn CanMotor>));
    let numbers = (1..=3).flat_map(|number| [(number, 0), (number, 14)]);
    let modules: Vec<_> = numbers.map(|(number, motor)| module(number, motor)).collect();
    let gears: Vec<_> =
        (101..=127).map(|id| robstride(&cybergear::models::CYBERGEAR, id, 0xFD)).collect();
    for (index, motor) in all.iter().enumerate() {
        let others = all[index + 1..].iter().map(|other| &**other);
        let others = others.chain(modules.iter().map(|other| other as &dyn CanMotor));
        for other in others.chain(gears.iter().map(|other| other as &dyn CanMotor)) {
            let names = (motor.name(), other.name());
            assert!(!clash(&**motor, other), "{} {}", names.0, names.1);
        }
    }
}
