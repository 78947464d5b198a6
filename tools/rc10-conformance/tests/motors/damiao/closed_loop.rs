use super::{MOST, Rig, cascade, config, controls, device, motor, on_bus};
use rc10_app::{Degrees, NewtonMetres, Rpm, TotalAngle};
use rc10_motor::damiao::{Config, Control, Damiao, models};
use rc10_motor::rc10_app::Direction;
use rc10_motor::{
    CommandError, Condition, Impedance, Request, Response, Safety, Target, TargetError, TargetKind,
};
use rc10_sim::Beyond;
use rc10_sim::damiao::DamiaoConfig;

const FORWARD: Target = Target::Speed(Rpm::new(100.0));

fn angle(degrees: i32) -> Target {
    Target::TotalAngle(TotalAngle::from_degrees(degrees))
}

fn mit() -> Control {
    Control::Mit(cascade())
}

/// Armed, the motor is enabled within three ticks; before, never.
#[test]
fn it_is_enabled_by_a_command_and_disabled_with_the_robot() {
    for control in controls() {
        let mut rig = on_bus(motor(control), &device(&control), Safety::COAST);
        rig.bench.tick();
        assert_eq!(rig.status().condition, Condition::Starting);
        let target = if control == Control::Velocity { FORWARD } else { angle(90) };
        rig.bench.hold(rig.motor, target, 50).unwrap();
        assert!(!rig.is_enabled(), "{control:?}");
        assert_eq!(rig.status().condition, Condition::Ready);
        rig.switch.arm().unwrap();
        rig.bench.hold(rig.motor, target, 3).unwrap();
        assert!(rig.is_enabled(), "{control:?}");
        rig.bench.hold(rig.motor, target, 100).unwrap();
        assert!(rig.esc.state().output_rpm > 20.0, "{control:?}");
        let is_ours = matches!(control, Control::Mit(_));
        assert_eq!(rig.status().feedback.effort().is_some(), is_ours, "{control:?}");
        rig.switch.disarm();
        rig.bench.wait(2);
        assert!(!rig.is_enabled(), "{control:?}");
        assert_eq!(rig.esc.state().current, 0.0);
        rig.switch.arm().unwrap();
        rig.bench.hold(rig.motor, target, 3).unwrap();
        assert!(rig.is_enabled(), "{control:?}");
        rig.switch.emergency_stop();
        rig.bench.wait(2);
        assert!(!rig.is_enabled(), "{control:?}");
        assert_eq!(rig.esc.state().malformed, 0);
        assert_eq!(rig.bench.refused, 0);
    }
}

/// A stiff spring that is far away pulls with what the motor may give, and no more; and that too
/// begins softly.
#[test]
fn an_impedance_keeps_to_the_torque_limit() {
    for limit in [MOST, 2.0] {
        let mut rig = on_bus(motor(mit()), &device(&mit()), Safety::COAST).armed();
        let request = Request::TorqueLimit(NewtonMetres::new(limit));
        assert_eq!(rig.bench.bus.request(rig.motor, request), Ok(Response::Done));
        let spring =
            Impedance { angle: Degrees::new(300.0), kp: 25.0, kd: 1.0, ..Impedance::default() };
        let (mut last, mut most) = (0.0, 0.0_f64);
        for tick in 0..1000 {
            rig.bench.hold(rig.motor, Target::Impedance(spring), 1).unwrap();
            let now = rig.esc.state().torque;
            // A step of `kp` on the wire is 0.12 N m/rad.
            let softly = 0.12 * f64::from(limit) + 0.3;
            assert!(tick > 15 || now - last < softly, "{last} to {now} N m");
            last = now;
            most = most.max(now.abs());
        }
        // What is told is a tick old, and `kp` is coarse.
        assert!((0.9..1.3).contains(&(most / f64::from(limit))), "{most} N m");
    }
}

#[test]
fn the_devices_own_loops_reach_their_targets() {
    for control in controls() {
        let (target, is_position) = match control {
            Control::Mit(_) => continue,
            Control::Velocity => (FORWARD, false),
            _ => (angle(-200), true),
        };
        let mut rig = on_bus(motor(control), &device(&control), Safety::COAST).armed();
        let mut fastest: f64 = 0.0;
        for _ in 0..900 {
            rig.bench.hold(rig.motor, target, 1).unwrap();
            fastest = fastest.max(rig.esc.state().output_rpm.abs());
        }
        let told = rig.status().feedback;
        if is_position {
            let degrees = told.total_angle.degrees().get();
            assert!((degrees + 200.0).abs() < 0.5, "{control:?}: {degrees}");
            rig.bench.hold(rig.motor, Target::Angle(Degrees::new(170.0)), 700).unwrap();
            let degrees = rig.status().feedback.total_angle.degrees().get();
            assert!((degrees + 190.0).abs() < 0.5, "{control:?}: {degrees}");
        } else {
            assert!((told.speed.get() - 100.0).abs() < 1.0, "{control:?}: {}", told.speed);
        }
        assert!(fastest < 108.0, "{control:?}: no faster than told, but {fastest} rpm");
        // No torque means disabled there.
        rig.bench.hold(rig.motor, Target::Coast, 3).unwrap();
        assert!(!rig.is_enabled(), "{control:?}");
        assert_eq!(rig.status().condition, Condition::Ready);
    }
}

