//! Pulses of given widths, one per period, without a gap: what an LED strip of WS2812 listens to.
//!
//! A timer makes a PWM, and at each update a DMA brings the next compare value. It counts at
//! [`TIMER_CLOCK`](crate::TIMER_CLOCK). The compiler knows which timers can ask a DMA: at PF9 TIM23
//! ([`Ordinary`]), at PA7 TIM8 by channel 1's complement ([`Complement`]).
//!
//! The values are words: a 32-bit timer's register would double a half word (RM0468).

use core::marker::PhantomData;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pin, Speed};
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{Binding, Handler};
use embassy_stm32::pac::timer::{TimAdv, TimGp32, vals};
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::{
    AdvancedInstance4Channel, GeneralInstance4Channel, TimerChannel, TimerComplementaryPin,
    TimerPin, UpDma,
};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

use crate::dma::{DmaBuffer, DmaMemory, DmaStream, Stream, Transfer, enable};

/// Values of zero behind the last pulse: the DMA brings the second when the first takes effect.
const SILENT: usize = 2;

/// Told by the interrupt of a stream when a transfer is over: whether it worked.
static OVER: [Signal<CriticalSectionRawMutex, bool>; 16] = [const { Signal::new() }; 16];

/// The interrupt handler, for `bind_interrupts!`: of the DMA stream.
pub struct Interrupt<D>(PhantomData<D>);

impl<D: DmaStream> Handler<D::Interrupt> for Interrupt<D> {
    unsafe fn on_interrupt() {
        let events = D::STREAM.take_events();
        if events.error || events.complete {
            OVER[D::STREAM.number()].signal(!events.error);
        }
    }
}

/// Why pulses were not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PulseError {
    /// There were more than the buffer holds; none was sent.
    #[error("the buffer holds {room} pulses, not {pulses}")]
    TooMany {
        /// Number of pulses that were to be sent.
        pulses: usize,
        /// Number of pulses that the buffer holds.
        room: usize,
    },
    /// The DMA could not transfer; some were sent.
    #[error("a DMA transfer failed")]
    Dma,
}

/// The output of a timer's channel.
pub struct Ordinary;

/// An advanced timer's complement: the channel's own signal, if that has no pin (RM0468).
pub struct Complement;

/// A pin at which a timer can make pulses.
pub trait PulsePin<T, C, O>: Pin {
    /// The pin's alternate function.
    fn function(&self) -> u8;

    /// Lets the channel out of the timer.
    fn enable(timer: TimGp32, channel: usize);
}

impl<T: GeneralInstance4Channel, C: TimerChannel, P: TimerPin<T, C>> PulsePin<T, C, Ordinary>
    for P
{
    fn function(&self) -> u8 {
        self.af_num()
    }

    fn enable(timer: TimGp32, channel: usize) {
        timer.ccer().modify(|w| w.set_cce(channel, true));
    }
}

impl<T: AdvancedInstance4Channel, C: TimerChannel, P: TimerComplementaryPin<T, C>>
    PulsePin<T, C, Complement> for P
{
    fn function(&self) -> u8 {
        self.af_num()
    }

    fn enable(timer: TimGp32, channel: usize) {
        // SAFETY: these are the registers of an advanced timer, as `T` says.
        let timer = unsafe { TimAdv::from_ptr(timer.as_ptr()) };
        timer.ccer().modify(|w| w.set_ccne(channel, true));
    }
}

/// An output that is low, but for the pulses it is told to send.
pub struct PulseOutput {
    /// The registers that are used here are at the same places in all timers.
    timer: TimGp32,
    channel: usize,
    stream: Stream,
    request: u8,
    memory: DmaMemory<u32>,
}

impl PulseOutput {
    /// Starts the timer, a pulse every `period` of its clocks, 2 or more; two values more of room.
    ///
    /// `priority` is that of the stream's interrupt.
    pub fn start<T, C: TimerChannel, P: PulsePin<T, C, O>, O, D, const N: usize>(
        timer: Peri<'static, T>,
        pin: Peri<'static, P>,
        stream: Peri<'static, D>,
        _interrupt: impl Binding<D::Interrupt, Interrupt<D>>,
        period: u16,
        buffer: DmaBuffer<u32, N>,
        priority: Priority,
    ) -> Self
    where
        T: GeneralInstance4Channel,
        D: DmaStream + UpDma<T>,
    {
        const { assert!(N > SILENT, "no room for a pulse") };
        // Its clock, and the main output of one that has that.
        let started = Timer::new(timer);
        started.enable_outputs();
        // Dropped, it would stop.
        core::mem::forget(started);
        // SAFETY: the registers of a timer, of which those are used that every timer with this channel has.
        let timer = unsafe { TimGp32::from_ptr(T::regs()) };
        let channel = C::CHANNEL.index();
        timer.arr().write_value(u32::from(period.max(2)) - 1);
        timer.ccmr_output(channel / 2).modify(|w| {
            w.set_ocm(channel % 2, vals::OcmGp::PWM_MODE1);
            w.set_ocpe(channel % 2, true);
        });
        P::enable(timer, channel);
        timer.cr1().modify(|w| w.set_arpe(true));
        // Takes the registers over: the compare value is 0, so the output stays low.
        timer.egr().write(|w| w.set_ug(true));
        timer.cr1().modify(|w| w.set_cen(true));

        // The pin only now: the timer behind it says low.
        let function = pin.function();
        let mut pin = Flex::new(pin);
        pin.set_as_af_unchecked(function, AfType::output(OutputType::PushPull, Speed::Medium));
        // Dropped, it would disconnect.
        core::mem::forget(pin);
        enable::<D::Interrupt>(priority);
        let (request, memory) = (stream.request(), buffer.memory());
        Self { timer, channel, stream: D::STREAM, request, memory }
    }

    /// Sends a pulse for each value, as many of the timer's clocks wide; returns when the last one
    /// is over. If the future is dropped, the pulses go on, and the next call waits for them.
    pub async fn send(&mut self, widths: &[u16]) -> Result<(), PulseError> {
        let room = self.memory.length() - SILENT;
        if widths.len() > room {
            return Err(PulseError::TooMany { pulses: widths.len(), room });
        }
        let over = &OVER[self.stream.number()];
        if self.stream.is_running() {
            over.wait().await;
        }
        over.reset();
        let values = widths.iter().map(|&width| u32::from(width)).chain([0; SILENT]);
        let count = self.memory.fill(values);
        let transfer = Transfer {
            request: self.request,
            peripheral: self.timer.ccr(self.channel).as_ptr() as u32,
            to_peripheral: true,
            circular: false,
            is_serial: false,
        };
        // Off and on: a request of before is void.
        self.timer.dier().modify(|w| w.set_ude(false));
        self.stream.start(&transfer, &self.memory, count);
        self.timer.dier().modify(|w| w.set_ude(true));
        if over.wait().await {
            return Ok(());
        }
        // Not for ever what the failed transfer brought last.
        self.timer.ccr(self.channel).write_value(0);
        Err(PulseError::Dma)
    }
}
