//! One CAN wire: who may send, how long it takes, who hears it.

use std::collections::VecDeque;

use rc10_can::embedded_can::Id;
use rc10_can::{BusError, CanFrame, ErrorState, Health, Mailboxes, Micros, Submitted};

/// How a bus is set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusConfig {
    /// Length of one bit in nanoseconds; 1000 (1 Mbit/s, the fastest classic CAN goes) or more.
    pub bit_time_ns: u32,
    /// Frames the controller's receive queue holds; what comes while it is full is lost and
    /// counted in [`Health::receive_lost`].
    pub receive_capacity: usize,
    /// Whether every frame is kept for [`Bus::take_trace`](crate::Bus::take_trace).
    pub trace: bool,
}

impl Default for BusConfig {
    /// 1 Mbit/s, 64 frames, traced.
    fn default() -> Self {
        Self { bit_time_ns: FASTEST_BIT_NS, receive_capacity: 64, trace: true }
    }
}

/// ISO 11898-2: classic CAN goes up to 1 Mbit/s.
const FASTEST_BIT_NS: u32 = 1000;

/// One frame that went over a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraceEntry {
    /// When it ended, interframe space included: when its receivers have it.
    pub at: Micros,
    /// The frame.
    pub frame: CanFrame,
    /// Whether the controller sent it (else an ESC or the foreign node).
    pub from_controller: bool,
}

/// What happened on a wire so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusCounters {
    /// Frames sent and acknowledged.
    pub frames: u64,
    /// Attempts that nobody acknowledged; each is repeated.
    pub unacknowledged: u64,
    /// Arbitrations in which two nodes sent the same identifier at once. On a real bus they would
    /// destroy each other's frames; here the node that was added first wins.
    pub id_clashes: u64,
}

/// Transmit buffers of the controller (STM32H7 FDCAN: 32 dedicated ones).
const MAILBOXES: usize = 32;
/// Fault confinement, ISO 11898-1: a failed transmission counts 8, and an error-passive sender
/// that only misses its acknowledge counts no further.
const FAILED_TRANSMISSION: u8 = 8;
const ERROR_WARNING: u8 = 96;
const ERROR_PASSIVE: u8 = 128;
/// Length of the windows of [`Bus::load_windows`](crate::Bus::load_windows).
const WINDOW_NS: u64 = 100_000_000;

/// The host's side of the bus.
pub(crate) struct Controller {
    mailboxes: Mailboxes<MAILBOXES>,
    /// A frame whose last attempt failed. It keeps its transmit buffer, as in the real controller:
    /// no room has to be found for it.
    retry: Option<CanFrame>,
    /// Identifier and size of the frame on the wire, while one is.
    sending: Option<u32>,
    /// The frame on the wire is not to be repeated: it was cancelled, or a newer one waits.
    stale: bool,
    received: VecDeque<(CanFrame, Micros)>,
    capacity: usize,
    health: Health,
}

