use std::fmt;

use rc10_motor::MotorName;
use rc10_motor::rc10_app::Direction;
use rc10_time::Micros;

/// A rule that a motor breaks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breach {
    /// The rule's name.
    pub rule: &'static str,
    /// Description of what happened.
    pub what: String,
    /// Virtual time since the motor was plugged in; `None` if time does not come into it.
    pub at: Option<Micros>,
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.rule, self.what)?;
        self.at.map_or(Ok(()), |at| write!(f, " (at {at})"))
    }
}

/// Every rule that a motor breaks. Its first line has the finding from which others follow, if there
/// is one. `Debug` is the same text as `Display`: what a test that returns it prints.
#[derive(Clone, PartialEq, Eq)]
pub struct Report {
    pub(crate) motor: MotorName,
    pub(crate) direction: Direction,
    /// All that was found: first wrong numbers and panics, from which others follow, then the others,
    /// both in the order of the [rules](crate::RULES).
    pub breaches: Vec<Breach>,
    /// The rules that could not be tried to the end, because the motor did not do what it takes
    /// (turn, above all).
    pub unchecked: Vec<&'static str>,
}

impl Report {
    /// The names of the rules that are broken, each once.
    pub fn broken(&self) -> impl Iterator<Item = &'static str> {
        let rules = self.breaches.iter().map(|breach| breach.rule).enumerate();
        let is_first =
            |&(index, rule): &(usize, _)| self.breaches[..index].iter().all(|it| it.rule != rule);
        rules.filter(is_first).map(|(_, rule)| rule)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let motor = self.motor;
        match self.direction {
            Direction::Forward => write!(f, "{motor}: ")?,
            Direction::Reversed => write!(f, "{motor}, reversed: ")?,
        }
        match self.breaches.split_first() {
            None => write!(f, "it does not do what the rules start from")?,
            Some((first, others)) => {
                write!(f, "{first}")?;
                others.iter().try_for_each(|breach| write!(f, "\n  {breach}"))?;
            }
        }
        if self.unchecked.is_empty() {
            return Ok(());
        }
        write!(f, "\n  not tried to the end: {}", self.unchecked.join(", "))
    }
}

impl fmt::Debug for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Report {}
