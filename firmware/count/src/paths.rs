//! Paths: a tick of the follower, and both portions of a plan.

use core::hint::black_box;

use rc10_app::path::{
    Follower, FollowerConfig, FollowerOutput, Path, PathLimits, Plan, PlanError, Planner,
    PoseNotFinite, Waypoint,
};
use rc10_app::{Base, Pose, Radians, Rpm, Seconds, TwistLimits};

const BASE: Base<4> = Base::mecanum(0.076, 0.20, 0.22, Rpm::new(400.0));
const PATH: Path<5> = Path::sound([
    Waypoint::new(0.0, 0.0, Radians::new(0.0)),
    Waypoint::new(1.0, 0.0, Radians::new(1.0)).rounded(0.3),
    Waypoint::new(1.0, 1.5, Radians::new(2.0)).rounded(0.2),
    Waypoint::new(0.0, 1.0, Radians::new(4.0)),
    Waypoint::new(0.3, -0.2, Radians::new(2.0)),
]);
const LIMITS: PathLimits = PathLimits {
    twist: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    max_speed_m_s: 2.0,
    wheel_share: 0.9,
};

/// Measures both.
pub fn measure() {
    let Ok(mut planner) = Planner::new(black_box(&PATH), black_box(&BASE), &LIMITS, 0.0) else {
        cortex_m::asm::udf()
    };
    let plan = loop {
        match portion(&mut planner) {
            Ok(Some(plan)) => break plan,
            Ok(None) => {}
            Err(_) => cortex_m::asm::udf(),
        }
    };
    if whole(black_box(&PATH), black_box(&BASE)).is_err() {
        cortex_m::asm::udf();
    }
    let mut follower = Follower::new();
    let mut pose = Pose::IDENTITY;
    for round in 0..1500_u16 {
        let Ok(step) = tick(&mut follower, &plan, black_box(&pose)) else { cortex_m::asm::udf() };
        // It goes where it shall, but for an error that is corrected, limited, and waited for.
        let off = match round % 7 {
            0 => 0.3,
            1..=3 => 0.02,
            _ => -0.08,
        };
        let Pose { x, y, heading, .. } = step.target;
        pose = Pose::new(x + off, y - 0.5 * off, heading + Radians::new(7.0 * off));
    }
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_1_plan_portion")]
#[inline(never)]
fn portion(planner: &mut Planner<'_, 5>) -> Result<Option<Plan<5>>, PlanError> {
    planner.step()
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_4_plan_leg")]
#[inline(never)]
fn whole(path: &Path<5>, base: &Base<4>) -> Result<Plan<5>, PlanError> {
    Plan::new(path, base, &LIMITS, 0.0)
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_1_path_follower")]
#[inline(never)]
fn tick(
    follower: &mut Follower,
    plan: &Plan<5>,
    pose: &Pose,
) -> Result<FollowerOutput, PoseNotFinite> {
    follower.update(&FollowerConfig::DEFAULT, plan, *pose, Seconds::new(0.005))
}