impl Controller {
    pub(crate) fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        self.received.pop_front()
    }

    pub(crate) fn submit(&mut self, frame: &CanFrame) -> Submitted {
        let replaces_retry = self.retry.is_some_and(|retry| retry.key() == frame.key());
        let submitted = self.mailboxes.put(frame);
        if submitted == Submitted::Refused {
            if !replaces_retry {
                return Submitted::Refused;
            }
            // The failed frame's own buffer takes the newer one.
            self.retry = Some(*frame);
            return Submitted::Replaced;
        }
        if self.sending == Some(frame.key()) {
            self.stale = true;
        }
        if replaces_retry {
            self.retry = None;
            return Submitted::Replaced;
        }
        submitted
    }

    pub(crate) fn cancel_pending(&mut self) -> u8 {
        self.stale = true;
        self.mailboxes.clear() + u8::from(self.retry.take().is_some())
    }

    pub(crate) const fn health(&self) -> Health {
        self.health
    }

    fn peek(&self) -> Option<&CanFrame> {
        self.retry.iter().chain(self.mailboxes.peek()).min_by_key(|frame| urgency(frame))
    }

    fn take(&mut self) -> Option<CanFrame> {
        let frame = *self.peek()?;
        if self.retry == Some(frame) {
            self.retry = None;
        } else {
            self.mailboxes.pop();
        }
        self.sending = Some(frame.key());
        self.stale = false;
        Some(frame)
    }

    /// The transmission ended without success: it is repeated, unless it is stale.
    fn give_back(&mut self, frame: CanFrame) {
        self.sending = None;
        if !self.stale {
            self.retry = Some(frame);
        }
    }

    fn sent(&mut self) {
        self.sending = None;
        self.count(self.health.transmit_errors.saturating_sub(1));
    }

    fn not_acknowledged(&mut self, frame: CanFrame) {
        self.give_back(frame);
        self.health.last_error = Some(BusError::Acknowledge);
        if self.health.transmit_errors < ERROR_PASSIVE {
            self.count(self.health.transmit_errors + FAILED_TRANSMISSION);
        }
    }

    fn count(&mut self, transmit_errors: u8) {
        self.health.transmit_errors = transmit_errors;
        self.health.state = match transmit_errors {
            ERROR_PASSIVE.. => ErrorState::Passive,
            ERROR_WARNING.. => ErrorState::Warning,
            _ => ErrorState::Active,
        };
    }

    fn arrive(&mut self, frame: CanFrame, at: Micros) {
        if self.received.len() < self.capacity {
            self.received.push_back((frame, at));
        } else {
            self.health.receive_lost = self.health.receive_lost.saturating_add(1);
        }
    }
}

/// Whether a node is on the bus. It hears, and acknowledges, frames that began while it was.
#[derive(Clone, Copy)]
enum Presence {
    Absent,
    Since(Micros),
}

impl Presence {
    const fn covers(self, air: &Transmission) -> bool {
        match self {
            Self::Absent => false,
            Self::Since(start) => start.get() * 1000 <= air.start_ns,
        }
    }
}

/// An ESC's CAN controller: room for one frame.
struct Node {
    presence: Presence,
    pending: Option<CanFrame>,
    overwritten: u64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Sender {
    Controller,
    Node(usize),
    Foreign,
}

pub(crate) struct Transmission {
    pub(crate) frame: CanFrame,
    sender: Sender,
    start_ns: u64,
    end_ns: u64,
}

/// A piece of wire: what is on it, and when the last frame ended.
#[derive(Default)]
struct Segment {
    on_air: Option<Transmission>,
    free_ns: u64,
}

impl Segment {
    fn start(&mut self, frame: CanFrame, sender: Sender, now: Micros, bit_time_ns: u64) {
        // The last frame may have ended within this very microsecond: then the next one follows
        // it without a gap.
        let start_ns = if micros_up(self.free_ns) == now { self.free_ns } else { now.get() * 1000 };
        let end_ns = start_ns + u64::from(frame.wire_length().total()) * bit_time_ns;
        self.free_ns = end_ns;
        self.on_air = Some(Transmission { frame, sender, start_ns, end_ns });
    }

    fn next_end(&self) -> Option<Micros> {
        self.on_air.as_ref().map(|air| micros_up(air.end_ns))
    }

    fn end(&mut self, now: Micros) -> Option<Transmission> {
        self.on_air.take_if(|air| micros_up(air.end_ns) <= now)
    }
}

/// The first whole microsecond that is not before a time in nanoseconds.
const fn micros_up(ns: u64) -> Micros {
    Micros::new(ns.div_ceil(1000))
}

/// Lowest wins. `Id`'s order is arbitration order; a data frame goes before a remote one.
fn urgency(frame: &CanFrame) -> (Id, bool) {
    (frame.id(), frame.is_remote())
}

pub(crate) struct Wire {
    bit_time_ns: u64,
    pub(crate) controller: Controller,
    nodes: Vec<Node>,
    foreign: VecDeque<CanFrame>,
    /// The controller's.
    presence: Presence,
    bus: Segment,
    /// What is left of the wire at a controller that was cut off: it sends there to nobody.
    stub: Segment,
    trace: Option<Vec<TraceEntry>>,
    counters: BusCounters,
    busy_ns: u64,
    window_ns: Vec<u64>,
}

impl Wire {
    pub(crate) fn new(config: BusConfig) -> Self {
        Self {
            bit_time_ns: u64::from(config.bit_time_ns.max(FASTEST_BIT_NS)),
            controller: Controller {
                mailboxes: Mailboxes::new(),
                retry: None,
                sending: None,
                stale: false,
                received: VecDeque::new(),
                capacity: config.receive_capacity,
                health: Health::default(),
            },
            nodes: Vec::new(),
            foreign: VecDeque::new(),
            presence: Presence::Since(Micros::ZERO),
            bus: Segment::default(),
            stub: Segment::default(),
            trace: config.trace.then(Vec::new),
            counters: BusCounters::default(),
            busy_ns: 0,
            window_ns: Vec::new(),
        }
    }

