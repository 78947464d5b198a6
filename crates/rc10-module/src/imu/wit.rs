//! WIT (`WitMotion`) modules, such as WT901 and HWT101: UART 8N1, 9600 baud as sold, little endian.
//!
//! | byte | |
//! |---|---|
//! | 0 | `55` |
//! | 1 | `51` acceleration, `52` angular rate, `53` angle, others |
//! | 2 ..= 9 | four i16: x, y, z, and one more |
//! | 10 | sum of bytes 0 to 9 |
//!
//! An HWT101 measures yaw only: `52` and `53`, with z alone of interest.
//!
//! Sources: WIT standard and HWT101 protocols, data sheet HWT905 for rates and baud rates.

use rc10_app::{Celsius, Degrees};

use crate::sum::sum;
use crate::{Found, Protocol};

const LEN: usize = 11;
const HEAD: u8 = 0x55;
/// Time, the frames that are understood, and up to the answer to a register that is read.
const TYPES: core::ops::RangeInclusive<u8> = 0x50..=0x5F;

/// The protocol of a WIT module.
///
/// ```
/// use rc10_time::Micros;
/// use rc10_module::{Stream, imu::{Heading, Wit, wit::Message}};
///
/// let (mut stream, mut heading) = (Stream::new(Wit), Heading::default());
/// let at = Micros::from_millis(10);
/// let frame = [0x55, 0x53, 0, 0, 0, 0, 0, 0x20, 0, 0, 0xC8];
/// stream.receive(&frame, at, |message| {
///     if let Message::Angle { yaw, .. } = message {
///         heading.hear(yaw, at);
///     }
/// });
/// assert_eq!(heading.total(at).unwrap().degrees().get(), 45.0);
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Wit;

/// The content of a frame. Axes are the module's, right-handed; rotations counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Message {
    /// Acceleration, gravity included.
    Acceleration {
        /// In g, -16 ..< 16.
        g: [f32; 3],
        /// The chip's temperature.
        temperature: Celsius,
    },
    /// Angular rate.
    Rate {
        /// In degrees per second, -2000 ..< 2000.
        degrees_per_second: [f32; 3],
    },
    /// Attitude: turned about z, then y, then x.
    Angle {
        /// About x, -180 ..< 180.
        roll: Degrees,
        /// About y, -90 ..= 90.
        pitch: Degrees,
        /// About z, -180 ..< 180.
        yaw: Degrees,
    },
}

impl Protocol for Wit {
    type Message = Message;
    type Buffer = heapless::Vec<u8, LEN>;

    fn examine(&self, bytes: &[u8]) -> Found<Message> {
        let &[HEAD, ..] = bytes else { return Found::Nothing };
        let Some(frame) = bytes.first_chunk::<LEN>() else { return Found::More(LEN) };
        let &[_, kind, x0, x1, y0, y1, z0, z1, w0, w1, check] = frame;
        if !TYPES.contains(&kind) {
            return Found::Nothing;
        }
        if sum(&frame[..LEN - 1]) != check {
            return Found::Damaged;
        }
        // A full scale of 16 g, 2000 °/s or 180° is 2¹⁵ counts: exact in an f32.
        let xyz = [[x0, x1], [y0, y1], [z0, z1]].map(|raw| f32::from(i16::from_le_bytes(raw)));
        let scaled = |full_scale: f32| xyz.map(|counts| counts * (full_scale / 32768.0));
        Found::Frame(
            LEN,
            match kind {
                0x51 => Message::Acceleration {
                    g: scaled(16.0),
                    temperature: Celsius::new(f32::from(i16::from_le_bytes([w0, w1])) / 100.0),
                },
                0x52 => Message::Rate { degrees_per_second: scaled(2000.0) },
                0x53 => {
                    let [roll, pitch, yaw] = scaled(180.0).map(Degrees::new);
                    Message::Angle { roll, pitch, yaw }
                }
                _ => return Found::Other(LEN),
            },
        )
    }
}

/// A setting, taken within 10 s of [`Unlock`](Self::Unlock), kept by [`Save`](Self::Save).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Settings may be changed.
    Unlock,
    /// Sets the rate at which it sends.
    Rate(Rate),
    /// Sets the baud rate; it changes over at once.
    Baud(Baud),
    /// HWT101: yaw is zero now. [`Heading::zero`](super::Heading::zero) does it without the device.
    ZeroYaw,
    /// Settings are kept over power-off.
    Save,
}

/// The rate at which a module sends, with the maker's code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the names say it")]
#[repr(u8)]
pub enum Rate {
    Hz1 = 0x03,
    Hz2 = 0x04,
    Hz5 = 0x05,
    Hz10 = 0x06,
    Hz20 = 0x07,
    Hz50 = 0x08,
    Hz100 = 0x09,
    Hz125 = 0x0A,
    Hz200 = 0x0B,
}

/// The baud rate of a module, with the maker's code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the names say it")]
#[repr(u8)]
pub enum Baud {
    B4800 = 0x01,
    B9600 = 0x02,
    B19200 = 0x03,
    B38400 = 0x04,
    B57600 = 0x05,
    B115200 = 0x06,
    B230400 = 0x07,
    B460800 = 0x08,
    B921600 = 0x09,
}

