//! Stopping the robot, and the time it takes: measured on simulated buses.

use crate::common::{Bench, motor, twin};
use rc10_app::{Amps, Rpm, TotalAngle};
use rc10_cli::world::environment::Environment;
use rc10_motor::dji::{self, Dji, FeedbackRate, Model};
use rc10_motor::{ArmSwitch, DriveMode, Link, Names, Safety, Target};
use rc10_time::Micros;
use team::table::{LIFT, Name};
use team::{Motors, Shared};

const MODELS: [&Model; 4] = [&dji::M3508, &dji::M2006, &dji::GM6020_CURRENT, &dji::GM6020_VOLTAGE];

/// Runs a motor at speed, then silences it: after how many milliseconds is it lost, and is it safe?
fn lost_after(model: &'static Model, rate: FeedbackRate, seed: u64) -> u32 {
    let switch = ArmSwitch::new();
    let config = dji::Config::new(model, 1).with_feedback_rate(rate);
    let mut ours = Dji::new(config).unwrap();
    let mut device = twin(model, 1);
    device.rate = match rate {
        FeedbackRate::Hz125 => rc10_sim::FeedbackRate::Hz125,
        _ => rc10_sim::FeedbackRate::Hz1000,
    };
    let mut bench = Bench::new(seed, &switch);
    let (id, esc) = bench.add(&mut ours, Safety::COAST, device);
    assert_eq!(bench.status(id).link, Link::NeverSeen);
    switch.arm().unwrap();
    let target = Target::Speed(Rpm::new(60.0));
    bench.hold(id, target, 500);
    assert_eq!((bench.status(id).link, bench.status(id).drive), (Link::Online, DriveMode::Run));
    assert_ne!(esc.state().command, 0);
    esc.set_feedback(false);
    for millis in 1..100 {
        bench.hold(id, target, 1);
        if bench.status(id).link == Link::Lost {
            // The very tick that finds it lost sends zero; the ESC obeys within the millisecond.
            assert_eq!(bench.tx.frames()[0].bytes(), [0; 8]);
            bench.tick();
            assert_eq!(esc.state().command, 0);
            return millis;
        }
    }
    panic!("{} was never lost", model.name);
}

#[test]
fn an_unplugged_motor_is_lost_within_three_periods_or_ten_milliseconds() {
    for model in MODELS {
        for seed in 0..10 {
            // One tick more, for the tick that notices.
            assert!(lost_after(model, FeedbackRate::Hz1000, seed) <= 11);
        }
    }
    for seed in 0..10 {
        let millis = lost_after(&dji::M3508, FeedbackRate::Hz125, seed);
        assert!((17..=25).contains(&millis), "{millis}");
    }
}

/// Unplugged for a second at speed, under load: when it comes back it starts from where it is.
#[test]
fn a_motor_that_comes_back_is_picked_up_gently() {
    for (model, rpm) in MODELS.into_iter().zip([200.0, 200.0, 60.0, 60.0]) {
        for seed in 0..5 {
            let switch = ArmSwitch::new();
            let mut ours = motor(model, 1);
            let mut device = twin(model, 1);
            device.plant = device.plant.with_load_inertia(0.02);
            let mut bench = Bench::new(seed, &switch);
            let (id, esc) = bench.add(&mut ours, Safety::COAST, device);
            switch.arm().unwrap();
            let target = Target::Speed(Rpm::new(rpm));
            bench.hold(id, target, 1500);
            esc.set_power(false);
            bench.hold(id, target, 300);
            assert_eq!(bench.status(id).link, Link::Lost);
            esc.set_power(true);
            let tenth = model.full_scale / 10 + 1;
            let (mut last, mut ticks) = (0, 0);
            for _ in 0..40 {
                bench.hold(id, target, 1);
                let command =
                    i16::from_be_bytes(bench.tx.frames()[0].bytes()[..2].try_into().unwrap());
                let jump = (command - last).abs();
                // For 20 ms from when it runs again.
                let gentle = jump <= tenth || ticks > 20;
                assert!(gentle, "{} tick {ticks}: {last} to {command}", model.name);
                ticks += u32::from(bench.status(id).drive == DriveMode::Run);
                last = command;
            }
            assert!(ticks > 20, "{} does not run again", model.name);
            bench.hold(id, target, 2500);
            assert!(
                (esc.state().output_rpm - f64::from(rpm)).abs() < 0.03 * f64::from(rpm).max(50.0)
            );
        }
    }
}

