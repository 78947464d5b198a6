use rc10_can::BusError;
use rc10_emu::peripherals::AccessKind;
use rc10_sim::{Activity, Controller, Nanos, Outcome};

use super::bench::*;

const TSW: u32 = 1 << 16;
const ARA: u32 = 1 << 29;

#[test]
fn it_is_the_core_that_drivers_look_for() {
    let bench = Bench::configuring();
    assert_eq!(bench.read(0x00), 0x3214_1218);
    assert_eq!(bench.read(0x04), 0x8765_4321);
    bench.write(0x00, 0);
    assert_eq!(bench.read(0x00), 0x3214_1218);
}

#[test]
fn reset_values() {
    let mut fdcans = rc10_emu::fdcan::Fdcans::new(1);
    let values = [
        (CCCR, 1),
        (NBTP, 0x0600_0A03),
        (0x0C, 0x0A33),
        (0x28, 0xFFFF_0000),
        (0x2C, 0xFFFF),
        (PSR, 0x707),
        (ECR, 0),
        (XIDAM, 0x1FFF_FFFF),
        (TXFQS, 0),
        (RXF0S, 0),
    ];
    for index in 0..3 {
        for (offset, value) in values {
            assert_eq!(fdcans.read(index, offset, Nanos::ZERO), Ok(value), "{offset:#x}");
        }
    }
}

#[test]
fn what_is_not_there_is_told() {
    let bench = Bench::configuring();
    let now = bench.now;
    for offset in [0x08, 0x30, 0x60, 0x8C, 0xFC, 0x100, 0x300, u32::MAX] {
        assert_eq!(bench.fdcans().read(0, offset, now), Err(AccessKind::Unmodelled), "{offset:#x}");
        assert_eq!(
            bench.fdcans().write(0, offset, 0, now),
            Err(AccessKind::Unmodelled),
            "{offset:#x}"
        );
    }
    assert_eq!(bench.take_flags(), ARA);
    assert_eq!(bench.fdcans().read(3, CCCR, now), Err(AccessKind::Unmodelled));
    assert_eq!(bench.fdcans().write(3, CCCR, 0, now), Err(AccessKind::Unmodelled));
    assert_eq!(bench.fdcans().counters(3).sent, 0);
    let mut absent = rc10_emu::fdcan::Node::new(bench.fdcans.clone(), 3);
    assert!(!absent.is_on_bus() && absent.offer(now).is_none());
}

#[test]
fn configuration_needs_init_and_cce() {
    let mut bench = Bench::configuring();
    bench.join();
    let protected = [0x0C, 0x14, NBTP, TSCC, 0x28, 0x48, GFC, SIDFC, XIDFC, XIDAM, RXF0C, RXBC];
    let protected = protected.into_iter().chain([RXF1C, RXESC, TXBC, 0xC8, TXEFC, TEST]);
    let values: Vec<_> = protected.map(|offset| (offset, bench.read(offset))).collect();
    for cccr in [0, INIT] {
        bench.set_cccr(cccr);
        for &(offset, value) in &values {
            let before = bench.counters().protected_writes;
            bench.write(offset, !value);
            assert_eq!(bench.read(offset), value, "{offset:#x}");
            assert_eq!(bench.counters().protected_writes, before + 1, "{offset:#x}");
        }
    }
    bench.set_cccr(INIT | CCE);
    let before = bench.counters().protected_writes;
    for &(offset, value) in values.iter().filter(|&&(offset, _)| offset != TEST) {
        bench.write(offset, !value);
        assert_ne!(bench.read(offset), value, "{offset:#x}");
    }
    assert_eq!(bench.counters().protected_writes, before);
    // Writing the same value is no attempt to change it.
    bench.set_cccr(0);
    bench.write(NBTP, bench.read(NBTP));
    assert_eq!(bench.counters().protected_writes, before);
}

