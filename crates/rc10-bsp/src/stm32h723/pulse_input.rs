//! Times of the rising edges of an input, to the microsecond: for a PPM receiver.
//!
//! A timer notes each rising edge in hardware, without an interrupt's delay. Its 16 bits are extended by counting
//! rounds; a channel of [`HELD`] edges hands times over. A program has one input.

use core::cell::Cell;
use core::marker::PhantomData;

use embassy_stm32::gpio::{AfType, Flex, Pull};
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{Binding, Handler};
use embassy_stm32::pac::timer::{TimGp16, regs, vals};
use embassy_stm32::timer::{GeneralInstance4Channel, TimerChannel, TimerPin};
use embassy_stm32::{Peri, rcc};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use rc10_time::Micros;

use super::TIMER_CLOCK;
use crate::dma::enable;

/// Edges that wait for their reader: three frames of eight channels.
pub const HELD: usize = 32;

/// Makes microseconds of [`TIMER_CLOCK`].
const DIVISOR: u16 = 240;
const _: () = assert!(TIMER_CLOCK.0 == DIVISOR as u32 * 1_000_000);
const ROUND: u64 = 1 << 16;

static EDGES: Channel<CriticalSectionRawMutex, Micros, HELD> = Channel::new();
static STATE: Mutex<CriticalSectionRawMutex, Cell<State>> =
    Mutex::new(Cell::new(State { round_began: Micros::ZERO, lost: 0 }));

#[derive(Clone, Copy)]
struct State {
    /// The time at which the timer was at zero last.
    round_began: Micros,
    lost: u32,
}

/// The registers of a timer, of which those are used that one of one channel has, too.
fn registers<T: GeneralInstance4Channel>() -> TimGp16 {
    // SAFETY: they are where a timer's are.
    unsafe { TimGp16::from_ptr(T::regs()) }
}

/// The interrupt handler, for `bind_interrupts!`: of a timer and its channel.
pub struct Interrupt<T, C>(PhantomData<(T, C)>);

impl<T: GeneralInstance4Channel, C: TimerChannel> Handler<T::CaptureCompareInterrupt>
    for Interrupt<T, C>
{
    unsafe fn on_interrupt() {
        let (timer, channel) = (registers::<T>(), C::CHANNEL.index());
        let flags = timer.sr().read();
        // A flag is cleared by a zero; one that came since must stay.
        timer.sr().write_value(regs::SrGp16(!flags.0));
        let mut state = STATE.lock(Cell::get);
        let before = state.round_began;
        if flags.uif() {
            state.round_began = before + Micros::new(ROUND);
        }
        if flags.ccif(channel) {
            let at = timer.ccr(channel).read().ccr();
            // An edge late in a round that has ended since is of that round.
            let is_of_before = flags.uif() && u64::from(at) >= ROUND / 2;
            let began = if is_of_before { before } else { state.round_began };
            if EDGES.try_send(began + Micros::new(at.into())).is_err() {
                state.lost = state.lost.saturating_add(1);
            }
        }
        if flags.ccof(channel) {
            // At least one more edge came before this interrupt.
            state.lost = state.lost.saturating_add(1);
        }
        STATE.lock(|cell| cell.set(state));
    }
}

/// The rising edges at a pin.
pub struct PulseInput(());

impl PulseInput {
    /// Starts the timer; `priority` is its interrupt's, never held off for 32 ms. Edges last 33 ns.
    pub fn start<T: GeneralInstance4Channel, C: TimerChannel>(
        _timer: Peri<'static, T>,
        pin: Peri<'static, impl TimerPin<T, C>>,
        _interrupt: impl Binding<T::CaptureCompareInterrupt, Interrupt<T, C>>,
        priority: Priority,
    ) -> Self {
        let function = pin.af_num();
        let mut pin = Flex::new(pin);
        pin.set_as_af_unchecked(function, AfType::input(Pull::Down));
        // Dropped, it would disconnect.
        core::mem::forget(pin);
        rcc::enable_and_reset::<T>();
        let (timer, channel) = (registers::<T>(), C::CHANNEL.index());
        timer.psc().write_value(DIVISOR - 1);
        timer.arr().write(|w| w.set_arr(u16::MAX));
        timer.ccmr_input(channel / 2).modify(|w| {
            w.set_ccs(channel % 2, vals::CcmrInputCcs::TI4);
            w.set_icf(channel % 2, vals::FilterValue::FCK_INT_N8);
        });
        timer.ccer().modify(|w| w.set_cce(channel, true));
        // Takes the prescaler over; that shows as an update, which does not count.
        timer.egr().write(|w| w.set_ug(true));
        timer.sr().write_value(regs::SrGp16(0));
        STATE.lock(|state| state.set(State { round_began: rc10_message::now(), lost: 0 }));
        timer.cr1().modify(|w| w.set_cen(true));
        timer.dier().modify(|w| {
            w.set_ccie(channel, true);
            w.set_uie(true);
        });
        enable::<T::CaptureCompareInterrupt>(priority);
        Self(())
    }

    /// The next rising edge, exact to a microsecond to other edges. A dropped future takes none.
    pub async fn rising_edge(&mut self) -> Micros {
        EDGES.receive().await
    }

    /// Edges not handed over: reader or interrupt were too slow. Of the latter an occasion is one.
    #[must_use]
    pub fn lost(&self) -> u32 {
        STATE.lock(Cell::get).lost
    }
}
