use rc10_module::positioning::{self, rc9::Frame};

use super::super::wire::{Guard, Source, Wire, crc, word};

/// RC9 frames: 115,200 baud 8N1, `FC FB id length data CRC-16 FD FE`.
#[derive(Clone, Copy, Debug)]
pub struct Rc9;

impl Wire for Rc9 {
    type Protocol = positioning::Rc9;

    const BYTE_NS: u64 = 86_806;
    const HEADER: &'static [u8] = &[0xFC, 0xFB, 0xFD, 0xFE, 0x40];
    // The checksum is that of the data alone.
    const GUARD: Guard = Guard::Checksum { not_over: &[2] };

    fn protocol(self) -> positioning::Rc9 {
        positioning::Rc9 { unchecked: false }
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let id = source.byte();
        let length = source.between(0, 64);
        let mut frame = vec![0xFC, 0xFB, id, length as u8];
        frame.resize_with(usize::from(length) + 4, || source.byte());
        let crc = crc(&frame[4..], 0x1021);
        frame.extend(crc.to_le_bytes());
        frame.extend([0xFD, 0xFE]);
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let length = usize::from(*bytes.get(3)?);
        let frame = bytes.get(..length + 8)?;
        let good = length <= 64
            && frame.starts_with(&[0xFC, 0xFB])
            && frame.ends_with(&[0xFD, 0xFE])
            && crc(&frame[4..length + 4], 0x1021) == word(frame, length + 4);
        good.then_some(frame.len())
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let data = frame[4..frame.len() - 4].iter();
        Some([frame[2]].iter().chain(data).map(|byte| f64::from(*byte)).collect())
    }

    fn told(self, message: &Frame) -> Vec<f64> {
        if let Some(floats) = message.floats() {
            assert!(floats.iter().all(|number| number.is_finite()));
        }
        [message.id()].iter().chain(message.data()).map(|byte| f64::from(*byte)).collect()
    }
}
