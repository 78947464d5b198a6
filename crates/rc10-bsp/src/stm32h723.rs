//! STM32H723 on embassy-stm32. Facts: RM0468 and the board's `CubeMX` project.
//!
//! * [`initialise`]: clocks and caches; [`crystal()`] and [`other_chip`]: whether they are right.
//! * [`cycle_count`]: the core's cycle counter.
//! * [`can`]: the three FDCAN ports, and [`can::Bus::start`].
//! * [`serial`]: UARTs; [`dma`]: the memory that a DMA reaches.
//! * [`i2c`] with timeouts and recovery; [`spi`] through that memory.
//! * [`servo`], [`pwm`] with a bound, [`pulse_output`] for LED strips, [`pulse_input`] for PPM, [`quadrature`] for encoders.
//! * `usb`: a serial port on USB, with the feature of that name.
//! * [`voltage`] at pins.
//! * [`flash`]: the two sectors for what is kept.
//! * [`supervisor`]: makes the motors of a bus safe that does not tick.
//! * [`watchdog`]: fed only while everything that must tick ticks.
//! * `black_box`: memory that stays over a reset, and `w25q64`: a serial flash, with the feature `black-box`.
//! * [`crash`]: after a panic or fault motors are made safe, the cause is kept, the chip restarts.
#![expect(unsafe_code, reason = "registers, vectors and retained memory")]

#[cfg(feature = "black-box")]
pub mod black_box;
pub mod can;
pub mod crash;
mod crystal;
pub mod dma;
pub mod flash;
pub mod i2c;
pub mod pulse_input;
pub mod pulse_output;
pub mod pwm;
pub mod quadrature;
pub mod serial;
pub mod servo;
pub mod spi;
pub mod supervisor;
mod supply;
#[cfg(feature = "usb")]
pub mod usb;
pub mod voltage;
#[cfg(feature = "black-box")]
pub mod w25q64;
pub mod watchdog;

pub use crystal::{Crystal, CrystalState, crystal};

use cortex_m::peripheral::DWT;
use embassy_stm32::rcc::mux::{Adcsel, Fdcansel};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, Peripherals, pac};

/// Clock of the core.
pub const CORE_CLOCK: Hertz = Hertz(480_000_000);

/// Clock of APB1 to APB4.
const APB_CLOCK: Hertz = Hertz(120_000_000);

/// Kernel clock of the three FDCANs, and of SPI1 to SPI3: PLL1 Q.
///
/// The quanta of a bit must not be faster than APB1 (RM0468, FDCAN bit timing; the text allows
/// equality, the formula beside it does not; ST's FAQ on FDCAN names frames that are repeated though
/// acknowledged as what happens else), nor than 125 MHz. 80 MHz is far from both.
pub const FDCAN_CLOCK: Hertz = Hertz(80_000_000);
const _: () = assert!(FDCAN_CLOCK.0 < APB_CLOCK.0 && FDCAN_CLOCK.0 <= 125_000_000);

/// The clock of the timers, unless a prescaler divides it.
pub const TIMER_CLOCK: Hertz = Hertz(240_000_000);

/// The clocks, made of a board's crystal: 480 MHz for the core (25 MHz / 5 x 96, 24 MHz / 4 x 80), half of it for
/// AHB (limit 275 MHz), a quarter for every APB (limit 137.5 MHz), a sixth from PLL1 Q for the FDCANs.
///
/// The timers run at 240 MHz: the time driver wants a whole number of megahertz.
#[must_use]
pub fn clocks(crystal: Crystal) -> Config {
    let (divider, multiplier) = crystal.pll();
    let mut config = Config::default();
    let clocks = &mut config.rcc;
    clocks.hse = Some(Hse { freq: Hertz(crystal.hz()), mode: HseMode::Oscillator });
    clocks.pll1 = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::from_bits(divider),
        // Its field holds one less.
        mul: PllMul::from_bits(multiplier - 1),
        divp: Some(PllDiv::DIV1),
        divq: Some(PllDiv::DIV6),
        divr: None,
    });
    clocks.sys = Sysclk::PLL1_P;
    clocks.ahb_pre = AHBPrescaler::DIV2;
    clocks.apb1_pre = APBPrescaler::DIV2;
    clocks.apb2_pre = APBPrescaler::DIV2;
    clocks.apb3_pre = APBPrescaler::DIV2;
    clocks.apb4_pre = APBPrescaler::DIV2;
    // embassy's default is the crystal itself.
    clocks.mux.fdcansel = Fdcansel::PLL1_Q;
    // HSI: embassy's default is a PLL that does not run.
    clocks.mux.adcsel = Adcsel::PER;
    #[cfg(feature = "usb")]
    {
        use embassy_stm32::rcc::{Hsi48Config, mux::Usbsel};
        clocks.hsi48 = Some(Hsi48Config { sync_from_usb: true });
        clocks.mux.usbsel = Usbsel::HSI48;
    }
    config
}

