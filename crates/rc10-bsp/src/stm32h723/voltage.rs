//! The voltage at a pin, a few times a second, by ADC1: for a supply.
//!
//! embassy-stm32's driver waits for ever. Here an ADC that does not answer in time is no voltage.

use embassy_stm32::adc::AdcChannel;
use embassy_stm32::gpio::{Flex, Pin};
use embassy_stm32::pac::adc::vals::{Boost, Ovrmod, Pcsel, SampleTime};
use embassy_stm32::pac::adccommon::vals::Presc;
use embassy_stm32::pac::{ADC1, ADC12_COMMON, RCC};
use embassy_stm32::peripherals;
use embassy_stm32::{Peri, rcc};
use embassy_time::Timer;

// The ADC's clock is HSI / 4 (see `clocks`), and half of that behind the prescaler, which this line of chips halves
// once more (ST's HAL, `ADC_VER_V5_V90`): 8 MHz, for which `BOOST` has a range. A calibration without linearity takes
// some 0.2 ms at that, with it 165,010 clocks (ST's HAL, which knows no other number): 20.6 ms. One conversion 102 us: 810.5 periods of sampling, for a pin behind a divider of
// many kiloohms, and 8.5 for 16 bits.
const DIVIDER: Presc = Presc::DIV4;
const BOOST: Boost = Boost::LT12_5;
/// Until the regulator is up: 10 us at most.
const REGULATOR: u64 = 50;
const CALIBRATION_LOOK: u64 = 1_000;
const CALIBRATION_LOOKS: u32 = 25;
const ENABLING: u64 = 100;
const CONVERSION: u64 = 300;

/// A voltage at one pin.
pub struct VoltageInput {
    channel: u8,
    is_ready: bool,
    /// Whether it has still to be set up.
    is_fresh: bool,
}

impl VoltageInput {
    /// The voltage at this pin. The ADC is set up when it is read.
    pub fn new<P: Pin>(_adc: Peri<'static, peripherals::ADC1>, pin: Peri<'static, P>) -> Self
    where
        Peri<'static, P>: AdcChannel<peripherals::ADC1>,
    {
        rcc::enable_and_reset::<peripherals::ADC1>();
        // SAFETY: this second one is gone at the end of the line, and has nothing but the channel's number read.
        let channel = unsafe { pin.clone_unchecked() }.degrade_adc().get_hw_channel();
        let mut pin = Flex::new(pin);
        pin.set_as_analog();
        core::mem::forget(pin);
        Self { channel, is_ready: false, is_fresh: true }
    }

    /// The voltage in 65,535ths of the reference; `None` if the ADC fails, and is set up anew.
    pub async fn read(&mut self) -> Option<u16> {
        if !self.is_ready {
            self.start().await?;
        }
        self.is_ready = false;
        // Writing ones clears the flags.
        ADC1.isr().write(|w| w.set_eoc(true));
        ADC1.cr().modify(|w| w.set_adstart(true));
        Timer::after_micros(CONVERSION).await;
        if !ADC1.isr().read().eoc() {
            return None;
        }
        self.is_ready = true;
        // 16 bits of resolution.
        u16::try_from(ADC1.dr().read().0).ok()
    }

    /// RM0468, ADC: out of deep power-down, regulator, calibration, ready.
    async fn start(&mut self) -> Option<()> {
        if !core::mem::take(&mut self.is_fresh) {
            // From wherever it is stuck. (embassy resets it for its first user only.) ADC2 is reset with it.
            RCC.ahb1rstr().modify(|w| w.set_adc12rst(true));
            RCC.ahb1rstr().modify(|w| w.set_adc12rst(false));
        }
        ADC12_COMMON.ccr().modify(|w| w.set_presc(DIVIDER));
        ADC1.cr().modify(|w| w.set_boost(BOOST));
        ADC1.cr().modify(|w| {
            w.set_deeppwd(false);
            w.set_advregen(true);
        });
        Timer::after_micros(REGULATOR).await;
        ADC1.cr().modify(|w| w.set_adcal(true));
        for looked in 1.. {
            Timer::after_micros(CALIBRATION_LOOK).await;
            if !ADC1.cr().read().adcal() {
                break;
            }
            if looked == CALIBRATION_LOOKS {
                return None;
            }
        }
        ADC1.isr().write(|w| w.set_adrdy(true));
        ADC1.cr().modify(|w| w.set_aden(true));
        Timer::after_micros(ENABLING).await;
        if !ADC1.isr().read().adrdy() {
            return None;
        }
        let channel = usize::from(self.channel);
        ADC1.pcsel().write(|w| w.set_pcsel(channel, Pcsel::PRESELECTED));
        ADC1.smpr(channel / 10).modify(|w| w.set_smp(channel % 10, SampleTime::CYCLES810_5));
        ADC1.sqr1().write(|w| w.set_sq(0, self.channel));
        ADC1.cfgr().modify(|w| w.set_ovrmod(Ovrmod::OVERWRITE));
        self.is_ready = true;
        Some(())
    }
}
