//! Paths against the least time by dynamic programming in f64 (`golden/paths.py`).

use rc10_app::path::{Path, PathLimits, Plan, Waypoint};
use rc10_app::{Base, Radians, Rpm, TwistLimits};

const LIMIT: Rpm = Rpm::new(450.0);

#[test]
fn the_time_is_the_least_within_two_percent() {
    let (mut paths, mut sum, mut worst) = (0_u8, 0.0_f32, 0.0_f32);
    for line in include_str!("golden/paths.csv").lines().skip(1) {
        let (base, numbers) = line.split_once(',').unwrap();
        let numbers: Vec<f32> = numbers.split(',').map(|number| number.parse().unwrap()).collect();
        let [linear_m_s2, angular_rad_s2, max_speed_m_s, _, time] = numbers[..5] else {
            panic!("{line}");
        };
        let waypoints: Vec<_> = numbers[5..]
            .chunks_exact(5)
            .map(|one| Waypoint {
                radius_m: one[3],
                ..Waypoint::new(one[0], one[1], Radians::new(one[2])).at_most(one[4])
            })
            .collect();
        let path: Path<5> = Path::new(waypoints.try_into().unwrap()).unwrap();
        let limits = PathLimits {
            twist: TwistLimits { linear_m_s2, angular_rad_s2 },
            max_speed_m_s,
            wheel_share: 1.0,
        };
        let plan = match base {
            "mecanum" => Plan::new(&path, &Base::mecanum(0.076, 0.20, 0.25, LIMIT), &limits, 0.0),
            "omni_4" => Plan::new(&path, &Base::omni_4(0.076, 0.25, LIMIT), &limits, 0.0),
            _ => Plan::new(&path, &Base::omni_3(0.05, 0.2, LIMIT), &limits, 0.0),
        };
        let more = plan.unwrap().duration().get() / time - 1.0;
        println!("path {paths}: {base}, {time} s, {:.2} % more", 100.0 * more);
        // Not faster either: a limit would be broken.
        assert!((-1e-3..0.02).contains(&more), "path {paths}: {more}");
        (paths, sum, worst) = (paths + 1, sum + more, worst.max(more));
    }
    assert_eq!(paths, 60);
    println!("mean {:.2} %, worst {:.2} %", 100.0 * sum / f32::from(paths), 100.0 * worst);
}
