//! A controller of another kind on a wire: what it is asked and told, and when, to the nanosecond.

use std::cell::RefCell;
use std::pin::pin;
use std::rc::Rc;

use embassy_time::Timer;
use rc10_can::embedded_can::StandardId;
use rc10_can::{BusError, CanFrame, CanPort};
use rc10_sim::{
    Activity, Bus, BusConfig, Controller, Esc, EscConfig, Model, Nanos, Outcome, World,
    tolerance_ppm,
};
use rc10_time::Micros;

/// Sends one frame once, and writes down what it hears.
struct Probe {
    is_on_bus: bool,
    is_connected: bool,
    bit_time_ns: Option<u32>,
    tolerance_ppm: u32,
    request: Option<CanFrame>,
    event: Option<Nanos>,
    log: Vec<(u64, String)>,
}

impl Probe {
    fn note(&mut self, at: Nanos, what: impl ToString) {
        self.log.push((at.get(), what.to_string()));
    }

    fn take_log(&mut self) -> Vec<(u64, String)> {
        std::mem::take(&mut self.log)
    }
}

impl Controller for Probe {
    fn is_on_bus(&self) -> bool {
        self.is_on_bus
    }
    fn is_connected(&self) -> bool {
        self.is_connected
    }
    fn bit_time_ns(&self) -> Option<u32> {
        self.bit_time_ns
    }
    fn tolerance_ppm(&self) -> u32 {
        self.tolerance_ppm
    }
    fn offer(&mut self, _now: Nanos) -> Option<CanFrame> {
        self.request
    }
    fn sending(&mut self, start: Nanos) {
        let frame = self.request.take().unwrap();
        self.note(start, format!("sends {frame}"));
    }
    fn lost_arbitration(&mut self, start: Nanos) {
        self.note(start, "lost");
    }
    fn sent(&mut self, outcome: Outcome, end: Nanos) {
        self.note(end, format!("{outcome:?}"));
    }
    fn received(&mut self, frame: &CanFrame, start: Nanos, end: Nanos) {
        self.note(end, format!("received {frame} from {}", start.get()));
    }
    fn disturbed(&mut self, error: BusError, at: Nanos) {
        self.note(at, format!("disturbed {error:?}"));
    }
    fn wire_is(&mut self, activity: Activity, at: Nanos) {
        self.note(at, format!("{activity:?}"));
    }
    fn next_event(&self) -> Option<Nanos> {
        self.event
    }
    fn advance(&mut self, now: Nanos) {
        self.event = None;
        self.note(now, "event");
    }
}

/// A bus with a probe and a silent ESC.
fn probed() -> (World, Bus, Rc<RefCell<Probe>>, Esc) {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    let esc = bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap();
    esc.set_feedback(false);
    let probe = Rc::new(RefCell::new(Probe {
        is_on_bus: true,
        is_connected: true,
        bit_time_ns: None,
        tolerance_ppm: 0,
        request: None,
        event: None,
        log: Vec::new(),
    }));
    bus.attach(Rc::<RefCell<Probe>>::clone(&probe));
    assert_eq!(probe.borrow_mut().take_log(), log(&[(0, "Idle")]));
    (world, bus, probe, esc)
}

fn log(lines: &[(u64, &str)]) -> Vec<(u64, String)> {
    lines.iter().map(|&(at, what)| (at, what.to_string())).collect()
}

fn frame(id: u16) -> CanFrame {
    CanFrame::data_frame(StandardId::new(id).unwrap(), &[]).unwrap()
}

/// Length of [`frame`] without interframe space, in nanoseconds.
fn length(id: u16) -> u64 {
    (u64::from(frame(id).wire_length().total()) - 3) * 1000
}

/// As an emulator lets a world pass, which writes its request at `at`.
fn emulate(world: &mut World, probe: &RefCell<Probe>, at: u64, request: CanFrame, until: u64) {
    while world.now_ns().get() < until {
        let now = world.now_ns();
        let horizon = world.next_event();
        assert!(horizon > now);
        let next = if now.get() < at { horizon.get().min(at) } else { horizon.get() };
        if next == at {
            // Before the world knows that it is so late.
            probe.borrow_mut().request = Some(request);
        }
        world.advance_to(Nanos::new(next));
    }
}

