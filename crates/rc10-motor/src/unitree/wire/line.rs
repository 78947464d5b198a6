//! RS-485: commands of 17 bytes, replies of 16, found in a stream. Little endian.
//!
//! | command | | reply | |
//! |---|---|---|---|
//! | 0, 1 | `FE EE` | 0, 1 | `FD EE` |
//! | 2 | address, status | 2 | address, status |
//! | 3 ..= 4 | τ i16 | 3 ..= 4 | τ i16 |
//! | 5 ..= 6 | ω i16 | 5 ..= 6 | ω i16 |
//! | 7 ..= 10 | θ i32 | 7 ..= 10 | θ i32 |
//! | 11 ..= 12 | `k_pos` u16 | 11 | temperature i8, °C |
//! | 13 ..= 14 | `k_spd` u16 | 12 ..= 13 | error in bits 2 to 0, foot force in 14 to 3 |
//! | 15 ..= 16 | CRC | 14 ..= 15 | CRC |

use rc10_app::Celsius;

use super::{Address, RawImpedance, RawMotion, Status, fault, mode, split_mode};
use crate::feedback::Fault;

/// Bytes of a command.
pub const COMMAND_LEN: usize = 17;
/// Bytes of a reply.
pub const REPLY_LEN: usize = 16;

const COMMAND_HEAD: [u8; 2] = [0xFE, 0xEE];
const REPLY_HEAD: [u8; 2] = [0xFD, 0xEE];

/// CRC-16/KERMIT: 0x1021 reflected, from zero, not inverted; 0x2189 for "123456789".
///
/// Without a table: the taps of x¹⁶ + x¹² + x⁵ + 1 move a byte to three places.
pub fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc: u16, byte| {
        let mixed = (crc ^ u16::from(*byte)) & 0xFF;
        let fed = u16::from((mixed ^ mixed << 4).to_le_bytes()[0]);
        crc >> 8 ^ fed << 8 ^ fed << 3 ^ fed >> 4
    })
}

/// A command to one motor, or with [`Address::BROADCAST`] to all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Command {
    /// The motor it is for.
    pub address: Address,
    /// The status it is to have.
    pub status: Status,
    /// The motion it is to have, of the rotor.
    pub motion: RawMotion,
    /// The stiffness and damping with which it is to follow that motion, of the rotor.
    pub impedance: RawImpedance,
}

impl Command {
    /// The bytes, with their CRC.
    ///
    /// ```
    /// use rc10_motor::unitree::wire::{Address, RawImpedance, RawMotion, Status, line::Command};
    /// let calibrate = Command {
    ///     address: Address::new(3).unwrap(),
    ///     status: Status::CALIBRATE,
    ///     motion: RawMotion::default(),
    ///     impedance: RawImpedance::default(),
    /// };
    /// assert_eq!(calibrate.pack(), *b"\xFE\xEE\x23\0\0\0\0\0\0\0\0\0\0\0\0\x32\x98");
    /// ```
    pub fn pack(&self) -> [u8; COMMAND_LEN] {
        let [h0, h1] = COMMAND_HEAD;
        let [t0, t1] = self.motion.torque.to_le_bytes();
        let [w0, w1] = self.motion.speed.to_le_bytes();
        let [a0, a1, a2, a3] = self.motion.angle.to_le_bytes();
        let [p0, p1] = self.impedance.stiffness.to_le_bytes();
        let [d0, d1] = self.impedance.damping.to_le_bytes();
        let mode = mode(self.address, self.status);
        let body = [h0, h1, mode, t0, t1, w0, w1, a0, a1, a2, a3, p0, p1, d0, d1];
        let mut bytes = [0; COMMAND_LEN];
        bytes[..15].copy_from_slice(&body);
        bytes[15..].copy_from_slice(&crc(&body).to_le_bytes());
        bytes
    }
}

/// The motor that a command is for; `None` if it is no command.
pub fn destination(command: &[u8; COMMAND_LEN]) -> Option<Address> {
    let [body @ .., c0, c1] = command;
    let is_whole = body.starts_with(&COMMAND_HEAD) && crc(body) == u16::from_le_bytes([*c0, *c1]);
    is_whole.then(|| split_mode(body[2]).0)
}

/// A reply of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reply {
    /// The motor.
    pub address: Address,
    /// The status of the motor.
    pub status: Status,
    /// The motion it has, of the rotor.
    pub motion: RawMotion,
    /// The motor's temperature, in whole degrees.
    pub temperature: Celsius,
    /// The vendor's `MError`, 0 ..= 7; see [`fault`](Self::fault).
    pub error: u8,
    /// A pressure sensor in a robot dog's foot, 0 ..= 4095, in units of its own.
    pub foot_force: u16,
}

