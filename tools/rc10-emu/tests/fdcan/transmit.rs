use rc10_can::{BusError, CanFrame};
use rc10_sim::{Controller, Nanos, Outcome};

use super::bench::*;

const TC: u32 = 1 << 9;
const TCF: u32 = 1 << 10;
const TFE: u32 = 1 << 11;
const TEFN: u32 = 1 << 12;
const TEFW: u32 = 1 << 13;
const TEFF: u32 = 1 << 14;
const TEFL: u32 = 1 << 15;

const NOISE: Outcome = Outcome::Destroyed(BusError::Bit);

/// TXBRP, TXBTO, TXBCF.
fn state(bench: &Bench) -> (u32, u32, u32) {
    (bench.read(TXBRP), bench.read(TXBTO), bench.read(TXBCF))
}

/// FIFO status: free level, get index, put index, full.
fn fifo(bench: &Bench) -> (u32, u32, u32, bool) {
    let status = bench.read(TXFQS);
    (status & 0x3F, status >> 8 & 0x1F, status >> 16 & 0x1F, status >> 21 & 1 != 0)
}

fn named(id: u16) -> CanFrame {
    standard(id, &[])
}

#[test]
fn dedicated_buffers_leave_by_identifier_then_by_number() {
    let mut bench = Bench::sending(6, 0, false);
    bench.fill(0, &named(0x300), 0);
    bench.fill(1, &standard(0x200, &[1]), 0);
    bench.fill(2, &standard(0x200, &[2]), 0);
    // Standard goes before extended of the same leading bits, data before remote.
    bench.fill(3, &extended(0x200 << 18, &[]), 0);
    let remote = CanFrame::remote_frame(rc10_can::embedded_can::StandardId::new(0x200).unwrap(), 3);
    bench.fill(4, &remote.unwrap(), 0);
    bench.fill(5, &named(0x100), 0);
    bench.write(TXBAR, 0b11_1111);
    assert_eq!(bench.carry_all(), ["100#", "200#01", "200#02", "200#R3", "08000000#", "300#"],);
    assert_eq!(state(&bench), (0, 0b11_1111, 0));
    assert_eq!(bench.counters().sent, 6);
}

#[test]
fn a_fifo_keeps_its_order_and_wraps_around() {
    let mut bench = Bench::sending(0, 3, false);
    assert_eq!(fifo(&bench), (3, 0, 0, false));
    bench.request(0, &named(0x300));
    bench.request(1, &named(0x200));
    assert_eq!(fifo(&bench), (1, 0, 2, false));
    bench.request(2, &named(0x100));
    assert_eq!(fifo(&bench), (0, 0, 0, true));
    assert_eq!(bench.carry(Outcome::Acknowledged), Some(named(0x300)));
    assert_eq!(fifo(&bench), (1, 1, 0, false));
    bench.request(0, &named(0x001));
    bench.take_flags();
    assert_eq!(bench.carry_all(), ["200#", "100#", "001#"]);
    assert_eq!(fifo(&bench), (3, 1, 1, false));
    assert_eq!(bench.take_flags() & TFE, TFE);
}

#[test]
fn several_fifo_elements_may_be_requested_at_once() {
    let mut bench = Bench::sending(0, 4, false);
    bench.fill(0, &named(0x300), 0);
    bench.fill(1, &named(0x200), 0);
    bench.write(TXBAR, 0b11);
    assert_eq!(fifo(&bench), (2, 0, 2, false));
    assert_eq!(bench.carry_all(), ["300#", "200#"]);
}

#[test]
fn the_fifos_head_competes_with_dedicated_buffers() {
    let mut bench = Bench::sending(2, 3, false);
    assert_eq!(fifo(&bench), (3, 2, 2, false));
    bench.request(0, &named(0x150));
    bench.request(1, &named(0x250));
    bench.request(2, &named(0x200));
    // Behind the head: waits although it is the lowest.
    bench.request(3, &named(0x001));
    assert_eq!(fifo(&bench), (1, 2, 4, false));
    assert_eq!(bench.carry_all(), ["150#", "200#", "001#", "250#"]);
}

#[test]
fn a_queue_leaves_by_identifier() {
    let mut bench = Bench::sending(1, 3, true);
    assert_eq!(bench.read(TXFQS), 1 << 16);
    bench.request(0, &named(0x250));
    bench.request(1, &named(0x300));
    bench.request(2, &named(0x200));
    assert_eq!(bench.read(TXFQS), 3 << 16);
    bench.request(3, &named(0x001));
    assert_eq!(bench.read(TXFQS), 1 << 21);
    assert_eq!(bench.carry(Outcome::Acknowledged), Some(named(0x001)));
    assert_eq!(bench.read(TXFQS), 3 << 16);
    assert_eq!(bench.carry_all(), ["200#", "250#", "300#"]);
}

