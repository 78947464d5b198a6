//! The signal table says what the codec says.

use proptest::array::uniform8;
use proptest::prelude::*;
use proptest::sample::select;
use rc10_can::CanFrame;
use rc10_motor::CanMotor;
use rc10_motor::lk::models::MF9025;
use rc10_motor::lk::signals::{NOT_IN_DBC, messages};
use rc10_motor::lk::{Commands, Config, EncoderBits, Errors, Lk, Model};

use super::values::{ID, config, values};
use crate::motors::{assert_same, cases};

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn every_signal_is_what_the_codec_says(
        mut bytes in uniform8(any::<u8>()),
        command in select(&[0x80_u8, 0x88, 0x9A, 0x9B, 0x9C, 0xA1][..]),
        which in 0..2_usize,
    ) {
        let message = &messages(&config()).unwrap()[which];
        if which == 0 {
            bytes[0] = command;
        }
        let frame = CanFrame::data_frame(message.id, &bytes).unwrap();
        let ours = values(message.name, &frame);
        prop_assert!(!ours.is_empty());
        assert_same(message, &frame, &ours, |value| 1e-5 * value.abs().max(1e-3));
    }
}

#[test]
fn the_table_names_what_is_on_the_wire() {
    for config in [config(), Config { commands: Commands::Single, ..config() }] {
        let wiring = Lk::new(Config { id: ID, ..config }).unwrap().can_ids();
        let messages = messages(&config).unwrap();
        let received = wiring.received();
        assert_eq!(messages[0].id, received[0].pattern.id());
        assert_eq!(messages[0].len, received[0].len);
        if config.commands == Commands::MultiMotor {
            assert_eq!(messages[1].id, wiring.transmitted()[0].pattern.id());
            assert!(!messages[1].from_device);
        } else {
            assert_eq!(messages.iter().filter(|message| message.is_plain()).count(), 1);
        }
    }
    assert_eq!(NOT_IN_DBC.len(), 2);
    assert!(messages(&Config { id: 33, ..config() }).is_err());
}

#[test]
fn every_drive_has_one_and_the_same_shared_frame() {
    let shared = |id| messages(&Config { id, ..config() }).unwrap()[1];
    assert_eq!(shared(1), shared(4));
}

#[test]
fn the_scales_are_the_models() {
    let current = |model: Model| {
        let config = Config { model, ..config() };
        let signals = messages(&config).unwrap()[0].signals;
        let find = |name| *signals.iter().find(|signal| signal.name == name).unwrap();
        (find("CURRENT").factor, find("CURRENT").unit, find("ROTOR_ANGLE").factor)
    };
    assert_eq!(current(MF9025), (16.5 / 2048.0, "A", 360.0 / 65_536.0));
    let small = Model::mg(EncoderBits::Fourteen);
    assert_eq!(current(small), (33.0 / 2048.0, "A", 360.0 / 16_384.0));
    let own = Model { amps_per_count: 0.02, ..Model::mf(EncoderBits::Fifteen) };
    assert_eq!(current(own), (1.0, "", 360.0 / 32_768.0));
}

#[test]
fn a_set_bit_has_the_codecs_text() {
    let signals = messages(&config()).unwrap()[0].signals;
    let mut bits = 0;
    for signal in signals.iter().filter(|signal| signal.bits == 1) {
        let bit = signal.start - 56;
        let text = Errors::new(1 << bit).fault().unwrap().text;
        assert!(signal.values().eq([(1, text)]));
        bits += 1;
    }
    assert_eq!(bits, 16);
}
