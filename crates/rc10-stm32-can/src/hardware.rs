use rc10_can::{BusError, CanFrame, ErrorState, IdPattern, Micros};

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
