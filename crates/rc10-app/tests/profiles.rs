//! Profiles keep their limits whatever comes, and arrive.

use rc10_app::profile::synchronise;
use rc10_app::{
    AngleLimits, AngleProfile, Profile, ProfileLimits, Rpm, RpmPerSecond, RpmPerSecondSquared,
    Seconds, Setpoint, TotalAngle,
};

const MS: Seconds = Seconds::new(0.001);

/// A small repeatable generator (`SplitMix64`).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^ (bits >> 31)
    }

    /// 0 ..< 1.
    fn share(&mut self) -> f32 {
        f32::from(u16::try_from(self.bits() >> 48).unwrap()) / 65536.0
    }

    /// Within −`size` .. `size`.
    fn within(&mut self, size: f32) -> f32 {
        size * (2.0 * self.share() - 1.0)
    }

    /// From `low` to `high`, each power of ten as likely as another.
    fn scale(&mut self, low: f32, high: f32) -> f32 {
        low * (high / low).powf(self.share())
    }

    fn below(&mut self, end: u64) -> u64 {
        self.bits() % end
    }

    /// Axes from a slow gimbal to a fast wheel; every fifth without a limit of the jerk.
    fn limits(&mut self) -> ProfileLimits {
        let velocity = self.scale(0.1, 2000.0);
        // To full velocity in 10 ms to 10 s, to full acceleration in 1 ms to 1 s.
        let acceleration = velocity / self.scale(0.01, 10.0);
        let jerk = match self.below(5) {
            0 => f32::INFINITY,
            _ => acceleration / self.scale(0.001, 1.0),
        };
        ProfileLimits { velocity, acceleration, jerk }
    }

    /// A distance that is interesting within `limits`, from next to nothing to a long way.
    fn way(&mut self, limits: &ProfileLimits) -> f32 {
        let braking = limits.velocity * (limits.velocity / limits.acceleration + 0.1);
        match self.below(8) {
            0 => 0.0,
            1 => self.scale(1e-7, 1.0).copysign(self.within(1.0)) * braking,
            2 => self.within(30.0) * braking,
            _ => self.within(2.0) * braking,
        }
    }
}

/// The most that two setpoints `dt` apart break, as a share of a limit: 1 is the limit.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    velocity: f64,
    acceleration: f64,
    jerk: f64,
    /// Mismatch of position and velocity, of velocity and acceleration.
    position_jump: f64,
    velocity_jump: f64,
}

impl Worst {
    fn see(&mut self, limits: &ProfileLimits, from: Setpoint, to: Setpoint, dt: f32, way: f32) {
        let [velocity, acceleration, jerk, dt] =
            [limits.velocity, limits.acceleration, limits.jerk, dt].map(f64::from);
        let [p, v, a] = [from.position, from.velocity, from.acceleration].map(f64::from);
        let [q, w, b] = [to.position, to.velocity, to.acceleration].map(f64::from);
        let most = |old: &mut f64, new: f64| {
            assert!(!new.is_nan());
            *old = old.max(new);
        };
        most(&mut self.velocity, w.abs() / velocity);
        most(&mut self.acceleration, b.abs() / acceleration);
        // An acceleration that is the difference of rounded numbers.
        let rounding = 1e-6 * acceleration;
        if jerk.is_finite() {
            most(&mut self.jerk, ((b - a).abs() - rounding).max(0.0) / (jerk * dt));
        }
        // The trapezoidal rule is off by at most this, for an acceleration within its limit, and
        // for a jerk within its limit.
        let rule = [
            (2.0 * acceleration * dt).min(jerk * dt * dt / 4.0),
            (acceleration * dt * dt / 4.0).min(jerk * dt * dt * dt / 12.0),
        ];
        let off = (w - v - 0.5 * dt * (a + b)).abs() - rule[0];
        most(&mut self.velocity_jump, off / velocity);
        let off = (q - p - 0.5 * dt * (v + w)).abs() - rule[1];
        let digits = f64::from(from.position.abs().max(to.position.abs()).max(way.abs()));
        most(&mut self.position_jump, off / (velocity * dt + digits));
    }
}

