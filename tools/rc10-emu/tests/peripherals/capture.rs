//! Inputs of timers: capture and the encoder interface.

use rc10_emu::peripherals::AccessKind;
use rc10_sim::Nanos;

use crate::chip::{APB1LENR, Chip};

const TIM3: u32 = 0x4000_0400;
const TIM4: u32 = 0x4000_0800;
const TIM5: u32 = 0x4000_0C00;
const TIM12: u32 = 0x4000_1800;
const TIM13: u32 = 0x4000_1C00;
const CR1: u32 = 0x00;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR2: u32 = 0x38;

impl Chip {
    fn drive(&mut self, (port, pin): (char, usize), high: bool) {
        assert!(self.soc.drive_pin(port, pin, Some(high), Nanos::new(self.now)));
    }
}

/// A timer at 1 MHz whose channel 1 captures, with a CCMR1 and a CCER.
fn captures(timer: u32, gate: u32, ccmr1: u32, ccer: u32) -> Chip {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 << gate);
    chip.count(timer, 239, 0xFFFF);
    chip.write(timer + CCMR1, ccmr1);
    chip.write(timer + CCER, ccer);
    chip.write(timer + DIER, 1 << 1);
    chip
}

/// TIM13's channel 1 on PF8, as for a PPM remote: interrupt 44.
fn ppm(filter: u32) -> (Chip, u64) {
    let mut chip = captures(TIM13, 7, filter << 4 | 1, 1);
    chip.alternate(5, 8, 9);
    chip.write(TIM13 + CR1, 1);
    let start = chip.now;
    (chip, start)
}

const PF8: (char, usize) = ('F', 8);

#[test]
fn a_rising_edge_is_timed() {
    let (mut chip, start) = ppm(0);
    for (nanos, high, captured) in
        [(1_500_000, true, Some(1_500)), (1_800_000, false, None), (2_999_999, true, Some(2_999))]
    {
        chip.run_to(start + nanos);
        chip.drive(PF8, high);
        assert_eq!(chip.interrupt(44), captured.is_some());
        if let Some(captured) = captured {
            assert_eq!(chip.read(TIM13 + CCR1), captured);
            assert!(!chip.interrupt(44), "reading takes it");
        }
    }
    assert_eq!(chip.kinds(), []);
}

#[test]
fn one_that_was_not_taken_is_overwritten_and_told() {
    let (mut chip, start) = ppm(0);
    for nanos in [1_000_000, 2_000_000] {
        chip.run_to(start + nanos);
        chip.drive(PF8, true);
        chip.drive(PF8, false);
    }
    assert_eq!(chip.read(TIM13 + SR) & 0x202, 0x202);
    assert_eq!(chip.read(TIM13 + CCR1), 2_000);
    chip.write(TIM13 + SR, !0x200);
    assert_eq!(chip.read(TIM13 + SR) & 0x202, 0);
}

#[test]
fn a_filter_delays_edges_and_swallows_short_pulses() {
    // IC1F = 3: eight equal samples at 240 MHz, 33 1/3 ns.
    let (mut chip, start) = ppm(3);
    chip.run_to(start + 1_000_000);
    chip.drive(PF8, true);
    chip.run_to(start + 1_000_033);
    chip.drive(PF8, false);
    chip.run_to(start + 1_100_000);
    assert_eq!(chip.read(TIM13 + SR) & 2, 0, "a spike");
    chip.drive(PF8, true);
    assert_eq!(chip.until_interrupt(44, start + 2_000_000), Some(start + 1_100_034));
}

#[test]
fn falling_edges_both_edges_and_every_fourth() {
    for (ccmr1, ccer, expected) in
        [(1, 0b0011, 3), (1, 0b1011, 6), (1 | 2 << 2, 0b0001, 0), (1 | 1 << 2, 0b1011, 3)]
    {
        let mut chip = captures(TIM13, 7, ccmr1, ccer);
        chip.alternate(5, 8, 9);
        chip.write(TIM13 + CR1, 1);
        let mut captured = 0;
        for step in 0..6 {
            chip.run_to(chip.now + 10_000);
            chip.drive(PF8, step % 2 == 0);
            captured += u32::from(chip.interrupt(44));
            chip.write(TIM13 + SR, 0);
        }
        assert_eq!(captured, expected, "{ccmr1:#x} {ccer:#b}");
    }
}

