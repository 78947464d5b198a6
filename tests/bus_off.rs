//! A bus that leaves, and comes back or does not; and what a port is told to let in.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::pin::Pin;

use crate::common::{motor, twin};
use embassy_time::Timer;
use rc10_app::Amps;
use rc10_can::embedded_can::{ExtendedId, StandardId};
use rc10_can::{BusOffPolicy, CanFrame, CanPort, ErrorState, Health, IdPattern, Submitted};
use rc10_motor::dji::{self, Dji};
use rc10_motor::embassy::{BusPort, Filter, Runner};
use rc10_motor::{ArmState, ArmSwitch, Link, MotorBus, MotorId, Place, Safety, Target, numbers};
use rc10_sim::{BusConfig, Tasks, World};
use rc10_time::Micros;

/// The number of a motor on its bus, as `attach` counts.
fn nth(index: usize) -> MotorId {
    numbers([Place::Bus(1); 16]).nth(index).unwrap()
}

/// A port in any state that the test wants, which writes down its calls.
#[derive(Default)]
struct Patient {
    state: Cell<ErrorState>,
    bus_offs: Cell<u32>,
    now: Cell<u64>,
    /// Times at which it was asked to go back, in milliseconds.
    attempts: RefCell<Vec<u64>>,
    accepted: RefCell<Vec<Vec<IdPattern>>>,
    incoming: RefCell<VecDeque<CanFrame>>,
}

impl CanPort for &Patient {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        let frame = self.incoming.borrow_mut().pop_front()?;
        Some((frame, Micros::from_millis(self.now.get())))
    }
    fn submit_as(&mut self, _: &CanFrame, _: u32) -> Submitted {
        Submitted::Queued
    }
    fn cancel_pending(&mut self) -> u8 {
        0
    }
    fn health(&self) -> Health {
        Health { state: self.state.get(), bus_offs: self.bus_offs.get(), ..Health::NEW }
    }
    fn accept(&mut self, patterns: &[IdPattern]) {
        self.accepted.borrow_mut().push(patterns.to_vec());
    }
    fn recover(&mut self) {
        self.attempts.borrow_mut().push(self.now.get());
    }
}

impl Patient {
    fn fall(&self) {
        self.state.set(ErrorState::BusOff);
        self.bus_offs.set(self.bus_offs.get() + 1);
    }

    fn ticks(&self, runner: &mut Runner<'_, '_, &Self>, millis: u64) {
        for _ in 0..millis {
            self.now.set(self.now.get() + 1);
            runner.tick(|| Micros::from_millis(self.now.get()));
        }
    }
}

#[test]
fn a_bus_that_does_not_heal_is_tried_less_and_less_often() {
    let (patient, switch, shared) = (Patient::default(), ArmSwitch::new(), BusPort::new());
    let mut runner = Runner::new(&patient, MotorBus::new(&switch), &shared, Micros::ZERO);
    switch.arm().unwrap();
    patient.ticks(&mut runner, 9);
    patient.fall();
    patient.ticks(&mut runner, 250);
    let tries = [10, 12, 16, 24, 40, 72, 122, 172, 222];
    assert_eq!(*patient.attempts.borrow(), tries);
    assert_eq!(switch.state(), ArmState::Armed);
    assert_eq!(shared.status().health.state, ErrorState::BusOff);

    // Back for less than a second, then for more: only then is it a new bus. (It has been off for
    // long enough to be tried at once either way.)
    for (well, tries) in [(900, &[1][..]), (1100, &[1, 3, 7])] {
        patient.state.set(ErrorState::Passive);
        patient.ticks(&mut runner, 2000);
        patient.state.set(ErrorState::Warning);
        patient.ticks(&mut runner, well);
        patient.attempts.borrow_mut().clear();
        let fell = patient.now.get();
        patient.fall();
        patient.ticks(&mut runner, 10);
        let after: Vec<_> = patient.attempts.borrow().iter().map(|at| at - fell).collect();
        assert_eq!(after, tries);
    }
}

#[test]
fn a_manual_bus_stays_off_until_somebody_wants_it_back() {
    let (patient, switch, shared) = (Patient::default(), ArmSwitch::new(), BusPort::new());
    let mut runner = Runner::new(&patient, MotorBus::new(&switch), &shared, Micros::ZERO)
        .with_bus_off(BusOffPolicy::Manual);
    // Not off yet: this is not kept for later.
    shared.recover();
    patient.ticks(&mut runner, 5);
    patient.fall();
    patient.ticks(&mut runner, 500);
    assert!(patient.attempts.borrow().is_empty());
    shared.recover();
    patient.ticks(&mut runner, 5);
    assert_eq!(*patient.attempts.borrow(), [506]);
}

#[test]
fn a_latched_bus_comes_back_but_the_robot_stays_stopped() {
    let (patient, switch, shared) = (Patient::default(), ArmSwitch::new(), BusPort::new());
    // Events before the bus ran stop no motor.
    patient.bus_offs.set(7);
    let mut runner = Runner::new(&patient, MotorBus::new(&switch), &shared, Micros::ZERO)
        .with_bus_off(BusOffPolicy::Latched);
    switch.arm().unwrap();
    patient.ticks(&mut runner, 5);
    assert_eq!(switch.state(), ArmState::Armed);
    patient.fall();
    patient.ticks(&mut runner, 1);
    assert_eq!(*patient.attempts.borrow(), [6]);
    patient.state.set(ErrorState::Active);
    patient.ticks(&mut runner, 2000);
    assert_eq!(shared.status().arm, ArmState::EStopped);
    switch.reset();
    switch.arm().unwrap();
    patient.ticks(&mut runner, 5);
    assert_eq!(switch.state(), ArmState::Armed);
    // Gone and back between two ticks: the count tells.
    patient.bus_offs.set(9);
    patient.ticks(&mut runner, 1);
    assert_eq!(switch.state(), ArmState::EStopped);
}

