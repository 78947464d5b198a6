//! The boards: crystals, pins that lead nowhere, switches of pads.

use rc10_emu::peripherals::{AccessKind, PinFault, ResetCause};
use rc10_emu::{Board, Package};
use rc10_sim::Nanos;

use crate::chip::{AHB1ENR, AHB4ENR, APB1LENR, APB2ENR, APB4ENR, Chip, RCC};

const GPIOC: u32 = 0x5802_0800;
const GPIOF: u32 = 0x5802_1400;
const PMCR: u32 = 0x5800_0404;

fn said(chip: &mut Chip) -> Vec<String> {
    chip.soc.take_reports().iter().map(ToString::to_string).collect()
}

/// HSE / 2 x 40 as on DM-MC02, with its crystal and with another.
#[test]
fn every_clock_follows_the_crystal() {
    for (crystal_hz, core, fdcan) in
        [(24_000_000, 480_000_000, 80_000_000), (25_000_000, 500_000_000, 83_333_333)]
    {
        let mut chip = Chip::on(Board { crystal_hz, ..Board::DM_MC02 }, 0);
        chip.start_clocks_with(2, 40, 6);
        let clocks = chip.soc.clocks();
        assert_eq!((clocks.core, clocks.fdcan), (core, fdcan));
        assert_eq!((clocks.bus, clocks.apb), (core / 2, [core / 4; 2]));
        assert_eq!(chip.kinds(), []);
    }
    assert_eq!(Chip::on(Board::DM_MC02, 0).soc.board(), Board::DM_MC02);
}

#[test]
fn hsi_may_be_one_per_cent_off() {
    for (ppm, hz) in [(10_000, 64_640_000), (-10_000, 63_360_000), (0, 64_000_000)] {
        let mut chip = Chip::on(Board::DM_MC02, ppm);
        assert_eq!(chip.soc.clocks().core, hz);
        // HSI / 16 x 120 at the edge of the PLL's range.
        chip.set(RCC + 0x28, 0x3F << 4 | 3, 16 << 4);
        chip.set(RCC + 0x2C, 0xF | 7 << 16, 2 << 2 | 3 << 16);
        chip.write(RCC + 0x30, 119 | 3 << 16);
        chip.set(RCC, 1 << 24, 1 << 24);
        chip.wait(RCC, 1 << 25);
        chip.set(RCC + 0x50, 3 << 28, 1 << 28);
        assert_eq!(chip.soc.clocks().fdcan, hz / 16 * 120 / 4);
        assert_eq!(chip.kinds(), []);
    }
}

#[test]
fn a_pin_that_the_package_lacks_is_told_once() {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    chip.start_clocks_with(2, 40, 6);
    chip.write(AHB4ENR, 0x7F);
    // An input is harmless.
    chip.write(GPIOF, 0xFFF3_FFFF);
    assert_eq!(said(&mut chip), [""; 0]);
    // TIM14's channel on PF9.
    chip.alternate(5, 9, 9);
    assert_eq!(said(&mut chip), ["PF9 is not bonded out on the STM32H723VG (LQFP100)"]);
    chip.write(GPIOF, u32::MAX);
    chip.write(GPIOF, 0xFFF7_FFFF);
    assert_eq!(said(&mut chip), [""; 0]);
    let package = Package::Lqfp100;
    let fault = PinFault { pin: ('F', 9), chip: "", package, is_switch_open: false };
    assert_eq!((chip.soc.count(AccessKind::Pin(fault)), chip.soc.pin_output('F', 9)), (1, None));
    // It has the others, the team's own board all of them.
    chip.alternate(0, 7, 9);
    assert_eq!(chip.kinds(), []);
    let mut chip = Chip::running();
    chip.alternate(5, 9, 9);
    assert_eq!(chip.kinds(), []);
}

