use core::fmt;

use rc10_can::CanFrame;

/// A command that contains a NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NotANumber {
    /// Name of the value that is not a number.
    pub field: &'static str,
    /// A frame that may be sent in its place and moves nothing; see the command's `pack`.
    pub neutral: CanFrame,
}

impl fmt::Display for NotANumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the {} is not a number", self.field)
    }
}

impl core::error::Error for NotANumber {}