/// Targets of all kinds; where it has to stand still in the end, if it has.
fn new_target(random: &mut Random, limits: &ProfileLimits, profile: &mut Profile) -> Option<f32> {
    let Setpoint { position, velocity, .. } = profile.setpoint();
    let place = match random.below(4) {
        // Where it would come to a stand, about.
        0 => position + velocity * velocity.abs() / (2.0 * limits.acceleration),
        _ => position + random.way(limits),
    };
    let there = if random.below(3) == 0 { random.within(0.99 * limits.velocity) } else { 0.0 };
    let stands = (there.abs() <= 0.0).then_some(place);
    match random.below(8) {
        0 => profile.set_velocity(limits, random.within(limits.velocity)).map(|()| None),
        1 | 2 => profile.follow(limits, place, there).map(|()| stands),
        _ => profile.set_target(limits, place, there).map(|()| stands),
    }
    .unwrap()
}

#[test]
fn a_million_new_targets_at_any_moment_keep_the_limits() {
    let mut random = Random(1);
    let mut worst = Worst::default();
    let mut stood = 0;
    for _ in 0..20_000 {
        let limits = random.limits();
        let mut profile = Profile::at(random.way(&limits));
        for _ in 0..50 {
            let stands = new_target(&mut random, &limits, &mut profile);
            let way = profile.remaining().get() * limits.velocity;
            for _ in 0..random.below(6) {
                let dt = match random.below(3) {
                    0 => profile.remaining().get() * random.share(),
                    1 => random.scale(0.01, 1.0) * limits.velocity / limits.acceleration,
                    _ => 0.001,
                };
                let from = profile.setpoint();
                let to = profile.update(Seconds::new(dt));
                if dt > 0.0 {
                    worst.see(&limits, from, to, dt, way);
                }
            }
            if let Some(place) = stands
                && profile.has_arrived()
            {
                let arrived = Setpoint { position: place, velocity: 0.0, acceleration: 0.0 };
                assert_eq!(profile.setpoint(), arrived);
                stood += 1;
            }
        }
    }
    assert!(worst.velocity <= 1.0 + 1e-6 && worst.acceleration <= 1.0 + 1e-6, "{worst:?}");
    assert!(worst.jerk <= 1.0 + 1e-5, "{worst:?}");
    assert!(worst.position_jump <= 7e-7 && worst.velocity_jump <= 7e-7, "{worst:?}");
    assert!(stood > 50_000, "{stood}");
}

/// No trajectory is above the highest velocity from which it can still brake in time. If even the
/// distance under that does not reach the target, no course takes as little time.
#[test]
fn a_trapezoid_takes_the_shortest_time_there_is() {
    const STEPS: u32 = 2000;
    let mut random = Random(2);
    for _ in 0..3000 {
        let limits = ProfileLimits { jerk: f32::INFINITY, ..random.limits() };
        let mut profile = Profile::from_setpoint(Setpoint {
            position: 0.0,
            velocity: random.within(limits.velocity),
            acceleration: 0.0,
        });
        let way = f64::from(random.way(&limits));
        let begin = f64::from(profile.setpoint().velocity);
        #[expect(clippy::cast_possible_truncation, reason = "it was an f32")]
        profile.set_target(&limits, way as f32, 0.0).unwrap();
        let [velocity, acceleration] = [limits.velocity, limits.acceleration].map(f64::from);
        let sooner = 0.998 * f64::from(profile.remaining().get());
        if sooner <= begin.abs() / acceleration {
            // It only just brakes.
            continue;
        }
        let dt = sooner / f64::from(STEPS);
        let (mut least, mut most) = (0.0, 0.0);
        for step in 0..STEPS {
            let time = (f64::from(step) + 0.5) * dt;
            let brakes = acceleration * (sooner - time);
            most += dt * (begin + acceleration * time).min(velocity).min(brakes);
            least += dt * (begin - acceleration * time).max(-velocity).max(-brakes);
        }
        let error = 1e-6 * velocity * sooner;
        assert!(way < least + error || way > most - error, "{limits:?} {begin} {way} {sooner}");
    }
}

