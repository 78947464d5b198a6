//! Effects of each target on a simulated motor.

use rc10_app::{Amps, Degrees, PidConfig, Rpm, RpmPerSecond, TotalAngle};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::rc10_app::Direction;
use rc10_motor::vesc::Setting;
use rc10_motor::{Condition, DriveMode, Request, RequestError, Target, TargetError, TargetKind};
use rc10_sim::vesc::Mode;

use super::*;

fn hold(bench: &mut Bench<'_>, motor: MotorId, target: Target, millis: u32) {
    bench.hold(motor, target, millis).unwrap();
}

fn near(actual: f64, wanted: f64, within: f64) {
    assert!((actual - wanted).abs() <= within, "{actual}, not {wanted} ± {within}");
}

/// What the motor tells is what is true, but for its steps and the time on the way.
fn assert_told(bench: &Bench<'_>, motor: MotorId, esc: &Esc, rpm: f64, amps: f64) {
    let (told, state) = (bench.status(motor).feedback, esc.state());
    near(told.speed.get().into(), state.output_rpm, rpm);
    near(told.current().unwrap().get().into(), state.current, amps);
}

#[test]
fn a_current_is_reached_softly_and_measured_with_its_sign() {
    armed(|bench, motor, esc| {
        let target = Target::Current(Amps::new(10.0));
        hold(bench, motor, target, 5);
        assert!(esc.state().current < 5.0, "a kick of {} A", esc.state().current);
        hold(bench, motor, target, 45);
        near(esc.state().current, 10.0, 0.05);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Current(10.0));
        hold(bench, motor, target, 250);
        assert_told(bench, motor, esc, 20.0, 0.2);
        // Against the movement the firmware tells a current that feeds back as negative.
        for (amps, millis) in [(-10.0, 100), (-10.0, 600), (10.0, 100)] {
            hold(bench, motor, Target::Current(Amps::new(amps)), millis);
            near(esc.state().current, amps.into(), 0.05);
            assert_told(bench, motor, esc, 20.0, 0.2);
        }
        // More than the limit is limited on our side.
        hold(bench, motor, Target::Current(Amps::new(90.0)), 30);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Current(40.0));
    });
}

/// Its limits are set to half of what our side was told: a share of them is half of the current.
#[test]
fn relative_currents_are_shares_of_what_the_device_allows() {
    let ours = Config { relative_to: Some(Amps::new(80.0)), ..config(1) };
    on_armed_bench(Vesc::new(ours).unwrap(), device(1), Safety::BRAKE, |bench, motor, esc| {
        let mode = |esc: &Esc| inside(esc, |vesc| vesc.mode());
        let target = Target::Current(Amps::new(-20.0));
        hold(bench, motor, target, 5);
        assert!(esc.state().current > -5.0, "a kick of {} A", esc.state().current);
        hold(bench, motor, target, 45);
        near(esc.state().current, -10.0, 0.05);
        // More than the limit is limited on our side.
        hold(bench, motor, Target::Current(Amps::new(90.0)), 30);
        assert_eq!(mode(esc), Mode::Current(20.0));
        hold(bench, motor, Target::Brake(Amps::new(20.0)), 10);
        assert_eq!(mode(esc), Mode::Brake(10.0));
        hold(bench, motor, Target::Handbrake(Amps::new(20.0)), 5);
        assert!(matches!(mode(esc), Mode::Handbrake(amps) if amps < 5.0));
        hold(bench, motor, Target::Handbrake(Amps::new(20.0)), 30);
        assert_eq!(mode(esc), Mode::Handbrake(10.0));
        hold(bench, motor, Target::Coast, 10);
        assert_eq!(mode(esc), Mode::Released);
        // A safe state is in amperes.
        hold(bench, motor, Target::Duty(0.1), 200);
        bench.wait(100);
        assert_eq!(mode(esc), Mode::Brake(15.0));
    });
}

#[test]
fn a_speed_is_reached_and_kept() {
    armed(|bench, motor, esc| {
        for rpm in [1500.0, -1500.0, 2500.0_f32] {
            hold(bench, motor, Target::Speed(Rpm::new(rpm)), 1500);
            // The firmware's own gains: an integral that takes its time.
            near(esc.state().output_rpm, rpm.into(), 0.05 * f64::from(rpm.abs()));
            hold(bench, motor, Target::Speed(Rpm::new(rpm)), 4000);
            near(esc.state().output_rpm, rpm.into(), 0.005 * f64::from(rpm.abs()));
            assert_told(bench, motor, esc, 2.0, 0.2);
            assert_eq!(bench.status(motor).condition, Condition::Ready);
        }
    });
}