impl Reply {
    /// Decodes a reply.
    ///
    /// # Errors
    /// [`ReplyError`]: another length, another head, another CRC.
    pub fn unpack(bytes: &[u8]) -> Result<Self, ReplyError> {
        let bytes: &[u8; REPLY_LEN] = bytes.try_into().map_err(|_| ReplyError::Length)?;
        let [h0, h1, mode, t0, t1, w0, w1, a0, a1, a2, a3, temperature, e0, e1, c0, c1] = *bytes;
        if [h0, h1] != REPLY_HEAD {
            return Err(ReplyError::Head);
        }
        let (received, computed) = (u16::from_le_bytes([c0, c1]), crc(&bytes[..14]));
        if received != computed {
            return Err(ReplyError::Crc { received, computed });
        }
        let (address, status) = split_mode(mode);
        Ok(Self {
            address,
            status,
            motion: RawMotion {
                torque: i16::from_le_bytes([t0, t1]),
                speed: i16::from_le_bytes([w0, w1]),
                angle: i32::from_le_bytes([a0, a1, a2, a3]),
            },
            temperature: Celsius::new(temperature.cast_signed().into()),
            error: e0 & 7,
            foot_force: u16::from_le_bytes([e0, e1]) >> 3 & 0xFFF,
        })
    }

    /// The fault that the motor reports.
    pub fn fault(&self) -> Option<Fault> {
        fault(self.error)
    }
}

/// Why bytes are no reply of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplyError {
    /// Not sixteen bytes.
    #[error("a reply has sixteen bytes")]
    Length,
    /// Another head than `FD EE`.
    #[error("a reply begins with FD EE")]
    Head,
    /// The CRC does not match.
    #[error("CRC {received:04X} received, {computed:04X} computed")]
    Crc {
        /// The one that was received.
        received: u16,
        /// The one of the received bytes.
        computed: u16,
    },
}

/// Finds replies in a stream: none with a wrong CRC, and none lost within garbage.
///
/// A byte costs one comparison, or, at the end of sixteen like a reply, one CRC and one move.
///
/// ```
/// use rc10_motor::unitree::wire::line::Parser;
/// let mut parser = Parser::new();
/// let stream = b"\xFD\xFD\xEE\x10\xC0\0\x80\0\0\x20\0\0\x23\0\0\x12\x13";
/// let replies: Vec<_> = stream.iter().filter_map(|&byte| parser.push(byte)).collect();
/// assert_eq!((replies.len(), parser.skipped(), parser.crc_errors()), (1, 1, 0));
/// assert_eq!(replies[0].motion.torque, 192); // 0.75 N m at the rotor
/// ```
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "record", derive(serde::Serialize, serde::Deserialize))]
pub struct Parser {
    /// The first `len` of them begin like a reply; fewer than sixteen between calls.
    bytes: [u8; REPLY_LEN],
    len: usize,
    skipped: u32,
    crc_errors: u32,
}

impl Parser {
    /// Nothing received yet.
    pub const fn new() -> Self {
        Self { bytes: [0; REPLY_LEN], len: 0, skipped: 0, crc_errors: 0 }
    }

    /// Takes the next byte, and returns the reply that ends with it.
    pub fn push(&mut self, byte: u8) -> Option<Reply> {
        if let Some(next) = self.bytes.get_mut(self.len) {
            *next = byte;
            self.len += 1;
        }
        if self.len < REPLY_LEN {
            if self.len <= REPLY_HEAD.len() && !self.begins_at(0) {
                self.skip();
            }
            return None;
        }
        let Ok(reply) = Reply::unpack(&self.bytes) else {
            self.crc_errors = self.crc_errors.saturating_add(1);
            self.skip();
            return None;
        };
        self.len = 0;
        Some(reply)
    }

    /// Forgets a beginning whose rest will not come: after a reply's time-out.
    pub fn clear(&mut self) {
        self.count_skipped(self.len);
        self.len = 0;
    }

    /// Bytes that were not part of a reply, those of replies with a wrong CRC included.
    pub const fn skipped(&self) -> u32 {
        self.skipped
    }

    /// Sixteen bytes that began like a reply, but whose CRC was wrong.
    pub const fn crc_errors(&self) -> u32 {
        self.crc_errors
    }

    /// Whether a reply may begin with this byte of those held.
    fn begins_at(&self, at: usize) -> bool {
        let held = self.bytes.get(at..self.len).unwrap_or_default();
        held.iter().zip(REPLY_HEAD).all(|(byte, head)| *byte == head)
    }

