//! The attitude of a robot, from gyroscope and accelerometer: how it leans, and its heading.
//!
//! The rotation is integrated as a quaternion. Where the accelerometer feels gravity alone, the
//! estimate leans towards it: slowly on the move, quickly at rest, and not in a spin or a hard
//! push. Nothing leans it about the vertical: **yaw is the gyroscope's alone**, zero at the first
//! sample, and drifts. The gyroscope's bias is learned after a second at a stand.
//!
//! Accuracy of a BMI088 (`tests/attitude.rs`, with its data sheet's noise and bias): yaw within
//! half a degree after a minute of driving, a tenth of a degree a minute at rest; tilt within the
//! accelerometer's offset, 1.2 degrees for 20 mg. Besides, a real gyroscope's scale is off by up to
//! a percent: 3.6 degrees after a turn.
//!
//! The limit: a turn below 0.6 °/s of a robot that nothing shakes looks like bias. Without a second
//! at a stand [`bias`](Attitude::bias) stays `None`, and yaw drifts by a degree a second.
//!
//! # Why not `fusion-ahrs`
//! It is a good port of a well-known filter, `no_std` and `f32`. But a NaN spoils its quaternion
//! for good; it counts in samples of a fixed rate, takes three seconds of any turn below 3 °/s for
//! bias, and does not know that a spinning accelerometer lies. It is the witness in the tests: this
//! must not be worse.

use rc10_app::maths::{hypot, within};
use rc10_app::{Radians, Seconds};

use super::{GRAVITY, Sample};

type Vector = [f32; 3];

/// The longest step: between samples 30 rad/s² makes 0.3 degrees beyond what they tell.
pub const LONGEST_STEP: Seconds = Seconds::new(0.02);
/// No sensor of ours turns faster, rad/s: ±2000 °/s is 34.9.
const FASTEST: f32 = 50.0;

/// The rate of leaning towards the accelerometer's up, 1/s, on the move and at rest.
const LEAN: f32 = 0.1;
const LEAN_AT_REST: f32 = 2.0;
/// On the move while the bias is unknown: 1 °/s of it then makes 2 degrees of tilt.
const LEAN_BEFORE: f32 = 0.5;
/// Share of gravity squared (a tenth of gravity) beyond which the accelerometer does not count.
const OTHER_THAN_GRAVITY: f32 = 0.2;
/// Beyond this rotation, rad/s, the accelerometer does not count either.
const SPINS: f32 = 2.0;

/// Time constant of the means that rest is judged by, s.
const MEAN: f32 = 0.25;
/// At rest nothing is further from its mean than this: six times a BMI088's noise. rad/s, m/s².
const ROTATION_STILL: f32 = 0.03;
const ACCELERATION_STILL: f32 = 0.5;
/// A bias is no larger than this, rad/s: three times the data sheet's 1 °/s.
const LARGEST_BIAS: f32 = 0.05;
/// Once it is known it is no further off than this, rad/s: by temperature, 0.015 °/s per °C.
const BIAS_CHANGE: f32 = 0.01;
/// The time for which it must look like rest before it counts as rest, s.
const REST: f32 = 1.0;
/// A bias is the mean over at most this time of rest, s: longer would not follow the temperature.
const BIAS_MEMORY: f32 = 20.0;

/// A sample was not used: nothing has changed, but a rotation was missed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refused {
    /// Not a step above zero, and up to [`LONGEST_STEP`].
    #[error("a step of {0}: must be above 0 and up to 0.02 s")]
    Step(Seconds),
    /// The rotation about x, y, z, rad/s: not finite, or faster than any sensor.
    #[error("rotation of {0:?} rad/s: no sensor says that")]
    Rotation([f32; 3]),
}

/// Attitude of a robot: see the [module](self).
///
/// ```
/// use rc10_app::Seconds;
/// use rc10_module::imu::{Sample, attitude::Attitude};
///
/// let mut attitude = Attitude::new();
/// let turning = Sample {
///     acceleration: [0.0, 0.0, 9.81],
///     rotation: [0.0, 0.0, 1.0],
///     temperature: None,
///     acceleration_is_saturated: false,
///     rotation_is_saturated: false,
/// };
/// for _ in 0..500 {
///     attitude.update(&turning, Seconds::new(0.001))?;
/// }
/// assert!((attitude.yaw().get() - 0.5).abs() < 1e-4);
/// # Ok::<(), rc10_module::imu::attitude::Refused>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Attitude {
    /// From the robot's axes to the world's: w, x, y, z.
    quaternion: [f32; 4],
    /// The accelerometer has said which way is up.
    is_levelled: bool,
    /// All steps together, s; stands still after some hours.
    seen: f32,
    bias: Vector,
    /// The time of rest that the bias is the mean of, s: at most [`BIAS_MEMORY`].
    rested: f32,
    /// The time for which it has looked like rest, s.
    still: f32,
    mean_rotation: Vector,
    mean_acceleration: Vector,
    gaps: u32,
}

