//! Two codecs that agree, and the signals that say the same.

use proptest::collection::vec;
use proptest::prelude::*;
use rc10_app::{Amps, Degrees};
use rc10_can::CanFrame;
use rc10_motor::vesc::signals::messages;
use rc10_motor::vesc::{Command, ElectricalRpm, Reply, Setting, Status, StatusRates, ping};
use rc10_sim::vesc::{Order, Report};

use super::{config, id};
use crate::motors::vesc_values::values;
use crate::motors::{assert_same, cases, number};

type Ordered = (Command, fn(f64) -> Order, f64, f64);

/// Its order as the device should read it: what makes it, its number, the largest such number,
/// and how many steps a unit has.
fn orders(value: f32) -> [Ordered; 9] {
    let (amps, word) = (Amps::new(value), f64::from(i32::MAX));
    [
        (Command::Duty(value), Order::Duty, 1.0, 1e5),
        (Command::Current(amps), Order::Current, word / 1e3, 1e3),
        (Command::Brake(amps), Order::Brake, word / 1e3, 1e3),
        (Command::Speed(ElectricalRpm::new(value)), Order::Speed, word, 1.0),
        (Command::Position(Degrees::new(value)), Order::Position, word / 1e6, 1e6),
        (Command::RelativeCurrent(value), Order::CurrentShare, 1.0, 1e5),
        (Command::RelativeBrake(value), Order::BrakeShare, 1.0, 1e5),
        (Command::Handbrake(amps), Order::Handbrake, word / 1e3, 1e3),
        (Command::RelativeHandbrake(value), Order::HandbrakeShare, 1.0, 1e5),
    ]
}

/// The number in an order of one number.
fn told(order: &Order) -> f64 {
    match *order {
        Order::Duty(value)
        | Order::Current(value)
        | Order::Brake(value)
        | Order::Speed(value)
        | Order::Position(value)
        | Order::CurrentShare(value)
        | Order::BrakeShare(value)
        | Order::Handbrake(value)
        | Order::HandbrakeShare(value) => value,
        _ => panic!("{order:?}"),
    }
}

/// Within a step, and what an f32 leaves out.
fn near(actual: f64, wanted: f64, step: f64) -> bool {
    (actual - wanted).abs() <= step + wanted.abs() * 3e-7
}

