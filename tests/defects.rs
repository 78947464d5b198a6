//! The defects of the C++ library that this project replaces, one test each: they stay out. The
//! numbers are those under which they were found. (R1 and R7 cannot be written in safe Rust; R6,
//! R12 and R16 concern motors and remotes that come later.)

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::pin::pin;
use std::rc::Rc;
use std::sync::Mutex;

use crate::common::{Bench, motor, twin};
use rc10_app::angle::shortest_way_degrees;
use rc10_app::{
    Amps, Base, CountsPerTurn, Degrees, Direction, Gear, PidConfig, PidState, Rpm, Seconds, Twist,
};
use rc10_can::embedded_can::{Id, StandardId};
use rc10_can::{CanFrame, CanPort, Health, Submitted};
use rc10_conformance::{Acts, Dummy};
use rc10_message::{Every, Statistics};
use rc10_motor::dji::{self, Dji};
use rc10_motor::embassy::{BusPort, Runner};
use rc10_motor::shaft::Shaft;
use rc10_motor::{
    ArmSwitch, AttachError, CanIds, CanMotor, Clash, Link, Motor, MotorBus, Safety, Target,
    TargetError, TargetKind, Tick, TxBatch,
};
use rc10_time::Micros;

const MS: Seconds = Seconds::new(0.001);

fn frame(id: u16, data: [u8; 8]) -> CanFrame {
    CanFrame::eight_bytes(StandardId::new(id).unwrap(), data)
}

/// A port that has frames to give, and room for some.
#[derive(Default)]
struct FakePort {
    incoming: VecDeque<CanFrame>,
    sent: Rc<RefCell<Vec<CanFrame>>>,
    room: usize,
    health: Health,
}

impl CanPort for FakePort {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        self.incoming.pop_front().map(|frame| (frame, Micros::from_millis(1)))
    }
    fn submit_as(&mut self, frame: &CanFrame, _: u32) -> Submitted {
        if self.sent.borrow().len() >= self.room {
            return Submitted::Refused;
        }
        self.sent.borrow_mut().push(*frame);
        Submitted::Queued
    }
    fn cancel_pending(&mut self) -> u8 {
        0
    }
    fn health(&self) -> Health {
        self.health
    }
}

/// Writes down the time steps that a motor is given.
struct Witness<'a>(&'a Mutex<Vec<f32>>);

impl Acts for Witness<'_> {
    fn update(&mut self, tick: &Tick) {
        self.0.lock().unwrap().push(tick.dt.get());
    }
}

#[test]
fn r2_the_way_from_350_to_10_degrees_is_20() {
    let way = |from, to| shortest_way_degrees(Degrees::new(from), Degrees::new(to)).get();
    assert!((way(350.0, 10.0) - 20.0).abs() < 1e-3 && (way(10.0, 350.0) + 20.0).abs() < 1e-3);
}

/// At 1 h of uptime a true 1.000 ms read 0.732 to 1.221 ms, at 4.6 h 0 or 1.953 ms.
#[test]
fn r3_a_millisecond_is_a_millisecond_after_any_uptime() {
    let seen = Mutex::new(Vec::new());
    for hours in [0, 1, 5, 24 * 365 * 100] {
        let start = Micros::from_millis(hours * 3_600_000);
        let switch = ArmSwitch::new();
        let shared = BusPort::new();
        let mut witness = Dummy::new("witness", 1, CanIds::new()).with(Witness(&seen));
        let mut bus = MotorBus::new(&switch);
        bus.attach(&mut witness, Safety::COAST).unwrap();
        let mut runner = Runner::new(FakePort::default(), bus, &shared, start);
        for tick in 1..=100 {
            runner.tick(|| start + Micros::from_millis(tick));
        }
        let seen = std::mem::take(&mut *seen.lock().unwrap());
        assert_eq!(seen.len(), 100);
        assert!(seen.iter().all(|dt| (dt - 0.001).abs() < 1e-9), "{hours} h");
    }
}

