//! A servo through its public interface: stops, zeros, limits and springs.

use rc10_motor::rc10_app::{
    Amps, Cascade, Degrees, Direction, FeedForward, Gear, Gravity, NewtonMetres, PidConfig, Rpm,
    RpmPerSecond, TotalAngle,
};
use rc10_motor::rc10_time::Micros;
use rc10_motor::servo::{Servo, Spring, SpringRange};
use rc10_motor::shaft::Shaft;
use rc10_motor::{
    DriveMode, Gains, Impedance, Motion, Request, Response, Target, TargetError, TargetKind, Tick,
};

const RANGE: SpringRange = SpringRange { kp: 100.0, kd: 5.0, speed: Rpm::new(300.0) };

fn cascade() -> Cascade {
    Cascade {
        speed: PidConfig::within(5.0).kp(0.1),
        angle: PidConfig::within(100.0).kp(3.0),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(600.0),
        feed_forward: FeedForward::NONE,
    }
}

fn servo() -> Servo {
    Servo::new(TargetKind::Torque, cascade()).expect("good gains").with_springs(RANGE)
}

fn at(degrees: i64, rpm: f32) -> Shaft {
    let mut shaft = Shaft::new(360_000, Gear::DIRECT, Direction::Forward);
    shaft.start(degrees * 1000);
    shaft.measure(rpm, Micros::from_millis(1));
    shaft
}

/// The effort after `ticks` ticks.
fn after(ticks: u32, servo: &mut Servo, mode: DriveMode, shaft: &Shaft) -> f32 {
    (0..ticks).for_each(|_| servo.update(&Tick::new(mode), shaft));
    servo.effort()
}

fn spring_after(ticks: u32, servo: &mut Servo, shaft: &Shaft) -> Spring {
    after(ticks, servo, DriveMode::Run, shaft);
    *servo.spring().expect("a spring drives")
}

/// The torque that the device makes of a spring.
fn torque(spring: &Spring, rpm: f32) -> f32 {
    let slip = (spring.speed.get() - rpm) * core::f32::consts::TAU / 60.0;
    spring.kp * spring.way.get().to_radians() + spring.kd * slip + spring.torque
}

fn impedance(degrees: f32, speed: f32, torque: f32) -> Target {
    let (angle, speed) = (Degrees::new(degrees), Rpm::new(speed));
    Target::Impedance(Impedance {
        angle,
        speed,
        torque: NewtonMetres::new(torque),
        kp: 2.0,
        kd: 0.5,
    })
}

fn near(measured: f32, expected: f32) {
    assert!((measured - expected).abs() <= 2e-3 * expected.abs().max(1.0), "{measured} {expected}");
}

#[test]
fn it_holds_where_the_shaft_comes_to_a_stand_whichever_way_it_turns() {
    // 60 rpm are braked with 600 rpm/s in 0.1 s: 18 degrees.
    for (rpm, stand) in [(60.0, 118), (-60.0, 82), (0.0, 100)] {
        let mut servo = servo();
        after(1, &mut servo, DriveMode::Hold, &at(100, rpm));
        near(after(300, &mut servo, DriveMode::Hold, &at(stand, 0.0)), 0.0);
        assert!(after(300, &mut servo, DriveMode::Hold, &at(stand + 1, 0.0)) < -0.2);
        assert!(after(300, &mut servo, DriveMode::Hold, &at(stand - 1, 0.0)) > 0.2);
        // Held until the mode changes, and then anew.
        let modes = [DriveMode::Run, DriveMode::Brake, DriveMode::Coast, DriveMode::Off];
        for (mode, degrees) in modes.into_iter().zip([7, 17, 27, 37]) {
            after(1, &mut servo, mode, &at(degrees, 0.0));
            near(after(300, &mut servo, DriveMode::Hold, &at(degrees, 0.0)), 0.0);
        }
        servo.rest();
        near(after(300, &mut servo, DriveMode::Hold, &at(9, 0.0)), 0.0);
    }
}

