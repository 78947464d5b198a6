use std::collections::BTreeMap;

use rc10_can::embedded_can::Id;
use rc10_motor::signals::{ByteOrder, Message, Presence, Signal};

use crate::formats::dbc::Node;
use crate::formats::dbc::names::{Name, Names};

const ROBOT: &str = "Robot";

/// The contents of a DBC file: one bus.
#[derive(Clone, Debug)]
pub struct Dbc {
    /// Name of the bus.
    pub bus: String,
    /// Our own node, then the devices, each with a comment.
    pub nodes: Vec<(Name, String)>,
    /// The frames, in the order of their identifiers.
    pub frames: Vec<Frame>,
    /// Facts that the file cannot describe: a sentence each.
    pub left_out: Vec<String>,
}

/// All messages of one identifier.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Name of the frame.
    pub name: Name,
    /// Identifier of the frame.
    pub id: Id,
    /// Data bytes.
    pub len: u8,
    /// Senders of the frame: indices into [`Dbc::nodes`], each once.
    pub senders: Vec<usize>,
    /// Signals of the frame.
    pub signals: Vec<NamedSignal>,
}

/// A signal as a file names it.
#[derive(Clone, Debug)]
pub struct NamedSignal {
    /// Name of the signal, unique in its frame.
    pub name: Name,
    /// Place of the signal in the frame, and its meaning.
    pub signal: Signal,
    /// Receivers of the signal: indices into [`Dbc::nodes`], each once.
    pub receivers: Vec<usize>,
}

impl Dbc {
    /// The contents for a bus with these devices.
    pub fn new(bus: &str, devices: &[Node]) -> Self {
        let mut names = Names::default();
        let robot = (names.name(ROBOT), "the program of this robot".to_owned());
        let device = |node: &Node| (names.name(&node.label), node.comment.clone());
        let nodes: Vec<_> = std::iter::once(robot).chain(devices.iter().map(device)).collect();

        // In the order of numbers, extended ones last.
        let mut by_id: BTreeMap<u32, Vec<(usize, &Message)>> = BTreeMap::new();
        for (place, device) in (1..).zip(devices) {
            for message in device.messages.iter().filter(|message| message.is_plain()) {
                by_id.entry(number(message.id)).or_default().push((place, message));
            }
        }
        let mut left_out = Vec::new();
        let lines = devices.iter().flat_map(|device| device.not_in_dbc);
        lines.for_each(|line| add(&mut left_out, (*line).to_owned()));
        for Node { label, messages, .. } in devices {
            let is_plain = |name| messages.iter().any(|it| it.is_plain() && it.name == name);
            let mut special = Vec::new();
            let names = messages.iter().map(|message| message.name);
            names.filter(|name| !is_plain(*name)).for_each(|name| add(&mut special, name));
            if !special.is_empty() {
                let special = special.join(", ");
                left_out.push(format!("{label}, but named by rc10 decode: {special}"));
            }
        }
        let mut names = Names::default();
        let frames = by_id
            .into_values()
            .map(|messages| frame(&messages, &nodes, &mut names, &mut left_out))
            .collect();
        Self { bus: bus.to_owned(), nodes, frames, left_out }
    }
}

/// An identifier as in the file: extended ones have bit 31 set.
pub(super) fn number(id: Id) -> u32 {
    match id {
        Id::Standard(id) => id.as_raw().into(),
        Id::Extended(id) => id.as_raw() | 1 << 31,
    }
}

