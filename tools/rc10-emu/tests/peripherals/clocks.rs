use rc10_emu::Options;
use rc10_emu::peripherals::{AccessKind, Clocks, ResetCause};
use rc10_sim::Nanos;

use crate::chip::{APB1LENR, Chip, FLASH, PWR, RCC, TOO_FAST};

const RSR: u32 = RCC + 0xD0;

#[test]
fn our_firmwares_clocks() {
    let mut chip = Chip::new();
    assert_eq!(chip.soc.clocks().core, 64_000_000);
    assert_eq!(chip.soc.system_ready_at(), None);
    chip.start_clocks(6);
    let expected = Clocks {
        core: 480_000_000,
        bus: 240_000_000,
        apb: [120_000_000; 2],
        timers: [240_000_000; 2],
        fdcan: 80_000_000,
        usarts: [120_000_000; 2],
        spis: [80_000_000, 120_000_000],
        i2cs: 120_000_000,
        adc: 0,
    };
    assert_eq!(chip.soc.clocks(), expected);
    assert_eq!(chip.soc.clocks().core, 480_000_000);
    assert!(chip.soc.system_ready_at().is_some_and(|at| at.get() <= chip.now));
    assert_eq!(chip.kinds(), []);
}

#[test]
fn the_crystal_takes_two_milliseconds_and_the_pll_fifty_microseconds() {
    let mut chip = Chip::new();
    chip.now = 1_000;
    chip.set(RCC, 1 << 16, 1 << 16);
    chip.to(2_000_999);
    assert_eq!(chip.read(RCC) & 1 << 17, 0);
    chip.to(2_001_000);
    assert_ne!(chip.read(RCC) & 1 << 17, 0);

    chip.set(RCC + 0x28, 0x3F << 4 | 3, 5 << 4 | 2);
    chip.set(RCC + 0x2C, 0xF, 0b10 << 2);
    chip.write(RCC + 0x30, 95 | 3 << 16);
    chip.set(RCC, 1 << 24, 1 << 24);
    // Wanted before it is there: the switch waits.
    chip.set(RCC + 0x10, 7, 3);
    chip.run_to(2_050_999);
    assert_eq!((chip.read(RCC) >> 25 & 1, chip.read(RCC + 0x10) >> 3 & 7), (0, 0));
    chip.run_to(2_051_000);
    assert_eq!((chip.read(RCC) >> 25 & 1, chip.read(RCC + 0x10) >> 3 & 7), (1, 3));
    assert_eq!(chip.soc.system_ready_at(), Some(Nanos::new(2_051_000)));
}

#[test]
fn a_pll_whose_input_is_off_never_locks() {
    let mut chip = Chip::new();
    chip.write(RCC + 0x28, 5 << 4 | 2);
    chip.write(RCC + 0x30, 95);
    chip.set(RCC, 1 << 24, 1 << 24);
    chip.run_to(1_000_000_000);
    assert_eq!(chip.read(RCC) >> 25 & 1, 0);
}

#[test]
fn a_running_pll_is_locked_and_the_system_clock_cannot_be_switched_off() {
    let mut chip = Chip::running();
    chip.write(RCC + 0x28, 0);
    chip.write(RCC + 0x30, 0);
    chip.write(RCC + 0x2C, 0);
    chip.write(RCC, 0);
    assert_eq!(chip.read(RCC + 0x28) & 0x3F3, 5 << 4 | 2);
    assert_eq!(chip.soc.clocks().core, 480_000_000);
    // PLL2 is off: its divider is not locked.
    assert_eq!(chip.read(RCC + 0x28) >> 12 & 0x3F, 0);
}

#[test]
fn too_few_wait_states_are_reported_once() {
    let mut chip = Chip::running();
    chip.write(FLASH, 2);
    chip.write(FLASH, 1);
    assert_eq!(chip.kinds(), [AccessKind::WaitStates]);
    chip.write(FLASH, 3);
    chip.write(FLASH, 2);
    assert_eq!(chip.soc.count(AccessKind::WaitStates), 2);
}

