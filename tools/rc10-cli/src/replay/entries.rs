//! The entries of a record, as [`rc10_motor::record`] writes them.

use rc10_motor::record::{
    ARM, BYTES, COMMAND, FAILED, FIRST_LINE, FRAME, HEALTH, KEYFRAME, LOST, OUTGOING, POLL,
    RECOVER, REQUEST, SENT, START, STATE, TICK, TOOK,
};

use crate::robot::description::Description;
use crate::robot::motor::Place as On;

/// An entry of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry<'w> {
    pub(crate) kind: u8,
    pub(crate) place: u8,
    /// The byte that depends on the kind.
    pub(crate) more: u8,
    pub(crate) words: &'w [u32],
}

impl Entry<'_> {
    /// Whether it has a kind that there is, and as many words as belong to it.
    pub(crate) fn is_well_formed(&self) -> bool {
        let is_line = self.place >= FIRST_LINE;
        let words = match self.kind {
            START => 3..=3,
            TICK => 2..=2,
            LOST => 1..=1,
            FRAME if !is_line => 4..=4,
            SENT | OUTGOING if !is_line => 3..=3,
            TOOK if !is_line => 1..=1,
            ARM | RECOVER if !is_line => 0..=0,
            FAILED if is_line => 0..=0,
            POLL | BYTES if is_line => 1..=255,
            HEALTH if !is_line => 1..=255,
            COMMAND | REQUEST | STATE | KEYFRAME => 1..=255,
            _ => return false,
        };
        words.contains(&self.words.len())
    }

    /// A word; 0 behind the end.
    pub(crate) fn word(&self, at: usize) -> u32 {
        self.words.get(at).copied().unwrap_or_default()
    }

    /// The number in two words.
    pub(crate) fn long(&self, at: usize) -> u64 {
        u64::from(self.word(at)) | u64::from(self.word(at + 1)) << 32
    }

    /// The bytes of its words from one on.
    pub(crate) fn bytes(&self, from: usize) -> Vec<u8> {
        self.words.iter().skip(from).flat_map(|word| word.to_le_bytes()).collect()
    }
}

/// The entries of a record; ends early where it is cut off.
pub(crate) fn entries(words: &[u32]) -> impl Iterator<Item = Entry<'_>> {
    let mut rest = words;
    std::iter::from_fn(move || {
        let (head, behind) = rest.split_first()?;
        let [kind, place, length, more] = head.to_le_bytes();
        let (words, behind) = behind.split_at_checked(length.into())?;
        rest = behind;
        Some(Entry { kind, place, more, words })
    })
}

/// A place of a record, as the table has it.
fn on(place: u8) -> On {
    match place.checked_sub(FIRST_LINE) {
        Some(line) => On::Line(line + 1),
        None => On::Bus(place + 1),
    }
}

/// The label of a motor of a place.
pub(crate) fn label(robot: &Description, place: u8, motor: u8) -> Option<&'static str> {
    let mut motors = robot.motors.iter().filter(|it| it.on == on(place));
    motors.nth(motor.into()).map(|it| it.label)
}

/// The name of a place.
pub(crate) fn name_of(place: u8) -> String {
    on(place).to_string()
}
