//! The port of a bus: commands, requests, the outbox, subscriptions, statistics.

mod requests;

use std::cell::{Cell, RefCell};
use std::num::NonZeroU8;
use std::pin::Pin;

use crate::common::{motor, twin};
use embassy_time::Timer;
use rc10_app::{Amps, Degrees, Gear, Rpm};
use rc10_can::embedded_can::{ExtendedId, Id, StandardId};
use rc10_can::{CanFrame, IdPattern};
use rc10_motor::dji::{self, Dji};
use rc10_motor::embassy::{BusPort, Filter, OutboxError, Runner, run_bus, run_buses};
use rc10_motor::vesc::{self, Vesc};
use rc10_motor::{
    ArmSwitch, Link, MotorBus, MotorId, Place, Request, RequestError, Response, Safety, Target,
    TargetError, TargetKind, Withheld, numbers,
};
use rc10_sim::{BusConfig, Tasks, World};
use rc10_time::Micros;

/// The number of a motor on its bus, as `attach` counts.
fn nth(index: usize) -> MotorId {
    numbers([Place::Bus(1); 16]).nth(index).unwrap()
}

fn frame(id: u16, data: &[u8]) -> CanFrame {
    CanFrame::data_frame(StandardId::new(id).unwrap(), data).unwrap()
}

/// An M3508 (id 1) on a simulated bus with its runner; `task` is the task of a user.
fn with_wheel<F>(
    millis: u64,
    task: impl FnOnce(&'static BusPort, &'static ArmSwitch, rc10_sim::Bus) -> F,
) where
    F: Future<Output = ()> + 'static,
{
    let mut world = World::new(9);
    let wire = world.add_bus(BusConfig::default());
    let _esc = wire.add_esc(twin(&dji::M3508, 1)).unwrap();
    // A test ends soon enough.
    let wheel: &'static mut Dji = Box::leak(Box::new(motor(&dji::M3508, 1)));
    let switch: &'static ArmSwitch = Box::leak(Box::default());
    let shared: &'static BusPort = Box::leak(Box::default());
    let mut bus = MotorBus::new(switch);
    bus.attach(wheel, Safety::COAST).unwrap();
    let mut tasks = Tasks::new();
    tasks.add(run_bus(wire.port(), bus, shared));
    let ended = std::rc::Rc::new(Cell::new(false));
    let task = task(shared, switch, wire);
    let tell = std::rc::Rc::clone(&ended);
    tasks.add(async move {
        task.await;
        tell.set(true);
    });
    let _ = world.run(Pin::new(&mut tasks), Micros::from_millis(millis));
    assert!(ended.get(), "the task did not end in time");
}

#[test]
fn a_port_refuses_what_the_motor_cannot_do_where_it_is_asked() {
    let closed = BusPort::new();
    let coast = closed.motor(nth(0)).command(Target::Coast);
    assert_eq!(coast, Err(TargetError::Unsupported(TargetKind::Coast)));
    with_wheel(100, async |shared, _, _| {
        let port = shared.motor(nth(0));
        assert_eq!(port.command(Target::Speed(Rpm::new(10.0))), Ok(()));
        let duty = port.command(Target::Duty(0.5));
        assert_eq!(duty, Err(TargetError::Unsupported(TargetKind::Duty)));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let current = port.command(Target::Current(Amps::new(bad)));
            assert_eq!(current, Err(TargetError::NotFinite(TargetKind::Current)));
            let angle = port.command(Target::Angle(Degrees::new(bad)));
            assert_eq!(angle, Err(TargetError::NotFinite(TargetKind::Angle)));
        }
        // A refused target does not disturb the one before.
        Timer::after_millis(5).await;
        assert_eq!(port.status().target, Target::Speed(Rpm::new(10.0)));
        // Counted by reason, also what came no further than the port.
        let refused = port.status().counters.refused;
        assert_eq!((refused.unsupported, refused.not_finite, refused.out_of_range), (1, 6, 0));
        assert_eq!(refused.to_string(), "1 of a kind it does not take, 6 not finite");
        let missing = shared.motor(nth(3));
        assert!(missing.command(Target::Coast).is_err());
        assert_eq!(missing.request(Request::SetZero).await, Err(RequestError::NoSuchMotor));
    });
}

