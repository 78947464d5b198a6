//! Bases: what their wheels can do, what they refuse, and what is seen of a wheel that is wrong.

use crate::random::Random;
use crate::walk::bases::SKID_STEER;
use rc10_app::base::{Base, BaseError, Body, Tread, Wheel};
use rc10_app::{BaseMotion, Degrees, Direction, Point, Rpm, RpmPerSecond, Twist, TwistLimits};

const LIMIT: Rpm = Rpm::new(450.0);
const MECANUM: Base<4> = Base::mecanum(0.076, 0.20, 0.25, LIMIT);
const OMNI_4: Base<4> = Base::omni_4(0.076, 0.25, LIMIT);
const OMNI_3: Base<3> = Base::omni_3(0.05, 0.2, LIMIT);
const DIFFERENTIAL: Base<2> = Base::differential(0.05, 0.2, LIMIT);

fn twist(random: &mut Random, size: f32) -> Twist {
    Twist::new(random.within(size), random.within(size), random.within(2.0 * size))
}

#[track_caller]
fn near(actual: Twist, expected: Twist, tolerance: f32) {
    let off = actual - expected;
    let worst = off.vx.abs().max(off.vy.abs()).max(off.wz.abs());
    assert!(worst < tolerance, "{actual:?} is not {expected:?}");
}

fn signs<const N: usize>(base: &Base<N>, twist: Twist) -> [i8; N] {
    base.inverse(twist).unwrap().speeds.map(|speed| match speed.get() {
        speed if speed > 1e-3 => 1,
        speed if speed < -1e-3 => -1,
        _ => 0,
    })
}

#[test]
fn each_motion_turns_the_wheels_the_right_way() {
    let (x, y, turn) =
        (Twist::new(1.0, 0.0, 0.0), Twist::new(0.0, 1.0, 0.0), Twist::new(0.0, 0.0, 1.0));
    assert_eq!(signs(&MECANUM, x), [1, 1, 1, 1]);
    assert_eq!(signs(&MECANUM, y), [-1, 1, 1, -1]);
    assert_eq!(signs(&MECANUM, turn), [-1, 1, -1, 1]);
    assert_eq!(signs(&MECANUM, x + y), [0, 1, 1, 0]);
    assert_eq!(signs(&OMNI_4, x), [-1, -1, 1, 1]);
    assert_eq!(signs(&OMNI_4, y), [1, -1, -1, 1]);
    assert_eq!(signs(&OMNI_4, turn), [1; 4]);
    assert_eq!(signs(&OMNI_3, x), [-1, 0, 1]);
    assert_eq!(signs(&OMNI_3, y), [1, -1, 1]);
    assert_eq!(signs(&OMNI_3, turn), [1; 3]);
    assert_eq!(signs(&DIFFERENTIAL, x), [1, 1]);
    assert_eq!(signs(&DIFFERENTIAL, turn), [-1, 1]);
    assert_eq!(signs(&DIFFERENTIAL, y), [0, 0]);
    assert_eq!(signs(&SKID_STEER, turn), [-1, 1, -1, 1]);
}

#[test]
fn wheel_speeds_have_the_right_size() {
    // One circumference of the wheel per second forward is 60 rpm.
    let rim = core::f32::consts::TAU * 0.076;
    for speed in MECANUM.inverse(Twist::new(rim, 0.0, 0.0)).unwrap().speeds {
        assert!((speed.get() - 60.0).abs() < 1e-4, "{speed}");
    }
    // 2 rad/s · 0.45 m / 0.076 m = 11.842 rad/s = 113.08 rpm; the lever of the omni wheels is 0.25 m.
    let turn = Twist::new(0.0, 0.0, 2.0);
    assert!((MECANUM.inverse(turn).unwrap().speeds[1].get() - 113.085).abs() < 1e-2);
    assert!((OMNI_4.inverse(turn).unwrap().speeds[1].get() - 62.825).abs() < 1e-2);
    let [left, right] = DIFFERENTIAL.accelerations(turn);
    // 2 rad/s² · 0.2 m / 0.05 m = 8 rad/s².
    assert!((right.get() - 76.394).abs() < 1e-2 && (left.get() + 76.394).abs() < 1e-2);
}

