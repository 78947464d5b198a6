use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::{GoM8010, LineConfig};
use rc10_motor::{
    ArmSwitch, Condition, DriveMode, Impedance, Link, Request, Response, Safety, Target,
    TargetError, TargetKind,
};
use rc10_sim::unitree_line::plant;
use rc10_sim::{Esc, Plant, Scale};

use super::bench::{Bench, obeys};

/// A shaft that nothing turns.
fn blocked() -> Plant {
    Plant { static_friction: 1e6, coulomb_friction: 1e6, ..plant() }
}

fn torque(device: &Esc) -> f64 {
    device.state().torque
}

#[test]
fn a_speed_is_reached() {
    for scale in [0.7, 1.0, 1.3] {
        let switch = ArmSwitch::new();
        let mut motor = GoM8010::new(LineConfig::new(3)).unwrap();
        let mut bench = Bench::new(1, &switch);
        let scale = Scale { inertia: scale, friction: scale, torque_constant: 1.0 };
        let device = bench.device_with(3, plant().scaled(scale));
        let motor = bench.line.attach(&mut motor, Safety::COAST).unwrap();
        bench.wait(5);
        switch.arm().unwrap();
        bench.hold(motor, Target::Speed(Rpm::new(120.0)), 1);
        assert_eq!(bench.status(motor).condition, Condition::Starting);
        bench.hold(motor, Target::Speed(Rpm::new(120.0)), 249);
        let rpm = device.state().output_rpm;
        assert!((rpm - 120.0).abs() < 3.0, "after 250 ms: {rpm}");
        bench.hold(motor, Target::Speed(Rpm::new(120.0)), 450);
        let rpm = device.state().output_rpm;
        assert!((rpm - 120.0).abs() < 0.5, "after 700 ms: {rpm}");
        let status = bench.status(motor);
        assert!((f64::from(status.feedback.speed.get()) - rpm).abs() < 0.2);
        assert_eq!((status.link, status.condition), (Link::Online, Condition::Ready));
        bench.hold(motor, Target::Speed(Rpm::new(-120.0)), 600);
        assert!((device.state().output_rpm + 120.0).abs() < 1.0);
    }
}

#[test]
fn an_angle_is_reached_and_zero_is_ours() {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
    let mut bench = Bench::new(2, &switch);
    let device = bench.device(0);
    let motor = bench.line.attach(&mut motor, Safety::HOLD).unwrap();
    assert!(bench.line.request(motor, Request::SetZeroOfDriven).is_err(), "nothing measured yet");
    bench.wait(5);
    assert_eq!(bench.line.request(motor, Request::SetZeroOfDriven), Ok(Response::Done));
    switch.arm().unwrap();
    let start = device.state().output_degrees;
    let turned = || device.state().output_degrees - start;

    bench.hold(motor, Target::Angle(Degrees::new(90.0)), 1600);
    assert!((turned() - 90.0).abs() < 0.5, "{}", turned());
    bench.hold(motor, Target::TotalAngle(TotalAngle::from_degrees(-720)), 3000);
    assert!((turned() + 720.0).abs() < 0.5, "{}", turned());
    let feedback = bench.status(motor).feedback;
    assert!((f64::from(feedback.total_angle.degrees().get()) - turned()).abs() < 0.1);
    // The shorter way round: 350 is 10 back.
    bench.hold(motor, Target::Angle(Degrees::new(350.0)), 800);
    assert!((turned() + 730.0).abs() < 0.5, "{}", turned());
    // Zero moves nothing that is sought or held; the same number commanded anew lies elsewhere.
    bench.hold(motor, Target::TotalAngle(TotalAngle::from_degrees(-730)), 300);
    assert_eq!(bench.line.request(motor, Request::SetZeroOfDriven), Ok(Response::Done));
    bench.wait(40);
    assert_eq!(bench.status(motor).drive, DriveMode::Run);
    assert!((turned() + 730.0).abs() < 0.5, "{}", turned());
    bench.wait(100);
    assert_eq!(bench.status(motor).drive, DriveMode::Hold);
    assert_eq!(bench.line.request(motor, Request::SetZeroOfDriven), Ok(Response::Done));
    bench.wait(200);
    assert!((turned() + 730.0).abs() < 0.5, "{}", turned());
    bench.hold(motor, Target::TotalAngle(TotalAngle::from_degrees(0)), 300);
    assert!((turned() + 730.0).abs() < 0.7, "{}", turned());
}

