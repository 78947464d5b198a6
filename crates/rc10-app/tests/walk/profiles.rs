//! Drives profiles with pseudo-random targets and limits, and gives all setpoints away: PC and chip
//! have to compute the same bits.

use rc10_app::profile::synchronise;
use rc10_app::{
    AngleLimits, AngleProfile, AngleSetpoint, Profile, ProfileLimits, Rpm, RpmPerSecond,
    RpmPerSecondSquared, Seconds, Setpoint, TotalAngle,
};

/// A linear congruential generator (Numerical Recipes, chapter 7.1).
struct Random(u32);

impl Random {
    /// 0 ..< 1.
    fn share(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        #[expect(clippy::cast_precision_loss, reason = "24 bits")]
        return (self.0 >> 8) as f32 / 16_777_216.0;
    }

    fn within(&mut self, size: f32) -> f32 {
        size * (2.0 * self.share() - 1.0)
    }

    fn limits(&mut self) -> ProfileLimits {
        let velocity = 1.0 + 500.0 * self.share();
        let acceleration = velocity * (0.3 + 50.0 * self.share() * self.share());
        let jerk = if self.share() < 0.2 {
            f32::INFINITY
        } else {
            acceleration * (1.0 + 200.0 * self.share() * self.share())
        };
        ProfileLimits { velocity, acceleration, jerk }
    }
}

fn give(put: &mut dyn FnMut(f32), profile: &Profile) {
    let Setpoint { position, velocity, acceleration } = profile.setpoint();
    for number in [position, velocity, acceleration, profile.remaining().get()] {
        put(number);
    }
    put(f32::from(u8::from(profile.has_arrived())));
}

/// Every function of the profiles, at random; every result to `put`.
pub fn walk(put: &mut dyn FnMut(f32)) {
    let mut random = Random(7);
    let start = Setpoint { position: 1.0, velocity: 0.5, acceleration: -0.25 };
    let mut profiles = [Profile::from_setpoint(start), Profile::at(-3.0), Profile::at(1e3)];
    let angle = TotalAngle::from_degrees(3_600_000);
    let (speed, acceleration) = (Rpm::new(-3.0), RpmPerSecond::new(10.0));
    let mut shaft = AngleProfile::from_setpoint(AngleSetpoint { angle, speed, acceleration });
    for round in 0..300_u16 {
        let limits = random.limits();
        for profile in &mut profiles {
            let size = limits.velocity * (limits.velocity / limits.acceleration + 0.1);
            let position = profile.setpoint().position + random.within(size);
            let velocity = random.within(limits.velocity);
            let result = match round % 4 {
                0 => profile.set_target(&limits, position, 0.0),
                1 => profile.set_target(&limits, position, velocity),
                2 => profile.follow(&limits, position, velocity),
                _ => profile.set_velocity(&limits, velocity),
            };
            put(f32::from(u8::from(result.is_ok())));
            for _ in 0..3 {
                let dt = profile.remaining().get() * random.share() * 0.5;
                profile.update(Seconds::new(dt));
                give(put, profile);
            }
        }
        if round % 4 == 0 {
            let [a, b, c] = &mut profiles;
            put(synchronise(&mut [a, b, c, shaft.as_mut()]).get());
            for profile in &mut profiles {
                profile.update(Seconds::new(0.01));
                give(put, profile);
            }
        }
        let way = TotalAngle::from_microdegrees(i64::from(round) * 12_345_678);
        let speed = Rpm::new(random.within(limits.velocity));
        let limits = AngleLimits {
            velocity: Rpm::new(limits.velocity),
            acceleration: RpmPerSecond::new(limits.acceleration),
            jerk: RpmPerSecondSquared::new(limits.jerk),
        };
        let result = match round % 3 {
            0 => shaft.set_target(&limits, angle.plus(way), Rpm::ZERO),
            1 => shaft.follow(&limits, angle.minus(way), speed),
            _ => shaft.set_speed(&limits, speed),
        };
        put(f32::from(u8::from(result.is_ok())));
        for _ in 0..3 {
            let AngleSetpoint { angle: now, speed, acceleration } =
                shaft.update(Seconds::new(0.01 * random.share()));
            put(now.minus(angle).degrees().get());
            put(now.within_turn().get());
            put(speed.get());
            put(acceleration.get());
            put(shaft.remaining().get());
            put(f32::from(u8::from(shaft.has_arrived())));
        }
    }
}
