//! Each ESC's frames, byte by byte, and its faults. Numbers from the ESCs' manuals.
#![expect(clippy::float_cmp, clippy::unwrap_used, reason = "a test may panic, and exact is meant")]

use rc10_can::embedded_can::{ExtendedId, StandardId};
use rc10_can::{CanFrame, CanPort};
use rc10_sim::{
    Bus, BusConfig, Esc, EscConfig, EscState, FeedbackRate, IdOutOfRange, Model, Plant, World,
};
use rc10_time::Micros;

fn one(model: Model, id: u8) -> (World, Bus, Esc) {
    let mut world = World::new(11);
    let bus = world.add_bus(BusConfig::default());
    let esc = bus.add_esc(EscConfig::new(model, id)).unwrap();
    (world, bus, esc)
}

fn send(bus: &Bus, id: u16, data: [u8; 8]) {
    let frame = CanFrame::eight_bytes(StandardId::new(id).unwrap(), data);
    let _ = bus.port().submit(&frame);
}

/// The command an ESC takes from a frame whose slots are 0x0101, 0x0202, 0x0303, 0x0404.
fn slot(model: Model, esc_id: u8, frame_id: u16) -> i16 {
    let (mut world, bus, esc) = one(model, esc_id);
    send(&bus, frame_id, [1, 1, 2, 2, 3, 3, 4, 4]);
    world.advance(Micros::from_millis(1));
    esc.state().command
}

#[test]
fn every_id_has_its_frame_and_its_slot() {
    let families = [
        (Model::C620, 8, 0x200, 0x1FF),
        (Model::C610, 8, 0x200, 0x1FF),
        (Model::Gm6020Voltage, 7, 0x1FF, 0x2FF),
        (Model::Gm6020Current, 7, 0x1FE, 0x2FE),
    ];
    for (model, last, low, high) in families {
        for id in 1..=last {
            let (own, other) = if id <= 4 { (low, high) } else { (high, low) };
            let expected = 0x0101 * (i16::from(id - 1) % 4 + 1);
            assert_eq!(slot(model, id, own), expected, "{model:?} {id}");
            assert_eq!(slot(model, id, other), 0, "{model:?} {id}");
        }
        for id in [0, last + 1] {
            let error = IdOutOfRange { model, id };
            let bus = World::new(0).add_bus(BusConfig::default());
            assert_eq!(bus.add_esc(EscConfig::new(model, id)).err(), Some(error));
        }
    }
}

/// A motor that cannot turn, so that the current is all there is.
fn blocked(model: Model, command: u16, data: [u8; 8]) -> (EscState, CanFrame) {
    let mut world = World::new(11);
    let bus = world.add_bus(BusConfig::default());
    let config = EscConfig::new(model, 1);
    let plant = Plant {
        static_friction: 1e6,
        coulomb_friction: 1e6,
        thermal_time_constant: 1e9,
        ..config.plant
    };
    let esc = bus.add_esc(EscConfig { plant, ..config }).unwrap();
    send(&bus, command, data);
    world.advance(Micros::from_millis(50));
    let last = bus.take_trace().pop().unwrap();
    (esc.state(), last.frame)
}

#[test]
fn raw_commands_and_feedback_have_the_manuals_scales() {
    let near = |a: f64, b: f64| (a - b).abs() < 1e-6;

    // 16384 = 20 A.
    let (state, feedback) = blocked(Model::C620, 0x200, [0x40, 0, 0, 0, 0, 0, 0, 0]);
    assert!(near(state.current, 20.0), "{state:?}");
    assert_eq!(feedback.raw_id(), 0x201);
    assert_eq!(feedback.bytes()[2..], [0, 0, 0x40, 0, 25, 0]);

    // -8192 = -10 A.
    let (state, feedback) = blocked(Model::C620, 0x200, [0xE0, 0, 0, 0, 0, 0, 0, 0]);
    assert!(near(state.current, -10.0), "{state:?}");
    assert_eq!(feedback.bytes()[4..6], [0xE0, 0]);

    // 10000 = 10 A; byte 6 is null. More than full scale is full scale.
    for raw in [10_000_i16, 32_767] {
        let [high, low] = raw.to_be_bytes();
        let (state, feedback) = blocked(Model::C610, 0x200, [high, low, 0, 0, 0, 0, 0, 0]);
        assert!(near(state.current, 10.0), "{state:?}");
        assert_eq!(feedback.raw_id(), 0x201);
        assert_eq!(feedback.bytes()[2..], [0, 0, 0x27, 0x10, 0, 0]);
    }

    // 16384 = 3 A.
    let (state, feedback) = blocked(Model::Gm6020Current, 0x1FE, [0xC0, 0, 0, 0, 0, 0, 0, 0]);
    assert!(near(state.current, -3.0), "{state:?}");
    assert_eq!(feedback.raw_id(), 0x205);
    assert_eq!(feedback.bytes()[2..], [0, 0, 0xC0, 0, 25, 0]);

    // 2500 of 25000 at 24 V on 1.8 Ω: 1.333 A, raw 7282.
    let (state, feedback) = blocked(Model::Gm6020Voltage, 0x1FF, [0x09, 0xC4, 0, 0, 0, 0, 0, 0]);
    assert!(near(state.current, 2.4 / 1.8), "{state:?}");
    assert_eq!(feedback.raw_id(), 0x205);
    assert_eq!(feedback.bytes()[4..6], [0x1C, 0x72]);
}

