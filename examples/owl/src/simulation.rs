//! What is around the robot, for the tools on a PC, and the operator's script.

use std::collections::VecDeque;

use rc10::sim::prelude::*;
use rc10::sim::simulator::{self, Nanos, SerialConfig, SerialDevice};

use crate::{ARM, BASE, Name, Robot};

impl Simulated for Robot {
    const TWINS: &'static [Twin] = &[
        Twin::Serial("wall", |world, base| {
            let device = TfMini { base: base.cloned(), next: Nanos::ZERO };
            Ok(world.add_serial(SerialConfig { baud: 115_200, ..SerialConfig::default() }, device))
        }),
        Twin::Contact("bottom", || ContactPart::new(Name::Lift, Closed::Below(LIFT_BOTTOM + 20.0))),
        Twin::Voltage("pressure", |_, _| 5.0),
    ];

    fn description() -> Description {
        let [upper_mass, upper_centre, upper_length, fore_mass, fore_centre] = [
            ARM.upper_mass_kg,
            ARM.upper_centre_m,
            ARM.upper_length_m,
            ARM.fore_mass_kg,
            ARM.fore_centre_m,
        ]
        .map(f64::from);
        let upper = ArmLink {
            mass: upper_mass,
            centre: upper_centre,
            length: upper_length,
            start: START[0],
        };
        let fore = ArmLink { mass: fore_mass, centre: fore_centre, length: 0.0, start: START[1] };
        Description {
            base: Some(Base::of(BASE.wheels, &BASE.geometry).with_mass(12.0)),
            arms: vec![ArmPart::new([(Name::Shoulder, upper), (Name::Elbow, fore)])],
            remote: Some(RemoteControl::of::<Self>(&SCRIPT, None)),
            mechanisms: vec![
                Shape::lift("lift", Name::Lift, LIFT_TRAVEL),
                Shape::arm("arm", [(Name::Shoulder, 360.0, 0.32), (Name::Elbow, 200.0, 0.26)]),
            ],
            ..Description::of_program::<Self>(plant)
        }
    }
}

/// The joints at power-on, degrees from level and stretched: the shoulder on its stop, the forearm hangs.
pub const START: [f64; 2] = [-5.0, -85.0];
/// The bottom of the lift, degrees since power-on.
pub const LIFT_BOTTOM: f64 = -200.0;
const LIFT_TRAVEL: [f64; 2] = [LIFT_BOTTOM, LIFT_BOTTOM + 1900.0];
/// Where the wall is, metres ahead of where the robot starts.
pub const WALL: f64 = 2.0;

fn plant(name: Name) -> Plant {
    match name {
        Name::Lift => Plant { load: -0.4, travel: Some(LIFT_TRAVEL), ..Plant::inertia(0.01) },
        // Encoders say 0 where the shoulder is level, and 200 where the elbow is stretched.
        Name::Shoulder => Plant {
            rotor: Some(360.0 + START[0]),
            travel: Some([0.0, 125.0]),
            ..Plant::inertia(0.006)
        },
        Name::Elbow => Plant {
            rotor: Some(200.0 + START[1]),
            travel: Some([-15.0, 185.0]),
            ..Plant::inertia(0.001)
        },
        _ => Plant::default(),
    }
}

/// A `TFmini` on the robot, that looks at the wall: 100 frames a second.
struct TfMini {
    base: Option<simulator::Base>,
    next: Nanos,
}

impl SerialDevice for TfMini {
    fn power_on(&mut self, now: Nanos) {
        self.next = now;
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        self.next = now + Nanos::new(10_000_000);
        let x = self.base.as_ref().map_or(0.0, |base| base.pose().x);
        #[expect(clippy::cast_possible_truncation, reason = "at most 1200")]
        let centimetres = ((WALL - x) * 100.0).clamp(0.0, 1200.0) as u16;
        let [low, high] = centimetres.to_le_bytes();
        let frame = [0x59, 0x59, low, high, 0xD7, 0x11, 0x90, 0x09];
        let sum = frame.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        send.extend(frame.into_iter().chain([sum]));
    }
}

/// The operator's controls, from these milliseconds on. The throttle lies at its low end.
const SCRIPT: [ScriptLine; 8] = [
    ScriptLine::new(0, "switches down", Controls { right_switch: Switch::Down, ..ARMED }),
    ScriptLine::new(300, "arm: the lift homes", ARMED),
    ScriptLine::new(1000, "forward", Controls { right: Stick { x: 0.0, y: 1.0 }, ..ARMED }),
    ScriptLine::new(4000, "arm up", Controls { left: Stick { x: 0.8, y: -1.0 }, ..ARMED }),
    ScriptLine::new(
        5000,
        "elbow, gripper",
        Controls { dial: 0.8, left_switch: Switch::Up, ..ARMED },
    ),
    ScriptLine::new(6000, "lift up", Controls { left: Stick { x: 0.0, y: 0.0 }, ..ARMED }),
    ScriptLine::new(8500, "lift down", ARMED),
    ScriptLine::new(9800, "disarm", Controls { right_switch: Switch::Down, ..ARMED }),
];

/// Armed, the throttle at its low end.
const ARMED: Controls = Controls { left: Stick { x: 0.0, y: -1.0 }, ..Controls::REST };
