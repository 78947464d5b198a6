//! A bus and its runner, with a motor that does as it is told.

use std::sync::{Arc, Mutex};

// The lock of a PC.
use critical_section as _;
use rc10_conformance::{Acts, Dummy};
use rc10_motor::embassy::{BusPort, Runner};
use rc10_motor::pending::Outcome;
use rc10_motor::rc10_app::{Amps, NewtonMetres, Rpm, Seconds};
use rc10_motor::rc10_can::embedded_can::StandardId;
use rc10_motor::rc10_can::{CanFrame, CanPort, Health, IdPattern, Submitted};
use rc10_motor::rc10_time::Micros;
use rc10_motor::{
    ArmSwitch, AttachError, CanIds, Clash, CommandError, Dispatch, DriveMode, Feedback, FrameError,
    FrameKind, Frames, Impedance, Link, Motion, MotorBus, MotorId, MotorName, MotorStatus,
    Ownership, Place, Rate, Request, RequestError, Response, Safety, Target, Tick, TxBatch, TxFull,
    numbers,
};

const MS: Seconds = Seconds::new(0.001);

/// The number of a motor on its bus, as `attach` counts.
fn nth(index: usize) -> MotorId {
    numbers([Place::Bus(1); 16]).nth(index).unwrap()
}

fn id(raw: u16) -> StandardId {
    StandardId::new(raw).unwrap()
}

fn exact(raw: u16) -> IdPattern {
    IdPattern::exact(id(raw))
}

/// The identifiers of the dummy with this number: [`Told`] has the bytes.
fn says(number: u16, byte: u8) -> CanFrame {
    CanFrame::data_frame(id(number), &[byte]).unwrap()
}

type Seen<T> = Arc<Mutex<T>>;

/// Writes down what it is told, and says what it is told to say.
#[derive(Default)]
struct Told {
    number: u16,
    /// How many frames it sends in a tick.
    frames: u16,
    /// Whether it does what is requested without asking its device.
    at_once: bool,
    ticks: Seen<Vec<Tick>>,
    /// The link as its frames came.
    links: Seen<Vec<Link>>,
    /// The outcome that it will tell of a request that waits for the device.
    response: Seen<Option<Outcome>>,
}

impl Acts for Told {
    /// Tells as its speed what it was allowed to do.
    fn feedback(&self) -> Feedback {
        let drive = self.ticks.lock().unwrap().last().map_or(DriveMode::Off, |tick| tick.mode);
        let mut told = Feedback::NEW;
        told.speed = Rpm::new(f32::from(drive as u8));
        told
    }
    fn update(&mut self, tick: &Tick) {
        self.ticks.lock().unwrap().push(*tick);
    }
    fn request(&mut self, _: Request) -> Outcome {
        Ok(if self.at_once { Response::Done } else { Response::Pending })
    }
    fn response(&mut self) -> Option<Outcome> {
        self.response.lock().unwrap().take()
    }
    fn unpack(&mut self, frame: &CanFrame, link: Link) -> Result<FrameKind, FrameError> {
        self.links.lock().unwrap().push(link);
        match frame.bytes() {
            [0] => Ok(FrameKind::Feedback),
            [1] => Ok(FrameKind::Fault),
            [2] => Ok(FrameKind::Other),
            [3] => {
                *self.response.lock().unwrap() = Some(Ok(Response::Done));
                Ok(FrameKind::Feedback)
            }
            _ => Err(FrameError::Length),
        }
    }
    fn pack(&mut self, tx: &mut TxBatch) -> Result<(), TxFull> {
        let mut frames = 0..self.frames;
        frames.try_for_each(|frame| tx.lane(id(0x100 + 16 * self.number + frame), 0, [1, 1]))
    }
}

/// Heard with its number as identifier, commanded from 0x100 + 16 x its number on.
fn dummy(number: u16) -> Dummy<Told> {
    let ids = CanIds::new()
        .receives(Frames::new(exact(number), 1, Rate::EveryTick))
        .transmits(Frames::new(exact(0x100 + 16 * number), 8, Rate::EveryTick));
    Dummy::new("dummy", number, ids).with(Told { number, frames: 1, ..Told::default() })
}

