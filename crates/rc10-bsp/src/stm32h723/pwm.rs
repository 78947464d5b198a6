//! A PWM with a largest share of time: a heater would burn, and a buzzer's transistor too.

use core::mem::ManuallyDrop;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Speed};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{OutputCompareMode, RoundTo, Timer};
use embassy_stm32::timer::{Channel, GeneralInstance4Channel, TimerChannel, TimerPin};

/// The largest share of [`PwmOutput::set`].
pub const WHOLE: u16 = 1000;

/// One timer at one pin: low until told, with its share in a hang or crash; a reset is an input.
pub struct PwmOutput<T: GeneralInstance4Channel> {
    /// Never dropped: without its clock it would leave the pin as it is at that moment.
    timer: ManuallyDrop<Timer<'static, T>>,
    channel: Channel,
    period: u32,
    most: u16,
}

impl<T: GeneralInstance4Channel> PwmOutput<T> {
    /// Starts the timer at periods a second. `most` thousandths is how long the pin may be high.
    pub fn start<C: TimerChannel>(
        timer: Peri<'static, T>,
        pin: Peri<'static, impl TimerPin<T, C>>,
        frequency: Hertz,
        most: u16,
    ) -> Self {
        let timer = Timer::new(timer);
        timer.set_frequency(frequency, RoundTo::Slower);
        timer.set_output_compare_mode(C::CHANNEL, OutputCompareMode::PwmMode1);
        timer.set_output_compare_preload(C::CHANNEL, true);
        timer.set_compare_value(C::CHANNEL, 0_u16.into());
        timer.enable_channel(C::CHANNEL, true);
        timer.enable_outputs();
        timer.generate_update_event();
        timer.start();
        // The pin only now: the timer behind it says low.
        let function = pin.af_num();
        let mut pin = Flex::new(pin);
        pin.set_as_af_unchecked(function, AfType::output(OutputType::PushPull, Speed::Low));
        // Dropped, it would disconnect.
        core::mem::forget(pin);
        let period = timer.get_max_compare_value().into() + 1;
        let timer = ManuallyDrop::new(timer);
        Self { timer, channel: C::CHANNEL, period, most }
    }

    /// The share of time high, thousandths, at most the largest; from the next period on.
    pub fn set(&mut self, share: u16) {
        let share = u64::from(share.min(self.most).min(WHOLE));
        let ticks = u64::from(self.period) * share / u64::from(WHOLE);
        // At most the period, which is one more than its word may hold.
        let ticks = T::Word::try_from(ticks).unwrap_or_else(|_| u16::MAX.into());
        self.timer.set_compare_value(self.channel, ticks);
    }
}
