use rc10_app::{Degrees, NewtonMetres, Rpm};
use rc10_can::Micros;
use rc10_motor::unitree::{GoM8010, LineConfig, Rs485Bus};
use rc10_motor::{
    ArmSwitch, CommandError, DriveMode, Impedance, Link, Request, RequestError, Response,
    SafeState, Safety, Target, TargetError, TargetKind,
};
use rc10_sim::Nanos;

use super::bench::{Bench, nth, obeys};

const SPEED: Target = Target::Speed(Rpm::new(100.0));

/// One motor on a line, armed and turning at 100 rpm.
fn turning<'m>(
    switch: &'m ArmSwitch,
    motor: &'m mut GoM8010,
    state: SafeState,
) -> (Bench<'m>, rc10_sim::Esc, rc10_motor::MotorId) {
    let mut bench = Bench::new(20, switch);
    let device = bench.device(0);
    let id = bench.line.attach(motor, Safety::new(state)).unwrap();
    bench.wait(5);
    switch.arm().unwrap();
    bench.hold(id, SPEED, 400);
    assert!((device.state().output_rpm - 100.0).abs() < 0.5);
    (bench, device, id)
}

#[test]
fn disarmed_it_is_locked_and_heard() {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
    let mut bench = Bench::new(21, &switch);
    let device = bench.device(0);
    let id = bench.line.attach(&mut motor, Safety::COAST).unwrap();
    bench.hold(id, SPEED, 100);
    assert_eq!(bench.status(id).link, Link::Online);
    assert_eq!(bench.status(id).drive, DriveMode::Off);
    assert_eq!((obeys(&device).status, obeys(&device).torque), (0, 0.0));
    assert_eq!(device.state().output_rpm, 0.0);
    assert!(device.state().commands >= 98);
}

#[test]
fn a_command_expires_into_the_safe_state() {
    for state in [SafeState::Coast, SafeState::Brake, SafeState::Hold] {
        let switch = ArmSwitch::new();
        let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
        let (mut bench, device, id) = turning(&switch, &mut motor, state);
        bench.wait(48);
        assert_eq!(bench.status(id).drive, DriveMode::Run);
        bench.wait(2);
        assert_eq!((bench.status(id).drive, bench.status(id).counters.expired), (state.mode(), 1));
        bench.wait(300);
        let rpm = device.state().output_rpm;
        match state {
            // Field-oriented control, and nothing to do: friction alone.
            SafeState::Coast => {
                assert!(rpm > 10.0, "{rpm}");
                assert_eq!((obeys(&device).status, obeys(&device).torque), (1, 0.0));
                assert_eq!((obeys(&device).stiffness, obeys(&device).damping), (0.0, 0.0));
            }
            SafeState::Brake => assert!(rpm.abs() < 1.0, "{rpm}"),
            SafeState::Hold => {
                assert!(rpm.abs() < 1.0, "{rpm}");
                let here = device.state().output_degrees;
                device.set_load(4.0);
                bench.wait(1000);
                let moved = device.state().output_degrees - here;
                assert!(moved.abs() < 2.0, "{moved}");
            }
        }
        // And back, without a jump.
        device.set_load(0.0);
        bench.hold(id, SPEED, 1000);
        assert!((device.state().output_rpm - 100.0).abs() < 0.5);
    }
}

#[test]
fn emergency_stop_and_disarming() {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
    let (mut bench, device, id) = turning(&switch, &mut motor, SafeState::Brake);
    switch.emergency_stop();
    bench.hold(id, SPEED, 300);
    assert_eq!(bench.status(id).drive, DriveMode::Brake);
    assert!(device.state().output_rpm.abs() < 1.0);
    switch.reset();
    bench.hold(id, SPEED, 20);
    assert_eq!((bench.status(id).drive, obeys(&device).status), (DriveMode::Off, 0));
    switch.arm().unwrap();
    bench.hold(id, SPEED, 400);
    assert!((device.state().output_rpm - 100.0).abs() < 0.5);
    switch.disarm();
    bench.hold(id, SPEED, 3);
    assert_eq!((bench.status(id).drive, obeys(&device).status), (DriveMode::Off, 0));
}

#[test]
fn a_lost_motor_hears_nothing_but_its_safe_word() {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
    let (mut bench, device, id) = turning(&switch, &mut motor, SafeState::Hold);
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
    assert_eq!(bench.status(id).link, Link::Online);
    assert!((device.state().output_rpm - 100.0).abs() < 0.5);
    // The whole cable.
    bench.wire.set_cut(true);
    bench.hold(id, SPEED, 400);
    assert_eq!(bench.status(id).link, Link::Lost);
    // The device gave up by itself, and locked.
    assert_eq!(obeys(&device).status, 0);
    bench.wire.set_cut(false);
    bench.hold(id, SPEED, 600);
    assert!((device.state().output_rpm - 100.0).abs() < 0.5);
}