#[test]
fn a_request_on_an_idle_wire_starts_at_its_nanosecond() {
    let (mut world, bus, probe, esc) = probed();
    let start = 1_234_567;
    emulate(&mut world, &probe, start, frame(0x100), 2_000_000);
    let end = start + length(0x100);
    let lines =
        [(start, "sends 100#"), (start, "Busy"), (end, "Acknowledged"), (end + 3000, "Idle")];
    assert_eq!(probe.borrow_mut().take_log(), log(&lines));
    let entry = bus.take_trace()[0];
    assert_eq!((entry.start.get(), entry.end.get()), (start, end));
    assert_eq!(entry.at, Micros::new((end + 3000) / 1000));
    assert!(entry.from_controller);
    assert_eq!(esc.state().commands, 0);
}

#[test]
fn a_request_during_a_frame_starts_where_the_interframe_space_ends() {
    let (mut world, bus, probe, _) = probed();
    bus.inject(&frame(0x200));
    emulate(&mut world, &probe, 12_345, frame(0x100), 200_000);
    let first = length(0x200);
    let second = first + 3000 + length(0x100);
    let lines = [
        (0, "Busy"),
        (first, "received 200# from 0"),
        (first + 3000, "Idle"),
        (first + 3000, "sends 100#"),
        (first + 3000, "Busy"),
        (second, "Acknowledged"),
        (second + 3000, "Idle"),
    ];
    assert_eq!(probe.borrow_mut().take_log(), log(&lines));
}

#[test]
fn who_loses_arbitration_is_told_and_offers_again() {
    let (mut world, bus, probe, _) = probed();
    bus.inject(&frame(0x0FF));
    probe.borrow_mut().request = Some(frame(0x100));
    world.advance(Micros::new(200));
    let first = length(0x0FF);
    let lines = probe.borrow_mut().take_log();
    assert_eq!(lines[..2], log(&[(0, "lost"), (0, "Busy")]));
    assert_eq!(lines[4], (first + 3000, "sends 100#".to_string()));
}

#[test]
fn the_next_event_is_the_next_thing_that_happens() {
    let (mut world, bus, probe, _) = probed();
    // Physics.
    assert_eq!(world.next_event().get(), 100_000);
    probe.borrow_mut().event = Some(Nanos::new(99_999));
    assert_eq!(world.next_event().get(), 99_999);
    world.advance_to(Nanos::new(99_998));
    assert_eq!(probe.borrow_mut().take_log(), []);
    world.advance_to(Nanos::new(99_999));
    assert_eq!(probe.borrow_mut().take_log(), log(&[(99_999, "event")]));
    // Asked for too late: at once.
    probe.borrow_mut().event = Some(Nanos::new(7));
    assert_eq!(world.next_event().get(), 100_000);
    assert_eq!(probe.borrow_mut().take_log(), log(&[(99_999, "event")]));

    bus.inject(&frame(0x200));
    assert_eq!(world.next_event().get(), 100_000);
    world.advance_to(Nanos::new(100_000));
    let end = 99_999 + length(0x200);
    assert_eq!(world.next_event().get(), end);
    world.advance_to(Nanos::new(end));
    assert_eq!(world.next_event().get(), end + 3000);

    let mut timer = pin!(Timer::after_micros(25));
    assert!(world.run(timer.as_mut(), world.now()).is_pending());
    world.advance_to(Nanos::new(end + 3000));
    assert_eq!(world.next_event(), Nanos::from(Micros::new(end / 1000 + 25)));
}

/// Forgets to do what it said.
struct Stubborn;

impl Controller for Stubborn {
    fn is_on_bus(&self) -> bool {
        false
    }
    fn offer(&mut self, _now: Nanos) -> Option<CanFrame> {
        None
    }
    fn sending(&mut self, _start: Nanos) {}
    fn sent(&mut self, _outcome: Outcome, _end: Nanos) {}
    fn received(&mut self, _frame: &CanFrame, _start: Nanos, _end: Nanos) {}
    fn next_event(&self) -> Option<Nanos> {
        Some(Nanos::ZERO)
    }
}

#[test]
fn no_controller_can_stop_time() {
    let mut world = World::new(1);
    world.add_bus(BusConfig::default()).attach(Rc::new(RefCell::new(Stubborn)));
    assert_eq!(world.next_event(), Nanos::new(1));
    world.advance(Micros::new(10));
    assert_eq!(world.now_ns(), Nanos::new(10_000));
}

