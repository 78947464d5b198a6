//! The chip's UARTs and pins on the lines of a world. The program only loops: the registers are
//! written from outside.

use std::collections::VecDeque;

use rc10_emu::fault::Fault;
use rc10_emu::{Machine, Options, Rig};
use rc10_sim::unitree_line::{GoM8010, plant};
use rc10_sim::{
    Esc, Line, LineConfig, Nanos, PulseDevice, Serial, SerialConfig, SerialDevice, UartFault, World,
};

use crate::{Bench, FLASH, HANDLER, LOAD, program};

/// UART5: receives on PD2, sends on PC12.
const UART5: u32 = 0x4000_5000;
/// USART2: PD5, PD6, driver enable on PD4.
const USART2: u32 = 0x4000_4400;
const ISR: u32 = 0x1C;
const BUFFER: u32 = 0x2400_0000;
/// After a reset everything runs from 64 MHz.
const HZ: u32 = 64_000_000;
const CR1_8E1: u32 = 1 << 12 | 1 << 10;

fn bench() -> Bench {
    let bench = Bench::new(LOAD, Options::default());
    // Memory that no byte has reached is zero.
    bench.machine.memory.write(BUFFER, &[0; 0x200]).unwrap();
    // Ports A to F, DMA1, UART5 and USART2, TIM13.
    bench.write(0x5802_44E0, 0x3F);
    bench.write(0x5802_44D8, 1);
    bench.write(0x5802_44E8, 1 << 20 | 1 << 17 | 1 << 7);
    bench
}

impl Bench {
    fn uart5(&self, baud: u32, cr1: u32, cr2: u32) {
        self.alternate(3, 2, 8);
        self.alternate(2, 12, 8);
        self.write(UART5 + 0x0C, HZ / baud);
        self.write(UART5 + 0x04, cr2);
        // DMAR, DMAT.
        self.write(UART5 + 0x08, 0b11 << 6);
        self.write(UART5, cr1 | 0b1101);
    }

    /// DMA1's stream 0 receives into the buffer, stream 1 sends from behind it.
    fn receive(&self, register: u32, request: u32, count: u32) {
        self.stream(0, request, register, BUFFER, 0, count);
    }

    fn send(&self, register: u32, request: u32, bytes: &[u8]) {
        self.machine.memory.write(BUFFER + 0x100, bytes).unwrap();
        let count = u32::try_from(bytes.len()).unwrap();
        self.stream(1, request, register, BUFFER + 0x100, 1 << 6, count);
    }

    fn stream(&self, n: u32, request: u32, register: u32, memory: u32, control: u32, count: u32) {
        self.write(0x4002_0008, 0x3D << (6 * n));
        self.write(0x4002_0800 + 4 * n, request);
        let base = 0x4002_0010 + 0x18 * n;
        self.write(base + 0x04, count);
        self.write(base + 0x08, register);
        self.write(base + 0x0C, memory);
        self.write(base, 1 << 10 | control | 1);
    }

    fn received(&self, count: usize) -> Vec<u8> {
        let mut bytes = vec![0; count];
        self.machine.memory.read(BUFFER, &mut bytes).unwrap();
        bytes
    }

    fn remaining(&self) -> u32 {
        self.read(0x4002_0014)
    }

    /// USART2 with DMA for both directions, on a line with a motor.
    fn usart2(&mut self, config: LineConfig, baud: u32, control: u32) -> (Line, Esc) {
        let line = self.world.add_line(config);
        self.machine.connect_line(2, &line).unwrap();
        [5, 6].iter().for_each(|&pin| self.alternate(3, pin, 7));
        self.write(USART2 + 0x0C, HZ / baud);
        self.write(USART2 + 0x08, 0b11 << 6 | control);
        self.write(USART2, 0b1101);
        self.receive(USART2 + 0x24, 43, 64);
        let motor = line.add(GoM8010::new(0), plant());
        (line, motor)
    }
}

/// Says something at a time, and notes what it hears.
struct Device {
    says: Vec<(u64, Vec<u8>)>,
    heard: Vec<(u8, Nanos)>,
}

impl SerialDevice for Device {
    fn power_on(&mut self, _now: Nanos) {}

