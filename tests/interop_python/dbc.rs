//! `cantools` loads each DBC file, finds in it what we put there, and decodes frames to our values.

use rc10_cli::Simulated as _;
use std::fmt::Write;
use std::fs;
use std::process::Command;

use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_cli::formats::dbc::{Dbc, Frame, NamedSignal};
use rc10_cli::formats::dbc::{Node, of_bus};
use rc10_motor::signals::{ByteOrder, Kind, Message, Presence, Signal};
use serde_json::{Map, Value, json};

use super::scratch::Scratch;
use super::{must_succeed, others, python, script};
use rc10_sim::Random;

const FRAMES_PER_BUS: usize = 10_000;

#[test]
fn cantools_decodes_every_frame_to_our_values() {
    let Some(python) = python() else { return };
    let folder = Scratch::new("dbc");
    let mut lines = String::new();
    let mut files = Vec::new();
    let robots = [("team", team::Robot::description()), ("mixed", mixed::Robot::description())];
    for (robot, description) in &robots {
        for bus in 1..=description.buses {
            files.push((format!("{robot}{bus}"), of_bus(description, bus)));
        }
    }
    files.push(("others".to_owned(), Dbc::new("others", &others::nodes())));
    files.push(("shapes".to_owned(), Dbc::new("every shape", &every_shape())));
    for (name, dbc) in &files {
        fs::write(folder.join(format!("{name}.dbc")), dbc.to_bytes()).unwrap();
        for frame in &dbc.frames {
            writeln!(lines, "{}", message(name, dbc, frame)).unwrap();
        }
        let mut random = Random::new(1);
        for _ in 0..FRAMES_PER_BUS {
            let frame = &dbc.frames[random.index(dbc.frames.len())];
            writeln!(lines, "{}", values(name, frame, &mut random)).unwrap();
        }
    }
    let cases = folder.join("cases.jsonl");
    fs::write(&cases, lines).unwrap();
    let script = script("decode_with_cantools.py");
    let printed = must_succeed(Command::new(python).arg(script).arg(&*folder).arg(&cases));
    print!("{printed}");
    let compared = printed.matches(&format!("{FRAMES_PER_BUS} frames")).count();
    assert_eq!(compared, files.len(), "{printed}");
}

/// Every signal of every motor of the robot is in its bus's file, at its place, under its label.
#[test]
fn nothing_of_the_robot_is_left_out() {
    let robot = team::Robot::description();
    for bus in 1..=robot.buses {
        let dbc = of_bus(&robot, bus);
        for motor in robot.on_bus(bus) {
            let label = motor.label.replace(' ', "_");
            assert_eq!(motor.messages().len(), 3);
            for message in motor.messages() {
                let frame = dbc.frames.iter().find(|frame| frame.id == message.id).unwrap();
                let own = frame.name.long == format!("{label}_{}", message.name);
                assert!(own || frame.name.long == message.name, "{}", frame.name.long);
                for signal in message.signals {
                    let name = if own {
                        signal.name.to_owned()
                    } else {
                        format!("{label}_{}", signal.name)
                    };
                    let there = frame.signals.iter().find(|there| there.name.long == name);
                    assert_eq!(there.unwrap().signal, *signal);
                }
            }
        }
        assert!(dbc.left_out.iter().all(|line| line.starts_with("DJI: ")), "{:?}", dbc.left_out);
    }
}

/// Shapes that DJI's frames do not have: floats, both orders at odd places, offsets, extended
/// identifiers, switches, names of values, feedback of two devices with one identifier, long names, 64 bits.
fn every_shape() -> [Node; 3] {
    const FAULTS: &[(u32, &str)] =
        &[(0, "none"), (1, "\"too\" hot\\cold"), (0xD, "no connection, °C")];
    const DEVICE: Signal = Signal::new("DEVICE", ByteOrder::Little, 0, 4).when(Presence::Switch);
    const fn of(device: u32) -> [Signal; 5] {
        [
            DEVICE,
            Signal::new("FAULT", ByteOrder::Little, 4, 4).named(FAULTS).when(Presence::If(device)),
            Signal::big("POSITION", 1, 2)
                .scaled(25.0 / 65535.0, "rad")
                .offset(-12.5)
                .when(Presence::If(device)),
            Signal::new("SPEED", ByteOrder::Big, 31, 12)
                .scaled(60.0 / 4095.0, "rad/s")
                .offset(-30.0)
                .when(Presence::If(device)),
            Signal::new("TORQUE", ByteOrder::Big, 35, 12)
                .signed()
                .scaled(0.1, "N m")
                .when(Presence::If(device)),
        ]
    }
    const ONE: &[Signal] = &of(1);
    const TWO: &[Signal] = &of(2);
    const OTHER: &[Signal] = &[
        Signal::little("A_FLOAT", 0, 4).float().scaled(2.0, "V"),
        Signal::new("ODD_LITTLE", ByteOrder::Little, 37, 11).signed().scaled(-0.25, "A"),
        Signal::new("A_NAME_THAT_IS_LONGER_THAN_ANY_DBC_ALLOWS", ByteOrder::Big, 55, 3),
    ];
    const WHOLE: &[Signal] = &[Signal::little("EVERYTHING", 0, 8)];
    const BIG_FLOAT: &[Signal] = &[Signal::big("B_FLOAT", 2, 4).float()];
    const SHORT: &[Signal] = &[Signal::new("BIT", ByteOrder::Little, 23, 1).named(&[(1, "on")])];
    let standard = |id| Id::from(StandardId::new(id).unwrap());
    let extended = |id| Id::from(ExtendedId::new(id).unwrap());
    let message = Message::new;
    let node = |label: &str, messages: Vec<Message>| Node {
        label: label.to_owned(),
        comment: "\"quoted\", in °C and 中文".to_owned(),
        messages,
        not_in_dbc: &["what it thinks"],
    };
    [
        node(
            "arm",
            vec![
                message("SHARED", standard(0), 8, true, ONE),
                message(
                    "A_MESSAGE_WITH_A_NAME_LONGER_THAN_32",
                    extended(0x1234_5678),
                    7,
                    true,
                    OTHER,
                ),
                message("TO_IT", extended(0x201), 3, false, SHORT),
            ],
        ),
        node(
            "fore arm",
            vec![
                message("SHARED", standard(0), 8, true, TWO),
                message("TO_IT", standard(0x201), 8, false, WHOLE),
            ],
        ),
        node("3rd", vec![message("STATUS", extended(0x1FFF_FFFF), 6, true, BIG_FLOAT)]),
    ]
}

