//! Arbitration, bit timing, overload, missing acknowledge.

use rc10_can::embedded_can::{ExtendedId, StandardId};
use rc10_can::{BusError, CanFrame, CanPort, ErrorState, Submitted};
use rc10_sim::damiao::{Damiao, DamiaoConfig};
use rc10_sim::{Bus, BusConfig, EscConfig, FeedbackRate, Model, SimPort, World};
use rc10_time::Micros;

fn standard(id: u16, data: [u8; 8]) -> CanFrame {
    CanFrame::eight_bytes(StandardId::new(id).unwrap(), data)
}

/// A bus with one silent ESC, which acknowledges.
fn quiet_bus(world: &mut World) -> (Bus, SimPort) {
    let bus = world.add_bus(BusConfig::default());
    let esc = bus.add_esc(EscConfig::new(Model::C620, 8)).unwrap();
    esc.set_feedback(false);
    let port = bus.port();
    (bus, port)
}

/// Traffic on the wire, as `end time, frame`.
fn trace(bus: &Bus) -> Vec<(u64, String)> {
    let trace = bus.take_trace();
    let line = |entry: &rc10_sim::TraceEntry| (entry.at.get(), entry.frame.to_string());
    trace.iter().map(line).collect()
}

#[test]
fn the_lowest_identifier_leaves_first_and_data_before_remote() {
    let mut world = World::new(1);
    let (bus, mut port) = quiet_bus(&mut world);
    let id = |raw| StandardId::new(raw).unwrap();
    for frame in [
        standard(0x300, [0; 8]),
        // Extended 0x100 << 18 starts like standard 0x100, and loses to it.
        CanFrame::data_frame(ExtendedId::new(0x100 << 18).unwrap(), &[]).unwrap(),
        CanFrame::data_frame(id(0x100), &[]).unwrap(),
    ] {
        assert_eq!(port.submit(&frame), Submitted::Queued);
    }
    bus.inject(&CanFrame::data_frame(id(0x0FF), &[7]).unwrap());
    bus.inject(&CanFrame::remote_frame(id(0x100), 0).unwrap());
    world.advance(Micros::from_millis(1));
    let order: Vec<_> = trace(&bus).into_iter().map(|(_, frame)| frame).collect();
    let expected = ["0FF#07", "100#", "100#R0", "04000000#", "300#0000000000000000"];
    assert_eq!(order, expected);
}

/// A device that answers at once waits for nothing but the end of the frame.
#[test]
fn an_answer_begins_behind_the_question_and_its_interframe_space() {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let config = DamiaoConfig::j4310(0x11, 0x31);
    bus.add(Damiao::new(&config), config.plant);
    let mut port = bus.port();
    // Between two steps of the physics, which are 100 us apart.
    for question in [2_013, 4_047, 6_071, 8_099] {
        world.advance(Micros::new(question));
        let enable = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC];
        assert_eq!(port.submit(&standard(0x11, enable)), Submitted::Queued);
        world.advance(Micros::new(question + 1000));
        let trace = bus.take_trace();
        let [asked, answered] = &trace[..] else { panic!("no answer to {question}: {trace:?}") };
        assert_eq!(answered.start.get() - asked.end.get(), 3_000, "{question}");
    }
}

#[test]
fn frames_take_exactly_their_bits() {
    let mut world = World::new(1);
    let (bus, mut port) = quiet_bus(&mut world);
    world.advance(Micros::new(1000));
    // 111 bits and 15 stuff bits.
    let _ = port.submit(&standard(0x200, [0; 8]));
    // 111 bits and as many stuff bits as this frame needs.
    let other = standard(0x1FF, [0x55; 8]);
    let other_bits = u64::from(other.wire_length().total());
    let _ = port.submit(&other);
    world.advance(Micros::new(2000));
    assert_eq!(
        trace(&bus),
        [
            (1000 + other_bits, "1FF#5555555555555555".to_string()),
            (1000 + other_bits + 126, "200#0000000000000000".to_string()),
        ]
    );
    let busy = (other_bits + 126) as f64;
    assert!((bus.load() - busy * 100.0 / 2000.0).abs() < 1e-9);
}

