//! Times of the rising edges of an input, to the microsecond: for a PPM receiver.
//!
//! TIM13 notes each rising edge at PA6 or PF8 in hardware, without an interrupt's delay. Its 16
//! bits are extended by counting rounds; a channel of [`HELD`] edges hands times over.

use core::cell::Cell;

use embassy_stm32::gpio::{AfType, Flex, Pin, Pull};
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{self, Binding, Handler};
use embassy_stm32::pac::timer::{regs, vals};
use embassy_stm32::peripherals::TIM13;
use embassy_stm32::{Peri, pac, rcc};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use rc10_time::Micros;

use super::TIMER_CLOCK;
use crate::dma::enable;

/// Edges that wait for their reader: three frames of eight channels.
pub const HELD: usize = 32;

/// TIM13's channel 1 at these pins: port A is 0 (stm32-metapac; embassy-stm32 has no trait).
const PINS: [(u8, u8); 2] = [(0, 6), (5, 8)];
const ALTERNATE_FUNCTION: u8 = 9;
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

/// The interrupt handler, for `bind_interrupts!`.
pub struct Interrupt;

impl Handler<typelevel::TIM8_UP_TIM13> for Interrupt {
    unsafe fn on_interrupt() {
        let timer = pac::TIM13;
        let flags = timer.sr().read();
        // A flag is cleared by a zero; one that came since must stay.
        timer.sr().write_value(regs::Sr1ch(!flags.0));
        let mut state = STATE.lock(Cell::get);
        let before = state.round_began;
        if flags.uif() {
            state.round_began = before + Micros::new(ROUND);
        }
        if flags.ccif(0) {
            let at = timer.ccr(0).read().ccr();
            // An edge late in a round that has ended since is of that round.
            let is_of_before = flags.uif() && u64::from(at) >= ROUND / 2;
            let began = if is_of_before { before } else { state.round_began };
            if EDGES.try_send(began + Micros::new(at.into())).is_err() {
                state.lost = state.lost.saturating_add(1);
            }
        }
        if flags.ccof(0) {
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
    ///
    /// # Panics
    /// If the timer is not at this pin: it is at PA6 and PF8.
    pub fn start(
        _timer: Peri<'static, TIM13>,
        pin: Peri<'static, impl Pin>,
        _interrupt: impl Binding<typelevel::TIM8_UP_TIM13, Interrupt>,
        priority: Priority,
    ) -> Self {
        assert!(PINS.contains(&(pin.port(), pin.pin())), "TIM13 is at PA6 and PF8 alone");
        let mut pin = Flex::new(pin);
        pin.set_as_af_unchecked(ALTERNATE_FUNCTION, AfType::input(Pull::Down));
        // Dropped, it would disconnect.
        core::mem::forget(pin);
        rcc::enable_and_reset::<TIM13>();
        let timer = pac::TIM13;
        timer.psc().write_value(DIVISOR - 1);
        timer.arr().write(|w| w.set_arr(u16::MAX));
        timer.ccmr_input(0).modify(|w| {
            w.set_ccs(0, vals::CcmrInputCcs::TI4);
            w.set_icf(0, vals::FilterValue::FCK_INT_N8);
        });
        timer.ccer().modify(|w| w.set_cce(0, true));
        // Takes the prescaler over; that shows as an update, which does not count.
        timer.egr().write(|w| w.set_ug(true));
        timer.sr().write_value(regs::Sr1ch(0));
        STATE.lock(|state| state.set(State { round_began: rc10_message::now(), lost: 0 }));
        timer.cr1().modify(|w| w.set_cen(true));
        timer.dier().modify(|w| {
            w.set_ccie(0, true);
            w.set_uie(true);
        });
        enable::<typelevel::TIM8_UP_TIM13>(priority);
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
