//! A base that drives: its wheels, the motors that turn them, and the motion that they are commanded.

use rc10_app::swerve::Module;
use rc10_app::{
    Base, BaseMotion, Body, FieldFrame, PowerConfig, Radians, Rpm, Seconds, Swerve, SwerveState,
    TotalAngle, Twist, TwistLimiter, TwistLimits,
};
use rc10_module::remote::Remote;
use rc10_motor::{Motion, Names, Target};

use crate::common::Common;
use crate::live::Live;

mod power;

pub use power::{BasePower, Grant, Limit};

/// A base with the motors of its wheels: a constant in a robot's table, for a [`BaseDriver`].
///
/// ```
/// # use rc10_app::{Base, Body, Rpm, Twist, TwistLimits};
/// # use rc10_motor::{Entry, Place::Bus, dji::{Config, Dji, M3508}, motors};
/// # motors! {
/// #     pub enum Name;
/// #     pub struct Motors;
/// #     Left: Dji = Entry::new(Bus(1), WHEEL),
/// #     Right: Dji = Entry::new(Bus(1), Config::new(&M3508, 2)),
/// # }
/// use rc10_tasks::DrivenBase;
/// const WHEEL: Config = Config::new(&M3508, 1);
/// const BASE: DrivenBase<Name, 2> = DrivenBase {
///     wheels: [Name::Left, Name::Right],
///     geometry: Base::differential(0.05, 0.2, Rpm::new(400.0)),
///     body: Body { mass_kg: 8.0, yaw_inertia_kg_m2: 0.2 },
///     torque_constant: WHEEL.torque_constant(),
///     limits: TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 },
///     full_stick: Twist::new(1.5, 0.0, 4.0),
/// };
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DrivenBase<N, const WHEELS: usize> {
    /// The motors of the wheels, in the order of the base.
    pub wheels: [N; WHEELS],
    /// Where the wheels are.
    pub geometry: Base<WHEELS>,
    /// The body on the wheels.
    pub body: Body,
    /// Torque of a wheel's motor, at its output shaft, per unit of its effort: N m/A, or 1 where that
    /// is N m.
    pub torque_constant: f32,
    /// Largest accelerations at which its wheels do not slip.
    pub limits: TwistLimits,
    /// The twist with the sticks at their ends.
    pub full_stick: Twist,
}

impl<N: Names, const WHEELS: usize> DrivenBase<N, WHEELS> {
    /// Returns the motion of the base as its wheels measure it.
    #[must_use]
    pub fn measured(&self, shared: &Common<'_, N, impl Live>) -> BaseMotion<WHEELS> {
        self.geometry.forward(self.wheels.map(|name| shared.motor(name).status().feedback.speed))
    }
}

/// A swerve base with its motors: a constant in a robot's table, for a [`BaseDriver`].
#[derive(Clone, Copy, Debug)]
pub struct DrivenSwerve<N, const MODULES: usize> {
    /// The motors of the wheels, in the order of the base.
    pub drives: [N; MODULES],
    /// The motors that steer them.
    pub steers: [N; MODULES],
    /// The angles at which those stand while the wheels look ahead.
    pub ahead: [TotalAngle; MODULES],
    /// Where the modules are.
    pub geometry: Swerve<MODULES>,
    /// The body on the wheels.
    pub body: Body,
    /// Torque of a wheel's motor, as of a [`DrivenBase`].
    pub torque_constant: f32,
    /// Largest accelerations at which its wheels do not slip.
    pub limits: TwistLimits,
    /// The twist with the sticks at their ends.
    pub full_stick: Twist,
}

impl<N: Names, const MODULES: usize> DrivenSwerve<N, MODULES> {
    fn modules(&self, shared: &Common<'_, N, impl Live>) -> [Module; MODULES] {
        core::array::from_fn(|at| {
            let speed = shared.motor(self.drives[at]).status().feedback.speed;
            let angle = shared.motor(self.steers[at]).status().feedback.total_angle;
            Module { speed, angle: angle.minus(self.ahead[at]) }
        })
    }

    /// Returns the motion of the base as its modules measure it.
    #[must_use]
    pub fn measured(&self, shared: &Common<'_, N, impl Live>) -> BaseMotion<MODULES> {
        self.geometry.forward(self.modules(shared))
    }
}

/// A base that a [`BaseDriver`] drives.
pub trait Drive {
    /// Names of the robot's motors.
    type Name: Names;
    /// The state that is kept from one command to the next.
    type State: Default;

    /// Largest accelerations, and the twist with the sticks at their ends.
    fn limits(&self) -> (&TwistLimits, Twist);

    /// Returns the twist of the sticks: the left one moves the base, the right one turns it.
    fn sticks(&self, remote: &Remote) -> Twist {
        let (_, full) = self.limits();
        // Sticks count to the right, the robot to the left.
        let [x, y, turn] = [-remote.left.x, remote.left.y, -remote.right.x];
        Twist::new(y * full.vx, x * full.vy, turn * full.wz)
    }

