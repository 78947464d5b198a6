use super::bench::*;

const NEW: u32 = 1;
const WATERMARK: u32 = 1 << 1;
const FULL: u32 = 1 << 2;
const LOST: u32 = 1 << 3;

/// Status of FIFO 0: level, get index, put index, full, lost.
fn status(bench: &Bench) -> (u32, u32, u32, bool, bool) {
    let status = bench.read(RXF0S);
    let bit = |at: u32| status >> at & 1 != 0;
    (status & 0x7F, status >> 8 & 0x3F, status >> 16 & 0x3F, bit(24), bit(25))
}

/// First data bytes in FIFO 0 by index.
fn contents(bench: &Bench) -> [u32; 3] {
    [0, 1, 2].map(|index| bench.ram(FIFO_0 + ELEMENT * index + 2))
}

fn hear(bench: &mut Bench, byte: u8) -> u32 {
    bench.hear(&standard(0x201, &[byte]));
    bench.take_flags()
}

#[test]
fn blocking_mode_loses_the_newest_and_tells() {
    let mut bench = Bench::configuring();
    bench.write(RXF0C, 2 << 24 | 3 << 16 | start_address(FIFO_0));
    bench.join();
    assert_eq!(hear(&mut bench, 1), NEW);
    assert_eq!(hear(&mut bench, 2), NEW | WATERMARK);
    assert_eq!(hear(&mut bench, 3), NEW | FULL);
    assert_eq!(status(&bench), (3, 0, 0, true, false));
    bench.hear(&standard(0x201, &[4]));
    assert_eq!(bench.read(IR), LOST);
    assert_eq!(status(&bench), (3, 0, 0, true, true));
    // The bit in RXF0S is a copy of the flag.
    bench.write(IR, LOST);
    assert_eq!(status(&bench), (3, 0, 0, true, false));
    assert_eq!(contents(&bench), [1, 2, 3]);
    let counters = bench.counters();
    assert_eq!((counters.received, counters.lost), ([3, 0], [1, 0]));
    assert_eq!(counters.overwritten, [0, 0]);
}

#[test]
fn overwrite_mode_loses_the_oldest_without_a_flag() {
    let mut bench = Bench::configuring();
    bench.write(RXF0C, 1 << 31 | 3 << 16 | start_address(FIFO_0));
    bench.join();
    for byte in 1..=3 {
        hear(&mut bench, byte);
    }
    assert_eq!(hear(&mut bench, 4), NEW);
    assert_eq!(status(&bench), (3, 1, 1, true, false));
    assert_eq!(contents(&bench), [4, 2, 3]);
    let counters = bench.counters();
    assert_eq!((counters.received[0], counters.lost, counters.overwritten[0]), (4, [0, 0], 1));
}

#[test]
fn acknowledging_frees_up_to_and_including_that_element() {
    let mut bench = Bench::configuring();
    bench.join();
    for byte in 1..=3 {
        hear(&mut bench, byte);
    }
    bench.write(RXF0A, 1);
    assert_eq!(status(&bench), (1, 2, 0, false, false));
    hear(&mut bench, 4);
    hear(&mut bench, 5);
    assert_eq!(contents(&bench), [4, 5, 3]);
    bench.write(RXF0A, 0);
    assert_eq!(status(&bench), (1, 1, 2, false, false));
    // Not in the FIFO: not filled, not there at all, in a FIFO without elements.
    bench.write(RXF0A, 2);
    bench.write(RXF0A, 4);
    bench.write(TXEFA, 0);
    assert_eq!(status(&bench), (1, 1, 2, false, false));
    assert_eq!(bench.counters().bad_acknowledges, 3);
}

#[test]
fn a_fifo_of_size_zero_loses_everything() {
    let mut bench = Bench::configuring();
    bench.write(RXF0C, 0);
    bench.join();
    assert_eq!(hear(&mut bench, 1), LOST);
    assert_eq!((bench.read(RXF0S), bench.counters().lost), (0, [1, 0]));
}

#[test]
fn fifo_1_has_its_own_flags_size_and_element_size() {
    let mut bench = Bench::configuring();
    // Frames that match nothing go to FIFO 1, whose elements have 64 data bytes: 18 words.
    bench.write(GFC, 0b01 << 4);
    bench.write(RXF1C, 64 << 16 | start_address(FIFO_1));
    bench.write(RXESC, 0b111 << 4);
    bench.join();
    for byte in 0..64 {
        bench.hear(&standard(0x201, &[byte, 0, 0, 0, 9]));
    }
    let last = FIFO_1 + 18 * 63;
    assert_eq!([bench.ram(last + 2), bench.ram(last + 3)], [63, 9]);
    assert_eq!(bench.read(RXF1S), 1 << 24 | 64);
    assert_eq!(bench.take_flags(), (NEW | FULL) << 4);
    bench.hear(&standard(0x201, &[]));
    assert_eq!(bench.read(IR), LOST << 4);
    assert_eq!(bench.counters().lost, [0, 1]);
    assert_eq!(bench.read(RXF0S), 0);
}

#[test]
fn an_element_holds_identifier_length_and_data() {
    let mut bench = Bench::configuring();
    bench.join();
    bench.hear(&standard(0x205, &[1, 2, 3, 4, 5, 6, 7, 8]));
    // Words that no byte needs are not written.
    let rest = bench.ram(FIFO_0 + 2 * ELEMENT - 1);
    assert_ne!(rest, 0, "the message RAM holds noise after power-on");
    bench.hear(&extended(0x1FFF_FFFF, &[9, 8, 7]));
    let element = |index: usize| [0, 1, 2, 3].map(|at| bench.ram(FIFO_0 + ELEMENT * index + at));
    // No filter list: ANMF is set.
    assert_eq!(element(0), [0x205 << 18, 1 << 31 | 8 << 16, 0x0403_0201, 0x0807_0605]);
    assert_eq!(element(1), [1 << 30 | 0x1FFF_FFFF, 1 << 31 | 3 << 16, 0x0007_0809, rest]);
}

#[test]
fn elements_beyond_the_message_ram_are_counted() {
    let mut bench = Bench::configuring();
    bench.write(RXF0C, 3 << 16 | start_address(2558));
    bench.join();
    bench.hear(&standard(0x201, &[1; 8]));
    // Header words fit, data words do not.
    assert_eq!(bench.fdcans().ram_misses(), 2);
    assert_eq!(bench.ram(2558), 0x201 << 18);
    assert_eq!(bench.fdcans().read_ram(2560), None);
    assert!(!bench.fdcans().write_ram(2560, 0));
}

#[test]
fn configuration_empties_the_fifos() {
    let mut bench = Bench::configuring();
    bench.join();
    hear(&mut bench, 1);
    bench.set_cccr(INIT);
    assert_eq!(status(&bench).0, 1);
    bench.set_cccr(INIT | CCE);
    assert_eq!(bench.read(RXF0S), 0);
}
