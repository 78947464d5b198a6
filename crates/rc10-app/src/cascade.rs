//! The cascade of most motors: an angle loop around a speed loop, at the output shaft, softly.
//!
//! * The angle loop asks for a speed, never for one it could not brake from in time.
//! * The speed reference moves at a limited acceleration and starts at the measured speed.
//! * A motion known in advance is followed by [`FeedForward`]; the loops correct the rest.
//! * Switching between kinds of target, and coming back after a pause, gives no kick.
//!
//! The **effort** has the actuator's unit: amperes, or a share of the full voltage.

use crate::config::positive;
use crate::maths::{fast_sqrt, within};
use crate::ok;
use crate::{ConfigError, FeedForward, PidConfig, PidInput, PidState, RpmPerSecond, Seconds};

/// Gains and limits of both loops.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Cascade {
    /// Speed loop: effort per rpm of error.
    pub speed: PidConfig,
    /// Angle loop: rpm per degree of error; its output limit is the largest speed it asks for.
    pub angle: PidConfig,
    /// Ticks from one step of the angle loop to the next (0 counts as 1).
    pub outer_divider: u8,
    /// The largest rate of change of the speed reference, and the deceleration of the angle loop.
    pub acceleration: RpmPerSecond,
    /// Effort that the motion of the reference takes, added to that of the loops.
    pub feed_forward: FeedForward,
}

impl Cascade {
    /// Checks every field; the error names the first that is wrong, and what it must be.
    pub const fn validate(&self) -> Result<(), ConfigError> {
        ok!(self.speed.validate(), in "speed");
        ok!(self.angle.validate(), in "angle");
        ok!(positive("acceleration", self.acceleration.get()));
        // The speed reference is ramped, and an angle has no setpoint of its own: a way is left.
        ok!(unweighted(&self.speed), in "speed");
        ok!(unweighted(&self.angle), in "angle");
        ok!(self.feed_forward.validate(), in "feed_forward");
        Ok(())
    }

    /// From the tick `count` to the next one in which the angle loop runs: 1 ..= divider.
    const fn ticks_to_next(&self, count: u32) -> u8 {
        let divider = if self.outer_divider == 0 { 1 } else { self.outer_divider };
        #[expect(clippy::cast_possible_truncation, reason = "a remainder of a u8")]
        return divider - (count % divider as u32) as u8;
    }
}

const fn unweighted(pid: &PidConfig) -> Result<(), ConfigError> {
    let weight = pid.setpoint_weight;
    ConfigError::check(weight >= 1.0, "setpoint_weight", weight, "1 in a cascade")
}

/// 1 rpm in degrees a second.
const DEGREES_PER_SECOND: f32 = 6.0;

/// The speed at which the acceleration limit just stops in time, if the angle loop asked for more.
fn brake_in_time(config: &Cascade, way: f32, asked: f32) -> f32 {
    let (kp, steepest) = (config.angle.kp, config.acceleration.get());
    if kp <= 0.0 {
        return asked;
    }
    // v² = 2 a s, in rpm and degrees: 1 rpm = 6 degrees a second. It meets the proportional law
    // where that needs the same deceleration, without a corner.
    let knee = steepest / (DEGREES_PER_SECOND * kp);
    within(asked, fast_sqrt(steepest * (way.abs() - 0.5 * knee / kp) * (1.0 / 3.0)))
}

/// Share of full scale by which the effort may change per second during a soft start.
const SOFT_SLOPE: f32 = 100.0;
/// Length of a soft start in seconds: 20 ms, and half a tick more for rounding.
const SOFT_TIME: f32 = 0.0205;
/// Seconds: what a reference is away that began at a false speed, at its acceleration. Less is soon made up for.
const FALSE_START: f32 = 0.2;

/// Share of full scale below which the effort of an acceleration tells nothing of the load.
const LEAST_LOAD: f32 = 0.01;
/// Share of full scale from which on it tells all of it.
const TELLING_LOAD: f32 = 0.05;
/// The least that a load may be learned to be, as a share above what the feed-forward says.
const LIGHTEST: f32 = -0.8;
/// The other end, like [`LIGHTEST`].
const HEAVIEST: f32 = 2.0;

