use crate::text::Text;

/// A number in a configuration that cannot be used, and where it stands.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("{}", self.text())]
#[must_use]
pub struct ConfigError {
    /// Model and identifier of the device whose configuration it is, if it is a device's.
    pub device: Option<(&'static str, u16)>,
    /// The part of the configuration, such as `speed` for the speed loop; empty for the whole.
    pub part: &'static str,
    /// The field, as it is written in the source.
    pub field: &'static str,
    /// The value.
    pub value: f32,
    /// The values allowed.
    pub must_be: &'static str,
}

impl ConfigError {
    /// A field that holds `value`, but must be something else.
    pub const fn new(field: &'static str, value: f32, must_be: &'static str) -> Self {
        Self { device: None, part: "", field, value, must_be }
    }

    /// `Ok` if `good`, else [`new`](Self::new).
    pub const fn check(
        good: bool,
        field: &'static str,
        value: f32,
        must_be: &'static str,
    ) -> Result<(), Self> {
        if good { Ok(()) } else { Err(Self::new(field, value, must_be)) }
    }

    /// The same, in a part of a configuration.
    pub const fn in_part(self, part: &'static str) -> Self {
        Self { part, ..self }
    }

    /// The same, in the configuration of a device.
    pub const fn of_device(self, model: &'static str, id: u16) -> Self {
        Self { device: Some((model, id)), ..self }
    }

    /// The message, for a `const`, which cannot use [`Display`](core::fmt::Display).
    pub const fn text(&self) -> Text {
        self.add_to(Text::new())
    }

    /// A text with what it says at its end.
    pub const fn add_to(&self, mut text: Text) -> Text {
        let Self { device, part, field, value, must_be } = *self;
        if let Some((model, id)) = device {
            text = text.push(model).push(" id ").push_number(id as u64).push(": ");
        }
        let dot = if part.is_empty() { "" } else { "." };
        let text = text.push("`").push(part).push(dot).push(field).push("` is ");
        text.push_float(value).push(", but must be ").push(must_be)
    }
}

/// `?` for a `const fn`, which has none yet: the value of a `Result`, or back with its error. With
/// `in "speed"` it is an error [of that part](ConfigError::in_part).
#[macro_export]
macro_rules! ok {
    ($result:expr) => {
        match $result {
            Ok(value) => value,
            Err(error) => return Err(error),
        }
    };
    ($result:expr, in $part:literal) => {
        match $result {
            Ok(value) => value,
            Err(error) => return Err(error.in_part($part)),
        }
    };
}

pub(crate) const fn finite(field: &'static str, value: f32) -> Result<(), ConfigError> {
    ConfigError::check(value.is_finite(), field, value, "finite")
}

/// `Ok` for a finite number of zero or more.
pub(crate) const fn not_negative(field: &'static str, value: f32) -> Result<(), ConfigError> {
    ConfigError::check(value.is_finite() && value >= 0.0, field, value, "finite and not negative")
}

pub(crate) const fn positive(field: &'static str, value: f32) -> Result<(), ConfigError> {
    ConfigError::check(value.is_finite() && value > 0.0, field, value, "finite and positive")
}

/// `Ok` for the radius of a wheel in metres.
pub(crate) const fn radius(value: f32) -> Result<(), ConfigError> {
    ok!(positive("radius", value));
    ConfigError::check(value <= 1.0, "radius", value, "in metres, 1 at most")
}

/// `Ok` for a place in a robot, in metres.
pub(crate) const fn within_robot(field: &'static str, value: f32) -> Result<(), ConfigError> {
    ok!(finite(field, value));
    ConfigError::check(value.abs() <= 5.0, field, value, "in metres, 5 at most")
}

/// `Ok` for a number above zero, or for infinity, which stands for "no limit".
pub(crate) const fn positive_or_unlimited(
    field: &'static str,
    value: f32,
) -> Result<(), ConfigError> {
    ConfigError::check(value > 0.0, field, value, "positive (infinite: no limit)")
}
