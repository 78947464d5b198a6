use rc10_app::CountsPerTurn;

use super::*;

const MS: u64 = 1_000;

fn shaft(steps: u32, rotor: u32, output: u32, direction: Direction) -> Shaft {
    Shaft::new(steps, Gear::new(rotor, output).unwrap(), direction)
}

/// Both ways of counting agree, and with the exact fraction.
fn check(shaft: &Shaft) {
    let within = shaft.angle().microdegrees().rem_euclid(TURN.into());
    assert!((within - i64::from(shaft.phase())).abs() <= 1, "{within} {}", shaft.phase());
}

#[test]
fn a_million_turns_behind_any_gear_leave_nothing_behind() {
    for (steps, rotor, output) in
        [(8192, 3591, 187), (8192, 1, 1), (16_384, 10, 1), (65_536, 7, 3), (42, 65_521, 1)]
    {
        for direction in [Direction::Forward, Direction::Reversed] {
            let mut shaft = shaft(steps, rotor, output, direction);
            let step = i32::try_from(steps / 2 - 1).unwrap();
            let laps = i64::from(rotor) * i64::from(steps);
            // A whole number of output turns, in many steps and one remainder.
            let (full, left) = (laps / i64::from(step), laps % i64::from(step));
            let full = full.min(3_000_000);
            let whole = full * i64::from(step) + left;
            for _ in 0..full {
                shaft.move_by(step);
            }
            shaft.jump_by(left);
            check(&shaft);
            let exact = i128::from(whole) * 360_000_000 * i128::from(output)
                / (i128::from(steps) * i128::from(rotor))
                * i128::from(direction.sign());
            assert!((i128::from(shaft.angle().microdegrees()) - exact).abs() <= 1);
            for _ in 0..full {
                shaft.move_by(-step);
            }
            shaft.jump_by(-left);
            assert_eq!((shaft.angle(), shaft.phase(), shaft.rest), (TotalAngle::ZERO, 0, 0));
        }
    }
}

#[test]
fn reversed_is_the_mirror_of_forward() {
    let mut forward = shaft(8192, 3591, 187, Direction::Forward);
    let mut reversed = shaft(8192, 3591, 187, Direction::Reversed);
    for (at, reading) in (1..).zip([5000, 5100, 8100, 300, 8000, 4000, 100]) {
        for shaft in [&mut forward, &mut reversed] {
            shaft.follow(reading, 333.0, Micros::new(at * MS));
            check(shaft);
        }
        assert_eq!(forward.angle(), reversed.angle().reversed());
        let (a, b) = (forward.feedback(), reversed.feedback());
        assert!((a.speed.get() + b.speed.get()).abs() < 1e-6);
    }
}

#[test]
fn the_first_reading_is_an_absolute_angle_and_zero_is_where_it_stands() {
    let mut shaft = shaft(8192, 1, 1, Direction::Forward);
    assert_eq!(shaft.feedback(), Feedback::NEW);
    assert!(!shaft.is_known());
    shaft.follow(2048, 0.0, Micros::from_millis(500));
    assert_eq!((shaft.angle(), shaft.phase()), (TotalAngle::from_degrees(90), TURN / 4));
    assert_eq!(shaft.feedback().turn_gaps, 0);
    assert_eq!(shaft.set_zero(), TotalAngle::from_degrees(90));
    shaft.follow(0, 0.0, Micros::from_millis(501));
    assert_eq!((shaft.angle(), shaft.phase()), (TotalAngle::from_degrees(-90), TURN / 4 * 3));
}

#[test]
fn turns_in_a_silence_are_those_that_the_mean_speed_tells() {
    for sign in [1.0, -1.0] {
        let mut shaft = shaft(8192, 10, 1, Direction::Forward);
        shaft.follow(0, 6000.0 * sign, Micros::ZERO);
        // Slowing down from 6000 rpm to none in 40 ms: two turns, and 100 steps.
        let reading = if sign > 0.0 { 100 } else { 8092 };
        shaft.follow(reading, 0.0, Micros::from_millis(40));
        assert_eq!(shaft.feedback().turn_gaps, 1);
        let exact = i64::from(if sign > 0.0 { 1 } else { -1 }) * (2 * 8192 + 100) * 36_000_000;
        assert!((shaft.angle().microdegrees() - exact / 8192).abs() <= 1);
        check(&shaft);
        // Slow enough to be sure.
        shaft.follow(reading - 50, 10.0, Micros::from_millis(90));
        assert_eq!(shaft.feedback().turn_gaps, 1);
        // Too long, however slow.
        shaft.follow(reading - 50, 0.0, Micros::from_millis(191));
        assert_eq!(shaft.feedback().turn_gaps, 2);
    }
}