    fn next_event(&self) -> Option<Nanos> {
        self.says.first().map(|(at, _)| Nanos::new(*at))
    }

    fn advance(&mut self, _now: Nanos, send: &mut VecDeque<u8>) {
        send.extend(self.says.remove(0).1);
    }

    fn receive(&mut self, byte: u8, now: Nanos) {
        self.heard.push((byte, now));
    }
}

const DBUS: SerialConfig = SerialConfig { baud: 100_000, bits: 11, receive_capacity: 0 };
const CHARACTER: u64 = 110_000;

fn link(bench: &mut Bench, config: SerialConfig, says: &[(u64, &[u8])], inverted: bool) -> Serial {
    let says = says.iter().map(|(at, bytes)| (*at, bytes.to_vec())).collect();
    let serial = bench.world.add_serial(config, Device { says, heard: Vec::new() });
    bench.machine.connect_serial(5, &serial, inverted).unwrap();
    serial
}

fn heard(serial: &Serial) -> Vec<(u8, Nanos)> {
    serial.with(|device: &mut Device| device.heard.clone()).unwrap()
}

#[test]
fn bytes_go_both_ways_at_the_exact_time() {
    let mut bench = bench();
    let serial = link(&mut bench, DBUS, &[(1_000_123, &[1, 2, 3]), (5_000_000, &[4])], false);
    bench.uart5(100_000, CR1_8E1, 0);
    bench.receive(UART5 + 0x24, 65, 16);
    // The stop bit is sampled 10.625 bits after the start. The core stops behind an instruction.
    bench.run_to(1_000_123 + 2 * CHARACTER + 106_200);
    assert_eq!(bench.remaining(), 14);
    bench.run_to(1_000_123 + 2 * CHARACTER + 106_251);
    assert_eq!(bench.remaining(), 13);

    bench.run_to(2_000_000);
    let start = bench.machine.now().get();
    bench.send(UART5 + 0x28, 66, &[0x10, 0x20, 0x33]);
    bench.run_to(6_000_000);
    assert_eq!(bench.received(5), [1, 2, 3, 4, 0]);
    let times: Vec<_> = heard(&serial).iter().map(|(byte, at)| (*byte, at.get())).collect();
    // The world hears of it a nanosecond later at most.
    for ((index, expected), (byte, at)) in (1..).zip([0x10, 0x20, 0x33]).zip(times) {
        assert_eq!(byte, expected);
        let due = start + index * CHARACTER;
        assert!((due..=due + 1).contains(&at), "{at} {due}");
    }
    assert_eq!(heard(&serial).len(), 3);
    assert_eq!((bench.machine.garbled(5), bench.read(UART5 + ISR) & 0xF), (0, 0));
    assert_eq!(bench.machine.reports, []);
}

#[test]
fn a_line_that_idles_low_needs_the_inversion() {
    let sbus = SerialConfig { bits: 12, ..DBUS };
    // RXINV, TXINV and two stop bits.
    for (inverted, cr2, works) in [
        (true, 0b11 << 16 | 2 << 12, true),
        (true, 2 << 12, false),
        (false, 0b11 << 16 | 2 << 12, false),
    ] {
        let mut bench = bench();
        let serial = link(&mut bench, sbus, &[(1_000_000, &[0x0F, 0x55, 0xAA])], inverted);
        bench.uart5(100_000, CR1_8E1, cr2);
        bench.receive(UART5 + 0x24, 65, 16);
        bench.send(UART5 + 0x28, 66, &[7]);
        bench.run_to(3_000_000);
        let good = bench.received(3) == [0x0F, 0x55, 0xAA] && bench.read(UART5 + ISR) & 0xF == 0;
        assert_eq!(
            (good, heard(&serial).len()),
            (works, usize::from(works)),
            "{inverted} {cr2:#x}"
        );
        assert_eq!(bench.machine.garbled(5), u64::from(!works));
    }
}

