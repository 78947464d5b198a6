//! The port on the simulated wire: order, replacement, what is lost, bus-off.
#![cfg(test)]

mod simulated;

use std::collections::BTreeMap;

use rc10_can::embedded_can::StandardId;
use rc10_can::{BusOffPolicy, CanFrame, CanPort, ErrorState, IdPattern, Submitted};
use rc10_motor::dji::{Config, Dji, M3508};
use rc10_motor::embassy::{BusPort, Runner};
use rc10_motor::{ArmState, ArmSwitch, MotorBus, Safety};
use rc10_stm32_can::{RECEIVE_QUEUE, TRANSMIT_QUEUE};
use rc10_time::Micros;

use simulated::{Bench, KINDS, Kind};

/// A frame of eight bytes with a number in it.
fn frame(id: u16, number: u64) -> CanFrame {
    CanFrame::eight_bytes(StandardId::new(id).unwrap(), number.to_be_bytes())
}

/// The number in a frame.
fn number(frame: &CanFrame) -> u64 {
    u64::from_be_bytes(*frame.all_eight().unwrap())
}

fn ids(bench: &Bench) -> Vec<u32> {
    bench.sent().iter().map(|entry| entry.frame.raw_id()).collect()
}

/// On each controller.
fn on_both(test: impl Fn(Kind, Bench)) {
    for kind in KINDS {
        println!("{kind:?}");
        test(kind, Bench::new(kind));
    }
}

#[test]
fn the_most_urgent_frame_leaves_first() {
    on_both(|_, mut bench| {
        for id in [0x307, 0x305, 0x306, 0x302, 0x304, 0x301, 0x303] {
            assert_eq!(bench.port.submit(&frame(id, 0)), Submitted::Queued);
        }
        // As the third is on the wire, one comes that is more urgent than the rest.
        bench.pass(2 * 130 + 60);
        assert_eq!(bench.port.submit(&frame(0x300, 0)), Submitted::Queued);
        bench.pass(2_000);
        let order = [0x301, 0x302, 0x303, 0x300, 0x304, 0x305, 0x306, 0x307];
        assert_eq!(ids(&bench), order);
        assert_eq!(bench.port.health().transmit_lost, 0);
    });
}

#[test]
fn the_mailboxes_hold_the_most_urgent_frames_for_a_handler_that_is_late() {
    on_both(|_, mut bench| {
        bench.set_latency(Some(400_000));
        for id in [0x301, 0x310, 0x320] {
            let _ = bench.port.submit(&frame(id, 0));
        }
        bench.pass(50);
        // One is on the wire, one makes room.
        let _ = bench.port.submit(&frame(0x305, 0));
        bench.pass(450);
        assert_eq!(ids(&bench), [0x301, 0x305, 0x310]);
        bench.pass(500);
        assert_eq!(ids(&bench), [0x320]);
        // All three are filled each time.
        for id in 0x300..0x30C {
            let _ = bench.port.submit(&frame(id, 0));
        }
        bench.pass(3_000);
        assert_eq!(ids(&bench), (0x300..0x30C).collect::<Vec<_>>());
    });
}

#[test]
fn a_stream_of_changing_identifiers_keeps_its_order_under_noise() {
    on_both(|_, mut bench| {
        // The handler comes so late that frames wait in mailboxes that are free.
        let latencies = [Some(0), Some(2_000), Some(150_000), Some(700_000), None];
        for (latency, abort) in
            latencies.into_iter().flat_map(|latency| [(latency, 0), (latency, 300)])
        {
            bench.set_latency(latency);
            bench.set_abort_time(abort);
            let mut chance = 12_345_u64;
            let mut next = || {
                chance = chance.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                chance >> 33
            };
            let mut newest = BTreeMap::new();
            let mut sent: BTreeMap<u64, u64> = BTreeMap::new();
            let mut check = |bench: &Bench| {
                for entry in bench.sent() {
                    let number = number(&entry.frame);
                    let (stream, count) = (number >> 32, number & u64::from(u32::MAX));
                    let before = sent.insert(stream, count);
                    assert!(before < Some(count), "{before:?} {count}: {entry:?}");
                }
                sent.clone()
            };
            for count in 0..2_000 {
                let stream = next() % 8;
                let id = u16::try_from(0x300 + next() % 16).unwrap();
                let frame = frame(id, stream << 32 | count);
                let submitted = bench.port.submit_as(&frame, u32::try_from(stream).unwrap());
                assert_ne!(submitted, Submitted::Refused);
                newest.insert(stream, count);
                bench.bus.damage(u32::from(next() % 16 == 0));
                bench.pass(next() % 100);
                check(&bench);
            }
            bench.bus.damage(0);
            for _ in 0..10 {
                bench.pass(1_000);
                while bench.port.receive().is_some() {}
            }
            assert_eq!(check(&bench), newest, "{latency:?}");
            assert_eq!(bench.port.health().transmit_lost, 0);
        }
    });
}

