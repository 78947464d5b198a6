//! The made-up range finder of `docs/modules/README.md`: its parser.

use rc10_module::{Found, Protocol};

/// A measurement of a Wren W2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// So far, m.
    Distance(f32),
    /// Nothing comes back.
    OutOfRange,
}

/// The frames of a Wren W2: `A5 5A`, a distance in mm (`u16`, low byte first, 65535 if there is
/// none), and the low byte of the sum of what stands before.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wren;

/// Bytes of a frame.
const LENGTH: usize = 5;

impl Protocol for Wren {
    type Message = Range;
    type Buffer = heapless::Vec<u8, LENGTH>;

    fn examine(&self, bytes: &[u8]) -> Found<Range> {
        match *bytes {
            [0xA5, 0x5A, low, high, sum, ..] => {
                let right =
                    [0xA5, 0x5A, low, high].iter().fold(0_u8, |sum, b| sum.wrapping_add(*b));
                if sum != right {
                    return Found::Damaged;
                }
                let range = match u16::from_le_bytes([low, high]) {
                    u16::MAX => Range::OutOfRange,
                    millimetres => Range::Distance(f32::from(millimetres) / 1000.0),
                };
                Found::Frame(LENGTH, range)
            }
            [0xA5] | [0xA5, 0x5A, ..] => Found::More(LENGTH),
            _ => Found::Nothing,
        }
    }
}
