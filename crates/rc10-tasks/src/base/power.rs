use rc10_app::{Joules, NewtonMetres, PowerConfig, PowerInput, PowerLimiter, Rpm, Seconds, Watts};
use rc10_motor::{Link, Motion, Names, Target, TargetKind, Withheld};

use crate::common::Common;
use crate::live::Live;

/// What a [`BaseDriver`](crate::BaseDriver) keeps its wheels' efforts within: nothing, `()`, or a [`BasePower`].
pub trait Limit {
    /// Decides what wheels get for the coming `dt`, which accelerate the body with these torques.
    fn grant<N: Names, const WHEELS: usize>(
        &mut self,
        shared: &Common<'_, N, impl Live>,
        wheels: [N; WHEELS],
        torque_constant: f32,
        torques: [NewtonMetres; WHEELS],
        dt: Seconds,
    ) -> Grant<WHEELS>;
}

/// What wheels are granted of what they wish for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grant<const WHEELS: usize> {
    /// Share of the acceleration, 0 ..= 1.
    pub share: f32,
    /// What is withheld from each wheel.
    pub withheld: [Withheld; WHEELS],
}

impl Limit for () {
    fn grant<N: Names, const WHEELS: usize>(
        &mut self,
        _: &Common<'_, N, impl Live>,
        _: [N; WHEELS],
        _: f32,
        _: [NewtonMetres; WHEELS],
        _: Seconds,
    ) -> Grant<WHEELS> {
        Grant { share: 1.0, withheld: [Withheld::NONE; WHEELS] }
    }
}

/// Keeps the power of a base's wheels within what a referee system allows: for
/// [`BaseDriver::within`](crate::BaseDriver::within).
///
/// The base accelerates by the share of its wish that the power allows, so it keeps its direction, and no wheel's loops
/// make more effort than its part of that power. The loops have to run here: the motor of a wheel that closes its own
/// refuses its commands, and counts them.
#[derive(Clone, Copy, Debug)]
pub struct BasePower<'b> {
    config: &'b PowerConfig,
    /// What is learned, and what is left in the buffer.
    pub limiter: PowerLimiter,
    /// Power that others take from the same supply, as steering.
    pub others: Watts,
    /// Share of the limit that the battery and the motors' temperatures allow, 0 ..= 1.
    pub derating: f32,
}

/// The least share of the largest effort that is granted to a wheel: what it wishes for next may be more than what it
/// wishes for now.
const LEAST: f32 = 0.2;

impl<'b> BasePower<'b> {
    /// Nothing has been heard: the lowest limit of the rules.
    pub const fn new(config: &'b PowerConfig) -> Self {
        Self { config, limiter: PowerLimiter::new(config), others: Watts::ZERO, derating: 1.0 }
    }

    /// Takes what the referee says: its limit, and whole joules in the buffer. Once for each time that it says so.
    pub fn hear(&mut self, limit: Watts, buffer: Joules) {
        self.limiter.hear(self.config, limit, buffer);
    }
}

impl Limit for BasePower<'_> {
    fn grant<N: Names, const WHEELS: usize>(
        &mut self,
        shared: &Common<'_, N, impl Live>,
        wheels: [N; WHEELS],
        torque_constant: f32,
        torques: [NewtonMetres; WHEELS],
        dt: Seconds,
    ) -> Grant<WHEELS> {
        let mut input = PowerInput {
            wished: torques,
            measured: [NewtonMetres::ZERO; WHEELS],
            speeds: [Rpm::ZERO; WHEELS],
            others: self.others,
            derating: self.derating,
        };
        let model = self.limiter.model(self.config);
        let (mut full, mut directions, mut most) = ([0.0; WHEELS], [0.0; WHEELS], 0.0_f32);
        let (mut slow, mut of_body) = ([false; WHEELS], 0.0);
        for (at, port) in wheels.map(|name| shared.motor(name)).into_iter().enumerate() {
            // A voltage is no torque.
            let tuning =
                port.tuning().map(|[_, now]| now).filter(|it| it.effort != TargetKind::Duty);
            full[at] = tuning.map_or(0.0, |it| it.limit * torque_constant);
            let (effort, given) = port.look(|status| {
                // What a lost one measured last is not what it does.
                if status.link != Link::Online {
                    return (0.0, 0.0);
                }
                let effort = status.feedback.effort().unwrap_or(0.0) * torque_constant;
                input.speeds[at] = status.feedback.speed;
                input.measured[at] = status.feedback.torque().unwrap_or(NewtonMetres::new(effort));
                match status.target {
                    Target::Motion(Motion { inertia, .. }) => (effort, inertia * torque_constant),
                    _ => (effort, 0.0),
                }
            });
            // Friction, a slope, an error of the speed: what its loops make beside the acceleration stays.
            let wish = torques[at].get() + effort - given;
            let speed = input.speeds[at].get();
            of_body += torques[at].get() * speed;
            // A fast wheel takes no power to brake, a slow one does.
            slow[at] = model.braking_takes_power(NewtonMetres::new(full[at]), input.speeds[at]);
            directions[at] = if slow[at] { wish } else { speed };
            let size = if slow[at] || wish * speed > 0.0 { wish.abs() } else { 0.0 };
            input.wished[at] = NewtonMetres::new(size);
            most = most.max(size / full[at]);
        }
        // Wished for is the most in that direction: it is what the loops may come to until the next step.
        let scale = if most > 0.0 { 1.0 / most } else { 0.0 };
        for (at, wish) in input.wished.iter_mut().enumerate() {
            let size = (wish.get() * scale).max(LEAST * full[at]);
            *wish = NewtonMetres::new(size.copysign(directions[at]));
        }
        let granted = self.limiter.allocate(self.config, &input, dt);
        // A body that slows down is not kept from it.
        let is_free = most <= 0.0 || of_body < 0.0;
        let share = if is_free { 1.0 } else { (granted.share * scale).min(1.0) };
        let withheld = core::array::from_fn(|at| {
            let left = granted.torques[at].get().abs() / full[at];
            // NaN is nothing.
            let driving = if left > 0.0 { (1.0 - left).max(0.0) } else { 1.0 };
            Withheld { driving, braking: if slow[at] { driving } else { 0.0 } }
        });
        Grant { share, withheld }
    }
}