#[test]
fn a_buffer_is_read_when_it_leaves_and_its_size_is_txescs() {
    let mut bench = Bench::configuring();
    bench.lay_out_transmit(2, 0, false);
    // 64 data bytes: 18 words.
    bench.write(0xC8, 0b111);
    bench.join();
    let element = TRANSMIT + 18;
    bench.write_ram(element, 0x123 << 18);
    bench.write_ram(element + 1, 6 << 16);
    bench.write(TXBAR, 0b10);
    bench.write_ram(element + 2, 0x4433_2211);
    bench.write_ram(element + 3, 0x8877_6655);
    assert_eq!(bench.carry_all(), ["123#112233445566"]);
}

#[test]
fn length_codes_above_eight_mean_eight() {
    let mut bench = Bench::sending(1, 0, false);
    bench.fill(0, &standard(1, &[1; 8]), 15 << 16);
    bench.write(TXBAR, 1);
    assert_eq!(bench.carry_all(), ["001#0101010101010101"]);
}

#[test]
fn a_failed_frame_is_repeated_unless_something_more_urgent_came() {
    let mut bench = Bench::sending(2, 0, false);
    bench.request(0, &named(0x200));
    assert_eq!(bench.carry(NOISE), Some(named(0x200)));
    assert_eq!(state(&bench), (0b01, 0, 0));
    bench.request(1, &named(0x100));
    assert_eq!(bench.carry_all(), ["100#", "200#"]);
    assert_eq!((bench.counters().failed, bench.counters().sent), (1, 2));
}

/// 4 periods of 120 MHz for each of two buffers, 66 2/3 ns.
const SCAN: u64 = 67;

#[test]
fn a_waiting_buffer_is_cancelled_a_little_later() {
    let mut bench = Bench::sending(2, 0, false);
    bench.request(0, &named(0x200));
    bench.wait(SCAN);
    bench.request(1, &named(0x300));
    bench.wait(SCAN);
    bench.write(TXBCR, 0b01);
    // Not done yet: it is still pending, and no flag tells.
    assert_eq!((state(&bench), bench.read(TXBCR), bench.take_flags()), ((0b11, 0, 0), 0b01, 0));
    assert_eq!(bench.node.next_event(), Some(bench.now + Nanos::new(CROSSING)));
    // A new request for it is lost.
    bench.request(0, &named(0x100));
    assert_eq!(bench.counters().requests_ignored, 1);
    bench.wait(CROSSING);
    assert_eq!((state(&bench), bench.read(TXBCR), bench.take_flags()), ((0b10, 0, 0b01), 0, TCF));
    assert_eq!(bench.carry_all(), ["300#"]);
    // A new request forgets the old outcome.
    bench.request(0, &named(0x200));
    assert_eq!(state(&bench), (0b01, 0b10, 0));
    bench.wait(SCAN);
    bench.request(1, &named(0x300));
    assert_eq!(state(&bench), (0b11, 0, 0));
    assert_eq!(bench.counters().cancelled, 1);
}

/// TXBAR: "When no Tx scan is running, the bits are reset immediately, else the bits remain set until
/// the Tx scan process has completed."
#[test]
fn a_request_during_a_scan_stays_in_txbar() {
    let mut bench = Bench::sending(2, 0, false);
    bench.request(0, &named(0x200));
    assert_eq!((bench.read(TXBAR), bench.read(TXBRP)), (0, 0b01));
    bench.request(1, &named(0x100));
    assert_eq!((bench.read(TXBAR), bench.read(TXBRP)), (0b10, 0b01));
    bench.wait(SCAN - 1);
    assert_eq!((bench.read(TXBAR), bench.read(TXBRP)), (0b10, 0b01));
    bench.wait(1);
    assert_eq!((bench.read(TXBAR), bench.read(TXBRP)), (0, 0b11));
    assert_eq!(bench.carry_all(), ["100#", "200#"]);
}

#[test]
fn cancelling_what_is_not_pending_is_finished_too() {
    let mut bench = Bench::sending(2, 0, false);
    bench.write(TXBCR, 0b111);
    bench.wait(CROSSING);
    assert_eq!(state(&bench), (0, 0, 0b11));
    assert_eq!(bench.counters().cancelled, 0);
}