#[test]
fn cce_lives_only_with_init() {
    let mut bench = Bench::configuring();
    bench.join();
    // Both at once: INIT was not set yet.
    bench.set_cccr(INIT | CCE);
    assert_eq!(bench.read(CCCR), INIT);
    bench.set_cccr(INIT | CCE);
    assert_eq!(bench.read(CCCR), INIT | CCE);
    bench.set_cccr(CCE);
    assert_eq!(bench.read(CCCR), 0);
    bench.set_cccr(CCE);
    assert_eq!(bench.read(CCCR), 0);
}

#[test]
fn modes_are_set_in_configuration_and_some_cleared_at_any_time() {
    let mut bench = Bench::configuring();
    let modes = ASM | MON | 1 << 7 | DAR | FDOE;
    bench.set_cccr(INIT | CCE | modes);
    bench.set_cccr(modes);
    assert_eq!(bench.read(CCCR), modes);
    // ASM, MON and TEST go, DAR and FDOE stay.
    bench.set_cccr(0);
    assert_eq!(bench.read(CCCR), DAR | FDOE);
    let before = bench.counters().protected_writes;
    bench.set_cccr(DAR | FDOE | MON);
    assert_eq!(bench.read(CCCR), DAR | FDOE);
    assert_eq!(bench.counters().protected_writes, before + 1);
}

#[test]
fn test_modes_need_cccr_test_and_loop_back_leaves_the_bus() {
    let mut bench = Bench::configuring();
    bench.write(TEST, 1 << 4);
    assert_eq!(bench.read(TEST), 0);
    bench.write(CCCR, INIT | CCE | 1 << 7);
    bench.write(TEST, 1 << 4);
    assert_eq!(bench.read(TEST), 1 << 4);
    bench.write(CCCR, 1 << 7);
    bench.wait(11 * BIT);
    assert!(!bench.node.is_on_bus());
    bench.write(CCCR, 0);
    assert_eq!(bench.read(TEST), 0);
    assert!(bench.node.is_on_bus());
}

#[test]
fn eleven_recessive_bits_before_it_takes_part() {
    let mut bench = Bench::configuring();
    bench.write(CCCR, 0);
    assert_eq!(bench.node.next_event(), Some(Nanos::new(11_000)));
    bench.wait(10_999);
    assert!(!bench.node.is_on_bus());
    assert_eq!(bench.read(PSR) >> 3 & 3, 0);
    bench.wait(1);
    assert!(bench.node.is_on_bus());
    assert_eq!((bench.read(PSR) >> 3 & 3, bench.node.next_event()), (1, None));
    bench.set_cccr(INIT);
    assert!(!bench.node.is_on_bus());

    // A frame in between: it waits for its end, whose recessive bits count.
    bench.write(CCCR, 0);
    bench.wait(5_000);
    bench.node.wire_is(Activity::Busy, bench.now);
    assert_eq!(bench.node.next_event(), None);
    bench.wait(100_000);
    assert!(!bench.node.is_on_bus());
    bench.node.wire_is(Activity::Idle, bench.now);
    assert!(bench.node.is_on_bus());
}

#[test]
fn init_stops_a_transmission_and_keeps_its_request() {
    let mut bench = Bench::sending(1, 0, false);
    let frame = standard(0x200, &[1]);
    bench.request(0, &frame);
    bench.start();
    assert_eq!(bench.read(PSR) >> 3 & 3, 3);
    bench.write(CCCR, INIT);
    assert!(!bench.node.is_on_bus());
    bench.end(&frame, Outcome::Destroyed(BusError::Bit));
    assert_eq!((bench.read(TXBRP), bench.read(ECR)), (1, 0));
    bench.write(CCCR, 0);
    bench.wait(11 * BIT);
    assert_eq!(bench.carry(Outcome::Acknowledged), Some(frame));
    assert_eq!(bench.read(TXBTO), 1);
}

