//! Characters as levels on a wire, and what a receiver makes of the levels.

use std::collections::VecDeque;

use rc10_sim::{Nanos, UartFault};

/// Femtoseconds in a nanosecond: bits are measured in them, so that no rounding adds up.
const FEMTOS: u64 = 1_000_000;

/// The parity bit of a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// With it the number of ones is even.
    Even,
    /// With it the number of ones is odd.
    Odd,
}

/// Format of a character, besides its start bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// Data bits, 5 to 9, least significant first.
    pub data_bits: u32,
    /// The bit behind them, if any.
    pub parity: Option<Parity>,
    /// Stop bits times two: 1 to 4.
    pub half_stops: u32,
}

impl Format {
    /// Eight bits, no parity, one stop bit.
    pub const EIGHT_N_1: Self = Self { data_bits: 8, parity: None, half_stops: 2 };
    /// Eight bits, even parity, one stop bit: DBUS.
    pub const EIGHT_E_1: Self = Self { parity: Some(Parity::Even), ..Self::EIGHT_N_1 };
    /// Eight bits, even parity, two stop bits: SBUS.
    pub const EIGHT_E_2: Self = Self { half_stops: 4, ..Self::EIGHT_E_1 };

    /// The usual format of characters of this length in bits, start and stop included.
    pub(crate) const fn of_length(bits: u32) -> Option<Self> {
        match bits {
            10 => Some(Self::EIGHT_N_1),
            11 => Some(Self::EIGHT_E_1),
            12 => Some(Self::EIGHT_E_2),
            _ => None,
        }
    }

    /// Bits between start and stop.
    pub(super) const fn word(self) -> u32 {
        self.data_bits + if self.parity.is_some() { 1 } else { 0 }
    }

    /// Length in sixteenths of a bit, start and stop included.
    pub(super) const fn sixteenths(self) -> u64 {
        8 * (2 + 2 * self.word() + self.half_stops) as u64
    }

    pub(super) const fn mask(self) -> u16 {
        (1 << self.data_bits) - 1
    }

    fn parity_of(self, value: u16) -> Option<bool> {
        let odd = !(value & self.mask()).count_ones().is_multiple_of(2);
        self.parity.map(|parity| odd != (parity == Parity::Odd))
    }
}

/// A character on a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Character {
    /// Data bits.
    pub value: u16,
    /// Their format.
    pub format: Format,
    /// The first edge of its start bit.
    pub start: Nanos,
    /// Length of a bit, femtoseconds.
    pub bit_fs: u64,
    /// Whether the line idles low and all levels are inverted.
    pub inverted: bool,
    /// The fault. An overrun does not show: the character before counts as not taken.
    pub fault: Option<UartFault>,
}

impl Character {
    /// A good character at a rate in bits a second, from an idle-high wire.
    pub fn new(value: u16, format: Format, baud: u32, start: Nanos) -> Self {
        let bit_fs = 1_000_000_000 * FEMTOS / u64::from(baud.max(1));
        Self { value, format, start, bit_fs, inverted: false, fault: None }
    }

    /// The time of a number of sixteenths of a bit after its start.
    pub(crate) fn at(&self, sixteenths: u64) -> Nanos {
        self.start + Nanos::new(self.bit_fs * sixteenths / 16 / FEMTOS)
    }

    /// The end of its last stop bit.
    pub fn end(&self) -> Nanos {
        self.at(self.format.sixteenths())
    }