/// On the simulated wire: shorted, and healed after 300 ms.
#[test]
fn after_a_short_nothing_old_leaves_and_the_bus_is_back_within_100_ms() {
    let mut world = World::new(5);
    let wire = world.add_bus(BusConfig::default());
    let esc = wire.add_esc(twin(&dji::M3508, 1)).unwrap();
    let (switch, shared) = (ArmSwitch::new(), BusPort::new());
    let mut wheel = motor(&dji::M3508, 1);
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut wheel, Safety::COAST).unwrap();
    let mut tasks = Tasks::new();
    tasks.add(rc10_motor::embassy::run_bus(wire.port(), bus, &shared));
    tasks.add(async {
        loop {
            let _ = shared.motor(nth(0)).command(Target::Current(Amps::new(3.0)));
            Timer::after_millis(5).await;
        }
    });
    switch.arm().unwrap();
    let _ = world.run(Pin::new(&mut tasks), Micros::from_millis(100));
    assert!(esc.state().command > 2000);
    wire.set_shorted(true);
    let _ = world.run(Pin::new(&mut tasks), Micros::from_millis(400));
    let status = shared.status();
    assert_eq!(status.health.state, ErrorState::BusOff);
    assert_eq!(shared.motor(nth(0)).status().link, Link::Lost);
    let _ = wire.take_trace();
    wire.set_shorted(false);
    let healed = world.now();
    let _ = world.run(Pin::new(&mut tasks), Micros::from_millis(500));
    let trace = wire.take_trace();
    let first = trace.iter().find(|entry| entry.from_controller).unwrap();
    assert_eq!(first.frame.bytes(), [0; 8], "{:?}", first.at);
    assert!(first.at.since(healed) < Micros::from_millis(100));
    let status = shared.status();
    assert_eq!(status.health.state, ErrorState::Active);
    assert!(status.health.bus_offs >= 1);
    assert_eq!(shared.motor(nth(0)).status().link, Link::Online);
    assert!(esc.state().command > 2000);
}

#[test]
fn a_port_lets_in_what_motors_and_subscriptions_want_and_is_told_when_that_changes() {
    let (patient, switch, shared) = (Patient::default(), ArmSwitch::new(), BusPort::new());
    let mut motors = [motor(&dji::M3508, 1), motor(&dji::M3508, 2)];
    let mut bus = MotorBus::new(&switch);
    for motor in &mut motors {
        bus.attach(motor, Safety::COAST).unwrap();
    }
    let exact = |raw| IdPattern::exact(StandardId::new(raw).unwrap());
    let feedback = [exact(0x201), exact(0x202)];
    let lamp = IdPattern::exact(ExtendedId::new(0x1234).unwrap());
    let newest = || patient.accepted.borrow().last().unwrap().clone();

    let mut runner = Runner::new(&patient, bus, &shared, Micros::ZERO);
    assert_eq!(newest(), feedback);
    let first = shared.subscribe(Filter::Pattern(lamp)).unwrap();
    // It is wanted already.
    let second = shared.subscribe(Filter::Pattern(exact(0x202))).unwrap();
    patient.ticks(&mut runner, 10);
    assert_eq!(newest(), [feedback[0], feedback[1], lamp]);
    let third = shared.subscribe(Filter::Unclaimed).unwrap();
    patient.ticks(&mut runner, 10);
    let everything = [IdPattern::any_standard(), IdPattern::any_extended()];
    assert_eq!(newest()[3..], everything);
    // Once for each change.
    assert_eq!(patient.accepted.borrow().len(), 3);
    drop((first, second, third));
    patient.ticks(&mut runner, 10);
    assert_eq!(newest(), feedback);
}

#[test]
fn a_pause_costs_no_frame_and_remote_requests_are_counted_apart() {
    let (patient, switch, shared) = (Patient::default(), ArmSwitch::new(), BusPort::new());
    let mut wheel: Dji = motor(&dji::M3508, 1);
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut wheel, Safety::COAST).unwrap();
    let mut runner = Runner::new(&patient, bus, &shared, Micros::ZERO);
    let id = StandardId::new(0x201).unwrap();
    let mut frames = VecDeque::from(vec![CanFrame::eight_bytes(id, [0; 8]); 62]);
    frames.push_back(CanFrame::remote_frame(id, 8).unwrap());
    frames.push_back(CanFrame::data_frame(StandardId::new(0x77).unwrap(), &[]).unwrap());
    patient.incoming.replace(frames);
    patient.ticks(&mut runner, 1);
    let received = shared.status().received;
    assert_eq!((received.received, received.unclaimed, received.remote), (64, 1, 1));
    assert_eq!(received.malformed, 0);
    assert_eq!(shared.motor(nth(0)).status().counters.received, 62);
}
