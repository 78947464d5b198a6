use super::super::config::EncoderBits;
use super::*;
extern crate std;
use std::string::{String, ToString};
use std::vec::Vec;

const MG: Model = Model::mg(EncoderBits::Fourteen);
const MF: Model = Model::mf(EncoderBits::Sixteen);

fn id(number: u8) -> DriveId {
    DriveId::new(number).unwrap()
}

fn sent(command: Command, number: u8, model: &Model) -> String {
    command.pack(id(number), model).unwrap().to_string()
}

fn rpm(degrees_per_second: f32) -> RotorRpm {
    RotorRpm::new(degrees_per_second / 6.0)
}

fn angle(degrees: f32) -> TotalAngle {
    TotalAngle::try_from_degrees(Degrees::new(degrees)).unwrap()
}

#[test]
fn identifiers_go_from_1_to_32() {
    assert_eq!((DriveId::new(0), DriveId::new(33)), (None, None));
    assert_eq!((id(1).can_id().as_raw(), id(32).can_id().as_raw()), (0x141, 0x160));
    assert_eq!(
        (id(1).multi_motor_lane(), id(4).multi_motor_lane(), id(5).multi_motor_lane()),
        (Some(0), Some(6), None)
    );
}

/// librm compiled, and the tables of manual V2.3.
#[test]
fn commands_have_the_bytes_of_the_manual() {
    for (command, bytes) in [
        (Command::Off, "80"),
        (Command::Stop, "81"),
        (Command::Run, "88"),
        (Command::ReadMultiTurn, "92"),
        (Command::ReadSingleTurn, "94"),
        (Command::ReadHealth, "9A"),
        (Command::ClearErrors, "9B"),
        (Command::ReadMotion, "9C"),
        (Command::ReadPhaseCurrents, "9D"),
    ] {
        assert_eq!(sent(command, 7, &MG), std::format!("147#{bytes}00000000000000"));
    }
    let limit = Some(rpm(500.0));
    let (counter, free) = (SpinDirection::CounterClockwise, None);
    for (command, frame) in [
        (Command::OpenLoop(-3), "141#A0000000FDFF0000"),
        (Command::OpenLoop(2000), "141#A000000052030000"),
        (Command::Current(Amps::new(3.3)), "141#A1000000CC000000"),
        (Command::Current(Amps::new(-33.0)), "141#A100000000F80000"),
        (Command::Current(Amps::new(f32::NEG_INFINITY)), "141#A100000000F80000"),
        (Command::Current(Amps::new(40.0)), "141#A100000000080000"),
        (Command::Speed(rpm(90.0)), "141#A200000028230000"),
        (Command::Speed(rpm(-0.01)), "141#A2000000FFFFFFFF"),
        (Command::Speed(rpm(f32::INFINITY)), "141#A2000000FFFFFF7F"),
        (Command::TurnTo { angle: angle(360.0), speed_limit: free }, "141#A3000000A08C0000"),
        (Command::TurnTo { angle: angle(-90.5), speed_limit: limit }, "141#A400F401A6DCFFFF"),
        (
            Command::TurnTo { angle: angle(1e12), speed_limit: Some(rpm(-1.0)) },
            "141#A4000000FFFFFF7F",
        ),
        (
            Command::TurnWithin {
                angle: Degrees::new(90.0),
                direction: counter,
                speed_limit: free,
            },
            "141#A501000028230000",
        ),
        (
            Command::TurnWithin {
                angle: Degrees::new(400.0),
                direction: SpinDirection::Clockwise,
                speed_limit: Some(rpm(1e9)),
            },
            "141#A600FFFF9F8C0000",
        ),
        (Command::TurnBy { angle: angle(-1.0), speed_limit: free }, "141#A70000009CFFFFFF"),
        (Command::TurnBy { angle: angle(1.0), speed_limit: limit }, "141#A800F40164000000"),
    ] {
        assert_eq!(sent(command, 1, &MG), frame, "{command:?}");
    }
    assert_eq!(sent(Command::Current(Amps::new(1.65)), 7, &MF), "147#A1000000CC000000");
    let multi = pack_multi_motor([100, -100, 2000, -2000]);
    assert_eq!(multi.to_string(), "280#64009CFFD00730F8");
}

#[test]
fn what_is_not_a_number_is_reported_and_moves_nothing() {
    let nan = f32::NAN;
    let limit = Some(RotorRpm::new(nan));
    let direction = SpinDirection::Clockwise;
    for (command, field, neutral) in [
        (Command::Current(Amps::new(nan)), "current", "A1"),
        (Command::Speed(RotorRpm::new(nan)), "speed", "A2"),
        (
            Command::TurnWithin { angle: Degrees::new(nan), direction, speed_limit: None },
            "angle",
            "9C",
        ),
        (
            Command::TurnWithin { angle: Degrees::ZERO, direction, speed_limit: limit },
            "speed limit",
            "9C",
        ),
        (Command::TurnTo { angle: angle(1.0), speed_limit: limit }, "speed limit", "9C"),
        (Command::TurnBy { angle: angle(1.0), speed_limit: limit }, "speed limit", "9C"),
    ] {
        let error = command.pack(id(1), &MG).unwrap_err();
        assert_eq!(error.field, field);
        assert_eq!(error.neutral.to_string(), std::format!("141#{neutral}00000000000000"));
    }
}

