//! The access of a run to a robot's motors, buses and lines.

use std::rc::Rc;

use rc10_module::Reception;
use rc10_motor::ArmSwitch;
use rc10_motor::embassy::{BusPort, MotorPort, Rs485Port};
use rc10_tasks::live::Parameter;
use rc10_tasks::seen::Whole;
use rc10_time::Micros;

use crate::robot::description::Description;
use crate::robot::motor::Place;
use crate::robot::signal::Signal;

/// Ports of a running robot's buses and lines; the first of each is number 1.
#[derive(Clone, Default)]
pub struct Ports<'r> {
    /// The buses.
    pub buses: Vec<&'r BusPort>,
    /// The lines.
    pub lines: Vec<&'r Rs485Port>,
    /// The arm switch.
    pub switch: Option<&'r ArmSwitch>,
    /// The robot's own state as a whole, now.
    pub whole: Option<Rc<dyn Fn() -> Whole + 'r>>,
    /// Counters of the remote's receiver.
    pub reception: Option<&'r Reception>,
    /// Counters of the parts on UARTs, in the order of [`Description::serials`].
    pub parts: Vec<&'r Reception>,
    /// Own signals.
    pub signals: Vec<Signal<'r>>,
    /// Own parameters.
    pub parameters: Vec<&'r Parameter>,
    /// Label of the yaw signal, and the yaw by the IMU: degrees counter-clockwise, all turns
    /// counted.
    pub yaw: Option<(&'static str, Yaw<'r>)>,
}

/// A function that gives a robot's yaw at a time, if it is known.
pub type Yaw<'r> = Rc<dyn Fn(Micros) -> Option<f64> + 'r>;

impl<'r> Ports<'r> {
    /// The port of the motor with this index into [`Description::motors`], if plugged in here.
    pub fn motor(&self, description: &Description, entry: usize) -> Option<MotorPort<'r>> {
        let motor = description.number(entry)?;
        let index = |number: u8| usize::from(number).checked_sub(1);
        match description.motors.get(entry)?.on {
            Place::Bus(number) => Some(self.buses.get(index(number)?)?.motor(motor)),
            Place::Line(number) => Some(self.lines.get(index(number)?)?.motor(motor)),
        }
    }
}
