// The path of the module `path`, for other examples in the docs.
use rc10_app::path::{Path, PathLimits, Waypoint};
use rc10_app::{Base, Radians, Rpm, TwistLimits};

pub const BASE: Base<4> = Base::mecanum(0.076, 0.20, 0.25, Rpm::new(450.0));
pub const PATH: Path<3> = Path::sound([
    Waypoint::new(0.0, 0.0, Radians::new(0.0)),
    Waypoint::new(2.0, 0.0, Radians::new(0.0)).rounded(0.4),
    Waypoint::new(2.0, 1.0, Radians::new(1.5)),
]);
pub const LIMITS: PathLimits = PathLimits {
    twist: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    max_speed_m_s: 2.0,
    wheel_share: 0.9,
};
