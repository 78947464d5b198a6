//! Serial links and pulse lines: how long bytes take, who hears them, and what goes wrong.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::pin::pin;
use std::rc::Rc;
use std::task::Poll;

use embassy_futures::join::join;
use embassy_time::{Instant, Timer};
use embedded_io_async::{Read, Write};
use rc10_sim::{
    Nanos, PulseDevice, PulseEnd, Pulses, Serial, SerialConfig, SerialDevice, SerialEnd, UartFault,
    UartPort, World,
};
use rc10_time::Micros;

/// Says the same every so often, and notes what it hears.
struct Parrot {
    says: Vec<u8>,
    every: Nanos,
    next: Nanos,
    heard: Vec<(u8, Nanos)>,
}

impl Parrot {
    fn new(says: &[u8], every: u64) -> Self {
        Self { says: says.into(), every: Nanos::new(every), next: Nanos::ZERO, heard: Vec::new() }
    }
}

impl SerialDevice for Parrot {
    fn power_on(&mut self, now: Nanos) {
        self.next = now + self.every;
        self.heard.clear();
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos, send: &mut VecDeque<u8>) {
        send.extend(&self.says);
        self.next = now + self.every;
    }

    fn receive(&mut self, byte: u8, now: Nanos) {
        self.heard.push((byte, now));
    }
}

/// 8E1: a character takes 110 us.
const DBUS: SerialConfig = SerialConfig { baud: 100_000, bits: 11, receive_capacity: 256 };

const fn nanos(micros: u64) -> Nanos {
    Nanos::new(micros * 1000)
}

fn link(config: SerialConfig, says: &[u8], every_us: u64) -> (World, Serial) {
    let mut world = World::new(1);
    let link = world.add_serial(config, Parrot::new(says, every_us * 1000));
    (world, link)
}

type Heard = Vec<(Result<Vec<u8>, UartFault>, u64)>;

/// Everything that reads give up to a time, and when, in us.
fn read(world: &mut World, mut port: UartPort, until: Micros) -> Heard {
    let heard = RefCell::new(Vec::new());
    let mut task = pin!(async {
        loop {
            let mut buffer = [0; 16];
            let read = port.read(&mut buffer).await.map(|count| buffer[..count].to_vec());
            heard.borrow_mut().push((read, Instant::now().as_micros()));
        }
    });
    let _: Poll<()> = world.run(task.as_mut(), until);
    heard.take()
}

#[test]
fn every_byte_arrives_when_its_character_has_ended() {
    let (mut world, link) = link(DBUS, &[7, 8, 9], 1000);
    let heard = read(&mut world, link.port(), Micros::new(2250));
    let byte = |byte: u8, at: u64| (Ok(vec![byte]), at);
    let first = [byte(7, 1110), byte(8, 1220), byte(9, 1330), byte(7, 2110), byte(8, 2220)];
    assert_eq!(heard, first);
    // 86.805 us each, whole nanoseconds, without a pause.
    let config = SerialConfig::default();
    assert_eq!(config.character(), Nanos::new(86_805));
    let (mut world, link) = self::link(config, &[0; 100], 1000);
    for (at, bytes) in [(1_000_000 + 8_680_499, 99), (1_000_000 + 8_680_500, 100)] {
        world.advance_to(Nanos::new(at));
        assert_eq!(link.counters().from_device, bytes);
    }
}

#[test]
fn both_directions_go_at_once_and_flush_waits_for_the_last_bit() {
    let (mut world, link) = link(DBUS, &[1, 2], 100);
    let mut port = link.port();
    let task = pin!(join(
        async {
            Timer::after_micros(50).await;
            let _ = port.write(&[0xA, 0xB, 0xC]).await;
            let _ = port.flush().await;
            Instant::now().as_micros()
        },
        async {
            let mut port = link.port();
            let mut bytes = [0; 2];
            let _ = port.read_exact(&mut bytes).await;
            (bytes, Instant::now().as_micros())
        },
    ));
    let done = world.run(task, Micros::from_millis(1));
    assert_eq!(done, Poll::Ready((380, ([1, 2], 320))));
    let heard = link.with(|parrot: &mut Parrot| parrot.heard.clone()).unwrap_or_default();
    assert_eq!(heard, [(0xA, nanos(160)), (0xB, nanos(270)), (0xC, nanos(380))]);
    assert_eq!(link.counters().from_host, 3);
}

