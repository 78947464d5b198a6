//! A robot that turns and drives, in f64, and the sensor on it.

use rc10_module::imu::Sample;

pub type Vector = [f64; 3];

pub const DT: f64 = 0.001;
const GRAVITY: f64 = 9.80665;

/// Numbers that look random, the same each time.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// 0 ..< 1.
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// -limit ..< limit.
    pub fn within(&mut self, limit: f64) -> f64 {
        (2.0 * self.unit() - 1.0) * limit
    }

    /// A number of the normal distribution.
    pub fn normal(&mut self, deviation: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos() * deviation
    }
}

/// The errors of a sensor. The default is a perfect one.
#[derive(Clone, Copy, Default)]
pub struct Faults {
    /// rad/s.
    pub rotation_bias: Vector,
    /// m/s².
    pub acceleration_bias: Vector,
    /// The noise of one sample at 1 kHz: rad/s, m/s².
    pub noise: [f64; 2],
    /// From the axis of the turn, m: along x.
    pub offset: f64,
}

impl Faults {
    /// A BMI088 by its data sheet (1.2): ±1 °/s, 0.014 °/s/√Hz, 190 µg/√Hz; mounted 0.15 m off the
    /// axis.
    pub fn bmi088(random: &mut Random) -> Self {
        let per_root_hertz = (0.5 / DT).sqrt();
        Self {
            rotation_bias: [0; 3].map(|_| random.within(1_f64.to_radians())),
            acceleration_bias: [0.0; 3],
            noise: [0.014_f64.to_radians() * per_root_hertz, 190e-6 * GRAVITY * per_root_hertz],
            offset: 0.15,
        }
    }
}

/// The truth: from the robot's axes to the world's.
pub struct Robot {
    pub quaternion: [f64; 4],
    /// The total turn about the world's vertical that was commanded, rad: exact while level.
    pub yaw: f64,
    pub random: Random,
    pub faults: Faults,
}

fn product([aw, ax, ay, az]: [f64; 4], [bw, bx, by, bz]: [f64; 4]) -> [f64; 4] {
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

impl Robot {
    pub fn new(seed: u64, faults: Faults) -> Self {
        let random = Random::new(seed);
        Self { quaternion: [1.0, 0.0, 0.0, 0.0], yaw: 0.0, random, faults }
    }

    /// Turned about an axis (of length 1) of its own at once.
    pub fn put(&mut self, [x, y, z]: Vector, angle: f64) {
        let (sin, cos) = (angle / 2.0).sin_cos();
        self.quaternion = product(self.quaternion, [cos, x * sin, y * sin, z * sin]);
    }

    /// A millisecond of rotation (rad/s) and acceleration (m/s², without gravity), both in its own
    /// axes; what a sensor says of it.
    pub fn step(&mut self, rotation: Vector, acceleration: Vector) -> Sample {
        let rate = rotation.iter().map(|axis| axis * axis).sum::<f64>().sqrt();
        if rate > 0.0 {
            self.put(rotation.map(|axis| axis / rate), rate * DT);
        }
        self.yaw += rotation[2] * DT;
        let up = self.up();
        let mut felt = [0, 1, 2].map(|axis| up[axis] * GRAVITY + acceleration[axis]);
        // Towards the axis of the turn.
        felt[0] -= self.faults.offset * rotation[2] * rotation[2];
        let Faults { rotation_bias, acceleration_bias, noise: [turn_noise, noise], .. } =
            self.faults;
        // A last digit of 2000 °/s and 6 g.
        let (turn_digit, digit) = (2000_f64.to_radians() / 32767.0, 6.0 * GRAVITY / 32768.0);
        let mut measured = |value: f64, bias: f64, noise: f64, digit: f64| {
            let value = value + bias + self.random.normal(noise);
            if noise > 0.0 { (value / digit).round() * digit } else { value }
        };
        let rotation = [0, 1, 2]
            .map(|axis| measured(rotation[axis], rotation_bias[axis], turn_noise, turn_digit));
        let acceleration =
            [0, 1, 2].map(|axis| measured(felt[axis], acceleration_bias[axis], noise, digit));
        Sample {
            acceleration: acceleration.map(|axis| axis as f32),
            rotation: rotation.map(|axis| axis as f32),
            temperature: None,
            acceleration_is_saturated: false,
            rotation_is_saturated: false,
        }
    }

    /// The world's up in its axes.
    pub fn up(&self) -> Vector {
        let [w, x, y, z] = self.quaternion;
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]
    }

    /// Degrees between its up and that of an estimate.
    pub fn tilt_error(&self, [w, x, y, z]: [f64; 4]) -> f64 {
        let other = [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)];
        let up = self.up();
        let cross = [0, 1, 2].map(|axis| {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            up[next] * other[last] - up[last] * other[next]
        });
        let sin = cross.iter().map(|axis| axis * axis).sum::<f64>().sqrt();
        let cos: f64 = up.iter().zip(other).map(|(up, other)| up * other).sum();
        sin.atan2(cos).to_degrees()
    }

    /// Degrees of its yaw.
    pub fn heading(&self) -> f64 {
        let [w, x, y, z] = self.quaternion;
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)).to_degrees()
    }
}

/// Degrees from one heading to another, the shorter way.
pub fn off(a: f64, b: f64) -> f64 {
    (a - b + 540.0).rem_euclid(360.0) - 180.0
}