/// The angle was off by 8.9 degrees after 256,000 rotor turns, and by 10^8 degrees after 262,144.
#[test]
fn r4_a_million_rotor_turns_are_counted_exactly() {
    let mut shaft = Shaft::new(8192, Gear::DIRECT, Direction::Forward);
    let turns = 1_000_000_i64;
    for quarter in 0..turns * 4 {
        shaft.follow(i32::try_from(quarter % 4 * 2048).unwrap(), 0.0, Micros::ZERO);
    }
    shaft.follow(1, 0.0, Micros::ZERO);
    assert_eq!(shaft.angle().counts_at(CountsPerTurn::new(8192, 1)), turns * 8192 + 1);
}

#[test]
fn r5_the_integral_works_without_any_separation_threshold() {
    let config = PidConfig::within(100.0).ki(10.0);
    let mut state = PidState::new();
    for _ in 0..1000 {
        state.update(&config, 1.0, 0.0, 0.0, MS);
    }
    assert!(state.output() > 9.0);
    // And the value that silently switched it off is an error now.
    let zero = PidConfig { integral_separation: 0.0, ..config };
    assert_eq!(zero.validate().unwrap_err().field, "integral_separation");
}

/// Groups used up places: at most six motors fitted, and the ninth registration only said `false`.
#[test]
fn r8_eight_motors_of_two_groups_fit_and_the_ninth_is_named() {
    let switch = ArmSwitch::new();
    let mut motors: Vec<Dji> = (1..=8).map(|id| motor(&dji::M3508, id)).collect();
    let mut ninth = motor(&dji::GM6020_CURRENT, 7);
    let mut bus = MotorBus::new(&switch);
    for motor in &mut motors {
        bus.attach(motor, Safety::COAST).unwrap();
    }
    let error = bus.attach(&mut ninth, Safety::COAST).unwrap_err();
    assert_eq!(
        error.to_string(),
        "GM6020 (current mode) id 7 finds no room: the bus holds 8 motors"
    );
    let mut tx = TxBatch::new();
    bus.tick(Micros::from_millis(1), MS, &mut tx).unwrap();
    assert_eq!(tx.frames().len(), 2);
}

/// One frame was read per interrupt, and what did not go out was dropped without a word.
#[test]
fn r9_all_received_frames_are_taken_in_one_tick_and_losses_are_counted() {
    let switch = ArmSwitch::new();
    let shared = BusPort::new();
    let mut motors: Vec<Dji> = (1..=8).map(|id| motor(&dji::M3508, id)).collect();
    let mut bus = MotorBus::new(&switch);
    for motor in &mut motors {
        bus.attach(motor, Safety::COAST).unwrap();
    }
    let port = FakePort {
        incoming: (0..24).map(|n| frame(0x201 + n % 8, [0; 8])).collect(),
        room: 1,
        health: Health { receive_lost: 3, bus_offs: 2, ..Health::NEW },
        ..FakePort::default()
    };
    let mut runner = Runner::new(port, bus, &shared, Micros::ZERO);
    runner.tick(|| Micros::from_millis(1));
    let status = shared.status();
    assert_eq!(status.received.received, 24);
    // Two command frames, room for one.
    assert_eq!((status.submitted, status.refused), (1, 1));
    assert_eq!((status.health.receive_lost, status.health.bus_offs), (3, 2));
}

/// Feedback stopped, the controller went on integrating, and the motor kicked on reconnection.
#[test]
fn r10_nothing_is_integrated_while_a_motor_is_unplugged() {
    let switch = ArmSwitch::new();
    let mut wheel = motor(&dji::M3508, 1);
    let mut bench = Bench::new(1, &switch);
    let (id, esc) = bench.add(&mut wheel, Safety::COAST, twin(&dji::M3508, 1));
    switch.arm().unwrap();
    let target = Target::Speed(Rpm::new(200.0));
    bench.hold(id, target, 1000);
    esc.set_power(false);
    bench.hold(id, target, 3000);
    assert_eq!(bench.status(id).link, Link::Lost);
    assert_eq!(bench.tx.frames()[0].bytes(), [0; 8]);
    esc.set_power(true);
    let mut largest = 0;
    for _ in 0..20 {
        bench.hold(id, target, 1);
        largest = largest.max(esc.state().command.abs());
    }
    // Twenty ticks after it is back it has not even half its full current: no wound-up integral.
    assert!(largest < 8192, "{largest}");
}

