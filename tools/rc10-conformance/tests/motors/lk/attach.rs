//! What a drive cannot be, and who it cannot share a bus with.

use rc10_app::{Gear, PidConfig};
use rc10_motor::dji::{self, Dji, M3508};
use rc10_motor::lk::models::{ALL, MG4010E_I10};
use rc10_motor::lk::{Commands, Config, EncoderBits, Lk, Model};
use rc10_motor::{ArmSwitch, AttachError, CanMotor, Clash, MotorBus, Safety, TxBatch, Verdict};

use super::{JOINT, joint, wheel};

fn error(id: u8, config: Config) -> (&'static str, &'static str) {
    let error = Lk::new(Config { id, ..config }).err().unwrap();
    (error.field, error.must_be)
}

#[test]
fn what_cannot_be_is_named() {
    let multi = joint().with_commands(Commands::MultiMotor);
    assert_eq!(error(0, joint()), ("id", "1 to 32"));
    assert_eq!(error(33, joint()), ("id", "1 to 32"));
    assert_eq!(error(5, multi), ("id", "1 to 4 in the multi-motor frame"));
    let model = |model| Config { model, ..joint() };
    assert_eq!(error(1, model(Model::ms(EncoderBits::Sixteen))).0, "amps_per_count");
    for constant in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let model = Model { torque_constant: Some(constant), ..MG4010E_I10 };
        assert_eq!(error(1, Config { model, ..joint() }).0, "torque_constant");
    }
    let gear = Gear::new(1, 2).unwrap();
    assert_eq!(error(1, model(Model { gear, ..MG4010E_I10 })).0, "gear");
    let cascade = |speed| Config { cascade: super::Cascade { speed, ..JOINT }, ..joint() };
    assert_eq!(error(1, cascade(PidConfig::new(0.1, 0.0, 0.0, 33.1))).0, "output_limit");
    assert_eq!(error(1, cascade(PidConfig::new(f32::NAN, 0.0, 0.0, 1.0))).0, "kp");
    for model in ALL {
        assert!(
            Lk::new(Config { id: 32, ..Config { model: *model, ..joint() } }).is_ok(),
            "{}",
            model.name
        );
    }
}

#[test]
fn drives_with_one_identifier_and_other_vendors_on_it_are_refused() {
    let switch = ArmSwitch::new();
    let (mut one, mut same) = (Lk::new(joint()).unwrap(), Lk::new(wheel()).unwrap());
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut one, Safety::COAST).unwrap();
    match bus.attach(&mut same, Safety::COAST) {
        Err(AttachError::Clash { motor, with, clash, .. }) => {
            assert_eq!((motor.model, with.model), ("MF9025", "MG4010E-i10"));
            assert!(matches!(clash, Clash::RxFrames(_)), "{clash}");
        }
        other => panic!("{other:?}"),
    }
    // A DM-S3519 or DJI group at 0x280 does not exist; a model of one's own may.
    const OTHER: dji::Model = dji::Model { command_ids: [0x280, 0x1FF], ..M3508 };
    let mut own = Dji::new(dji::Config::new(&OTHER, 1)).unwrap();
    let config = wheel().with_commands(Commands::MultiMotor);
    let mut multi = Lk::new(config).unwrap();
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut own, Safety::COAST).unwrap();
    match bus.attach(&mut multi, Safety::COAST) {
        Err(AttachError::Clash { clash, .. }) => assert!(matches!(clash, Clash::TxFrames(_))),
        other => panic!("{other:?}"),
    }
}

/// Percent of 1 Mbit/s, as the page says.
#[test]
fn three_drives_or_four_in_one_frame_fit_beside_a_wheel() {
    let switch = ArmSwitch::new();
    let mut wheel_dji = Dji::new(dji::Config::new(&M3508, 1)).unwrap();
    let mut motors = [1, 2, 3].map(|id| Lk::new(Config { id, ..wheel() }).unwrap());
    let mut bus = MotorBus::new(&switch);
    for motor in &mut motors {
        bus.attach(motor, Safety::COAST).unwrap();
    }
    bus.attach(&mut wheel_dji, Safety::COAST).unwrap();
    let load = bus.load(1_000_000);
    assert_eq!((load.typical.round(), load.worst.round()), (94.0, 108.0));
    assert_eq!(load.verdict(), Verdict::Tight);

    let config = wheel().with_commands(Commands::MultiMotor);
    let mut motors = [1, 2, 3, 4].map(|id| Lk::new(Config { id, ..config }).unwrap());
    let mut bus = MotorBus::new(&switch);
    for motor in &mut motors {
        bus.attach(motor, Safety::COAST).unwrap();
    }
    let load = bus.load(1_000_000);
    assert_eq!((load.typical.round(), load.worst.round()), (59.0, 68.0));
    let mut tx = TxBatch::new();
    bus.coast_image(&mut tx).unwrap();
    assert_eq!(tx.frames().len(), 1);
    assert_eq!(tx.frames()[0].to_string(), "280#0000000000000000");
}

#[test]
fn the_coast_image_is_off() {
    let mut tx = TxBatch::new();
    Lk::new(Config { id: 7, ..joint() }).unwrap().coast_frames(&mut tx).unwrap();
    assert_eq!(tx.frames()[0].to_string(), "147#8000000000000000");
}
