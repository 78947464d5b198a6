use rc10_can::BusError;
use rc10_sim::{Activity, Controller, Nanos, Outcome};

use super::bench::*;

const ELO: u32 = 1 << 22;
const EP: u32 = 1 << 23;
const EW: u32 = 1 << 24;
const BO: u32 = 1 << 25;
const PEA: u32 = 1 << 27;
const STATES: u32 = EP | EW | BO;

const NOISE: Outcome = Outcome::Destroyed(BusError::Bit);

/// TEC, REC, CEL, and whether REC is passive.
fn counters(bench: &Bench) -> (u32, u32, u32, bool) {
    let ecr = bench.read(ECR);
    (ecr & 0xFF, ecr >> 8 & 0x7F, ecr >> 16, ecr >> 15 & 1 != 0)
}

/// PSR: last error, and the letters of the states.
fn psr(bench: &Bench) -> (u32, &'static str) {
    let psr = bench.read(PSR);
    let states = ["", "P", "W", "PW", "B", "PB", "WB", "PWB"];
    (psr & 7, states[(psr >> 5 & 7) as usize])
}

fn with_a_frame() -> Bench {
    let bench = Bench::sending(1, 0, false);
    bench.request(0, &standard(0x200, &[0; 8]));
    bench
}

/// One attempt, however long it is suspended.
fn attempt(bench: &mut Bench, outcome: Outcome) {
    if let Some(resumes) = bench.node.next_event() {
        let wait = resumes.since(bench.now);
        bench.wait(wait.get());
    }
    assert!(bench.carry(outcome).is_some());
}

#[test]
fn alone_it_becomes_passive_and_never_goes_to_bus_off() {
    let mut bench = with_a_frame();
    for tries in 1..=11 {
        attempt(&mut bench, Outcome::Unacknowledged);
        assert_eq!(counters(&bench), (8 * tries, 0, 1, false));
    }
    assert_eq!(bench.take_flags(), PEA);
    assert_eq!(psr(&bench), (3, ""));
    // Read twice, nothing new.
    assert_eq!(psr(&bench), (7, ""));
    attempt(&mut bench, Outcome::Unacknowledged);
    assert_eq!((bench.take_flags(), psr(&bench)), (PEA | EW, (3, "W")));
    for _ in 0..3 {
        attempt(&mut bench, Outcome::Unacknowledged);
        assert_eq!(bench.take_flags(), PEA);
    }
    attempt(&mut bench, Outcome::Unacknowledged);
    assert_eq!((bench.take_flags(), psr(&bench)), (PEA | EP, (3, "PW")));
    counters(&bench);
    for _ in 0..100 {
        attempt(&mut bench, Outcome::Unacknowledged);
    }
    assert_eq!((bench.take_flags(), psr(&bench)), (PEA, (3, "PW")));
    assert_eq!(counters(&bench), (128, 0, 0, false));
    // Heard at last.
    attempt(&mut bench, Outcome::Acknowledged);
    assert_eq!((counters(&bench).0, psr(&bench)), (127, (0, "W")));
    assert_eq!(bench.take_flags() & STATES, EP);
}

#[test]
fn a_passive_sender_waits_eight_bits_more() {
    let mut bench = with_a_frame();
    for _ in 0..15 {
        assert!(bench.carry(Outcome::Unacknowledged).is_some());
        assert_eq!(bench.node.next_event(), None);
    }
    bench.carry(Outcome::Unacknowledged);
    // The wire is idle, but the others go first.
    let resumes = bench.now + Nanos::new(8 * BIT);
    assert_eq!(bench.node.offer(bench.now), None);
    assert_eq!(bench.node.next_event(), Some(resumes));
    bench.wait(8 * BIT - 1);
    assert_eq!(bench.node.offer(bench.now), None);
    bench.wait(1);
    assert!(bench.node.offer(bench.now).is_some());
    assert_eq!(bench.node.next_event(), None);
}

#[test]
fn receiving_counts_one_up_and_one_down() {
    let mut bench = Bench::configuring();
    bench.join();
    let good = standard(1, &[]);
    for _ in 0..95 {
        bench.node.disturbed(BusError::Crc, bench.now);
    }
    assert_eq!(counters(&bench), (0, 95, 95, false));
    assert_eq!((bench.take_flags(), psr(&bench)), (PEA, (6, "")));
    bench.node.disturbed(BusError::Stuff, bench.now);
    assert_eq!((bench.take_flags(), psr(&bench)), (PEA | EW, (1, "W")));
    bench.hear(&good);
    assert_eq!((bench.take_flags() & STATES, psr(&bench)), (EW, (0, "")));
    assert_eq!(counters(&bench), (0, 95, 1, false));
    for _ in 0..50 {
        bench.node.disturbed(BusError::Form, bench.now);
    }
    assert_eq!((bench.take_flags() & STATES, psr(&bench)), (EW | EP, (2, "PW")));
    assert_eq!(counters(&bench), (0, 127, 50, true));
    // From passive one good frame leads back below 128.
    bench.hear(&good);
    assert_eq!(counters(&bench), (0, 127, 0, false));
    bench.hear(&good);
    assert_eq!(counters(&bench), (0, 126, 0, false));
}

#[test]
fn the_error_log_stops_at_its_end_and_tells() {
    let mut bench = Bench::configuring();
    bench.join();
    for _ in 0..255 {
        bench.node.disturbed(BusError::Crc, bench.now);
    }
    assert_eq!(bench.take_flags() & ELO, 0);
    bench.node.disturbed(BusError::Crc, bench.now);
    assert_eq!(bench.take_flags() & ELO, ELO);
    assert_eq!(counters(&bench).2, 255);
}