#[test]
fn a_slow_speed_is_sent_as_it_is_and_said_not_to_be_regulated() {
    armed(|bench, motor, esc| {
        hold(bench, motor, Target::Speed(Rpm::new(1000.0)), 800);
        for rpm in [100.0, 0.0_f32] {
            hold(bench, motor, Target::Speed(Rpm::new(rpm)), 20);
            assert_eq!(bench.status(motor).condition, Condition::Unregulated);
            assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Speed(f64::from(rpm) * 7.0));
        }
        hold(bench, motor, Target::Speed(Rpm::new(0.0)), 2000);
        near(esc.state().output_rpm, 0.0, 0.1);
        // It holds nothing.
        esc.set_load(0.2);
        hold(bench, motor, Target::Speed(Rpm::new(0.0)), 500);
        assert!(esc.state().output_degrees > 10.0);
        assert_eq!(bench.status(motor).condition, Condition::Unregulated);
        hold(bench, motor, Target::Speed(Rpm::new(129.0)), 1);
        assert_eq!(bench.status(motor).condition, Condition::Ready);
        bench.wait(60);
        assert_eq!(bench.status(motor).condition, Condition::Ready, "it may not run at all");
    });
}

#[test]
fn a_duty_turns_the_motor_in_proportion() {
    armed(|bench, motor, esc| {
        // It begins gently, from rest and from what the motor turns at.
        for duty in [0.3, -0.3] {
            for _ in 0..200 {
                let before = esc.state().current;
                hold(bench, motor, Target::Duty(duty), 1);
                let grown = (esc.state().current - before).abs();
                assert!(grown < 5.0, "{grown} A in a millisecond");
            }
            hold(bench, motor, Target::Coast, 20);
        }
        // 24 V and 270 rpm/V, less what friction takes.
        for (duty, rpm) in [(0.3, 1944.0), (-0.3, -1944.0), (0.1, 648.0)] {
            hold(bench, motor, Target::Duty(duty), 1500);
            near(esc.state().output_rpm, rpm, 30.0);
            assert_told(bench, motor, esc, 2.0, 0.2);
        }
        assert!(bench.bus.command(motor, Target::Duty(f32::NAN), Micros::ZERO).is_err());
        hold(bench, motor, Target::Duty(-9.0), 20);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Duty(-1.0));
    });
}

#[test]
fn brake_and_handbrake_are_what_they_say() {
    armed(|bench, motor, esc| {
        hold(bench, motor, Target::Duty(0.3), 800);
        let before = esc.state().output_rpm;
        hold(bench, motor, Target::Brake(Amps::new(10.0)), 100);
        near(esc.state().current, -10.0, 0.1);
        assert!(esc.state().output_rpm < before - 100.0);
        hold(bench, motor, Target::Brake(Amps::new(20.0)), 1000);
        near(esc.state().output_rpm, 0.0, 1.0);
        near(esc.state().current, 0.0, 0.2);
        // A brake does not hold; a handbrake does.
        esc.set_load(0.2);
        let stood = esc.state().output_degrees;
        hold(bench, motor, Target::Brake(Amps::new(10.0)), 1000);
        assert!(esc.state().output_degrees > stood + 5.0);
        // It catches what nearly stands.
        esc.set_load(0.0);
        hold(bench, motor, Target::Brake(Amps::new(10.0)), 2000);
        hold(bench, motor, Target::Handbrake(Amps::new(20.0)), 1000);
        esc.set_load(0.2);
        // Within the field's turn, in which it swings.
        let stood = esc.state().output_degrees;
        for _ in 0..1000 {
            hold(bench, motor, Target::Handbrake(Amps::new(20.0)), 1);
            near(esc.state().output_degrees, stood, 360.0 / 7.0);
        }
        hold(bench, motor, Target::Coast, 20);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Released);
        for negative in [Target::Brake(Amps::new(-1.0)), Target::Handbrake(Amps::new(-1.0))] {
            let error = bench.bus.command(motor, negative, Micros::ZERO).unwrap_err();
            let range = TargetError::OutOfRange(negative.kind());
            assert_eq!(error, rc10_motor::CommandError::Target(range));
        }
    });
}