impl Attitude {
    /// Level, at yaw zero, until the first sample says more.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            quaternion: [1.0, 0.0, 0.0, 0.0],
            is_levelled: false,
            seen: 0.0,
            bias: [0.0; 3],
            rested: 0.0,
            still: 0.0,
            mean_rotation: [0.0; 3],
            mean_acceleration: [0.0; 3],
            gaps: 0,
        }
    }

    /// Takes a sample, `step` after the last one taken: longer where a sample is missing.
    ///
    /// # Errors
    /// [`Refused`], if it is not used; then a rotation was missed, and [`gaps`](Self::gaps) counts
    /// it. No value, not a number or not, does more harm than that.
    #[inline]
    pub fn update(&mut self, sample: &Sample, step: Seconds) -> Result<(), Refused> {
        let dt = step.get();
        let is_step = dt > 0.0 && dt <= LONGEST_STEP.get();
        let is_rotation = sample.rotation.iter().all(|rate| rate.abs() <= FASTEST);
        if !is_step || !is_rotation {
            self.gaps = self.gaps.saturating_add(1);
            self.still = 0.0;
            return Err(if is_step {
                Refused::Rotation(sample.rotation)
            } else {
                Refused::Step(step)
            });
        }
        if sample.rotation_is_saturated {
            self.gaps = self.gaps.saturating_add(1);
        }
        let acceleration = sample.acceleration.map(|axis| axis / GRAVITY);
        let is_acceleration = !sample.acceleration_is_saturated && squared(acceleration) < 1e4;
        self.look_for_rest(sample, is_acceleration, dt);

        let mut rotation = minus(sample.rotation, self.bias);
        if is_acceleration {
            let weight = weight(acceleration, rotation);
            if !self.is_levelled && weight > 0.0 {
                self.level(acceleration);
            }
            let lean = match self.bias() {
                _ if self.is_at_rest() => LEAN_AT_REST,
                Some(_) => LEAN,
                None => LEAN_BEFORE,
            };
            let towards = cross(acceleration, self.up());
            rotation = add(rotation, towards, lean * weight);
        }
        self.turn(rotation, dt);
        Ok(())
    }

    /// About the vertical, counter-clockwise from above, -π ..= π; not with the nose down.
    #[must_use]
    pub fn yaw(&self) -> Radians {
        let [w, x, y, z] = self.quaternion;
        Radians::new(libm::atan2f(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    }

    /// About the robot's y axis: nose down positive, -π/2 ..= π/2.
    #[must_use]
    pub fn pitch(&self) -> Radians {
        let [w, x, y, z] = self.quaternion;
        Radians::new(libm::asinf(within(2.0 * (w * y - x * z), 1.0)))
    }

    /// About the robot's x axis: right side down positive, -π ..= π.
    #[must_use]
    pub fn roll(&self) -> Radians {
        let [w, x, y, z] = self.quaternion;
        Radians::new(libm::atan2f(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)))
    }

    /// The angle by which it leans, whichever way: 0 ..= π.
    #[must_use]
    pub fn tilt(&self) -> Radians {
        let [x, y, z] = self.up();
        Radians::new(libm::atan2f(hypot(x, y), z))
    }

    /// The unit quaternion from the robot's axes to the world's: w, x, y, z.
    #[must_use]
    pub const fn quaternion(&self) -> [f32; 4] {
        self.quaternion
    }

    /// From here on this is the yaw. What is no finite number changes nothing.
    pub fn set_yaw(&mut self, yaw: Radians) {
        if yaw.is_finite() {
            let (sin, cos) = rc10_app::maths::sin_cos((yaw.get() - self.yaw().get()) * 0.5);
            self.quaternion = normal(product([cos, 0.0, 0.0, sin], self.quaternion));
        }
    }

    /// The gyroscope's rotation at rest, x, y, z, rad/s; `None` before a second at a stand.
    #[must_use]
    pub fn bias(&self) -> Option<[f32; 3]> {
        (self.rested > 0.0).then_some(self.bias)
    }

    /// Whether it has stood still for a second, and does.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.still >= REST
    }

    /// Missed rotations: no sample, no number, or out of range. Above zero, yaw may be off.
    #[must_use]
    pub const fn gaps(&self) -> u32 {
        self.gaps
    }

    #[inline]
    fn up(&self) -> Vector {
        let [w, x, y, z] = self.quaternion;
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z]
    }

    #[inline]
    fn look_for_rest(&mut self, sample: &Sample, is_acceleration: bool, dt: f32) {
        self.seen += dt;
        let share = dt / self.seen.min(MEAN).max(dt);
        let rotation = minus(sample.rotation, self.mean_rotation);
        self.mean_rotation = add(self.mean_rotation, rotation, share);
        let mut is_still = is_acceleration && !sample.rotation_is_saturated;
        if is_acceleration {
            let acceleration = minus(sample.acceleration, self.mean_acceleration);
            self.mean_acceleration = add(self.mean_acceleration, acceleration, share);
            is_still &= is_within(acceleration, ACCELERATION_STILL);
        }
        is_still &= is_within(rotation, ROTATION_STILL);
        is_still &= is_within(self.mean_rotation, LARGEST_BIAS);
        let off = minus(self.mean_rotation, self.bias);
        is_still &= self.rested < REST || is_within(off, BIAS_CHANGE);
        self.still = if is_still { (self.still + dt).min(REST + 1.0) } else { 0.0 };
        if self.is_at_rest() {
            if self.rested <= 0.0 {
                // This part of its apparent turn since power-on was bias.
                let about_vertical = dot(self.mean_rotation, self.up());
                self.set_yaw(Radians::new(self.yaw().get() - about_vertical * self.seen));
            }
            // The mean over all rest so far, then a mean that forgets.
            self.rested = (self.rested + dt).min(BIAS_MEMORY);
            self.bias = add(self.bias, off, (dt / self.rested).min(1.0));
        }
    }

    /// Upright as the accelerometer says, at yaw zero.
    #[cold]
    fn level(&mut self, [x, y, z]: Vector) {
        self.is_levelled = true;
        let length = hypot(hypot(x, y), z);
        // The shortest turn from the up that is felt to the world's.
        let shortest = [length + z, y, -x, 0.0];
        let is_upside_down = z < 0.0 && x * x + y * y < 1e-8;
        self.quaternion = if is_upside_down { [0.0, 1.0, 0.0, 0.0] } else { normal(shortest) };
        self.set_yaw(Radians::ZERO);
    }

    /// Turns about the robot's own axes, rad/s.
    #[inline]
    fn turn(&mut self, rotation: Vector, dt: f32) {
        let half = rotation.map(|rate| rate * dt * 0.5);
        // Cosine and sine of the half by series: a last digit off at the longest, fastest step.
        let square = squared(half);
        let cos = 1.0 - square * (1.0 / 2.0 - square * (1.0 / 24.0 - square * (1.0 / 720.0)));
        let sin = 1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0)));
        let turn = [cos, half[0] * sin, half[1] * sin, half[2] * sin];
        let turned = product(self.quaternion, turn);
        // One step of Newton's towards length 1, which it has but for rounding.
        let [w, x, y, z] = turned;
        let scale = 1.5 - 0.5 * (w * w + x * x + y * y + z * z);
        self.quaternion = turned.map(|part| part * scale);
    }
}