#[test]
fn nothing_stale_leaves_after_an_outage() {
    on_both(|_, mut bench| {
        const STREAMS: u16 = 6;
        let mut tick = 0;
        let mut millisecond = |bench: &mut Bench| {
            tick += 1;
            for id in 0..STREAMS {
                assert_ne!(bench.port.submit(&frame(0x300 + id, tick)), Submitted::Refused);
            }
            bench.pass(1_000);
            while bench.port.receive().is_some() {}
            tick
        };
        for _ in 0..5 {
            millisecond(&mut bench);
        }
        assert_eq!(bench.sent().len(), 5 * usize::from(STREAMS));
        bench.bus.set_cut(true);
        for _ in 0..100 {
            millisecond(&mut bench);
        }
        assert_eq!(bench.sent(), []);
        assert!(bench.port.health().is_alone(), "{}", bench.port.health());
        // In the middle between two ticks it is whole again: each stream's newest frame, once.
        bench.pass(500);
        bench.bus.set_cut(false);
        bench.pass(20_000);
        let sent = bench.sent();
        let numbers: Vec<_> =
            sent.iter().map(|entry| (entry.frame.raw_id(), number(&entry.frame))).collect();
        let newest: Vec<_> = (0..STREAMS).map(|id| (u32::from(0x300 + id), 105)).collect();
        assert_eq!(numbers, newest);
    });
}

#[test]
fn a_frame_on_the_wire_is_not_replaced_and_that_is_counted() {
    on_both(|_, mut bench| {
        assert_eq!(bench.port.submit(&frame(0x300, 1)), Submitted::Queued);
        assert_eq!(bench.port.submit(&frame(0x301, 1)), Submitted::Queued);
        bench.pass(50);
        assert_eq!(bench.port.submit(&frame(0x300, 2)), Submitted::Queued);
        assert_eq!(bench.port.submit(&frame(0x301, 2)), Submitted::Replaced);
        // It waits for the wire now, so it can be.
        assert_eq!(bench.port.submit(&frame(0x300, 3)), Submitted::Replaced);
        bench.pass(1_000);
        let sent: Vec<_> = bench.sent().iter().map(|entry| entry.frame).collect();
        assert_eq!(sent, [frame(0x300, 1), frame(0x300, 3), frame(0x301, 2)]);
        assert_eq!((bench.port.unreplaced(), bench.port.health().transmit_lost), (1, 0));
    });
}

#[test]
fn an_abort_that_was_lost_is_requested_again() {
    on_both(|_, mut bench| {
        let _ = bench.port.submit(&frame(0x300, 1));
        let _ = bench.port.submit(&frame(0x301, 1));
        bench.pass(50);
        // 0x300 is on the wire, 0x301 waits for it.
        bench.lose_aborts(1);
        assert_eq!(bench.port.submit(&frame(0x301, 2)), Submitted::Queued);
        assert_eq!(bench.port.receive(), None);
        bench.pass(1_000);
        let sent: Vec<_> = bench.sent().iter().map(|entry| entry.frame).collect();
        assert_eq!(sent, [frame(0x300, 1), frame(0x301, 2)]);
        assert_eq!(bench.port.unreplaced(), 0);
    });
}