#[test]
fn a_full_buffer_loses_bytes_and_says_so_once_in_their_place() {
    let config = SerialConfig { receive_capacity: 4, ..DBUS };
    let (mut world, link) = link(config, &[1, 2, 3, 4, 5, 6], 1000);
    world.advance(Micros::new(1700));
    assert_eq!(link.counters().overrun, 2);
    let heard = read(&mut world, link.port(), Micros::new(2110));
    let expected =
        [(Ok(vec![1, 2, 3, 4]), 1700), (Err(UartFault::Overrun), 1700), (Ok(vec![1]), 2110)];
    assert_eq!(heard, expected);
}

#[test]
fn an_injected_fault_takes_one_character_and_is_read_once() {
    for fault in UartFault::ALL {
        let (mut world, link) = link(DBUS, &[1, 2, 3], 1000);
        world.advance(Micros::new(1150));
        link.inject(fault);
        let heard = read(&mut world, link.port(), Micros::new(1500));
        let expected = [(Ok(vec![1]), 1150), (Err(fault), 1220), (Ok(vec![3]), 1330)];
        assert_eq!(heard, expected);
        // Between two characters it comes by itself.
        link.inject(fault);
        let heard = read(&mut world, link.port(), Micros::new(2110));
        assert_eq!(heard, [(Err(fault), 1500), (Ok(vec![1]), 2110)]);
        assert_eq!(link.counters().injected, 2);
        assert_eq!(link.counters().from_device, 4);
    }
}

#[test]
fn a_fault_wakes_who_waits() {
    let (mut world, link) = link(DBUS, &[], 1_000_000);
    let mut port = link.port();
    let task = pin!(join(
        async {
            let mut buffer = [0; 4];
            (port.read(&mut buffer).await, Instant::now().as_micros())
        },
        async {
            Timer::after_micros(300).await;
            link.inject(UartFault::Break);
        },
    ));
    let done = world.run(task, Micros::from_millis(1));
    let Poll::Ready(((read, at), ())) = done else { panic!("it was not woken") };
    assert_eq!(read, Err(UartFault::Break));
    assert!((300..=400).contains(&at), "{at}");
}

#[test]
fn a_cut_link_carries_nothing_and_a_device_without_power_is_silent() {
    let (mut world, link) = link(DBUS, &[1, 2, 3], 1000);
    // Within the second character, which counts as it began.
    world.advance(Micros::new(1150));
    link.set_cut(true);
    let mut port = link.port();
    let _ = pin!(port.write(&[9])).poll_once();
    assert_eq!(
        read(&mut world, link.port(), Micros::new(1900)),
        [(Ok(vec![1]), 1150), (Ok(vec![2]), 1220)]
    );
    assert_eq!(link.counters().unheard, 2);
    link.set_cut(false);
    link.set_power(false);
    assert_eq!(read(&mut world, link.port(), Micros::new(5000)), []);
    link.set_power(true);
    assert_eq!(read(&mut world, link.port(), Micros::new(6150)), [(Ok(vec![1]), 6110)]);
    assert_eq!(link.with(|parrot: &mut Parrot| parrot.heard.len()), Some(0));
}

trait PollOnce: Future {
    /// For what never waits.
    fn poll_once(self: std::pin::Pin<&mut Self>) -> Poll<Self::Output> {
        self.poll(&mut std::task::Context::from_waker(std::task::Waker::noop()))
    }
}

impl<F: Future> PollOnce for F {}

#[derive(Default)]
struct Chip {
    heard: Vec<(u8, Nanos, Nanos)>,
    faults: Vec<(UartFault, Nanos)>,
    levels: Vec<(bool, Nanos)>,
}

impl SerialEnd for Chip {
    fn hear(&mut self, byte: u8, start: Nanos, end: Nanos) {
        self.heard.push((byte, start, end));
    }

    fn disturb(&mut self, fault: UartFault, at: Nanos) {
        self.faults.push((fault, at));
    }
}

impl PulseEnd for Chip {
    fn level(&mut self, high: bool, at: Nanos) {
        self.levels.push((high, at));
    }
}

