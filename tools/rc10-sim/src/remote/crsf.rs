//! The "crossfire" protocol, as receivers of TBS and `ExpressLRS` speak it.

use std::collections::VecDeque;

use super::channels::{AETR, packed};
use super::{Remote, characters};
use crate::Nanos;
use crate::serial::{SerialConfig, SerialDevice};

/// 150 packets a second.
const PERIOD: Nanos = Nanos::new(6_666_667);
/// Packets from one with statistics to the next.
const STATISTICS_EVERY: u32 = 15;
/// To a flight controller.
const ADDRESS: u8 = 0xC8;
const CHANNELS: u8 = 0x16;
const LINK_STATISTICS: u8 = 0x14;

/// A CRSF receiver: a frame of channels for every packet it hears, 150 a second, and statistics of
/// the link ten times a second in any case. The link quality in these is how many of the last
/// hundred packets it heard, and so falls to 0 within 0.7 s.
#[derive(Debug)]
pub struct Crsf {
    remote: Remote,
    phase: Nanos,
    next: Nanos,
    packets: u32,
    quality: u8,
}

impl Crsf {
    /// The UART: 420 kbaud, 8N1.
    pub const SERIAL: SerialConfig =
        SerialConfig { baud: 420_000, bits: 10, receive_capacity: 256 };

    /// A receiver that sends its first frame at `phase` after power-on.
    pub fn new(remote: &Remote, phase: Nanos) -> Self {
        Self { remote: remote.clone(), phase, next: Nanos::ZERO, packets: 0, quality: 0 }
    }
}

impl SerialDevice for Crsf {
    fn power_on(&mut self, now: Nanos) {
        self.next = now + self.phase;
        (self.packets, self.quality) = (0, 100);
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        self.next = now + PERIOD;
        match self.remote.heard() {
            Some(controls) => {
                self.quality = (self.quality + 1).min(100);
                let packed = packed(&self.remote.mixer(AETR), &controls);
                send.extend(frame(CHANNELS, &packed));
                let end = now + characters(send.len(), Self::SERIAL.character());
                self.remote.sends(true, end);
            }
            None => {
                self.quality = self.quality.saturating_sub(1);
                self.remote.pauses();
            }
        }
        if self.packets.is_multiple_of(STATISTICS_EVERY) {
            send.extend(frame(LINK_STATISTICS, &statistics(self.quality)));
            self.remote.reports();
        }
        self.packets = self.packets.wrapping_add(1);
    }
}

/// Uplink: strength at both antennas (-dBm), quality (%), signal to noise (dB), antenna, mode,
/// power; downlink: strength, quality, signal to noise.
const fn statistics(quality: u8) -> [u8; 10] {
    let strength = if quality == 0 { 130 } else { 70 };
    [strength, strength, quality, 8, 0, 5, 3, strength, quality, 8]
}

/// Address, length of what follows, type, payload, checksum over type and payload.
fn frame(kind: u8, payload: &[u8]) -> Vec<u8> {
    #[expect(clippy::cast_possible_truncation, reason = "22 bytes at most")]
    let length = payload.len() as u8 + 2;
    let mut frame = vec![ADDRESS, length, kind];
    frame.extend(payload);
    frame.push(checksum(&frame[2..]));
    frame
}

/// CRC-8 with polynomial 0xD5.
fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| (crc << 1) ^ if crc & 0x80 == 0 { 0 } else { 0xD5 })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remote::Controls;

    #[test]
    fn checksum_and_frames_are_those_of_the_specification() {
        assert_eq!(checksum(b"123456789"), 0xBC);
        let rest = b"\xC8\x18\x16\xE0\x03\x1F\xF8\xC0\x07\x3E\xF0\x81\x0F\x7C\
            \xE0\x03\x1F\xF8\xC0\x07\x3E\xF0\x81\x0F\x7C\xAD";
        assert_eq!(frame(CHANNELS, &packed(&AETR, &Controls::REST)), rest);
        let payload = [70, 72, 98, 0xF6, 1, 2, 3, 80, 95, 5];
        let statistics = b"\xC8\x0C\x14\x46\x48\x62\xF6\x01\x02\x03\x50\x5F\x05\xFA";
        assert_eq!(frame(LINK_STATISTICS, &payload), statistics);
    }

    #[test]
    fn without_a_remote_only_statistics_go_on_and_get_worse() {
        let remote = Remote::new();
        let mut receiver = Crsf::new(&remote, Nanos::ZERO);
        receiver.power_on(Nanos::ZERO);
        let mut frames = |count: u32| {
            let mut send = VecDeque::new();
            (0..count).for_each(|_| receiver.advance(Nanos::ZERO, &mut send));
            let bytes: Vec<u8> = send.into();
            let quality = bytes.len().checked_sub(9).map(|at| bytes[at]);
            (bytes.len(), quality)
        };
        assert_eq!(frames(15).0, 15 * 26 + 14);
        remote.set_transmitter(false);
        assert_eq!(frames(1), (14, Some(99)));
        assert_eq!(frames(29), (14, Some(84)));
        assert_eq!(frames(75 + 1), (6 * 14, Some(0)));
        remote.set_transmitter(true);
        assert_eq!(frames(1).0, 26);
        // The statistics are frames, too.
        assert_eq!((remote.sent().frames, remote.sent().live), (16 + 9, 16));
    }
}