#[test]
fn no_clock_no_pins_no_bus() {
    let mut bench = Bench::configuring();
    bench.join();
    assert!(bench.node.is_connected());
    bench.fdcans().set_pins(0, true, false);
    assert!(!bench.node.is_connected());
    bench.fdcans().set_kernel_clock(0);
    assert!(!bench.node.is_on_bus());
    assert_eq!(bench.node.bit_time_ns(), None);
    bench.fdcans().set_kernel_clock(120_000_000);
    bench.wait(11 * BIT);
    assert!(bench.node.is_on_bus());
}

#[test]
fn a_reset_takes_registers_and_leaves_message_ram() {
    let mut bench = Bench::sending(1, 0, false);
    bench.request(0, &standard(1, &[]));
    bench.fdcans().reset();
    assert_eq!((bench.read(CCCR), bench.read(TXBRP), bench.read(NBTP)), (1, 0, 0x0600_0A03));
    assert_eq!(bench.ram(TRANSMIT), 1 << 18);
    assert!(bench.node.is_connected() && bench.start().is_none());
}

#[test]
fn clock_stop_waits_for_what_is_pending() {
    let mut bench = Bench::sending(1, 0, false);
    bench.request(0, &standard(1, &[]));
    bench.set_cccr(CSR);
    assert_eq!(bench.read(CCCR), CSR);
    bench.carry(Outcome::Acknowledged);
    assert_eq!(bench.read(CCCR), CSR | CSA | INIT);
    // Released: INIT is the program's to clear.
    bench.set_cccr(INIT);
    assert_eq!(bench.read(CCCR), INIT);
    bench.set_cccr(0);
    assert_eq!(bench.read(CCCR), 0);
}

#[test]
fn the_bit_time_follows_clock_and_nbtp() {
    let bench = Bench::configuring();
    assert_eq!(bench.node.bit_time_ns(), Some(1000));
    // 25 MHz / 1 / (1 + 18 + 6): the timing of a driver on the crystal.
    bench.fdcans().set_kernel_clock(25_000_000);
    bench.write(NBTP, 5 << 25 | 17 << 8 | 5);
    assert_eq!(bench.node.bit_time_ns(), Some(1000));
    bench.write(NBTP, 5 << 25 | 1 << 16 | 17 << 8 | 5);
    assert_eq!(bench.node.bit_time_ns(), Some(2000));
    // 48 MHz / 7 / 7: 1020.8 ns.
    bench.fdcans().set_kernel_clock(48_000_000);
    bench.write(NBTP, 6 << 16 | 3 << 8 | 1);
    assert_eq!(bench.node.bit_time_ns(), Some(1021));
}

#[test]
fn timestamps_are_taken_at_the_start_of_frame() {
    let mut bench = Bench::configuring();
    // Every second bit.
    bench.write(TSCC, 1 << 16 | 1);
    bench.write(TSCV, 0);
    bench.join();
    bench.wait(189 * BIT);
    assert_eq!(bench.read(TSCV), 100);
    bench.hear(&standard(0x201, &[0; 8]));
    assert_eq!(bench.ram(FIFO_0 + 1) & 0xFFFF, 100);
    bench.write(TSCV, 1234);
    assert_eq!(bench.read(TSCV), 0);
    bench.wait(2 * 65_536 * BIT - 1);
    assert_eq!((bench.read(TSCV), bench.read(IR) & TSW), (0xFFFF, 0));
    bench.wait(1);
    assert_eq!((bench.read(TSCV), bench.take_flags() & TSW), (0, TSW));
    assert_eq!(bench.take_flags() & TSW, 0);
}

#[test]
fn a_wrapping_timestamp_wakes_who_wants_to_know() {
    let mut bench = Bench::configuring();
    bench.write(TSCC, 1);
    bench.write(TSCV, 0);
    bench.join();
    assert_eq!(bench.node.next_event(), None);
    bench.write(IE, TSW);
    bench.write(ILE, 1);
    let wrap = Nanos::new(65_536 * BIT);
    assert_eq!(bench.node.next_event(), Some(wrap));
    bench.node.advance(wrap);
    assert!(bench.fdcans().interrupt_lines()[0][0]);
    assert_eq!(bench.node.next_event(), Some(wrap + wrap));
}

