//! A LED strip's signal: TIM23's channel 4 on PF9, a width by DMA for every period.

use crate::chip::{AHB1ENR, APB1HENR, Chip, RCC};

const TIM23: u32 = 0x4000_E000;
const PF9: (char, usize) = ('F', 9);
/// The registers of DMA1's stream 7.
const CR: u32 = 0x4002_0010 + 7 * 0x18;
const WIDTHS: u32 = 0x3000_0000;
/// 240 MHz: 1.25 us, 0.3 us, 0.8 us.
const PERIOD: u32 = 300;
const ZERO: u32 = 72;
const ONE: u32 = 192;

/// Timer and pin as a strip's driver sets them up.
fn strip(control: u32) -> Chip {
    let mut chip = Chip::running();
    chip.write(APB1HENR, 1 << 24);
    chip.write(AHB1ENR, 1);
    chip.write(RCC + 0xDC, 1 << 29);
    chip.alternate(5, 9, 13);
    // OC4M: PWM 1, OC4PE; CC4E.
    chip.write(TIM23 + 0x1C, 0x6800);
    chip.write(TIM23 + 0x20, 1 << 12);
    chip.write(TIM23 + 0x04, control);
    chip.count(TIM23, 0, PERIOD - 1);
    assert!(chip.record('F', 9));
    chip
}

fn send(chip: &mut Chip, request: u32, enable: u32, widths: &[u32]) {
    for (address, width) in (WIDTHS..).step_by(4).zip(widths) {
        chip.memory.write(address, &width.to_le_bytes()).unwrap();
    }
    // Words to words, to the peripheral, TCIE.
    let control = 2 << 13 | 2 << 11 | 1 << 6 | 1 << 4 | 1;
    let count = u32::try_from(widths.len()).unwrap();
    chip.stream((1, 7), request, [TIM23 + 0x40, WIDTHS], count, control);
    chip.write(TIM23 + 0x0C, enable);
    chip.set(TIM23, 1, 1);
}

/// A width for each bit, and none at the end.
pub fn widths(colours: &[u32]) -> Vec<u32> {
    let bits = colours.iter().flat_map(|colour| (0..24).rev().map(move |bit| colour >> bit & 1));
    bits.map(|bit| if bit == 1 { ONE } else { ZERO }).chain([0]).collect()
}

/// Start, high time and low time of each pulse, nanoseconds; the last one's low time is 0.
pub fn pulses(chip: &mut Chip, (port, pin): (char, usize)) -> Vec<(u64, u64, u64)> {
    let edges = chip.soc.take_edges(port, pin);
    assert!(edges.iter().enumerate().all(|(index, edge)| edge.high == (index % 2 == 0)));
    let time = |index: usize| edges.get(index).map(|edge| edge.at.get());
    (0..edges.len())
        .step_by(2)
        .map(|index| {
            let (rise, fall) = (time(index).unwrap(), time(index + 1).unwrap());
            (rise, fall - rise, time(index + 2).map_or(0, |next| next - fall))
        })
        .collect()
}

/// A WS2812's reading of pulses: 24 bits a colour, green first.
pub fn colours(pulses: &[(u64, u64, u64)]) -> Vec<u32> {
    let bits = pulses.iter().map(|&(_, high, low)| {
        // Data sheet: 0.3 us and 0.8 us high, each +- 0.15 us.
        assert!((150..=450).contains(&high) || (650..=950).contains(&high), "{high}");
        assert!(low == 0 || high + low == 1250, "{high} {low}");
        u32::from(high > 550)
    });
    let bits: Vec<_> = bits.collect();
    bits.chunks(24).map(|colour| colour.iter().fold(0, |sum, bit| sum << 1 | bit)).collect()
}

#[test]
fn colours_come_out_as_they_were_put_in() {
    let wanted = [0x00FF_8001, 0x0012_3456, 0x0000_0000, 0x00FF_FFFF];
    let widths = widths(&wanted);
    let mut chip = strip(0);
    let start = chip.now;
    // TIM23_UP, UDE.
    send(&mut chip, 130, 1 << 8, &widths);
    assert!(chip.until_interrupt(47, start + 1_000_000).is_some());
    chip.run_to(start + 1_000_000);
    let pulses = pulses(&mut chip, PF9);
    assert_eq!(colours(&pulses), wanted);
    assert_eq!((pulses[0].1, pulses[8].1), (800, 800));
    assert_eq!(chip.kinds(), []);
    assert_eq!(chip.read(CR) & 1, 0);
    assert_eq!(chip.soc.pin_output('F', 9), Some(false));
}

/// A width is fetched when a period begins, and counts when the next begins.
#[test]
fn a_width_counts_from_the_next_period_on() {
    let mut chip = strip(0);
    let start = chip.now;
    send(&mut chip, 130, 1 << 8, &[ONE, ZERO, 0]);
    chip.run_to(start + 100_000);
    let pulses = pulses(&mut chip, PF9);
    assert_eq!(pulses, [(start + 2500, 800, 450), (start + 3750, 300, 0)]);
}

/// The compare channel's request (`TIM23_CH4`): at its match, or with CCDS at the update.
#[test]
fn the_channel_asks_too() {
    for control in [0, 1 << 3] {
        let mut chip = strip(control);
        let start = chip.now;
        send(&mut chip, 129, 1 << 12, &[ONE, ZERO, ONE, 0]);
        chip.run_to(start + 100_000);
        let widths: Vec<_> = pulses(&mut chip, PF9).iter().map(|pulse| pulse.1).collect();
        assert_eq!(widths, [800, 300, 800], "{control}");
    }
}

#[test]
fn nothing_comes_out_of_another_alternate_function_or_without_cc4e() {
    for broken in [0, 1] {
        let mut chip = strip(0);
        if broken == 0 {
            chip.alternate(5, 9, 9);
        } else {
            chip.write(TIM23 + 0x20, 0);
        }
        let start = chip.now;
        send(&mut chip, 130, 1 << 8, &[ONE, ONE, 0]);
        chip.run_to(start + 100_000);
        assert_eq!(pulses(&mut chip, PF9), []);
    }
}

#[test]
fn a_request_without_a_stream_costs_one_event() {
    let mut chip = strip(0);
    chip.write(TIM23 + 0x0C, 1 << 8);
    chip.set(TIM23, 1, 1);
    let start = chip.now;
    let mut events = 0;
    while let Some(next) = chip.soc.next_event().filter(|next| next.get() < start + 10_000_000) {
        chip.to(next.get());
        events += 1;
    }
    assert!(events <= 1, "{events}");
}
