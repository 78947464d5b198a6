//! Commands: values that a PC gives to the channels that a robot leaves to it, as raw words.
//!
//! | bytes | content |
//! |---|---|
//! | 0 | [`COMMAND`], which no [`Ask`](crate::Ask) begins with |
//! | 1 | [`LAYOUT`]: the version of this table |
//! | 2, 3 | the number of the command, for its answer: only a refusal is answered |
//! | 4 .. 7 | the [`Declaration`] of the robot that is meant |
//! | 8 .. 15 | the newest time that the robot told, µs since its power-on |
//! | 16, 17 | the age of the command when it was sent, ms |
//! | 18 | the first channel |
//! | 19 | 0 |
//! | 20 .. 23 | who commands: differs between programs, and after a restart of one |
//! | 24 .. 27 | counts the commands of who commands: an older one is refused |
//! | from 28 | an `f32` for each channel from the first one on |
//!
//! All little endian.

use crate::Declaration;

/// The first byte of a command.
pub const COMMAND: u8 = 0x7F;
/// The version of the table above.
pub const LAYOUT: u8 = 1;
/// Bytes before the values.
pub const HEAD: usize = 28;
/// Most values in a command.
pub const VALUES: usize = (crate::frame::ASK - HEAD) / 4;
/// A command that is older is never executed, µs.
pub const COMMAND_AGE: u64 = 50_000;

/// A command before its values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// The number of the command.
    pub id: u16,
    /// The robot that is meant.
    pub declaration: Declaration,
    /// The newest time that the robot told, µs.
    pub heard: u64,
    /// Its age when it was sent, ms.
    pub age: u16,
    /// The first channel.
    pub first: u8,
    /// Who commands.
    pub who: u32,
    /// Counts the commands of who commands.
    pub count: u32,
}

impl Head {
    /// The bytes of the head.
    #[must_use]
    pub fn bytes(self) -> [u8; HEAD] {
        let mut bytes = [0; HEAD];
        [bytes[0], bytes[1], bytes[18]] = [COMMAND, LAYOUT, self.first];
        bytes[2..4].copy_from_slice(&self.id.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.declaration.0.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.heard.to_le_bytes());
        bytes[16..18].copy_from_slice(&self.age.to_le_bytes());
        bytes[20..24].copy_from_slice(&self.who.to_le_bytes());
        bytes[24..].copy_from_slice(&self.count.to_le_bytes());
        bytes
    }

    /// A command of a frame's body, with the bytes of its values.
    ///
    /// # Errors
    /// With the number of the command, as far as it is told, for one of another version or length.
    pub fn of(body: &[u8]) -> Result<(Self, &[[u8; 4]]), u16> {
        let id = u16::from_le_bytes([at(body, 2), at(body, 3)]);
        let Some((head, values)) = body.split_first_chunk::<HEAD>() else { return Err(id) };
        let (words, rest) = values.as_chunks::<4>();
        if head[..2] != [COMMAND, LAYOUT] || !rest.is_empty() {
            return Err(id);
        }
        let word = |it| u32::from_le_bytes([it, it + 1, it + 2, it + 3].map(|it| at(head, it)));
        let heard = u64::from(word(8)) | u64::from(word(12)) << 32;
        let (declaration, who, count) = (Declaration(word(4)), word(20), word(24));
        let age = u16::from_le_bytes([head[16], head[17]]);
        Ok((Self { id, declaration, heard, age, first: head[18], who, count }, words))
    }
}

fn at(bytes: &[u8], at: usize) -> u8 {
    bytes.get(at).copied().unwrap_or_default()
}