/// An armed bus with this motor alone.
fn armed(motor: Dummy<Told>, safety: Safety) -> MotorBus<'static> {
    let switch = &*Box::leak(Box::new(ArmSwitch::new()));
    let mut bus = MotorBus::new(switch);
    bus.attach(Box::leak(Box::new(motor)), safety).unwrap();
    switch.arm().unwrap();
    bus
}

/// One tick of a bus whose motors are all heard and commanded.
fn tick(bus: &mut MotorBus<'_>, now: Micros, tx: &mut TxBatch) -> Result<(), TxFull> {
    let motors: Vec<_> = bus.motors().collect();
    for (motor, name) in motors {
        bus.on_frame(&says(name.id, 0), now);
        bus.command(motor, Target::Speed(Rpm::new(1.0)), now).unwrap();
    }
    bus.tick(now, MS, tx)
}

/// One tick with a frame and a fresh command; what the motor was allowed.
fn tick_with(bus: &mut MotorBus<'_>, now: u64, byte: Option<u8>) -> (DriveMode, Link) {
    let now = Micros::from_millis(now);
    if let Some(byte) = byte {
        bus.on_frame(&says(1, byte), now);
    }
    bus.command(nth(0), Target::Speed(Rpm::new(1.0)), now).unwrap();
    bus.tick(now, MS, &mut TxBatch::new()).unwrap();
    let status = bus.status(nth(0), now).unwrap();
    let told = status.feedback.speed;
    assert_eq!(told, Rpm::new(f32::from(status.drive as u8)), "the motor was told otherwise");
    (status.drive, status.link)
}

fn drives(bus: &MotorBus<'_>) -> Vec<DriveMode> {
    bus.ids().map(|motor| bus.status(motor, Micros::ZERO).unwrap().drive).collect()
}

#[test]
fn behind_a_motor_that_fills_the_batch_the_others_are_still_decided_and_updated() {
    let switch = ArmSwitch::new();
    let (mut first, mut greedy, mut last) = (dummy(1), dummy(2), dummy(3));
    greedy.acts.frames = 16;
    let ticks = last.acts.ticks.clone();
    let mut bus = MotorBus::new(&switch);
    for motor in [&mut first, &mut greedy, &mut last] {
        bus.attach(motor, Safety::COAST).unwrap();
    }
    switch.arm().unwrap();
    let mut tx = TxBatch::new();
    assert_eq!(tick(&mut bus, Micros::from_millis(1), &mut tx), Err(TxFull));
    assert_eq!(drives(&bus), [DriveMode::Run; 3]);
    // Those that found room are in it.
    assert_eq!(tx.frames().len(), TxBatch::CAPACITY);
    assert_eq!((tx.frames()[0].raw_id(), tx.refused()), (0x110, Some(id(0x130).into())));
    switch.disarm();
    tx.clear();
    assert_eq!(tick(&mut bus, Micros::from_millis(2), &mut tx), Err(TxFull));
    assert_eq!(drives(&bus), [DriveMode::Off; 3]);
    let modes: Vec<_> = ticks.lock().unwrap().iter().map(|tick| tick.mode).collect();
    assert_eq!(modes, [DriveMode::Run, DriveMode::Off]);
}

#[test]
fn a_clear_that_is_refused_or_not_answered_does_not_end_a_fault() {
    for error in [RequestError::Refused(7), RequestError::Timeout] {
        let motor = dummy(1);
        let response = motor.acts.response.clone();
        let mut bus = armed(motor, Safety::BRAKE);
        bus.on_frame(&says(1, 1), Micros::ZERO);
        for (answer, drive) in [
            (None, DriveMode::Brake),
            (Some(Err(error)), DriveMode::Brake),
            // An answer to something else than a clear says nothing of the fault.
            (Some(Ok(Response::Done)), DriveMode::Brake),
        ] {
            if answer == Some(Err(error)) {
                assert_eq!(bus.request(nth(0), Request::ClearFault), Ok(Response::Pending));
            }
            *response.lock().unwrap() = answer;
            assert_eq!(bus.response(nth(0)), answer);
            tick(&mut bus, Micros::from_millis(1), &mut TxBatch::new()).unwrap();
            assert_eq!(drives(&bus), [drive], "{answer:?}");
        }
        bus.request(nth(0), Request::ClearFault).unwrap();
        *response.lock().unwrap() = Some(Ok(Response::Done));
        assert_eq!(bus.response(nth(0)), Some(Ok(Response::Done)));
        tick(&mut bus, Micros::from_millis(2), &mut TxBatch::new()).unwrap();
        assert_eq!(drives(&bus), [DriveMode::Run]);
    }
}

