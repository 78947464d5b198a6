//! The crystal, and what is done without it.
//!
//! One that does not start must not hold the program up, and one that stops must not leave motors with
//! their last command. Both ways lead to the chip's own oscillator (HSI, 64 MHz) with every frequency as
//! before, but within 1 % only (STM32H723 data sheet, HSI characteristics, 0 to 85 °C). The bit timing
//! follows a node that is 1.9 % off, if the others are exact: the coast image gets through, as far as
//! numbers tell. Nothing more is built on that: a robot without its crystal must not be armed
//! ([`has_crystal`]).

use cortex_m::peripheral::syst::SystClkSource;
use embassy_stm32::pac::RCC;
use embassy_stm32::rcc::{Pll, PllMul, PllPreDiv, PllSource, Sysclk};
use embassy_stm32::{Config, Peripherals};

// 64 MHz / 16 x 120 is 25 MHz / 5 x 96.
const HSI_DIVIDER: PllPreDiv = PllPreDiv::DIV16;
const HSI_MULTIPLIER: PllMul = PllMul::MUL120;

/// The time that the crystal may take, in milliseconds: what ST's HAL gives it
/// (`HSE_STARTUP_TIMEOUT`). A good one takes about 2.
const START: u32 = 100;
/// The time that the PLL may take, in milliseconds: 0.2 ms at most (data sheet, PLL
/// characteristics).
const SWITCH: u32 = 1;
const HSI_CYCLES_A_MILLISECOND: u32 = 64_000;

/// Waits for a flag, `milliseconds` (up to 262) at most, of a core on HSI. Its clock is `SysTick`,
/// which nothing else uses: embassy's does not run yet, or runs wrong.
fn comes(flag: impl Fn() -> bool, milliseconds: u32) -> bool {
    // SAFETY: called before anything else runs, and by an exception that does not return.
    let mut clock = unsafe { cortex_m::Peripherals::steal() }.SYST;
    clock.set_clock_source(SystClkSource::Core);
    clock.set_reload(milliseconds * HSI_CYCLES_A_MILLISECOND - 1);
    clock.clear_current();
    clock.enable_counter();
    let is_there = loop {
        if flag() {
            break true;
        }
        if clock.has_wrapped() {
            break false;
        }
    };
    clock.disable_counter();
    is_there
}

/// Starts embassy-stm32 on the crystal, or on HSI if that does not start within 100 ms.
pub(super) fn start(mut config: Config) -> Peripherals {
    RCC.cr().modify(|w| w.set_hseon(true));
    let swings = comes(|| RCC.cr().read().hserdy(), START);
    if !swings {
        config.rcc.hse = None;
        let on_hsi =
            |pll| Pll { source: PllSource::HSI, prediv: HSI_DIVIDER, mul: HSI_MULTIPLIER, ..pll };
        config.rcc.pll1 = config.rcc.pll1.map(on_hsi);
    }
    let peripherals = embassy_stm32::init(config);
    if swings {
        // From now on a crystal that stops raises an NMI.
        RCC.cr().modify(|w| w.set_hsecsson(true));
    }
    peripherals
}

/// Whether the clocks come from the crystal. If not, the chip's own oscillator stands in for one that
/// does not work: times and bit rates are 1 % off, and motors must stay without torque.
#[must_use]
pub fn has_crystal() -> bool {
    RCC.pllckselr().read().pllsrc() == PllSource::HSE
}

/// Whether the NMI says that the crystal has stopped; forgets it.
pub(super) fn take_stopped() -> bool {
    let has_stopped = RCC.cifr().read().hsecssf();
    RCC.cicr().write(|w| w.set_hsecssc(true));
    has_stopped
}

/// The crystal has stopped. The hardware has put the core on HSI and switched the PLL off, and with it
/// the FDCANs' clock (RM0468, RCC, clock security system): the PLL goes on from HSI.
pub(super) fn replace() {
    RCC.cr().modify(|w| w.set_pllon(0, false));
    comes(|| !RCC.cr().read().pllrdy(0), SWITCH);
    // The range of the PLL's input, 4 to 8 MHz, and all its outputs stay what they were.
    RCC.pllckselr().modify(|w| {
        w.set_pllsrc(PllSource::HSI);
        w.set_divm(0, HSI_DIVIDER);
    });
    RCC.plldivr(0).modify(|w| w.set_plln(HSI_MULTIPLIER));
    RCC.cr().modify(|w| w.set_pllon(0, true));
    if comes(|| RCC.cr().read().pllrdy(0), SWITCH) {
        RCC.cfgr().modify(|w| w.set_sw(Sysclk::PLL1_P));
        comes(|| RCC.cfgr().read().sws() == Sysclk::PLL1_P, SWITCH);
    }
}