#[test]
fn the_port_of_a_replaced_controller_is_a_dead_end() {
    let (mut world, bus, probe, _) = probed();
    let mut port = bus.port();
    let _ = port.submit(&frame(0x100));
    bus.inject(&frame(0x200));
    world.advance(Micros::from_millis(1));
    assert_eq!(port.receive(), None);
    let sent: Vec<_> = bus.take_trace().iter().map(|entry| entry.frame).collect();
    assert_eq!(sent, [frame(0x200)]);
    assert_eq!(port.cancel_pending(), 1);
    assert!(probe.borrow().log.len() > 2);
}

#[test]
fn a_controller_that_is_replaced_within_its_frame_destroys_it() {
    let mut world = World::new(1);
    let bus = world.add_bus(BusConfig::default());
    bus.add_esc(EscConfig::new(Model::C620, 1)).unwrap().set_feedback(false);
    let _ = bus.port().submit(&frame(0x100));
    world.advance(Micros::new(10));
    let probe = probed().2;
    bus.attach(Rc::<RefCell<Probe>>::clone(&probe));
    world.advance(Micros::from_millis(1));
    // 14 bits of error frame and 3 of interframe space.
    assert_eq!(probe.borrow_mut().take_log(), log(&[(10_000, "Busy"), (27_000, "Idle")]));
    assert_eq!((bus.counters().frames, bus.counters().destroyed), (0, 1));
    assert_eq!(bus.take_trace(), []);
}

#[test]
fn unplugged_it_is_alone() {
    let (mut world, bus, probe, _) = probed();
    probe.borrow_mut().is_connected = false;
    bus.inject(&frame(0x200));
    probe.borrow_mut().request = Some(frame(0x300));
    world.advance(Micros::new(200));
    let end = length(0x300);
    let lines = [(0, "sends 300#"), (0, "Busy"), (end, "Unacknowledged"), (end + 3000, "Idle")];
    assert_eq!(probe.borrow_mut().take_log(), log(&lines));
    assert_eq!((bus.counters().frames, bus.counters().unacknowledged), (1, 0));

    // Plugged in within a frame it hears that the wire is busy, but not the frame.
    bus.inject(&frame(0x200));
    world.advance(Micros::new(210));
    probe.borrow_mut().is_connected = true;
    world.advance(Micros::new(300));
    let free = 203_000 + length(0x200);
    assert_eq!(probe.borrow_mut().take_log(), log(&[(210_000, "Busy"), (free, "Idle")]));
}

#[test]
fn unplugged_within_its_frame_it_goes_on_alone() {
    let (mut world, bus, probe, _) = probed();
    probe.borrow_mut().request = Some(frame(0x300));
    world.advance(Micros::new(10));
    probe.borrow_mut().is_connected = false;
    bus.inject(&frame(0x200));
    world.advance(Micros::new(200));
    let end = length(0x300);
    let lines = [(0, "sends 300#"), (0, "Busy"), (end, "Unacknowledged"), (end + 3000, "Idle")];
    assert_eq!(probe.borrow_mut().take_log(), log(&lines));
    assert_eq!((bus.counters().frames, bus.counters().destroyed), (1, 1));
    // The others' error frame and interframe space come first.
    assert_eq!(bus.take_trace()[0].start.get(), 10_000 + 17_000);
}

#[test]
fn a_controller_that_leaves_the_bus_within_its_frame_destroys_it() {
    let (mut world, bus, probe, _) = probed();
    probe.borrow_mut().request = Some(frame(0x300));
    world.advance(Micros::new(10));
    probe.borrow_mut().is_on_bus = false;
    world.advance(Micros::new(20));
    // Back before the frame would have ended.
    probe.borrow_mut().is_on_bus = true;
    world.advance(Micros::new(200));
    let lines = [(0, "sends 300#"), (0, "Busy"), (24_000, "Destroyed(Bit)"), (27_000, "Idle")];
    assert_eq!(probe.borrow_mut().take_log(), log(&lines));
    assert_eq!((bus.counters().frames, bus.counters().destroyed), (0, 1));
}

#[test]
fn a_controller_that_leaves_within_its_frame_on_no_bus_is_told_so() {
    let (mut world, _, probe, _) = probed();
    probe.borrow_mut().is_connected = false;
    probe.borrow_mut().request = Some(frame(0x300));
    world.advance(Micros::new(10));
    probe.borrow_mut().is_on_bus = false;
    world.advance(Micros::new(200));
    let line = (24_000, "Destroyed(Bit)".to_string());
    assert_eq!(probe.borrow().log[2], line);
}