#[test]
fn lowered_limits_are_returned_to_as_fast_as_they_allow() {
    let mut random = Random(3);
    let mut beyond = 0;
    for _ in 0..20_000 {
        let limits = random.limits();
        let mut profile = Profile::at(0.0);
        let target = random.way(&limits);
        profile.set_target(&limits, target, 0.0).unwrap();
        profile.update(Seconds::new(profile.remaining().get() * random.share()));
        let lowered = ProfileLimits {
            velocity: limits.velocity * random.scale(0.1, 1.0),
            acceleration: limits.acceleration * random.scale(0.1, 1.0),
            jerk: limits.jerk * random.scale(0.1, 1.0),
        };
        let begin = profile.setpoint();
        // Also without another target.
        let another = begin.position + random.way(&lowered);
        let target = if random.below(2) == 0 { target } else { another };
        profile.set_target(&lowered, target, 0.0).unwrap();
        let ProfileLimits { velocity, acceleration, jerk } = lowered;
        // The velocity that it cannot help reaching, and the time until all is within the limits.
        let swing = begin.acceleration * begin.acceleration / (2.0 * jerk);
        let highest = velocity.max(begin.velocity.abs() + swing);
        let ramps = (begin.acceleration.abs() + 3.0 * acceleration) / jerk;
        let until = (highest - velocity) / acceleration + ramps;
        beyond += u32::from(begin.velocity.abs() > velocity);
        let (dt, mut time) = (profile.remaining().get() / 300.0, 0.0);
        while !profile.has_arrived() {
            let from = profile.setpoint();
            let to = profile.update(Seconds::new(dt));
            time += dt;
            let fallen = (from.acceleration.abs() - jerk * dt).max(acceleration);
            assert!(to.acceleration.abs() <= fallen * 1.00001, "{lowered:?} {begin:?} {to:?}");
            let allowed = if time > until { velocity } else { highest };
            assert!(to.velocity.abs() <= allowed * 1.00001, "{lowered:?} {begin:?} {to:?} {time}");
        }
    }
    assert!(beyond > 5000, "{beyond}");
}

/// A driver's stick moves the target every 10 ms; then it is let go.
#[test]
fn a_target_that_changes_all_the_time_is_followed_without_chatter() {
    const LIMITS: ProfileLimits =
        ProfileLimits { velocity: 360.0, acceleration: 1500.0, jerk: 30_000.0 };
    const SPEED: f32 = 50.0;
    // The velocity that the jerk limit can change and change back between two targets.
    let ripple = LIMITS.jerk * 0.01 * 0.01 / 4.0;
    // A target is rounded to 2e-6, and made good in the shortest time too.
    for (is_told_the_speed, allowed) in [(false, ripple), (true, 1e-2)] {
        let mut profile = Profile::at(0.0);
        let mut target = 0.0;
        for tick in 0..2000_u16 {
            if tick % 10 == 0 {
                target = f32::from(tick) * 0.001 * SPEED;
                let speed = if is_told_the_speed { SPEED } else { 0.0 };
                profile.follow(&LIMITS, target, speed).unwrap();
            }
            let Setpoint { position, velocity, .. } = profile.update(MS);
            if tick > 500 {
                assert!((velocity - SPEED).abs() <= allowed, "{tick}: {velocity}");
                let lag = f32::from(tick + 1) * 0.001 * SPEED - position;
                // Unless it knows the speed, it is where it can still stop.
                let most = if is_told_the_speed { 1e-3 } else { 0.05 * SPEED };
                assert!((-1e-3..most).contains(&lag), "{tick}: {lag}");
            }
        }
        profile.set_target(&LIMITS, target, 0.0).unwrap();
        while !profile.has_arrived() {
            profile.update(MS);
        }
        assert_eq!(profile.setpoint().position.to_bits(), target.to_bits());
    }
}

