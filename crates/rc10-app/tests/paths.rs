//! Paths: that a plan keeps every limit, and a base follows it, waits, or gives up.
#![allow(clippy::cast_possible_truncation, reason = "the nearest f32")]

use core::f32::consts::{FRAC_PI_2, PI};

use crate::random::Random;
use rc10_app::path::{Path, PathError, PathLimits, Plan, PlanError, Planner, Waypoint};
use rc10_app::{Base, Pose, Radians, Rpm, Seconds, Twist, TwistLimits};

const LIMIT: Rpm = Rpm::new(450.0);
const MECANUM: Base<4> = Base::mecanum(0.076, 0.20, 0.25, LIMIT);
const OMNI_3: Base<3> = Base::omni_3(0.05, 0.2, LIMIT);
const LIMITS: PathLimits = PathLimits {
    twist: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    max_speed_m_s: 2.0,
    wheel_share: 0.9,
};

const fn waypoint(x: f32, y: f32, heading: f32) -> Waypoint {
    Waypoint::new(x, y, Radians::new(heading))
}

/// Two rounded corners, a stop in a sharp one, and turns in both directions.
const COURSE: Path<5> = Path::sound([
    waypoint(0.5, -0.5, 0.0),
    waypoint(3.0, -0.5, 0.0).rounded(0.6),
    waypoint(3.0, 2.0, FRAC_PI_2).rounded(0.3),
    waypoint(1.0, 2.5, PI - 0.2),
    waypoint(0.5, 0.5, 0.0),
]);

fn course() -> Plan<5> {
    Plan::new(&COURSE, &MECANUM, &LIMITS, 0.0).unwrap()
}

fn off(a: Pose, b: Pose) -> f32 {
    (a.x - b.x).hypot(a.y - b.y)
}

fn turn(from: Radians, to: Radians) -> f32 {
    (to - from).get().sin().atan2((to - from).get().cos())
}

/// A path with arcs as wide as there is room.
fn random_path(random: &mut Random) -> Path<5> {
    loop {
        let mut waypoints = [waypoint(0.0, 0.0, 0.0); 5];
        for one in &mut waypoints {
            *one = waypoint(random.within(3.0), random.within(3.0), random.within(PI));
        }
        for one in &mut waypoints[1..4] {
            *one = one.rounded(0.45 + random.within(0.4));
        }
        if random.within(1.0) > 0.5 {
            waypoints[2] = waypoints[2].at_most(0.7);
        }
        if let Ok(path) = Path::new(waypoints) {
            return path;
        }
    }
}

/// Checks a plan every millisecond, by differences in f64.
fn check_limits<const N: usize, const WHEELS: usize>(
    plan: &Plan<N>,
    base: &Base<WHEELS>,
    limits: &PathLimits,
) {
    let numbers = |Twist { vx, vy, wz, .. }: Twist<_>| [vx, vy, wz].map(f64::from);
    let at = |ms: u16| plan.at(Seconds::new(f32::from(ms) * 0.001));
    let most = f64::from(base.max_wheel_speed().get() * limits.wheel_share);
    let end = (plan.duration().get() * 1000.0) as u16 + 2;
    let (mut smooth, mut before) = (0, at(0));
    for ms in 1..=end {
        let now = at(ms);
        let robot = now.twist.into_frame(now.pose.heading);
        for speed in base.inverse(robot * 0.1).unwrap().speeds {
            let speed = 10.0 * f64::from(speed.get()).abs();
            assert!(speed <= most * 1.0001, "{ms} ms: {speed} rpm");
        }
        let ([vx, vy, wz], [ux, uy, uz]) = (numbers(now.twist), numbers(before.twist));
        assert!(vx.hypot(vy) <= f64::from(limits.max_speed_m_s) * 1.0001, "{ms} ms: {now:?}");
        let [ax, ay, az] = [vx - ux, vy - uy, wz - uz].map(|change| change * 1e3);
        let TwistLimits { linear_m_s2, angular_rad_s2 } = limits.twist;
        // The times are f32s: 4 µs of 1 ms.
        assert!(ax.hypot(ay) <= f64::from(linear_m_s2) * 1.005, "{ms} ms: {ax} {ay} m/s²");
        assert!(az.abs() <= f64::from(angular_rad_s2) * 1.005, "{ms} ms: {az} rad/s²");
        // The pose moves by the twist, and the twist by the acceleration.
        let [dx, dy] = [now.pose.x - before.pose.x, now.pose.y - before.pose.y].map(f64::from);
        let dz = f64::from(turn(before.pose.heading, now.pose.heading));
        for (moved, mean) in [(dx, vx + ux), (dy, vy + uy), (dz, wz + uz)] {
            assert!((moved - 0.5e-3 * mean).abs() < 2e-5, "{ms} ms: {moved} {mean}");
        }
        let ([bx, by, bz], [cx, cy, cz]) =
            (numbers(now.acceleration), numbers(before.acceleration));
        let wrong = (ax - 0.5 * (bx + cx)).hypot(ay - 0.5 * (by + cy));
        smooth += u16::from(wrong < 0.05 && (az - 0.5 * (bz + cz)).abs() < 0.2);
        before = now;
    }
    // Accelerations jump where cells meet.
    assert!(smooth > end - end / 20, "{smooth} of {end} ms");
}