    /// Another ESC on the wire, powered from now on; its number.
    pub(crate) fn join(&mut self, now: Micros) -> usize {
        self.nodes.push(Node { presence: Presence::Since(now), pending: None, overwritten: 0 });
        self.nodes.len() - 1
    }

    /// Switches an ESC's power: what it had to send is gone.
    pub(crate) fn power(&mut self, node: usize, powered: bool, now: Micros) {
        self.nodes[node].presence = if powered { Presence::Since(now) } else { Presence::Absent };
        self.nodes[node].pending = None;
    }

    /// A node's next frame; one that still waits is overwritten.
    pub(crate) fn send(&mut self, node: usize, frame: CanFrame) {
        let node = &mut self.nodes[node];
        node.overwritten += u64::from(node.pending.replace(frame).is_some());
    }

    pub(crate) fn overwritten(&self, node: usize) -> u64 {
        self.nodes[node].overwritten
    }

    pub(crate) fn inject(&mut self, frame: CanFrame) {
        self.foreign.push_back(frame);
    }

    /// A frame that goes to nobody when the controller is connected again still ends unheard.
    pub(crate) const fn set_cut(&mut self, cut: bool, now: Micros) {
        match (cut, self.presence) {
            (true, _) => self.presence = Presence::Absent,
            (false, Presence::Absent) => self.presence = Presence::Since(now),
            (false, Presence::Since(_)) => (),
        }
    }

    pub(crate) fn take_trace(&mut self) -> Vec<TraceEntry> {
        self.trace.as_mut().map(std::mem::take).unwrap_or_default()
    }

    pub(crate) const fn counters(&self) -> BusCounters {
        self.counters
    }

    /// Nanoseconds the wire was busy since the start of time.
    pub(crate) const fn busy_ns(&self) -> u64 {
        self.busy_ns
    }

    /// How busy it was in each 100 ms that is over by `now`, in per cent.
    #[expect(clippy::cast_precision_loss, reason = "at most 1e8")]
    pub(crate) fn load_windows(&self, now: Micros) -> Vec<f64> {
        (0..now.get() * 1000 / WINDOW_NS)
            .map(|index| {
                let busy = usize::try_from(index)
                    .ok()
                    .and_then(|index| self.window_ns.get(index))
                    .map_or(0, |&busy| busy);
                busy as f64 * 100.0 / WINDOW_NS as f64
            })
            .collect()
    }

    /// When the next frame ends.
    pub(crate) fn next_end(&self) -> Option<Micros> {
        let stub = self.stub.next_end();
        self.bus.next_end().into_iter().chain(stub).min()
    }

    /// Ends what ends by now; an acknowledged frame is the caller's to hand to the ESCs that
    /// [hear](Self::hears) it.
    pub(crate) fn end(&mut self, now: Micros) -> Option<Transmission> {
        if let Some(air) = self.stub.end(now) {
            self.controller.not_acknowledged(air.frame);
        }
        let air = self.bus.end(now)?;
        self.count_busy(air.start_ns, air.end_ns);
        if let Sender::Node(node) = air.sender
            && !self.nodes[node].presence.covers(&air)
        {
            // The sender lost power half-way: what was on the wire is no frame.
            return None;
        }
        if !self.is_acknowledged(&air) {
            self.counters.unacknowledged += 1;
            self.repeat(air);
            return None;
        }
        self.counters.frames += 1;
        if let Some(trace) = &mut self.trace {
            trace.push(TraceEntry {
                at: now,
                frame: air.frame,
                from_controller: air.sender == Sender::Controller,
            });
        }
        if air.sender == Sender::Controller {
            self.controller.sent();
        } else if self.presence.covers(&air) {
            self.controller.arrive(air.frame, now);
        }
        Some(air)
    }

