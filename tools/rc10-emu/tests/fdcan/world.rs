//! On a simulated wire, against other nodes.

use std::cell::RefCell;
use std::rc::Rc;

use rc10_emu::fdcan::Node;
use rc10_sim::{Bus, BusConfig, EscConfig, Model, Nanos, World};
use rc10_time::Micros;

use super::bench::*;

/// A joined controller with 32 dedicated buffers and a silent ESC that acknowledges.
fn rig() -> (World, Bus, Bench) {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let esc = bus.add_esc(EscConfig::new(Model::C620, 8)).unwrap();
    esc.set_feedback(false);
    let bench = Bench::configuring();
    bench.lay_out_transmit(32, 0, false);
    bench.write(CCCR, 0);
    bus.attach(Rc::new(RefCell::new(Node::new(bench.fdcans.clone(), 0))));
    (world, bus, bench)
}

fn advance(world: &mut World, bench: &mut Bench, micros: u64) {
    world.advance(world.now() + Micros::new(micros));
    bench.now = Nanos::from(world.now());
}

fn trace(bus: &Bus) -> Vec<(u64, u64, String)> {
    let entries = bus.take_trace();
    entries.iter().map(|e| (e.start.get(), e.end.get(), e.frame.to_string())).collect()
}

#[test]
fn a_frame_takes_exactly_its_stuffed_length() {
    let (mut world, bus, mut bench) = rig();
    advance(&mut world, &mut bench, 50);
    let frames = [
        standard(0x200, &[0; 8]),
        standard(0x201, &[0xFF; 8]),
        standard(0x202, &[0x12, 0x34, 0x56]),
        extended(0x0285_7D01, &[0; 8]),
    ];
    for (buffer, frame) in frames.iter().enumerate() {
        bench.request(buffer, frame);
    }
    advance(&mut world, &mut bench, 1000);
    let trace = trace(&bus);
    assert_eq!(trace.len(), frames.len());
    // Back to back: a frame and its interframe space, then the next.
    let mut start = 50_000;
    let mut order = frames.to_vec();
    order.sort_by_key(|frame| frame.id());
    for (entry, frame) in trace.iter().zip(order) {
        let bits = u64::from(frame.wire_length().total());
        assert_eq!(*entry, (start, start + (bits - 3) * BIT, frame.to_string()));
        start += bits * BIT;
    }
    assert_eq!(bench.counters().sent, 4);
}

#[test]
fn it_joins_the_world_after_eleven_bits() {
    let (mut world, bus, mut bench) = rig();
    bench.request(0, &standard(0x200, &[]));
    advance(&mut world, &mut bench, 200);
    assert_eq!(trace(&bus)[0].0, 11_000);
}

#[test]
fn arbitration_against_other_nodes() {
    let (mut world, bus, mut bench) = rig();
    advance(&mut world, &mut bench, 50);
    for (buffer, id) in [0x100, 0x200, 0x300].into_iter().enumerate() {
        bench.request(buffer, &standard(id, &[]));
    }
    for id in [0x150, 0x250, 0x350] {
        bus.inject(&standard(id, &[]));
    }
    advance(&mut world, &mut bench, 1000);
    let order: Vec<_> = trace(&bus).into_iter().map(|(.., frame)| frame).collect();
    assert_eq!(order, ["100#", "150#", "200#", "250#", "300#", "350#"]);
    let counters = bench.counters();
    assert_eq!((counters.sent, counters.received, counters.failed), (3, [3, 0], 0));
}

#[test]
fn cut_off_it_is_passive_and_healed_it_is_heard() {
    let (mut world, bus, mut bench) = rig();
    advance(&mut world, &mut bench, 50);
    bus.set_cut(true);
    bench.request(0, &standard(0x200, &[0; 8]));
    advance(&mut world, &mut bench, 10_000);
    assert_eq!((bench.read(ECR) & 0xFF, bench.read(PSR) & 0xE7), (128, 0x63));
    bus.set_cut(false);
    advance(&mut world, &mut bench, 1000);
    assert_eq!((bench.counters().sent, bench.read(TXBTO)), (1, 1));
}

#[test]
fn a_short_leads_to_bus_off_and_the_manual_way_back() {
    let (mut world, bus, mut bench) = rig();
    advance(&mut world, &mut bench, 50);
    bus.set_shorted(true);
    bench.request(0, &standard(0x200, &[0; 8]));
    advance(&mut world, &mut bench, 5000);
    assert_eq!((bench.read(PSR) & 0xE7, bench.read(CCCR)), (0xE5, INIT));
    assert_eq!((bench.counters().bus_offs, bench.counters().failed), (1, 32));
    bus.set_shorted(false);
    bench.write(CCCR, 0);
    let start = bench.now.get();
    advance(&mut world, &mut bench, 3000);
    assert_eq!(trace(&bus)[0].0, start + 129 * 11 * BIT);
    assert_eq!((bench.read(ECR) & 0xFF, bench.counters().sent), (0, 1));
}

#[test]
fn a_dominant_wire_holds_recovery_up() {
    let (mut world, bus, mut bench) = rig();
    advance(&mut world, &mut bench, 50);
    bus.set_shorted(true);
    bench.request(0, &standard(0x200, &[0; 8]));
    advance(&mut world, &mut bench, 5000);
    bus.set_shorted(false);
    bus.set_held_dominant(true);
    bench.write(CCCR, 0);
    advance(&mut world, &mut bench, 50_000);
    assert_eq!(bench.read(ECR) >> 8 & 0x7F, 0);
    bus.set_held_dominant(false);
    let start = bench.now.get();
    advance(&mut world, &mut bench, 3000);
    assert_eq!(trace(&bus)[0].0, start + 129 * 11 * BIT);
}

#[test]
fn another_bit_rate_hears_nothing_and_counts_errors() {
    let (mut world, bus, mut bench) = rig();
    advance(&mut world, &mut bench, 1);
    bench.write(CCCR, INIT);
    advance(&mut world, &mut bench, 1);
    bench.write(CCCR, INIT | CCE);
    // 41 quanta: 2.5 % off.
    bench.write(NBTP, ONE_MEGABIT + 1);
    bench.write(CCCR, 0);
    advance(&mut world, &mut bench, 50);
    bus.inject(&standard(0x201, &[]));
    advance(&mut world, &mut bench, 1000);
    assert_eq!(bench.counters().received, [0, 0]);
    assert!(bench.read(ECR) >> 8 & 0x7F > 0);
}

#[test]
fn nothing_is_lost_to_back_to_back_traffic() {
    let (mut world, bus, mut bench) = rig();
    advance(&mut world, &mut bench, 50);
    for id in 0x300..0x303 {
        bus.inject(&standard(id, &[0x55; 8]));
    }
    advance(&mut world, &mut bench, 1000);
    assert_eq!(bench.read(RXF0S) & 0x7F, 3);
    assert_eq!(bench.ram(FIFO_0 + 2 * ELEMENT) >> 18, 0x302);
}
