//! The program of `cargo xtask count`: a bus's millisecond, without executor and peripherals.
//!
//! Every function whose symbol is `count_<units>_<name>` is a measurement: the instructions from
//! its call to its return, per call and per unit. `count_done` ends the run.
//!
//! It also tells the hash of each walk through rc10-app by `walked`: a PC must have the same.
#![no_std]
#![no_main]

mod bases;
mod codecs;
mod control;
mod paths;
mod profiles;
mod streams;
#[path = "../../../crates/rc10-app/tests/walk/mod.rs"]
mod walk;

use core::hint::black_box;

use cortex_m_rt::entry;
// For its interrupt vectors alone: built together with the firmware, cortex-m-rt asks for them.
use embassy_stm32 as _;
use rc10_app::{Degrees, Rpm, Seconds};
use rc10_can::CanFrame;
use rc10_can::embedded_can::StandardId;
use rc10_motor::dji::{self, Dji, M2006, M3508};
use rc10_motor::{ArmSwitch, CanMotor, MotorBus, Safety, Target, TxBatch};
use rc10_time::Micros;

/// The motors' identifiers: M3508 are 1 to 4, M2006 5 to 8.
const IDS: [u8; 8] = [1, 2, 3, 4, 5, 6, 7, 8];
const TICK: Micros = Micros::from_millis(1);
/// Milliseconds for which each measurement is repeated …
const ROUNDS: u16 = 450;
/// … after these in which the motors are armed and started softly.
const WARM_UP: u16 = 50;

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // `xtask count` sees the fault and names its address.
    cortex_m::asm::udf()
}

#[entry]
fn main() -> ! {
    measure(|_, rpm| Target::Speed(rpm), speed_tick);
    measure(|degrees, _| Target::Angle(degrees), angle_tick);
    measure(|_, rpm| Target::Speed(rpm), frames);
    measure(|_, _| Target::Coast, coasting_tick);
    bases::measure();
    codecs::measure();
    profiles::measure();
    paths::measure();
    streams::measure();
    control::measure();
    for (number, &(_, walk)) in (0..).zip(walk::WALKS) {
        let hash = walk::hash(black_box(walk));
        let half = |bits: u64| u32::try_from(bits & 0xFFFF_FFFF).unwrap_or_default();
        walked(number, half(hash >> 32), half(hash));
    }
    done()
}

/// Four M3508 and four M2006 on one bus that follow a moving target closely; `tick` once a
/// millisecond. `target` makes one from the output's angle and speed.
fn measure(
    target: fn(Degrees, Rpm) -> Target,
    tick: extern "C" fn(&mut MotorBus<'_>, &Input, &mut TxBatch),
) {
    let switch = ArmSwitch::new();
    let mut motors =
        IDS.map(|id| Dji::new(dji::Config::new(if id <= 4 { &M3508 } else { &M2006 }, id)).ok());
    let mut bus = MotorBus::new(&switch);
    let numbers = motors.each_mut().map(|motor| {
        let Some(motor) = motor else { cortex_m::asm::udf() };
        let motor: &mut dyn CanMotor = motor;
        let attached = bus.attach(black_box(motor), Safety::COAST);
        attached.unwrap_or_else(|_| cortex_m::asm::udf())
    });
    if switch.arm().is_err() {
        cortex_m::asm::udf();
    }
    let mut tx = TxBatch::new();
    for round in 1..=ROUNDS {
        let input = black_box(Input::of(round));
        for motor in numbers {
            let Some(status) = bus.status(motor, input.now) else { cortex_m::asm::udf() };
            // As fast as it turns, and as far ahead as asks for that: no loop is at its limit.
            let speed = status.feedback.speed;
            let ahead = Degrees::new(status.feedback.angle.get() + speed.get() / 1.3);
            // A motor that is not heard yet takes it as well.
            let _ = bus.command(motor, target(ahead, speed), input.now);
        }
        tx.clear();
        if round <= WARM_UP {
            everything(&mut bus, &input, &mut tx);
        } else {
            tick(&mut bus, &input, &mut tx);
        }
        black_box(tx.frames());
    }
}

/// Input of one millisecond.
struct Input {
    now: Micros,
    frames: [CanFrame; IDS.len()],
}

impl Input {
    /// Rotors that speed up slowly, to 4000 rpm, so that turns are counted too.
    fn of(round: u16) -> Self {
        let frame = |id: u8| {
            let speed = round * 10;
            // 8192 counts a turn; rpm / 60,000 turns in a millisecond, summed up.
            let angle = u32::from(round) * u32::from(round) * 5 * 8192 / 60_000 % 8192;
            let angle = u16::try_from(angle).unwrap_or(0);
            let current = 500_u16;
            let ([a, b], [c, d], [e, f]) =
                (angle.to_be_bytes(), speed.to_be_bytes(), current.to_be_bytes());
            let id = StandardId::new(0x200 + u16::from(id)).unwrap_or(StandardId::ZERO);
            CanFrame::eight_bytes(id, [a, b, c, d, e, f, 30, 0])
        };
        Self { now: Micros::from_millis(round.into()), frames: IDS.map(frame) }
    }
}

fn everything(bus: &mut MotorBus<'_>, input: &Input, tx: &mut TxBatch) {
    for frame in &input.frames {
        bus.on_frame(frame, input.now);
    }
    let _ = bus.tick(input.now, Seconds::from_micros(TICK.get()), tx);
}

fn receive(bus: &mut MotorBus<'_>, input: &Input, _: &mut TxBatch) {
    for frame in &input.frames {
        bus.on_frame(frame, input.now);
    }
}

/// Gives a function of its own, and a symbol to find it by, to something that is measured.
macro_rules! measured {
    ($(#[$doc:meta])* $symbol:literal, $name:ident, $what:ident) => {
        $(#[$doc])*
        // SAFETY: nothing else has this name.
        #[unsafe(export_name = $symbol)]
        #[inline(never)]
        extern "C" fn $name(bus: &mut MotorBus<'_>, input: &Input, tx: &mut TxBatch) {
            // SAFETY: a comment. It keeps the compiler from merging functions that are equal.
            unsafe { core::arch::asm!(concat!("// ", $symbol), options(nomem, nostack)) };
            $what(bus, input, tx);
        }
    };
}

measured! {
    /// Eight frames received and dispatched, eight speed loops, two group frames.
    "count_8_motor_speed", speed_tick, everything
}
measured! {
    /// The tick above with the angle loop before the speed loop.
    "count_8_motor_angle", angle_tick, everything
}
measured! {
    /// The tick above without a loop.
    "count_8_motor_coasting", coasting_tick, everything
}
measured! {
    /// The receiving half alone.
    "count_8_frame_received", frames, receive
}

/// A walk is over: its number, and its hash.
// SAFETY: nothing else has this name.
#[unsafe(export_name = "walked")]
#[inline(never)]
extern "C" fn walked(number: u32, high: u32, low: u32) {
    black_box((number, high, low));
}

// SAFETY: nothing else has this name.
#[unsafe(export_name = "count_done")]
#[inline(never)]
extern "C" fn done() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}
