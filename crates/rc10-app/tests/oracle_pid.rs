//! PID against scipy: `golden/pid.py` says how, `cargo xtask golden` makes the file.

use rc10_app::{PidConfig, PidState, Seconds};

struct Row {
    case: &'static str,
    config: PidConfig,
    dt: f32,
    setpoint: f32,
    measured: f32,
    output: f32,
}

fn rows() -> impl Iterator<Item = Row> {
    include_str!("golden/pid.csv").lines().skip(1).map(|line| {
        let (case, numbers) = line.split_once(',').unwrap();
        let numbers: Vec<f32> = numbers.split(',').map(|number| number.parse().unwrap()).collect();
        let [kp, ki, kd, derivative_filter, setpoint_weight, dt, setpoint, measured, output] =
            numbers[..]
        else {
            panic!("{line}")
        };
        let config = PidConfig {
            derivative_filter: Seconds::new(derivative_filter),
            setpoint_weight,
            ..PidConfig::within(1e9).kp(kp).ki(ki).kd(kd)
        };
        Row { case, config, dt, setpoint, measured, output }
    })
}

#[test]
fn every_part_is_the_linear_filter_that_it_says() {
    let (mut case, mut state, mut compared) = ("", PidState::new(), 0);
    for row in rows().filter(|row| row.case.starts_with("open")) {
        if row.case != case {
            (case, state) = (row.case, PidState::new());
        }
        let output =
            state.update(&row.config, row.setpoint, row.measured, 0.0, Seconds::new(row.dt));
        let off = (output - row.output).abs();
        assert!(off <= 2e-5 * row.output.abs().max(10.0), "{case}: {output}, scipy {}", row.output);
        compared += 1;
    }
    assert_eq!(compared, 20 * 60);
}

#[test]
fn a_closed_loop_responds_as_its_transfer_function() {
    let (mut case, mut state, mut y, mut step, mut compared) = ("", PidState::new(), 0.0, 0.0, 0);
    let (a, gain) = ((-0.01_f64).exp(), 2.0);
    #[expect(clippy::cast_possible_truncation, reason = "the plant in f32, too")]
    let (a, b) = (a as f32, (gain * (1.0 - a)) as f32);
    for row in rows().filter(|row| row.case.starts_with("closed")) {
        if row.case != case {
            (case, state, y, step) = (row.case, PidState::new(), 0.0, 0.0);
            // scipy's derivative knows that nothing was measured before: so does this one now.
            state.update(&row.config, 0.0, 0.0, 0.0, Seconds::new(row.dt));
        }
        while step < row.output {
            y = a * y + b * state.update(&row.config, row.setpoint, y, 0.0, Seconds::new(row.dt));
            step += 1.0;
        }
        assert!((y - row.measured).abs() < 2e-4, "{case} step {step}: {y}, scipy {}", row.measured);
        compared += 1;
    }
    assert_eq!(compared, 10 * 100);
}