fn frame(
    messages: &[(usize, &Message)],
    nodes: &[(Name, String)],
    names: &mut Names,
    left_out: &mut Vec<String>,
) -> Frame {
    let &(first, message) = &messages[0];
    let is_shared = messages.iter().any(|(place, _)| *place != first);
    let label = |place: usize| &nodes[place].0.long;
    let name = if is_shared {
        // Each kind of device once: "DJI_COMMAND_200".
        let mut parts = Vec::new();
        messages.iter().for_each(|(_, message)| add(&mut parts, message.name));
        names.name(&parts.join("_"))
    } else {
        names.name(&format!("{}_{}", label(first), message.name))
    };
    let mut frame = Frame {
        name,
        id: message.id,
        len: messages.iter().map(|(_, message)| message.len).max().unwrap_or(0),
        senders: Vec::new(),
        signals: Vec::new(),
    };
    let mut signal_names = Names::default();
    for &(place, message) in messages {
        let (sender, receiver) = if message.from_device { (place, 0) } else { (0, place) };
        add(&mut frame.senders, sender);
        let switch = message.signals.iter().find(|signal| signal.presence == Presence::Switch);
        let lost_switch = switch.is_some_and(|switch| frame.obstacle(switch).is_some());
        for signal in message.signals {
            if let Some(same) = frame.signals.iter_mut().find(|known| known.signal == *signal) {
                add(&mut same.receivers, receiver);
                continue;
            }
            let why = match frame.obstacle(signal) {
                Some(known) => format!("{} is in its place", known.name.long),
                None if lost_switch && matches!(signal.presence, Presence::If(_)) => {
                    "what says whether it is there is not in it".to_owned()
                }
                None => {
                    // A signal that all motors share belongs to no single one.
                    let has_it = |(_, other): &&(_, &Message)| other.signals.contains(signal);
                    let is_own = is_shared && messages.iter().filter(has_it).count() == 1;
                    let whose = if is_own { format!("{}_", label(place)) } else { String::new() };
                    let name = signal_names.name(&(whose + signal.name));
                    let receivers = vec![receiver];
                    frame.signals.push(NamedSignal { name, signal: *signal, receivers });
                    continue;
                }
            };
            let (frame, label) = (&frame.name.long, label(place));
            left_out.push(format!("{frame}: {} of {label}: {why}", signal.name));
        }
    }
    frame
}

impl Frame {
    /// The signal that leaves no room for another one.
    fn obstacle(&self, signal: &Signal) -> Option<&NamedSignal> {
        let obstacle = self.signals.iter().find(|known| clash(&known.signal, signal));
        obstacle.filter(|known| known.signal != *signal)
    }
}

fn add<T: PartialEq>(list: &mut Vec<T>, item: T) {
    if !list.contains(&item) {
        list.push(item);
    }
}

/// Whether two signals exclude each other: they share bits, or both are multiplexors.
fn clash(one: &Signal, other: &Signal) -> bool {
    let never_together =
        matches!((one.presence, other.presence), (Presence::If(a), Presence::If(b)) if a != b);
    let are_switches = (one.presence, other.presence) == (Presence::Switch, Presence::Switch);
    are_switches || !never_together && bits(one) & bits(other) != 0
}

/// The bits of a signal, bit 0 of byte 0 first.
fn bits(signal: &Signal) -> u64 {
    let mut bits = 0;
    let mut bit = u32::from(signal.start);
    for _ in 0..signal.bits {
        bits |= 1_u64.checked_shl(bit).unwrap_or(0);
        bit = match signal.order {
            ByteOrder::Little => bit + 1,
            ByteOrder::Big if bit.is_multiple_of(8) => bit + 15,
            ByteOrder::Big => bit - 1,
        };
    }
    bits
}

#[cfg(test)]
mod tests {
    use rc10_can::embedded_can::StandardId;
    use rc10_motor::signals::Marks;

    use super::*;

    fn node(label: &str, signals: &'static [Signal]) -> Node {
        let id = StandardId::new(0x10).unwrap().into();
        let message = Message::new("STATE", id, 8, true, signals);
        Node {
            label: label.to_owned(),
            comment: String::new(),
            messages: vec![message],
            not_in_dbc: &[],
        }
    }

    fn names(dbc: &Dbc) -> Vec<&str> {
        dbc.frames[0].signals.iter().map(|signal| signal.name.long.as_str()).collect()
    }

    const BITS: ByteOrder = ByteOrder::Little;
    const SWITCH: Signal = Signal::new("WHO", BITS, 0, 4).when(Presence::Switch);

