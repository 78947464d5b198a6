//! LDROBOT STP-23L: UART, 230400 baud 8N1, ten frames a second of twelve points, little endian.
//!
//! | byte | |
//! |---|---|
//! | 0 ..= 3 | `AA AA AA AA` |
//! | 4 | address, reserved |
//! | 5 | `02`: distances |
//! | 6, 7 | offset, 0 |
//! | 8, 9 | length of what follows up to the sum, 184 |
//! | 10 ..= 189 | twelve points of 15 bytes: distance 2, noise 2, peak 4, confidence 1, integration 4, reference 2 |
//! | 190 ..= 193 | time stamp |
//! | 194 | sum of bytes 4 to 193 |
//!
//! Sources: LDROBOT's ROS driver, three teams' drivers, and a capture checked by tape measure.

use super::{Doubt, Range};
use crate::sum::sum;
use crate::{Found, Protocol};

const LEN: usize = 195;
const HEAD: u8 = 0xAA;
/// Bytes before the points.
const HEADER: usize = 10;
/// The other commands are answers to what this module never sends.
const DISTANCES: u8 = 0x02;
const POINTS: usize = 12;
const POINT_LEN: usize = 15;
/// The sensor's reach, in mm (data sheet).
const REACH: core::ops::RangeInclusive<u16> = 30..=7500;

/// The protocol of an STP-23L.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stp23l;

/// One of the twelve measurements of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Point {
    /// In millimetres, as the device has it.
    pub millimetres: u16,
    /// Light from elsewhere, in units of the device.
    pub noise: u16,
    /// Light that came back, in units of the device.
    pub peak: u32,
    /// 0: none. 100 is what every published capture shows.
    pub confidence: u8,
    /// Pulses that were added up: the more, the weaker each was.
    pub integration: u32,
    /// The time of flight within the device, for its temperature: no distance.
    pub reference: u16,
}

/// The content of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Measurement {
    /// One after the other.
    pub points: [Point; POINTS],
    /// The device's own clock; its unit is not documented.
    pub timestamp: u32,
}

impl Point {
    fn of(bytes: &[u8; POINT_LEN]) -> Self {
        let &[d0, d1, n0, n1, p0, p1, p2, p3, confidence, i0, i1, i2, i3, r0, r1] = bytes;
        Self {
            millimetres: u16::from_le_bytes([d0, d1]),
            noise: u16::from_le_bytes([n0, n1]),
            peak: u32::from_le_bytes([p0, p1, p2, p3]),
            confidence,
            integration: u32::from_le_bytes([i0, i1, i2, i3]),
            reference: u16::from_le_bytes([r0, r1]),
        }
    }

    /// Whether it has a confidence, and is within the device's reach of 30 to 7500 mm.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.confidence > 0 && REACH.contains(&self.millimetres)
    }
}

impl Measurement {
    /// The median of the good points, if more than half of the twelve are good: a stray one moves
    /// a mean, but no median. It is about 50 ms old when it arrives. A few good points are
    /// [`Unsteady`](Doubt::Unsteady), none at all means that there is nothing within reach.
    pub fn range(&self) -> Range {
        let mut good = heapless::Vec::<u16, POINTS>::new();
        for point in self.points.iter().filter(|point| point.is_good()) {
            let _ = good.push(point.millimetres);
        }
        good.sort_unstable();
        match good.get(good.len() / 2) {
            Some(&median) if good.len() * 2 > POINTS => Range::Distance(median.into()),
            Some(_) => Range::Unreliable(Doubt::Unsteady),
            None => Range::OutOfRange,
        }
    }
}

impl Protocol for Stp23l {
    type Message = Measurement;
    type Buffer = heapless::Vec<u8, LEN>;

