//! ACTION positioning, two odometer wheels and a gyroscope: UART, 115200 baud 8N1, little endian.
//!
//! | byte | |
//! |---|---|
//! | 0, 1 | `0D 0A` |
//! | 2 ..= 25 | six f32: yaw, angle about x, angle about y, in degrees; x, y in mm; yaw rate |
//! | 26, 27 | `0A 0D` |
//!
//! **There is no checksum**, only head, tail, and finite numbers below a million. A program that
//! steers by this must refuse a pose that is further from the last than the robot can be.
//!
//! Source: seven public parsers of Robocon teams, which agree; commands from two of them.

use rc10_app::Degrees;

use crate::{Found, Protocol};

const LEN: usize = 28;
const HEAD: [u8; 2] = [0x0D, 0x0A];
const TAIL: [u8; 2] = [0x0A, 0x0D];
/// A kilometre, 2,777 turns: what is beyond is no measurement but a damaged exponent.
const PLAUSIBLE: f32 = 1e6;

/// The protocol of an ACTION positioning system.
#[derive(Clone, Copy, Debug, Default)]
pub struct Action;

/// The pose: angles and place, with the maker's axes and signs, since it was switched on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pose {
    /// About the vertical axis.
    pub yaw: Degrees,
    /// Inclination about x.
    pub x_angle: Degrees,
    /// Inclination about y.
    pub y_angle: Degrees,
    /// In millimetres.
    pub x: f32,
    /// In millimetres.
    pub y: f32,
    /// In the system's unit, which no source names: degrees per second, most likely.
    pub yaw_rate: f32,
}

impl Protocol for Action {
    type Message = Pose;
    type Buffer = heapless::Vec<u8, LEN>;

    fn examine(&self, bytes: &[u8]) -> Found<Pose> {
        if bytes.first() != Some(&HEAD[0]) {
            return Found::Nothing;
        }
        let Some(frame) = bytes.first_chunk::<LEN>() else { return Found::More(LEN) };
        let [h0, h1, numbers @ .., t0, t1] = frame;
        if [*h0, *h1] != HEAD || [*t0, *t1] != TAIL {
            return Found::Nothing;
        }
        let mut values = [0.0; 6];
        let (numbers, _) = numbers.as_chunks::<4>();
        for (value, bytes) in values.iter_mut().zip(numbers) {
            *value = f32::from_le_bytes(*bytes);
            // False for NaN.
            let is_plausible = value.abs() <= PLAUSIBLE;
            if !is_plausible {
                return Found::Damaged;
            }
        }
        let [yaw, x_angle, y_angle, x, y, yaw_rate] = values;
        let [yaw, x_angle, y_angle] = [yaw, x_angle, y_angle].map(Degrees::new);
        Found::Frame(LEN, Pose { yaw, x_angle, y_angle, x, y, yaw_rate })
    }
}

/// A coordinate that can be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Coordinate {
    /// In degrees.
    Yaw,
    /// In millimetres.
    X,
    /// In millimetres.
    Y,
}

/// A coordinate cannot be set to this.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("{coordinate:?} cannot be {value}: it must be finite, and within ±{PLAUSIBLE}")]
pub struct Implausible {
    /// The coordinate.
    pub coordinate: Coordinate,
    /// The value that it was to have.
    pub value: f32,
}

