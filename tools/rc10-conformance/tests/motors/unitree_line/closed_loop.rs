use rc10_app::{Degrees, NewtonMetres, Rpm};
use rc10_motor::rc10_app::Direction;
use rc10_motor::unitree::LineConfig;
use rc10_motor::{
    Condition, Impedance, Link, Request, Response, Safety, Target, TargetError, TargetKind,
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
        let scale = Scale { inertia: scale, friction: scale, torque_constant: 1.0 };
        let plant = plant().scaled(scale);
        let (mut bench, motor, device) = Bench::armed(LineConfig::new(3), plant, Safety::COAST);
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
fn an_impedance_is_the_device_s_own_law() {
    for (direction, sign) in [(Direction::Forward, 1.0), (Direction::Reversed, -1.0)] {
        let config = LineConfig::new(1).with_direction(direction);
        let (mut bench, motor, device) = Bench::armed(config, blocked(), Safety::COAST);
        bench.bus.request(motor, Request::SetZeroOfDriven).unwrap();
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
        assert_eq!(bench.bus.request(motor, limit), Ok(Response::Done));
        bench.hold(motor, Target::Impedance(pull), 60);
        assert!((torque(&device) - 1.5 * sign).abs() < 0.05, "{}", torque(&device));

        let negative = Target::Impedance(Impedance { kp: -1.0, ..pull });
        let now = bench.world.now();
        let error = bench.bus.command(motor, negative, now).unwrap_err();
        let out = TargetError::OutOfRange(TargetKind::Impedance);
        assert_eq!(error, rc10_motor::CommandError::Target(out));
    }
}
