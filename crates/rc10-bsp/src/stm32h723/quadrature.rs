//! Incremental encoders on timers: the whole counter. (embassy-stm32 reads 16 bits, unfiltered.)
//!
//! A counter starts over at [`QuadratureTimer::MODULUS`], as an `encoder::Counter` knows.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Pull};
use embassy_stm32::pac::timer::{TimGp32, vals};
use embassy_stm32::peripherals::{TIM3, TIM4, TIM5, TIM24};
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::{Ch1, Ch2, GeneralInstance4Channel, TimerPin};

/// A timer of two tracks whose counter's length is known.
pub trait QuadratureTimer: GeneralInstance4Channel {
    /// Counts after which its counter starts over.
    const MODULUS: u64;
}

impl QuadratureTimer for TIM3 {
    const MODULUS: u64 = 1 << 16;
}
impl QuadratureTimer for TIM4 {
    const MODULUS: u64 = 1 << 16;
}
impl QuadratureTimer for TIM5 {
    const MODULUS: u64 = 1 << 32;
}
impl QuadratureTimer for TIM24 {
    const MODULUS: u64 = 1 << 32;
}

/// The counter of an encoder: both edges of both tracks count.
pub struct QuadratureCounter {
    registers: TimGp32,
}

impl QuadratureCounter {
    /// Counts from zero. `pull` is for open collectors; shorter than 33 ns is no edge.
    pub fn start<T: QuadratureTimer, A: TimerPin<T, Ch1>, B: TimerPin<T, Ch2>>(
        timer: Peri<'static, T>,
        track_a: Peri<'static, A>,
        track_b: Peri<'static, B>,
        pull: Pull,
    ) -> Self {
        let functions = [track_a.af_num(), track_b.af_num()];
        for (mut pin, function) in
            [Flex::new(track_a), Flex::new(track_b)].into_iter().zip(functions)
        {
            pin.set_as_af_unchecked(function, AfType::input(pull));
            // Dropped, it would disconnect.
            core::mem::forget(pin);
        }
        let timer = Timer::new(timer);
        // SAFETY: a general timer by its trait; those of 16 bits read zero in the upper halves.
        let registers = unsafe { TimGp32::from_ptr(timer.regs_core().as_ptr()) };
        // Dropped, it would stop.
        core::mem::forget(timer);
        registers.ccmr_input(0).modify(|w| {
            for channel in 0..2 {
                w.set_ccs(channel, vals::CcmrInputCcs::TI4);
                w.set_icf(channel, vals::FilterValue::FCK_INT_N8);
            }
        });
        registers.smcr().modify(|w| w.set_sms(vals::Sms::ENCODER_MODE_3));
        #[expect(clippy::cast_possible_truncation, reason = "2^32 at most")]
        registers.arr().write_value((T::MODULUS - 1) as u32);
        registers.cr1().modify(|w| w.set_cen(true));
        Self { registers }
    }

    /// The counter: 0 ..< [`QuadratureTimer::MODULUS`].
    #[must_use]
    pub fn read(&self) -> u32 {
        self.registers.cnt().read()
    }
}
