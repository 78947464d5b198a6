//! The pages of the boards against `firmware/board`: the same pins, peripherals and DMA streams, and of the team's
//! board the programs that use them.

use std::collections::{BTreeMap, BTreeSet};

/// A board: its page, its code, and how many pins and streams it has at least.
struct Board {
    page: &'static str,
    code: &'static str,
    pins: usize,
    streams: usize,
}

const OURS: Board = Board {
    page: include_str!("../docs/wiring.md"),
    code: include_str!("../firmware/board/src/h723zg.rs"),
    pins: 40,
    streams: 16,
};
const BOARDS: [Board; 2] = [
    OURS,
    Board {
        page: include_str!("../docs/dm-mc02.md"),
        code: include_str!("../firmware/board/src/dm_mc02.rs"),
        pins: 38,
        streams: 14,
    },
];
const SELF_TEST: &str = include_str!("../firmware/selftest/src/main.rs");
/// The program of a robot.
const PROGRAM: &str = concat!(
    include_str!("../firmware/board/src/program.rs"),
    include_str!("../firmware/board/src/parts.rs")
);
const USB: &str = include_str!("../firmware/usb/src/main.rs");
/// The signals of each pin of the emulated chip, by alternate function.
const PINS: &str = include_str!("../tools/rc10-emu/src/peripherals/pins.rs");

/// A line of the table, or what the code says of a pin.
#[derive(Debug, PartialEq)]
struct Pin<'t> {
    part: &'t str,
    peripheral: &'t str,
}

/// The page's table, by pin: part, signal, alternate function, streams, source, users if it says them.
fn table(board: &Board) -> BTreeMap<&'static str, [&'static str; 6]> {
    let mut table = BTreeMap::new();
    let (_, lines) = board.page.split_once("| part | pin |").unwrap();
    for line in lines.lines().skip(2).take_while(|line| line.starts_with("| `")) {
        let cells: Vec<_> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [part, pin, signal, function, streams, source, ref users @ ..] = cells[..] else {
            panic!("a line of other columns: {line}");
        };
        let users = users.first().copied().unwrap_or_default();
        let part = part.trim_matches('`');
        let before = table.insert(pin, [part, signal, function, streams, source, users]);
        assert_eq!(before, None, "{pin} stands there twice");
    }
    table
}

/// The parts of `Board::new`: each part and the names behind `p.` in it, in their order.
fn parts(board: &Board) -> Vec<(&'static str, Vec<&'static str>)> {
    let code = board.code.split_once("pub fn new(p: Peripherals)").unwrap().1;
    let code = code.split_once("\n    }\n").unwrap().0;
    let mut parts: Vec<(&str, Vec<&str>)> = Vec::new();
    for line in code.lines() {
        // A field of `Board` is indented by three steps.
        let field =
            line.strip_prefix("            ").filter(|line| !line.starts_with([' ', '/', '.']));
        if let Some((part, _)) = field.and_then(|line| line.split_once(':')) {
            parts.push((part, Vec::new()));
        }
        for name in line.split("p.").skip(1) {
            let end =
                name.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(name.len());
            parts.last_mut().unwrap().1.push(&name[..end]);
        }
    }
    parts
}

fn is_pin(name: &str) -> bool {
    let [b'P', b'A'..=b'K', number @ ..] = name.as_bytes() else { return false };
    !number.is_empty() && number.iter().all(u8::is_ascii_digit)
}

#[test]
fn every_pin_stands_in_the_table_and_the_other_way_round() {
    for board in &BOARDS {
        every_pin_stands_in_the_table_of(board);
    }
}

fn every_pin_stands_in_the_table_of(board: &Board) {
    let mut wired = BTreeMap::new();
    for (part, names) in parts(board) {
        for (at, name) in names.iter().enumerate().filter(|(_, name)| is_pin(name)) {
            // An interrupt line stands behind its pin, any other peripheral before.
            let line = names.get(at + 1).filter(|next| next.starts_with("EXTI"));
            let before = names[..at].iter().rfind(|name| !is_pin(name) && !name.starts_with("DMA"));
            // An output of its own has none.
            let peripheral = line.or(before).unwrap_or(&"GPIO");
            let again = wired.insert(*name, Pin { part, peripheral });
            assert_eq!(again, None, "{name} is used twice");
        }
    }
    assert!(wired.len() >= board.pins, "only {} pins found", wired.len());
    let told: BTreeMap<_, _> = table(board)
        .into_iter()
        .map(|(pin, [part, signal, ..])| {
            (pin, Pin { part, peripheral: signal.split(' ').next().unwrap() })
        })
        .collect();
    for (pin, wired) in &wired {
        assert_eq!(told.get(pin), Some(wired), "what page and code say of {pin}");
    }
    for pin in told.keys() {
        assert!(wired.contains_key(pin), "{pin} of the page is not in the code");
    }
}