const HALF: Withheld = Withheld { driving: 0.5, braking: 0.0 };

#[test]
fn a_share_of_the_effort_is_withheld_from_one_command() {
    with_wheel(400, async |shared, switch, _| {
        let port = shared.motor(nth(0));
        let efforts = async |driving| {
            let withheld = Withheld { driving, braking: 0.0 };
            let mut most = 0.0_f32;
            for _ in 0..20 {
                assert_eq!(port.command_within(Target::Speed(Rpm::new(5e4)), withheld), Ok(()));
                Timer::after_millis(2).await;
                most = most.max(port.status().feedback.effort().unwrap());
            }
            most
        };
        Timer::after_millis(20).await;
        switch.arm().unwrap();
        let [_, now] = port.tuning().unwrap();
        let (some, none) = (efforts(0.95).await, efforts(1.0).await);
        assert!((some - 0.05 * now.limit).abs() < 0.01 && none < some + 0.01, "{some} {none}");
        assert!(port.status().feedback.effort().unwrap().abs() < 0.01, "nothing is left");
        // The next command has all of it.
        assert_eq!(port.command(Target::Speed(Rpm::new(5e4))), Ok(()));
        Timer::after_millis(30).await;
        let all = port.status().feedback.effort().unwrap();
        assert!(all > 1.5 * some, "{all} of {}", now.limit);
        assert_eq!(port.tuning().unwrap()[1], now);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let withheld = Withheld { driving: 0.0, braking: bad };
            let refused = port.command_within(Target::Speed(Rpm::ZERO), withheld);
            assert_eq!(refused, Err(TargetError::NotFinite(TargetKind::Speed)));
        }
        // An effort that is asked for is not one of loops.
        let current = port.command_within(Target::Current(Amps::new(1.0)), HALF);
        assert_eq!(current, Err(TargetError::OutOfRange(TargetKind::Current)));
        let refused = port.status().counters.refused;
        assert_eq!((refused.not_finite, refused.out_of_range), (3, 1));
    });
    // Nothing can be withheld from loops of a device.
    let config = vesc::Config::new(
        1,
        vesc::ElectricalScale::new(NonZeroU8::MIN, Gear::DIRECT),
        vesc::Currents { limit: Amps::new(9.0), brake: Amps::new(9.0), handbrake: Amps::new(9.0) },
    );
    let (mut flywheel, switch, shared) =
        (Vesc::new(config).unwrap(), ArmSwitch::new(), BusPort::new());
    let mut bus = MotorBus::new(&switch);
    let flywheel = bus.attach(&mut flywheel, Safety::COAST).unwrap();
    let wire = World::new(9).add_bus(BusConfig::default());
    let target = Target::Speed(Rpm::new(10.0));
    let refused = TargetError::OutOfRange(TargetKind::Speed);
    let now = Micros::from_millis(1);
    let _runner = Runner::new(wire.port(), bus, &shared, now);
    let port = shared.motor(flywheel);
    assert_eq!(port.command_within(target, HALF), Err(refused));
    assert_eq!(port.command_within(target, Withheld::NONE), Ok(()));
    assert_eq!(port.status().counters.refused.out_of_range, 1);
}

#[test]
fn a_request_is_answered_after_the_next_tick() {
    with_wheel(100, async |shared, _, _| {
        let port = shared.motor(nth(0));
        assert_eq!(port.request(Request::ClearFault).await, Err(RequestError::Unsupported));
        assert_eq!(port.request(Request::SetZero).await, Ok(Response::Done));
        assert_eq!(port.status().feedback.total_angle.microdegrees(), 0);
    });
}