#[test]
fn a_bit_time_that_is_no_whole_microsecond_adds_up_exactly() {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig { bit_time_ns: 1250, ..BusConfig::default() });
    for _ in 0..4 {
        bus.inject(&standard(0x200, [0; 8]));
    }
    world.advance(Micros::from_millis(1));
    // 126 bits of 1.25 µs are 157.5 µs.
    let trace = bus.take_trace();
    let ends: Vec<_> = trace.iter().map(|entry| entry.at.get()).collect();
    assert_eq!(ends, [157, 315, 472, 630]);
    let starts: Vec<_> = trace.iter().map(|entry| entry.start.get()).collect();
    assert_eq!(starts, [0, 157_500, 315_000, 472_500]);
    assert_eq!(trace[3].end.get(), 472_500 + 123 * 1250);
}

#[test]
fn a_newer_frame_replaces_one_that_waits_but_not_one_on_the_wire() {
    let mut world = World::new(1);
    let (bus, mut port) = quiet_bus(&mut world);
    let _ = port.submit(&standard(0x200, [1; 8]));
    world.advance(Micros::new(10));
    assert_eq!(
        port.submit(&standard(0x200, [2; 8])),
        Submitted::Queued,
        "the first is on the wire"
    );
    assert_eq!(port.submit(&standard(0x200, [3; 8])), Submitted::Replaced, "the second waits");
    let _ = port.submit(&standard(0x201, [4; 8]));
    world.advance(Micros::new(1000));
    let sent: Vec<_> = trace(&bus).into_iter().map(|(_, frame)| frame).collect();
    let expected = ["200#0101010101010101", "200#0303030303030303", "201#0404040404040404"];
    assert_eq!(sent, expected);

    let _ = port.submit(&standard(0x200, [5; 8]));
    let _ = port.submit(&standard(0x201, [6; 8]));
    assert_eq!(port.cancel_pending(), 2);
    world.advance(Micros::new(2000));
    assert_eq!(trace(&bus), []);
}

#[test]
fn the_thirty_third_identifier_is_refused() {
    let mut world = World::new(1);
    let (_, mut port) = quiet_bus(&mut world);
    for id in 0..32 {
        assert_eq!(port.submit(&standard(id, [0; 8])), Submitted::Queued);
    }
    assert_eq!(port.submit(&standard(32, [0; 8])), Submitted::Refused);
}

/// Runs eight ESCs and a command of two frames each millisecond for a second.
fn eight_motors(rate: FeedbackRate) -> (Bus, Vec<u64>) {
    let mut world = World::new(7);
    let bus = world.add_bus(BusConfig::default());
    let escs: Vec<_> = (1..=8)
        .map(|id| {
            let config = EscConfig { rate, ..EscConfig::new(Model::C620, id) };
            bus.add_esc(config).unwrap()
        })
        .collect();
    let mut port = bus.port();
    for millisecond in 1..=1000 {
        world.advance(Micros::from_millis(millisecond));
        while port.receive().is_some() {}
        let _ = port.submit(&standard(0x200, [2; 8]));
        let _ = port.submit(&standard(0x1FF, [2; 8]));
    }
    let lost = escs.iter().map(|esc| esc.state().feedback_overwritten);
    (bus, lost.collect())
}

#[test]
fn eight_motors_at_1_khz_overload_the_bus_and_at_500_hz_do_not() {
    let (bus, lost) = eight_motors(FeedbackRate::Hz1000);
    assert!(bus.load() > 99.0, "{}", bus.load());
    assert!(lost.iter().sum::<u64>() > 500, "{lost:?}");
    let full = |load: &f64| (99.0..=100.0).contains(load);
    assert!(bus.load_windows().iter().all(full), "{:?}", bus.load_windows());
    // The highest identifier loses.
    assert_eq!(lost[0], 0, "{lost:?}");
    assert!(lost[7] > 500, "{lost:?}");

    let (bus, lost) = eight_motors(FeedbackRate::Hz500);
    assert_eq!(lost, [0; 8]);
    let windows = bus.load_windows();
    assert_eq!(windows.len(), 10);
    assert!(windows.iter().all(|load| (65.0..82.0).contains(load)), "{windows:?}");
}

