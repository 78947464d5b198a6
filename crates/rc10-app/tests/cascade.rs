//! The loops of a cascade with every gain that the stock ones leave at zero.

use rc10_app::cascade::{Seek, Step};
use rc10_app::{Cascade, CascadeState, FeedForward, Gravity, PidConfig, RpmPerSecond, Seconds};

const MS: Seconds = Seconds::new(0.001);
const FULL: f32 = 20.0;
const NO_GAINS: PidConfig = PidConfig::within(400.0);

/// A cascade whose speed reference follows at once.
fn cascade(speed: PidConfig, angle: PidConfig) -> Cascade {
    let acceleration = RpmPerSecond::new(1e6);
    Cascade {
        speed,
        angle,
        outer_divider: 10,
        acceleration,
        feed_forward: rc10_app::FeedForward::NONE,
    }
}

fn near(measured: f32, expected: f32) {
    assert!((measured - expected).abs() <= 1e-3 * expected.abs().max(1.0), "{measured} {expected}");
}

const fn step(measured: f32, count: u32) -> Step {
    Step { measured, load: 0.0, full: FULL, dt: MS, count }
}

/// One tick towards a speed.
fn run(state: &mut CascadeState, config: &Cascade, target: f32, rpm: f32) {
    state.seek(config, &Seek::Speed(target), &step(rpm, 0));
}

/// One tick towards an angle.
fn seek(state: &mut CascadeState, config: &Cascade, way: f32, rpm: f32, count: u32) {
    state.seek(config, &Seek::Angle(way), &step(rpm, count));
}

#[test]
fn the_speed_loops_derivative_acts_on_the_measured_speed_alone() {
    let damped = cascade(PidConfig::within(FULL).kd(0.02), NO_GAINS);
    // A reference that follows at once, and one on the way.
    for acceleration in [1e6, 1000.0] {
        let config = Cascade { acceleration: RpmPerSecond::new(acceleration), ..damped };
        let mut state = CascadeState::new();
        let mut seek = |target, rpm| {
            run(&mut state, &config, target, rpm);
            state.effort()
        };
        // Neither the first step nor a new setpoint is a change of the measurement.
        (0..40).for_each(|_| near(seek(0.0, 100.0), 0.0));
        (0..40).for_each(|_| near(seek(300.0, 100.0), 0.0));
        near(seek(300.0, 100.1), -0.02 * 0.1 / 0.001);
        near(seek(300.0, 100.1), 0.0);
    }
}

#[test]
fn a_speed_loop_with_a_derivative_takes_over_from_an_effort_without_a_kick() {
    let config = cascade(PidConfig::within(FULL).kd(0.02), NO_GAINS);
    let mut state = CascadeState::new();
    (0..40).for_each(|_| state.give(5.0, FULL, MS));
    run(&mut state, &config, 100.0, 100.0);
    near(state.effort(), 5.0);
}

#[test]
fn new_gains_neither_reach_back_nor_leave_an_integral_behind() {
    let carried = cascade(PidConfig::within(FULL).ki(10.0), NO_GAINS);
    let mut state = CascadeState::new();
    (0..100).for_each(|_| run(&mut state, &carried, 10.0, 0.0));
    assert!(state.effort() > 9.0);
    let damped = cascade(PidConfig::within(FULL).kd(0.02), NO_GAINS);
    state.change_gains(&damped, 200.0);
    // Softly: by at most a tenth of full scale in a tick.
    for _ in 0..20 {
        let before = state.effort();
        run(&mut state, &damped, 10.0, 200.0);
        assert!((state.effort() - before).abs() <= 0.1 * FULL + 1e-4);
    }
    near(state.effort(), 0.0);

    // The same for the angle loop: no speed is asked for by an integral that is off.
    let carried = cascade(NO_GAINS, PidConfig::within(400.0).ki(10.0));
    let mut state = CascadeState::new();
    (0..200).for_each(|count| seek(&mut state, &carried, 10.0, 0.0, count));
    assert!(state.reference() > 15.0);
    let off = cascade(NO_GAINS, NO_GAINS);
    state.change_gains(&off, 0.0);
    (0..20).for_each(|count| seek(&mut state, &off, 10.0, 0.0, count));
    near(state.reference(), 0.0);
    // One that is still on stays.
    let mut state = CascadeState::new();
    (0..200).for_each(|count| seek(&mut state, &carried, 10.0, 0.0, count));
    let before = state.reference();
    state.change_gains(&carried, 0.0);
    (0..20).for_each(|count| seek(&mut state, &carried, 0.0, 0.0, count));
    assert!(state.reference() >= before);
}

#[test]
fn the_angle_loop_integrates_over_all_the_ticks_between_its_steps() {
    for outer_divider in [1, 10, 50] {
        let angle = PidConfig::within(400.0).ki(2.0);
        let config = Cascade { outer_divider, ..cascade(NO_GAINS, angle) };
        let mut state = CascadeState::new();
        (0..2000).for_each(|count| seek(&mut state, &config, 10.0, 0.0, count));
        // 10 degrees for 2 s, twice a second; give or take the last step.
        let error = (state.reference() - 40.0).abs();
        assert!(error <= 0.02 * f32::from(outer_divider) + 0.1, "{outer_divider}: {error}");
    }
}

