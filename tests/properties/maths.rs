//! Angles that stay exact, and wheels that keep the direction.

use proptest::collection::vec;
use proptest::prelude::*;
use rc10_app::angle::{nearest_movement, shortest_way, shortest_way_degrees};
use rc10_app::{Base, CountsPerTurn, Degrees, FieldFrame, Radians, Rpm, TotalAngle, Twist};
use rc10_module::encoder::Counter;

use super::any;

/// Each position of a 13-bit encoder to each other one, as counts and as degrees: 45/1024 degrees
/// a count is exact in an f32, so nothing may be lost. Half a turn may go either way.
#[test]
fn the_shortest_way_is_exact_for_every_pair_of_counts() {
    let degrees: Vec<_> = (0..8192_u16).map(|raw| f32::from(raw) * 45.0 / 1024.0).collect();
    for from in 0..8192_u16 {
        let mut counter = Counter::new(8192);
        counter.update(from.into()).unwrap();
        for to in 0..8192_u16 {
            let exact = (i32::from(to) - i32::from(from) + 4096).rem_euclid(8192) - 4096;
            let (a, b) = (i32::from(from), i32::from(to));
            assert_eq!(shortest_way(a, b, 8192), exact);
            let mut moved = counter;
            assert_eq!(moved.update(to.into()), Ok(exact.into()));
            assert_eq!(moved.total(), i64::from(a + exact));
            let [one, other] = [degrees[usize::from(from)], degrees[usize::from(to)]];
            let way = shortest_way_degrees(Degrees::new(one), Degrees::new(other)).get();
            let way = f64::from(way) * 1024.0 / 45.0;
            let near = (way - f64::from(exact)).abs() < 1e-9;
            assert!(near || exact == -4096 && (way - 4096.0).abs() < 1e-9, "{from} {to}: {way}");
        }
    }
}

proptest! {
    #![proptest_config(any::cases(2000))]

    #[test]
    fn the_shortest_way_leads_there(
        from in any::number(),
        to in any::number(),
    ) {
        let way = shortest_way_degrees(Degrees::new(from), Degrees::new(to)).get();
        let (from, to) = (f64::from(from), f64::from(to));
        if from.abs() < 1e5 && to.abs() < 1e5 {
            prop_assert!((-180.02..=180.02).contains(&way), "{}", way);
            let miss = (from + f64::from(way) - to).rem_euclid(360.0);
            prop_assert!(miss.min(360.0 - miss) < 0.02, "{} off", miss);
        }
    }

    /// On a circle of any size, forwards and backwards.
    #[test]
    fn an_encoder_counts_every_step(
        modulus in 3..=1_u64 << 32,
        start in any::<u32>(),
        steps in vec(any::<i32>(), 1..50),
        turns in vec(-1_000_000..1_000_000_i64, 50),
    ) {
        let circle = i64::try_from(modulus).unwrap();
        let half = (circle - 1) / 2;
        let first = i64::from(start) % circle;
        let mut total = first;
        let mut counter = Counter::new(modulus);
        let raw = |total: i64| u32::try_from(total.rem_euclid(circle)).unwrap();
        counter.update(raw(total)).unwrap();
        for (&step, &turns) in steps.iter().zip(&turns) {
            let step = i64::from(step) % (half + 1);
            total += step;
            prop_assert_eq!(counter.update(raw(total)), Ok(step));
            // Through a gap: the expectation may be wrong by almost half a turn.
            let moved = turns * circle + step;
            let expected = moved - i64::from(start) % (half + 1);
            prop_assert_eq!(nearest_movement(step, expected, circle), moved);
        }
        if let Ok(modulus) = u32::try_from(modulus) {
            prop_assert!(counter.update(modulus).is_err());
        }
        prop_assert_eq!(counter.total(), total);
    }

    #[test]
    fn total_angles_never_leave_their_range(
        one in any::total_angle(),
        other in any::total_angle(),
        degrees in any::number(),
    ) {
        prop_assert!(one.degrees().is_finite());
        prop_assert!((0.0..360.0).contains(&one.within_turn().get()));
        prop_assert_eq!(one, one);
        prop_assert_eq!(one == other, other == one);
        let _ = (one.plus(other), one.minus(other), one.counts_at(CountsPerTurn::new(8192, 3)));
        let angle = TotalAngle::try_from_degrees(Degrees::new(degrees));
        prop_assert_eq!(angle.is_some(), degrees.abs() <= 9e12);
        if let Some(angle) = angle {
            let back = f64::from(angle.degrees().get());
            let off = (back - f64::from(degrees)).abs();
            prop_assert!(off <= 1e-6 + 2e-7 * f64::from(degrees.abs()), "{} {}", degrees, back);
        }
    }

    /// A base that cannot go as fast as it shall still goes where it shall.
    #[test]
    fn limited_wheels_keep_the_direction(
        vx in any::number(),
        vy in any::number(),
        wz in any::number(),
        radius in 0.01..0.3_f32,
        length in 0.05..1.0_f32,
        width in 0.05..1.0_f32,
        most in 1.0..10_000.0_f32,
    ) {
        let base = Base::mecanum(radius, length, width, Rpm::new(most));
        let Ok(wheels) = base.inverse(Twist::new(vx, vy, wz)) else {
            // Only what cannot be computed with is refused.
            let sum = f64::from(vx.abs()) + f64::from(vy.abs()) + f64::from(wz.abs()) * 2.0;
            prop_assert!(!sum.is_finite() || sum / f64::from(radius) > 1e37);
            return Ok(());
        };
        let scale = f64::from(wheels.scale);
        prop_assert!((0.0..=1.0).contains(&scale));
        let speeds = wheels.speeds.map(|speed| speed.get());
        prop_assert!(speeds.iter().all(|speed| speed.abs() <= most), "{:?}", wheels);
        let fastest = speeds.iter().fold(0.0_f32, |fastest, speed| fastest.max(speed.abs()));
        let exactly = (fastest - most).abs() <= 1e-6 * most;
        prop_assert!(wheels.scale >= 1.0 || exactly, "slower than it could: {:?}", wheels);
        let [x, y, turn] = [vx, vy, wz].map(f64::from);
        let turn = turn * f64::from(length + width);
        let per_speed = scale * 30.0 / (std::f64::consts::PI * f64::from(radius));
        let size = (x.abs() + y.abs() + turn.abs()) * per_speed;
        let wanted = [x - y - turn, x + y + turn, x + y - turn, x - y + turn];
        for (wanted, speed) in wanted.into_iter().zip(speeds) {
            let off = (wanted * per_speed - f64::from(speed)).abs();
            prop_assert!(off <= 2e-6 * size + 1e-30, "{:?} is {} off", wheels, off);
        }
        prop_assert!(base.forward(wheels.speeds).twist.is_finite());
        let there = Twist::<FieldFrame>::new(vx, vy, wz).into_frame(Radians::new(1.0));
        prop_assert!(there.wz.to_bits() == wz.to_bits());
    }
}