#[test]
fn targets_that_creep_or_tremble_are_reached() {
    const LIMITS: ProfileLimits = ProfileLimits { velocity: 2.0, acceleration: 5.0, jerk: 50.0 };
    // In every tick a thousandth of the last place of the position further.
    let mut profile = Profile::at(1000.0);
    for tick in 0..20_000_u16 {
        profile.follow(&LIMITS, 1000.0, 6e-5).unwrap();
        let before = profile.setpoint();
        let after = profile.update(MS);
        assert!(after.velocity.abs() < 1e-3, "{tick}: {after:?}");
        assert!((after.position - before.position).abs() < 1e-3);
    }
    // Around a place, by rounding errors.
    let mut random = Random(4);
    let mut worst = 0.0_f32;
    for tick in 0..60_000 {
        profile.set_target(&LIMITS, 900.0 + random.within(1e-4), 0.0).unwrap();
        let Setpoint { velocity, acceleration, .. } = profile.update(MS);
        if tick > 52_000 {
            worst = worst.max(velocity.abs()).max(acceleration.abs() * 1e-3);
        }
    }
    profile.set_target(&LIMITS, 900.0, 0.0).unwrap();
    (0..1000).for_each(|_| _ = profile.update(MS));
    assert!(worst < 0.03, "{worst}");
    assert_eq!(profile.setpoint(), Setpoint { position: 900.0, velocity: 0.0, acceleration: 0.0 });
}

#[test]
fn axes_arrive_in_the_same_tick() {
    let mut random = Random(5);
    let (mut longest, mut took_longer) = (0.0_f32, 0);
    for _ in 0..3000 {
        let mut axes: [(ProfileLimits, Profile, Option<f32>); 4] = std::array::from_fn(|_| {
            let limits = random.limits();
            let mut profile = Profile::at(random.way(&limits));
            let mut target = profile.setpoint().position + random.way(&limits);
            // Half of them are on their way. Half brake, and have to stop a little further.
            if random.below(2) == 0 {
                profile.set_velocity(&limits, random.within(limits.velocity)).unwrap();
                profile.update(Seconds::new(profile.remaining().get() * 2.0 * random.share()));
            }
            if random.below(2) == 0 {
                profile.set_velocity(&limits, 0.0).unwrap();
                profile.update(Seconds::new(profile.remaining().get() * random.share()));
                let mut stopped = profile;
                let stop = stopped.update(profile.remaining()).position;
                let braking = stop - profile.setpoint().position;
                target = stop + braking * random.scale(0.001, 0.1);
            }
            // One goes past its target, one goes along with it.
            let velocity = random.within(0.9 * limits.velocity);
            let stands = match random.below(8) {
                0 => profile.set_target(&limits, target, velocity).map(|()| None),
                1 => profile.follow(&limits, target, velocity).map(|()| None),
                _ => profile.set_target(&limits, target, 0.0).map(|()| Some(target)),
            };
            (limits, profile, stands.unwrap())
        });
        let slowest = axes.iter().map(|(_, axis, _)| axis.remaining().get()).fold(0.0, f32::max);
        let late = axes.map(|(_, axis, _)| !axis.has_arrived());
        let [(_, a, _), (_, b, _), (_, c, _), (_, d, _)] = &mut axes;
        let together = synchronise(&mut [a, b, c, d]).get();
        assert!(together >= slowest * 0.99999, "{together} {slowest}");
        if together <= 0.0 {
            continue;
        }
        longest = longest.max(together / slowest);
        took_longer += u32::from(together > slowest * 1.001);
        let dt = Seconds::new(together / 173.3);
        let mut worst = Worst::default();
        for tick in 1..=174 {
            for ((limits, axis, _), late) in axes.iter_mut().zip(late) {
                let from = axis.setpoint();
                let to = axis.update(dt);
                worst.see(limits, from, to, dt.get(), together * limits.velocity);
                assert_eq!(axis.has_arrived(), tick == 174 || !late, "{axis:?}");
            }
        }
        for (_, axis, target) in &axes {
            if let Some(target) = target {
                assert_eq!(axis.setpoint().position.to_bits(), target.to_bits());
            }
        }
        assert!(worst.velocity <= 1.00001 && worst.acceleration <= 1.00001, "{worst:?}");
        assert!(worst.position_jump < 2e-5 && worst.velocity_jump < 1e-5, "{worst:?}");
    }
    // It is the exception that one cannot come later without starting again.
    assert!((5..300).contains(&took_longer) && longest < 8.0, "{took_longer} {longest}");
}

