//! Bases, swerve and odometry against numpy and scipy in f64: see `golden/bases.py`,
//! `golden/swerve.py`, `golden/odometry.py`.

use rc10_app::base::{Base, Tread, Wheel};
use rc10_app::swerve::{Module, Steering, Swerve, SwerveState};
use rc10_app::{
    Degrees, Direction, Odometry, OdometryConfig, OdometryInput, Point, Pose, Radians, Rpm,
    Seconds, TotalAngle, Twist,
};

/// A row by the names of its columns.
struct Row<'a> {
    names: &'a [&'a str],
    cells: Vec<&'a str>,
}

impl Row<'_> {
    fn text(&self, name: &str) -> &str {
        self.cells[self.names.iter().position(|one| *one == name).unwrap()]
    }

    fn float(&self, name: &str) -> f32 {
        self.text(name).parse().unwrap()
    }

    fn double(&self, name: &str) -> f64 {
        self.text(name).parse().unwrap()
    }

    fn twist(&self, [vx, vy, wz]: [&str; 3]) -> Twist {
        Twist::new(self.float(vx), self.float(vy), self.float(wz))
    }
}

fn each_row(table: &str, mut test: impl FnMut(&Row<'_>)) -> usize {
    let mut lines = table.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let mut count = 0;
    for line in lines {
        test(&Row { names: &names, cells: line.split(',').collect() });
        count += 1;
    }
    count
}

/// Within a part in 10^5 of the numbers that it is made of, whose size is given.
#[track_caller]
fn near(actual: f32, expected: f64, size: f64) {
    let off = (f64::from(actual) - expected).abs();
    assert!(off <= 1e-5 * size, "{actual} is not {expected}: {off}");
}

fn base<const N: usize>(row: &Row<'_>) -> [f64; 2] {
    let mut at = 0;
    let wheels = [(); N].map(|()| {
        let cell = |name: &str| format!("{name}{at}");
        let tread = match row.text(&cell("rollers")) {
            "" => Tread::Plain,
            angle => Tread::Rollers(Degrees::new(angle.parse().unwrap())),
        };
        let is_reversed = row.text(&cell("reversed")) == "1";
        let wheel = Wheel {
            place: Point::new(row.float(&cell("x")), row.float(&cell("y"))),
            direction: Degrees::new(row.float(&cell("direction"))),
            tread,
            radius: row.float(&cell("radius")),
            turns: if is_reversed { Direction::Reversed } else { Direction::Forward },
        };
        at += 1;
        wheel
    });
    // The usual ones have a name as well.
    let limit = Rpm::new(1e9);
    let [first, ..] = wheels.as_slice() else { panic!("no wheels") };
    let (radius, x, y) = (first.radius, first.place.x, first.place.y);
    let named = |wheels: &[Wheel]| {
        for (ours, theirs) in wheels.iter().zip(row_wheels(row)) {
            let Point { x, y, .. } = ours.place;
            near(x, theirs[0], 0.1);
            near(y, theirs[1], 0.1);
            near(ours.direction.get(), theirs[2], 1.0);
        }
    };
    match row.text("kind") {
        "mecanum" => named(Base::mecanum(radius, x, y, limit).wheels()),
        "omni_3" => named(Base::omni_3(radius, x.hypot(y), limit).wheels()),
        "omni_4" => named(Base::omni_4(radius, x.hypot(y), limit).wheels()),
        "differential" => named(Base::differential(radius, y, limit).wheels()),
        _ => {}
    }

    let base = Base::new(wheels, limit).unwrap();
    let twist = row.twist(["vx", "vy", "wz"]);
    near(base.sideways(twist), row.double("sideways"), 5.0);
    let speeds = base.inverse(twist).unwrap().speeds;
    let measured = core::array::from_fn(|at| Rpm::new(row.float(&format!("measured{at}"))));
    let motion = base.forward(measured);
    let mut most = [0.0_f64; 2];
    for (at, speed) in speeds.into_iter().enumerate() {
        let expected = row.double(&format!("speed{at}"));
        near(speed.get(), expected, 2000.0);
        let residual = row.double(&format!("residual{at}"));
        near(motion.residual[at], residual, 5.0);
        most = [most[0].max(expected.abs()), most[1].max(residual.abs())];
    }
    near(motion.twist.vx, row.double("mx"), 5.0);
    near(motion.twist.vy, row.double("my"), 5.0);
    near(motion.twist.wz, row.double("mwz"), 20.0);
    assert!((f64::from(motion.slip()) - most[1]).abs() < 5e-5);
    most
}

fn row_wheels(row: &Row<'_>) -> Vec<[f64; 3]> {
    let count: usize = row.text("count").parse().unwrap();
    let wheel = |at| ["x", "y", "direction"].map(|name| row.double(&format!("{name}{at}")));
    (0..count).map(wheel).collect()
}

#[test]
fn bases_are_those_of_numpy() {
    let (mut fast, mut slips) = (0, 0);
    let rows = each_row(include_str!("golden/bases.csv"), |row| {
        let [speed, residual] = match row.text("count") {
            "2" => base::<2>(row),
            "3" => base::<3>(row),
            "4" => base::<4>(row),
            "5" => base::<5>(row),
            "6" => base::<6>(row),
            count => panic!("{count} wheels"),
        };
        fast += u32::from(speed > 100.0);
        slips += u32::from(residual > 0.02);
    });
    assert!(rows == 100 && fast > 80 && slips > 40, "{rows} {fast} {slips}");
}

#[test]
fn swerve_is_that_of_numpy() {
    let total = |degrees: f64| {
        #[expect(clippy::cast_possible_truncation, reason = "whole")]
        TotalAngle::from_microdegrees((degrees * 1e6).round() as i64)
    };
    let rows = each_row(include_str!("golden/swerve.csv"), |row| {
        let cell = |name: &str, at: usize| row.double(&format!("{name}{at}"));
        #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
        let places =
            core::array::from_fn(|at| Point::new(cell("x", at) as f32, cell("y", at) as f32));
        let range = row.double("range");
        let steering = if range > 0.0 {
            Steering::Between(total(-range), total(range))
        } else {
            Steering::Endless
        };
        let base = Swerve::<4>::new(places, row.float("radius"), Rpm::new(1e9), steering).unwrap();
        let measured = core::array::from_fn(|at| total(cell("measured", at)));
        let mut state = SwerveState::new();
        let modules = state.update(&base, row.twist(["vx", "vy", "wz"]), measured).unwrap().modules;
        #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
        let motion = base.forward(core::array::from_fn(|at| Module {
            speed: Rpm::new(cell("mspeed", at) as f32),
            angle: total(cell("mangle", at)),
        }));
        for (at, module) in modules.iter().enumerate() {
            near(module.speed.get(), cell("speed", at), 2000.0);
            #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
            let angle = module.angle.microdegrees() as f64 * 1e-6;
            assert!((angle - cell("angle", at)).abs() < 1e-3, "{module:?} {}", cell("angle", at));
            near(motion.residual[at], cell("residual", at), 5.0);
        }
        near(motion.twist.vx, row.double("mx"), 5.0);
        near(motion.twist.vy, row.double("my"), 5.0);
        near(motion.twist.wz, row.double("mwz"), 20.0);
    });
    assert_eq!(rows, 200);
}

#[test]
fn odometry_is_the_integral_of_a_fine_path() {
    let mut odometry = Odometry::default();
    let rows = each_row(include_str!("golden/odometry.csv"), |row| {
        let dt = row.float("dt");
        if dt == 0.0 {
            let heading = Radians::new(row.float("heading"));
            odometry = Odometry::new(Pose::new(row.float("x"), row.float("y"), heading));
            return;
        }
        let twist = row.twist(["vx", "vy", "wz"]);
        let input = OdometryInput { twist, slip: 0.0, heading: None };
        odometry.update(&OdometryConfig::DEFAULT, input, Seconds::new(dt));
        let pose = odometry.pose();
        // Metres and radians, after up to 60 steps.
        near(pose.x, row.double("x"), 0.3);
        near(pose.y, row.double("y"), 0.3);
        let turn = f64::from(pose.heading.get()) - row.double("heading");
        assert!(turn.sin().abs() < 2e-6 && turn.cos() > 0.0, "{turn}");
        let is = odometry.covariance();
        let expected = ["xx", "xy", "xt", "yy", "yt", "tt"].map(|name| row.double(name));
        for (is, expected) in [is.xx, is.xy, is.xt, is.yy, is.yt, is.tt].into_iter().zip(expected) {
            near(is, expected, 1e-3);
        }
    });
    assert_eq!(rows, 12 * 61);
}