impl Default for Attitude {
    fn default() -> Self {
        Self::new()
    }
}

/// The weight of an accelerometer, 0 ..= 1; its unit is gravity.
#[inline]
fn weight(acceleration: Vector, rotation: Vector) -> f32 {
    let other = (squared(acceleration) - 1.0).abs() / OTHER_THAN_GRAVITY;
    let spin = squared(rotation) / (SPINS * SPINS);
    (1.0 - other).max(0.0) * (1.0 - spin).max(0.0)
}

#[inline]
fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + factor · b.
#[inline]
fn add(a: Vector, b: Vector, factor: f32) -> Vector {
    [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]]
}

#[inline]
fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
fn squared(vector: Vector) -> f32 {
    dot(vector, vector)
}

#[inline]
fn is_within(vector: Vector, limit: f32) -> bool {
    vector.iter().all(|axis| axis.abs() <= limit)
}

/// The turn `b`, seen from inside the turn `a`.
#[inline]
fn product([aw, ax, ay, az]: [f32; 4], [bw, bx, by, bz]: [f32; 4]) -> [f32; 4] {
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

fn normal([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    let length = hypot(hypot(w, x), hypot(y, z));
    if length > 0.0 { [w, x, y, z].map(|part| part / length) } else { [1.0, 0.0, 0.0, 0.0] }
}