    #[test]
    fn one_device_has_its_label_before_the_message_and_several_before_the_signals() {
        const LEFT: &[Signal] = &[Signal::big("SPEED", 0, 2)];
        const RIGHT: &[Signal] = &[Signal::big("SPEED", 2, 2)];
        let one = Dbc::new("bus", &[node("left wheel", LEFT)]);
        assert_eq!(
            (one.frames[0].name.long.as_str(), names(&one)),
            ("left_wheel_STATE", vec!["SPEED"])
        );
        let two = Dbc::new("bus", &[node("left", LEFT), node("right", RIGHT)]);
        assert_eq!(two.frames.len(), 1);
        assert_eq!(two.frames[0].name.long, "STATE");
        assert_eq!(names(&two), ["left_SPEED", "right_SPEED"]);
        assert_eq!(two.frames[0].senders, [1, 2]);
        assert_eq!(two.left_out, [""; 0]);
    }

    #[test]
    fn a_shared_multiplexor_appears_once() {
        const ONE: &[Signal] = &[SWITCH, Signal::big("SPEED", 1, 2).when(Presence::If(1))];
        const TWO: &[Signal] = &[SWITCH, Signal::big("SPEED", 1, 2).when(Presence::If(2))];
        let dbc = Dbc::new("bus", &[node("one", ONE), node("two", TWO)]);
        assert_eq!(names(&dbc), ["WHO", "one_SPEED", "two_SPEED"]);
        assert_eq!(dbc.left_out, [""; 0]);
    }

    #[test]
    fn what_has_no_room_is_left_out_and_named() {
        const ONE: &[Signal] = &[SWITCH, Signal::big("SPEED", 1, 2).when(Presence::If(1))];
        const ELSE: &[Signal] = &[
            Signal::big("LOAD", 5, 1).when(Presence::If(3)),
            Signal::new("KIND", BITS, 4, 4).when(Presence::Switch),
            Signal::new("HEAT", BITS, 15, 2),
            Signal::big("FREE", 7, 1),
        ];
        let dbc = Dbc::new("bus", &[node("one", ONE), node("two", ELSE)]);
        assert_eq!(names(&dbc), ["one_WHO", "one_SPEED", "two_FREE"]);
        let expected = [
            "STATE: LOAD of two: what says whether it is there is not in it",
            "STATE: KIND of two: one_WHO is in its place",
            "STATE: HEAT of two: one_SPEED is in its place",
        ];
        assert_eq!(dbc.left_out, expected);
    }

    #[test]
    fn special_messages_are_named_and_are_no_frames() {
        let id = StandardId::new(0x10).unwrap().into();
        let plain = Message::new("SET", id, 8, false, &[]);
        let messages = vec![
            plain,
            plain.marked(Marks::bytes([1])),
            Message { name: "STOP", ..plain.marked(Marks::bytes([2])) },
            Message { name: "ASK", ..plain.requested() },
            Message { name: "MOVE", ..plain.varying(3) },
        ];
        let dbc = Dbc::new("bus", &[Node { messages, ..node("arm", &[]) }]);
        let frames: Vec<_> = dbc.frames.iter().map(|frame| frame.name.long.as_str()).collect();
        assert_eq!(frames, ["arm_SET"]);
        assert_eq!(dbc.left_out, ["arm, but named by rc10 decode: STOP, ASK, MOVE"]);
    }

    #[test]
    fn bits_are_those_that_the_signal_reads() {
        for signal in [
            Signal::big("A", 1, 2),
            Signal::little("A", 3, 4),
            Signal::new("A", ByteOrder::Big, 35, 12),
            Signal::new("A", BITS, 13, 9),
            Signal::little("A", 0, 8),
        ] {
            let bits = bits(&signal);
            assert_eq!(bits.count_ones(), u32::from(signal.bits));
            let ones = signal.raw(&bits.to_le_bytes()).unwrap();
            assert_eq!(ones, u64::MAX >> (64 - signal.bits));
            assert_eq!(signal.raw(&(!bits).to_le_bytes()), Some(0));
        }
    }
}