/// Expected text of a message in the file.
fn message(bus: &str, dbc: &Dbc, frame: &Frame) -> Value {
    let nodes = |places: &[usize]| {
        let mut names: Vec<_> =
            places.iter().map(|&place| dbc.nodes[place].0.long.clone()).collect();
        names.sort();
        names
    };
    // As the file can write them.
    let text = |text: &str| text.replace('"', "'").replace('\\', "/");
    let signals: Map<_, _> = frame
        .signals
        .iter()
        .map(|NamedSignal { name, signal, receivers }| {
            let choices: Map<_, _> = signal
                .values()
                .map(|(raw, meaning)| (raw.to_string(), text(meaning).into()))
                .collect();
            let present_if = match signal.presence {
                Presence::If(value) => vec![value],
                _ => Vec::new(),
            };
            let about = json!({
                "unit": signal.unit,
                "receivers": nodes(receivers),
                "choices": choices,
                "float": signal.kind == Kind::Float,
                "switch": signal.presence == Presence::Switch,
                "present_if": present_if,
            });
            (name.long.clone(), about)
        })
        .collect();
    let (id, extended) = number(frame.id);
    json!({
        "bus": bus, "message": frame.name.long, "id": id, "extended": extended,
        "length": frame.len, "senders": nodes(&frame.senders), "signals": signals,
    })
}

/// A random frame with its values.
fn values(bus: &str, frame: &Frame, random: &mut Random) -> Value {
    let mut data: Vec<_> = (0..frame.len).map(|_| random.bits().to_le_bytes()[0]).collect();
    let presences = || frame.signals.iter().map(|signal| signal.signal.presence);
    let switch = frame.signals.iter().find(|signal| signal.signal.presence == Presence::Switch);
    if let Some(switch) = switch {
        let known: Vec<_> = presences()
            .filter_map(
                |presence| if let Presence::If(value) = presence { Some(value) } else { None },
            )
            .collect();
        set(&switch.signal, known[random.index(known.len())].into(), &mut data);
    }
    let chosen = switch.and_then(|switch| switch.signal.raw(&data));
    let is_there = |signal: &&NamedSignal| match signal.signal.presence {
        Presence::Always | Presence::Switch => true,
        Presence::If(value) => chosen == Some(value.into()),
    };
    let values: Map<_, _> = frame
        .signals
        .iter()
        .filter(is_there)
        .map(|NamedSignal { name, signal, .. }| {
            let value = signal.physical(&data).unwrap();
            // JSON has no word for the others.
            let value = if value.is_finite() { json!(value) } else { json!(value.to_string()) };
            (name.long.clone(), value)
        })
        .collect();
    let hex = data.iter().fold(String::new(), |hex, byte| hex + &format!("{byte:02x}"));
    let (id, extended) = number(frame.id);
    json!({ "bus": bus, "id": id, "extended": extended, "data": hex, "values": values })
}

/// Writes a little-endian signal: all switches here are.
fn set(signal: &Signal, raw: u64, data: &mut [u8]) {
    assert_eq!(signal.order, ByteOrder::Little);
    for index in 0..signal.bits {
        let bit = signal.start + index;
        let (byte, mask) = (usize::from(bit / 8), 1 << (bit % 8));
        if raw >> index & 1 == 1 { data[byte] |= mask } else { data[byte] &= !mask }
    }
}

fn number(id: Id) -> (u32, bool) {
    match id {
        Id::Standard(id) => (id.as_raw().into(), false),
        Id::Extended(id) => (id.as_raw(), true),
    }
}
