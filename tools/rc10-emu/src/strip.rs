//! A strip of WS2812 as a listener at a pin: pulses in, colours out.

use anyhow::{Result, bail, ensure};

use crate::peripherals::Edge;

/// The pictures on a strip of WS2812, each LED as red, green, blue. Widths, period and silence are
/// what all data sheets agree on. The first edge must be a rise. Fails with the first pulse that no
/// WS2812 is sure to understand.
pub fn pictures(edges: &[Edge]) -> Result<Vec<Vec<[u8; 3]>>> {
    let mut pictures: Vec<Vec<bool>> = Vec::new();
    let mut last_rise = None;
    for pulse in edges.chunks(2) {
        let [rise, fall] = pulse else { bail!("the strip's pin stays high") };
        let bit = match fall.at.since(rise.at).get() {
            250..=380 => false,
            650..=850 => true,
            other => bail!("a pulse of {other} ns"),
        };
        let pause = last_rise.replace(rise.at).map(|last| rise.at.since(last).get());
        match (pause, pictures.last_mut()) {
            // A byte that waits for others to end begins some microseconds later.
            (Some(1200..=1350 | 2_400..=30_000), Some(picture)) => picture.push(bit),
            (None | Some(280_000..), _) => pictures.push(vec![bit]),
            (Some(other), _) => bail!("a pulse {other} ns behind the last one"),
        }
    }
    pictures.iter().map(|picture| picture.chunks(24).map(led).collect()).collect()
}

/// Green comes first, the highest bit of each.
fn led(bits: &[bool]) -> Result<[u8; 3]> {
    ensure!(bits.len() == 24, "{} bits for a LED", bits.len());
    let byte = |bits: &[bool]| bits.iter().fold(0, |byte, &bit| byte << 1 | u8::from(bit));
    Ok([&bits[8..16], &bits[..8], &bits[16..]].map(byte))
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
        let shown = pictures(&edges(both)).unwrap();
        assert_eq!(shown, [[[0x80, 1, 0xFF]], [[0, 0xFF, 0]]]);
        assert!(pictures(&[]).unwrap().is_empty());
    }

    #[test]
    fn what_no_led_understands_is_an_error() {
        let error = |edges: &[Edge]| pictures(edges).unwrap_err().to_string();
        let whole = edges(bits(0, 0));
        assert_eq!(error(&whole[..47]), "the strip's pin stays high");
        assert_eq!(error(&whole[..46]), "23 bits for a LED");
        assert_eq!(error(&edges([(0, 500)].into_iter())), "a pulse of 500 ns");
        let pause = edges([(0, 300), (50_000, 300)].into_iter());
        assert_eq!(error(&pause), "a pulse 50000 ns behind the last one");
    }
}