#[test]
fn a_new_zero_moves_nothing_and_the_target_is_told_from_it() {
    let total = |degrees| Target::TotalAngle(TotalAngle::from_degrees(degrees));
    let angle = |degrees| Target::Angle(Degrees::new(degrees));
    for (before, after_zero) in [
        (total(100), total(60)),
        (total(-1000), total(-1040)),
        (angle(45.0), angle(5.0)),
        (angle(30.0), angle(350.0)),
        (impedance(100.0, 12.0, 0.3), impedance(60.0, 12.0, 0.3)),
        (Target::Speed(Rpm::new(20.0)), Target::Speed(Rpm::new(20.0))),
        (Target::Torque(NewtonMetres::new(0.5)), Target::Torque(NewtonMetres::new(0.5))),
        (Target::Coast, Target::Coast),
    ] {
        for mode in [DriveMode::Run, DriveMode::Hold, DriveMode::Brake] {
            let mut servo = servo();
            servo.set_target(before).unwrap();
            let effort = after(400, &mut servo, mode, &at(40, 0.0));
            let spring = servo.spring().copied();
            servo.set_zero(TotalAngle::from_degrees(40));
            assert_eq!(servo.target(), after_zero);
            near(after(1, &mut servo, mode, &at(0, 0.0)), effort);
            if let (Some(before), Some(now)) = (spring, servo.spring()) {
                near(now.way.get(), before.way.get());
                near(torque(now, 0.0), torque(&before, 0.0));
            }
            assert_eq!(spring.is_some(), servo.spring().is_some());
        }
    }
}

#[test]
fn a_springs_angle_is_exact_after_a_zero() {
    let mut servo = servo();
    servo.set_target(impedance(0.0, 0.0, 0.0)).unwrap();
    // Far more turns than the degrees of an impedance resolve.
    let zero = TotalAngle::from_microdegrees(-100_000_003_000_001);
    servo.set_zero(zero);
    let mut shaft = Shaft::new(360_000_000, Gear::DIRECT, Direction::Forward);
    shaft.start(100_000_003_000_001 - 2_000_000);
    shaft.measure(0.0, Micros::from_millis(1));
    near(spring_after(1, &mut servo, &shaft).way.get(), 2.0);
}

#[test]
fn a_spring_starts_softly_with_one_factor_for_all_of_it() {
    let mut servo = servo();
    let shaft = at(0, 30.0);
    // 100 degrees: 3.49 N m, and a damper and a torque on top.
    servo.set_target(impedance(100.0, 60.0, 0.4)).unwrap();
    let mut last = 0.0;
    for tick in 1..=20_u8 {
        let spring = spring_after(1, &mut servo, &shaft);
        let now = torque(&spring, 30.0);
        assert!(now <= 5.0 * f32::from(tick) / 20.0 + 1e-3, "tick {tick}: {now}");
        assert!(now >= last, "tick {tick}: {now} after {last}");
        // The equilibrium stays.
        near(spring.kp / spring.kd, 4.0);
        near(spring.torque / spring.kp, 0.2);
        near(spring.way.get(), 100.0);
        assert_eq!(spring.speed, Rpm::new(60.0));
        near(servo.effort(), 0.0);
        last = now;
    }
    let spring = spring_after(1, &mut servo, &shaft);
    let whole = 2.0 * 100_f32.to_radians() + 0.5 * 30.0 * core::f32::consts::TAU / 60.0 + 0.4;
    near(torque(&spring, 30.0), whole.min(5.0));
    // Not softly again for another spring, but after an effort, a stop or a rest.
    servo.set_target(impedance(-100.0, 0.0, 0.0)).unwrap();
    assert!(torque(&spring_after(1, &mut servo, &shaft), 30.0) < -4.9);
    // An effort before leaves nothing of itself.
    servo.set_target(Target::Torque(NewtonMetres::new(3.0))).unwrap();
    near(after(30, &mut servo, DriveMode::Run, &shaft), 3.0);
    servo.set_target(impedance(-100.0, 0.0, 0.0)).unwrap();
    near(after(1, &mut servo, DriveMode::Run, &shaft), 0.0);
    let again: [&dyn Fn(&mut Servo); 4] = [
        &|servo| servo.set_target(Target::Speed(Rpm::new(1.0))).unwrap(),
        &Servo::rest,
        &|servo| _ = after(1, servo, DriveMode::Brake, &at(0, 30.0)),
        &|servo| servo.update(&Tick::new(DriveMode::Coast), &at(0, 30.0)),
    ];
    for stop in again {
        stop(&mut servo);
        assert_eq!(servo.spring(), None);
        servo.set_target(impedance(-100.0, 0.0, 0.0)).unwrap();
        near(torque(&spring_after(1, &mut servo, &shaft), 30.0), -0.25);
        after(30, &mut servo, DriveMode::Run, &shaft);
    }
}

