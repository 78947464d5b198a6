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
//! A body that begins with [`CARRIER`] is a sample that carries a piece of other frames:
//!
//! | bytes | content |
//! |---|---|
//! | 0 | [`CARRIER`] |
//! | 1 | the number of bytes carried |
//! | from 2 | those: the next of a stream of frames, which may begin and end within them |
//! | behind them | the body of a [sample](samples); nothing if there is none |
//!
//! [`rc10_module::Stream`] finds them in any stream: a false head costs one byte, a damaged frame
//! itself. Stuffing would cost a robot as many instructions as all else.

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::Vec;
use rc10_module::{Found, Protocol};
use serde::Serialize;

use crate::commands::COMMAND;
use crate::message::Ask;
use crate::samples;

/// The first byte of a frame.
pub const BEGIN: u8 = 0xE7;
/// Most bytes of a body.
pub const BODY: usize = 1024;
/// Most bytes of a body that a robot hears.
pub const ASK: usize = 192;
/// The first byte of a body that carries a piece of other frames.
pub const CARRIER: u8 = 5;
/// Most bytes of such a body.
pub const CARRIED: usize = 192;
/// Bytes of a carrier that carries nothing yet, and has no sample.
pub const CARRIER_HEAD: usize = 2;
/// The first byte of a body for the robot's other board, and its place, below 32; up to eight bytes follow.
pub const BOARD: u8 = 0xA0;
const FOR_BOARD: usize = 9;
/// Bytes around a body.
pub const AROUND: usize = HEAD + TAIL;

const HEAD: usize = 4;
const TAIL: usize = 4;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// The check sum of a body.
#[must_use]
pub fn crc(body: &[u8]) -> u32 {
    CRC.checksum(body)
}

const fn head(length: u16) -> [u8; HEAD] {
    let [low, high] = length.to_le_bytes();
    [BEGIN, low, high, BEGIN ^ low ^ high ^ 0xFF]
}

/// A frame that is being written, of up to `N` bytes in all.
#[derive(Debug)]
pub struct Writer<const N: usize> {
    bytes: [u8; N],
    /// The frame's length; 0 without a frame.
    length: usize,
    /// Bytes of the body before a sample.
    before: usize,
}

impl<const N: usize> Default for Writer<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Writer<N> {
    /// Nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N > AROUND + samples::HEAD && N <= AROUND + BODY) };
        Self { bytes: [0; N], length: 0, before: 0 }
    }

    /// Begins a carrier. A [sample](Self::sample) may follow, or [`end_carrier`](Self::end_carrier).
    pub fn carrier(&mut self) {
        self.bytes[HEAD] = CARRIER;
        self.bytes[HEAD + 1] = 0;
        self.before = CARRIER_HEAD;
    }

    /// Takes some of these bytes into a carrier, until it carries `most`; returns how many.
    pub fn carry(&mut self, bytes: &[u8], most: usize) -> usize {
        let room = (CARRIER_HEAD + most).min(N - AROUND).saturating_sub(self.before);
        let count = bytes.len().min(room);
        let begin = HEAD + self.before;
        self.bytes[begin..begin + count].copy_from_slice(&bytes[..count]);
        #[expect(clippy::cast_possible_truncation, reason = "no more than a carrier has room for")]
        let carried = count as u8;
        self.bytes[HEAD + 1] = self.bytes[HEAD + 1].wrapping_add(carried);
        self.before += count;
        count
    }

    /// Ends a carrier that has no sample; one that carries nothing is no frame.
    pub fn end_carrier(&mut self) {
        let body = core::mem::take(&mut self.before);
        if body > CARRIER_HEAD { self.end(body) } else { self.length = 0 }
    }

    /// Begins a [sample](samples), and returns where its values go.
    pub fn sample(&mut self, head: samples::Head) -> &mut [[u8; 4]] {
        let (body, _) = self.bytes[HEAD + self.before..].split_at_mut(N - AROUND - self.before);
        let (place, values) = body.split_at_mut(samples::HEAD);
        place.copy_from_slice(&head.bytes());
        values.as_chunks_mut().0
    }

    /// Ends it, with this number of values.
    pub fn end_sample(&mut self, values: usize) {
        let before = core::mem::take(&mut self.before);
        self.end((before + samples::HEAD + 4 * values).min(N - AROUND));
    }

    /// Makes a whole frame of a message. Without room for it there is no frame.
    pub fn message(&mut self, message: &impl Serialize) {
        match postcard::to_slice(message, &mut self.bytes[HEAD..N - TAIL]).map(|it| it.len()) {
            Ok(length) => self.end(length),
            Err(_) => self.length = 0,
        }
    }

    /// Makes a whole frame of a body, such as a [command](crate::commands). Without room for it there is no frame.
    pub fn body(&mut self, body: &[u8]) {
        match self.bytes[HEAD..N - TAIL].get_mut(..body.len()) {
            Some(place) => {
                place.copy_from_slice(body);
                self.end(body.len());
            }
            None => self.length = 0,
        }
    }

    fn end(&mut self, body: usize) {
        let sum = crc(&self.bytes[HEAD..HEAD + body]);
        self.bytes[HEAD + body..][..TAIL].copy_from_slice(&sum.to_le_bytes());
        #[expect(clippy::cast_possible_truncation, reason = "at most BODY")]
        self.bytes[..HEAD].copy_from_slice(&head(body as u16));
        self.length = AROUND + body;
    }

    /// The frame; no bytes without a message.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