#[test]
fn off_the_bus_it_neither_sends_nor_hears_nor_acknowledges() {
    let (mut world, bus, probe, esc) = probed();
    esc.set_power(false);
    probe.borrow_mut().is_on_bus = false;
    probe.borrow_mut().request = Some(frame(0x100));
    bus.inject(&frame(0x200));
    world.advance(Micros::new(100));
    let lines = probe.borrow_mut().take_log();
    assert!(lines.iter().all(|(_, line)| line == "Busy" || line == "Idle"), "{lines:?}");
    assert_eq!((bus.counters().frames, bus.counters().unacknowledged), (0, 2));
    // On the bus within a frame: that one it does not hear, the next one it does.
    probe.borrow_mut().is_on_bus = true;
    probe.borrow_mut().request = None;
    world.advance(Micros::from_millis(1));
    let period = length(0x200) + 3000;
    let received = format!("received 200# from {}", 2 * period);
    let lines = probe.borrow_mut().take_log();
    let heard: Vec<_> = lines.iter().filter(|(_, line)| line.starts_with("rec")).collect();
    assert_eq!(heard, [&(2 * period + length(0x200), received)]);

    // Off it for an instant it has missed the frame.
    bus.inject(&frame(0x200));
    world.advance(Micros::new(1010));
    probe.borrow_mut().is_on_bus = false;
    world.advance(Micros::new(1011));
    probe.borrow_mut().is_on_bus = true;
    world.advance(Micros::new(1000 + period / 1000));
    let end = 1_000_000 + period;
    assert_eq!(probe.borrow_mut().take_log(), log(&[(1_000_000, "Busy"), (end, "Idle")]));
}

#[test]
fn another_bit_rate_destroys_what_it_sends_and_understands_nothing() {
    let (mut world, bus, probe, esc) = probed();
    probe.borrow_mut().bit_time_ns = Some(1008);
    probe.borrow_mut().tolerance_ppm = tolerance_ppm(10, 3, 1);
    probe.borrow_mut().request = Some(frame(0x100));
    world.advance(Micros::new(200));
    let end = length(0x100) + 14_000;
    let lines = [(0, "sends 100#"), (0, "Busy"), (end, "Destroyed(Bit)"), (end + 3000, "Idle")];
    assert_eq!(probe.borrow_mut().take_log(), log(&lines));
    assert_eq!((bus.counters().frames, bus.counters().destroyed), (0, 1));

    bus.inject(&frame(0x200));
    world.advance(Micros::new(300));
    let end = 200_000 + length(0x200);
    let lines = [(200_000, "Busy"), (end, "disturbed Stuff"), (end + 3000, "Idle")];
    assert_eq!(probe.borrow_mut().take_log(), log(&lines));

    // It does not acknowledge, either; 0.7 per cent off it does.
    esc.set_power(false);
    bus.inject(&frame(0x200));
    world.advance(Micros::new(1000));
    assert_eq!(bus.counters().frames, 1);
    probe.borrow_mut().bit_time_ns = Some(993);
    world.advance(Micros::new(1200));
    assert_eq!(bus.counters().frames, 2);
}

/// 1.9 per cent off, with segments for that: it follows the ESCs, and they do not follow it.
#[test]
fn each_end_follows_as_its_own_bit_timing_says() {
    // The arithmetic of ISO 11898-1, by hand: 80 quanta; ST's F407 at 21; CubeMX's jump of 1 at 14 and 21.
    let expected = [19_607, 18_656, 7_142, 4_761];
    let timings = [(59, 20, 20), (15, 5, 4), (10, 3, 1), (16, 4, 1)];
    assert_eq!(timings.map(|(before, after, jump)| tolerance_ppm(before, after, jump)), expected);
    let (mut world, bus, probe, _esc) = probed();
    for (bit_time_ns, is_heard) in [(1019, true), (1020, false), (981, true), (980, false)] {
        probe.borrow_mut().bit_time_ns = Some(bit_time_ns);
        probe.borrow_mut().tolerance_ppm = expected[0];
        probe.borrow_mut().request = Some(frame(0x100));
        let (before, start) = (bus.counters(), world.now());
        world.advance(start + Micros::new(300));
        assert_eq!(bus.counters().destroyed, before.destroyed + 1, "{bit_time_ns}");
        bus.inject(&frame(0x200));
        world.advance(start + Micros::new(1000));
        let heard = probe.borrow_mut().take_log();
        let heard = heard.iter().any(|(_, what)| what.starts_with("received 200#"));
        assert_eq!(heard, is_heard, "{bit_time_ns}");
    }
}