/// Callers at one motor: each gets its own answer.
#[test]
fn no_caller_gets_the_answer_of_another() {
    with_wheel(200, async |shared, _, _| {
        Timer::after_millis(5).await;
        let port = shared.motor(nth(0));
        let answers = RefCell::new(Vec::new());
        let ask = async |name: &str, request, pause| {
            Timer::after_micros(pause).await;
            let answer = port.request(request).await;
            answers.borrow_mut().push((name.to_owned(), answer));
        };
        let mut callers = Tasks::new();
        callers.add(ask("unsupported", Request::ClearFault, 0));
        callers.add(ask("at once", Request::SetZero, 10));
        callers.add(ask("later", Request::SetZero, 5_000));
        Pin::new(&mut callers).await;
        let mut answers = answers.take();
        answers.sort_by(|a, b| a.0.cmp(&b.0));
        assert_eq!(answers[0], ("at once".into(), Ok(Response::Done)));
        assert_eq!(answers[1], ("later".into(), Ok(Response::Done)));
        assert_eq!(answers[2], ("unsupported".into(), Err(RequestError::Unsupported)));
        // A caller that gives up leaves no answer behind for the next one.
        let given_up = port.request(Request::ClearFault);
        let mut given_up = Box::pin(given_up);
        let waker = std::task::Waker::noop();
        let mut context = std::task::Context::from_waker(waker);
        assert!(given_up.as_mut().poll(&mut context).is_pending());
        drop(given_up);
        Timer::after_millis(3).await;
        assert_eq!(port.request(Request::SetZero).await, Ok(Response::Done));
    });
}

#[test]
fn frames_for_others_go_out_after_the_motors_and_never_in_their_name() {
    with_wheel(100, async |shared, _, wire| {
        Timer::after_millis(10).await;
        let _ = wire.take_trace();
        let own = frame(0x200, &[9; 8]);
        let refused =
            Err(OutboxError::BelongsToMotor(Id::Standard(StandardId::new(0x200).unwrap())));
        assert_eq!(shared.send(&own), refused);
        let lamp = CanFrame::data_frame(ExtendedId::new(0x1234).unwrap(), &[1, 2]).unwrap();
        shared.send(&lamp).unwrap();
        Timer::after_millis(2).await;
        let sent: Vec<_> = wire.take_trace().into_iter().filter(|e| e.from_controller).collect();
        assert!(sent.iter().any(|entry| entry.frame == lamp));
        assert!(sent.iter().all(|entry| entry.frame == lamp || entry.frame.bytes() == [0; 8]));
        for n in 0..16 {
            shared.send(&frame(0x300 + n, &[])).unwrap();
        }
        assert_eq!(shared.send(&lamp), Err(OutboxError::Full));
    });
}

#[test]
fn subscribers_get_what_they_asked_for_and_know_what_they_lost() {
    with_wheel(200, async |shared, _, wire| {
        let mut strangers = shared.subscribe(Filter::Unclaimed).unwrap();
        let wheel = IdPattern::exact(StandardId::new(0x201).unwrap());
        let mut feedback = shared.subscribe(Filter::Pattern(wheel)).unwrap();
        for n in 0..3 {
            wire.inject(&frame(0x500, &[n]));
        }
        for n in 0..3 {
            let received = strangers.next().await;
            assert_eq!(received.frame, frame(0x500, &[n]));
        }
        assert_eq!(strangers.try_next(), None);
        Timer::after_millis(50).await;
        // Eight frames wait, the others of 50 ms were lost, and are counted.
        let kept = std::iter::from_fn(|| feedback.try_next()).count();
        assert_eq!(kept, 8);
        assert!((35..=60).contains(&feedback.lost()), "{}", feedback.lost());
        assert_eq!(strangers.lost(), 0);
        // Four at most; a dropped one makes room.
        let third = shared.subscribe(Filter::Unclaimed).unwrap();
        let _fourth = shared.subscribe(Filter::Unclaimed).unwrap();
        assert!(shared.subscribe(Filter::Unclaimed).is_err());
        drop(third);
        assert!(shared.subscribe(Filter::Unclaimed).is_ok());
        assert_eq!(shared.status().received.unclaimed, 3);
    });
}