#[test]
fn no_wheel_and_no_acceleration_is_ever_above_its_limit() {
    check_limits(&course(), &MECANUM, &LIMITS);
    let mut random = Random(31);
    for round in 0..60_u8 {
        let path = random_path(&mut random);
        let limits = PathLimits {
            twist: TwistLimits {
                linear_m_s2: 3.0 + random.within(2.0),
                angular_rad_s2: 12.0 + random.within(8.0),
            },
            max_speed_m_s: if round % 2 == 0 { f32::INFINITY } else { 1.5 },
            wheel_share: 0.7 + random.within(0.3),
        };
        check_limits(&Plan::new(&path, &MECANUM, &limits, 0.0).unwrap(), &MECANUM, &limits);
        check_limits(&Plan::new(&path, &OMNI_3, &limits, 0.0).unwrap(), &OMNI_3, &limits);
    }
}

#[test]
fn far_away_tiny_and_huge_paths_are_finite_and_within_the_speeds() {
    let mut random = Random(32);
    let mut paths = 0;
    for round in 0..4000_u16 {
        let size = [2e-3, 0.05, 1.0, 30.0, 900.0][usize::from(round) % 5];
        let (x, y) = (random.within(950.0 - size), random.within(950.0 - size));
        let (x, y) = if round % 2 == 0 { (0.0, 0.0) } else { (x, y) };
        let mut waypoints = [waypoint(x, y, random.within(900.0)); 4];
        for one in &mut waypoints[1..] {
            let (dx, dy) = (random.within(size), random.within(size));
            *one = waypoint(x + dx, y + dy, random.within(PI)).rounded(0.3 * dx.abs());
        }
        waypoints[3].radius_m = 0.0;
        let Ok(path) = Path::new(waypoints) else { continue };
        paths += 1;
        let plan = Plan::new(&path, &MECANUM, &LIMITS, 0.0).unwrap();
        let duration = plan.duration().get();
        assert!(duration > 0.0 && duration < 1e4, "{path:?}: {duration}");
        for part in 0..=40_u8 {
            let now = plan.at(Seconds::new(duration * f32::from(part) / 40.0));
            let robot = now.twist.into_frame(now.pose.heading);
            assert!(now.acceleration.is_finite() && now.pose.x.is_finite(), "{path:?}: {now:?}");
            for speed in MECANUM.inverse(robot * 0.1).unwrap().speeds {
                assert!(10.0 * speed.get().abs() <= 405.0 * 1.001, "{path:?}: {now:?}");
            }
        }
    }
    println!("{paths} paths");
    assert!(paths > 500, "{paths}");
}

#[test]
fn it_begins_and_ends_exactly_and_passes_the_waypoints() {
    let plan = course();
    let [first, .., sharp, last] = COURSE.waypoints();
    assert_eq!(plan.at(Seconds::ZERO).pose, first.pose);
    let end = plan.at(plan.duration() + Seconds::new(1e-3));
    assert_eq!((end.pose, end.twist, plan.end()), (last.pose, Twist::STOP, last.pose));
    // The last moment before: no jump.
    let nearly = plan.at(plan.duration() - Seconds::new(1e-4));
    assert!(off(nearly.pose, last.pose) < 1e-5, "{nearly:?}");
    assert!(turn(nearly.pose.heading, last.pose.heading).abs() < 1e-5);
    let (mut nearest, mut slowest, mut rounded) = (f32::MAX, f32::MAX, f32::MAX);
    for ms in 0..(plan.duration().get() * 1000.0) as u16 {
        let now = plan.at(Seconds::new(f32::from(ms) * 0.001));
        let distance = off(now.pose, sharp.pose);
        if distance < nearest {
            (nearest, slowest) = (distance, now.twist.vx.hypot(now.twist.vy));
        }
        rounded = rounded.min(off(now.pose, COURSE.waypoints()[1].pose));
    }
    assert!(nearest < 1e-4 && slowest < 0.01, "{nearest} m, {slowest} m/s");
    // An arc passes its corner at radius · (√2 − 1).
    assert!((rounded - 0.6 * 0.414_214).abs() < 1e-4, "{rounded}");
}