#[test]
fn a_channel_may_listen_to_its_neighbours_pin() {
    // TIM12: channel 1 on PB14; channel 2 captures falling edges of the same pin.
    let mut chip = captures(TIM12, 6, 1 | 2 << 8, 0b0011_0001);
    chip.alternate(1, 14, 2);
    chip.write(TIM12 + CR1, 1);
    let start = chip.now;
    chip.run_to(start + 100_000);
    chip.drive(('B', 14), true);
    chip.run_to(start + 350_000);
    chip.drive(('B', 14), false);
    assert!(chip.interrupt(43));
    assert_eq!((chip.read(TIM12 + CCR1), chip.read(TIM12 + CCR2)), (100, 350));
}

#[test]
fn an_unconnected_or_switched_off_channel_captures_nothing() {
    let mut chip = captures(TIM13, 7, 1, 1);
    chip.alternate(5, 8, 3);
    chip.write(TIM13 + CR1, 1);
    chip.drive(PF8, true);
    assert_eq!(chip.read(TIM13 + SR) & 2, 0);
    // That the pin becomes an input of a timer is no edge.
    let mut chip = captures(TIM13, 7, 1, 0);
    chip.drive(PF8, true);
    chip.alternate(5, 8, 9);
    chip.write(TIM13 + CCER, 1);
    assert_eq!(chip.read(TIM13 + SR) & 2, 0);
    // Its direction is locked while it is on, and its register cannot be written.
    chip.write(TIM13 + CCMR1, 0);
    chip.write(TIM13 + CCR1, 5);
    assert_eq!((chip.read(TIM13 + CCMR1), chip.read(TIM13 + CCR1)), (1, 0));
    assert_eq!(chip.kinds(), [AccessKind::Protected; 2]);
}

/// An encoder's two signals on a timer's channels 1 and 2.
struct Encoder {
    chip: Chip,
    timer: u32,
    pins: [(char, usize); 2],
    /// Quarter periods.
    position: i32,
}

impl Encoder {
    fn new(timer: u32, gate: u32, port: u32, pins: [u32; 2], mode: u32, last: u32) -> Self {
        let mut chip = Chip::running();
        chip.write(APB1LENR, 1 << gate);
        pins.iter().for_each(|&pin| chip.alternate(port, pin, 2));
        chip.write(timer + CCMR1, 0x0101);
        chip.write(timer + CCER, 0x11);
        chip.write(timer + SMCR, mode);
        chip.write(timer + ARR, last);
        chip.set(timer + CR1, 1, 1);
        let port = char::from(b'A' + u8::try_from(port).unwrap());
        Self { chip, timer, pins: pins.map(|pin| (port, pin as usize)), position: 0 }
    }

    /// Quarter periods forwards: the first signal leads.
    fn turn(&mut self, steps: i32) {
        for _ in 0..steps.abs() {
            self.position += steps.signum();
            let quarter = self.position.rem_euclid(4);
            self.chip.run_to(self.chip.now + 1_000);
            self.chip.drive(self.pins[0], quarter == 1 || quarter == 2);
            self.chip.drive(self.pins[1], quarter == 2 || quarter == 3);
        }
    }

    fn count(&mut self) -> u32 {
        self.chip.read(self.timer + CNT)
    }

    fn counts_down(&mut self) -> bool {
        self.chip.read(self.timer + CR1) & 1 << 4 != 0
    }
}

#[test]
fn an_encoder_counts_every_edge_in_both_directions() {
    let mut encoder = Encoder::new(TIM3, 1, 2, [6, 7], 3, 0xFFFF);
    encoder.turn(1000);
    assert_eq!((encoder.count(), encoder.counts_down()), (1000, false));
    encoder.turn(-1003);
    assert_eq!((encoder.count(), encoder.counts_down()), (0xFFFD, true));
    // Through zero: an update.
    assert_eq!(encoder.chip.read(TIM3 + SR) & 1, 1);
    encoder.turn(3);
    assert_eq!((encoder.count(), encoder.counts_down()), (0, false));
    // Time does not move it.
    encoder.chip.run_to(encoder.chip.now + 1_000_000_000);
    assert_eq!(encoder.count(), 0);
    encoder.chip.set(TIM3 + CR1, 1 << 7, 0);
    assert_eq!(encoder.chip.kinds(), []);
}

