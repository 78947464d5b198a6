//! WS2812: 24 bits an LED, green, red, blue, highest bit first, as pulse widths in 1.25 µs.
//!
//! | | 0 | 1 | period | silence |
//! |---|---|---|---|---|
//! | WS2812 | 200 .. 500 ns high | 550 .. 850 ns | 1.25 µs ± 0.6 | above 50 µs |
//! | WS2812B | 250 .. 550 ns | 650 .. 950 ns | 1.25 µs ± 0.6 | above 50 µs |
//! | WS2812B-V5 | 220 .. 380 ns | 580 .. 1000 ns | 1.25 µs or more | above 280 µs |
//!
//! (`WorldSemi`'s data sheets.) What all three take: 250 .. 380 ns, 650 .. 850 ns, 280 µs.
//!
//! A [`Strip`] sends by one of two [`Output`]s. [`Spi`]: a byte per bit, on any SPI bus, with no
//! pin but data. [`Pulses`]: a timer's compare values, one per bit, which a DMA feeds to it.
//!
//! `ws2812-async` has half the memory, but no timer, and leaves LEDs out without a word.

use core::ops::RangeInclusive;

use embassy_time::{Duration, Timer};
use embedded_hal_async::spi::SpiBus;
use smart_leds_trait::{RGB8, SmartLedsWriteAsync};

/// Bits of one LED.
pub const BITS: usize = 24;

/// The time for which the line rests low after a picture: 280 µs of the slowest LEDs, and a margin.
pub const SILENCE: Duration = Duration::from_micros(300);

/// A bit that is 0, as a byte of SPI: two of eight high.
pub const SPI_ZERO: u8 = 0x30;
/// A bit that is 1: six of eight high.
pub const SPI_ONE: u8 = 0xFC;

/// SPI clocks in Hz: two bits last 250 ns, six 950 ns at most; a WS2812 without a letter 850.
pub const SPI_CLOCK: RangeInclusive<u32> = 6_320_000..=8_000_000;

/// Bytes of silence before and after a picture: 300 µs at the fastest clock.
const SPI_SILENCE: [u8; 300] = [0; 300];

/// The bits of a colour in the order of the wire.
fn bits(colour: RGB8) -> [bool; BITS] {
    let word = u32::from_be_bytes([0, colour.g, colour.r, colour.b]);
    core::array::from_fn(|bit| word >> (BITS - 1 - bit) & 1 != 0)
}

/// A colour as bytes of SPI: [`SPI_ZERO`] or [`SPI_ONE`] per bit.
///
/// ```
/// use rc10_module::led::ws2812::{SPI_ONE, SPI_ZERO, spi_bytes};
/// use smart_leds_trait::RGB8;
/// let red = spi_bytes(RGB8::new(0xFF, 0, 0));
/// assert_eq!(red[..8], [SPI_ZERO; 8]); // green comes first
/// assert_eq!(red[8..16], [SPI_ONE; 8]);
/// ```
#[must_use]
pub fn spi_bytes(colour: RGB8) -> [u8; BITS] {
    bits(colour).map(|one| if one { SPI_ONE } else { SPI_ZERO })
}

/// The widths of a timer's pulses, in its clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PulseTiming {
    /// Clocks between pulses: the timer's period (an STM32's auto-reload register gets one less).
    pub period: u16,
    /// Clocks for which a bit that is 0 is high: a compare value.
    pub zero: u16,
    /// A bit that is 1.
    pub one: u16,
}

/// No whole number of a timer's clocks makes a width that LEDs understand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("a timer of {clock} Hz hits no pulse width of a WS2812: it needs some MHz")]
pub struct TooCoarse {
    /// The timer's clock, Hz.
    pub clock: u32,
}

