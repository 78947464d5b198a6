//! The robot: its table, what its tasks share, and its task.

use rc10_message::{Overrun, Statistics, periodic};
use rc10_motor::dji::{self, Dji, M3508};
use rc10_motor::embassy::BusPort;
use rc10_motor::rc10_app::{ConfigError, Direction};
use rc10_motor::rc10_app::Rpm;
use rc10_motor::rc10_can::Micros;
use rc10_motor::{ArmSwitch, AttachError, Link, MotorBus, MotorId, Safety, Target};

/// The wheels: their names, the identifiers set on them, and the directions in which they count.
pub const WHEELS: [(&str, u8, Direction); 2] =
    [("wheel left", 1, Direction::Forward), ("wheel right", 2, Direction::Reversed)];

/// Radius of the wheels, metres.
pub const WHEEL_RADIUS: f64 = 0.076;

/// The script: from when on, the name of the motion, and the speeds of the wheels in rpm.
pub const SCRIPT: [(Micros, &str, [f32; WHEELS.len()]); 4] = [
    (Micros::from_millis(100), "forward", [200.0, 200.0]),
    (Micros::from_millis(1000), "turn left", [-60.0, 60.0]),
    (Micros::from_millis(1500), "forward again", [120.0, 120.0]),
    (Micros::from_millis(5000), "stand", [0.0, 0.0]),
];

/// The whole robot.
pub struct TwoWheels {
    shared: Shared,
    wheels: Vec<Dji>,
}

/// Everything that its tasks share.
pub struct Shared {
    /// Arms and stops both motors.
    pub switch: ArmSwitch,
    /// The bus both are on.
    pub bus: BusPort,
    /// Timing of the task.
    pub timing: Statistics,
}

impl TwoWheels {
    /// The robot of the table, at rest and disarmed.
    pub fn new() -> Result<Self, ConfigError> {
        let wheel = |(_, id, direction)| Ok(Dji::new(dji::Config::new(&M3508, id).with_direction(direction))?);
        let wheels = WHEELS.into_iter().map(wheel).collect::<Result<_, _>>()?;
        let shared =
            Shared { switch: ArmSwitch::new(), bus: BusPort::new(), timing: Statistics::new() };
        Ok(Self { shared, wheels })
    }

    /// Starts the robot: returns what its tasks share, and the bus with both motors.
    pub fn start(&mut self) -> Result<(&Shared, MotorBus<'_>), AttachError> {
        let mut bus = MotorBus::new(&self.shared.switch);
        for wheel in &mut self.wheels {
            bus.attach(wheel, Safety::COAST)?;
        }
        Ok((&self.shared, bus))
    }
}

impl Shared {
    /// Metres that the middle of the robot went, by its wheels, from where their motors count;
    /// `None` before both are heard.
    pub fn distance(&self) -> Option<f64> {
        let mut metres = 0.0;
        for wheel in (0..).take(WHEELS.len()) {
            let status = self.bus.motor(MotorId::new(wheel)).status();
            if status.link == Link::NeverSeen {
                return None;
            }
            let degrees = status.feedback.total_angle.microdegrees() as f64 * 1e-6;
            metres += degrees.to_radians() * WHEEL_RADIUS / WHEELS.len() as f64;
        }
        Some(metres)
    }
}

/// The task: arms the robot, and tells its wheels every 10 ms what the script says.
pub async fn drive(shared: &Shared) -> ! {
    // Refused after an emergency stop, and if the bus does not fit: it stays disarmed then.
    let _ = shared.switch.arm();
    periodic(Micros::from_millis(10), Overrun::Skip, &shared.timing, async |tick| {
        let line = SCRIPT.iter().rev().find(|(from, ..)| *from <= tick.now);
        let Some((_, _, speeds)) = line else { return };
        for (wheel, rpm) in (0..).zip(speeds) {
            let target = Target::Speed(Rpm::new(*rpm));
            if shared.bus.motor(MotorId::new(wheel)).command(target).is_err() {
                // A mistake in this program: rather none drives than one alone. The motor's status
                // counts it by reason.
                shared.switch.emergency_stop();
            }
        }
    })
    .await
}
