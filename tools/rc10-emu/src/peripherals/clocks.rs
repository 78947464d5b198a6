//! The clock tree at one moment (RM0468, RCC chapter), and how fast its clocks may be.

use std::fmt;

use super::registers::field;
use crate::time::Period;

pub(super) const HSI_HZ: u64 = 64_000_000;
pub(super) const CSI_HZ: u64 = 4_000_000;
pub(super) const LSI_HZ: u64 = 32_000;
pub(super) const LSE_HZ: u64 = 32_768;

/// Frequencies in hertz; 0 where nothing ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clocks {
    /// The core.
    pub core: u64,
    /// AXI and AHB.
    pub bus: u64,
    /// APB1 and APB2.
    pub apb: [u64; 2],
    /// Timers on APB1 and APB2.
    pub timers: [u64; 2],
    /// Kernel clock of the FDCANs.
    pub fdcan: u64,
    /// Kernel clocks of the UARTs: those on APB1 (2, 3, 4, 5, 7, 8), those on APB2 (1, 6, 9, 10).
    pub usarts: [u64; 2],
    /// Kernel clocks of the SPIs: 1 to 3, 4 and 5.
    pub spis: [u64; 2],
    /// Kernel clock of I2C1, 2, 3 and 5.
    pub i2cs: u64,
    /// Kernel clock of the ADCs.
    pub adc: u64,
}

/// Clocks that timers' inputs can be connected to, and in the last place what is not modelled.
pub(super) type Tones = [Option<Period>; 5];
/// Places of LSI, LSE, HSE behind `RCC_CFGR.RTCPRE`, and MCO1.
pub(super) const TONE_LSI: usize = 0;
pub(super) const TONE_LSE: usize = 1;
pub(super) const TONE_HSE: usize = 2;
pub(super) const TONE_MCO1: usize = 3;
pub(super) const UNMODELLED: usize = 4;

/// Frequencies of what the tree starts from: 0 if not running.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sources {
    pub hsi: u64,
    pub csi: u64,
    pub hse: u64,
    pub lse: u64,
    /// P, Q and R of PLL1 to PLL3.
    pub plls: [[u64; 3]; 3],
}

// Registers of RCC that shape the tree.
words! { pub(super)
    CFGR: 0x10, D1CFGR: 0x18, D2CFGR: 0x1C, D1CCIPR: 0x4C, D2CCIP1R: 0x50, D2CCIP2R: 0x54,
    D3CCIPR: 0x58,
}

/// Divider by `PRESC` of ADCs and UARTs. Source: RM0468, `ADC_CCR`, `USART_PRESC`.
pub(super) const PRESCALERS: [u64; 12] = [1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256];

impl Clocks {
    /// `source` is SWS: the source of the system clock.
    pub(super) fn new(sources: &Sources, source: u32, register: impl Fn(u32) -> u32) -> Self {
        let Sources { hsi, csi, hse, lse, plls } = *sources;
        // The clock that a field selects: others than these stand.
        let select = |(at, shift, bits): (u32, u32, u32), from: &[u64]| {
            from.get(field(register(at), shift, bits) as usize).copied().unwrap_or(0)
        };
        let system = [hsi, csi, hse, plls[0][0]].get(source as usize).copied().unwrap_or(0);
        let core = system / ahb_divider(field(register(D1CFGR), 8, 4));
        let bus = core / ahb_divider(field(register(D1CFGR), 0, 4));
        let prescalers = [4, 8].map(|shift| apb_divider(field(register(D2CFGR), shift, 3)));
        let apb = prescalers.map(|divider| bus / divider);
        // RM0468, RCC_CFGR, TIMPRE: timers run at the bus's clock, if APB is not much slower.
        let faster = if field(register(CFGR), 15, 1) == 0 { 2 } else { 4 };
        let timers =
            prescalers.map(|divider| if divider <= faster { bus } else { bus / divider * faster });
        let fdcan = select((D2CCIP1R, 28, 2), &[hse, plls[0][1], plls[1][1]]);
        let usarts = [0, 1].map(|bus| {
            let from = [apb[bus], plls[1][1], plls[2][1], hsi, csi, lse];
            select((D2CCIP2R, [0, 3][bus], 3), &from)
        });
        // CKPERSEL.
        let per = select((D1CCIPR, 28, 2), &[hsi, csi, hse]);
        let spis = [
            // SPI123SEL; there is no external clock at I2S_CKIN.
            select((D2CCIP1R, 12, 3), &[plls[0][1], plls[1][0], plls[2][0], 0, per]),
            // SPI45SEL.
            select((D2CCIP1R, 16, 3), &[apb[1], plls[1][1], plls[2][1], hsi, csi, hse]),
        ];
        // I2C1235SEL.
        let i2cs = select((D2CCIP2R, 12, 2), &[apb[0], plls[2][2], hsi, csi]);
        // ADCSEL.
        let adc = select((D3CCIPR, 16, 2), &[plls[1][0], plls[2][2], per]);
        Self { core, bus, apb, timers, fdcan, usarts, spis, i2cs, adc }
    }
}