#[test]
fn a_lowered_limit_holds_for_what_drives_already() {
    let limit = |servo: &mut Servo, newton_metres| {
        let request = Request::TorqueLimit(NewtonMetres::new(newton_metres));
        assert_eq!(servo.request(request, &mut at(0, 0.0)), Ok(Response::Done));
    };
    for target in [
        Target::Torque(NewtonMetres::new(4.0)),
        Target::Speed(Rpm::new(1000.0)),
        Target::TotalAngle(TotalAngle::from_degrees(10_000)),
        Target::TotalAngle(TotalAngle::from_degrees(3_000)),
        Target::Angle(Degrees::new(170.0)),
    ] {
        let mut servo = servo();
        servo.set_target(target).unwrap();
        assert!(after(500, &mut servo, DriveMode::Run, &at(0, 0.0)) > 3.9, "{target:?}");
        limit(&mut servo, 1.5);
        near(after(1, &mut servo, DriveMode::Run, &at(0, 0.0)), 1.5);
        // So do the stops, and the limit outlives them.
        assert!(after(50, &mut servo, DriveMode::Brake, &at(0, 500.0)) >= -1.501);
        assert!(after(50, &mut servo, DriveMode::Hold, &at(0, 500.0)) >= -1.501);
        near(after(500, &mut servo, DriveMode::Run, &at(0, 0.0)), 1.5);
    }
    let mut servo = servo();
    servo.set_target(impedance(100.0, 0.0, 3.0)).unwrap();
    near(torque(&spring_after(50, &mut servo, &at(0, 0.0)), 0.0), 5.0);
    limit(&mut servo, 1.5);
    let spring = spring_after(1, &mut servo, &at(0, 0.0));
    near(torque(&spring, 0.0), 1.5);
    // Its torque alone obeys the limit before all is taken back by one factor.
    near(spring.torque / spring.kp, 1.5 / 2.0);
}

#[test]
fn springs_that_the_device_cannot_make_are_refused() {
    let good = Impedance { kp: RANGE.kp, kd: RANGE.kd, speed: RANGE.speed, ..Impedance::default() };
    let mut servo = servo();
    for good in [good, Impedance { speed: Rpm::new(-300.0), ..good }, Impedance::default()] {
        servo.set_target(Target::Impedance(good)).unwrap();
        assert_eq!(servo.target(), Target::Impedance(good));
    }
    let out_of_range = Err(TargetError::OutOfRange(TargetKind::Impedance));
    let not_finite = Err(TargetError::NotFinite(TargetKind::Impedance));
    for (bad, error) in [
        (Impedance { kp: 100.1, ..good }, out_of_range),
        (Impedance { kp: -0.1, ..good }, out_of_range),
        (Impedance { kd: 5.1, ..good }, out_of_range),
        (Impedance { kd: -0.1, ..good }, out_of_range),
        (Impedance { speed: Rpm::new(300.1), ..good }, out_of_range),
        (Impedance { speed: Rpm::new(-300.1), ..good }, out_of_range),
        (Impedance { angle: Degrees::new(f32::MAX), ..good }, out_of_range),
        (Impedance { angle: Degrees::new(f32::NAN), ..good }, not_finite),
        (Impedance { kp: f32::NAN, ..good }, not_finite),
    ] {
        assert_eq!(servo.set_target(Target::Impedance(bad)), error, "{bad:?}");
        assert_eq!(servo.target(), Target::Impedance(Impedance::default()));
    }
    let mut without = Servo::new(TargetKind::Torque, cascade()).unwrap();
    let unsupported = Err(TargetError::Unsupported(TargetKind::Impedance));
    assert_eq!(without.set_target(Target::Impedance(good)), unsupported);
}

