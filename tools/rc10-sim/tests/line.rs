//! The serial line: how long bytes take, who hears them, and what goes wrong.

use rc10_sim::unitree_line::{GoM8010, plant};
use rc10_sim::{Esc, Line, LineConfig, Nanos, UartPort, World};

/// Lock, to motor 0.
const QUESTION: [u8; 17] = [0xFE, 0xEE, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x65, 0x23];

fn world(config: LineConfig) -> (World, Line, Esc, UartPort) {
    let mut world = World::new(1);
    let line = world.add_line(config);
    let motor = line.add(GoM8010::new(0), plant());
    let port = line.port();
    (world, line, motor, port)
}

#[test]
fn an_exchange_takes_its_bytes_and_the_motor_s_thinking() {
    let (mut world, line, motor, mut port) = world(LineConfig::default());
    port.send(&QUESTION);
    // 17 bytes of 2.5 us.
    world.advance_to(Nanos::new(42_499));
    assert_eq!(motor.state().commands, 0);
    world.advance_to(Nanos::new(42_500));
    assert_eq!(motor.state().commands, 1);
    // 20 us later the first of 16 bytes starts.
    world.advance_to(Nanos::new(64_999));
    assert_eq!(port.take_received(), []);
    world.advance_to(Nanos::new(65_000));
    assert_eq!(port.take_received(), [0xFD]);
    world.advance_to(Nanos::new(102_500));
    assert_eq!(port.take_received().len(), 15);
    let counters = line.counters();
    assert_eq!((counters.from_host, counters.from_devices, counters.busy_ns), (17, 16, 82_500));

    let slow = LineConfig { baud: 115_200, ..LineConfig::default() };
    let (mut world, _, motor, mut port) = self::world(slow);
    port.send(&QUESTION);
    world.advance_to(Nanos::new(17 * 86_805 - 1));
    assert_eq!(motor.state().commands, 0);
    world.advance_to(Nanos::new(17 * 86_805));
    assert_eq!(motor.state().commands, 1);
}

#[test]
fn a_trace_has_what_a_node_in_the_middle_hears() {
    let (mut world, line, motor, mut port) = world(LineConfig::default());
    port.send(&QUESTION);
    world.advance_to(Nanos::new(200_000));
    assert_eq!(line.take_trace(), [], "it was not asked for");
    line.keep_trace();
    let mut exchange = || {
        port.send(&QUESTION);
        world.advance_to(world.now_ns() + Nanos::new(200_000));
        line.take_trace()
    };
    let trace = exchange();
    let (asked, answered) = trace.split_at(17);
    assert!(asked.iter().map(|entry| entry.byte).eq(QUESTION));
    assert!(asked.iter().all(|entry| entry.from_host));
    assert!(answered.iter().all(|entry| !entry.from_host) && answered.len() == 16);
    let [first, last] = [asked[0], answered[15]];
    assert_eq!((first.start, first.end), (Nanos::new(200_000), Nanos::new(202_500)));
    assert_eq!((answered[0].byte, last.end), (0xFD, Nanos::new(302_500)));
    // An end that is unplugged is not on the line.
    line.set_cut(true);
    assert_eq!(exchange(), []);
    line.set_cut(false);
    motor.set_cut(true);
    assert_eq!(exchange().len(), 17);
}

#[test]
fn who_talks_at_the_same_time_spoils_both() {
    let (mut world, line, motor, mut port) = world(LineConfig::default());
    port.send(&QUESTION);
    world.advance_to(Nanos::new(20_001));
    line.inject(&[0x55]);
    world.advance_to(Nanos::new(1_000_000));
    // The one byte overlaps two.
    assert_eq!(line.counters().collided, 3);
    assert_eq!((motor.state().commands, motor.state().malformed), (0, 1));
    assert_eq!(port.take_received().len(), 1);
    // Into the answer.
    port.send(&QUESTION);
    world.advance_to(Nanos::new(1_080_000));
    port.send(&[0]);
    world.advance_to(Nanos::new(2_000_000));
    assert_eq!((motor.state().commands, port.take_received().len()), (1, 16));
    assert!(line.counters().collided > 3);
}

#[test]
fn cut_muted_or_without_power_it_does_not_answer() {
    let (mut world, line, motor, mut port) = world(LineConfig::default());
    let mut answers = |commands: u64| {
        port.send(&QUESTION);
        world.advance_to(world.now_ns() + Nanos::new(1_000_000));
        assert_eq!(motor.state().commands, commands);
        port.take_received().len()
    };
    assert_eq!(answers(1), 16);
    motor.set_cut(true);
    assert_eq!(answers(1), 0);
    motor.set_cut(false);
    line.set_cut(true);
    assert_eq!(answers(1), 0);
    line.set_cut(false);
    motor.set_feedback(false);
    assert_eq!(answers(2), 0);
    motor.set_feedback(true);
    motor.set_power(false);
    assert_eq!(answers(2), 0);
    motor.set_power(true);
    assert_eq!(answers(3), 16);
    line.damage_commands(1);
    assert_eq!(answers(3), 0);
    line.damage_answers(1);
    assert_eq!(answers(4), 16);
    assert_eq!(motor.state().malformed, 1);
}

#[test]
fn a_full_buffer_loses_and_an_echo_is_heard() {
    let config = LineConfig { echo: true, receive_capacity: 20, ..LineConfig::default() };
    let (mut world, line, _, mut port) = world(config);
    port.send(&QUESTION);
    world.advance_to(Nanos::new(1_000_000));
    let received = port.take_received();
    assert_eq!(received[..17], QUESTION);
    assert_eq!((received.len(), line.counters().overrun), (20, 13));
}

#[test]
fn it_counts_its_angle_from_power_on_within_a_turn() {
    let (mut world, _, motor, mut port) = world(LineConfig::default());
    let mut angle = || {
        port.send(&QUESTION);
        world.advance_to(world.now_ns() + Nanos::new(200_000_000));
        let answer = port.take_received();
        f64::from(i32::from_le_bytes(answer[7..11].try_into().unwrap())) / 32_768.0
    };
    assert!((0.0..1.0).contains(&angle()));
    motor.set_load(20.0);
    let _ = angle();
    motor.set_load(0.0);
    let turns = angle();
    assert!(turns > 1.0, "{turns}");
    motor.set_power(false);
    motor.set_power(true);
    assert!((0.0..1.0).contains(&angle()));
}