/// Makes two regions without access, which to a Cortex-M7 are ordinary memory: it may read ahead in them.
///
/// * `0x6000_0000` to `0xDFFF_FFFF`: external memories, which the board lacks: the FMC would wait.
/// * `0x1FF0_0000` to `0x1FFF_FFFF`: system flash (errors by prefetch, Zephyr 60449), below DTCM.
fn forbid_regions(mpu: &cortex_m::peripheral::MPU) {
    // Armv7-M manual, B3.5: all 4 GiB, less the eighths 0, 1, 2 and 7; then 1 MiB. No access, no execution.
    const ENABLE: u32 = 1;
    const WHOLE: u32 = 31 << 1;
    const WITHOUT: u32 = 0b1000_0111 << 8;
    const MEBIBYTE: u32 = 19 << 1;
    const SHAREABLE: u32 = 1 << 18;
    const NEVER_EXECUTE: u32 = 1 << 28;
    // Everywhere else the memory map is what it is without the MPU.
    const BACKGROUND: u32 = 1 << 2;
    cortex_m::asm::dmb();
    // SAFETY: nothing that this program has lies in the regions.
    unsafe {
        for (number, base, size) in [(0, 0, WITHOUT | WHOLE), (1, 0x1FF0_0000, MEBIBYTE)] {
            mpu.rnr.write(number);
            mpu.rbar.write(base);
            mpu.rasr.write(NEVER_EXECUTE | SHAREABLE | size | ENABLE);
        }
        mpu.ctrl.write(BACKGROUND | ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Starts the cycle counter, which stands still after a reset.
fn start_cycle_counter(core: &mut cortex_m::Peripherals) {
    // Armv7-M manual, C1.6.5 and C1.8.7; a Cortex-M7 has a lock before it (its own manual, DWT_LAR).
    core.DCB.enable_trace();
    DWT::unlock();
    core.DWT.enable_cycle_counter();
}

/// Cycles of [`CORE_CLOCK`], modulo 2^32 (8.9 s). It may stand while the core sleeps.
#[must_use]
#[inline]
pub fn cycle_count() -> u32 {
    DWT::cycle_count()
}

/// Another chip's `DEV_ID` (RM0468: 0x483 is STM32H723 to 735); zero counts as not known.
#[must_use]
pub fn other_chip() -> Option<u16> {
    const OURS: u16 = 0x483;
    let id = pac::DBGMCU.idc().read().dev_id();
    (id != OURS && id != 0).then_some(id)
}

/// Starts the chip: [`clocks`], instruction cache on, data cache off, cycle counter on. A crystal that does not start
/// within 100 ms, or has another frequency, is replaced ([`crystal()`]); one that stops later is a
/// [crash](crash::LastCrash::CrystalStopped), if [`crash_handlers!`](crate::crash_handlers) are there.
///
/// The data cache is off: DTCM is as fast, and nothing here keeps it coherent with DMA.
///
/// # Panics
/// If called twice.
#[must_use]
#[inline(never)]
pub fn initialise(crystal: Crystal) -> Peripherals {
    let peripherals = crystal::start(crystal, clocks(crystal));
    // SAFETY: nothing else touches the core's peripherals; a second `init` panics.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    forbid_regions(&core.MPU);
    start_cycle_counter(&mut core);
    core.SCB.enable_icache();
    // Off after a reset; who started this program may have switched it on.
    core.SCB.disable_dcache(&mut core.CPUID);
    // The DMA buffers' memory.
    pac::RCC.ahb2enr().modify(|w| w.set_sram1en(true));
    peripherals
}