#[test]
fn streams_stand_at_the_pins_of_their_part() {
    for board in &BOARDS {
        streams_stand_at_the_pins_of(board);
    }
}

fn streams_stand_at_the_pins_of(board: &Board) {
    let is_stream = |name: &&str| name.starts_with("DMA");
    let told = table(board);
    let mut all = BTreeSet::new();
    for (part, names) in parts(board) {
        let streams: BTreeSet<_> = names.into_iter().filter(is_stream).collect();
        let of_part = told.values().filter(|line| line[0] == part);
        let said: Vec<_> = of_part.flat_map(|line| line[3].split(' ')).filter(is_stream).collect();
        assert_eq!(said.iter().copied().collect::<BTreeSet<_>>(), streams, "streams of {part}");
        for stream in said {
            assert!(all.insert(stream), "{stream} stands there twice");
        }
    }
    assert_eq!(all.len(), board.streams);
}

/// As the emulator has it, whose table is made of the chip's data.
#[test]
fn alternate_functions_are_those_of_the_chip() {
    let mut checked = 0;
    let tables = BOARDS.iter().flat_map(table);
    for (pin, [_, signal, function, ..]) in tables {
        let (peripheral, what) = signal.split_once(' ').unwrap();
        let kind = match peripheral.trim_end_matches(char::is_numeric) {
            "FDCAN" if what != "standby" => "Can",
            "USART" | "UART" => "Serial",
            "TIM" => "Timer",
            "SPI" if !what.starts_with("select") => "Spi",
            "I" | "I2C" => "I2c",
            "OCTOSPI" => "Octo",
            _ => {
                assert_eq!(function, "–", "{pin}, {signal}");
                continue;
            }
        };
        let place = format!("{}:{function}", &pin[1..]);
        let mut signals = PINS.split("Signal::").filter(|text| text.starts_with(kind));
        let is_known = signals.any(|text| text.split(['"', ' ']).any(|word| word == place));
        assert!(is_known, "{pin} is not {signal} by alternate function {function}");
        checked += 1;
    }
    assert!(checked >= 62, "{checked}");
}

/// The inputs and outputs of the emulated boards, in the order of the code.
#[test]
fn the_emulated_boards_have_the_same_ports() {
    for (board, emulated) in BOARDS.iter().zip(rc10_emu::Board::ALL) {
        let parts = parts(board);
        let of = |what: &str| -> Vec<String> {
            let names = parts.iter().filter(|(part, _)| part.starts_with(what));
            names
                .flat_map(|(_, names)| names)
                .filter(|name| is_pin(name))
                .map(|it| (*it).into())
                .collect()
        };
        let name = |(port, pin): &(char, usize)| format!("P{port}{pin}");
        let names = |pins: &[(char, usize)]| pins.iter().map(name).collect::<Vec<_>>();
        assert_eq!(of("switches"), names(&emulated.switches), "{}", emulated.name);
        assert_eq!(of("servo_"), names(&emulated.servos), "{}", emulated.name);
        assert_eq!(of("voltage_"), names(emulated.voltages), "{}", emulated.name);
        assert_eq!(of("pulses"), names(&[emulated.pulses]), "{}", emulated.name);
    }
}

#[test]
fn who_uses_a_part_is_true() {
    for (pin, [part, .., source, users]) in table(&OURS) {
        let takes = |code: &str| {
            // By itself, or by a macro that starts it.
            let by_macro = [format!("board, {part}"), format!("start_{part}!(board")];
            by_macro.iter().chain([&format!("board.{part}")]).any(|part| {
                code.match_indices(part).any(|(at, _)| {
                    let behind = code[at + part.len()..].chars().next();
                    behind.is_some_and(|next| !next.is_alphanumeric() && next != '_')
                })
            })
        };
        // A robot says which of these it has.
        let by_name = ["servo_", "voltage_"].iter().any(|name| part.starts_with(name));
        let programs =
            [("R", takes(PROGRAM) || by_name), ("S", takes(SELF_TEST)), ("U", takes(USB))];
        let takers = programs.into_iter().filter(|(_, takes)| *takes).map(|(letter, _)| letter);
        let expected = takers.collect::<Vec<_>>().join(" ");
        assert_eq!(users, expected, "who uses `{part}` ({pin})");
        assert!(matches!(source, "T" | "P"), "{pin}: {source}");
    }
}