/// The wheels' power is that of the forces on the body, whatever the base: also with the axes that turn.
#[test]
fn the_power_of_the_torques_is_that_of_the_body() {
    fn power<const N: usize>(base: &Base<N>, twist: Twist, change: Twist) -> [f32; 2] {
        let body = Body { mass_kg: 17.0, yaw_inertia_kg_m2: 0.9 };
        let speeds = base.inverse(twist).unwrap();
        assert!((speeds.scale - 1.0).abs() < 1e-6, "meant to be within the limit");
        let torques = base.torques(&body, twist, change);
        let of_wheels = torques
            .iter()
            .zip(speeds.speeds)
            .map(|(torque, speed)| torque.get() * speed.get() * core::f32::consts::PI / 30.0);
        // The turning of the axes does no work on the velocity.
        let of_body = body.mass_kg * (twist.vx * change.vx + twist.vy * change.vy)
            + body.yaw_inertia_kg_m2 * twist.wz * change.wz;
        [of_wheels.sum(), of_body]
    }
    let mut random = Random(23);
    for _ in 0..500 {
        let [twist, change] = [0.5, 3.0]
            .map(|size| Twist::new(random.within(size), random.within(size), random.within(size)));
        for [wheels, body] in [power(&MECANUM, twist, change), power(&OMNI_4, twist, change)] {
            assert!((wheels - body).abs() < 1e-3 * body.abs().max(1.0), "{wheels} W, {body} W");
        }
    }
}

/// A wheel in a random place, as wheels are.
fn wheel(random: &mut Random, tread: Tread, direction: f32) -> Wheel {
    Wheel {
        place: Point::new(random.within(0.4), random.within(0.4)),
        direction: Degrees::new(direction),
        tread,
        radius: 0.06 + random.within(0.03),
        turns: if random.within(1.0) > 0.0 { Direction::Forward } else { Direction::Reversed },
    }
}

/// A base of random wheels: all with rollers, or some plain ones in parallel as well.
fn base<const N: usize>(random: &mut Random, limit: f32, plain: usize) -> Option<Base<N>> {
    let along = random.within(180.0);
    let mut count = 0;
    let wheels = [(); N].map(|()| {
        count += 1;
        if count <= plain {
            let back = if random.within(1.0) > 0.0 { 180.0 } else { 0.0 };
            return wheel(random, Tread::Plain, along + back);
        }
        let rollers = [90.0, 45.0, -45.0, 60.0][count % 4];
        let direction = random.within(180.0);
        wheel(random, Tread::Rollers(Degrees::new(rollers)), direction)
    });
    Base::new(wheels, Rpm::new(limit)).ok()
}

#[test]
fn forward_undoes_inverse_for_every_sound_base() {
    fn undone<const N: usize>(random: &mut Random, base: &Base<N>) {
        for _ in 0..10 {
            let wanted = twist(random, 1.0);
            let wheels = base.inverse(wanted).unwrap();
            assert!((wheels.scale - 1.0).abs() < f32::EPSILON, "meant to be within the limit");
            let motion = base.forward(wheels.speeds);
            let left_out = motion.twist - wanted;
            let across = left_out.vx.hypot(left_out.vy);
            // Only what was reported is missing, and it is a motion across the plain wheels.
            assert!((across - base.sideways(wanted).abs()).abs() < 2e-4, "{wheels:?} {motion:?}");
            assert!(left_out.wz.abs() < 1e-3, "{base:?} {wanted:?} {motion:?}");
            assert!(motion.slip() < 2e-5, "{motion:?}");
        }
    }
    let (mut random, mut sound) = (Random(10), 0);
    for round in 0..3000 {
        let plain = if round % 3 == 0 { round / 3 % 3 } else { 0 };
        sound += u32::from(base::<3>(&mut random, 1e7, plain).is_some_and(|base| {
            undone(&mut random, &base);
            true
        }));
        sound += u32::from(base::<4>(&mut random, 1e7, plain).is_some_and(|base| {
            undone(&mut random, &base);
            true
        }));
        sound += u32::from(base::<6>(&mut random, 1e7, plain).is_some_and(|base| {
            undone(&mut random, &base);
            true
        }));
    }
    assert!(sound > 6000, "{sound} of 9000 sound");
    for _ in 0..100 {
        undone(&mut random, &MECANUM);
        undone(&mut random, &OMNI_4);
        undone(&mut random, &OMNI_3);
        undone(&mut random, &DIFFERENTIAL);
        undone(&mut random, &SKID_STEER);
    }
}

