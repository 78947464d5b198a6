use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use rc10_can::BitTimingError;

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

/// Reads of a register until the controller must have answered: tens of microseconds.
const PATIENCE: u32 = 1000;

/// Reads of a register until a controller that has only to notice must have: a microsecond.
const BRIEF: u32 = 16;

/// Waits until something is so, but not for long; whether it is.
pub fn wait_for(mut is_so: impl FnMut() -> bool) -> bool {
    (0..PATIENCE).any(|_| is_so())
}

/// The same, for critical sections.
pub fn wait_briefly(mut is_so: impl FnMut() -> bool) -> bool {
    (0..BRIEF).any(|_| is_so())
}

/// Connects the pins, only after the reset: without a controller they could hold the bus.
pub fn connect(receive: (Flex<'static>, u8), transmit: (Flex<'static>, u8)) {
    let (mut receive, function) = receive;
    // Pulled to recessive: a transceiver without supply would leave it to the noise.
    receive.set_as_af_unchecked(function, AfType::input(Pull::Up));
    let (mut transmit, function) = transmit;
    let push_pull = AfType::output(OutputType::PushPull, Speed::VeryHigh);
    transmit.set_as_af_unchecked(function, push_pull);
    // Dropped, they would disconnect.
    core::mem::forget((receive, transmit));
}