#[test]
fn force_position_pushes_no_harder_than_its_share() {
    let control = Control::ForcePosition { speed: Rpm::new(100.0), torque_share: 0.2 };
    let mut rig = on_bus(motor(control), &device(&control), Safety::COAST).armed();
    // 0.2 of 10 N m cannot lift 3 N m.
    rig.esc.set_load(-3.0);
    let mut hardest: f64 = 0.0;
    for _ in 0..200 {
        rig.bench.hold(rig.motor, angle(90), 1).unwrap();
        hardest = hardest.max(rig.esc.state().current.abs() * 0.945);
    }
    assert!((hardest - 2.0).abs() < 0.05, "{hardest}");
}

#[test]
fn what_lies_beyond_its_range_is_refused() {
    let mut rig = on_bus(motor(mit()), &device(&mit()), Safety::COAST).armed();
    let id = rig.motor;
    let far = |rig: &mut Rig, target| {
        let now = rig.bench.world.now();
        rig.bench.bus.command(id, target, now)
    };
    let out = |kind| Err(CommandError::Target(TargetError::OutOfRange(kind)));
    // PMAX is 716.197 degrees, VMAX 286.5 rpm.
    assert_eq!(far(&mut rig, angle(716)), Ok(()));
    assert_eq!(far(&mut rig, angle(717)), out(TargetKind::TotalAngle));
    assert_eq!(far(&mut rig, angle(-717)), out(TargetKind::TotalAngle));
    let fast = Target::Speed(Rpm::new(287.0));
    assert_eq!(far(&mut rig, fast), out(TargetKind::Speed));
    let good = Impedance { kp: 10.0, kd: 1.0, ..Impedance::default() };
    assert_eq!(far(&mut rig, Target::Impedance(good)), Ok(()));
    for bad in [
        Impedance { kp: -1.0, ..good },
        Impedance { kp: 501.0, ..good },
        Impedance { kd: 5.1, ..good },
        Impedance { angle: Degrees::new(720.0), ..good },
        Impedance { angle: Degrees::new(f32::MAX), ..good },
        Impedance { speed: Rpm::new(300.0), ..good },
    ] {
        assert_eq!(far(&mut rig, Target::Impedance(bad)), out(TargetKind::Impedance), "{bad:?}");
    }
    // A new zero moves the range.
    rig.bench.hold(rig.motor, angle(90), 1000).unwrap();
    assert_eq!(rig.ask(Request::SetZeroOfDriven), Ok(rc10_motor::Response::Done));
    assert_eq!(far(&mut rig, angle(630)), out(TargetKind::TotalAngle));
    assert_eq!(far(&mut rig, angle(-716)), Ok(()));
    assert_eq!(rig.status().counters.refused.total(), 10);

    let narrow = rc10_motor::damiao::Limits::new(3.0, 30.0, 10.0);
    let model = rc10_motor::damiao::Model { limits: narrow, ..models::J4310 };
    let mut single = Damiao::new(Config::new(model, 1, 0x21, mit())).unwrap();
    let target = Target::Angle(Degrees::new(180.0));
    use rc10_motor::Motor;
    let refused = single.set_target(target);
    assert_eq!(refused, Err(TargetError::OutOfRange(TargetKind::Angle)));
    assert_eq!(single.set_target(Target::Angle(Degrees::new(190.0))), Ok(()));
}

/// From 690 degrees the shorter way to 10 leads to 730, and PMAX is 716.
#[test]
fn an_angle_is_sought_within_the_range() {
    for (control, direction) in controls()
        .into_iter()
        .filter(|control| *control != Control::Velocity)
        .flat_map(|control| [(control, Direction::Forward), (control, Direction::Reversed)])
    {
        for sign in [1, -1] {
            let motor = Damiao::new(config(control).with_direction(direction)).unwrap();
            let mut rig = on_bus(motor, &device(&control), Safety::COAST).armed();
            rig.bench.hold(rig.motor, angle(sign * 690), 2500).unwrap();
            for (target, total) in [(10, 370), (350, 350), (340, 340), (-10, 350)] {
                #[expect(clippy::cast_precision_loss, reason = "small")]
                let target = Target::Angle(Degrees::new((sign * target) as f32));
                rig.bench.hold(rig.motor, target, 2000).unwrap();
                let told = f64::from(rig.status().feedback.total_angle.degrees().get());
                let off = told - f64::from(sign * total);
                assert!(off.abs() < 1.0, "{control:?} {direction:?} {target:?}: {told}");
            }
        }
    }
}

/// Sources do not say what is told beyond PMAX; turning on and coming back is right for both.
#[test]
fn turning_beyond_the_range_and_back_is_survived() {
    for beyond in [Beyond::Saturates, Beyond::Wraps] {
        let config = DamiaoConfig { beyond, ..device(&mit()) };
        let mut rig = on_bus(motor(mit()), &config, Safety::COAST).armed();
        let start = rig.esc.state().output_degrees;
        rig.bench.hold(rig.motor, Target::Speed(Rpm::new(150.0)), 1200).unwrap();
        let went = rig.esc.state().output_degrees - start;
        assert!(went > 800.0, "{went}");
        assert!((rig.status().feedback.speed.get() - 150.0).abs() < 3.0);
        if beyond == Beyond::Wraps {
            let told = f64::from(rig.status().feedback.total_angle.degrees().get());
            assert!((told - went).abs() < 2.0, "{told} {went}");
        }
        rig.bench.hold(rig.motor, angle(100), 3000).unwrap();
        let told = rig.status().feedback.total_angle.degrees().get();
        assert!((told - 100.0).abs() < 0.5, "{beyond:?}: {told}");
        let left = rig.esc.state().output_degrees - start;
        assert!((left - 100.0).abs() < 1.0, "{beyond:?}: {left}");
    }
}
