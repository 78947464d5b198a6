//! RC10's motors without Embassy's executor and RC10's drivers, on any [`nb::Can`].
//!
//! The programs beside this library differ in nothing but the driver:
//!
//! * `superloop-nb`: any HAL; the place to put it is marked.
//! * `superloop-embassy`: the CAN driver of embassy-stm32.
//! * `superloop-fdcan`: the `fdcan` crate.
#![no_std]

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use embassy_stm32::rcc::mux::Fdcansel;
use embassy_stm32::rcc::{Hse, HseMode};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, Peripherals};
use embedded_can::nb;
use rc10_app::{Rpm, Seconds};
use rc10_can::embedded_can;
use rc10_can::{CanPort, NbPort};
use rc10_motor::dji::{self, Dji, GM6020_VOLTAGE, M3508};
use rc10_motor::{ArmSwitch, MotorBus, Safety, Target, TxBatch};
use rc10_time::Micros;

/// The 1 kHz heartbeat: the core's own timer, polled.
pub struct Heartbeat(SYST);

/// Milliseconds since the start; 49 days long.
static MILLIS: AtomicU32 = AtomicU32::new(0);

/// The time, to a millisecond.
pub fn now() -> Micros {
    Micros::from_millis(MILLIS.load(Ordering::Relaxed).into())
}

impl Heartbeat {
    /// A heartbeat of a core that runs at `core_hz` (at most 16 GHz: the timer has 24 bits).
    #[must_use]
    pub fn start(mut timer: SYST, core_hz: u32) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(core_hz / 1000 - 1);
        timer.clear_current();
        timer.enable_counter();
        Self(timer)
    }

    /// Waits for the next millisecond.
    fn wait(&mut self) {
        while !self.0.has_wrapped() {}
        MILLIS.store(MILLIS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }
}

/// Starts the chip, once: heartbeat, FDCAN from the crystal's 25 MHz, the core from 64 MHz inside.
#[must_use]
pub fn start() -> (Peripherals, Heartbeat) {
    let Some(core) = cortex_m::Peripherals::take() else {
        unreachable!("taken once");
    };
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(25_000_000), mode: HseMode::Oscillator });
    config.rcc.mux.fdcansel = Fdcansel::HSE;
    (embassy_stm32::init(config), Heartbeat::start(core.SYST, 64_000_000))
}

/// Two motors on one bus, once a millisecond, for ever.
pub fn superloop(can: impl nb::Can, mut heartbeat: Heartbeat) -> ! {
    let switch = ArmSwitch::new();
    let (Ok(mut wheel), Ok(mut turret)) =
        (Dji::new(dji::Config::new(&M3508, 1)), Dji::new(dji::Config::new(&GM6020_VOLTAGE, 1)))
    else {
        unreachable!("both motors have an id 1");
    };
    let mut bus = MotorBus::new(&switch);
    let attached = (bus.attach(&mut wheel, Safety::COAST), bus.attach(&mut turret, Safety::COAST));
    let (Ok(wheel), Ok(_)) = attached else {
        unreachable!("their identifiers do not clash");
    };
    // The robot was not stopped yet.
    let _ = switch.arm();

    let mut port = NbPort::<_, 16>::new(can, now);
    let mut tx = TxBatch::new();
    loop {
        heartbeat.wait();
        let now = now();
        while let Some((frame, at)) = port.receive() {
            bus.on_frame(&frame, at);
        }
        // An M3508 takes speeds.
        let _ = bus.command(wheel, Target::Speed(Rpm::new(60.0)), now);
        tx.clear();
        // Two motors fit into a batch of sixteen frames.
        let _ = bus.tick(now, Seconds::new(0.001), &mut tx);
        for frame in tx.frames() {
            // Refused only if sixteen identifiers wait.
            let _ = port.submit(frame);
        }
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    cortex_m::asm::udf()
}
