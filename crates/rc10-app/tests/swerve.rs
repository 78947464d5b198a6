//! Swerve bases: how modules turn, what they never do, and what is seen of one that is wrong.

use crate::random::Random;
use rc10_app::base::BaseError;
use rc10_app::swerve::{Module, Steering, Swerve, SwerveState};
use rc10_app::{Point, RobotFrame, Rpm, TotalAngle, Twist};

const LIMIT: Rpm = Rpm::new(450.0);
const PLACES: [Point<RobotFrame>; 4] =
    [Point::new(0.2, 0.2), Point::new(-0.2, 0.2), Point::new(-0.2, -0.2), Point::new(0.2, -0.2)];
const ENDLESS: Swerve<4> = Swerve::sound(PLACES, 0.05, LIMIT, Steering::Endless);

const fn degrees(whole: i32) -> TotalAngle {
    TotalAngle::from_degrees(whole)
}

fn twist(random: &mut Random, size: f32) -> Twist {
    Twist::new(random.within(size), random.within(size), random.within(2.0 * size))
}

fn angle(random: &mut Random, size: f32) -> TotalAngle {
    #[expect(clippy::cast_possible_truncation, reason = "any will do")]
    TotalAngle::from_microdegrees((f64::from(random.within(size)) * 1e6) as i64)
}

fn turn(from: TotalAngle, to: TotalAngle) -> f32 {
    to.minus(from).degrees().get()
}

#[track_caller]
fn near(actual: Twist, expected: Twist, tolerance: f32) {
    let off = actual - expected;
    let worst = off.vx.abs().max(off.vy.abs()).max(off.wz.abs());
    assert!(worst < tolerance, "{actual:?} is not {expected:?}");
}

#[test]
fn an_endless_module_turns_a_quarter_at_most_and_no_wheel_is_too_fast() {
    let (mut random, mut limited) = (Random(1), 0);
    for _ in 0..5000 {
        let mut state = SwerveState::new();
        let measured = PLACES.map(|_| angle(&mut random, 100_000.0));
        let modules = state.update(&ENDLESS, twist(&mut random, 4.0), measured).unwrap();
        assert!(modules.scale > 0.0 && modules.scale <= 1.0);
        limited += u32::from(modules.scale < 1.0);
        for (module, measured) in modules.modules.into_iter().zip(measured) {
            assert!(turn(measured, module.angle).abs() <= 90.001, "{module:?} {measured}");
            assert!(module.speed.abs() <= LIMIT, "{module:?}");
        }
    }
    assert!(limited > 1000 && limited < 4900, "{limited}");
}

#[test]
fn steered_modules_move_the_robot_as_it_was_told() {
    let mut random = Random(2);
    for round in 0..2000 {
        let places = PLACES.map(|_| Point::new(random.within(0.5), random.within(0.5)));
        let steering = if round % 2 == 0 {
            Steering::Endless
        } else {
            Steering::Between(degrees(-100), degrees(95))
        };
        let base = Swerve::new(places, 0.05, LIMIT, steering).unwrap();
        let wanted = twist(&mut random, 4.0);
        let mut state = SwerveState::new();
        let start = PLACES.map(|_| angle(&mut random, 95.0));
        let steered = state.update(&base, wanted, start).unwrap().modules.map(|one| one.angle);
        let modules = state.update(&base, wanted, steered).unwrap();
        // Also limited, it goes the same way.
        let motion = base.forward(modules.modules);
        near(motion.twist, wanted * modules.scale, 2e-3);
        assert!(motion.slip() < 2e-3, "{motion:?}");
        for (module, steered) in modules.modules.into_iter().zip(steered) {
            assert!(turn(steered, module.angle).abs() < 0.01, "{module:?} {steered}");
        }
    }
}

#[test]
fn a_range_is_kept_and_every_direction_is_reached_in_it() {
    let mut random = Random(3);
    for _ in 0..2000 {
        let least = angle(&mut random, 1000.0);
        let range = 180.0 + random.within(170.0).abs();
        let most = least
            .plus(angle(&mut Random(0), 0.0))
            .plus(TotalAngle::try_from_degrees(rc10_app::Degrees::new(range)).unwrap());
        let base = Swerve::new(PLACES, 0.05, LIMIT, Steering::Between(least, most)).unwrap();
        let mut state = SwerveState::new();
        // Also from where it never should be.
        let measured = PLACES.map(|_| least.plus(angle(&mut random, 800.0)));
        let wanted = twist(&mut random, 1.0);
        let steered = state.update(&base, wanted, measured).unwrap().modules.map(|one| one.angle);
        assert!(steered.iter().all(|angle| (least..=most).contains(angle)), "{steered:?}");
        let there = state.update(&base, wanted, steered).unwrap().modules;
        near(base.forward(there).twist, wanted, 2e-3);
    }
}