impl PulseTiming {
    /// Pulses of a timer at `clock` Hz: nearly 312 ns, 750 ns and 1.25 µs.
    ///
    /// ```
    /// use rc10_module::led::ws2812::PulseTiming;
    /// let timing = PulseTiming::new(240_000_000).unwrap();
    /// assert_eq!(timing, PulseTiming { period: 300, zero: 75, one: 180 });
    /// ```
    ///
    /// # Errors
    /// [`TooCoarse`] if that is outside of what all LEDs take (see the table above).
    pub const fn new(clock: u32) -> Result<Self, TooCoarse> {
        let period = Self::clocks(clock, 1250, 1200, 1350);
        let zero = Self::clocks(clock, 312, 250, 380);
        let one = Self::clocks(clock, 750, 650, 850);
        match (period, zero, one) {
            (Some(period), Some(zero), Some(one)) => Ok(Self { period, zero, one }),
            _ => Err(TooCoarse { clock }),
        }
    }

    /// The number of clocks nearest to a time in ns, if it is within these bounds.
    const fn clocks(clock: u32, ns: u64, at_least: u64, at_most: u64) -> Option<u16> {
        const SECOND: u64 = 1_000_000_000;
        let clocks = (clock as u64 * ns + SECOND / 2) / SECOND;
        // What lasts `clocks` of a clock compares to ns like this; nothing is rounded.
        let (took, clock) = (clocks * SECOND, clock as u64);
        let is_near = took >= clock * at_least && took <= clock * at_most;
        if !is_near || clocks == 0 || clocks > u16::MAX as u64 {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked")]
        Some(clocks as u16)
    }

    /// A colour as compare values.
    #[must_use]
    pub fn pulses(&self, colour: RGB8) -> [u16; BITS] {
        bits(colour).map(|one| if one { self.one } else { self.zero })
    }
}

/// A peripheral that brings bits to the LEDs: [`Spi`] or [`Pulses`].
#[expect(async_fn_in_trait, reason = "as in embedded-hal-async: executors here need no Send")]
pub trait Output {
    /// The form of a bit.
    type Symbol: Copy + Default;
    /// Error of the peripheral.
    type Error;
    /// The bits of an LED.
    fn encode(&self, colour: RGB8) -> [Self::Symbol; BITS];
    /// Sends the bits of some LEDs in one go, and the silence after them.
    async fn send(&mut self, symbols: &[Self::Symbol]) -> Result<(), Self::Error>;
}

/// LEDs at an SPI bus of one of [`SPI_CLOCK`], low at rest (on STM32: `AFCNTR`, or a pull-down).
#[derive(Debug)]
pub struct Spi<S>(pub S);

impl<S: SpiBus> Output for Spi<S> {
    type Symbol = u8;
    type Error = S::Error;

    fn encode(&self, colour: RGB8) -> [u8; BITS] {
        spi_bytes(colour)
    }

    async fn send(&mut self, symbols: &[u8]) -> Result<(), S::Error> {
        // The first silence ends whatever the line did before, the last one shows the picture.
        self.0.write(&SPI_SILENCE).await?;
        self.0.write(symbols).await?;
        self.0.write(&SPI_SILENCE).await?;
        self.0.flush().await
    }
}

/// LEDs at a timer's output: PWM, high first, whose compare value a DMA replaces once a period.
///
/// `send` gets compare values, one a pulse, and returns once the line is low: 0 at the end.
#[derive(Debug)]
pub struct Pulses<F> {
    timing: PulseTiming,
    send: F,
}

impl<F> Pulses<F> {
    /// A timer set up like this, and how its compare values are sent.
    pub const fn new(timing: PulseTiming, send: F) -> Self {
        Self { timing, send }
    }
}

impl<F: AsyncFnMut(&[u16]) -> Result<(), E>, E> Output for Pulses<F> {
    type Symbol = u16;
    type Error = E;

    fn encode(&self, colour: RGB8) -> [u16; BITS] {
        self.timing.pulses(colour)
    }