#[test]
fn nothing_overflows() {
    for gear in [(1, 1), (65_535, 1), (1, 65_535)] {
        for steps in [0, 1, 6, 360_000_000, u32::MAX] {
            for direction in [Direction::Forward, Direction::Reversed] {
                let mut shaft = shaft(steps, gear.0, gear.1, direction);
                for at in [0, 1, u64::MAX / 2, 7] {
                    for moved in [i32::MIN, i32::MAX, -1, 1] {
                        shaft.move_by(moved);
                        let before = shaft.before();
                        shaft.measure(f32::MAX, Micros::new(at));
                        shaft.bridge(moved.into(), before);
                        shaft.follow(0, f32::MIN, Micros::new(at));
                        shaft.jump_by(i64::from(moved) << 32);
                        assert!((0..TURN).contains(&shaft.phase()));
                        let _ = shaft.feedback();
                    }
                }
            }
        }
    }
}

#[test]
fn movements_are_certain_up_to_half_a_turn_of_the_sensor() {
    let mut half = shaft(8192, 36, 1, Direction::Forward);
    half.follow(0, 0.0, Micros::from_millis(1));
    half.follow(4096, 0.0, Micros::from_millis(2));
    // Ambiguous, and taken as backwards everywhere in the workspace.
    let turned_steps = |shaft: &Shaft| shaft.angle().counts_at(CountsPerTurn::new(8192 * 36, 1));
    assert_eq!(turned_steps(&half), -4096);
    // rpm, milliseconds between two readings, steps, and whether that is an estimate.
    for (rpm, millis, steps, gaps) in [
        // 0.3 turns, 0.55 of them, and one: the shorter way round is certain only for the first.
        (3000.0, 6, 2458_i32, 0),
        (3300.0, 10, 4506, 1),
        (20_000.0, 3, 8192, 1),
        // At full speed with 1 ms feedback.
        (20_000.0, 1, 2731, 0),
    ] {
        for sign in [1_i32, -1] {
            let mut shaft = shaft(8192, 36, 1, Direction::Forward);
            let rpm = rpm * f32::from(i8::try_from(sign).unwrap());
            shaft.follow(0, rpm, Micros::from_millis(1));
            shaft.follow((sign * steps).rem_euclid(8192), rpm, Micros::from_millis(1 + millis));
            let turned = turned_steps(&shaft);
            assert_eq!((turned, shaft.gaps), (i64::from(sign * steps), gaps), "{rpm} {millis}");
        }
    }
}

#[test]
fn nothing_is_left_of_what_was_counted_before_a_start_or_a_zero() {
    let fresh = || {
        let mut shaft = shaft(8192, 3591, 187, Direction::Forward);
        shaft.start(0);
        shaft
    };
    let (mut moved, mut started, mut zeroed) = (fresh(), fresh(), fresh());
    for shaft in [&mut started, &mut zeroed] {
        shaft.move_by(4001);
    }
    started.start(0);
    let _ = zeroed.set_zero();
    for _ in 0..10_000 {
        for shaft in [&mut moved, &mut started, &mut zeroed] {
            shaft.move_by(1);
        }
        assert_eq!((moved.angle(), moved.rest), (started.angle(), started.rest));
        assert_eq!((moved.angle(), moved.rest), (zeroed.angle(), zeroed.rest));
    }
}

#[test]
fn any_number_of_steps_is_counted_alike_at_once_or_by_the_short_way() {
    for (steps, rotor, output) in [(8192, 3591, 187), (8192, 1, 1), (42, 65_521, 1), (6, 1, 7)] {
        for direction in [Direction::Forward, Direction::Reversed] {
            let (mut quick, mut exact) =
                (shaft(steps, rotor, output, direction), shaft(steps, rotor, output, direction));
            for power in 0..31 {
                for moved in [1_i32 << power, -(3 << power.min(29))] {
                    quick.move_by(moved);
                    exact.jump_by(moved.into());
                    assert_eq!((quick.angle(), quick.rest), (exact.angle(), exact.rest), "{moved}");
                }
            }
        }
    }
}

#[test]
fn the_sensors_side_is_told_with_gear_and_direction() {
    for (direction, sign) in [(Direction::Forward, 1.0), (Direction::Reversed, -1.0)] {
        let shaft = shaft(8192, 36, 1, direction);
        assert!((shaft.sign() - sign).abs() < 1e-6);
        assert!((shaft.to_sensor(10.0) - 360.0 * sign).abs() < 1e-3);
    }
}