#[test]
fn cancelled_on_the_wire_and_sent_all_the_same() {
    let mut bench = Bench::sending(1, 0, false);
    bench.request(0, &named(0x200));
    let frame = bench.start().unwrap();
    bench.write(TXBCR, 1);
    assert_eq!((state(&bench), bench.read(TXBCR)), ((1, 0, 0), 1));
    bench.end(&frame, Outcome::Acknowledged);
    assert_eq!(bench.read(TXBCR), 0);
    assert_eq!((state(&bench), bench.take_flags()), ((0, 1, 1), TC | TCF));
    assert_eq!((bench.counters().sent, bench.counters().cancelled), (1, 0));
}

#[test]
fn cancelled_on_the_wire_and_failed_it_is_not_repeated() {
    let mut bench = Bench::sending(1, 0, false);
    bench.request(0, &named(0x200));
    let frame = bench.start().unwrap();
    bench.write(TXBCR, 1);
    bench.end(&frame, NOISE);
    assert_eq!((state(&bench), bench.take_flags() & (TC | TCF)), ((0, 0, 1), TCF));
    assert_eq!(bench.start(), None);
    assert_eq!((bench.counters().sent, bench.counters().cancelled), (0, 1));
}

#[test]
fn cancelling_the_fifos_head_moves_it_on() {
    let mut bench = Bench::sending(0, 3, false);
    for (buffer, id) in [(0, 0x300), (1, 0x200), (2, 0x100)] {
        bench.request(buffer, &named(id));
    }
    bench.write(TXBCR, 0b010);
    assert_eq!(fifo(&bench), (0, 0, 0, true));
    bench.write(TXBCR, 0b001);
    assert_eq!(fifo(&bench), (2, 2, 0, false));
    assert_eq!(bench.carry_all(), ["100#"]);
}

#[test]
fn without_retransmission_one_attempt_is_all() {
    let mut bench = Bench::configuring();
    bench.lay_out_transmit(3, 0, false);
    bench.write(TXEFC, 3 << 16 | start_address(EVENTS));
    bench.write(CCCR, INIT | CCE | DAR);
    bench.join();
    bench.fill(0, &named(0x200), EVENT);
    bench.write(TXBAR, 1);
    bench.carry(NOISE);
    assert_eq!(state(&bench), (0, 0, 1));
    bench.request(1, &named(0x300));
    assert!(bench.node.offer(bench.now).is_some());
    bench.node.lost_arbitration(bench.now);
    assert_eq!(state(&bench), (0, 0, 0b11));
    bench.write(TXBAR, 1);
    bench.carry(Outcome::Acknowledged);
    assert_eq!(state(&bench), (0, 1, 0b10));
    // Event type 2: sent in spite of cancellation, as always in this mode.
    assert_eq!(bench.ram(EVENTS + 1) >> 22 & 0b11, 2);
}

#[test]
fn losing_arbitration_only_delays() {
    let mut bench = Bench::sending(1, 0, false);
    bench.request(0, &named(0x300));
    assert!(bench.node.offer(bench.now).is_some());
    bench.node.lost_arbitration(bench.now);
    bench.hear(&named(0x201));
    assert_eq!(bench.carry_all(), ["300#"]);
    assert_eq!((bench.counters().failed, bench.counters().received[0]), (0, 1));
}

#[test]
fn requests_without_effect_are_counted() {
    let mut bench = Bench::sending(2, 0, false);
    bench.request(0, &named(0x200));
    bench.write(TXBAR, 0b101);
    assert_eq!((bench.read(TXBRP), bench.counters().requests_ignored), (0b001, 2));
    assert_eq!(bench.read(TXBAR), 0);
    assert_eq!(bench.carry_all(), ["200#"]);
    bench.set_cccr(INIT);
    bench.set_cccr(INIT | CCE);
    let before = bench.counters().protected_writes;
    bench.write(TXBAR, 1);
    bench.write(TXBCR, 1);
    assert_eq!((bench.read(TXBRP), bench.counters().protected_writes), (0, before + 2));
}

#[test]
fn only_wanted_buffers_raise_the_flags() {
    let mut bench = Bench::sending(2, 0, false);
    bench.write(TXBTIE, 0b10);
    bench.write(TXBCIE, 0);
    bench.request(0, &named(1));
    bench.carry(Outcome::Acknowledged);
    bench.write(TXBCR, 1);
    assert_eq!(bench.take_flags(), 0);
    bench.request(1, &named(1));
    bench.carry(Outcome::Acknowledged);
    assert_eq!(bench.take_flags(), TC);
}