    async fn send(&mut self, symbols: &[u16]) -> Result<(), E> {
        (self.send)(symbols).await?;
        Timer::after(SILENCE).await;
        Ok(())
    }
}

/// A strip of `LEDS` LEDs, or fewer.
///
/// ```
/// use rc10_module::led::ws2812::{PulseTiming, Pulses, Strip};
/// # fn example() -> Result<(), rc10_module::led::ws2812::TooCoarse> {
/// const TIMING: PulseTiming = match PulseTiming::new(240_000_000) {
///     Ok(timing) => timing,
///     Err(_) => panic!("the timer is too slow"),
/// };
/// let timer = async |compare: &[u16]| Ok::<(), ()>(drop(compare.len()));
/// let strip = Strip::<_, 16>::new(Pulses::new(TIMING, timer)).with_brightness(40);
/// # let _ = strip;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
#[must_use]
pub struct Strip<O: Output, const LEDS: usize> {
    output: O,
    brightness: u8,
    symbols: [[O::Symbol; BITS]; LEDS],
}

/// A picture did not get onto the strip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Error<E> {
    /// The strip has more LEDs than its buffer has room for; nothing was sent.
    #[error("more colours than the strip's buffer has room for: {room} LEDs")]
    TooManyLeds {
        /// The room.
        room: usize,
    },
    /// The output to the strip failed; LEDs may show a part of the picture.
    #[error("the strip's output failed: {0}")]
    Output(E),
}

impl<O: Output, const LEDS: usize> Strip<O, LEDS> {
    /// A strip at full brightness.
    pub fn new(output: O) -> Self {
        let dark = core::array::from_fn(|_| O::Symbol::default());
        Self { output, brightness: u8::MAX, symbols: [dark; LEDS] }
    }

    /// The same at `brightness` of 255: at full white an LED takes up to 60 mA, too much for 5 V.
    pub const fn with_brightness(mut self, brightness: u8) -> Self {
        self.brightness = brightness;
        self
    }

    /// A channel as bright as this strip may be; what is on stays on.
    fn dim(&self, channel: u8) -> u8 {
        let dimmed = (u16::from(channel) * u16::from(self.brightness)).div_ceil(255);
        dimmed.to_be_bytes()[1]
    }
}

impl<O: Output, const LEDS: usize> SmartLedsWriteAsync for Strip<O, LEDS> {
    type Error = Error<O::Error>;
    type Color = RGB8;