#[test]
fn another_rate_or_format_is_not_understood_on_either_side() {
    for (baud, cr1) in [(57_600, CR1_8E1), (100_000, CR1_8E1 | 1 << 9), (110_000, CR1_8E1)] {
        let mut bench = bench();
        let serial = link(&mut bench, DBUS, &[(1_000_000, &[0x5A; 4])], false);
        bench.uart5(baud, cr1, 0);
        bench.send(UART5 + 0x28, 66, &[0x5A; 3]);
        bench.run_to(3_000_000);
        assert_ne!(bench.read(UART5 + ISR) & 0b11, 0, "{baud}");
        // Not every mistake is one that the far end can notice.
        let heard = heard(&serial);
        assert!(heard.iter().all(|(byte, _)| *byte != 0x5A), "{baud}");
        assert_eq!(bench.machine.garbled(5) + heard.len() as u64, 3, "{baud}");
    }
}

#[test]
fn faults_of_the_link_are_the_chips() {
    for (fault, flag) in [
        (UartFault::Parity, 1),
        (UartFault::Framing, 2),
        (UartFault::Noise, 4),
        (UartFault::Overrun, 8),
        (UartFault::Break, 2),
    ] {
        let mut bench = bench();
        let serial = link(&mut bench, DBUS, &[(1_000_000, &[0x11]), (3_000_000, &[0x22])], false);
        bench.uart5(100_000, CR1_8E1, 0);
        bench.receive(UART5 + 0x24, 65, 16);
        bench.run_to(1_050_000);
        serial.inject(fault);
        bench.run_to(2_000_000);
        assert_eq!(bench.read(UART5 + ISR) & flag, flag, "{fault:?}");
        bench.write(UART5 + 0x20, 0xF);
        bench.run_to(4_000_000);
        assert_eq!(
            (bench.received(2), bench.read(UART5 + ISR) & 0xF),
            (vec![0x22, 0], 0),
            "{fault:?}"
        );
    }
    // Cut it is silent, and no sender is heard.
    let mut bench = bench();
    let serial = link(&mut bench, DBUS, &[(1_000_000, &[0x11])], false);
    serial.set_cut(true);
    bench.uart5(100_000, CR1_8E1, 0);
    bench.receive(UART5 + 0x24, 65, 16);
    bench.send(UART5 + 0x28, 66, &[7]);
    bench.run_to(2_000_000);
    assert_eq!((bench.remaining(), heard(&serial).len()), (16, 0));
}

#[test]
fn only_uarts_that_exist_are_connected() {
    let mut bench = bench();
    let serial = link(&mut bench, DBUS, &[], false);
    assert!(bench.machine.connect_serial(0, &serial, false).is_err());
    assert!(bench.machine.connect_serial(11, &serial, false).is_err());
    let config = SerialConfig { bits: 13, ..DBUS };
    let device = Device { says: Vec::new(), heard: Vec::new() };
    let serial = bench.world.add_serial(config, device);
    let error = bench.machine.connect_serial(5, &serial, false).unwrap_err().to_string();
    assert!(error.contains("13 bits"), "{error}");
}

/// Lock, to motor 0.
const QUESTION: [u8; 17] = [0xFE, 0xEE, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x65, 0x23];

/// A motor on RS-485: it answers a question 20 us after its last byte.
#[test]
fn a_line_needs_the_driver_enabled() {
    const DEM: u32 = 1 << 14;
    for (control, pin, works) in [(DEM, 7, true), (0, 7, false), (DEM, 8, false)] {
        let mut bench = bench();
        bench.alternate(3, 4, pin);
        let config = LineConfig { echo: true, ..LineConfig::default() };
        let (line, motor) = bench.usart2(config, 4_000_000, control);
        bench.run_to(100_000);
        let start = bench.machine.now().get();
        bench.send(USART2 + 0x28, 44, &QUESTION);
        for t in 0..259 {
            bench.run_to(start + t * 250);
            if bench.remaining() != 64 {
                eprintln!("{control:#x} {pin} {t} {} {:?}", bench.remaining(), bench.received(2));
                break;
            }
        }
        bench.run_to(start + 42_500 + 20_000 + 2_300);
        assert_eq!(bench.remaining(), 64, "its own bytes are not heard");
        bench.run_to(start + 200_000);
        let answer = bench.received(2);
        assert_eq!(answer == [0xFD, 0xEE], works, "{control:#x} {pin}");
        assert_eq!(motor.state().commands, u64::from(works));
        if works {
            assert_eq!((bench.remaining(), line.counters().collided), (64 - 16, 0));
        }
    }
}

