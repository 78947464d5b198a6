//! The cascade that most motors without a controller of their own need: an angle loop around a
//! speed loop, at the output shaft, with everything that makes it gentle.
//!
//! * The angle loop asks for a speed, never for one it could not brake from in time.
//! * The speed reference moves at a limited acceleration and starts at the measured speed.
//! * Switching between kinds of target, and coming back after a pause, gives no kick.
//!
//! The **effort** that comes out is in whatever the actuator takes: amperes, or a share of the
//! full voltage.

use rc10_app::maths::{fast_sqrt, within};
use rc10_app::{ConfigError, PidConfig, PidInput, PidState, RpmPerSecond, Seconds};

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
        self.speed.validate()?;
        self.angle.validate()?;
        let check = |field, value: f32, good: bool, must_be| {
            if good { Ok(()) } else { Err(ConfigError { field, value, must_be }) }
        };
        let acceleration = self.acceleration.get();
        let good = acceleration.is_finite() && acceleration > 0.0;
        check("acceleration", acceleration, good, "finite and positive")?;
        let forward = self.feed_forward;
        check("feed_forward", forward, forward.is_finite(), "finite")
    }
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
    last_speed: f32,
    last_angle_error: f32,
    soft_time_left: f32,
    effort: f32,
    active: Active,
    tick: u8,
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
            last_angle_error: 0.0,
            soft_time_left: 0.0,
            effort: 0.0,
            active: Active::Nothing,
            tick: 0,
        }
    }

    /// The effort decided last.
    #[inline]
    #[must_use]
    pub const fn effort(&self) -> f32 {
        self.effort
    }

    /// The speed the speed loop works towards now, rpm.
    #[must_use]
    pub const fn reference(&self) -> f32 {
        self.reference
    }

    /// No effort; whatever drives next starts afresh.
    #[inline]
    pub fn rest(&mut self) {
        if self.active != Active::Nothing {
            *self = Self::new();
        }
    }

    /// Gives this effort, without any loop. `full` is the full scale of the effort.
    #[inline]
    pub fn give(&mut self, effort: f32, full: f32, dt: Seconds) {
        if self.active != Active::Effort {
            self.enter(Active::Effort, 0.0);
        }
        self.finish(effort, full, dt);
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
        if self.active != Active::Speed {
            self.enter(Active::Speed, measured);
        }
        self.speed_loop(config, target, measured, full, dt);
    }

    /// One step towards an angle. `error` is the way still to go, in degrees; `measured` in rpm.
    #[inline]
    pub fn seek_angle(
        &mut self,
        config: &Cascade,
        error: f32,
        measured: f32,
        full: f32,
        dt: Seconds,
    ) {
        if self.active != Active::Angle {
            self.enter(Active::Angle, measured);
            self.last_angle_error = error;
        }
        if self.tick == 0 {
            self.tick = config.outer_divider.max(1);
            let dt = dt * f32::from(self.tick);
            let change = self.last_angle_error - error;
            self.last_angle_error = error;
            let input = PidInput { error, change, feed_forward: 0.0, integrate: true };
            let asked = self.angle.update_error(&config.angle, input, dt);
            // v² = 2 a s, in rpm and degrees: 1 rpm = 6 degrees a second. Beyond the point where
            // the proportional law falls below this parabola it is the law that brakes.
            let steepest = config.acceleration.get();
            let linear = steepest / (6.0 * config.angle.kp);
            let distance = error.abs();
            self.asked = if config.angle.kp > 0.0 && asked.abs() > linear {
                let knee = linear / config.angle.kp;
                within(asked, fast_sqrt(steepest * (distance - 0.5 * knee) * (1.0 / 3.0)))
            } else {
                asked
            };
        }
        self.tick -= 1;
        self.speed_loop(config, self.asked, measured, full, dt);
    }

    #[inline]
    fn speed_loop(&mut self, config: &Cascade, target: f32, measured: f32, full: f32, dt: Seconds) {
        let step = config.acceleration.get() * dt.get();
        let gap = target - self.reference;
        self.reference += within(gap, step);
        let change = measured - self.last_speed;
        self.last_speed = measured;
        let input = PidInput {
            error: self.reference - measured,
            change,
            feed_forward: config.feed_forward * self.reference,
            // The lag behind a moving reference is no load: integrating it would overshoot.
            integrate: gap.abs() <= step,
        };
        let effort = self.speed.update_error(&config.speed, input, dt);
        self.finish(effort, full, dt);
    }

    #[inline]
    fn finish(&mut self, effort: f32, full: f32, dt: Seconds) {
        let effort = if self.soft_time_left > 0.0 {
            self.soft_time_left -= dt.get();
            self.effort + within(effort - self.effort, SOFT_SLOPE * full * dt.get())
        } else {
            effort
        };
        self.effort = within(effort, full);
    }

    /// Takes over from whatever drove before.
    #[cold]
    fn enter(&mut self, next: Active, measured: f32) {
        if self.active == Active::Nothing {
            self.soft_time_left = SOFT_TIME;
        }
        // From speed to angle or back the speed loop simply goes on; else it starts at the
        // measured speed with the effort that flows now.
        if matches!(self.active, Active::Nothing | Active::Effort) {
            self.speed.preset(self.effort);
            self.reference = measured;
            self.last_speed = measured;
        }
        self.angle = PidState::new();
        self.tick = 0;
        self.active = next;
    }
}
