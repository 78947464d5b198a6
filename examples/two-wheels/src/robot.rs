//! The robot: its table, what its tasks share, and its task.

use rc10::app::{Base, Direction, Rpm, Twist};
use rc10::message::{Every, Statistics};
use rc10::motor::Place::Bus;
use rc10::motor::dji::{Config, Dji, M3508};
use rc10::motor::embassy::Ports;
use rc10::motor::{ArmSwitch, Entry, Link, Names, Target, motors};
use rc10::time::Micros;

motors! {
    /// Names of the wheels.
    pub enum Name;
    /// Where their motors stand.
    pub struct Motors;
    Left: Dji = Entry::new(Bus(1), Config::new(&M3508, 1)).with_label("wheel left"),
    Right: Dji = Entry::new(Bus(1),
        Config::new(&M3508, 2).with_direction(Direction::Reversed),
    ).with_label("wheel right"),
}

/// Radius of the wheels, metres.
pub const WHEEL_RADIUS: f32 = 0.076;

/// The base: its wheels are 400 mm apart, and stay below the 480 rpm that an M3508 reaches unloaded.
pub const BASE: Base<2> = Base::differential(WHEEL_RADIUS, 0.2, Rpm::new(450.0));

/// The script: from when on, the name of the motion, and the motion: m/s ahead, and rad/s to the left.
pub const SCRIPT: [(Micros, &str, Twist); 4] = [
    (Micros::from_millis(100), "forward", Twist::new(1.6, 0.0, 0.0)),
    (Micros::from_millis(1000), "turn left", Twist::new(0.0, 0.0, 2.4)),
    (Micros::from_millis(1500), "forward again", Twist::new(0.9, 0.0, 0.0)),
    (Micros::from_millis(5000), "stand", Twist::STOP),
];

/// Everything that its tasks share.
pub struct Shared {
    /// Arms and stops both motors.
    pub switch: ArmSwitch,
    /// The bus both are on, and each motor by name.
    pub ports: Ports<Name, 1>,
    /// Timing of the task.
    pub timing: Statistics,
}

impl Shared {
    /// Creates the state of a robot at rest and disarmed.
    pub const fn new() -> Self {
        Self { switch: ArmSwitch::new(), ports: Ports::new(), timing: Statistics::new() }
    }

    /// Metres that the middle of the robot went, by its wheels, from where their motors count;
    /// `None` before both are heard.
    pub fn distance(&self) -> Option<f64> {
        let mut metres = 0.0;
        for wheel in Name::ALL {
            let status = self.ports.motor(*wheel).status();
            if status.link == Link::NeverSeen {
                return None;
            }
            let degrees = status.feedback.total_angle.microdegrees() as f64 * 1e-6;
            metres += degrees.to_radians() * f64::from(WHEEL_RADIUS) / Name::ALL.len() as f64;
        }
        Some(metres)
    }
}

/// The task: arms the robot, and tells its wheels every 10 ms what the script says.
pub async fn drive(shared: &Shared) -> ! {
    // Refused after an emergency stop, and if the bus does not fit: it stays disarmed then.
    let _ = shared.switch.arm();
    let mut every = Every::millis(10).with_statistics(&shared.timing);
    loop {
        let now = every.next().await.now;
        let line = SCRIPT.iter().rev().find(|(from, ..)| *from <= now);
        // A twist that is not finite has no wheel speeds.
        let Some(Ok(wheels)) = line.map(|(_, _, twist)| BASE.inverse(*twist)) else { continue };
        for (wheel, speed) in [Name::Left, Name::Right].into_iter().zip(wheels.speeds) {
            if shared.ports.motor(wheel).command(Target::Speed(speed)).is_err() {
                // A mistake in this program: rather none drives than one alone. The motor's status
                // counts it by reason.
                shared.switch.emergency_stop();
            }
        }
    }
}