/// Neither end understands the other: half the rate is noise to both.
#[test]
fn another_rate_on_a_line_is_garbage_at_both_ends() {
    let mut bench = bench();
    bench.alternate(3, 4, 7);
    let (line, motor) = bench.usart2(LineConfig::default(), 2_000_000, 1 << 14);
    line.keep_trace();
    bench.run_to(100_000);
    bench.send(USART2 + 0x28, 44, &QUESTION);
    bench.run_to(500_000);
    let heard = line.take_trace();
    assert_eq!(heard.len() as u64 + bench.machine.garbled(2), 17);
    assert!(bench.machine.garbled(2) > 0 && motor.state().commands == 0);
    assert_eq!(bench.remaining(), 64, "no answer");
    // Another master polls at the right rate.
    line.inject(&QUESTION);
    bench.run_to(1_000_000);
    assert_eq!(motor.state().commands, 1);
    // Framing.
    assert_ne!(bench.read(USART2 + ISR) & 2, 0);
    assert_ne!(bench.received(2), [0xFD, 0xEE]);
}

#[test]
fn who_talks_into_an_answer_is_noticed() {
    let mut bench = bench();
    let line = bench.world.add_line(LineConfig::default());
    bench.machine.connect_line(2, &line).unwrap();
    let _motor = line.add(GoM8010::new(0), plant());
    bench.alternate(3, 6, 7);
    bench.write(USART2 + 0x0C, HZ / 4_000_000);
    // OVRDIS: the received bytes are not read.
    bench.write(USART2 + 0x08, 1 << 12);
    bench.write(USART2, 0b101);
    // Another master polls, and a third node talks into the motor's reply.
    line.inject(&QUESTION);
    bench.run_to(70_000);
    assert_eq!(bench.read(USART2 + ISR) & 2, 0);
    line.inject(&[0x55; 3]);
    bench.write(USART2 + 0x20, 0xF);
    bench.run_to(200_000);
    assert_ne!(bench.read(USART2 + ISR) & 2, 0);
    assert!(bench.machine.connect_line(11, &line).is_err());
}

/// Rises every 700 us, for 300 us.
struct Ticker {
    next: Nanos,
    high: bool,
}

impl PulseDevice for Ticker {
    fn power_on(&mut self, now: Nanos) {
        self.next = now + Nanos::new(700_000);
    }

    fn next_event(&self) -> Option<Nanos> {
        Some(self.next)
    }

    fn advance(&mut self, now: Nanos) -> bool {
        self.high = !self.high;
        self.next = now + Nanos::new(if self.high { 300_000 } else { 400_000 });
        self.high
    }
}

#[test]
fn pulses_are_captured() {
    let mut bench = bench();
    let pulses = bench.world.add_pulses(Ticker { next: Nanos::ZERO, high: false });
    bench.machine.connect_pulses(('F', 8), &pulses).unwrap();
    assert!(bench.machine.connect_pulses(('F', 16), &pulses).is_err());
    bench.alternate(5, 8, 9);
    // TIM13: 64 MHz, microseconds, channel 1 captures rising edges.
    const TIM13: u32 = 0x4000_1C00;
    for (offset, value) in [(0x28, 63), (0x2C, 0xFFFF), (0x14, 1), (0x18, 1), (0x20, 1), (0x00, 1)]
    {
        bench.write(TIM13 + offset, value);
    }
    let mut edges = Vec::new();
    while bench.machine.now() < Nanos::new(3_000_000) {
        let next = bench.machine.now().get() + 50_000;
        bench.run_to(next);
        if bench.read(TIM13 + 0x10) & 2 != 0 {
            edges.push(bench.read(TIM13 + 0x34));
        }
    }
    assert_eq!(edges, [700, 1_400, 2_100, 2_800]);
}

/// The rig has no remote: such faults are for the owner of one.
#[test]
fn a_rig_without_a_remote_refuses_to_lose_it() {
    let machine = Machine::new(&program(LOAD, FLASH, HANDLER)).unwrap();
    let fault: Fault = "remote-lost@1ms..2500us".parse().unwrap();
    let refused = Rig::new(machine, World::new(1), vec![], vec![], vec![], &[fault]).err().unwrap();
    assert!(refused.to_string().contains("remote"), "{refused}");
}
