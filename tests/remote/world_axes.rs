//! Driving by the world's axes: forward stays where the robot looked when it was armed. Without a
//! heading the robot stands still.

use std::sync::atomic::Ordering;

use rc10_cli::Receiver;
use rc10_module::imu::Heading;
use rc10_motor::ArmState;
use rc10_sim::remote::{Controls, Stick, Switch};
use rc10_sim::{Pose, World};
use rc10_tasks::status;
use rc10_time::Micros;

use super::{DOWN, DRIVE, Scene, millis, scene, scene_with};

/// The left stick forward, by the world's axes.
const WORLD: Controls = Controls { right_switch: Switch::Up, ..DRIVE };

impl Scene<'_> {
    fn pose(&self) -> Pose {
        self.around.base.as_ref().unwrap().pose()
    }

    fn speed(&self) -> f64 {
        let twist = self.around.base.as_ref().unwrap().twist();
        twist.x.hypot(twist.y)
    }

    /// Turns to the left by about a quarter, and stands.
    fn turn(&mut self) {
        let start = self.pose().yaw;
        self.hands(Controls { right: Stick { x: -0.5, y: 0.0 }, ..Controls::REST });
        while self.pose().yaw < start + 1.2 {
            self.run(millis(10));
        }
        self.hands(Controls::REST);
        self.run(millis(700));
        let turned = self.pose().yaw - start;
        assert!((1.2..2.0).contains(&turned), "{turned}");
    }

    /// Drives for a second: how far along the direction `yaw`, and to the left of it.
    fn drive_along(&mut self, controls: Controls, yaw: f64) -> (f64, f64) {
        let start = self.pose();
        self.hands(controls);
        self.run(millis(1000));
        let (x, y) = (self.pose().x - start.x, self.pose().y - start.y);
        self.hands(Controls { left: Stick::default(), ..controls });
        self.run(millis(600));
        (x * yaw.cos() + y * yaw.sin(), y * yaw.cos() - x * yaw.sin())
    }

    fn imu(&self) -> &rc10_sim::Serial {
        &self.around.serials[0]
    }
}

/// A scene with a DR16, armed unless told otherwise.
fn armed(play: impl FnOnce(Scene<'_>)) {
    scene(Receiver::Dr16, 2, |mut scene| {
        scene.arm_by_hand();
        play(scene);
    });
}

#[track_caller]
fn is_straight((forward, left): (f64, f64)) {
    assert!(forward > 0.5, "{forward} m forward, {left} m to the left");
    assert!(left.abs() < 0.15 * forward, "{forward} m forward, {left} m to the left");
}

#[test]
fn the_world_s_axes_stay_where_they_are() {
    armed(|mut scene| {
        scene.turn();
        is_straight(scene.drive_along(WORLD, 0.0));
        // In its own axes it goes where it looks.
        let yaw = scene.pose().yaw;
        is_straight(scene.drive_along(DRIVE, yaw));
        // To the left is to the left of the world.
        let left = Controls { left: Stick { x: -0.6, y: 0.0 }, ..WORLD };
        is_straight(scene.drive_along(left, std::f64::consts::FRAC_PI_2));
    });
}

/// More than a turn while it drives.
#[test]
fn a_robot_that_spins_drives_straight() {
    armed(|mut scene| {
        let start = scene.pose().yaw;
        for _ in 0..3 {
            let spin = Controls { right: Stick { x: 0.6, y: 0.0 }, ..WORLD };
            is_straight(scene.drive_along(spin, 0.0));
        }
        let turned = start - scene.pose().yaw;
        assert!(turned > 7.0, "clockwise by {turned}");
    });
}

#[test]
fn forward_is_where_it_looks_when_it_is_armed() {
    armed(|mut scene| {
        scene.turn();
        let ahead = scene.pose().yaw;
        scene.arm_by_hand();
        scene.turn();
        is_straight(scene.drive_along(WORLD, ahead));
    });
}

/// Its plug comes out, or its power goes and comes back with another zero.
#[test]
fn without_an_imu_it_stops_until_it_is_armed_anew() {
    for power in [false, true] {
        armed(|mut scene| {
            scene.turn();
            scene.hands(WORLD);
            scene.run(millis(600));
            assert!(scene.speed() > 0.8, "{}", scene.speed());
            if power {
                scene.imu().set_power(false);
            } else {
                scene.imu().set_cut(true);
            }
            // 90 ms until it is missed; then it brakes at 3 m/s².
            scene.run(millis(700));
            assert!(scene.speed() < 0.03, "{} m/s", scene.speed());
            assert_eq!(scene.arm(), ArmState::Armed);
            // Its own axes need no IMU.
            let yaw = scene.pose().yaw;
            is_straight(scene.drive_along(DRIVE, yaw));
            scene.imu().set_power(true);
            scene.imu().set_cut(false);
            let (x, y) = scene.drive_along(WORLD, 0.0);
            assert!(x.hypot(y) < 0.02, "{x} m, {y} m: forward is not known");
            let ahead = scene.pose().yaw;
            scene.arm_by_hand();
            is_straight(scene.drive_along(WORLD, ahead));
        });
    }
}

/// It was plugged in, or got its power, when the robot had been armed and had turned.
#[test]
fn an_imu_that_comes_late_counts_from_the_next_arming_on() {
    // Never heard before, or heard while the robot was disarmed and not when it was armed.
    for heard_before in [false, true] {
        scene_with(
            Receiver::Dr16,
            2,
            |around| around.serials[0].set_cut(!heard_before),
            |mut scene| {
                scene.hands(DOWN);
                scene.run(millis(200));
                scene.imu().set_cut(true);
                scene.run(millis(100));
                scene.hands(Controls::REST);
                scene.run(millis(100));
                assert_eq!(scene.arm(), ArmState::Armed);
                scene.turn();
                scene.imu().set_cut(false);
                scene.run(millis(200));
                let (x, y) = scene.drive_along(WORLD, 0.0);
                assert!(x.hypot(y) < 0.02, "{x} m, {y} m: it was armed looking elsewhere");
                let ahead = scene.pose().yaw;
                scene.arm_by_hand();
                scene.turn();
                is_straight(scene.drive_along(WORLD, ahead));
            },
        );
    }
}

/// From the first second on, of a robot that has an IMU; what a board says of it comes first.
#[test]
fn a_heading_that_does_not_come_or_is_old_is_told() {
    let ports = mixed::Ports::new();
    let shared = mixed::Shared::new(&ports);
    let at = |time| {
        let _world = World::starting_at(millis(time), 1);
        status::now(&shared).imu_trouble
    };
    assert_eq!([at(500), at(5000)], [None; 2]);
    shared.has_imu.store(true, Ordering::Relaxed);
    assert_eq!([at(999), at(1000)], [None, Some("gives no heading")]);
    shared.heading.set(Heading::default(), millis(5000));
    assert_eq!([at(5199), at(5201)], [None, Some("gives no heading")]);
    shared.imu_trouble.set(Some("does not answer"), Micros::ZERO);
    assert_eq!([at(5199), at(5201)], [Some("does not answer"); 2]);
}
