use rc10_app::Rpm;
use rc10_motor::unitree::{GoM8010, LineConfig, Rs485Bus, Step};
use rc10_motor::{
    ArmSwitch, AttachError, Clash, Link, MotorId, MotorName, SafeState, Safety, Target,
};
use rc10_sim::unitree_line::{Answer, GoM8010 as Device};
use rc10_sim::{Esc, Nanos};
use rc10_time::Micros;

use super::bench::{Bench, motors, nth};

/// Eight motors at a speed for a second, number 3 of them silent or not.
fn eight(silent: bool) -> (Bench<'static>, Vec<MotorId>, Vec<Esc>) {
    let (mut bench, ids, devices) = Bench::of(8, Safety::COAST);
    devices[3].set_power(!silent);
    bench.wait(150);
    bench.bus.switch().arm().unwrap();
    bench.hold_all(&ids, Target::Speed(Rpm::new(60.0)), 1000);
    (bench, ids, devices)
}

/// Mean and longest time in µs from one question to the next.
fn cycle(asked: &[Micros], from: Micros) -> (f64, u64) {
    let asked: Vec<_> = asked.iter().filter(|at| **at >= from).collect();
    let gaps: Vec<_> = asked.windows(2).map(|pair| pair[1].since(*pair[0]).get()).collect();
    let longest = *gaps.iter().max().unwrap();
    #[expect(clippy::cast_precision_loss, reason = "small")]
    let mean = gaps.iter().sum::<u64>() as f64 / gaps.len() as f64;
    (mean, longest)
}

#[test]
fn eight_motors_are_asked_every_millisecond() {
    let (bench, ids, devices) = eight(false);
    for (id, device) in ids.iter().zip(&devices) {
        let (mean, longest) = cycle(&bench.asked[id.index()], Micros::from_millis(200));
        assert!((mean - 1000.0).abs() < 1.0 && longest <= 1002, "{id:?} {mean} {longest}");
        assert!((device.state().output_rpm - 60.0).abs() < 0.5);
    }
    let counters = bench.bus.counters();
    assert_eq!((counters.timeouts, counters.garbage, counters.unexpected), (0, 0, 0));
    // 33 bytes of 2.5 µs, and the device's 20 µs.
    assert_eq!((counters.exchange.min(), counters.exchange.max()), (Some(102), Some(103)));
    let cycle = counters.cycle;
    assert!((cycle.mean().unwrap() - 1000.0).abs() < 5.0 && cycle.max() < Some(1100), "{cycle:?}");
}

#[test]
fn a_listener_counts_what_it_overhears() {
    let switch = ArmSwitch::new();
    let mut ours = motors(3);
    let mut listener = Rs485Bus::new(&switch);
    let ids: Vec<_> =
        ours.iter_mut().map(|motor| listener.attach(motor, Safety::COAST).unwrap()).collect();
    let command = |id| GoM8010::new(LineConfig::new(id)).unwrap().pack_command();
    let answer = |id| Answer { id, angle: 1.0, ..Answer::default() }.write();
    for round in 0..3 {
        let at = |micros: u64| Micros::new(round * 1000 + micros);
        listener.overhear(&command(0), at(0));
        listener.on_bytes(&answer(0), at(110));
        // A motor that does not answer, and one of another bus.
        listener.overhear(&command(1), at(200));
        listener.overhear(&command(14), at(400));
        listener.on_bytes(&answer(14), at(510));
    }
    // A damaged command is for no motor.
    let mut damaged = command(0);
    damaged[5] ^= 1;
    listener.overhear(&damaged, Micros::from_millis(3));
    listener.on_bytes(&answer(0), Micros::new(3_100));
    let counters = listener.counters();
    assert_eq!((counters.exchanges, counters.timeouts, counters.unexpected), (3, 3, 4));
    assert_eq!((counters.exchange.min(), counters.exchange.max()), (Some(110), Some(110)));
    assert_eq!((counters.cycle.min(), counters.cycle.max()), (Some(1000), Some(1000)));
    let link =
        |millis, id: usize| listener.status(ids[id], Micros::from_millis(millis)).unwrap().link;
    assert_eq!((link(3, 0), link(3, 1), link(30, 0)), (Link::Online, Link::NeverSeen, Link::Lost));
}

