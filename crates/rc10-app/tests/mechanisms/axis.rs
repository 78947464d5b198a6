//! A simulated motor with its loops, on an axis. Degrees, seconds; efforts in A.

use rc10_app::mechanism::{Braking, Health, Measured, MotorCommand};
use rc10_app::{AngleSetpoint, Rpm, RpmPerSecond, Seconds, TotalAngle};

/// A repeatable generator (`SplitMix64`).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^ (bits >> 31)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    pub fn chance(&mut self, share: f64) -> bool {
        self.between(0.0, 1.0) < share
    }
}

/// A spring that only pushes, from `at` on; in the direction +1 or -1.
#[derive(Clone, Copy)]
pub struct Stop {
    pub at: f64,
    pub direction: f64,
    /// A per degree.
    pub stiffness: f64,
}

impl Stop {
    /// The effort that pushes back, 0 or more.
    fn force(&self, at: f64, speed: f64) -> f64 {
        let depth = self.direction * (at - self.at);
        // Lossy: it pushes less on the way out.
        if depth <= 0.0 {
            0.0
        } else {
            (self.stiffness * depth * (1.0 + 0.002 * self.direction * speed)).max(0.0)
        }
    }
}

pub struct Axis {
    /// The angle of the motor's shaft.
    pub angle: f64,
    pub speed: f64,
    /// The slip of the belt: the axis is at `angle - slipped`.
    pub slipped: f64,
    /// deg/s² per A.
    pub gain: f64,
    pub friction: f64,
    /// A per deg/s.
    pub viscous: f64,
    /// Pulls to negative angles.
    pub load: f64,
    pub stops: Vec<Stop>,
    /// The belt slips from this force on.
    pub slips_at: f64,
    /// Share of its effort that a motor gives.
    pub strength: f64,
    /// Where it is stuck both ways.
    pub stuck_at: Option<f64>,
    pub health: Health,
    pub gaps: u32,
    /// By which the counted angle has jumped.
    pub jumped: f64,
    pub not_finite: bool,
    pub effort: f64,
    command: MotorCommand,
    reference: f64,
    integral: f64,
    measured: Measured,
}

/// Largest effort.
pub const FULL: f64 = 20.0;
/// Acceleration limit of the loops, deg/s².
const ACCELERATION: f64 = 6000.0;
const STEP: f64 = 0.001;
const PARTS: usize = 4;

/// Braking that these axes reach for sure.
pub const BRAKING: Braking =
    Braking { acceleration: RpmPerSecond::new(400.0), reaction: Seconds::new(0.05) };

impl Axis {
    pub fn random(random: &mut Random, angle: f64) -> Self {
        let mut axis = Self {
            angle,
            speed: 0.0,
            slipped: 0.0,
            gain: random.between(300.0, 900.0),
            friction: random.between(0.2, 2.0),
            viscous: random.between(0.0, 0.003),
            load: 0.0,
            stops: Vec::new(),
            slips_at: f64::INFINITY,
            strength: 1.0,
            stuck_at: None,
            health: Health::Ready,
            gaps: random.below(3) as u32,
            jumped: 0.0,
            not_finite: false,
            effort: 0.0,
            command: MotorCommand::Coast,
            reference: 0.0,
            integral: 0.0,
            measured: Measured::default(),
        };
        axis.measure(random);
        axis
    }

    /// Where the axis is.
    pub fn position(&self) -> f64 {
        self.angle - self.slipped
    }

    pub fn counted(&self) -> f64 {
        self.angle + self.jumped
    }

    pub fn command(&mut self, command: MotorCommand) {
        if self.health == Health::Ready {
            self.command = command;
        }
    }

    pub fn measured(&self) -> Measured {
        self.measured
    }

    fn measure(&mut self, random: &mut Random) {
        let Self { health, gaps, .. } = *self;
        if health == Health::Offline {
            self.measured.health = health;
            return;
        }
        let angle = TotalAngle::from_microdegrees((self.counted() * 1e6).round() as i64);
        let speed = self.speed / 6.0 + random.between(-0.3, 0.3);
        let effort = self.effort + random.between(-0.1, 0.1);
        let effort = if self.not_finite { f64::NAN } else { effort };
        let speed = Rpm::new(speed as f32);
        self.measured = Measured { angle, speed, effort: effort as f32, gaps, health };
    }

    /// The motor's loops: an angle loop with speed feed-forward, an acceleration limit, a PI speed loop
    /// that does not wind up beyond its limit.
    fn drive(&mut self) {
        let asked = match self.command {
            MotorCommand::Coast => {
                (self.reference, self.integral, self.effort) = (self.speed, 0.0, 0.0);
                return;
            }
            MotorCommand::Speed(speed) => f64::from(speed.get()) * 6.0,
            MotorCommand::Angle(AngleSetpoint { angle, speed, .. }) => {
                let way = angle.microdegrees() as f64 * 1e-6 - self.counted();
                let brakes = (ACCELERATION * way.abs()).sqrt();
                f64::from(speed.get()) * 6.0 + (12.0 * way).clamp(-brakes, brakes)
            }
        };
        let change = ACCELERATION * STEP;
        self.reference += (asked - self.reference).clamp(-change, change);
        let error = (self.reference - self.speed) / 6.0;
        let wanted = error + self.integral;
        self.effort = wanted.clamp(-FULL, FULL);
        if wanted.abs() < FULL || wanted * error < 0.0 {
            self.integral += 5.0 * error * STEP;
        }
    }

    /// A millisecond.
    pub fn step(&mut self, random: &mut Random) {
        self.measure(random);
        if self.health == Health::Ready {
            self.drive();
        } else {
            (self.effort, self.integral, self.reference) = (0.0, 0.0, self.speed);
        }
        let dt = STEP / PARTS as f64;
        for _ in 0..PARTS {
            let mut force = self.effort * self.strength - self.load - self.viscous * self.speed;
            let mut outside = 0.0;
            for stop in &self.stops {
                outside -= stop.direction * stop.force(self.position(), self.speed);
            }
            if let Some(at) = self.stuck_at {
                outside -= 30.0 * (self.angle - at) + 0.3 * self.speed;
            }
            if f64::abs(outside) > self.slips_at {
                outside = outside.clamp(-self.slips_at, self.slips_at);
                self.slipped += self.speed * dt;
            }
            force += outside;
            let moved = self.speed + self.gain * force * dt;
            let held = self.gain * self.friction * dt;
            self.speed = if moved.abs() <= held { 0.0 } else { moved - held.copysign(moved) };
            self.angle += self.speed * dt;
        }
    }
}
