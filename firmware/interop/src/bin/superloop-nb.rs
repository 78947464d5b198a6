//! On any HAL.
#![no_std]
#![no_main]

use core::convert::Infallible;

use cortex_m_rt::entry;
// For its interrupt vectors alone; your HAL brings them.
use embassy_stm32 as _;
use interop::{Heartbeat, superloop};
use rc10_can::CanFrame;
use rc10_can::embedded_can::nb::Can;

/// Put your HAL's CAN driver here. This one is a wire without other nodes.
struct YourDriver;

impl Can for YourDriver {
    type Frame = CanFrame;
    type Error = Never;

    fn transmit(&mut self, _: &CanFrame) -> nb::Result<Option<CanFrame>, Never> {
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, Never> {
        Err(nb::Error::WouldBlock)
    }
}

#[derive(Debug)]
struct Never(Infallible);

impl rc10_can::embedded_can::Error for Never {
    fn kind(&self) -> rc10_can::embedded_can::ErrorKind {
        match self.0 {}
    }
}

#[entry]
fn main() -> ! {
    let Some(core) = cortex_m::Peripherals::take() else {
        unreachable!("taken once");
    };
    // The chip's internal oscillator after reset.
    superloop(YourDriver, Heartbeat::start(core.SYST, 64_000_000))
}
