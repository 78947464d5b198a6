//! The cascade that most motors without a controller of their own need: an angle loop around a
//! speed loop, at the output shaft, with everything that makes it gentle.
//!
//! * The angle loop asks for a speed, never for one it could not brake from in time.
//! * The speed reference moves at a limited acceleration and starts at the measured speed.
//! * Switching between kinds of target, and coming back after a pause, gives no kick.
//!
//! The **effort** that comes out is in whatever the actuator takes: amperes, or a share of the
//! full voltage.

use crate::maths::{fast_sqrt, within};
use crate::{ConfigError, PidConfig, PidInput, PidState, RpmPerSecond, Seconds};

/// Gains and limits of both loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cascade {
    /// Speed loop: effort per rpm of error.
    pub speed: PidConfig,
    /// Angle loop: rpm per degree of error; its output limit is the largest speed it asks for.
    pub angle: PidConfig,
    /// The angle loop runs in every so many ticks (0 counts as 1).
    pub outer_divider: u8,
    /// How fast the speed reference may change. Also what the angle loop brakes with.
    pub acceleration: RpmPerSecond,
    /// Effort added per rpm of speed reference: what viscous friction or the back-EMF takes.
    pub feed_forward: f32,
}

impl Cascade {
    /// Whether every field can be used.
    ///
    /// # Errors
    /// The first field that cannot, and what it must be.
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.speed.validate().map_err(|error| error.in_part("speed"))?;
        self.angle.validate().map_err(|error| error.in_part("angle"))?;
        let check = |field, value: f32, good: bool, must_be| {
            if good { Ok(()) } else { Err(ConfigError::new(field, value, must_be)) }
        };
        let acceleration = self.acceleration.get();
        let good = acceleration.is_finite() && acceleration > 0.0;
        check("acceleration", acceleration, good, "finite and positive")?;
        let forward = self.feed_forward;
        check("feed_forward", forward, forward.is_finite(), "finite")
    }
}

impl Cascade {
    /// From the tick `count` to the next one in which the angle loop runs: 1 ..= divider.
    const fn ticks_to_next(&self, count: u32) -> u8 {
        let divider = if self.outer_divider == 0 { 1 } else { self.outer_divider };
        #[expect(clippy::cast_possible_truncation, reason = "a remainder of a u8")]
        return divider - (count % divider as u32) as u8;
    }
}

/// How far a measurement moved since this was asked last.
const fn change(last: &mut f32, measured: f32) -> f32 {
    measured - core::mem::replace(last, measured)
}

/// The speed from which the acceleration limit just brakes until there is no way left to go, if
/// that is less than what the angle loop asked for.
#[inline(never)]
fn brake_in_time(config: &Cascade, way: f32, asked: f32) -> f32 {
    let (kp, steepest) = (config.angle.kp, config.acceleration.get());
    if kp <= 0.0 {
        return asked;
    }
    // v² = 2 a s, in rpm and degrees: 1 rpm = 6 degrees a second. It meets the proportional law
    // where that needs the same deceleration, without a corner.
    let knee = steepest / (6.0 * kp);
    within(asked, fast_sqrt(steepest * (way.abs() - 0.5 * knee / kp) * (1.0 / 3.0)))
}

/// After driving starts, the effort may change by this share of full scale per second …
const SOFT_SLOPE: f32 = 100.0;
/// … for so long. (10 % per millisecond for 20 ms; half a tick more, for rounding.)
const SOFT_TIME: f32 = 0.0205;

/// What a cascade remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CascadeState {
    speed: PidState,
    angle: PidState,
    /// Speed the angle loop asked for last.
    asked: f32,
    /// Speed reference after the acceleration limit.
    reference: f32,
    /// For the derivative alone, and only kept up if there is one.
    last_speed: f32,
    /// As `last_speed`: the way left, taken as a position.
    last_way: f32,
    /// Seconds for which the effort may only change slowly yet, because driving has just begun.
    soft_time_left: f32,
    /// What drove last; [`Active::Nothing`] also during a soft start, so that the usual case has
    /// one thing to compare.
    active: Active,
    /// What drives during a soft start.
    starting: Active,
    /// Ticks until the angle loop runs again; zero also if no angle is sought, and during a soft
    /// start.
    ticks_left: u8,
}

