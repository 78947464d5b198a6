//! The first difference between a record and its replay, in words.

use rc10_can::CanFrame;
use rc10_motor::record::BUS;
use rc10_time::Micros;

use super::entries::{label, name_of};
use crate::decode::print::said;
use crate::recording::sample::seconds;
use crate::robot::description::Description;

/// A difference, of a tick.
pub(crate) struct Difference {
    pub(crate) at: Micros,
    /// Number of the tick.
    pub(crate) tick: u32,
    pub(crate) place: u8,
    pub(crate) found: Vec<What>,
    /// Parts whose state was recorded after it, with the fields that differ there.
    explained: Vec<(u8, Vec<Field>)>,
}

/// A field of a state: its name, the record's value, and the replay's.
pub(crate) type Field = (String, String, String);

/// What differs.
pub(crate) enum What {
    /// A frame: the record's, and the replay's.
    Frame(CanFrame, CanFrame),
    /// A frame of the record that the replay does not send.
    Missing(CanFrame),
    /// A command on a line: the record's, and the replay's; empty for none.
    Command(Vec<u8>, Vec<u8>),
    /// The record does not say the state.
    Untold,
    /// The state of these motors, or of the bus alone.
    State(Vec<u8>),
}

/// Fields that are told.
const MOST: usize = 6;

impl Difference {
    pub(crate) const fn new(at: Micros, tick: u32, place: u8, found: Vec<What>) -> Self {
        Self { at, tick, place, found, explained: Vec::new() }
    }

    /// Adds a state that was recorded after it.
    pub(crate) fn explain(&mut self, part: u8, fields: Vec<Field>) {
        if self.explained.iter().all(|(known, _)| *known != part) {
            self.explained.push((part, fields));
        }
    }

    /// The parts whose state differs.
    fn parts(&self) -> impl Iterator<Item = u8> {
        self.found
            .iter()
            .flat_map(|what| match what {
                What::State(parts) => parts.as_slice(),
                _ => &[],
            })
            .copied()
    }

    /// Whether it is known in which fields it is.
    pub(crate) fn is_settled(&self) -> bool {
        self.parts().all(|part| self.explained.iter().any(|(known, _)| *known == part))
    }

    /// The lines that name it.
    pub(crate) fn lines(&self, robot: &Description) -> Vec<String> {
        let place = name_of(self.place);
        let of = |part: u8| {
            label(robot, self.place, part).map_or_else(|| place.clone(), |it| format!("`{it}`"))
        };
        let mut lines = vec![format!(
            "the first difference is at {} s, in tick {} of {place}:",
            seconds(self.at),
            self.tick
        )];
        let frame = |frame: &CanFrame| said(robot, self.place + 1, frame);
        for what in &self.found {
            lines.push(match what {
                What::Frame(theirs, own) => {
                    format!("  it sent    {}\n  here it is {}", frame(theirs), frame(own))
                }
                What::Missing(theirs) => format!("  it sent {}, and here nothing", frame(theirs)),
                What::Command(theirs, own) => {
                    let hex = |bytes: &[u8]| {
                        let all: Vec<_> = bytes.iter().map(|it| format!("{it:02X}")).collect();
                        if all.is_empty() { "nothing".to_owned() } else { all.join(" ") }
                    };
                    format!("  it sent    {}\n  here it is {}", hex(theirs), hex(own))
                }
                What::Untold => "  the record does not say the state after it".to_owned(),
                What::State(parts) if parts[..] == [BUS] => {
                    format!("  the state of {place} itself: its counters or its clock")
                }
                What::State(parts) => {
                    let names: Vec<_> = parts.iter().map(|part| of(*part)).collect();
                    format!("  the state of {}", names.join(", "))
                }
            });
        }
        for (part, fields) in &self.explained {
            for (name, theirs, own) in fields.iter().take(MOST) {
                lines.push(format!("  {} {name}: {theirs} in the record, {own} here", of(*part)));
            }
            if let more @ 1.. = fields.len().saturating_sub(MOST) {
                lines.push(format!("  {} and {more} fields more", of(*part)));
            }
        }
        lines
    }
}

/// The fields in which two states differ, as Debug shows them a field a line.
pub(crate) fn fields(theirs: &str, own: &str) -> Vec<Field> {
    let (theirs, own) = (named(theirs), named(own));
    let value = |all: &[(String, String)], name: &str| {
        all.iter().find(|it| it.0 == name).map_or_else(|| "nothing".to_owned(), |it| it.1.clone())
    };
    let names = theirs.iter().chain(&own).map(|it| &it.0);
    let mut fields: Vec<Field> = Vec::new();
    for name in names {
        let (a, b) = (value(&theirs, name), value(&own, name));
        if a != b && fields.iter().all(|it| it.0 != *name) {
            fields.push((name.clone(), a, b));
        }
    }
    fields
}

/// Each value with the names that lead to it.
fn named(text: &str) -> Vec<(String, String)> {
    let mut path: Vec<String> = Vec::new();
    let mut all = Vec::new();
    for line in text.lines() {
        let depth = (line.len() - line.trim_start().len()) / 4;
        let line = line.trim().trim_end_matches(',');
        path.truncate(depth);
        if line.is_empty() || [")", "}", "]"].contains(&line) {
            continue;
        }
        let (name, value) = line.split_once(": ").unwrap_or(("", line));
        let opens = value.ends_with(['(', '{', '[']);
        path.push(name.to_owned());
        if !opens {
            let names: Vec<_> = path.iter().filter(|it| !it.is_empty()).cloned().collect();
            let name = names.join(".");
            // What has no name of its own has a number.
            let number =
                all.iter().filter(|(it, _): &&(String, _)| it.split('[').next() == Some(&name));
            let name = match number.count() {
                0 => name,
                number => format!("{name}[{number}]"),
            };
            all.push((name, value.to_owned()));
        }
    }
    all
}
