//! JRT-type laser modules: UART 8N1, 19200 baud or other, big endian; [`run`] has them measure.
//!
//! | bytes | |
//! |---|---|
//! | 1 | `AA`, or `EE` before an error |
//! | 1 | bit 7: register is read; bits 6 to 0: address |
//! | 2 | register |
//! | 2 | how many words follow; not in a command that reads |
//! | 2 each | words |
//! | 1 | sum of all but the first byte |
//!
//! A result is register 0022: distance u32 in mm, quality u16. An error is its code, one word.
//!
//! Sources: drivers of RC9 (GDUT) and IADIY's LRF100M3PS, `laser_ldj100` with its code table.

mod driver;

use super::{Doubt, Range};
use crate::sum::sum;
use crate::{Found, Protocol};
pub use driver::{Speed, run};

const REPLY: u8 = 0xAA;
const ERROR: u8 = 0xEE;
const READ: u8 = 0x80;
/// Register that starts a measurement.
const MEASURE: u16 = 0x0020;
/// Register with the newest result.
const RESULT: u16 = 0x0022;
/// Register that switches the laser.
const LASER: u16 = 0x01BE;
/// Ends continuous measuring: this byte alone.
const STOP: u8 = 0x58;
/// Head, address, register, count.
const HEADER: usize = 6;
/// No reply of these modules has more words than a result.
const MOST_WORDS: usize = 3;
const LONGEST: usize = HEADER + 2 * MOST_WORDS + 1;
/// The family's range in mm: from 30 to 150 m. Yours may reach less far, and says so by an error.
const REACH: core::ops::RangeInclusive<u32> = 30..=150_000;

/// The protocol of a JRT-type module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Jrt;

/// The answer of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// The module measured.
    Result {
        /// The address of the module: 0 as sold.
        address: u8,
        /// The distance; [`range`](Self::range) judges it.
        millimetres: u32,
        /// The quality. The manual calls a small value good, users found the contrary: try it.
        quality: u16,
    },
    /// The module could not measure.
    Error {
        /// The address of the module.
        address: u8,
        /// Why. See [`range`](Self::range).
        code: u16,
    },
}

impl Answer {
    /// The distance of something, or why it is not known. Codes that speak of the target are
    /// states; the others (1 supply too low, 3 and 4 too cold and too hot, 10 and up hardware, 129
    /// no such command) are a [`Fault`](Range::Fault).
    pub fn range(&self) -> Range {
        match *self {
            Self::Result { millimetres, .. } if REACH.contains(&millimetres) => {
                Range::Distance(millimetres)
            }
            Self::Result { .. } | Self::Error { code: 5, .. } => Range::OutOfRange,
            Self::Error { code: 6, .. } => Range::Unreliable(Doubt::Unexplained),
            Self::Error { code: 7, .. } => Range::Unreliable(Doubt::AmbientLight),
            Self::Error { code: 8, .. } => Range::Unreliable(Doubt::TooWeak),
            Self::Error { code: 9, .. } => Range::Unreliable(Doubt::TooStrong),
            Self::Error { code: 15, .. } => Range::Unreliable(Doubt::Unsteady),
            Self::Error { code, .. } => Range::Fault(code),
        }
    }
}

impl Protocol for Jrt {
    type Message = Answer;
    type Buffer = heapless::Vec<u8, LONGEST>;

    fn examine(&self, bytes: &[u8]) -> Found<Answer> {
        let &[REPLY | ERROR, ..] = bytes else { return Found::Nothing };
        let Some(&[head, address, r1, r0, c1, c0]) = bytes.first_chunk::<HEADER>() else {
            return Found::More(HEADER);
        };
        let words = usize::from(u16::from_be_bytes([c1, c0]));
        if words == 0 || words > MOST_WORDS {
            return Found::Nothing;
        }
        let length = HEADER + 2 * words + 1;
        let Some([_, checked @ .., check]) = bytes.get(..length) else {
            return Found::More(length);
        };
        if sum(checked) != *check {
            return Found::Damaged;
        }
        let address = address & !READ;
        match (head, u16::from_be_bytes([r1, r0]), &checked[HEADER - 1..]) {
            (REPLY, RESULT, &[d3, d2, d1, d0, q1, q0]) => {
                let millimetres = u32::from_be_bytes([d3, d2, d1, d0]);
                let quality = u16::from_be_bytes([q1, q0]);
                Found::Frame(length, Answer::Result { address, millimetres, quality })
            }
            (ERROR, _, &[e1, e0]) if [e1, e0] != [0, 0] => {
                let code = u16::from_be_bytes([e1, e0]);
                Found::Frame(length, Answer::Error { address, code })
            }
            _ => Found::Other(length),
        }
    }
}

