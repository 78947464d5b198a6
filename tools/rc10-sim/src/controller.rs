//! The interface between a wire and a CAN controller.

use std::fmt;
use std::ops::Add;

use rc10_can::{BusError, CanFrame};
use rc10_time::Micros;

/// Time in whole nanoseconds since the start of a [`World`](crate::World): 584 years.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Nanos(u64);

impl Nanos {
    /// The start of time, or no time at all.
    pub const ZERO: Self = Self(0);
    /// Later than all else: the time of what does not happen.
    pub(crate) const NEVER: Self = Self(u64::MAX);

    /// A number of nanoseconds.
    pub const fn new(nanos: u64) -> Self {
        Self(nanos)
    }

    /// The number of nanoseconds.
    pub const fn get(self) -> u64 {
        self.0
    }

    /// Time since `earlier`; zero if that is not earlier.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }

    /// The last whole microsecond that is not after it.
    pub const fn micros(self) -> Micros {
        Micros::new(self.0 / 1000)
    }
}

impl From<Micros> for Nanos {
    fn from(micros: Micros) -> Self {
        Self(micros.get().saturating_mul(1000))
    }
}

impl Add for Nanos {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl fmt::Display for Nanos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:09} s", self.0 / 1_000_000_000, self.0 % 1_000_000_000)
    }
}

/// Outcome of a transmission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Another node heard it whole.
    Acknowledged,
    /// No other node heard it.
    Unacknowledged,
    /// It was destroyed on the wire: by noise, by a short, by nodes of another bit rate.
    Destroyed(BusError),
}

/// Activity on a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Recessive, the interframe space of the last frame included: from now on nodes may start.
    Idle,
    /// A frame has started, or the wire is held dominant.
    Busy,
}

/// The largest difference between a sender's bits and its own that a receiver follows, in millionths, by its bit timing in
/// quanta: one of synchronisation, `before` and `after` the sample point, and the synchronisation `jump`.
///
/// ISO 11898-1, oscillator tolerance: ten bits from one edge to the next must not need more than a jump, and 13 bits, up
/// to the end of an error flag, not more than the shorter phase segment. (It says so of each end's oscillator: half.
/// Propagation on the wire is left out.)
pub const fn tolerance_ppm(before: u32, after: u32, jump: u32) -> u32 {
    let bit = 1 + before + after;
    let shorter = if before < after { before } else { after };
    let (by_jump, by_segment) =
        (jump * 1_000_000 / (10 * bit), shorter * 1_000_000 / (13 * bit - after));
    if by_jump < by_segment { by_jump } else { by_segment }
}

/// A CAN controller at its end of a wire, as the wire sees it: the simulator's own behind
/// [`SimPort`](crate::SimPort), or an emulated chip's ([`Bus::attach`](crate::Bus::attach)).
///
/// The wire calls, in the order of time; a controller never calls back.
///
/// Error frames are always those of error-active nodes (6 + 8 bits), and a frame that is not
/// acknowledged ends as if it had been.
pub trait Controller {
    /// Whether the controller takes part: it sends, hears frames whole and acknowledges them. Not
    /// while it is being configured, and not in bus-off. If it leaves within its own frame, that
    /// frame is destroyed.
    fn is_on_bus(&self) -> bool;

    /// Whether it is wired up at all. If not, it is alone on a wire of its own: what it sends is
    /// not acknowledged.
    fn is_connected(&self) -> bool {
        true
    }

    /// Whether what it sends comes back to it, when it is not wired up: not from a transceiver that takes no part. Then
    /// its first dominant bit is a bit error (ISO 11898-1).
    fn hears_itself(&self) -> bool {
        true
    }

    /// The length of its bits in nanoseconds; `None` if it is the wire's. If the ESCs do not follow them, what it
    /// sends is destroyed.
    fn bit_time_ns(&self) -> Option<u32> {
        None
    }

    /// The largest difference of the wire's bits from its own that it follows ([`tolerance_ppm`]), in
    /// millionths: it understands nothing beyond. That of the simulator's own controller if not said, which
    /// has no bits of another length.
    fn tolerance_ppm(&self) -> u32 {
        0
    }

    /// The frame that it sends if the wire is idle now. Asked at every arbitration it could take
    /// part in, which is at the end of every instant at which its wire is idle and something happened
    /// on it, and whenever time begins to pass: often. A frame that is offered need not be offered again.
    fn offer(&mut self, now: Nanos) -> Option<CanFrame>;

    /// The frame that it just offered is on the wire since now.
    fn sending(&mut self, start: Nanos);

    /// The frame that it just offered lost arbitration; it hears the winner now.
    fn lost_arbitration(&mut self, _start: Nanos) {}

    /// The frame that it sent has ended, before the interframe space; after an error, the error
    /// frame is over too. Told also if it has left the bus meanwhile.
    fn sent(&mut self, outcome: Outcome, end: Nanos);

    /// Another node's frame: when its start-of-frame bit began, and when it had ended (before the
    /// interframe space).
    fn received(&mut self, frame: &CanFrame, start: Nanos, end: Nanos);

    /// Another node's frame was destroyed while it listened; the error frame is over.
    fn disturbed(&mut self, _error: BusError, _at: Nanos) {}

    /// The activity of the wire from now on; told when it is attached and at every change, on the
    /// bus or off it. Whenever the wire becomes idle, 11 recessive bits have just passed: a
    /// controller on its way back from bus-off counts one for that, and one more for each 11 bits
    /// until the wire is busy again.
    fn wire_is(&mut self, _activity: Activity, _at: Nanos) {}

    /// The time of its next event without the wire's doing. In the past means now. Asked after other calls, and as time begins to pass.
    fn next_event(&self) -> Option<Nanos> {
        None
    }

    /// Lets that happen.
    fn advance(&mut self, _now: Nanos) {}
}
