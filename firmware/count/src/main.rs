//! What `cargo xtask count` runs and counts: the part of a bus that runs every millisecond, without
//! executor, interrupts and peripherals.
//!
//! Every function whose symbol is `count_<units>_<name>` is a measurement: the instructions from
//! its call to its return, per call and per unit. `count_done` ends the run. What is measured
//! starts from the same state and gets the same input every time.
#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use rc10_app::{Degrees, Rpm, Seconds};
use rc10_can::embedded_can::StandardId;
use rc10_can::{CanFrame, Micros};
use rc10_motor::dji::{Dji, M3508};
use rc10_motor::{ArmSwitch, CanMotor, MotorBus, MotorId, Safety, Target, TxBatch};

const MOTORS: usize = 8;
const TICK: Micros = Micros::from_millis(1);
/// Each measurement is repeated for so many milliseconds.
const ROUNDS: u64 = 200;

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // `xtask count` sees the fault and names its address.
    cortex_m::asm::udf()
}

#[entry]
fn main() -> ! {
    measure(Target::Speed(Rpm::new(120.0)), speed_tick);
    measure(Target::Angle(Degrees::new(200.0)), angle_tick);
    measure(Target::Speed(Rpm::new(120.0)), frames);
    measure(Target::Coast, coasting_tick);
    done()
}

/// Eight M3508 on one bus, with this target; `tick` once a millisecond.
fn measure(target: Target, tick: extern "C" fn(&mut MotorBus<'_>, &Input, &mut TxBatch)) {
    let switch = ArmSwitch::new();
    let mut motors: [Option<Dji>; MOTORS] =
        core::array::from_fn(|index| Dji::new(&M3508, index as u8 + 1).ok());
    let mut bus = MotorBus::<MOTORS>::new(&switch);
    for motor in motors.iter_mut().flatten() {
        let motor: &mut dyn CanMotor = motor;
        if bus.attach(black_box(motor), Safety::COAST).is_err() {
            cortex_m::asm::udf();
        }
    }
    if switch.arm().is_err() {
        cortex_m::asm::udf();
    }
    let mut tx = TxBatch::new();
    for round in 1..=ROUNDS {
        let input = Input::of(round);
        for index in 0..MOTORS {
            // A motor that is not there has no feedback to compute with: the count would show.
            let _ = bus.command(MotorId::new(index as u8), target, input.now);
        }
        tx.clear();
        tick(&mut bus, &input, &mut tx);
        black_box(tx.frames());
    }
}

/// What one millisecond brings.
struct Input {
    now: Micros,
    frames: [CanFrame; MOTORS],
}

impl Input {
    /// Rotors that turn at 2000 rpm and more, so that turns are counted too.
    fn of(round: u64) -> Self {
        let frame = |index: usize| {
            let speed = 2000 + 100 * index as u16;
            // 8192 counts a turn: rpm / 60,000 of it in a millisecond.
            let angle = (round * u64::from(speed) * 8192 / 60_000) as u16 % 8192;
            let current = 500_u16;
            let ([a, b], [c, d], [e, f]) =
                (angle.to_be_bytes(), speed.to_be_bytes(), current.to_be_bytes());
            let id = StandardId::new(0x201 + index as u16).unwrap_or(StandardId::ZERO);
            CanFrame::eight_bytes(id, [a, b, c, d, e, f, 30, 0])
        };
        Self { now: Micros::from_millis(round), frames: core::array::from_fn(frame) }
    }
}

fn everything(bus: &mut MotorBus<'_>, input: &Input, tx: &mut TxBatch) {
    for frame in &input.frames {
        bus.on_frame(frame, input.now);
    }
    let _ = bus.tick(input.now, Seconds::from_micros(TICK.get()), tx);
}

/// Eight frames received and dispatched, eight speed loops, two group frames.
#[unsafe(export_name = "count_8_motor_speed")]
#[inline(never)]
extern "C" fn speed_tick(bus: &mut MotorBus<'_>, input: &Input, tx: &mut TxBatch) {
    everything(bus, input, tx);
}

/// As above with the angle loop before the speed loop.
#[unsafe(export_name = "count_8_motor_angle")]
#[inline(never)]
extern "C" fn angle_tick(bus: &mut MotorBus<'_>, input: &Input, tx: &mut TxBatch) {
    everything(bus, input, tx);
}

/// As above without a loop.
#[unsafe(export_name = "count_8_motor_coasting")]
#[inline(never)]
extern "C" fn coasting_tick(bus: &mut MotorBus<'_>, input: &Input, tx: &mut TxBatch) {
    everything(bus, input, tx);
}

/// The receiving half alone.
#[unsafe(export_name = "count_8_frame_received")]
#[inline(never)]
extern "C" fn frames(bus: &mut MotorBus<'_>, input: &Input, _: &mut TxBatch) {
    for frame in &input.frames {
        bus.on_frame(frame, input.now);
    }
}

#[unsafe(export_name = "count_done")]
#[inline(never)]
extern "C" fn done() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}