    fn examine(&self, bytes: &[u8]) -> Found<Measurement> {
        let &[HEAD, ..] = bytes else { return Found::Nothing };
        let Some(frame) = bytes.first_chunk::<LEN>() else { return Found::More(LEN) };
        let [body @ .., t0, t1, t2, t3, check] = frame;
        let (header, points) = body.split_at(HEADER);
        let [HEAD, HEAD, HEAD, HEAD, _, DISTANCES, 0, 0, 184, 0] = header else {
            return Found::Nothing;
        };
        if sum(&frame[4..LEN - 1]) != *check {
            return Found::Damaged;
        }
        let mut measurement = Measurement {
            points: [Point::default(); POINTS],
            timestamp: u32::from_le_bytes([*t0, *t1, *t2, *t3]),
        };
        let (points, _) = points.as_chunks::<POINT_LEN>();
        for (point, bytes) in measurement.points.iter_mut().zip(points) {
            *point = Point::of(bytes);
        }
        Found::Frame(LEN, measurement)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::{Counters, Stream};
    use rc10_time::Micros;
    use std::vec::Vec;

    /// Points of one frame: distance and confidence of each.
    fn frame(points: [(u16, u8); POINTS], timestamp: u32) -> Vec<u8> {
        let mut frame = std::vec![0xAA, 0xAA, 0xAA, 0xAA, 0, 2, 0, 0, 0xB8, 0];
        for (distance, confidence) in points {
            let [d0, d1] = distance.to_le_bytes();
            let rest = [0x88, 0x13, 0, 0x01, confidence, 0xBC, 0x02, 0, 0, 0xB2, 0x01];
            frame.extend([d0, d1, 0x0A, 0]);
            frame.extend(rest);
        }
        frame.extend(timestamp.to_le_bytes());
        frame.push(sum(&frame[4..]));
        frame
    }

    fn heard(bytes: &[u8]) -> (Vec<Measurement>, Counters) {
        let (mut stream, mut heard) = (Stream::new(Stp23l), Vec::new());
        stream.receive(bytes, Micros::ZERO, |measurement| heard.push(measurement));
        (heard, stream.counters())
    }

    #[test]
    fn a_frame_field_by_field() {
        let mut points = [(1000, 100); POINTS];
        points[11] = (0x1234, 99);
        let (heard, counters) = heard(&frame(points, 0x0102_0304));
        assert_eq!((heard.len(), counters.frames, counters.skipped), (1, 1, 0));
        assert_eq!(heard[0].timestamp, 0x0102_0304);
        let last = Point {
            millimetres: 0x1234,
            noise: 10,
            peak: 0x0100_1388,
            confidence: 99,
            integration: 700,
            reference: 434,
        };
        assert_eq!(heard[0].points[11], last);
        assert_eq!(heard[0].points[0], Point { millimetres: 1000, confidence: 100, ..last });
    }

    #[test]
    fn the_median_of_the_good_points_counts() {
        let range = |points| heard(&frame(points, 0)).0[0].range();
        let mut points = [(2000, 100); POINTS];
        points[3] = (7499, 100);
        points[4] = (30, 100);
        points[5] = (1, 0);
        assert_eq!(range(points), Range::Distance(2000));
        // In any order; of an even number the upper of the two in the middle.
        let mut distances = (100..112).rev();
        let descending = points.map(|_| (distances.next().unwrap(), 1));
        assert_eq!(range(descending), Range::Distance(106));
    }

    #[test]
    fn every_state_at_its_limits() {
        let range = |points| heard(&frame(points, 0)).0[0].range();
        let good = |count| core::array::from_fn(|at| if at < count { (500, 100) } else { (0, 0) });
        assert_eq!(range(good(7)), Range::Distance(500));
        assert_eq!(range(good(6)), Range::Unreliable(Doubt::Unsteady));
        assert_eq!(range(good(1)), Range::Unreliable(Doubt::Unsteady));
        assert_eq!(range(good(0)), Range::OutOfRange);
        assert_eq!(range([(500, 0); POINTS]), Range::OutOfRange);
        for (distance, is_within) in [(29, false), (30, true), (7500, true), (7501, false)] {
            let within = range([(distance, 100); POINTS]) == Range::Distance(distance.into());
            assert_eq!(within, is_within, "{distance}");
        }
        // Vendor code has a signed distance: a negative one is out of reach, too.
        assert_eq!(range([(0xFFFF, 100); POINTS]), Range::OutOfRange);
    }

    /// However many AA stand before, and though AA stands in the points.
    #[test]
    fn a_run_of_heads_costs_no_frame() {
        let good = frame([(0x0AAA, 0xAA); POINTS], 0xAAAA_AAAA);
        for extra in 0..9_u8 {
            let bytes = [&std::vec![0xAA; extra.into()], good.as_slice(), &good].concat();
            let (heard, counters) = heard(&bytes);
            assert_eq!((heard.len(), counters.skipped), (2, u32::from(extra)), "{extra}");
        }
    }

    #[test]
    fn any_wrong_byte_is_noticed_and_costs_one_frame() {
        let good = frame([(1500, 100); POINTS], 7);
        // Byte 4 is reserved: only the sum minds it.
        for at in 0..LEN {
            let mut spoilt = good.clone();
            spoilt[at] ^= 0x10;
            let (heard, counters) = heard(&[spoilt, good.clone(), good.clone()].concat());
            assert_eq!((heard.len(), counters.frames), (2, 2), "{at}");
            assert_eq!(counters.skipped, 195, "{at}");
        }
    }

    #[test]
    fn other_packets_and_a_lost_byte_are_no_frame() {
        let good = frame([(1500, 100); POINTS], 7);
        let acknowledgement = [0xAA, 0xAA, 0xAA, 0xAA, 0, 0x10, 0, 0, 2, 0, 2, 1, 0x15];
        let mut short = good.clone();
        short.remove(100);
        let bytes = [&acknowledgement[..], &short, &good, &good].concat();
        assert_eq!(heard(&bytes).0.len(), 2);
    }
}