#[test]
fn other_timestamp_sources_read_as_zero() {
    for source in [0, 2, 3] {
        let mut bench = Bench::configuring();
        bench.write(TSCC, source);
        bench.join();
        bench.wait(100 * BIT);
        assert_eq!(bench.read(TSCV), 0);
    }
}

#[test]
fn a_line_is_raised_while_an_enabled_flag_stands() {
    let mut bench = Bench::configuring();
    bench.join();
    let lines = |bench: &Bench| bench.fdcans().interrupt_lines()[0];
    bench.hear(&standard(1, &[]));
    assert_eq!(lines(&bench), [false, false]);
    bench.write(IE, 1);
    assert_eq!(lines(&bench), [false, false]);
    bench.write(ILE, 0b11);
    assert_eq!(lines(&bench), [true, false]);
    bench.write(ILS, 1);
    assert_eq!(lines(&bench), [false, true]);
    bench.write(ILE, 0b01);
    assert_eq!(lines(&bench), [false, false]);
    bench.write(ILE, 0b11);
    // Only a one clears.
    bench.write(IR, !1);
    assert_eq!(lines(&bench), [false, true]);
    bench.write(IR, 1);
    assert_eq!(lines(&bench), [false, false]);
    assert_eq!(bench.fdcans().interrupt_lines()[1..], [[false; 2]; 2]);
}

#[test]
fn controllers_share_the_message_ram_and_nothing_else() {
    let bench = Bench::configuring();
    assert_eq!(bench.fdcans().read(1, NBTP, bench.now), Ok(0x0600_0A03));
    assert_eq!(bench.fdcans().read(2, CCCR, bench.now), Ok(INIT));
}

/// Nothing may be read that nothing has written.
#[test]
fn the_message_ram_starts_with_noise_of_the_seed() {
    let words = |seed| {
        let fdcans = rc10_emu::fdcan::Fdcans::new(seed);
        (0..2560).map(|word| fdcans.read_ram(word).unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(words(1), words(1));
    let same = words(1).iter().zip(words(2)).filter(|(one, two)| **one == *two).count();
    assert!(same < 5, "{same} words are the same with another seed");
    assert!(words(1).iter().filter(|word| **word == 0).count() < 5);
}

/// "There may be a delay until the value written to INIT can be read back. Therefore the programmer has
/// to assure that the previous value written to INIT has been accepted by reading INIT before setting
/// INIT to a new value."
#[test]
fn init_is_read_back_later() {
    let mut bench = Bench::configuring();
    bench.write(CCCR, 0);
    assert_eq!(bench.read(CCCR), INIT, "a driver that looks at once takes it for bus-off");
    bench.wait(CROSSING - 1);
    assert_eq!(bench.read(CCCR), INIT);
    // Written again meanwhile: lost, and counted.
    bench.write(CCCR, INIT);
    assert_eq!(bench.counters().protected_writes, 1);
    bench.wait(1);
    assert_eq!(bench.read(CCCR), 0);

    // CCE needs an INIT that has arrived.
    bench.write(CCCR, INIT);
    bench.write(CCCR, INIT | CCE);
    bench.wait(CROSSING);
    assert_eq!(bench.read(CCCR), INIT);
    bench.write(CCCR, INIT | CCE);
    assert_eq!(bench.read(CCCR), INIT | CCE);
}

#[test]
fn without_a_kernel_clock_init_is_never_read_back() {
    let mut bench = Bench::configuring();
    bench.fdcans().set_kernel_clock(0);
    bench.write(CCCR, 0);
    bench.wait(1_000_000_000);
    assert_eq!(bench.read(CCCR), INIT);
    bench.fdcans().set_kernel_clock(120_000_000);
    bench.wait(CROSSING);
    assert_eq!(bench.read(CCCR), 0);
}
