//! A strip of WS2812 as a listener at a pin: pulses in, colours out.

use std::fmt;

use crate::peripherals::Edge;

/// A signal that no WS2812 is sure to understand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadPulse {
    /// The pin stays high at the end.
    StaysHigh,
    /// A pulse begins at a wrong distance from the last one's begin. Length in nanoseconds.
    Pause(u64),
    /// A pulse is neither a 0 nor a 1. Length in nanoseconds.
    Width(u64),
    /// The last LED of a picture does not get 24 bits. Number of bits.
    Bits(usize),
}

impl fmt::Display for BadPulse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StaysHigh => write!(f, "the strip's pin stays high"),
            Self::Pause(nanos) => write!(f, "a pulse {nanos} ns behind the last one"),
            Self::Width(nanos) => write!(f, "a pulse of {nanos} ns"),
            Self::Bits(bits) => write!(f, "{bits} bits for a LED"),
        }
    }
}

impl std::error::Error for BadPulse {}

/// The pictures on a strip of WS2812, each LED as red, green, blue. Widths, period and silence are
/// what all data sheets agree on. The first edge must be a rise.
///
/// # Errors
/// The first pulse that no WS2812 is sure to understand.
pub fn pictures(edges: &[Edge]) -> Result<Vec<Vec<[u8; 3]>>, BadPulse> {
    let mut pictures: Vec<Vec<bool>> = Vec::new();
    let mut last_rise = None;
    for pulse in edges.chunks(2) {
        let [rise, fall] = pulse else { return Err(BadPulse::StaysHigh) };
        let bit = match fall.at.since(rise.at).get() {
            250..=380 => false,
            650..=850 => true,
            other => return Err(BadPulse::Width(other)),
        };
        let pause = last_rise.replace(rise.at).map(|last| rise.at.since(last).get());
        match (pause, pictures.last_mut()) {
            // A byte that waits for others to end begins some microseconds later.
            (Some(1200..=1350 | 2_400..=30_000), Some(picture)) => picture.push(bit),
            (None | Some(280_000..), _) => pictures.push(vec![bit]),
            (Some(other), _) => return Err(BadPulse::Pause(other)),
        }
    }
    pictures.iter().map(|picture| picture.chunks(24).map(led).collect()).collect()
}

/// Green comes first, the highest bit of each.
fn led(bits: &[bool]) -> Result<[u8; 3], BadPulse> {
    if bits.len() != 24 {
        return Err(BadPulse::Bits(bits.len()));
    }
    let byte = |from: usize| {
        let bits = bits.iter().skip(from).take(8);
        bits.fold(0, |byte, &bit| byte << 1 | u8::from(bit))
    };
    Ok([byte(8), byte(0), byte(16)])
}

#[cfg(test)]
mod tests {
    use rc10_sim::Nanos;

    use super::*;

    /// The edges of pulses: start and length in nanoseconds.
    fn edges(pulses: impl Iterator<Item = (u64, u64)>) -> Vec<Edge> {
        let both = |(start, length): (u64, u64)| {
            let edge = |at, high| Edge { at: Nanos::new(at), high };
            [edge(start, true), edge(start + length, false)]
        };
        pulses.flat_map(both).collect()
    }

    fn bits(start: u64, bits: u32) -> impl Iterator<Item = (u64, u64)> {
        (0..24).map(move |bit| {
            (start + 1250 * bit, if bits << bit & 0x80_0000 != 0 { 800 } else { 300 })
        })
    }

    #[test]
    fn green_comes_first_and_a_pause_begins_a_picture() {
        let both = bits(0, 0x01_80_FF).chain(bits(400_000, 0xFF_00_00));
        assert_eq!(pictures(&edges(both)), Ok(vec![vec![[0x80, 1, 0xFF]], vec![[0, 0xFF, 0]]]));
        assert_eq!(pictures(&[]), Ok(vec![]));
    }

    #[test]
    fn what_no_led_understands_is_an_error() {
        let whole = edges(bits(0, 0));
        assert_eq!(pictures(&whole[..47]), Err(BadPulse::StaysHigh));
        assert_eq!(pictures(&whole[..46]), Err(BadPulse::Bits(23)));
        let width = edges([(0, 500)].into_iter());
        assert_eq!(pictures(&width), Err(BadPulse::Width(500)));
        let pause = edges([(0, 300), (50_000, 300)].into_iter());
        assert_eq!(pictures(&pause), Err(BadPulse::Pause(50_000)));
    }
}