/// A frame for the robot's other board, with a place below 32 and up to eight bytes.
#[must_use]
pub fn of_board(place: u8, data: &[u8]) -> Writer<32> {
    let (mut body, mut writer) = (Vec::<u8, FOR_BOARD>::new(), Writer::new());
    if body.push(BOARD | place).and_then(|()| body.extend_from_slice(data).map_err(|_| 0)).is_ok() {
        writer.body(&body);
    }
    writer
}

/// What a carrier's body carries, and the body of its sample, which may be empty; `None` for another body.
#[must_use]
pub fn carried(body: &[u8]) -> Option<(&[u8], &[u8])> {
    let (&[CARRIER, count], rest) = body.split_first_chunk()? else { return None };
    rest.split_at_checked(count.into())
}

/// Examines the frame that begins with these bytes: `read` judges a sound body, and gets the frame's length.
fn examine<M>(bytes: &[u8], most: usize, read: impl FnOnce(usize, &[u8]) -> Found<M>) -> Found<M> {
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
    let (body, sum) = frame[HEAD..].split_at(size);
    if sum == crc(body).to_le_bytes() { read(whole, body) } else { Found::Damaged }
}

/// The protocol that a robot hears: [`Ask`]s. Sound ones that it does not know are skipped.
#[derive(Debug)]
pub struct FromPc;

impl Protocol for FromPc {
    type Message = Ask;
    type Buffer = Vec<u8, { ASK + AROUND }>;

    #[inline(never)]
    fn examine(&self, bytes: &[u8]) -> Found<Ask> {
        examine(bytes, ASK, |whole, body| match postcard::take_from_bytes(body) {
            Ok((ask, _)) => Found::Frame(whole, ask),
            Err(_) => Found::Other(whole),
        })
    }
}

/// What a robot hears that takes [commands](crate::commands).
#[derive(Clone, Debug)]
pub enum Said {
    /// What a PC asks.
    Ask(Ask),
    /// The body of a command, sound or not.
    Command(Vec<u8, ASK>),
}

/// The protocol that such a robot hears.
#[derive(Debug)]
pub struct WithCommands;

impl Protocol for WithCommands {
    type Message = Said;
    type Buffer = Vec<u8, { ASK + AROUND }>;

    fn examine(&self, bytes: &[u8]) -> Found<Said> {
        if bytes.get(HEAD).is_none_or(|first| *first != COMMAND) {
            return match FromPc.examine(bytes) {
                Found::Frame(whole, ask) => Found::Frame(whole, Said::Ask(ask)),
                Found::More(needed) => Found::More(needed),
                Found::Nothing => Found::Nothing,
                Found::Damaged => Found::Damaged,
                Found::Other(whole) => Found::Other(whole),
            };
        }
        examine(bytes, ASK, |whole, body| {
            Vec::from_slice(body)
                .map_or(Found::Other(whole), |it| Found::Frame(whole, Said::Command(it)))
        })
    }
}

/// The protocol that a PC hears: bodies, which are [samples] or a [`Tell`](crate::Tell).
#[derive(Debug)]
pub struct FromRobot;

impl Protocol for FromRobot {
    type Message = Vec<u8, BODY>;
    type Buffer = Vec<u8, { BODY + AROUND }>;

    fn examine(&self, bytes: &[u8]) -> Found<Self::Message> {
        examine(bytes, BODY, |whole, body| {
            Vec::from_slice(body).map_or(Found::Damaged, |body| Found::Frame(whole, body))
        })
    }
}

/// The protocol that a board hears of the robot's other one: places and bytes. Frames of and for PCs are skipped.
#[derive(Debug)]
pub struct FromBoard;

impl Protocol for FromBoard {
    type Message = (u8, Vec<u8, FOR_BOARD>);
    type Buffer = Vec<u8, { FOR_BOARD + AROUND }>;

    fn examine(&self, bytes: &[u8]) -> Found<Self::Message> {
        examine(bytes, FOR_BOARD, |whole, body| match body {
            [first, data @ ..] if first & 0xE0 == BOARD => {
                let data = Vec::from_slice(data).unwrap_or_default();
                Found::Frame(whole, (first & 0x1F, data))
            }
            _ => Found::Other(whole),
        })
    }
}

#[cfg(test)]
mod tests {
    /// The check value of the catalogue of CRCs.
    #[test]
    fn the_crc_is_that_of_the_catalogue() {
        assert_eq!(super::crc(b"123456789"), 0xCBF4_3926);
    }
}
