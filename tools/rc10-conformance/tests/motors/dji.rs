//! DJI's signal tables against the codec.

use proptest::prelude::*;
use rc10_can::CanFrame;
use rc10_motor::dji::signals::messages;
use rc10_motor::dji::{
    self, Dji, Effort, GM6020_CURRENT, GM6020_VOLTAGE, M2006, M3508, Model, RawFeedback,
};
use rc10_motor::signals::Signal;
use rc10_motor::{CanMotor, Link, Motor, TxBatch};
use rc10_time::Micros;

const MODELS: [&Model; 4] = [&M3508, &M2006, &GM6020_CURRENT, &GM6020_VOLTAGE];

fn named<'s>(signals: &'s [Signal], name: &str) -> Option<&'s Signal> {
    signals.iter().find(|signal| signal.name == name)
}

#[test]
fn identifiers_and_lanes_are_those_of_the_motor() {
    for model in MODELS {
        for id in 1..=model.last_id {
            let [feedback, command, _] = messages(model, id).unwrap().into_array().unwrap();
            assert_eq!(feedback.id, model.feedback_id(id).unwrap().into());
            let (command_id, lane) = model.command_lane(id).unwrap();
            assert_eq!(command.id, command_id.into());
            let digits = command.name.strip_prefix("DJI_COMMAND_").unwrap();
            assert_eq!(u16::from_str_radix(digits, 16), Ok(command_id.as_raw()));
            // Its highest bit is that of the lane's first byte.
            assert_eq!(usize::from(command.signals[0].start), lane * 8 + 7);
            assert!(feedback.from_device && !command.from_device);
            assert_eq!((feedback.len, command.len), (8, 8));
        }
        assert!(messages(model, 0).is_none() && messages(model, model.last_id + 1).is_none());
    }
    const OTHER: Model = Model { full_scale: 1000, ..M3508 };
    assert!(messages(&OTHER, 1).is_none());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn feedback_says_what_the_codec_says(
        index in 0..MODELS.len(),
        id in 1..=7_u8,
        data in any::<[u8; 8]>(),
    ) {
        let model = MODELS[index];
        let feedback = messages(model, id).unwrap()[0];
        let raw = RawFeedback::unpack(&data);
        let physical = |name: &str| named(feedback.signals, name).unwrap().physical(&data).unwrap();
        prop_assert_eq!(physical("ROTOR_ANGLE"), f64::from(raw.angle) * 360.0 / 8192.0);
        prop_assert_eq!(physical("ROTOR_SPEED"), f64::from(raw.rpm));
        let temperature = named(feedback.signals, "TEMPERATURE");
        prop_assert_eq!(temperature.is_some(), model.has_temperature);
        if let Some(temperature) = temperature {
            prop_assert_eq!(temperature.physical(&data), Some(raw.temperature.into()));
        }
        // The current as the motor itself tells it, in single precision.
        let mut motor = Dji::new(dji::Config::new(model, id)).unwrap();
        // An angle that there is: another frame is refused.
        let mut known = data;
        known[0] &= 0x1F;
        let frame = CanFrame::eight_bytes(model.feedback_id(id).unwrap(), known);
        motor.unpack_feedback(&frame, Micros::ZERO, Link::NeverSeen).unwrap();
        let told = f64::from(motor.feedback().current().unwrap().get());
        prop_assert!((physical("CURRENT") - told).abs() <= told.abs() * 1e-6, "{}", told);
    }

    #[test]
    fn a_command_says_what_the_codec_was_asked_for(
        index in 0..MODELS.len(),
        id in 1..=7_u8,
        share in -1.0..=1.0_f32,
    ) {
        let model = MODELS[index];
        let command = messages(model, id).unwrap()[1];
        let [signal] = command.signals else { panic!() };
        let (full, unit, shown) = match model.effort {
            Effort::Current(amps) => (amps, "A", amps),
            Effort::Voltage => (1.0, "%", 100.0),
        };
        prop_assert_eq!(signal.unit, unit);
        let (command_id, lane) = model.command_lane(id).unwrap();
        let mut batch = TxBatch::new();
        batch.lane(command_id, lane, model.raw_command(share * full).to_be_bytes()).unwrap();
        let physical = signal.physical(batch.frames()[0].bytes()).unwrap();
        let asked = f64::from(share) * f64::from(shown);
        prop_assert!((physical - asked).abs() <= signal.factor * 0.501, "{} {}", physical, asked);
    }
}
