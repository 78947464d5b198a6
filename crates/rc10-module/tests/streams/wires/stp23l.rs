use rc10_module::ranging::{self, stp23l::Measurement};

use super::super::wire::{Guard, Source, Wire, double_word, sum, word};

/// LDROBOT STP-23L: 230400 baud 8N1, 195 bytes.
#[derive(Clone, Copy, Debug)]
pub struct Stp23l;

const LENGTH: usize = 195;
const HEADER: [u8; 10] = [0xAA, 0xAA, 0xAA, 0xAA, 0, 2, 0, 0, 0xB8, 0];

impl Wire for Stp23l {
    type Protocol = ranging::Stp23l;

    const BYTE_NS: u64 = 43_403;
    const HEADER: &'static [u8] = &HEADER;
    const GUARD: Guard = Guard::Checksum { not_over: &[] };

    fn protocol(self) -> ranging::Stp23l {
        ranging::Stp23l
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let mut frame = HEADER.to_vec();
        frame.resize_with(LENGTH - 1, || source.byte());
        frame.push(sum(&frame[4..]));
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..LENGTH)?;
        // The address may be any.
        let good = frame[..4] == HEADER[..4]
            && frame[5..10] == HEADER[5..]
            && sum(&frame[4..LENGTH - 1]) == frame[LENGTH - 1];
        good.then_some(LENGTH)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let points = (10..190).step_by(15).flat_map(|at| {
            [
                f64::from(word(frame, at)),
                f64::from(word(frame, at + 2)),
                f64::from(double_word(frame, at + 4)),
                f64::from(frame[at + 8]),
                f64::from(double_word(frame, at + 9)),
                f64::from(word(frame, at + 13)),
            ]
        });
        Some(points.chain([f64::from(double_word(frame, 190))]).collect())
    }

    fn told(self, message: &Measurement) -> Vec<f64> {
        let points = message.points.iter().flat_map(|point| {
            [
                f64::from(point.millimetres),
                f64::from(point.noise),
                f64::from(point.peak),
                f64::from(point.confidence),
                f64::from(point.integration),
                f64::from(point.reference),
            ]
        });
        points.chain([f64::from(message.timestamp)]).collect()
    }
}