/// Without acknowledgement: the newest command waits alone, and those it replaced are counted.
#[test]
fn after_an_outage_only_the_newest_command_leaves() {
    let mut world = World::new(2);
    let wire = world.add_bus(BusConfig::default());
    let esc = wire.add_esc(twin(&dji::M3508, 1)).unwrap();
    let switch = ArmSwitch::new();
    let shared = BusPort::new();
    let mut wheel = motor(&dji::M3508, 1);
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut wheel, Safety::COAST).unwrap();
    let mut tasks = Tasks::new();
    tasks.add(run_bus(wire.port(), bus, &shared));
    switch.arm().unwrap();
    tasks.add(async {
        loop {
            let _ = shared.motor(nth(0)).command(Target::Current(Amps::new(3.0)));
            Timer::after_millis(5).await;
        }
    });
    let _ = world.run(Pin::new(&mut tasks), Micros::from_millis(100));
    assert!(esc.state().command > 2000);
    wire.set_cut(true);
    let _ = world.run(Pin::new(&mut tasks), Micros::from_millis(400));
    let status = shared.status();
    // Most of the time the one before is just being repeated on the wire, and not replaced there.
    assert!(status.replaced > 0, "{status:?}");
    assert_eq!(status.refused, 0);
    assert_ne!(status.health.transmit_errors, 0);
    assert_eq!(shared.motor(nth(0)).status().link, Link::Lost);
    let _ = wire.take_trace();
    wire.set_cut(false);
    let _ = world.run(Pin::new(&mut tasks), Micros::from_millis(402));
    // The bus noticed long ago: the first command after the outage says zero.
    let first = wire.take_trace().into_iter().find(|entry| entry.from_controller).unwrap();
    assert_eq!(first.frame.bytes(), [0; 8]);
}

/// A tick that comes late is counted, and the next ones are on the grid again.
#[test]
fn overruns_are_counted_and_do_not_move_the_grid() {
    let mut world = World::new(1);
    let wire = world.add_bus(BusConfig::default());
    let switch = ArmSwitch::new();
    let shared = BusPort::new();
    let mut runner = Runner::new(wire.port(), MotorBus::new(&switch), &shared, Micros::ZERO);
    for start in [1_000, 2_000, 5_400, 6_000, 7_010] {
        world.advance(Micros::new(start));
        runner.tick(|| Micros::new(start));
        // The first half of the next one.
        assert_eq!(runner.next().get() % 1000, 940);
    }
    let status = shared.status();
    assert_eq!((status.ticks, status.overruns), (5, 2));
    assert_eq!((status.period.min(), status.period.max()), (Some(600), Some(3_400)));
}

/// An M3508 that is asked for 3 A. At 100 ms the first half of a tick is done, with the last of its
/// targets; then `between` happens, and after a pause the runner comes by again. The commands on the wire from then on: when, and whether zero.
fn after_half_a_tick(pause: u64, between: impl FnOnce(&ArmSwitch)) -> Vec<(Micros, bool)> {
    let mut world = World::new(3);
    let wire = world.add_bus(BusConfig::default());
    let _esc = wire.add_esc(twin(&dji::M3508, 1)).unwrap();
    let (switch, shared) = (ArmSwitch::new(), BusPort::new());
    let mut wheel = motor(&dji::M3508, 1);
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut wheel, Safety::COAST).unwrap();
    let mut runner = Runner::new(wire.port(), bus, &shared, Micros::ZERO);
    switch.arm().unwrap();
    let mut step = |at: Micros| {
        world.advance(at);
        runner.tick(|| at);
        runner.next()
    };
    let mut next = Micros::new(940);
    while next <= Micros::new(99_940) {
        shared.motor(nth(0)).command(Target::Current(Amps::new(3.0))).unwrap();
        next = step(next);
    }
    assert_eq!(next, Micros::from_millis(100));
    let torque = |entry: &rc10_sim::TraceEntry| entry.frame.bytes() != [0; 8];
    let commands = || wire.take_trace().into_iter().filter(|entry| entry.from_controller);
    assert!(commands().any(|entry| torque(&entry)));
    between(&switch);
    next += Micros::new(pause);
    while next < Micros::new(102_500 + pause) {
        next = step(next);
    }
    commands().map(|entry| (entry.start.micros(), !torque(&entry))).collect()
}

