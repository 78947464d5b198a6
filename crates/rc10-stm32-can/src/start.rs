use core::marker::PhantomData;

use embassy_stm32::can::{Instance, RxPin, TxPin};
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::interrupt::typelevel::{Handler, Interrupt};
use embassy_stm32::{Peri, rcc};
use rc10_can::{BitTiming, BitTimingError};

#[cfg(feature = "bxcan")]
pub use crate::bxcan::BxCan as Controller;
#[cfg(feature = "fdcan")]
pub use crate::fdcan::Fdcan as Controller;
use crate::{Port, SharedDriver};

/// Why a bus was not started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StartError {
    /// The controller's clock cannot make the bit rate.
    #[error(transparent)]
    BitTiming(#[from] BitTimingError),
    /// No configuration mode within 1000 reads; most likely the controller has no clock.
    #[error("the CAN controller does not answer")]
    NoAnswer,
    /// bxCAN: the controller whose filters it shares was not started before.
    #[error("the controller that has the filters starts first")]
    NoFilters,
}

/// A bus, as `bxcan_bus!` or `fdcan_bus!` declares it.
pub trait Bus: 'static {
    /// The peripheral.
    type Peripheral: Instance;

    #[doc(hidden)]
    fn controller() -> Controller;

    #[doc(hidden)]
    fn shared() -> &'static SharedDriver<Controller>;
}

/// The common part of `bxcan_bus!` and `fdcan_bus!`.
#[doc(hidden)]
#[macro_export]
macro_rules! bus {
    ([$($head:tt)*] $name:ident $peripheral:ident $controller:expr) => {
        $($head)* enum $name {}

        impl $crate::Bus for $name {
            type Peripheral = $crate::embassy_stm32::peripherals::$peripheral;

            fn controller() -> $crate::Controller {
                $controller
            }

            fn shared() -> &'static $crate::SharedDriver<$crate::Controller> {
                static SHARED: $crate::SharedDriver<$crate::Controller> = $crate::SharedDriver::new();
                &SHARED
            }
        }
    };
}

/// For a bus's interrupts, in `bind_interrupts!`: bxCAN's `TX` and `RX0`, FDCAN's `IT0`. The others are
/// not used.
pub struct InterruptHandler<B>(PhantomData<B>);

impl<B: Bus, I: Interrupt> Handler<I> for InterruptHandler<B> {
    #[expect(unsafe_code, reason = "embassy-stm32's trait has it so; nothing here is unsafe")]
    unsafe fn on_interrupt() {
        B::shared().on_interrupt();
    }
}

/// Starts a bus, but not its interrupts.
pub fn start<B: Bus>(
    receive: Peri<'static, impl RxPin<B::Peripheral>>,
    transmit: Peri<'static, impl TxPin<B::Peripheral>>,
    bits_per_second: u32,
) -> Result<Port<Controller>, StartError> {
    let clock = rcc::frequency::<B::Peripheral>().0;
    let timing = BitTiming::find(clock, bits_per_second, Controller::LIMITS)?;
    // The FDCANs of a chip have one reset in common; embassy does it before the first only.
    rcc::enable_and_reset::<B::Peripheral>();
    // The pins only after the reset: without a controller they could hold the bus.
    let functions = (receive.af_num(), transmit.af_num());
    let (mut receive, mut transmit) = (Flex::new(receive), Flex::new(transmit));
    // Pulled to recessive: a transceiver without supply would leave it to the noise.
    receive.set_as_af_unchecked(functions.0, AfType::input(Pull::Up));
    let push_pull = AfType::output(OutputType::PushPull, Speed::VeryHigh);
    transmit.set_as_af_unchecked(functions.1, push_pull);
    // Dropped, they would disconnect.
    core::mem::forget((receive, transmit));
    let mut controller = B::controller();
    controller.configure(timing)?;
    Ok(B::shared().start(controller))
}

/// Reads of a register until the controller must have answered: tens of microseconds.
pub const PATIENCE: u32 = 1000;

/// Reads of a register until a controller that has only to notice must have: a microsecond, so also for
/// critical sections.
pub const BRIEF: u32 = 16;

/// Waits until something is so, for this number of looks at most; whether it is.
pub fn wait_for(looks: u32, mut is_so: impl FnMut() -> bool) -> bool {
    (0..looks).any(|_| is_so())
}

/// A number of quanta or filters as a register field takes it.
#[expect(clippy::cast_possible_truncation, reason = "at most 255")]
pub fn byte(count: impl Into<usize>) -> u8 {
    count.into() as u8
}