#[test]
fn a_motor_is_told_what_the_bus_knows_of_its_link() {
    let motor = dummy(1);
    let (ticks, links) = (motor.acts.ticks.clone(), motor.acts.links.clone());
    let mut bus = armed(motor, Safety::COAST);
    bus.switch().disarm();
    for (millis, is_heard) in [(1, false), (2, true), (12, true), (25, false), (26, true)] {
        if is_heard {
            bus.on_frame(&says(1, 0), Micros::from_millis(millis));
        }
        bus.tick(Micros::from_millis(millis), MS, &mut TxBatch::new()).unwrap();
    }
    let (never, online, lost) = (Link::NeverSeen, Link::Online, Link::Lost);
    assert_eq!(*links.lock().unwrap(), [never, online, lost]);
    let ticks: Vec<_> = ticks.lock().unwrap().iter().map(|tick| tick.link).collect();
    assert_eq!(ticks, [never, online, online, lost, online]);
}

#[test]
fn a_command_holds_until_it_expires_and_a_link_until_it_is_lost_to_the_microsecond() {
    let safety = Safety { command_expiry: Micros::from_millis(5), ..Safety::BRAKE };
    let mut bus = armed(dummy(1), safety);
    let switch = bus.switch();
    let expired = |bus: &MotorBus<'_>| bus.status(nth(0), Micros::ZERO).unwrap().counters.expired;
    let (run, brake) = (DriveMode::Run, DriveMode::Brake);
    let start = Micros::from_millis(100);
    tick(&mut bus, start, &mut TxBatch::new()).unwrap();
    for (after, drive) in
        [(4_999, run), (5_000, brake), (10_000, brake), (10_001, DriveMode::Coast)]
    {
        bus.tick(start + Micros::new(after), MS, &mut TxBatch::new()).unwrap();
        assert_eq!((drives(&bus), expired(&bus)), (vec![drive], u32::from(after >= 5_000)));
    }
    // A robot that is disarmed as a command expires has not missed it.
    let start = Micros::from_millis(200);
    tick(&mut bus, start, &mut TxBatch::new()).unwrap();
    assert_eq!(drives(&bus), [run]);
    switch.disarm();
    bus.tick(start + Micros::new(6_000), MS, &mut TxBatch::new()).unwrap();
    assert_eq!((drives(&bus), expired(&bus)), (vec![DriveMode::Off], 1));
    // A link that outlasts a command: the same for a command that is given again.
    switch.arm().unwrap();
    let start = Micros::from_millis(300);
    tick(&mut bus, start, &mut TxBatch::new()).unwrap();
    for (after, drive) in [(9_999, run), (10_000, run), (10_001, DriveMode::Coast)] {
        let now = start + Micros::new(after);
        bus.command(nth(0), Target::Coast, now).unwrap();
        bus.tick(now, MS, &mut TxBatch::new()).unwrap();
        assert_eq!(drives(&bus), [drive], "{after}");
    }
}

/// The bus keeps the low 32 bits of times: they are the same again after 71.6 minutes.
#[test]
fn a_pause_in_which_the_clocks_low_half_comes_round_revives_no_command() {
    let mut bus = armed(dummy(1), Safety::HOLD);
    let start = Micros::from_millis(5);
    tick(&mut bus, start, &mut TxBatch::new()).unwrap();
    assert_eq!(drives(&bus), [DriveMode::Run]);
    let mut now = Micros::new(start.get() + (1 << 32));
    // Nor is it heard, until it is.
    for drive in [DriveMode::Coast, DriveMode::Hold, DriveMode::Hold] {
        bus.tick(now, MS, &mut TxBatch::new()).unwrap();
        assert_eq!(drives(&bus), [drive]);
        bus.on_frame(&says(1, 0), now);
        now += Micros::from_millis(1);
    }
    assert_eq!(bus.status(nth(0), now).unwrap().counters.lost, 1);
    tick(&mut bus, now, &mut TxBatch::new()).unwrap();
    assert_eq!(drives(&bus), [DriveMode::Run]);
    // Nor a jog, whose time it keeps by the low 16 bits of the milliseconds.
    bus.switch().disarm();
    now += Micros::from_millis(1000);
    bus.on_frame(&says(1, 0), now);
    bus.tick(now, MS, &mut TxBatch::new()).unwrap();
    bus.request(nth(0), Request::Jog(Rpm::new(5.0))).unwrap();
    now += Micros::from_millis(1);
    bus.tick(now, MS, &mut TxBatch::new()).unwrap();
    assert_eq!(drives(&bus), [DriveMode::Run]);
    now += Micros::from_millis(1 << 16);
    for _ in 0..3 {
        bus.tick(now, MS, &mut TxBatch::new()).unwrap();
        assert_eq!(drives(&bus), [DriveMode::Off]);
        bus.on_frame(&says(1, 0), now);
        now += Micros::from_millis(1);
    }
}

