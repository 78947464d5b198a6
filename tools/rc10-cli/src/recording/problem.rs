//! Findings about a run, as data: console, JSON, report and exit code say the same.

use serde_json::{Value, json};
use std::fmt;

/// The severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Something to mend: `--strict` ends with exit code 3.
    Problem,
    /// Good to know.
    Information,
}

/// The subject of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum About {
    /// The robot as a whole.
    Robot,
    /// The motor with this label.
    Motor(&'static str),
    /// A bus; the first is 1.
    Bus(u8),
    /// An RS-485 line; the first is 1.
    Line(u8),
    /// The remote control.
    Remote,
    /// The part on a UART with this label.
    Part(&'static str),
    /// The emulated chip and its program.
    Chip,
}

impl fmt::Display for About {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Robot => f.write_str("robot"),
            Self::Motor(label) | Self::Part(label) => f.write_str(label),
            Self::Bus(number) => write!(f, "bus {number}"),
            Self::Line(number) => write!(f, "line {number}"),
            Self::Remote => f.write_str("remote"),
            Self::Chip => f.write_str("chip"),
        }
    }
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Severity of the finding.
    pub severity: Severity,
    /// Subject of the finding.
    pub about: About,
    /// Identifier for programs: small letters with hyphens.
    pub kind: &'static str,
    /// Text for people: a sentence without its subject.
    pub text: String,
}

impl Problem {
    /// Creates a problem: something to mend.
    #[must_use]
    pub const fn new(about: About, kind: &'static str, text: String) -> Self {
        Self { severity: Severity::Problem, about, kind, text }
    }

    /// Creates information: something good to know.
    #[must_use]
    pub const fn information(about: About, kind: &'static str, text: String) -> Self {
        Self { severity: Severity::Information, about, kind, text }
    }

    /// The finding as JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "severity": match self.severity {
                Severity::Problem => "problem",
                Severity::Information => "information",
            },
            "about": self.about.to_string(),
            "kind": self.kind,
            "text": self.text,
        })
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.about, self.text)
    }
}

/// A problem for each count that is not zero; each has its kind, and what is counted.
pub(crate) fn counted<'t>(
    about: About,
    counts: impl IntoIterator<Item = (u64, &'static str, &'t str)>,
) -> impl Iterator<Item = Problem> {
    let counts = counts.into_iter().filter(|(count, ..)| *count > 0);
    counts.map(move |(count, kind, what)| Problem::new(about, kind, format!("{count} {what}")))
}

/// Whether there is something to mend.
#[must_use]
pub fn any(problems: &[Problem]) -> bool {
    problems.iter().any(|problem| problem.severity == Severity::Problem)
}