#[test]
fn an_angle_is_reached_by_the_device_only_where_its_encoder_sits_on_the_shaft() {
    let (mut ours, mut theirs) = (config(1), device(1));
    assert!(!supports(&ours).contains(TargetKind::Angle));
    for encoder in [&mut ours.encoder_on_shaft, &mut theirs.encoder_on_shaft] {
        *encoder = true;
    }
    (ours.status.status_4, theirs.status_hz[3]) = (200, 200);
    for direction in [Direction::Forward, Direction::Reversed] {
        ours.direction = direction;
        assert!(supports(&ours).contains(TargetKind::Angle));
        assert!(!supports(&ours).contains(TargetKind::TotalAngle));
        on_armed_bench(Vesc::new(ours).unwrap(), theirs, Safety::COAST, |bench, motor, esc| {
            let sign = if direction == Direction::Forward { 1.0 } else { -1.0 };
            // The shorter way round, told in degrees of any number.
            for (wanted, stands) in [(90.0, 90.0), (350.0, -10.0), (720.0 + 100.0, 100.0)] {
                hold(bench, motor, Target::Angle(Degrees::new(wanted)), 700);
                near(esc.state().output_degrees * sign, stands, 1.0);
                let told = bench.status(motor).feedback.angle.get();
                near(told.into(), stands.rem_euclid(360.0), 1.0);
            }
            assert_eq!(
                bench.bus.request(motor, Request::SetZeroOfDriven),
                Ok(rc10_motor::Response::Done)
            );
            bench.wait(1);
            let told = bench.status(motor).feedback.angle.get();
            assert!(!(1.0..359.0).contains(&told), "{told}");
            hold(bench, motor, Target::Angle(Degrees::new(45.0)), 700);
            near(esc.state().output_degrees * sign, 145.0, 1.5);
        });
    }
}

fn supports(config: &Config) -> rc10_motor::TargetSet {
    rc10_motor::Motor::supports(&Vesc::new(*config).unwrap())
}

fn lift() -> (Vesc, VescConfig) {
    let ours = Config { command_hz: 500, ..super::lift(1) };
    (Vesc::new(ours).unwrap(), VescConfig { plant: lift_plant(), ..device(1) })
}

#[test]
fn a_servo_reaches_many_turns_under_load_and_holds() {
    let (ours, theirs) = lift();
    on_armed_bench(ours, theirs, Safety::HOLD, |bench, motor, esc| {
        let total = |degrees| Target::TotalAngle(TotalAngle::from_degrees(degrees));
        hold(bench, motor, total(720), 3000);
        // A step of the tachometer is 0.45 degrees here.
        near(esc.state().output_degrees, 720.0, 1.0);
        esc.set_load(-5.0);
        hold(bench, motor, total(0), 3500);
        near(esc.state().output_degrees, 0.0, 1.0);
        assert_eq!(bench.status(motor).condition, Condition::Ready);
        hold(bench, motor, Target::Angle(Degrees::new(-90.0)), 1500);
        near(esc.state().output_degrees, -90.0, 1.0);
        // Zero moves nothing, and counts from here on.
        assert!(bench.bus.request(motor, Request::SetZeroOfDriven).is_ok());
        hold(bench, motor, total(10), 1000);
        near(esc.state().output_degrees, -80.0, 1.0);
        // The same number again lies elsewhere.
        assert!(bench.bus.request(motor, Request::SetZeroOfDriven).is_ok());
        hold(bench, motor, total(10), 1000);
        near(esc.state().output_degrees, -70.0, 1.0);
        // And told to coast after a new zero it coasts.
        assert!(bench.bus.request(motor, Request::SetZeroOfDriven).is_ok());
        hold(bench, motor, Target::Coast, 20);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Released);
        esc.set_load(0.0);
        hold(bench, motor, Target::TotalAngle(TotalAngle::ZERO), 3000);
        near(esc.state().output_degrees, -70.0, 1.0);
        esc.set_load(-5.0);
        hold(bench, motor, Target::TotalAngle(TotalAngle::ZERO), 3000);
        // Commands have stopped: it stays, also while it is pushed.
        bench.wait(500);
        assert_eq!(bench.status(motor).drive, DriveMode::Hold);
        near(esc.state().output_degrees, -70.0, 1.5);
        assert!(bench.bus.request(motor, Request::SetZeroOfDriven).is_ok());
        esc.set_load(-8.0);
        bench.wait(3000);
        near(esc.state().output_degrees, -70.0, 1.5);
        // Where its angle is not told any more it is not left to fall: that would be 1600 rpm by
        // then. A field that does not catch it gives it some speed before it is braked again.
        let now = bench.world.now();
        inside(esc, |vesc| vesc.set_status_hz([200, 0, 0, 0, 0, 0], now));
        for _ in 0..2000 {
            bench.wait(1);
            assert!(esc.state().output_rpm > -60.0, "{}", esc.state().output_rpm);
        }
        let mode = inside(esc, |vesc| vesc.mode());
        assert!(matches!(mode, Mode::Brake(_) | Mode::Handbrake(_)), "{mode:?}");
    });
}

