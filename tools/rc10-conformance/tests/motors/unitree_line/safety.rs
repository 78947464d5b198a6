use rc10_app::{NewtonMetres, Rpm};
use rc10_motor::unitree::{LineConfig, Rs485Bus};
use rc10_motor::{
    CommandError, DriveMode, Link, MotorId, Request, RequestError, Response, Safety, Target,
    TargetError, TargetKind,
};
use rc10_sim::unitree_line::plant;
use rc10_sim::{Esc, Nanos};
use rc10_time::Micros;

use super::bench::{Bench, nth, obeys};

const SPEED: Target = Target::Speed(Rpm::new(100.0));

/// One motor on a line, armed and turning at 100 rpm.
fn turning(safety: Safety) -> (Bench<'static>, MotorId, Esc) {
    let (mut bench, id, device) = Bench::armed(LineConfig::new(0), plant(), safety);
    bench.hold(id, SPEED, 400);
    assert!((device.state().output_rpm - 100.0).abs() < 0.5);
    (bench, id, device)
}

#[test]
fn a_lost_motor_hears_nothing_but_its_safe_word() {
    let (mut bench, id, device) = turning(Safety::HOLD);
    // It obeys, but is not heard.
    device.set_feedback(false);
    bench.hold(id, SPEED, 22);
    assert_eq!((bench.status(id).link, bench.status(id).drive), (Link::Lost, DriveMode::Coast));
    assert_eq!(bench.status(id).counters.lost, 1);
    // It is told at once, and then ten times a second.
    bench.hold(id, SPEED, 1);
    assert_eq!((obeys(&device).status, obeys(&device).torque), (1, 0.0));
    bench.hold(id, SPEED, 300);
    let told = bench.told(0);
    assert_eq!((told.status, told.torque, told.stiffness, told.damping), (1, 0.0, 0.0, 0.0));
    device.set_feedback(true);
    bench.hold(id, SPEED, 500);
    // The whole cable: the device gives up by itself, and locks.
    bench.wire.set_cut(true);
    bench.hold(id, SPEED, 400);
    assert_eq!(obeys(&device).status, 0);
}

#[test]
fn requests_and_refusals() {
    let (mut bench, ids, devices) = Bench::of(1, Safety::COAST);
    devices[0].set_power(false);
    let (id, absent) = (ids[0], nth(1));
    let now = bench.world.now();
    assert_eq!(bench.bus.command(absent, SPEED, now), Err(CommandError::NoSuchMotor));
    assert_eq!(bench.bus.request(absent, Request::SetZeroOfDriven), Err(RequestError::NoSuchMotor));
    assert_eq!(bench.bus.response(absent), None);
    assert_eq!(bench.bus.status(absent, now), None);
    let current = Target::Current(rc10_app::Amps::new(1.0));
    let refused = TargetError::Unsupported(TargetKind::Current);
    assert_eq!(bench.bus.command(id, current, now), Err(CommandError::Target(refused)));
    let nan = Target::Torque(NewtonMetres::new(f32::NAN));
    let refused = TargetError::NotFinite(TargetKind::Torque);
    assert_eq!(bench.bus.command(id, nan, now), Err(CommandError::Target(refused)));
    assert_eq!(bench.status(id).counters.refused.total(), 2);
    for request in [Request::StoreZero, Request::ReadRegister(1), Request::SaveRegisters] {
        assert_eq!(bench.bus.request(id, request), Err(RequestError::Unsupported));
    }
    // The device has no power.
    assert_eq!(bench.bus.request(id, Request::ClearFault), Ok(Response::Pending));
    assert_eq!(bench.bus.request(id, Request::SetZeroOfDriven), Err(RequestError::Busy));
    bench.wait(240);
    assert_eq!(bench.bus.response(id), None);
    bench.wait(20);
    assert_eq!(bench.bus.response(id), Some(Err(RequestError::Timeout)));
    assert_eq!(bench.bus.response(id), None);
}

#[test]
fn after_a_pause_nothing_old_holds() {
    let (mut bench, id, device) = turning(Safety::COAST);
    // The processor stood still for two seconds: no ticks, no polls.
    let now = bench.world.now() + Micros::from_millis(2000);
    bench.world.advance(now);
    assert_eq!(obeys(&device).status, 0, "the device has given up");
    bench.tick();
    assert_ne!(bench.status(id).drive, DriveMode::Run);
    assert_eq!(bench.status(id).link, Link::Lost);
}

#[test]
fn the_coast_image_frees_all_of_them_in_whatever_state() {
    let (mut bench, ids, devices) = Bench::of(3, Safety::HOLD);
    bench.wait(20);
    bench.bus.switch().arm().unwrap();
    bench.hold_all(&ids, Target::Torque(NewtonMetres::new(2.0)), 50);
    assert!(devices.iter().all(|device| device.state().current > 3.0));
    // In the middle of an exchange.
    let mut port = bench.wire.port();
    port.send(&Rs485Bus::coast_image());
    port.send(&Rs485Bus::coast_image());
    let later = bench.world.now_ns() + Nanos::new(3_000_000);
    bench.world.advance_to(later);
    for device in &devices {
        assert!(device.state().current.abs() < 0.1, "{:?}", device.state());
        assert_eq!(obeys(device).status, 1);
    }
}