#[test]
fn a_commander_that_stops_leaves_the_motor_safe_within_50_ms() {
    let switch = ArmSwitch::new();
    let mut ours = motor(&dji::M3508, 1);
    let mut bench = Bench::new(1, &switch);
    let (id, esc) = bench.add(&mut ours, Safety::COAST, twin(&dji::M3508, 1));
    switch.arm().unwrap();
    bench.hold(id, Target::Current(Amps::new(2.0)), 100);
    let silent_since = bench.now();
    for _ in 0..100 {
        if bench.status(id).drive != DriveMode::Run {
            break;
        }
        bench.tick();
    }
    assert_eq!(bench.tx.frames()[0].bytes(), [0; 8]);
    assert!(bench.now().since(silent_since) <= Micros::from_millis(51));
    assert!(bench.now().since(silent_since) >= Micros::from_millis(49));
    assert_eq!(bench.status(id).counters.expired, 1);
    bench.tick();
    assert_eq!(esc.state().command, 0);
}

/// Safe state hold: the load stays where it is, against gravity, for as long as it takes.
#[test]
fn a_lift_whose_commander_stops_holds_its_load() {
    let switch = ArmSwitch::new();
    let mut ours = motor(&dji::M3508, 1);
    let mut bench = Bench::new(1, &switch);
    let mut device = twin(&dji::M3508, 1);
    device.plant = device.plant.with_load_inertia(0.01);
    let (id, esc) = bench.add(&mut ours, Safety::HOLD, device);
    switch.arm().unwrap();
    bench.tick();
    bench.tick();
    let start = bench.status(id).feedback.total_angle;
    let up = start.plus(TotalAngle::from_degrees(360));
    esc.set_load(-1.5);
    bench.hold(id, Target::TotalAngle(up), 2000);
    let held = esc.state().output_degrees;
    for _ in 0..5000 {
        bench.tick();
    }
    assert_eq!(bench.status(id).drive, DriveMode::Hold);
    let moved = esc.state().output_degrees - held;
    assert!(moved.abs() < 2.0, "moved {moved}");
    // A stop holds it too; disarming does not.
    switch.emergency_stop();
    bench.hold(id, Target::TotalAngle(start), 1000);
    let moved = esc.state().output_degrees - held;
    assert!(moved.abs() < 2.0, "moved {moved}");
    switch.reset();
    bench.hold(id, Target::TotalAngle(up), 500);
    assert!(esc.state().output_degrees < held - 20.0);
}

#[test]
fn nothing_moves_before_the_robot_is_armed() {
    for model in MODELS {
        let switch = ArmSwitch::new();
        let mut ours = motor(model, 1);
        let mut bench = Bench::new(1, &switch);
        let (id, esc) = bench.add(&mut ours, Safety::HOLD, twin(model, 1));
        bench.hold(id, Target::Speed(Rpm::new(100.0)), 200);
        assert_eq!(esc.state().command, 0);
        assert!(esc.state().commands > 190);
    }
}

/// The whole robot at full activity, and an emergency stop.
#[test]
fn an_emergency_stop_makes_every_frame_safe_in_the_next_tick_on_all_buses() {
    let ports = team::Ports::new();
    let shared = &Shared::new(&ports);
    let mut motors = Motors::new();
    let robot = rc10_cli::robot_of::<team::Robot>(shared, &mut motors).unwrap();
    let mut around = Environment::new(robot.description(), 4).unwrap();
    let mut tasks = robot.tasks(&around).unwrap();
    let stop = Micros::new(7_400_300);
    around.run(&mut tasks, stop);
    let traces = |around: &Environment| {
        around.wires.iter().map(rc10_sim::Bus::take_trace).collect::<Vec<_>>()
    };
    let lift =
        |around: &Environment| LIFT.map(|name| around.motors[name as usize].state().output_degrees);
    let rising = around.motors[Name::LiftFrontLeft as usize].state().output_rpm;
    assert!(rising > 20.0, "the lift moves: {rising}");
    shared.switch.emergency_stop();
    // The next tick starts 0.7 ms from now; its frames are through 0.6 ms later at the latest.
    around.run(&mut tasks, stop + Micros::new(1_300));
    let _ = traces(&around);
    around.run(&mut tasks, stop + Micros::from_millis(600));
    let still = lift(&around);
    let traces = traces(&around);
    let commands = traces[0].iter().chain(&traces[1]).filter(|entry| entry.from_controller);
    let mut count = 0;
    for entry in commands {
        assert_eq!(entry.frame.bytes(), [0; 8], "{} at {}", entry.frame, entry.at);
        count += 1;
    }
    assert!(count > 1000, "{count} frames");
    // It cannot be armed, and the lift hangs where it stopped.
    assert!(shared.switch.arm().is_err());
    around.run(&mut tasks, stop + Micros::from_millis(900));
    for (now, before) in lift(&around).into_iter().zip(still) {
        assert!((now - before).abs() < 1.5, "{before} to {now}");
    }
    for name in [Name::WheelFrontLeft, Name::GimbalYaw, Name::LiftRearRight] {
        let drive = shared.motor(name).status().drive;
        assert_eq!(drive, name.entry().safety.state.mode());
    }
    shared.switch.reset();
    shared.switch.arm().unwrap();
    around.run(&mut tasks, stop + Micros::from_millis(950));
    assert_eq!(shared.motor(Name::WheelFrontLeft).status().drive, DriveMode::Run);
}