#[test]
fn it_stops_in_a_sharp_corner_to_either_side_and_where_it_goes_straight_back() {
    for turned in [FRAC_PI_2, -FRAC_PI_2, 0.1, -0.1, 2.5, -2.5, PI] {
        let (sin, cos) = turned.sin_cos();
        // Straight back it is exact.
        let sin = if cos <= -1.0 { 0.0 } else { sin };
        for [x, y] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
            let end = waypoint(x + x * cos - y * sin, y + y * cos + x * sin, 0.0);
            let path = Path::new([waypoint(0.0, 0.0, 0.0), waypoint(x, y, 0.0), end]).unwrap();
            check_limits(&Plan::new(&path, &MECANUM, &LIMITS, 0.0).unwrap(), &MECANUM, &LIMITS);
        }
    }
}

#[test]
fn a_straight_path_takes_the_time_of_a_trapezoid() {
    let time = |length: f32, max_speed, start| {
        let path = Path::new([waypoint(-1.0, 0.0, 1.0), waypoint(length - 1.0, 0.0, 1.0)]).unwrap();
        let limits = PathLimits { max_speed_m_s: max_speed, ..LIMITS };
        Plan::new(&path, &MECANUM, &limits, start).unwrap().duration().get()
    };
    // v / a + s / v, and 2 √(s / a). From the start speed u the way to a stand begins earlier, by
    // u² / 2 a and u / a.
    for (length, max_speed, start, exact) in [
        (3.0, 1.5, 0.0, 1.5 / 3.0 + 3.0 / 1.5),
        (5.0, 2.0, 0.0, 2.0 / 3.0 + 5.0 / 2.0),
        (1.0, 2.0, 0.0, 2.0 * (1.0_f32 / 3.0).sqrt()),
        (0.01, 2.0, 0.0, 2.0 * (0.01_f32 / 3.0).sqrt()),
        (3.0, 1.5, 0.9, 1.5 / 3.0 + (3.0 + 0.81 / 6.0) / 1.5 - 0.9 / 3.0),
    ] {
        let took = time(length, max_speed, start);
        // Where it reaches its highest speed a cell of the grid is rounded off.
        assert!((took / exact - 1.0).abs() < 2e-3, "{length} m: {took} s, not {exact} s");
        assert!(took > exact * (1.0 - 2e-5), "{length} m: {took} s, not {exact} s");
    }
}

#[test]
fn what_cannot_be_a_path_is_refused_with_the_waypoint() {
    let ahead = |x, y| waypoint(x, y, 0.0);
    let text = |error: PathError| error.to_string();
    assert_eq!(Path::new([ahead(0.0, 0.0)]), Err(PathError::TooFewWaypoints));
    assert_eq!(Path::<0>::new([]), Err(PathError::TooFewWaypoints));
    let same = Path::new([ahead(0.0, 0.0), ahead(1.0, 0.0), ahead(1.0, 5e-4)]);
    assert_eq!(text(same.unwrap_err()), "waypoint 2: at the place of the one before");
    for bad in [f32::NAN, f32::INFINITY, 1001.0] {
        for one in [waypoint(bad, 0.0, 0.0), waypoint(0.0, bad, 0.0), waypoint(0.0, 0.0, bad)] {
            let error = Path::new([ahead(9.0, 0.0), one]).unwrap_err();
            assert!(matches!(error, PathError::Waypoint { waypoint: 1, .. }), "{error}");
        }
    }
    for (field, one) in [
        ("radius_m", ahead(1.0, 0.0).rounded(-0.1)),
        ("radius_m", ahead(1.0, 0.0).rounded(f32::NAN)),
        ("max_speed_m_s", ahead(1.0, 0.0).at_most(-1.0)),
        ("max_speed_m_s", ahead(1.0, 0.0).at_most(f32::NAN)),
    ] {
        let error = Path::new([ahead(0.0, 0.0), one, ahead(2.0, 0.0)]).unwrap_err();
        let PathError::Waypoint { waypoint: 1, error } = error else { panic!("{error}") };
        assert_eq!(error.field, field);
    }
    // At its ends there is no corner.
    let error = Path::new([ahead(0.0, 0.0), ahead(1.0, 0.0).rounded(0.1)]).unwrap_err();
    assert!(text(error).contains("waypoint 1: `radius_m` is 0.1, but must be 0"), "{error}");
    // A right angle takes its radius of both legs.
    let corner = |radius, length| {
        Path::new([ahead(0.0, 0.0), ahead(1.0, 0.0).rounded(radius), ahead(1.0, length)])
    };
    assert!(corner(0.999, 2.0).is_ok() && corner(0.499, 0.5).is_ok());
    for error in [corner(1.01, 2.0), corner(0.51, 0.5)] {
        assert!(matches!(error, Err(PathError::ArcTooWide { waypoint: 1, .. })), "{error:?}");
    }
    // Two arcs that share a leg.
    let two = |radius| {
        let (a, b) = (ahead(1.0, 0.0).rounded(0.4), ahead(1.0, 1.0).rounded(radius));
        Path::new([ahead(0.0, 0.0), a, b, ahead(3.0, 1.0)])
    };
    assert!(two(0.599).is_ok());
    assert!(matches!(two(0.61), Err(PathError::ArcTooWide { waypoint: 2, .. })));
    // Back by the same way: a stop, but no arc.
    let back =
        |radius| Path::new([ahead(0.0, 0.0), ahead(1.0, 0.0).rounded(radius), ahead(0.1, 0.01)]);
    assert!(back(0.0).is_ok());
    assert_eq!(back(0.1), Err(PathError::TurnsBack { waypoint: 1 }));
}