/// An older frame whose abort is not carried out sits in a higher mailbox than the next free one.
#[test]
fn an_older_frame_never_leaves_after_a_newer_one() {
    on_both(|_, mut bench| {
        // By its stream with another identifier, and by its identifier with another stream.
        for (newer_id, stream) in [(0x300, 1), (0x2FF, 1), (0x300, 2)] {
            for id in [0x2F0, 0x2F1] {
                let _ = bench.port.submit(&frame(id, 0));
            }
            let _ = bench.port.submit_as(&frame(0x300, 1), 1);
            // 0x2F1 is on the wire, the first mailbox free.
            bench.pass(200);
            bench.lose_aborts(u32::MAX);
            let _ = bench.port.submit_as(&frame(newer_id, 2), stream);
            bench.pass(1_000);
            let sent: Vec<_> = bench.sent().iter().map(|entry| entry.frame).collect();
            let last = [frame(0x300, 1), frame(newer_id, 2)];
            assert_eq!(sent, [[frame(0x2F0, 0), frame(0x2F1, 0)], last].concat());
            bench.lose_aborts(0);
        }
    });
}

#[test]
fn a_frame_that_fails_on_the_wire_is_replaced_after_all() {
    on_both(|_, mut bench| {
        let _ = bench.port.submit(&frame(0x300, 1));
        bench.pass(50);
        bench.bus.damage(1);
        assert_eq!(bench.port.submit(&frame(0x300, 2)), Submitted::Queued);
        bench.pass(1_000);
        let sent: Vec<_> = bench.sent().iter().map(|entry| entry.frame).collect();
        assert_eq!(sent, [frame(0x300, 2)]);
        assert_eq!(bench.port.unreplaced(), 0);
    });
}

#[test]
fn a_full_bus_loses_nothing_between_two_ticks() {
    on_both(|_, mut bench| {
        for count in 0..400 {
            bench.bus.inject(&frame(0x100, count));
        }
        let mut expected = 0;
        for _ in 0..60 {
            bench.pass(1_000);
            while let Some((received, at)) = bench.port.receive() {
                assert!(bench.world.now().since(at) < Micros::from_millis(1));
                if received.raw_id() == 0x100 {
                    assert_eq!(number(&received), expected);
                    expected += 1;
                }
            }
        }
        assert_eq!((expected, bench.port.health().receive_lost), (400, 0));
    });
}

#[test]
fn frames_that_the_hardware_had_no_room_for_are_counted() {
    on_both(|kind, mut bench| {
        // Interrupts are masked: a full FIFO keeps three of the five.
        bench.set_latency(None);
        for count in 0..5 {
            bench.bus.inject(&frame(0x100, count));
        }
        bench.port.accept(&[IdPattern::standard(0x100)]);
        bench.pass(900);
        let received: Vec<_> =
            std::iter::from_fn(|| bench.port.receive()).map(|(frame, _)| number(&frame)).collect();
        // bxCAN overwrites the last one, FDCAN refuses the new one.
        assert_eq!(received, if kind == Kind::BxCan { [0, 1, 4] } else { [0, 1, 2] });
        // It does not say how many.
        assert_eq!(bench.port.health().receive_lost, 1);
    });
}

#[test]
fn frames_that_no_task_takes_are_counted() {
    on_both(|_, mut bench| {
        bench.port.accept(&[IdPattern::standard(0x100)]);
        for count in 0..100 {
            bench.bus.inject(&frame(0x100, count));
        }
        bench.pass(20_000);
        let received: Vec<_> =
            std::iter::from_fn(|| bench.port.receive()).map(|(frame, _)| number(&frame)).collect();
        assert_eq!(received, (0..RECEIVE_QUEUE as u64).collect::<Vec<_>>());
        assert_eq!(u64::from(bench.port.health().receive_lost), 100 - RECEIVE_QUEUE as u64);
    });
}

