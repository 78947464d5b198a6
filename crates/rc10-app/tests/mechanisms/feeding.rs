//! Jams of a simulated motor, and a feeder that counts through them.

use rc10_app::mechanism::{
    Feeder, FeederConfig, Health, Jam, JamConfig, JamStatus, MotorCommand, SoftLimits, Stall,
};
use rc10_app::{CountsPerTurn, Degrees, Direction, Rpm, Seconds, TotalAngle};

use super::axis::{Axis, BRAKING, FULL, Random, Stop};

const STALL_TIME: f32 = 0.2;

const JAM: JamConfig = JamConfig {
    stall: Stall { effort: 8.0, standstill: Rpm::new(5.0), time: Seconds::new(STALL_TIME) },
    following_error: Degrees::new(2.0),
    reverse: Degrees::new(30.0),
    reverse_speed: Rpm::new(60.0),
    reverse_time: Seconds::new(0.5),
    tries: 3,
};

fn period(random: &mut Random) -> (u32, Seconds) {
    let period = [1, 2, 5, 10][random.below(4)];
    (period, Seconds::new(period as f32 * 1e-3))
}

#[test]
fn a_heavy_start_is_no_jam() {
    for seed in 0..500 {
        let mut random = Random(seed);
        let (period, dt) = period(&mut random);
        let mut axis = Axis::random(&mut random, 0.0);
        // From rest to the speed of a standstill, 30 deg/s, in at most 0.13 s: below the time of a jam.
        axis.gain = random.between(15.0, 100.0);
        let (mut jam, mut wanted) = (Jam::new(), MotorCommand::STOP);
        let mut pushed = 0;
        for ms in 0..4000 {
            if ms % 1000 == 0 {
                wanted = MotorCommand::Speed(Rpm::new(random.between(-200.0, 200.0) as f32));
            }
            if ms % period == 0 {
                axis.command(jam.update(&JAM, wanted, &axis.measured(), dt));
            }
            axis.step(&mut random);
            pushed += u32::from(axis.effort.abs() > 0.9 * FULL);
        }
        assert!(pushed > 100, "{seed}: no heavy start");
        assert_eq!(jam.count(), 0, "{seed}");
    }
}

#[test]
fn a_jam_is_found_within_its_time() {
    for seed in 0..500 {
        let mut random = Random(seed);
        let (period, dt) = period(&mut random);
        let mut axis = Axis::random(&mut random, 0.0);
        let direction = if random.chance(0.5) { 1.0 } else { -1.0 };
        let speed = direction * random.between(30.0, 150.0);
        let wanted = MotorCommand::Speed(Rpm::new(speed as f32));
        let jams_at = random.between(500.0, 1500.0) as u32;
        let mut jam = Jam::new();
        let (mut pushing, mut found) = (0.0, None);
        for ms in 0..4000 {
            if ms == jams_at {
                assert_eq!(jam.count(), 0, "{seed}");
                axis.stops.push(Stop { at: axis.angle, direction, stiffness: 20.0 });
            }
            if ms % period == 0 {
                let measured = axis.measured();
                let is_stalled = f64::from(measured.effort) * direction >= 8.0
                    && measured.speed.get().abs() < 5.0;
                pushing = if is_stalled { pushing + dt.get() } else { 0.0 };
                axis.command(jam.update(&JAM, wanted, &measured, dt));
                if jam.count() > 0 {
                    found = Some(ms);
                    break;
                }
            }
            axis.step(&mut random);
        }
        let Some(found) = found else { panic!("{seed}: not found") };
        assert!(pushing <= STALL_TIME + 1.01 * dt.get(), "{seed}: {pushing}");
        // With the time in which the loop builds up the effort and the rebound dies out.
        assert!(found - jams_at <= 800, "{seed}: {} ms", found - jams_at);
    }
}

/// Obstacles before a feeder: one comes up now and then, and goes when the feeder reverses.
struct Hopper {
    /// Piece frame, forward; what is needed to free it: degrees of reversing, times.
    jammed: Option<(f64, f64, u32)>,
    is_back: bool,
    jams: u32,
}

impl Hopper {
    fn step(&mut self, axis: &mut Axis, sign: f64, share: f64, lasting: bool, random: &mut Random) {
        let at = sign * axis.angle;
        match &mut self.jammed {
            None if axis.speed * sign > 60.0 && random.chance(share) => {
                let times = if lasting { u32::MAX } else { 1 + random.below(3) as u32 };
                self.jammed = Some((at, random.between(2.0, 25.0), times));
                self.jams += 1;
                axis.stops = vec![Stop { at: axis.angle, direction: sign, stiffness: 20.0 }];
            }
            None => {}
            Some((from, back, times)) => {
                let is_back = at < *from - *back;
                if is_back && !self.is_back {
                    *times -= 1;
                }
                self.is_back = is_back;
                if *times == 0 {
                    (self.jammed, self.is_back) = (None, false);
                    axis.stops.clear();
                }
            }
        }
    }
}

