use heapless::Vec;
use rc10_time::Micros;

use super::channels::eleven_bits;
use super::{ChannelMap, Remote};
use crate::{Found, Pause, Protocol};

/// CRSF of TBS and `ExpressLRS`: `address, length, type, payload, checksum`, 420 kbaud 8N1.
///
/// A frame has one of TBS's addresses, a length of 2 to 62 right for its type, and its checksum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Crsf;

/// One frame of CRSF that says something about the remote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CrsfFrame {
    /// Type 16: sixteen channels, 0 ..= 2047, like SBUS: [`pulse_width`](super::pulse_width).
    Channels([u16; 16]),
    /// Type 14.
    Link(LinkStatistics),
}

/// Quality of the radio link both ways; uplink is what the receiver hears.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinkStatistics {
    /// Signal strength at the receiver's two antennas, -255 ..= 0 dBm.
    pub uplink_rssi: [i16; 2],
    /// The share that the receiver hears, 0 ..= 100 %; 0: it does not hear the remote.
    pub uplink_quality: u8,
    /// Signal to noise at the receiver, dB.
    pub uplink_snr: i8,
    /// The antenna in use: 0 or 1.
    pub antenna: u8,
    /// Code of the packet rate; the maker's.
    pub rf_mode: u8,
    /// Code of the transmitter's power: 0 mW, 10, 25, 100, 500, 1000, 2000, 250, 50 mW.
    pub transmit_power: u8,
    /// Signal strength at the transmitter, dBm.
    pub downlink_rssi: i16,
    /// The share of the telemetry that the transmitter hears, %.
    pub downlink_quality: u8,
    /// Signal to noise at the transmitter, dB.
    pub downlink_snr: i8,
}

/// The longest frame: length 62, and the two bytes before it counts.
const LONGEST: usize = 64;
/// TBS's device addresses: broadcast, flight controller, handset, receiver, transmitter module.
const ADDRESSES: [u8; 5] = [0x00, 0xC8, 0xEA, 0xEC, 0xEE];
const CHANNELS: u8 = 0x16;
const LINK_STATISTICS: u8 = 0x14;
/// The longest frame takes 1.5 ms.
const PAUSE: Micros = Micros::from_millis(2);

/// Half a byte's worth of CRC-8 with polynomial D5.
const CRC_TABLE: [u8; 16] = {
    let mut table = [0; 16];
    let mut half: u8 = 0;
    while half < 16 {
        let mut crc = half << 4;
        let mut bit = 0;
        while bit < 4 {
            crc = if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ 0xD5 };
            bit += 1;
        }
        table[half as usize] = crc;
        half += 1;
    }
    table
};

/// CRC-8/DVB-S2: polynomial D5, from 0.
fn crc(bytes: &[u8]) -> u8 {
    let half = |crc: u8| crc << 4 ^ CRC_TABLE[usize::from(crc >> 4)];
    bytes.iter().fold(0, |crc, byte| half(half(crc ^ byte)))
}

impl Protocol for Crsf {
    type Message = CrsfFrame;
    type Buffer = Vec<u8, LONGEST>;

    const PAUSE: Option<Pause> = Some(Pause::Ends(PAUSE));

    fn examine(&self, bytes: &[u8]) -> Found<CrsfFrame> {
        let Some((address, rest)) = bytes.split_first() else { return Found::More(1) };
        if !ADDRESSES.contains(address) {
            return Found::Nothing;
        }
        let [length, kind, ..] = *rest else { return Found::More(3) };
        let is_right = match kind {
            CHANNELS => length == 24,
            LINK_STATISTICS => length == 12,
            _ => (2..=62).contains(&length),
        };
        if !is_right {
            return Found::Nothing;
        }
        let whole = usize::from(length) + 2;
        let Some([_, _, checked @ .., checksum]) = bytes.get(..whole) else {
            return Found::More(whole);
        };
        if crc(checked) != *checksum {
            return Found::Damaged;
        }
        match checked {
            [CHANNELS, packed @ ..] => {
                Found::Frame(whole, CrsfFrame::Channels(eleven_bits(packed)))
            }
            [LINK_STATISTICS, payload @ ..] => {
                payload.try_into().map_or(Found::Nothing, |payload| {
                    Found::Frame(whole, CrsfFrame::Link(LinkStatistics::unpack(payload)))
                })
            }
            _ => Found::Other(whole),
        }
    }
}