#[test]
fn what_cannot_be_planned_is_refused() {
    let plan = |limits: &PathLimits, start| Plan::new(&COURSE, &MECANUM, limits, start);
    let differential = Base::differential(0.05, 0.2, LIMIT);
    let refused = Plan::new(&COURSE, &differential, &LIMITS, 0.0);
    assert_eq!(refused, Err(PlanError::CannotMoveSideways));
    let field = |limits: &PathLimits, start| match plan(limits, start) {
        Err(PlanError::Limits(error)) => error.field,
        other => panic!("{other:?}"),
    };
    for bad in [-1.0, 0.0, f32::NAN] {
        assert_eq!(field(&PathLimits { max_speed_m_s: bad, ..LIMITS }, 0.0), "max_speed_m_s");
        assert_eq!(field(&PathLimits { wheel_share: bad, ..LIMITS }, 0.0), "wheel_share");
        let twist = TwistLimits { linear_m_s2: bad, ..LIMITS.twist };
        assert_eq!(field(&PathLimits { twist, ..LIMITS }, 0.0), "linear_m_s2");
    }
    assert_eq!(field(&PathLimits { wheel_share: 1.1, ..LIMITS }, 0.0), "wheel_share");
    assert_eq!(field(&LIMITS, f32::NAN), "start_speed");
    let Err(PlanError::TooFast { allowed }) = plan(&LIMITS, 2.5) else { panic!() };
    assert!((allowed - 2.0).abs() < 1e-4, "{allowed}");
    let mut planner = Planner::new(&COURSE, &MECANUM, &LIMITS, 2.5).unwrap();
    let mut refused = || (0..6).map(|_| planner.step()).filter(Result::is_err).count();
    assert_eq!(refused(), 2);
    assert!(plan(&LIMITS, allowed * 0.9999).is_ok());
}

#[test]
fn portions_make_the_same_plan() {
    let mut planner = Planner::new(&COURSE, &MECANUM, &LIMITS, 0.3).unwrap();
    for _ in 0..7 {
        assert_eq!(planner.step(), Ok(None));
    }
    let whole = Plan::new(&COURSE, &MECANUM, &LIMITS, 0.3).unwrap();
    assert_eq!(planner.step(), Ok(Some(whole)));
    assert_eq!(planner.step(), Ok(Some(whole)));
    // As its documentation says.
    assert_eq!(size_of::<Plan<5>>() - size_of::<Plan<4>>(), 164);
    let start = whole.at(Seconds::ZERO).twist;
    assert!((start.vx - 0.3).abs() < 1e-5 && start.vy.abs() < 1e-6, "{start:?}");
}

#[test]
fn it_turns_the_shorter_way_and_not_beyond_a_waypoint() {
    let path = Path::new([
        waypoint(0.0, 0.0, 3.0),
        waypoint(1.0, 0.0, -3.0),
        waypoint(2.0, 0.0, -2.0),
        waypoint(3.0, 0.0, -2.4),
    ]);
    let plan = Plan::new(&path.unwrap(), &MECANUM, &LIMITS, 0.0).unwrap();
    for ms in 0..(plan.duration().get() * 1000.0) as u16 {
        let heading = plan.at(Seconds::new(f32::from(ms) * 0.001)).pose.heading.get();
        // 3.0 over the seam to −2.0, of which 3.0 is −3.283.
        assert!((3.0 - 1e-5..=PI).contains(&heading) || (-PI..=-2.0 + 1e-5).contains(&heading));
    }
}

mod follower;
