//! The robot in simulation: it does what the sticks say, and stops when they are not heard.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use omni::{Motors, Name, Ports, Shared, simulation};
use rc10_can::Micros;
use rc10_cli::recording::Recording;
use rc10_cli::simulate::simulate;
use rc10_motor::{Link, Names};

fn run(fault: Option<&str>, millis: u64) -> Recording {
    let ports = Ports::new();
    let (shared, mut motors) = (Shared::new(&ports), Motors::new());
    let mut robot = simulation::robot(&shared, &mut motors).unwrap();
    let faults: Vec<_> = fault.iter().map(|fault| fault.parse().unwrap()).collect();
    robot.set_faults(&faults).unwrap();
    simulate(robot, 1, Micros::from_millis(millis)).unwrap()
}

#[test]
fn it_does_what_the_sticks_say() {
    let run = run(None, 4000);
    let sample = |name: Name, millis: usize| run.motors[name.index()].samples[millis / 10 - 1];
    #[expect(clippy::cast_possible_truncation, reason = "a speed")]
    let motion = |millis| {
        let rpm = |name| rc10_motor::rc10_app::Rpm::new(sample(name, millis).rpm as f32);
        omni::table::BASE.forward(omni::table::WHEELS.map(rpm)).twist
    };
    for (millis, [forward, left, turn]) in
        [(950, [1.0, 0.0, 0.0]), (1750, [0.0, 1.0, 0.0]), (2550, [0.0, 0.0, 2.0])]
    {
        let real = motion(millis);
        let off = [real.vx - forward, real.vy - left, real.wz - turn].map(f32::abs);
        assert!(off.iter().all(|off| *off < 0.06), "at {millis} ms: {real:?}");
    }
    let arm = sample(Name::Arm, 2900).measured;
    assert!((arm - 72.0).abs() < 3.0, "0.8 s at 90 degrees per second: {arm}");
    let turret = [3000, 3600].map(|millis| sample(Name::Turret, millis).measured);
    let turned = (turret[0] - turret[1]).rem_euclid(360.0);
    assert!((turned - 54.0).abs() < 5.0, "0.6 s at half of 180 degrees per second: {turned}");
    let flywheel = sample(Name::Flywheel, 3900).rpm;
    // Its own speed controller overshoots, and takes seconds to settle: `s_pid_ki` as it is sold.
    assert!((flywheel - 1500.0).abs() < 30.0, "{flywheel}");
    assert!(run.motors.iter().all(|track| track.last.link == Link::Online));
    assert!(run.buses.iter().all(|bus| bus.last.refused + bus.last.replaced == 0));
}

#[test]
fn a_lost_remote_stops_it() {
    let run = run(Some("remote-lost@1.5s"), 3000);
    for name in Name::ALL {
        let last = run.motors[name.index()].samples.last().unwrap();
        assert!(last.current.abs() < 0.05, "{name:?}: {} A", last.current);
    }
}
