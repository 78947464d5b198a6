//! Driver enable, for RS-485 transceivers.

use crate::chip::{APB1LENR, Chip};

/// USART2, on PD5, PD6, driver enable on PD4.
const USART2: u32 = 0x4000_4400;
const DEM: u32 = 1 << 14;
const DEP: u32 = 1 << 15;
const UE_TE: u32 = 0b1001;
/// 30 clocks of 120 MHz: 4 Mbit/s.
const BIT: u64 = 250;

fn usart(deat: u32, dedt: u32, cr3: u32) -> Chip {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1 << 17);
    chip.alternate(3, 4, 7);
    chip.alternate(3, 5, 7);
    chip.write(USART2 + 0x0C, 30);
    chip.write(USART2 + 0x08, cr3);
    assert!(chip.record('D', 4));
    chip.write(USART2, deat << 21 | dedt << 16);
    chip.write(USART2, deat << 21 | dedt << 16 | UE_TE);
    chip
}

fn edges(chip: &mut Chip) -> Vec<(u64, bool)> {
    chip.soc.take_edges('D', 4).iter().map(|edge| (edge.at.get(), edge.high)).collect()
}

#[test]
fn it_is_asserted_around_everything_that_is_sent() {
    // 16 and 8 samples of 16: a bit before, half a bit behind.
    let mut chip = usart(16, 8, DEM);
    let start = chip.now;
    assert_eq!(chip.soc.driver_enable(2), Some(false));
    chip.write(USART2 + 0x28, 0x55);
    chip.write(USART2 + 0x28, 0xAA);
    assert_eq!(chip.soc.driver_enable(2), Some(true));
    chip.run_to(start + 100 * BIT);
    let sent = chip.soc.take_sent();
    let times: Vec<_> = sent.iter().map(|byte| (byte.start.get(), byte.end.get())).collect();
    let first = start + BIT;
    assert_eq!(times, [(first, first + 10 * BIT), (first + 10 * BIT, first + 20 * BIT)]);
    assert_eq!(edges(&mut chip), [(start, true), (first + 20 * BIT + BIT / 2, false)]);
    assert_eq!(chip.soc.pin_output('D', 4), Some(false));
}

#[test]
fn what_comes_while_it_is_released_waits_for_both_times() {
    let mut chip = usart(16, 16, DEM);
    let start = chip.now;
    chip.write(USART2 + 0x28, 1);
    let end = start + 11 * BIT;
    chip.run_to(end + BIT / 2);
    chip.write(USART2 + 0x28, 2);
    chip.run_to(end + 100 * BIT);
    let second = chip.soc.take_sent()[1];
    assert_eq!(second.start.get(), end + BIT + BIT);
    // Released and asserted in the same instant.
    assert_eq!(edges(&mut chip), [(start, true), (second.end.get() + BIT, false)]);
}

#[test]
fn it_may_be_low_or_not_there() {
    let mut chip = usart(0, 0, DEM | DEP);
    let start = chip.now;
    assert_eq!(chip.soc.driver_enable(2), Some(true));
    chip.write(USART2 + 0x28, 1);
    chip.run_to(start + 100 * BIT);
    let levels: Vec<_> = edges(&mut chip);
    assert_eq!(levels.last(), Some(&(start + 10 * BIT, true)));
    assert!(levels.contains(&(start, false)));

    let mut chip = usart(16, 16, 0);
    let start = chip.now;
    chip.write(USART2 + 0x28, 1);
    chip.run_to(start + 100 * BIT);
    assert_eq!((chip.soc.driver_enable(2), edges(&mut chip)), (None, vec![]));
    assert_eq!(chip.soc.take_sent()[0].start.get(), start, "nothing to wait for");

    // Another alternate function: nothing leads outside.
    let mut chip = usart(0, 0, DEM);
    chip.alternate(3, 4, 8);
    assert_eq!(chip.soc.driver_enable(2), None);
}