impl Command {
    /// The bytes: `FF AA`, a register, and its new value, little endian.
    #[must_use]
    pub const fn pack(self) -> [u8; 5] {
        let [register, low, high] = match self {
            Self::Unlock => [0x69, 0x88, 0xB5],
            Self::Rate(rate) => [0x03, rate as u8, 0x00],
            Self::Baud(baud) => [0x04, baud as u8, 0x00],
            Self::ZeroYaw => [0x76, 0x00, 0x00],
            Self::Save => [0x00, 0x00, 0x00],
        };
        [0xFF, 0xAA, register, low, high]
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::{Counters, Stream};
    use rc10_time::Micros;
    use std::vec::Vec;

    fn frame(kind: u8, words: [i16; 4]) -> [u8; LEN] {
        let mut frame = [0; LEN];
        frame[..2].copy_from_slice(&[HEAD, kind]);
        for (bytes, word) in frame[2..].chunks_exact_mut(2).zip(words) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        frame[10] = sum(&frame[..10]);
        frame
    }

    fn heard(bytes: &[u8]) -> (Vec<Message>, Counters) {
        let (mut stream, mut heard) = (Stream::new(Wit), Vec::new());
        stream.receive(bytes, Micros::ZERO, |message| heard.push(message));
        (heard, stream.counters())
    }

    fn yaw(counts: i16) -> [u8; LEN] {
        frame(0x53, [0, 0, counts, 0])
    }

    #[test]
    fn frames_byte_for_byte() {
        let acceleration = b"\x55\x51\x00\x08\x00\xFC\x00\x40\xC4\x09\xB7";
        let expected =
            Message::Acceleration { g: [1.0, -0.5, 8.0], temperature: Celsius::new(25.0) };
        assert_eq!(heard(acceleration).0, [expected]);
        let rate = b"\x55\x52\x00\xC0\x64\x00\xC8\x00\x00\x00\x93";
        let degrees_per_second = [-1000.0, 6.103_515_6, 12.207_031];
        assert_eq!(heard(rate).0, [Message::Rate { degrees_per_second }]);
        let [roll, pitch, yaw] = [45.0, -90.0, 179.994_5].map(Degrees::new);
        let angle = b"\x55\x53\x00\x20\x00\xC0\xFF\x7F\x00\x00\x06";
        assert_eq!(heard(angle).0, [Message::Angle { roll, pitch, yaw }]);
    }

    #[test]
    fn the_ends_of_the_scale() {
        let ends = heard(&frame(0x52, [i16::MIN, i16::MAX, 0, 0])).0[0];
        let degrees_per_second = [-2000.0, 1999.939, 0.0];
        assert_eq!(ends, Message::Rate { degrees_per_second });
    }

    #[test]
    fn commands_byte_for_byte() {
        let table = [
            (Command::Unlock, [0xFF, 0xAA, 0x69, 0x88, 0xB5]),
            (Command::Rate(Rate::Hz200), [0xFF, 0xAA, 0x03, 0x0B, 0x00]),
            (Command::Rate(Rate::Hz10), [0xFF, 0xAA, 0x03, 0x06, 0x00]),
            (Command::Baud(Baud::B115200), [0xFF, 0xAA, 0x04, 0x06, 0x00]),
            (Command::Baud(Baud::B921600), [0xFF, 0xAA, 0x04, 0x09, 0x00]),
            (Command::ZeroYaw, [0xFF, 0xAA, 0x76, 0x00, 0x00]),
            (Command::Save, [0xFF, 0xAA, 0x00, 0x00, 0x00]),
        ];
        for (command, bytes) in table {
            assert_eq!(command.pack(), bytes, "{command:?}");
        }
    }

    #[test]
    fn other_frames_are_passed_over() {
        let bytes = [frame(0x50, [1; 4]), frame(0x54, [2; 4]), frame(0x5F, [3; 4]), yaw(0)];
        let (messages, counters) = heard(&bytes.concat());
        assert_eq!((messages.len(), counters.frames, counters.skipped), (1, 4, 0));
    }

    /// 55 is a type as well, and stands in the numbers.
    #[test]
    fn heads_where_none_belong_cost_no_frame() {
        let good = frame(0x53, [0x5555, 0x5355, 0x5155, 0x5255]);
        for extra in 0..12_u8 {
            let bytes = [&std::vec![HEAD; extra.into()], &good[..], &good].concat();
            let (messages, counters) = heard(&bytes);
            assert_eq!((messages.len(), counters.skipped), (2, u32::from(extra)), "{extra}");
        }
    }

    #[test]
    fn any_wrong_byte_is_noticed() {
        for at in 0..LEN {
            let mut spoilt = yaw(1);
            spoilt[at] ^= 0x20;
            let messages = heard(&[spoilt, yaw(2), yaw(3)].concat()).0;
            assert_eq!(messages.len(), 2, "{at}");
        }
    }
}