#[test]
fn feedback_reports_rotor_speed_and_rotor_angle() {
    let (mut world, bus, esc) = one(Model::C620, 3);
    send(&bus, 0x200, [0, 0, 0, 0, 0x08, 0, 0, 0]); // 2.5 A
    let mut port = bus.port();
    let (mut last_raw, mut counts): (Option<i32>, i64) = (None, 0);
    let mut start = 0.0;
    for millisecond in 1..=300 {
        world.advance(Micros::from_millis(millisecond));
        while let Some((frame, _)) = port.receive() {
            assert_eq!(frame.raw_id(), 0x203);
            let bytes = frame.bytes();
            let raw = i32::from(u16::from_be_bytes([bytes[0], bytes[1]]));
            assert!((0..8192).contains(&raw));
            if let Some(last) = last_raw {
                counts += i64::from((raw - last + 4096).rem_euclid(8192) - 4096);
            } else {
                start = esc.state().output_degrees;
            }
            last_raw = Some(raw);
        }
    }
    let state = esc.state();
    assert!(state.rotor_rpm > 1000.0, "{state:?}");
    let feedback = bus.take_trace().pop().unwrap().frame;
    let rpm = i16::from_be_bytes([feedback.bytes()[2], feedback.bytes()[3]]);
    assert!((f64::from(rpm) - state.rotor_rpm).abs() < 0.02 * state.rotor_rpm);
    assert!((state.output_rpm * 3591.0 / 187.0 - state.rotor_rpm).abs() < 1e-6);
    // Multi-turn angle rebuilt from the 13 bits, at most two milliseconds off.
    let rebuilt = counts as f64 / 8192.0 * 360.0 * 187.0 / 3591.0;
    let true_angle = state.output_degrees - start;
    let travel = state.output_rpm * 6.0 * 0.002;
    assert!((rebuilt - true_angle).abs() <= travel, "{rebuilt} {true_angle}");
}

#[test]
fn an_absolute_encoder_says_where_its_rotor_was_put() {
    let (mut world, bus, esc) = one(Model::Gm6020Current, 1);
    esc.set_rotor_angle(-90.0);
    world.advance(Micros::from_millis(3));
    let feedback = bus.take_trace().pop().unwrap().frame;
    assert_eq!(feedback.bytes()[..2], 6144_u16.to_be_bytes());
    // The shaft did not turn by that.
    assert!(esc.state().output_degrees.abs() < 1e-9, "{:?}", esc.state());
}

#[test]
fn feedback_comes_at_the_set_rate_with_a_phase_of_its_own() {
    let mut world = World::new(9);
    let bus = world.add_bus(BusConfig::default());
    for (id, rate) in [
        (1, FeedbackRate::Hz1000),
        (2, FeedbackRate::Hz500),
        (3, FeedbackRate::Hz250),
        (4, FeedbackRate::Hz125),
    ] {
        let config = EscConfig::new(Model::C620, id);
        bus.add_esc(EscConfig { rate, ..config }).unwrap();
    }
    world.advance(Micros::from_millis(1000));
    let trace = bus.take_trace();
    let times = |id| {
        let of_id = trace.iter().filter(move |entry| entry.frame.raw_id() == id);
        of_id.map(|entry| entry.at.get()).collect::<Vec<_>>()
    };
    let counts = [0x201, 0x202, 0x203, 0x204].map(|id| times(id).len());
    assert_eq!(counts, [1000, 500, 250, 125]);
    let phases = [0x201, 0x202, 0x203, 0x204].map(|id| times(id)[0] % 1000);
    assert!(phases.windows(2).all(|pair| pair[0] != pair[1]), "{phases:?}");
    // Their rotors stand anywhere at first, and stay there.
    let angle = |id| {
        let mut of_id = trace.iter().filter(move |entry| entry.frame.raw_id() == id);
        of_id.next().map(|entry| [entry.frame.bytes()[0], entry.frame.bytes()[1]])
    };
    let angles = [0x201, 0x202, 0x203, 0x204].map(angle);
    assert!(angles.windows(2).all(|pair| pair[0] != pair[1]), "{angles:?}");
}

