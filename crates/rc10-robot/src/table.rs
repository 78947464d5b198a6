//! The motor table: bus, id, gains and safe state of each motor; and the robot's measures.

use rc10_app::{Degrees, Mecanum, Rpm, Twist, TwistLimits};
use rc10_module::remote::Receiver;
use rc10_motor::Safety;
use rc10_motor::dji::{self, FeedbackRate, Model};
use rc10_motor::rc10_app::Cascade;
use rc10_motor::rc10_app::Direction;
use rc10_tasks::ArmingConfig;

/// Names of the motors, in the order of [`MOTORS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Name {
    FrontLeft,
    FrontRight,
    RearLeft,
    RearRight,
    Yaw,
    Pitch,
    Feeder,
    LiftFrontLeft,
    LiftFrontRight,
    LiftRearLeft,
    LiftRearRight,
}

/// One motor of the robot.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Name of the motor.
    pub name: Name,
    /// The same, for people.
    pub label: &'static str,
    /// On which bus: 1, 2 or 3.
    pub bus: u8,
    /// Model of the motor.
    pub model: &'static Model,
    /// The identifier set on it.
    pub id: u8,
    /// Direction in which it counts.
    pub direction: Direction,
    /// The feedback rate set on it.
    pub rate: FeedbackRate,
    /// Gains of its own, in place of its model's.
    pub gains: Option<Cascade>,
    /// Its safe state, for when it may not follow its target.
    pub safety: Safety,
}

const fn entry(name: Name, label: &'static str, bus: u8, model: &'static Model, id: u8) -> Entry {
    Entry {
        name,
        label,
        bus,
        model,
        id,
        direction: Direction::Forward,
        rate: FeedbackRate::Hz1000,
        gains: None,
        safety: Safety::COAST,
    }
}

/// Mounted the other way round.
const fn mirrored(entry: Entry) -> Entry {
    Entry { direction: Direction::Reversed, ..entry }
}

/// A lift that coasts falls.
const fn holding(entry: Entry) -> Entry {
    Entry { safety: Safety::HOLD, ..entry }
}

/// All motors of the robot.
pub const MOTORS: [Entry; 11] = [
    entry(Name::FrontLeft, "wheel front left", 1, &dji::M3508, 1),
    mirrored(entry(Name::FrontRight, "wheel front right", 1, &dji::M3508, 2)),
    entry(Name::RearLeft, "wheel rear left", 1, &dji::M3508, 3),
    mirrored(entry(Name::RearRight, "wheel rear right", 1, &dji::M3508, 4)),
    entry(Name::Yaw, "gimbal yaw", 2, &dji::GM6020_CURRENT, 1),
    entry(Name::Pitch, "gimbal pitch", 2, &dji::GM6020_VOLTAGE, 2),
    entry(Name::Feeder, "feeder", 2, &dji::M2006, 3),
    holding(entry(Name::LiftFrontLeft, "lift front left", 3, &dji::M3508, 1)),
    holding(mirrored(entry(Name::LiftFrontRight, "lift front right", 3, &dji::M3508, 2))),
    holding(entry(Name::LiftRearLeft, "lift rear left", 3, &dji::M3508, 3)),
    holding(mirrored(entry(Name::LiftRearRight, "lift rear right", 3, &dji::M3508, 4))),
];

/// The buses of the board.
pub const BUSES: usize = 3;

/// The wheels, in the order of [`Mecanum`].
pub const WHEELS: [Name; 4] = [Name::FrontLeft, Name::FrontRight, Name::RearLeft, Name::RearRight];

/// The lift's motors.
pub const LIFT: [Name; 4] =
    [Name::LiftFrontLeft, Name::LiftFrontRight, Name::LiftRearLeft, Name::LiftRearRight];

/// The base: wheels of 76 mm radius, 400 mm by 440 mm apart. The wheels stay below the 480 rpm that
/// an M3508 reaches unloaded.
pub const BASE: Mecanum = Mecanum {
    wheel_radius: 0.076,
    half_wheelbase: 0.20,
    half_track: 0.22,
    max_wheel_speed: Rpm::new(400.0),
};

/// The receiver of the remote control that is plugged in.
pub const RECEIVER: Receiver = Receiver::Dr16;

/// The switches that arm, disarm and stop. Other positions of both have a meaning of their own in
/// [`driver`](crate::driver): change it together with this, and the simulated operator's script.
pub const ARMING: ArmingConfig = ArmingConfig::DEFAULT.checked(RECEIVER);

/// LEDs of the strip that shows how the robot is.
pub const LEDS: usize = 8;

/// Brightness, of 255. An LED takes up to 60 mA at full white: the 5 V of a board are soon
/// too weak for that.
pub const LED_BRIGHTNESS: u8 = 60;

/// Speed of the base with the sticks at their ends.
pub const FULL_STICK: Twist = Twist::new(2.0, 2.0, 6.0);

/// Speed of the gimbal with the sticks at their ends, degrees per second: yaw and pitch.
pub const GIMBAL_RATES: [f32; 2] = [240.0, 120.0];

/// Angles of the gimbal when the robot is armed.
pub const GIMBAL_AHEAD: Degrees = Degrees::new(180.0);

/// Speed of the feeder with the stick at its end.
pub const FEEDER: Rpm = Rpm::new(300.0);

/// Speed of the lift's shafts with the stick at its end, degrees per second.
pub const LIFT_RATE: f32 = 800.0;

/// The lift's shafts turn so far from the bottom to the top, degrees.
pub const LIFT_TOP: i32 = 1080;

/// Largest accelerations of the base at which its wheels do not slip: m/s² and rad/s².
pub const BASE_LIMITS: TwistLimits =
    TwistLimits { linear_acceleration: 3.0, angular_acceleration: 12.0 };

impl Name {
    /// The motor's line in [`MOTORS`].
    #[must_use]
    pub const fn entry(self) -> &'static Entry {
        &MOTORS[self as usize]
    }

    /// The number of the motor on its bus: the number of motors of that bus that stand before it in
    /// [`MOTORS`].
    pub(crate) const fn index_on_bus(self) -> u8 {
        INDICES[self as usize]
    }
}

/// [`Name::index_on_bus`] of every motor: counted when this is compiled.
const INDICES: [u8; MOTORS.len()] = {
    let mut indices = [0; MOTORS.len()];
    let mut motor = 0;
    while motor < MOTORS.len() {
        let mut line = 0;
        while line < motor {
            indices[motor] += (MOTORS[line].bus == MOTORS[motor].bus) as u8;
            line += 1;
        }
        motor += 1;
    }
    indices
};

/// Checked when this is compiled: the lines stand in the order of the names, on buses that exist.
const _: () = {
    let mut line = 0;
    while line < MOTORS.len() {
        assert!(MOTORS[line].name as usize == line, "MOTORS must be in the order of Name");
        assert!(MOTORS[line].bus >= 1 && MOTORS[line].bus as usize <= BUSES, "no such bus");
        line += 1;
    }
};