/// The state of a cascade between two steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CascadeState {
    speed: PidState,
    angle: PidState,
    /// Speed the angle loop asked for last.
    asked: f32,
    /// Speed reference after the acceleration limit, and the acceleration with which that limit moved it
    /// last; zero where it did not.
    reference: f32,
    limited: f32,
    /// Whether it has been at its target since driving began.
    arrived: bool,
    /// By which share the load is heavier than the feed-forward says.
    learned: f32,
    /// For the derivative alone, and only kept up if there is one.
    last_speed: f32,
    /// Seconds for which the effort may only change slowly yet, because driving has just begun.
    soft_time_left: f32,
    /// The loops that ran in the last step.
    active: Active,
    /// Ticks until the angle loop runs again; zero also if no angle is sought, and during a soft start.
    ticks_left: u8,
}

/// The loops that ran last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Active {
    #[default]
    Nothing,
    Effort,
    Speed,
    Angle,
    Motion,
}

/// The goal of a step of a cascade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seek {
    /// A speed, rpm, at the cascade's own acceleration.
    Speed(f32),
    /// An angle this far away, by the angle loop.
    Angle(f32),
    /// A motion that is known. It should not accelerate by more than the cascade does.
    Motion {
        /// Degrees to where it is now; `None`: its speed is all that counts.
        way: Option<f32>,
        /// The speed, rpm.
        speed: f32,
        /// The acceleration, rpm/s.
        acceleration: f32,
        /// Effort that this acceleration takes beside what the feed-forward says of it.
        inertia: f32,
    },
}

/// The measurements and limits of a step of a cascade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Measured speed, rpm.
    pub measured: f32,
    /// Effort that is needed whether it accelerates or not: a weight.
    pub load: f32,
    /// Full scale of the effort.
    pub full: f32,
    /// Time since the last step.
    pub dt: Seconds,
    /// Counts ticks: the angle loop runs where it is a multiple of the divider.
    pub count: u32,
}

impl CascadeState {
    /// At rest.
    pub const fn new() -> Self {
        Self {
            speed: PidState::new(),
            angle: PidState::new(),
            asked: 0.0,
            reference: 0.0,
            limited: 0.0,
            arrived: false,
            learned: 0.0,
            last_speed: 0.0,
            soft_time_left: 0.0,
            active: Active::Nothing,
            ticks_left: 0,
        }
    }

    /// The effort decided last.
    #[inline]
    pub const fn effort(&self) -> f32 {
        self.speed.output()
    }

    /// The speed the speed loop works towards now, rpm.
    pub const fn reference(&self) -> f32 {
        self.reference
    }

    /// No effort; what drives next starts afresh.
    pub fn rest(&mut self) {
        // No effort may be left: it is looked at itself, not only what gave it.
        if self.active != Active::Nothing || self.effort().to_bits() != 0 {
            *self = Self::new();
        }
    }

    /// Whether driving has just begun.
    fn is_soft(&self) -> bool {
        self.soft_time_left > 0.0
    }

    /// Forgets what the loops have gathered, and leaves the present effort softly: no push against
    /// an obstacle goes on. `keep_load` keeps what carries a load.
    pub fn start_over(&mut self, keep_load: bool) {
        self.ticks_left = 0;
        if !keep_load || self.active == Active::Effort {
            (self.learned, self.soft_time_left) = (0.0, 0.0);
            self.active = Active::Nothing;
        }
    }

    /// New gains: no derivative from before, no integral that cannot move; what they make of the
    /// error now is approached softly.
    pub fn change_gains(&mut self, config: &Cascade, measured: f32) {
        self.last_speed = measured;
        if config.speed.ki <= 0.0 {
            self.speed.drop_integral();
        }
        if config.angle.ki <= 0.0 {
            self.angle.drop_integral();
        }
        if self.is_soft() || !matches!(self.active, Active::Nothing | Active::Effort) {
            self.soft_time_left = SOFT_TIME;
            self.ticks_left = 0;
        }
    }

