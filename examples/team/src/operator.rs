//! The script of the team's remote: ten seconds that show everything. Controls:
//! `crate::driver`.

use crate::table::{BASE, FEEDER, GIMBAL_RATES, LIFT_RATE};
use rc10::sim::prelude::*;

/// Period of the script.
pub const SCRIPT_LENGTH: Micros = Micros::from_millis(10_000);

/// Times in ms since power-on, and the controls from then on. A stick that turns a motor for some
/// time turns it by about the angle that stands there; for the gimbal yaw and pitch in brackets.
pub const SCRIPT: [ScriptLine; 22] = [
    at(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    at(100, "arm", ARMED),
    at(200, "square: forward", drive(1.2, 0.0, 0.0)),
    at(1100, "square: left", drive(0.0, 1.2, 0.0)),
    at(2000, "square: back", drive(-1.2, 0.0, 0.0)),
    at(2900, "square: right", drive(0.0, -1.2, 0.0)),
    at(3800, "spin", drive(0.0, 0.0, 4.0)),
    at(4800, "stand", ARMED),
    // (-90, -30)
    at(4800, "gimbal right", mechanisms(-180.0, -60.0, 0.0, 0.0)),
    at(5300, "feeder on", mechanisms(0.0, 0.0, 180.0, 0.0)),
    // (180, 60)
    at(5600, "gimbal left", mechanisms(225.0, 75.0, 180.0, 0.0)),
    // (-90, -30)
    at(6400, "gimbal ahead", mechanisms(-225.0, -75.0, 180.0, 0.0)),
    at(6800, "feeder off", mechanisms(0.0, 0.0, 0.0, 0.0)),
    // 720 degrees.
    at(6900, "lift up", mechanisms(0.0, 0.0, 0.0, 800.0)),
    at(7800, "lift stays", mechanisms(0.0, 0.0, 0.0, 0.0)),
    at(8100, "drive off", drive(1.5, 0.0, 1.0)),
    at(8600, "emergency stop", Controls { left_switch: Switch::Down, ..ARMED }),
    at(9000, "reset", Controls { right_switch: Switch::Down, ..ARMED }),
    at(9100, "arm again", ARMED),
    // 360 degrees.
    at(9200, "lift down", mechanisms(0.0, 0.0, 0.0, -800.0)),
    at(9650, "drive on", drive(0.6, 0.0, 0.0)),
    at(9850, "stand", ARMED),
];

/// Controls of an armed robot in driving mode with sticks at rest.
const ARMED: Controls = Controls::REST;

const fn at(millis: u64, label: &'static str, controls: Controls) -> ScriptLine {
    ScriptLine { at: Micros::from_millis(millis), label, controls }
}

/// Moves the base: m/s forward, m/s left, rad/s counter-clockwise.
const fn drive(forward: f64, left: f64, turn: f64) -> Controls {
    let stick =
        Stick { x: -left / BASE.full_stick.vy as f64, y: forward / BASE.full_stick.vx as f64 };
    let right = Stick { x: -turn / BASE.full_stick.wz as f64, y: 0.0 };
    Controls { left: stick, right, ..ARMED }
}

/// Turns gimbal (yaw and pitch, degrees/s), feeder (rpm) and lift (degrees/s).
const fn mechanisms(yaw: f64, pitch: f64, feeder: f64, lift: f64) -> Controls {
    let [full_yaw, full_pitch] = GIMBAL_RATES;
    Controls {
        right: Stick { x: -yaw / full_yaw as f64, y: pitch / full_pitch as f64 },
        left: Stick { x: lift / LIFT_RATE as f64, y: feeder / FEEDER.get() as f64 },
        left_switch: Switch::Up,
        ..ARMED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_stick_is_asked_for_more_than_it_can() {
        for ScriptLine { label, controls: Controls { left, right, .. }, .. } in SCRIPT {
            let within =
                [left.x, left.y, right.x, right.y].map(|axis| (-1.0..=1.0).contains(&axis));
            assert_eq!(within, [true; 4], "{label}");
        }
        assert!(SCRIPT.is_sorted_by_key(|line| line.at));
        assert!(SCRIPT.last().is_some_and(|line| line.at < SCRIPT_LENGTH));
    }
}