#[test]
fn while_it_is_steered_a_wheel_rolls_as_far_as_it_helps() {
    let mut state = SwerveState::new();
    let ahead = Twist::new(1.0, 0.0, 0.0);
    let full = 190.986; // 1 m/s of a wheel of 50 mm
    for (measured, share, target) in [
        (0, 1.0, 0),
        (60, 0.5, 0),
        (-60, 0.5, 0),
        (89, 0.017_45, 0),
        (91, -0.017_45, 180),
        (150, -0.866, 180),
        (300, 0.5, 360),
        (-36_000 - 170, -0.984_8, -36_000 - 180),
    ] {
        let modules = state.update(&ENDLESS, ahead, [degrees(measured); 4]).unwrap().modules;
        for module in modules {
            assert!((module.speed.get() - share * full).abs() < 0.02, "{measured}: {module:?}");
            assert!(turn(module.angle, degrees(target)).abs() < 1e-3, "{measured}: {module:?}");
        }
    }
}

#[test]
fn a_robot_that_stands_keeps_its_modules_where_they_were_steered() {
    let mut state = SwerveState::new();
    let measured = [10, 20, 30, 40].map(degrees);
    let stop = |state: &mut SwerveState<4>, measured| {
        let modules = state.update(&ENDLESS, Twist::STOP, measured).unwrap().modules;
        assert!(modules.iter().all(|module| module.speed == Rpm::ZERO));
        modules.map(|module| module.angle)
    };
    assert_eq!(stop(&mut state, measured), measured);
    // It does not follow what is measured, which would creep.
    assert_eq!(stop(&mut state, [11, 21, 31, 41].map(degrees)), measured);
    let moved = state.update(&ENDLESS, Twist::new(0.3, 0.2, 1.0), measured).unwrap().modules;
    let steered = moved.map(|module| module.angle);
    assert_ne!(steered, measured);
    assert_eq!(stop(&mut state, measured), steered);
    // Nor does a stick at rest steer.
    let rest = Twist::new(0.0, 5e-4, -1e-3);
    assert_eq!(state.update(&ENDLESS, rest, measured).unwrap().modules.map(|m| m.angle), steered);
}

#[test]
fn a_module_that_is_wrong_is_seen() {
    let mut random = Random(4);
    let mut state = SwerveState::new();
    for _ in 0..200 {
        let mut wanted = twist(&mut random, 1.0);
        wanted.vx += 1.0_f32.copysign(wanted.vx);
        let start = state.update(&ENDLESS, wanted, [TotalAngle::ZERO; 4]).unwrap().modules;
        let modules =
            state.update(&ENDLESS, wanted, start.map(|module| module.angle)).unwrap().modules;
        for wheel in 0..4 {
            let seen = |change: &dyn Fn(Module) -> Module| {
                let mut modules = modules;
                modules[wheel] = change(modules[wheel]);
                ENDLESS.forward(modules).slip()
            };
            let rim = modules[wheel].speed.get().abs() / 190.986;
            assert!(seen(&|one| one) < 1e-4);
            // Least squares leave at least 1 - 1/4 - 1/4 of an error with the module itself.
            assert!(seen(&|one| Module { speed: -one.speed, ..one }) > 0.99 * rim);
            assert!(seen(&|one| Module { speed: Rpm::ZERO, ..one }) > 0.49 * rim);
            let turned = |one: Module| Module { angle: one.angle.plus(degrees(60)), ..one };
            assert!(seen(&turned) > 0.49 * rim);
        }
    }
}

#[test]
fn bad_input_changes_nothing_and_an_unsound_base_is_refused() {
    let mut state = SwerveState::new();
    state.update(&ENDLESS, Twist::new(1.0, 0.5, 0.0), [degrees(5); 4]).unwrap();
    let before = state;
    for bad in [f32::NAN, f32::INFINITY, f32::MAX] {
        for twist in
            [Twist::new(bad, 0.0, 0.0), Twist::new(0.0, bad, 0.0), Twist::new(0.0, 0.0, bad)]
        {
            assert!(state.update(&ENDLESS, twist, [degrees(5); 4]).is_err());
        }
    }
    assert_eq!(state, before);

    let why = |places, radius, steering| {
        Swerve::<4>::new(places, radius, LIMIT, steering).unwrap_err().to_string()
    };
    let one_place = [Point::new(0.1, 0.2); 4];
    assert_eq!(
        why(one_place, 0.05, Steering::Endless),
        "the wheels cannot turn the base about (0.1, 0.2)"
    );
    let short = Steering::Between(degrees(-80), degrees(80));
    assert_eq!(
        why(PLACES, 0.05, short),
        "`steering range` is 160, but must be half a turn or more, 180 degrees"
    );
    assert!(why(PLACES, -0.05, Steering::Endless).starts_with("`radius` is -0.05"));
    let millimetres = "`radius` is 50, but must be in metres, 1 at most";
    assert_eq!(why(PLACES, 50.0, Steering::Endless), millimetres);
    let broken = [Point::new(f32::NAN, 0.0), PLACES[1], PLACES[2], PLACES[3]];
    assert_eq!(
        why(broken, 0.05, Steering::Endless),
        "wheel 0: `place.x` is NaN, but must be finite"
    );
    let one = Swerve::new([PLACES[0]], 0.05, LIMIT, Steering::Endless);
    assert!(matches!(one, Err(BaseError::CannotTurn { .. })));
}