#[test]
fn r13_the_limit_is_kept_and_so_is_the_direction() {
    fn kept<const N: usize>(random: &mut Random, base: &Base<N>, limited: &mut u32) {
        let limit = base.max_wheel_speed().get();
        let wanted = twist(random, 6.0);
        let wheels = base.inverse(wanted).unwrap();
        let fastest = wheels.speeds.iter().fold(0.0_f32, |a, b| a.max(b.get().abs()));
        assert!(fastest <= limit && wheels.scale > 0.0 && wheels.scale <= 1.0, "{wheels:?}");
        if wheels.scale < 1.0 {
            *limited += 1;
            assert!(fastest > limit * 0.999_999, "{fastest} of {limit}");
        }
        // What it would do without a limit, slower.
        let unlimited = Base::new(*base.wheels(), Rpm::new(1e9)).unwrap();
        let all = unlimited.forward(unlimited.inverse(wanted).unwrap().speeds).twist;
        near(base.forward(wheels.speeds).twist, all * wheels.scale, 2e-4);
    }
    let (mut random, mut limited, mut all) = (Random(11), 0, 0);
    for _ in 0..2000 {
        for base in [MECANUM, OMNI_4, SKID_STEER] {
            kept(&mut random, &base, &mut limited);
        }
        kept(&mut random, &OMNI_3, &mut limited);
        kept(&mut random, &DIFFERENTIAL, &mut limited);
        let Some(base) = base::<5>(&mut random, 700.0, 0) else { continue };
        kept(&mut random, &base, &mut limited);
        all += 1;
    }
    assert!(all > 1500 && limited > 3000 && limited < 11_000, "{limited} limited, {all} random");
}

#[test]
fn a_twist_that_is_not_finite_is_an_error() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
        for twist in
            [Twist::new(bad, 0.0, 0.0), Twist::new(0.0, bad, 0.0), Twist::new(0.0, 0.0, bad)]
        {
            let named = MECANUM.inverse(twist).unwrap_err();
            assert_eq!(named.vx.to_bits(), twist.vx.to_bits());
            assert!(OMNI_3.inverse(twist).is_err());
        }
    }
    let error = MECANUM.inverse(Twist::new(f32::NAN, 0.5, 1.0)).unwrap_err();
    assert_eq!(error.to_string(), "not a usable twist: vx NaN m/s, vy 0.5 m/s, wz 1 rad/s");
    assert!(!MECANUM.forward([Rpm::new(f32::NAN); 4]).twist.is_finite());
    assert!(MECANUM.forward([Rpm::new(f32::NAN); 4]).slip().is_nan());
}

fn omni(x: f32, y: f32, direction: f32) -> Wheel {
    let tread = Tread::OMNI;
    let (place, direction) = (Point::new(x, y), Degrees::new(direction));
    Wheel { place, direction, tread, radius: 0.05, turns: Direction::Forward }
}

fn plain(x: f32, y: f32, direction: f32) -> Wheel {
    Wheel { tread: Tread::Plain, ..omni(x, y, direction) }
}

fn why<const N: usize>(wheels: [Wheel; N]) -> String {
    Base::new(wheels, LIMIT).unwrap_err().to_string()
}

