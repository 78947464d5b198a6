use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;

use super::bench::*;

const RANGE: u32 = 0;
const DUAL: u32 = 1;
const MASK: u32 = 2;
const OFF: u32 = 3;
/// EFT: a range that XIDAM does not touch.
const RANGE_UNMASKED: u32 = 3;

const FIFO0: u32 = 1;
const FIFO1: u32 = 2;
const REJECT: u32 = 3;
const PRIORITY: u32 = 4;
const PRIORITY_FIFO0: u32 = 5;
const PRIORITY_FIFO1: u32 = 6;
const BUFFER: u32 = 7;

/// Frames that match nothing are rejected.
const GFC_REJECT: u32 = 0b10 << 4 | 0b10 << 2;
const HPM: u32 = 1 << 8;
const DRX: u32 = 1 << 19;

/// Elements as (type, configuration, first identifier, second identifier).
fn bench(standard: &[(u32, u32, u32, u32)], extended: &[(u32, u32, u32, u32)]) -> Bench {
    let bench = configured(standard, extended);
    joined(bench)
}

fn joined(mut bench: Bench) -> Bench {
    bench.join();
    bench
}

fn configured(standard: &[(u32, u32, u32, u32)], extended: &[(u32, u32, u32, u32)]) -> Bench {
    let bench = Bench::configuring();
    for (index, (kind, configuration, first, second)) in standard.iter().enumerate() {
        let word = kind << 30 | configuration << 27 | first << 16 | second;
        bench.write_ram(STANDARD_FILTERS + index, word);
    }
    for (index, (kind, configuration, first, second)) in extended.iter().enumerate() {
        bench.write_ram(EXTENDED_FILTERS + 2 * index, configuration << 29 | first);
        bench.write_ram(EXTENDED_FILTERS + 2 * index + 1, kind << 30 | second);
    }
    let count = |list: &[_]| u32::try_from(list.len()).unwrap() << 16;
    bench.write(SIDFC, count(standard) | start_address(STANDARD_FILTERS));
    bench.write(XIDFC, count(extended) | start_address(EXTENDED_FILTERS));
    bench.write(GFC, GFC_REJECT);
    bench
}

/// Number of frames that went to FIFO 0, to FIFO 1, and nowhere.
fn went(bench: &mut Bench, frame: &CanFrame) -> [u64; 3] {
    let before = bench.counters();
    bench.hear(frame);
    let after = bench.counters();
    let fifo = |index: usize| {
        after.received[index] + after.lost[index] - before.received[index] - before.lost[index]
    };
    [fifo(0), fifo(1), after.rejected - before.rejected]
}

fn ids_that_reach(bench: &mut Bench, fifo: usize, ids: std::ops::Range<u16>) -> Vec<u16> {
    ids.filter(|&id| went(bench, &standard(id, &[]))[fifo] == 1).collect()
}

#[test]
fn a_standard_range_includes_both_ends() {
    let mut bench = bench(&[(RANGE, FIFO0, 0x201, 0x204)], &[]);
    assert_eq!(ids_that_reach(&mut bench, 0, 0x1FF..0x207), [0x201, 0x202, 0x203, 0x204]);
}

#[test]
fn a_dual_filter_takes_two_identifiers() {
    let mut bench = bench(&[(DUAL, FIFO1, 0x201, 0x204)], &[]);
    assert_eq!(ids_that_reach(&mut bench, 1, 0x1FF..0x207), [0x201, 0x204]);
}

#[test]
fn a_mask_compares_the_bits_it_has() {
    let mut bench = bench(&[(MASK, FIFO0, 0x201, 0x7FD)], &[]);
    assert_eq!(ids_that_reach(&mut bench, 0, 0x1FF..0x207), [0x201, 0x203]);
}