#[test]
fn one_silent_motor_of_eight_costs_the_others_one_time_out_in_a_hundred_milliseconds() {
    let (mut bench, ids, devices) = eight(true);
    let from = Micros::from_millis(200);
    for id in ids.iter().filter(|id| id.index() != 3) {
        let (mean, longest) = cycle(&bench.asked[id.index()], from);
        assert!(mean < 1012.0, "{id:?}: {mean} us on average");
        assert!(longest <= 2050, "{id:?}: {longest} us at most");
        assert_eq!(bench.status(*id).link, Link::Online);
        assert_eq!(bench.status(*id).counters.lost, 0);
        assert!((devices[id.index()].state().output_rpm - 60.0).abs() < 0.5);
    }
    assert_eq!(bench.status(ids[3]).link, Link::NeverSeen);
    let (mean, _) = cycle(&bench.asked[3], from);
    assert!((100_000.0..101_000.0).contains(&mean), "{mean}");
    let before = bench.bus.counters().timeouts;
    bench.hold_all(&ids, Target::Speed(Rpm::new(60.0)), 1000);
    assert_eq!(bench.bus.counters().timeouts - before, 10);

    // It comes back, softly, and without a kick; the others do not notice.
    devices[3].set_power(true);
    let mut last = devices[3].state().current;
    let mut heard_after = None;
    for millis in 0..200 {
        bench.hold_all(&ids, Target::Speed(Rpm::new(60.0)), 1);
        let current = devices[3].state().current;
        // 10 % of full scale, 2.37 N m, each millisecond at most.
        assert!((current - last).abs() < 2.37 / 0.638_95 + 0.1, "{millis}: {last} to {current}");
        last = current;
        if heard_after.is_none() && bench.status(ids[3]).link == Link::Online {
            heard_after = Some(millis);
        }
    }
    assert!(heard_after.unwrap() <= 102, "{heard_after:?}");
    bench.hold_all(&ids, Target::Speed(Rpm::new(60.0)), 200);
    assert!((devices[3].state().output_rpm - 60.0).abs() < 0.5);
    let (mean, longest) = cycle(&bench.asked[3], bench.world.now() - Micros::from_millis(100));
    assert!((mean - 1000.0).abs() < 1.0 && longest <= 1002, "{mean} {longest}");
}

#[test]
fn fourteen_that_fall_silent_at_once_do_not_cost_the_fifteenth_its_link() {
    let (mut bench, ids, devices) = Bench::of(15, Safety::COAST);
    bench.wait(50);
    bench.bus.switch().arm().unwrap();
    let speed = Target::Speed(Rpm::new(30.0));
    bench.hold_all(&ids, speed, 500);
    for id in &ids {
        // More than a tick has room for: 15 times 103 µs and what a poll takes.
        let (mean, longest) = cycle(&bench.asked[id.index()], Micros::from_millis(100));
        assert!(mean < 1700.0 && longest <= 2600, "{id:?} {mean} {longest}");
        assert_eq!(bench.status(*id).link, Link::Online);
    }
    devices.iter().filter(|device| !std::ptr::eq(*device, &devices[7])).for_each(|device| {
        device.set_cut(true);
    });
    bench.hold_all(&ids, speed, 1000);
    for id in &ids {
        let expected = if id.index() == 7 { Link::Online } else { Link::Lost };
        assert_eq!(bench.status(*id).link, expected, "{id:?}");
    }
    assert_eq!(bench.status(ids[7]).counters.lost, 0);
    assert!((devices[7].state().output_rpm - 30.0).abs() < 0.5);
    let (mean, longest) = cycle(&bench.asked[7], bench.world.now() - Micros::from_millis(500));
    // 14 time-outs in 100 ms, each followed by a question to it.
    assert!(mean < 1250.0 && longest <= 2100, "{mean} {longest}");
}

