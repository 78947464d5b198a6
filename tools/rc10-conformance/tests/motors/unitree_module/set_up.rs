//! Nothing drives before the module has what it shall have and the motor says that it follows.

use rc10_motor::rc10_app::{Degrees, NewtonMetres};
use rc10_motor::unitree::{GoModule, ModuleConfig};
use rc10_motor::{ArmSwitch, Condition, Impedance, Link, Safety, Target};
use rc10_sim::unitree_module::{Asked, Command, Mode, UnitreeModule, plant};

use super::{One, behind, speed, with_module};

/// Frames of the last tick, by the device's codec.
fn sent(one: &One) -> Vec<Asked> {
    let read = |frame| Command::unpack(frame).unwrap().asked.unwrap();
    one.bench.sent.frames().iter().map(read).collect()
}

fn name(asked: &Asked) -> &'static str {
    match asked {
        Asked::Control { status: 0, .. } => "lock",
        Asked::Control { status: 1, .. } => "follow",
        Asked::Control { .. } => "calibrate",
        Asked::SetGains(_) => "set",
        Asked::ReadGains => "read",
    }
}

/// Ticks with a target, until it follows or the ticks are over: what was sent in each.
fn ticks(one: &mut One, target: Target, count: u32) -> Vec<&'static str> {
    let mut names = Vec::new();
    for _ in 0..count {
        one.hold(target, 1);
        let sent = sent(one);
        assert_eq!(sent.len(), 1, "one frame a tick");
        names.push(name(&sent[0]));
    }
    names
}

const SPRING: Impedance = Impedance {
    angle: Degrees::new(20.0),
    speed: rc10_motor::rc10_app::Rpm::ZERO,
    torque: NewtonMetres::ZERO,
    kp: 20.0,
    kd: 0.5,
};

#[test]
fn disarmed_it_is_polled_and_armed_it_is_set_up_in_four_ticks() {
    let mut one = behind(Safety::COAST);
    assert_eq!(one.bench.status(one.motor).link, Link::Online);
    assert_eq!(ticks(&mut one, speed(60.0), 3), ["lock"; 3]);
    assert_eq!(one.mode(), Mode::Locked);
    one.switch.arm().unwrap();
    let names = ticks(&mut one, speed(60.0), 5);
    assert_eq!(names, ["set", "read", "follow", "follow", "follow"]);
    assert_eq!(one.bench.status(one.motor).condition, Condition::Ready);
    one.switch.disarm();
    assert_eq!(ticks(&mut one, speed(60.0), 2), ["lock"; 2]);
    one.bench.wait(2);
    assert_eq!((one.mode(), one.device(|device| device.calibrations)), (Mode::Locked, 0));
}

#[test]
fn an_impedance_counts_once_the_module_has_confirmed_it() {
    let mut one = behind(Safety::COAST).armed();
    one.hold(speed(100.0), 500);
    assert!(one.gains().stiffness == 0.0 && one.gains().damping == 0.0);
    let target = Target::Impedance(SPRING);
    for (tick, expected) in ["follow", "set", "read", "follow", "follow"].into_iter().enumerate() {
        assert_eq!(ticks(&mut one, target, 1), [expected]);
        let starting = one.bench.status(one.motor).condition == Condition::Starting;
        assert_eq!(starting, tick < 3, "tick {tick}");
        // The command takes effect within the next tick.
        if (1..4).contains(&tick) {
            let torque = one.device(|device| device.command.torque);
            assert!(torque.abs() < 1e-9, "tick {tick}: {torque}");
        }
    }
    one.hold(target, 100);
    assert!(one.gains().stiffness > 0.49, "{:?}", one.gains());
    // Back to a speed: the spring is taken away first, and pulls at nothing meanwhile.
    for tick in 0..6 {
        one.hold(speed(100.0), 1);
        let (has, angle) = one.device(|device| (device.gains, device.command.angle));
        let at = one.esc.state().output_degrees;
        assert!(has.stiffness == 0.0 || tick < 5, "tick {tick}: {has:?} {angle} {at}");
    }
    one.hold(speed(100.0), 1000);
    assert!((one.rpm() - 100.0).abs() < 0.5, "{}", one.rpm());
}