impl LinkStatistics {
    /// TBS's CRSF document, frame 14: signal strengths are negative, and sent without their sign.
    fn unpack(payload: &[u8; 10]) -> Self {
        let [rssi_1, rssi_2, uplink_quality, uplink_snr, antenna, rf_mode, others @ ..] = *payload;
        let [transmit_power, downlink_rssi, downlink_quality, downlink_snr] = others;
        Self {
            uplink_rssi: [-i16::from(rssi_1), -i16::from(rssi_2)],
            uplink_quality,
            uplink_snr: uplink_snr.cast_signed(),
            antenna,
            rf_mode,
            transmit_power,
            downlink_rssi: -i16::from(downlink_rssi),
            downlink_quality,
            downlink_snr: downlink_snr.cast_signed(),
        }
    }
}

/// Makes a [`Remote`] of CRSF's frames, which each say only a part.
///
/// Link statistics with an uplink quality of 0 say that the receiver does not hear the remote: a
/// failsafe. Until statistics say otherwise every frame of channels is one, too, for some receivers
/// go on with what they heard last. (`ExpressLRS` sends no channels then, which is as good.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrsfLink {
    map: ChannelMap<16>,
    newest: Remote,
}

impl CrsfLink {
    /// A link of which nothing was heard.
    #[must_use]
    pub fn new(map: ChannelMap<16>) -> Self {
        Self { map, newest: Remote::default() }
    }