#[test]
fn the_first_element_that_matches_decides_and_disabled_ones_do_not_match() {
    let filters = [
        (OFF, FIFO1, 0x201, 0x201),
        (DUAL, 0, 0x201, 0x201),
        (DUAL, REJECT, 0x202, 0x202),
        (RANGE, FIFO0, 0x201, 0x203),
        (RANGE, FIFO1, 0x200, 0x2FF),
    ];
    let mut bench = bench(&filters, &[]);
    let mut went = |id| went(&mut bench, &standard(id, &[]));
    assert_eq!(went(0x201), [1, 0, 0]);
    assert_eq!(went(0x202), [0, 0, 1]);
    assert_eq!(went(0x203), [1, 0, 0]);
    assert_eq!(went(0x2FF), [0, 1, 0]);
    assert_eq!(went(0x300), [0, 0, 1]);
    // The element's index and the frame, as stored in FIFO 0: 201 by the fourth element.
    assert_eq!(bench.ram(FIFO_0), 0x201 << 18);
    assert_eq!(bench.ram(FIFO_0 + 1) >> 24, 3);
}

#[test]
fn an_extended_list_does_not_see_standard_identifiers() {
    let mut bench = bench(&[(RANGE, FIFO0, 0, 0x7FF)], &[(RANGE, FIFO1, 0, 0x1FFF_FFFF)]);
    assert_eq!(went(&mut bench, &standard(0x301, &[])), [1, 0, 0]);
    assert_eq!(went(&mut bench, &extended(0x301, &[])), [0, 1, 0]);
    assert_eq!(bench.ram(FIFO_1), 1 << 30 | 0x301);
}

#[test]
fn extended_filters_of_every_kind() {
    let filters = [
        (DUAL, FIFO0, 0x1234_5678, 0x0000_0301),
        (MASK, FIFO1, 0x0280_0000, 0x1F80_0000),
        (RANGE_UNMASKED, 0, 0x100, 0x1FF),
        (RANGE, FIFO0, 0x100, 0x1FF),
    ];
    let mut bench = bench(&[], &filters);
    let mut went = |id| went(&mut bench, &extended(id, &[]));
    assert_eq!(went(0x1234_5678), [1, 0, 0]);
    assert_eq!(went(0x0000_0301), [1, 0, 0]);
    assert_eq!(went(0x0285_7D01), [0, 1, 0]);
    assert_eq!(went(0x0305_7D01), [0, 0, 1]);
    assert_eq!(went(0x100), [1, 0, 0]);
    assert_eq!(went(0x1FF), [1, 0, 0]);
    assert_eq!(went(0x200), [0, 0, 1]);
}

#[test]
fn xidam_masks_the_identifier_except_for_the_unmasked_range() {
    let filters = [(RANGE_UNMASKED, FIFO1, 0x5500, 0x55FF), (RANGE, FIFO0, 0x10, 0x20)];
    let bench = configured(&[], &filters);
    bench.write(XIDAM, 0xFF);
    let mut bench = joined(bench);
    // 0x5510 is in the unmasked range as it stands, 0x6610 in the masked one once it is 0x10.
    assert_eq!(went(&mut bench, &extended(0x5510, &[])), [0, 1, 0]);
    assert_eq!(went(&mut bench, &extended(0x6610, &[])), [1, 0, 0]);
    assert_eq!(went(&mut bench, &extended(0x6630, &[])), [0, 0, 1]);
    // The identifier is stored as received.
    assert_eq!(bench.ram(FIFO_0), 1 << 30 | 0x6610);
}

#[test]
fn what_matches_nothing_goes_where_gfc_says_and_says_so() {
    let bench = configured(&[(DUAL, FIFO0, 1, 1)], &[]);
    bench.write(GFC, 0b01 << 4);
    let mut bench = joined(bench);
    assert_eq!(went(&mut bench, &standard(2, &[7])), [0, 1, 0]);
    assert_eq!(went(&mut bench, &extended(2, &[7])), [1, 0, 0]);
    assert_eq!(bench.ram(FIFO_1 + 1), 1 << 31 | 1 << 16);
    assert_eq!(bench.ram(FIFO_0 + 1), 1 << 31 | 1 << 16);
    assert_eq!(went(&mut bench, &standard(1, &[7])), [1, 0, 0]);
    assert_eq!(bench.ram(FIFO_0 + ELEMENT + 1), 1 << 16);
}