/// D1CPRE, HPRE.
fn ahb_divider(bits: u32) -> u64 {
    match bits {
        0..8 => 1,
        8..12 => 2 << (bits - 8),
        _ => 64 << (bits - 12),
    }
}

/// D2PPRE1, D2PPRE2.
fn apb_divider(bits: u32) -> u64 {
    if bits < 4 { 1 } else { 2 << (bits - 4) }
}

/// The outputs P, Q and R of a PLL, 0 where disabled; `None` if it cannot lock with these settings.
///
/// Limits: RM0468, RCC chapter, PLL section, and the data sheet's PLL table. They are those of the
/// input's nominal frequency: what an oscillator is off by does not matter.
pub(super) fn pll([nominal, actual]: [u64; 2], settings: &Pll) -> Option<[u64; 3]> {
    let reference = nominal.checked_div(u64::from(settings.pre_divider))?;
    let lowest = 1_000_000 << settings.range;
    let allowed = lowest..=2 * lowest;
    let multiplier = u64::from(settings.multiplier) * 8192 + u64::from(settings.fraction);
    let oscillator = reference * multiplier / 8192;
    let reachable =
        if settings.wide { 192_000_000..=836_000_000 } else { 150_000_000..=420_000_000 };
    if !allowed.contains(&reference) || !reachable.contains(&oscillator) {
        return None;
    }
    // Rounded once: what a clock is off by must not grow.
    let oscillator = u128::from(actual) * u128::from(multiplier);
    let output = |divider: u64| {
        let divider = u128::from(divider) * u128::from(settings.pre_divider) * 8192;
        u64::try_from(oscillator / divider).unwrap_or(u64::MAX)
    };
    Some(settings.dividers.map(|divider| divider.map_or(0, output)))
}

/// A clock that is too fast for what it drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooFast {
    /// Name of the clock.
    pub clock: &'static str,
    /// Frequency, hertz.
    pub hz: u64,
    /// Bound that it must not reach, or not exceed.
    pub limit: Limit,
}

/// Upper bound of a clock, hertz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// At most this, at this voltage.
    AtMost(u64),
    /// Slower than APB1, which has this frequency.
    BelowApb1(u64),
    /// At most this, as the converter's `BOOST` is set.
    Boost(u64),
}

impl fmt::Display for TooFast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mhz = |hz: u64| hz as f64 / 1e6;
        write!(f, "{} is {} MHz, ", self.clock, mhz(self.hz))?;
        match self.limit {
            Limit::AtMost(limit) => write!(f, "at this voltage {} are allowed", mhz(limit)),
            Limit::Boost(limit) => write!(f, "with this BOOST {} are allowed", mhz(limit)),
            Limit::BelowApb1(apb) => write!(f, "and must be below APB1's {} MHz", mhz(apb)),
        }
    }
}