#[test]
fn pc3_reaches_its_pad_while_its_switch_is_closed() {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    chip.write(AHB4ENR, 1 << 2);
    chip.write(APB4ENR, 1 << 1);
    assert_eq!(chip.read(PMCR) >> 26 & 3, 0, "closed after a reset");
    chip.write(GPIOC + 0x18, 1 << 3);
    chip.write(GPIOC, 0xFFFF_FF7F);
    assert_eq!((chip.soc.pin_output('C', 3), chip.kinds()), (Some(true), vec![]));
    // PC3SO.
    chip.set(PMCR, 1 << 27, 1 << 27);
    assert_eq!(chip.soc.pin_output('C', 3), None);
    let report = "PC3 is used while its switch to PC3_C is open (SYSCFG_PMCR.PC3SO)";
    assert_eq!(said(&mut chip), [report]);
    assert_eq!(chip.read(GPIOC + 0x10) & 8, 8, "it still reads itself");
    chip.set(PMCR, 1 << 27, 0);
    assert_eq!((chip.soc.pin_output('C', 3), chip.kinds()), (Some(true), vec![]));
    // Neither does a level come in.
    chip.write(GPIOC, 0xFFFF_FFCF);
    assert!(chip.soc.drive_pin('C', 2, Some(true), Nanos::new(chip.now)));
    assert_eq!(chip.read(GPIOC + 0x10) & 4, 4);
    chip.set(PMCR, 1 << 26, 1 << 26);
    assert_eq!(chip.read(GPIOC + 0x10) & 4, 0);
    assert_eq!(chip.kinds(), [], "an input is no use that is told");
}

#[test]
fn an_open_switch_takes_a_pin_from_its_spi() {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    chip.start_clocks_with(2, 40, 6);
    chip.write(APB1LENR, 1 << 14);
    chip.write(APB4ENR, 1 << 1);
    chip.set(PMCR, 1 << 26, 1 << 26);
    chip.alternate(2, 2, 5);
    assert!(matches!(chip.kinds()[..], [AccessKind::Pin(fault)] if fault.pin == ('C', 2)));
}

/// The same chip where both switches are open after a reset: the program has to close them.
#[test]
fn switches_may_be_open_after_a_reset() {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    chip.soc.set_switches_closed(false, Nanos::ZERO);
    for _ in 0..2 {
        chip.write(AHB4ENR, 1 << 2);
        chip.write(APB4ENR, 1 << 1);
        assert_eq!(chip.read(PMCR) >> 26 & 3, 3);
        chip.write(GPIOC + 0x18, 1 << 3);
        chip.write(GPIOC, 0xFFFF_FF4F);
        let report = "PC3 is used while its switch to PC3_C is open (SYSCFG_PMCR.PC3SO)";
        assert_eq!((chip.soc.pin_output('C', 3), said(&mut chip)), (None, vec![report.into()]));
        assert!(chip.soc.drive_pin('C', 2, Some(true), Nanos::new(chip.now)));
        assert_eq!(chip.read(GPIOC + 0x10) & 4, 0);
        chip.set(PMCR, 3 << 26, 0);
        assert_eq!((chip.soc.pin_output('C', 3), chip.kinds()), (Some(true), vec![]));
        assert_eq!(chip.read(GPIOC + 0x10) & 4, 4);
        chip.soc.reset(ResetCause::Software, Nanos::new(chip.now));
    }
}

#[test]
fn a_silent_peripheral_is_as_good_as_none() {
    let mut chip = Chip::on(Board::DM_MC02, 0);
    for name in ["TIM17", "TIM8", "SPI2", "ADC1"] {
        assert!(chip.soc.silence(name), "{name}");
    }
    assert!(!chip.soc.silence("TIM99"));
    // Without a clock, and with one: CR1 of two timers, CFG1, SQR1, ADC12_COMMON's CCR.
    for clocks in [0, u32::MAX] {
        chip.write(AHB1ENR, clocks & 1 << 5);
        chip.write(APB1LENR, clocks & 1 << 14);
        chip.write(APB2ENR, clocks & (1 << 18 | 1 << 17 | 1 << 1));
        let silent = [0x4001_4800, 0x4001_0400, 0x4000_3808, 0x4002_2030, 0x4002_2308];
        for address in silent {
            chip.write(address, 7);
            assert_eq!(chip.read(address), 0, "{address:#x}");
        }
        assert_eq!((chip.kinds(), chip.soc.next_event()), (vec![], None));
    }
    // TIM16, beside them, says something.
    chip.write(0x4001_442C, 7);
    assert_eq!(chip.read(0x4001_442C), 7);
}