#[test]
fn thirty_two_destroyed_frames_are_bus_off() {
    let mut bench = with_a_frame();
    for tries in 1..=31 {
        attempt(&mut bench, NOISE);
        assert_eq!(counters(&bench).0, 8 * tries);
    }
    assert_eq!((bench.take_flags(), psr(&bench)), (PEA | EP | EW, (5, "PW")));
    attempt(&mut bench, NOISE);
    assert_eq!((bench.take_flags(), psr(&bench)), (PEA | BO, (5, "PWB")));
    assert_eq!((bench.read(CCCR), bench.node.is_on_bus()), (INIT, false));
    assert_eq!((bench.read(TXBRP), bench.counters().bus_offs), (1, 1));
    // Left alone it stays there.
    bench.wait(1_000_000_000);
    assert_eq!((psr(&bench), bench.node.next_event()), ((7, "PWB"), None));
}

#[test]
fn recovery_takes_129_times_eleven_recessive_bits() {
    let mut bench = bus_off();
    bench.write(CCCR, 0);
    let cleared = bench.now;
    let end = cleared + Nanos::new(129 * 11 * BIT);
    assert_eq!(bench.node.next_event(), Some(end));
    // Every sequence shows in LEC, and REC counts them.
    for sequence in 1..=127 {
        bench.wait(11 * BIT - 1);
        assert_eq!(psr(&bench), (7, "PWB"));
        bench.wait(1);
        assert_eq!(psr(&bench), (5, "PWB"));
        assert_eq!(counters(&bench).1, sequence);
    }
    bench.wait(22 * BIT - 1);
    assert!(!bench.node.is_on_bus() && bench.node.offer(bench.now).is_none());
    assert_eq!(bench.take_flags() & STATES, 0);
    bench.wait(1);
    assert_eq!(bench.now, end);
    assert!(bench.node.is_on_bus());
    assert_eq!((bench.take_flags() & STATES, psr(&bench)), (STATES, (5, "")));
    assert_eq!(counters(&bench), (0, 0, 0, false));
    // Pending frames go out: cancelling them is the driver's affair.
    assert_eq!(bench.carry_all(), ["200#0000000000000000"]);
}

fn bus_off() -> Bench {
    let mut bench = with_a_frame();
    for _ in 0..32 {
        attempt(&mut bench, NOISE);
    }
    bench.take_flags();
    counters(&bench);
    psr(&bench);
    bench
}

#[test]
fn recovery_stands_still_while_the_wire_is_dominant() {
    let mut bench = bus_off();
    bench.write(CCCR, 0);
    // Two sequences and a half, of which the half is lost.
    bench.wait(27 * BIT + BIT / 2);
    bench.node.wire_is(Activity::Busy, bench.now);
    assert_eq!((counters(&bench).1, bench.node.next_event()), (2, None));
    bench.wait(50_000_000);
    assert_eq!((counters(&bench).1, bench.node.is_on_bus()), (2, false));
    // The wire is idle after eleven recessive bits: they are the third.
    bench.node.wire_is(Activity::Idle, bench.now);
    assert_eq!(counters(&bench).1, 3);
    assert_eq!(bench.node.next_event(), Some(bench.now + Nanos::new(126 * 11 * BIT)));
}

#[test]
fn on_a_full_bus_every_frame_is_one_step_of_recovery() {
    let mut bench = bus_off();
    let foreign = standard(0x201, &[1, 2, 3]);
    bench.write(CCCR, 0);
    for frames in 1..=128 {
        bench.hear(&foreign);
        assert_eq!((counters(&bench).1, bench.node.is_on_bus()), (frames.min(127), false));
    }
    bench.hear(&foreign);
    assert!(bench.node.is_on_bus());
    assert_eq!(bench.counters().received, [0, 0]);
    bench.hear(&foreign);
    assert_eq!(bench.counters().received, [1, 0]);
}

#[test]
fn setting_init_again_does_not_shorten_recovery() {
    let mut bench = bus_off();
    bench.set_cccr(0);
    bench.wait(128 * 11 * BIT);
    bench.set_cccr(INIT);
    bench.set_cccr(INIT | CCE);
    bench.set_cccr(0);
    assert_eq!(bench.node.next_event(), Some(bench.now + Nanos::new(129 * 11 * BIT - CROSSING)));
    // CCE took the request with it.
    assert_eq!((bench.read(TXBRP), bench.counters().cancelled), (0, 1));
}

#[test]
fn in_restricted_operation_it_listens_and_its_counters_stand() {
    let mut bench = Bench::configuring();
    bench.lay_out_transmit(1, 0, false);
    bench.write(CCCR, INIT | CCE | ASM);
    bench.join();
    bench.request(0, &standard(1, &[]));
    assert_eq!(bench.start(), None);
    bench.node.disturbed(BusError::Crc, bench.now);
    assert_eq!((counters(&bench), psr(&bench)), ((0, 0, 1, false), (6, "")));
    bench.hear(&standard(2, &[]));
    assert_eq!(bench.counters().received, [1, 0]);
    bench.write(CCCR, 0);
    assert!(bench.start().is_some());
}

#[test]
fn a_bus_monitor_sends_nothing() {
    let mut bench = Bench::sending(1, 0, false);
    bench.request(0, &standard(1, &[]));
    bench.set_cccr(INIT);
    bench.set_cccr(INIT | CCE);
    bench.set_cccr(INIT | CCE | MON);
    bench.join();
    assert_eq!(bench.read(TXBRP), 0);
    bench.request(0, &standard(1, &[]));
    assert_eq!((bench.read(TXBRP), bench.start()), (0, None));
    assert_eq!(bench.counters().requests_ignored, 1);
    bench.hear(&standard(2, &[]));
    assert_eq!(bench.counters().received, [1, 0]);
}
