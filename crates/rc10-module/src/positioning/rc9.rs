//! RC9 (GDUT) frames between boards, and of its positioning module: UART, any baud rate, 8N1.
//!
//! | bytes | |
//! |---|---|
//! | 2 | `FC FB` |
//! | 1 | identifier |
//! | 1 | length of the data, 0 ..= 64 |
//! | 0 ..= 64 | data: bytes, or f32, little endian |
//! | 2 | CRC-16/XMODEM of the data alone, low byte first |
//! | 2 | `FD FE` |
//!
//! Source: RC9's implementations for STM32 and ESP32, which agree.

use crate::{Found, Protocol};

const HEAD: [u8; 2] = [0xFC, 0xFB];
const TAIL: [u8; 2] = [0xFD, 0xFE];
/// Bytes of data at most.
pub const MOST: usize = 64;
/// Head, identifier, length.
const HEADER: usize = 4;
const LONGEST: usize = HEADER + MOST + 4;

/// The protocol of RC9 frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rc9 {
    /// Whether frames with a CRC of `00 00` are taken unchecked: for one positioning module of the
    /// team that calculates none. Off for all else.
    pub unchecked: bool,
}

/// A frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame {
    id: u8,
    len: u8,
    /// Zero from `len` on.
    data: [u8; MOST],
}

/// Why something is no frame's data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// The frame claims this number of bytes: too many.
    #[error("{0} bytes of data: an RC9 frame has at most {MOST}")]
    TooLong(usize),
    /// This number, counted from 0, is infinite or none at all.
    #[error("number {0} of an RC9 frame's data is not finite: it must be")]
    NotFinite(usize),
}

impl Frame {
    /// A frame of bytes.
    ///
    /// # Errors
    /// [`FrameError::TooLong`] for more than 64.
    pub fn new(id: u8, bytes: &[u8]) -> Result<Self, FrameError> {
        let mut data = [0; MOST];
        let too_long = FrameError::TooLong(bytes.len());
        data.get_mut(..bytes.len()).ok_or(too_long)?.copy_from_slice(bytes);
        Ok(Self { id, len: u8::try_from(bytes.len()).map_err(|_| too_long)?, data })
    }

    /// A frame of numbers.
    ///
    /// ```
    /// use rc10_module::positioning::rc9::Frame;
    /// let frame = Frame::of_floats(1, &[1.5, -2.25])?;
    /// assert_eq!(frame.pack(), *b"\xFC\xFB\x01\x08\0\0\xC0\x3F\0\0\x10\xC0\x18\x0D\xFD\xFE");
    /// # Ok::<(), rc10_module::positioning::rc9::FrameError>(())
    /// ```
    ///
    /// # Errors
    /// [`FrameError::TooLong`] above 16, [`FrameError::NotFinite`] for infinity or NaN.
    pub fn of_floats(id: u8, numbers: &[f32]) -> Result<Self, FrameError> {
        let mut bytes = heapless::Vec::<u8, MOST>::new();
        for (index, number) in numbers.iter().enumerate() {
            if !number.is_finite() {
                return Err(FrameError::NotFinite(index));
            }
            let fits = bytes.extend_from_slice(&number.to_le_bytes());
            fits.map_err(|_| FrameError::TooLong(numbers.len().saturating_mul(4)))?;
        }
        Self::new(id, &bytes)
    }

    /// The identifier of the frame.
    #[must_use]
    pub const fn id(&self) -> u8 {
        self.id
    }

    /// The data.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.data.get(..self.len.into()).unwrap_or_default()
    }

    /// The data as numbers; `None` unless all are finite and of four whole bytes.
    #[must_use]
    pub fn floats(&self) -> Option<heapless::Vec<f32, { MOST / 4 }>> {
        let (numbers, rest) = self.data().as_chunks::<4>();
        let finite = |bytes: &[u8; 4]| Some(f32::from_le_bytes(*bytes)).filter(|n| n.is_finite());
        if rest.is_empty() { numbers.iter().map(finite).collect() } else { None }
    }

    /// The bytes on the wire.
    #[must_use]
    pub fn pack(&self) -> heapless::Vec<u8, LONGEST> {
        let crc = crc(self.data()).to_le_bytes();
        let [h0, h1] = HEAD;
        // Chained, they are as many as fit.
        let header = [h0, h1, self.id, self.len];
        [&header, self.data(), &crc, &TAIL].into_iter().flatten().copied().collect()
    }
}

/// CRC-16/XMODEM: 0x1021, from zero, highest bit first; 0x31C3 for "123456789".
///
/// Without a table: the taps of x¹⁶ + x¹² + x⁵ + 1 move a byte to three places.
fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc: u16, byte| {
        let mixed = crc >> 8 ^ u16::from(*byte);
        let fed = mixed ^ mixed >> 4;
        crc << 8 ^ fed << 12 ^ fed << 5 ^ fed
    })
}

impl Protocol for Rc9 {
    type Message = Frame;
    type Buffer = heapless::Vec<u8, LONGEST>;

