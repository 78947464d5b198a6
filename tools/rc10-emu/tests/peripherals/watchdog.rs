use rc10_emu::peripherals::{AccessKind, ResetCause};
use rc10_sim::Nanos;

use crate::chip::{Chip, RCC};

const IWDG: u32 = 0x5800_4800;
const KR: u32 = IWDG;
const PR: u32 = IWDG + 0x04;
const RLR: u32 = IWDG + 0x08;
const SR: u32 = IWDG + 0x0C;
const WINR: u32 = IWDG + 0x10;
/// Five periods of 32 kHz.
const UPDATE: u64 = 156_250;

/// 100 ms as embassy sets it: LSI / 4, reload 799; started.
fn started() -> (Chip, u64) {
    let mut chip = Chip::running();
    chip.write(KR, 0x5555);
    chip.write(PR, 0);
    chip.write(RLR, 799);
    chip.write(KR, 0xCCCC);
    let start = chip.now;
    (chip, start)
}

#[test]
fn fed_it_stays_quiet() {
    let (mut chip, start) = started();
    for feed in 1..100 {
        chip.run_to(start + feed * 99_000_000);
        assert_eq!(chip.soc.take_reset(), None);
        chip.write(KR, 0xAAAA);
    }
}

#[test]
fn unfed_it_resets_after_its_time_to_the_nanosecond() {
    let (mut chip, start) = started();
    chip.run_to(start + 10_000_000);
    chip.write(KR, 0xAAAA);
    // 800 x 4 periods of 31.25 us.
    chip.run_to(start + 109_999_999);
    assert_eq!(chip.soc.take_reset(), None);
    assert_eq!(chip.soc.next_event(), Some(Nanos::new(start + 110_000_000)));
    chip.run_to(start + 110_000_000);
    assert_eq!(chip.soc.take_reset(), Some(ResetCause::Watchdog));
    assert_eq!(chip.soc.take_reset(), None);
    chip.soc.reset(ResetCause::Watchdog, Nanos::new(chip.now));
    assert_eq!(chip.read(RCC + 0xD0) >> 26 & 1, 1);
    chip.run_to(start + 10_000_000_000);
    assert_eq!(chip.soc.take_reset(), None, "a reset stops it");
}

#[test]
fn never_fed_it_counts_from_its_reset_value() {
    let (mut chip, start) = started();
    chip.run_to(start + 511_999_999);
    assert_eq!(chip.soc.take_reset(), None);
    chip.run_to(start + 512_000_000);
    assert_eq!(chip.soc.take_reset(), Some(ResetCause::Watchdog));
}

#[test]
fn new_values_take_five_periods() {
    let (mut chip, start) = started();
    assert_eq!(chip.read(SR), 0b011);
    chip.run_to(start + UPDATE - 1);
    assert_eq!(chip.read(SR), 0b011);
    chip.run_to(start + UPDATE);
    assert_eq!((chip.read(SR), chip.read(RLR)), (0, 799));
}

#[test]
fn locked_without_its_key() {
    let (mut chip, _) = started();
    chip.write(RLR, 5);
    assert_eq!((chip.read(RLR), chip.kinds()), (799, vec![AccessKind::Protected]));
}

#[test]
fn too_early_is_as_bad_as_too_late() {
    let (mut chip, start) = started();
    chip.write(KR, 0x5555);
    chip.write(WINR, 400);
    chip.run_to(start + 1_000_000);
    chip.write(KR, 0xAAAA);
    assert_eq!(chip.soc.take_reset(), Some(ResetCause::Watchdog));
}