#[test]
fn remote_frames_are_stored_without_data_or_rejected() {
    let remote = CanFrame::remote_frame(StandardId::new(1).unwrap(), 8).unwrap();
    let mut open = bench(&[(DUAL, FIFO0, 1, 1)], &[]);
    assert_eq!(went(&mut open, &remote), [1, 0, 0]);
    assert_eq!(open.ram(FIFO_0), 1 << 29 | 1 << 18);
    assert_eq!(open.ram(FIFO_0 + 1), 8 << 16);

    let closed = configured(&[(DUAL, FIFO0, 1, 1)], &[(DUAL, FIFO0, 1, 1)]);
    closed.write(GFC, GFC_REJECT | 0b10);
    let mut closed = joined(closed);
    assert_eq!(went(&mut closed, &remote), [0, 0, 1]);
    // RRFE is another bit.
    let extended = rc10_can::embedded_can::ExtendedId::new(1).unwrap();
    let remote = CanFrame::remote_frame(extended, 8).unwrap();
    assert_eq!(went(&mut closed, &remote), [1, 0, 0]);
}

#[test]
fn priority_tells_list_element_and_place() {
    let filters = [
        (DUAL, PRIORITY, 1, 1),
        (DUAL, PRIORITY_FIFO0, 2, 2),
        (DUAL, PRIORITY_FIFO1, 3, 3),
        (DUAL, FIFO0, 4, 4),
    ];
    let mut bench = bench(&filters, &[(DUAL, PRIORITY_FIFO1, 5, 5)]);
    let mut priority = |frame: &CanFrame| {
        bench.hear(frame);
        (bench.take_flags() & HPM != 0, bench.read(HPMS))
    };
    assert_eq!(priority(&standard(4, &[])), (false, 0));
    // MSI 0: stored nowhere.
    assert_eq!(priority(&standard(1, &[])), (true, 0));
    // MSI 2: in FIFO 0, at index 1, by element 1.
    assert_eq!(priority(&standard(2, &[])), (true, 1 << 8 | 2 << 6 | 1));
    assert_eq!(priority(&standard(3, &[])), (true, 2 << 8 | 3 << 6));
    assert_eq!(priority(&extended(5, &[])), (true, 1 << 15 | 3 << 6 | 1));
    // FIFO 0 is full after one more: MSI 1, lost.
    assert_eq!(priority(&standard(2, &[])), (true, 1 << 8 | 2 << 6 | 2));
    assert_eq!(priority(&standard(2, &[])), (true, 1 << 8 | 1 << 6));
}

#[test]
fn a_dedicated_buffer_is_locked_until_it_is_read() {
    // Buffer 5, then buffer 6 for the same identifier, then FIFO 1.
    // The type does not matter.
    let filters = [(RANGE, BUFFER, 0x201, 5), (OFF, BUFFER, 0x201, 6), (RANGE, FIFO1, 0, 0x7FF)];
    let mut bench = bench(&filters, &[(RANGE_UNMASKED, BUFFER, 0x301, 40)]);
    let word = |buffer: usize| RX_BUFFERS + ELEMENT * buffer;
    bench.hear(&standard(0x201, &[1, 2, 3, 4, 5]));
    assert_eq!((bench.read(NDAT1), bench.take_flags() & DRX), (1 << 5, DRX));
    assert_eq!([2, 3].map(|at| bench.ram(word(5) + at)), [0x0403_0201, 0x05]);
    bench.hear(&standard(0x201, &[2]));
    bench.hear(&standard(0x201, &[3]));
    assert_eq!(bench.read(NDAT1), 0b11 << 5);
    assert_eq!((bench.ram(word(6) + 2), bench.ram(FIFO_1 + 2)), (2, 3));
    bench.write(NDAT1, 1 << 5);
    bench.hear(&standard(0x201, &[4]));
    assert_eq!(bench.ram(word(5) + 2), 4);
    bench.hear(&extended(0x301, &[5]));
    assert_eq!((bench.read(NDAT1 + 4), bench.ram(word(40) + 2)), (1 << 8, 5));
    assert_eq!(bench.counters().received_in_buffers, 4);
}