#[test]
fn garbage_and_wrong_bits_are_counted_and_never_taken() {
    let (mut bench, ids, devices) = Bench::of(2, Safety::COAST);
    bench.wait(50);
    bench.bus.switch().arm().unwrap();
    let speed = Target::Speed(Rpm::new(60.0));
    bench.hold_all(&ids, speed, 500);
    let before = bench.bus.counters();
    assert_eq!((before.timeouts, before.crc_errors, before.garbage), (0, 0, 0));

    // Twenty commands that the device refuses, twenty answers that we do: a time-out each.
    for _ in 0..20 {
        bench.wire.damage_commands(1);
        bench.hold_all(&ids, speed, 2);
        bench.wire.damage_answers(1);
        bench.hold_all(&ids, speed, 2);
    }
    let counters = bench.bus.counters();
    let malformed: u64 = devices.iter().map(|device| device.state().malformed).sum();
    assert_eq!((malformed, counters.crc_errors, counters.garbage), (20, 20, 20 * 16));
    assert_eq!((counters.timeouts, counters.unexpected), (40, 0));

    // Somebody talks into it, and begins like an answer.
    for _ in 0..40 {
        bench.wire.inject(&[0xFD, 0xEE, 0x10, 0x00, 0xFE, 0xEE, 0x01]);
        bench.hold_all(&ids, speed, 2);
    }
    assert!(bench.wire.counters().collided > 100);
    let counters = bench.bus.counters();
    assert!(counters.garbage >= 40 * 7 && counters.timeouts > 60, "{counters:?}");
    assert_eq!(counters.unexpected, 0);
    for (id, device) in ids.iter().zip(&devices) {
        let status = bench.status(*id);
        assert_eq!((status.link, status.counters.lost, status.fault), (Link::Online, 0, None));
        assert!((device.state().output_rpm - 60.0).abs() < 0.7, "{:?}", device.state());
    }
}

#[test]
fn a_line_with_nothing_to_poll_is_looked_at_again_within_a_millisecond() {
    let switch = ArmSwitch::new();
    let mut motor = GoM8010::new(LineConfig::new(0)).unwrap();
    let mut line = Rs485Bus::new(&switch);
    let again = |now| Step::Wait(now + Micros::from_millis(1));
    assert_eq!(line.poll(Micros::ZERO), again(Micros::ZERO));
    line.attach(&mut motor, Safety::COAST).unwrap();
    // It does not answer, and is polled seldom.
    let mut polled = Vec::new();
    for now in (0..250).map(Micros::from_millis) {
        match line.poll(now) {
            Step::Send(_) => polled.push(now.get() / 1000),
            step => assert_eq!(step, again(now)),
        }
    }
    assert_eq!(polled, [0, 100, 200]);
}