/// Which loops ran last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Active {
    #[default]
    Nothing,
    Effort,
    Speed,
    Angle,
}

impl CascadeState {
    /// At rest.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            speed: PidState::new(),
            angle: PidState::new(),
            asked: 0.0,
            reference: 0.0,
            last_speed: 0.0,
            last_way: 0.0,
            soft_time_left: 0.0,
            active: Active::Nothing,
            starting: Active::Nothing,
            ticks_left: 0,
        }
    }

    /// The effort decided last.
    #[inline]
    #[must_use]
    pub const fn effort(&self) -> f32 {
        self.speed.output()
    }

    /// The speed the speed loop works towards now, rpm.
    #[must_use]
    pub const fn reference(&self) -> f32 {
        self.reference
    }

    /// No effort; whatever drives next starts afresh.
    #[inline]
    pub fn rest(&mut self) {
        // Nobody may be left pushing: the effort itself is looked at, not only who gave it.
        let drives = self.active != Active::Nothing || self.starting != Active::Nothing;
        if drives || self.effort().to_bits() != 0 {
            self.reset();
        }
    }

    #[cold]
    #[inline(never)]
    const fn reset(&mut self) {
        *self = Self::new();
    }

    /// Forgets what the loops have gathered; the effort that flows now is left softly. For a stop:
    /// pushing against an obstacle must not go on. With `keep_load`, what a loop has gathered to
    /// carry a load stays.
    pub fn start_over(&mut self, keep_load: bool) {
        let before = if self.active == Active::Nothing { self.starting } else { self.active };
        self.ticks_left = 0;
        if !keep_load || before == Active::Effort {
            (self.active, self.starting) = (Active::Nothing, Active::Nothing);
        }
    }

    /// The gains have changed: no derivative reaches back before that, and no integral stays that
    /// nothing can move. `way` is the way left to an angle.
    pub fn change_gains(&mut self, config: &Cascade, measured: f32, way: f32) {
        (self.last_speed, self.last_way) = (measured, -way);
        if config.speed.ki <= 0.0 {
            self.speed.drop_integral();
        }
        if config.angle.ki <= 0.0 {
            self.angle.drop_integral();
        }
    }

    /// Gives this effort, without any loop. `full` is the full scale of the effort; a loop's own
    /// output limit must not be above it.
    #[inline(never)]
    pub fn give(&mut self, effort: f32, full: f32, dt: Seconds) {
        let last = self.effort();
        let goes_on = self.active == Active::Effort || self.enter(Active::Effort, 0.0);
        self.speed.preset(within(effort, full));
        if !goes_on {
            self.soften(last, full, dt);
        }
    }

    /// One step towards a speed. `target` and `measured` in rpm.
    #[inline]
    pub fn seek_speed(
        &mut self,
        config: &Cascade,
        target: f32,
        measured: f32,
        full: f32,
        dt: Seconds,
    ) {
        if self.active == Active::Speed {
            self.speed_loop(config, target, measured, dt);
        } else {
            self.start_speed(config, target, measured, full, dt);
        }
    }

    #[cold]
    #[inline(never)]
    fn start_speed(
        &mut self,
        config: &Cascade,
        target: f32,
        measured: f32,
        full: f32,
        dt: Seconds,
    ) {
        let last = self.effort();
        let goes_on = self.enter(Active::Speed, measured);
        self.speed_loop(config, target, measured, dt);
        if !goes_on {
            self.soften(last, full, dt);
        }
    }

    /// One step towards the angle sought so far, if it is not the angle loop's turn; else `false`,
    /// and [`seek_angle`](Self::seek_angle) is to be called, with the way that is left.
    #[inline]
    pub fn keep_seeking_angle(&mut self, config: &Cascade, measured: f32, dt: Seconds) -> bool {
        // Above zero only while an angle is sought.
        let goes_on = self.ticks_left > 0;
        if goes_on {
            self.ticks_left -= 1;
            self.speed_loop(config, self.asked, measured, dt);
        }
        goes_on
    }

    /// One step towards an angle that is `way` degrees away. `measured` in rpm. `count` counts ticks:
    /// the angle loop runs where it is a multiple of the divider, so that cascades with other
    /// counts take other ticks.
    #[inline]
    pub fn seek_angle(
        &mut self,
        config: &Cascade,
        way: f32,
        measured: f32,
        full: f32,
        dt: Seconds,
        count: u32,
    ) {
        if self.active != Active::Angle {
            return self.start_angle(config, way, measured, full, dt, count);
        }
        self.angle_loop(config, way, config.ticks_to_next(count), dt);
        self.speed_loop(config, self.asked, measured, dt);
    }

    #[cold]
    #[inline(never)]
    fn start_angle(
        &mut self,
        config: &Cascade,
        way: f32,
        measured: f32,
        full: f32,
        dt: Seconds,
        count: u32,
    ) {
        if self.starting != Active::Angle {
            self.last_way = -way;
        }
        let last = self.effort();
        let goes_on = self.enter(Active::Angle, measured);
        // During a soft start it runs in every tick.
        let ticks = if goes_on { config.ticks_to_next(count) } else { 1 };
        self.angle_loop(config, way, ticks, dt);
        self.speed_loop(config, self.asked, measured, dt);
        if !goes_on {
            self.soften(last, full, dt);
        }
    }

    /// The angle loop, which runs every `ticks` ticks of `dt`.
    #[inline(always)]
    fn angle_loop(&mut self, config: &Cascade, way: f32, ticks: u8, dt: Seconds) {
        self.ticks_left = ticks - 1;
        let Self { angle, last_way, .. } = self;
        let input = PidInput { error: way, feed_forward: 0.0, integrate: true };
        let dt = dt * f32::from(ticks);
        let asked = angle.update_error(&config.angle, input, || change(last_way, -way), dt);
        self.asked = if asked.abs() * 6.0 * config.angle.kp <= config.acceleration.get() {
            asked
        } else {
            brake_in_time(config, way, asked)
        };
    }

    #[inline(always)]
    fn speed_loop(&mut self, config: &Cascade, target: f32, measured: f32, dt: Seconds) {
        let step = config.acceleration.get() * dt.get();
        let gap = target - self.reference;
        if gap.abs() > step {
            return self.ramp(config, step.copysign(gap), measured, dt);
        }
        self.reference = target;
        let error = target - measured;
        let feed_forward = config.feed_forward * target;
        let input = PidInput { error, feed_forward, integrate: true };
        let Self { speed, last_speed, .. } = self;
        speed.update_error(&config.speed, input, || change(last_speed, measured), dt);
    }

    /// The speed loop while its reference is on the way to the target.
    #[inline(never)]
    fn ramp(&mut self, config: &Cascade, step: f32, measured: f32, dt: Seconds) {
        self.reference += step;
        let error = self.reference - measured;
        let feed_forward = config.feed_forward * self.reference;
        // The lag behind a moving reference is no load: integrating it would overshoot.
        let input = PidInput { error, feed_forward, integrate: false };
        let Self { speed, last_speed, .. } = self;
        speed.update_error(&config.speed, input, || change(last_speed, measured), dt);
    }

    /// Driving has just begun: the effort may not move far from what it was.
    #[cold]
    #[inline(never)]
    fn soften(&mut self, last: f32, full: f32, dt: Seconds) {
        // A step back in time is no step.
        let most = SOFT_SLOPE * full * dt.get().max(0.0);
        // The limit may have been lowered since.
        let step = within(self.effort() - last, most);
        self.speed.override_output(within(last + step, full));
        self.soft_time_left -= dt.get();
        if self.soft_time_left <= 0.0 {
            (self.active, self.starting) = (self.starting, Active::Nothing);
        }
    }

    /// Takes over from whatever drove before. Whether driving simply goes on; if not, it starts
    /// softly.
    #[cold]
    #[inline(never)]
    fn enter(&mut self, next: Active, measured: f32) -> bool {
        let before = if self.active == Active::Nothing { self.starting } else { self.active };
        if before == Active::Nothing {
            self.soft_time_left = SOFT_TIME;
        }
        // From speed to angle or back the speed loop simply goes on; else it starts at the
        // measured speed, with the effort that was asked for.
        if matches!(before, Active::Nothing | Active::Effort) && next != before {
            self.speed.preset(if before == Active::Effort { self.effort() } else { 0.0 });
            self.reference = measured;
            self.last_speed = measured;
        }
        if next != before {
            self.angle = PidState::new();
            self.ticks_left = 0;
        }
        let goes_on = self.active != Active::Nothing;
        *(if goes_on { &mut self.active } else { &mut self.starting }) = next;
        goes_on
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Seconds = Seconds::new(0.001);
    const CONFIG: Cascade = Cascade {
        speed: PidConfig::new(0.4, 2.0, 0.0, 20.0),
        angle: PidConfig::new(1.3, 0.0, 0.0, 400.0),
        outer_divider: 10,
        acceleration: RpmPerSecond::new(1000.0),
        feed_forward: 0.0,
    };

    #[test]
    fn the_speed_reference_starts_at_the_measured_speed_and_moves_at_the_acceleration() {
        let mut state = CascadeState::new();
        for tick in 1..=100_u8 {
            state.seek_speed(&CONFIG, 400.0, 50.0, 20.0, MS);
            assert!((state.reference() - 50.0 - f32::from(tick)).abs() < 1e-3);
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
        state.seek_speed(&CONFIG, 100.0, 100.0, 20.0, MS);
        assert!((state.effort() - 5.0).abs() < 0.1, "{}", state.effort());
        state.seek_angle(&CONFIG, 100.0 / 1.3, 100.0, 20.0, MS, 0);
        assert!((state.effort() - 5.0).abs() < 0.1, "{}", state.effort());
        state.seek_speed(&CONFIG, 100.0, 100.0, 20.0, MS);
        assert!((state.effort() - 5.0).abs() < 0.1, "{}", state.effort());
    }

    #[test]
    fn the_angle_loop_runs_every_tenth_tick() {
        let mut state = CascadeState::new();
        for _ in 0..30 {
            state.seek_angle(&CONFIG, 10.0, 0.0, 20.0, MS, 0);
        }
        let mut between = 0;
        while state.keep_seeking_angle(&CONFIG, 0.0, MS) {
            between += 1;
        }
        assert_eq!(between, 9);
        // Leaving the angle ends that at once.
        state.seek_angle(&CONFIG, 10.0, 0.0, 20.0, MS, 0);
        state.seek_speed(&CONFIG, 0.0, 0.0, 20.0, MS);
        assert!(!state.keep_seeking_angle(&CONFIG, 0.0, MS));
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

    #[test]
    fn a_cascade_that_cannot_work_is_named() {
        let wrong = Cascade { acceleration: RpmPerSecond::ZERO, ..CONFIG };
        assert_eq!(wrong.validate().unwrap_err().field, "acceleration");
        let wrong = Cascade { speed: PidConfig { kp: f32::NAN, ..CONFIG.speed }, ..CONFIG };
        assert_eq!(wrong.validate().unwrap_err().field, "kp");
    }
}