#[test]
fn a_full_receive_queue_loses_frames_and_counts_them() {
    let mut world = World::new(3);
    let bus = world.add_bus(BusConfig { receive_capacity: 4, ..BusConfig::default() });
    bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
    let mut port = bus.port();
    world.advance(Micros::from_millis(10));
    let sent = bus.take_trace();
    let received: Vec<_> = std::iter::from_fn(|| port.receive()).collect();
    // The oldest stay.
    let first: Vec<_> = sent[..4].iter().map(|e| (e.frame, e.start.micros())).collect();
    assert_eq!(received, first);
    assert_eq!(port.health().receive_lost as usize, sent.len() - 4);
}

#[test]
fn without_an_acknowledge_the_sender_repeats_and_turns_passive_until_somebody_listens() {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let esc = bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
    esc.set_feedback(false);
    esc.set_power(false);
    let mut port = bus.port();
    let _ = port.submit(&standard(0x200, [0; 8])); // 126 µs each time

    world.advance(Micros::new(126 * 11));
    let health = port.health();
    assert_eq!((health.transmit_errors, health.state), (88, ErrorState::Active));
    assert_eq!(health.last_error, Some(BusError::Acknowledge));
    world.advance(Micros::new(126 * 12));
    let health = port.health();
    assert_eq!((health.transmit_errors, health.state), (96, ErrorState::Warning));
    world.advance(Micros::new(126 * 100));
    let health = port.health();
    assert_eq!((health.transmit_errors, health.state), (128, ErrorState::Passive));
    assert_eq!(health.bus_offs, 0);
    assert_eq!((bus.counters().frames, bus.counters().unacknowledged), (0, 100));
    assert!(bus.load() > 99.9);

    // A newer command takes the failed one's place: nothing stale leaves after an outage.
    assert_eq!(port.cancel_pending(), 1);
    let _ = port.submit(&standard(0x200, [0; 8]));
    world.advance(Micros::new(126 * 100 + 50));
    assert_eq!(port.submit(&standard(0x200, [9; 8])), Submitted::Queued);
    esc.set_power(true);
    world.advance(Micros::new(126 * 104));
    let sent: Vec<_> = trace(&bus).into_iter().map(|(_, frame)| frame).collect();
    assert_eq!(sent, ["200#0909090909090909"]);
    assert_eq!(port.health().transmit_errors, 127);
    assert_eq!(port.health().state, ErrorState::Warning);
}

#[test]
fn a_cut_controller_is_alone_and_the_others_go_on() {
    let mut world = World::new(5);
    let bus = world.add_bus(BusConfig::default());
    let escs = [1, 2].map(|id| bus.add_esc(EscConfig::new(Model::C620, id)).unwrap());
    let mut port = bus.port();
    bus.set_cut(true);
    let _ = port.submit(&standard(0x200, [1; 8]));
    world.advance(Micros::from_millis(100));
    assert_eq!(port.receive(), None);
    assert_eq!(port.health().state, ErrorState::Passive);
    assert!(escs.iter().all(|esc| esc.state().commands == 0));
    // The two ESCs acknowledge each other, undisturbed.
    let counters = bus.counters();
    assert_eq!((counters.frames, counters.unacknowledged), (200, 0));

    bus.set_cut(false);
    world.advance(Micros::from_millis(101));
    assert_eq!(escs[0].state().commands, 1);
    assert!(port.receive().is_some());
}

#[test]
fn the_failed_frame_keeps_its_transmit_buffer() {
    let mut world = World::new(1);
    let mut port = world.add_bus(BusConfig::default()).port();
    let _ = port.submit(&standard(0x000, [0; 8]));
    world.advance(Micros::new(10));
    for id in 1..=32 {
        assert_eq!(port.submit(&standard(id, [0; 8])), Submitted::Queued);
    }
    let attempt = u64::from(standard(0, [0; 8]).wire_length().total());
    world.advance(Micros::new(attempt));
    assert_eq!(port.submit(&standard(0x000, [1; 8])), Submitted::Replaced);
    assert_eq!(port.cancel_pending(), 33);
}

#[test]
fn a_frame_cut_off_on_the_wire_is_not_heard_and_what_failed_alone_goes_first() {
    let mut world = World::new(1);
    let (bus, mut port) = quiet_bus(&mut world);
    let _ = port.submit(&standard(0x200, [0; 8])); // 126 µs
    world.advance(Micros::new(50));
    bus.set_cut(true);
    // Connected again in the middle of the third attempt, the first one that could not be
    // heard, because the controller was alone.
    world.advance(Micros::new(126 * 2 + 50));
    assert_eq!(bus.counters().frames, 0);
    bus.set_cut(false);
    let _ = port.submit(&standard(0x300, [2; 8]));
    world.advance(Micros::from_millis(1));
    let sent: Vec<_> = trace(&bus).into_iter().map(|(_, frame)| frame).collect();
    assert_eq!(sent, ["200#0000000000000000", "300#0202020202020202"]);
}

