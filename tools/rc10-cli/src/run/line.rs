//! Listening to an RS-485 line from outside the chip: the robot's own code decodes both directions.

use rc10_motor::embassy::Rs485Status;
use rc10_motor::unitree::Rs485Bus;
use rc10_motor::unitree::wire::line::COMMAND_LEN;
use rc10_sim::{LineEntry, Nanos};

/// A listener on a line, which sends nothing.
pub(crate) struct LineListener<'r> {
    pub(crate) motors: Rs485Bus<'r>,
    /// The bytes that the chip has sent without a pause.
    command: Vec<u8>,
    began: Nanos,
    ended: Nanos,
}

impl<'r> LineListener<'r> {
    pub(crate) const fn new(motors: Rs485Bus<'r>) -> Self {
        Self { motors, command: Vec::new(), began: Nanos::ZERO, ended: Nanos::ZERO }
    }

    pub(crate) fn listen(&mut self, bytes: &[LineEntry]) {
        for entry in bytes {
            if entry.from_host {
                self.hear_command(entry);
            } else {
                self.motors.on_bytes(&[entry.byte], entry.end.micros());
            }
        }
    }

    fn hear_command(&mut self, entry: &LineEntry) {
        // A pause as long as a byte ends a command.
        if entry.start > self.ended + entry.end.since(entry.start) {
            self.command.clear();
        }
        if self.command.is_empty() {
            self.began = entry.start;
        }
        self.ended = entry.end;
        self.command.push(entry.byte);
        if let Ok(command) = <&[u8; COMMAND_LEN]>::try_from(&*self.command) {
            self.motors.overhear(command, self.began.micros());
            self.command.clear();
        }
    }

    /// The exchanges on the line; the ticks are inside the chip.
    pub(crate) fn status(&self) -> Rs485Status {
        let mut status = Rs485Status::default();
        status.traffic = self.motors.counters();
        status
    }
}