/// The command that sets a coordinate. Public drivers wait 10 ms between two.
///
/// ```
/// use rc10_module::positioning::action::{Coordinate, set};
/// assert_eq!(set(Coordinate::Yaw, 90.0)?, *b"ACTJ\x00\x00\xB4\x42");
/// # Ok::<(), rc10_module::positioning::action::Implausible>(())
/// ```
///
/// # Errors
/// [`Implausible`] if the value is not finite, or beyond ±1,000,000.
pub fn set(coordinate: Coordinate, value: f32) -> Result<[u8; 8], Implausible> {
    let is_plausible = value.abs() <= PLAUSIBLE;
    if !is_plausible {
        return Err(Implausible { coordinate, value });
    }
    let letter = match coordinate {
        Coordinate::Yaw => b'J',
        Coordinate::X => b'X',
        Coordinate::Y => b'Y',
    };
    let [v0, v1, v2, v3] = value.to_le_bytes();
    Ok([b'A', b'C', b'T', letter, v0, v1, v2, v3])
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::{Counters, Stream};
    use rc10_time::Micros;
    use std::string::ToString;
    use std::vec::Vec;

    fn frame(values: [f32; 6]) -> Vec<u8> {
        let numbers = values.map(f32::to_le_bytes).concat();
        [&HEAD[..], &numbers, &TAIL].concat()
    }

    fn heard(bytes: &[u8]) -> (Vec<Pose>, Counters) {
        let (mut stream, mut heard) = (Stream::new(Action), Vec::new());
        stream.receive(bytes, Micros::ZERO, |pose| heard.push(pose));
        (heard, stream.counters())
    }

    fn yaws(bytes: &[u8]) -> Vec<f32> {
        heard(bytes).0.iter().map(|pose| pose.yaw.get()).collect()
    }

    #[test]
    fn a_frame_byte_for_byte() {
        let bytes = b"\x0D\x0A\x00\x00\x48\x41\x00\x00\x80\xBE\x00\x00\x00\x3F\
                      \x00\x50\x9A\x44\x00\x90\x29\xC4\x00\x00\x70\x40\x0A\x0D";
        let [yaw, x_angle, y_angle] = [12.5, -0.25, 0.5].map(Degrees::new);
        let pose = Pose { yaw, x_angle, y_angle, x: 1234.5, y: -678.25, yaw_rate: 3.75 };
        let (poses, counters) = heard(bytes);
        assert_eq!((poses.as_slice(), counters.skipped), (&[pose][..], 0));
    }

    #[test]
    fn no_number_is_nan_or_absurd() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.000_001e6, f32::MIN] {
            for at in 0..6 {
                let mut values = [0.5; 6];
                values[at] = bad;
                let (poses, counters) = heard(&[frame(values), frame([2.0; 6])].concat());
                assert_eq!((poses.len(), counters.damaged), (1, 1), "{bad} at {at}");
            }
        }
        assert_eq!(yaws(&frame([1e6; 6])), [1e6]);
    }

    /// Tail and head are the same two bytes the other way round.
    #[test]
    fn heads_too_many_and_lost_bytes_cost_no_other_frame() {
        let (one, two) = (frame([1.0; 6]), frame([2.0; 6]));
        let pieces: [&[u8]; 6] =
            [&[0x0D], &[0x0D, 0x0A], &[0x0A, 0x0D], &[0x0D; 30], &one[..27], &[]];
        for piece in pieces {
            assert_eq!(yaws(&[piece, &one, &two].concat()), [1.0, 2.0], "{piece:02X?}");
        }
        for lost in 0..LEN {
            let mut short = one.clone();
            short.remove(lost);
            let heard = yaws(&[&short[..], &two, &one, &two].concat());
            // Of a lost last byte, the next frame's first takes the place, and that frame is lost.
            let first = if lost == 27 { 1.0 } else { 2.0 };
            assert_eq!(heard, [first, 1.0, 2.0], "{lost}");
        }
    }

    #[test]
    fn both_ends_must_be_right() {
        for at in [0, 1, 26, 27] {
            let mut spoilt = frame([1.0; 6]);
            spoilt[at] ^= 7;
            assert_eq!(yaws(&spoilt), [], "{at}");
        }
    }

    #[test]
    fn commands_byte_for_byte() {
        assert_eq!(set(Coordinate::X, -1.0), Ok(*b"ACTX\x00\x00\x80\xBF"));
        assert_eq!(set(Coordinate::Y, 1e6), Ok(*b"ACTY\x00\x24\x74\x49"));
        let error = set(Coordinate::X, f32::INFINITY).unwrap_err().to_string();
        assert_eq!(error, "X cannot be inf: it must be finite, and within ±1000000");
        assert!(set(Coordinate::Yaw, f32::NAN).is_err());
    }
}