#[test]
fn an_answer_that_was_not_asked_for_is_not_taken() {
    let switch = ArmSwitch::new();
    let mut ours = motors(2);
    let mut line = Rs485Bus::new(&switch);
    for motor in &mut ours {
        line.attach(motor, Safety::COAST).unwrap();
    }
    let now = Micros::from_millis(1);
    let answer = |id| Answer { id, status: 1, ..Answer::default() }.write();
    // No device was asked.
    line.on_bytes(&answer(0), now);
    assert_eq!((line.counters().unexpected, line.counters().exchanges), (1, 0));
    // Motor 0 is asked, another answers; then motor 0, in two portions, with garbage before it.
    let Step::Send(bytes) = line.poll(now) else { panic!("a question") };
    assert_eq!(bytes[2], 0x00);
    line.on_bytes(&answer(1), now);
    assert_eq!((line.counters().unexpected, line.counters().exchanges), (2, 0));
    assert_eq!(line.status(nth(1), now).unwrap().link, Link::NeverSeen);
    line.on_bytes(&[0xFD, 0x00, 0xFD], now);
    line.on_bytes(&answer(0)[..9], now);
    line.on_bytes(&answer(0)[9..], now);
    assert_eq!((line.counters().unexpected, line.counters().exchanges), (2, 1));
    assert_eq!(line.status(nth(0), now).unwrap().link, Link::Online);
    // The same again comes too late: its question has been answered.
    line.on_bytes(&answer(0), now);
    assert_eq!((line.counters().unexpected, line.counters().exchanges), (3, 1));
    // What was received before a question is no part of its answer.
    line.on_bytes(&answer(1)[..9], now);
    // Motor 1 is asked and takes too long: what comes then is not its turn any more.
    let Step::Send(bytes) = line.poll(now) else { panic!("a question") };
    assert_eq!(bytes[2], 0x01);
    line.on_bytes(&answer(1)[9..], now);
    assert_eq!((line.counters().unexpected, line.counters().exchanges), (3, 1));
    let late = now + Micros::from_millis(1);
    let _ = line.poll(late);
    line.on_bytes(&answer(1), late + Micros::new(10));
    assert_eq!(line.counters().timeouts, 1);
    assert_eq!((line.counters().unexpected, line.counters().exchanges), (4, 1));
    assert_eq!(line.status(nth(1), late).unwrap().link, Link::NeverSeen);
}

#[test]
fn slow_devices_are_waited_for_up_to_the_time_out() {
    for (turnaround, answers) in [(880, true), (950, false)] {
        let (mut bench, ids, devices) = Bench::of(1, Safety::COAST);
        let think = Nanos::new(turnaround * 1000);
        devices[0].with(|device: &mut Device| device.think = think).unwrap();
        bench.wait(500);
        let online = bench.status(ids[0]).link == Link::Online;
        assert_eq!(online, answers, "{turnaround} us");
        assert_eq!(bench.bus.counters().timeouts > 0, !answers);
    }
    let switch = ArmSwitch::new();
    let line = |micros| Rs485Bus::new(&switch).with_reply_timeout(Micros::new(micros));
    assert!(line(100).is_ok() && line(1000).is_ok());
    assert_eq!(line(99).err().unwrap().field, "reply_timeout");
    assert_eq!(line(1001).err().unwrap().must_be, "100 to 1000 us");
}

#[test]
fn what_cannot_be_attached_is_refused_by_name() {
    let switch = ArmSwitch::new();
    let mut ours = motors(15);
    let mut twin = GoM8010::new(LineConfig::new(4)).unwrap();
    let mut hasty = GoM8010::new(LineConfig::new(5)).unwrap();
    let mut line = Rs485Bus::new(&switch);
    let expiry = Safety { command_expiry: Micros::ZERO, ..Safety::new(SafeState::Hold) };
    let name = |id| MotorName { model: "GO-M8010-6", id };
    let error = line.attach(&mut hasty, expiry).unwrap_err();
    assert_eq!(error, AttachError::Expiry { motor: name(5), asked: Micros::ZERO });
    for (index, motor) in ours.iter_mut().enumerate() {
        assert_eq!(line.attach(motor, Safety::COAST).unwrap().index(), index);
    }
    let error = line.attach(&mut twin, Safety::COAST).unwrap_err();
    let AttachError::Clash { motor, with, slot, clash } = error else { panic!("{error}") };
    assert_eq!((motor, with, slot.index(), clash), (name(4), name(4), 4, Clash::Address(4)));
    let text = "GO-M8010-6 id 4 cannot share a bus with GO-M8010-6 id 4: both have address 4; \
                set another on one, or plug it in elsewhere";
    assert_eq!(error.to_string(), text);
    assert_eq!(line.motors().count(), 15);
    let text = GoM8010::new(LineConfig::new(15)).unwrap_err().to_string();
    assert_eq!(text, "GO-M8010-6 id 15: `id` is 15, but must be 0 to 14 (15 is every motor)");
}