#[test]
fn lanes_of_frames_of_unequal_length_clash() {
    let lane = |number, len, bytes| {
        let frames = Frames::new(exact(0x200), len, Rate::EveryTick);
        let ids = CanIds::new().transmits(frames.owned(Ownership::Bytes(bytes)));
        Dummy::new("dummy", number, ids)
    };
    let switch = ArmSwitch::new();
    let (mut first, mut second, mut shorter) = (lane(1, 8, 3), lane(2, 8, 12), lane(3, 6, 48));
    let mut bus = MotorBus::new(&switch);
    let slot = bus.attach(&mut first, Safety::COAST).unwrap();
    bus.attach(&mut second, Safety::COAST).unwrap();
    let name = |id| MotorName { model: "dummy", id };
    let clash = Clash::TxFrames(id(0x200).into());
    let refused = bus.attach(&mut shorter, Safety::COAST);
    assert_eq!(refused, Err(AttachError::Clash { motor: name(3), with: name(1), slot, clash }));
}

#[test]
fn a_motor_that_the_bus_has_no_room_for_is_refused_by_name() {
    let receives = |number: u16, count: u16| {
        let frames = |raw| Frames::new(exact(raw), 8, Rate::Rare);
        let all = (0..count).map(|index| frames(0x400 + 16 * number + index));
        Dummy::new("dummy", number, all.fold(CanIds::new(), CanIds::receives))
    };
    let switch = ArmSwitch::new();
    let mut greedy = receives(9, 9);
    let mut all: Vec<_> = (0..9).map(dummy).collect();
    let mut bus = MotorBus::new(&switch);
    let motor = MotorName { model: "dummy", id: 9 };
    let refused = bus.attach(&mut greedy, Safety::COAST).unwrap_err();
    assert_eq!(refused, AttachError::TooManyIds { motor });
    assert!(refused.to_string().starts_with("dummy id 9 declares more than 8 received"));
    let attached: Vec<_> = all.iter_mut().map(|motor| bus.attach(motor, Safety::COAST)).collect();
    let motor = MotorName { model: "dummy", id: 8 };
    for (index, attached) in attached.into_iter().enumerate() {
        let full = Err(AttachError::Full { motor, capacity: 8 });
        assert_eq!(attached, if index < 8 { Ok(nth(index)) } else { full });
    }
}

#[test]
fn each_motor_of_a_bus_counts_ticks_from_another_number_and_time_steps_are_bounded() {
    let switch = ArmSwitch::new();
    let (mut first, mut second) = (dummy(1), dummy(2));
    let (ours, theirs) = (first.acts.ticks.clone(), second.acts.ticks.clone());
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut first, Safety::COAST).unwrap();
    bus.attach(&mut second, Safety::COAST).unwrap();
    for (dt, given) in [(0.001, 0.001), (0.5, 0.01), (0.0, 0.001), (-1.0, 0.001), (f32::NAN, 0.001)]
    {
        bus.tick(Micros::ZERO, Seconds::new(dt), &mut TxBatch::new()).unwrap();
        let last = |ticks: &Seen<Vec<Tick>>| *ticks.lock().unwrap().last().unwrap();
        assert!((last(&ours).dt.get() - given).abs() < 1e-9, "{dt}");
        assert_eq!(last(&theirs).count, last(&ours).count + 1);
    }
    let counts: Vec<_> = ours.lock().unwrap().iter().map(|tick| tick.count).collect();
    assert!(counts.windows(2).all(|two| two[1] == two[0] + 1), "{counts:?}");
}