#[test]
fn the_last_command_stays_when_the_bus_goes_quiet() {
    let (mut world, bus, esc) = one(Model::C620, 1);
    send(&bus, 0x200, [0x08, 0, 0, 0, 0, 0, 0, 0]);
    world.advance(Micros::from_millis(2000));
    let state = esc.state();
    assert_eq!((state.command, state.commands), (0x0800, 1));
    assert!(state.rotor_rpm > 8000.0);
}

#[test]
fn without_power_it_coasts_in_silence_and_starts_again_at_zero() {
    let (mut world, bus, esc) = one(Model::C620, 1);
    send(&bus, 0x200, [0x20, 0, 0, 0, 0, 0, 0, 0]);
    world.advance(Micros::from_millis(200));
    esc.set_power(false);
    let before = esc.state();
    let _ = bus.take_trace();
    send(&bus, 0x200, [0x10, 0, 0, 0, 0, 0, 0, 0]);
    world.advance(Micros::from_millis(250));
    let after = esc.state();
    assert_eq!(bus.take_trace(), []);
    assert_eq!(after.commands, before.commands);
    assert_eq!(after.current, 0.0);
    assert!(after.rotor_rpm > 100.0 && after.rotor_rpm < 0.99 * before.rotor_rpm);
    bus.port().cancel_pending();

    esc.set_power(true);
    world.advance(Micros::from_millis(260));
    assert_eq!(esc.state().command, 0);
    assert_eq!(esc.state().current, 0.0);
    assert!(bus.take_trace().iter().any(|entry| !entry.from_controller));
}

#[test]
fn power_lost_within_a_frame_destroys_it() {
    let (mut world, bus, esc) = one(Model::C620, 1);
    world.advance(Micros::from_millis(10));
    let next = bus.take_trace().pop().unwrap().at + Micros::from_millis(1);
    world.advance(next - Micros::new(20));
    esc.set_power(false);
    esc.set_power(true);
    // It is not repeated, either.
    esc.set_feedback(false);
    world.advance(next + Micros::from_millis(1));
    assert_eq!(bus.take_trace(), []);
}

#[test]
fn unplugged_it_drives_on_unheard_and_without_acknowledging() {
    let (mut world, bus, esc) = one(Model::C620, 1);
    send(&bus, 0x200, [0x20, 0, 0, 0, 0, 0, 0, 0]);
    world.advance(Micros::from_millis(10));
    esc.set_cut(true);
    let before = esc.state();
    let _ = bus.take_trace();
    send(&bus, 0x200, [0; 8]);
    world.advance(Micros::from_millis(60));
    let after = esc.state();
    assert_eq!((bus.take_trace(), after.commands, after.command), (Vec::new(), 1, 0x2000));
    assert!(after.rotor_rpm > before.rotor_rpm + 100.0);
    // Plugged in again it hears the frame that has been repeated since.
    esc.set_cut(false);
    world.advance(Micros::from_millis(65));
    assert_eq!((esc.state().commands, esc.state().command), (2, 0));
    assert!(bus.take_trace().iter().any(|entry| !entry.from_controller));
}

#[test]
fn a_muted_esc_still_drives() {
    let (mut world, bus, esc) = one(Model::C610, 6);
    esc.set_feedback(false);
    send(&bus, 0x1FF, [0, 0, 0x07, 0xD0, 0, 0, 0, 0]);
    world.advance(Micros::from_millis(100));
    assert!(esc.state().output_rpm > 50.0, "{:?}", esc.state());
    assert!(bus.take_trace().iter().all(|entry| entry.from_controller));
}

#[test]
fn foreign_frames_move_nothing_and_short_ones_are_counted() {
    let (mut world, bus, esc) = one(Model::C620, 1);
    let id = StandardId::new(0x200).unwrap();
    bus.inject(&CanFrame::data_frame(id, &[0x40, 0, 0]).unwrap());
    bus.inject(&CanFrame::remote_frame(id, 8).unwrap());
    bus.inject(&CanFrame::eight_bytes(ExtendedId::new(0x200).unwrap(), [0x40; 8]));
    bus.inject(&CanFrame::eight_bytes(StandardId::new(0x1FF).unwrap(), [0x40; 8]));
    world.advance(Micros::from_millis(5));
    let state = esc.state();
    assert_eq!((state.command, state.commands, state.malformed), (0, 0, 1));
}
