//! What may share a bus, and how full it gets.

use rc10_can::IdPattern;
use rc10_can::embedded_can::{ExtendedId, Id};
use rc10_conformance::Dummy;
use rc10_motor::dji::{self, Dji, M3508};
use rc10_motor::rc10_app::ConfigError;
use rc10_motor::unitree::{GoModule, ModuleConfig};
use rc10_motor::{ArmSwitch, AttachError, CanIds, Clash, Frames, MotorBus, Rate, Safety};

fn extended(id: u32, mask: u32) -> IdPattern {
    IdPattern::masked(ExtendedId::new(id).unwrap(), mask)
}

fn frames(id: u32, mask: u32) -> Frames {
    Frames::new(extended(id, mask), 8, Rate::EveryTick)
}

/// STATUS and STATUS 3, commands: declared by hand.
fn vesc(id: u16) -> Dummy {
    let ids = CanIds::new()
        .receives(frames(0x09 << 8 | u32::from(id), 0x1FFF_FFFF))
        .receives(frames(0x0F << 8 | u32::from(id), 0x1FFF_FFFF))
        .transmits(frames(id.into(), 0x1FFF_00FF));
    Dummy::new("VESC", id, ids)
}

/// Feedback, motion control, and everything else.
fn cybergear(motor: u16) -> Dummy {
    let id = u32::from(motor);
    let ids = CanIds::new()
        .receives(frames(id << 8 | 0xFD, 0xFFFF))
        .transmits(frames(1 << 24 | id, 0x1F00_00FF))
        .transmits(frames(id, 0xFF));
    Dummy::new("CyberGear", motor, ids)
}

#[test]
fn only_numbers_that_exist_are_taken() {
    let error = |module, motor| {
        let Err(ConfigError { field, must_be, .. }) =
            GoModule::new(ModuleConfig::new(module, motor))
        else {
            panic!("taken")
        };
        format!("{field} must be {must_be}")
    };
    assert_eq!(error(4, 0), "module must be 0 to 3");
    assert_eq!(error(0, 15), "motor must be 0 to 14 (15 is every motor)");
    assert!(
        GoModule::new(ModuleConfig::new(0, 0)).is_ok()
            && GoModule::new(ModuleConfig::new(3, 14)).is_ok()
    );
    let config = ModuleConfig::new(3, 14);
    let mut cascade = rc10_motor::unitree::CASCADE;
    cascade.speed.output_limit = 30.0;
    let refused = config.with_cascade(cascade).validate().unwrap_err();
    assert_eq!(refused.field, "output_limit");
    cascade.speed.output_limit = f32::NAN;
    assert!(config.with_cascade(cascade).validate().is_err());
}

#[test]
fn motors_of_a_module_and_modules_of_a_bus_live_together() {
    let switch = ArmSwitch::new();
    let mut motors: Vec<_> = [(3, 0), (3, 1), (2, 0), (2, 14), (0, 0)]
        .map(|(module, motor)| GoModule::new(ModuleConfig::new(module, motor)).unwrap())
        .into();
    let mut twin = GoModule::new(ModuleConfig::new(2, 14)).unwrap();
    let mut wheel = Dji::new(dji::Config::new(&M3508, 1)).unwrap();
    let mut bus = MotorBus::new(&switch);
    for motor in &mut motors {
        bus.attach(motor, Safety::COAST).unwrap();
    }
    bus.attach(&mut wheel, Safety::COAST).unwrap();
    let error = bus.attach(&mut twin, Safety::COAST).unwrap_err();
    assert_eq!(
        error.to_string(),
        "GO-M8010-6 behind module 2, id 14 cannot share a bus with GO-M8010-6 behind module 2, \
         id 14: both send feedback with identifier 0x14000E00; set another on one, or plug it in elsewhere"
    );
}

#[test]
fn what_a_module_would_misunderstand_is_refused() {
    let clash = |module, mut other: Dummy| {
        let switch = ArmSwitch::new();
        let mut motor = GoModule::new(ModuleConfig::new(module, 0)).unwrap();
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut motor, Safety::COAST).unwrap();
        match bus.attach(&mut other, Safety::COAST) {
            Ok(_) => None,
            Err(AttachError::Clash { clash, .. }) => Some(clash),
            Err(other) => panic!("{other}"),
        }
    };
    // STATUS 3 of a VESC would address every motor of module 0.
    let status_3 = Id::Extended(ExtendedId::new(0x0F01).unwrap());
    assert_eq!(clash(0, vesc(1)), Some(Clash::Confuses(status_3.into())));
    assert_eq!(clash(3, vesc(1)), None);
    for module in 0..4 {
        assert!(clash(module, cybergear(1)).is_some(), "module {module}");
    }
}

#[test]
fn three_motors_fill_a_bus() {
    let load = |count: u8| {
        let switch = ArmSwitch::new();
        let mut motors: Vec<_> =
            (0..count).map(|id| GoModule::new(ModuleConfig::new(3, id)).unwrap()).collect();
        let mut bus = MotorBus::new(&switch);
        for motor in &mut motors {
            bus.attach(motor, Safety::COAST).unwrap();
        }
        let load = bus.load(1_000_000);
        (load.typical.round(), load.worst.round())
    };
    assert_eq!(load(1), (28.0, 32.0));
    assert_eq!(load(3), (83.0, 96.0));
}