#[test]
fn a_fault_stops_the_motor_until_it_is_cleared() {
    let mut motor = dummy(1);
    motor.acts.at_once = true;
    let mut bus = armed(motor, Safety::BRAKE);
    assert_eq!(tick_with(&mut bus, 1, Some(0)), (DriveMode::Run, Link::Online));
    assert_eq!(tick_with(&mut bus, 2, Some(1)), (DriveMode::Brake, Link::Online));
    // That the fault goes by itself is not enough.
    assert_eq!(tick_with(&mut bus, 3, Some(0)), (DriveMode::Brake, Link::Online));
    bus.request(nth(0), Request::ClearFault).unwrap();
    assert_eq!(tick_with(&mut bus, 4, Some(0)), (DriveMode::Run, Link::Online));
    assert_eq!(bus.status(nth(0), Micros::ZERO).unwrap().counters.expired, 0);
}

#[test]
fn a_fault_is_cleared_when_the_device_says_so_and_not_before() {
    let mut bus = armed(dummy(1), Safety::COAST);
    assert_eq!(tick_with(&mut bus, 1, Some(1)), (DriveMode::Coast, Link::Online));
    assert_eq!(bus.request(nth(0), Request::ClearFault), Ok(Response::Pending));
    assert_eq!(bus.response(nth(0)), None);
    // A frame that was on its way still tells of the fault, and it is gone with the answer.
    assert_eq!(tick_with(&mut bus, 2, Some(1)), (DriveMode::Coast, Link::Online));
    assert_eq!(tick_with(&mut bus, 3, Some(3)), (DriveMode::Coast, Link::Online));
    assert_eq!(bus.response(nth(0)), Some(Ok(Response::Done)));
    assert_eq!(bus.response(nth(0)), None);
    assert_eq!(tick_with(&mut bus, 4, Some(0)), (DriveMode::Run, Link::Online));
}

#[test]
fn a_reply_that_is_no_feedback_does_not_keep_the_link_alive() {
    let mut bus = armed(dummy(1), Safety::HOLD);
    assert_eq!(tick_with(&mut bus, 1, Some(2)), (DriveMode::Coast, Link::NeverSeen));
    assert_eq!(tick_with(&mut bus, 2, Some(0)), (DriveMode::Run, Link::Online));
    for now in 3..=12 {
        assert_eq!(tick_with(&mut bus, now, Some(2)).1, Link::Online);
    }
    assert_eq!(tick_with(&mut bus, 13, Some(2)), (DriveMode::Coast, Link::Lost));
    // A motor once lost stays lost, also when the low half of the time has gone round.
    for millis in [4_294_967_u64, 4_294_972, 4_294_980] {
        assert_eq!(tick_with(&mut bus, millis, None), (DriveMode::Coast, Link::Lost));
    }
    let counters = bus.status(nth(0), Micros::ZERO).unwrap().counters;
    assert_eq!((counters.lost, counters.received), (1, 13));
}

#[test]
fn a_frame_that_arrives_during_the_tick_is_not_old() {
    let mut bus = armed(dummy(1), Safety::COAST);
    let now = Micros::from_millis(5);
    bus.on_frame(&says(1, 0), now + Micros::new(40));
    bus.command(nth(0), Target::Coast, now).unwrap();
    bus.tick(now, MS, &mut TxBatch::new()).unwrap();
    assert_eq!(bus.status(nth(0), now).unwrap().drive, DriveMode::Run);
}

#[test]
fn refusals_and_strangers_are_counted() {
    let mut bus = armed(dummy(1), Safety::COAST);
    let motor = nth(0);
    assert!(bus.command(motor, Target::Duty(0.5), Micros::ZERO).is_err());
    let missing = bus.command(nth(5), Target::Coast, Micros::ZERO);
    assert_eq!(missing, Err(CommandError::NoSuchMotor));
    let stranger = CanFrame::data_frame(id(0x55), &[]).unwrap();
    assert_eq!(bus.on_frame(&stranger, Micros::ZERO), Dispatch::Unclaimed);
    let wrong = Dispatch::Malformed(motor, FrameError::Length);
    assert_eq!(bus.on_frame(&says(1, 9), Micros::ZERO), wrong);
    let counters = bus.counters();
    assert_eq!((counters.received, counters.malformed, counters.unclaimed), (2, 1, 1));
    assert_eq!(counters.last_unclaimed, Some(0x55));
    assert_eq!(bus.status(motor, Micros::ZERO).unwrap().counters.refused.total(), 1);
}

