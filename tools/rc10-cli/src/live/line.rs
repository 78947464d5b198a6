//! A line to a robot, whatever is at its end.

use anyhow::Result;
use rc10_can::Micros;

/// A line to a robot.
pub trait Source {
    /// Sends some bytes, lets a few milliseconds pass, and returns what came. The time is the robot's
    /// where that is known, else this PC's.
    ///
    /// # Errors
    /// If there is no way on: a port that is gone comes back, and is none.
    fn exchange(&mut self, out: &[u8]) -> Result<(Vec<u8>, Micros)>;

    /// Why nothing comes, if that is known.
    fn trouble(&self) -> Option<&str> {
        None
    }
}

/// A way to a robot, and its name for people.
pub struct Way<'r> {
    /// The line.
    pub source: Box<dyn Source + 'r>,
    /// Its name.
    pub name: String,
    /// It leaves this program: others may speak there, too.
    pub is_real: bool,
}
