//! Receivers and an IMU on their wires: when each byte or edge comes, and what a lost remote does.

use std::cell::RefCell;
use std::f64::consts::TAU;
use std::pin::pin;
use std::task::Poll;

use embassy_time::Instant;
use embedded_io_async::{Read, Write};
use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, CanPort};
use rc10_sim::imu::Hwt101;
use rc10_sim::remote::{Controls, Crsf, Dr16, Failsafe, Ppm, Remote, Sbus, Stick, Switch};
use rc10_sim::{BusConfig, Chassis, EscConfig, Model, Mounting, Nanos, Serial, UartPort, World};
use rc10_time::Micros;

const PHASE: Nanos = Nanos::new(1_000_000);
const STICKS: Controls = Controls {
    left: Stick { x: -0.25, y: 0.5 },
    right: Stick { x: 1.0, y: -1.0 },
    left_switch: Switch::Up,
    right_switch: Switch::Down,
    ..Controls::REST
};

/// Bytes with the time in us at which each was there.
fn bytes(world: &mut World, mut port: UartPort, until_ms: u64) -> Vec<(u8, u64)> {
    let heard = RefCell::new(Vec::new());
    let mut task = pin!(async {
        loop {
            let mut byte = [0];
            port.read_exact(&mut byte).await.unwrap();
            heard.borrow_mut().push((byte[0], Instant::now().as_micros()));
        }
    });
    let _: Poll<()> = world.run(task.as_mut(), Micros::from_millis(until_ms));
    heard.take()
}

/// When frames of `length` bytes ended, in us.
fn ends(bytes: &[(u8, u64)], length: usize) -> Vec<u64> {
    assert_eq!(bytes.len() % length, 0, "whole frames");
    bytes.chunks(length).map(|frame| frame[length - 1].1).collect()
}

#[test]
fn a_dr16_speaks_every_14_ms_and_falls_silent() {
    let (mut world, remote) = (World::new(1), Remote::new());
    let uart = world.add_serial(Dr16::SERIAL, Dr16::new(&remote, PHASE));
    let heard = bytes(&mut world, uart.port(), 28);
    assert_eq!(heard[0].1, 1110);
    assert_eq!(ends(&heard, 18), [2980, 16_980]);
    // The frame that is on the wire then is whole all the same.
    world.advance(Micros::from_millis(30));
    remote.set_transmitter(false);
    let heard = bytes(&mut world, uart.port(), 1000);
    assert_eq!(ends(&heard, 18), [30_980]);
    assert_eq!(remote.sent().last_live, Some(Nanos::new(30_980_000)));
    assert_eq!(remote.sent().back_since, None);
    remote.set_transmitter(true);
    let heard = bytes(&mut world, uart.port(), 1025);
    assert_eq!(ends(&heard, 18), [1_010_980, 1_024_980]);
    let sent = remote.sent();
    assert_eq!((sent.frames, sent.live), (5, 5));
    assert_eq!(sent.back_since, Some(Nanos::new(1_010_980_000)));
}

#[test]
fn hands_are_in_the_next_frame() {
    let (mut world, remote) = (World::new(1), Remote::new());
    let uart = world.add_serial(Dr16::SERIAL, Dr16::new(&remote, PHASE));
    let at_rest = bytes(&mut world, uart.port(), 14);
    remote.set(STICKS);
    let moved = bytes(&mut world, uart.port(), 28);
    let value = |bytes: &[(u8, u64)]| u16::from(bytes[0].0) | u16::from(bytes[1].0 & 7) << 8;
    assert_eq!((value(&at_rest), value(&moved)), (1024, 1684));
}