#[test]
fn an_expiry_that_is_none_is_refused() {
    let switch = ArmSwitch::new();
    for micros in [0, 1_000_001] {
        let mut motor = dummy(1);
        let mut bus = MotorBus::new(&switch);
        let safety = Safety { command_expiry: Micros::new(micros), ..Safety::COAST };
        let refused = bus.attach(&mut motor, safety);
        assert!(matches!(refused, Err(AttachError::Expiry { .. })));
    }
}

/// Takes everything.
struct Port(Seen<Vec<CanFrame>>);

impl CanPort for Port {
    fn receive(&mut self) -> Option<(CanFrame, Micros)> {
        None
    }
    fn submit_as(&mut self, frame: &CanFrame, _: u32) -> Submitted {
        self.0.lock().unwrap().push(*frame);
        Submitted::Queued
    }
    fn cancel_pending(&mut self) -> u8 {
        0
    }
    fn health(&self) -> Health {
        Health::NEW
    }
}

#[test]
fn a_frame_that_waits_before_the_bus_runs_cannot_speak_in_a_motors_name() {
    let (switch, shared, sent) = (ArmSwitch::new(), BusPort::new(), Seen::default());
    let command = CanFrame::eight_bytes(id(0x110), [0x7F; 8]);
    let other = CanFrame::eight_bytes(id(0x300), [0x7F; 8]);
    // The port does not know its motors yet.
    shared.send(&command).unwrap();
    shared.send(&other).unwrap();
    let mut motor = dummy(1);
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut motor, Safety::COAST).unwrap();
    let mut runner = Runner::new(Port(sent.clone()), bus, &shared, Micros::ZERO);
    for millis in 1..=3 {
        runner.tick(|| Micros::from_millis(millis));
    }
    let sent = sent.lock().unwrap();
    assert!(sent.contains(&other) && !sent.contains(&command));
    assert_eq!(shared.status().refused, 1);
    assert!(shared.send(&command).is_err());
}

#[test]
fn loops_have_an_effort_while_they_drive_a_motor_that_is_heard() {
    let mut status = MotorStatus::NEW;
    status.feedback = Feedback::NEW.with_effort(2.5);
    let speed = Target::Speed(Rpm::new(1.0));
    let modes = [DriveMode::Run, DriveMode::Hold, DriveMode::Brake];
    for drive in modes.into_iter().chain([DriveMode::Coast, DriveMode::Off]) {
        for link in [Link::Online, Link::Lost, Link::NeverSeen] {
            for (target, follows) in [
                (speed, true),
                (Target::Motion(Motion::default()), true),
                (Target::Current(Amps::new(1.0)), false),
                (Target::Torque(NewtonMetres::new(1.0)), false),
                (Target::Duty(0.1), false),
                (Target::Impedance(Impedance::default()), false),
            ] {
                (status.drive, status.link, status.target) = (drive, link, target);
                let is_looped = follows && link == Link::Online && modes.contains(&drive);
                assert_eq!(status.is_looped(), is_looped, "{drive:?} {link:?} {target:?}");
                assert_eq!(status.effort(), is_looped.then_some(2.5));
            }
        }
    }
}

