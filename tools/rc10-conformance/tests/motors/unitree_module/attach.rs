//! Numbers, and motors that share a bus.

use rc10_motor::dji::{self, Dji, M3508};
use rc10_motor::rc10_app::ConfigError;
use rc10_motor::unitree::{GoModule, ModuleConfig};
use rc10_motor::{ArmSwitch, MotorBus, Safety};

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