#[test]
fn a_module_that_does_not_keep_its_gains_never_drives() {
    let (one, module) = with_module(ModuleConfig::new(3, 0), Safety::COAST, plant());
    let mut one = one.armed();
    for _ in 0..200 {
        // It restarts in every millisecond: what it tells is never what it was told.
        module.set_power(true);
        one.hold(Target::Impedance(SPRING), 1);
        let status = one.bench.status(one.motor);
        assert_eq!((status.condition, status.link), (Condition::Starting, Link::Online));
        assert_eq!(one.mode(), Mode::Locked);
    }
    one.hold(Target::Impedance(SPRING), 10);
    assert_eq!(one.bench.status(one.motor).condition, Condition::Ready);
}

#[test]
fn a_module_that_restarts_unnoticed_is_found_without_its_gains() {
    let (one, module) = with_module(ModuleConfig::new(3, 0), Safety::COAST, plant());
    let mut one = one.armed();
    one.hold(Target::Impedance(SPRING), 500);
    let held = one.told();
    module.set_power(true);
    let mut soft = 0;
    for _ in 0..200 {
        one.hold(Target::Impedance(SPRING), 1);
        soft += u32::from(one.gains().stiffness == 0.0);
    }
    assert!((1..60).contains(&soft), "{soft} ms without the spring");
    assert!((one.told() - held).abs() < 0.5);
    assert_eq!(one.bench.status(one.motor).counters.malformed, 0);
}

#[test]
fn a_module_without_power_is_set_up_again_when_it_is_back() {
    let (one, module) = with_module(ModuleConfig::new(3, 0), Safety::COAST, plant());
    let mut one = one.armed();
    one.hold(Target::Impedance(SPRING), 500);
    module.set_power(false);
    one.hold(Target::Impedance(SPRING), 30);
    assert_eq!(one.bench.status(one.motor).link, Link::Lost);
    module.set_power(true);
    let names = ticks(&mut one, Target::Impedance(SPRING), 7);
    let set = names.iter().position(|name| *name == "set").unwrap();
    assert!(names[..set].iter().all(|name| *name == "lock"), "{names:?}");
    assert_eq!(names[set..set + 3], ["set", "read", "follow"]);
    one.hold(Target::Impedance(SPRING), 500);
    assert!((one.told() - 20.0).abs() < 1.0, "{}", one.told());
}

#[test]
fn motors_of_one_module_have_gains_and_motions_of_their_own() {
    let switch = ArmSwitch::new();
    let mut motors =
        [(3, 0), (3, 1), (2, 1)].map(|(m, id)| GoModule::new(ModuleConfig::new(m, id)).unwrap());
    let mut bench = rc10_conformance::Bench::new(3, &switch);
    let (third, second) = (UnitreeModule::new(3).unwrap(), UnitreeModule::new(2).unwrap());
    let escs = [(&third, 0), (&third, 1), (&second, 1)]
        .map(|(module, id)| bench.wire.add(module.motor(id).unwrap(), plant()));
    let ids: Vec<_> =
        motors.iter_mut().map(|motor| bench.attach(motor, Safety::COAST).unwrap()).collect();
    bench.wait(20);
    switch.arm().unwrap();
    for _ in 0..1500 {
        let now = bench.world.now();
        bench.bus.command(ids[0], speed(80.0), now).unwrap();
        bench.bus.command(ids[1], Target::Impedance(SPRING), now).unwrap();
        bench.bus.command(ids[2], speed(-40.0), now).unwrap();
        bench.tick();
    }
    let rpm = |index: usize| escs[index].state().output_rpm;
    assert!((rpm(0) - 80.0).abs() < 0.5 && (rpm(2) + 40.0).abs() < 0.5);
    let at = bench.status(ids[1]).feedback.total_angle.degrees().get();
    assert!((at - 20.0).abs() < 1.0, "{at}");
    assert!(third.gains(1).stiffness > 0.49 && third.gains(0).stiffness == 0.0);
    assert_eq!(second.gains(1).stiffness, 0.0);
    // Three motors: 83 % typically.
    assert!(bench.refused == 0 && (70.0..96.0).contains(&bench.wire.load()));
}
