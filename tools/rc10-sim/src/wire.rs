//! One CAN wire: who may send, how long it takes, who hears it.

use std::cell::RefCell;
use std::cmp::Ordering;
use std::collections::VecDeque;
use std::rc::Rc;

use rc10_can::embedded_can::Id;
use rc10_can::{BusError, CanFrame};
use rc10_time::Micros;

use crate::host::Host;
use crate::occupancy::Occupancy;
use crate::segment::{Segment, Sender, Transmission};
use crate::{Activity, Controller, Nanos, Outcome, tolerance_ppm};

/// Configuration of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusConfig {
    /// Length of one bit in nanoseconds; 1000 (1 Mbit/s, the fastest classic CAN goes) or more.
    pub bit_time_ns: u32,
    /// Frames the receive queue of the bus's own controller holds; what comes while it is full is
    /// lost and counted in [`Health::receive_lost`](rc10_can::Health::receive_lost).
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

/// Lengths in bit times, ISO 11898-1. Error flag (6) and error delimiter (8).
const ERROR_FRAME: u32 = 14;
/// Interframe space without a suspended transmission.
const INTERFRAME: u32 = 3;
/// Recessive bits after which a wire is idle.
const IDLE: u32 = 11;

/// What the ESCs follow. An assumption: no maker says how it times its bits. That of `CubeMX`, as DJI's own examples for
/// STM32F4 have it: 1 + 10 + 3 quanta, a jump of 1. That is 0.71 %.
pub(crate) const ESC_TOLERANCE: u32 = tolerance_ppm(10, 3, 1);

/// One frame that went over a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraceEntry {
    /// The time at which the interframe space after it ended, in whole microseconds.
    pub at: Micros,
    /// The time at which its start-of-frame bit began.
    pub start: Nanos,
    /// The time at which it ended, before the interframe space: then its receivers have it.
    pub end: Nanos,
    /// The frame.
    pub frame: CanFrame,
    /// Whether the controller sent it (else an ESC or the foreign node).
    pub from_controller: bool,
}

/// Counters of a wire since the world began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusCounters {
    /// Frames sent and acknowledged.
    pub frames: u64,
    /// Attempts that were not acknowledged; each is repeated.
    pub unacknowledged: u64,
    /// Attempts that were destroyed: by a fault of the wire, by a sender that fell silent half-way,
    /// by another bit rate. Each is repeated by a sender that is still there.
    pub destroyed: u64,
    /// Arbitrations in which two nodes sent the same identifier at once. On a real bus they would
    /// destroy each other's frames; here the node that was added first wins.
    pub id_clashes: u64,
}

/// An ESC's CAN controller: a queue with one frame per identifier.
pub(crate) struct Node {
    /// Since when it is powered: it hears, and acknowledges, frames that began since.
    present_since: Option<Nanos>,
    queue: VecDeque<CanFrame>,
    pub(crate) overwritten: u64,
}

/// Frames an ESC's queue holds; then the oldest goes.
const QUEUE: usize = 16;

impl Node {
    fn was_there_for(&self, air: &Transmission) -> bool {
        self.present_since.is_some_and(|since| since <= air.start)
    }
}

/// Lowest wins. `Id`'s order is arbitration order; a data frame goes before a remote one.
pub(crate) fn urgency(frame: &CanFrame) -> (Id, bool) {
    (frame.id(), frame.is_remote())
}

/// A controller's place on a wire.
struct Plug {
    /// The place's own controller.
    host: Rc<RefCell<Host>>,
    /// The host, unless another controller was attached.
    controller: Rc<RefCell<dyn Controller>>,
    /// The wire's end at a controller that is cut off: no other node is there.
    stub: Segment,
    cut: bool,
    /// Whether the controller is connected, when that was looked at last.
    connected: bool,
    /// The activity that the controller was told last.
    told: Option<Activity>,
    /// The frames on the wire, as its owner sees them.
    trace: Option<Vec<TraceEntry>>,
}

impl Plug {
    fn new(config: BusConfig, bit_time_ns: u64) -> Self {
        let host = Rc::new(RefCell::new(Host::new(config.receive_capacity, bit_time_ns)));
        Self {
            controller: Rc::<RefCell<Host>>::clone(&host),
            host,
            stub: Segment::Idle,
            cut: false,
            connected: true,
            told: None,
            trace: config.trace.then(Vec::new),
        }
    }