#[test]
fn a_32_bit_encoder_goes_far() {
    let mut encoder = Encoder::new(TIM5, 3, 0, [0, 1], 3, u32::MAX);
    encoder.turn(-2);
    assert_eq!(encoder.count(), u32::MAX - 1);
    encoder.chip.write(TIM5 + CNT, 0x1_0000);
    encoder.turn(70_000);
    assert_eq!(encoder.count(), 0x1_0000 + 70_000);
}

#[test]
fn modes_and_polarity_of_an_encoder() {
    // Edges of the first signal only, of the second only: half as many.
    for mode in [1, 2] {
        let mut encoder = Encoder::new(TIM3, 1, 2, [6, 7], mode, 0xFFFF);
        encoder.turn(400);
        assert_eq!(encoder.count(), 200, "mode {mode}");
        encoder.turn(-400);
        assert_eq!(encoder.count(), 0, "mode {mode}");
    }
    // One signal inverted: the other direction.
    let mut encoder = Encoder::new(TIM3, 1, 2, [6, 7], 3, 999);
    encoder.chip.write(TIM3 + CCER, 0x13);
    encoder.turn(10);
    assert_eq!((encoder.count(), encoder.counts_down()), (990, true));
    // Any other slave mode is not modelled.
    encoder.chip.write(TIM3 + SMCR, 4);
    assert_eq!(encoder.chip.kinds(), [AccessKind::Unmodelled]);
}

#[test]
fn four_outputs_have_their_widths() {
    // Servos on PD12 to PD15: 20 ms, 1 to 2 ms.
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 << 2);
    chip.write(TIM4 + CCMR1, 0x6868);
    chip.write(TIM4 + CCMR1 + 4, 0x6868);
    chip.write(TIM4 + CCER, 0x3111);
    for channel in 0..4 {
        chip.alternate(3, 12 + channel, 2);
        chip.write(TIM4 + CCR1 + 4 * channel, 1_000 + 250 * channel);
        assert!(chip.record('D', 12 + channel as usize));
    }
    chip.count(TIM4, 239, 19_999);
    chip.write(TIM4 + CR1, 1);
    let start = chip.now;
    chip.run_to(start + 59_000_000);
    for channel in 0..4_usize {
        let edges = chip.soc.take_edges('D', 12 + channel);
        let rises: Vec<_> = edges
            .iter()
            .filter(|edge| edge.high == (channel < 3))
            .map(|edge| edge.at.get())
            .collect();
        let width = 1_000_000 + 250_000 * channel as u64;
        let falls: Vec<_> = edges
            .iter()
            .filter(|edge| edge.high == (channel == 3))
            .map(|edge| edge.at.get())
            .collect();
        assert_eq!(
            falls,
            [0, 20, 40].map(|millis| start + millis * 1_000_000 + width),
            "{channel}"
        );
        // The fourth is inverted.
        assert_eq!(rises.last(), Some(&(start + 40_000_000)), "{channel}");
    }
}

#[test]
fn a_wire_from_an_output_to_an_input_carries_its_pulses() {
    // TIM4's PD12 to TIM12's PB14, whose second channel captures falling edges of the same pin.
    let mut chip = captures(TIM12, 6, 1 | 2 << 8, 0b0011_0001);
    chip.set(APB1LENR, 1 << 2, 1 << 2);
    chip.alternate(1, 14, 2);
    assert!(!chip.soc.join_pins(('D', 16), ('B', 14), Nanos::new(chip.now)));
    assert!(chip.soc.join_pins(('D', 12), ('B', 14), Nanos::new(chip.now)));
    chip.write(TIM12 + CR1, 1);
    chip.write(TIM4 + CCMR1, 0x68);
    chip.write(TIM4 + CCER, 1);
    chip.write(TIM4 + CCR1, 1_234);
    chip.alternate(3, 12, 2);
    chip.count(TIM4, 239, 19_999);
    chip.write(TIM4 + CR1, 1);
    chip.run_to(chip.now + 59_000_000);
    let [rise, fall] = [CCR1, CCR2].map(|register| chip.read(TIM12 + register));
    assert_eq!(fall - rise, 1_234);
    assert_eq!(chip.kinds(), []);
}
