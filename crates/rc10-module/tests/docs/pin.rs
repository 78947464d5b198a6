// A pin for the examples in the docs.
use core::convert::Infallible;
use embedded_hal::digital::{ErrorType, InputPin};

pub struct High;

impl ErrorType for High {
    type Error = Infallible;
}

impl InputPin for High {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(false)
    }
}
