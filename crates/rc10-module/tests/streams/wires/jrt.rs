use rc10_module::ranging::{self, jrt::Answer};

use super::super::wire::{Guard, Source, Wire, sum};

/// Lasers of the JRT type: 19,200 baud 8N1, `head, address, register, words, data, sum`.
#[derive(Clone, Copy, Debug)]
pub struct Jrt;

impl Wire for Jrt {
    type Protocol = ranging::Jrt;

    const BYTE_NS: u64 = 520_833;
    const HEADER: &'static [u8] = &[0xAA, 0xEE, 0x00, 0x22, 0x03, 0x01];
    // Neither the head; nor where the sum stands if the number of words is wrong.
    const GUARD: Guard = Guard::Checksum { not_over: &[0, 4, 5] };

    fn protocol(self) -> ranging::Jrt {
        ranging::Jrt
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let address = source.byte() & 0x7F;
        let mut frame = match source.byte() {
            // A result, an error, and the echo of a command.
            0..0x80 => [&[0xAA, address, 0x00, 0x22, 0, 3][..], &source.bytes::<6>()].concat(),
            0x80..0xC0 => vec![0xEE, address, 0x00, 0x00, 0, 1, 0, source.byte() | 1],
            speed => vec![0xAA, address, 0x00, 0x20, 0, 1, 0, speed & 7],
        };
        frame.push(sum(&frame[1..]));
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let words = usize::from(*bytes.get(5)?);
        let good = matches!(bytes[0], 0xAA | 0xEE) && bytes[4] == 0 && matches!(words, 1..=3);
        let frame = bytes.get(..7 + 2 * words)?;
        let (last, rest) = frame.split_last()?;
        (good && sum(&rest[1..]) == *last).then_some(frame.len())
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let number = |bytes: &[u8]| {
            f64::from(bytes.iter().fold(0_u32, |value, byte| value << 8 | u32::from(*byte)))
        };
        let address = f64::from(frame[1] & 0x7F);
        match *frame {
            [0xAA, _, 0x00, 0x22, 0, 3, ..] => {
                Some(vec![address, number(&frame[6..10]), number(&frame[10..12])])
            }
            [0xEE, _, _, _, 0, 1, high, low, _] if (high, low) != (0, 0) => {
                Some(vec![address, number(&[high, low])])
            }
            _ => None,
        }
    }

    fn told(self, message: &Answer) -> Vec<f64> {
        match *message {
            Answer::Result { address, millimetres, quality } => {
                vec![address.into(), millimetres.into(), quality.into()]
            }
            Answer::Error { address, code } => vec![address.into(), code.into()],
        }
    }
}