/// With loops that ask for all of its current at once.
fn hasty(config: Config) -> Vesc {
    let speed = PidConfig::within(40.0).kp(50.0);
    let cascade = Cascade { speed, acceleration: RpmPerSecond::new(4000.0), ..LIFT };
    Vesc::new(config.with_angle_loops(cascade)).unwrap()
}

#[test]
fn a_servo_keeps_to_the_limits() {
    let (ours, theirs) = lift();
    let mut config = *ours.config();
    config.currents = amps(4.0, 0.0, 0.0);
    let ours = hasty(config);
    on_armed_bench(ours, theirs, Safety::COAST, |bench, motor, esc| {
        let far = Target::TotalAngle(TotalAngle::from_degrees(7200));
        hold(bench, motor, far, 100);
        near(esc.state().current, 4.0, 0.1);
        let limit = Request::CurrentLimit(Amps::new(2.0));
        assert!(bench.bus.request(motor, limit).is_ok());
        hold(bench, motor, far, 100);
        near(esc.state().current, 2.0, 0.1);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Current(2.0));
    });
}

/// Also where a command is repeated every 5 ms.
#[test]
fn a_servo_starts_softly() {
    let (ours, theirs) = lift();
    let config = Config { command_hz: 200, ..*ours.config() };
    let ours = hasty(config);
    on_armed_bench(ours, theirs, Safety::COAST, |bench, motor, esc| {
        let mut strongest = 0.0_f64;
        for _ in 0..15 {
            let before = esc.state().current;
            hold(bench, motor, Target::TotalAngle(TotalAngle::from_degrees(7200)), 1);
            let grown = esc.state().current - before;
            assert!(grown < 0.15 * 40.0, "{grown} A in a millisecond");
            strongest = strongest.max(esc.state().current);
        }
        assert!(strongest > 30.0, "{strongest}");
    });
}

#[test]
fn a_servo_seeks_nothing_by_a_tachometer_that_has_stopped() {
    let (ours, theirs) = lift();
    on_armed_bench(ours, theirs, Safety::COAST, |bench, motor, esc| {
        let far = Target::TotalAngle(TotalAngle::from_degrees(7200));
        hold(bench, motor, far, 300);
        assert!(esc.state().current > 1.0);
        let now = bench.world.now();
        inside(esc, |vesc| vesc.set_status_hz([200, 0, 0, 0, 0, 0], now));
        hold(bench, motor, far, 50);
        near(esc.state().current, 0.0, 0.01);
        assert_eq!(bench.status(motor).condition, Condition::SlowFeedback);
        inside(esc, |vesc| vesc.set_status_hz([200, 0, 0, 0, 200, 0], now));
        hold(bench, motor, far, 300);
        assert!(esc.state().current > 0.2);
        assert_eq!(bench.status(motor).condition, Condition::Ready);
    });
}

#[test]
fn hold_slows_down_before_it_locks() {
    let motor = Vesc::new(config(1)).unwrap();
    on_armed_bench(motor, device(1), Safety::HOLD, |bench, motor, esc| {
        hold(bench, motor, Target::Speed(Rpm::new(1000.0)), 1000);
        bench.wait(100);
        assert_eq!(bench.status(motor).drive, DriveMode::Hold);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Brake(15.0));
        bench.wait(2000);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Handbrake(20.0));
        let stood = esc.state().output_degrees;
        for _ in 0..1000 {
            bench.wait(1);
            near(esc.state().output_degrees, stood, 370.0 / 7.0);
        }
        hold(bench, motor, Target::Speed(Rpm::new(1000.0)), 1500);
        near(esc.state().output_rpm, 1000.0, 50.0);
    });
}

