//! Pulses of hobby servos, 50 a second.
//!
//! The duty of a [`ServoOutput`] is the pulse in microseconds, of a period of 20,000.

use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::gpio::{AfType, Flex, OutputType, Pin, Speed};
use embassy_stm32::pac::timer::{TimGp32, vals};
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::{GeneralInstance4Channel, TimerChannel, TimerPin};
use embassy_stm32::{Peri, peripherals};
use embedded_hal::pwm::{ErrorType, SetDutyCycle};

use super::TIMER_CLOCK;

/// The shortest pulse, µs.
pub const SHORTEST: u16 = 500;
/// The longest pulse, µs.
pub const LONGEST: u16 = 2_500;
/// From one pulse to the next, µs.
const PERIOD: u16 = 20_000;
/// Makes microseconds of [`TIMER_CLOCK`].
const DIVISOR: u16 = 240;
const _: () = assert!(TIMER_CLOCK.0 == DIVISOR as u32 * 1_000_000);

/// A timer of servos' outputs.
pub trait ServoTimer: GeneralInstance4Channel {
    #[doc(hidden)]
    const RUNS: &'static AtomicBool;
}

macro_rules! timers {
    ($($name:ident),*) => {
        $(impl ServoTimer for peripherals::$name {
            const RUNS: &'static AtomicBool = {
                static RUNS: AtomicBool = AtomicBool::new(false);
                &RUNS
            };
        })*
    };
}

timers!(TIM1, TIM3, TIM4, TIM5);

/// The parts of a servo's output. The outputs of one timer share it.
pub struct ServoParts<T: ServoTimer, P: Pin> {
    timer: Peri<'static, T>,
    /// The pin, where a program has something else.
    pub pin: Peri<'static, P>,
}

impl<T: ServoTimer, P: Pin> ServoParts<T, P> {
    /// A pin of a timer that makes nothing but servos' pulses.
    pub fn new(timer: &Peri<'static, T>, pin: Peri<'static, P>) -> Self {
        // SAFETY: they are used by `start` alone, which sets the timer up once, and registers of one channel then.
        Self { timer: unsafe { timer.clone_unchecked() }, pin }
    }

    /// Starts it: the pin is low until a pulse is set.
    #[must_use]
    pub fn start<C: TimerChannel>(self) -> ServoOutput
    where
        P: TimerPin<T, C>,
    {
        // SAFETY: the registers of a timer, of which those are used that every timer with this channel has.
        let timer = unsafe { TimGp32::from_ptr(T::regs()) };
        if !T::RUNS.swap(true, Ordering::Relaxed) {
            // Its clock, and the main output of one that has that.
            let started = Timer::new(self.timer);
            started.enable_outputs();
            // Dropped, it would stop.
            core::mem::forget(started);
            timer.psc().write_value(DIVISOR - 1);
            timer.arr().write_value(u32::from(PERIOD) - 1);
            // Takes the prescaler over.
            timer.egr().write(|w| w.set_ug(true));
            timer.cr1().modify(|w| w.set_cen(true));
        }
        let channel = C::CHANNEL.index();
        timer.ccmr_output(channel / 2).modify(|w| {
            w.set_ocm(channel % 2, vals::OcmGp::PWM_MODE1);
            // A new width counts from the next pulse on: none is cut.
            w.set_ocpe(channel % 2, true);
        });
        timer.ccer().modify(|w| w.set_cce(channel, true));
        // The pin only now: the timer behind it says low.
        let function = self.pin.af_num();
        let mut pin = Flex::new(self.pin);
        pin.set_as_af_unchecked(function, AfType::output(OutputType::PushPull, Speed::Low));
        // Dropped, it would disconnect.
        core::mem::forget(pin);
        ServoOutput { timer, channel }
    }
}

/// A servo's output. Its duty is the pulse, µs: 500 to 2500, to which others are bounded, or 0 for none.
///
/// The pulses go on while nothing is set, in a hang too; a restart of the chip ends them.
pub struct ServoOutput {
    timer: TimGp32,
    channel: usize,
}

impl ErrorType for ServoOutput {
    type Error = Infallible;
}

impl SetDutyCycle for ServoOutput {
    fn max_duty_cycle(&self) -> u16 {
        PERIOD
    }

    fn set_duty_cycle(&mut self, micros: u16) -> Result<(), Infallible> {
        let pulse = if micros == 0 { 0 } else { micros.clamp(SHORTEST, LONGEST) };
        self.timer.ccr(self.channel).write_value(pulse.into());
        Ok(())
    }
}