    fn is_on_bus(&self) -> bool {
        self.controller.borrow().is_on_bus()
    }

    /// What it has to send, if it may begin now.
    fn offer(&self, bus: &Segment, now: Nanos) -> Option<CanFrame> {
        let may_start = self.stub.is_idle() && (bus.is_idle() || !self.connected);
        let mut controller = self.controller.borrow_mut();
        (may_start && controller.is_on_bus()).then(|| controller.offer(now)).flatten()
    }
}

pub(crate) struct Wire {
    pub(crate) bit_time_ns: u64,
    plugs: Vec<Plug>,
    pub(crate) nodes: Vec<Node>,
    /// Frames that a foreign node has to send.
    pub(crate) foreign: VecDeque<CanFrame>,
    bus: Segment,
    shorted: bool,
    held: bool,
    /// Frames that noise is going to destroy.
    pub(crate) to_damage: u32,
    /// The time of the next event here, and whether something was done since that was asked.
    pub(crate) due: Nanos,
    pub(crate) touched: bool,
    pub(crate) counters: BusCounters,
    pub(crate) occupancy: Occupancy,
    config: BusConfig,
}

impl Wire {
    pub(crate) fn new(config: BusConfig, start: Nanos) -> Self {
        let bit_time_ns = u64::from(config.bit_time_ns.max(FASTEST_BIT_NS));
        Self {
            bit_time_ns,
            plugs: vec![Plug::new(config, bit_time_ns)],
            nodes: Vec::new(),
            foreign: VecDeque::new(),
            bus: Segment::Idle,
            shorted: false,
            held: false,
            to_damage: 0,
            due: Nanos::ZERO,
            touched: true,
            counters: BusCounters::default(),
            occupancy: Occupancy::since(start),
            config,
        }
    }

    fn bits(&self, bits: u32) -> Nanos {
        Nanos::new(u64::from(bits) * self.bit_time_ns)
    }

    /// Another ESC on the wire, powered from now on; its number.
    pub(crate) fn join(&mut self, now: Nanos) -> usize {
        self.nodes.push(Node { present_since: Some(now), queue: VecDeque::new(), overwritten: 0 });
        self.nodes.len() - 1
    }

    /// Another controller's place on the wire; its number.
    pub(crate) fn add_plug(&mut self) -> usize {
        self.plugs.push(Plug::new(self.config, self.bit_time_ns));
        self.plugs.len() - 1
    }

    /// The own controller of a place.
    pub(crate) fn host(&self, plug: usize) -> &Rc<RefCell<Host>> {
        &self.plugs[plug].host
    }