    /// Skips the first byte, and all up to the next with which a reply may begin.
    fn skip(&mut self) {
        let next = (1..self.len).find(|&at| self.begins_at(at)).unwrap_or(self.len);
        self.bytes.copy_within(next..self.len, 0);
        self.len -= next;
        self.count_skipped(next);
    }

    fn count_skipped(&mut self, bytes: usize) {
        let bytes = u32::try_from(bytes).unwrap_or(u32::MAX);
        self.skipped = self.skipped.saturating_add(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::vec::Vec;

    /// SDK, executed: id 11, FOC, 85 °C, over-voltage.
    const REPLY: [u8; 16] = [
        0xFD, 0xEE, 0x1B, 0xC7, 0xCF, 0xA0, 0x5B, 0x4F, 0x97, 0x21, 0xC5, 0x55, 0x23, 0x03, 0xB0,
        0x5D,
    ];

    fn replies(parser: &mut Parser, stream: &[u8]) -> Vec<Reply> {
        stream.iter().filter_map(|&byte| parser.push(byte)).collect()
    }

    #[test]
    fn crc_is_kermit_and_the_short_form_is_the_long_one() {
        assert_eq!(crc(b"123456789"), 0x2189);
        for byte in 0..=u8::MAX {
            let bit = |crc: u16, _| if crc & 1 == 1 { crc >> 1 ^ 0x8408 } else { crc >> 1 };
            assert_eq!(crc(&[byte]), (0..8).fold(byte.into(), bit), "{byte}");
        }
    }

    #[test]
    fn command_is_the_vendor_s_bytes() {
        // SDK, executed; its truncation undone in θ, so with a CRC of our own.
        let command = Command {
            address: Address::new(0).unwrap(),
            status: Status::FOC,
            motion: RawMotion { torque: 192, speed: 127, angle: 8191 },
            impedance: RawImpedance { stiffness: 128, damping: 256 },
        };
        let bytes = [
            0xFE, 0xEE, 0x10, 0xC0, 0x00, 0x7F, 0x00, 0xFF, 0x1F, 0x00, 0x00, 0x80, 0x00, 0x00,
            0x01, 0xA6, 0x60,
        ];
        assert_eq!(command.pack(), bytes);
    }

    #[test]
    fn reply_is_what_the_vendor_reads() {
        let reply = Reply::unpack(&REPLY).unwrap();
        let expected = Reply {
            address: Address::new(11).unwrap(),
            status: Status::FOC,
            motion: RawMotion { torque: -12345, speed: 23456, angle: -987_654_321 },
            temperature: Celsius::new(85.0),
            error: 3,
            foot_force: 100,
        };
        assert_eq!(reply, expected);
        assert_eq!(reply.fault(), Some(Fault::new(3, "over-voltage")));
    }

    #[test]
    fn each_way_to_be_no_reply_is_named() {
        assert_eq!(Reply::unpack(&REPLY[..15]), Err(ReplyError::Length));
        assert_eq!(Reply::unpack(&[0; 17]), Err(ReplyError::Length));
        let mut command = REPLY;
        command[0] = 0xFE;
        assert_eq!(Reply::unpack(&command), Err(ReplyError::Head));
        for at in 2..16 {
            let mut broken = REPLY;
            broken[at] ^= 0x10;
            assert!(matches!(Reply::unpack(&broken), Err(ReplyError::Crc { .. })), "byte {at}");
        }
    }

    #[test]
    fn a_reply_hidden_in_another_s_beginning_is_found() {
        let good = Reply::unpack(&REPLY).unwrap();
        // What was cut off after any number of bytes delays the next reply, and loses none.
        for cut in 0..16 {
            let mut stream = REPLY[..cut].to_vec();
            stream.extend(REPLY);
            let mut parser = Parser::new();
            assert_eq!(replies(&mut parser, &stream), [good], "cut after {cut}");
            assert_eq!(parser.skipped() as usize, cut);
        }
    }

    #[test]
    fn a_broken_reply_is_counted_and_the_next_one_comes() {
        let mut broken = REPLY;
        broken[4] ^= 1;
        let mut parser = Parser::new();
        assert_eq!(replies(&mut parser, &broken), []);
        assert_eq!((parser.skipped(), parser.crc_errors()), (16, 1));
        assert_eq!(replies(&mut parser, &REPLY).len(), 1);
        assert_eq!((parser.skipped(), parser.crc_errors()), (16, 1));
    }

    #[test]
    fn clear_forgets_a_beginning() {
        let mut parser = Parser::new();
        assert_eq!(replies(&mut parser, &REPLY[..9]), []);
        parser.clear();
        assert_eq!(replies(&mut parser, &REPLY[9..]), []);
        assert_eq!(parser.skipped(), 16);
    }
}
