//! A test's own knowledge of a protocol: how its frames are made, what they say, and where one
//! begins. The fuzz targets know it from here, too.

use std::fmt::Debug;

use rc10_module::Protocol;

/// A protocol on a wire, written from its description, without a look at its parser.
pub trait Wire: Copy {
    /// The parser under test.
    type Protocol: Protocol<Message: Debug>;

    /// How long a byte takes, ns.
    const BYTE_NS: u64;
    /// Bytes that its frames begin with, for garbage that nearly is one.
    const HEADER: &'static [u8];
    /// The guard against damage.
    const GUARD: Guard;
    /// Silence between two frames, µs: at least, at most.
    const GAP: (u64, u64) = (0, 10_000);

    /// The parser.
    fn protocol(self) -> Self::Protocol;

    /// A good frame; what it says comes from the source.
    fn frame(self, source: &mut Source<'_>) -> Vec<u8>;

    /// How long the good frame is that begins with the first of these bytes, if one does.
    fn frame_at(self, bytes: &[u8]) -> Option<usize>;

    /// Where the frames are in what came without a fault.
    fn found(self, heard: &Segment) -> Vec<Place> {
        searched(self, &heard.bytes)
    }

    /// How many bytes good frames took, of which the parser said so; `frames` were taken.
    fn in_frames(self, said: u32, frames: u32) -> u32 {
        let _ = frames;
        said
    }

    /// The numbers that a good frame says, if it says anything of interest.
    fn says(self, frame: &[u8]) -> Option<Vec<f64>>;

    /// The same numbers, from a message.
    fn told(self, message: &<Self::Protocol as Protocol>::Message) -> Vec<f64>;
}

/// The guard against damage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guard {
    /// A checksum, which does not go over the bytes at these places: what they say may be changed
    /// unseen.
    Checksum { not_over: &'static [usize] },
    /// Fixed bytes and ranges of values only.
    Shape,
}

/// Bytes to make frames of; zeros when there are no more.
#[derive(Debug)]
pub struct Source<'b>(pub &'b [u8]);

impl Source<'_> {
    pub fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    pub fn bytes<const N: usize>(&mut self) -> [u8; N] {
        std::array::from_fn(|_| self.byte())
    }

    pub fn word(&mut self) -> u16 {
        u16::from_le_bytes(self.bytes())
    }

    /// A number of this range, both ends included.
    pub fn between(&mut self, least: u16, most: u16) -> u16 {
        least + self.word() % (most - least + 1)
    }

    /// Any float that is no further from zero than this.
    pub fn float(&mut self, most: f32) -> f32 {
        let any = f32::from_le_bytes(self.bytes());
        if any.abs() <= most { any } else { f32::from(self.word()) / 65536.0 * most }
    }
}

/// `width` bits from bit `at` on, counted from the lowest bit of the first byte.
pub fn bits(bytes: &[u8], at: usize, width: usize) -> u16 {
    (0..width).rev().fold(0, |value, bit| {
        let at = at + bit;
        value << 1 | u16::from(bytes[at / 8] >> (at % 8) & 1)
    })
}

/// Puts them there; they were zero.
pub fn set_bits(bytes: &mut [u8], at: usize, width: usize, value: u16) {
    for bit in 0..width {
        let to = at + bit;
        bytes[to / 8] |= ((value >> bit & 1) as u8) << (to % 8);
    }
}

/// All of them.
pub fn numbers(parts: &[&[u16]]) -> Vec<f64> {
    parts.concat().into_iter().map(f64::from).collect()
}

/// The low byte of the sum.
pub fn sum(bytes: &[u8]) -> u8 {
    (bytes.iter().map(|byte| u32::from(*byte)).sum::<u32>() & 0xFF) as u8
}

/// A little-endian number that begins here.
pub fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

/// One of four bytes.
pub fn double_word(bytes: &[u8], at: usize) -> u32 {
    u32::from(word(bytes, at)) | u32::from(word(bytes, at + 2)) << 16
}

/// CRC bit by bit, without the tables of the parsers: lowest bit first.
pub fn crc_reflected(bytes: &[u8], start: u16, polynomial: u16) -> u16 {
    bytes.iter().fold(start, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte), |crc, _| {
            if crc & 1 == 1 { crc >> 1 ^ polynomial } else { crc >> 1 }
        })
    })
}

/// The same, highest bit first.
pub fn crc(bytes: &[u8], polynomial: u16) -> u16 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| {
            if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ polynomial }
        })
    })
}

/// A good frame among other bytes: where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub start: usize,
    pub end: usize,
}

/// The bytes between two faults or silences.
#[derive(Clone, Debug)]
pub struct Segment {
    pub bytes: Vec<u8>,
    /// The frames in it that came whole.
    pub whole: Vec<Place>,
    /// Whether they begin with a fault, and no silence behind it.
    pub after_fault: bool,
    /// Whether they end with a fault, and no silence before it.
    pub before_fault: bool,
}

/// The messages that a parser with all the time and memory in the world finds: at each place a good
/// frame, or a byte to be skipped.
pub fn searched<W: Wire>(wire: W, stream: &[u8]) -> Vec<Place> {
    let (mut found, mut start) = (Vec::new(), 0);
    while start < stream.len() {
        match wire.frame_at(&stream[start..]) {
            Some(length) => {
                found.push(Place { start, end: start + length });
                start += length;
            }
            None => start += 1,
        }
    }
    found
}

/// The messages of these frames.
pub fn said<W: Wire>(wire: W, stream: &[u8], places: &[Place]) -> Vec<Vec<f64>> {
    places.iter().filter_map(|place| wire.says(&stream[place.start..place.end])).collect()
}

/// Whether two messages say the same, as exactly as `f32` can.
pub fn same(one: &[f64], other: &[f64]) -> bool {
    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-5 * b.abs().max(1.0);
    one.len() == other.len() && one.iter().zip(other).all(near)
}
