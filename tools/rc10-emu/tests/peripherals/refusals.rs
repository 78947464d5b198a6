use rc10_emu::peripherals::{AccessKind, BusFault, Width};
use rc10_sim::Nanos;

use crate::chip::{APB1HENR, APB1LENR, APB4ENR, Chip, RCC};

const TIM2: u32 = 0x4000_0000;
const TIM15: u32 = 0x4001_4000;

#[test]
fn without_clock_it_reads_zero_and_is_counted() {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1);
    chip.write(TIM2 + 0x2C, 1234);
    chip.write(APB1LENR, 0);
    assert_eq!(chip.read(TIM2 + 0x2C), 0);
    chip.write(TIM2 + 0x2C, 99);
    assert_eq!(chip.soc.count(AccessKind::Gated), 2);
    let reports = chip.soc.take_reports();
    assert_eq!(reports.iter().map(|access| access.write).collect::<Vec<_>>(), [false, true]);
    assert_eq!(reports[0].to_string(), "read of 0x4000002c (TIM2): without clock or in reset");
    chip.write(APB1LENR, 1);
    assert_eq!(chip.read(TIM2 + 0x2C), 1234);
}

#[test]
fn a_peripheral_held_in_reset_has_its_reset_values_afterwards() {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1);
    chip.write(TIM2 + 0x2C, 1234);
    chip.write(RCC + 0x90, 1);
    assert_eq!((chip.read(TIM2 + 0x2C), chip.soc.count(AccessKind::Gated)), (0, 1));
    chip.write(RCC + 0x90, 0);
    assert_eq!(chip.read(TIM2 + 0x2C), u32::MAX);
}

#[test]
fn an_address_without_a_device_is_a_bus_fault() {
    let mut chip = Chip::running();
    let now = Nanos::new(chip.now);
    for address in [0x4000_7000, 0x4FFF_FFFC, 0x5802_2000, 0x5FFF_FFFC] {
        assert_eq!(chip.soc.read(address, Width::Word, now), Err(BusFault));
        assert_eq!(chip.soc.write(address, Width::Byte, 0, now), Err(BusFault));
    }
    assert_eq!(chip.soc.read(RCC + 2, Width::Word, now), Err(BusFault), "not aligned");
    assert_eq!(chip.soc.count(AccessKind::Unowned), 9);
    assert_eq!(chip.soc.count(AccessKind::Gated), 0);
}

#[test]
fn what_is_not_modelled_says_so() {
    let mut chip = Chip::running();
    chip.write(crate::chip::APB2ENR, 1 << 16);
    assert_eq!(chip.read(TIM15), 0);
    chip.write(TIM15, 1);
    assert_eq!(chip.kinds(), [AccessKind::Unmodelled; 2]);
}

#[test]
fn parts_of_words() {
    let mut chip = Chip::running();
    chip.write(APB4ENR, 1 << 1);
    let (syscfg, now) = (0x5800_0400, Nanos::new(chip.now));
    chip.write(syscfg + 0x08, 0x1234);
    chip.soc.write(syscfg + 0x09, Width::Byte, 0xAB, now).unwrap();
    assert_eq!(chip.read(syscfg + 0x08), 0xAB34);
    assert_eq!(chip.soc.read(syscfg + 0x09, Width::Byte, now), Ok(0xAB));
    chip.soc.write(syscfg + 0x08, Width::Half, 0xFFFF_5678, now).unwrap();
    assert_eq!(chip.soc.read(syscfg + 0x08, Width::Half, now), Ok(0x5678));
}

#[test]
fn the_fdcans_share_a_clock_gate_a_reset_and_their_memory() {
    let mut chip = Chip::running();
    let fdcans = [0x4000_A000, 0x4000_A400, 0x4000_D400];
    let ram = 0x4000_AC00;
    for base in fdcans.into_iter().chain([ram]) {
        assert_eq!(chip.read(base), 0);
    }
    assert_eq!(chip.soc.count(AccessKind::Gated), 4);
    chip.write(APB1HENR, 1 << 8);
    for base in fdcans {
        assert_eq!(chip.read(base), 0x3214_1218, "CREL");
        assert_eq!(chip.read(base + 4), 0x8765_4321, "ENDN");
        // CCCR: INIT, CCE; then NBTP.
        chip.write(base + 0x18, 3);
        chip.write(base + 0x1C, 0x1234_0506);
        assert_eq!(chip.read(base + 0x1C), 0x1234_0506);
    }
    // The calibration unit, while FDCAN1 is configured and when it no longer is.
    let ccfg = 0x4000_A804;
    chip.write(ccfg, 1 << 6);
    assert_eq!((chip.read(ccfg), chip.soc.count(AccessKind::Protected)), (1 << 6, 0));
    chip.write(fdcans[0] + 0x18, 0);
    chip.write(ccfg, 0);
    assert_eq!((chip.read(ccfg), chip.soc.count(AccessKind::Protected)), (1 << 6, 1));

    chip.write(ram + 0x27FC, 0x5A5A_0001);
    let now = Nanos::new(chip.now);
    chip.soc.write(ram + 0x27FD, Width::Byte, 0x77, now).unwrap();
    assert_eq!(chip.read(ram + 0x27FC), 0x5A5A_7701);

    chip.write(RCC + 0x94, 1 << 8);
    chip.write(RCC + 0x94, 0);
    for base in fdcans {
        assert_eq!(chip.read(base + 0x1C), 0x0600_0A03, "NBTP after a reset");
    }
    assert_eq!(chip.read(ccfg), 0x4, "no bypass after a reset");
    assert_eq!(chip.read(ram + 0x27FC), 0x5A5A_7701);
}

/// 480, 240 and 120 MHz: reading an FDCAN or its message RAM is said to take 40 to 50 clocks.
#[test]
fn an_access_takes_longer_the_farther_away_it_goes() {
    let chip = Chip::running();
    for (address, clocks) in [
        (0x4000_A000, 44), // FDCAN1
        (0x4000_AC00, 44), // message RAM
        (0x4001_1000, 44), // USART1
        (0x4002_0000, 24), // DMA1
        (0x5200_2000, 12), // FLASH
        (0x5802_0000, 24), // GPIOA
        (0x3000_0000, 0),  // SRAM1
    ] {
        assert_eq!(chip.soc.access_clocks(address), clocks, "{address:#x}");
    }
    assert_eq!(Chip::new().soc.access_clocks(0x4000_A000), 16, "all buses at the core's clock");
}