    pub(crate) fn take_trace(&mut self, plug: usize) -> Vec<TraceEntry> {
        self.plugs[plug].trace.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Switches an ESC's power: what it had to send is gone, and what it sends is no frame.
    pub(crate) fn power(&mut self, node: usize, powered: bool, now: Nanos) {
        self.nodes[node].present_since = powered.then_some(now);
        self.nodes[node].queue.clear();
        if matches!(&self.bus, Segment::Frame(air) if air.sender == Sender::Node(node)) {
            self.destroy(now);
        }
    }

    /// A node's next frame; one of its identifier that still waits is overwritten.
    pub(crate) fn send(&mut self, node: usize, frame: CanFrame) {
        self.touched = true;
        let Node { queue, overwritten, .. } = &mut self.nodes[node];
        if let Some(older) = queue.iter_mut().find(|older| older.key() == frame.key()) {
            *older = frame;
            *overwritten += 1;
            return;
        }
        if queue.len() == QUEUE {
            queue.pop_front();
            *overwritten += 1;
        }
        queue.push_back(frame);
    }

    /// Another controller in the place of the present one, whose frame on the wire breaks off.
    pub(crate) fn attach(
        &mut self,
        plug: usize,
        controller: Rc<RefCell<dyn Controller>>,
        now: Nanos,
    ) {
        let cut = std::mem::replace(&mut self.plugs[plug].cut, true);
        self.look_at_controllers(now);
        let place = &mut self.plugs[plug];
        (place.cut, place.stub, place.told) = (cut, Segment::Idle, None);
        place.controller = controller;
        self.look_at_controllers(now);
    }

    pub(crate) fn set_cut(&mut self, plug: usize, cut: bool, now: Nanos) {
        self.plugs[plug].cut = cut;
        self.look_at_controllers(now);
    }

    pub(crate) fn set_shorted(&mut self, shorted: bool, now: Nanos) {
        self.shorted = shorted;
        if shorted {
            self.destroy(now);
        }
    }

    pub(crate) fn set_held_dominant(&mut self, held: bool, now: Nanos) {
        self.held = held;
        match self.bus {
            Segment::Idle if held => self.bus = Segment::Held { since: now },
            Segment::Gap { since, .. } if held => self.bus = Segment::Held { since },
            Segment::Frame(_) if held => self.destroy(now),
            Segment::Held { since } if !held => {
                self.bus = Segment::Gap { since, until: now + self.bits(IDLE) };
            }
            _ => (),
        }
        self.tell(now);
    }

    /// Asks when the next event happens here by itself.
    pub(crate) fn ask(&mut self) {
        let of_plug = |plug: &Plug| [plug.stub.next_event(), plug.controller.borrow().next_event()];
        let events = self.plugs.iter().flat_map(of_plug).chain([self.bus.next_event()]);
        self.due = events.flatten().fold(Nanos::NEVER, Nanos::min);
    }

    /// Carries out what happens by itself now. An acknowledged frame is the caller's to hand to the
    /// ESCs that [hear](Self::hears) it.
    pub(crate) fn process(&mut self, now: Nanos) -> Option<Transmission> {
        if self.due > now {
            return None;
        }
        self.touched = true;
        let interframe = self.bits(INTERFRAME);
        for Plug { controller, stub, .. } in &mut self.plugs {
            let mut controller = controller.borrow_mut();
            if controller.next_event().is_some_and(|at| at <= now) {
                controller.advance(now);
            }
            if let Some(air) = stub.end_frame(now, interframe) {
                let outcome = match air.failed {
                    Some(_) => Outcome::Destroyed(BusError::Bit),
                    None => Outcome::Unacknowledged,
                };
                controller.sent(outcome, air.end);
            }
            stub.end_gap(now);
        }
        if let Some((since, until)) = self.bus.end_gap(now) {
            self.occupancy.add(since, until);
        }
        self.make_noise(now);
        let ended = self.bus.end_frame(now, interframe);
        if let Some(air) = &ended
            && self.held
        {
            self.bus = Segment::Held { since: air.start };
        }
        let heard = ended.and_then(|air| self.finish(air));
        self.tell(now);
        heard
    }

    /// Whether an ESC hears a frame.
    pub(crate) fn hears(&self, node: usize, air: &Transmission) -> bool {
        air.sender != Sender::Node(node) && self.nodes[node].was_there_for(air)
    }

    /// Arbitration on an idle wire: all nodes that have a frame compete now.
    pub(crate) fn arbitrate(&mut self, now: Nanos) {
        self.touched = false;
        self.look_at_controllers(now);
        for at in 0..self.plugs.len() {
            let plug = &self.plugs[at];
            if plug.connected {
                continue;
            }
            if let Some(frame) = plug.offer(&self.bus, now) {
                let mut air = self.transmission(frame, Sender::Controller(at), now);
                if !plug.controller.borrow().hears_itself() {
                    air.fail(BusError::Bit, now + self.bits(1 + ERROR_FRAME));
                }
                plug.controller.borrow_mut().sending(now);
                self.plugs[at].stub = Segment::Frame(air);
            }
        }
        if self.bus.is_idle() {
            self.compete(now);
        }
        self.tell(now);
        self.ask();
    }

    fn compete(&mut self, now: Nanos) {
        let offers = self.plugs.iter().enumerate().filter(|(_, plug)| plug.connected);
        let offers = offers
            .filter_map(|(at, plug)| Some((plug.offer(&self.bus, now)?, Sender::Controller(at))));
        let from_nodes = self.nodes.iter().enumerate();
        let from_nodes = from_nodes
            .filter_map(|(index, node)| Some((*node.queue.front()?, Sender::Node(index))));
        let from_foreign = self.foreign.front().map(|&frame| (frame, Sender::Foreign));
        let (mut winner, mut clash) = (None, false);
        // Of the controllers: which have something to send, and the first of them.
        let (mut offering, mut first) = (0_u32, None);
        for candidate in offers.chain(from_nodes).chain(from_foreign) {
            if let Sender::Controller(at) = candidate.1 {
                offering |= 1 << at;
                first = first.or(Some(candidate));
            }
            match winner.map(|(best, _)| urgency(&candidate.0).cmp(&urgency(&best))) {
                None | Some(Ordering::Less) => {
                    winner = Some(candidate);
                    clash = false;
                }
                Some(Ordering::Equal) => clash = true,
                Some(Ordering::Greater) => (),
            }
        }
        // Shorted all nodes fail at the first bit, controllers too: only one of those counts.
        let Some((frame, sender)) = first.filter(|_| self.shorted).or(winner) else {
            return;
        };
        self.counters.id_clashes += u64::from(clash && !self.shorted);
        match sender {
            Sender::Controller(at) => self.plugs[at].controller.borrow_mut().sending(now),
            Sender::Node(node) => drop(self.nodes[node].queue.pop_front()),
            Sender::Foreign => drop(self.foreign.pop_front()),
        }
        let mut air = self.transmission(frame, sender, now);
        for (at, plug) in self.plugs.iter().enumerate() {
            if sender == Sender::Controller(at) {
                continue;
            }
            let mut controller = plug.controller.borrow_mut();
            if offering & 1 << at != 0 {
                controller.lost_arbitration(now);
            }
            if plug.connected && !self.shorted && controller.is_on_bus() {
                air.heard_by |= 1 << at;
            }
        }
        if self.shorted {
            air.fail(BusError::Bit, now + self.bits(1 + ERROR_FRAME));
        } else if let Sender::Controller(at) = sender
            && self.is_off_by(&*self.plugs[at].controller.borrow(), ESC_TOLERANCE)
        {
            air.fail(BusError::Stuff, air.end + self.bits(ERROR_FRAME));
        }
        self.bus = Segment::Frame(air);
    }

    fn transmission(&self, frame: CanFrame, sender: Sender, start: Nanos) -> Transmission {
        let end = start + self.bits(frame.wire_length().total() - INTERFRAME);
        Transmission { frame, sender, start, end, failed: None, heard_by: 0 }
    }

    /// Whether the controller's bits differ by more than one end follows, in millionths.
    fn is_off_by(&self, controller: &dyn Controller, tolerance: u32) -> bool {
        controller.bit_time_ns().is_some_and(|bit_time_ns| !self.is_within(bit_time_ns, tolerance))
    }

    pub(crate) fn is_within(&self, bit_time_ns: u32, tolerance: u32) -> bool {
        let off = u64::from(bit_time_ns).abs_diff(self.bit_time_ns);
        off * 1_000_000 <= self.bit_time_ns * u64::from(tolerance)
    }

    /// Destroys the frame that is on the wire.
    fn destroy(&mut self, now: Nanos) {
        let end = now + self.bits(ERROR_FRAME);
        if let Segment::Frame(air) = &mut self.bus {
            air.fail(BusError::Stuff, end);
        }
    }

    /// Destroys a frame that ends now, if noise is to.
    fn make_noise(&mut self, now: Nanos) {
        let error_frame = self.bits(ERROR_FRAME);
        if let Segment::Frame(air) = &mut self.bus
            && self.to_damage > 0
            && air.end <= now
            && air.failed.is_none()
        {
            self.to_damage -= 1;
            air.fail(BusError::Crc, air.end + error_frame);
        }
    }

    /// Notices that a controller has left the bus, or its wire, within a frame.
    fn look_at_controllers(&mut self, now: Nanos) {
        let error_end = now + self.bits(ERROR_FRAME);
        let until = error_end + self.bits(INTERFRAME);
        let mut disturbed = 0;
        for (at, plug) in self.plugs.iter_mut().enumerate() {
            plug.connected = !plug.cut && plug.controller.borrow().is_connected();
            let on_bus = plug.is_on_bus();
            if let Segment::Frame(air) = &mut self.bus {
                if air.sender != Sender::Controller(at) {
                    if !on_bus || !plug.connected {
                        air.heard_by &= !(1 << at);
                    }
                } else if !plug.connected {
                    // It goes on alone; the others destroy what they have of the frame.
                    let broken_off = Segment::Gap { since: air.start, until };
                    self.counters.destroyed += 1;
                    disturbed = air.heard_by;
                    plug.stub = std::mem::replace(&mut self.bus, broken_off);
                } else if !on_bus {
                    air.fail(BusError::Stuff, error_end);
                }
            }
            if let Segment::Frame(air) = &mut plug.stub
                && !on_bus
            {
                air.fail(BusError::Stuff, error_end);
            }
        }
        for (at, plug) in self.plugs.iter().enumerate() {
            if disturbed & 1 << at != 0 {
                plug.controller.borrow_mut().disturbed(BusError::Stuff, error_end);
            }
        }
        self.tell(now);
    }

    /// Tells each controller what its wire carries, if that has changed.
    fn tell(&mut self, now: Nanos) {
        for plug in &mut self.plugs {
            let is_idle = plug.stub.is_idle() && (self.bus.is_idle() || !plug.connected);
            let activity = if is_idle { Activity::Idle } else { Activity::Busy };
            if plug.told != Some(activity) {
                plug.told = Some(activity);
                plug.controller.borrow_mut().wire_is(activity, now);
            }
        }
    }

    /// Tells all nodes but the ESCs how a frame ended; returns it if they hear it.
    fn finish(&mut self, air: Transmission) -> Option<Transmission> {
        let is_heard_by = |at: &usize| air.heard_by & 1 << at != 0;
        let understands = |at: usize| {
            let controller = self.plugs[at].controller.borrow();
            !self.is_off_by(&*controller, controller.tolerance_ppm())
        };
        let mut is_acknowledged = (0..self.nodes.len()).any(|node| self.hears(node, &air))
            || air.sender != Sender::Foreign && !self.foreign.is_empty();
        for at in (0..self.plugs.len()).filter(is_heard_by) {
            let understands = understands(at);
            is_acknowledged |= understands;
            let mut controller = self.plugs[at].controller.borrow_mut();
            match air.failed {
                _ if !understands => controller.disturbed(BusError::Stuff, air.end),
                Some(error) => controller.disturbed(error, air.end),
                None => controller.received(&air.frame, air.start, air.end),
            }
        }
        let outcome = match air.failed {
            Some(_) => Outcome::Destroyed(BusError::Bit),
            None if is_acknowledged => Outcome::Acknowledged,
            None => Outcome::Unacknowledged,
        };
        match outcome {
            Outcome::Acknowledged => self.counters.frames += 1,
            Outcome::Unacknowledged => self.counters.unacknowledged += 1,
            Outcome::Destroyed(_) => self.counters.destroyed += 1,
        }
        let is_heard = outcome == Outcome::Acknowledged;
        match air.sender {
            Sender::Controller(at) => {
                self.plugs[at].controller.borrow_mut().sent(outcome, air.end);
            }
            Sender::Node(node) if !is_heard && self.nodes[node].was_there_for(&air) => {
                let node = &mut self.nodes[node];
                if node.queue.iter().any(|newer| newer.key() == air.frame.key()) {
                    node.overwritten += 1;
                } else {
                    node.queue.push_front(air.frame);
                }
            }
            Sender::Foreign if !is_heard => self.foreign.push_front(air.frame),
            Sender::Node(_) | Sender::Foreign => (),
        }
        if !is_heard {
            return None;
        }
        let end = air.end + self.bits(INTERFRAME);
        for (at, plug) in self.plugs.iter_mut().enumerate() {
            if let Some(trace) = &mut plug.trace {
                trace.push(TraceEntry {
                    at: end.micros(),
                    start: air.start,
                    end: air.end,
                    frame: air.frame,
                    from_controller: air.sender == Sender::Controller(at),
                });
            }
        }
        Some(air)
    }
}
