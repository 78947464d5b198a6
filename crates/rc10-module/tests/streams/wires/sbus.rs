use rc10_module::remote::{self, SbusFrame};

use super::super::wire::{Guard, Source, Wire, bits, numbers, set_bits};

/// SBUS: 100 kbaud 8E2, 25 bytes, no checksum.
#[derive(Clone, Copy, Debug)]
pub struct Sbus;

const LENGTH: usize = 25;
/// SBUS, and the four of SBUS2.
const ENDS: [u8; 5] = [0x00, 0x04, 0x14, 0x24, 0x34];

impl Wire for Sbus {
    type Protocol = remote::Sbus;

    const BYTE_NS: u64 = 120_000;
    const HEADER: &'static [u8] = &[0x0F, 0x00];
    const GUARD: Guard = Guard::Shape;
    const GAP: (u64, u64) = (1_000, 11_000);

    fn protocol(self) -> remote::Sbus {
        remote::Sbus
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let mut frame = vec![0; LENGTH];
        frame[0] = 0x0F;
        for channel in 0..16 {
            set_bits(&mut frame, 8 + 11 * channel, 11, source.between(0, 2047));
        }
        frame[23] = source.byte() & 0x0F;
        frame[24] = ENDS[usize::from(source.between(0, 4))];
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let frame = bytes.get(..LENGTH)?;
        (frame[0] == 0x0F && frame[23] < 0x10 && ENDS.contains(&frame[24])).then_some(LENGTH)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let channels: Vec<_> = (0..16).map(|channel| bits(frame, 8 + 11 * channel, 11)).collect();
        let flags: Vec<_> = (0..4).map(|flag| bits(frame, 184 + flag, 1)).collect();
        Some(numbers(&[&channels, &flags]))
    }

    fn told(self, message: &SbusFrame) -> Vec<f64> {
        let [first, second] = message.digital;
        let flags = [first, second, message.frame_lost, message.failsafe].map(u16::from);
        numbers(&[&message.channels, &flags])
    }
}