#[test]
fn events_tell_what_was_sent_when() {
    let mut bench = Bench::configuring();
    bench.lay_out_transmit(4, 0, false);
    bench.write(TXEFC, 2 << 24 | 2 << 16 | start_address(EVENTS));
    bench.write(TSCC, 1);
    bench.write(0x24, 0);
    bench.join();
    bench.wait(89 * BIT);
    bench.request(0, &named(0x100));
    bench.fill(1, &extended(0x1FFF_0055, &[1, 2, 3]), EVENT | 0xAB << 24);
    bench.write(TXBAR, 0b10);
    let start = bench.now;
    bench.carry(Outcome::Acknowledged);
    assert_eq!(bench.take_flags(), TC);
    let stamp = u32::try_from(bench.now.since(start).get() / BIT).unwrap() + 100;
    bench.carry(Outcome::Acknowledged);
    assert_eq!(bench.take_flags(), TC | TEFN);
    assert_eq!(bench.ram(EVENTS), 1 << 30 | 0x1FFF_0055);
    assert_eq!(bench.ram(EVENTS + 1), 0xAB << 24 | 1 << 22 | 3 << 16 | stamp);
    assert_eq!(bench.read(TXEFS), 1 << 16 | 1);

    bench.fill(2, &named(0x200), EVENT);
    bench.fill(3, &named(0x300), EVENT);
    bench.write(TXBAR, 0b1100);
    bench.carry(Outcome::Acknowledged);
    assert_eq!(bench.take_flags(), TC | TEFN | TEFW | TEFF);
    bench.carry(Outcome::Acknowledged);
    assert_eq!(bench.read(IR), TC | TEFL);
    assert_eq!(bench.read(TXEFS), 1 << 25 | 1 << 24 | 2);
    assert_eq!(bench.counters().events_lost, 1);
    bench.take_flags();
    bench.write(TXEFA, 0);
    assert_eq!(bench.read(TXEFS), 1 << 8 | 1);
}

#[test]
fn fd_frames_are_refused_aloud() {
    let mut bench = Bench::configuring();
    bench.lay_out_transmit(2, 0, false);
    bench.write(CCCR, INIT | CCE | FDOE);
    bench.join();
    bench.fill(0, &named(0x100), 1 << 21);
    bench.write(TXBAR, 1);
    bench.request(1, &named(0x200));
    assert_eq!(bench.carry_all(), ["200#"]);
    assert_eq!((state(&bench), bench.counters().fd_refused), ((0, 0b10, 0b01), 1));
}

#[test]
fn ticks_are_told_from_the_requests_within_them() {
    let bench = Bench::sending(4, 0, false);
    let request_at = |micros: u64, buffer: usize| {
        let now = Nanos::new(micros * 1000);
        assert_eq!(bench.fdcans().write(0, TXBAR, 1 << buffer, now), Ok(()));
    };
    for tick in 1..=4_u64 {
        let start = 1000 * tick + if tick == 3 { 7 } else { 0 };
        for buffer in 0..3 {
            request_at(start + 20 * buffer as u64, buffer);
        }
    }
    let period = bench.counters().tick_period;
    assert_eq!((period.count, period.min.get(), period.max.get()), (3, 993_000, 1_007_000));
    assert_eq!(period.mean().get(), 1_000_000);
    request_at(5000, 0);
    request_at(6000, 0);
    assert_eq!(bench.counters().tick_period.count, 5);
    assert_eq!(bench.counters().last_request, Some(Nanos::new(6_000_000)));
}

#[test]
fn what_is_sent_is_as_old_as_its_request() {
    let mut bench = Bench::sending(2, 0, false);
    bench.request(0, &named(0x200));
    bench.wait(700 * BIT);
    // A request that is there already stays as old as it is; one that failed, too.
    bench.write(TXBAR, 1);
    bench.carry(NOISE);
    assert_eq!(bench.counters().oldest_sent, Nanos::ZERO);
    bench.wait(300 * BIT);
    bench.carry(Outcome::Acknowledged);
    let oldest = bench.counters().oldest_sent;
    assert!(oldest > Nanos::new(1000 * BIT), "{oldest}");
    bench.request(1, &named(0x300));
    bench.carry(Outcome::Acknowledged);
    assert_eq!(bench.counters().oldest_sent, oldest);
}