#[test]
fn an_sbus_receiver_goes_on_for_ever_and_says_how_it_is() {
    let (mut world, remote) = (World::new(1), Remote::new());
    let mut receiver = Sbus::new(&remote, PHASE);
    (receiver.failsafe, receiver.failsafe_after) = (Failsafe::Hold, 3);
    let uart = world.add_serial(Sbus::SERIAL, receiver);
    remote.set(STICKS);
    let heard = bytes(&mut world, uart.port(), 28);
    // 25 characters of 120 us.
    assert_eq!(ends(&heard, 25), [4000, 18_000]);
    remote.set_transmitter(false);
    remote.set(Controls::REST);
    let heard = bytes(&mut world, uart.port(), 98);
    let flags: Vec<u8> = heard.chunks(25).map(|frame| frame[23].0).collect();
    assert_eq!(flags, [4, 4, 4, 12, 12]);
    let held = |frame: &[(u8, u64)]| frame[1].0 == 0x13 && frame[2].0 & 7 == 7;
    assert!(heard.chunks(25).all(held), "1811 in the first channel: the stick is stuck");
    assert_eq!(remote.sent().last_live, Some(Nanos::new(18_000_000)));
    remote.set_transmitter(true);
    let heard = bytes(&mut world, uart.port(), 110);
    assert_eq!(heard[23].0, 0);
    assert_eq!(remote.sent().back_since, Some(Nanos::new(102_000_000)));

    let mut world = World::new(1);
    let mut receiver = Sbus::new(&remote, PHASE);
    receiver.period = Nanos::new(7_000_000);
    (receiver.failsafe, receiver.failsafe_after) = (Failsafe::Centre, 0);
    let uart = world.add_serial(Sbus::SERIAL, receiver);
    let _ = bytes(&mut world, uart.port(), 7);
    remote.set(STICKS);
    remote.set_transmitter(false);
    let heard = bytes(&mut world, uart.port(), 14);
    assert_eq!(ends(&heard, 25), [11_000]);
    assert_eq!((heard[1].0, heard[23].0), (0xE0, 12));
}

#[test]
fn a_crsf_receiver_stops_its_channels_and_keeps_its_statistics() {
    let (mut world, remote) = (World::new(1), Remote::new());
    let uart = world.add_serial(Crsf::SERIAL, Crsf::new(&remote, PHASE));
    remote.set(STICKS);
    let heard = bytes(&mut world, uart.port(), 999);
    let (channels, statistics) = (150, 10);
    assert_eq!(heard.len(), channels * 26 + statistics * 14);
    // 26 characters of 23.809 us, then 14 more.
    assert_eq!((heard[25].1, heard[39].1), (1619, 1952));
    assert_eq!((heard[26].0, heard[28].0, heard[40].0), (0xC8, 0x14, 0xC8));
    remote.set_transmitter(false);
    let heard = bytes(&mut world, uart.port(), 1999);
    let qualities: Vec<u8> = heard.chunks(14).map(|frame| frame[5].0).collect();
    assert_eq!(qualities, [99, 84, 69, 54, 39, 24, 9, 0, 0, 0]);
    assert!(heard.chunks(14).all(|frame| frame[2].0 == 0x14));
}

#[test]
fn ppm_says_a_channel_from_edge_to_edge() {
    let (mut world, remote) = (World::new(1), Remote::new());
    let pulses = world.add_pulses(Ppm::new(&remote, PHASE));
    remote.set(STICKS);
    let mut port = pulses.port();
    let edges = RefCell::new(Vec::new());
    let mut task = pin!(async {
        loop {
            let edge = port.rising_edge().await.get();
            edges.borrow_mut().push(edge);
        }
    });
    let _: Poll<()> = world.run(task.as_mut(), Micros::new(23_500));
    let intervals = |edges: &[u64]| -> Vec<u64> { edges.windows(2).map(|w| w[1] - w[0]).collect() };
    let channels = [1375, 1750, 1000, 2000, 2000, 1000, 1500, 1500];
    let first = edges.take();
    assert_eq!((first[0], first[9]), (1000, 23_000));
    assert_eq!(intervals(&first[..9]), channels, "then silence");
    assert_eq!(remote.sent().last_live, Some(Nanos::from(Micros::new(23_000 + 12_125))));
    // A frame that has begun ends.
    remote.set_transmitter(false);
    let _: Poll<()> = world.run(task.as_mut(), Micros::from_millis(500));
    assert_eq!(edges.take().len(), 8);
    remote.set_transmitter(true);
    let _: Poll<()> = world.run(task.as_mut(), Micros::from_millis(530));
    assert_eq!(intervals(&edges.take()[..9]), channels);
    assert_eq!(remote.sent().frames, 4);
}

/// A base that turns, its IMU, and how fast it turns its wheels.
struct Turning {
    world: World,
    uart: Serial,
    base: rc10_sim::Base,
}