#[test]
fn a_torque_is_what_the_shaft_gets_whichever_way_it_counts() {
    for (direction, sign) in [(Direction::Forward, 1.0), (Direction::Reversed, -1.0)] {
        let switch = ArmSwitch::new();
        let mut motor = GoM8010::new(LineConfig::new(14).with_direction(direction)).unwrap();
        let mut bench = Bench::new(3, &switch);
        let device = bench.device_with(14, blocked());
        let motor = bench.line.attach(&mut motor, Safety::COAST).unwrap();
        bench.wait(5);
        switch.arm().unwrap();
        bench.hold(motor, Target::Torque(NewtonMetres::new(6.0)), 60);
        assert!((torque(&device) - 6.0 * sign).abs() < 0.03, "{}", torque(&device));
        let told = bench.status(motor).feedback.torque().unwrap();
        assert!((told.get() - 6.0).abs() < 0.03, "{told:?}");
        // No more than the motor has, nor than somebody said.
        bench.hold(motor, Target::Torque(NewtonMetres::new(f32::MAX)), 60);
        assert!((torque(&device) - 23.7 * sign).abs() < 0.05, "{}", torque(&device));
        let limit = Request::TorqueLimit(NewtonMetres::new(2.0));
        assert_eq!(bench.line.request(motor, limit), Ok(Response::Done));
        bench.hold(motor, Target::Torque(NewtonMetres::new(-9.0)), 60);
        assert!((torque(&device) + 2.0 * sign).abs() < 0.03, "{}", torque(&device));
    }
}

#[test]
fn an_impedance_is_the_device_s_own_law() {
    for (direction, sign) in [(Direction::Forward, 1.0), (Direction::Reversed, -1.0)] {
        let switch = ArmSwitch::new();
        let mut motor = GoM8010::new(LineConfig::new(1).with_direction(direction)).unwrap();
        let mut bench = Bench::new(4, &switch);
        let device = bench.device_with(1, blocked());
        let motor = bench.line.attach(&mut motor, Safety::COAST).unwrap();
        bench.wait(5);
        bench.line.request(motor, Request::SetZeroOfDriven).unwrap();
        switch.arm().unwrap();
        let pull = Impedance {
            angle: Degrees::new(30.0),
            torque: NewtonMetres::new(-1.0),
            kp: 8.0,
            kd: 0.5,
            ..Impedance::default()
        };
        bench.hold(motor, Target::Impedance(pull), 60);
        let law = sign * (8.0 * 30.0_f64.to_radians() - 1.0);
        assert!((torque(&device) - law).abs() < 0.05, "{} {law}", torque(&device));
        assert_eq!(bench.status(motor).target, Target::Impedance(pull));
        // At the rotor: through a gearbox of 6.33, stiffness by its square.
        let told = obeys(&device);
        assert!((told.stiffness - 8.0 / 6.33 / 6.33).abs() < 1e-3, "{told:?}");
        assert!((told.damping - 0.5 / 6.33 / 6.33).abs() < 1e-3, "{told:?}");
        // A limit takes back all of it.
        let limit = Request::TorqueLimit(NewtonMetres::new(1.5));
        assert_eq!(bench.line.request(motor, limit), Ok(Response::Done));
        bench.hold(motor, Target::Impedance(pull), 60);
        assert!((torque(&device) - 1.5 * sign).abs() < 0.05, "{}", torque(&device));

        let negative = Target::Impedance(Impedance { kp: -1.0, ..pull });
        let now = bench.world.now();
        let error = bench.line.command(motor, negative, now).unwrap_err();
        let out = TargetError::OutOfRange(TargetKind::Impedance);
        assert_eq!(error, rc10_motor::CommandError::Target(out));
    }
}

#[test]
fn an_impedance_moves_the_shaft_to_where_it_pulls() {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(1)).unwrap();
    let mut bench = Bench::new(5, &switch);
    let device = bench.device(1);
    let motor = bench.line.attach(&mut motor, Safety::COAST).unwrap();
    bench.wait(5);
    bench.line.request(motor, Request::SetZeroOfDriven).unwrap();
    let start = device.state().output_degrees;
    switch.arm().unwrap();
    let angle = Degrees::new(400.0);
    let pull = Impedance { angle, kp: 10.0, kd: 0.4, ..Impedance::default() };
    bench.hold(motor, Target::Impedance(pull), 600);
    let turned = device.state().output_degrees - start;
    // What is left is friction: 0.1 N m by 10 N m/rad.
    assert!((turned - 400.0).abs() < 0.7, "{turned}");
    // Zero set there: it pulls where it pulled.
    bench.line.request(motor, Request::SetZeroOfDriven).unwrap();
    bench.wait(30);
    assert!((device.state().output_degrees - start - 400.0).abs() < 0.7);
    assert_eq!(bench.status(motor).drive, DriveMode::Run);
}