    /// Gives this effort without a loop. `full` is full scale, not below a loop's own output limit.
    pub fn give(&mut self, effort: f32, full: f32, dt: Seconds) {
        let last = self.effort();
        if self.active != Active::Effort {
            self.enter(Active::Effort, 0.0);
        }
        self.speed.preset(within(effort, full));
        if self.is_soft() {
            self.soften(last, full, dt);
        }
    }

    /// One step with the whole feed-forward. What did not drive before starts softly.
    #[inline(always)]
    pub fn seek(&mut self, config: &Cascade, seek: &Seek, step: &Step) {
        let &Step { measured, load, full, dt, count } = step;
        let last = self.effort();
        let next = match seek {
            Seek::Speed(_) => Active::Speed,
            Seek::Angle(_) => Active::Angle,
            Seek::Motion { .. } => Active::Motion,
        };
        if next != self.active {
            self.enter(next, measured);
        }
        let (target, acceleration, inertia) = match *seek {
            Seek::Speed(target) => (target, 0.0, 0.0),
            Seek::Angle(way) => {
                // During a soft start it runs in every tick.
                if self.ticks_left > 0 {
                    self.ticks_left -= 1;
                } else {
                    let ticks = if self.is_soft() { 1 } else { config.ticks_to_next(count) };
                    self.asked = self.ask(config, way, measured, ticks, dt);
                }
                (self.asked, 0.0, 0.0)
            }
            Seek::Motion { way, speed, acceleration, inertia } => {
                // By how much the shaft moves otherwise than the motion.
                let aside = measured - speed;
                let asked = way.map_or(0.0, |way| self.ask(config, way, aside, 1, dt));
                (speed + asked, acceleration, inertia)
            }
        };
        // What is far away is approached as gently in a motion as any other angle.
        let ramped = self.approach(config, target, dt);
        let ramps = ramped != 0.0;
        if ramps && !self.arrived {
            self.doubt(config, target, measured);
        }
        let acceleration = if ramps { ramped } else { acceleration };
        let by_inertia = config.feed_forward.per_rpm_s * acceleration + inertia;
        let tells = by_inertia.abs() > LEAST_LOAD * full;
        if tells {
            self.learn(config, by_inertia, measured, full, dt);
        }
        // The lag behind a reference that is ramped is no load; what an acceleration leaves is learned.
        let integrate = !ramps && !tells;
        let of_speed = config.feed_forward.at_speed(self.reference);
        let feed_forward = of_speed + by_inertia * (1.0 + self.learned) + load;
        self.speed_loop(config, measured, feed_forward, integrate, dt);
        if self.is_soft() {
            self.soften(last, full, dt);
        }
    }

    /// A reference on its first way to a target, which has the shaft far behind it, began at a speed that was a false
    /// one, of a frame that was not the device's. It goes on from the shaft, or from the target that the shaft is beyond.
    #[cold]
    fn doubt(&mut self, config: &Cascade, target: f32, measured: f32) {
        let (ahead, left) = (self.reference - measured, self.reference - target);
        if ahead * left > 0.0 && ahead.abs() > FALSE_START * config.acceleration.get() {
            self.reference = if left > 0.0 { measured.max(target) } else { measured.min(target) };
            self.learned = 0.0;
        }
    }

    /// While a motion accelerates, the integral learns how much the load differs from the
    /// feed-forward. It counts only while accelerating, so it does not overshoot after that.
    fn learn(&mut self, config: &Cascade, by_inertia: f32, measured: f32, full: f32, dt: Seconds) {
        // A start is soft: what lags then is no load.
        if self.is_soft() {
            return;
        }
        // A small acceleration tells less.
        let least = TELLING_LOAD * full;
        let size = by_inertia.abs();
        let per_effort = if size > least { 1.0 / by_inertia } else { by_inertia / (least * least) };
        let step = config.speed.ki * dt.get() * (self.reference - measured) * per_effort;
        let effort = self.effort();
        let is_limited = effort.abs() >= config.speed.output_limit;
        // At the limit only what leads away from it is learned.
        let learned = self.learned + step;
        if learned.is_finite() && !(is_limited && step * per_effort * effort > 0.0) {
            self.learned = learned.clamp(LIGHTEST, HEAVIEST);
        }
    }

