//! The clock calibration unit in front of the controllers.

use rc10_emu::peripherals::AccessKind;
use rc10_sim::{Controller, Outcome};

use super::bench::*;

const CSTAT: u32 = 0x08;
const CWD: u32 = 0x0C;

/// A bench whose block was reset again after the bypass was set; FDCAN1 is in INIT and CCE.
fn after_reset() -> Bench {
    let bench = Bench::configuring();
    bench.fdcans().reset();
    bench.write(CCCR, INIT | CCE);
    bench.write(NBTP, ONE_MEGABIT);
    bench.lay_out_transmit(1, 0, false);
    bench
}

#[test]
fn it_is_not_bypassed_after_a_reset() {
    let bench = after_reset();
    assert_eq!(bench.fdcans().read_calibration(CCFG), Ok(0x4));
    // CALS: not calibrated.
    assert_eq!(bench.fdcans().read_calibration(CSTAT), Ok(0x0203_FFFF));
    assert_eq!(bench.fdcans().read_calibration(0x18), Err(AccessKind::Unmodelled));
    assert_eq!(bench.fdcans().write_calibration(0x18, 0), Err(AccessKind::Unmodelled));
}

/// A program that never writes the unit: nothing leaves, and no error says why.
#[test]
fn without_a_valid_clock_controllers_stay_in_restricted_mode() {
    let mut bench = after_reset();
    bench.set_cccr(0);
    bench.wait(11 * BIT);
    assert_eq!(bench.read(CCCR), ASM);
    // Cleared, it is set again.
    bench.set_cccr(0);
    assert_eq!(bench.read(CCCR), ASM);
    bench.request(0, &standard(0x200, &[0; 8]));
    assert_eq!(bench.carry(Outcome::Acknowledged), None);
    assert_eq!((bench.read(TXBRP), bench.read(ECR)), (1, 0));
    // It hears and acknowledges.
    assert!(bench.node.is_on_bus());
    // FDCAN2 needs it as much.
    let now = bench.now;
    bench.fdcans().write(1, CCCR, 0, now).unwrap();
    bench.wait(CROSSING);
    let now = bench.now;
    assert_eq!(bench.fdcans().read(1, CCCR, now), Ok(ASM));
}

#[test]
fn it_is_written_while_fdcan1_is_configured_and_at_no_other_time() {
    let mut bench = after_reset();
    for cccr in [0, INIT] {
        bench.set_cccr(cccr);
        // FDCAN2's configuration does not unlock it.
        let now = bench.now;
        bench.fdcans().write(1, CCCR, INIT | CCE, now).unwrap();
        for offset in [CCFG, CWD] {
            assert_eq!(
                bench.fdcans().write_calibration(offset, BYPASS),
                Err(AccessKind::Protected)
            );
        }
        assert_eq!(bench.fdcans().read_calibration(CCFG), Ok(0x4));
    }
    bench.set_cccr(INIT | CCE);
    assert_eq!(bench.fdcans().write_calibration(CCFG, BYPASS), Ok(()));
    assert_eq!(bench.fdcans().read_calibration(CCFG), Ok(BYPASS));
}

#[test]
fn bypassed_it_lets_all_of_them_send() {
    let mut bench = after_reset();
    // One that was restricted before stays so until the program lets it go.
    let now = bench.now;
    bench.fdcans().write(2, CCCR, 0, now).unwrap();
    bench.wait(CROSSING);
    let now = bench.now;
    bench.fdcans().write_calibration(CCFG, BYPASS).unwrap();
    assert_eq!(bench.fdcans().read(2, CCCR, now), Ok(ASM));
    bench.fdcans().write(2, CCCR, 0, now).unwrap();
    assert_eq!(bench.fdcans().read(2, CCCR, now), Ok(0));

    bench.join();
    assert_eq!(bench.read(CCCR), 0);
    let frame = standard(0x200, &[0; 8]);
    bench.request(0, &frame);
    assert_eq!(bench.carry(Outcome::Acknowledged), Some(frame));
}

/// CDIV 0 divides by 1, n by 2 n.
#[test]
fn its_divider_stretches_the_bits() {
    let bench = Bench::configuring();
    for (divider, nanos) in [(0, 1000), (1, 2000), (2, 4000), (15, 30_000)] {
        bench.fdcans().write_calibration(CCFG, divider << 16 | BYPASS).unwrap();
        assert_eq!(bench.node.bit_time_ns(), Some(nanos));
    }
}

/// The behaviour that ST's HAL relies on.
#[test]
fn the_other_reading_needs_no_bypass() {
    let mut bench = after_reset();
    bench.fdcans().set_calibration_needed(false);
    bench.join();
    assert_eq!(bench.read(CCCR), 0);
    bench.request(0, &standard(0x200, &[]));
    assert!(bench.carry(Outcome::Acknowledged).is_some());
}