    /// Returns its twist as its wheels measure it.
    fn twist(&self, shared: &Common<'_, Self::Name, impl Live>) -> Twist;

    /// Commands its wheels: the base has this twist now, in its own axes, which changes by this much a
    /// second. The wheels get speed, acceleration, and the effort that the body takes, and go on with
    /// that until the next command. Where a number is not finite they refuse it, and that is counted. Returns the
    /// share of the change that the limit grants for the coming `dt`.
    fn command(
        &self,
        state: &mut Self::State,
        shared: &Common<'_, Self::Name, impl Live>,
        motion: [Twist; 2],
        limit: &mut impl Limit,
        dt: Seconds,
    ) -> f32;
}

impl<N: Names, const WHEELS: usize> Drive for DrivenBase<N, WHEELS> {
    type Name = N;
    type State = ();

    fn limits(&self) -> (&TwistLimits, Twist) {
        (&self.limits, self.full_stick)
    }

    fn twist(&self, shared: &Common<'_, N, impl Live>) -> Twist {
        self.measured(shared).twist
    }

    fn command(
        &self,
        (): &mut (),
        shared: &Common<'_, N, impl Live>,
        [twist, change]: [Twist; 2],
        limit: &mut impl Limit,
        dt: Seconds,
    ) -> f32 {
        let wheels = self.geometry.inverse(twist);
        let speeds = wheels.map_or([REFUSED; WHEELS], |wheels| wheels.speeds);
        let accelerations = self.geometry.accelerations(change);
        let torques = self.geometry.torques(&self.body, twist, change);
        let Grant { share, withheld } =
            limit.grant(shared, self.wheels, self.torque_constant, torques, dt);
        for (at, name) in self.wheels.into_iter().enumerate() {
            let motion = Motion {
                speed: speeds[at],
                acceleration: accelerations[at] * share,
                inertia: torques[at].get() / self.torque_constant * share,
                ..Motion::default()
            };
            shared.command_within(name, Target::Motion(motion), withheld[at]);
        }
        share
    }
}

impl<N: Names, const MODULES: usize> Drive for DrivenSwerve<N, MODULES> {
    type Name = N;
    type State = SwerveState<MODULES>;

    fn limits(&self) -> (&TwistLimits, Twist) {
        (&self.limits, self.full_stick)
    }

    fn twist(&self, shared: &Common<'_, N, impl Live>) -> Twist {
        self.measured(shared).twist
    }

    fn command(
        &self,
        state: &mut SwerveState<MODULES>,
        shared: &Common<'_, N, impl Live>,
        motion: [Twist; 2],
        limit: &mut impl Limit,
        dt: Seconds,
    ) -> f32 {
        let angles = self.modules(shared).map(|module| module.angle);
        let Ok(motions) = state.motions(&self.geometry, &self.body, motion, angles) else {
            for name in self.drives {
                shared.command(name, Target::Speed(REFUSED));
            }
            return 1.0;
        };
        let torques = motions.each_ref().map(|motion| motion.torque);
        let Grant { share, withheld } =
            limit.grant(shared, self.drives, self.torque_constant, torques, dt);
        for (at, motion) in motions.into_iter().enumerate() {
            let drive = Motion {
                speed: motion.module.speed,
                acceleration: motion.acceleration * share,
                inertia: motion.torque.get() / self.torque_constant * share,
                ..Motion::default()
            };
            let angle = Some(motion.module.angle.plus(self.ahead[at]));
            let steer = Motion { angle, speed: motion.turning, ..Motion::default() };
            shared.command_within(self.drives[at], Target::Motion(drive), withheld[at]);
            shared.command(self.steers[at], Target::Motion(steer));
        }
        share
    }
}

/// A speed that every motor refuses and counts.
const REFUSED: Rpm = Rpm::new(f32::NAN);

/// A driver of a base: from the twist that is wished for to its wheels' commands, as fast as they grip.
///
/// It takes over the motion that the wheels have when it begins, for the robot may be rolling. A twist that is
/// not finite is refused by the wheels' motors, and counted there.
pub struct BaseDriver<'b, B: Drive, L = ()> {
    base: &'b B,
    /// What its wheels' efforts are kept within.
    pub limit: L,
    state: B::State,
    /// The twist that the wheels are brought to, once it drives.
    commanded: Option<Twist>,
    /// The same in the field's axes, while it is driven in those.
    in_field: Option<TwistLimiter<FieldFrame>>,
}

impl<'b, B: Drive> BaseDriver<'b, B> {
    /// Creates the driver of a base that rests.
    #[must_use]
    pub fn new(base: &'b B) -> Self {
        Self { base, limit: (), state: B::State::default(), commanded: None, in_field: None }
    }