#[test]
fn reset_flags_tell_every_cause_until_they_are_removed() {
    let mut chip = Chip::running();
    const PIN: u32 = 1 << 22;
    const POWER: u32 = 1 << 23;
    const SOFTWARE: u32 = 1 << 24;
    const WATCHDOG: u32 = 1 << 26;
    const ALL: u32 = PIN | POWER | SOFTWARE | WATCHDOG;
    assert_eq!(chip.read(RSR) & ALL, POWER | PIN);
    chip.write(RSR, 1 << 16);
    chip.write(RSR, 0);
    assert_eq!(chip.read(RSR), 0);
    for (cause, flags) in [
        (ResetCause::Watchdog, WATCHDOG | PIN),
        (ResetCause::Software, WATCHDOG | SOFTWARE | PIN),
        (ResetCause::PowerOn, POWER | PIN),
        (ResetCause::Pin, POWER | PIN),
    ] {
        chip.soc.reset(cause, Nanos::new(chip.now));
        assert_eq!(chip.read(RSR) & ALL, flags, "{cause:?}");
    }
}

#[test]
fn a_reset_starts_anew_but_keeps_supply_and_backup_domain() {
    let mut chip = Chip::running();
    chip.write(APB1LENR, 1);
    // BDCR, locked at first.
    chip.write(RCC + 0x70, 1 << 15);
    assert_eq!((chip.read(RCC + 0x70), chip.kinds()), (0, vec![AccessKind::Protected]));
    chip.set(PWR, 1 << 8, 1 << 8);
    chip.write(RCC + 0x70, 1 << 15 | 2 << 8);
    chip.write(RCC + 0x70, 1 << 15 | 1 << 8);
    assert_eq!(chip.read(RCC + 0x70), 1 << 15 | 2 << 8, "RTCSEL is written once");

    chip.soc.reset(ResetCause::Software, Nanos::new(chip.now));
    assert_eq!(chip.soc.clocks().core, 64_000_000);
    assert_eq!(chip.soc.system_ready_at(), None);
    assert_eq!(chip.read(APB1LENR), 0);
    assert_eq!(chip.read(RCC + 0x70), 1 << 15 | 2 << 8);
    assert_eq!(chip.read(PWR + 0x04) >> 13 & 1, 1, "supply");
    chip.start_clocks(6);
    assert_eq!(chip.soc.clocks().core, 480_000_000);

    chip.soc.reset(ResetCause::PowerOn, Nanos::new(chip.now));
    assert_eq!((chip.read(RCC + 0x70), chip.read(PWR + 0x04) >> 13 & 1), (0, 0));
}

const HSE_ON: u32 = 1 << 16;
const SECURITY: u32 = 1 << 19;

#[test]
fn a_dead_crystal_never_becomes_ready() {
    let mut chip = Chip::new();
    chip.soc.set_crystal(false, Nanos::ZERO);
    chip.set(RCC, HSE_ON, HSE_ON);
    // A PLL behind it does not lock, and the system clock is not switched to it.
    chip.set(RCC + 0x28, 0x3F << 4 | 3, 5 << 4 | 2);
    chip.set(RCC + 0x2C, 0xF, 0b10 << 2);
    chip.write(RCC + 0x30, 95 | 3 << 16);
    chip.set(RCC, 1 << 24, 1 << 24);
    chip.set(RCC + 0x10, 7, 3);
    chip.run_to(1_000_000_000);
    assert_eq!((chip.read(RCC) >> 17 & 1, chip.read(RCC) >> 25 & 1), (0, 0));
    assert_eq!(chip.soc.clocks().core, 64_000_000);
    // A reset does not mend it.
    chip.soc.reset(ResetCause::Watchdog, Nanos::new(chip.now));
    chip.set(RCC, HSE_ON, HSE_ON);
    chip.run_to(2_000_000_000);
    assert_eq!(chip.read(RCC) >> 17 & 1, 0);
}

