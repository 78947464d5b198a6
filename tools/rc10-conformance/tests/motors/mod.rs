//! Each vendor's motor against its simulated device: two codecs that agree, closed loops, unplug,
//! restart, faults; the signal tables against the codecs.
#![allow(clippy::float_cmp, reason = "exact is meant")]

mod cybergear;
pub mod damiao;
mod damiao_values;
mod dji;
mod faults;
mod index;
pub mod lk;
pub mod odrive;
mod unitree_line;
mod unitree_module;
pub mod vesc;
mod vesc_values;

use std::marker::PhantomData;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rc10_app::Rpm;
use rc10_can::CanFrame;
use rc10_conformance::Bench;
use rc10_motor::signals::{Message, Presence};
use rc10_motor::{
    ArmSwitch, AttachError, CanMotor, Clash, Link, MotorBus, MotorId, MotorStatus, Request,
    RequestError, Response, Safety, Target, Tick, TxBatch,
};
use rc10_sim::{Device, Esc, Plant};

/// The same cases in every run.
fn cases(cases: u32) -> ProptestConfig {
    let rng_seed = RngSeed::Fixed(10);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

/// Any f32, NaN and infinities included; mostly those up to `usual`, either way.
fn number(usual: f32) -> impl Strategy<Value = f32> {
    const SPECIAL: [f32; 8] = [
        0.0,
        -0.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN,
        f32::MIN_POSITIVE,
    ];
    prop_oneof![
        4 => -usual..usual,
        2 => any::<u32>().prop_map(f32::from_bits),
        1 => prop::sample::select(&SPECIAL[..]),
    ]
}

/// The signals of a message that are there in a frame, by its table alone.
fn by_table(message: &Message, frame: &CanFrame) -> Vec<(&'static str, f64)> {
    let bytes = frame.bytes();
    let switch = message.signals.iter().find(|signal| signal.presence == Presence::Switch);
    let selected = switch.map(|signal| signal.raw(bytes).unwrap());
    let is_there = |presence| match presence {
        Presence::If(value) => selected == Some(value.into()),
        Presence::Always | Presence::Switch => true,
    };
    let there = message.signals.iter().filter(|signal| is_there(signal.presence));
    there.map(|signal| (signal.name, signal.physical(bytes).unwrap())).collect()
}

/// The values that the codec reads are all those of the table, each within so much of it, or no
/// number in both.
fn assert_same(
    message: &Message,
    frame: &CanFrame,
    ours: &[(&str, f64)],
    within: impl Fn(f64) -> f64,
) {
    let table = by_table(message, frame);
    assert_eq!(ours.len(), table.len(), "{} {frame}", message.name);
    for &(name, value) in ours {
        let (_, wanted) = *table.iter().find(|(known, _)| *known == name).expect(name);
        let same =
            value.is_nan() && !wanted.is_finite() || (value - wanted).abs() <= within(wanted);
        assert!(same || value == wanted, "{} {name} in {frame}: {value} {wanted}", message.name);
    }
}

/// The frames that a motor sends in a tick.
fn sent_in(motor: &mut impl CanMotor, tick: &Tick) -> TxBatch {
    motor.update(tick);
    let mut tx = TxBatch::new();
    motor.pack_command(&mut tx).unwrap();
    tx
}

/// Why the other one is refused on a bus with the first; `None` if it is not.
fn clash(one: &mut dyn CanMotor, other: &mut dyn CanMotor) -> Option<Clash> {
    let switch = ArmSwitch::new();
    let mut bus = MotorBus::new(&switch);
    bus.attach(one, Safety::COAST).unwrap();
    match bus.attach(other, Safety::COAST) {
        Ok(_) => None,
        Err(AttachError::Clash { clash, .. }) => Some(clash),
        Err(error) => panic!("{error}"),
    }
}

/// A motor that is back comes to 100 rpm; until it has been driven for 20 ms its current is at most
/// what it may be after so many.
fn assert_returns_softly(
    bench: &mut Bench<'_>,
    motor: MotorId,
    esc: &Esc,
    most: impl Fn(f64) -> f64,
) {
    let mut driven = 0.0;
    for _ in 0..1200 {
        bench.hold(motor, Target::Speed(Rpm::new(100.0)), 1).unwrap();
        let current = esc.state().current.abs();
        if current > 0.0 || driven > 0.0 {
            driven += 1.0;
            assert!(driven > 20.0 || current <= most(driven), "{current} A after {driven} ms");
        }
    }
    assert!(driven > 500.0);
    assert!((rpm(esc) - 100.0).abs() < 2.0, "{}", rpm(esc));
}

/// What a bench borrows, for as long as the tests run: none has to keep it.
fn leak<T>(value: T) -> &'static mut T {
    Box::leak(Box::new(value))
}

/// A motor of ours and its device, alone on a bus.
struct One<D> {
    bench: Bench<'static>,
    switch: &'static ArmSwitch,
    motor: MotorId,
    esc: Esc,
    device: PhantomData<D>,
}

impl<D: Device> One<D> {
    /// Both with power, disarmed.
    fn new(motor: impl CanMotor + 'static, device: D, plant: Plant, safety: Safety) -> Self {
        let switch = &*leak(ArmSwitch::new());
        let mut bench = Bench::new(7, switch);
        let esc = bench.wire.add(device, plant);
        let motor = bench.attach(leak(motor), safety).unwrap();
        Self { bench, switch, motor, esc, device: PhantomData }
    }

    /// Disarmed until the device was heard and looked at, then armed.
    fn armed(mut self) -> Self {
        self.bench.wait(20);
        assert_eq!((self.status().link, self.status().fault), (Link::Online, None));
        self.switch.arm().unwrap();
        self
    }

    fn status(&self) -> MotorStatus {
        self.bench.status(self.motor)
    }

    fn hold(&mut self, target: Target, millis: u32) {
        self.bench.hold(self.motor, target, millis).unwrap();
    }

    fn device<T>(&self, look: impl FnOnce(&mut D) -> T) -> T {
        self.esc.with(look).unwrap()
    }

    /// Speed and angle of its shaft.
    fn rpm(&self) -> f64 {
        rpm(&self.esc)
    }

    fn degrees(&self) -> f64 {
        self.esc.state().output_degrees
    }

    /// Makes a request, and waits for its answer.
    fn ask(&mut self, request: Request) -> Result<Response, RequestError> {
        let answer = self.bench.bus.request(self.motor, request)?;
        if answer != Response::Pending {
            return Ok(answer);
        }
        let answer = (0..1000).find_map(|_| {
            self.bench.tick();
            self.bench.bus.response(self.motor)
        });
        answer.unwrap_or_else(|| panic!("no answer to {request:?}"))
    }
}

impl<D> Drop for One<D> {
    fn drop(&mut self) {
        assert!(std::thread::panicking() || self.bench.refused == 0);
    }
}

fn rpm(esc: &Esc) -> f64 {
    esc.state().output_rpm
}

/// Milliseconds until what is measured stays within `band` of the goal for 200 ms.
fn settles(
    bench: &mut Bench<'_>,
    motor: MotorId,
    target: Target,
    off: impl Fn() -> f64,
    band: f64,
) -> u32 {
    let mut inside_since = 0;
    for millis in 1..4000 {
        bench.hold(motor, target, 1).unwrap();
        if off().abs() > band {
            inside_since = millis;
        }
        if millis - inside_since > 200 {
            return inside_since;
        }
    }
    panic!("does not settle: off by {}", off());
}