/// A gripper pushes against its end stop; then it is stopped. It must let go.
#[test]
fn a_stalled_motor_that_is_stopped_does_not_go_on_pushing() {
    for target in [Target::Current(Amps::new(15.0)), Target::Speed(Rpm::new(20.0))] {
        let switch = ArmSwitch::new();
        let mut ours = motor(&dji::M3508, 1);
        let mut bench = Bench::new(1, &switch);
        let mut device = twin(&dji::M3508, 1);
        // Nothing turns this shaft.
        device.plant.static_friction = 100.0;
        device.plant.coulomb_friction = 100.0;
        let (id, esc) = bench.add(&mut ours, Safety::BRAKE, device);
        switch.arm().unwrap();
        bench.hold(id, target, 3000);
        assert!(esc.state().current > 10.0, "{target:?}");
        switch.emergency_stop();
        bench.hold(id, target, 50);
        assert_eq!(bench.status(id).drive, DriveMode::Brake);
        assert!(esc.state().current.abs() < 0.1, "{target:?}: {}", esc.state().current);
    }
}

#[test]
fn stopping_a_disarmed_robot_gives_no_motor_torque_and_disarming_a_stopped_one_takes_it() {
    let switch = ArmSwitch::new();
    let mut ours = motor(&dji::M3508, 1);
    let mut bench = Bench::new(1, &switch);
    let (id, esc) = bench.add(&mut ours, Safety::HOLD, twin(&dji::M3508, 1));
    esc.set_load(-2.0);
    bench.hold(id, Target::Coast, 20);
    switch.emergency_stop();
    bench.hold(id, Target::Coast, 100);
    assert_eq!((bench.status(id).drive, esc.state().command), (DriveMode::Off, 0));
    switch.reset();
    switch.arm().unwrap();
    bench.hold(id, Target::Coast, 20);
    switch.emergency_stop();
    bench.hold(id, Target::Coast, 200);
    assert_eq!(bench.status(id).drive, DriveMode::Hold);
    assert_ne!(esc.state().command, 0);
    switch.disarm();
    bench.hold(id, Target::Coast, 2);
    assert_eq!((bench.status(id).drive, esc.state().command), (DriveMode::Off, 0));
    assert!(switch.arm().is_err());
}

/// The program slept for longer than a second, or the bus's clock and the port's differ.
#[test]
fn what_was_heard_long_ago_or_will_be_is_not_fresh() {
    let switch = ArmSwitch::new();
    let mut ours = motor(&dji::M3508, 1);
    let mut bench = Bench::new(1, &switch);
    let (id, _) = bench.add(&mut ours, Safety::COAST, twin(&dji::M3508, 1));
    switch.arm().unwrap();
    bench.hold(id, Target::Current(Amps::new(5.0)), 100);
    let (now, mut tx) = (bench.now(), rc10_motor::TxBatch::new());
    for minutes in [1, 40, 60, 71, 72] {
        let later = now + Micros::from_millis(minutes * 60_000);
        tx.clear();
        bench.bus.tick(later, rc10_app::Seconds::new(0.001), &mut tx).unwrap();
        assert_eq!(tx.frames()[0].bytes(), [0; 8], "{minutes} min");
    }
    // A port whose clock is a minute ahead: its frames keep no link alive.
    let feedback = bench.wire.take_trace().into_iter().find(|entry| !entry.from_controller);
    let start = now + Micros::from_millis(80 * 60_000);
    let mut tick = |at: Micros, frame: Option<Micros>| {
        if let Some(arrival) = frame {
            bench.bus.on_frame(&feedback.unwrap().frame, arrival);
        }
        bench.bus.tick(at, rc10_app::Seconds::new(0.001), &mut tx).unwrap();
        bench.bus.status(id, at).unwrap().link
    };
    tick(start, None);
    let ahead = start + Micros::from_millis(60_000);
    assert_eq!(tick(start + Micros::from_millis(1), Some(ahead)), Link::Lost);
    let during = start + Micros::new(2_500);
    assert_eq!(tick(start + Micros::from_millis(2), Some(during)), Link::Online);
}