#[test]
fn a_stream_too_many_is_refused_and_a_newer_frame_of_one_that_waits_is_not() {
    on_both(|_, mut bench| {
        bench.bus.set_cut(true);
        for id in 0..TRANSMIT_QUEUE {
            let id = u16::try_from(0x300 + id).unwrap();
            assert_eq!(bench.port.submit(&frame(id, 0)), Submitted::Queued);
        }
        assert_eq!(bench.port.submit(&frame(0x100, 0)), Submitted::Refused);
        for id in 0..TRANSMIT_QUEUE {
            let id = u16::try_from(0x300 + id).unwrap();
            assert_eq!(bench.port.submit(&frame(id, 1)), Submitted::Replaced, "{id:#x}");
        }
        bench.bus.set_cut(false);
        bench.pass(10_000);
        let sent = bench.sent();
        assert_eq!(sent.len(), TRANSMIT_QUEUE);
        assert!(sent.iter().all(|entry| number(&entry.frame) == 1));
    });
}

#[test]
fn a_full_queue_makes_room_for_urgent_frames_without_a_loss() {
    on_both(|_, mut bench| {
        // Each more urgent than the one before, so each takes a mailbox.
        for id in (0..TRANSMIT_QUEUE).rev() {
            let id = u16::try_from(0x300 + id).unwrap();
            assert_eq!(bench.port.submit(&frame(id, 0)), Submitted::Queued);
        }
        bench.pass(10_000);
        let sent = ids(&bench);
        assert_eq!(sent.len(), TRANSMIT_QUEUE);
        assert!(sent.is_sorted(), "{sent:x?}");
        assert_eq!(bench.port.health().transmit_lost, 0);
    });
}

#[test]
fn what_is_taken_back_does_not_leave() {
    on_both(|_, mut bench| {
        for id in 0x300..0x306 {
            let _ = bench.port.submit(&frame(id, 0));
        }
        bench.pass(50);
        // One is on the wire.
        assert_eq!(bench.port.cancel_pending(), 5);
        bench.pass(2_000);
        assert_eq!(ids(&bench), [0x300]);

        bench.bus.set_cut(true);
        for id in 0x300..0x306 {
            let _ = bench.port.submit(&frame(id, 0));
        }
        bench.pass(50);
        assert_eq!(bench.port.cancel_pending(), 5);
        bench.bus.set_cut(false);
        bench.pass(2_000);
        // The one on the wire broke off, and is not repeated.
        assert_eq!(ids(&bench), []);
    });
}

#[test]
fn after_bus_off_nothing_leaves_until_it_is_asked_back_and_then_nothing_old() {
    on_both(|_, mut bench| {
        for id in 0x300..0x308 {
            let _ = bench.port.submit(&frame(id, 1));
        }
        bench.bus.set_shorted(true);
        bench.pass(2_000);
        assert_eq!(bench.port.receive(), None);
        let health = bench.port.health();
        assert_eq!((health.state, health.bus_offs), (ErrorState::BusOff, 1));
        assert_eq!((health.transmit_lost, bench.port.cancel_pending()), (8, 0));
        assert_eq!(bench.port.submit(&frame(0x300, 2)), Submitted::Refused);

        bench.bus.set_shorted(false);
        bench.pass(50_000);
        while bench.port.receive().is_some() {}
        assert_eq!(bench.port.health().state, ErrorState::BusOff);

        bench.port.recover();
        assert_eq!(bench.port.submit(&frame(0x300, 3)), Submitted::Queued);
        // 128 times 11 bits, of which the end of a frame has one: the C620 is not acknowledged, so it
        // repeats its frame all the time.
        bench.pass(10_000);
        assert_eq!((bench.port.health().state, bench.sent()), (ErrorState::BusOff, vec![]));
        bench.pass(10_000);
        let sent: Vec<_> = bench.sent().iter().map(|entry| entry.frame).collect();
        assert_eq!(sent, [frame(0x300, 3)]);
        let health = bench.port.health();
        assert_eq!((health.state, health.bus_offs), (ErrorState::Active, 1));
    });
}