    /// Sends colours to the first LEDs; others keep theirs. 30 µs an LED, and the silence.
    async fn write<T, I>(&mut self, colours: T) -> Result<(), Self::Error>
    where
        T: IntoIterator<Item = I>,
        I: Into<RGB8>,
    {
        let mut count = 0;
        for colour in colours {
            let RGB8 { r, g, b } = colour.into();
            let colour = RGB8::new(self.dim(r), self.dim(g), self.dim(b));
            let Some(symbols) = self.symbols.get_mut(count) else {
                return Err(Error::TooManyLeds { room: LEDS });
            };
            *symbols = self.output.encode(colour);
            count += 1;
        }
        let picture = self.symbols.get(..count).unwrap_or_default();
        self.output.send(picture.as_flattened()).await.map_err(Error::Output)
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// The bits that an LED reads from pulses of these lengths in ns, by the widths that all three
    /// data sheets agree on.
    fn read(high_ns: &[u64]) -> Vec<RGB8> {
        let bit = |&width| match width {
            250..=380 => false,
            650..=850 => true,
            other => panic!("a pulse of {other} ns"),
        };
        let bits: Vec<bool> = high_ns.iter().map(bit).collect();
        let byte = |bits: &[bool]| bits.iter().fold(0, |byte, &bit| byte << 1 | u8::from(bit));
        let led = |led: &[bool]| RGB8::new(byte(&led[8..16]), byte(&led[..8]), byte(&led[16..]));
        bits.chunks(BITS).map(led).collect()
    }

    const COLOURS: [RGB8; 4] = [
        RGB8::new(0xFF, 0, 0),
        RGB8::new(0, 0x80, 0x01),
        RGB8::new(0x12, 0x34, 0x56),
        RGB8::new(0xA5, 0x5A, 0xC3),
    ];

    #[test]
    fn timers_of_many_clocks_speak_to_all_leds() {
        for clock in [8_000_000, 16_000_000, 64_000_000, 240_000_000, 275_000_000, 480_000_000] {
            let timing = PulseTiming::new(clock).unwrap();
            let ns = |clocks: u16| u64::from(clocks) * 1_000_000_000 / u64::from(clock);
            for colour in COLOURS {
                let widths: Vec<_> = timing.pulses(colour).map(ns).to_vec();
                assert_eq!(read(&widths), [colour], "{clock} Hz");
            }
            assert!((1200..=1350).contains(&ns(timing.period)), "{clock} Hz");
        }
    }

    #[test]
    fn a_timer_that_is_too_slow_or_too_odd_is_refused() {
        for clock in [0, 1, 800_000, 1_000_000, 2_000_000] {
            assert_eq!(PulseTiming::new(clock), Err(TooCoarse { clock }), "{clock} Hz");
        }
        assert!(PulseTiming::new(u32::MAX).is_ok());
    }

    #[test]
    fn spi_bytes_are_bits_at_both_ends_of_the_clock_range() {
        for clock in [*SPI_CLOCK.start(), *SPI_CLOCK.end()] {
            let ns = |byte: u8| u64::from(byte.count_ones()) * 1_000_000_000 / u64::from(clock);
            assert!((250..=380).contains(&ns(SPI_ZERO)), "{clock} Hz");
            assert!((650..=950).contains(&ns(SPI_ONE)), "{clock} Hz");
            let silence = SPI_SILENCE.len() as u64 * 8_000_000_000 / u64::from(clock);
            assert!(silence >= 280_000, "{clock} Hz: {silence} ns");
        }
        // One pulse a byte, beginning and ending within it.
        for byte in [SPI_ZERO, SPI_ONE] {
            assert_eq!(byte.count_ones() + byte.leading_zeros() + byte.trailing_zeros(), 8);
            assert!(byte.trailing_zeros() >= 2);
        }
    }

    /// All silence and no picture, and the other way round.
    #[derive(Default)]
    struct Wire(Vec<Vec<u8>>);

    impl Output for &mut Wire {
        type Symbol = u8;
        type Error = u8;

        fn encode(&self, colour: RGB8) -> [u8; BITS] {
            spi_bytes(colour)
        }

        async fn send(&mut self, symbols: &[u8]) -> Result<(), u8> {
            self.0.push(symbols.to_vec());
            if self.0.len() > 1 { Err(7) } else { Ok(()) }
        }
    }

    fn write<const LEDS: usize>(
        strip: &mut Strip<&mut Wire, LEDS>,
        colours: &[RGB8],
    ) -> Result<(), Error<u8>> {
        embassy_futures::block_on(strip.write(colours.iter().copied()))
    }

    #[test]
    fn too_many_leds_send_nothing_and_fewer_send_only_theirs() {
        let mut wire = Wire::default();
        let mut strip = Strip::<_, 3>::new(&mut wire);
        assert_eq!(write(&mut strip, &COLOURS), Err(Error::TooManyLeds { room: 3 }));
        assert_eq!(write(&mut strip, &COLOURS[1..3]), Ok(()));
        assert_eq!(write(&mut strip, &COLOURS[..3]), Err(Error::Output(7)));
        let lengths: Vec<_> = wire.0.iter().map(Vec::len).collect();
        assert_eq!(lengths, [2 * BITS, 3 * BITS]);
        assert_eq!(wire.0[0][..BITS], spi_bytes(COLOURS[1]));
        assert_eq!(wire.0[0][BITS..], spi_bytes(COLOURS[2]));
    }

    #[test]
    fn brightness_dims_and_never_blackens() {
        let mut wire = Wire::default();
        let mut strip = Strip::<_, 1>::new(&mut wire).with_brightness(51);
        write(&mut strip, &[RGB8::new(255, 1, 0)]).unwrap();
        assert_eq!(wire.0[0], spi_bytes(RGB8::new(51, 1, 0)));
        let full = Strip::<_, 1>::new(&mut wire);
        assert!((0..=255).all(|channel| full.dim(channel) == channel));
        let none = full.with_brightness(0);
        assert!((0..=255).all(|channel| none.dim(channel) == 0));
    }
}