/// RM0468, "Clock security system on HSE".
#[test]
fn with_clock_security_a_lost_crystal_is_an_nmi_on_hsi() {
    let mut chip = Chip::running();
    chip.set(RCC, SECURITY, SECURITY);
    // It is only ever switched on.
    chip.set(RCC, SECURITY, 0);
    assert_eq!(chip.read(RCC) & SECURITY, SECURITY);
    assert!(!chip.soc.nmi());
    chip.now += 1000;
    chip.soc.set_crystal(false, Nanos::new(chip.now));
    assert!(chip.soc.nmi());
    // HSI, behind the same dividers; HSE, PLL1 and the security itself are off.
    assert_eq!((chip.soc.clocks().core, chip.soc.clocks().bus), (64_000_000, 32_000_000));
    assert_eq!(chip.soc.clocks().fdcan, 0);
    assert_eq!(chip.read(RCC) & (HSE_ON | SECURITY | 1 << 17 | 0b11 << 24), 0);
    assert_eq!(chip.read(RCC + 0x10) & 0x3F, 0, "SW and SWS");
    assert_eq!(chip.read(RCC + 0x64), 1 << 10, "HSECSSF");
    // HSECSSC, and no other bit.
    chip.write(RCC + 0x68, !(1 << 10));
    assert!(chip.soc.nmi());
    chip.write(RCC + 0x68, 1 << 10);
    assert!(!chip.soc.nmi());
    assert_eq!(chip.read(RCC + 0x64), 0);
}

#[test]
fn without_clock_security_everything_stands_still_until_the_crystal_is_back() {
    let mut chip = Chip::running();
    chip.soc.set_crystal(false, Nanos::new(chip.now));
    assert!(!chip.soc.nmi());
    assert_eq!((chip.soc.clocks().core, chip.soc.clocks().apb), (0, [0; 2]));
    chip.run_to(chip.now + 1_000_000);
    chip.soc.set_crystal(true, Nanos::new(chip.now));
    // Two milliseconds for the crystal, 50 us for the PLL.
    chip.run_to(chip.now + 2_049_999);
    assert_eq!(chip.soc.clocks().core, 0);
    chip.run_to(chip.now + 1);
    assert_eq!(chip.soc.clocks().core, 480_000_000);
}

/// Clock security switches what came from the crystal, and leaves a core on HSI alone.
#[test]
fn a_core_on_hsi_goes_on_without_the_crystal() {
    let mut chip = Chip::new();
    chip.set(RCC, HSE_ON, HSE_ON);
    chip.wait(RCC, 1 << 17);
    chip.set(RCC, SECURITY, SECURITY);
    chip.soc.set_crystal(false, Nanos::new(chip.now));
    assert!(chip.soc.nmi());
    assert_eq!(chip.soc.clocks().core, 64_000_000);
}

const APB1HENR: u32 = RCC + 0xEC;

fn reports(chip: &mut Chip) -> Vec<String> {
    chip.soc.take_reports().iter().map(ToString::to_string).collect()
}

/// RM0399 59.4.5: `fdcan_tq_ck < fdcan_pclk`; 125 MHz at most at the highest voltage.
#[test]
fn the_fdcans_clock_has_limits() {
    for (divider, said) in [
        (6, &[][..]),
        (5, &[]),
        (4, &["FDCAN's time quantum clock is 120 MHz, and must be below APB1's 120 MHz"]),
        (
            3,
            &[
                "FDCAN's kernel clock is 160 MHz, at this voltage 125 are allowed",
                "FDCAN's time quantum clock is 160 MHz, and must be below APB1's 120 MHz",
            ],
        ),
    ] {
        let mut chip = Chip::with_pll1_q(divider);
        assert_eq!(chip.kinds(), [], "without its bus clock it does not matter");
        chip.set(APB1HENR, 1 << 8, 1 << 8);
        let reports = reports(&mut chip);
        assert_eq!(reports.len(), said.len(), "{divider}: {reports:?}");
        for (report, said) in reports.iter().zip(said) {
            assert!(report.contains(said) && report.contains("(RCC)"), "{report}");
        }
        // Once, not with every access.
        chip.set(APB1HENR, 1 << 8, 1 << 8);
        assert_eq!(chip.soc.count(TOO_FAST), said.len() as u64);
    }
}

