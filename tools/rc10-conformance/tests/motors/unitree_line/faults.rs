use rc10_app::{NewtonMetres, Rpm};
use rc10_motor::unitree::LineConfig;
use rc10_motor::{DriveMode, Impedance, Link, Request, RequestError, Response, Safety, Target};
use rc10_sim::EscFault;
use rc10_sim::unitree_line::{GoM8010 as Device, plant};

use super::bench::{Bench, obeys};

const SPEED: Target = Target::Speed(Rpm::new(60.0));

#[test]
fn each_fault_has_its_code_and_text_and_cannot_be_cleared_while_it_lasts() {
    for (fault, code, text) in [
        (EscFault::OverTemperature, 1, "over-temperature"),
        (EscFault::OverCurrent, 2, "over-current"),
        (EscFault::OverVoltage, 3, "over-voltage"),
        (EscFault::Encoder, 4, "encoder"),
    ] {
        let (mut bench, id, device) = Bench::armed(LineConfig::new(6), plant(), Safety::BRAKE);
        bench.hold(id, SPEED, 300);
        assert!(device.inject(fault));
        bench.hold(id, SPEED, 3);
        let status = bench.status(id);
        let told = status.fault.unwrap();
        assert_eq!((told.code, told.text), (code, text));
        assert_eq!((status.link, status.drive), (Link::Online, DriveMode::Brake));
        assert_eq!((obeys(&device).status, obeys(&device).torque), (0, 0.0));
        assert!(device.state().open);

        // Still there: the device refuses.
        assert_eq!(bench.bus.request(id, Request::ClearFault), Ok(Response::Pending));
        bench.hold(id, SPEED, 3);
        assert_eq!(bench.bus.response(id), Some(Err(RequestError::Refused(code))));
        bench.hold(id, SPEED, 50);
        assert_eq!(bench.status(id).drive, DriveMode::Brake);
    }
}

#[test]
fn a_motor_that_gets_too_hot_protects_itself_and_says_so() {
    let plant = rc10_sim::Plant {
        ambient: 85.0,
        static_friction: 1e3,
        coulomb_friction: 1e3,
        thermal_time_constant: 1.0,
        ..plant()
    };
    let (mut bench, id, device) = Bench::armed(LineConfig::new(0), plant, Safety::COAST);
    let torque = Target::Torque(NewtonMetres::new(8.0));
    for _ in 0..2000 {
        bench.hold(id, torque, 1);
        if bench.status(id).fault.is_some() {
            break;
        }
    }
    let status = bench.status(id);
    assert_eq!(status.fault.map(|fault| fault.text), Some("over-temperature"));
    assert!((status.feedback.temperature().unwrap().get() - 90.0).abs() < 1.0);
    bench.hold(id, torque, 5);
    assert!(device.state().current.abs() < 0.01);
}

/// Numbers for a target from a counter: no chance needed.
fn strange(step: u32) -> Target {
    let numbers = [0.0, -1.0, 1e9, f32::MAX, -f32::MAX, f32::NAN, f32::INFINITY, 37.5];
    let pick = |shift: u32| numbers[(step >> shift) as usize % numbers.len()];
    match step % 4 {
        0 => Target::Speed(Rpm::new(pick(2))),
        1 => Target::Torque(NewtonMetres::new(pick(2))),
        2 => Target::Angle(rc10_app::Degrees::new(pick(2))),
        _ => Target::Impedance(Impedance {
            angle: rc10_app::Degrees::new(pick(2)),
            speed: Rpm::new(pick(5)),
            torque: NewtonMetres::new(pick(4)),
            kp: pick(3).abs(),
            kd: pick(6).abs(),
        }),
    }
}

#[test]
fn whatever_is_commanded_the_device_is_never_told_to_calibrate() {
    let (mut bench, id, device) = Bench::armed(LineConfig::new(0), plant(), Safety::HOLD);
    for step in 0..3000 {
        let now = bench.world.now();
        let _ = bench.bus.command(id, strange(step), now);
        bench.tick();
        let told = bench.told(0);
        assert!(told.status <= 1 && told.torque.abs() <= 23.71 / 6.33, "{told:?}");
        let rest = [told.speed, told.angle, told.stiffness, told.damping];
        assert!(rest.iter().all(|number| number.is_finite()));
    }
    assert_eq!(device.with(|device: &mut Device| device.is_calibrating()), Some(false));
    assert_eq!(device.state().malformed, 0);
    assert!(bench.status(id).feedback.speed.is_finite());
}
