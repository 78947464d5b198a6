use std::collections::BTreeMap;

use rc10_can::embedded_can::Id;
use rc10_motor::signals::{ByteOrder, Message, Presence, Signal};

use super::Node;
use super::names::{Name, Names};

/// Our own node.
const ROBOT: &str = "Robot";

/// What a DBC file says of a bus.
#[derive(Clone, Debug)]
pub struct Dbc {
    /// What the bus is called.
    pub bus: String,
    /// Our own node, then the devices; with what each is.
    pub nodes: Vec<(Name, String)>,
    /// In the order of their identifiers.
    pub frames: Vec<Frame>,
    /// What it does not say: a sentence each.
    pub left_out: Vec<String>,
}

/// All that comes with one identifier.
#[derive(Clone, Debug)]
pub struct Frame {
    /// What it is called.
    pub name: Name,
    /// Its identifier.
    pub id: Id,
    /// Data bytes.
    pub len: u8,
    /// Who sends it: places in [`Dbc::nodes`], each once.
    pub senders: Vec<usize>,
    /// What stands in it.
    pub signals: Vec<NamedSignal>,
}

/// A signal as a file names it.
#[derive(Clone, Debug)]
pub struct NamedSignal {
    /// What it is called: in its message there is no other of this name.
    pub name: Name,
    /// Where it stands and what it means.
    pub signal: Signal,
    /// Whom it concerns: places in [`Dbc::nodes`], each once.
    pub receivers: Vec<usize>,
}

impl Dbc {
    /// Of a bus with these devices.
    #[must_use]
    pub fn new(bus: &str, devices: &[Node]) -> Self {
        let mut names = Names::default();
        let robot = (names.name(ROBOT), "the program of this robot".to_owned());
        let device = |node: &Node| (names.name(&node.label), node.comment.clone());
        let nodes: Vec<_> = std::iter::once(robot).chain(devices.iter().map(device)).collect();

        // In the order of numbers, extended ones last.
        let mut by_id: BTreeMap<u32, Vec<(usize, &Message)>> = BTreeMap::new();
        for (place, device) in (1..).zip(devices) {
            for message in &device.messages {
                by_id.entry(number(message.id)).or_default().push((place, message));
            }
        }
        let mut left_out = Vec::new();
        for line in devices.iter().flat_map(|device| device.not_in_dbc) {
            if !left_out.iter().any(|known| known == line) {
                left_out.push((*line).to_owned());
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

/// An identifier as the file writes it: extended ones with bit 31.
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
    // At least one has the identifier: that is how it was found.
    let &(first, message) = &messages[0];
    let is_shared = messages.iter().any(|(place, _)| *place != first);
    let label = |place: usize| &nodes[place].0.long;
    let name = if is_shared {
        // Each sort of device once: "DJI_COMMAND_200".
        let mut parts: Vec<&str> = messages.iter().map(|(_, message)| message.name).collect();
        parts.dedup();
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
        for signal in message.signals {
            if let Some(same) = frame.signals.iter_mut().find(|known| known.signal == *signal) {
                add(&mut same.receivers, receiver);
                continue;
            }
            if let Some(in_the_way) =
                frame.signals.iter().find(|known| clash(&known.signal, signal))
            {
                left_out.push(format!(
                    "{}, {} of {}: its bits are {} already",
                    frame.name.long,
                    signal.name,
                    label(place),
                    in_the_way.name.long
                ));
                continue;
            }
            // What others have at the same place is nobody's own.
            let has_it = |other: &Message| other.signals.contains(signal);
            let is_common = messages.iter().filter(|(_, other)| has_it(other)).count() > 1;
            let name = if is_shared && !is_common {
                signal_names.name(&format!("{}_{}", label(place), signal.name))
            } else {
                signal_names.name(signal.name)
            };
            frame.signals.push(NamedSignal { name, signal: *signal, receivers: vec![receiver] });
        }
    }
    frame
}

fn add(places: &mut Vec<usize>, place: usize) {
    if !places.contains(&place) {
        places.push(place);
    }
}

/// Whether a file cannot have both: they share bits in the same frame, or both say which others
/// are there.
fn clash(one: &Signal, other: &Signal) -> bool {
    let never_together =
        matches!((one.presence, other.presence), (Presence::If(a), Presence::If(b)) if a != b);
    let are_switches = (one.presence, other.presence) == (Presence::Switch, Presence::Switch);
    are_switches || !never_together && bits(one) & bits(other) != 0
}

/// The bits it takes, bit 0 of byte 0 first.
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