#[test]
fn the_angle_loops_derivative_is_the_measured_speed_alone() {
    let config = cascade(NO_GAINS, PidConfig::within(400.0).kd(0.1));
    let mut state = CascadeState::new();
    // 10 rpm are 60 degrees a second, whatever way is left, and however the angle sought moves.
    for (count, way) in (0..300).zip([5.0, 5.0, 90.0, -90.0].into_iter().cycle()) {
        seek(&mut state, &config, way, 10.0, count);
        near(state.reference(), -6.0);
    }
}

#[test]
fn cascades_with_different_counts_run_their_angle_loops_in_different_ticks() {
    // The speed that it asks for tells when it ran: the way is another one in each tick.
    let config = cascade(NO_GAINS, PidConfig::within(400.0).kp(1.0));
    for offset in 0..10_u32 {
        let (mut state, mut way) = (CascadeState::new(), 1.0_f32);
        let mut ran = |tick: u32| {
            let before = state.reference();
            way += 0.01;
            seek(&mut state, &config, way, 0.0, tick + offset);
            (state.reference() - before).abs() > 1e-6
        };
        // Its soft start, in which the angle loop runs in every tick.
        assert!((0..20).all(&mut ran));
        // From the first whole period on, where the count is a multiple of the divider.
        let ran: Vec<u32> = (21..200).filter(|&tick| ran(tick) && tick >= 32).collect();
        assert!(ran.iter().all(|tick| (tick + offset) % 10 == 0), "{offset}: {ran:?}");
        assert!(ran.len() >= 16, "{offset}: {ran:?}");
        // Another goal between ends the wait for the next one at once.
        for count in 0..3_u8 {
            run(&mut state, &config, 10.0, 0.0);
            seek(&mut state, &config, f32::from(count) + 7.0, 0.0, 11);
            near(state.reference(), f32::from(count) + 7.0);
        }
    }
}

#[test]
fn a_stop_keeps_what_carries_a_load_only_if_it_is_asked_to() {
    let config = cascade(PidConfig::within(FULL).kp(0.1).ki(10.0), NO_GAINS);
    for keep_load in [false, true] {
        let mut state = CascadeState::new();
        // An obstacle: the integral pushes with all it has.
        (0..500).for_each(|_| run(&mut state, &config, 50.0, 0.0));
        near(state.effort(), FULL);
        state.start_over(keep_load);
        (0..40).for_each(|_| run(&mut state, &config, 0.0, 0.0));
        let left = state.effort();
        assert!(if keep_load { left > 5.0 } else { left.abs() < 0.1 }, "{keep_load}: {left}");
    }
}

#[test]
fn a_limit_that_is_lowered_during_a_soft_start_holds_at_once() {
    let mut state = CascadeState::new();
    (0..5).for_each(|_| state.give(FULL, FULL, MS));
    near(state.effort(), 10.0);
    state.give(FULL, 1.0, MS);
    near(state.effort(), 1.0);

    let config = cascade(PidConfig::within(1.0).kp(0.1), NO_GAINS);
    let mut state = CascadeState::new();
    (0..5).for_each(|_| state.give(FULL, FULL, MS));
    near(state.effort(), 10.0);
    state.seek(&config, &Seek::Speed(400.0), &Step { full: 1.0, ..step(0.0, 0) });
    near(state.effort(), 1.0);
}

/// A device sends each millisecond, and so does a tick look: at times it sees one twice, and then one is
/// left out. At 60 rpm that is 0.36 degrees, and more than the acceleration limit makes up for in a tick.
#[test]
fn a_measurement_that_comes_a_tick_late_is_no_acceleration() {
    let feed_forward =
        FeedForward { friction: 0.054, per_rpm: 0.0, per_rpm_s: 0.0029, gravity: Gravity::None };
    let config = Cascade {
        speed: PidConfig::within(3.0).kp(0.12),
        angle: PidConfig::within(250.0).kp(1.5),
        outer_divider: 1,
        acceleration: RpmPerSecond::new(500.0),
        feed_forward,
    };
    for (sign, motion) in [(1.0, true), (-1.0, true), (1.0, false), (-1.0, false)] {
        let mut state = CascadeState::new();
        let mut efforts = |ways: &mut dyn Iterator<Item = f32>| {
            let effort = |way: f32| {
                let (rpm, way) = (60.0 * sign, way * sign);
                let seek = if motion {
                    Seek::Motion { way: Some(way), speed: rpm, acceleration: 0.0, inertia: 0.0 }
                } else {
                    // The way at which it asks for 60 rpm.
                    Seek::Angle(40.0 * sign + way)
                };
                let step = Step { measured: rpm, load: 0.0, full: 3.0, dt: MS, count: 0 };
                state.seek(&config, &seek, &step);
                state.effort() * sign
            };
            ways.map(effort).collect::<Vec<_>>()
        };
        // It comes up to speed.
        let _ = efforts(&mut [0.0; 200].into_iter());
        let steady =
            efforts(&mut (0..200_u16).map(|tick| f32::from(u8::from(tick % 5 == 0)) * 0.36));
        assert!(steady.iter().all(|effort| (0.0..0.2).contains(effort)), "{motion}: {steady:?}");
        // What it is really behind takes what it says, from the second tick on.
        let far = efforts(&mut [10.0; 5].into_iter());
        assert!(far[1..].iter().all(|effort| *effort > 1.45), "{motion}: {far:?}");
    }
}
