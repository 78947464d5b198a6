use std::fmt;

use rc10_can::Micros;
use rc10_motor::MotorName;

/// A rule that a motor breaks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breach {
    /// The rule's name.
    pub rule: &'static str,
    /// What happened.
    pub what: String,
    /// When, in virtual time since the motor was plugged in; `None` if time does not come into it.
    pub at: Option<Micros>,
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.rule, self.what)?;
        self.at.map_or(Ok(()), |at| write!(f, " (at {at})"))
    }
}

/// Every rule that a motor breaks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    pub(crate) motor: MotorName,
    pub(crate) breaches: Vec<Breach>,
    pub(crate) unchecked: Vec<&'static str>,
}

impl Report {
    /// All that was found, in the order of the [rules](crate::RULES).
    #[must_use]
    pub fn breaches(&self) -> &[Breach] {
        &self.breaches
    }

    /// The names of the rules that are broken, each once.
    pub fn broken(&self) -> impl Iterator<Item = &'static str> {
        let mut last = None;
        let rules = self.breaches.iter().map(|breach| breach.rule);
        rules.filter(move |rule| last.replace(*rule) != Some(*rule))
    }

    /// The rules that could not be tried to the end, because the motor did not do what it takes
    /// (turn, above all).
    #[must_use]
    pub fn unchecked(&self) -> &[&'static str] {
        &self.unchecked
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.breaches.len();
        write!(f, "{}: {count} found", self.motor)?;
        self.breaches.iter().try_for_each(|breach| write!(f, "\n  {breach}"))?;
        if self.unchecked.is_empty() {
            return Ok(());
        }
        write!(f, "\n  not tried to the end: {}", self.unchecked.join(", "))
    }
}

impl std::error::Error for Report {}
