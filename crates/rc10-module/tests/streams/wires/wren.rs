use rc10_module::Protocol;

use super::example::{self, Range};
use super::wire::{Guard, Source, Wire, sum, word};

/// Made up; see `docs/modules/README.md`.
#[derive(Clone, Copy, Debug)]
pub struct Wren;

impl Wire for Wren {
    type Protocol = example::Wren;

    const BYTE_NS: u64 = 86_806;
    const HEADER: &'static [u8] = &[0xA5, 0x5A];
    const GUARD: Guard = Guard::Checksum { not_over: &[] };

    fn protocol(self) -> example::Wren {
        example::Wren
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let mut frame = vec![0xA5, 0x5A, source.byte(), source.byte()];
        frame.push(sum(&frame));
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..5)?;
        (frame.starts_with(&[0xA5, 0x5A]) && sum(&frame[..4]) == frame[4]).then_some(5)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let millimetres = f64::from(word(frame, 2));
        Some(if millimetres == 65535.0 { vec![] } else { vec![millimetres / 1e3] })
    }

    fn told(self, message: &<example::Wren as Protocol>::Message) -> Vec<f64> {
        match message {
            Range::Distance(metres) => vec![f64::from(*metres)],
            Range::OutOfRange => vec![],
        }
    }
}