    /// The state of the remote after a frame: `None` from statistics of a link that stands.
    pub fn hear(&mut self, frame: &CrsfFrame) -> Option<Remote> {
        match frame {
            CrsfFrame::Channels(channels) => {
                let failsafe = self.newest.failsafe;
                self.newest = Remote { failsafe, ..self.map.remote(channels) };
                Some(self.newest)
            }
            CrsfFrame::Link(link) => {
                self.newest.failsafe = link.uplink_quality == 0;
                self.newest.failsafe.then_some(self.newest)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stream;

    /// All channels 992.
    const CENTRED: [u8; 26] = [
        0xC8, 0x18, 0x16, 0xE0, 0x03, 0x1F, 0xF8, 0xC0, 0x07, 0x3E, 0xF0, 0x81, 0x0F, 0x7C, 0xE0,
        0x03, 0x1F, 0xF8, 0xC0, 0x07, 0x3E, 0xF0, 0x81, 0x0F, 0x7C, 0xAD,
    ];
    const LINK: [u8; 14] =
        [0xC8, 0x0C, 0x14, 0x46, 0x48, 0x62, 0xF6, 0x01, 0x02, 0x03, 0x50, 0x5F, 0x05, 0xFA];

    fn frame(kind: u8, payload: &[u8]) -> std::vec::Vec<u8> {
        let mut bytes = std::vec![0xC8, u8::try_from(payload.len()).unwrap() + 2, kind];
        bytes.extend(payload);
        bytes.push(crc(&bytes[2..]));
        bytes
    }

    fn heard(stream: &mut Stream<Crsf>, bytes: &[u8], at: u64) -> usize {
        let mut heard = 0;
        stream.receive(bytes, Micros::new(at), |_| heard += 1);
        heard
    }

    #[test]
    fn the_checksum_is_that_of_the_catalogue() {
        assert_eq!(crc(b"123456789"), 0xBC);
    }

    #[test]
    fn channels_and_statistics() {
        let centred = CrsfFrame::Channels([992; 16]);
        assert_eq!(Crsf.examine(&CENTRED), Found::Frame(26, centred));
        let Found::Frame(14, CrsfFrame::Link(link)) = Crsf.examine(&LINK) else { panic!() };
        assert_eq!((link.uplink_rssi, link.uplink_quality, link.uplink_snr), ([-70, -72], 98, -10));
        assert_eq!((link.antenna, link.rf_mode, link.transmit_power), (1, 2, 3));
        let down = (link.downlink_rssi, link.downlink_quality, link.downlink_snr);
        assert_eq!(down, (-80, 95, 5));
    }

    #[test]
    fn lengths_addresses_and_checksums_are_checked() {
        for at in 1..CENTRED.len() {
            assert!(matches!(Crsf.examine(&CENTRED[..at]), Found::More(more) if more > at));
        }
        for address in 0..=255 {
            let mut bytes = CENTRED;
            bytes[0] = address;
            let is_taken = matches!(Crsf.examine(&bytes), Found::Frame(..));
            assert_eq!(is_taken, ADDRESSES.contains(&address), "{address:02X}");
        }
        for bit in 0..8 * CENTRED.len() {
            let mut bytes = CENTRED;
            bytes[bit / 8] ^= 1 << (bit % 8);
            let taken = matches!(Crsf.examine(&bytes), Found::Frame(..) | Found::Other(_));
            // The checksum does not cover the address.
            assert!(!taken || bit < 8, "bit {bit}");
        }
        for length in [0, 1, 63, 255] {
            assert_eq!(Crsf.examine(&[0xC8, length, 0x29]), Found::Nothing, "{length}");
        }
        // Sound, but not as long as its type is.
        assert_eq!(Crsf.examine(&frame(CHANNELS, &[0; 21])), Found::Nothing);
        assert_eq!(Crsf.examine(&frame(LINK_STATISTICS, &[0; 11])), Found::Nothing);
        // A battery, the longest frame and the shortest.
        for payload in [&[1; 8][..], &[2; 60], &[]] {
            assert_eq!(Crsf.examine(&frame(8, payload)), Found::Other(payload.len() + 4));
        }
    }

    #[test]
    fn a_link_without_quality_is_a_failsafe_until_it_has_some() {
        let mut link = CrsfLink::new(ChannelMap::AETR);
        let quality = |uplink_quality| {
            CrsfFrame::Link(LinkStatistics { uplink_quality, ..LinkStatistics::default() })
        };
        let channels = CrsfFrame::Channels([1811; 16]);
        let failsafe = |remote: Option<Remote>| remote.map(|remote| remote.failsafe);
        assert_eq!(failsafe(link.hear(&quality(0))), Some(true));
        assert_eq!(failsafe(link.hear(&channels)), Some(true));
        assert_eq!(link.hear(&quality(1)), None);
        let remote = link.hear(&channels).unwrap();
        assert_eq!((remote.failsafe, remote.right.x), (false, 1.0));
        let lost = link.hear(&quality(0)).unwrap();
        assert_eq!((lost.failsafe, lost.right.x), (true, 1.0));
        assert_eq!(failsafe(link.hear(&channels)), Some(true));
        assert_eq!(link.hear(&quality(100)), None);
        assert_eq!(failsafe(link.hear(&channels)), Some(false));
    }

    #[test]
    fn silence_frees_a_frame_behind_a_false_header() {
        let mut stream = Stream::new(Crsf);
        // As if a frame of 62 were to come.
        let wire = [&[0xC8, 60, 0x29][..], &CENTRED, &LINK].concat();
        assert_eq!(heard(&mut stream, &wire, 0), 0);
        assert_eq!(heard(&mut stream, &[], 1999), 0);
        assert_eq!(heard(&mut stream, &[], 2000), 2);
        assert_eq!((stream.counters().frames, stream.counters().skipped), (2, 3));
        // Without silence the next frames do.
        assert_eq!(heard(&mut stream, &wire, 3000), 0);
        assert_eq!(heard(&mut stream, &CENTRED, 4000), 3);
    }
}
