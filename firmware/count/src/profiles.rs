//! Motion profiles: a tick on the way, and a new target at random states and limits.

use core::hint::black_box;

use rc10_app::profile::synchronise;
use rc10_app::{
    AngleLimits, AngleProfile, AngleSetpoint, Profile, ProfileLimits, Rpm, RpmPerSecond,
    RpmPerSecondSquared, Seconds, TotalAngle,
};

/// Random targets for each kind of call.
const CALLS: u32 = 2000;

/// Gives a function of its own, and a symbol to find it by, to something that is measured.
macro_rules! measured {
    ($symbol:literal, $name:ident($($argument:ident: $type:ty),*) $what:block) => {
        // SAFETY: nothing else has this name.
        #[unsafe(export_name = $symbol)]
        #[inline(never)]
        fn $name($($argument: $type),*) $what
    };
}

measured!("count_1_follow_profile", tick(profile: &mut Profile) {
    black_box(profile.update(Seconds::new(0.001)));
});
measured!("count_1_follow_angle_profile", angle_tick(profile: &mut AngleProfile, out: &mut AngleSetpoint) {
    *out = profile.update(Seconds::new(0.001));
});
measured!("count_1_plan_target", target(profile: &mut Profile, new: &New) {
    let _ = black_box(profile.set_target(&new.limits, new.position, new.velocity));
});
measured!("count_1_plan_moving_target", follow(profile: &mut Profile, new: &New) {
    let _ = black_box(profile.follow(&new.limits, new.position, new.velocity));
});
measured!("count_1_plan_velocity", velocity(profile: &mut Profile, new: &New) {
    let _ = black_box(profile.set_velocity(&new.limits, new.velocity));
});
measured!("count_1_plan_angle", angle_target(profile: &mut AngleProfile, new: &New) {
    let ProfileLimits { velocity, acceleration, jerk } = new.limits;
    let limits = AngleLimits { velocity: Rpm::new(velocity), acceleration: RpmPerSecond::new(acceleration), jerk: RpmPerSecondSquared::new(jerk) };
    let angle = TotalAngle::from_microdegrees(i64::from(new.bits) << 3);
    let _ = black_box(profile.set_target(&limits, angle, Rpm::new(new.velocity)));
});
measured!("count_3_synchronise", together(profiles: &mut [Profile; 3]) {
    let [a, b, c] = profiles;
    black_box(synchronise(&mut [a, b, c]));
});

/// A new target.
#[derive(Clone, Copy)]
struct New {
    limits: ProfileLimits,
    position: f32,
    velocity: f32,
    bits: i32,
}

/// A linear congruential generator (Numerical Recipes, chapter 7.1).
struct Random(u32);

impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0
    }

    /// 0 ..< 1.
    fn share(&mut self) -> f32 {
        #[expect(clippy::cast_precision_loss, reason = "24 bits")]
        return (self.bits() >> 8) as f32 / 16_777_216.0;
    }

    /// Limits with the ratios of real axes, or without one of the jerk.
    fn limits(&mut self) -> ProfileLimits {
        let velocity = 1.0 + 500.0 * self.share();
        let acceleration = velocity * (0.3 + 50.0 * self.share() * self.share());
        let jerk = match self.bits() >> 29 {
            0 => f32::INFINITY,
            _ => acceleration * (1.0 + 200.0 * self.share() * self.share()),
        };
        ProfileLimits { velocity, acceleration, jerk }
    }

    /// Up to where the axis can brake twice, or much less, or more.
    fn target(&mut self, limits: ProfileLimits) -> New {
        let ProfileLimits { velocity, acceleration, .. } = limits;
        let size = match self.bits() >> 30 {
            0 => 0.01,
            1 => 10.0,
            _ => 1.0,
        };
        let position =
            size * (2.0 * self.share() - 1.0) * velocity * (velocity / acceleration + 0.1);
        let there = match self.bits() >> 30 {
            0 => 0.99 * velocity * (2.0 * self.share() - 1.0),
            _ => 0.0,
        };
        #[expect(clippy::cast_possible_wrap, reason = "any number does")]
        let bits = self.bits() as i32;
        New { limits, position, velocity: there, bits }
    }
}

/// Measures all of them.
pub fn measure() {
    let mut random = Random(1);
    let mut profile = Profile::at(0.0);
    let mut shaft = AngleProfile::at(TotalAngle::ZERO);
    let mut limits = random.limits();
    for call in 0..CALLS {
        // New limits now and then, also below the present state.
        if call % 8 == 0 {
            limits = random.limits();
        }
        let new = black_box(random.target(limits));
        target(&mut profile, &new);
        advance(&mut profile, random.share());
        follow(&mut profile, &new);
        advance(&mut profile, random.share());
        if call % 4 == 0 {
            velocity(&mut profile, &new);
            advance(&mut profile, random.share());
        }
        angle_target(&mut shaft, &new);
        let mut out = shaft.setpoint();
        angle_tick(&mut shaft, &mut out);
        black_box(out);
        shaft.update(Seconds::new(random.share() * shaft.remaining().get()));
        if call % 8 == 0 {
            let mut profiles = [profile; 3];
            for profile in &mut profiles {
                let _ = profile.set_target(&limits, random.target(limits).position, 0.0);
            }
            together(&mut profiles);
        }
    }
}

/// A tick, and then to somewhere in the plan.
fn advance(profile: &mut Profile, share: f32) {
    tick(profile);
    profile.update(Seconds::new(share * profile.remaining().get()));
    tick(profile);
}