/// A brake fades at low speed: under a weight the shaft sinks on. A still field that does not catch
/// it would let it fall.
#[test]
fn hold_lets_a_weight_sink_rather_than_fall() {
    for (load, locks) in [(-0.25, false), (-0.1, true)] {
        let motor = Vesc::new(config(1)).unwrap();
        // What is caught swings about the field until friction stops it.
        let mut theirs = device(1);
        theirs.plant.load_inertia = 0.0;
        (theirs.plant.coulomb_friction, theirs.plant.static_friction) = (0.05, 0.06);
        on_armed_bench(motor, theirs, Safety::HOLD, |bench, motor, esc| {
            hold(bench, motor, Target::Speed(Rpm::new(-1000.0)), 500);
            esc.set_load(load);
            bench.wait(500);
            for _ in 0..3000 {
                bench.wait(1);
                let rpm = esc.state().output_rpm;
                assert!(locks || rpm > -100.0, "{rpm}");
            }
            let locked = inside(esc, |vesc| vesc.mode()) == Mode::Handbrake(20.0);
            assert_eq!(locked, locks);
            let stood = esc.state().output_degrees;
            bench.wait(1000);
            let moved = (esc.state().output_degrees - stood).abs();
            assert_eq!(moved < 360.0 / 7.0, locks, "{moved}");
        });
    }
}

/// A shaft torn out of the field is braked until it can be caught again.
#[test]
fn hold_brakes_again_what_was_torn_loose() {
    let motor = Vesc::new(config(1)).unwrap();
    on_bench(motor, device(1), Safety::HOLD, |bench, motor, esc, switch| {
        switch.arm().unwrap();
        bench.wait(500);
        assert_eq!(bench.status(motor).drive, DriveMode::Hold);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Handbrake(20.0));
        esc.set_load(2.0);
        bench.wait(300);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Brake(15.0));
        esc.set_load(0.0);
        bench.wait(3000);
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Handbrake(20.0));
    });
}

#[test]
fn limits_are_kept_here_and_told_to_the_device_again_after_a_restart() {
    armed(|bench, motor, esc| {
        assert_eq!(inside(esc, |vesc| vesc.current_limits), (-40.0, 40.0));
        let limit = |amps| Request::CurrentLimit(Amps::new(amps));
        assert!(bench.bus.request(motor, limit(12.5)).is_ok());
        hold(bench, motor, Target::Current(Amps::new(30.0)), 50);
        assert_eq!(inside(esc, |vesc| vesc.current_limits), (-12.5, 12.5));
        assert_eq!(inside(esc, |vesc| vesc.mode()), Mode::Current(12.5));
        // So that a speed, which the device regulates, keeps to it too.
        hold(bench, motor, Target::Speed(Rpm::new(-2000.0)), 200);
        assert!(esc.state().current.abs() < 12.6);
        esc.set_power(false);
        bench.wait(100);
        esc.set_power(true);
        assert_eq!(inside(esc, |vesc| vesc.current_limits), (-40.0, 40.0));
        bench.wait(30);
        assert_eq!(inside(esc, |vesc| vesc.current_limits), (-12.5, 12.5));
        // Another program has told it another one; it is told ours again once a second.
        let (low, high) = (Amps::new(-40.0), Amps::new(40.0));
        let other = Setting::MotorCurrent { min: low, max: high }.pack(id(1)).unwrap();
        let mut lowest = 0;
        for _ in 0..2 {
            bench.wire.inject(&other);
            for _ in 0..1010 {
                bench.wait(1);
                lowest += u32::from(inside(esc, |vesc| vesc.current_limits) == (-12.5, 12.5));
            }
            assert_eq!(inside(esc, |vesc| vesc.current_limits), (-12.5, 12.5));
        }
        assert!(lowest < 1200, "told again {lowest} ms too early");
        // Never above what it was made with.
        assert!(bench.bus.request(motor, limit(1e9)).is_ok());
        bench.wait(10);
        assert_eq!(inside(esc, |vesc| vesc.current_limits), (-40.0, 40.0));
        for bad in [-1.0, f32::NAN] {
            assert!(matches!(bench.bus.request(motor, limit(bad)), Err(RequestError::Config(_))));
        }
    });
}