/// What happens to the current, millisecond by millisecond, when a motor that has been without
/// power while somebody turned its shaft comes back.
fn comes_back(target: Target) -> (Vec<f64>, f64) {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
    let mut bench = Bench::new(22, &switch);
    let device = bench.device(0);
    let id = bench.line.attach(&mut motor, Safety::HOLD).unwrap();
    bench.wait(5);
    bench.line.request(id, Request::SetZeroOfDriven).unwrap();
    switch.arm().unwrap();
    bench.hold(id, target, 500);
    device.set_power(false);
    device.set_load(0.5);
    bench.hold(id, target, 150);
    device.set_load(0.0);
    bench.hold(id, target, 800);
    assert_eq!(bench.status(id).link, Link::Lost);
    let moved = device.state().output_degrees;
    device.set_power(true);
    let currents = (0..400).map(|_| {
        bench.hold(id, target, 1);
        device.state().current
    });
    let currents: Vec<_> = currents.collect();
    assert_eq!(bench.status(id).link, Link::Online);
    // It only knows its rotor's angle now, and we say so.
    assert_eq!(bench.status(id).feedback.turn_gaps, 1);
    (currents, moved)
}

#[test]
fn it_comes_back_from_power_off_without_a_kick() {
    let spring = Impedance { kp: 40.0, kd: 0.5, angle: Degrees::new(20.0), ..Impedance::default() };
    for target in [SPEED, Target::Angle(Degrees::new(20.0)), Target::Impedance(spring)] {
        let (currents, moved) = comes_back(target);
        assert!(moved.abs() > 30.0, "{moved}");
        let torques: Vec<_> = currents.iter().map(|amps| amps * 0.638_95).collect();
        // 10 % of 23.7 N m each millisecond at most.
        for pair in torques.windows(2) {
            assert!((pair[1] - pair[0]).abs() < 2.37 + 0.3, "{target:?} {pair:?}");
        }
        assert!(torques.iter().any(|torque| torque.abs() > 0.3), "{target:?}: it drives again");
    }
}

#[test]
fn requests_and_refusals() {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
    let mut bench = Bench::new(23, &switch);
    let id = bench.line.attach(&mut motor, Safety::COAST).unwrap();
    let nobody = nth(1);
    let now = bench.world.now();
    assert_eq!(bench.line.command(nobody, SPEED, now), Err(CommandError::NoSuchMotor));
    assert_eq!(
        bench.line.request(nobody, Request::SetZeroOfDriven),
        Err(RequestError::NoSuchMotor)
    );
    assert_eq!(bench.line.response(nobody), None);
    assert_eq!(bench.line.status(nobody, now), None);
    let current = Target::Current(rc10_app::Amps::new(1.0));
    let refused = TargetError::Unsupported(TargetKind::Current);
    assert_eq!(bench.line.command(id, current, now), Err(CommandError::Target(refused)));
    let nan = Target::Torque(NewtonMetres::new(f32::NAN));
    let refused = TargetError::NotFinite(TargetKind::Torque);
    assert_eq!(bench.line.command(id, nan, now), Err(CommandError::Target(refused)));
    assert_eq!(bench.status(id).counters.refused.total(), 2);
    for request in [Request::StoreZero, Request::ReadRegister(1), Request::SaveRegisters] {
        assert_eq!(bench.line.request(id, request), Err(RequestError::Unsupported));
    }
    // There is no device at all.
    assert_eq!(bench.line.request(id, Request::ClearFault), Ok(Response::Pending));
    assert_eq!(bench.line.request(id, Request::SetZeroOfDriven), Err(RequestError::Busy));
    bench.wait(240);
    assert_eq!(bench.line.response(id), None);
    bench.wait(20);
    assert_eq!(bench.line.response(id), Some(Err(RequestError::Timeout)));
    assert_eq!(bench.line.response(id), None);
}

#[test]
fn after_a_pause_nothing_old_holds() {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
    let (mut bench, device, id) = turning(&switch, &mut motor, SafeState::Coast);
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
    let switch = ArmSwitch::new();
    let mut ours = super::bench::motors(3);
    let mut bench = Bench::new(24, &switch);
    let devices: Vec<_> = (0..3).map(|id| bench.device(id)).collect();
    let ids: Vec<_> =
        ours.iter_mut().map(|motor| bench.line.attach(motor, Safety::HOLD).unwrap()).collect();
    bench.wait(20);
    switch.arm().unwrap();
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