    /// Whether an ESC hears a frame.
    pub(crate) fn hears(&self, node: usize, air: &Transmission) -> bool {
        air.sender != Sender::Node(node) && self.nodes[node].presence.covers(air)
    }

    fn is_acknowledged(&self, air: &Transmission) -> bool {
        let by_controller = self.presence.covers(air);
        let by_others = || {
            (0..self.nodes.len()).any(|node| self.hears(node, air))
                || air.sender != Sender::Foreign && !self.foreign.is_empty()
        };
        match air.sender {
            // A controller that is cut off while it sends is heard by nobody.
            Sender::Controller => by_controller && by_others(),
            _ => by_controller || by_others(),
        }
    }

    fn repeat(&mut self, air: Transmission) {
        match air.sender {
            Sender::Controller => self.controller.not_acknowledged(air.frame),
            Sender::Node(node) => {
                let node = &mut self.nodes[node];
                if node.pending.is_some() {
                    node.overwritten += 1;
                } else {
                    node.pending = Some(air.frame);
                }
            }
            Sender::Foreign => self.foreign.push_front(air.frame),
        }
    }

    fn count_busy(&mut self, mut start_ns: u64, end_ns: u64) {
        self.busy_ns += end_ns - start_ns;
        while start_ns < end_ns {
            let window = start_ns / WINDOW_NS;
            let until = end_ns.min((window + 1) * WINDOW_NS);
            if let Ok(index) = usize::try_from(window) {
                if self.window_ns.len() <= index {
                    self.window_ns.resize(index + 1, 0);
                }
                self.window_ns[index] += until - start_ns;
            }
            start_ns = until;
        }
    }

    /// An idle wire: everybody who has a frame competes now.
    pub(crate) fn arbitrate(&mut self, now: Micros) {
        let may_send = self.controller.sending.is_none();
        let connected = matches!(self.presence, Presence::Since(_));
        if !connected
            && may_send
            && let Some(frame) = self.controller.take()
        {
            self.stub.start(frame, Sender::Controller, now, self.bit_time_ns);
        }
        if self.bus.on_air.is_some() {
            return;
        }
        let from_controller = (may_send && connected).then(|| self.controller.peek());
        let from_controller = from_controller.flatten().map(|f| (f, Sender::Controller));
        let from_foreign = self.foreign.front().map(|frame| (frame, Sender::Foreign));
        let from_nodes = self.nodes.iter().enumerate();
        let from_nodes = from_nodes
            .filter_map(|(index, node)| node.pending.as_ref().map(|f| (f, Sender::Node(index))));
        let mut winner: Option<(&CanFrame, Sender)> = None;
        let candidates = from_controller.into_iter().chain(from_nodes);
        let mut clash = false;
        for candidate in candidates.chain(from_foreign) {
            match winner.map(|(best, _)| urgency(candidate.0).cmp(&urgency(best))) {
                None | Some(std::cmp::Ordering::Less) => {
                    winner = Some(candidate);
                    clash = false;
                }
                Some(std::cmp::Ordering::Equal) => clash = true,
                Some(std::cmp::Ordering::Greater) => (),
            }
        }
        let Some((&frame, sender)) = winner else {
            return;
        };
        self.counters.id_clashes += u64::from(clash);
        match sender {
            Sender::Controller => drop(self.controller.take()),
            Sender::Node(node) => self.nodes[node].pending = None,
            Sender::Foreign => drop(self.foreign.pop_front()),
        }
        self.bus.start(frame, sender, now, self.bit_time_ns);
    }
}