/// A jog drives one motor of a disarmed robot, and nothing else does.
#[test]
fn a_jog_ends_in_time_and_by_everything_that_matters_more() {
    /// One tick in which the motor is heard, and maybe asked to jog: what it may do, and the answer.
    fn turn(
        bus: &mut MotorBus<'_>,
        now: u64,
        rpm: Option<f32>,
        byte: u8,
    ) -> (DriveMode, Option<Result<Response, RequestError>>) {
        // It was heard in the tick before, too.
        let before = Micros::from_millis(now - 1);
        bus.on_frame(&says(1, if byte == 1 { 2 } else { byte }), before);
        bus.tick(before, MS, &mut TxBatch::new()).unwrap();
        let now = Micros::from_millis(now);
        bus.on_frame(&says(1, byte), now);
        let answer = rpm.map(|rpm| bus.request(nth(0), Request::Jog(Rpm::new(rpm))));
        bus.tick(now, MS, &mut TxBatch::new()).unwrap();
        (bus.status(nth(0), now).unwrap().drive, answer)
    }
    const DONE: Option<Result<Response, RequestError>> = Some(Ok(Response::Done));
    let armed = Some(Err(RequestError::NotWhileArmed));
    let switch = ArmSwitch::new();
    let (mut first, mut other) = (dummy(1), dummy(2));
    let mut bus = MotorBus::new(&switch);
    bus.attach(&mut first, Safety::COAST).unwrap();
    bus.attach(&mut other, Safety::COAST).unwrap();
    let (off, run) = (DriveMode::Off, DriveMode::Run);
    // Not before it was heard.
    let early = bus.request(nth(0), Request::Jog(Rpm::new(5.0)));
    assert_eq!(early, Err(RequestError::NoFeedback));
    assert_eq!(turn(&mut bus, 1, None, 0).0, off);
    // For 80 ms, and the other motor not at all.
    assert_eq!(turn(&mut bus, 2, Some(5.0), 0), (run, DONE));
    assert_eq!(bus.status(nth(1), Micros::from_millis(2)).unwrap().drive, off);
    assert!((3..80).all(|now| turn(&mut bus, now, None, 0).0 == run));
    assert!((83..90).all(|now| turn(&mut bus, now, None, 0).0 == off));
    // Released.
    assert_eq!(turn(&mut bus, 90, Some(5.0), 0), (run, DONE));
    assert_eq!(turn(&mut bus, 91, Some(0.0), 0), (off, DONE));
    // A link that is lost.
    assert_eq!(turn(&mut bus, 100, Some(5.0), 0), (run, DONE));
    let late = Micros::from_millis(130);
    bus.tick(late, MS, &mut TxBatch::new()).unwrap();
    assert_eq!(bus.status(nth(0), late).unwrap().drive, off);
    // A fault.
    assert_eq!(turn(&mut bus, 140, Some(5.0), 0), (run, DONE));
    assert_eq!(turn(&mut bus, 141, None, 1).0, off);
    assert_eq!(turn(&mut bus, 142, Some(5.0), 1), (off, Some(Err(RequestError::Busy))));
    let _ = bus.request(nth(0), Request::ClearFault);
    bus.on_frame(&says(1, 3), Micros::from_millis(143));
    while bus.response(nth(0)).is_some() {}
    // Arming: the motor has no command, and what the jog told it is not one.
    assert_eq!(turn(&mut bus, 150, Some(5.0), 0), (run, DONE));
    switch.arm().unwrap();
    assert_eq!(turn(&mut bus, 151, Some(5.0), 0), (DriveMode::Coast, armed));
    assert_eq!(turn(&mut bus, 152, None, 0).0, DriveMode::Coast);
    // Disarmed again: it does not go on by itself.
    switch.disarm();
    assert_eq!(turn(&mut bus, 153, None, 0).0, off);
    // A stop.
    assert_eq!(turn(&mut bus, 160, Some(5.0), 0), (run, DONE));
    switch.emergency_stop();
    assert_eq!(turn(&mut bus, 161, Some(5.0), 0), (off, armed));
    switch.reset();
    // A task's command ends it, and the next one is refused while that holds.
    assert_eq!(turn(&mut bus, 170, Some(5.0), 0), (run, DONE));
    bus.command(nth(0), Target::Speed(Rpm::new(900.0)), Micros::from_millis(171)).unwrap();
    assert_eq!(turn(&mut bus, 171, None, 0).0, off);
    assert_eq!(turn(&mut bus, 172, Some(5.0), 0), (off, Some(Err(RequestError::Busy))));
    assert_eq!(turn(&mut bus, 230, Some(5.0), 0), (run, DONE));
    assert_eq!(bus.status(nth(0), Micros::from_millis(230)).unwrap().counters.expired, 0);
    // An invalid speed.
    assert_eq!(turn(&mut bus, 231, Some(f32::NAN), 0), (off, Some(Err(RequestError::Unsupported))));
}
