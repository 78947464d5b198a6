//! What a drive cannot be, and who it cannot share a bus with.

use rc10_app::{Gear, PidConfig};
use rc10_motor::lk::models::{ALL, MG4010E_I10};
use rc10_motor::lk::{Commands, Config, EncoderBits, Lk, Model};
use rc10_motor::{CanMotor, TxBatch};

use super::{JOINT, joint};

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
    assert_eq!(error(1, cascade(PidConfig::within(33.1).kp(0.1))).0, "output_limit");
    assert_eq!(error(1, cascade(PidConfig::within(1.0).kp(f32::NAN))).0, "kp");
    for model in ALL {
        assert!(
            Lk::new(Config { id: 32, ..Config { model: *model, ..joint() } }).is_ok(),
            "{}",
            model.name
        );
    }
}

#[test]
fn the_coast_image_is_off() {
    let mut tx = TxBatch::new();
    Lk::new(Config { id: 7, ..joint() }).unwrap().coast_frames(&mut tx).unwrap();
    assert_eq!(tx.frames()[0].to_string(), "147#8000000000000000");
}
