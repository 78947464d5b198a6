//! Voltages at pins, some times a second, by ADC1: of a supply, of a sensor.
//!
//! embassy-stm32's driver waits for ever. Here an ADC that does not answer in time is no voltage.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::adc::AdcChannel;
use embassy_stm32::gpio::{AnyPin, Flex, Pin};
use embassy_stm32::pac::adc::vals::{Boost, Ovrmod, Pcsel, SampleTime};
use embassy_stm32::pac::adccommon::vals::Presc;
use embassy_stm32::pac::{ADC1, ADC12_COMMON, RCC};
use embassy_stm32::peripherals;
use embassy_stm32::{Peri, rcc};
use embassy_time::Timer;

/// The reference, volts: the chip's own supply.
const REFERENCE: f32 = 3.3;

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

/// Whether ADC1 has its clock, is set up, and is making a conversion.
static IS_ON: AtomicBool = AtomicBool::new(false);
static IS_READY: AtomicBool = AtomicBool::new(false);
static IS_BUSY: AtomicBool = AtomicBool::new(false);

/// One conversion, which ends when this is dropped.
struct Turn;

impl Drop for Turn {
    fn drop(&mut self) {
        IS_BUSY.store(false, Ordering::Release);
    }
}

/// A pin at ADC1.
pub struct VoltageParts {
    channel: u8,
    pin: Peri<'static, AnyPin>,
}

impl VoltageParts {
    /// A pin, which is left alone until it is read.
    pub fn new<P: Pin>(_adc: &Peri<'static, peripherals::ADC1>, pin: Peri<'static, P>) -> Self
    where
        Peri<'static, P>: AdcChannel<peripherals::ADC1>,
    {
        // SAFETY: this second one is gone at the end of the line, and has nothing but the channel's number read.
        let channel = unsafe { pin.clone_unchecked() }.degrade_adc().get_hw_channel();
        Self { channel, pin: pin.into() }
    }
}

/// A voltage at one pin.
pub struct VoltageInput {
    channel: u8,
    divider: f32,
}

impl VoltageInput {
    /// The voltage behind a divider: `divider` times that at the pin, 1 without one. The ADC is set up when it is read.
    #[must_use]
    pub fn new(parts: VoltageParts, divider: f32) -> Self {
        let mut pin = Flex::new(parts.pin);
        pin.set_as_analog();
        core::mem::forget(pin);
        Self { channel: parts.channel, divider }
    }

    /// The voltage, 0 to 3.3 V times the divider; `None` if the ADC fails, and is set up anew. It takes 0.3 ms, and as
    /// long for each other input that is being read.
    pub async fn read(&mut self) -> Option<f32> {
        while IS_BUSY.swap(true, Ordering::Acquire) {
            Timer::after_micros(CONVERSION).await;
        }
        let raw = Turn.convert(self.channel).await?;
        Some(f32::from(raw) / f32::from(u16::MAX) * REFERENCE * self.divider)
    }
}

impl Turn {
    /// The voltage at a channel in 65,535ths of the reference.
    async fn convert(self, channel: u8) -> Option<u16> {
        if !IS_READY.swap(false, Ordering::Relaxed) {
            self.start().await?;
        }
        let at = usize::from(channel);
        ADC1.pcsel().modify(|w| w.set_pcsel(at, Pcsel::PRESELECTED));
        ADC1.smpr(at / 10).modify(|w| w.set_smp(at % 10, SampleTime::CYCLES810_5));
        ADC1.sqr1().write(|w| w.set_sq(0, channel));
        // Writing ones clears the flags.
        ADC1.isr().write(|w| w.set_eoc(true));
        ADC1.cr().modify(|w| w.set_adstart(true));
        Timer::after_micros(CONVERSION).await;
        if !ADC1.isr().read().eoc() {
            return None;
        }
        IS_READY.store(true, Ordering::Relaxed);
        // 16 bits of resolution.
        u16::try_from(ADC1.dr().read().0).ok()
    }

    /// RM0468, ADC: out of deep power-down, regulator, calibration, ready.
    async fn start(&self) -> Option<()> {
        if IS_ON.swap(true, Ordering::Relaxed) {
            // From wherever it is stuck. (embassy resets it for its first user only.) ADC2 is reset with it.
            RCC.ahb1rstr().modify(|w| w.set_adc12rst(true));
            RCC.ahb1rstr().modify(|w| w.set_adc12rst(false));
        } else {
            rcc::enable_and_reset::<peripherals::ADC1>();
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
        ADC1.cfgr().modify(|w| w.set_ovrmod(Ovrmod::OVERWRITE));
        Some(())
    }
}
