//! Each mode reaches what it is told to reach.

use rc10_app::{Amps, Degrees, Gear, NewtonMetres, Rpm, TotalAngle};
use rc10_conformance::Bench;
use rc10_motor::odrive::{AxisState, Config, Control, InputMode, Limits, ODrive, Rates};
use rc10_motor::rc10_app::Direction;
use rc10_motor::{
    CanMotor, Condition, DriveMode, Link, Motor, Request, RequestError, Response, Safety, Target,
    TargetError, TargetKind, Tick,
};
use rc10_sim::Esc;
use rc10_sim::odrive::{Axis, Settings, State, encode_estimates, encode_heartbeat};
use rc10_time::Micros;

use crate::motors::{rpm, sent_in, settles};

use super::{NODE, bench, is_on, wheel, with};

#[test]
fn currents_temperatures_and_the_supply_are_told() {
    let config = Config {
        torque_constant: Some(8.27 / 150.0),
        rates: Rates { currents: 100, temperatures: 100, supply: 100, ..Rates::new(1000, 50) },
        ..wheel()
    };
    let motor = ODrive::new(config).unwrap();
    let settings = Settings { others_every: Some(Micros::from_millis(10)), ..Settings::new(NODE) };
    let (mut bench, esc, id) = bench(motor, settings, Safety::COAST);
    let constant = 8.0 * 8.27 / 150.0;
    bench.hold(id, Target::Torque(NewtonMetres::new(2.0)), 120).unwrap();
    assert!((esc.state().current * constant - 2.0).abs() < 0.01, "{}", esc.state().current);
    let told = bench.status(id).feedback;
    assert!((told.torque().unwrap().get() - 2.0).abs() < 0.02, "{:?}", told.torque());
    assert!((f64::from(told.current().unwrap().get()) - esc.state().current).abs() < 0.05);
    assert_eq!(told.supply().unwrap().get(), 24.0);
    assert_eq!(told.controller_temperature(), None);
    assert!(told.temperature().unwrap().get() > 24.0);
}

#[test]
fn an_axis_with_velocity_loops_of_its_own_gets_velocities() {
    for input in [InputMode::Passthrough, InputMode::VelocityRamp] {
        let mut motor = ODrive::new(with(Control::Velocity(input))).unwrap();
        assert!(!motor.supports().contains(TargetKind::Angle));
        let error = motor.set_target(Target::Torque(NewtonMetres::ZERO));
        assert_eq!(error, Err(TargetError::Unsupported(TargetKind::Torque)));
        let (mut bench, esc, id) = bench(motor, Settings::new(NODE), Safety::BRAKE);
        let target = Target::Speed(Rpm::new(120.0));
        let took = settles(&mut bench, id, target, || rpm(&esc) - 120.0, 3.0);
        assert!(took < 700, "{took} ms");
        let modes = esc.with(|axis: &mut Axis| {
            let controller = &axis.controller;
            (controller.control_mode, controller.input_mode, controller.input_velocity)
        });
        assert_eq!(modes, Some((2, input as u32, 16.0)));
        // Braking is a speed, coasting is not.
        bench.wait(60);
        assert_eq!(bench.status(id).drive, DriveMode::Brake);
        bench.wait(1000);
        assert!(rpm(&esc).abs() < 2.0 && is_on(&esc));
        bench.hold(id, target, 800).unwrap();
        bench.hold(id, Target::Coast, 50).unwrap();
        assert!(!is_on(&esc) && rpm(&esc) > 50.0);
        assert_eq!(bench.status(id).condition, Condition::Ready);
    }
}