#[test]
fn a_stop_forgets_what_pushed_against_an_obstacle_and_a_hold_keeps_what_carries_a_load() {
    let speed = PidConfig::within(5.0).kp(0.1).ki(5.0);
    for (mode, is_kept) in [(DriveMode::Brake, false), (DriveMode::Hold, true)] {
        let mut servo = Servo::new(TargetKind::Current, Cascade { speed, ..cascade() }).unwrap();
        servo.set_target(Target::Speed(Rpm::new(20.0))).unwrap();
        assert!(after(500, &mut servo, DriveMode::Run, &at(0, 0.0)) > 4.9);
        let left = after(40, &mut servo, mode, &at(0, 0.0));
        assert!(if is_kept { left > 1.0 } else { left.abs() < 0.1 }, "{mode:?}: {left}");
        // A stop has loops that regulate like others.
        assert!(after(2000, &mut servo, mode, &at(0, 0.5)) < -2.0 || is_kept);
        servo.rest();
        near(servo.effort(), 0.0);
    }
}

#[test]
fn gains_and_limits_reach_the_loop_they_are_meant_for() {
    let mut servo = Servo::new(TargetKind::Current, cascade()).unwrap().with_full_scale(8.0);
    let gains = |kp| Gains { kp, ki: 2.0, kd: 3.0 };
    let mut shaft = at(0, 0.0);
    assert_eq!(servo.request(Request::SpeedGains(gains(1.0)), &mut shaft), Ok(Response::Done));
    assert_eq!(servo.request(Request::AngleGains(gains(4.0)), &mut shaft), Ok(Response::Done));
    let Cascade { speed, angle, .. } = servo.loops().cascade;
    assert_eq!((speed.kp, speed.ki, speed.kd, speed.output_limit), (1.0, 2.0, 3.0, 5.0));
    assert_eq!((angle.kp, angle.ki, angle.kd, angle.output_limit), (4.0, 2.0, 3.0, 100.0));
    assert_eq!(servo.loops().effort, TargetKind::Current);
    for (limit, of_the_loop, of_all) in [(3.0, 3.0, 3.0), (6.0, 5.0, 6.0), (100.0, 5.0, 8.0)] {
        let request = Request::CurrentLimit(Amps::new(limit));
        assert_eq!(servo.request(request, &mut shaft), Ok(Response::Done));
        near(servo.loops().cascade.speed.output_limit, of_the_loop);
        servo.set_target(Target::Current(Amps::new(50.0))).unwrap();
        near(after(40, &mut servo, DriveMode::Run, &shaft), of_all);
    }
    let wrong = servo.request(Request::TorqueLimit(NewtonMetres::new(1.0)), &mut shaft);
    assert!(wrong.is_err());
}

#[test]
fn a_new_derivative_does_not_reach_back() {
    let mut servo = servo();
    servo.set_target(Target::Speed(Rpm::new(100.0))).unwrap();
    after(100, &mut servo, DriveMode::Run, &at(0, 0.0));
    near(after(400, &mut servo, DriveMode::Run, &at(0, 100.0)), 0.0);
    let gains = Gains { kp: 0.1, ki: 0.0, kd: 0.02 };
    servo.request(Request::SpeedGains(gains), &mut at(0, 100.0)).unwrap();
    near(after(1, &mut servo, DriveMode::Run, &at(0, 100.0)), 0.0);
}