    /// Moves the reference to a speed as fast as it may; returns its acceleration on the way.
    fn approach(&mut self, config: &Cascade, target: f32, dt: Seconds) -> f32 {
        let most = config.acceleration.get();
        let (gap, step) = (target - self.reference, most * dt.get());
        if gap.abs() <= step {
            (self.reference, self.limited, self.arrived) = (target, 0.0, true);
            return 0.0;
        }
        self.reference += step.copysign(gap);
        let before = core::mem::replace(&mut self.limited, most.copysign(gap));
        // For one tick alone, or to and fro, it is a measurement that came a tick early or late: no
        // acceleration that takes an effort.
        if before * self.limited > 0.0 { self.limited } else { 0.0 }
    }

    /// The speed that the angle loop asks for. Another angle to seek changes no derivative.
    fn ask(&mut self, config: &Cascade, way: f32, measured: f32, ticks: u8, dt: Seconds) -> f32 {
        self.ticks_left = ticks - 1;
        let input = PidInput { error: way, feed_forward: 0.0, integrate: true };
        let since = dt * f32::from(ticks);
        let turned = || measured * DEGREES_PER_SECOND * since.get();
        let asked = self.angle.update_error(&config.angle, input, turned, since);
        let steepest = config.acceleration.get();
        if asked.abs() * DEGREES_PER_SECOND * config.angle.kp <= steepest {
            asked
        } else {
            brake_in_time(config, way, asked)
        }
    }

    #[inline(always)]
    fn speed_loop(
        &mut self,
        config: &Cascade,
        measured: f32,
        feed_forward: f32,
        integrate: bool,
        dt: Seconds,
    ) {
        let Self { speed, last_speed, reference, .. } = self;
        let error = *reference - measured;
        let change = || measured - core::mem::replace(last_speed, measured);
        let input = PidInput { error, feed_forward, integrate };
        speed.update_error(&config.speed, input, change, dt);
    }

    /// Driving has just begun: the effort may not move far from what it was.
    #[cold]
    fn soften(&mut self, last: f32, full: f32, dt: Seconds) {
        // A step back in time is no step.
        let most = SOFT_SLOPE * full * dt.get().max(0.0);
        // The limit may have been lowered since.
        let step = within(self.effort() - last, most);
        self.speed.override_output(within(last + step, full));
        self.soft_time_left -= dt.get();
    }