#[test]
fn a_chip_in_the_port_s_place_hears_characters_begin_and_delivers_its_own() {
    let (mut world, link) = link(DBUS, &[1, 2], 1000);
    let chip = Rc::new(RefCell::new(Chip::default()));
    link.attach(chip.clone());
    world.advance(Micros::new(1001));
    assert_eq!(chip.borrow().heard, [(1, nanos(1000), nanos(1110))]);
    link.inject(UartFault::Parity);
    // Now, and a little later.
    link.deliver(0x41, nanos(1001));
    link.deliver(0x42, Nanos::new(1_050_500));
    world.advance(Micros::new(1500));
    assert_eq!(chip.borrow().heard.len(), 2);
    assert_eq!(chip.borrow().faults, [(UartFault::Parity, nanos(1001))]);
    let heard = link.with(|parrot: &mut Parrot| std::mem::take(&mut parrot.heard));
    let (first, second) = (nanos(1001), Nanos::new(1_050_500));
    assert!(matches!(heard.as_deref(), Some(&[(0x41, at), (0x42, then)])
        if at.since(first) <= Nanos::new(1) && then == second));
    // The port's buffer stays empty.
    assert_eq!(read(&mut world, link.port(), Micros::new(1600)), []);
    link.set_cut(true);
    world.advance(Micros::new(2500));
    assert_eq!(chip.borrow().heard.len(), 2);
}

/// High for 100 us every so often.
struct Beeper {
    every: Nanos,
    next: Nanos,
    high: bool,
}

impl PulseDevice for Beeper {
    fn power_on(&mut self, now: Nanos) {
        (self.next, self.high) = (now + self.every, false);
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos) -> bool {
        self.high = !self.high;
        let high = nanos(100);
        self.next = now + if self.high { high } else { self.every.since(high) };
        self.high
    }
}

fn beeper(every_us: u64) -> (World, Pulses) {
    let mut world = World::new(1);
    let beeper = Beeper { every: nanos(every_us), next: Nanos::ZERO, high: false };
    let pulses = world.add_pulses(beeper);
    (world, pulses)
}

fn edges(world: &mut World, pulses: &Pulses, until: Micros) -> Vec<(u64, u64)> {
    let edges = RefCell::new(Vec::new());
    let mut port = pulses.port();
    let mut task = pin!(async {
        loop {
            let edge = port.rising_edge().await.get();
            edges.borrow_mut().push((edge, Instant::now().as_micros()));
        }
    });
    let _: Poll<()> = world.run(task.as_mut(), until);
    edges.take()
}

#[test]
fn rising_edges_have_their_times_and_a_cut_line_has_none() {
    let (mut world, pulses) = beeper(1500);
    assert_eq!(edges(&mut world, &pulses, Micros::new(3100)), [(1500, 1500), (3000, 3000)]);
    pulses.set_cut(true);
    assert_eq!(edges(&mut world, &pulses, Micros::new(4550)), []);
    // In the middle of a pulse: what is left of it begins now.
    pulses.set_cut(false);
    assert_eq!(edges(&mut world, &pulses, Micros::new(6000)), [(4550, 4550), (6000, 6000)]);
    pulses.set_power(false);
    assert_eq!(edges(&mut world, &pulses, Micros::new(9000)), []);
    pulses.set_power(true);
    assert_eq!(edges(&mut world, &pulses, Micros::new(10_600)), [(10_500, 10_500)]);
    assert_eq!(pulses.with(|beeper: &mut Beeper| beeper.high), Some(false));
}

#[test]
fn edges_that_are_not_taken_are_kept_up_to_a_number() {
    let (mut world, pulses) = beeper(1000);
    world.advance(Micros::from_millis(70));
    assert_eq!(pulses.lost(), 6);
    let late = edges(&mut world, &pulses, Micros::from_millis(70));
    assert_eq!((late.len(), late.first()), (64, Some(&(7000, 70_000))));
}

#[test]
fn a_chip_sees_every_edge() {
    let (mut world, pulses) = beeper(1000);
    world.advance(Micros::new(1050));
    let chip = Rc::new(RefCell::new(Chip::default()));
    pulses.attach(chip.clone());
    world.advance(Micros::new(2000));
    pulses.set_cut(true);
    let levels = [(true, 1050), (false, 1100), (true, 2000), (false, 2000)];
    assert_eq!(chip.borrow().levels, levels.map(|(high, at)| (high, nanos(at))));
    assert_eq!(edges(&mut world, &pulses, Micros::new(9000)), [(1000, 2000)]);
}

#[test]
fn a_world_s_chance_is_its_seed_s() {
    let mut numbers = [1, 1, 2].map(|seed| World::new(seed).chance(nanos(1_000_000)));
    assert!(numbers.iter().all(|number| *number < nanos(1_000_000)));
    assert_eq!(numbers[0], numbers[1]);
    numbers.sort();
    assert_ne!(numbers[0], numbers[2]);
}