#[test]
fn an_angle_within_the_turn_is_any_number_of_degrees() {
    for (from, degrees, way) in [
        (350, -350.0, 1.0),
        (10, 710.0, -1.0),
        (0, -1e-9, 0.0),
        (1, -1e-9, -1.0),
        (10, 3610.0, 0.0),
        (359, -3600.5, 1.0),
    ] {
        let mut servo = servo();
        servo.set_target(Target::Angle(Degrees::new(degrees))).unwrap();
        let effort = after(400, &mut servo, DriveMode::Run, &at(from, 0.0));
        let is_right = if way == 0.0 { effort.abs() < 1e-3 } else { effort * way > 0.1 };
        assert!(is_right, "{degrees} from {from}: {effort}");
    }
}

#[test]
fn each_part_of_the_feed_forward_alone_is_given_in_every_tick_and_to_either_side() {
    let motion = |angle, speed, acceleration| {
        let (speed, acceleration) = (Rpm::new(speed), RpmPerSecond::new(acceleration));
        Target::Motion(Motion { angle, speed, acceleration, ..Motion::default() })
    };
    let none = FeedForward::NONE;
    let with = |feed_forward| {
        let cascade = Cascade { feed_forward, ..cascade() };
        Servo::new(TargetKind::Torque, cascade).unwrap()
    };
    let here = TotalAngle::from_degrees(60);
    for sign in [1.0, -1.0] {
        let moves = [Target::Speed(Rpm::new(sign * 20.0)), motion(None, sign * 20.0, 0.0)];
        let stands = [
            Target::Speed(Rpm::ZERO),
            Target::TotalAngle(here),
            Target::Angle(Degrees::new(60.0)),
            motion(Some(here), 0.0, 0.0),
            motion(None, 0.0, 0.0),
        ];
        let lift = Gravity::Lift(sign * 1.5);
        // At 60 degrees half of what it weighs where it is level.
        let arm = Gravity::Arm { effort: sign * 3.0, level: Degrees::ZERO };
        for (feed_forward, rpm, targets) in [
            (FeedForward { friction: 1.5, ..none }, 20.0, &moves[..]),
            (FeedForward { per_rpm: 0.075, ..none }, 20.0, &moves),
            (FeedForward { gravity: lift, ..none }, 0.0, &stands),
            (FeedForward { gravity: arm, ..none }, 0.0, &stands),
            (FeedForward { gravity: lift, ..none }, 20.0, &moves),
        ] {
            for target in targets {
                let mut servo = with(feed_forward);
                servo.set_target(*target).unwrap();
                // The loops have nothing to correct.
                for ticks in [200, 1, 1] {
                    let effort = after(ticks, &mut servo, DriveMode::Run, &at(60, sign * rpm));
                    near(effort, sign * 1.5);
                }
            }
        }
        // A speed is gathered with 600 rpm/s.
        let mut servo = with(FeedForward { per_rpm_s: 0.0025, ..none });
        servo.set_target(Target::Speed(Rpm::new(sign * 1000.0))).unwrap();
        for tick in 0..100_u8 {
            let shaft = at(60, sign * 0.6 * f32::from(tick));
            let given = after(1, &mut servo, DriveMode::Run, &shaft);
            // A tick of it, 0.6 rpm, is left to the loop.
            assert!(tick < 30 || (given - sign * 1.5).abs() < 0.1, "{tick}: {given}");
        }
        // An acceleration that is told lasts 50 ms.
        let mut servo = with(FeedForward { per_rpm_s: 0.005, ..none });
        let mut given = 0.0;
        for tick in 0..40_u8 {
            if tick % 5 == 0 {
                let speed = sign * 0.3 * f32::from(tick);
                servo.set_target(motion(None, speed, sign * 300.0)).unwrap();
            }
            let rpm = sign * 0.3 * f32::from(tick + 1);
            given = after(1, &mut servo, DriveMode::Run, &at(60, rpm));
        }
        near(given, sign * 1.5);
    }
}

