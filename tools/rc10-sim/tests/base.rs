//! The base goes where its wheels push it.

use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, CanPort};
use rc10_sim::{Base, Bus, BusConfig, Chassis, Esc, EscConfig, Model, Mounting, WheelError, World};
use rc10_time::Micros;

/// The right side's motors look the other way.
const MOUNTINGS: [Mounting; 4] =
    [Mounting::Normal, Mounting::Mirrored, Mounting::Normal, Mounting::Mirrored];

struct Robot {
    world: World,
    bus: Bus,
    base: Base,
    escs: [Esc; 4],
}

impl Robot {
    fn new(chassis: Chassis) -> Self {
        let mut world = World::new(4);
        let bus = world.add_bus(BusConfig::default());
        let escs = [1, 2, 3, 4].map(|id| bus.add_esc(EscConfig::new(Model::C620, id)).unwrap());
        let wheels = escs.iter().zip(MOUNTINGS);
        let base = world.add_base(chassis, wheels).unwrap();
        Self { world, bus, base, escs }
    }

    /// Drives front left, front right, rear left, rear right with these raw currents, each
    /// positive forward, for a time.
    fn drive(mut self, raw: [i16; 4], millis: u64) -> Self {
        let mut data = [0; 8];
        for (index, raw) in raw.into_iter().enumerate() {
            let raw = match MOUNTINGS[index] {
                Mounting::Normal => raw,
                Mounting::Mirrored => -raw,
            };
            data[2 * index..][..2].copy_from_slice(&raw.to_be_bytes());
        }
        let command = CanFrame::eight_bytes(StandardId::new(0x200).unwrap(), data);
        let _ = self.bus.port().submit(&command);
        self.world.advance(self.world.now() + Micros::from_millis(millis));
        self
    }
}

fn drive(raw: [i16; 4], millis: u64) -> Robot {
    Robot::new(Chassis::default()).drive(raw, millis)
}

#[test]
fn all_wheels_forward_go_straight_on() {
    let Robot { base, escs, .. } = drive([2000; 4], 1000);
    let (pose, twist) = (base.pose(), base.twist());
    assert!(pose.x > 0.3 && twist.x > 0.5, "{pose:?} {twist:?}");
    assert!(pose.y.abs() < 1e-9 && pose.yaw.abs() < 1e-9, "{pose:?}");
    // The wheels roll: rim speed is ground speed but for a little slip.
    let rim = escs[0].state().output_rpm / 60.0 * std::f64::consts::TAU * 0.076;
    assert!((rim / twist.x - 1.0).abs() < 0.05, "{rim} {twist:?}");
    // 2.44 A give 0.73 N·m, less 0.2 N·m of friction and drag, on 0.0763 m and about 24 kg.
    assert!((0.8..1.6).contains(&twist.x), "{twist:?}");
}

#[test]
fn it_strafes_to_the_left() {
    let pose = drive([-2000, 2000, 2000, -2000], 1000).base.pose();
    assert!(pose.y > 0.3, "{pose:?}");
    assert!(pose.x.abs() < 1e-9 && pose.yaw.abs() < 1e-9, "{pose:?}");
}

#[test]
fn it_spins_counter_clockwise_with_the_right_side_forward() {
    let Robot { base, escs, .. } = drive([-2000, 2000, -2000, 2000], 1000);
    let (pose, twist) = (base.pose(), base.twist());
    assert!(pose.yaw > 0.5, "{pose:?}");
    assert!(pose.x.abs() < 1e-9 && pose.y.abs() < 1e-9, "{pose:?}");
    // Rim speed = (half length + half width) · yaw rate.
    let rim = -escs[1].state().output_rpm / 60.0 * std::f64::consts::TAU * 0.076;
    assert!((rim / (0.42 * twist.yaw) - 1.0).abs() < 0.05, "{rim} {twist:?}");
}