/// Highest frequencies of the core, of AXI and AHB, and of the APBs, by voltage scale 0 to 3; the
/// core without the option byte that boosts it. Source: STM32H723 data sheet, general operating
/// conditions; the same in embassy-stm32's `rcc/h.rs`. But that APBs may have 42.5 MHz at scale 3
/// cannot be meant of the state after a reset, where they have HSI's 64 MHz: so they may here.
const BUS_LIMITS: [[u64; 3]; 4] = [
    [520_000_000, 275_000_000, 137_500_000],
    [400_000_000, 200_000_000, 100_000_000],
    [300_000_000, 150_000_000, 75_000_000],
    [170_000_000, 85_000_000, HSI_HZ],
];
/// FDCAN's kernel clock at scale 0 (RM0399, kernel clock distribution; Zephyr's
/// `can_stm32h7_fdcan.c`); else the APB's limit is the smaller one.
const FDCAN_LIMIT: u64 = 125_000_000;
/// SPI1 to SPI3's at scale 0 (data sheet, SPI characteristics); else we take AXI's limit.
const SPI123_LIMIT: u64 = 200_000_000;

/// The nominal clocks that are too fast. Kernel clocks without a figure in the documents at hand
/// have the limit of their peripheral's bus; one that drives nothing is to be 0.
///
/// `time_quantum` is FDCAN's clock behind the calibration unit: "always below or equal to" APB's
/// (RM0399 59.4.5), with the formula `fdcan_tq_ck < fdcan_pclk`, which holds here.
pub(super) fn too_fast(
    clocks: &Clocks,
    time_quantum: u64,
    scale: u32,
) -> impl Iterator<Item = TooFast> {
    let [core, bus, apb] = BUS_LIMITS[scale as usize % BUS_LIMITS.len()];
    let at_most = [
        ("the core's clock", clocks.core, core),
        ("AXI's clock", clocks.bus, bus),
        ("APB1's clock", clocks.apb[0], apb),
        ("APB2's clock", clocks.apb[1], apb),
        ("FDCAN's kernel clock", clocks.fdcan, FDCAN_LIMIT.min(apb)),
        ("the kernel clock of the UARTs on APB1", clocks.usarts[0], apb),
        ("the kernel clock of the UARTs on APB2", clocks.usarts[1], apb),
        ("SPI1 to 3's kernel clock", clocks.spis[0], SPI123_LIMIT.min(bus)),
        ("SPI4 and 5's kernel clock", clocks.spis[1], apb),
        ("I2C1, 2, 3 and 5's kernel clock", clocks.i2cs, apb),
    ];
    let at_most = at_most.into_iter().filter(|(_, hz, limit)| hz > limit);
    let at_most =
        at_most.map(|(clock, hz, limit)| TooFast { clock, hz, limit: Limit::AtMost(limit) });
    let (clock, apb) = ("FDCAN's time quantum clock", clocks.apb[0]);
    let quantum = TooFast { clock, hz: time_quantum, limit: Limit::BelowApb1(apb) };
    at_most.chain((time_quantum != 0 && time_quantum >= apb).then_some(quantum))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pll {
    /// DIVM; 0: no clock.
    pub pre_divider: u32,
    /// DIVN, 4 ..= 512.
    pub multiplier: u32,
    /// In 1/8192.
    pub fraction: u32,
    /// VCOSEL = 0: 192 ..= 836 MHz, otherwise 150 ..= 420 MHz.
    pub wide: bool,
    /// RGE.
    pub range: u32,
    /// P, Q, R: 1 ..= 128; `None` if the output is disabled.
    pub dividers: [Option<u64>; 3],
}

#[cfg(test)]
mod tests {
    use super::*;

    const HSE_HZ: u64 = 25_000_000;

    const RC10: Pll = Pll {
        pre_divider: 5,
        multiplier: 96,
        fraction: 0,
        wide: true,
        range: 2,
        dividers: [Some(1), Some(4), None],
    };

    #[test]
    fn a_pll_multiplies() {
        assert_eq!(pll([HSE_HZ; 2], &RC10), Some([480_000_000, 120_000_000, 0]));
        let half = Pll { fraction: 4096, ..RC10 };
        assert_eq!(pll([HSE_HZ; 2], &half), Some([482_500_000, 120_625_000, 0]));
    }

    #[test]
    fn a_pll_follows_an_oscillator_that_is_off() {
        // HSI / 16 x 120 at the edge of its range, 1 % slow.
        let input = [64_000_000, 63_360_000];
        let on_hsi = Pll { pre_divider: 16, multiplier: 120, ..RC10 };
        assert_eq!(pll(input, &on_hsi), Some([475_200_000, 118_800_000, 0]));
    }

    #[test]
    fn a_pll_outside_its_limits_does_not_lock() {
        assert_eq!(pll([0; 2], &RC10), None);
        assert_eq!(pll([HSE_HZ; 2], &Pll { pre_divider: 0, ..RC10 }), None);
        assert_eq!(pll([HSE_HZ; 2], &Pll { range: 3, ..RC10 }), None);
        assert_eq!(pll([HSE_HZ; 2], &Pll { multiplier: 200, ..RC10 }), None);
    }

    #[test]
    fn clocks_have_limits_by_voltage() {
        let clocks = Clocks {
            core: 480_000_000,
            bus: 240_000_000,
            apb: [120_000_000; 2],
            fdcan: 80_000_000,
            usarts: [120_000_000, 0],
            spis: [200_000_000, 120_000_000],
            ..Clocks::default()
        };
        let names = |clocks: &Clocks, tq, scale| {
            too_fast(clocks, tq, scale).map(|clock| clock.clock).collect::<Vec<_>>()
        };
        assert_eq!(names(&clocks, 80_000_000, 0), [""; 0]);
        let unused = Clocks { fdcan: 0, usarts: [0; 2], spis: [0; 2], ..clocks };
        assert_eq!(names(&unused, 0, 1).len(), 4, "core and buses");
        let used = Clocks { usarts: [120_000_000, 250_000_000], ..clocks };
        assert_eq!(names(&used, 80_000_000, 0), ["the kernel clock of the UARTs on APB2"]);
        // One hertz too much for each.
        let fast = Clocks {
            core: 520_000_001,
            bus: 275_000_001,
            apb: [137_500_001; 2],
            fdcan: 125_000_001,
            usarts: [137_500_001; 2],
            spis: [200_000_001, 137_500_001],
            i2cs: 137_500_001,
            ..Clocks::default()
        };
        assert_eq!(names(&fast, 125_000_001, 0).len(), 10);
    }

    #[test]
    fn dividers_are_the_manuals() {
        assert_eq!([0, 7, 8, 11, 12, 15].map(ahb_divider), [1, 1, 2, 16, 64, 512]);
        assert_eq!([0, 3, 4, 7].map(apb_divider), [1, 1, 2, 16]);
    }

    #[test]
    fn the_bus_divides_the_cores_clock_which_divides_the_systems() {
        let sources = Sources { hsi: HSI_HZ, ..Sources::default() };
        let register = |at| if at == D1CFGR { 8 << 8 | 9 } else { 0 };
        let clocks = Clocks::new(&sources, 0, register);
        assert_eq!((clocks.core, clocks.bus), (32_000_000, 8_000_000));
    }

    #[test]
    fn timers_run_at_the_bus_clock_unless_apb_is_much_slower() {
        let sources = Sources { hsi: HSI_HZ, ..Sources::default() };
        let clocks = |cfgr, prescaler: u32| {
            let register = |at| match at {
                CFGR => cfgr,
                D2CFGR => prescaler << 4,
                _ => 0,
            };
            Clocks::new(&sources, 0, register).timers[0]
        };
        assert_eq!(clocks(0, 4), 64_000_000);
        assert_eq!(clocks(0, 5), 32_000_000);
        assert_eq!(clocks(1 << 15, 5), 64_000_000);
        assert_eq!(clocks(1 << 15, 6), 32_000_000);
    }
}
