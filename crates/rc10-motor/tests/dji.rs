//! A DJI motor through its public interface: turns, gears and zeros.

use rc10_motor::dji::{self, Dji, M2006, M3508};
use rc10_motor::rc10_app::{Direction, Gear, PidConfig, Rpm, TotalAngle};
use rc10_motor::rc10_can::CanFrame;
use rc10_motor::rc10_can::embedded_can::StandardId;
use rc10_motor::rc10_time::Micros;
use rc10_motor::{CanMotor, DriveMode, Link, Motor, Request, Target, Tick};

/// Feedback of device 1: its rotor's angle and speed.
fn hear(motor: &mut Dji, angle: u16, rpm: i16, millis: u64) {
    let ([a, b], [c, d]) = (angle.to_be_bytes(), rpm.to_be_bytes());
    let id = StandardId::new(0x201).expect("a standard identifier");
    let frame = CanFrame::eight_bytes(id, [a, b, c, d, 0, 0, 0, 0]);
    motor.unpack_feedback(&frame, Micros::from_millis(millis), Link::Online).expect("feedback");
}

fn after(ticks: u32, motor: &mut Dji, mode: DriveMode) -> i16 {
    (0..ticks).for_each(|count| motor.update(&Tick { count, ..Tick::new(mode) }));
    motor.raw_command()
}

#[test]
fn turns_in_a_gap_are_those_of_the_mean_speed() {
    for (direction, sign) in [(Direction::Forward, 1), (Direction::Reversed, -1)] {
        // 8000 rpm to none in 30 ms, and back: two turns of the rotor each.
        let mut motor = Dji::new(dji::Config::new(&M2006, 1).with_direction(direction)).unwrap();
        hear(&mut motor, 0, 8000, 0);
        hear(&mut motor, 0, 0, 30);
        let turns = |count: i32| TotalAngle::from_degrees(sign * 10 * count);
        assert_eq!(motor.feedback().total_angle, turns(2));
        hear(&mut motor, 0, -8000, 60);
        assert_eq!(motor.feedback().total_angle, turns(0));
        assert_eq!(motor.feedback().turn_gaps, 2);
    }
}

#[test]
fn with_another_gear_the_rotor_is_driven_as_before() {
    let config = dji::Config::new(&M3508, 1);
    let (stock, direct) = (Dji::new(config).unwrap(), config.with_gear(Gear::DIRECT));
    let back = Dji::new(direct.with_gear(Gear::new(3591, 187).unwrap())).unwrap();
    let direct = Dji::new(direct).unwrap();
    let (before, after_gear) = (stock.loops().unwrap().cascade, direct.loops().unwrap().cascade);
    let near = |measured: f32, expected: f32| {
        assert!((measured / expected - 1.0).abs() < 1e-5, "{measured} {expected}");
    };
    let ratio = 3591.0 / 187.0;
    // The same speed of the rotor: 7681 rpm at the output now, and not 21.
    near(after_gear.angle.output_limit, before.angle.output_limit * ratio);
    near(after_gear.acceleration.get(), before.acceleration.get() * ratio);
    near(after_gear.speed.kp, before.speed.kp / ratio);
    near(after_gear.speed.ki, before.speed.ki / ratio);
    near(after_gear.speed.output_limit, before.speed.output_limit);
    // There and back is the gear it comes with, and feedback is scaled with it.
    near(back.loops().unwrap().cascade.angle.output_limit, before.angle.output_limit);
    let mut direct = direct;
    hear(&mut direct, 4096, 600, 1);
    assert_eq!(direct.feedback().total_angle, TotalAngle::from_degrees(180));
    assert_eq!(direct.feedback().speed, Rpm::new(600.0));
    // The same error of the rotor, the same current.
    let mut geared = stock;
    hear(&mut geared, 0, 0, 1);
    hear(&mut direct, 0, 0, 2);
    geared.set_target(Target::Speed(Rpm::new(100.0))).unwrap();
    direct.set_target(Target::Speed(Rpm::new(100.0 * ratio))).unwrap();
    let (ours, theirs) =
        (after(60, &mut geared, DriveMode::Run), after(60, &mut direct, DriveMode::Run));
    assert!(ours > 1000 && (ours - theirs).abs() <= 1, "{ours} {theirs}");
}

/// `docs/from-cpp.md`: a gain of 10 in raw current per rotor rpm, here in A per rpm of the output.
#[test]
fn gains_of_a_loop_in_raw_numbers_give_its_raw_numbers() {
    for (model, full) in [(&M3508, 20.0), (&M2006, 10.0)] {
        let ratio = model.gear.ratio();
        let mut cascade = model.cascade;
        let unit = full / f32::from(model.full_scale);
        cascade.speed = PidConfig::within(full).kp(10.0 * unit * ratio);
        let mut motor = Dji::new(dji::Config::new(model, 1).with_cascade(cascade)).unwrap();
        hear(&mut motor, 0, 600, 1);
        // 500 rpm too slow at the rotor.
        motor.set_target(Target::Speed(Rpm::new(1100.0 / ratio))).unwrap();
        let raw = after(300, &mut motor, DriveMode::Run);
        assert!((raw - 5000).abs() <= 1, "{} {raw}", model.name);
    }
}

#[test]
fn a_new_zero_moves_nothing_and_the_target_is_told_from_it() {
    for direction in [Direction::Forward, Direction::Reversed] {
        for mode in [DriveMode::Run, DriveMode::Hold, DriveMode::Brake] {
            let mut lift = Dji::new(dji::Config::new(&M3508, 1).with_direction(direction)).unwrap();
            hear(&mut lift, 0, 0, 0);
            // Two turns of the rotor from where it was.
            for (millis, quarter) in (1..=8_u16).enumerate() {
                hear(&mut lift, quarter % 4 * 2048, 0, millis as u64 + 1);
            }
            let here = lift.feedback().total_angle;
            lift.set_target(Target::TotalAngle(here)).unwrap();
            assert_eq!(after(200, &mut lift, mode), 0);
            lift.request(Request::SetZero).unwrap();
            assert_eq!(lift.feedback().total_angle, TotalAngle::ZERO);
            assert_eq!(lift.target(), Target::TotalAngle(TotalAngle::ZERO));
            assert_eq!(after(200, &mut lift, mode), 0, "{mode:?}");
            // The old number is another angle now.
            lift.set_target(Target::TotalAngle(here)).unwrap();
            let command = after(200, &mut lift, DriveMode::Run);
            let forward = command > 0;
            assert!(command.abs() > 1000 && forward, "{direction:?}: {command}");
        }
    }
}