/// The motion of its target now.
fn moment(servo: &Servo) -> (f32, f32) {
    let Target::Motion(Motion { angle, speed, .. }) = servo.target() else {
        panic!("{:?}", servo.target());
    };
    (angle.map_or(0.0, |angle| angle.degrees().get()), speed.get())
}

#[test]
fn a_motion_that_slows_down_comes_to_a_stand_and_one_that_speeds_up_does_so_for_50_ms() {
    for sign in [1.0, -1.0] {
        for (rpm, acceleration, ticks, then, degrees) in [
            // 10 rpm in 10 ms: 0.3 degrees.
            (10.0, -1000.0, 9, 1.0, 0.297),
            (10.0, -1000.0, 40, 0.0, 0.3),
            (10.0, -1000.0, 200, 0.0, 0.3),
            // Not yet at a stand after 50 ms, and then it goes on.
            (100.0, -1000.0, 50, 50.0, 22.5),
            (100.0, -1000.0, 100, 50.0, 37.5),
            (10.0, 1000.0, 40, 50.0, 7.2),
            (10.0, 1000.0, 100, 60.0, 28.5),
            (0.0, 1000.0, 100, 50.0, 22.5),
        ] {
            let mut servo = servo();
            let motion = Motion {
                angle: Some(TotalAngle::ZERO),
                speed: Rpm::new(sign * rpm),
                acceleration: RpmPerSecond::new(sign * acceleration),
                ..Motion::default()
            };
            servo.set_target(Target::Motion(motion)).unwrap();
            after(ticks, &mut servo, DriveMode::Run, &at(0, 0.0));
            let (angle, speed) = moment(&servo);
            let what = format!("{rpm} {acceleration} {ticks}");
            assert!((speed - sign * then).abs() < 0.01, "{what}: {speed} rpm");
            assert!((angle - sign * degrees).abs() < 0.01, "{what}: {angle} degrees");
        }
    }
}

#[test]
fn a_motion_that_is_given_again_begins_anew_also_the_same() {
    let motion = |degrees| {
        Target::Motion(Motion {
            angle: Some(TotalAngle::from_degrees(degrees)),
            speed: Rpm::new(60.0),
            acceleration: RpmPerSecond::new(-300.0),
            ..Motion::default()
        })
    };
    for again in [100, 200] {
        let mut servo = servo();
        servo.set_target(motion(100)).unwrap();
        after(30, &mut servo, DriveMode::Run, &at(100, 60.0));
        let first = moment(&servo);
        assert!((first.0 - 109.99).abs() < 0.01 && (first.1 - 51.0).abs() < 0.01, "{first:?}");
        servo.set_target(motion(again)).unwrap();
        assert_eq!(servo.target(), motion(again));
        after(30, &mut servo, DriveMode::Run, &at(100, 60.0));
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let further = (again - 100) as f32;
        let (angle, speed) = moment(&servo);
        near(angle, first.0 + further);
        near(speed, first.1);
    }
}

#[test]
fn angle_loops_run_in_the_ticks_that_the_bus_says() {
    let cascade = Cascade { outer_divider: 10, acceleration: RpmPerSecond::new(1e6), ..cascade() };
    for (mode, offset) in [DriveMode::Run, DriveMode::Hold].into_iter().zip([3, 7]) {
        let mut servo = Servo::new(TargetKind::Torque, cascade).unwrap();
        servo.set_target(Target::TotalAngle(TotalAngle::ZERO)).unwrap();
        let (mut ran, mut last) = (Vec::new(), 0.0);
        for tick in 0..100_u8 {
            // It moves, so that the angle loop asks for another speed each time.
            let shaft = at(if tick == 0 { 0 } else { i64::from(tick) / 4 }, 0.0);
            servo.update(&Tick { count: offset + u32::from(tick), ..Tick::new(mode) }, &shaft);
            if tick > 40 && f32::abs(servo.effort() - last) > 1e-6 {
                ran.push((u32::from(tick) + offset) % 10);
            }
            last = servo.effort();
        }
        assert!(ran.len() >= 4 && ran.iter().all(|tick| *tick == 0), "{mode:?}: {ran:?}");
    }
}