fn turning() -> Turning {
    let mut world = World::new(4);
    let bus = world.add_bus(BusConfig::default());
    let escs = [1, 2, 3, 4].map(|id| bus.add_esc(EscConfig::new(Model::C620, id)).unwrap());
    let wheels = escs.iter().map(|esc| (esc, Mounting::Normal));
    let base = world.add_base(Chassis::default(), wheels).unwrap();
    let uart = world.add_serial(Hwt101::SERIAL, Hwt101::new(&base, PHASE));
    // Left backward, right forward: counter-clockwise.
    let mut data = [0; 8];
    for (index, raw) in [-3000_i16, 3000, -3000, 3000].into_iter().enumerate() {
        data[2 * index..][..2].copy_from_slice(&raw.to_be_bytes());
    }
    let command = CanFrame::eight_bytes(StandardId::new(0x200).unwrap(), data);
    let _ = bus.port().submit(&command);
    Turning { world, uart, base }
}

impl Turning {
    /// Turn rate in rad/s and yaw in turns, as of each pair of frames up to a time.
    fn hear(&mut self, until_ms: u64) -> Vec<(f64, f64)> {
        let heard = bytes(&mut self.world, self.uart.port(), until_ms);
        let value = |frame: &[(u8, u64)]| {
            assert_eq!(frame.len(), 11);
            let sum = frame[..10].iter().fold(0, |sum: u8, byte| sum.wrapping_add(byte.0));
            assert_eq!((frame[0].0, frame[10].0), (0x55, sum));
            f64::from(i16::from_le_bytes([frame[6].0, frame[7].0]))
        };
        let pair = |pair: &[(u8, u64)]| {
            assert_eq!((pair[1].0, pair[12].0), (0x52, 0x53));
            let rate = value(&pair[..11]) / 32_768.0 * 2000.0 / 360.0 * TAU;
            (rate, value(&pair[11..]) / 65_536.0)
        };
        heard.chunks(22).map(pair).collect()
    }

    fn tell(&mut self, command: [u8; 5]) {
        let mut port = self.uart.port();
        let task = pin!(async {
            port.write_all(&command).await.unwrap();
            port.flush().await.unwrap();
        });
        assert!(self.world.run(task, Micros::from_millis(60_000)).is_ready());
    }

    fn yaw_turns(&self) -> f64 {
        self.base.pose().yaw / TAU
    }
}

#[test]
fn an_imu_says_how_its_base_turns() {
    let mut scene = turning();
    let heard = scene.hear(1999);
    assert_eq!(heard.len(), 400);
    let (rate, yaw) = heard[399];
    // Of 3 ms ago.
    let (rate_now, turns) = (scene.base.twist().yaw, scene.yaw_turns());
    assert!(rate_now > 3.0 && (rate_now - rate).abs() < 0.1, "{rate} {rate_now}");
    assert!(turns > 0.6, "it must have turned past the seam: {turns}");
    assert!((-0.5..0.5).contains(&yaw));
    let off = (turns - yaw).fract();
    assert!(off.min(1.0 - off) < 0.005, "{yaw} {turns}");
}

#[test]
fn an_imu_takes_orders_only_when_unlocked() {
    let (unlock, zero) = ([0xFF, 0xAA, 0x69, 0x88, 0xB5], [0xFF, 0xAA, 0x76, 0, 0]);
    let slow = [0xFF, 0xAA, 3, 9, 0];
    let mut scene = turning();
    let _ = scene.hear(700);
    scene.tell(zero);
    let start = scene.yaw_turns();
    let heard = scene.hear(800);
    assert!(heard[1].1 > 0.02, "locked: {:?}", heard[1]);
    scene.tell(unlock);
    scene.tell(zero);
    let zeroed = scene.yaw_turns();
    assert!(zeroed > start);
    let _ = scene.hear(899);
    let (_, yaw) = *scene.hear(1000).last().unwrap();
    assert!((yaw - (scene.yaw_turns() - zeroed)).abs() < 0.02, "{yaw}");
    scene.tell(slow);
    let _ = scene.hear(1100);
    assert_eq!(scene.hear(1300).len(), 20);
    // Ten seconds later it is locked again.
    let _ = scene.hear(11_000);
    scene.tell([0xFF, 0xAA, 3, 0x0B, 0]);
    let _ = scene.hear(11_100);
    assert_eq!(scene.hear(11_300).len(), 20);
}
