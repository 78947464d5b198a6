//! Samples: the values of a group of signals at one time, as raw words.
//!
//! | bytes | content |
//! |---|---|
//! | 0 | 0, which no [`Tell`](crate::Tell) begins with |
//! | 1 | the group |
//! | 2, 3 | counts the group's samples: what is missing was lost on the way |
//! | 4 .. 7 | counts the group's samples that were not taken, because those before were not sent yet |
//! | 8 .. 15 | time since power-on, µs |
//! | from 16 | an `f32` for each signal of the group, in the order of their numbers; NaN: no value |
//!
//! All little endian.

/// Bytes before the values.
pub const HEAD: usize = 16;

/// Most signals in one sample.
pub const VALUES: usize = (crate::frame::BODY - HEAD) / 4;

/// A sample before its values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// The group.
    pub group: u8,
    /// Counts the group's samples.
    pub count: u16,
    /// Counts those that were not taken.
    pub skipped: u32,
    /// Time since power-on, µs.
    pub at: u64,
}

impl Head {
    /// The bytes of the head.
    #[must_use]
    pub fn bytes(self) -> [u8; HEAD] {
        let mut bytes = [0; HEAD];
        bytes[1] = self.group;
        bytes[2..4].copy_from_slice(&self.count.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.skipped.to_le_bytes());
        bytes[8..].copy_from_slice(&self.at.to_le_bytes());
        bytes
    }

    /// A sample of a frame's body, with the bytes of its values; `None` for another body.
    #[must_use]
    pub fn of(body: &[u8]) -> Option<(Self, &[[u8; 4]])> {
        let (head, values) = body.split_first_chunk::<HEAD>()?;
        let [0, group, a, b, c, d, e, f, at @ ..] = *head else { return None };
        let (words, rest) = values.as_chunks::<4>();
        let head = Self {
            group,
            count: u16::from_le_bytes([a, b]),
            skipped: u32::from_le_bytes([c, d, e, f]),
            at: u64::from_le_bytes(at),
        };
        rest.is_empty().then_some((head, words))
    }
}
