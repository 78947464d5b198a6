use rc10_module::ranging::{self, tfmini::Measurement};

use super::super::wire::{Guard, Source, Wire, sum, word};

/// Benewake TFmini-Plus: 115200 baud 8N1, nine bytes.
#[derive(Clone, Copy, Debug)]
pub struct TfMini;

const LENGTH: usize = 9;

impl Wire for TfMini {
    type Protocol = ranging::TfMini;

    const BYTE_NS: u64 = 86_806;
    const HEADER: &'static [u8] = &[0x59];
    const GUARD: Guard = Guard::Checksum { not_over: &[] };

    fn protocol(self) -> ranging::TfMini {
        ranging::TfMini
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let mut frame = vec![0x59, 0x59];
        frame.extend(source.bytes::<6>());
        frame.push(sum(&frame));
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..LENGTH)?;
        (frame.starts_with(&[0x59, 0x59]) && sum(&frame[..8]) == frame[8]).then_some(LENGTH)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let [distance, strength, temperature] = [2, 4, 6].map(|at| f64::from(word(frame, at)));
        Some(vec![distance, strength, temperature / 8.0 - 256.0])
    }

    fn told(self, message: &Measurement) -> Vec<f64> {
        let Measurement { centimetres, strength, temperature } = *message;
        vec![centimetres.into(), strength.into(), temperature.get().into()]
    }
}