proptest! {
    #![proptest_config(cases(4000))]

    #[test]
    fn the_device_understands_every_command(to in 0..=254_u8, value in prop_oneof![number(1.5), number(5e4)]) {
        for (command, order, most, steps) in orders(value) {
            let Ok(frame) = command.pack(id(to)) else {
                prop_assert!(value.is_nan());
                continue;
            };
            let understood = Order::parse(&frame, to).unwrap();
            let wanted = f64::from(value).clamp(-most, most);
            let same = std::mem::discriminant(&understood) == std::mem::discriminant(&order(0.0));
            prop_assert!(same, "{:?} as {:?}", command, understood);
            prop_assert!(near(told(&understood), wanted, 1.0 / steps), "{:?}", understood);
            // No other does.
            prop_assert!(Order::parse(&frame, to.wrapping_add(1) % 255).is_err());
        }
        prop_assert_eq!(Order::parse(&ping(id(to), id(9)), to), Ok(Order::Ping(9)));
    }

    #[test]
    fn the_device_understands_limits(to in 0..=254_u8, min in number(5e4), max in number(5e4)) {
        let setting = Setting::MotorCurrent { min: Amps::new(min), max: Amps::new(max) };
        let (Ok(held), Ok(kept)) = (setting.pack(id(to)), setting.pack_store(id(to))) else {
            prop_assert!(min.is_nan() || max.is_nan());
            return Ok(());
        };
        let most = f64::from(i32::MAX) / 1e3;
        for (frame, as_told) in [(held, false), (kept, true)] {
            let Ok(Order::CurrentLimits { min: low, max: high, is_stored }) = Order::parse(&frame, to) else {
                panic!("{frame}")
            };
            prop_assert_eq!(is_stored, as_told);
            for (actual, wanted) in [(low, min), (high, max)] {
                let wanted = f64::from(wanted).clamp(-most, most);
                prop_assert!(near(actual, wanted, 1e-3), "{} {}", actual, wanted);
            }
        }
    }

    #[test]
    fn we_understand_every_report(
        from in 0..=254_u8,
        large in [-3e9..3e9_f64, -2e5..2e5],
        small in [-4e3..4e3_f64, -4e3..4e3, -4e3..4e3, -7e2..7e2],
        steps in any::<i32>(),
    ) {
        let word = |value: f64, scale: f64| {
            value.clamp(f64::from(i32::MIN) / scale, f64::from(i32::MAX) / scale)
        };
        let half = |value: f64, scale: f64| value.clamp(-32768.0 / scale, 32767.0 / scale);
        let status = |report: Report| match Reply::unpack(&report.frame(from)) {
            Ok(Reply::Status { from: told, status }) if told == id(from) => status,
            other => panic!("{report:?} as {other:?}"),
        };
        let all = |pairs: &[(f32, f64, f64)]| {
            pairs.iter().all(|&(actual, wanted, step)| near(actual.into(), wanted, step))
        };
        let [a, b, c, d] = small;
        let report = Report::Status1 { erpm: large[0], current: a, duty: b };
        let Status::Motion { speed, current, duty } = status(report) else { panic!() };
        let wanted = [
            (speed.get(), word(large[0], 1.0), 1.0),
            (current.get(), half(a, 10.0), 0.1),
            (duty, half(b, 1e3), 1e-3),
        ];
        prop_assert!(all(&wanted), "{:?}", wanted);
        let report = Report::Status2(large[0], large[1]);
        let Status::AmpHours { used, charged } = status(report) else { panic!() };
        let wanted =
            [(used, word(large[0], 1e4), 1e-4), (charged, word(large[1], 1e4), 1e-4)];
        prop_assert!(all(&wanted), "{:?}", wanted);
        let report = Report::Status3(large[0], large[1]);
        let Status::WattHours { used, charged } = status(report) else { panic!() };
        let wanted =
            [(used, word(large[0], 1e4), 1e-4), (charged, word(large[1], 1e4), 1e-4)];
        prop_assert!(all(&wanted), "{:?}", wanted);
        let report = Report::Status4 { transistors: a, motor: b, input: c, position: d };
        let Status::Temperatures { transistors, motor, input_current, position } = status(report)
        else { panic!() };
        let wanted = [
            (transistors.get(), half(a, 10.0), 0.1),
            (motor.get(), half(b, 10.0), 0.1),
            (input_current.get(), half(c, 10.0), 0.1),
            (position.get(), half(d, 50.0), 0.02),
        ];
        prop_assert!(all(&wanted), "{:?}", wanted);
        let report = Report::Status5 { steps, supply: a };
        let Status::Tachometer { steps: counted, volts } = status(report) else { panic!() };
        prop_assert_eq!(counted, steps);
        prop_assert!(near(volts.into(), half(a, 10.0), 0.1));
        let report = Report::Status6(small);
        let Status::Inputs { analogue: [first, second, third], ppm } = status(report) else {
            panic!()
        };
        let wanted = [
            (first, half(a, 1e3), 1e-3),
            (second, half(b, 1e3), 1e-3),
            (third, half(c, 1e3), 1e-3),
            (ppm, half(d, 1e3), 1e-3),
        ];
        prop_assert!(all(&wanted), "{:?}", wanted);
        let pong = Reply::Pong { from: id(from), to: id(200), hardware: 0 };
        prop_assert_eq!(Reply::unpack(&Report::Pong(200).frame(from)), Ok(pong));
    }
}

proptest! {
    #![proptest_config(cases(10_000))]

    #[test]
    fn the_signals_say_what_the_codecs_say(
        number in 0..=253_u8, which in 0..26_usize, data in vec(any::<u8>(), 8),
    ) {
        let every = StatusRates {
            status_1: 50, status_2: 5, status_3: 5, status_4: 5, status_5: 5, status_6: 5,
        };
        let mut config = config(number);
        config.status = every;
        let messages = messages(&config);
        prop_assert_eq!(messages.iter().filter(|message| message.is_plain()).count(), 26);
        let message = messages[which];
        let mut data = data;
        if message.name == "VESC_PONG" {
            // No VESC has the id of all of them.
            data[0] %= 255;
        }
        let frame = CanFrame::data_frame(message.id, &data[..message.len.into()]).unwrap();
        let values = values(message.name, &frame);
        assert_same(&message, &frame, &values, |value| 1e-9 + 3e-7 * value.abs());
    }
}

#[test]
fn what_is_switched_on_comes_first() {
    let messages = messages(&config(3));
    let from: Vec<_> = messages.iter().take_while(|message| message.from_device).collect();
    let names: Vec<_> = from.iter().map(|message| message.name).collect();
    assert_eq!(names, ["VESC_STATUS_1", "VESC_STATUS_4", "VESC_STATUS_5", "VESC_PONG"]);
    let ids: Vec<_> =
        from.iter().map(|message| CanFrame::key_of(message.id) & 0x1FFF_FFFF).collect();
    assert_eq!(ids, [0x903, 0x1003, 0x1B03, 0x12FE]);
    let off: Vec<_> =
        messages[4 + 19..].iter().filter(|it| it.is_plain()).map(|it| it.name).collect();
    assert_eq!(off, ["VESC_STATUS_2", "VESC_STATUS_3", "VESC_STATUS_6"]);
}
