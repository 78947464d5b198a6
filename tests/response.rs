//! Worst response times, against the simulated wire in random phases, and `rc10 plan`, which tells them.

use std::cell::RefCell;
use std::rc::Rc;

use rc10_can::embedded_can::{Id, StandardId};
use rc10_can::response::{Stream, response};
use rc10_can::{CanFrame, IdPattern};
use rc10_sim::{BusConfig, Device, Outbox, Plant, Shaft, Winding, World};
use rc10_time::Micros;

/// Sends a frame each period, and notes when.
struct Sender {
    frame: CanFrame,
    period: Micros,
    next: Micros,
    ready: Rc<RefCell<Vec<Micros>>>,
}

impl Device for Sender {
    fn power_on(&mut self, _shaft: &Shaft, now: Micros, phase: Micros) {
        self.next = now + phase;
    }

    fn period(&self) -> Micros {
        self.period
    }

    fn next_event(&self) -> Option<Micros> {
        Some(self.next)
    }

    fn advance(&mut self, _shaft: &Shaft, now: Micros, out: &mut Outbox) {
        if self.next <= now {
            out.push(self.frame);
            self.ready.borrow_mut().push(self.next);
            self.next += self.period;
        }
    }

    fn drive(&mut self, _shaft: &Shaft, _now: Micros) -> Winding {
        Winding::Open
    }
}

/// The longest of frames with this identifier that some thousand payloads make.
fn longest(id: u16) -> CanFrame {
    let id = StandardId::new(id).unwrap();
    let mut state = 1_u64;
    let payloads = (0..3000).map(|_| {
        std::array::from_fn(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            [0x0F, 0x1E, 0x3C, 0x78, 0xF0, 0xE1, 0xC3, 0x87][(state >> 61) as usize]
        })
    });
    payloads
        .map(|payload| CanFrame::eight_bytes(id, payload))
        .max_by_key(|frame| frame.wire_length().total())
        .unwrap()
}

/// The longest times of the senders' frames, in worlds of these seeds.
fn measured(senders: &[(u16, u64)], seeds: std::ops::Range<u64>) -> Vec<u64> {
    let frames: Vec<_> = senders.iter().map(|(id, _)| longest(*id)).collect();
    let mut worst = vec![0; senders.len()];
    for seed in seeds {
        let mut world = World::new(seed);
        let bus = world.add_bus(BusConfig::default());
        let ready: Vec<Rc<RefCell<Vec<Micros>>>> = senders.iter().map(|_| Rc::default()).collect();
        for ((frame, (_, period)), ready) in frames.iter().zip(senders).zip(&ready) {
            let (period, ready) = (Micros::new(*period), Rc::clone(ready));
            let sender = Sender { frame: *frame, period, next: Micros::ZERO, ready };
            let _esc = bus.add(sender, Plant::m3508());
        }
        world.advance(Micros::from_millis(12));
        let trace = bus.take_trace();
        for ((at, (id, _)), ready) in senders.iter().enumerate().zip(&ready) {
            let id = Id::Standard(StandardId::new(*id).unwrap());
            let sent = trace.iter().filter(|entry| entry.frame.id() == id);
            for (entry, ready) in sent.zip(&*ready.borrow()) {
                worst[at] = worst[at].max(entry.at.get() - ready.get());
            }
        }
    }
    worst
}

/// `RC10_PHASES=1000000 cargo test --release -p rc10-tool --test all response:: -- --nocapture` has a million.
#[test]
fn no_phase_is_later_than_the_time_that_is_computed() {
    let phases = std::env::var("RC10_PHASES").map_or(3000, |phases| phases.parse().unwrap());
    let senders =
        [(0x201, 1000), (0x202, 500), (0x203, 1000), (0x204, 1000), (0x205, 2000), (0x206, 1000)];
    let stream = |(id, period): &(u16, u64)| {
        Stream::new(IdPattern::standard(*id), 8, u32::try_from(*period).unwrap())
    };
    let streams: Vec<_> = senders.iter().map(stream).collect();
    let mut shares = Vec::new();
    for (at, worst) in measured(&senders, 0..phases).into_iter().enumerate() {
        let bound = response(&streams, at, 0).unwrap();
        println!("{:#x}: {worst} us at most in {phases} phases, {bound} computed", senders[at].0);
        assert!(worst <= bound.into(), "{worst} {bound}");
        shares.push(worst as f64 / f64::from(bound));
    }
    // Each bound is nearly reached: none is a guess on the safe side.
    let least = if phases >= 1_000_000 { 0.9 } else { 0.75 };
    assert!(shares.iter().all(|share| *share >= least), "{shares:?}");
}

fn plan(arguments: &[&str]) -> (bool, String) {
    let program = env!("CARGO_BIN_EXE_rc10");
    let output = std::process::Command::new(program).arg("plan").args(arguments).output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    (output.status.success(), text.concat())
}

#[test]
fn the_plan_tells_what_fits_and_adds_motors_that_are_thought_of() {
    let json = |arguments: &[&str]| -> serde_json::Value {
        serde_json::from_str(&plan(&[arguments, &["--json"]].concat()).1).unwrap()
    };
    let before = json(&[]);
    let fits = before["buses"][0]["fits"][0]["more"].as_u64().unwrap();
    assert_eq!(before["buses"][0]["fits"][0]["motor"], "M3508 at 1 kHz");
    // As many fit as it says, and not one more.
    let many = |count: u64| plan(&["--add", &format!("1:M3508*{count}")]);
    assert!(fits > 0 && many(fits).0, "{fits}");
    let (is_fine, error) = many(fits + 1);
    assert!(
        !is_fine && error.contains(&format!("{} more like M3508 on bus 1", fits + 1)),
        "{error}"
    );
    // Each motor more makes the least urgent frame later; error frames do, too.
    let last = |plan: &serde_json::Value| {
        let frames = plan["buses"][0]["frames"].as_array().unwrap();
        frames.iter().filter_map(|frame| frame["response_us"].as_u64()).max().unwrap()
    };
    let [more, errors] = [json(&["--add", "1:M3508@500"]), json(&["--errors", "1000"])];
    assert!(last(&more) > last(&before) && last(&errors) > last(&before));
    assert!(more["buses"][0]["motors"].as_array().unwrap().iter().any(|it| it["label"] == "new 1"));
    // One like another of the robot's.
    let (is_fine, text) = plan(&["--add", "2:gimbal-yaw"]);
    assert!(is_fine && text.contains("new 1"), "{text}");
    for (wrong, says) in [
        ("1", "BUS:MOTOR[@HZ][*N]"),
        ("4:M3508", "the robot has no bus 4"),
        ("1:M3509", "there is no motor `M3509`"),
        ("1:M3508@300", "no feedback rate of 300 Hz: it is one of 1000, 500, 250, 125"),
        ("1:M3508*0", "N is 1 to 255"),
    ] {
        let (is_fine, error) = plan(&["--add", wrong]);
        assert!(!is_fine && error.contains(says), "{wrong}: {error}");
    }
}
