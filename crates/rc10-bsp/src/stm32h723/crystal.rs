//! The crystal, and what is done without it.
//!
//! One that does not start must not hold the program up, and one that stops must not leave motors with
//! their last command. Both ways lead to the chip's own oscillator (HSI, 64 MHz) with every frequency as
//! before, but not as exact: HSI is within 0.5 % at 30 °C and 3.3 V (data sheet, HSI characteristics), and drifts by
//! 1 % more between -20 and 105 °C: 1.5 % at worst. So each start with a good crystal measures HSI by it, to 24
//! millionths, and PLL1's fraction takes that out when HSI has to stand in. What is left is the drift since then.
//!
//! What that must be less than, by ISO 11898-1: of frames that are received here, 0.98 % of each end (80 quanta,
//! segment 2 and SJW of 20), so 1.96 % between two. Frames that are sent from here the ESC must follow, by its SJW of
//! ten of its bits. With `CubeMX`'s SJW of 1 that is 0.71 % at 14 quanta, 0.48 % at 21; what the ESCs have no maker
//! says. Nothing more is built on it: a robot without its crystal must not be armed ([`CrystalState`]).
//!
//! Another crystal does not work, too: 24 MHz instead of 25 makes buses of 960 kbit/s, and noise of
//! the console. So it is measured in 0.7 ms: TIM17 counts HSI, and captures each eighth period of
//! the crystal's 63rd part. A failed measurement says nothing.

mod pll;

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use embassy_stm32::pac::timer::{Tim1ch, vals::CcmrInputCcs};
use embassy_stm32::pac::{RCC, TIM17};
use embassy_stm32::rcc::{Pll, PllMul, PllPreDiv, PllSource, Sysclk};
use embassy_stm32::{Config, Peripherals};

pub use pll::Crystal;

/// The state of the crystal, as the program found it at its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrystalState {
    /// The clocks come from it, and it has its frequency.
    Works {
        /// How much too fast the chip's own oscillator is, measured by it: hundredths of a per cent.
        hsi: i32,
    },
    /// The clocks come from it; its frequency could not be measured.
    Unmeasured,
    /// The crystal does not swing. The chip's oscillator stands in, off by its drift since the last
    /// good start, or up to 1.5 %: motors must stay without torque.
    Dead,
    /// The crystal has another frequency than the program is made for. Handled like a dead one.
    Other {
        /// The measured one, within 1.5 %: hertz.
        hz: u32,
    },
}

/// The measured frequency, or 0.
static MEASURED: AtomicU32 = AtomicU32::new(0);

/// PLL1's multiplier of HSI by the last good crystal, in 8192ths, and its complement.
#[unsafe(link_section = ".uninit.rc10_hsi")]
static MULTIPLIER: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

/// The measured frequency, or the one of an exact HSI.
fn multiplier() -> u32 {
    let [kept, complement] = MULTIPLIER.each_ref().map(|word| word.load(Ordering::Relaxed));
    if kept == !complement { kept } else { pll::HSI_MULTIPLIER }
}

// 64 MHz / 10 x 75 is 480 MHz. At 6.4 MHz the PLL's input stays in its range, 4 to 8 MHz, also of a HSI that is off.
const HSI_DIVIDER: PllPreDiv = PllPreDiv::DIV10;
const HSI_MULTIPLIER: PllMul = PllMul::MUL75;

/// Milliseconds for the crystal: ST's HAL (`HSE_STARTUP_TIMEOUT`). A good one takes 2.
const START: u32 = 100;
/// Milliseconds for the PLL: 0.2 at most (data sheet, PLL characteristics).
const SWITCH: u32 = 1;
const HSI_CYCLES_A_MILLISECOND: u32 = 64_000;

/// Waits for a flag, `milliseconds` (up to 262) at most, of a core on HSI, by the otherwise unused
/// `SysTick`; should that stand, looks are counted.
fn comes(mut flag: impl FnMut() -> bool, milliseconds: u32) -> bool {
    // SAFETY: called before anything else runs, and by an exception that does not return.
    let mut clock = unsafe { cortex_m::Peripherals::steal() }.SYST;
    clock.set_clock_source(SystClkSource::Core);
    clock.set_reload(milliseconds * HSI_CYCLES_A_MILLISECOND - 1);
    clock.clear_current();
    clock.enable_counter();
    let mut looks = milliseconds * HSI_CYCLES_A_MILLISECOND / 4;
    let is_there = loop {
        if flag() {
            break true;
        }
        looks -= 1;
        if clock.has_wrapped() || looks == 0 {
            break false;
        }
    };
    clock.disable_counter();
    is_there
}

/// Captures, and milliseconds for them: 0.7 at 25 MHz, 4 at 4. At 50 MHz 10 µs each: polled.
const CAPTURES: u32 = 32;
const MEASURE: u32 = 6;