#[test]
fn forward_is_where_it_looks() {
    let turned = drive([-2000, 2000, -2000, 2000], 950).drive([0; 4], 10_000);
    let start = turned.base.pose();
    assert!(start.yaw.sin().abs() > 0.3 && start.yaw.cos().abs() > 0.3, "{start:?}");
    let driven = turned.drive([2000; 4], 500);
    let (end, twist) = (driven.base.pose(), driven.base.twist());
    let (x, y) = (end.x - start.x, end.y - start.y);
    let way = x.hypot(y);
    assert!((end.yaw - start.yaw).abs() < 1e-6, "{end:?}");
    assert!((x - way * end.yaw.cos()).abs() < 1e-6, "{start:?} {end:?}");
    assert!((y - way * end.yaw.sin()).abs() < 1e-6, "{start:?} {end:?}");
    assert!(twist.x > 0.2 && twist.y.abs() < 1e-6, "{twist:?}");

    let start = driven.drive([0; 4], 10_000);
    let (start, robot) = (start.base.pose(), start.drive([-2000, 2000, 2000, -2000], 500));
    let (end, twist) = (robot.base.pose(), robot.base.twist());
    let (x, y) = (end.x - start.x, end.y - start.y);
    let way = x.hypot(y);
    assert!((x + way * end.yaw.sin()).abs() < 1e-6, "{start:?} {end:?}");
    assert!((y - way * end.yaw.cos()).abs() < 1e-6, "{start:?} {end:?}");
    assert!(twist.y > 0.2 && twist.x.abs() < 1e-6, "{twist:?}");
}

#[test]
fn a_contact_too_stiff_for_the_step_does_not_swing() {
    let stiff = || Chassis { stiffness: 1e9, ..Chassis::default() };
    let rigid = Robot::new(stiff()).drive([2000; 4], 500).base.twist().x;
    let usual = drive([2000; 4], 500).base.twist().x;
    assert!((rigid / usual - 1.0).abs() < 0.05, "{rigid} {usual}");
    // The wheels roll steadily: in a step they gain what the base's acceleration gives them.
    let mut robot = Robot::new(stiff()).drive([2000; 4], 500);
    let mut rim = robot.escs[0].state().output_rpm / 60.0 * 0.4775;
    for _ in 0..10 {
        robot.world.advance(robot.world.now() + Micros::new(100));
        let next = robot.escs[0].state().output_rpm / 60.0 * 0.4775;
        assert!((next - rim).abs() < 3e-4, "{rim} {next}");
        rim = next;
    }
}

#[test]
fn too_much_torque_spins_the_wheels() {
    let gentle = drive([4000; 4], 300);
    let wild = drive([16_384; 4], 300);
    let rim = |robot: &Robot| robot.escs[0].state().output_rpm / 60.0 * 0.4775;
    let slip = |robot: &Robot| rim(robot) - robot.base.twist().x;
    assert!(slip(&gentle) < 0.05, "{}", slip(&gentle));
    assert!(slip(&wild) > 0.5, "{}", slip(&wild));
    // Grip 0.6 allows 5.9 m/s² and no more.
    let speed = wild.base.twist().x;
    assert!(speed < 0.3 * 0.6 * 9.81 && speed > 0.25 * 0.6 * 9.81, "{speed}");
}

#[test]
fn it_rolls_out_and_stands() {
    let Robot { mut world, base, escs, .. } = drive([2000; 4], 500);
    escs.iter().for_each(|esc| esc.set_power(false));
    let coasting = base.twist().x;
    world.advance(Micros::from_millis(600));
    let later = base.twist().x;
    assert!(later > 0.0 && later < coasting);
    world.advance(Micros::from_millis(20_000));
    assert!(base.twist().x.abs() < 1e-9, "{:?}", base.twist());
    assert!(escs.iter().all(|esc| esc.state().rotor_rpm == 0.0));
}

#[test]
fn a_motor_carries_one_wheel_in_its_own_world() {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let mut other_world = World::new(1);
    let other_bus = other_world.add_bus(BusConfig::default());
    let esc = |id| bus.add_esc(EscConfig::new(Model::C620, id)).unwrap();
    let escs = [1, 2, 3, 4].map(esc);
    let stranger = other_bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
    let wheels = |last| [&escs[0], &escs[1], &escs[2], last].map(|esc| (esc, Mounting::Normal));
    let mut add = |last| world.add_base(Chassis::default(), wheels(last)).err();
    assert_eq!(add(&stranger), Some(WheelError::OtherWorld));
    assert_eq!(add(&escs[0]), Some(WheelError::Taken));
    assert_eq!(add(&escs[3]), None);
    assert_eq!(add(&escs[3]), Some(WheelError::Taken));
}