#[test]
fn a_target_that_moves_is_met_where_it_has_got_to() {
    const LIMITS: ProfileLimits = ProfileLimits { velocity: 2.0, acceleration: 5.0, jerk: 50.0 };
    let (mut one, mut other) = (Profile::at(0.0), Profile::at(0.0));
    one.follow(&LIMITS, 1.0, 0.5).unwrap();
    other.set_target(&LIMITS, 4.0, 0.0).unwrap();
    (0..100).for_each(|_| _ = (one.update(MS), other.update(MS)));
    // It has moved for 0.1 s by now.
    let ticks = (synchronise(&mut [&mut one, &mut other]).get() * 1000.0).ceil();
    assert!(ticks > 2000.0, "{ticks}");
    while !one.has_arrived() {
        one.update(MS);
        other.update(MS);
    }
    assert!(other.has_arrived());
    let met = 1.0 + 0.5 * (0.1 + 0.001 * ticks);
    assert!((one.setpoint().position - met).abs() < 1e-5, "{one:?} {met}");
    // Once more, and again: it is at 1 now.
    for _ in 0..2 {
        one.follow(&LIMITS, 1.0, 0.5).unwrap();
        let takes = one.remaining();
        let back = one.update(takes).position;
        assert!((back - (1.0 + 0.5 * takes.get())).abs() < 1e-5, "{back}");
        assert!(takes.get() > 0.1);
    }
}

fn shaft_limits() -> AngleLimits {
    AngleLimits {
        velocity: Rpm::new(300.0),
        acceleration: RpmPerSecond::new(2000.0),
        jerk: RpmPerSecondSquared::new(40_000.0),
    }
}

#[test]
fn a_shaft_far_from_zero_lands_on_the_microdegree() {
    let limits = shaft_limits();
    let here = TotalAngle::from_microdegrees(987_654_321_123_457);
    let mut shaft = AngleProfile::at(here);
    for microdegrees in [1, -1, 89_999_999, 360_000_001, -3_600_000_000_007, 12_345_678] {
        let target = here.plus(TotalAngle::from_microdegrees(microdegrees));
        shaft.set_target(&limits, target, Rpm::ZERO).unwrap();
        let mut last = shaft.setpoint();
        let way = target.minus(last.angle).microdegrees() as f32;
        while !shaft.has_arrived() {
            let next = shaft.update(MS);
            let moved = next.angle.minus(last.angle).microdegrees();
            // 1 rpm is 6 degrees a second. The trapezoidal rule is off by jerk · dt³ / 12, and the
            // way is rounded.
            let expected = 0.5 * (last.speed + next.speed).get() * 6000.0;
            let error = 22.0 + 3e-7 * way.abs();
            assert!((moved as f32 - expected).abs() < error, "{moved} {expected} {error}");
            last = next;
        }
        assert_eq!(last.angle, target);
        assert_eq!((last.speed, last.acceleration), (Rpm::ZERO, RpmPerSecond::ZERO));
    }
}