    fn examine(&self, bytes: &[u8]) -> Found<Frame> {
        if bytes.first() != Some(&HEAD[0]) {
            return Found::Nothing;
        }
        let Some(&[h0, h1, id, len]) = bytes.first_chunk::<HEADER>() else {
            return Found::More(HEADER);
        };
        let length = HEADER + usize::from(len) + 4;
        if [h0, h1] != HEAD || length > LONGEST {
            return Found::Nothing;
        }
        let Some([_, _, _, _, data @ .., c0, c1, t0, t1]) = bytes.get(..length) else {
            return Found::More(length);
        };
        if [*t0, *t1] != TAIL {
            return Found::Nothing;
        }
        let received = u16::from_le_bytes([*c0, *c1]);
        if crc(data) != received && !(self.unchecked && received == 0) {
            return Found::Damaged;
        }
        Frame::new(id, data).map_or(Found::Nothing, |frame| Found::Frame(length, frame))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::{Counters, Stream};
    use rc10_time::Micros;
    use std::string::ToString;
    use std::vec::Vec;

    fn heard_by(protocol: Rc9, bytes: &[u8]) -> (Vec<Frame>, Counters) {
        let (mut stream, mut heard) = (Stream::new(protocol), Vec::new());
        stream.receive(bytes, Micros::ZERO, |frame| heard.push(frame));
        (heard, stream.counters())
    }

    fn heard(bytes: &[u8]) -> Vec<Frame> {
        heard_by(Rc9::default(), bytes).0
    }

    #[test]
    fn the_crc_is_xmodem() {
        assert_eq!(crc(b"123456789"), 0x31C3);
        assert_eq!(crc(b""), 0);
    }

    #[test]
    fn a_frame_byte_for_byte() {
        let bytes = b"\xFC\xFB\x02\x10\x00\x01\x02\x03\x04\x05\x06\x07\
                      \x08\x09\x0A\x0B\x0C\x0D\x0E\x0F\x3D\x51\xFD\xFE";
        let frame = Frame::new(2, &(0..16).collect::<Vec<u8>>()).unwrap();
        let (frames, counters) = heard_by(Rc9::default(), bytes);
        assert_eq!((frames.as_slice(), counters.skipped), (&[frame][..], 0));
        assert_eq!(frame.pack(), bytes);
        assert_eq!(frame.data()[15], 15);
    }

    #[test]
    fn every_length_goes_there_and_back() {
        for len in 0..=64 {
            let data: Vec<u8> = (0..len).map(|at| at ^ 0xFC).collect();
            let frame = Frame::new(len, &data).unwrap();
            assert_eq!(heard(&frame.pack()), [frame]);
            assert_eq!((frame.id(), frame.data()), (len, data.as_slice()));
        }
        assert_eq!(Frame::new(1, &[0; 65]), Err(FrameError::TooLong(65)));
        // A frame that says it had 65 is invalid, and costs no other.
        let good = Frame::new(1, &[7; 3]).unwrap();
        let too_long = [&[0xFC, 0xFB, 1, 65][..], &[0; 65], &[0, 0, 0xFD, 0xFE]].concat();
        assert_eq!(heard(&[&too_long[..], &good.pack()].concat()), [good]);
    }

    #[test]
    fn numbers_are_finite() {
        let numbers: Vec<f32> = (0..16).map(|at| at as f32 - 3.5).collect();
        let frame = Frame::of_floats(9, &numbers).unwrap();
        assert_eq!(frame.floats().unwrap().as_slice(), numbers);
        assert_eq!(Frame::of_floats(9, &[1.0; 17]), Err(FrameError::TooLong(68)));
        assert_eq!(Frame::of_floats(9, &[0.0, f32::NAN]), Err(FrameError::NotFinite(1)));
        let infinite = Frame::new(1, &f32::INFINITY.to_le_bytes()).unwrap();
        assert_eq!(infinite.floats(), None);
        assert_eq!(Frame::new(1, &[0; 5]).unwrap().floats(), None);
        let text = FrameError::TooLong(68).to_string();
        assert_eq!(text, "68 bytes of data: an RC9 frame has at most 64");
    }

    #[test]
    fn a_crc_of_zero_is_no_crc_only_if_asked_for() {
        let mut bytes = Frame::new(1, &[1, 2, 3, 4]).unwrap().pack();
        let len = bytes.len();
        bytes[len - 4..len - 2].fill(0);
        assert_eq!(heard(&bytes), []);
        let unchecked = Rc9 { unchecked: true };
        assert_eq!(heard_by(unchecked, &bytes).0[0].data(), [1, 2, 3, 4]);
        // Any other is still checked.
        bytes[len - 3] = 1;
        assert_eq!(heard_by(unchecked, &bytes).1.damaged, 1);
    }

    #[test]
    fn nothing_in_between_costs_a_frame() {
        let one = Frame::new(1, &[0xFC, 0xFB, 0xFD, 0xFE, 0xFC]).unwrap();
        let two = Frame::new(2, &[]).unwrap();
        for piece in [&[0xFC][..], &[0xFC, 0xFC], &[0xFC, 0xFB], &[0xFD, 0xFE], &one.pack()[..9]] {
            let long = Frame::new(3, &[0; MOST]).unwrap();
            let bytes = [piece, &one.pack(), &two.pack(), &long.pack()].concat();
            assert_eq!(heard(&bytes), [one, two, long], "{piece:02X?}");
        }
    }

    #[test]
    fn any_wrong_byte_is_noticed_but_the_identifiers() {
        let (good, next) =
            (Frame::new(1, &[10, 20, 30]).unwrap(), Frame::new(2, &[7; 40]).unwrap());
        for at in (0..good.pack().len()).filter(|at| *at != 2) {
            let mut spoilt = good.pack();
            spoilt[at] ^= 0x10;
            let bytes = [&spoilt[..], &next.pack(), &good.pack(), &next.pack()].concat();
            let frames = heard(&bytes);
            assert!(!frames.contains(&Frame { id: 1, ..next }), "{at}");
            assert_eq!(frames, [next, good, next], "{at}");
        }
    }
}
