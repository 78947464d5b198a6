//! Two codecs that were written apart: what one says, the other hears.

use crate::motors::{cases, number};
use proptest::prelude::*;
use proptest::sample::select;
use rc10_app::{Amps, Degrees, RotorRpm, TotalAngle};
use rc10_can::CanFrame;
use rc10_motor::lk::{
    CENTIDEGREES, Command, DriveId, EncoderBits, Model, Reply, SpinDirection, pack_multi_motor,
};
use rc10_sim::lk::{Order, State, decode, encode_echo, encode_health, encode_state};

/// What the drive hears of a command; `None` where there is no number to send.
fn heard(command: Command, model: &Model) -> Option<Order> {
    let packed = command.pack(DriveId::new(9).unwrap(), model);
    let frame = packed.as_ref().map_or_else(|nan| nan.neutral, |frame| *frame);
    assert_eq!(frame.raw_id(), 0x149);
    let order = decode(frame.all_eight().unwrap()).unwrap();
    if packed.is_err() {
        assert!(matches!(order, Order::Current(0) | Order::Speed(0) | Order::ReadState));
        return None;
    }
    Some(order)
}

/// Within one step of what was asked for, as far as the field goes.
fn near(raw: i64, asked: f64, most: f64) -> bool {
    (raw as f64 - asked.clamp(-most, most)).abs() <= 1.0
}

proptest! {
    #![proptest_config(cases(3000))]

    #[test]
    fn currents_arrive_within_a_step(amps in number(40.0), full in select(&[16.5_f32, 33.0][..])) {
        let model = if full > 20.0 {
            Model::mg(EncoderBits::Sixteen)
        } else {
            Model::mf(EncoderBits::Fourteen)
        };
        let steps = f64::from(amps) / f64::from(full) * 2048.0;
        match heard(Command::Current(Amps::new(amps)), &model) {
            Some(Order::Current(raw)) => prop_assert!(near(raw.into(), steps, 2048.0)),
            other => prop_assert!(amps.is_nan() && other.is_none(), "{other:?}"),
        }
    }

    #[test]
    fn speeds_arrive_within_a_step(rpm in number(3000.0)) {
        match heard(Command::Speed(RotorRpm::new(rpm)), &Model::mg(EncoderBits::Sixteen)) {
            Some(Order::Speed(raw)) => {
                let asked = f64::from(rpm * 600.0);
                prop_assert!(near(raw.into(), asked, f64::from(i32::MAX) + 1.0));
            }
            other => prop_assert!(rpm.is_nan() && other.is_none(), "{other:?}"),
        }
    }

    #[test]
    fn angles_arrive_within_a_step(
        centidegrees in prop_oneof![-4_000_000..4_000_000_i64, any::<i64>()],
        limit in proptest::option::of(number(2000.0)),
        kind in 0..3,
        is_backwards: bool,
    ) {
        let angle = TotalAngle::from_counts(centidegrees, CENTIDEGREES);
        let speed_limit = limit.map(RotorRpm::new);
        use SpinDirection::{Clockwise, CounterClockwise};
        let direction = if is_backwards { CounterClockwise } else { Clockwise };
        let degrees = Degrees::new(centidegrees as f32 / 100.0);
        let command = match kind {
            0 => Command::TurnTo { angle, speed_limit },
            1 => Command::TurnBy { angle, speed_limit },
            _ => Command::TurnWithin { angle: degrees, direction, speed_limit },
        };
        let Some(order) = heard(command, &Model::ms(EncoderBits::Fifteen)) else {
            prop_assert!(limit.is_some_and(f32::is_nan));
            return Ok(());
        };
        let wanted = centidegrees.clamp(i32::MIN.into(), i32::MAX.into());
        let most = match (kind, order) {
            (0, Order::TurnTo(raw, most)) | (1, Order::TurnBy(raw, most)) => {
                prop_assert_eq!(i64::from(raw), wanted);
                most
            }
            (2, Order::TurnWithin(raw, back, most)) => {
                prop_assert_eq!(back, is_backwards);
                let asked = f64::from(degrees.get()) * 100.0;
                prop_assert!(near(raw.into(), asked.clamp(0.0, 35_999.0), 35_999.0));
                most
            }
            other => return Err(TestCaseError::fail(format!("{other:?}"))),
        };
        prop_assert_eq!(most.is_some(), limit.is_some());
        if let (Some(most), Some(limit)) = (most, limit) {
            prop_assert!(near(most.into(), f64::from(limit * 6.0).clamp(0.0, 65_535.0), 65_535.0));
        }
    }

    #[test]
    fn measurements_arrive_exactly(
        command in select(&[0x9C_u8, 0xA1, 0xA2, 0xA8][..]),
        temperature: i8, current: i16, speed: i16, encoder: u16,
    ) {
        let state = State { temperature, current, speed, encoder };
        let Ok(Reply::Motion(motion)) = Reply::unpack(&encode_state(command, state)) else {
            return Err(TestCaseError::fail("no measurement"));
        };
        prop_assert_eq!(motion.command, command);
        prop_assert_eq!((motion.temperature, motion.effort), (temperature, current));
        prop_assert_eq!((motion.speed, motion.encoder), (speed, encoder));
    }

    #[test]
    fn health_arrives_within_a_step(
        command in select(&[0x9A_u8, 0x9B][..]), temperature: i8, volts in 0.0..100.0_f64, errors: u8,
    ) {
        let frame = encode_health(command, temperature, volts, errors);
        let Ok(Reply::Health(health)) = Reply::unpack(&frame) else {
            return Err(TestCaseError::fail("no health"));
        };
        prop_assert_eq!((health.command, health.errors.bits()), (command, errors));
        prop_assert!((health.temperature.get() - f32::from(temperature)).abs() < 1e-6);
        prop_assert!((f64::from(health.supply) - volts).abs() <= 0.0501);
    }

    #[test]
    fn lanes_arrive_exactly(raw: [i16; 4]) {
        let frame = pack_multi_motor(raw);
        let bytes = frame.all_eight().unwrap();
        for (lane, raw) in raw.into_iter().enumerate() {
            prop_assert_eq!(i16::from_le_bytes([bytes[2 * lane], bytes[2 * lane + 1]]), raw);
        }
    }
}

