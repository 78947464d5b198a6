use core::fmt;

/// Error state of a CAN controller (ISO 11898-1, fault confinement).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ErrorState {
    /// Both error counters below 96.
    #[default]
    Active,
    /// An error counter at 96 or more: the bus is disturbed, or frames are not acknowledged.
    Warning,
    /// An error counter above 127: the controller may no longer destroy others' frames.
    Passive,
    /// Transmit error counter above 255: the controller is off the bus.
    BusOff,
}

impl ErrorState {
    /// All states, in the order of their numbers.
    pub const ALL: &'static [Self] = &[Self::Active, Self::Warning, Self::Passive, Self::BusOff];
    /// Names of the states in that order, with commas between.
    pub const NAMES: &'static str = "Active,Warning,Passive,BusOff";
}

/// The last error a controller saw on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BusError {
    /// More than five equal bits in a row.
    #[error("six equal bits in a row")]
    Stuff,
    /// A fixed-form field had the wrong value.
    #[error("a malformed frame")]
    Form,
    /// No acknowledge: no other node is alive on the bus.
    #[error("no acknowledge")]
    Acknowledge,
    /// A bit read back differs from the bit sent.
    #[error("a bit was not read back as sent")]
    Bit,
    /// The checksum of a received frame was wrong.
    #[error("a wrong checksum")]
    Crc,
    /// Frames came faster than they were read.
    #[error("frames were read too slowly")]
    Overrun,
}

/// State of a bus and its controller, and counters of what was lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Health {
    /// Error state.
    pub state: ErrorState,
    /// Transmit error counter, 0 ..= 255.
    pub transmit_errors: u8,
    /// Receive error counter, 0 ..= 127.
    pub receive_errors: u8,
    /// The last bus error seen, if any was.
    pub last_error: Option<BusError>,
    /// Received frames lost by late reading; one that a controller does not count is one.
    pub receive_lost: u32,
    /// Accepted frames that never left: the driver refused them, or they were too old.
    pub transmit_lost: u32,
    /// Received frames dropped without a look: not [accepted](crate::CanPort::accept).
    pub ignored: u32,
    /// Number of times that the controller went bus-off.
    pub bus_offs: u32,
    /// Times in restricted operation, which sends nothing, and from which it was sent back.
    pub restrictions: u32,
    /// Times that a supervisor made the motors safe, because the port was not asked for long.
    pub stalls: u32,
}

impl Health {
    /// Nothing wrong and nothing lost yet.
    pub const NEW: Self = Self {
        state: ErrorState::Active,
        transmit_errors: 0,
        receive_errors: 0,
        last_error: None,
        receive_lost: 0,
        transmit_lost: 0,
        ignored: 0,
        bus_offs: 0,
        restrictions: 0,
        stalls: 0,
    };

    /// Whether the controller seems to be alone on the bus: its frames are not acknowledged.
    #[must_use]
    pub fn is_alone(&self) -> bool {
        self.state != ErrorState::Active && self.last_error == Some(BusError::Acknowledge)
    }
}

/// The words that CAN people use.
impl fmt::Display for ErrorState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Active => "error active",
            Self::Warning => "error warning",
            Self::Passive => "error passive",
            Self::BusOff => "bus-off",
        })
    }
}

/// One line: `error passive, transmit errors 128: no acknowledge, alone on the bus?`
impl fmt::Display for Health {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.state.fmt(f)?;
        let counters = [
            ("transmit errors", self.transmit_errors.into()),
            ("receive errors", self.receive_errors.into()),
            ("received frames lost", self.receive_lost),
            ("unsent frames lost", self.transmit_lost),
            ("frames ignored", self.ignored),
            ("times bus-off", self.bus_offs),
            ("times restricted", self.restrictions),
            ("stalls", self.stalls),
        ];
        for (name, count) in counters.into_iter().filter(|&(_, count)| count > 0) {
            write!(f, ", {name} {count}")?;
        }
        match self.last_error {
            Some(error) if self.state != ErrorState::Active => write!(f, ": {error}")?,
            _ => {}
        }
        if self.is_alone() { f.write_str(", alone on the bus?") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::string::ToString;

    #[test]
    fn health_says_what_is_wrong_and_nothing_else() {
        assert_eq!(Health::NEW.to_string(), "error active");
        let alone = Health {
            state: ErrorState::Passive,
            transmit_errors: 128,
            last_error: Some(BusError::Acknowledge),
            ..Health::NEW
        };
        assert_eq!(
            alone.to_string(),
            "error passive, transmit errors 128: no acknowledge, alone on the bus?"
        );
        // An error of long ago.
        let healed = Health { state: ErrorState::Active, transmit_errors: 0, bus_offs: 2, ..alone };
        assert_eq!(healed.to_string(), "error active, times bus-off 2");
        let restricted = Health { restrictions: 3, ..Health::NEW };
        assert_eq!(restricted.to_string(), "error active, times restricted 3");
        let shorted =
            Health { state: ErrorState::BusOff, last_error: Some(BusError::Bit), ..alone };
        assert!(!shorted.is_alone());
    }
}
