//! Faults of a wire, and what the bus's own controller makes of them: error counters, bus-off, the
//! way back.

use rc10_can::embedded_can::StandardId;
use rc10_can::{BusError, CanFrame, CanPort, ErrorState, Submitted};
use rc10_sim::{Bus, BusConfig, Esc, EscConfig, Model, SimPort, World};
use rc10_time::Micros;

/// A bus with one silent ESC.
fn quiet() -> (World, Bus, SimPort, Esc) {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let esc = bus.add_esc(EscConfig::new(Model::C620, 8)).unwrap();
    esc.set_feedback(false);
    let port = bus.port();
    (world, bus, port, esc)
}

fn frame(id: u16) -> CanFrame {
    CanFrame::eight_bytes(StandardId::new(id).unwrap(), [0; 8])
}

fn bits(id: u16) -> u64 {
    u64::from(frame(id).wire_length().total())
}

fn errors(port: &SimPort) -> (u8, u8, ErrorState) {
    let health = port.health();
    (health.transmit_errors, health.receive_errors, health.state)
}

/// Traffic on the wire, as `start in ns, identifier`.
fn trace(bus: &Bus) -> Vec<(u64, u32)> {
    bus.take_trace().iter().map(|entry| (entry.start.get(), entry.frame.raw_id())).collect()
}

#[test]
fn a_short_takes_the_controller_off_the_bus() {
    let (mut world, bus, mut port, _) = quiet();
    bus.set_shorted(true);
    let _ = port.submit(&frame(0x200));
    // Each attempt takes 1 + 14 + 3 bits.
    world.advance(Micros::new(18 * 11));
    assert_eq!(errors(&port), (88, 0, ErrorState::Active));
    world.advance(Micros::new(18 * 12));
    assert_eq!(errors(&port), (96, 0, ErrorState::Warning));
    assert_eq!(port.health().last_error, Some(BusError::Bit));
    world.advance(Micros::new(18 * 16));
    assert_eq!(errors(&port), (128, 0, ErrorState::Passive));
    world.advance(Micros::new(18 * 31));
    assert_eq!(errors(&port), (248, 0, ErrorState::Passive));
    world.advance(Micros::new(18 * 32));
    assert_eq!(errors(&port), (255, 0, ErrorState::BusOff));
    assert_eq!(port.health().bus_offs, 1);
    world.advance(Micros::from_millis(50));
    assert_eq!((bus.counters().destroyed, bus.counters().frames), (32, 0));

    // What was unsent is lost. It stays off when the wire is whole again, and takes nothing.
    assert_eq!(port.health().transmit_lost, 1);
    bus.set_shorted(false);
    assert_eq!(port.submit(&frame(0x200)), Submitted::Refused);
    assert_eq!(port.cancel_pending(), 0);
    world.advance(Micros::from_millis(100));
    assert_eq!(errors(&port), (255, 0, ErrorState::BusOff));
    assert_eq!(trace(&bus), []);
}

#[test]
fn the_way_back_takes_128_times_11_recessive_bits_and_forgets_what_waited() {
    let (mut world, bus, mut port, _) = quiet();
    bus.set_shorted(true);
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::from_millis(10));
    // Shorted the wire is recessive: it comes back, and fails again.
    port.recover();
    let _ = port.submit(&frame(0x201));
    world.advance(Micros::new(10_000 + 1407));
    assert_eq!(errors(&port), (255, 0, ErrorState::BusOff));
    world.advance(Micros::new(10_000 + 1408));
    assert_eq!(errors(&port), (0, 0, ErrorState::Active));
    world.advance(Micros::from_millis(20));
    assert_eq!((port.health().state, port.health().bus_offs), (ErrorState::BusOff, 2));

    bus.set_shorted(false);
    port.recover();
    let _ = port.submit(&frame(0x202));
    // Once more changes nothing.
    world.advance(Micros::new(20_500));
    port.recover();
    world.advance(Micros::from_millis(30));
    assert_eq!(trace(&bus), [(21_408_000, 0x202)]);
    assert_eq!(errors(&port), (0, 0, ErrorState::Active));
    // Nor while it is on the bus.
    bus.set_cut(true);
    let _ = port.submit(&frame(0x203));
    world.advance(Micros::new(30_050));
    port.recover();
    bus.set_cut(false);
    world.advance(Micros::from_millis(31));
    assert_eq!(trace(&bus).len(), 1);
}

