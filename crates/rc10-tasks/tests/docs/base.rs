// The base of `DrivenBase`, for other examples in the docs.
use rc10_app::{Base, Body, Rpm, Twist, TwistLimits};
use rc10_motor::{Entry, Place::Bus, dji::{Config, Dji, M3508}, motors};
use rc10_tasks::DrivenBase;

motors! {
    pub enum Name;
    pub struct Motors;
    Left: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)),
    Right: Dji = Entry::new(Bus(1), Config::new(&M3508, 2)),
}

pub const BASE: DrivenBase<Name, 2> = DrivenBase {
    wheels: [Name::Left, Name::Right],
    geometry: Base::differential(0.05, 0.2, Rpm::new(400.0)),
    body: Body { mass_kg: 8.0, yaw_inertia_kg_m2: 0.2 },
    torque_constant: Config::new(&M3508, 1).torque_constant(),
    limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
    full_stick: Twist::new(1.5, 0.0, 4.0),
};