/// A command to a module of address 0, as sold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// The laser as a pointer.
    LaserOn,
    /// Dark.
    LaserOff,
    /// One measurement; its result comes by itself.
    Once(Speed),
    /// Measure until stopped; results come by themselves.
    Continuously(Speed),
    /// The end of measuring continuously.
    Stop,
    /// Say the newest result again.
    Read,
}

impl Command {
    /// The bytes of the command.
    ///
    /// ```
    /// use rc10_module::ranging::jrt::Command;
    /// assert_eq!(Command::Read.pack(), [0xAA, 0x80, 0x00, 0x22, 0xA2]);
    /// ```
    #[must_use]
    pub fn pack(self) -> heapless::Vec<u8, 9> {
        match self {
            Self::Stop => [STOP].into(),
            Self::Read => {
                let [r1, r0] = RESULT.to_be_bytes();
                [REPLY, READ, r1, r0, sum(&[READ, r1, r0])].into()
            }
            Self::LaserOn => write(LASER, 1).into(),
            Self::LaserOff => write(LASER, 0).into(),
            Self::Once(speed) => write(MEASURE, speed as u8).into(),
            Self::Continuously(speed) => write(MEASURE, 4 + speed as u8).into(),
        }
    }
}

/// Writes one word into a register of module 0.
fn write(register: u16, word: u8) -> [u8; 9] {
    let [r1, r0] = register.to_be_bytes();
    let mut bytes = [REPLY, 0, r1, r0, 0, 1, 0, word, 0];
    bytes[8] = sum(&bytes[1..]);
    bytes
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::{Counters, Stream};
    use rc10_time::Micros;
    use std::vec::Vec;

    const GOOD: [u8; 13] = *b"\xAA\x00\x00\x22\x00\x03\x00\x00\x10\xE1\x00\x78\x8E";
    const ANSWER: Answer = Answer::Result { address: 0, millimetres: 4321, quality: 120 };

    fn heard(bytes: &[u8]) -> (Vec<Answer>, Counters) {
        let (mut stream, mut heard) = (Stream::new(Jrt), Vec::new());
        stream.receive(bytes, Micros::ZERO, |answer| heard.push(answer));
        (heard, stream.counters())
    }

    fn error(code: u16) -> [u8; 9] {
        let [e1, e0] = code.to_be_bytes();
        let mut bytes = [ERROR, 0, 0, 0, 0, 1, e1, e0, 0];
        bytes[8] = sum(&bytes[1..]);
        bytes
    }

    #[test]
    fn a_result_byte_for_byte() {
        let (answers, counters) = heard(&GOOD);
        assert_eq!((answers.as_slice(), counters.skipped), (&[ANSWER][..], 0));
        assert_eq!(ANSWER.range(), Range::Distance(4321));
        // The answer to a command that reads has bit 7 set; the address is 5.
        let read = b"\xAA\x85\x00\x22\x00\x03\x01\x02\x03\x04\x05\x06\xBF";
        let far = Answer::Result { address: 5, millimetres: 0x0102_0304, quality: 0x0506 };
        assert_eq!(heard(read).0, [far]);
        assert_eq!(far.range(), Range::OutOfRange);
    }

    #[test]
    fn commands_byte_for_byte() {
        use Speed::{Auto, Fast, Slow};
        let table: [(Command, &[u8]); 10] = [
            (Command::LaserOn, b"\xAA\x00\x01\xBE\x00\x01\x00\x01\xC1"),
            (Command::LaserOff, b"\xAA\x00\x01\xBE\x00\x01\x00\x00\xC0"),
            (Command::Once(Auto), b"\xAA\x00\x00\x20\x00\x01\x00\x00\x21"),
            (Command::Once(Slow), b"\xAA\x00\x00\x20\x00\x01\x00\x01\x22"),
            (Command::Once(Fast), b"\xAA\x00\x00\x20\x00\x01\x00\x02\x23"),
            (Command::Continuously(Auto), b"\xAA\x00\x00\x20\x00\x01\x00\x04\x25"),
            (Command::Continuously(Slow), b"\xAA\x00\x00\x20\x00\x01\x00\x05\x26"),
            (Command::Continuously(Fast), b"\xAA\x00\x00\x20\x00\x01\x00\x06\x27"),
            (Command::Stop, b"\x58"),
            (Command::Read, b"\xAA\x80\x00\x22\xA2"),
        ];
        for (command, bytes) in table {
            assert_eq!(command.pack(), bytes, "{command:?}");
        }
    }

    #[test]
    fn codes_are_states_where_they_speak_of_the_target() {
        let range = |code| heard(&error(code)).0[0].range();
        assert_eq!(range(5), Range::OutOfRange);
        assert_eq!(range(6), Range::Unreliable(Doubt::Unexplained));
        assert_eq!(range(7), Range::Unreliable(Doubt::AmbientLight));
        assert_eq!(range(8), Range::Unreliable(Doubt::TooWeak));
        assert_eq!(range(9), Range::Unreliable(Doubt::TooStrong));
        assert_eq!(range(15), Range::Unreliable(Doubt::Unsteady));
        for fault in [1, 2, 3, 4, 10, 14, 16, 0x81, 0xFFFF] {
            assert_eq!(range(fault), Range::Fault(fault));
        }
        // "No error" says nothing of a distance.
        assert_eq!(heard(&error(0)).0, []);
    }

    #[test]
    fn a_distance_lies_within_reach() {
        let answer = |millimetres| Answer::Result { address: 0, millimetres, quality: 0 };
        for nowhere in [0, 29, 150_001, u32::MAX] {
            assert_eq!(answer(nowhere).range(), Range::OutOfRange);
        }
        for somewhere in [30, 150_000] {
            assert_eq!(answer(somewhere).range(), Range::Distance(somewhere));
        }
    }

    /// Commands that come back, an error's other head, heads too many, and a damaged frame.
    #[test]
    fn nothing_in_between_costs_a_result() {
        let echo = Command::Continuously(Speed::Auto).pack();
        let read = Command::Read.pack();
        let mut damaged = GOOD;
        damaged[8] ^= 1;
        let pieces: [&[u8]; 8] =
            [&echo, &read, &[0xAA, 0xAA, 0xEE], &[0xEE; 5], &damaged, &error(8), &GOOD[..7], &[]];
        for piece in pieces {
            let is_error = piece.len() == 9 && piece[0] == ERROR;
            let weak = Answer::Error { address: 0, code: 8 };
            let expected = if is_error { &[ANSWER, weak, ANSWER][..] } else { &[ANSWER, ANSWER] };
            let answers = heard(&[&GOOD, piece, &GOOD].concat()).0;
            assert_eq!(answers, expected, "{piece:02X?}");
        }
        assert_eq!(heard(&echo).1.frames, 1, "a known frame of no interest");
        assert_eq!(heard(b"\xAA\x00\x00\x22\x00\x00\x22").1.frames, 0, "a frame of no words");
    }

    #[test]
    fn any_wrong_byte_is_noticed() {
        for at in 0..GOOD.len() {
            let mut spoilt = GOOD;
            spoilt[at] ^= 0x04;
            let answers = heard(&[&spoilt[..], &GOOD, &GOOD].concat()).0;
            assert_eq!(answers, [ANSWER, ANSWER], "{at}");
        }
    }
}