/// However long the first half took, and however late the one before was.
#[test]
fn frames_leave_on_the_grid() {
    let commands = after_half_a_tick(0, |_| {});
    // The wire may be busy with a feedback, of 130 us at most.
    let late = commands.iter().map(|(at, _)| at.get() % 1000);
    assert!(late.clone().all(|late| late < 150), "{commands:?}");
    assert!(commands.len() >= 2 && commands.iter().all(|(_, zero)| !zero), "{commands:?}");
}

/// Frames computed before the stop do not leave after it.
#[test]
fn a_stop_between_the_halves_of_a_tick_counts() {
    for stop in [ArmSwitch::emergency_stop, ArmSwitch::disarm] {
        let commands = after_half_a_tick(0, stop);
        assert!(commands.len() >= 2 && commands.iter().all(|(_, zero)| *zero), "{commands:?}");
    }
}

/// A task that was kept from running for 60 ms computes anew: by now its target has expired.
#[test]
fn half_a_tick_that_is_old_does_not_leave() {
    let commands = after_half_a_tick(60_000, |_| {});
    let (first, zero) = commands[0];
    assert!(first >= Micros::from_millis(160) && zero, "{commands:?}");
    // Late by a little it may leave.
    let commands = after_half_a_tick(300, |_| {});
    assert!(!commands[0].1, "{commands:?}");
}

/// The ticks of several buses lie behind each other.
#[test]
fn buses_of_one_task_send_60_us_apart() {
    let mut world = World::new(4);
    let switch = ArmSwitch::new();
    let wires = [(); 3].map(|()| world.add_bus(BusConfig::default()));
    let _escs = wires.each_ref().map(|wire| wire.add_esc(twin(&dji::M3508, 1)).unwrap());
    let shared = [(); 3].map(|()| BusPort::new());
    let mut motors = [(); 3].map(|()| motor(&dji::M3508, 1));
    let mut tasks = Tasks::new();
    let mut runners = wires.iter().zip(&mut motors).zip(&shared).map(|((wire, motor), shared)| {
        let mut bus = MotorBus::new(&switch);
        bus.attach(motor, Safety::COAST).unwrap();
        Runner::new(wire.port(), bus, shared, Micros::ZERO)
    });
    let runners: [_; 3] = std::array::from_fn(|_| runners.next().unwrap());
    tasks.add(run_buses(runners));
    let _ = world.run(Pin::new(&mut tasks), Micros::from_millis(20));
    drop(tasks);
    for (wire, grid) in wires.iter().zip([500, 560, 620]) {
        let sent = wire.take_trace().into_iter().filter(|entry| entry.from_controller);
        // A feedback may be on the wire.
        let late: Vec<_> = sent.map(|entry| (entry.start.micros().get() - grid) % 1000).collect();
        assert!(late.len() >= 18 && late.iter().all(|late| *late < 150), "{late:?}");
    }
    for port in &shared {
        let status = port.status();
        assert_eq!((status.period.min(), status.period.max()), (Some(1000), Some(1000)));
        assert!(status.ticks >= 19 && status.overruns == 0, "{status:?}");
    }
}