#[test]
fn an_axis_with_position_loops_of_its_own_gets_positions() {
    for input in [InputMode::PositionFilter, InputMode::Trapezoid, InputMode::Passthrough] {
        let motor = ODrive::new(with(Control::Position(input))).unwrap();
        let (mut bench, esc, id) = bench(motor, Settings::new(NODE), Safety::HOLD);
        bench.hold(id, Target::Coast, 30).unwrap();
        let goal = TotalAngle::from_degrees(400);
        let off = || esc.state().output_degrees - 400.0;
        let took = settles(&mut bench, id, Target::TotalAngle(goal), off, 1.0);
        assert!(took < 2000, "{took} ms");
        // 400 is 40; the shorter way to 350 is back.
        bench.hold(id, Target::Angle(Degrees::new(350.0)), 1500).unwrap();
        assert!((esc.state().output_degrees - 350.0).abs() < 1.0);
        bench.hold(id, Target::Angle(Degrees::new(-20.0)), 1500).unwrap();
        assert!((esc.state().output_degrees - 340.0).abs() < 1.0);
        // An angle within the turn counts from the new zero; a total angle that is sought stays
        // where it is, and its number means another place when it is commanded again.
        let total = |degrees| Target::TotalAngle(TotalAngle::from_degrees(degrees));
        assert_eq!(bench.bus.request(id, Request::SetZeroOfDriven), Ok(Response::Done));
        bench.hold(id, Target::Angle(Degrees::new(-20.0)), 1500).unwrap();
        assert!((esc.state().output_degrees - 320.0).abs() < 1.0);
        bench.hold(id, total(-90), 1500).unwrap();
        assert!((esc.state().output_degrees - 250.0).abs() < 1.0);
        assert_eq!(bench.bus.request(id, Request::SetZeroOfDriven), Ok(Response::Done));
        bench.wait(30);
        assert!((esc.state().output_degrees - 250.0).abs() < 1.0 && is_on(&esc));
        bench.hold(id, total(-90), 1500).unwrap();
        assert!((esc.state().output_degrees - 160.0).abs() < 1.0);
        assert_eq!(bench.bus.request(id, Request::SetZeroOfDriven), Ok(Response::Done));
        bench.hold(id, Target::Coast, 30).unwrap();
        assert!(!is_on(&esc), "coasting is coasting, also after a new zero");
        bench.hold(id, total(90), 1500).unwrap();
        assert!((esc.state().output_degrees - 250.0).abs() < 2.0);
        // Commands stop: it holds against a load.
        bench.wait(60);
        assert_eq!(bench.status(id).drive, DriveMode::Hold);
        esc.set_load(2.0);
        bench.wait(1000);
        assert!((esc.state().output_degrees - 250.0).abs() < 3.0, "{:?}", esc.state());
    }
}

/// The angle of a fresh axis is its reading, cut off at a microdegree; and readings that come back
/// to where they were leave nothing behind.
#[test]
fn turns_become_angles_and_nothing_is_lost() {
    const TURNS: [f32; 6] = [0.25, -0.25, 0.1, 1000.5, -12_345.125, 16_000_000.0];
    let heard = |motor: &mut ODrive, turns: f32, millis| {
        let frame = encode_estimates(NODE, turns.into(), 0.0);
        motor.unpack_feedback(&frame, Micros::from_millis(millis), Link::Online).unwrap();
        motor.feedback().total_angle.microdegrees()
    };
    for (direction, sign) in [(Direction::Forward, 1), (Direction::Reversed, -1)] {
        for (rotor, output) in [(8, 1), (1, 1), (96, 5)] {
            let gear = Gear::new(rotor, output).unwrap();
            let config = wheel().with_gear(gear).with_direction(direction);
            for turns in TURNS {
                let told = heard(&mut ODrive::new(config).unwrap(), turns, 1);
                #[expect(clippy::cast_possible_truncation, reason = "a few turns")]
                let exact = (f64::from(turns) * 360e6) as i64 * sign * i64::from(output);
                assert!((told - exact / i64::from(rotor)).abs() <= 1, "{turns}: {told}");
            }
            let mut motor = ODrive::new(config).unwrap();
            let first = heard(&mut motor, 1000.3, 1);
            for step in 0..10_000_u32 {
                heard(&mut motor, 1000.3 + (step % 50) as f32 * 0.0037, u64::from(step) + 2);
            }
            // What a step leaves over has the sign of the step.
            assert!((heard(&mut motor, 1000.3, 10_002) - first).abs() <= 1);
            assert_eq!(motor.feedback().turn_gaps, 0);
        }
    }
}

