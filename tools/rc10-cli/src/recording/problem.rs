//! Findings about a run, as data: console, JSON, report and exit code say the same.

use rc10_time::Micros;
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

/// All findings, a line each: the kind, or the cause where that says more; the cause in at most five words; the signals of
/// its culprit that show it; what tells it from others, and what to do. What stands further up explains more of what
/// stands below.
const FINDINGS: &str = include_str!("findings.tsv");

/// The line of a kind or a cause: its place, and the words behind it.
fn known(wanted: &str) -> Option<(usize, [&'static str; 4])> {
    let mut lines = FINDINGS.lines().map(|line| line.split('\t')).enumerate();
    lines.find_map(|(place, mut words)| {
        let is_it = words.next() == Some(wanted);
        is_it.then(|| (place, std::array::from_fn(|_| words.next().unwrap_or_default())))
    })
}

/// Length of a text in bytes up to which it is its own headline.
const SHORT: usize = 60;

/// Kinds that say what no run of this robot can show: the same after every run.
const STANDING: [&str; 4] = ["not-overdetermined", "wheel-radius", "not-checked", "no-inertia"];

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
    /// The cause in a few words.
    pub cause: &'static str,
    /// Labels of the motors that cause it, where those are not its subject.
    pub culprits: Vec<&'static str>,
    /// Its begin and its end, where it has a time.
    pub span: Option<(Micros, Micros)>,
}

impl Problem {
    /// Creates a problem: something to mend.
    pub fn new(about: About, kind: &'static str, text: String) -> Self {
        let cause = known(kind).map_or(kind, |(_, [cause, ..])| cause);
        let (severity, culprits, span) = (Severity::Problem, Vec::new(), None);
        Self { severity, about, kind, text, cause, culprits, span }
    }

    /// Creates information: something good to know.
    pub fn information(about: About, kind: &'static str, text: String) -> Self {
        Self { severity: Severity::Information, ..Self::new(about, kind, text) }
    }

    /// The same, of this time.
    #[must_use]
    pub fn in_time(self, begin: Micros, length: Micros) -> Self {
        Self { span: Some((begin, begin + length)), ..self }
    }

    /// The same with a cause of its own.
    #[must_use]
    pub fn because(self, cause: &'static str) -> Self {
        Self { cause, ..self }
    }

    /// Culprit and cause in at most eight words.
    pub fn headline(&self) -> String {
        match self.culprits.as_slice() {
            [] => format!("{}: {}", self.about, self.cause),
            labels => format!("{}: {}", labels.join(", "), self.cause),
        }
    }

    /// Whether its text needs a headline above it.
    pub fn is_long(&self) -> bool {
        self.text.len() > SHORT
    }

    /// The finding for a terminal: a line, or its headline and its text.
    pub fn lines(&self) -> String {
        if self.is_long() {
            format!("  {}\n    {self}\n", self.headline())
        } else {
            format!("  {self}\n")
        }
    }

    /// Labels of its culprits, as the robot's tables and signals have them.
    pub fn labels(&self) -> Vec<String> {
        match self.about {
            About::Motor(label) | About::Part(label) => vec![label.to_owned()],
            About::Bus(number) | About::Line(number) => vec![number.to_string()],
            _ => self.culprits.iter().map(|label| (*label).to_owned()).collect(),
        }
    }

    /// Whether it is the same after every run of this robot: what no sensor of it knows.
    pub fn is_standing(&self) -> bool {
        STANDING.contains(&self.kind)
    }

    /// Full names of the signals that show it: label and name, or a name of the robot's own.
    pub fn signals(&self) -> Vec<String> {
        let names = known(self.kind).map_or("", |(_, [_, names, ..])| names).split_whitespace();
        let of = |label: &String| -> Vec<_> {
            names.clone().map(|name| format!("{label} {name}")).collect()
        };
        match self.labels().as_slice() {
            // Of the robot, the others of the table are motors'.
            [] => names.filter(|it| *it == "arm").map(str::to_owned).collect(),
            labels => labels.iter().flat_map(of).collect(),
        }
    }

    /// Its place among those that explain others, what tells it from others, and what to do; empty if nothing is known.
    pub fn remedy(&self) -> (usize, [&'static str; 2]) {
        let remedy = |(place, [.., check, mend]): (_, [_; 4])| (place, [check, mend]);
        let found = known(self.cause).or_else(|| known(self.kind)).map(remedy);
        found.filter(|(_, [check, _])| !check.is_empty()).unwrap_or((usize::MAX, [""; 2]))
    }

    /// The finding as JSON.
    pub fn to_json(&self) -> Value {
        let seconds = |at: Micros| at.get() as f64 / 1e6;
        let [check, mend] = self.remedy().1;
        json!({
            "check": check,
            "do": mend,
            "severity": match self.severity {
                Severity::Problem => "problem",
                Severity::Information => "information",
            },
            "about": self.about.to_string(),
            "kind": self.kind,
            "text": self.text,
            "headline": self.headline(),
            "culprits": self.labels(),
            "signals": self.signals(),
            "at": self.span.map(|(begin, _)| seconds(begin)),
            "until": self.span.map(|(_, end)| seconds(end)),
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
pub fn any(problems: &[Problem]) -> bool {
    problems.iter().any(|problem| problem.severity == Severity::Problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_headline_has_culprit_and_cause_and_a_label_of_three_words_leaves_room() {
        for line in FINDINGS.lines() {
            let words: Vec<_> = line.split('\t').collect();
            let [kind, cause, ..] = words[..] else { panic!("{line}") };
            assert_eq!(words.len(), 5, "{line}");
            let problem = Problem::new(About::Motor("wheel front left"), kind, String::new());
            let headline = problem.headline();
            assert_eq!(headline, format!("wheel front left: {cause}"));
            // Those that are causes alone are of the robot.
            let is_short = kind == cause || headline.split_whitespace().count() <= 8;
            assert!(is_short, "{headline}");
        }
        let unknown = Problem::new(About::Bus(2), "no-such-kind", String::new());
        assert_eq!(unknown.headline(), "bus 2: no-such-kind");
    }

    #[test]
    fn a_problem_is_told_with_its_time_its_culprits_and_their_signals() {
        let problem = Problem::new(About::Robot, "base", "text".to_owned()).because("swapped");
        let problem = problem.in_time(Micros::from_millis(1500), Micros::from_millis(100));
        let swapped = Problem { culprits: vec!["a left", "a right"], ..problem.clone() };
        let json = swapped.to_json();
        assert_eq!(json["headline"], "a left, a right: swapped");
        assert_eq!((&json["at"], &json["until"]), (&json!(1.5), &json!(1.6)));
        assert_eq!(json["culprits"], json!(["a left", "a right"]));
        let signals = ["target", "measured", "effort"];
        let of = |label: &str| signals.map(|name| format!("{label} {name}"));
        assert_eq!(json["signals"], json!([of("a left"), of("a right")].concat()));
        assert_eq!(problem.to_json()["signals"], json!([]));
        let lost = Problem::new(About::Bus(3), "bus-off", String::new()).to_json();
        assert_eq!((&lost["signals"], &lost["at"]), (&json!(["3 bus_offs"]), &Value::Null));
    }
}