#[test]
fn a_way_back_that_cannot_begin_at_once_begins_later() {
    on_both(|_, mut bench| {
        let _ = bench.port.submit(&frame(0x300, 1));
        bench.bus.set_shorted(true);
        bench.pass(5_000);
        assert_eq!(bench.port.receive(), None);
        bench.bus.set_shorted(false);
        bench.delay_restarts(2);
        bench.port.recover();
        assert_eq!(bench.port.submit(&frame(0x300, 2)), Submitted::Refused);
        // It is not asked for a second time.
        assert_eq!(bench.port.receive(), None);
        assert_eq!(bench.port.submit(&frame(0x300, 3)), Submitted::Refused);
        assert_eq!(bench.port.receive(), None);
        assert_eq!(bench.port.submit(&frame(0x300, 4)), Submitted::Queued);
        bench.pass(20_000);
        let sent: Vec<_> = bench.sent().iter().map(|entry| entry.frame).collect();
        assert_eq!(sent, [frame(0x300, 4)]);
        let health = bench.port.health();
        assert_eq!((health.state, health.bus_offs), (ErrorState::Active, 1));
    });
}

#[test]
fn a_bus_that_goes_off_again_as_soon_as_it_is_back_is_seen_each_time() {
    on_both(|_, mut bench| {
        bench.bus.set_shorted(true);
        for attempt in 1..=5 {
            assert_ne!(bench.port.submit(&frame(0x300, 1)), Submitted::Refused);
            // Long enough for the way back and the next fall.
            bench.pass(5_000);
            assert_eq!(bench.port.receive(), None);
            assert_eq!(bench.port.health().bus_offs, attempt);
            bench.port.recover();
        }
    });
}

#[test]
fn each_policy_for_bus_off_is_kept() {
    use ArmState::{Armed, EStopped};
    for (policy, back, arm) in [
        (BusOffPolicy::Automatic, true, Armed),
        (BusOffPolicy::Manual, false, Armed),
        (BusOffPolicy::Latched, true, EStopped),
    ] {
        on_both(|_, bench| {
            let (mut bench, port) = bench.give_port();
            let switch = ArmSwitch::new();
            let mut wheel = Dji::new(Config::new(&M3508, 1)).unwrap();
            let mut bus = MotorBus::new(&switch);
            bus.attach(&mut wheel, Safety::COAST).unwrap();
            let shared = BusPort::new();
            let start = bench.world.now();
            let mut runner = Runner::new(port, bus, &shared, start).with_bus_off(policy);
            let mut millis = |bench: &mut Bench<()>, millis: u64| {
                let end = bench.world.now() + Micros::from_millis(millis);
                while runner.next() <= end {
                    bench.world.advance(runner.next());
                    runner.tick(rc10_sim::now);
                }
                bench.world.advance(end);
            };
            switch.arm().unwrap();
            millis(&mut bench, 100);
            assert!(bench.sent().len() >= 98);
            bench.bus.set_shorted(true);
            millis(&mut bench, 100);
            bench.bus.set_shorted(false);
            assert_eq!(bench.sent(), []);
            millis(&mut bench, 200);
            let health = shared.status().health;
            assert_eq!(health.state == ErrorState::Active, back, "{policy:?}: {health}");
            assert_eq!(switch.state(), arm, "{policy:?}");
            assert_eq!(bench.sent().len() > 100, back, "{policy:?}");
            if policy == BusOffPolicy::Manual {
                assert_eq!(health.bus_offs, 1);
                shared.recover();
                millis(&mut bench, 60);
                assert_eq!(shared.status().health.state, ErrorState::Active);
                assert!(bench.sent().len() > 40);
            }
        });
    }
}

/// The property that the examples' panic handlers count on: they only restart the chip.
#[test]
fn a_robot_that_starts_sends_zeros_from_its_first_millisecond_on() {
    on_both(|_, bench| {
        let (mut bench, port) = bench.give_port();
        let switch = ArmSwitch::new();
        let mut wheel = Dji::new(Config::new(&M3508, 1)).unwrap();
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut wheel, Safety::COAST).unwrap();
        let shared = BusPort::new();
        let mut runner = Runner::new(port, bus, &shared, bench.world.now());
        while runner.next() <= Micros::from_millis(10) {
            bench.world.advance(runner.next());
            runner.tick(rc10_sim::now);
        }
        bench.pass(500);
        let sent = bench.sent();
        assert_eq!(sent.len(), 10);
        assert!(sent[0].end.micros() < Micros::from_millis(2));
        assert!(sent.iter().all(|entry| entry.frame == frame(0x200, 0)), "{sent:?}");
    });
}