#[test]
fn each_frame_of_others_is_one_step_of_the_way_back() {
    let (mut world, bus, mut port, _) = quiet();
    bus.set_shorted(true);
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::from_millis(1));
    bus.set_shorted(false);
    for _ in 0..200 {
        bus.inject(&frame(0x300));
    }
    port.recover();
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::new(1000 + 200 * bits(0x300)));
    let first = trace(&bus).iter().position(|&(_, id)| id == 0x200);
    // The wire is never idle for longer than between two frames.
    assert_eq!(first, Some(128));
}

#[test]
fn a_short_destroys_the_frame_on_the_wire_and_the_escs_repeat_theirs() {
    let (mut world, bus, mut port, esc) = quiet();
    let _ = port.submit(&frame(0x1FF));
    bus.inject(&frame(0x300));
    world.advance(Micros::new(50));
    bus.set_shorted(true);
    bus.set_shorted(false);
    world.advance(Micros::from_millis(1));
    // 14 bits of error frame, 3 of interframe space.
    let again = 50_000 + 17_000;
    assert_eq!(trace(&bus), [(again, 0x1FF), (again + bits(0x1FF) * 1000, 0x300)]);
    assert_eq!(errors(&port), (7, 0, ErrorState::Active));
    assert_eq!(port.receive(), Some((frame(0x300), Micros::new(67 + bits(0x1FF)))));

    esc.set_feedback(true);
    bus.set_shorted(true);
    world.advance(Micros::from_millis(20));
    assert_eq!(trace(&bus), []);
    assert!(bus.counters().destroyed > 500);
    // Who listens sees nothing of it.
    assert_eq!(errors(&port), (7, 0, ErrorState::Active));
    bus.set_shorted(false);
    world.advance(Micros::from_millis(21));
    assert!(!trace(&bus).is_empty());
}

#[test]
fn on_a_shorted_wire_no_node_wins() {
    let (mut world, bus, mut port, _) = quiet();
    bus.inject(&frame(0x100));
    bus.set_shorted(true);
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::from_millis(1));
    assert_eq!(port.health().state, ErrorState::BusOff);
    bus.set_shorted(false);
    world.advance(Micros::from_millis(2));
    assert_eq!(trace(&bus), [(18 * 56 * 1000, 0x100)]);
}

#[test]
fn a_bus_held_dominant_is_never_idle() {
    let (mut world, bus, mut port, _) = quiet();
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::new(50));
    bus.set_held_dominant(true);
    world.advance(Micros::new(2000));
    assert_eq!(errors(&port), (8, 0, ErrorState::Active));
    assert_eq!(bus.counters().destroyed, 1);
    bus.inject(&frame(0x300));
    bus.set_held_dominant(false);
    world.advance(Micros::from_millis(3));
    let start = 2_011_000;
    assert_eq!(trace(&bus), [(start, 0x200), (start + bits(0x200) * 1000, 0x300)]);

    // Also from the interframe space on.
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::new(3000 + bits(0x200) - 1));
    bus.set_held_dominant(true);
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::new(3500));
    bus.set_held_dominant(false);
    world.advance(Micros::from_millis(4));
    assert_eq!(trace(&bus), [(3_000_000, 0x200), (3_511_000, 0x200)]);

    // No way back from bus-off meanwhile.
    bus.set_shorted(true);
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::from_millis(5));
    bus.set_shorted(false);
    port.recover();
    world.advance(Micros::new(5_100));
    bus.set_held_dominant(true);
    world.advance(Micros::from_millis(50));
    assert_eq!(port.health().state, ErrorState::BusOff);
    bus.set_held_dominant(false);
    // 9 sequences in the first 100 µs; 1 when it was let go; 118 are missing then.
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::from_millis(60));
    assert_eq!(trace(&bus), [(50_000_000 + 11_000 + 118 * 11_000, 0x200)]);
    assert!(bus.load() > 70.0, "{}", bus.load());
}