/// The frequency of a swinging crystal, by HSI: hertz; `None` if it cannot be measured.
///
/// RM0468: TIM17's first input can be HSE divided by `RTCPRE`. Before the PLL runs, its clock is HSI.
fn measure() -> Option<u32> {
    // Its register TISEL is where the timers with one channel have theirs; the PAC has it for those only.
    // SAFETY: it is at this address, and nothing else uses the timer now.
    let inputs = unsafe { Tim1ch::from_ptr(TIM17.as_ptr()) };
    RCC.cfgr().modify(|w| w.set_rtcpre(pll::DIVIDER));
    RCC.apb2enr().modify(|w| w.set_tim17en(true));
    // RM0468, RCC: two cycles of the bus go by before a peripheral can be written.
    let _ = RCC.apb2enr().read();
    inputs.tisel().write(|w| w.set_tisel(0, HSE_DIVIDED));
    TIM17.ccmr_input(0).write(|w| {
        w.set_ccs(0, CcmrInputCcs::TI4);
        w.set_icpsc(0, EVERY_EIGHTH);
    });
    TIM17.ccer().write(|w| w.set_cce(0, true));
    TIM17.cr1().write(|w| w.set_cen(true));
    let (mut captures, mut last, mut ticks) = (0, 0, 0_u32);
    let is_done = comes(
        || {
            if !TIM17.sr().read().ccif(0) {
                return false;
            }
            // Reading it clears the flag.
            let now = TIM17.ccr(0).read().ccr();
            if captures > 0 {
                ticks += u32::from(now.wrapping_sub(last));
            }
            last = now;
            captures += 1;
            captures > CAPTURES
        },
        MEASURE,
    );
    let is_overrun = TIM17.sr().read().ccof(0);
    RCC.apb2rstr().modify(|w| w.set_tim17rst(true));
    RCC.apb2rstr().modify(|w| w.set_tim17rst(false));
    RCC.apb2enr().modify(|w| w.set_tim17en(false));
    RCC.cfgr().modify(|w| w.set_rtcpre(0));
    if !is_done || is_overrun {
        return None;
    }
    pll::frequency(CAPTURES, ticks)
}

/// `TIM17_TISEL`, TI1SEL: HSE divided by `RTCPRE` (RM0468; `HSE_1MHz` in its table).
const HSE_DIVIDED: u8 = 2;
/// `TIM17_CCMR1`, IC1PSC.
const EVERY_EIGHTH: u8 = 3;

/// Starts embassy-stm32 on the crystal, or on HSI if that does not start within 100 ms or is another one.
pub(super) fn start(crystal: Crystal, mut config: Config) -> Peripherals {
    RCC.cr().modify(|w| w.set_hseon(true));
    let swings = comes(|| RCC.cr().read().hserdy(), START);
    let measured = if swings { measure() } else { None };
    let other = measured.filter(|hz| crystal.is_other(*hz));
    let is_right = swings && other.is_none();
    if !is_right {
        config.rcc.hse = None;
        let on_hsi =
            |pll| Pll { source: PllSource::HSI, prediv: HSI_DIVIDER, mul: HSI_MULTIPLIER, ..pll };
        config.rcc.pll1 = config.rcc.pll1.map(on_hsi);
    }
    let peripherals = embassy_stm32::init(config);
    MEASURED.store(measured.unwrap_or_default(), Ordering::Relaxed);
    if is_right {
        if let Some(measured) = measured {
            let multiplier = crystal.hsi_multiplier(measured);
            MULTIPLIER[0].store(multiplier, Ordering::Relaxed);
            MULTIPLIER[1].store(!multiplier, Ordering::Relaxed);
        }
        // From now on a crystal that stops raises an NMI.
        RCC.cr().modify(|w| w.set_hsecsson(true));
    } else {
        // embassy-stm32 reckons with an exact HSI, and so with whole numbers.
        replace();
    }
    peripherals
}

/// The state of the crystal.
#[must_use]
pub fn crystal() -> CrystalState {
    let comes_from_it = RCC.pllckselr().read().pllsrc() == PllSource::HSE;
    match (comes_from_it, MEASURED.load(Ordering::Relaxed)) {
        (true, 0) => CrystalState::Unmeasured,
        (true, _) => CrystalState::Works { hsi: pll::hsi_deviation(multiplier()) },
        (false, 0) => CrystalState::Dead,
        (false, hz) => CrystalState::Other { hz },
    }
}

/// Whether the NMI says that the crystal has stopped; forgets it.
pub(super) fn take_stopped() -> bool {
    let has_stopped = RCC.cifr().read().hsecssf();
    RCC.cicr().write(|w| w.set_hsecssc(true));
    has_stopped
}

/// PLL1 goes on from a measured HSI. After a stop the hardware has switched it off (RM0468).
pub(super) fn replace() {
    RCC.cfgr().modify(|w| w.set_sw(Sysclk::HSI));
    comes(|| RCC.cfgr().read().sws() == Sysclk::HSI, SWITCH);
    RCC.cr().modify(|w| w.set_pllon(0, false));
    comes(|| !RCC.cr().read().pllrdy(0), SWITCH);
    // The range of the PLL's input, 4 to 8 MHz, and all its outputs stay what they were.
    RCC.pllckselr().modify(|w| {
        w.set_pllsrc(PllSource::HSI);
        w.set_divm(0, HSI_DIVIDER);
    });
    let [whole, fraction] = pll::parts(multiplier());
    RCC.plldivr(0).modify(|w| w.set_plln(PllMul::from_bits(whole - 1)));
    RCC.pllcfgr().modify(|w| w.set_pllfracen(0, false));
    RCC.pllfracr(0).write(|w| w.set_fracn(fraction));
    RCC.pllcfgr().modify(|w| w.set_pllfracen(0, true));
    RCC.cr().modify(|w| w.set_pllon(0, true));
    if comes(|| RCC.cr().read().pllrdy(0), SWITCH) {
        RCC.cfgr().modify(|w| w.set_sw(Sysclk::PLL1_P));
        comes(|| RCC.cfgr().read().sws() == Sysclk::PLL1_P, SWITCH);
    }
}