#[test]
fn a_reported_current_can_be_asked_for() {
    for model in [MG, MF] {
        for effort in -2048..=2048 {
            let motion = Motion { command: CURRENT, temperature: 0, effort, speed: 0, encoder: 0 };
            let current = model.current(&motion).unwrap();
            assert_eq!(model.raw_current(current), effort, "{} {effort}", model.name);
        }
    }
    assert_eq!(Model::ms(EncoderBits::Fourteen).raw_current(Amps::new(5.0)), 0);
}

#[test]
fn a_measurement_is_unpacked() {
    let bytes = [0xA1, 0x23, 0xE8, 0x03, 0xA6, 0xFF, 0x00, 0x20];
    let Ok(Reply::Motion(motion)) = Reply::unpack(&bytes) else { panic!("no measurement") };
    let expected =
        Motion { command: 0xA1, temperature: 35, effort: 1000, speed: -90, encoder: 8192 };
    assert_eq!(motion, expected);
    assert_eq!(MG.current(&motion), Some(Amps::new(1000.0 * 33.0 / 2048.0)));
    assert!((motion.speed().get() + 15.0).abs() < 1e-5);
    assert_eq!(motion.temperature(), Celsius::new(35.0));
    assert_eq!(MG.angle(&motion), Ok(Degrees::new(180.0)));
    assert_eq!(MF.angle(&motion), Ok(Degrees::new(45.0)));
    let far = Motion { encoder: 16_384, ..motion };
    assert_eq!(MG.angle(&far), Err(FrameError::Encoder));
    assert_eq!(Model::mg(EncoderBits::Fifteen).angle(&far), Ok(Degrees::new(180.0)));
    let power = Motion { command: 0xA0, ..motion };
    assert_eq!(MG.current(&power), None);
    assert_eq!(Model::ms(EncoderBits::Fourteen).current(&motion), None);
}

#[test]
fn the_other_answers_are_unpacked() {
    let unpack = |bytes| Reply::unpack(&bytes).unwrap();
    assert!(matches!(unpack([0x80, 0, 0, 0, 0, 0, 0, 0]), Reply::Off));
    assert!(matches!(unpack([0x81, 0, 0, 0, 0, 0, 0, 0]), Reply::Stop));
    assert!(matches!(unpack([0x88, 0, 0, 0, 0, 0, 0, 0]), Reply::Run));
    for command in [0x9A, 0x9B] {
        let reply = unpack([command, 0xD8, 0, 0xF1, 0, 0, 0, 9]);
        let Reply::Health(health) = reply else { panic!("no health") };
        assert_eq!(health.temperature, Celsius::new(-40.0));
        assert!((health.supply - 24.1).abs() < 1e-5);
        let texts: Vec<_> = health.errors.texts().collect();
        assert_eq!(texts, ["supply voltage too low", "motor too hot"]);
        assert_eq!(health.errors.fault(), Some(Fault::new(9, "motor too hot")));
    }
    assert_eq!(Errors::default().fault(), None);
    let Reply::PhaseCurrents(currents) = unpack([0x9D, 25, 0x40, 0, 0xE0, 0xFF, 0, 0x80]) else {
        panic!("no phase currents")
    };
    assert_eq!(currents.temperature, Celsius::new(25.0));
    assert_eq!(currents.phases, [1.0, -0.5, -512.0].map(Amps::new));
    let Reply::MultiTurn(angle) = unpack([0x92, 0xA6, 0xDC, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]) else {
        panic!("no angle over many turns")
    };
    assert_eq!(angle.microdegrees(), -90_500_000);
    let Reply::SingleTurn(angle) = unpack([0x94, 0, 0, 0, 0x9F, 0x8C, 0, 0]) else {
        panic!("no angle within a turn")
    };
    assert_eq!(angle.microdegrees(), 359_990_000);
}

#[test]
fn what_is_no_answer_is_refused() {
    let of = |frame: &CanFrame| Reply::from_frame(frame, id(1)).map(drop);
    let bytes = [0x9C, 0, 0, 0, 0, 0, 0, 0];
    let extended = embedded_can::ExtendedId::new(0x141).unwrap();
    assert_eq!(of(&CanFrame::eight_bytes(id(1).can_id(), bytes)), Ok(()));
    for stranger in [
        CanFrame::eight_bytes(id(2).can_id(), bytes),
        CanFrame::eight_bytes(extended, bytes),
        CanFrame::remote_frame(id(1).can_id(), 8).unwrap(),
    ] {
        assert_eq!(of(&stranger), Err(FrameError::NotMine));
    }
    let short = CanFrame::data_frame(id(1).can_id(), &bytes[..7]).unwrap();
    assert_eq!(of(&short), Err(FrameError::Length));
    for command in [0x00, 0x7F, 0x90, 0x93, 0x9E, 0x9F, 0xA9, 0xFF] {
        let frame = CanFrame::eight_bytes(id(1).can_id(), [command; 8]);
        assert_eq!(of(&frame), Err(FrameError::Unexpected));
    }
}
