//! Waiting for time or pins, in virtual time: strips' silence, and limit switches.
#![cfg(test)]

use std::cell::{Cell, RefCell};
use std::future::Future;
use std::pin::pin;
use std::rc::Rc;
use std::task::Poll;

use embassy_time::Instant;
use embedded_hal_async::digital::Wait;
use embedded_hal_async::spi::SpiBus;
use rc10_module::led::ws2812::{
    BITS, Error, PulseTiming, Pulses, SILENCE, SPI_CLOCK, Spi, Strip, spi_bytes,
};
use rc10_module::limit_switch::{Active, Config, Position, watch};
use rc10_sim::World;
use rc10_time::Micros;
use smart_leds_trait::{RGB8, SmartLedsWriteAsync};

const RED: RGB8 = RGB8::new(255, 0, 0);
const BLUE: RGB8 = RGB8::new(0, 0, 255);

fn now() -> u64 {
    Instant::now().as_micros()
}

#[test]
fn a_timer_gets_a_pulse_per_bit_and_the_strip_waits_for_the_silence() {
    let timing = PulseTiming::new(240_000_000).unwrap();
    let sent = RefCell::new(Vec::new());
    let timer = async |compare: &[u16]| {
        sent.borrow_mut().push((now(), compare.to_vec()));
        // As long as the pulses take.
        embassy_time::Timer::after_nanos(1250 * compare.len() as u64).await;
        if sent.borrow().len() < 3 { Ok(()) } else { Err("stopped") }
    };
    let mut strip = Strip::<_, 2>::new(Pulses::new(timing, timer));
    let mut world = World::new(1);
    let shows = pin!(async {
        assert_eq!(strip.write([RED, BLUE]).await, Ok(()));
        assert_eq!(strip.write([BLUE]).await, Ok(()));
        assert_eq!(strip.write([RED, RED, RED]).await, Err(Error::TooManyLeds { room: 2 }));
        assert_eq!(strip.write([RED]).await, Err(Error::Output("stopped")));
    });
    assert_eq!(world.run(shows, Micros::from_millis(10)), Poll::Ready(()));
    let sent = sent.borrow();
    let pictures: Vec<_> = sent.iter().map(|(_, compare)| compare.clone()).collect();
    let pulses = |colours: &[RGB8]| -> Vec<u16> {
        colours.iter().flat_map(|&colour| timing.pulses(colour)).collect()
    };
    assert_eq!(pictures, [pulses(&[RED, BLUE]), pulses(&[BLUE]), pulses(&[RED])]);
    assert_eq!(pictures[0][..8], [timing.zero; 8]);
    assert_eq!(pictures[0][8..16], [timing.one; 8]);
    for pair in sent.windows(2) {
        let took = (pair[0].1.len() as u64 * 1250).div_ceil(1000);
        assert!(pair[1].0 - pair[0].0 >= took + SILENCE.as_micros());
    }
}

/// An SPI bus that keeps what it was told.
#[derive(Default)]
struct Bus {
    line: Vec<u8>,
    flushed: usize,
    fails: bool,
}

impl embedded_hal_async::spi::ErrorType for Bus {
    type Error = embedded_hal_async::spi::ErrorKind;
}

impl SpiBus for Bus {
    async fn read(&mut self, _: &mut [u8]) -> Result<(), Self::Error> {
        unimplemented!("a strip says nothing")
    }

    async fn write(&mut self, words: &[u8]) -> Result<(), Self::Error> {
        self.line.extend(words);
        if self.fails { Err(embedded_hal_async::spi::ErrorKind::Overrun) } else { Ok(()) }
    }

    async fn transfer(&mut self, _: &mut [u8], _: &[u8]) -> Result<(), Self::Error> {
        unimplemented!("a strip says nothing")
    }

    async fn transfer_in_place(&mut self, _: &mut [u8]) -> Result<(), Self::Error> {
        unimplemented!("a strip says nothing")
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        self.flushed = self.line.len();
        Ok(())
    }
}

/// A `&mut` of a bus is one too; the bus is looked at afterwards.
#[test]
fn an_spi_bus_gets_silence_the_bits_and_silence() {
    let mut bus = Bus::default();
    let mut strip = Strip::<_, 4>::new(Spi(&mut bus));
    embassy_futures::block_on(strip.write([RED, BLUE])).unwrap();
    let silence = bus.line.iter().take_while(|&&byte| byte == 0).count();
    let picture: Vec<u8> = [RED, BLUE].into_iter().flat_map(spi_bytes).collect();
    assert_eq!(picture.len(), 2 * BITS);
    assert_eq!(bus.line[silence..silence + picture.len()], picture);
    assert!(bus.line[silence + picture.len()..].iter().all(|&byte| byte == 0));
    let after = bus.line.len() - silence - picture.len();
    let fastest = u64::from(*SPI_CLOCK.end());
    for bytes in [silence, after] {
        assert!(bytes as u64 * 8_000_000 / fastest >= 280, "{bytes} bytes of silence");
    }
    assert_eq!(bus.flushed, bus.line.len());

    let mut bus = Bus { fails: true, ..Bus::default() };
    let mut strip = Strip::<_, 4>::new(Spi(&mut bus));
    let failed = embassy_futures::block_on(strip.write([RED]));
    assert_eq!(failed, Err(Error::Output(embedded_hal_async::spi::ErrorKind::Overrun)));
}