    /// Takes over from whatever drove before: softly, if nothing did.
    #[cold]
    fn enter(&mut self, next: Active, measured: f32) {
        let before = core::mem::replace(&mut self.active, next);
        if before == Active::Nothing {
            self.soft_time_left = SOFT_TIME;
        }
        // From speed to angle or back the speed loop simply goes on; else it starts at the
        // measured speed, with the effort that was asked for.
        if matches!(before, Active::Nothing | Active::Effort) {
            self.speed.preset(if before == Active::Effort { self.effort() } else { 0.0 });
            (self.reference, self.arrived) = (measured, false);
            self.last_speed = measured;
            self.learned = 0.0;
        }
        self.angle = PidState::new();
        self.ticks_left = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Seconds = Seconds::new(0.001);
    const CONFIG: Cascade = Cascade {
        speed: PidConfig::within(20.0).kp(0.4).ki(2.0),
        angle: PidConfig::within(400.0).kp(1.3),
        outer_divider: 10,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: FeedForward::NONE,
    };

    fn step(measured: f32) -> Step {
        Step { measured, load: 0.0, full: 20.0, dt: MS, count: 0 }
    }

    #[test]
    fn the_speed_reference_starts_at_the_measured_speed_and_moves_at_the_acceleration() {
        let mut state = CascadeState::new();
        for tick in 1..=100_u8 {
            state.seek(&CONFIG, &Seek::Speed(400.0), &step(50.0));
            assert!((state.reference() - 50.0 - f32::from(tick)).abs() < 1e-3);
        }
    }

    #[test]
    fn a_reference_that_began_at_a_false_speed_begins_anew() {
        // False for a tick, and for much longer than a start is soft.
        let speeds = [(32_000.0, 60.0), (-32_000.0, 60.0), (32_000.0, -60.0)];
        for ((false_speed, target), ticks) in speeds.into_iter().flat_map(|it| [(it, 1), (it, 300)])
        {
            let mut state = CascadeState::new();
            for _ in 0..ticks {
                state.seek(&CONFIG, &Seek::Speed(target), &step(false_speed));
            }
            // At once; and the last 50 rpm at its acceleration.
            state.seek(&CONFIG, &Seek::Speed(target), &step(10.0));
            assert!((10.0..=60.0).contains(&state.reference().abs()), "{}", state.reference());
            for _ in 0..100 {
                state.seek(&CONFIG, &Seek::Speed(target), &step(10.0));
            }
            assert!((state.reference() - target).abs() < 0.01, "{}", state.reference());
        }
        // One that has been at its target stays gentle, whatever is measured: a wheel may slip.
        let mut state = CascadeState::new();
        for _ in 0..500 {
            state.seek(&CONFIG, &Seek::Speed(400.0), &step(400.0));
        }
        for tick in 1..=100_u8 {
            state.seek(&CONFIG, &Seek::Speed(0.0), &step(0.0));
            assert!((state.reference() - 400.0 + f32::from(tick)).abs() < 0.01);
        }
        // A shaft that was really that fast is slowed down as gently as ever.
        let mut state = CascadeState::new();
        for tick in 1..=100_u8 {
            let measured = 300.0 - 0.9 * f32::from(tick);
            state.seek(&CONFIG, &Seek::Speed(0.0), &step(measured));
            assert!((state.reference() - measured).abs() < 11.0);
        }
    }

    #[test]
    fn a_start_is_soft_and_then_is_not_held_back_any_more() {
        let mut state = CascadeState::new();
        let mut last = 0.0;
        for _ in 0..20 {
            state.give(20.0, 20.0, MS);
            assert!((state.effort() - last).abs() <= 2.001);
            last = state.effort();
        }
        assert!((last - 20.0).abs() < 1e-3);
        state.give(20.0, 20.0, MS);
        state.give(-20.0, 20.0, MS);
        assert!((state.effort() + 20.0).abs() < 1e-3);
    }

    #[test]
    fn changing_between_effort_speed_and_angle_gives_no_kick() {
        let mut state = CascadeState::new();
        for _ in 0..100 {
            state.give(5.0, 20.0, MS);
        }
        state.seek(&CONFIG, &Seek::Speed(100.0), &step(100.0));
        assert!((state.effort() - 5.0).abs() < 0.1, "{}", state.effort());
        state.seek(&CONFIG, &Seek::Angle(100.0 / 1.3), &step(100.0));
        assert!((state.effort() - 5.0).abs() < 0.1, "{}", state.effort());
        state.seek(&CONFIG, &Seek::Speed(100.0), &step(100.0));
        assert!((state.effort() - 5.0).abs() < 0.1, "{}", state.effort());
    }

    #[test]
    fn no_speed_is_asked_for_that_could_not_be_braked_from() {
        for degrees in [1.0_f32, 10.0, 90.0, 720.0, 1e6] {
            let asked = brake_in_time(&CONFIG, degrees, 1.3 * degrees);
            // v² / 2 a, with 1 rpm = 6 degrees a second.
            let braking = 3.0 * asked * asked / 1000.0;
            assert!(braking <= degrees * 1.001, "{degrees}: {asked} rpm");
        }
    }

    /// A rotor of 0.01 rpm/s per unit of effort, without friction.
    fn follow(config: &Cascade, motion: impl Fn(f32) -> (f32, f32, f32)) -> f32 {
        let (mut state, mut rpm, mut degrees) = (CascadeState::new(), 0.0_f32, 0.0_f32);
        let mut worst = 0.0_f32;
        for tick in 0..1000_u16 {
            let (angle, speed, acceleration) = motion(f32::from(tick) * 1e-3);
            worst = worst.max((angle - degrees).abs());
            let seek =
                Seek::Motion { way: Some(angle - degrees), speed, acceleration, inertia: 0.0 };
            state.seek(config, &seek, &step(rpm));
            rpm += state.effort() * 100.0 * 1e-3;
            degrees += 6.0 * rpm * 1e-3;
        }
        worst
    }

    #[test]
    fn a_known_motion_is_followed_without_lag() {
        // 0.5 s up to 100 rpm, then on.
        let motion = |t: f32| {
            let a = if t < 0.5 { 200.0 } else { 0.0 };
            let early = t.min(0.5);
            let angle = 6.0 * (100.0 * early * early + 100.0 * (t - early));
            (angle, 200.0 * early, a)
        };
        let known = FeedForward { per_rpm_s: 0.01, ..FeedForward::NONE };
        let (with, without) =
            (follow(&Cascade { feed_forward: known, ..CONFIG }, motion), follow(&CONFIG, motion));
        // The soft start takes a part of the first 20 ms.
        assert!(with < 0.5 && without > 3.0 * with, "{with} with, {without} without");
    }

    /// The load learned while it accelerates at 500 rpm/s for 0.3 s, `inertia` times as heavy as
    /// known.
    fn learned(inertia: f32) -> CascadeState {
        let known = FeedForward { per_rpm_s: 0.01, ..FeedForward::NONE };
        let config = Cascade { feed_forward: known, ..CONFIG };
        let (mut state, mut rpm) = (CascadeState::new(), 0.0_f32);
        for tick in 0..300_u16 {
            let speed = 0.5 * f32::from(tick);
            let seek = Seek::Motion { way: None, speed, acceleration: 500.0, inertia: 0.0 };
            state.seek(&config, &seek, &step(rpm));
            rpm += state.effort() / (0.01 * inertia) * 1e-3;
        }
        state
    }

    #[test]
    fn a_heavier_or_lighter_load_is_learned() {
        assert!(learned(1.0).learned.abs() < 0.05, "{}", learned(1.0).learned);
        assert!(learned(1.5).learned > 0.2 && learned(0.6).learned < -0.2);
    }

    #[test]
    fn what_is_learned_of_a_blocked_shaft_is_bounded_and_forgotten_in_a_stop() {
        let mut state = learned(1e9);
        assert!(state.learned > 0.2 && state.learned <= HEAVIEST, "{}", state.learned);
        state.start_over(true);
        assert!(state.learned > 0.2, "it holds: the load is still there");
        state.start_over(false);
        assert!(state.learned.abs() < f32::EPSILON);
    }

    #[test]
    fn a_motion_that_rests_far_away_is_an_angle_that_is_sought() {
        let (mut state, mut last) = (CascadeState::new(), 0.0);
        for _ in 0..100 {
            let seek =
                Seek::Motion { way: Some(90.0), speed: 0.0, acceleration: 0.0, inertia: 0.0 };
            state.seek(&CONFIG, &seek, &step(0.0));
            assert!((state.reference() - last).abs() <= 1.001, "1000 rpm/s");
            last = state.reference();
        }
        assert!(last > 99.0);
    }

    #[test]
    fn a_cascade_that_cannot_work_is_named() {
        let wrong = Cascade { acceleration: RpmPerSecond::ZERO, ..CONFIG };
        assert_eq!(wrong.validate().unwrap_err().field, "acceleration");
        let wrong = Cascade { speed: PidConfig { kp: f32::NAN, ..CONFIG.speed }, ..CONFIG };
        assert_eq!(wrong.validate().unwrap_err().field, "kp");
        let wrong = Cascade { speed: PidConfig { setpoint_weight: 0.5, ..CONFIG.speed }, ..CONFIG };
        assert_eq!(wrong.validate().unwrap_err().field, "setpoint_weight");
    }
}
