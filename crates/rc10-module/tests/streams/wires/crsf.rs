use rc10_module::remote::{self, CrsfFrame};

use super::super::wire::{Guard, Source, Wire, bits, numbers, set_bits};

/// TBS CRSF: 420 kbaud 8N1, `address, length, type, payload, CRC-8`.
#[derive(Clone, Copy, Debug)]
pub struct Crsf;

const ADDRESSES: [u8; 5] = [0xC8, 0x00, 0xEA, 0xEC, 0xEE];
const CHANNELS: u8 = 0x16;
const STATISTICS: u8 = 0x14;

/// CRC-8/DVB-S2, bit by bit.
fn crc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| if crc < 0x80 { crc << 1 } else { crc << 1 ^ 0xD5 })
    })
}

impl Wire for Crsf {
    type Protocol = remote::Crsf;

    const BYTE_NS: u64 = 23_810;
    const HEADER: &'static [u8] = &[0xC8, 0x18, 0x16, 0x3E];
    // An address more or less is all the same; a length may happen to end at a byte that fits.
    const GUARD: Guard = Guard::Checksum { not_over: &[0, 1] };

    fn protocol(self) -> remote::Crsf {
        remote::Crsf
    }

    fn frame(self, source: &mut Source<'_>) -> Vec<u8> {
        let address =
            if source.byte() < 0xC0 { 0xC8 } else { ADDRESSES[usize::from(source.between(0, 4))] };
        let kind = source.byte();
        let mut frame = match kind {
            0..0x80 => {
                let mut frame = vec![0; 25];
                (frame[1], frame[2]) = (24, CHANNELS);
                for channel in 0..16 {
                    set_bits(&mut frame, 24 + 11 * channel, 11, source.between(0, 2047));
                }
                frame
            }
            0x80..0xC0 => [&[0, 12, STATISTICS][..], &source.bytes::<10>()].concat(),
            _ => {
                // GPS, battery, attitude, and whatever there will be.
                let kind = [0x02, 0x08, 0x1E, 0x21, 0x29, 0x3A, 0x7A, 0x80][usize::from(kind % 8)];
                let length = source.between(2, 62);
                let mut frame = vec![0, length as u8, kind];
                frame.resize_with(usize::from(length) + 1, || source.byte());
                frame
            }
        };
        frame[0] = address;
        frame.push(crc(&frame[2..]));
        frame
    }

    fn frame_at(self, bytes: &[u8]) -> Option<usize> {
        let [address, length, kind, ..] = *bytes else { return None };
        let lengths = match kind {
            CHANNELS => 24..=24,
            STATISTICS => 12..=12,
            _ => 2..=62,
        };
        let frame = bytes.get(..usize::from(length) + 2)?;
        let (last, rest) = frame.split_last()?;
        let good = ADDRESSES.contains(&address) && lengths.contains(&length);
        (good && crc(&rest[2..]) == *last).then_some(frame.len())
    }

    fn says(self, frame: &[u8]) -> Option<Vec<f64>> {
        match frame[2] {
            CHANNELS => {
                let channels: Vec<_> = (0..16).map(|n| bits(frame, 24 + 11 * n, 11)).collect();
                Some(numbers(&[&channels]))
            }
            STATISTICS => {
                let told = frame[3..13].iter().enumerate().map(|(at, byte)| match at {
                    0 | 1 | 7 => -f64::from(*byte),
                    3 | 9 => f64::from(byte.cast_signed()),
                    _ => f64::from(*byte),
                });
                Some(told.collect())
            }
            _ => None,
        }
    }

    fn told(self, message: &CrsfFrame) -> Vec<f64> {
        match message {
            CrsfFrame::Channels(channels) => numbers(&[channels]),
            CrsfFrame::Link(link) => [
                link.uplink_rssi[0],
                link.uplink_rssi[1],
                link.uplink_quality.into(),
                link.uplink_snr.into(),
                link.antenna.into(),
                link.rf_mode.into(),
                link.transmit_power.into(),
                link.downlink_rssi,
                link.downlink_quality.into(),
                link.downlink_snr.into(),
            ]
            .map(f64::from)
            .to_vec(),
        }
    }
}
