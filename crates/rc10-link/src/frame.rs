//! Frames: a head of four bytes, a body, and its CRC.
//!
//! | bytes | content |
//! |---|---|
//! | 0 | [`BEGIN`], which is no character of a text |
//! | 1, 2 | length of the body, little endian: 1 ..= [`BODY`] |
//! | 3 | the exclusive or of the three before, and 0xFF |
//! | from 4 | the body |
//! | the last four | CRC-32 (ISO-HDLC) of the body, little endian |
//!
//! [`rc10_module::Stream`] finds them, whatever else is in a stream: a head that is none costs one byte,
//! and a damaged frame itself. There is no stuffing, which would cost a robot as many instructions for
//! each byte as all else.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use heapless::Vec;
use rc10_module::{Found, Protocol};
use serde::Serialize;

use crate::message::Ask;

/// The first byte of a frame.
pub const BEGIN: u8 = 0xE7;
/// Most bytes of a body.
pub const BODY: usize = 1024;
/// Most bytes of a body that a robot hears.
pub const ASK: usize = 160;
/// Bytes around a body.
pub const AROUND: usize = HEAD + TAIL;

const HEAD: usize = 4;
const TAIL: usize = 4;

/// A table of 16 KiB: four instructions a byte, where one of 1 KiB takes seven.
static CRC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

const fn head(length: u16) -> [u8; HEAD] {
    let [low, high] = length.to_le_bytes();
    [BEGIN, low, high, BEGIN ^ low ^ high ^ 0xFF]
}

/// A frame that is being written, of up to `N` bytes in all.
#[derive(Debug)]
pub struct Writer<const N: usize>(Vec<u8, N>);

impl<const N: usize> Default for Writer<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Writer<N> {
    /// Nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Begins a frame, and returns where its body goes.
    #[inline]
    pub fn begin(&mut self) -> &mut Vec<u8, N> {
        self.0.clear();
        let _ = self.0.extend_from_slice(&[0; HEAD]);
        &mut self.0
    }

    /// Ends it: all its bytes; none if there is no room for them.
    #[inline]
    pub fn end(&mut self) -> &[u8] {
        let body = self.0.get(HEAD..).unwrap_or_default();
        let crc = CRC.checksum(body).to_le_bytes();
        let Some(length) = u16::try_from(body.len()).ok().filter(|it| usize::from(*it) <= BODY)
        else {
            return &[];
        };
        if self.0.extend_from_slice(&crc).is_err() {
            return &[];
        }
        if let Some(place) = self.0.first_chunk_mut() {
            *place = head(length);
        }
        &self.0
    }

    /// A whole frame of a message; no bytes if there is no room for it.
    pub fn message(&mut self, message: &impl Serialize) -> &[u8] {
        let room = self.begin();
        // Written behind the head, into all the room that there is but for the CRC.
        if room.resize(N.saturating_sub(TAIL), 0).is_err() {
            return &[];
        }
        let written = postcard::to_slice(message, room.get_mut(HEAD..).unwrap_or_default());
        let Ok(length) = written.map(|bytes| bytes.len()) else { return &[] };
        room.truncate(HEAD + length);
        self.end()
    }
}

/// The body of a frame that begins with these bytes.
fn body(bytes: &[u8], most: usize) -> Found<&[u8]> {
    let [begin, low, high, check] = match *bytes {
        [BEGIN] | [BEGIN, _] | [BEGIN, _, _] => return Found::More(HEAD),
        [a, b, c, d, ..] => [a, b, c, d],
        _ => return Found::Nothing,
    };
    let length = u16::from_le_bytes([low, high]);
    let size = usize::from(length);
    if [begin, low, high, check] != head(length) || size == 0 || size > most {
        return Found::Nothing;
    }
    let whole = HEAD + size + TAIL;
    let Some(frame) = bytes.get(..whole) else { return Found::More(whole) };
    let (body, crc) = frame[HEAD..].split_at(size);
    if crc == CRC.checksum(body).to_le_bytes() { Found::Frame(whole, body) } else { Found::Damaged }
}

/// What a robot hears: [`Ask`]s. Sound ones that it does not know are skipped.
#[derive(Debug)]
pub struct FromPc;

impl Protocol for FromPc {
    type Message = Ask;
    type Buffer = Vec<u8, { ASK + AROUND }>;

    fn examine(&self, bytes: &[u8]) -> Found<Ask> {
        match body(bytes, ASK) {
            Found::Frame(whole, body) => match postcard::take_from_bytes(body) {
                Ok((ask, _)) => Found::Frame(whole, ask),
                Err(_) => Found::Other(whole),
            },
            Found::More(whole) => Found::More(whole),
            Found::Damaged => Found::Damaged,
            Found::Nothing | Found::Other(_) => Found::Nothing,
        }
    }
}

/// What a PC hears: bodies, which are [samples](crate::samples) or a [`Tell`](crate::Tell).
#[derive(Debug)]
pub struct FromRobot;

impl Protocol for FromRobot {
    type Message = Vec<u8, BODY>;
    type Buffer = Vec<u8, { BODY + AROUND }>;

    fn examine(&self, bytes: &[u8]) -> Found<Self::Message> {
        match body(bytes, BODY) {
            Found::Frame(whole, body) => match Vec::from_slice(body) {
                Ok(body) => Found::Frame(whole, body),
                Err(_) => Found::Damaged,
            },
            Found::More(whole) => Found::More(whole),
            Found::Damaged => Found::Damaged,
            Found::Nothing | Found::Other(_) => Found::Nothing,
        }
    }
}