#[test]
fn noise_destroys_frames_and_they_are_repeated() {
    let (mut world, bus, mut port, _) = quiet();
    let _ = port.submit(&frame(0x200));
    bus.damage(2);
    // Up to its end, then an error frame of 17 bits.
    let attempt = bits(0x200) - 3 + 17;
    world.advance(Micros::new(attempt));
    assert_eq!(errors(&port), (8, 0, ErrorState::Active));
    assert_eq!(port.health().last_error, Some(BusError::Bit));
    world.advance(Micros::from_millis(1));
    assert_eq!(trace(&bus), [(2 * attempt * 1000, 0x200)]);
    assert_eq!(errors(&port), (15, 0, ErrorState::Active));
    assert_eq!((bus.counters().frames, bus.counters().destroyed), (1, 2));

    bus.damage(3);
    bus.inject(&frame(0x300));
    world.advance(Micros::new(1000 + 2 * attempt));
    assert_eq!(errors(&port), (15, 2, ErrorState::Active));
    assert_eq!(port.health().last_error, Some(BusError::Crc));
    bus.damage(0);
    world.advance(Micros::from_millis(2));
    assert_eq!(errors(&port), (15, 1, ErrorState::Active));
    assert_eq!(trace(&bus), [(1_000_000 + 2 * attempt * 1000, 0x300)]);
    assert_eq!(port.receive(), Some((frame(0x300), Micros::new(1000 + 2 * attempt))));
}

#[test]
fn a_fault_within_an_error_frame_adds_nothing() {
    let (mut world, bus, mut port, _) = quiet();
    let _ = port.submit(&frame(0x200));
    bus.damage(1);
    world.advance(Micros::new(bits(0x200)));
    bus.set_shorted(true);
    bus.set_shorted(false);
    world.advance(Micros::from_millis(1));
    assert_eq!(trace(&bus), [((bits(0x200) - 3 + 17) * 1000, 0x200)]);
}

#[test]
fn a_disturbed_listener_turns_passive_and_a_good_frame_brings_it_back() {
    let (mut world, bus, port, esc) = quiet();
    bus.damage(200);
    esc.set_feedback(true);
    let mut states = Vec::new();
    while bus.counters().frames == 0 {
        world.advance(world.now() + Micros::new(10));
        if states.last() != Some(&errors(&port)) {
            states.push(errors(&port));
        }
    }
    assert_eq!(
        states[95..98].iter().map(|s| s.2).collect::<Vec<_>>(),
        [ErrorState::Active, ErrorState::Warning, ErrorState::Warning]
    );
    let last = states.len() - 3..;
    assert_eq!(
        states[last],
        [
            (0, 127, ErrorState::Warning),
            (0, 127, ErrorState::Passive),
            (0, 127, ErrorState::Warning)
        ]
    );
}

#[test]
fn a_cut_controller_is_not_reached_by_the_faults_of_the_wire() {
    let (mut world, bus, mut port, _) = quiet();
    bus.set_cut(true);
    bus.set_shorted(true);
    bus.damage(1);
    let _ = port.submit(&frame(0x200));
    world.advance(Micros::new(bits(0x200)));
    assert_eq!(port.health().last_error, Some(BusError::Acknowledge));
    bus.set_held_dominant(true);
    world.advance(Micros::new(2 * bits(0x200)));
    assert_eq!(errors(&port).0, 16);
    assert_eq!(bus.counters().destroyed, 0);
}