/// A pin whose level follows a list of times, in µs: high until the first, low until the next.
#[derive(Clone)]
struct Pin {
    edges: Rc<[u64]>,
    /// From here on it is broken.
    breaks: u64,
    looks: Rc<Cell<u32>>,
}

impl Pin {
    fn new(edges: impl Into<Rc<[u64]>>) -> Self {
        Self { edges: edges.into(), breaks: u64::MAX, looks: Rc::default() }
    }

    fn check(&self) -> Result<(), PinFault> {
        self.looks.set(self.looks.get() + 1);
        if now() < self.breaks { Ok(()) } else { Err(PinFault) }
    }

    async fn until(&self, high: bool) -> Result<(), PinFault> {
        self.check()?;
        let is_there = |count: usize| count.is_multiple_of(2) == high;
        let passed = self.edges.partition_point(|&edge| edge <= now());
        if is_there(passed) {
            return Ok(());
        }
        match self.edges.get(passed) {
            Some(&edge) => embassy_time::Timer::at(Instant::from_micros(edge)).await,
            None => std::future::pending().await,
        }
        Ok(())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PinFault;

impl embedded_hal::digital::Error for PinFault {
    fn kind(&self) -> embedded_hal::digital::ErrorKind {
        embedded_hal::digital::ErrorKind::Other
    }
}

impl embedded_hal::digital::ErrorType for Pin {
    type Error = PinFault;
}

impl embedded_hal::digital::InputPin for Pin {
    fn is_high(&mut self) -> Result<bool, PinFault> {
        self.check()?;
        Ok(self.edges.partition_point(|&edge| edge <= now()).is_multiple_of(2))
    }

    fn is_low(&mut self) -> Result<bool, PinFault> {
        self.is_high().map(|high| !high)
    }
}

impl Wait for Pin {
    fn wait_for_high(&mut self) -> impl Future<Output = Result<(), PinFault>> {
        self.until(true)
    }

    fn wait_for_low(&mut self) -> impl Future<Output = Result<(), PinFault>> {
        self.until(false)
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), PinFault> {
        unimplemented!("an edge may be missed")
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), PinFault> {
        unimplemented!("an edge may be missed")
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), PinFault> {
        unimplemented!("an edge may be missed")
    }
}

/// The states heard of a pin until `until` µs, with the times; and whether the watch ended.
fn heard(pin: &Pin, until: u64) -> (Vec<(u64, Position)>, bool) {
    let mut heard = Vec::new();
    let mut world = World::new(1);
    let watching = watch(pin.clone(), Config::new(Active::Low), |position, at: Micros| {
        heard.push((at.get(), position));
    });
    let ended = world.run(pin!(watching), Micros::new(until)).is_ready();
    (heard, ended)
}

#[test]
fn a_press_with_bounces_is_heard_once_and_in_time() {
    // Bounces for 3 ms from 50 ms on, and for 2 ms when let go at 200 ms.
    let edges: Vec<u64> =
        (0..11).map(|bounce| 50_000 + 300 * bounce).chain([200_000, 201_000, 202_000]).collect();
    let pin = Pin::new(edges);
    let (heard, ended) = heard(&pin, 1_000_000);
    let positions: Vec<_> = heard.iter().map(|&(_, position)| position).collect();
    assert_eq!(positions, [Position::Released, Position::Pressed, Position::Released]);
    let [known, pressed, released] = [heard[0].0, heard[1].0, heard[2].0];
    assert!((10_000..=11_000).contains(&known), "{known}");
    // Two milliseconds after the last bounce at most, and a look later.
    assert!((52_000..=56_100).contains(&pressed), "{pressed}");
    assert!((212_000..=213_100).contains(&released), "{released}");
    assert!(!ended);
    // At rest nothing polls: a second at 1 kHz would be a thousand looks.
    assert!(pin.looks.get() < 150, "{} looks", pin.looks.get());
}

#[test]
fn a_storm_of_edges_is_chatter_and_costs_two_looks_a_millisecond() {
    let edges: Vec<u64> = (0..30_000).map(|edge| 100_000 + 37 * edge).collect();
    let pin = Pin::new(edges);
    let (heard, _) = heard(&pin, 2_000_000);
    let positions: Vec<_> = heard.iter().map(|&(_, position)| position).collect();
    assert_eq!(positions, [Position::Released, Position::Chattering, Position::Released]);
    assert!((350_000..360_000).contains(&heard[1].0), "{}", heard[1].0);
    assert!(pin.looks.get() < 3000, "{} looks", pin.looks.get());
}

#[test]
fn a_pin_that_fails_ends_the_watch() {
    let pin = Pin { breaks: 30_000, ..Pin::new([20_000]) };
    let (heard, ended) = heard(&pin, 1_000_000);
    assert_eq!(heard.last().map(|&(_, position)| position), Some(Position::Pressed));
    assert!(!ended, "it waits for a release that never comes");
    let pin = Pin { breaks: 30_000, ..Pin::new([20_000, 40_000]) };
    let (_, ended) = self::heard(&pin, 1_000_000);
    assert!(ended);
}