/// What the axis is sent is its own reading and the way left, wherever it counts from.
#[test]
fn a_position_is_sent_as_the_axis_counts() {
    let config = with(Control::Position(InputMode::Passthrough));
    for (direction, sign) in [(Direction::Forward, 1.0), (Direction::Reversed, -1.0)] {
        let mut motor = ODrive::new(config.with_direction(direction)).unwrap();
        let mut sent = |target, millis, reading: f32| {
            let at = Micros::from_millis(millis);
            motor.set_target(target).unwrap();
            let frame = encode_estimates(NODE, reading.into(), 0.0);
            motor.unpack_feedback(&frame, at, Link::Online).unwrap();
            let [_, tx] = [1, 8].map(|state| {
                let heartbeat = encode_heartbeat(NODE, 0, state, [0; 3]);
                motor.unpack_feedback(&heartbeat, at, Link::Online).unwrap();
                sent_in(&mut motor, &Tick::new(DriveMode::Run))
            });
            let frame = *tx.frames().last().unwrap();
            assert_eq!(frame.raw_id() & 31, 0x0C, "{frame}");
            let [a, b, c, d, ..] = *frame.all_eight().unwrap();
            (motor.feedback().total_angle, f32::from_le_bytes([a, b, c, d]))
        };
        // 8 turns of the axis are one of the output.
        let total = |degrees| Target::TotalAngle(TotalAngle::from_degrees(degrees));
        assert_eq!(sent(total(3600), 1, 0.0).1, 80.0 * sign);
        assert_eq!(sent(total(3600), 2, 0.125).1, 80.0 * sign);
        assert_eq!(sent(Target::Angle(Degrees::new(315.0)), 3, 0.125).1, -sign);
        // Restarted, it counts from elsewhere, and the way left is the same.
        assert_eq!(sent(total(3600), 4, 500.125).1, 500.0 + 80.0 * sign);
    }
}

/// A command that was given before the axis was heard of, and an angle the shorter way from there.
#[test]
fn an_angle_waits_until_it_is_known_where_the_shaft_is() {
    let mut motor = ODrive::new(with(Control::Position(InputMode::Trapezoid))).unwrap();
    motor.set_target(Target::Angle(Degrees::new(90.0))).unwrap();
    assert_eq!(motor.target(), Target::Angle(Degrees::new(90.0)));
    assert_eq!(motor.request(Request::SetZero), Err(RequestError::NoFeedback));
}