    /// Calls with each level of an idle-high wire, and its begin in sixteenths of a bit.
    fn levels(&self, mut level: impl FnMut(u64, bool)) {
        let stop = 16 * (1 + u64::from(self.format.word()));
        level(0, false);
        if self.fault == Some(UartFault::Break) {
            return level(self.format.sixteenths(), true);
        }
        let parity = self.format.parity_of(self.value).unwrap_or(false);
        let mut word =
            u32::from(self.value & self.format.mask()) | u32::from(parity) << self.format.data_bits;
        if self.fault == Some(UartFault::Parity) {
            // Without a parity bit it makes no difference.
            word ^= 1 << (self.format.word() - 1);
        }
        for bit in 0..self.format.word() {
            let from = 16 * (1 + u64::from(bit));
            let high = word >> bit & 1 != 0;
            level(from, high);
            if self.fault == Some(UartFault::Noise) && bit == 3 {
                // So short that of three samples it hits one.
                level(from + 8, !high);
                level(from + 9, high);
            }
        }
        if self.fault == Some(UartFault::Framing) {
            level(stop, false);
            level(stop + 12, true);
        } else {
            level(stop, true);
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sampling {
    pub format: Format,
    pub bit_fs: u64,
    pub inverted: bool,
    /// Eight samples a bit instead of sixteen.
    pub by_8: bool,
    /// One sample decides instead of the majority of three.
    pub one_sample: bool,
}

/// A character as sampled by a receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sampled {
    /// Data bits, and the parity bit above them.
    pub word: u16,
    pub framing: bool,
    pub parity: bool,
    pub noise: bool,
}

impl Sampled {
    pub const fn is_good(&self) -> bool {
        !self.framing && !self.parity
    }
}

/// Levels over time: the past that may still be sampled, and the future that is under way.
#[derive(Debug)]
pub(crate) struct Wire {
    /// The level before the first edge.
    level: bool,
    edges: VecDeque<(Nanos, bool)>,
    last: Option<Character>,
}

impl Default for Wire {
    fn default() -> Self {
        Self { level: true, edges: VecDeque::new(), last: None }
    }
}

impl Wire {
    fn push(&mut self, at: Nanos, level: bool) {
        if self.edges.back().is_some_and(|&(last, _)| last == at) {
            // A level of no length does not exist.
            self.edges.pop_back();
        }
        if level != self.edges.back().map_or(self.level, |&(_, last)| last) {
            self.edges.push_back((at, level));
        }
    }

    /// The level of the idle line, from now on.
    pub fn set_idle(&mut self, high: bool) {
        self.edges.clear();
        self.level = high;
    }

    /// A character begins: now, or after all the others. It cuts short a level that lasts longer.
    pub fn draw(&mut self, character: Character) {
        while self.edges.back().is_some_and(|&(edge, _)| edge > character.start) {
            self.edges.pop_back();
        }
        character.levels(|sixteenths, level| {
            self.push(character.at(sixteenths), level != character.inverted);
        });
        self.last = Some(character);
    }

    /// A disturbance damages the character on the wire, or looks like a damaged one.
    pub fn disturb(&mut self, fault: UartFault, at: Nanos, otherwise: Character) {
        // Its stop bit has not been sampled.
        let is_on_wire = |last: &Character| {
            at >= last.start && at < last.at(stop_sixteenths(last.format, false))
        };
        let last = self.last.filter(is_on_wire);
        let damaged = last.unwrap_or(Character { start: at, ..otherwise });
        while self.edges.back().is_some_and(|&(edge, _)| edge >= damaged.start) {
            self.edges.pop_back();
        }
        self.draw(Character { fault: Some(fault), ..damaged });
    }

    pub fn level_at(&self, at: Nanos) -> bool {
        let before = self.edges.iter().take_while(|&&(edge, _)| edge <= at);
        before.last().map_or(self.level, |&(_, level)| level)
    }

    /// The first edge to a level, at that time or later.
    pub fn edge_to(&self, level: bool, from: Nanos) -> Option<Nanos> {
        let mut edges = self.edges.iter();
        edges.find(|&&(at, new)| at >= from && new == level).map(|&(at, _)| at)
    }

    /// Forgets levels that no receiver will sample any more.
    pub fn forget(&mut self, before: Nanos) {
        while let Some(&(_, level)) = self.edges.front().filter(|(at, _)| *at < before) {
            self.level = level;
            self.edges.pop_front();
        }
    }

    /// Samples a character whose start bit began then; `None` if that was no start bit.
    pub fn sample(&self, start: Nanos, how: &Sampling) -> Option<Sampled> {
        let mut noise = false;
        let mut bit = |index: u32| {
            let high = |twice: u64| {
                // In thirty-seconds of a bit, from the start of the bit.
                let offset = how.bit_fs * (32 * u64::from(index) + twice) / 32 / FEMTOS;
                self.level_at(start + Nanos::new(offset)) != how.inverted
            };
            // Samples 8, 9 and 10 of 16, or 4, 5 and 6 of 8, each in the middle of its share.
            let votes = if how.by_8 { [14, 18, 22] } else { [15, 17, 19] }.map(high);
            if how.one_sample {
                return votes[1];
            }
            let ones = votes.iter().filter(|&&high| high).count();
            noise |= ones % 3 != 0;
            ones >= 2
        };
        if bit(0) {
            return None;
        }
        let format = how.format;
        let word: u16 = (0..format.word()).map(|n| u16::from(bit(n + 1)) << n).sum();
        let framing = !bit(format.word() + 1);
        let expected = format.parity_of(word);
        let parity = expected.is_some_and(|bit| u16::from(bit) != word >> format.data_bits & 1);
        Some(Sampled { word, framing, parity, noise })
    }
}

/// Sixteenths from the start to the end of the sampling of the stop bit: its 10th sample; of two,
/// the end of the first (RM0468, configurable stop bits).
pub(crate) const fn stop_sixteenths(format: Format, by_8: bool) -> u64 {
    let stop = 16 * (1 + format.word() as u64);
    stop + if format.half_stops > 2 {
        16
    } else if by_8 {
        12
    } else {
        10
    }
}

/// The time of a number of sixteenths of a bit after another.
pub(crate) fn after(start: Nanos, bit_fs: u64, sixteenths: u64) -> Nanos {
    start + Nanos::new((bit_fs * sixteenths).div_ceil(16 * FEMTOS))
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Nanos = Nanos::new(1_000);

    fn hear(character: Character, format: Format) -> Option<Sampled> {
        let mut wire = Wire::default();
        wire.draw(character);
        let how = Sampling {
            format,
            bit_fs: character.bit_fs,
            inverted: false,
            by_8: false,
            one_sample: false,
        };
        wire.sample(START, &how)
    }

    #[test]
    fn every_value_arrives_in_every_format() {
        for data_bits in 7..=9 {
            for parity in [None, Some(Parity::Even), Some(Parity::Odd)] {
                let format = Format { data_bits, parity, half_stops: 2 };
                for value in 0..=format.mask() {
                    let heard =
                        hear(Character::new(value, format, 115_200, START), format).unwrap();
                    assert_eq!(heard.word & format.mask(), value);
                    assert!(heard.is_good() && !heard.noise, "{format:?} {value:#x}");
                }
            }
        }
    }

    #[test]
    fn another_format_is_noticed_where_the_chip_can_notice_it() {
        let even = Character::new(0x55, Format::EIGHT_E_1, 100_000, START);
        let odd = Format { parity: Some(Parity::Odd), ..Format::EIGHT_E_1 };
        assert!(hear(even, odd).unwrap().parity);
        // The parity bit of 0x55 is zero: where a stop bit is expected.
        assert!(hear(even, Format::EIGHT_N_1).unwrap().framing);
        // Of 0x54 it is one, and looks like one.
        let lucky = Character { value: 0x54, ..even };
        assert!(hear(lucky, Format::EIGHT_N_1).unwrap().is_good());
    }

    #[test]
    fn who_begins_is_heard_whatever_was_there() {
        let noise = Character::new(0x0F, Format::EIGHT_N_1, 9_600, START);
        let good = Character::new(0x5A, Format::EIGHT_N_1, 115_200, noise.at(40));
        let mut wire = Wire::default();
        wire.draw(noise);
        wire.draw(good);
        let how = Sampling {
            format: Format::EIGHT_N_1,
            bit_fs: good.bit_fs,
            inverted: false,
            by_8: false,
            one_sample: false,
        };
        let heard = wire.sample(good.start, &how);
        assert_eq!(heard, Some(Sampled { word: 0x5A, ..Sampled::default() }));
    }

    #[test]
    fn faults_show_as_what_they_are() {
        let good = Character::new(0x81, Format::EIGHT_E_1, 100_000, START);
        let heard =
            |fault| hear(Character { fault: Some(fault), ..good }, Format::EIGHT_E_1).unwrap();
        assert_eq!(
            heard(UartFault::Framing),
            Sampled { word: 0x81, framing: true, ..Sampled::default() }
        );
        assert!(heard(UartFault::Parity).parity && !heard(UartFault::Parity).framing);
        assert_eq!(
            heard(UartFault::Noise),
            Sampled { word: 0x81, noise: true, ..Sampled::default() }
        );
        assert_eq!(heard(UartFault::Break), Sampled { framing: true, ..Sampled::default() });
    }
}