#[test]
fn a_lone_esc_repeats_its_newest_frame_until_it_is_heard() {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
    let mut port = bus.port();
    bus.set_cut(true);
    world.advance(Micros::from_millis(100));
    assert!(bus.load() > 95.0, "{}", bus.load());
    assert_eq!(bus.counters().frames, 0);
    bus.set_cut(false);
    world.advance(Micros::from_millis(101));
    assert!(port.receive().is_some());
}

#[test]
fn a_foreign_node_waits_to_be_heard_and_acknowledges_meanwhile() {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let mut port = bus.port();
    bus.set_cut(true);
    bus.inject(&standard(0x300, [3; 8]));
    world.advance(Micros::from_millis(10));
    assert_eq!(bus.counters().frames, 0);
    bus.set_cut(false);
    let _ = port.submit(&standard(0x200, [2; 8]));
    world.advance(Micros::from_millis(11));
    let sent: Vec<_> = trace(&bus).into_iter().map(|(_, frame)| frame).collect();
    assert_eq!(sent, ["200#0202020202020202", "300#0303030303030303"]);
}

#[test]
fn two_nodes_of_one_identifier_are_counted() {
    let mut world = World::new(5);
    let (bus, _) = quiet_bus(&mut world);
    bus.add_esc(EscConfig::new(Model::C620, 5)).unwrap();
    bus.add_esc(EscConfig::new(Model::Gm6020Voltage, 1)).unwrap();
    // The wire is busy until both wait for it.
    for _ in 0..20 {
        bus.inject(&standard(0x001, [0; 8]));
    }
    world.advance(Micros::from_millis(5));
    assert!(bus.counters().id_clashes > 0);
}

#[test]
fn two_controllers_arbitrate_hear_and_acknowledge_each_other() {
    let mut world = World::new(1);
    let left = world.add_bus(BusConfig::default());
    let right = left.another_end();
    let (mut ours, mut theirs) = (left.port(), right.port());
    // Nothing else is there: each is acknowledged by the other one.
    let _ = ours.submit(&standard(0x300, [1; 8]));
    let _ = theirs.submit(&standard(0x200, [2; 8]));
    let _ = theirs.submit(&standard(0x400, [3; 8]));
    world.advance(Micros::from_millis(1));
    let from_controller = |bus: &Bus| -> Vec<_> {
        bus.take_trace().iter().map(|it| (it.frame.key(), it.from_controller)).collect()
    };
    assert_eq!(from_controller(&left), [(0x200, false), (0x300, true), (0x400, false)]);
    assert_eq!(from_controller(&right), [(0x200, true), (0x300, false), (0x400, true)]);
    let heard = |port: &mut SimPort| port.receive().map(|(frame, _)| frame.key());
    assert_eq!([(); 3].map(|()| heard(&mut ours)), [Some(0x200), Some(0x400), None]);
    assert_eq!([(); 2].map(|()| heard(&mut theirs)), [Some(0x300), None]);
    // One end cut: both are alone, and both go on when it is whole again.
    right.set_cut(true);
    let _ = ours.submit(&standard(0x300, [4; 8]));
    let _ = theirs.submit(&standard(0x200, [5; 8]));
    world.advance(Micros::from_millis(100));
    assert_eq!([ours.health().state, theirs.health().state], [ErrorState::Passive; 2]);
    assert_eq!([heard(&mut ours), heard(&mut theirs)], [None; 2]);
    right.set_cut(false);
    world.advance(Micros::from_millis(101));
    assert_eq!([heard(&mut ours), heard(&mut theirs)], [Some(0x200), Some(0x300)]);
    // Of one identifier at once both cannot be told apart.
    let before = left.counters().id_clashes;
    let _ = ours.submit(&standard(0x300, [6; 8]));
    let _ = theirs.submit(&standard(0x300, [7; 8]));
    world.advance(Micros::from_millis(102));
    assert_eq!(left.counters().id_clashes, before + 1);
}