#[test]
fn plain_commands_are_understood_and_echoed() {
    let model = Model::mg(EncoderBits::Sixteen);
    for (command, order) in [
        (Command::Off, Order::Off),
        (Command::Stop, Order::Stop),
        (Command::Run, Order::Run),
        (Command::ReadHealth, Order::ReadHealth),
        (Command::ClearErrors, Order::ClearErrors),
        (Command::ReadMotion, Order::ReadState),
        (Command::ReadPhaseCurrents, Order::ReadPhases),
        (Command::ReadMultiTurn, Order::ReadManyTurns),
        (Command::ReadSingleTurn, Order::ReadOneTurn),
        (Command::OpenLoop(-7), Order::OpenLoop(-7)),
    ] {
        assert_eq!(heard(command, &model), Some(order), "{command:?}");
    }
    assert!(matches!(Reply::unpack(&encode_echo(0x80)), Ok(Reply::Off)));
    assert!(matches!(Reply::unpack(&encode_echo(0x81)), Ok(Reply::Stop)));
    assert!(matches!(Reply::unpack(&encode_echo(0x88)), Ok(Reply::Run)));
}

/// Every frame that a drive is asked for by the vendor's tool.
#[test]
fn answers_to_questions_of_others_are_understood() {
    use rc10_sim::lk::{Drive, Settings, mg4010e_i10};
    let mut world = rc10_sim::World::new(3);
    let bus = world.add_bus(rc10_sim::BusConfig::default());
    let esc = bus.add(Drive::new(Settings::mg(9)).unwrap(), mg4010e_i10());
    let mut port = bus.port();
    let mut at = 0;
    let model = Model::mg(EncoderBits::Sixteen);
    let mut ask = |command: Command| {
        let frame: CanFrame = command.pack(DriveId::new(9).unwrap(), &model).unwrap();
        let _ = rc10_can::CanPort::submit(&mut port, &frame);
        at += 1;
        world.advance(rc10_time::Micros::from_millis(at));
        let (frame, _) = rc10_can::CanPort::receive(&mut port).unwrap();
        Reply::from_frame(&frame, DriveId::new(9).unwrap()).unwrap()
    };
    let Reply::MultiTurn(many) = ask(Command::ReadMultiTurn) else { panic!() };
    let Reply::SingleTurn(one) = ask(Command::ReadSingleTurn) else { panic!() };
    let apart = many.minus(one).counts_at(CENTIDEGREES);
    assert!(apart.abs() <= 1, "{apart}");
    let Reply::PhaseCurrents(currents) = ask(Command::ReadPhaseCurrents) else { panic!() };
    assert!(currents.phases.iter().all(|phase| phase.get().abs() < 0.1));
    // The drive's own loops: 45 degrees/s, then ten degrees on.
    let _ = ask(Command::Run);
    for _ in 0..300 {
        let _ = ask(Command::Speed(RotorRpm::new(600.0)));
    }
    assert!((esc.state().rotor_rpm - 600.0).abs() < 10.0, "{:?}", esc.state());
    let _ = ask(Command::Stop);
    for _ in 0..1000 {
        let _ = ask(Command::ReadMotion);
    }
    let before = esc.state().output_degrees;
    let angle = TotalAngle::from_degrees(3600);
    let _ = ask(Command::TurnBy { angle, speed_limit: None });
    for _ in 0..3000 {
        let _ = ask(Command::ReadMotion);
    }
    let moved = esc.state().output_degrees - before;
    assert!((moved - 360.0).abs() < 2.0, "{moved}");
}
