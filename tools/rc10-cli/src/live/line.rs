//! A line to a robot: a port, a connection, a simulation or an emulation.

use anyhow::Result;
use rc10_time::Micros;

use crate::run::running::Running;

/// A line to a robot.
pub trait Source {
    /// Sends bytes, waits a few milliseconds, and returns the received bytes, and the robot's time
    /// where that is known, else this PC's. Fails if the line has ended; a missing port may come
    /// back.
    fn exchange(&mut self, out: &[u8]) -> Result<(Vec<u8>, Micros)>;

    /// Why no bytes arrive, if that is known.
    fn trouble(&self) -> Option<&str> {
        None
    }

    /// The world of a robot that is simulated here, whose remote can be held; a real robot has none.
    fn world(&mut self) -> Option<&mut dyn Running> {
        None
    }
}

/// A connection to a robot, and its name for people.
pub struct RobotConnection<'r> {
    /// The line.
    pub source: Box<dyn Source + 'r>,
    /// Name of the connection.
    pub name: String,
    /// Its bit rate.
    pub baud: u32,
    /// Whether it leaves this program, so that others may speak there, too.
    pub is_real: bool,
}
