use rc10_module::referee::{self, Packet};

use super::super::wire::{Guard, Source, Wire, crc_reflected, numbers, word};

/// RoboMaster's referee system: 115,200 baud 8N1, 9 bytes and up to 300 of data.
#[derive(Clone, Copy, Debug)]
pub struct Referee;

/// The CRC of a frame's head, by long division.
fn head_crc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0xFF, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc: u8, _| if crc & 1 == 1 { crc >> 1 ^ 0x8C } else { crc >> 1 })
    })
}

impl Wire for Referee {
    type Protocol = referee::Referee;

    const BYTE_NS: u64 = 86_806;
    const HEADER: &'static [u8] = &[0xA5];
    const GUARD: Guard = Guard::Checksum { not_over: &[] };

    fn protocol(self) -> referee::Referee {
        referee::Referee
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let [sequence, c0, c1] = source.bytes();
        // Short ones mostly, as a robot hears them; now and then the longest.
        let length = match source.between(0, 31) {
            31 => 300,
            length => length,
        };
        let mut frame = vec![0xA5];
        frame.extend(length.to_le_bytes());
        frame.push(sequence);
        frame.push(head_crc(&frame));
        frame.extend([c0, c1]);
        frame.extend((0..length).map(|_| source.bytes::<1>()[0]));
        let crc = crc_reflected(&frame, 0xFFFF, 0x8408);
        frame.extend(crc.to_le_bytes());
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let head =
            bytes.get(..5).filter(|head| head[0] == 0xA5 && head_crc(&head[..4]) == head[4])?;
        let length = 9 + usize::from(word(head, 1));
        let frame = bytes.get(..length).filter(|_| length <= 309)?;
        (crc_reflected(&frame[..length - 2], 0xFFFF, 0x8408) == word(frame, length - 2))
            .then_some(length)
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        let data: Vec<u16> = frame[7..frame.len() - 2].iter().copied().map(u16::from).collect();
        Some(numbers(&[&[frame[3].into(), word(frame, 5)], &data]))
    }

    fn told(self, message: &Packet) -> Vec<f64> {
        let data: Vec<u16> = message.data.iter().copied().map(u16::from).collect();
        numbers(&[&[message.sequence.into(), message.command], &data])
    }
}