    /// The same within a limit of power.
    ///
    /// ```
    /// # mod table { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/docs/base.rs")); }
    /// # use rc10_app::{Joules, PowerConfig, PowerModel, Watts};
    /// # use table::BASE;
    /// use rc10_tasks::BaseDriver;
    ///
    /// const POWER: PowerConfig = PowerConfig {
    ///     model: PowerModel { mechanical: 1.0, per_speed: 0.22, per_torque: 1.2, idle: 2.78, returned: 0.0 },
    ///     uncertainty: 2.2,
    ///     limits: [Watts::new(45.0), Watts::new(120.0)],
    ///     buffer: Joules::new(60.0),
    /// };
    /// let mut base = BaseDriver::new(&BASE).within(&POWER);
    /// // When the referee's commands 0x0201 and 0x0202 have come:
    /// base.limit.hear(Watts::new(80.0), Joules::new(42.0));
    /// ```
    #[must_use]
    pub fn within(self, config: &'b PowerConfig) -> BaseDriver<'b, B, BasePower<'b>> {
        let Self { base, limit: (), state, commanded, in_field } = self;
        BaseDriver { base, limit: BasePower::new(config), state, commanded, in_field }
    }
}

impl<B: Drive, L: Limit> BaseDriver<'_, B, L> {
    /// Lets it rest: without commands its bus makes the wheels safe. Call it while the robot does not
    /// [obey](Common::obey).
    pub fn rest(&mut self) {
        (self.state, self.commanded, self.in_field) = (B::State::default(), None, None);
    }

    /// Returns the twist that it has been commanded; a standstill while it rests.
    pub fn commanded(&self) -> Twist {
        self.commanded.unwrap_or(Twist::STOP)
    }

    /// Drives towards a twist in the robot's axes, for the coming `dt`.
    pub fn drive(&mut self, shared: &Common<'_, B::Name, impl Live>, wish: Twist, dt: Seconds) {
        let from = self.begin(shared);
        self.in_field = None;
        let to = begun(from).update(self.base.limits().0, wish, dt).ok();
        self.go(shared, from, to, dt);
    }

    /// Drives towards a twist in the field's axes, in which the robot looks to `heading`.
    pub fn drive_in_field(
        &mut self,
        shared: &Common<'_, B::Name, impl Live>,
        wish: Twist<FieldFrame>,
        heading: Radians,
        dt: Seconds,
    ) {
        let from = self.begin(shared);
        let mut limiter = self.in_field.unwrap_or_else(|| begun(from.out_of_frame(heading)));
        let before = limiter.twist();
        let to = limiter.update(self.base.limits().0, wish, dt).ok();
        let share = self.go(shared, from, to.map(|twist| twist.into_frame(heading)), dt);
        if let Some(to) = to.filter(|_| share < 1.0) {
            // It goes on from what was granted: a share of the change in the field, in which the axes do not turn.
            limiter.reset(before + (to - before) * share);
            self.commanded = Some(limiter.twist().into_frame(heading));
        }
        self.in_field = Some(limiter);
    }

    /// Follows a motion that keeps the limits by itself, such as a path's: its mean twist in the coming `dt`, and
    /// how that changes a second. Returns the share of the acceleration that is granted: a path goes on all the same.
    pub fn follow(
        &mut self,
        shared: &Common<'_, B::Name, impl Live>,
        [twist, change]: [Twist; 2],
        dt: Seconds,
    ) -> f32 {
        let half = change * (0.5 * dt.get());
        self.commanded = Some(twist + half).filter(|twist| twist.is_finite()).or(self.commanded);
        self.in_field = None;
        let motion = [twist - half, change];
        self.base.command(&mut self.state, shared, motion, &mut self.limit, dt)
    }

    fn begin(&self, shared: &Common<'_, B::Name, impl Live>) -> Twist {
        self.commanded.unwrap_or_else(|| self.base.twist(shared))
    }

    fn go(
        &mut self,
        shared: &Common<'_, B::Name, impl Live>,
        from: Twist,
        to: Option<Twist>,
        dt: Seconds,
    ) -> f32 {
        let nothing = Twist::new(REFUSED.get(), 0.0, 0.0);
        let motion = to.map_or([nothing; 2], |to| [from, (to - from) * (1.0 / dt.get())]);
        let share = self.base.command(&mut self.state, shared, motion, &mut self.limit, dt);
        // All of it as it is: the same bits as without a limit.
        let granted = to.map(|to| if share < 1.0 { from + (to - from) * share } else { to });
        self.commanded = Some(granted.unwrap_or(from));
        share
    }
}

/// A limiter that goes on from this twist.
fn begun<F: rc10_app::Frame>(twist: Twist<F>) -> TwistLimiter<F> {
    let mut limiter = TwistLimiter::new();
    limiter.reset(twist);
    limiter
}