/// The calibration unit's divider makes the time quantum clock slower, not the kernel clock.
#[test]
fn the_calibration_units_divider_counts() {
    let mut chip = Chip::with_pll1_q(4);
    chip.set(APB1HENR, 1 << 8, 1 << 8);
    assert_eq!(chip.soc.count(TOO_FAST), 1);
    chip.write(0x4000_A018, 3);
    chip.write(0x4000_A804, 1 << 16 | 1 << 6);
    chip.write(0x4000_A804, 1 << 6);
    assert_eq!(chip.soc.count(TOO_FAST), 2, "and again when it is gone");
}

#[test]
fn kernel_clocks_have_limits_too() {
    // SPI1 to 3 at 240 MHz.
    let mut chip = Chip::with_pll1_q(2);
    chip.set(RCC + 0xF0, 1 << 12, 1 << 12);
    let said = reports(&mut chip);
    assert!(said.len() == 1 && said[0].contains("SPI1 to 3's kernel clock is 240 MHz"), "{said:?}");
    // A lower voltage: the core and its buses are too fast for it, and SPI1.
    let mut chip = Chip::running();
    chip.set(PWR + 0x18, 3 << 14, 3 << 14);
    chip.wait(PWR + 0x18, 1 << 13);
    chip.set(RCC + 0x10, 0, 0);
    assert_eq!(chip.soc.count(TOO_FAST), 4, "{:?}", reports(&mut chip));
}

/// After a reset the APBs have HSI's 64 MHz at the lowest voltage, and a little more if HSI is off.
/// A PLL that is set to 64.6 MHz is no such case.
#[test]
fn an_oscillator_may_be_off_and_a_setting_may_not() {
    let mut chip = Chip::on(rc10_emu::Board::H723ZG, 10_000);
    chip.set(RCC + 0x10, 0, 0);
    assert_eq!((chip.soc.clocks().apb[0], chip.kinds()), (64_640_000, vec![]));
    for (multiplier, told) in [(320, 0), (323, 2)] {
        let mut chip = Chip::on(rc10_emu::Board::DM_MC02, 0);
        chip.set(RCC, 1 << 16, 1 << 16);
        chip.wait(RCC, 1 << 17);
        // HSE / 20 x N / 6.
        chip.set(RCC + 0x28, 0x3F << 4 | 3, 20 << 4 | 2);
        chip.set(RCC + 0x2C, 0xF | 7 << 16, 1 << 16);
        chip.write(RCC + 0x30, (multiplier - 1) | 5 << 9);
        chip.set(RCC, 1 << 24, 1 << 24);
        chip.wait(RCC, 1 << 25);
        chip.set(RCC + 0x10, 7, 3);
        chip.wait(RCC + 0x10, 3 << 3);
        assert_eq!(chip.soc.clocks().apb[0], u64::from(multiplier) * 200_000);
        assert_eq!(chip.soc.count(TOO_FAST), told, "{:?}", reports(&mut chip));
    }
}

/// "Set and reset by software": while it is set, no flag is.
#[test]
fn rmvf_holds_the_flags_until_it_is_cleared_or_clears_itself() {
    for (stays, bit, second) in [(true, 1 << 16, 1 << 16), (false, 0, 1 << 26 | 1 << 22 | 1 << 17)]
    {
        let mut chip = Chip::with(Options { removal_stays: stays, ..Options::default() });
        chip.write(RSR, 1 << 16);
        assert_eq!(chip.read(RSR), bit, "{stays}");
        // A program that sets it, and leaves it at that, does not know why it was restarted.
        chip.soc.reset(ResetCause::Watchdog, Nanos::new(chip.now));
        assert_eq!(chip.read(RSR), second, "{stays}");
        // One that clears it does, in either case.
        chip.write(RSR, 1 << 16);
        chip.write(RSR, 0);
        chip.soc.reset(ResetCause::Watchdog, Nanos::new(chip.now));
        assert_eq!(chip.read(RSR), 1 << 26 | 1 << 22 | 1 << 17, "{stays}");
    }
}
