use rc10_module::imu::{self, wit::Message};

use super::super::wire::{Guard, Source, Wire, sum, word};

/// WIT modules: 115,200 baud 8N1, eleven bytes, several one behind the other.
#[derive(Clone, Copy, Debug)]
pub struct Wit;

const LENGTH: usize = 11;

impl Wire for Wit {
    type Protocol = imu::Wit;

    const BYTE_NS: u64 = 86_806;
    const HEADER: &'static [u8] = &[0x55, 0x51, 0x52, 0x53];
    const GUARD: Guard = Guard::Checksum { not_over: &[] };

    fn protocol(self) -> imu::Wit {
        imu::Wit
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let kind = match source.byte() {
            rare @ 0xE0.. => 0x50 | rare & 0xF,
            usual => 0x51 + usual % 3,
        };
        let mut frame = [&[0x55, kind][..], &source.bytes::<8>()].concat();
        frame.push(sum(&frame));
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..LENGTH)?;
        let good = frame[0] == 0x55 && frame[1] >> 4 == 5 && sum(&frame[..10]) == frame[10];
        good.then_some(LENGTH)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let [x, y, z, w] = [2, 4, 6, 8].map(|at| f64::from(word(frame, at).cast_signed()));
        let scaled = |full: f64| [x, y, z].map(|counts| counts / 32768.0 * full);
        match frame[1] {
            0x51 => Some([&scaled(16.0)[..], &[w / 100.0]].concat()),
            0x52 => Some(scaled(2000.0).to_vec()),
            0x53 => Some(scaled(180.0).to_vec()),
            _ => None,
        }
    }

    fn told(self, message: &Message) -> Vec<f64> {
        let numbers = match *message {
            Message::Acceleration { g: [x, y, z], temperature } => vec![x, y, z, temperature.get()],
            Message::Rate { degrees_per_second } => degrees_per_second.to_vec(),
            Message::Angle { roll, pitch, yaw } => vec![roll.get(), pitch.get(), yaw.get()],
        };
        numbers.into_iter().map(f64::from).collect()
    }
}