#[test]
fn an_unsound_base_is_refused_with_the_reason() {
    // Wheels that point at the middle do not turn it.
    let radial = [omni(0.2, 0.0, 0.0), omni(0.0, 0.2, 90.0), omni(-0.2, 0.0, 180.0)];
    assert_eq!(why(radial), "the wheels cannot turn the base about (0, 0)");
    let moved = radial
        .map(|wheel| Wheel { place: Point::new(wheel.place.x + 0.5, wheel.place.y), ..wheel });
    assert_eq!(why(moved), "the wheels cannot turn the base about (0.5, 0)");
    // Omni wheels in parallel: it slides away sideways.
    let parallel = [omni(0.2, 0.2, 0.0), omni(0.2, -0.2, 0.0), omni(-0.2, 0.2, 0.0)];
    assert_eq!(why(parallel), "the wheels cannot move or hold the base along (0, 1)");
    assert_eq!(why([omni(0.2, 0.2, 0.0)]), "the wheels cannot move or hold the base along (0, 1)");
    assert!(matches!(Base::new([], LIMIT), Err(BaseError::CannotMove { .. })));
    // Mecanum wheels all of one kind, and on a square with left and right exchanged.
    let mecanum = *MECANUM.wheels();
    let one_kind = mecanum.map(|wheel| Wheel { tread: mecanum[0].tread, ..wheel });
    assert!(matches!(Base::new(one_kind, LIMIT), Err(BaseError::CannotMove { .. })));
    let square = *Base::mecanum(0.076, 0.2, 0.2, LIMIT).wheels();
    let exchanged = [square[1], square[0], square[3], square[2]];
    let exchanged = [0, 1, 2, 3].map(|at| Wheel { place: square[at].place, ..exchanged[at] });
    assert_eq!(why(exchanged), "the wheels cannot turn the base about (0, 0)");
    // Two plain wheels one behind the other, and one alone.
    let bicycle = [plain(0.2, 0.0, 0.0), plain(-0.2, 0.0, 0.0)];
    assert!(matches!(Base::new(bicycle, LIMIT), Err(BaseError::CannotTurn { .. })));
    assert_eq!(why([plain(0.0, 0.1, 0.0)]), "the wheels cannot turn the base about (0, 0.1)");
    let at_odds = [plain(0.0, 0.2, 0.0), omni(0.0, 0.0, 0.0), plain(0.0, -0.2, 3.0)];
    let reason =
        "wheels 0 and 2 have no rollers and do not roll in parallel: they drag each other sideways";
    assert_eq!(why(at_odds), reason);
    let mut lame = mecanum;
    lame[2].tread = Tread::Rollers(Degrees::new(183.0));
    assert_eq!(why(lame), "the rollers of wheel 2 lie along its axle: it cannot push");
    for bad in [0.0, -0.1, f32::NAN, f32::INFINITY] {
        let mut wheels = mecanum;
        wheels[1].radius = bad;
        assert!(why(wheels).starts_with("wheel 1: `radius` is "), "{}", why(wheels));
        assert!(matches!(Base::new(mecanum, Rpm::new(bad)), Err(BaseError::Config(_))));
    }
    // In millimetres.
    let mut wheels = mecanum;
    wheels[1].radius = 76.0;
    assert_eq!(why(wheels), "wheel 1: `radius` is 76, but must be in metres, 1 at most");
    let mut wheels = mecanum;
    wheels[0].place.x = 200.0;
    assert_eq!(why(wheels), "wheel 0: `place.x` is 200, but must be in metres, 5 at most");
    let mut wheels = mecanum;
    wheels[3].place.y = f32::NAN;
    assert_eq!(why(wheels), "wheel 3: `place.y` is NaN, but must be finite");
}

/// How a wheel can be wrong.
#[derive(Clone, Copy, Debug)]
enum Wrong {
    Reversed,
    Dead,
    Slips,
}

fn measured<const N: usize>(base: &Base<N>, twist: Twist, wheel: usize, wrong: Wrong) -> [Rpm; N] {
    let mut speeds = base.inverse(twist).unwrap().speeds;
    speeds[wheel] = match wrong {
        Wrong::Reversed => -speeds[wheel],
        Wrong::Dead => Rpm::ZERO,
        Wrong::Slips => speeds[wheel] + Rpm::new(60.0),
    };
    speeds
}

