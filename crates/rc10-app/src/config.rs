use core::fmt;

/// A number in a configuration that cannot be used, and where it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConfigError {
    /// The field, as it is written in the source.
    pub field: &'static str,
    /// What it holds.
    pub value: f32,
    /// What it must be.
    pub must_be: &'static str,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is {}, but must be {}", self.field, self.value, self.must_be)
    }
}

impl core::error::Error for ConfigError {}

/// `Ok` for a finite number.
pub(crate) fn finite(field: &'static str, value: f32) -> Result<(), ConfigError> {
    check(value.is_finite(), field, value, "finite")
}

/// `Ok` for a finite number of zero or more.
pub(crate) fn not_negative(field: &'static str, value: f32) -> Result<(), ConfigError> {
    check(value.is_finite() && value >= 0.0, field, value, "finite and not negative")
}

/// `Ok` for a finite number above zero.
pub(crate) fn positive(field: &'static str, value: f32) -> Result<(), ConfigError> {
    check(value.is_finite() && value > 0.0, field, value, "finite and positive")
}

/// `Ok` for a number above zero, or for infinity, which stands for "no limit".
pub(crate) fn positive_or_unlimited(field: &'static str, value: f32) -> Result<(), ConfigError> {
    check(value > 0.0, field, value, "positive (infinite: no limit)")
}

fn check(
    good: bool,
    field: &'static str,
    value: f32,
    must_be: &'static str,
) -> Result<(), ConfigError> {
    if good { Ok(()) } else { Err(ConfigError { field, value, must_be }) }
}