#[test]
fn after_an_hour_at_a_speed_a_shaft_is_where_it_has_to_be() {
    let limits = shaft_limits();
    let mut shaft = AngleProfile::at(TotalAngle::ZERO);
    shaft.set_target(&limits, TotalAngle::from_degrees(720), Rpm::new(60.0)).unwrap();
    while !shaft.has_arrived() {
        shaft.update(MS);
    }
    let begin = shaft.setpoint().angle;
    (0..3_600_000).for_each(|_| _ = shaft.update(MS));
    // 3600 turns; a millisecond is rounded to 5 parts in 10⁸.
    let turns = shaft.setpoint().angle.minus(begin).degrees().get() / 360.0;
    assert!((turns - 3600.0).abs() < 0.001, "{turns}");
}

#[test]
fn what_cannot_be_used_changes_nothing() {
    const LIMITS: ProfileLimits = ProfileLimits { velocity: 2.0, acceleration: 5.0, jerk: 50.0 };
    let mut profile = Profile::at(0.0);
    profile.set_target(&LIMITS, 1.0, 0.0).unwrap();
    profile.update(Seconds::new(0.2));
    let before = profile;
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(profile.set_target(&LIMITS, bad, 0.0).unwrap_err().field, "position");
        assert_eq!(profile.set_target(&LIMITS, 1.0, bad).unwrap_err().field, "velocity");
        assert_eq!(profile.follow(&LIMITS, bad, 0.0).unwrap_err().field, "position");
        assert_eq!(profile.set_velocity(&LIMITS, bad).unwrap_err().field, "velocity");
        profile.update(Seconds::new(bad));
    }
    for bad in [0.0, -1.0, f32::NAN] {
        let field = |limits| before.clone().set_target(&limits, 3.0, 0.0).unwrap_err().field;
        assert_eq!(field(ProfileLimits { velocity: bad, ..LIMITS }), "velocity");
        assert_eq!(field(ProfileLimits { acceleration: bad, ..LIMITS }), "acceleration");
        assert_eq!(field(ProfileLimits { jerk: bad, ..LIMITS }), "jerk");
        profile.update(Seconds::new(bad));
    }
    // Within the limit a target can be passed, but only below it be caught up with.
    assert_eq!(profile.clone().set_target(&LIMITS, 9.0, 2.0), Ok(()));
    assert_eq!(profile.follow(&LIMITS, 9.0, 2.0).unwrap_err().field, "velocity");
    // Too far for an f32.
    let slow = ProfileLimits { velocity: 1e-30, ..LIMITS };
    assert_eq!(profile.set_target(&slow, 1e20, 0.0).unwrap_err().field, "position");
    assert_eq!(profile, before);
    // The same target again is no new plan.
    profile.set_target(&LIMITS, 1.0, 0.0).unwrap();
    assert_eq!(profile, before);
}

#[test]
fn next_to_nothing_and_the_largest_numbers_do_no_harm() {
    let numbers = [0.0, 1e-38, 1e-30, 1e-20, 1e-10, 1e-3, 1.0, 1e3, 1e10, 1e20, 1e30];
    let mut planned = 0;
    for velocity in &numbers[1..] {
        for acceleration in &numbers[1..] {
            for jerk in numbers[1..].iter().chain([&f32::INFINITY]) {
                let (velocity, acceleration, jerk) = (*velocity, *acceleration, *jerk);
                let limits = ProfileLimits { velocity, acceleration, jerk };
                let mut profile = Profile::at(0.0);
                for way in numbers {
                    if profile.set_target(&limits, way, 0.0).is_ok() {
                        planned += 1;
                    }
                    let to = profile.update(Seconds::new(profile.remaining().get() * 0.4));
                    let all = [to.position, to.velocity, to.acceleration];
                    assert!(all.iter().all(|x| x.is_finite()), "{limits:?} {way} {to:?}");
                }
            }
        }
    }
    assert!(planned > 5000, "{planned}");
}