#[test]
fn pieces_are_counted_right_through_jams() {
    let (mut jams, mut total, mut given_up) = (0, 0, 0);
    for seed in 0..300 {
        let mut random = Random(seed);
        let (period, dt) = period(&mut random);
        let direction = [Direction::Forward, Direction::Reversed][random.below(2)];
        let sign = f64::from(direction.sign());
        let config = FeederConfig {
            pieces: CountsPerTurn::new(3 + random.below(7) as u32, 1 + random.below(2) as u32),
            direction,
            pieces_per_s: random.between(2.0, 8.0) as f32,
            acceleration: BRAKING.acceleration,
            tolerance: Degrees::new(3.0),
            jam: JAM,
        };
        assert_eq!(config.validate(), Ok(()));
        let piece = 360.0 * f64::from(config.pieces.turns()) / f64::from(config.pieces.counts());
        let mut axis = Axis::random(&mut random, 0.0);
        let mut feeder = Feeder::new();
        let mut hopper = Hopper { jammed: None, is_back: false, jams: 0 };
        let (mut ordered, mut furthest) = (0, 0.0_f64);
        let (mut rests_for, mut offline_for) = (0, 0);
        for ms in 0..60_000 {
            // Orders come in the first ten seconds, also while others are on their way.
            if ms < 10_000 && random.chance(0.001) {
                let pieces = random.below(4) as u32;
                feeder.feed(pieces);
                ordered += pieces;
            }
            // A motor that is lost at speed coasts on and feeds what it likes.
            if offline_for == 0 && axis.speed.abs() < 60.0 && random.chance(0.0002) {
                offline_for = 100;
            }
            axis.health = if offline_for > 0 { Health::Offline } else { Health::Ready };
            offline_for = u32::saturating_sub(offline_for, 1);
            if ms % period == 0 {
                let before = feeder.fed();
                axis.command(feeder.update(&config, &axis.measured(), dt));
                assert!(feeder.fed() >= before, "{seed}: a piece came back");
            }
            axis.step(&mut random);
            hopper.step(&mut axis, sign, 0.0003, false, &mut random);
            furthest = furthest.max(sign * axis.angle);
            if feeder.jam().status() == JamStatus::GivenUp {
                // Several obstacles in one place.
                given_up += 1;
                feeder.reset();
            }
            let is_free = feeder.jam().status() == JamStatus::Free && hopper.jammed.is_none();
            rests_for = if feeder.left() == 0 && is_free { rests_for + 1 } else { 0 };
            if ms > 10_000 && rests_for > 500 {
                break;
            }
        }
        // Fed is what was ordered, and what has come out: by where the shaft has been, at most.
        let out = ((furthest + 3.0) / piece).floor() as u32;
        assert_eq!((feeder.fed(), feeder.left()), (ordered, 0), "{seed}");
        assert_eq!(out, ordered, "{seed}: {furthest} of {piece}");
        let off = sign * axis.angle - f64::from(ordered) * piece;
        assert!(off.abs() < 3.0, "{seed}: {off}");
        (jams, total) = (jams + hopper.jams, total + ordered);
    }
    println!("{total} pieces, {jams} jams, {given_up} times given up");
    assert!(jams > 300 && total > 3000, "{jams} {total}");
}

#[test]
fn a_feeder_that_gave_up_feeds_the_rest_after_a_reset() {
    for seed in 0..100 {
        let mut random = Random(seed);
        let (period, dt) = period(&mut random);
        let config = FeederConfig {
            pieces: CountsPerTurn::new(7, 1),
            direction: Direction::Forward,
            pieces_per_s: 6.0,
            acceleration: BRAKING.acceleration,
            tolerance: Degrees::new(3.0),
            jam: JAM,
        };
        let mut axis = Axis::random(&mut random, 0.0);
        let mut feeder = Feeder::new();
        let mut hopper = Hopper { jammed: None, is_back: false, jams: 0 };
        feeder.feed(10);
        for ms in 0..20_000 {
            if ms % period == 0 {
                axis.command(feeder.update(&config, &axis.measured(), dt));
            }
            axis.step(&mut random);
            let share = if ms < 10_000 { 0.005 } else { 0.0 };
            hopper.step(&mut axis, 1.0, share, true, &mut random);
            if ms == 10_000 {
                assert_eq!(feeder.jam().status(), JamStatus::GivenUp, "{seed}");
                assert_eq!(feeder.jam().count(), 4, "{seed}");
                // It has let go.
                assert!(axis.effort.abs() < 4.0, "{seed}: {}", axis.effort);
                assert!(feeder.left() > 0);
                axis.stops.clear();
                hopper.jammed = Some((1e9, 1e9, 0));
                feeder.reset();
            }
        }
        assert_eq!((feeder.fed(), feeder.left()), (10, 0), "{seed}");
        assert!((axis.angle - 3600.0 / 7.0).abs() < 3.0, "{seed}: {}", axis.angle);
    }
}

#[test]
fn a_speed_within_soft_limits_never_leaves_them() {
    for seed in 0..500 {
        let mut random = Random(seed);
        let (period, _) = period(&mut random);
        let mut axis = Axis::random(&mut random, 0.0);
        let limits = SoftLimits {
            lower: TotalAngle::from_degrees(-200),
            upper: TotalAngle::from_degrees(300),
            braking: BRAKING,
            not_homed: Rpm::ZERO,
        };
        let mut wanted = MotorCommand::STOP;
        let (mut least, mut most) = (0.0_f64, 0.0_f64);
        for ms in 0..5000 {
            if random.chance(0.002) {
                wanted = MotorCommand::Speed(Rpm::new(random.between(-150.0, 150.0) as f32));
            }
            if ms % period == 0 {
                axis.command(limits.limit(wanted, Some(axis.measured().angle)).command);
            }
            axis.step(&mut random);
            (least, most) = (least.min(axis.angle), most.max(axis.angle));
        }
        assert!(least >= -200.1 && most <= 300.1, "{seed}: {least} {most}");
    }
}
