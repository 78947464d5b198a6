//! A base that drives: its wheels, and the motors that turn them.

use rc10_app::{Base, BaseMotion, Body, Rpm, Twist};
use rc10_motor::{Motion, Names, Target};

use crate::common::Common;

/// A base with the motors of its wheels: a constant in a robot's table.
///
/// ```
/// # use rc10_app::{Base, Body, Rpm};
/// # use rc10_motor::{Entry, Place::Bus, dji::{Config, Dji, M3508}, motors};
/// # motors! {
/// #     pub enum Name;
/// #     pub struct Motors;
/// #     buses: [100.0; 1];
/// #     lines: 0;
/// #     Left: Dji = Entry::new("left", Bus(1), WHEEL),
/// #     Right: Dji = Entry::new("right", Bus(1), Config::new(&M3508, 2)),
/// # }
/// use rc10_tasks::DrivenBase;
/// const WHEEL: Config = Config::new(&M3508, 1);
/// const BASE: DrivenBase<Name, 2> = DrivenBase {
///     wheels: [Name::Left, Name::Right],
///     base: Base::differential(0.05, 0.2, Rpm::new(400.0)),
///     body: Body { mass: 8.0, yaw_inertia: 0.2 },
///     torque_constant: WHEEL.torque_constant(),
/// };
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DrivenBase<N, const WHEELS: usize> {
    /// The motors of the wheels, in the order of the base.
    pub wheels: [N; WHEELS],
    /// Where the wheels are.
    pub base: Base<WHEELS>,
    /// The body on the wheels.
    pub body: Body,
    /// Torque of a wheel's motor, at its output shaft, per unit of its effort: N m/A, or 1 where that
    /// is N m.
    pub torque_constant: f32,
}

impl<N: Names, const WHEELS: usize> DrivenBase<N, WHEELS> {
    /// The motion as the wheels measure it.
    #[must_use]
    pub fn measured<const BUSES: usize, const LINES: usize>(
        &self,
        shared: &Common<'_, N, BUSES, LINES>,
    ) -> BaseMotion<WHEELS> {
        self.base.forward(self.wheels.map(|name| shared.motor(name).status().feedback.speed))
    }

    /// Commands its wheels: the base has this `twist` now, in its own axes, which changes by `change`
    /// a second. The wheels get speed, acceleration, and the effort that the body takes, and go on with
    /// that until the next command. Where a number is not finite they refuse it, and that is counted.
    pub fn drive<const BUSES: usize, const LINES: usize>(
        &self,
        shared: &Common<'_, N, BUSES, LINES>,
        twist: Twist,
        change: Twist,
    ) {
        let wheels = self.base.inverse(twist);
        let speeds = wheels.map_or([Rpm::new(f32::NAN); WHEELS], |wheels| wheels.speeds);
        let accelerations = self.base.accelerations(change);
        let torques = self.base.torques(&self.body, twist, change);
        for (at, name) in self.wheels.into_iter().enumerate() {
            let motion = Motion {
                angle: None,
                speed: speeds[at],
                acceleration: accelerations[at],
                inertia: torques[at].get() / self.torque_constant,
                effort: 0.0,
            };
            shared.command(name, Target::Motion(motion));
        }
    }
}