#[test]
fn limits_are_told_before_it_is_switched_on() {
    let limits = Limits { speed: Rpm::new(300.0), current: Amps::new(20.0) };
    let motor = ODrive::new(wheel().with_limits(limits)).unwrap();
    let (mut bench, esc, id) = bench(motor, Settings::new(NODE), Safety::COAST);
    let told = |esc: &Esc| {
        let limits =
            |axis: &mut Axis| (axis.controller.velocity_limit, axis.controller.current_limit);
        esc.with(limits).unwrap()
    };
    assert_eq!(told(&esc), (100.0, 40.0));
    bench.hold(id, Target::Torque(NewtonMetres::new(8.0)), 100).unwrap();
    assert_eq!(told(&esc), (40.0, 20.0));
    let ask =
        |bench: &mut Bench<'_>, amps| bench.bus.request(id, Request::CurrentLimit(Amps::new(amps)));
    assert_eq!(ask(&mut bench, 5.0), Ok(Response::Done));
    bench.hold(id, Target::Torque(NewtonMetres::new(8.0)), 30).unwrap();
    assert_eq!(told(&esc), (40.0, 5.0));
    assert!((esc.state().current - 5.0).abs() < 0.01);
    // No request goes beyond the configuration.
    assert_eq!(ask(&mut bench, 30.0), Ok(Response::Done));
    bench.hold(id, Target::Torque(NewtonMetres::new(8.0)), 30).unwrap();
    assert_eq!(told(&esc), (40.0, 20.0));
    for bad in [-1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(ask(&mut bench, bad), Err(RequestError::Config(_))));
    }
    let limit = Request::TorqueLimit(NewtonMetres::new(1.0));
    assert_eq!(bench.bus.request(id, limit), Ok(Response::Done));
    bench.hold(id, Target::Torque(NewtonMetres::new(8.0)), 30).unwrap();
    assert!((esc.state().current * 8.0 * 8.27 / 150.0 - 1.0).abs() < 0.01);

    let mut without = ODrive::new(wheel()).unwrap();
    let limit = Request::CurrentLimit(Amps::new(1.0));
    assert_eq!(without.request(limit), Err(RequestError::Unsupported));
}

#[test]
fn an_axis_is_switched_on_by_heartbeat_and_kept_idle() {
    let settings = Settings { heartbeat_every: Micros::from_millis(20), ..Settings::new(NODE) };
    let (mut bench, esc, id) = bench(ODrive::new(wheel()).unwrap(), settings, Safety::COAST);
    assert!(!is_on(&esc));
    let torque = Target::Torque(NewtonMetres::new(1.0));
    let mut starting = 0;
    while esc.state().current == 0.0 {
        bench.hold(id, torque, 1).unwrap();
        starting += 1;
        let running = bench.status(id).condition == Condition::Ready;
        assert!(running || esc.state().current == 0.0, "torque before the heartbeat");
        assert!(starting < 60);
    }
    assert!(starting >= 4, "{starting}");
    // Disarmed and armed again before a heartbeat: it starts from the beginning all the same.
    bench.bus.switch().disarm();
    bench.wait(3);
    assert!(!is_on(&esc));
    bench.bus.switch().arm().unwrap();
    bench.hold(id, torque, 2).unwrap();
    assert_eq!(bench.status(id).condition, Condition::Starting);
    bench.hold(id, torque, 100).unwrap();
    assert!(is_on(&esc) && esc.state().current > 1.0);
    // Idle by itself: switched on again, softly.
    esc.with(|axis: &mut Axis| axis.state = State::Idle).unwrap();
    bench.hold(id, torque, 200).unwrap();
    assert!(is_on(&esc) && esc.state().current > 1.0);
    bench.bus.switch().disarm();
    bench.wait(40);
    let mut reminders = 0;
    for _ in 0..100 {
        bench.tick();
        reminders += bench.sent.frames().len();
        assert!(
            bench.sent.frames().iter().all(|frame| frame.to_string() == "067#0100000000000000")
        );
    }
    assert_eq!(reminders, 10);
}

#[test]
fn slow_estimates_are_said_to_be_slow() {
    for (hz, condition) in [(100, Condition::SlowFeedback), (200, Condition::Ready)] {
        let config = Config { rates: Rates::new(hz, 50), ..wheel() };
        let motor = ODrive::new(config.with_gear(Gear::new(8, 1).unwrap())).unwrap();
        let every = Micros::new(1_000_000 / u64::from(hz));
        let settings = Settings { estimates_every: every, ..Settings::new(NODE) };
        let (mut bench, _, id) = bench(motor, settings, Safety::COAST);
        bench.hold(id, Target::Torque(NewtonMetres::new(0.5)), 200).unwrap();
        assert_eq!(bench.status(id).condition, condition);
    }
    let motor = ODrive::new(wheel()).unwrap();
    assert_eq!(motor.state(), AxisState::default());
}