/// The largest residual of some motions, with a wheel wrong and afterwards turned round.
fn seen<const N: usize>(base: &Base<N>, wheel: usize, wrong: Wrong, turned: Option<usize>) -> f32 {
    let mut random = Random(20);
    (0..50).fold(0.0, |most: f32, _| {
        let mut speeds = measured(base, twist(&mut random, 1.0), wheel, wrong);
        if let Some(turned) = turned {
            speeds[turned] = -speeds[turned];
        }
        most.max(base.forward(speeds).slip())
    })
}

#[test]
fn a_wheel_that_is_wrong_is_seen_in_the_residual_where_wheels_are_more_than_motions() {
    for base in [MECANUM, OMNI_4, SKID_STEER] {
        for wheel in 0..4 {
            for wrong in [Wrong::Reversed, Wrong::Dead, Wrong::Slips] {
                assert!(seen(&base, wheel, wrong, None) > 0.05, "{wheel} {wrong:?}");
            }
            // Turned round again it leaves nothing; another one does. (On a skid-steer base the
            // other wheel of the same side makes them equal as well, and the wrong motion.)
            for turned in 0..4 {
                let left = seen(&base, wheel, Wrong::Reversed, Some(turned));
                if turned == wheel || base == SKID_STEER && turned % 2 == wheel % 2 {
                    assert!(left < 1e-5, "{left}");
                } else {
                    assert!(left > 0.05, "{wheel} {turned}: {left}");
                }
            }
        }
    }
    // As documented: three omni wheels or two of a differential base show nothing.
    for wrong in [Wrong::Reversed, Wrong::Dead, Wrong::Slips] {
        assert!(seen(&OMNI_3, 1, wrong, None) < 1e-5 && seen(&DIFFERENTIAL, 1, wrong, None) < 1e-5);
    }
}

#[test]
fn the_slip_is_the_largest_residual_of_a_wheel_too_fast_or_too_slow() {
    for wheel in 0..4 {
        for sign in [1.0, -1.0] {
            let mut residual = [0.1, -0.1, 0.1, -0.1];
            residual[wheel] = sign * 0.3;
            let motion = BaseMotion { twist: Twist::STOP, residual };
            assert!((motion.slip() - 0.3).abs() < 1e-6, "{motion:?}");
        }
    }
}

#[test]
fn forward_ignores_what_no_motion_explains() {
    // Front wheels against rear wheels: pure slip.
    let slip = [10.0, 10.0, -10.0, -10.0].map(Rpm::new);
    let motion = MECANUM.forward(slip);
    near(motion.twist, Twist::STOP, 1e-6);
    // 10 rpm of a wheel of 76 mm.
    assert!((motion.slip() - 0.079_59).abs() < 1e-5, "{motion:?}");
    let wanted = Twist::new(0.5, -0.3, 1.0);
    let mut speeds = MECANUM.inverse(wanted).unwrap().speeds;
    for (speed, slip) in speeds.iter_mut().zip(slip) {
        *speed = *speed + slip;
    }
    near(MECANUM.forward(speeds).twist, wanted, 1e-5);
}

#[test]
fn limits_that_the_wheels_cannot_keep_are_told() {
    let limits = TwistLimits { linear_m_s2: 3.0, angular_rad_s2: 12.0 };
    // The worst direction of a mecanum wheel is along its rollers' axis: √2 · 3 m/s² and
    // 0.45 m · 12 rad/s², of 76 mm: 126.88 rad/s².
    let needed = RpmPerSecond::new(1211.6);
    assert_eq!(MECANUM.validate_limits(&limits, needed + RpmPerSecond::new(0.1)), Ok(()));
    let error = MECANUM.validate_limits(&limits, needed - RpmPerSecond::new(0.1)).unwrap_err();
    assert!((error.value - 1211.6).abs() < 0.1, "{error}");
    let bad = TwistLimits { linear_m_s2: -1.0, ..limits };
    assert_eq!(MECANUM.validate_limits(&bad, needed).unwrap_err().field, "linear_m_s2");
}
