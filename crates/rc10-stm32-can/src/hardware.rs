use rc10_can::{BusError, CanFrame, ErrorState, IdPattern};
use rc10_time::Micros;

/// Transmit mailboxes of a controller: bxCAN (RM0090) and the small FDCAN (RM0440) have three.
pub const MAILBOXES: usize = 3;

/// The fate of a frame in a mailbox.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The frame was sent and acknowledged.
    Sent,
    /// The frame was not sent, and will not be.
    Aborted,
}

/// The error state of a controller at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Errors {
    /// Error state.
    pub state: ErrorState,
    /// Transmit error counter, 0 ..= 255.
    pub transmit: u8,
    /// Receive error counter, 0 ..= 127.
    pub receive: u8,
    /// The bus error that it saw last, if it did since it was asked before.
    pub last: Option<BusError>,
}

impl Errors {
    /// By the flags for bus-off, passive and warning, the code in the field LEC, and the counters: both
    /// controllers have the same.
    #[must_use]
    pub const fn new(flags: [bool; 3], code: u8, transmit: u8, receive: u8) -> Self {
        let state = match flags {
            [true, _, _] => ErrorState::BusOff,
            [_, true, _] => ErrorState::Passive,
            [_, _, true] => ErrorState::Warning,
            _ => ErrorState::Active,
        };
        let last = match code {
            1 => Some(BusError::Stuff),
            2 => Some(BusError::Form),
            3 => Some(BusError::Acknowledge),
            4 | 5 => Some(BusError::Bit),
            6 => Some(BusError::Crc),
            _ => None,
        };
        Self { state, transmit, receive, last }
    }
}

/// A CAN controller with three transmit mailboxes, numbered from 0. No method waits for the bus.
///
/// It sends the most urgent mailbox first, until acknowledged, and stays off after bus-off.
pub trait Hardware {
    /// The time.
    fn now(&self) -> Micros;

    /// Takes back the requests of interrupts, before what they told of is looked at.
    fn acknowledge(&mut self) {}

    /// Writes a frame into a mailbox that is free, and requests that it is sent.
    fn load(&mut self, mailbox: usize, frame: &CanFrame);

    /// Requests that a frame is not sent; on the wire it goes on. [`ended`](Self::ended) tells how.
    fn abort(&mut self, mailbox: usize);

    /// The fate of a mailbox's frame, told once; `None` while it waits or is on the wire.
    fn ended(&mut self, mailbox: usize) -> Option<Ended>;

    /// The oldest frame that was received.
    fn receive(&mut self) -> Option<CanFrame>;

    /// Whether received frames were lost since the last call, because there was no room for them.
    fn overrun(&mut self) -> bool;

    /// Whether it is off the bus, and was not [restarted](Self::restart) since.
    fn is_off(&mut self) -> bool;

    /// Error state and counters.
    fn errors(&mut self) -> Errors;

    /// Begins the way back, 128 times 11 recessive bits; whether it was begun, else call again.
    /// Frames not taken yet may be lost.
    fn restart(&mut self) -> bool;

    /// Whether FDCAN was in restricted operation, which sends nothing; it is sent back.
    fn leave_restricted(&mut self) -> bool {
        false
    }

    /// Lets only these frames in, or more; without a call all. A frame wanted throughout is kept.
    fn accept(&mut self, patterns: &[IdPattern]);
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    /// RM0090, `CAN_ESR`; RM0440, `FDCAN_PSR`.
    #[test]
    fn the_gravest_flag_is_the_state_and_the_code_the_last_error() {
        let state = |flags| Errors::new(flags, 0, 0, 0).state;
        assert_eq!(state([false; 3]), ErrorState::Active);
        assert_eq!(state([false, false, true]), ErrorState::Warning);
        assert_eq!(state([false, true, true]), ErrorState::Passive);
        assert_eq!(state([true; 3]), ErrorState::BusOff);
        let last: Vec<_> = (0..8).map(|code| Errors::new([false; 3], code, 0, 0).last).collect();
        let [stuff, form, acknowledge, bit, crc] =
            [BusError::Stuff, BusError::Form, BusError::Acknowledge, BusError::Bit, BusError::Crc]
                .map(Some);
        assert_eq!(last, [None, stuff, form, acknowledge, bit, bit, crc, None]);
        let Errors { transmit, receive, .. } = Errors::new([false; 3], 0, 200, 100);
        assert_eq!((transmit, receive), (200, 100));
    }
}