#[test]
fn r11_currents_are_limited_before_they_become_integers_and_reported_in_amperes() {
    let mut wheel = motor(&dji::M3508, 1);
    assert_eq!(wheel.model().raw_command(40.1), 16384);
    assert_eq!(wheel.model().raw_command(-1e30), -16384);
    assert_eq!(wheel.model().raw_command(f32::NAN), 0);
    for bad in [f32::NAN, f32::INFINITY] {
        let refused = wheel.set_target(Target::Current(Amps::new(bad)));
        assert_eq!(refused, Err(TargetError::NotFinite(TargetKind::Current)));
    }
    wheel
        .unpack_feedback(&frame(0x201, [0, 0, 0, 0, 0x40, 0, 0, 0]), Micros::ZERO, Link::Online)
        .unwrap();
    assert_eq!(wheel.feedback().current(), Some(Amps::new(20.0)));
}

/// The limited wheel speeds were computed and thrown away.
#[test]
fn r13_no_wheel_is_asked_for_more_than_its_limit() {
    let base = Base::mecanum(0.076, 0.20, 0.22, Rpm::new(400.0));
    let wanted = Twist::new(3.0, 2.0, 5.0);
    let wheels = base.inverse(wanted).unwrap();
    assert!(wheels.speeds.iter().all(|speed| speed.get().abs() <= 400.0));
    let got = base.forward(wheels.speeds).twist;
    // The direction is the one that was asked for.
    for (got, wanted) in [(got.vx, wanted.vx), (got.vy, wanted.vy), (got.wz, wanted.wz)] {
        assert!((got - wanted * wheels.scale).abs() < 1e-4);
    }
}

#[test]
fn r14_motors_with_one_feedback_id_are_refused_and_both_are_named() {
    for n in 1..=4 {
        for model in [&dji::GM6020_CURRENT, &dji::GM6020_VOLTAGE] {
            let switch = ArmSwitch::new();
            let (mut wheel, mut gimbal) = (motor(&dji::M3508, n + 4), motor(model, n));
            let mut bus = MotorBus::new(&switch);
            bus.attach(&mut wheel, Safety::COAST).unwrap();
            let error = bus.attach(&mut gimbal, Safety::COAST).unwrap_err();
            let id = Id::Standard(StandardId::new(0x204 + u16::from(n)).unwrap());
            let AttachError::Clash { motor, with, clash, .. } = error else { panic!("{error}") };
            assert_eq!(
                (motor.id, with.id, clash),
                (n.into(), (n + 4).into(), Clash::RxFrames(id.into()))
            );
            let text = error.to_string();
            assert!(text.contains("M3508") && text.contains("GM6020") && text.contains("0x20"));
        }
    }
    // The last GM6020 reports with 0x20B, not 0x211.
    let last = dji::GM6020_CURRENT.feedback_id(7).unwrap();
    assert_eq!(last.as_raw(), 0x20B);
    assert!(Dji::new(dji::Config::new(&dji::GM6020_CURRENT, 8)).is_err());
}

/// Periodic tasks drifted by the time their work took.
#[test]
fn r15_periodic_work_does_not_drift() {
    let mut world = rc10_sim::World::new(1);
    let statistics = Statistics::new();
    let count = Cell::new(0);
    let work = async {
        let mut every = Every::millis(10).with_statistics(&statistics);
        loop {
            every.next().await;
            count.set(count.get() + 1);
            embassy_time::Timer::after_millis(3).await;
        }
    };
    let mut work = pin!(work);
    let _ = world.run(work.as_mut(), Micros::from_millis(100_000));
    assert_eq!(count.get(), 10_001);
    let load = statistics.read();
    assert_eq!((load.period.min(), load.period.max()), (Some(10_000), Some(10_000)));
}
